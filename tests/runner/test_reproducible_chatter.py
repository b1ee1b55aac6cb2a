"""Chatter that an ulp changes, and its hash: that of every engine, width, compiler and machine (docs/equal-bits.md)."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from subprocess import run
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from typer.testing import CliRunner

from springline.codegen.export import bind
from springline.codegen.export.c import generate_files
from springline.codegen.files import write_tree
from springline.codegen.kernel import KernelOptions, KernelSpec, kernel, toolchain
from springline.runner.cli import app
from springline.runner.run import loop_settings, simulate, trajectory_hash, trajectory_table
from springline.runner.scenario import Scenario, load_scenario

ROOT = Path(__file__).parents[2]
NAME = "controllers/reproducible_chatter"
EXAMPLE = ROOT / "examples/equal_bits"
SHORT = 10_000  # samples
COMPILERS, LEVELS, WIDTHS = ("gcc", "clang"), ("-O0", "-O1", "-O2", "-O3"), (1, 2, 4, 8, 16)
ALONE = (2, 4)  # lanes of a run alone
PACKAGES = {
    "aarch64": "gcc-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user",
    "riscv64": "gcc-riscv64-linux-gnu libc6-dev-riscv64-cross qemu-user",
    "s390x": "gcc-s390x-linux-gnu libc6-dev-s390x-cross qemu-user",
    "cortex_m7": "gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm",
}
Tool = Callable[..., str]
Doubles = NDArray[np.float64]


@cache
def promised(samples: int, rows: int) -> str:
    """The hash that docs/equal-bits.md has for so many samples and rows."""
    page = (ROOT / "docs/equal-bits.md").read_text(encoding="utf-8")
    [found] = re.findall(rf"^\| {samples:,} \| {rows:,} \| `([0-9a-f]{{64}})` \|", page, re.MULTILINE)
    return str(found)


WHOLE, BEGINNING = promised(1_000_000, 10_001), promised(SHORT, SHORT // 100 + 1)


@cache
def chatter(samples: int = 1_000_000) -> Scenario:
    return load_scenario(NAME, {"simulation.duration": samples * 1e-3})


def hash_of(scenario: Scenario, options: KernelOptions, runs: int = 1, lane: int = 0) -> str:
    """Of one run by a kernel built so, among others that begin elsewhere."""
    system, values = scenario.system(), np.tile(scenario.values(), (runs, 1))
    start = [slot.key for slot in system.slots].index("initial.q.0")
    values[:, start] += np.arange(runs) - lane
    loop = kernel(KernelSpec(scenario.structure(), scenario.control_every > 0, options=options))
    trajectory = loop.run(values, loop_settings(scenario, trajectory=True)).trajectory
    assert trajectory is not None
    assert all((trajectory[k] != trajectory[lane]).any() for k in range(runs) if k != lane)
    return trajectory_hash(trajectory_table(system, trajectory[lane]))


def build(require_tool: Tool, compiler: str, **options: Any) -> KernelOptions:
    return KernelOptions(compiler=toolchain.probe_compiler([require_tool(compiler)]), **options)


def command(scenario: Scenario) -> Doubles:
    return np.asarray(simulate(scenario).trajectory["U_joint1"])


# What it is


def test_the_plant_is_a_mass_that_control_and_disturbance_push() -> None:
    """The second derivative of q is u + d to the bit, for any state and force."""
    scenario = chatter()
    assert (scenario.steps, scenario.control_every, scenario.warnings) == (1_000_000, 1, ())
    plant = scenario.system().function("plant")
    rng = np.random.default_rng(3)
    for q, dq, u, d in rng.normal(scale=10.0, size=(50, 4)):
        rates = np.array(plant(0.0, 0.0, 0.0, d, [q, dq], u, scenario.values())).ravel()
        np.testing.assert_array_equal(rates, [dq, u + d])


def test_an_ulp_at_the_start_is_soon_as_large_as_the_chatter() -> None:
    scenario = chatter(SHORT)
    other = scenario.with_overrides({"initial.q": float(np.nextafter(0.5, 1.0))})
    apart = np.abs(command(scenario) - command(other))
    assert apart[0] < 1e-12
    assert apart[len(apart) // 2 :].max() > 10.0  # N m


# Here


@pytest.mark.parametrize("engine", ["lanes", "casadi"])
def test_a_run_ends_with_the_promised_hash(engine: str, tmp_path: Path) -> None:
    words = ["run", NAME, "--hash", "--no-plot", "--engine", engine, "-o", str(tmp_path / "out")]
    done = CliRunner().invoke(app, words)
    assert done.stdout.splitlines()[-1] == f"sha256 {WHOLE}"


@pytest.mark.full
def test_every_sample_has_the_promised_bits() -> None:
    result = simulate(load_scenario(NAME, {"simulation.output_every": 1}))
    assert trajectory_hash(result.trajectory) == promised(1_000_000, 1_000_001)


@pytest.mark.parametrize(
    ("compiler", "level", "options"),
    [
        ("gcc", "-O0", {"engine": "casadi"}),
        ("gcc", "-O3", {"engine": "casadi"}),
        ("clang", "-O0", {"engine": "casadi"}),
        ("clang", "-O3", {"engine": "casadi"}),
        ("gcc", "-O0", {"width": 1}),
        ("gcc", "-O3", {"width": 2}),
        ("clang", "-O0", {"width": 4}),
        ("gcc", "-O1", {"width": 8}),
        ("clang", "-O3", {"width": 8}),
        ("clang", "-O2", {"width": 16}),
    ],
)
def test_builds_give_the_promised_bits(compiler: str, level: str, options: Any, require_tool: Tool) -> None:
    built = build(require_tool, compiler, flags=(level,), groups=1, packs=1, **options)
    assert hash_of(chatter(SHORT), built) == BEGINNING


@pytest.mark.parametrize(("runs", "lane"), [(5, 0), (5, 3), (21, 20)])
def test_a_lane_of_a_batch_gives_the_promised_bits(runs: int, lane: int) -> None:
    assert hash_of(chatter(SHORT), KernelOptions(width=4, flags=("-O1",)), runs, lane) == BEGINNING


@pytest.mark.full
@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("compiler", COMPILERS)
def test_every_build_gives_the_promised_bits(compiler: str, level: str, require_tool: Tool) -> None:
    assert hash_of(chatter(), build(require_tool, compiler, flags=(level,), engine="casadi")) == WHOLE
    native = (level, "-march=native")
    for width in ALONE:
        assert hash_of(chatter(), build(require_tool, compiler, flags=native, width=width, alone=True)) == WHOLE
    for width in WIDTHS:
        built = build(require_tool, compiler, flags=native, width=width)
        assert hash_of(chatter(), built) == WHOLE
        assert hash_of(chatter(SHORT), built, width + 3, width + 1) == BEGINNING


# By exported C, here and elsewhere


@pytest.fixture(scope="module")
def export(once: Callable[[str, Callable[[Path], object]], Path]) -> Path:
    def make(path: Path) -> None:
        scenario = chatter()
        period = scenario.control_every * scenario.step
        write_tree(path, *generate_files(bind(scenario.structure(), scenario.values(), period=period)))

    return once("exports/reproducible_chatter", make)


def made(target: str, export: Path, build: Path, *settings: str) -> str:
    """The hash that the example prints."""
    words = ["make", "-s", "-C", EXAMPLE, target, f"EXPORT={export}", f"BUILD={build}", *settings]
    done = run(words, capture_output=True, text=True, check=False, timeout=600)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout.split()[0]


def ready(target: str, require_tool: Tool) -> None:
    names = {"cortex_m7": ("arm-none-eabi-gcc", "qemu-system-arm")}
    for name in names.get(target, (f"{target}-linux-gnu-gcc", f"qemu-{target}")):
        require_tool(name, f"apt-get install {PACKAGES[target]}")


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("compiler", COMPILERS)
def test_exported_c_gives_the_promised_bits(
    compiler: str, level: str, export: Path, tmp_path: Path, require_tool: Tool
) -> None:
    samples, wanted = (1_000_000, WHOLE) if level == "-O3" else (SHORT, BEGINNING)
    settings = (f"CC={require_tool(compiler)}", f"LEVEL={level}", f"SAMPLES={samples}")
    assert made("host", export, tmp_path, *settings) == wanted


@pytest.mark.full
@pytest.mark.parametrize("level", LEVELS[:-1])
@pytest.mark.parametrize("compiler", COMPILERS)
def test_exported_c_goes_all_the_way(
    compiler: str, level: str, export: Path, tmp_path: Path, require_tool: Tool
) -> None:
    assert made("host", export, tmp_path, f"CC={require_tool(compiler)}", f"LEVEL={level}") == WHOLE


@pytest.mark.parametrize("target", list(PACKAGES))
def test_another_machine_gives_the_promised_bits(target: str, export: Path, tmp_path: Path, require_tool: Tool) -> None:
    ready(target, require_tool)
    assert made(target, export, tmp_path, f"SAMPLES={SHORT}") == BEGINNING


@pytest.mark.full
@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("target", list(PACKAGES))
def test_another_machine_goes_all_the_way(
    target: str, level: str, export: Path, tmp_path: Path, require_tool: Tool
) -> None:
    ready(target, require_tool)
    assert made(target, export, tmp_path, f"LEVEL={level}") == WHOLE


def test_a_fused_multiply_add_would_be_seen(export: Path, tmp_path: Path, require_tool: Tool) -> None:
    """aarch64 has the instruction: with it the command differs by as much as the chatter is."""
    ready("aarch64", require_tool)

    def command_of(contract: str) -> Doubles:
        made("aarch64", export, tmp_path, f"SAMPLES={SHORT}", f"CONTRACT={contract}")
        return np.fromfile(tmp_path / "aarch64.bin").reshape(-1, SHORT // 100 + 1)[6]

    apart = np.abs(command_of("off") - command_of("fast"))
    assert apart[len(apart) // 2 :].max() > 10.0  # N m
