"""Six degrees of freedom of the base in whole runs: records, mounts, other conventions, and classes of a user's own."""

from __future__ import annotations

import math
import re
import subprocess
import tomllib
from importlib import resources
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from springline.codegen.export import bind
from springline.model.structure import SignalShape
from springline.runner import batch, load_scenario, simulate
from springline.runner.cli import app
from springline.runner.files import InputError
from springline.runner.report import conventions
from springline.runner.scenario import Scenario
from springline.runner.sweep import Plan, load_sweep

DATA = resources.files("springline.runner") / "scenarios" / "data"
G = 9.80665
THREE = {"t": "time_s", "heave": "heave", "roll": "roll", "pitch": "pitch"}
LONG = {"simulation.duration": 359.0}
ALL = ("surge", "sway", "heave", "roll", "pitch", "yaw")


def rows(name: str) -> dict[str, np.ndarray]:
    text = (DATA / name).read_text().splitlines()
    return dict(zip(text[0].split(","), np.array([line.split(",") for line in text[1:]], float).T, strict=True))


def readings(scenario: Scenario, t: np.ndarray) -> np.ndarray:
    """Specific force and angular rate at the arm's foot in its axes, (6, times), as the plant's equations have them."""
    system, (table,) = scenario.system(), scenario.tables()
    knots = np.clip(((t - table.t0) / table.dt).astype(int), 0, len(table.coefficients) - 1)
    data = np.column_stack([t - table.t0 - knots * table.dt, table.coefficients[knots].reshape(len(t), -1)]).T
    w = system.function("signals").map(len(t))(t[None], data, np.tile(scenario.values()[:, None], len(t))).full()
    b, db, ddb = np.split(w[3 * system.n :], 3)
    base = system.base
    felt = ca.Function("felt", [base.b, base.db, base.ddb, system.p], [base.specific_force(ca.SX(G)), base.omega])
    force, omega = felt.map(len(t))(b, db, ddb, np.tile(scenario.values()[:, None], len(t)))
    return np.concatenate([force.full(), omega.full()])


def misfits(scenario: Scenario) -> tuple[np.ndarray, np.ndarray]:
    """Rms difference to the unit's record per channel, and its standard deviation."""
    record = rows("vessel_orcaflex_10hz_imu.csv")
    late = slice(None, -1)
    expected = np.stack([record["ax"], -record["az"], record["ay"], record["gx"], -record["gz"], record["gy"]])[:, late]
    found = readings(scenario, record["time_s"][late])
    return np.sqrt(((found - expected) ** 2).mean(axis=1)), expected.std(axis=1)


def test_the_vessel_feels_what_its_measuring_unit_recorded(capsys: pytest.CaptureFixture[str]) -> None:
    """Over six minutes; the readings come from the vessel's simulation, not from the motion record."""
    rms, spread = misfits(load_scenario("ship/vessel_10hz", LONG))
    with capsys.disabled():
        names = ("f_x", "f_y", "f_z", "w_x", "w_y", "w_z")
        shown = (f"{n} {r:.2g} ({r / s:.3%})" for n, r, s in zip(names, rms, spread, strict=True))
        print("\nrms of the difference, of the standard deviation:", ", ".join(shown))
    assert np.all(rms[:3] < 1e-3), "m/s^2"
    assert np.all(rms[3:] < 1e-6), "rad/s"
    force, rate = (rms / spread)[:3], (rms / spread)[3:]
    page = " ".join(DOCS.read_text("utf-8").split())
    said = re.search(
        r"to ([\d.]+) % \(x\), ([\d.]+) % \(y\) and ([\d.]+) % \(z\) .*? rate to ([\d.]+) % and better", page
    )
    assert said and [f"{100 * value:.1f}" for value in force] == list(said.groups()[:3])
    assert np.all(100 * rate < float(said[4])) and 100 * rate.max() > 0.9 * float(said[4])


def test_three_degrees_of_freedom_have_the_vertical_alone() -> None:
    """What the paper's base would make of the same record: the vertical, and little else."""
    three = {"base_motion.columns": THREE, "base_motion.units": {}, "base_motion.scale": {}}
    rms, spread = misfits(load_scenario("ship/vessel_10hz", LONG | three))
    along, up = (rms / spread)[:2]
    page = " ".join(DOCS.read_text("utf-8").split())
    assert f"the vertical is right to {100 * up:.1f} %, and x is off by {100 * along:.0f} %" in page
    assert (rms / spread)[2] > 0.3


@pytest.mark.parametrize("rpy", [[0.0, 0.0, 0.0], [0.2, -0.1, 2.3]])
def test_a_mount_away_from_the_origin(rpy: list[float]) -> None:
    """The place of the foot differentiated twice, by a spline of its own and by rotations of SciPy's; and the formula
    for a rigid body, from the measured rates.
    """
    mount = np.array([-31.0, 12.5, 6.4])
    changes = {"base_motion.mount": mount.tolist(), "base_motion.mount_rpy": rpy}
    scenario = load_scenario("ship/vessel_10hz", LONG | changes)
    motion, unit = rows("vessel_orcaflex_10hz.csv"), rows("vessel_orcaflex_10hz_imu.csv")
    t = motion["time_s"]
    turned = Rotation.from_euler("YZX", np.stack([-motion["yaw"], motion["pitch"], motion["roll"]], axis=1))
    place = np.stack([motion["surge"], motion["heave"], motion["sway"]], axis=1) + turned.apply(mount)
    acceleration = CubicSpline(t, place)(t, 2)
    standing = Rotation.from_euler("YZX", rpy[::-1])
    expected = (turned * standing).inv().apply(acceleration + np.array([0, G, 0]))

    middle = slice(50, -50)
    found = readings(scenario, t)[:3].T
    error = (found - expected)[middle]
    assert np.sqrt((error**2).mean(axis=0)).max() < 1e-3
    at_origin = readings(load_scenario("ship/vessel_10hz", LONG), t)[:3].T
    assert np.abs(standing.apply(found) - at_origin)[middle].max() > 0.1, "the lever arm counts"

    omega = np.stack([unit["gx"], -unit["gz"], unit["gy"]], axis=1)
    alpha = CubicSpline(t, omega)(t, 1)
    felt = np.stack([unit["ax"], -unit["az"], unit["ay"]], axis=1)
    rigid = felt + np.cross(alpha, mount) + np.cross(omega, np.cross(omega, mount))
    error = (found - standing.inv().apply(rigid))[middle]
    assert np.sqrt((error**2).mean(axis=0)).max() < 1.5e-3


# Keys


def base(text: str = "", kind: str = "sine") -> str:
    return f'[base_motion]\nkind = "{kind}"\n{text}\n[simulation]\nduration = 0.02\n'


@pytest.fixture
def load(tmp_path: Path) -> Any:
    def loaded(text: str, overrides: dict[str, object] | None = None) -> Scenario:
        (tmp_path / "s.toml").write_text(text)
        return load_scenario(tmp_path / "s.toml", overrides)

    return loaded


TERM = "[{ amplitude = 0.1, omega = 3.0 }]"


def test_shake_is_another_name_of_heave(load: Any) -> None:
    shake, heave = load(base(f"shake = {TERM}")), load(base(f"heave = {TERM}"))
    assert shake == heave and "heave = [" in shake.to_toml() and "shake" not in shake.to_toml()
    for scenario in (shake, heave):
        for key in ("base_motion.shake.0.amplitude", "base_motion.heave.0.amplitude"):
            assert scenario.value_of(key) == 0.1
            assert scenario.with_overrides({key: 0.3}).value_of("base_motion.heave.0.amplitude") == 0.3
    table = batch(shake, {"base_motion.shake.0.amplitude": np.array([0.1, 0.2])})
    assert "base_motion.shake.0.amplitude" in table.column_names, "as it was asked for"
    other = batch(shake, {"base_motion.heave.0.amplitude": np.array([0.1, 0.2])})
    assert table["rms_error_lift"].equals(other["rms_error_lift"])
    exported = bind(shake.structure(), shake.values(), tunable="all")
    assert "base_motion_shake_0_amplitude" in [slot.symbol for slot in exported.tunable_slots], "C keeps its name"


@pytest.mark.parametrize(
    ("text", "overrides", "told"),
    [
        (base("heave = []\nshake = []"), {}, ["base_motion.shake", "another name of base_motion.heave"]),
        (base(), {"base_motion.shake": [], "base_motion.heave": []}, ["base_motion.shake", "another name of"]),
        (base("shake = [{ amplitude = 1 }]"), {}, ["base_motion.shake.0.omega", "is missing"]),
        (base("heave = [{ amplitude = 1 }]"), {}, ["base_motion.heave.0.omega", "is missing"]),
        (base(), {"base_motion.shake": 3}, ["base_motion.shake", "a list of tables"]),
        (base("mount = [1.0, 2.0]"), {}, ["base_motion.mount", "three finite numbers [m]", "z (to starboard)"]),
        (base("mount = 1.0"), {}, ["base_motion.mount", "three finite numbers"]),
        (base("mount = [1.0, inf, 0.0]"), {}, ["base_motion.mount.1", "a finite number [m]", "inf"]),
        (base("mount_rpy = [0.0, 0.0, nan]"), {}, ["base_motion.mount_rpy.2", "a finite number [rad]"]),
        (base("", "none"), {"base_motion.mount.3": 1.0}, ["base_motion.mount.3", "no such entry"]),
        (base("scale = { heave = -1.0 }"), {}, ["base_motion.scale", "kind = 'table'"]),
        (base("", "heave"), {}, ["base_motion.kind", "unknown kind", "none, sine, table"]),
    ],
)
def test_mistakes_are_told(load: Any, text: str, overrides: dict[str, object], told: list[str]) -> None:
    with pytest.raises(InputError) as caught:
        load(text, overrides)
    assert all(part in str(caught.value) for part in told), str(caught.value)


def record(folder: Path, **columns: np.ndarray) -> dict[str, Any]:
    """Write a CSV file with a column for each and t; the table of a scenario that reads all of them."""
    t = 0.05 * np.arange(60)
    given = {"t": t, **{name: function * np.ones(60) for name, function in columns.items()}}
    lines = [",".join(given), *(",".join(repr(float(x)) for x in row) for row in zip(*given.values(), strict=True))]
    (folder / "m.csv").write_text("\n".join(lines) + "\n")
    return {"kind": "table", "path": str(folder / "m.csv"), "columns": {name: name for name in given}}


def test_a_record_of_another_convention_is_scaled(tmp_path: Path) -> None:
    wave = np.sin(2 * 0.05 * np.arange(60))
    down = record(tmp_path, heave=-100 * wave, yaw=wave)
    down |= {"units": {"heave": "cm", "yaw": "deg"}, "scale": {"shake": -1.0, "yaw": -2.0}}
    scaled = load_scenario("paper/nominal", {"base_motion": down, "simulation.duration": 1.0})
    up = record(tmp_path, heave=wave, yaw=-2 * wave) | {"units": {"yaw": "deg"}}
    plain = load_scenario("paper/nominal", {"base_motion": up, "simulation.duration": 1.0})
    np.testing.assert_allclose(scaled.tables()[0].coefficients, plain.tables()[0].coefficients, atol=1e-13)
    assert np.all(scaled.tables()[0].bounds > 0)
    assert scaled.document["base_motion"]["scale"] == {"heave": -1.0, "yaw": -2.0}
    assert "scale" not in plain.document["base_motion"]
    assert scaled.structure().base_motion == SignalShape("table", (1, 0, 0, 0, 0, 1))


def test_a_ramp_is_one_whichever_way_it_counts(tmp_path: Path) -> None:
    """What its digits are worth has no sign: with `ends = "hold"` it stops as its mirror image does."""
    t = 0.05 * np.arange(60)
    ramp = record(tmp_path, heave=np.round(1.5 * t + 1e-3 * np.sin(t), 3))
    tables = [
        load_scenario("paper/nominal", {"base_motion": ramp | {"scale": {"heave": scale}}}).tables()[0]
        for scale in (1.0, -1.0)
    ]
    assert np.array_equal(tables[0].bounds, tables[1].bounds)
    assert tables[0].bounds[0] == pytest.approx(1.5 / 0.05, rel=0.01)


def test_a_reference_is_scaled_by_its_joints(tmp_path: Path) -> None:
    table = record(tmp_path, lift=np.arange(60.0)) | {"scale": {"lift": 0.5}}
    scenario = load_scenario("paper/nominal", {"reference": table, "simulation.duration": 1.0})
    assert scenario.tables()[0].coefficients[7, 0, 0] == pytest.approx(3.5)


@pytest.mark.parametrize(
    ("scale", "told"),
    [
        ({"heave": 0.0}, ["base_motion.scale.heave", "a finite number other than 0"]),
        ({"heave": math.inf}, ["base_motion.scale.heave", "a finite number other than 0"]),
        ({"shake": "x"}, ["base_motion.scale", "a finite number other than 0"]),
        ({"roll": -1.0}, ["base_motion.scale.roll", "there is no columns.roll"]),
        ({"heave": 1.0, "shake": 1.0}, ["base_motion.scale.shake", "another name of base_motion.scale.heave"]),
        ({"lift": 1.0}, ["base_motion.scale.lift", "unknown key", "heave"]),
    ],
)
def test_a_scale_that_is_none_is_told(tmp_path: Path, scale: dict[str, object], told: list[str]) -> None:
    table = record(tmp_path, heave=np.arange(60.0)) | {"scale": scale}
    with pytest.raises(InputError) as caught:
        load_scenario("paper/nominal", {"base_motion": table})
    assert all(part in str(caught.value) for part in told), str(caught.value)


DOCS = Path(__file__).parents[2] / "docs" / "conventions.md"
NED = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])  # components along x, y to starboard, z down -> ours
ENU = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])  # along x, y to port, z up -> ours


@pytest.mark.parametrize(("page", "axes"), [("ned.csv", NED), ("enu.csv", ENU), ("orcaflex.csv", ENU)])
def test_what_the_page_says_of_other_conventions(page: str, axes: np.ndarray) -> None:
    """Position and attitude of a ship told in other axes, scaled as docs/conventions.md says, are ours."""
    table = page_table(page)
    units = table.get("units", {})
    assert all(units.get(key, "rad") == ("rad" if page == "enu.csv" else "deg") for key in ("roll", "pitch", "yaw"))
    told = dict(zip(ALL, (1.0, 2.0, 3.0, 0.3, -0.4, 1.1), strict=True))
    ours = {key: value * table["scale"].get(key, 1.0) for key, value in told.items()}
    place = axes @ [told["surge"], told["sway"], told["heave"]]
    assert place.tolist() == [ours["surge"], ours["heave"], ours["sway"]]
    theirs = Rotation.from_euler("ZYX", [told["yaw"], told["pitch"], told["roll"]]).as_matrix()
    rotation = Rotation.from_euler("YZX", [ours["yaw"], ours["pitch"], ours["roll"]]).as_matrix()
    np.testing.assert_allclose(rotation, axes @ theirs @ axes.T, atol=1e-15)


def page_table(path: str) -> dict[str, Any]:
    """[base_motion] of docs/conventions.md that reads this file."""
    blocks = [tomllib.loads(text) for text in re.findall(r"```toml\n(.*?)```", DOCS.read_text("utf-8"), re.DOTALL)]
    (table,) = (b["base_motion"] for b in blocks if b["base_motion"].get("path") == path)
    return dict(table)


class Told:
    """A ship that moves at random, by large angles, as it is told in other axes: its record there, and what it feels.

    axes   their components -> ours, 3 x 3
    order  of their rotations, as SciPy names it;  heading: from which theirs count, rad about their vertical
    All is made of rotation matrices and of derivatives of their columns; nothing of springline's.
    """

    def __init__(self, axes: np.ndarray, order: str = "ZYX", heading: float = 0.0) -> None:
        random, self.t, self.axes, self.order = np.random.default_rng(7), 0.05 * np.arange(241), axes, order
        amplitudes = np.array([3.0, 2.0, 2.5, 0.9, 0.8, 1.5])[:, None] * random.uniform(0.3, 0.5, (6, 3))
        phases, rates = random.uniform(0, 7, (2, 6, 3)) * [[[1]], [[0.2]]] + [[[0]], [[0.2]]]
        surge, sway, heave, roll, pitch, yaw = np.sum(
            amplitudes[..., None] * np.sin(rates[..., None] * self.t + phases[..., None]), axis=1
        )
        ours = Rotation.from_euler("YZX", np.stack([yaw, pitch, roll], axis=1)).as_matrix()
        level = Rotation.from_euler("Z", heading).as_matrix() @ axes.T
        place = np.stack([surge, heave, sway], axis=1) @ level.T
        angles = Rotation.from_matrix(level @ ours @ axes).as_euler(order)
        by_axis = angles[:, [order.index(axis) for axis in "XYZ"]]
        self.columns = np.concatenate([place, np.unwrap(by_axis, axis=0)], axis=1)
        assert np.abs(np.stack([roll, pitch, yaw])).max(axis=1).min() > 0.4, "rad: large angles"

    def write(self, path: Path, names: list[str], angle: float) -> None:
        """angle: how many of the record's units a radian is."""
        table = np.column_stack([self.t, self.columns * [1, 1, 1, angle, angle, angle]])
        np.savetxt(path, table, "%.17g", ",", header=",".join(names), comments="")

    def felt(self, t: np.ndarray, mount: np.ndarray, rpy: list[float]) -> np.ndarray:
        """Specific force and angular rate at the foot in the arm's axes, (6, times); t well between two rows."""
        spline, h = CubicSpline(self.t, self.columns), 2e-3
        up = self.axes.T @ [0, 1, 0]
        standing = Rotation.from_euler("YZX", rpy[::-1]).as_matrix()

        def attitude(at: np.ndarray) -> Rotation:
            columns = spline(at)[:, 3:]
            return Rotation.from_euler(self.order, columns[:, ["XYZ".index(axis) for axis in self.order]])

        def foot(at: np.ndarray) -> np.ndarray:
            return np.asarray(spline(at)[:, :3] + attitude(at).apply(self.axes.T @ mount))

        weights = ((0, -49 / 18), (1, 1.5), (2, -0.15), (3, 1 / 90))
        acceleration = sum(w * (foot(t + k * h) + foot(t - k * h)) / (1 if k else 2) for k, w in weights) / h**2
        turns = [(attitude(t - k * h).inv() * attitude(t + k * h)).as_rotvec() / (2 * k * h) for k in (1, 2, 3)]
        omega = 1.5 * turns[0] - 0.6 * turns[1] + 0.1 * turns[2]
        force = attitude(t).inv().apply(acceleration + G * up)
        return np.concatenate([(vector @ self.axes.T @ standing).T for vector in (force, omega)])


@pytest.mark.parametrize("mounted", [False, True])
@pytest.mark.parametrize(("page", "axes"), [("ned.csv", NED), ("enu.csv", ENU), ("orcaflex.csv", ENU)])
def test_one_motion_told_in_each_convention_is_felt_alike(
    tmp_path: Path, page: str, axes: np.ndarray, mounted: bool
) -> None:
    """Written in each convention, read as docs/conventions.md says, six large coordinates, at times between rows."""
    table, told = page_table(page), Told(axes)
    names = [table["columns"][key] for key in ("t", *ALL)]
    told.write(tmp_path / page, names, 180 / math.pi if table.get("units") else 1.0)
    mount, rpy = (np.array([-25.0, 6.0, 4.5]), [0.3, -0.2, 2.5]) if mounted else (np.zeros(3), [0.0, 0.0, 0.0])
    table |= {"path": str(tmp_path / page), "mount": mount.tolist(), "mount_rpy": rpy}
    scenario = load_scenario("paper/nominal", {"base_motion": table})
    at = told.t[10:-10:7] + 0.021
    found, expected = readings(scenario, at), told.felt(at, mount, rpy)
    np.testing.assert_allclose(found, expected, atol=2e-6)
    same = readings(load_scenario("paper/nominal", {"base_motion": table | {"scale": {}}}), at)
    assert np.abs(same - expected).max(axis=1).min() > 0.05, "the scale counts in each of the six"


def test_another_order_of_rotations_is_written_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As a buoy's in OrcaFlex, and about another heading: no scale makes it right, the page's lines do."""
    told, table, ours = Told(ENU, "XYZ", heading=0.7), page_table("orcaflex.csv"), Told(ENU)
    names = [table["columns"][key] for key in ("t", *ALL)]
    told.write(tmp_path / "orcaflex.csv", names, 180 / math.pi)
    (script,) = re.findall(r"```python\n(.*?)```", DOCS.read_text("utf-8"), re.DOTALL)
    monkeypatch.chdir(tmp_path)
    exec(compile(script, str(DOCS), "exec"), {})  # noqa: S102
    at = told.t[10:-10:7] + 0.021

    def felt(file: str) -> np.ndarray:
        changed = table | {"path": str(tmp_path / file)}
        return readings(load_scenario("paper/nominal", {"base_motion": changed}), at)

    # The rows are the same; between them either record has splines through its own angles.
    expected = ours.felt(at, np.zeros(3), [0.0, 0.0, 0.0])
    assert np.abs(felt("turned.csv") - expected).max() < 2e-6
    assert np.abs(felt("orcaflex.csv") - expected).max() > 1.0

    said = re.findall(r"^\| (\d+)° \| ([\d.]+)° \| ([\d.]+) m/s² \|$", DOCS.read_text("utf-8"), re.MULTILINE)
    assert len(said) == 4
    for angle, off, force in said:
        angles = [float(angle)] * 3
        buoy, vessel = (Rotation.from_euler(order, angles, degrees=True) for order in ("XYZ", "ZYX"))
        attitude = math.degrees((buoy.inv() * vessel).magnitude())
        rest = np.linalg.norm(buoy.inv().apply([0, 0, G]) - vessel.inv().apply([0, 0, G]))
        with capsys.disabled():
            print(f"\nthree angles of {angle} deg in the other order: {attitude:.3g} deg, {rest:.3g} m/s^2 at rest")
        digits = [len(text.partition(".")[2]) for text in (off, force)]
        assert [f"{attitude:.{digits[0]}f}", f"{rest:.{digits[1]}f}"] == [off, force]


def test_the_picture_says_what_the_model_does() -> None:
    said = f"<!-- shown: {conventions.shown()} -->".encode()
    picture = DOCS.parent / "images" / "conventions.svg"
    assert said in picture.read_bytes(), "stale: run `make docs-pictures`"
    assert said in conventions.drawn() and conventions.drawn() == conventions.drawn()
    assert [conventions.sense(view) for view in conventions.VIEWS] == [1, -1, 1]
    assert "](images/conventions.svg)" in DOCS.read_text("utf-8")


# Mounts


def test_a_mount_is_structure_and_its_numbers_are_tunable(load: Any) -> None:
    plain = load(base(f"pitch = {TERM}"))
    assert plain.structure() == load(base(f"pitch = {TERM}\nmount = [0, 0, 0]\nmount_rpy = [0, 0, 0]")).structure()
    there = plain.with_overrides({"base_motion.mount": [2.0, 0.0, -1.0]})
    keys = set(there.numeric_keys()) - set(plain.numeric_keys())
    assert keys == {f"base_motion.mount.{i}" for i in range(3)}
    far = np.array([2.0, 5.0, 0.0])
    table = batch(there, {"base_motion.mount.0": far})
    for x, row in zip(far.tolist(), table.to_pylist(), strict=True):
        alone = simulate(there.with_overrides({"base_motion.mount.0": x})).metrics.to_pylist()[0]
        assert {name: row[name] for name in alone} == alone
    assert len(set(table["rms_error_lift"].to_pylist())) == 3


def test_a_mount_stays_when_the_motion_is_another(load: Any) -> None:
    scenario = load(base("mount = [1.0, 2.0, 3.0]\nmount_rpy = [0.1, 0.0, 0.0]", "none"))
    changed = scenario.with_overrides({"base_motion.kind": "sine", "base_motion.sway": [{"amplitude": 1, "omega": 2}]})
    assert changed.document["base_motion"]["mount"] == [1.0, 2.0, 3.0]
    assert changed.structure().mount_rpy


def test_an_arm_on_an_inclined_base_hangs_on_its_springs(load: Any) -> None:
    """At rest on a slope the springs carry what is left of the weight, and the controller knows it."""
    text = base("mount_rpy = [0.3, 0.2, 1.0]", "none") + '[initial]\nq_motor = "equilibrium"\n'
    scenario = load(text)
    up = Rotation.from_euler("YZX", [1.0, 0.2, 0.3]).inv().apply([0, 9.8, 0])
    q = np.array([0.8, 0.5])
    along = 40 * 0.74 * np.array([-np.sin(q[1]), np.cos(q[1])])
    weight = scenario.system().function("gravity")(q, scenario.values()).full()[:, 0]
    np.testing.assert_allclose(weight, [50 * up[1], along @ up[:2]], rtol=1e-13)
    first = simulate(scenario).trajectory.to_pylist()[0]
    stretch = np.array([first["q2_lift"] - q[0], first["q2_rotation"] - q[1]]) * [2e6, 2e4]
    np.testing.assert_allclose(stretch, weight, rtol=1e-9)
    control = scenario.system().function("control")
    rest = np.concatenate([q, np.zeros(2), q, np.zeros(2)])
    command = control(q, np.zeros(2), np.zeros(2), rest, scenario.values())[0].full()[:, 0]
    np.testing.assert_allclose(command, weight, rtol=1e-12)


# Everywhere the same


SIX = "\n".join(f"{key} = [{{ amplitude = {0.01 * (k + 1)}, omega = {2.0 + k} }}]" for k, key in enumerate(ALL))
MOUNTED = f"{SIX}\nmount = [3.0, 2.0, -1.0]\nmount_rpy = [0.1, -0.2, 0.5]"


def test_columns_of_what_moves(load: Any) -> None:
    def names(text: str) -> list[str]:
        """The base's columns: those between the command's and the tip's."""
        columns = simulate(load(base(text))).trajectory.column_names
        return columns[columns.index("U_rotation") + 1 : columns.index("tip_x_ship")]

    assert names(MOUNTED) == ["y_r1", "theta_1z", "theta_1x", "surge", "sway", "yaw"]
    assert names(f"yaw = {TERM}") == ["y_r1", "theta_1z", "theta_1x", "yaw"]
    assert names(f"heave = {TERM}") == ["y_r1", "theta_1z", "theta_1x"]


def test_both_engines_and_a_lane_of_a_batch_give_the_same_bits(load: Any) -> None:
    scenario = load(base(MOUNTED))
    lanes, casadi = simulate(scenario), simulate(scenario, engine="casadi")
    assert lanes.status == "ok" and lanes.trajectory.equals(casadi.trajectory)
    yaw = lanes.trajectory["yaw"].to_numpy()
    np.testing.assert_allclose(yaw, 0.06 * np.sin(7.0 * lanes.trajectory["t"].to_numpy()), atol=1e-15)
    amplitudes = np.array([0.03, 0.06, 0.09])
    table = batch(scenario, {"base_motion.yaw.0.amplitude": amplitudes})
    alone = lanes.metrics.to_pylist()[0]
    assert {name: table.to_pylist()[1][name] for name in alone} == alone


# A user's own


MOTION = """
import math; import casadi as ca
from springline.model import BaseMotion, Parameter

class Circle(BaseMotion):
    '''Steams in a circle, and heels.'''

    parameters = (Parameter("radius", "m", 200.0, "of the circle"), Parameter("rate", "rad/s", 0.05, "of turning"),
                  Parameter("heel", "rad", 0.03, "while turning"))

    def motion(self, t, p):
        angle = p.rate * t
        return [p.radius * ca.sin(angle), p.radius * (ca.cos(angle) - 1), 0, p.heel, 0, angle]
"""


@pytest.fixture
def circle(tmp_path: Path) -> Path:
    (tmp_path / "circle.py").write_text(MOTION)
    (tmp_path / "c.toml").write_text(base("radius = 150.0", "circle.py:Circle"))
    return tmp_path / "c.toml"


def test_a_motion_of_a_users_own_moves_the_base(circle: Path) -> None:
    scenario = load_scenario(circle)
    assert scenario.document["base_motion"]["rate"] == 0.05
    shape = scenario.structure().base_motion
    assert shape.kind == "own" and shape.terms == (0, 0, 1, 1, 1, 1), "heave, pitch: exactly zero"
    lanes, casadi = simulate(scenario), simulate(scenario, engine="casadi")
    assert lanes.status == "ok" and lanes.trajectory.equals(casadi.trajectory)
    t = lanes.trajectory["t"].to_numpy()
    np.testing.assert_allclose(lanes.trajectory["surge"].to_numpy(), 150 * np.sin(0.05 * t), atol=1e-12)
    np.testing.assert_allclose(lanes.trajectory["theta_1x"].to_numpy(), 0.03, atol=0)
    system = scenario.system()
    w = system.function("signals")(1.7, np.zeros(0), scenario.values()).full()[:, 0]
    _, db, ddb = np.split(w[3 * system.n :], 3)
    turn = 0.05 * 1.7
    np.testing.assert_allclose(db, [0, 0, 0, 7.5 * np.cos(turn), -7.5 * np.sin(turn), 0.05], atol=1e-13)
    np.testing.assert_allclose(ddb, [0, 0, 0, -0.375 * np.sin(turn), -0.375 * np.cos(turn), 0], atol=1e-13)


def test_its_motion_is_in_the_exported_c(circle: Path, tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["export", "c", str(circle), "-o", str(tmp_path / "c")], prog_name="springline")
    assert done.exit_code == 0, done.output
    (tmp_path / "main.c").write_text("""
        #include <stdio.h>
        #include "springline.h"
        static springline_controller controller;
        int main(void) {
          springline_reference reference;
          springline_base base;
          springline_init(&controller, &springline_default_config);
          springline_signals(&controller, 1.7, &reference, &base);
          printf("%.17g %.17g %.17g\\n", base.d_surge, base.theta_1x, base.dd_sway);
          return 0;
        }
    """)
    include = [f"-I{tmp_path}/c/include", f"-I{tmp_path}/c/src"]
    sources = [tmp_path / "main.c", tmp_path / "c" / "src" / "springline.c"]
    subprocess.run(["cc", "-std=c99", *include, *sources, "-o", tmp_path / "main"], check=True)
    printed = subprocess.run([tmp_path / "main"], capture_output=True, text=True, check=True).stdout.split()
    expected = [7.5 * math.cos(0.085), 0.03, -0.375 * math.cos(0.085)]
    np.testing.assert_allclose([float(word) for word in printed], expected, rtol=1e-15)


def test_its_parameters_vary_and_its_file_travels(circle: Path, tmp_path: Path) -> None:
    scenario = load_scenario(circle)
    table = batch(scenario, {"base_motion.rate": np.array([0.0, 0.05, 0.2])})
    alone = simulate(scenario).metrics.to_pylist()[0]
    assert {name: table.to_pylist()[1][name] for name in alone} == alone
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "again.toml").write_text(scenario.to_toml(tmp_path / "results"))
    again = load_scenario(tmp_path / "results" / "again.toml")
    assert again == scenario and 'kind = "../circle.py:Circle"' in scenario.to_toml(tmp_path / "results")
    other = scenario.with_overrides({"base_motion.kind": "none"})
    assert other.document["base_motion"].keys() == {"kind", "mount", "mount_rpy"} and not other.code
    back = other.with_overrides({"base_motion.kind": str(circle.parent / "circle.py:Circle")})
    assert back.document["base_motion"]["radius"] == 200.0
    with_mount = scenario.with_overrides({"base_motion.mount": [1, 2, 3]})
    assert with_mount.structure().mount and simulate(with_mount).status == "ok"


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("angle]\n", "angle, 0]\n", ["motion: expected six expressions (surge, sway, heave, roll, pitch, yaw), got 7"]),
        ("return [", "return 0 and [", ["motion: expected six expressions", "got int"]),
        ("0, p.heel", "ca.SX.sym('x'), p.heel", ["motion, heave: depends on 'x', which it was not given"]),
        ("0, p.heel", "'up', p.heel", ["motion, heave: expected a CasADi SX expression, got str"]),
        ("0, p.heel", "ca.SX(2, 1), p.heel", ["motion, heave: expected a scalar, got 2 x 1"]),
        ("ca.sin(angle)", "math.sin(angle)", ["motion, surge: contains NaN", "use those of casadi"]),
        ("p.rate * t", "p.speed * t", ["there is no 'speed' here, but radius, rate, heel", "line 12"]),
        ("radius", "heave", ["parameters: 'heave' is a key of [base_motion] already"]),
        ('"of turning")', '"of turning", per_joint=True)', ["parameters, rate: expected one number"]),
        ("BaseMotion)", "object)", ["expected a subclass of springline.model.BaseMotion"]),
        ("def motion", "def move", ["abstract method"]),
    ],
)
def test_a_motion_that_is_none_is_told(circle: Path, old: str, new: str, told: list[str]) -> None:
    text = MOTION.replace("(BaseMotion)", "(object)") if new == "object)" else MOTION.replace(old, new)
    (circle.parent / "circle.py").write_text(text)
    with pytest.raises(InputError) as caught:
        load_scenario(circle)
    message = str(caught.value)
    assert "base_motion.kind" in message and "circle.py:Circle" in message, message
    assert all(part in message for part in told), message


def test_a_motion_that_jumps_is_warned_of(circle: Path) -> None:
    """By every command; it runs all the same."""
    assert not load_scenario(circle).notes
    (circle.parent / "circle.py").write_text(MOTION.replace("0, p.heel", "0.1 * ca.fabs(t - 0.01), ca.sign(t - 0.015)"))
    heave, roll = load_scenario(circle).notes
    assert "/circle.py:Circle: the rate of heave jumps by 0.2 m/s at 0.01 s: the arm feels" in heave
    assert "base_motion.kind: " in roll and "roll jumps by 2 rad at 0.015 s: " in roll and "tanh" in roll
    done = springline("run", circle, "-o", circle.parent / "out", "--no-plot")
    assert done.exit_code == 0 and "the rate of heave jumps" in done.stderr
    assert not load_scenario(circle, {"simulation.duration": 0.005}).notes


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("speed = 3.0", ["base_motion.speed", "unknown key", "radius"]),
        ("radius = inf", ["base_motion.radius", "a finite number [m]"]),
        ("heave = []", ["base_motion.heave", "only goes with kind = 'sine'"]),
    ],
)
def test_wrong_keys_beside_it_are_told(circle: Path, text: str, told: list[str]) -> None:
    circle.write_text(base(text, "circle.py:Circle"))
    with pytest.raises(InputError) as caught:
        load_scenario(circle)
    assert all(part in str(caught.value) for part in told), str(caught.value)


def springline(*arguments: object) -> Any:
    return CliRunner().invoke(app, [str(argument) for argument in arguments], prog_name="springline")


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("drive.link_viscous", "is zero in this scenario"),
        ("plant.spring_damping.0", "give it a value other than 0"),
        ("base_motion.mount.1", "is zero in this scenario"),
        ("drive.coulomb_velocity", "only counts beside a Coulomb friction"),
    ],
)
def test_what_is_absent_at_zero_is_told_so_where_it_should_be_tunable(load: Any, name: str, told: str) -> None:
    scenario = load(base(f"heave = {TERM}"))
    with pytest.raises(ValueError, match=f"'{name}' {told}|{told}"):
        bind(scenario.structure(), scenario.values(), tunable=[name])


def test_either_name_is_tunable_in_c(load: Any, tmp_path: Path) -> None:
    load(base(f"heave = {TERM}"))
    headers = []
    for name in ("shake", "heave"):
        done = springline("export", "c", tmp_path / "s.toml", "-o", tmp_path / name, "--tunable", f"base_motion.{name}")
        assert done.exit_code == 0, done.output
        headers.append((tmp_path / name / "include" / "springline.h").read_text())
    assert headers[0] == headers[1] and "base_motion_shake_0_omega;" in headers[0]


def test_a_sweep_over_it_can_be_replayed(circle: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Over its parameters, and over mounts from none on."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sweep.toml").write_text("""
        scenario = "c.toml"
        method = "grid"
        [vary]
        "base_motion.mount.0" = { values = [0.0, 3.0] }
        "base_motion.rate" = { values = [0.02, 0.2] }
    """)
    assert springline("batch", "sweep.toml", "-o", "data", "--no-plot", "--jobs", 1).exit_code == 0
    for run in (0, 1, 3):
        done = springline("replay", "data", run, "--no-plot", "-o", f"run{run}", "--code", "circle.py")
        assert done.exit_code == 0 and "bit for bit" in done.output, done.output


@pytest.mark.parametrize(
    ("vary", "groups"),
    [
        ("base_motion.mount_rpy.0 = { values = [0.0, 0.1, -0.2] }", 3),
        ("base_motion.mount_rpy.0 = { values = [0.1, 0.3] }", 1),
        ("base_motion.mount_rpy.0 = { values = [0.0, 0.1] }\nbase_motion.mount_rpy.2 = { values = [0.0, 0.5] }", 4),
        ("base_motion.mount_rpy.0 = { values = [0.0, 0.1] }\nbase_motion.mount_rpy.2 = { values = [0.2, 0.5] }", 1),
        ("base_motion.mount_rpy.1 = { values = [0.0, 0.5] }", 1),
        ("base_motion.mount.0 = { values = [0.0, 2.0] }\nbase_motion.mount_rpy.0 = { values = [0.0, 0.1] }", 4),
        ("base_motion.mount_rpy.0 = { uniform = [0.05, 0.2], points = 3 }", 1),
    ],
)
def test_an_arm_that_stands_as_its_base_does_among_others_that_do_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, vary: str, groups: int
) -> None:
    """Equations without a mount round otherwise: such runs have a kernel of their own, and every one is replayed."""
    monkeypatch.chdir(tmp_path)
    Path("s.toml").write_text(base(f"{SIX}\nmount = [2.0, 0.0, 0.0]\nmount_rpy = [0.1, 0.0, 0.0]"))
    Path("w.toml").write_text(f'scenario = "s.toml"\nmethod = "grid"\n[vary]\n{vary}\n')
    plan = Plan(load_sweep(Path("w.toml")))
    assert len(plan.groups) == groups
    for group in plan.groups:
        for run in range(group.first, group.first + group.runs):
            assert plan.scenario_of(run).structure() == group.work.spec.structure


def test_a_run_without_a_mount_is_replayed_bit_for_bit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("s.toml").write_text(base(f"{SIX}\nmount_rpy = [0.1, 0.0, 0.0]").replace("0.02", "0.3"))
    vary = "base_motion.mount_rpy.0 = { values = [0.0, 0.1] }\ncontrol.delta = { values = [0.04, 0.05] }"
    Path("w.toml").write_text(f'scenario = "s.toml"\nmethod = "grid"\n[vary]\n{vary}\n')
    assert springline("batch", "w.toml", "-o", "data", "--no-plot", "--jobs", 1).exit_code == 0
    for run in range(4):
        done = springline("replay", "data", run, "--no-plot", "-o", f"run{run}")
        assert done.exit_code == 0 and "bit for bit" in done.output, done.output
    for points in ("[0.0, 0.2], points = 3", "[-0.1, 0.1], points = 5"):
        Path("w.toml").write_text(
            f'scenario = "s.toml"\nmethod = "grid"\n[vary]\nbase_motion.mount_rpy.0 = {{ uniform = {points} }}\n'
        )
        refused = springline("batch", "w.toml", "-o", "other", "--dry-run")
        assert refused.exit_code == 2 and "vary.base_motion.mount_rpy.0: " in refused.stderr, refused.output
        assert "{ values = [...] }" in refused.stderr


def test_commands_take_it_and_refuse_it_without_code(circle: Path, tmp_path: Path) -> None:
    done = springline("run", circle, "-o", tmp_path / "out", "--no-plot", "--set", "base_motion.radius=90.0")
    assert done.exit_code == 0, done.output
    refused = springline("run", circle, "-o", tmp_path / "no", "--no-plot", "--no-code")
    assert refused.exit_code == 2 and "base_motion.kind" in refused.stderr
    assert not (tmp_path / "no").exists()
