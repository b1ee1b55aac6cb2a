"""What the commands say of sizes, times and progress."""

from pathlib import Path

import pytest

from springline.runner.cli import time_text
from springline.runner.cli.amounts import size_text
from springline.runner.cli.commands.batch import _progress
from springline.runner.sweep import Plan, Tally, load_sweep


def test_sizes_and_times_are_for_people() -> None:
    assert [time_text(s) for s in (0.0072, 0.123, 40, 600, 20_000, 400_000)] == [
        "7.2 ms",
        "0.12 s",
        "40 s",
        "10 min",
        "5.6 h",
        "4.6 days",
    ]
    assert [size_text(b) for b in (12, 34_567, 5.6e9, 7e13)] == ["12 B", "34.6 kB", "5.6 GB", "70 TB"]


@pytest.mark.parametrize("quiet", [False, True])
def test_who_sees_no_bar_gets_a_line_every_ten_seconds(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], *, quiet: bool
) -> None:
    now = [100.0]
    sweep = tmp_path / "sweep.toml"
    sweep.write_text("samples = 300\n[set]\nsimulation.duration = 0.002\n[vary]\ncontrol.k1 = { uniform = [1, 5] }\n")
    plan = Plan(load_sweep(sweep))  # of 20 steps each
    with _progress(plan, quiet=quiet, clock=lambda: now[0]) as report:
        tally = Tally(300, found=60)
        for second in range(1, 32):
            now[0] = 100.0 + second
            tally.done = 4 * second
            report(tally, 20 * 4 * second)
    said = capsys.readouterr()
    assert said.out == ""
    lines = said.err.splitlines()
    assert [line.split(" · ")[2] for line in lines] == ["100 done", "140 done", "180 done"]
    assert lines[0] == (f"{sweep}: 33 % of 300 runs · 4 runs/s · 100 done · 0 failed · 0 stopped early · 50 s left")
