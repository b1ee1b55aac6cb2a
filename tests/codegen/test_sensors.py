"""Sensors that are not ideal: their noise is one and the same everywhere, and what is off leaves no trace."""

from __future__ import annotations

import ctypes
import io
import subprocess
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from arms import structure_of, values_of
from fmi_client import Client, client_library
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from scipy import stats

from springline.codegen.elementary import float_header
from springline.codegen.export import bind
from springline.codegen.export.c import generate_files
from springline.codegen.export.fmu import Settings, fmu
from springline.codegen.export.fmu import archive as fmu_module
from springline.codegen.files import write_tree
from springline.codegen.kernel import (
    KernelOptions,
    KernelSpec,
    LoopSettings,
    Runs,
    kernel,
    print_kernel,
    runtime_sources,
    toolchain,
)
from springline.codegen.program import program
from springline.model.hardware import SENSORS
from springline.model.structure import SignalShape, Structure
from springline.model.system import System

pytestmark = pytest.mark.usefixtures("other_arms")

STEP, STEPS, HOLD = 1e-4, 300, 10
QUICK = ("-O0",)  # optimisation changes no bit: test_engines.py, test_fmu.py and test_export_c.py compare its levels
ALL = tuple(effect.name for effect in SENSORS)
SEED = 1234567890


@pytest.fixture(autouse=True)
def _fmus_that_are_compiled_quickly(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fmu_module, "_FLAGS", (*fmu_module._FLAGS, *QUICK))


# The generator

_DRAWS = """
#include "{header}"
{single}
#include "sl_noise.h"

#if {lanes} > 1
typedef sl_b sl_noise_word;
#else
typedef uint64_t sl_noise_word;
#endif

void philox(uint64_t *words, uint64_t key_0, uint64_t key_1) {{
  sl_noise_word counter[4];
  int i;
  for (i = 0; i < 4; i++) counter[i] = (sl_noise_word){{0}} + words[i];
  sl_philox(counter, (sl_noise_word){{0}} + key_0, (sl_noise_word){{0}} + key_1);
  for (i = 0; i < 4; i++) words[i] = *(const uint64_t *)&counter[i];
}}

/* samples x blocks x 4 x lanes numbers; lane k is run `run` + k */
void draw(uint64_t seed, uint64_t run, uint64_t first, int64_t samples, int64_t blocks, {real} *out) {{
  const sl_noise_word none = {{0}};
  sl_noise_word runs = none + run;
  int64_t k, block;
  for (k = 0; k < {lanes}; k++) ((uint64_t *)&runs)[k] += (uint64_t)k;
  for (k = 0; k < samples; k++) {{
    for (block = 0; block < blocks; block++, out += 4 * {lanes}) {{
      {vector} z[4];
      {prefix}_noise(none + seed, runs, none + (first + (uint64_t)k), none + (uint64_t)block, 3u, z);
      memcpy(out, z, sizeof z);
    }}
  }}
}}
"""


def generator(lanes: int = 1, real: str = "double") -> ctypes.CDLL:
    header = "sl_lanes.h" if lanes > 1 else "sl_math.h" if real == "double" else "sl_mathf.h"
    text = "#include <string.h>\n" + _DRAWS.format(
        header=header,
        lanes=lanes,
        real=real,
        vector="sl_v" if lanes > 1 else real,
        prefix="slv" if lanes > 1 else "slf" if real == "float" else "sl",
        single="#define SL_NOISE_SINGLE" if real == "float" else "",
    )
    sources = {**runtime_sources(), "draws.c": text}
    if real == "float":
        sources["sl_mathf.h"] = float_header()
    flags = ("-O2", "-std=gnu99", "-ffp-contract=off", f"-DSL_W={lanes}", "-lm")
    return toolchain.load(toolchain.build_library(sources, main="draws.c", flags=flags))


def draws(
    seed: int, run: int, samples: int, channels: int = 4, first: int = 0, lanes: int = 1, real: str = "double"
) -> np.ndarray:
    """(samples, channels, lanes) numbers."""
    blocks = -(-channels // 4)
    out = np.empty((samples, 4 * blocks, lanes), np.float64 if real == "double" else np.float32)
    numbers = [ctypes.c_uint64(seed), ctypes.c_uint64(run), ctypes.c_uint64(first)]
    counts = [ctypes.c_int64(samples), ctypes.c_int64(blocks)]
    generator(lanes, real).draw(*numbers, *counts, ctypes.c_void_p(out.ctypes.data))
    return out[:, :channels]


# The known answers that come with the authors' own implementation, Random123, kat_vectors.
KNOWN = [
    ((0, 0, 0, 0), (0, 0), (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)),
    ((2**32 - 1,) * 4, (2**32 - 1,) * 2, (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD)),
    (
        (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344),
        (0xA4093822, 0x299F31D0),
        (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1),
    ),
]


@pytest.mark.parametrize(("counter", "key", "expected"), KNOWN)
def test_the_generator_gives_its_authors_known_answers(
    counter: tuple[int, ...], key: tuple[int, int], expected: tuple[int, ...]
) -> None:
    words = np.array(counter, np.uint64)
    generator().philox(ctypes.c_void_p(words.ctypes.data), *map(ctypes.c_uint64, key))
    assert tuple(words) == expected


def test_lanes_draw_the_numbers_of_single_runs() -> None:
    for lanes, run in ((2, 5), (4, 2**32 - 2), (8, 2**40)):
        together = draws(SEED, run, 100, 8, first=2**32 - 50, lanes=lanes)
        for k in range(lanes):
            np.testing.assert_array_equal(together[..., k], draws(SEED, run + k, 100, 8, first=2**32 - 50)[..., 0])


def test_single_precision_draws_nearly_the_same_numbers() -> None:
    found, expected = draws(SEED, 0, 10_000, real="float"), draws(SEED, 0, 10_000)
    np.testing.assert_allclose(found, expected, rtol=2e-5, atol=2e-5)


def test_numbers_are_normal() -> None:
    """10^6 draws: moments within four standard errors, and Kolmogorov and Smirnov's test, by channel and in all."""
    numbers = draws(SEED, 0, 250_000)[..., 0]
    for sample in (*numbers.T, numbers.ravel()):
        count = len(sample)
        assert abs(sample.mean()) < 4 / np.sqrt(count)
        assert abs(sample.var() - 1) < 4 * np.sqrt(2 / count)
        assert abs(stats.skew(sample)) < 4 * np.sqrt(6 / count)
        assert abs(stats.kurtosis(sample)) < 4 * np.sqrt(24 / count)
        assert stats.kstest(sample, "norm").pvalue > 1e-3


def test_numbers_of_channels_samples_runs_and_seeds_are_not_correlated() -> None:
    count = 100_000
    numbers = draws(SEED, 7, count, 8)[..., 0]
    others = [draws(SEED, 8, count, 8)[..., 0], draws(SEED + 1, 7, count, 8)[..., 0], draws(7, SEED, count, 8)[..., 0]]
    least = 5 / np.sqrt(count)
    together = np.corrcoef(np.hstack([numbers, *others]).T)
    assert np.abs(together - np.eye(len(together))).max() < least
    for lag in (1, 2, 3, 10):
        assert np.abs(np.corrcoef(numbers[:-lag].T, numbers[lag:].T)[:8, 8:]).max() < least
    squares = np.corrcoef((np.hstack([numbers, *others]) ** 2).T)  # nor in what they are without their signs
    assert np.abs(squares - np.eye(len(squares))).max() < least


# The loop


def numbers_of(structure: Structure, **sensor: float) -> np.ndarray:
    values = values_of(structure)
    for i, slot in enumerate(System(structure).slots):
        table, _, name = slot.key.partition(".")
        if table == "sensor":
            values[i] = sensor.get(name.split(".")[0], 0.0) * (1 + int(name.split(".")[1]))
    return values


def run(
    structure: Structure, values: np.ndarray, every: int = 1, numbers: tuple[int, ...] = (0,), **options: Any
) -> Runs:
    loop = kernel(KernelSpec(structure, True, options=KernelOptions(flags=QUICK, **options)))
    told = LoopSettings(STEPS, STEP, hold=HOLD, output_every=every, seed=SEED)
    runs = loop.run(np.tile(values, (len(numbers), 1)), told, numbers=numbers)
    assert not runs.status.any()
    return runs


def columns(structure: Structure, rows: np.ndarray, *quantities: str) -> np.ndarray:
    names = [entry.name for entry in System(structure).trajectory]
    wanted = [f"{quantity}_{joint.name}" for quantity in quantities for joint in System(structure).joints]
    return rows[..., [names.index(name) for name in wanted]]


def of_state(structure: Structure) -> list[str]:
    return [item.name for item in System(structure).drive.state]


def exported_rows(structure: Structure, values: np.ndarray, folder: Path) -> np.ndarray:
    """q1 and U as main.c prints them."""
    write_tree(folder / "c", *generate_files(bind(structure, values, seed=SEED)))
    source = folder / "c"
    warnings = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Werror"]
    files = [source / "src" / "springline.c", source / "main.c"]
    includes = [f"-I{source}/include", f"-I{source}/src"]
    subprocess.run(["cc", *QUICK, *warnings, "-ffp-contract=off", *includes, *files, "-o", folder / "main"], check=True)
    printed = subprocess.run([folder / "main", "1"], capture_output=True, text=True, check=True).stdout.splitlines()
    header, rows = printed[0].split(","), [[float(word) for word in line.split(",")] for line in printed[1:]]
    joints = [joint.name for joint in System(structure).joints]
    return np.array(rows)[:, [header.index(f"{quantity}_{joint}") for quantity in ("q1", "U") for joint in joints]]


def loop_fmu(structure: Structure, values: np.ndarray, part: Any = "loop", version: Any = 3) -> bytes:
    told = Settings(duration=STEPS * STEP, step=STEP, period=HOLD * STEP, seed=SEED)
    return fmu(structure, values, told, part=part, version=version, identifier="arm", name="arm")


@settings(max_examples=4, suppress_health_check=[HealthCheck.function_scoped_fixture], phases=[Phase.generate])
@given(
    mechanism=st.sampled_from(["transfer_manipulator", "one_link"]),
    drive=st.sampled_from(["elastic", "rigid"]),
    effects=st.sets(st.sampled_from(ALL), min_size=1),
    amplitude=st.floats(1e-6, 1e-3),
    version=st.sampled_from([2, 3]),
)
def test_what_sensors_show_is_the_same_everywhere(
    mechanism: str,
    drive: str,
    effects: set[str],
    amplitude: float,
    version: int,
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    """Lanes, one lane, CasADi's C, the exported steps and FMUs: states, commands, errors, what is measured."""
    chosen, folder = tuple(name for name in ALL if name in effects), tmp_path_factory.mktemp("sensors")
    structure = structure_of(mechanism, drive=drive, effects=chosen)
    values = numbers_of(structure, **dict.fromkeys(chosen, amplitude))
    runs = (3, 0, 2**33 + 1, 5, 1)
    rows = run(structure, values, numbers=runs, width=4, groups=1).trajectory
    assert rows is not None
    for k, number in enumerate(runs[:3]):
        for options in ({"width": 1, "groups": 1}, {"engine": "casadi"}):
            alone = run(structure, values, numbers=(number,), **options)
            np.testing.assert_array_equal(alone.trajectory[0], rows[k])
    noisy = any("noise" in name for name in chosen)
    assert np.array_equal(rows[0], rows[1]) != noisy
    own = rows[1]  # of run 0
    expected = columns(structure, own[::100], "q1", "U")
    np.testing.assert_array_equal(exported_rows(structure, values, folder)[: len(expected)], expected)
    (folder / "arm.fmu").write_bytes(loop_fmu(structure, values, version=version))
    client = Client(folder / "arm.fmu", folder).start()
    outputs = set(client.names("output"))
    names = [entry.name for entry in System(structure).trajectory]
    shown = [name for name in names if name in outputs and not name.startswith(("tip", "d_tip"))]
    assert {name for name in shown if "_measured_" in name}
    places = [names.index(name) for name in shown]
    for k in range(STEPS // HOLD):
        np.testing.assert_array_equal(client.get(shown), own[HOLD * k, places], str(k))
        client.step(k * HOLD * STEP, HOLD * STEP)


def test_sensors_show_the_state_with_noise_in_steps_and_only_at_samples() -> None:
    structure = structure_of("transfer_manipulator", effects=ALL)
    amplitudes = {"position_noise": 2e-4, "velocity_noise": 3e-3, "position_resolution": 1e-4}
    runs = run(structure, numbers_of(structure, **amplitudes), numbers=tuple(range(100)), width=4)
    rows = runs.trajectory
    assert rows is not None
    state = of_state(structure)
    measured = columns(structure, rows, *(f"{name}_measured" for name in state))
    sampled = np.repeat(measured[:, ::HOLD], HOLD, axis=1)[:, : STEPS + 1]
    np.testing.assert_array_equal(measured, sampled)
    error = (measured - columns(structure, rows, *state))[:, ::HOLD]
    joint = np.tile([1.0, 2.0], 4)
    scale = np.repeat([2e-4, 3e-3, 2e-4, 3e-3], 2) * joint
    step = np.repeat([1e-4, 0.0, 1e-4, 0.0], 2) * joint
    np.testing.assert_allclose(error.std(axis=(0, 1)), np.sqrt(scale**2 + step**2 / 12), rtol=0.06)
    assert np.abs(error.mean(axis=(0, 1)) / scale).max() < 0.1
    for k in range(8):
        if step[k]:
            whole = measured[..., k] / step[k]
            np.testing.assert_allclose(whole, np.round(whole), atol=1e-9)
    q1d = columns(structure, rows, "q1d")
    np.testing.assert_array_equal(columns(structure, rows, "e"), q1d - columns(structure, rows, "q1"))


@pytest.mark.parametrize("mechanism", ["transfer_manipulator", "one_link"])
def test_noise_of_no_amplitude_leaves_every_bit(mechanism: str) -> None:
    structure, ideal = structure_of(mechanism, effects=ALL), structure_of(mechanism)
    silent, sound = run(structure, numbers_of(structure), width=4), run(ideal, values_of(ideal), width=4)
    assert silent.trajectory is not None and sound.trajectory is not None
    np.testing.assert_array_equal(silent.trajectory[..., : sound.trajectory.shape[-1]], sound.trajectory)
    np.testing.assert_array_equal(silent.metrics, sound.metrics)


def test_metrics_judge_the_true_error() -> None:
    structure = structure_of("transfer_manipulator", effects=ALL)
    runs = run(structure, numbers_of(structure, position_noise=1e-3), width=4)
    names = [entry.name for entry in System(structure).metrics]
    assert runs.trajectory is not None
    e = columns(structure, runs.trajectory[0], "e")
    squares = e**2
    mean = (squares[1:] + squares[:-1]).sum(axis=0) / 2 / STEPS
    first = names.index(f"rms_error_{System(structure).joints[0].name}") // System(structure).n
    np.testing.assert_allclose(runs.metrics[0, :, first], np.sqrt(mean), rtol=1e-12)


def test_what_is_off_is_in_no_printed_c() -> None:
    ideal = structure_of("transfer_manipulator")
    files, _ = generate_files(bind(ideal, values_of(ideal)))
    texts = {name: content.decode() for name, content in files.items()}
    for engine in ("lanes", "casadi"):
        printed = print_kernel(program(ideal), KernelSpec(ideal, True, options=KernelOptions(engine=engine)))
        texts |= {name: text for name, text in printed.files if name not in ("loop.c", "simulate.h")}
    package = zipfile.ZipFile(io.BytesIO(loop_fmu(ideal, values_of(ideal))))
    texts |= {name: package.read(name).decode() for name in package.namelist() if name.endswith((".c", ".h", ".xml"))}
    for name, text in texts.items():
        assert "sl_noise" not in name
        for word in ("noise", "_measured", "->samples", "NMEASURED", "philox", "_diff_", "has_last"):
            assert word not in text, f"{word} in {name}"


def test_an_export_counts_its_samples_and_checks_itself(tmp_path: Path) -> None:
    """Also in single precision, whose noise is the nearest."""
    structure = structure_of("transfer_manipulator", effects=ALL)
    values = numbers_of(structure, position_noise=1e-4, velocity_noise=1e-3, position_resolution=1e-5)
    for real in ("double", "float"):
        folder = tmp_path / real
        export = bind(structure, values, tunable=["control", "sensor"], real=real, seed=SEED)  # type: ignore[arg-type]
        write_tree(folder, *generate_files(export))
        header = (folder / "include" / "springline.h").read_text()
        assert "uint32_t samples;" in header and str(SEED) in header
        sources = [folder / "src" / "springline.c", folder / "src" / "springline_model.c", folder / "self_check.c"]
        warnings = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Werror", *QUICK, "-ffp-contract=off"]
        includes = [f"-I{folder}/include", f"-I{folder}/src"]
        subprocess.run(["cc", *warnings, *includes, *sources, "-o", folder / "check"], check=True)
        done = subprocess.run([folder / "check", folder / "test_vectors.txt"], capture_output=True, check=False)
        assert done.returncode == 0, done.stdout
    other = bind(structure, values, seed=SEED + 1)
    assert other.sha256 != bind(structure, values, seed=SEED).sha256


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("part", ["controller", "plant", "loop"])
def test_fmus_are_valid_and_tell_their_seed(part: str, version: int, tmp_path: Path) -> None:
    structure = structure_of("transfer_manipulator", effects=ALL)
    values = numbers_of(structure, position_noise=1e-4, velocity_noise=1e-3, position_resolution=1e-5)
    content = loop_fmu(structure, values, part, version)
    (tmp_path / "arm.fmu").write_bytes(content)
    assert client_library("fmpy.validation").validate_fmu(str(tmp_path / "arm.fmu")) == []
    page = zipfile.ZipFile(io.BytesIO(content)).read("documentation/index.html").decode()
    assert (f"the seed {SEED}" in page) == (part != "controller")


def test_a_plant_of_an_fmu_shows_what_the_loop_measures(tmp_path: Path) -> None:
    """With its communication points anywhere, and from a saved state on."""
    structure = structure_of("transfer_manipulator", effects=ALL)
    values = numbers_of(structure, position_noise=1e-4, velocity_noise=1e-3, position_resolution=1e-5)
    rows = run(structure, values, width=4).trajectory
    assert rows is not None
    names = [entry.name for entry in System(structure).trajectory]
    (tmp_path / "arm.fmu").write_bytes(loop_fmu(structure, values, "plant"))
    for stride in (1, 5, HOLD):
        client = Client(tmp_path / "arm.fmu", tmp_path).start()
        outputs = [name for name in client.names("output") if "_measured_" in name]
        assert len(outputs) == 6  # no law asks where motors are
        saved = None
        for k in range(0, STEPS, stride):
            command = [f"U_{joint.name}" for joint in System(structure).joints]
            client.set(command, [rows[0, k, names.index(name)] for name in command])
            np.testing.assert_array_equal(client.get(outputs), rows[0, k, [names.index(name) for name in outputs]])
            if k == 10 * HOLD:
                saved = client.slave.getFMUState()
            client.step(k * STEP, stride * STEP)
        if saved is not None:
            client.slave.setFMUState(saved)
            expected = rows[0, 10 * HOLD, [names.index(name) for name in outputs]]
            np.testing.assert_array_equal(client.get(outputs), expected)


def test_sensors_are_refused_where_control_is_continuous() -> None:
    structure = structure_of("transfer_manipulator", effects=ALL)
    with pytest.raises(ValueError, match="one of samples"):
        KernelSpec(structure, False)
    with pytest.raises(ValueError, match="expected a period"):
        fmu(structure, values_of(structure), Settings(1.0, STEP), part="loop", version=3, identifier="a", name="a")


@pytest.mark.parametrize("numbers", [(0, 1), (-1,)])
def test_a_run_has_one_number(numbers: tuple[int, ...]) -> None:
    structure = structure_of("transfer_manipulator", effects=ALL)
    with pytest.raises(ValueError, match="numbers are"):
        kernel(KernelSpec(structure, True, options=KernelOptions(flags=QUICK, width=4))).run(
            values_of(structure)[None], LoopSettings(1, STEP), numbers=numbers
        )


def test_only_pairs_that_a_sensor_shows_are_drawn() -> None:
    def pairs(*effects: str, **more: Any) -> tuple[int, ...]:
        return System(Structure(effects=effects, **more)).noise_pairs

    assert pairs("position_noise", "velocity_noise") == (3, 3)
    assert pairs("position_noise") == (1, 1)
    assert pairs("velocity_noise") == (2, 2)
    assert pairs("position_noise", drive="rigid") == (1,)
    three = {"mechanism": "planar_arm", "size": 3, "reference": SignalShape("sine", (1,) * 3)}
    assert pairs("position_noise", **three) == (3, 2, 1)  # of twelve, 0 to 2 and 6 to 8
    assert pairs("position_resolution") == ()
