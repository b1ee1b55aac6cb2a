"""The loop is described once: what is added to it is in the batch kernel, the exported C and FMUs alike."""

from __future__ import annotations

import io
import subprocess
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from arms import structure_of, values_of
from chains import chain, numbers_for
from fmi_client import Client, client_library
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from printed import with_whole_comments

from springline.codegen.export import bind
from springline.codegen.export.c import generate_files
from springline.codegen.export.fmu import Settings, fmu
from springline.codegen.export.fmu import archive as fmu_module
from springline.codegen.files import write_tree
from springline.codegen.kernel import KernelOptions, KernelSpec, LoopSettings, kernel
from springline.codegen.program import program
from springline.model.drive import FRICTION
from springline.model.hardware import EFFECTS, Effect
from springline.model.mechanisms import MECHANISMS
from springline.model.parameters import Values
from springline.model.quantities import Q1, Quantity
from springline.model.structure import SignalShape, Structure
from springline.model.system import System

pytestmark = pytest.mark.usefixtures("other_arms")

STEP, STEPS, HOLD = 1e-4, 400, 10
QUICK = ("-O0",)  # optimisation changes no bit: test_engines.py, test_fmu.py and test_export_c.py compare its levels


class WeakMotor(Effect):
    """A motor that gives four fifths of what it is told."""

    name = "weak_motor"

    def actuate(self, u: ca.SX) -> ca.SX:
        return 0.8 * u


class LateBus(Effect):
    """A bus between controller and motor that adds a bias: seen before what a motor makes of it."""

    name = "late_bus"

    def delay(self, u: ca.SX) -> ca.SX:
        return u + 0.5


class Offset(Effect):
    """Encoders that are a millimetre or milliradian off."""

    name = "offset"

    def sense(
        self, y: Mapping[Quantity, ca.SX], p: Values, noise: Mapping[Quantity, ca.SX]
    ) -> Mapping[Quantity, ca.SX]:
        return {**y, Q1: y[Q1] + 1e-3}


@pytest.fixture(autouse=True)
def _fmus_that_are_compiled_quickly(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fmu_module, "_FLAGS", (*fmu_module._FLAGS, *QUICK))


@pytest.fixture(autouse=True)
def _made_up_effects() -> Iterator[None]:
    effects = (WeakMotor(), LateBus(), Offset())
    EFFECTS.update({effect.name: effect for effect in effects})
    yield
    for effect in effects:
        del EFFECTS[effect.name]


def rows_of(
    structure: Structure, sampled: bool, every: int = HOLD, values: np.ndarray | None = None, **options: Any
) -> np.ndarray:
    loop = kernel(KernelSpec(structure, sampled, options=KernelOptions(flags=QUICK, **options)))
    values = values_of(structure) if values is None else values
    runs = loop.run(values[None], LoopSettings(STEPS, STEP, hold=HOLD, output_every=every))
    assert runs.status[0] == 0
    return runs.trajectory[0]


def names_of(structure: Structure) -> list[str]:
    """Columns of the state, then of the command."""
    arm = MECHANISMS[structure.mechanism].of_size(structure.size)
    state = ("q1", "dq1") if structure.drive == "rigid" else ("q1", "dq1", "q2", "dq2")
    return [f"{quantity}_{joint.name}" for quantity in (*state, "U") for joint in arm.joints]


def fmu_rows(
    structure: Structure, sampled: bool, version: int, folder: Path, values: np.ndarray | None = None
) -> np.ndarray:
    settings = Settings(duration=STEPS * STEP, step=STEP, period=HOLD * STEP if sampled else 0.0)
    values = values_of(structure) if values is None else values
    content = fmu(structure, values, settings, part="loop", version=version, identifier="arm", name="arm")
    path = folder / f"arm{version}{int(sampled)}.fmu"
    path.write_bytes(content)
    client = Client(path, folder).start()
    names = names_of(structure)
    rows = [client.get(names)]
    for k in range(STEPS // HOLD):
        client.step(k * HOLD * STEP, HOLD * STEP)
        rows.append(client.get(names))
    return np.array(rows)


def exported_rows(structure: Structure, folder: Path, values: np.ndarray | None = None) -> np.ndarray:
    """What main.c prints: the exported step and plant step under sampled control."""
    values = values_of(structure) if values is None else values
    write_tree(folder / "c", *generate_files(bind(structure, values)))
    program = folder / "main"
    source = folder / "c"
    subprocess.run(
        ["cc", *QUICK, "-ffp-contract=off", "-std=c99", f"-I{source}/include", f"-I{source}/src",
         source / "src" / "springline.c", source / "main.c", "-o", program],
        check=True,
    )  # fmt: skip
    printed = subprocess.run([program, "1"], capture_output=True, text=True, check=True).stdout.splitlines()
    header, rows = printed[0].split(","), [[float(word) for word in line.split(",")] for line in printed[1:]]
    joints = [joint.name for joint in MECHANISMS[structure.mechanism].of_size(structure.size).joints]
    wanted = [header.index(f"{quantity}_{joint}") for quantity in ("q1", "U") for joint in joints]
    return np.array(rows)[:, wanted]


def of_state_and_command(structure: Structure, rows: np.ndarray) -> np.ndarray:
    n = len(MECHANISMS[structure.mechanism].of_size(structure.size).joints)
    states = (2 if structure.drive == "rigid" else 4) * n
    return np.hstack([rows[:, 1 : 1 + states], rows[:, 1 + states + 3 * n : 1 + states + 4 * n]])


@pytest.mark.parametrize("effect", ["weak_motor", "late_bus", "offset"])
def test_an_effect_reaches_batch_exported_c_and_fmu(effect: str, tmp_path: Path) -> None:
    structure, ideal = structure_of("one_link", effects=(effect,)), structure_of("one_link")
    for sampled in (True, False):
        rows = rows_of(structure, sampled, width=4, groups=1)
        assert np.max(np.abs(rows - rows_of(ideal, sampled, width=4, groups=1))) > 1e-4
        np.testing.assert_array_equal(rows, rows_of(structure, sampled, engine="casadi"))
        expected = of_state_and_command(structure, rows)
        np.testing.assert_array_equal(fmu_rows(structure, sampled, 3, tmp_path), expected)
    sampled_rows = rows_of(structure, True, every=100)
    expected = np.hstack([sampled_rows[:, 1:2], sampled_rows[:, 8:9]])  # q1 and U
    np.testing.assert_array_equal(exported_rows(structure, tmp_path)[: len(expected)], expected)


def test_a_command_is_delayed_before_the_motors_act_on_it() -> None:
    """Whatever the order in which a structure names the effects."""
    for names in (("weak_motor", "late_bus"), ("late_bus", "weak_motor")):
        system = System(structure_of("one_link", effects=names))
        plant, values = system.function("loop_plant"), [slot.default for slot in system.slots]
        w, x = np.zeros(system.w.numel()), np.zeros(system.x.numel())
        ideal = System(structure_of("one_link")).function("loop_plant")
        np.testing.assert_array_equal(plant(w, x, 2.0, values), ideal(w, x, 0.8 * (2.0 + 0.5), values))


ALL_FRICTION = tuple(item.name for item in FRICTION)
# Arms, drives and integrators by turns; dop853 for what keeps slopes and has many nodes.
OTHERS = [
    ("one_link", "elastic", "rk4", ALL_FRICTION),
    ("one_link", "rigid", "dop853", ()),
    ("one_link", "rigid", "euler", ()),
    ("three_links", "elastic", "dop853", ()),
    ("three_links", "rigid", "midpoint", ALL_FRICTION[1:]),
]


@pytest.mark.parametrize(("mechanism", "drive", "integrator", "friction"), OTHERS)
def test_other_arms_have_the_same_bits_in_both_engines_and_in_fmus(
    mechanism: str, drive: str, integrator: str, friction: tuple[str, ...], tmp_path: Path
) -> None:
    structure = structure_of(mechanism, drive=drive, integrator=integrator, friction=friction)
    for sampled, version in ((True, 2), (False, 3)):
        rows = rows_of(structure, sampled, width=4, groups=2)
        assert np.isfinite(rows).all()
        np.testing.assert_array_equal(rows, rows_of(structure, sampled, engine="casadi"))
        expected = of_state_and_command(structure, rows)
        np.testing.assert_array_equal(fmu_rows(structure, sampled, version, tmp_path), expected)


@pytest.mark.parametrize(("mechanism", "drive", "integrator", "friction"), OTHERS)
def test_other_arms_are_exported_as_c_that_checks_itself(
    mechanism: str, drive: str, integrator: str, friction: tuple[str, ...], tmp_path: Path
) -> None:
    structure = structure_of(mechanism, drive=drive, integrator=integrator, friction=friction)
    folder = tmp_path / "c"
    write_tree(folder, *generate_files(bind(structure, values_of(structure), tunable=["control"], prefix="other_arm")))
    includes = [f"-I{folder}/include", f"-I{folder}/src"]
    sources = [folder / "src" / "other_arm.c", folder / "src" / "other_arm_model.c", folder / "self_check.c"]
    warnings = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Werror", *QUICK, "-ffp-contract=off"]
    subprocess.run(["cc", *warnings, *includes, *sources, "-o", tmp_path / "check"], check=True)
    done = subprocess.run(
        [tmp_path / "check", folder / "test_vectors.txt"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout
    texts = "".join(path.read_text() for path in folder.rglob("*") if path.suffix in (".c", ".h", ".md", ".txt"))
    for foreign in ("lift", "rotation", "Guo", "kHz", "0.7 ms"):
        assert foreign not in texts


SHIP = {"base_motion": SignalShape("sine", (1,) * 6), "mount": True, "mount_rpy": True}


def test_an_arm_mounted_on_a_ship_in_six_degrees_has_the_same_bits_everywhere(tmp_path: Path) -> None:
    """Lanes, CasADi's C, both FMUs, the exported step and plant step; and a base that is another is another run."""
    structure = structure_of("transfer_manipulator", **SHIP)
    for sampled, version in ((True, 2), (False, 3)):
        rows = rows_of(structure, sampled, width=4, groups=2)
        np.testing.assert_array_equal(rows, rows_of(structure, sampled, engine="casadi"))
        expected = of_state_and_command(structure, rows)
        np.testing.assert_array_equal(fmu_rows(structure, sampled, version, tmp_path), expected)
    for without in ({"mount": False}, {"mount_rpy": False}, {"base_motion": SignalShape("sine", (1,) * 5)}):
        other = rows_of(structure_of("transfer_manipulator", **SHIP | without), False, width=4, groups=2)
        assert np.max(np.abs(of_state_and_command(structure, other) - expected)) > 1e-4, without
    sampled_rows = rows_of(structure, True, every=100)
    n = len(MECHANISMS["transfer_manipulator"].joints)
    wanted = np.hstack([sampled_rows[:, 1 : 1 + n], sampled_rows[:, 1 + 7 * n : 1 + 8 * n]])  # q1 and U
    np.testing.assert_array_equal(exported_rows(structure, tmp_path)[: len(wanted)], wanted)


def test_exported_c_of_a_ship_has_what_moves_and_checks_itself(tmp_path: Path) -> None:
    structure = structure_of("transfer_manipulator", **SHIP | {"base_motion": SignalShape("sine", (1, 1, 1, 0, 0, 1))})
    folder = tmp_path / "c"
    tunable = ["base_motion"]
    write_tree(folder, *generate_files(bind(structure, values_of(structure), tunable=tunable)))
    header = with_whole_comments((folder / "include" / "springline.h").read_text())
    for member, told in (
        ("dd_yaw;", "rad/s^2; acceleration of the base: yaw, bow to port"),
        ("mount_z;", "m; where the arm stands on the base: z, to starboard"),
        ("mount_rpy_yaw;", "rad; how the arm's axes are turned on the base: yaw, about y"),
        ("base_motion_shake_0_amplitude;", "m; amplitude of heave term 0"),
    ):
        (line,) = (line for line in header.splitlines() if f" {member}" in line)
        assert told in line
    assert "surge" not in header and "sway" not in header
    sources = [folder / "src" / "springline.c", folder / "src" / "springline_model.c", folder / "self_check.c"]
    warnings = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Werror", *QUICK, "-ffp-contract=off"]
    includes = [f"-I{folder}/include", f"-I{folder}/src"]
    subprocess.run(["cc", *warnings, *includes, *sources, "-o", tmp_path / "check"], check=True)
    checked = [tmp_path / "check", folder / "test_vectors.txt"]
    done = subprocess.run(checked, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


@settings(max_examples=3, suppress_health_check=[HealthCheck.function_scoped_fixture], phases=[Phase.generate])
@given(
    kinds=st.text("rp", min_size=1, max_size=5),
    frames=st.sampled_from(["generic", "quarter"]),
    seed=st.integers(0, 2**32 - 1),
)
def test_any_chain_on_a_ship_is_the_same_everywhere(
    kinds: str, frames: str, seed: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Lanes, CasADi's C, its virtual machine, the exported plant step and an FMU, with friction and forces."""
    arm, folder = chain(kinds, frames), tmp_path_factory.mktemp("chain")
    arm.name = f"chain_{kinds}_{frames}"  # kernels and programs are known by the structure, so by the name
    with pytest.MonkeyPatch.context() as patched:
        patched.setitem(MECHANISMS, arm.name, arm)
        pushed = SignalShape("sine", (1,) * len(kinds))
        structure = structure_of(arm.name, friction=ALL_FRICTION, disturbance=pushed, **SHIP)
        numbers = numbers_for(len(kinds), np.random.default_rng(seed))
        values = values_of(
            structure, {f"{table}.{k}": v for k, v in numbers.items() for table in ("plant", "mechanism")}
        )
        rows = rows_of(structure, True, values=values, width=4, groups=2)
        assert np.isfinite(rows).all()
        np.testing.assert_array_equal(rows, rows_of(structure, True, values=values, engine="casadi"))
        expected = of_state_and_command(structure, rows)
        np.testing.assert_array_equal(fmu_rows(structure, True, 3, folder, values), expected)
        every = rows_of(structure, True, every=100, values=values)
        wanted = of_state_and_command(structure, every)
        n = len(kinds)
        wanted = np.hstack([wanted[:, :n], wanted[:, 4 * n :]])
        np.testing.assert_array_equal(exported_rows(structure, folder, values)[: len(wanted)], wanted)
        system, first = program(structure).system, rows_of(structure, True, every=1, values=values)[:2]
        w = np.array([system.function("signals")(t, [], values) for t in (0.0, STEP / 2, STEP)]).squeeze(axis=2)
        x, u = of_state_and_command(structure, first)[0, : 4 * n], of_state_and_command(structure, first)[0, 4 * n :]
        k1, *_ = slopes = [np.array(system.function("loop_plant")(w[0], x, u, values)).ravel()]
        for at, factor in ((1, 0.5), (1, 0.5), (2, 1.0)):
            state = x + factor * STEP * slopes[-1]
            slopes.append(np.array(system.function("loop_plant")(w[at], state, u, values)).ravel())
        stepped = x + STEP / 6 * (k1 + 2 * slopes[1] + 2 * slopes[2] + slopes[3])
        scale = np.abs(stepped).max() + STEP * np.abs(slopes).max()
        np.testing.assert_allclose(of_state_and_command(structure, first)[1, : 4 * n], stepped, atol=1e-12 * scale)


@pytest.mark.parametrize(
    ("mechanism", "n"),
    [("planar_arm", 1), ("planar_arm", 7), pytest.param("spatial_arm", 7, marks=pytest.mark.full)],  # slow to compile
)
def test_an_arm_on_a_ship_is_the_same_everywhere(mechanism: str, n: int, tmp_path: Path) -> None:
    """Lanes, one lane, CasADi's C, both FMUs, which are valid, and the exported step and plant step."""
    structure = structure_of(mechanism, size=n if mechanism == "planar_arm" else 0, **SHIP)
    rows = rows_of(structure, True, width=4, groups=1)
    assert np.isfinite(rows).all()
    for options in ({"width": 1, "groups": 1}, {"engine": "casadi"}):
        np.testing.assert_array_equal(rows_of(structure, True, **options), rows)
    expected = of_state_and_command(structure, rows)
    for version in (2, 3):
        np.testing.assert_array_equal(fmu_rows(structure, True, version, tmp_path), expected)
        assert client_library("fmpy.validation").validate_fmu(str(tmp_path / f"arm{version}1.fmu")) == []
    every = expected[::10]  # main.c prints one row in ten
    wanted = np.hstack([every[:, :n], every[:, 4 * n :]])
    np.testing.assert_array_equal(exported_rows(structure, tmp_path)[: len(wanted)], wanted)


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("part", ["plant", "loop"])
def test_fmus_of_a_ship_are_valid(part: Any, version: Any, tmp_path: Path) -> None:
    structure = structure_of("transfer_manipulator", **SHIP)
    settings = Settings(duration=1.0, step=STEP, period=1e-3)
    content = fmu(structure, values_of(structure), settings, part=part, version=version, identifier="a", name="a")
    described = zipfile.ZipFile(io.BytesIO(content)).read("modelDescription.xml").decode()
    for name in ("surge", "dd_sway", "d_yaw", "y_r1"):
        assert f'name="{name}"' in described
    (tmp_path / "a.fmu").write_bytes(content)
    assert client_library("fmpy.validation").validate_fmu(str(tmp_path / "a.fmu")) == []


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("part", ["controller", "plant", "loop"])
def test_fmus_of_another_arm_are_valid(part: Any, version: Any, tmp_path: Path) -> None:
    structure = structure_of("three_links")
    settings = Settings(duration=1.0, step=STEP, period=1e-3)
    content = fmu(structure, values_of(structure), settings, part=part, version=version, identifier="a", name="a")
    page = zipfile.ZipFile(io.BytesIO(content)).read("documentation/index.html").decode()
    for foreign in ("lift", "rotation", "Guo", "series"):
        assert foreign not in page
    (tmp_path / "a.fmu").write_bytes(content)
    assert client_library("fmpy.validation").validate_fmu(str(tmp_path / "a.fmu")) == []
