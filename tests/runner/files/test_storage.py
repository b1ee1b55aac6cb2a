"""Tables and files on disk: exact numbers, units, equal bytes, and nothing half-written."""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import stat
from pathlib import Path

import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st
from stored import read_table

from springline.codegen.files import write_file
from springline.runner.files import storage, table_files, units, write_folder
from springline.runner.run import field

SCHEMA = pa.schema([field("t", "s"), field("force", "N m"), field("status", "", pa.string())])
TABLE = pa.table(
    {"t": [0.0, 0.1, 1 / 3], "force": [5e-324, None, -1.7976931348623157e308], "status": ["ok", "a, b", 'say "x"']},
    schema=SCHEMA,
)


def stored(folder: Path, table: pa.Table, form: storage.Format) -> pa.Table:
    """`table`, written and read again."""
    for name, content in table_files("table", table, form).items():
        (folder / name).write_bytes(content)
    return read_table(folder / f"table.{form}")


@pytest.mark.parametrize("form", ["parquet", "csv"])
def test_what_is_written_is_read_with_units(tmp_path: Path, form: storage.Format) -> None:
    read = stored(tmp_path, TABLE, form)
    assert read.equals(TABLE)
    assert units(read) == {"t": "s", "force": "N m", "status": ""}


@given(numbers=st.lists(st.none() | st.floats(allow_nan=False), min_size=1))
def test_csv_keeps_every_double(tmp_path_factory: pytest.TempPathFactory, numbers: list[float | None]) -> None:
    table = pa.table(
        {"x": numbers, "i": list(range(len(numbers)))}, pa.schema([field("x", "m"), field("i", "", pa.int64())])
    )
    assert stored(tmp_path_factory.mktemp("csv"), table, "csv").equals(table)


def test_csv_columns_of_whole_numbers_and_of_nothing_stay_doubles(tmp_path: Path) -> None:
    table = pa.table({"t": [0.0, 2.0], "force": [None, None], "status": ["ok", "ok"]}, schema=SCHEMA)
    assert stored(tmp_path, table, "csv").schema.equals(SCHEMA, check_metadata=True)


def test_csv_starts_with_plain_column_names() -> None:
    files = table_files("x", TABLE, "csv")
    assert files["x.csv"].splitlines()[0] == b"t,force,status"
    assert list(json.loads(files["x.units.json"])) == TABLE.column_names


def test_csv_without_its_units_is_still_read(tmp_path: Path) -> None:
    (tmp_path / "bare.csv").write_bytes(b"t,force\n0.5,1.5\n")
    read = read_table(tmp_path / "bare.csv")
    assert read.to_pydict() == {"t": [0.5], "force": [1.5]}
    assert units(read) == {"t": "", "force": ""}


@pytest.mark.parametrize("form", ["parquet", "csv"])
def test_the_same_table_gives_the_same_bytes(form: storage.Format) -> None:
    again = pa.Table.from_pylist(TABLE.to_pylist(), schema=SCHEMA)
    assert table_files("x", TABLE, form) == table_files("x", again, form)


# --- whole or not at all ---------------------------------------------------------------------------------


def names(folder: Path) -> list[str]:
    """Every file below `folder`."""
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def disk_full(*_: object, **__: object) -> None:
    raise OSError(28, "No space left on device")


def test_write_file_replaces_and_leaves_nothing_else(tmp_path: Path) -> None:
    write_file(tmp_path / "a.txt", b"old")
    write_file(tmp_path / "a.txt", b"new")
    assert (tmp_path / "a.txt").read_bytes() == b"new"
    assert names(tmp_path) == ["a.txt"]


def test_write_file_obeys_the_umask(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        write_file(tmp_path / "a.txt", b"x")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "a.txt").stat().st_mode) == 0o640


@pytest.mark.parametrize("step", ["fsync", "replace"])
def test_write_file_that_fails_keeps_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str) -> None:
    write_file(tmp_path / "a.txt", b"old")
    monkeypatch.setattr(os, step, disk_full)
    with pytest.raises(OSError, match="No space"):
        write_file(tmp_path / "a.txt", b"new")
    assert (tmp_path / "a.txt").read_bytes() == b"old"
    assert names(tmp_path) == ["a.txt"]


def test_write_folder_makes_parents_and_subfolders(tmp_path: Path) -> None:
    folder = tmp_path / "deep" / "results"
    write_folder(folder, {"a.txt": b"a", "figures/b.txt": b"b"})
    assert names(tmp_path) == ["deep/results/a.txt", "deep/results/figures/b.txt"]


def test_write_folder_replaces_what_it_is_told_to_and_nothing_else(tmp_path: Path) -> None:
    write_folder(tmp_path, {"a.csv": b"1", "keep.txt": b"mine", "figures/x.png": b"2"})
    write_folder(tmp_path, {"a.parquet": b"3"}, replaces=["a.*", "figures/*.png"])
    assert names(tmp_path) == ["a.parquet", "keep.txt"]
    assert not (tmp_path / "figures").exists()


def test_write_folder_that_fails_leaves_no_new_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "fsync", disk_full)
    with pytest.raises(OSError, match="No space"):
        write_folder(tmp_path / "results", {"a.txt": b"a"})
    assert list(tmp_path.iterdir()) == []


def test_write_folder_that_fails_leaves_an_old_folder_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_folder(tmp_path, {"a.txt": b"old", "b.txt": b"old"})
    real, calls = os.fsync, []

    def full_at_the_second_file(handle: int) -> None:
        calls.append(handle)
        if len(calls) == 2:
            disk_full()
        real(handle)

    monkeypatch.setattr(os, "fsync", full_at_the_second_file)
    with pytest.raises(OSError, match="No space"):
        write_folder(tmp_path, {"a.txt": b"new", "b.txt": b"new"}, replaces=["*.txt"])
    assert names(tmp_path) == ["a.txt", "b.txt"]
    assert (tmp_path / "a.txt").read_bytes() == b"old"


def test_write_folder_that_fails_at_any_move_leaves_all_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old = {"a.txt": b"old", "b.txt": b"old", "figures/x.png": b"old", "mine.md": b"mine"}
    write_folder(tmp_path, old)
    real, left = os.replace, [0]

    def full_at_some_move(source: Path, target: Path) -> None:
        left[0] -= 1
        if left[0] == 0:
            disk_full()
        real(source, target)

    monkeypatch.setattr(os, "replace", full_at_some_move)
    for move in range(1, 5):  # the picture out, two files in, one of them new
        left[0] = move
        if move < 4:
            with pytest.raises(OSError, match="No space"):
                write_folder(tmp_path, {"a.txt": b"new", "c.txt": b"new"}, replaces=["figures/*.png"])
            assert {name: (tmp_path / name).read_bytes() for name in names(tmp_path)} == old
        else:
            write_folder(tmp_path, {"a.txt": b"new", "c.txt": b"new"}, replaces=["figures/*.png"])
    assert names(tmp_path) == ["a.txt", "b.txt", "c.txt", "mine.md"]


def test_a_file_is_there_all_the_time_while_it_is_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_folder(tmp_path, {"a.txt": b"old"})
    real, seen = os.replace, []

    def watched(source: Path, target: Path) -> None:
        seen.append((tmp_path / "a.txt").read_bytes())
        real(source, target)

    monkeypatch.setattr(os, "replace", watched)
    write_folder(tmp_path, {"a.txt": b"new"})
    assert seen == [b"old"]
    assert (tmp_path / "a.txt").read_bytes() == b"new"


@pytest.mark.parametrize("links", [True, False])
def test_a_folder_in_the_place_of_a_file_stays(links: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if not links:
        monkeypatch.setattr(os, "link", disk_full)
    write_folder(tmp_path, {"a.txt/mine.md": b"mine", "z.txt": b"old"})
    with pytest.raises(IsADirectoryError, match=r"a\.txt"):
        write_folder(tmp_path, {"z.txt": b"new", "a.txt": b"new"})
    assert names(tmp_path) == ["a.txt/mine.md", "z.txt"]
    assert (tmp_path / "z.txt").read_bytes() == b"old"


def killed_while_renaming(folder: Path) -> None:
    def die(*_: object) -> None:
        os.kill(os.getpid(), signal.SIGKILL)

    os.rename = os.replace = die  # type: ignore[assignment]  # this process is ours alone
    write_folder(folder, {"a.txt": b"half"})


@pytest.mark.parametrize("fresh", [False, True])
def test_the_next_write_folder_removes_what_a_killed_one_left(fresh: bool, tmp_path: Path) -> None:
    folder = tmp_path / "results"
    if not fresh:
        folder.mkdir()
    process = multiprocessing.get_context("fork").Process(target=killed_while_renaming, args=(folder,))
    process.start()
    process.join()
    assert list(tmp_path.rglob(".springline-*")), "killed too early for this test to mean anything"
    write_folder(folder, {"a.txt": b"whole"})
    assert [path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*")] == ["results", "results/a.txt"]
