"""How Sphinx makes the site of the pages that build.py has laid out. Nothing is fetched, here or by the browser."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

project = "springline"
html_title = "springline"
extensions = ["myst_parser", "mathml"]
root_doc = "index"
exclude_patterns = ["examples/**/Makefile"]

# The pages are read on the code host too, so they keep to Markdown as it is there: no syntax of MyST's own but the
# blocks of ```math, and anchors by the host's rule.
myst_disable_syntax = ["myst_line_comment", "myst_block_break", "myst_target", "myst_role", "substitution"]
myst_fence_as_directive = ["math"]
myst_heading_anchors = 6
highlight_language = "text"
smartquotes = False
add_module_names = False

html_theme = "furo"
html_static_path = ["site.css"]
html_css_files = ["site.css"]
html_theme_options = {"top_of_page_buttons": []}
html_copy_source = False
html_show_copyright = False
html_show_sphinx = False
# Sphinx shows extracts of the pages found by fetching them, which a browser refuses for file://.
html_show_search_summary = False
pygments_style = "default"
