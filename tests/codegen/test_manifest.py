"""Folders of generated files: nothing foreign is lost, nothing is half-written, staleness is seen."""

import json
import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from springline.codegen.manifest import (
    Changes,
    FolderConflict,
    Stale,
    canonical_json,
    check_tree,
    summary,
    write_tree,
)

OLD = {"include/a.h": b"int a;\n", "src/a.c": b"int a = 1;\n", "src/gone/b.c": b"int b;\n"}
NEW = {"include/a.h": b"int a;\n", "src/a.c": b"int a = 2;\n", "README.md": b"# a\n"}
OLD_INFO = {"hash": "1", "parameters": [{"name": "m3", "value": 40.0}, {"name": "k1", "value": 30.0}]}
NEW_INFO = {"hash": "2", "parameters": [{"name": "m3", "value": 48.0}, {"name": "k1", "value": 30.0}]}


def contents(folder: Path) -> dict[str, bytes]:
    """Every file below `folder`, hidden ones too, and empty folders as entries that end in a slash."""
    found = {}
    for path in folder.rglob("*"):
        name = path.relative_to(folder).as_posix()
        if path.is_symlink():
            found[name] = b"-> " + os.fsencode(path.readlink())
        elif path.is_dir():
            if not any(path.iterdir()):
                found[name + "/"] = b""
        else:
            found[name] = path.read_bytes()
    return found


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder that holds OLD, as written."""
    place = tmp_path / "deep" / "generated"
    write_tree(place, OLD, OLD_INFO)
    return place


# --- whose folder it is ----------------------------------------------------------------------------------


@pytest.mark.parametrize(("there", "asked"), [({}, {"kind": "b"}), ({"kind": "a"}, {}), ({"kind": "a"}, {"kind": "b"})])
def test_a_folder_of_another_kind_is_left_alone(tmp_path: Path, there: dict[str, str], asked: dict[str, str]) -> None:
    write_tree(tmp_path, OLD, there)
    before = contents(tmp_path)
    for force in (False, True):
        with pytest.raises(FolderConflict, match=r"manifest\.json: lists what another command wrote"):
            write_tree(tmp_path, NEW, asked, force=force)
    with pytest.raises(FolderConflict, match=r"manifest\.json: lists what another command wrote"):
        check_tree(tmp_path, NEW, asked)
    assert contents(tmp_path) == before
    write_tree(tmp_path, NEW, there)
    assert contents(tmp_path).keys() == {*NEW, "manifest.json"}


# --- writing ---------------------------------------------------------------------------------------------


def test_new_folder(tmp_path: Path) -> None:
    place = tmp_path / "not" / "yet" / "there"
    changes = write_tree(place, OLD, OLD_INFO)
    assert changes == Changes(written=(*OLD, "manifest.json"), removed=())
    assert contents(place).keys() == {*OLD, "manifest.json"}
    assert {path: contents(place)[path] for path in OLD} == OLD
    manifest = json.loads((place / "manifest.json").read_bytes())
    assert manifest["parameters"] == OLD_INFO["parameters"]
    assert [entry["path"] for entry in manifest["files"]] == sorted(OLD)
    # printf 'int a;\n' | sha256sum
    assert manifest["files"][0] == {
        "path": "include/a.h",
        "sha256": "386593f1475dc210d45a5f3d4b6bb11c065fc6fe2e08ebdd00ab4cf3a0848744",
    }


def test_update_changes_only_what_must_change(folder: Path) -> None:
    untouched = (folder / "include/a.h").stat()
    changes = write_tree(folder, NEW, NEW_INFO)
    assert changes == Changes(written=("README.md", "src/a.c", "manifest.json"), removed=("src/gone/b.c",))
    assert contents(folder).keys() == {*NEW, "manifest.json"}, "the emptied folder src/gone goes too"
    assert {path: contents(folder)[path] for path in NEW} == NEW
    assert (folder / "include/a.h").stat() == untouched


def test_second_write_does_nothing(folder: Path) -> None:
    before = (folder / "manifest.json").stat()
    assert write_tree(folder, OLD, OLD_INFO) == Changes((), ())
    assert (folder / "manifest.json").stat() == before


def test_order_of_the_arguments_does_not_matter(folder: Path, tmp_path: Path) -> None:
    other = tmp_path / "other"
    write_tree(other, dict(reversed(OLD.items())), dict(reversed(OLD_INFO.items())))
    assert contents(other) == contents(folder)


def test_files_of_others_stay(folder: Path) -> None:
    (folder / "src/gone/notes.txt").write_text("mine")
    write_tree(folder, NEW, NEW_INFO)
    assert (folder / "src/gone/notes.txt").read_text() == "mine"
    assert not (folder / "src/gone/b.c").exists()


def test_through_a_link_to_the_folder(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(folder)
    write_tree(tmp_path / "link", NEW, NEW_INFO)
    assert (tmp_path / "link").is_symlink()
    assert (folder / "src/a.c").read_bytes() == NEW["src/a.c"]


def test_into_the_current_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_tree(Path(), NEW, NEW_INFO)
    assert contents(tmp_path).keys() == {*NEW, "manifest.json"}


# --- conflicts -------------------------------------------------------------------------------------------


def edit_replaced(folder: Path) -> str:
    (folder / "src/a.c").write_text("int a = 3;\n")
    return "src/a.c: edited since springline wrote it"


def edit_removed(folder: Path) -> str:
    (folder / "src/gone/b.c").write_text("precious\n")
    return "src/gone/b.c: edited since springline wrote it"


def foreign_file(folder: Path) -> str:
    (folder / "README.md").write_text("mine\n")
    return "README.md: not written by springline"


def foreign_manifest(folder: Path) -> str:
    (folder / "manifest.json").write_text('{"name": "a web page", "icons": []}')
    return "manifest.json: not written by springline"


def garbled_manifest(folder: Path) -> str:
    (folder / "manifest.json").write_bytes(b"\xff{")
    return "manifest.json: not written by springline"


@pytest.mark.parametrize("disturb", [edit_replaced, edit_removed, foreign_file, foreign_manifest, garbled_manifest])
def test_conflict_is_refused_and_force_overrides(disturb: Callable[[Path], str], folder: Path) -> None:
    expected = disturb(folder)
    before = contents(folder)
    with pytest.raises(FolderConflict) as caught:
        write_tree(folder, NEW, NEW_INFO)
    assert contents(folder) == before
    assert f"  {expected}\n" in str(caught.value)
    assert str(folder) in str(caught.value)
    assert "--force" in str(caught.value)
    assert expected.split(":")[0] in caught.value.paths
    write_tree(folder, NEW, NEW_INFO, force=True)
    assert {path: contents(folder)[path] for path in NEW} == NEW
    assert [entry for entry in check_tree(folder, NEW, NEW_INFO) if entry.kind != "extra"] == []


def test_all_conflicts_are_named_at_once(folder: Path) -> None:
    edit_replaced(folder)
    edit_removed(folder)
    foreign_file(folder)
    with pytest.raises(FolderConflict) as caught:
        write_tree(folder, NEW, NEW_INFO)
    assert caught.value.paths == ("README.md", "src/a.c", "src/gone/b.c")


def test_what_is_right_already_is_no_conflict(folder: Path) -> None:
    """So a write that was killed half-way is completed by the next one."""
    (folder / "src/a.c").write_bytes(NEW["src/a.c"])
    (folder / "README.md").write_bytes(NEW["README.md"])
    (folder / "src/gone/b.c").unlink()
    write_tree(folder, NEW, NEW_INFO)
    assert check_tree(folder, NEW, NEW_INFO) == []


def folder_for_a_file(folder: Path) -> str:
    (folder / "README.md").mkdir()
    return "README.md"


def file_for_a_folder(folder: Path) -> str:
    (folder / "include/a.h").unlink()
    (folder / "include").rmdir()
    (folder / "include").write_text("mine")
    return "include"


def link_for_a_file(folder: Path) -> str:
    (folder / "src/a.c").rename(folder.parent / "a.c")
    (folder / "src/a.c").symlink_to(folder.parent / "a.c")
    return "src/a.c"


def link_for_a_folder(folder: Path) -> str:
    (folder / "src").rename(folder.parent / "src")
    (folder / "src").symlink_to(folder.parent / "src")
    return "src"


def dangling_link(folder: Path) -> str:
    (folder / "README.md").symlink_to("nowhere")
    return "README.md"


@pytest.mark.parametrize(
    "disturb", [folder_for_a_file, file_for_a_folder, link_for_a_file, link_for_a_folder, dangling_link]
)
@pytest.mark.parametrize("force", [False, True])
def test_folders_and_links_are_never_replaced(disturb: Callable[[Path], str], force: bool, folder: Path) -> None:
    path = disturb(folder)
    before = contents(folder.parent)
    with pytest.raises(FolderConflict, match=f"\n  {path}: is a link, or a folder") as caught:
        write_tree(folder, NEW, NEW_INFO, force=force)
    assert "--force" not in str(caught.value)
    assert contents(folder.parent) == before


def test_a_file_where_the_folder_should_be(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("mine")
    with pytest.raises(FolderConflict):
        write_tree(tmp_path / "out", NEW, NEW_INFO, force=True)
    assert (tmp_path / "out").read_text() == "mine"


@pytest.mark.parametrize("path", ["../precious", "/precious", "src/../../precious"])
@pytest.mark.parametrize("force", [False, True])
def test_a_manifest_cannot_make_us_remove_files_outside(path: str, force: bool, folder: Path) -> None:
    precious = folder.parent / "precious"
    precious.write_bytes(OLD["src/a.c"])
    manifest = json.loads((folder / "manifest.json").read_bytes())
    manifest["files"][1]["path"] = path
    (folder / "manifest.json").write_text(json.dumps(manifest))
    if force:
        write_tree(folder, NEW, NEW_INFO, force=True)
    else:
        with pytest.raises(FolderConflict, match=r"manifest\.json: not written by springline"):
            write_tree(folder, NEW, NEW_INFO)
    assert precious.read_bytes() == OLD["src/a.c"]


@pytest.mark.parametrize("path", ["../a", "/a", "a/../b", "", ".", "./a", "a//b", "manifest.json"])
def test_impossible_paths(path: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="is no path for a generated file"):
        write_tree(tmp_path / "out", {path: b""}, {})
    assert not (tmp_path / "out").exists()


def test_a_file_cannot_be_a_folder_too(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="'a' cannot be a file and the folder of 'a/b'"):
        write_tree(tmp_path / "out", {"a": b"", "a/b": b""}, {})


# --- all or nothing --------------------------------------------------------------------------------------


@pytest.mark.parametrize("fresh", [False, True])
@pytest.mark.parametrize("error", [OSError("disk full"), KeyboardInterrupt()])
def test_failure_at_any_move_restores_everything(
    fresh: bool, error: BaseException, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = tmp_path / "deep" / "out"
    if not fresh:
        write_tree(place, OLD, OLD_INFO)
    before = contents(tmp_path)
    real = os.replace
    calls = 0
    fail_at = 0

    def replace(source: Path, target: Path) -> None:
        nonlocal calls
        calls += 1
        if calls == fail_at:
            raise error
        real(source, target)

    monkeypatch.setattr(os, "replace", replace)
    failures = 0
    while True:
        calls, fail_at = 0, failures + 1
        try:
            write_tree(place, NEW, NEW_INFO)
        except type(error):
            failures += 1
            assert contents(tmp_path) == before
        else:
            break
    # new: README.md, include/a.h, src/a.c, manifest. Update: two files and the manifest in; two and one out.
    assert failures == (4 if fresh else 6)
    assert check_tree(place, NEW, NEW_INFO) == []


def test_failure_while_preparing_touches_nothing(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = contents(folder.parent)

    def refuse(_: int) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(os, "fsync", refuse)
    with pytest.raises(OSError, match="disk full"):
        write_tree(folder, NEW, NEW_INFO)
    assert contents(folder.parent) == before


# --- checking --------------------------------------------------------------------------------------------


def test_up_to_date(folder: Path) -> None:
    assert check_tree(folder, OLD, OLD_INFO) == []
    assert summary(folder, []) == f"{folder} is up to date"


def test_every_kind_of_staleness(folder: Path) -> None:
    (folder / "include/a.h").write_text("int edited;\n")
    before = contents(folder)
    stale = check_tree(folder, NEW, NEW_INFO)
    assert stale == [
        Stale("README.md", "missing", "is not there"),
        Stale("include/a.h", "edited", "edited since it was written"),
        Stale("manifest.json", "changed", 'hash "1" -> "2"; parameters.m3.value 40.0 -> 48.0'),
        Stale("src/a.c", "changed", "1 of 1 lines would change"),
        Stale("src/gone/b.c", "extra", "would no longer be written"),
    ]
    text = summary(folder, stale)
    assert text.splitlines()[0] == f"{folder} is stale:"
    assert "  changed manifest.json: hash" in text
    assert contents(folder) == before, "a check writes nothing"


def test_check_of_a_missing_folder(tmp_path: Path) -> None:
    stale = check_tree(tmp_path / "none", NEW, NEW_INFO)
    assert {entry.path: entry.kind for entry in stale} == dict.fromkeys([*NEW, "manifest.json"], "missing")


def test_check_sees_a_foreign_file_in_the_way(folder: Path) -> None:
    foreign_file(folder)
    assert Stale("README.md", "edited", "not written by springline") in check_tree(folder, NEW, NEW_INFO)


def test_check_sees_a_reformatted_manifest(folder: Path) -> None:
    manifest = folder / "manifest.json"
    manifest.write_text(json.dumps(json.loads(manifest.read_bytes())))
    assert check_tree(folder, OLD, OLD_INFO) == [Stale("manifest.json", "changed", "is written in another form")]


def test_long_differences_are_cut(folder: Path) -> None:
    info = OLD_INFO | {f"key{i}": i for i in range(9)}
    (entry,) = check_tree(folder, OLD, info)
    assert entry.detail == "key0 is new; key1 is new; key2 is new; key3 is new; key4 is new; and 4 more"


# --- canonical JSON --------------------------------------------------------------------------------------


def test_canonical_json() -> None:
    value = {"b": (1, 2.5), "a": {"ϵ": math.inf, "low": -math.inf}, "n": None, "x": np.float64(0.1)}
    assert canonical_json(value).decode() == (
        '{\n  "a": {\n    "low": "-inf",\n    "ϵ": "inf"\n  },\n'
        '  "b": [\n    1,\n    2.5\n  ],\n  "n": null,\n  "x": 0.1\n}\n'
    )


@pytest.mark.parametrize(("value", "error"), [(math.nan, ValueError), ({1, 2}, TypeError), (b"", TypeError)])
def test_canonical_json_refuses(value: Any, error: type[Exception]) -> None:
    with pytest.raises(error):
        canonical_json({"value": value})


@given(st.dictionaries(st.text(), st.floats(allow_nan=False, allow_infinity=False) | st.integers() | st.text()))
def test_canonical_json_reads_back(value: dict[str, Any]) -> None:
    assert json.loads(canonical_json(value)) == value
