"""Metrics as declarations: what kernels printed from them compute, against the same computed from trajectories."""

import math
from collections.abc import Callable
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import trapezoid

from springline.codegen.kernel import BANDS, KernelOptions, KernelSpec, LoopSettings, Runs
from springline.codegen.kernel import compiled as kernel_module
from springline.codegen.kernel import metrics as kernel_metrics
from springline.codegen.kernel.compiled import compile_kernel
from springline.codegen.program import Program, program
from springline.model.metrics import FIRST, METRICS, NOW, RUN, SETTINGS, Fold, Kind, Metric, Part
from springline.model.structure import Structure

Floats = NDArray[np.float64]
Values = Callable[..., Floats]

ENGINES = {
    "one lane": KernelOptions(width=1, groups=1, flags=("-O1",)),
    "lanes": KernelOptions(width=4, groups=2, flags=("-O1",)),
    "casadi": KernelOptions("casadi", flags=("-O1",)),
}
JOINTS = ("lift", "rotation")
GATHERED: dict[Kind, Callable[[Floats, Floats], float]] = {
    "largest": lambda x, t: x.max(),
    "smallest": lambda x, t: x.min(),
    "integral": trapezoid,
    "variation": lambda x, t: np.abs(np.diff(x)).sum(),
    "mean": lambda x, t: trapezoid(x, t) / (t[-1] - t[0]),
}


def run(base: Program, values: Floats, settings: LoopSettings, options: KernelOptions = ENGINES["lanes"]) -> Runs:
    return compile_kernel(base, KernelSpec(base.system.structure, options=options)).run(values[None, :], settings)


@pytest.fixture
def declare(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """declare(metric, ...): kernels have these instead."""

    def declared(*metrics: Metric) -> None:
        monkeypatch.setattr(kernel_metrics, "METRICS", metrics)
        monkeypatch.setattr(kernel_module, "METRICS", [metric.name for metric in metrics])

    return declared


def declared(folds: list[Fold]) -> list[Metric]:
    return [Metric(f"m{k}", "m", "", "", folds=(fold,)) for k, fold in enumerate(folds)]


@pytest.mark.parametrize("engine", ENGINES)
def test_every_kind_of_fold_over_every_part(
    engine: str, shaken: Program, values_of: Values, declare: Callable[..., None]
) -> None:
    """Of what no metric of ours looks at; the halves and quarters of these numbers of steps all begin differently."""
    parts: tuple[Part, ...] = ("run", "second half", "last quarter", "settled")
    over = [(kind, part) for kind in GATHERED for part in parts if kind != "mean" or part == "run"]
    stretch, scaled = NOW.q2 - NOW.q1, NOW.U / (1.0 + ca.sin(FIRST.e) ** 2)
    folds = [Fold(kind, of, part) for of in (stretch, scaled) for kind, part in over]
    declare(*declared(folds))
    columns = [entry.name for entry in shaken.system.trajectory]
    for steps in (8000, 8001, 8002, 8003):
        settings = LoopSettings(steps, 1e-4, output_every=1)
        result = run(shaken, values_of(shaken), settings, ENGINES[engine])
        assert result.trajectory is not None
        rows = result.trajectory[0]
        for j, joint in enumerate(JOINTS):
            q1, q2, e, u = (rows[:, columns.index(f"{name}_{joint}")] for name in ("q1", "q2", "e", "U"))
            last_outside = int(np.flatnonzero(np.abs(e) > settings.settling_band * abs(e[0]))[-1])
            assert 0 < last_outside < 0.98 * steps
            begin = {
                "run": 0,
                "second half": steps // 2,
                "last quarter": math.ceil(3 * steps / 4),
                "settled": last_outside,
            }
            for k, fold in enumerate(folds):
                x = q2 - q1 if fold.of is stretch else u / (1.0 + np.sin(e[0]) ** 2)
                at = slice(begin[fold.part], None)
                expected = GATHERED[fold.kind](x[at], rows[at, 0])
                name = f"{fold.kind} over {fold.part}, {joint}"
                np.testing.assert_allclose(result.metrics[0, j, k], expected, rtol=1e-9, atol=1e-15, err_msg=name)


def test_an_integral_begins_with_the_run_where_that_never_leaves_its_band(
    shaken: Program, values_of: Values, declare: Callable[..., None]
) -> None:
    declare(*declared([Fold("integral", NOW.U, part) for part in ("run", "settled")]))
    result = run(shaken, values_of(shaken), LoopSettings(500, 1e-4, settling_band=0.0, settling_error=1e3))
    for whole, settled in result.metrics[0]:
        assert settled == whole != 0.0


def test_times_thresholds_and_expressions_of_several_folds(
    shaken: Program, values_of: Values, declare: Callable[..., None]
) -> None:
    limit = 2.0 * SETTINGS.response_error
    share = Metric(
        "share",
        "s",
        "1",
        "time between the first and the last |e| beyond the limit, by the duration, where that is before the end",
        folds=(Fold("first", ca.fabs(NOW.e) > limit), Fold("last", ca.fabs(NOW.e) > limit)),
        value=lambda first, last: (last - first) / RUN.duration,
        exists=lambda _, last: last < RUN.start + RUN.duration,
    )
    declare(share)
    settings = LoopSettings(8000, 1e-4, start_time=3.0, output_every=1, response_band=0.0, response_error=0.01)
    result = run(shaken, values_of(shaken), settings)
    assert result.trajectory is not None
    columns = [entry.name for entry in shaken.system.trajectory]
    for j, joint in enumerate(JOINTS):
        beyond = np.flatnonzero(np.abs(result.trajectory[0][:, columns.index(f"e_{joint}")]) > 0.02)
        if beyond[-1] == 8000:
            assert math.isnan(result.metrics[0, j, 0])
        else:
            assert result.metrics[0, j, 0] == pytest.approx((beyond[-1] - beyond[0]) / 8000, rel=1e-9)


def test_what_a_system_lacks_is_null_and_not_gathered(values_of: Values, declare: Callable[..., None]) -> None:
    rigid = program(Structure(drive="rigid"))
    stretch, error = declared([Fold("largest", NOW.q2 - NOW.q1), Fold("largest", NOW.e)])
    declare(stretch, error)
    result = run(rigid, values_of(rigid), LoopSettings(10, 1e-4))
    assert np.isnan(result.metrics[0, :, 0]).all() and np.isfinite(result.metrics[0, :, 1]).all()
    text = kernel_metrics.print_metrics(rigid.system)
    assert "sl_v fold[1]" in text and "q2" not in text


def test_metrics_share_what_they_have_in_common(shaken: Program) -> None:
    """The last time outside the settling band, and the largest |U|."""
    text = kernel_metrics.print_metrics(shaken.system)
    folds = {fold for metric in METRICS for fold in metric.folds}
    assert f"sl_v fold[{len(folds)}]" in text
    assert text.count("= sl_last(") == 1


def test_a_run_without_a_sample_has_no_metric(shaken: Program, values_of: Values) -> None:
    """The command is not finite from the beginning."""
    for options in ENGINES.values():
        result = run(shaken, values_of(shaken, {"control.k1": 1e308}), LoopSettings(10, 1e-4), options)
        assert result.end_time[0] == 0.0 and np.isnan(result.metrics).all()


def test_a_kind_that_no_part_has_is_refused() -> None:
    for kind in ("mean", "first", "last"):
        with pytest.raises(ValueError, match=f"kind '{kind}' is of the whole run, not of part 'settled'"):
            Fold(kind, NOW.e, "settled")


@pytest.mark.parametrize("engine", ENGINES)
def test_each_run_of_a_pack_has_its_own_bands(engine: str, shaken: Program, values_of: Values) -> None:
    """Of each the metrics are those of a call with its bands for all, to the bit."""
    bands = np.array([[0.1, 0.0, 0.05, 0.0], [0.0, 0.05, 0.5, 0.0], [0.4, 0.0, 0.0, 0.2], [0.0, 0.0, 0.0, 0.0]] * 5)
    loop = compile_kernel(shaken, KernelSpec(shaken.system.structure, options=ENGINES[engine]))
    values = np.tile(values_of(shaken), (len(bands), 1))
    settings = LoopSettings(8000, 1e-4)
    together = loop.run(values, settings, bands=bands).metrics
    for run, own in enumerate(bands[:4]):
        told = replace(settings, **dict(zip(BANDS, map(float, own), strict=True)))
        alone = loop.run(values[:1], told).metrics[0]
        for other in together[run::4]:
            np.testing.assert_array_equal(other, alone)
    assert len({tuple(found[0, :2]) for found in together[:4]}) == 4
    assert np.isnan(together[3, :, :2]).all() and not np.isnan(together[:3, :, :2]).any()
    start = loop.run(values[:1], LoopSettings(0, 1e-4, output_every=1)).trajectory
    assert start is not None
    columns = [entry.name for entry in shaken.system.trajectory]
    there = {f"initial.q.{j}": start[0, 0, columns.index(f"q1d_{joint}")] for j, joint in enumerate(JOINTS)}
    found = loop.run(np.tile(values_of(shaken, there), (8, 1)), LoopSettings(0, 1e-4), bands=bands[:8]).metrics
    np.testing.assert_array_equal(np.isnan(found[:, 0, 0]), [True, False, True, True] * 2)  # of no error no band is any
    for wrong in (bands[:1], bands[:, :3], np.full_like(bands, np.nan)):
        with pytest.raises(ValueError, match=r"bands have shape .*, expected \(20, 4\) finite numbers"):
            loop.run(values, settings, bands=wrong)
