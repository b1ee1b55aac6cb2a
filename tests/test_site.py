"""The documentation as a site: nothing leads nowhere, nothing is fetched, and everything public is in its reference.

The pages themselves are read on the code host, too, where links and anchors have to lead somewhere as well.
"""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

ROOT = Path(__file__).parent.parent
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "codegen/export/README.md")),
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "examples").rglob("README.md")),
]
FETCHED = {"img": "src", "link": "href", "script": "src", "source": "src", "iframe": "src", "object": "data"}
"""What a browser fetches by itself: element -> attribute."""


def without_code(page: Path) -> str:
    return re.sub(r"^```.*?^```$|`[^`\n]*`", "", page.read_text("utf-8"), flags=re.MULTILINE | re.DOTALL)


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, by the code host's rule."""
    text = re.sub(r"^```.*?^```$", "", page.read_text("utf-8"), flags=re.MULTILINE | re.DOTALL)
    titles = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere_on_the_code_host(page: Path) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", without_code(page)):
        if target.startswith(("https://", "http://")):
            continue
        name, _, anchor = target.partition("#")
        file = page.parent / name if name else page
        assert file.exists(), target
        assert not anchor or anchor in anchors(file), target


def test_the_first_page_lists_every_page() -> None:
    listed = set(
        re.findall(r"^- \[[^\]]+\]\(([\w-]+\.md)\)", (ROOT / "docs/index.md").read_text("utf-8"), re.MULTILINE)
    )
    assert listed == {page.name for page in (ROOT / "docs").glob("*.md")} - {"index.md"}


class Page(HTMLParser):
    """What a built page has anchors for, leads to, and fetches."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.ids: set[str] = set()
        self.links: list[str] = []
        self.fetched: list[str] = []
        self.feed(path.read_text("utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = {name: value for name, value in attrs if value is not None}
        self.ids |= {found[name] for name in ("id", "name") if name in found}
        if tag == "a" and "href" in found:
            self.links.append(found["href"])
        if FETCHED.get(tag, "") in found:
            self.fetched.append(found[FETCHED[tag]])


def build(out: Path, seed: str) -> None:
    done = subprocess.run(
        [sys.executable, ROOT / "docs/site/build.py", out],
        env={**os.environ, "PYTHONHASHSEED": seed},
        check=False,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site; a warning of its generator is an error."""
    if importlib.util.find_spec("sphinx") is None:
        (pytest.fail if os.environ.get("CI") == "true" else pytest.skip)("pip install '.[docs]' brings Sphinx")
    out = tmp_path_factory.mktemp("site") / "docs"
    build(out, "1")
    return out


@pytest.fixture(scope="module")
def built(site: Path) -> dict[Path, Page]:
    return {path.resolve(): Page(path) for path in site.rglob("*.html")}


@pytest.mark.full
def test_no_link_of_the_site_leads_nowhere(built: dict[Path, Page]) -> None:
    dead = []
    for path, page in built.items():
        for link in [*page.links, *page.fetched]:
            parts = urlsplit(link)
            if parts.scheme:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            known = built[target].ids if target in built else set()
            if not target.exists() or (parts.fragment and unquote(parts.fragment) not in known):
                dead.append(f"{path.name}: {link}")
    assert len(built) > 40
    assert not dead


@pytest.mark.full
def test_the_site_fetches_nothing_from_elsewhere(site: Path, built: dict[Path, Page]) -> None:
    assert not [link for page in built.values() for link in page.fetched if urlsplit(link).netloc]
    for sheet in site.rglob("*.css"):
        assert not re.search(r"(?:url\(|@import)\s*['\"]?(?:https?:)?//", sheet.read_text("utf-8")), sheet.name
    for script in site.rglob("*.js"):
        assert not re.search(r"(?:fetch|import|src\s*=)\s*\(?['\"`](?:https?:)?//", script.read_text("utf-8")), (
            script.name
        )


@pytest.mark.full
def test_every_public_name_is_in_the_reference(built: dict[Path, Page], site: Path) -> None:
    stubs = [
        *ROOT.glob("springline/__init__.pyi"),
        *(p for r in ("model", "codegen", "runner") for p in (ROOT / r).rglob("__init__.pyi")),
    ]
    for stub in stubs:
        door = ".".join(stub.parent.relative_to(ROOT).parts)
        page = site / "reference" / f"python-{door if door == 'springline' else f'springline.{door}'}.html"
        names = re.findall(r" as (\w+)$", stub.read_text("utf-8"), re.MULTILINE)
        missing = [
            name
            for name in names
            if f'<span class="pre">{name}</span></code><a class="headerlink"' not in page.read_text("utf-8")
        ]
        assert not missing, door


@pytest.mark.full
def test_the_table_of_contents_begins_python_with_what_users_call(site: Path) -> None:
    """Rooms stand below the package that they are of, not in one long list."""
    text = (site / "index.html").read_text("utf-8").partition('<div class="sidebar-tree">')[2].partition("</aside>")[0]
    python = text.partition(">Python</span>")[2]
    face, _, rooms = python.partition(">Python, room by room</span>")
    assert re.findall(r'href="([^"]+)"', face) == ["reference/python-springline.html"]
    assert "load_scenario, simulate, analyze, batch" in face
    assert re.findall(r'toctree-l1[^>]*><a[^>]*href="reference/python-springline\.(\w+)\.html"', rooms) == [
        "runner",
        "model",
        "codegen",
    ]
    assert len(re.findall(r'toctree-l2"><a', rooms)) > 15
    page = (site / "reference/python-springline.html").read_text("utf-8")
    assert 'href="python-springline.runner.run.html#result"' in page


@pytest.mark.full
@pytest.mark.parametrize(
    ("page", "shown"),
    [
        ("reference/commands", "springline export fmu3"),
        ("reference/scenario-keys", "coulomb_velocity"),
        ("reference/columns", "steady_state_error_&lt;joint&gt;"),
        ("reference/c-api", "springline_set_parameters"),
        ("paper", 'id="equation-18"'),
    ],
)
def test_the_reference_has_what_the_code_has(site: Path, page: str, shown: str) -> None:
    assert shown in (site / f"{page}.html").read_text("utf-8")


@pytest.mark.full
def test_the_site_has_the_same_bytes_twice(site: Path, tmp_path: Path) -> None:
    build(tmp_path / "docs", "2")
    first, second = (
        {p.relative_to(d): p.read_bytes() for p in d.rglob("*") if p.is_file()} for d in (site, tmp_path / "docs")
    )
    assert first.keys() == second.keys()
    assert not [str(name) for name in first if first[name] != second[name]]
