"""The picture in docs/architecture.md: rooms, what each is for, and who imports whom, read from the sources.

A room is a folder with a door (``__init__.pyi``). Within a package its rooms stand from left to right as they build on
each other; an arrow points to what is imported, and one that follows from others is left out. What a package's own
files import counts for the rooms that import them. ``make docs-pictures`` draws it anew.
"""

from __future__ import annotations

import ast
import itertools
import sys
import textwrap
from collections.abc import Mapping, Sized
from hashlib import sha256
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

from springline.codegen.files import canonical_json
from springline.runner.report.docs_picture import command, stamped
from springline.runner.report.style import house_style

ROOT = Path(__file__).parents[2]
PICTURE = Path("docs/images/architecture.svg")
PACKAGES = ("benchmarks", "runner", "codegen", "model")
"""From the top of the picture down; imports point downwards."""

Graph = Mapping[str, frozenset[str]]

_FILLS = {"benchmarks": "#ececec", "runner": "#d5e6f5", "codegen": "#fbe0cd", "model": "#d6eedf"}
_INK, _QUIET = "#1c2024", "#5b646c"
_WIDTH, _HEIGHT, _STEP, _ROW = 1.62, 0.95, 1.92, 1.15  # of a room, and from one to the next, inches
_ACROSS = 5  # rooms side by side


def modules(root: Path) -> dict[str, frozenset[str]]:
    """Every module of the packages below `root` -> the modules and folders of springline that it imports."""
    found: dict[str, frozenset[str]] = {}
    for package in PACKAGES:
        for path in sorted((root / package).rglob("*.py")):
            if path.name == "__init__.py":
                continue
            module = ".".join(path.relative_to(root).with_suffix("").parts)
            nodes = [node for node in ast.walk(ast.parse(path.read_text("utf-8"))) if isinstance(node, ast.ImportFrom)]
            found[module] = frozenset(
                _imported(root, (node.module or "").removeprefix("springline."), alias.name)
                for node in nodes
                if (node.module or "").startswith("springline.")
                for alias in node.names
            )
    return found


def _imported(root: Path, module: str, name: str) -> str:
    inner = root.joinpath(*module.split("."), name)
    return f"{module}.{name}" if inner.is_dir() or inner.with_suffix(".py").is_file() else module


def room_of(root: Path, module: str) -> str:
    """The innermost folder with a door that a module is in or is; the module itself where it is a package's own."""
    parts = module.split(".")
    for k in range(len(parts), 1, -1):
        if root.joinpath(*parts[:k], "__init__.pyi").is_file():
            return ".".join(parts[:k])
    return module


def rooms(root: Path = ROOT) -> Graph:
    """Room -> the rooms of the same package that it imports, itself or through the package's own files."""
    direct: dict[str, set[str]] = {}
    for module, imported in modules(root).items():
        room = room_of(root, module)
        direct.setdefault(room, set()).update(room_of(root, other) for other in imported)
    doors = {room for room in direct if root.joinpath(*room.split("."), "__init__.pyi").is_file() and "." in room}

    def reached(room: str, seen: set[str]) -> set[str]:
        package = room.partition(".")[0]
        others = {other for other in direct.get(room, ()) if other.startswith(f"{package}.")} - seen
        seen |= others
        return {door for other in others for door in ({other} if other in doors else reached(other, seen))}

    return {room: frozenset(reached(room, {room}) - {room}) for room in sorted(doors)}


def reduced(graph: Graph) -> Graph:
    """The graph without the arrows that follow from others."""

    def below(node: str) -> frozenset[str]:
        return graph[node].union(*(below(other) for other in graph[node]))

    return {
        node: frozenset(other for other in others if not any(other in below(between) for between in others))
        for node, others in graph.items()
    }


def level(graph: Graph, node: str) -> int:
    """Length of the longest way from a room down to one that imports none."""
    return max((level(graph, other) + 1 for other in graph[node]), default=0)


def idea(root: Path, module: str) -> str:
    """The first line of a folder's docstring."""
    door = root.joinpath(*module.split("."), "__init__.py")
    return (ast.get_docstring(ast.parse(door.read_text("utf-8"))) or "").splitlines()[0].replace("`", "")


def own_files(root: Path, package: str) -> list[str]:
    """Python files of a package that are in none of its rooms."""
    return sorted(path.name for path in (root / package).glob("*.py") if path.name != "__init__.py")


def picture(root: Path = ROOT) -> Figure:
    """Packages from top to bottom, rooms from left to right."""
    graph = rooms(root)
    with house_style():
        figure = Figure(figsize=(10.0, 9.2))
        axes = figure.subplots()
        axes.axis("off")
        top = 0.0
        middles = []
        for package in PACKAGES:
            height = _package(axes, root, package, graph, top)
            middles.append((top, top - height))
            top -= height + 0.34
        pairs = {
            (module.split(".")[0], other.split(".")[0]) for module, all_ in modules(root).items() for other in all_
        }
        for pair, ((_, bottom), (below, _)) in zip(
            itertools.pairwise(PACKAGES), itertools.pairwise(middles), strict=True
        ):
            if pair in pairs:
                _arrow(axes, (0.55, bottom), (0.55, below), 2.0, "imports" if bottom == middles[0][1] else "")
        axes.set(xlim=(-0.02, 9.82), ylim=(top + 0.24, 0.1), aspect="equal")
        figure.set_size_inches(10.0, 0.1 - (top + 0.24))
        return figure


def _package(axes: Axes, root: Path, package: str, graph: Graph, top: float) -> float:
    mine = {room: others for room, others in graph.items() if room.startswith(f"{package}.")}
    columns: dict[int, list[str]] = {}
    for room in mine:
        columns.setdefault(level(graph, room), []).append(room)
    rows = [
        max(len(columns[k]) for k in range(first, min(first + _ACROSS, len(columns)))) for first in _firsts(columns)
    ]
    height = 0.6 + _ROW * sum(rows)
    files = textwrap.wrap(f"own files: {', '.join(own_files(root, package))}", 150)
    height += 0.17 * (len(files) - 1)
    axes.add_patch(
        FancyBboxPatch(
            (0, top - height),
            9.8,
            height,
            boxstyle="round,pad=0,rounding_size=0.08",
            facecolor=_FILLS[package],
            edgecolor="none",
            alpha=0.55,
        )
    )
    axes.text(0.12, top - 0.2, f"{package}/", fontsize=12, fontweight="bold", va="center", color=_INK)
    axes.text(1.55, top - 0.2, idea(root, package), fontsize=9, va="center", color=_INK)
    axes.text(0.12, top - height + 0.08, "\n".join(files), fontsize=8, va="bottom", color=_QUIET, linespacing=1.25)
    places = {}
    for k, column in columns.items():
        band, across = divmod(k, _ACROSS)
        across = _ACROSS - 1 - across if band % 2 else across
        for row, room in enumerate(column):
            shift = sum(rows[:band]) + (rows[band] - len(column)) / 2
            places[room] = (0.22 + _STEP * across, top - 0.38 - _HEIGHT / 2 - _ROW * (row + shift))
            _room(axes, places[room], room.removeprefix(f"{package}.").replace(".", "/") + "/", idea(root, room))
    for room, others in reduced(graph).items():
        for other in sorted(others) if room in places else ():
            (x, y), (end, at) = places[room], places[other]
            band = level(graph, room) // _ACROSS
            if band != level(graph, other) // _ACROSS:
                _arrow(axes, (x + _WIDTH / 2, y + _HEIGHT / 2), (end + _WIDTH / 2, at - _HEIGHT / 2), 1.0)
            elif band % 2:
                _arrow(axes, (x + _WIDTH, y), (end, at), 1.0)
            elif x - end > 1.5 * _STEP:  # around what stands between them
                _arrow(axes, (x + _WIDTH / 2, y - _HEIGHT / 2), (end + _WIDTH, at), 1.0, way="angle,angleA=90,angleB=0")
            else:
                _arrow(axes, (x, y), (end + _WIDTH, at), 1.0)
    return height


def _firsts(columns: Sized) -> range:
    """First levels of the bands in which levels run to the right and to the left by turns."""
    return range(0, len(columns), _ACROSS)


def _room(axes: Axes, place: tuple[float, float], name: str, text: str) -> None:
    x, y = place
    axes.add_patch(
        FancyBboxPatch(
            (x, y - _HEIGHT / 2),
            _WIDTH,
            _HEIGHT,
            boxstyle="round,pad=0,rounding_size=0.06",
            facecolor="white",
            edgecolor=_INK,
            linewidth=0.8,
            zorder=3,
        )
    )
    axes.text(x + 0.07, y + _HEIGHT / 2 - 0.13, name, fontsize=9.5, fontweight="bold", va="center", zorder=4)
    lines = textwrap.wrap(text, 25)
    axes.text(x + 0.07, y + _HEIGHT / 2 - 0.25, "\n".join(lines), fontsize=7.5, va="top", color=_QUIET, zorder=4)


def _arrow(
    axes: Axes, begin: tuple[float, float], end: tuple[float, float], width: float, text: str = "", way: str = "arc3"
) -> None:
    axes.add_patch(
        FancyArrowPatch(
            begin,
            end,
            arrowstyle="-|>",
            mutation_scale=9 + 3 * width,
            linewidth=width,
            color=_INK,
            shrinkA=0,
            shrinkB=0,
            connectionstyle=way,
            zorder=2,
        )
    )
    if text:
        axes.text(begin[0] + 0.12, (begin[1] + end[1]) / 2, text, fontsize=9, va="center", color=_INK)


def shown(root: Path = ROOT) -> str:
    """Hash of what the picture shows, whatever draws it."""
    graph = rooms(root)
    arrows = {room: sorted(others) for room, others in reduced(graph).items()}
    texts = {module: idea(root, module) for module in (*PACKAGES, *graph)}
    between = sorted({(a.split(".")[0], b.split(".")[0]) for a, all_ in modules(root).items() for b in all_})
    files = {package: own_files(root, package) for package in PACKAGES}
    return sha256(canonical_json([arrows, texts, [list(pair) for pair in between], files])).hexdigest()


def drawn(root: Path = ROOT) -> bytes:
    """The picture as SVG, with the hash of what it shows."""
    return stamped(PICTURE, picture(root), shown(root))


if __name__ == "__main__":
    sys.exit(command(PICTURE, drawn, __doc__))
