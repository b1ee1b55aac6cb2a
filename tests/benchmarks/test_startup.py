"""The command that times how commands start, on commands of which one does a lot."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from springline.benchmarks import startup
from springline.benchmarks.processes import Ended, run_to_end
from springline.benchmarks.startup import COMMANDS, FLOOR, Row, measure, table


def test_the_command_times_all_commands() -> None:
    words = [sys.executable, "-m", "springline.benchmarks.startup", "--rounds", "1", "--json"]
    answer = json.loads(subprocess.run(words, capture_output=True, text=True, check=True).stdout)
    rows = {row["command"]: row for row in answer["rows"]}
    assert tuple(rows) == COMMANDS
    assert rows[FLOOR]["ratio"] == 1.0
    # Whatever the machine: no command imports as little as an interpreter that ends at once.
    assert all(row["ratio"] > 1.5 and row["wall_best"] > 0.0 for name, row in rows.items() if name != FLOOR)


def test_times_are_those_of_the_process_that_is_started() -> None:
    """Processor time, not that of waiting; of the process alone, not of those before it."""
    busy = "import time\nwhile time.process_time() < 0.3: pass"
    worked = run_to_end([sys.executable, "-c", busy])
    slept = run_to_end([sys.executable, "-c", "import time; time.sleep(0.3)"])
    assert min(worked.wall, slept.wall) > 0.3
    assert worked.usage.ru_utime + worked.usage.ru_stime > 0.29
    assert slept.usage.ru_utime + slept.usage.ru_stime < 0.2


def test_commands_take_turns_after_a_round_that_does_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    """Byte code is kept, whatever the caller's environment says: else every process would compile what it imports."""
    started: list[str] = []

    def run(words: list[str], environment: dict[str, str]) -> Ended:
        assert "PYTHONDONTWRITEBYTECODE" not in environment
        started.append(Path(words[0]).name if "python" not in words[0] else "floor")
        seconds = (1.0 if started[-1] == "floor" else 10.0) + 0.5 * len(started)
        usage = type("Usage", (), {"ru_utime": seconds, "ru_stime": 1.0})()
        return Ended(2.0 * seconds, usage)

    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    monkeypatch.setattr(startup, "run_to_end", run)
    monkeypatch.setattr(startup, "words_of", lambda command: command.split())
    monkeypatch.setitem(startup.AIMS, "tool x", 27.0)
    floor, tool = measure(2, ("python -c pass", "tool x"))
    assert started == ["floor", "tool", "tool", "floor", "floor", "tool"]
    assert (floor.wall_best, floor.cpu_best, floor.cpu_median) == (6.0, 4.0, 4.25)
    assert (tool.wall_best, tool.cpu_best) == (23.0, 12.5)
    assert tool.ratio == 12.5 / 4.0
    assert (floor.verdict, tool.verdict) == ("", "reached")


def test_the_table_says_whether_an_aim_is_reached() -> None:
    rows = [Row("springline list laws", best, 0.4, 0.25, 0.3, 21.04, 0.3) for best in (0.26, 0.3)]
    _, *lines = table(rows)
    assert lines[0].split() == ["springline", "list", "laws", "260", "400", "250", "300", "21.0", "300:", "reached"]
    assert lines[1].endswith("  300: missed")
    assert all(len(line) <= 80 for line in table(rows))


def test_a_command_that_fails_is_told() -> None:
    with pytest.raises(RuntimeError, match=r"exit code 2 of list lores:(.|\n)*lores"):
        measure(1, (FLOOR, "springline list lores"))
