"""Folders of generated files: nothing foreign is lost, nothing is half-written, staleness is seen."""

import json
import math
import multiprocessing
import os
import re
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from springline.codegen.files import Changes, FolderConflict, Stale, canonical_json, check_tree, summary, write_tree
from springline.codegen.files.atomic import workplace

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


GARBAGE = {
    "not text": b"\xff{",
    "nothing": b"",
    "deep lists": b"[" * 100_000,
    "deep lists, closed": b'{"files": ' + b"[" * 100_000 + b"]" * 100_000 + b"}",
    "deep tables": b'{"files":' * 100_000,
    "a list": b"[]",
    "no table": b"1",
    "no files": b"{}",
    "files that are none": b'{"files": 1}',
    "a file that is none": b'{"files": [1]}',
    "a file without a path": b'{"files": [{"sha256": "0"}]}',
    "a file without a hash": b'{"files": [{"path": "a"}]}',
    "a path that is none": b'{"files": [{"path": [1], "sha256": "0"}]}',
    "a path with NUL": b'{"files": [{"path": "a\\u0000b", "sha256": "0"}]}',
    "a path of half a character": b'{"files": [{"path": "\\ud800", "sha256": "0"}]}',
    "a number of 5000 digits": b'{"files": ' + b"1" * 5000 + b"}",
}


@pytest.mark.parametrize("content", GARBAGE.values(), ids=GARBAGE.keys())
def test_a_manifest_of_garbage_is_nobodys(content: bytes, folder: Path) -> None:
    (folder / "manifest.json").write_bytes(content)
    before = contents(folder)
    (entry,) = (entry for entry in check_tree(folder, NEW, NEW_INFO) if entry.path == "manifest.json")
    assert entry.kind == "changed"
    with pytest.raises(FolderConflict, match=r"manifest\.json: not written by springline"):
        write_tree(folder, NEW, NEW_INFO)
    assert contents(folder) == before
    write_tree(folder, NEW, NEW_INFO, force=True)
    assert {path: contents(folder)[path] for path in NEW} == NEW


@pytest.mark.parametrize("depth", [200, 900, 100_000])
def test_a_manifest_with_deep_entries_of_its_own_is_compared(depth: int, folder: Path) -> None:
    manifest = json.loads((folder / "manifest.json").read_bytes())
    text = json.dumps(manifest | {"parameters": 0}).replace(
        '"parameters": 0', f'"parameters": {"[" * depth}{"]" * depth}'
    )
    (folder / "manifest.json").write_text(text)
    (entry,) = (entry for entry in check_tree(folder, OLD, OLD_INFO) if entry.path == "manifest.json")
    assert entry.kind == "changed"


def test_names_that_are_no_names_are_compared(folder: Path) -> None:
    manifest = json.loads((folder / "manifest.json").read_bytes()) | {"parameters": [{"name": ["m3"]}]}
    (folder / "manifest.json").write_text(json.dumps(manifest))
    (entry,) = check_tree(folder, OLD, OLD_INFO)
    assert entry.detail.startswith("parameters")


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


def without_links(*_: object, **__: object) -> None:
    raise OSError("Operation not permitted")


# Update: two files and the manifest in, one out; where there are no hard links, two of the three give way first.
@pytest.mark.parametrize(
    ("fresh", "links", "moves"),
    [(True, True, 1), (False, True, 4), (False, False, 6)],
    ids=["new folder", "update", "update without links"],
)
@pytest.mark.parametrize("error", [OSError("disk full"), KeyboardInterrupt()])
def test_failure_at_any_move_restores_everything(
    fresh: bool, links: bool, moves: int, error: BaseException, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = tmp_path / "deep" / "out"
    if not fresh:
        write_tree(place, OLD, OLD_INFO)
    if not links:
        monkeypatch.setattr(os, "link", without_links)
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
    assert failures == moves
    assert check_tree(place, NEW, NEW_INFO) == []


def test_failure_while_preparing_touches_nothing(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = contents(folder.parent)

    def refuse(_: int) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(os, "fsync", refuse)
    with pytest.raises(OSError, match="disk full"):
        write_tree(folder, NEW, NEW_INFO)
    assert contents(folder.parent) == before


def killed_while_replacing(place: Path) -> None:
    """A write that is killed when its first file is to be moved into place."""

    def die(*_: object) -> None:
        os.kill(os.getpid(), signal.SIGKILL)

    os.replace = die  # type: ignore[assignment]  # this process is ours alone
    write_tree(place, NEW, NEW_INFO)


def kill_a_write(place: Path) -> None:
    process = multiprocessing.get_context("fork").Process(target=killed_while_replacing, args=(place,))
    process.start()
    process.join()
    assert process.exitcode == -signal.SIGKILL
    assert list(place.glob(".springline-*")), "killed too early for this test to mean anything"


@pytest.mark.parametrize("files", [OLD, NEW], ids=["nothing to do", "something to do"])
def test_the_next_write_removes_what_a_killed_one_left(files: dict[str, bytes], folder: Path) -> None:
    kill_a_write(folder)
    (folder / ".springline-abcdefgh").mkdir()  # as version 0.1 left them
    (folder / ".springline-notes").mkdir()
    (folder / ".springline-notes/mine.txt").write_text("mine")
    write_tree(folder, files, OLD_INFO if files is OLD else NEW_INFO)
    assert contents(folder).keys() == {*files, "manifest.json", ".springline-notes/mine.txt"}


def test_what_another_process_is_working_on_stays(folder: Path) -> None:
    with workplace(folder) as busy:
        (busy / "a.c").write_text("half of it")
        write_tree(folder, NEW, NEW_INFO)
        assert (busy / "a.c").read_text() == "half of it"
    assert contents(folder).keys() == {*NEW, "manifest.json"}


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
        Stale("src/a.c", "changed", "1 of 1 lines are new, 1 go"),
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


def number_of_lines(text: str) -> tuple[int, int]:
    """How many lines a detail says would come, and how many would go."""
    found = re.search(r"(\d+) of \d+ lines are new, (\d+) go", text)
    assert found, text
    return int(found[1]), int(found[2])


def detail_of_change(place: Path, old: str, new: str) -> str:
    write_tree(place, {"a.c": old.encode()}, {})
    (entry,) = (entry for entry in check_tree(place, {"a.c": new.encode()}, {}) if entry.path == "a.c")
    return entry.detail


def test_a_line_that_is_put_in_changes_no_other(tmp_path: Path) -> None:
    lines = [f"double a{i};\n" for i in range(3000)]
    changed = ["/* new */\n", *lines[:700], *lines[702:2000], "int b;\n", *lines[2000:]]
    assert number_of_lines(detail_of_change(tmp_path, "".join(lines), "".join(changed))) == (2, 2)


@settings(max_examples=30)
@given(st.lists(st.sampled_from("abcd"), max_size=30), st.lists(st.sampled_from("abcd"), max_size=30))
def test_lines_are_counted_as_diff_counts_them(
    require_tool: Callable[..., str], tmp_path_factory: pytest.TempPathFactory, old: list[str], new: list[str]
) -> None:
    if old == new:
        return
    place, texts = tmp_path_factory.mktemp("diff"), ["".join(f"{word}\n" for word in words) for words in (old, new)]
    (place / "old").write_text(texts[0])
    (place / "new").write_text(texts[1])
    tool = require_tool("diff", "apt-get install diffutils")
    shown = subprocess.run(
        [tool, "--minimal", place / "old", place / "new"], check=False, capture_output=True, text=True
    ).stdout
    signs = [line[0] for line in shown.splitlines()]
    assert number_of_lines(detail_of_change(place / "tree", *texts)) == (signs.count(">"), signs.count("<"))


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
