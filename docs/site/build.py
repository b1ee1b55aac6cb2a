"""The site of the documentation.

    python docs/site/build.py [OUT]

docs/*.md are the pages, as they are read on the code host; docs/index.md lists them, and that list is the navigation.
What they link to outside docs/ becomes a page, too, and the reference is printed from the code. Everything is laid out
in OUT-pages and set by Sphinx, for which a warning is an error: a link or an anchor that leads nowhere among them. The
same checkout gives the same bytes.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

import reference

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
LANGUAGES = {
    ".c": "c",
    ".cpp": "cpp",
    ".h": "c",
    ".json": "json",
    ".md": "markdown",
    ".py": "python",
    ".toml": "toml",
    ".txt": "cmake",
    "Makefile": "make",
}
"""How files that are linked to are highlighted, by their ending."""

LINK = re.compile(r"(?<!`)(!?\[(?:[^\[\]]|\[[^\[\]]*\])*\]\()([^)#\s]+)((?:#[^)]*)?\))")
FENCE = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
INTERNAL = re.compile(r"https?:|mailto:")


class Pages:
    """The pages laid out in a folder; a file that is linked to becomes one."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._waiting: list[Path] = []
        self._known: set[Path] = set()

    def add(self, file: Path) -> str:
        """The name of a file's page, which will be there, as a path below the folder."""
        path = file.resolve()
        if path.is_dir():
            path = next((path / name for name in ("README.md", "Makefile") if (path / name).is_file()), path)
        if path not in self._known:
            self._known.add(path)
            self._waiting.append(path)
        return page_name(path)

    def lay_out(self) -> None:
        """Write all pages that were added, and those that they lead to."""
        while self._waiting:
            path = self._waiting.pop()
            if path.is_relative_to(ROOT / "docs" / "images"):
                put(self.folder / page_name(path), path.read_bytes())
            elif path.suffix == ".md":
                put(self.folder / page_name(path), self._linked(path).encode())
            elif path.is_dir():
                put(self.folder / page_name(path), self._listing(path).encode())
            else:
                put(self.folder / page_name(path), shown(path).encode())

    def _linked(self, path: Path) -> str:
        """A page's text, its links to files leading to their pages."""
        here = PurePosixPath(page_name(path)).parent

        def link(match: re.Match[str]) -> str:
            before, target, after = match.groups()
            if INTERNAL.match(target):
                return match[0]
            file = path.parent / target
            if not file.exists():
                raise SystemExit(f"{path.relative_to(ROOT)}: there is no {target}")
            return f"{before}{os.path.relpath(self.add(file), here)}{after}"

        text, parts, at = path.read_text(encoding="utf-8"), [], 0
        for block in FENCE.finditer(text):
            parts += [LINK.sub(link, text[at : block.start()]), block[0]]
            at = block.end()
        return "".join([*parts, LINK.sub(link, text[at:])])

    def _listing(self, folder: Path) -> str:
        """A page for a folder that has none of its own: its files."""
        names = sorted(item.name for item in folder.iterdir() if item.is_file())
        here = PurePosixPath(page_name(folder)).parent
        rows = [f"- [{name}]({os.path.relpath(self.add(folder / name), here)})" for name in names]
        return f"# {folder.relative_to(ROOT)}/\n\n" + "\n".join(rows) + "\n"


def page_name(path: Path) -> str:
    """Where the page of a file lies: those of docs/ on top, all others as in the checkout."""
    if path.is_dir():
        return f"{path.relative_to(ROOT)}/index.md"
    name = path.relative_to(ROOT / "docs" if path.is_relative_to(ROOT / "docs") else ROOT).as_posix()
    if path.suffix in {".md", ".png", ".svg"}:
        return name
    return f"{name}.md"


def shown(path: Path) -> str:
    """A page that shows a file; a notebook is one already, in pieces."""
    if path.suffix == ".ipynb":
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        texts = [(cell["cell_type"], "".join(cell["source"])) for cell in cells]
        pieces = [text if kind == "markdown" else f"```python\n{text}\n```" for kind, text in texts]
        return "\n\n".join(pieces) + "\n"
    language = LANGUAGES.get(path.suffix or path.name, "text")
    return f"# {path.relative_to(ROOT)}\n\n````{language}\n{path.read_text(encoding='utf-8').rstrip()}\n````\n"


def put(path: Path, content: bytes) -> None:
    """Write a file and the folders that it needs."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)


def navigation(index: str) -> Iterator[str]:
    """Hidden tables of contents: each list of docs/index.md under its heading."""
    for part in re.split(r"^## ", index, flags=re.MULTILINE)[1:]:
        title, _, body = part.partition("\n")
        pages = re.findall(r"^- \[([^\]]+)\]\(([^)#]+)\.md\)", body, re.MULTILINE)
        if pages:
            entries = "\n".join(f"{name} <{page}>" for name, page in pages)
            yield f"\n```{{toctree}}\n:hidden:\n:caption: {title}\n\n{entries}\n```\n"


def orphan(pages: Path, listed: set[str]) -> None:
    """Tell Sphinx which pages are in no table of contents, and that this is meant."""
    for page in pages.rglob("*.md"):
        name = page.relative_to(pages).with_suffix("").as_posix()
        if name not in listed:
            page.write_text(f"---\norphan: true\n---\n{page.read_text(encoding='utf-8')}", encoding="utf-8")


def main() -> int:
    """Command line; the exit code is Sphinx's."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("out", nargs="?", type=Path, default=ROOT / "build" / "docs", help="folder for the site")
    out = parser.parse_args().out.resolve()
    pages = out.parent / f"{out.name}-pages"
    for folder in (pages, out):
        shutil.rmtree(folder, ignore_errors=True)
    for name, text in reference.pages().items():
        put(pages / "reference" / name, text.encode())
    laid = Pages(pages)
    for path in sorted((ROOT / "docs").glob("*.md")):
        laid.add(path)
    laid.lay_out()
    index = pages / "index.md"
    listed = "".join([*navigation(index.read_text(encoding="utf-8")), *reference.contents()])
    index.write_text(index.read_text(encoding="utf-8") + listed, encoding="utf-8")
    orphan(pages, {"index", *re.findall(r"^.* <(.+)>$", listed, re.MULTILINE), *reference.nested()})
    trees = out.parent / f"{out.name}-trees"
    shutil.rmtree(trees, ignore_errors=True)
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-c", HERE, "-d", trees, pages, out]
    code = subprocess.run(command, check=False).returncode
    if not code:
        sys.stdout.write(f"{out / 'index.html'}\n")
    return code


if __name__ == "__main__":
    sys.exit(main())
