"""Every example is built and run, with the export that is committed."""

import json
import math
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pyarrow
import pyarrow.parquet
import pytest
from arms import structure_of, values_of
from chains import chain, numbers_for
from fmi_client import check_restored
from typer.testing import CliRunner

from springline.codegen.export import bind
from springline.codegen.export.c import generate_files
from springline.codegen.files import write_tree
from springline.model.mechanisms import MECHANISMS
from springline.model.structure import SignalShape
from springline.runner import load_scenario, simulate
from springline.runner.cli import app

ROOT = Path(__file__).parents[1]
EXAMPLES, EXPORT = ROOT / "examples", ROOT / "generated"
# The Make that runs the tests hands its flags down; an example's Make is to be a fresh one.
FRESH = {name: value for name, value in os.environ.items() if not name.startswith(("MAKE", "MFLAGS"))}


def run(*command: str | Path, environment: Mapping[str, str] = MappingProxyType({})) -> str:
    words = [str(word) for word in command]
    done = subprocess.run(words, capture_output=True, text=True, check=False, env={**FRESH, **environment})
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    return done.stdout


def make(folder: str, build: Path, *arguments: str) -> str:
    return run("make", "-s", "-C", EXAMPLES / folder, f"EXPORT={EXPORT}", f"BUILD={build}", *arguments)


def numbers(line: str) -> list[float]:
    return [float(text) for text in re.findall(r"-?\d+\.\d+(?:e-?\d+)?", line)]


def test_every_example_is_in_the_list() -> None:
    folders = {path.name for path in EXAMPLES.iterdir() if path.is_dir() and path.name != "build"}
    listed = set(re.findall(r"^\| `(\w+)` \|", (EXAMPLES / "README.md").read_text(), re.MULTILINE))
    assert folders == listed


def check_controller(printed: str) -> None:
    """What plain_c/controller.c prints: it settles, and a sensor that is out is noticed three times."""
    lines = printed.splitlines()
    assert sum("a measurement is not a finite number" in line for line in lines) == 3
    late = [numbers(line) for line in lines if line.startswith(("t = 0.8", "t = 0.9"))]
    assert len(late) == 2
    for _, lift, rotation, *_ in late:
        assert abs(lift) < 1e-3
        assert abs(rotation) < 1e-3


def test_plain_c(tmp_path: Path) -> None:
    check_controller(make("plain_c", tmp_path, "run"))


def test_cmake_and_pkg_config(tmp_path: Path, require_tool: Callable[..., str]) -> None:
    cmake = require_tool("cmake")
    installed = tmp_path / "installed"
    run(cmake, "-S", EXPORT, "-B", tmp_path / "export")
    run(cmake, "--build", tmp_path / "export")
    run(require_tool("ctest"), "--test-dir", tmp_path / "export")
    run(cmake, "--install", tmp_path / "export", "--prefix", installed)
    run(cmake, "-S", EXAMPLES / "cmake", "-B", tmp_path / "build", f"-DCMAKE_PREFIX_PATH={installed}")
    run(cmake, "--build", tmp_path / "build")
    check_controller(run(tmp_path / "build" / "controller"))

    [description] = installed.rglob("springline.pc")
    search = {"PKG_CONFIG_PATH": str(description.parent)}
    flags = run(require_tool("pkg-config"), "--cflags", "--libs", "springline", environment=search).split()
    program = tmp_path / "by_pkg_config"
    run("cc", EXAMPLES / "plain_c" / "controller.c", *flags, "-o", program)
    check_controller(run(program))


def test_cpp(tmp_path: Path, require_tool: Callable[..., str]) -> None:
    require_tool("c++")
    *before, last = make("cpp", tmp_path, "run").splitlines()
    retuned = [line for line in before if "t =" not in line]
    assert retuned[0] == "retuned: done"
    assert retuned[1].startswith("refused, and nothing changed: config.fallback is neither")
    time, lift, rotation = numbers(last)
    assert time == 1.0
    assert abs(lift) < 1e-3
    assert abs(rotation - 2.0) < 1e-3


def test_two_rates_in_two_threads(tmp_path: Path) -> None:
    printed = make("two_rate", tmp_path, "run")
    assert re.search(r"0 faults; references planned at 50 Hz", printed)


def test_cffi(tmp_path: Path) -> None:
    pytest.importorskip("cffi", reason="cffi is not installed: pip install 'springline[dev]'")
    printed = run(sys.executable, EXAMPLES / "cffi" / "control.py", EXPORT, tmp_path)
    assert "a failed sensor: a measurement is not a finite number" in printed
    assert max(map(abs, numbers(printed.splitlines()[-2])[1:])) < 1e-3


def test_casadi_external(tmp_path: Path) -> None:
    printed = run(sys.executable, EXAMPLES / "casadi_external" / "plant.py", EXPORT, tmp_path)
    assert "springline_plant:(b[3],db[3],ddb[3],x[8],u[2])->(dx[8]) External" in printed
    frequencies = json.loads(printed.splitlines()[-1].split(": ")[1])
    assert frequencies == pytest.approx([1036.5, 1414.7], abs=0.2)  # sqrt of the eigenvalues of (M1^-1 + M2^-1) K


@pytest.fixture
def own_controller(tmp_path: Path) -> Path:
    """A copy of that example beside a copy of the board that it is run on."""
    for name in ("cortex_m", "own_controller"):
        shutil.copytree(EXAMPLES / name, tmp_path / name, ignore=shutil.ignore_patterns("build", "__pycache__"))
    return tmp_path / "own_controller"


def test_own_controller_is_run_as_its_readme_says(
    own_controller: Path, require_tool: Callable[..., str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """And a Cortex-M7 computes what the simulation has, bit for bit."""
    require_tool("arm-none-eabi-gcc", HINT)
    require_tool("qemu-system-arm", HINT)
    monkeypatch.chdir(own_controller)
    blocks = re.findall(r"^```sh\n(.*?)^```", Path("README.md").read_text(), re.MULTILINE | re.DOTALL)
    for line in "".join(blocks).splitlines():
        program, *arguments = shlex.split(line.replace("$PWD", str(own_controller)))
        if program == "springline":
            quick = ["--no-plot"] if arguments[0] == "run" else ["--jobs", "1"] if arguments[0] == "batch" else []
            done = CliRunner().invoke(app, [*arguments, *quick], prog_name="springline")
            assert done.exit_code == 0, f"{line}\n{done.output}"
        else:
            printed = run(program, *arguments)
    assert "1000 control steps and 200 plant steps: all bits as expected" in printed
    assert "output as on this machine, bit for bit" in printed

    header, *lines = (own_controller / "adrc_m7/m7/main.txt").read_text().splitlines()
    board = np.array([[float(word) for word in line.split(",")] for line in lines])
    simulated = pyarrow.parquet.read_table(own_controller / "ship/trajectory.parquet")
    rows = np.rint(board[:, 0] / 1e-3).astype(int)  # the simulation has a row a sample
    for name, column in zip(header.split(","), board.T, strict=True):
        np.testing.assert_array_equal(simulated[name].to_numpy()[rows], column, name)
    assert {"z_e_hat_lift", "z_d_hat_rotation"} <= set(simulated.column_names)

    rms = {
        folder: pyarrow.parquet.read_table(own_controller / folder / "metrics.parquet")["rms_error_lift"][0].as_py()
        for folder in ("ship", "yardstick")
    }
    assert rms == {"ship": pytest.approx(0.29e-3, rel=0.02), "yardstick": pytest.approx(1.5e-3, rel=0.02)}
    sweep = [pyarrow.parquet.read_table(part) for part in sorted((own_controller / "payloads").glob("part-*.parquet"))]
    table = pyarrow.concat_tables(sweep)
    chatters = table["chatter_lift"].to_numpy() > 20.0
    np.testing.assert_array_equal(chatters, table["control.adrc.w_o"].to_numpy() == 400.0)


@pytest.mark.parametrize("target", ["fmu2", pytest.param("fmu3", marks=pytest.mark.full)])
def test_own_controller_as_an_fmu_keeps_its_states(own_controller: Path, target: str) -> None:
    folder = own_controller / target
    done = CliRunner().invoke(app, ["export", target, str(own_controller / "ship.toml"), "-o", str(folder)])
    assert done.exit_code == 0, done.output
    [path] = folder.glob("*.fmu")
    names = ["z_e_hat_lift", "z_de_hat_rotation", "z_d_hat_lift", "U_rotation", "q1_lift"]
    check_restored(path, own_controller, names, 5e-4, 7, 60)  # saved between two samples


@pytest.mark.full
def test_own_controller_does_not_wind_up(own_controller: Path) -> None:
    """The overshoots that its README names, far from the reference at first and with motors at their limits."""
    text = (own_controller / "adrc.py").read_text()
    told = "        def dz(limited):\n"
    assert text.count(told) == 1
    (own_controller / "adrc.py").write_text(text.replace(told, f"{told}            limited = u\n"))
    start = {"initial.q": [0.2, 0.8], "initial.dq": [math.pi, math.pi / 2]}
    for folder, overshoot in ((EXAMPLES / "own_controller", 0.4e-3), (own_controller, 147e-3)):
        result = simulate(load_scenario(folder / "ship.toml", start))
        assert max(result.trajectory["e_lift"].to_numpy()) == pytest.approx(overshoot, rel=0.2)
        assert result.metrics["U_max_lift"][0].as_py() == 1500.0


HINT = "apt-get install gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm"
BOARD = EXAMPLES / "cortex_m"
FLASH = {"planar": 32_000, "quarter turns": 36_000, "any frames": 56_000}  # a control step, its mathematics and startup


def for_cortex_m7(export: Path, build: Path, *sources: Path, hosted: bool = True) -> Path:
    """A program of these sources for the Cortex-M7 that is emulated; only if hosted it can print.

    Compiled as a firmware would be. But CasADi's own C is only compared with: to optimise it would take a minute, and
    changes no bit.
    """
    gcc = ["arm-none-eabi-gcc", "-mthumb", "-mcpu=cortex-m7", "-mfpu=fpv5-d16", "-mfloat-abi=hard", "-std=c99"]
    flags = ["-ffp-contract=off", "-ffunction-sections", f"-I{export}/include", f"-I{export}/src", "-DSAMPLES=20"]
    startup = build / f"startup_{'hosted' if hosted else 'alone'}.o"
    run(*gcc, *flags, *(["-DSEMIHOSTING"] if hosted else []), "-c", BOARD / "startup.c", "-o", startup)
    objects = [startup]
    for source in sources:
        objects.append(build / f"{source.stem}.o")
        level = "-O0" if source.stem.endswith("_model") else "-O2"
        if not objects[-1].exists():
            run(*gcc, *flags, level, "-c", source, "-o", objects[-1])
    program = build / f"{sources[0].stem}.elf"
    libraries = ["--specs=rdimon.specs"] if hosted else ["-nostdlib", "-lc", "-lgcc"]
    linking = ["-nostartfiles", "-T", BOARD / "mps2.ld", "-Wl,--gc-sections", "-Wl,--no-warn-rwx-segments"]
    run(*gcc, *objects, *linking, *libraries, "-o", program)
    return program


def printed_on_cortex_m7(program: Path, folder: Path) -> str:
    """What a program prints that runs in a folder."""
    done = subprocess.run(
        ["qemu-system-arm", "-machine", "mps2-an500", "-nographic", "-monitor", "none", "-serial", "none",
         "-icount", "shift=0", "-semihosting-config", "enable=on,target=native", "-kernel", str(program)],
        cwd=folder, capture_output=True, text=True, check=False, timeout=300, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.parametrize("arm", ["planar", pytest.param("quarter turns", marks=pytest.mark.full), "any frames"])
def test_firmware_of_seven_joints(
    arm: str, tmp_path: Path, require_tool: Callable[..., str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A Cortex-M7 computes what this machine computed, on a ship in six degrees, in the room that is said."""
    require_tool("arm-none-eabi-gcc", HINT)
    require_tool("qemu-system-arm", HINT)
    others: dict[str, float] = {}
    given = {"base_motion": SignalShape("sine", (1,) * 6), "reference": SignalShape("sine", (0,) * 7)}
    if arm == "planar":
        structure = structure_of("planar_arm", size=7, **given)
    else:
        chain_of_seven = chain("rrprrpr", "quarter" if arm == "quarter turns" else "generic")
        name = f"chain of {arm}"  # programs are known by the structure, so by the name
        monkeypatch.setitem(MECHANISMS, name, chain_of_seven)
        structure = structure_of(name, mount=True, mount_rpy=True, **given)
        numbers = numbers_for(7, np.random.default_rng(4))
        others = {f"{table}.{name}": v for name, v in numbers.items() for table in ("plant", "mechanism")}
    export = tmp_path / "export"
    write_tree(export, *generate_files(bind(structure, values_of(structure, others))))
    code = export / "src/springline.c"
    check = for_cortex_m7(export, tmp_path, export / "self_check.c", export / "src/springline_model.c", code)
    checked = printed_on_cortex_m7(check, export)
    assert "1000 control steps and 200 plant steps: all bits as expected" in checked

    cost = printed_on_cortex_m7(for_cortex_m7(export, tmp_path, BOARD / "measure.c", code), export)
    stack = {step: int(size) for step, size in re.findall(r"(\w+) step +mean.*stack +(\d+) bytes", cost)}
    told = re.search(r"needs about (\d+) bytes of stack, a plant step about (\d+)", (export / "README.md").read_text())
    assert told is not None
    for step, estimate in zip(("control", "plant"), told.groups(), strict=True):
        assert 0 < stack[step] < 1.25 * int(estimate), f"stack of a {step} step"
    alone = for_cortex_m7(export, tmp_path, BOARD / "control_only.c", code, hosted=False)
    text, data, *_ = run("arm-none-eabi-size", alone).splitlines()[1].split()
    assert int(text) < FLASH[arm] and int(data) == 0


OTHERS_FULL = [
    ("computed_torque", "none"),
    ("computed_torque", "disturbance"),
    ("nonsingular_terminal", "none"),
    ("nonsingular_terminal", "extended_state"),
    ("super_twisting", "none"),
    ("terminal_sliding", "disturbance"),
]


@pytest.mark.parametrize(
    ("controller", "observer"),
    [("super_twisting", "extended_state"), *(pytest.param(*pair, marks=pytest.mark.full) for pair in OTHERS_FULL)],
)
def test_firmware_of_packaged_controllers(
    controller: str, observer: str, tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    """A Cortex-M7 has this machine's bits over a sequence of samples, and in closed loop."""
    require_tool("arm-none-eabi-gcc", HINT)
    require_tool("qemu-system-arm", HINT)
    chosen = {"control.controller": controller, "control.observer": observer, "drive.spring_damping": [600.0, 5.0]}
    scenario = load_scenario("paper/group1_shake", chosen)
    export = tmp_path / "export"
    write_tree(export, *generate_files(bind(scenario.structure(), scenario.values())))
    code = export / "src/springline.c"
    check = for_cortex_m7(export, tmp_path, export / "self_check.c", export / "src/springline_model.c", code)
    assert "1000 control steps and 200 plant steps: all bits as expected" in printed_on_cortex_m7(check, export)
    board = printed_on_cortex_m7(for_cortex_m7(export, tmp_path, export / "main.c", code), export)
    host = tmp_path / "main"
    includes = [f"-I{export}/include", f"-I{export}/src"]
    run("cc", "-std=c99", "-O1", "-ffp-contract=off", *includes, export / "main.c", code, "-o", host)
    assert board == run(host)


def test_firmware(tmp_path: Path, require_tool: Callable[..., str]) -> None:
    """Cortex-M7 in double and Cortex-M4F in single precision: this machine's bits, and the cost that is promised."""
    hint = "apt-get install gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm"
    require_tool("arm-none-eabi-gcc", hint)
    require_tool("qemu-system-arm", hint)
    scenario = load_scenario("paper/nominal")
    single = tmp_path / "single"
    write_tree(single, *generate_files(bind(scenario.structure(), scenario.values(), real="float")))
    report = make("cortex_m", tmp_path / "build", "firmware", f"FLOAT={single}")
    m7, m4f = report.split("Cortex-M4F")
    for board in (m7, m4f):
        assert "1000 control steps and 200 plant steps: all bits as expected" in board
        assert "output as on this machine, bit for bit" in board
    instructions, stack = (int(x) for x in re.findall(r"control step +mean.*most +(\d+) .*stack +(\d+)", m7)[0])
    flash, data = (int(x) for x in re.findall(r"\.text (\d+)  \.data (\d+)", m7)[0])
    assert instructions <= 2500
    assert stack < 512
    assert flash < 16 * 1024
    assert data == 0


def test_a_search_that_is_begun_again_goes_on_where_it_was(tmp_path: Path) -> None:
    """Small ones, of the same seed: whole, and cut off after its first generation."""

    def search(folder: Path) -> str:
        command = [sys.executable, str(EXAMPLES / "identify_table4.py"), "--generations", "2", "--population", "6"]
        return run(*command, "--seeds", "1", "--state", str(folder))

    whole = search(tmp_path / "whole")
    assert re.search(r"^seed 1: cost [\d.]+, \d+ of 24 within 30 %$", whole, re.MULTILINE)
    state = json.loads((tmp_path / "whole" / "seed1.json").read_text())
    assert len(state) == 3
    (tmp_path / "cut").mkdir()
    (tmp_path / "cut" / "seed1.json").write_text(json.dumps(state[:1]))
    again = search(tmp_path / "cut")
    assert "generation 0:" not in again
    assert "generation 1:" in again
    assert again.partition("seed 1: cost")[2] == whole.partition("seed 1: cost")[2] != ""
    assert json.loads((tmp_path / "cut" / "seed1.json").read_text()) == state
