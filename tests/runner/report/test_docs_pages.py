"""The command line of what is computed for docs/."""

import sys
from pathlib import Path

import pytest

from springline.runner.report import asked_to_write

DOC = "Tables of something.\n\nMore about it."


def test_what_is_written_is_what_was_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for arguments, expected in (([], False), (["--write"], True)):
        monkeypatch.setattr(sys, "argv", ["tables", *arguments])
        assert asked_to_write(DOC, "the tables", tmp_path) is expected


def test_no_place_is_told_before_anything_is_computed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    missing = tmp_path / "page.md"
    monkeypatch.setattr(sys, "argv", ["tables"])
    assert asked_to_write(DOC, "the tables", missing) is False
    for arguments, text in (
        (["--write"], f"there is no {missing}: run it in a checkout"),
        (["--wriet"], "--wriet"),
    ):
        monkeypatch.setattr(sys, "argv", ["tables", *arguments])
        with pytest.raises(SystemExit) as ended:
            asked_to_write(DOC, "the tables", missing)
        assert ended.value.code == 2
        assert text in capsys.readouterr().err


def test_the_help_says_what_goes_where(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(sys, "argv", ["tables", "--help"])
    with pytest.raises(SystemExit):
        asked_to_write(DOC, "the tables", Path("docs") / "page.md")
    shown = capsys.readouterr().out
    assert "Tables of something." in shown and "More about it" not in shown
    assert "put the tables into docs/page.md" in shown
