"""The picture in docs/architecture.md shows the rooms and imports that there are."""

from __future__ import annotations

from pathlib import Path

from springline.runner.report.architecture import PICTURE, drawn, level, reduced, rooms, shown

ROOT = Path(__file__).parents[3]


def test_the_page_has_the_picture_that_the_command_draws() -> None:
    said = f"<!-- shown: {shown(ROOT)} -->".encode()
    assert said in (ROOT / PICTURE).read_bytes(), "stale: run `make docs-pictures`"
    assert said in drawn(ROOT)
    assert drawn(ROOT) == drawn(ROOT)
    assert f"]({PICTURE.relative_to('docs').as_posix()})" in (ROOT / "docs/architecture.md").read_text("utf-8")


def test_every_room_is_in_the_picture_and_in_the_table() -> None:
    doors = {path.parent for package in ("model", "codegen", "runner") for path in (ROOT / package).rglob("*.pyi")}
    named = {".".join(door.relative_to(ROOT).parts) for door in doors}
    assert set(rooms(ROOT)) == {name for name in named if "." in name}
    table = (ROOT / "docs/architecture.md").read_text("utf-8")
    for room in rooms(ROOT):
        above = "/".join(room.split(".")[:2])
        assert f"`{above}/`" in table


def write(root: Path, **files: str) -> None:
    for name, content in files.items():
        path = root.joinpath("model", *name.split("__")).with_suffix(".py")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content, encoding="utf-8")
        if path.parent.name != "model":
            path.with_name("__init__.pyi").touch()


def test_arrows_are_the_imports_and_those_that_follow_are_left_out(tmp_path: Path) -> None:
    """Through a package's own file too, and wherever in a file the import stands."""
    write(
        tmp_path,
        a__x="import casadi\n",
        b__x="from springline.model.a import x\n",
        c__x="def f():\n    from springline.model.middle import y\nfrom springline.model.a import x\n",
        middle="from springline.model.b.x import z\n",
    )
    graph = rooms(tmp_path)
    assert graph == {"model.a": set(), "model.b": {"model.a"}, "model.c": {"model.a", "model.b"}}
    assert reduced(graph) == {"model.a": set(), "model.b": {"model.a"}, "model.c": {"model.b"}}
    assert [level(graph, room) for room in graph] == [0, 1, 2]
