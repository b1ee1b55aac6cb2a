"""`springline batch` and `springline replay`: a sweep into a dataset, and one of its runs again."""

from __future__ import annotations

import shlex
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from springline.runner.cli.amounts import size_text, time_text
from springline.runner.cli.completion import sweep_names
from springline.runner.cli.options import Changes, NoCode
from springline.runner.cli.overrides import overrides
from springline.runner.cli.terminal import complain, console, print_json, print_table, say

if TYPE_CHECKING:
    from springline.runner.sweep import Dataset, Estimate, Plan, Pool, Report, Tally

_LONG = 3600.0
_LARGE = 10e9
_SHOWN_KEYS = 5
_BEAT = 10.0
_FLAWS = 20  # parts that are named when they are not whole
# Here, for the help must not load all that lists them.
_PACKAGED = (
    "controllers, delay_and_period, encoder_bits, gains, laws, payload_and_friction, payload_and_phase, stability_map"
)


def batch(
    sweep: Annotated[
        str, typer.Argument(help=f"A TOML file, or a packaged sweep: {_PACKAGED}.", autocompletion=sweep_names)
    ],
    output: Annotated[
        str,
        typer.Option(
            "-o", "--output", metavar="DIR", show_default="results/SWEEP", help="Folder or URL of the dataset."
        ),
    ] = "",
    changes: Changes = None,
    no_code: NoCode = False,
    jobs: Annotated[
        int | None, typer.Option("--jobs", min=1, show_default="one per processor", help="Threads.")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Do what is missing in a dataset that was begun.")] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Say what would be done and how long it takes.")] = False,
    scheduler: Annotated[
        str,
        typer.Option(
            "--scheduler",
            metavar="ADDRESS",
            help="A dask scheduler, tcp://host:port, or local:N for N worker processes here.",
        ),
    ] = "",
    plot: Annotated[bool, typer.Option("--plot/--no-plot", help="Draw figures.")] = True,
    as_json: Annotated[bool, typer.Option("--json", help="Print what became of the runs as JSON.")] = False,
) -> None:
    """Simulate every run of a sweep into one table, one row a run.

    A summary and figures come with it. Ctrl-C, and even a crash, loses no more than the runs under way: --resume goes
    on from there.

    Example: springline batch gains -o gains --set simulation.duration=2.0
    """
    from springline.runner.sweep import (
        Dataset,
        Plan,
        estimate,
        load_sweep,
        open_pool,
        place,
        refuse_oversized,
        run_sweep,
        versions,
    )

    loaded = load_sweep(sweep, overrides(changes, sweep))
    for note in loaded.scenario.notes:
        complain(note)
    plan = Plan(loaded)
    for warning in dict.fromkeys(text for group in plan.groups for text in group.scenario.warnings):
        complain(warning)
    plan.expect_plausible()
    destination = output or str(Path("results", Path(sweep).stem))
    dataset = Dataset(place(destination))
    begun = dataset.is_begun(resume=resume)
    if dry_run:
        with open_pool(jobs, scheduler) as pool:
            cost = estimate(plan, pool.threads)
            _describe(plan, cost, pool, destination, as_json=as_json)
        return
    sets = [word for change in changes or [] for word in ("--set", change)]
    again = shlex.join(["springline", "batch", sweep, *sets, "-o", destination, "--resume"])
    with open_pool(jobs, scheduler) as pool:
        if not begun:  # else what is left to do is known when its parts have been looked at
            refuse_oversized(plan, dataset.place, pool.threads)
        with dataset.place.locked():
            plan = dataset.begin(plan, versions(), resume=resume)
            said = Said(_FLAWS)
            done = dataset.done(plan, said.line, Heartbeat("checking the parts that are there").checked)
            said.rest("more parts are not whole")
            try:
                left = plan.runs - sum(plan.chunk(k).runs for k in done)
                refuse_oversized(plan, dataset.place, pool.threads, left)
                _warn(estimate(plan, pool.threads, left), again)
                with _progress(plan, quiet=as_json) as report:
                    tally = run_sweep(plan, dataset, pool, done, report)
            except KeyboardInterrupt as error:
                pool.stop()
                held = sum(plan.chunk(k).runs for k in done)
                complain(f"stopped: {held:,} of {plan.runs:,} runs are stored; continue with: {again}")
                raise typer.Exit(130) from error
            _finish(plan, dataset, done, tally, again, plot=plot, as_json=as_json)


def _describe(plan: Plan, cost: Estimate, pool: Pool, destination: str, *, as_json: bool) -> None:
    """What --dry-run prints."""
    facts = {
        "runs": plan.runs,
        "groups": len(plan.groups),
        "chunks": plan.chunks,
        "chunk": plan.chunk_size,
        "threads": pool.threads,
        "bytes": cost.bytes,
        "seconds": cost.seconds,
    }
    if as_json:
        print_json("batch", [facts], {"bytes": "B", "seconds": "s"})
        return
    rows = [
        ["runs", f"{plan.runs:,}"],
        ["groups", f"{len(plan.groups)}"],
        ["chunks", _chunks_text(plan)],
        ["threads", f"{pool.threads}"],
        ["size", f"about {size_text(cost.bytes)}"],
        ["time", f"about {time_text(cost.seconds)}, less where runs diverge"],
    ]
    print_table(["sweep", Path(plan.sweep.source).name], rows)
    say(f"results: would go to {destination}")


def _chunks_text(plan: Plan) -> str:
    """How many chunks there are, of how many runs: the last one of a group may be smaller."""
    largest = min(plan.chunk_size, max(group.runs for group in plan.groups))
    most = "" if plan.chunks * largest == plan.runs else "up to "
    return f"{plan.chunks:,} of {most}{largest:,} run{'s' if largest > 1 else ''}"


def _warn(cost: Estimate, again: str) -> None:
    if cost.seconds > _LONG or cost.bytes > _LARGE:
        complain(
            f"this will take about {time_text(cost.seconds)} and {size_text(cost.bytes)}; Ctrl-C ends it, and then "
            f"{again} goes on"
        )


def _finish(
    plan: Plan, dataset: Dataset, done: set[int], tally: Tally, again: str, *, plot: bool, as_json: bool
) -> None:
    """Summary and last words; exits with 1 if something failed."""
    from springline.runner.sweep import summarize, summary_tables, write_summary

    problems = [f"failed: {failure}" for failure in tally.failures]
    if tally.found + tally.done:
        summary = summarize(plan, dataset, done)
        try:
            write_summary(plan, dataset, summary, plot=plot)
        except OSError as error:  # the runs are safe, and what lost some of them is told below
            problems.append(f"failed: no summary: {error}")
        if as_json:
            rows = [{"group": name, **counts} for name, counts in summary.outcomes.items()]
            print_json("batch", rows, {}, "failed" if problems else "ok")
        else:
            keys = [axis.key for axis in plan.sweep.axes]
            keys = keys if len(keys) <= _SHOWN_KEYS else []  # the report has room for all
            for header, rows_of_text in summary_tables(summary, keys):
                print_table(header, rows_of_text, right=header[1:])
    if problems:
        for problem in problems:
            complain(problem)
        complain(f"{tally.left:,} of {plan.runs:,} runs are missing; once the cause is gone: {again}")
        raise typer.Exit(1)
    if not as_json:
        say(f"results: {dataset.place.name}")


class Heartbeat:
    """A line on stderr every ten seconds, for those who watch no bar: a log, a pipe, a job in the background.

    what   what is being done
    clock  seconds since whenever
    """

    def __init__(self, what: str, clock: Callable[[], float] = time.monotonic) -> None:
        self._what = what
        self._clock = clock
        self._start = self._last = clock()

    def line(self, text: Callable[[float], str]) -> None:
        """Say how it stands, if it is time: `text` is asked for it, with the seconds that have gone by."""
        now = self._clock()
        if now - self._last >= _BEAT:
            self._last = now
            complain(f"{self._what}: {text(now - self._start)}")

    def checked(self, done: int, of: int) -> None:
        """Say how many parts have been checked."""
        self.line(lambda seconds: f"{done:,} of {of:,}")


class Said:
    """Lines on stderr, of which there may be too many: the first ones, then how many more there were."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._count = 0

    def line(self, text: str) -> None:
        """Say a line."""
        self._count += 1
        if self._count <= self._most:
            complain(text)

    def rest(self, what: str) -> None:
        """Say how many lines were not said."""
        if self._count > self._most:
            complain(f"{self._count - self._most:,} {what}")


@contextmanager
def _progress(plan: Plan, *, quiet: bool, clock: Callable[[], float] = time.monotonic) -> Iterator[Report]:
    """How a sweep stands: a bar where somebody watches, unless stdout is for JSON; else a line now and then on stderr.

    Both tell runs/s, what became of the runs and the time left.
    """
    per_run = sum(group.runs * group.work.settings.steps for group in plan.groups) / plan.runs
    start = clock()

    def rate(steps: int) -> float:
        return steps / per_run / max(clock() - start, 1e-9)

    def counts(tally: Tally, steps: int) -> str:
        return (
            f"{rate(steps):,.0f} runs/s · {tally.found + tally.done:,} done · {tally.failed:,} failed · "
            f"{tally.stopped_early:,} stopped early"
        )

    if quiet or not sys.stdout.isatty():
        heartbeat = Heartbeat(plan.sweep.source, clock)

        def say_line(tally: Tally, steps: int) -> None:
            share = (tally.found + steps / per_run) / plan.runs
            left = (1.0 - share) * plan.runs / max(rate(steps), 1e-9)
            known = f" · {time_text(left)} left" if steps else ""
            heartbeat.line(lambda seconds: f"{100 * share:.0f} % of {plan.runs:,} runs · {counts(tally, steps)}{known}")

        yield say_line
        return
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    bar = Progress(
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TextColumn("{task.fields[counts]}"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=console(),
        transient=True,
    )
    with bar:
        task = bar.add_task("", total=per_run * plan.runs, counts="")
        yield lambda tally, steps: bar.update(
            task, completed=tally.found * per_run + steps, counts=counts(tally, steps)
        )


def replay(
    dataset: Annotated[str, typer.Argument(help="Folder or URL that `springline batch` wrote.")],
    run: Annotated[int, typer.Argument(min=0, help="Number of the run, as in the column `run`.")],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", metavar="DIR", show_default="results/DATASET-RUN", help="Folder for the results."
        ),
    ] = None,
    code: Annotated[
        list[Path] | None,
        typer.Option("--code", metavar="FILE", help="A Python file that the runs need.", show_default=False),
    ] = None,
    no_code: NoCode = False,
    plot: Annotated[bool, typer.Option("--plot/--no-plot", help="Draw figures.")] = True,
    force: Annotated[bool, typer.Option("--force", help="Replace results that DIR holds.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the metrics as JSON.")] = False,
) -> None:
    """Simulate one run of a dataset again, trajectory included.

    The metrics must come out as the dataset has them, to the last bit; if they do not, the exit code is 1.

    Example: springline replay gains 17 -o run_17
    """
    from springline.runner.cli.commands.run import OUTPUTS, print_metrics
    from springline.runner.cli.options import refuse_occupied
    from springline.runner.files import table_files, units, write_folder
    from springline.runner.run import report_files, simulate
    from springline.runner.scenario import expect_kind
    from springline.runner.sweep import Dataset, place, recorded_run, stored_plan

    expect_kind("dataset", dataset)
    source = Dataset(place(dataset))
    folder = output or Path("results", f"{Path(dataset).name}-{run}")
    refuse_occupied(folder, force=force)
    recorded = recorded_run(source, stored_plan(source, code or ()), run)
    if recorded.flaw:
        complain(recorded.flaw)
    result = simulate(recorded.scenario)
    files = recorded.files(folder)
    files |= report_files(recorded.scenario, result, plot=plot)
    files |= table_files("trajectory", result.trajectory)
    files |= table_files("metrics", result.metrics)
    write_folder(folder, files, replaces=OUTPUTS)
    wrong = recorded.differences(result.metrics)
    if as_json:
        print_json("replay", result.metrics.to_pylist(), units(result.metrics), result.status)
    else:
        print_metrics(result, recorded.scenario.system().joints)
        say(result.message)
        say(f"results: {folder}")
    if wrong:
        complain("the metrics are not those of the dataset:\n  " + "\n  ".join(wrong))
        raise typer.Exit(1)
    if not as_json:
        say("the metrics are those of the dataset, bit for bit")
