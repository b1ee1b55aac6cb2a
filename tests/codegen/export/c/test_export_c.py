"""The exported C as an embedder meets it: warnings, symbols, memory, statuses, limits, and the simulator's bits."""

import ctypes
import math
import re
import shutil
import subprocess
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from springline.codegen.export import bind
from springline.codegen.export.c import generate_files
from springline.codegen.export.c.statuses import STATUS
from springline.codegen.files import write_tree
from springline.codegen.kernel import KernelOptions, KernelSpec, LoopSettings, kernel
from springline.model.parameters import Slot
from springline.model.quantities import BASE, REFERENCE, SATURATED, SIGMA, E, U, entries
from springline.runner import load_scenario

FLAGS = ("-std=c99", "-O2", "-ffp-contract=off")
STRICT = ["-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Wdouble-promotion", "-Werror"]
WARNINGS = ("-std=c99", "-ffp-contract=off", *STRICT, "-Wmissing-prototypes", "-Wstrict-prototypes")
EXPORTS: dict[str, dict[str, Any]] = {
    "baked": {},
    "tunable": {"tunable": ["control", "mechanism.m3", "plant"], "prefix": "arm"},
    "all": {"tunable": "all", "prefix": "every"},
    "single": {"real": "float", "prefix": "single"},
    "single_tunable": {"real": "float", "tunable": "all", "prefix": "loose"},
}
Folder = Callable[[str], tuple[Path, str]]
Once = Callable[[str, Callable[[Path], object]], Path]
Objects = Callable[[str, str, str], list[Path]]


@pytest.fixture(scope="module")
def export(once: Once) -> Folder:
    """Folder and prefix of an export by its name in EXPORTS."""
    scenario = load_scenario("paper/nominal")

    def folder(name: str) -> tuple[Path, str]:
        options = EXPORTS[name]

        def make(path: Path) -> None:
            write_tree(path, *generate_files(bind(scenario.structure(), scenario.values(), **options)))

        return once(f"exports/{name}", make), options.get("prefix", "springline")

    return folder


def compile_c(compiler: str, sources: list[Path], output: Path, *flags: str, exports: Sequence[Path] = ()) -> Path:
    """Compile and link sources and objects; headers are those of the `exports`, and of the sources that are of one."""
    roots = {*exports, *(s.parents[1] for s in sources if s.parent.name == "src")}
    includes = [f"-I{folder}" for root in roots for folder in (root / "include", root / "src")]
    command = [compiler, *flags, *includes, *map(str, sources), "-o", str(output)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:3000]
    return output


def run(*command: str | Path) -> str:
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def sources(folder: Path, prefix: str, *programs: str) -> list[Path]:
    return [folder / "src" / f"{prefix}.c", folder / "src" / f"{prefix}_model.c", *(folder / p for p in programs)]


@pytest.fixture(scope="module")
def objects(export: Folder, once: Once) -> Objects:
    """objects(name, compiler, level): an export's controller and model, compiled once and without a warning."""

    def compiled(name: str, compiler: str, level: str) -> list[Path]:
        units = sources(*export(name))

        def make(folder: Path) -> None:
            folder.mkdir()
            for source in units:
                compile_c(compiler, [source], folder / f"{source.stem}.o", *WARNINGS, level, "-c")

        folder = once(f"objects/{name}_{Path(compiler).name}{level}", make)
        return [folder / f"{source.stem}.o" for source in units]

    return compiled


# --- compilers, symbols, memory ----------------------------------------------------------------------------


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
@pytest.mark.parametrize("name", EXPORTS)
def test_compiles_without_a_warning_and_passes_its_self_check(
    name: str, compiler: str, export: Folder, objects: Objects, tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    folder, _ = export(name)
    tool = require_tool(compiler)
    for level in ("-O0", "-O2") if name == "baked" else ("-O0",):
        units = [*objects(name, tool, level), folder / "self_check.c"]
        program = compile_c(tool, units, tmp_path / "check", *WARNINGS, level, exports=[folder])
        assert "1000 control steps and 200 plant steps: all bits" in run(program, folder / "test_vectors.txt")
    controller, _ = objects(name, tool, "-O0")
    compile_c(tool, [controller, folder / "main.c"], tmp_path / "main", *WARNINGS, exports=[folder])


@pytest.mark.parametrize("name", EXPORTS)
def test_headers_are_cpp(name: str, export: Folder, require_tool: Callable[..., str]) -> None:
    folder, prefix = export(name)
    run(
        require_tool("g++"),
        "-std=c++17",
        *STRICT,
        "-fsyntax-only",
        "-x",
        "c++",
        folder / "include" / f"{prefix}.h",
        folder / "src" / f"{prefix}_model.h",
    )


@pytest.mark.parametrize("name", EXPORTS)
def test_exported_symbols_are_those_of_the_headers(
    name: str, export: Folder, objects: Objects, require_tool: Callable[..., str]
) -> None:
    folder, prefix = export(name)
    declared = set()
    for header in (folder / "include" / f"{prefix}.h", folder / "src" / f"{prefix}_model.h"):
        text = without_comments(header)
        declared |= set(re.findall(r"(\w+)\([^()]*\);", text))
        declared |= set(re.findall(r"extern const \w+ (\w+)(?:\[\w+\])?;", text))
    defined, undefined = set(), set()
    for unit in objects(name, require_tool("gcc"), "-O0"):
        for line in run(require_tool("nm"), unit).splitlines():
            *_, kind, symbol = line.split()
            if kind == "U":
                undefined.add(symbol)
            elif kind.isupper():
                defined.add(symbol)
    assert defined == declared
    assert all(symbol.startswith(f"{prefix}_") for symbol in defined)
    assert undefined <= NEEDED


NEEDED = {"memcpy", "memset", "_GLOBAL_OFFSET_TABLE_"}
"""All that an export may take from elsewhere."""

_DOUBLE_INSTRUCTION = r"\b\w*(?:cvt\w*s[sd]2s[sd]|(?:add|sub|mul|div|sqrt|ucomi|comi|max|min)[sp]d)\b"


def without_comments(path: Path) -> str:
    return re.sub(r"/\*.*?\*/", "", path.read_text(), flags=re.DOTALL)


@pytest.mark.parametrize("name", ["baked", "single_tunable"])
def test_no_writable_data_no_heap_no_double_in_single(
    name: str, export: Folder, objects: Objects, require_tool: Callable[..., str]
) -> None:
    folder, prefix = export(name)
    units = objects(name, require_tool("gcc"), "-O1")
    for source, unit in zip(sources(folder, prefix), units, strict=True):
        assert set(re.findall(r" U (\w+)", run(require_tool("nm"), unit))) <= NEEDED
        _, data, bss = run(require_tool("size"), unit).splitlines()[1].split()[:3]
        assert (data, bss) == ("0", "0")
        if name == "single_tunable":
            assert not re.findall(_DOUBLE_INSTRUCTION, run(require_tool("objdump"), "-d", unit))
            assert not re.search(r"\bdouble\b", without_comments(source))
    if name == "single_tunable":
        assert not re.search(r"\bdouble\b", without_comments(folder / "src" / "sl_mathf.h"))


def test_single_precision_needs_no_double_on_a_processor_without(
    export: Folder, tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    folder, prefix = export("single")
    gcc = require_tool("arm-none-eabi-gcc", "apt-get install gcc-arm-none-eabi libnewlib-arm-none-eabi")
    board = ["-mthumb", "-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard"]
    for source in sources(folder, prefix):
        unit = compile_c(gcc, [source], tmp_path / "unit.o", *WARNINGS, *board, "-O2", "-c")
        undefined = re.findall(r"U (\w+)", run(require_tool("arm-none-eabi-nm"), unit))
        assert set(undefined) <= {"memcpy", "memset"}  # software double arithmetic would be __aeabi_dadd, …


def test_two_exports_in_one_program(
    export: Folder, objects: Objects, tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    (one, first), (two, second) = export("baked"), export("tunable")
    program = tmp_path / "both.c"
    program.write_text(
        f'#include "{first}.h"\n#include "{second}.h"\n#include "{first}_model.h"\n#include "{second}_model.h"\n'
        f"int main(void) {{\n  {first}_controller a;\n  {second}_controller b;\n"
        f"  return {first}_init(&a, &{first}_default_config) | {second}_init(&b, &{second}_default_config);\n}}\n"
    )
    gcc = require_tool("gcc")
    units = [*objects("baked", gcc, "-O0"), *objects("tunable", gcc, "-O0"), program]
    run(compile_c(gcc, units, tmp_path / "both", *WARNINGS, exports=[one, two]))


@pytest.mark.parametrize(
    ("compiler", "language"),
    [("gcc", ["-std=c99"]), ("clang", ["-std=c99"]), ("g++", ["-x", "c++", "-std=c++17"]),
     ("clang++", ["-x", "c++", "-std=c++17"])],
)  # fmt: skip
def test_exports_fit_into_one_translation_unit(
    compiler: str, language: list[str], export: Folder, once: Once, tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    """Four exports, two of them single, and the system's mathematics behind them: as C and as C++ the same bits."""
    names = ["baked", "single", "tunable", "single_tunable"]
    folders = [export(name) for name in names]
    unit = tmp_path / "unit.c"
    parts = [folder / "src" / f"{prefix}{end}.c" for folder, prefix in folders for end in ("", "_model")]
    parts[2:4] = reversed(parts[2:4])  # in any order
    unit.write_text("".join(f'#include "{part}"\n' for part in parts) + "#include <math.h>\n")
    includes = [f"-I{folder / inner}" for folder, _ in folders for inner in ("include", "src")]
    level = "-O1" if compiler.endswith("++") else "-O0"  # C is optimised in the tests above
    flags = [*language, level, "-ffp-contract=off", *STRICT, *includes]
    run(require_tool(compiler), *flags, "-c", unit, "-o", tmp_path / "unit.o")
    gcc = require_tool("gcc")
    for name, (folder, _) in zip(names, folders, strict=True):

        def checker(path: Path, folder: Path = folder) -> None:
            compile_c(gcc, [folder / "self_check.c"], path, *FLAGS, "-c", exports=[folder])

        check = compile_c(gcc, [tmp_path / "unit.o", once(f"checkers/{name}.o", checker)], tmp_path / "check")
        assert "all bits as expected" in run(check, folder / "test_vectors.txt")


def test_wrong_builds_are_refused_or_found_out(
    export: Folder, tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    folder, prefix = export("baked")
    gcc = require_tool("gcc")
    fast = [gcc, "-ffast-math", f"-I{folder / 'include'}", "-c", str(folder / "src" / f"{prefix}.c"), "-o", "/dev/null"]
    done = subprocess.run(fast, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "without -ffast-math" in done.stderr

    # One constant in its last bit, as a wrong compiler might have it.
    broken = tmp_path / "broken"
    shutil.copytree(folder, broken)
    source = broken / "src" / f"{prefix}.c"
    text = source.read_text()
    assert text.count("= 29.6;") >= 1
    source.write_text(text.replace("= 29.6;", f"= {math.nextafter(29.6, 30.0)!r};"))
    program = compile_c(
        gcc, sources(broken, prefix, "self_check.c"), tmp_path / "check", "-std=c99", "-ffp-contract=off"
    )
    done = subprocess.run([program, folder / "test_vectors.txt"], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert re.search(r"line \d+: \w+ of springline_step is .*; first differing bit: \d+", done.stdout)
    assert "-ffp-contract=off" in done.stdout

    if "fma" in Path("/proc/cpuinfo").read_text().split():
        flags = ("-O2", "-std=gnu99", "-mfma", "-ffp-contract=fast")
        program = compile_c(gcc, sources(folder, prefix, "self_check.c"), tmp_path / "fused", *flags)
        assert subprocess.run([program, folder / "test_vectors.txt"], capture_output=True, check=False).returncode == 1


def test_the_readme_builds_it(export: Folder, tmp_path: Path) -> None:
    folder = tmp_path / "copy"
    shutil.copytree(export("baked")[0], folder)
    [command] = re.findall(r"^```sh\n(cc .*?)^```", (folder / "README.md").read_text(), re.MULTILINE | re.DOTALL)
    done = subprocess.run(command, shell=True, cwd=folder, capture_output=True, text=True, check=False)  # noqa: S602 - what the README says
    assert done.returncode == 0, done.stderr
    assert "all bits as expected" in done.stdout


# --- calling it ------------------------------------------------------------------------------------------------


class Library:
    """An export as a shared library; structures are read off its header, as an embedder would."""

    def __init__(self, folder: Path, prefix: str, library: Path) -> None:
        self._handle = ctypes.CDLL(str(library))
        self._prefix = prefix
        header = without_comments(folder / "include" / f"{prefix}.h")
        real = ctypes.c_double if f"typedef double {prefix}_real" in header else ctypes.c_float
        self.types: dict[str, Any] = {"int32_t": ctypes.c_int32, f"{prefix}_real": real}
        for body, name in re.findall(r"typedef struct \w+ \{(.*?)\} (\w+);", header, re.DOTALL):
            fields = [
                (field, self.types[kind] * int(count) if count else self.types[kind])
                for kind, field, count in re.findall(r"(\w+) (\w+)(?:\[(\d+)\])?;", body)
            ]
            self.types[name] = type(name, (ctypes.Structure,), {"_fields_": fields})
        self.real = real
        getattr(self._handle, f"{prefix}_status_text").restype = ctypes.c_char_p
        pointer = ctypes.c_void_p
        getattr(self._handle, f"{prefix}_plant_step").argtypes = [pointer, pointer, pointer, pointer, real]
        getattr(self._handle, f"{prefix}_signals").argtypes = [pointer, real, pointer, pointer]

    def new(self, name: str) -> Any:
        return self.types[f"{self._prefix}_{name}"]()

    def array(self, name: str, count: int) -> Any:
        return (self.types[f"{self._prefix}_{name}"] * count)()

    def default(self) -> Any:
        return self.types[f"{self._prefix}_config"].in_dll(self._handle, f"{self._prefix}_default_config")

    def __call__(self, name: str, *arguments: Any) -> str:
        """The status' name."""
        passed = [ctypes.byref(a) if isinstance(a, ctypes.Structure | ctypes.Array) else a for a in arguments]
        return STATUS[getattr(self._handle, f"{self._prefix}_{name}")(*passed)][0]

    def text(self, status: int) -> str:
        return getattr(self._handle, f"{self._prefix}_status_text")(status).decode()


def compile_library(folder: Path, prefix: str, output: Path) -> Path:
    return compile_c("cc", [folder / "src" / f"{prefix}.c"], output, *FLAGS, "-fPIC", "-shared")


@pytest.fixture(scope="module")
def library(export: Folder, once: Once) -> Callable[[str], Library]:
    made: dict[str, Library] = {}

    def load(name: str) -> Library:
        if name not in made:
            folder, prefix = export(name)
            made[name] = Library(folder, prefix, once(f"libraries/{name}.so", partial(compile_library, folder, prefix)))
        return made[name]

    return load


def fields(structure: Any) -> Iterator[str]:
    return (name for name, *_ in structure._fields_)


def values(structure: Any) -> list[float]:
    return [getattr(structure, name) for name in fields(structure)]


class Case:
    """A ready controller with plausible inputs."""

    def __init__(self, library: Library, fallback: int = 0, **parameters: float) -> None:
        self.library = library
        self.controller, self.reference, self.measurement = map(library.new, ("controller", "reference", "measurement"))
        self.command, self.diagnostics, self.state = map(library.new, ("command", "diagnostics", "state"))
        config = type(library.default()).from_buffer_copy(library.default())
        config.fallback = fallback
        for name, value in parameters.items():
            setattr(config.parameters, name, value)
        self.status = library("init", self.controller, config)
        base = library.new("base")
        if self.status == "OK":
            assert library("start", self.controller, self.state) == "OK"
            assert library("signals", self.controller, 0.0, self.reference, base) == "OK"
            self.measure()

    def measure(self) -> None:
        for name in fields(self.measurement):
            setattr(self.measurement, name, getattr(self.state, name))

    def step(self) -> str:
        return self.library("step", self.controller, self.reference, self.measurement, self.command, self.diagnostics)


def test_header_and_readme_say_what_every_field_is(export: Folder) -> None:
    folder, _ = export("baked")
    header, readme = ((folder / file).read_text() for file in ("include/springline.h", "README.md"))
    system = load_scenario("paper/nominal").system()
    for entry in entries((*REFERENCE, *system.drive.state, U, E, SIGMA, SATURATED, *BASE), system.joints):
        comment = rf"/\* {re.escape(entry.unit)}; {re.escape(entry.meaning)} \*/"
        assert re.search(rf"^  \w+ {entry.name}; +{comment}$", header, re.MULTILINE), entry
        assert f"| `{entry.name}` | {entry.unit} | {entry.meaning} |" in readme, entry


def test_sizes_are_what_the_readme_says(export: Folder, library: Callable[[str], Library]) -> None:
    for name in EXPORTS:
        folder, _ = export(name)
        [size] = set(re.findall(r"controller takes (\d+) bytes", (folder / "README.md").read_text()))
        assert ctypes.sizeof(library(name).new("controller")) == int(size), name


@pytest.mark.parametrize("name", ["baked", "single", "all"])
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("fallback", [0, 1])
def test_a_number_that_is_not_finite_gives_the_fallback(
    name: str, bad: float, fallback: int, library: Callable[[str], Library]
) -> None:
    case = Case(library(name), fallback)
    assert case.step() == "OK"
    good = values(case.command)
    assert any(good)
    expected = good if fallback == 1 else [0.0, 0.0]
    for structure, status in ((case.reference, "BAD_REFERENCE"), (case.measurement, "BAD_MEASUREMENT")):
        for field in fields(structure):
            kept = getattr(structure, field)
            setattr(structure, field, bad)
            case.command.U_lift = math.nan
            assert case.step() == status, field
            assert values(case.command) == expected
            assert not any(values(case.diagnostics))
            setattr(structure, field, kept)
    assert case.step() == "OK"
    assert values(case.command) == good


def test_null_and_uninitialised(library: Callable[[str], Library]) -> None:
    lib = library("baked")
    case = Case(lib, fallback=1)
    assert case.step() == "OK"
    good = values(case.command)
    arguments = [case.controller, case.reference, case.measurement, case.command]
    for k in range(4):
        case.command.U_lift = 7.0
        assert lib("step", *[None if i == k else a for i, a in enumerate(arguments)], None) == "NULL_ARGUMENT"
        if k in (1, 2):
            assert values(case.command) == good
        if k == 0:
            assert values(case.command) == [0.0, 0.0]
    assert lib("init", None, lib.default()) == "NULL_ARGUMENT"
    assert lib("init", case.controller, None) == "NULL_ARGUMENT"
    assert case.step() == "NOT_INITIALIZED"
    assert values(case.command) == [0.0, 0.0]
    assert lib("start", lib.new("controller"), case.state) == "NOT_INITIALIZED"
    assert Case(lib, fallback=2).status == "BAD_FALLBACK"


def test_parameters_are_checked(library: Callable[[str], Library]) -> None:
    lib = library("all")
    assert Case(lib).status == "OK"
    assert Case(lib, control_U_max_lift=math.inf).status == "OK"  # no limit is a limit
    for name, bad in (
        ("control_k1", 0.0), ("control_k1", -1.0), ("control_k1", math.nan), ("control_k1", math.inf),
        ("control_alpha", 1.0), ("control_alpha", 0.0), ("control_nu", 3.0), ("control_nu", 0.0),
        ("control_beta", 1.0), ("control_U_max_lift", math.nan), ("control_U_max_lift", 0.0),
        ("mechanism_g", math.nan), ("drive_epsilon", 1.5), ("control_delta", -1e-9),
    ):  # fmt: skip
        case = Case(lib, **{name: bad})
        assert case.status == "BAD_PARAMETER", (name, bad)
        assert case.step() == "NOT_INITIALIZED"
        assert values(case.command) == [0.0, 0.0]


# --- retuning while it runs ------------------------------------------------------------------------------------


def copy(structure: Any) -> Any:
    return type(structure).from_buffer_copy(structure)


def other(slot: Slot, value: float) -> float:
    """An admissible value that is not `value`."""
    candidates = (1.25 * value, 0.75 * value, value + 0.5, 0.5, 2.0, 4.0)
    return next(x for x in candidates if x != value and slot.bounds.holds(x))


@pytest.mark.parametrize("name", ["baked", "all", "single_tunable"])
def test_a_retuning_that_is_refused_changes_nothing(name: str, library: Callable[[str], Library]) -> None:
    """One value of many is bad: none is taken, and the next command is as if nobody had asked."""
    lib = library(name)
    case = Case(lib, fallback=1)
    assert case.step() == "OK"
    command, before = values(case.command), bytes(case.controller)
    wrong: list[tuple[Any, str]] = [(None, "NULL_ARGUMENT")]
    for fallback in (-1, 2, 2**16):
        config = copy(case.controller.config)
        config.fallback = fallback
        wrong.append((config, "BAD_FALLBACK"))
    if name != "baked":
        slots = load_scenario("paper/nominal").system().slots
        for bad in slots:
            for number in (math.nan, -math.inf):
                config = copy(case.controller.config)
                config.fallback = 0
                for slot in slots:
                    setattr(config.parameters, slot.symbol, other(slot, getattr(config.parameters, slot.symbol)))
                setattr(config.parameters, bad.symbol, number)
                wrong.append((config, "BAD_PARAMETER"))
    for config, status in wrong:
        assert lib("set_parameters", case.controller, config) == status
        assert bytes(case.controller) == before
    assert case.step() == "OK"
    assert values(case.command) == command


@pytest.mark.parametrize("name", ["all", "single_tunable"])
def test_retuning_is_starting_anew_with_the_past_kept(name: str, library: Callable[[str], Library]) -> None:
    """Whichever parameter changes: control, plant and signals have the bits of a controller that started with it."""
    lib = library(name)
    live = Case(lib)
    differing = 0
    for slot in load_scenario("paper/nominal").system().slots:
        value = other(slot, getattr(lib.default().parameters, slot.symbol))
        fresh = Case(lib, **{slot.symbol: value})
        live.reference, live.measurement = copy(fresh.reference), copy(fresh.measurement)
        assert lib("set_parameters", live.controller, lib.default()) == "OK"
        assert live.step() == "OK"
        nominal, last = values(live.command), bytes(live.controller.last)
        config = copy(lib.default())
        setattr(config.parameters, slot.symbol, value)
        assert lib("set_parameters", live.controller, config) == "OK"
        assert bytes(live.controller.last) == last
        assert live.step() == fresh.step() == "OK"
        assert bytes(live.command) == bytes(fresh.command), slot.key
        assert bytes(live.diagnostics) == bytes(fresh.diagnostics), slot.key
        differing += values(live.command) != nominal
        states = [copy(fresh.state), copy(fresh.state)]
        for case, state in zip((live, fresh), states, strict=True):
            assert lib("start", case.controller, state) == "OK"
            assert lib("plant_step", case.controller, state, fresh.command, None, 1e-4) == "OK"
        assert bytes(states[0]) == bytes(states[1]), slot.key
        signals = [(copy(fresh.reference), lib.new("base")) for _ in range(2)]
        for case, (reference, base) in zip((live, fresh), signals, strict=True):
            assert lib("signals", case.controller, 0.3, reference, base) == "OK"
        assert bytes(signals[0][0]) == bytes(signals[1][0]), slot.key
    assert differing > 10


def test_the_last_command_survives_a_retuning_and_not_a_reset(library: Callable[[str], Library]) -> None:
    lib = library("tunable")
    case = Case(lib)
    assert case.step() == "OK"
    last = values(case.command)
    config = copy(case.controller.config)
    config.fallback, config.parameters.control_mu_lift = 1, 3.0
    assert lib("set_parameters", case.controller, config) == "OK"
    kept = case.measurement.q1_lift
    case.measurement.q1_lift = math.nan
    assert case.step() == "BAD_MEASUREMENT"
    assert values(case.command) == last
    assert lib("set_parameters", case.controller, case.controller.config) == "OK"  # from the controller itself
    assert lib("reset", case.controller) == "OK"
    assert bytes(case.controller.config) == bytes(config)
    assert case.step() == "BAD_MEASUREMENT"
    assert values(case.command) == [0.0, 0.0]
    case.measurement.q1_lift = kept
    tuned = Case(lib, control_mu_lift=3.0)
    assert case.step() == tuned.step() == "OK"
    assert values(case.command) == values(tuned.command) != last


def test_only_init_makes_a_controller_ready_and_a_refused_one_leaves_none(library: Callable[[str], Library]) -> None:
    """Init is for start-up: what it refuses commands zero, whatever ran in that memory before."""
    lib = library("tunable")
    raw = lib.new("controller")
    before = bytes(raw)
    assert lib("set_parameters", raw, lib.default()) == lib("reset", raw) == "NOT_INITIALIZED"
    assert bytes(raw) == before
    assert lib("set_parameters", None, lib.default()) == lib("reset", None) == "NULL_ARGUMENT"
    case = Case(lib, fallback=1)
    assert case.step() == "OK"
    config = copy(lib.default())
    config.parameters.control_k1 = math.nan
    assert lib("init", case.controller, config) == "BAD_PARAMETER"
    assert case.step() == "NOT_INITIALIZED"
    assert values(case.command) == [0.0, 0.0]
    assert lib("set_parameters", case.controller, lib.default()) == "NOT_INITIALIZED"


# --- limits ----------------------------------------------------------------------------------------------------


def test_limits_hold_and_are_flagged(library: Callable[[str], Library]) -> None:
    case = Case(library("tunable"), control_U_max_lift=100.0, control_U_max_rotation=1e6)
    assert case.step() == "OK"
    assert case.command.U_lift == -100.0
    assert (case.diagnostics.saturated_lift, case.diagnostics.saturated_rotation) == (1, 0)
    assert case.diagnostics.U_s_lift + case.diagnostics.U_f_lift < -100.0
    assert case.command.U_rotation == case.diagnostics.U_s_rotation + case.diagnostics.U_f_rotation


@pytest.mark.parametrize("name", ["tunable", "single_tunable"])
def test_a_law_that_a_max_limits_is_flagged(name: str, library: Callable[[str], Library]) -> None:
    """Where the flag changes as the limit moves is the size of what the law wishes, equation (18) by hand."""
    lib = library(name)
    free = Case(lib, control_a_max_lift=math.inf, control_a_max_rotation=math.inf)
    assert free.step() == "OK"
    assert (free.diagnostics.a_limited_lift, free.diagnostics.a_limited_rotation) == (0, 0)
    for joint, other_joint in (("lift", "rotation"), ("rotation", "lift")):
        low, high = 1e-3, 1e8  # limits, and does not
        for _ in range(100):
            middle = 0.5 * (low + high)
            case = Case(lib, **{f"control_a_max_{joint}": middle, f"control_a_max_{other_joint}": math.inf})
            assert case.step() == "OK"
            assert getattr(case.diagnostics, f"a_limited_{other_joint}") == 0
            if getattr(case.diagnostics, f"a_limited_{joint}"):
                low = middle
            else:
                assert values(case.command) == values(free.command)
                high = middle
        size = abs(getattr(free.diagnostics, f"sigma_{joint}"))
        logarithm = math.log(10.0 * size**2 + 1.0)
        wish = 3.0 * size ** (0.9 * max(size, 1.0)) + 5.0 * logarithm**1.5 + 12.0 * logarithm**0.5
        assert high == pytest.approx(wish, rel=1e-12 if name == "tunable" else 1e-5)
    case.measurement.q1_lift = math.nan
    assert case.step() == "BAD_MEASUREMENT"
    assert not any(values(case.diagnostics))


def test_without_a_limit_the_flags_stay_and_are_zero(tmp_path: Path) -> None:
    """The structure is the same whatever is baked; both signs of the error reach the limit where there is one."""
    flags = {}
    for a_max in (math.inf, 30.0):
        loaded = load_scenario("paper/nominal", {"control.a_max": [a_max, a_max]})
        folder = tmp_path / str(a_max)
        write_tree(folder, *generate_files(bind(loaded.structure(), loaded.values())))
        case = Case(Library(folder, "springline", compile_library(folder, "springline", tmp_path / f"{a_max}.so")))
        seen = []
        for shift in (-1.0, 1.0):
            case.measure()
            case.measurement.q1_rotation = case.reference.q1d_rotation + shift
            assert case.step() == "OK"
            seen.append((case.diagnostics.a_limited_lift, case.diagnostics.a_limited_rotation))
        flags[a_max] = seen
    assert flags == {math.inf: [(0, 0), (0, 0)], 30.0: [(1, 1), (1, 1)]}


def test_what_overflows_never_becomes_a_limit(library: Callable[[str], Library]) -> None:
    """fmin(fmax(NaN, -U), U) is -U: a limiter would hide an overflow, so what stands before it is looked at."""
    limits = {"control_U_max_lift": 50.0, "control_U_max_rotation": 50.0}
    case = Case(library("tunable"), **limits)
    case.measurement.q1_lift = 1e200  # e^3 overflows; sigma is infinite
    assert case.step() == "OVERFLOW"
    assert values(case.command) == [0.0, 0.0]
    for gain in ("k1", "k2", "k3"):  # the law's sum overflows, which a_max would hide
        case = Case(library("tunable"), **{f"control_{gain}": 1e308})
        assert case.step() == "OVERFLOW"
        assert values(case.command) == [0.0, 0.0]
        assert not any(values(case.diagnostics))
    case = Case(library("tunable"), control_a_max_lift=math.inf, control_K_f_lift=1e300, **limits)
    case.measurement.dq1_lift, case.measurement.dq2_lift = 1e10, -1e10
    assert case.step() == "OVERFLOW"
    assert values(case.command) == [0.0, 0.0]


@given(
    numbers=st.lists(
        st.floats(width=32) | st.floats() | st.sampled_from([0.0, -0.0, 1e-300, 1e300]), min_size=12, max_size=12
    )
)
def test_ok_means_finite_and_within_limits(library: Callable[[str], Library], numbers: list[float]) -> None:
    case = Case(library("tunable"), control_U_max_lift=1e4, control_U_max_rotation=2e3)
    for k, (structure, field) in enumerate(
        [(s, field) for s in (case.reference, case.measurement) for field in fields(s)]
    ):
        setattr(structure, field, numbers[k])
    status = case.step()
    assert abs(case.command.U_lift) <= 1e4
    assert abs(case.command.U_rotation) <= 2e3
    if status == "OK":
        assert all(map(math.isfinite, [*numbers, *values(case.diagnostics)]))
    else:
        assert values(case.command) == [0.0, 0.0]
        assert status in ("BAD_REFERENCE", "BAD_MEASUREMENT", "OVERFLOW")


def test_plant_step_refuses_and_keeps_the_state(library: Callable[[str], Library]) -> None:
    lib = library("baked")
    case = Case(lib)
    base = lib.array("base", 3)
    before = values(case.state)
    for step in (0.0, -1e-4, math.nan, math.inf):
        assert lib("plant_step", case.controller, case.state, case.command, None, step) == "BAD_PLANT_INPUT"
    base[1].theta_1x = math.nan
    assert lib("plant_step", case.controller, case.state, case.command, base, 1e-4) == "BAD_PLANT_INPUT"
    case.command.U_lift = math.inf
    assert lib("plant_step", case.controller, case.state, case.command, None, 1e-4) == "BAD_PLANT_INPUT"
    case.command.U_lift = 1e308
    assert lib("plant_step", case.controller, case.state, case.command, None, 1e10) == "DIVERGED"
    assert lib("plant_step", case.controller, None, case.command, None, 1e-4) == "NULL_ARGUMENT"
    assert values(case.state) == before
    case.command.U_lift = 0.0
    at_rest = type(case.state).from_buffer_copy(case.state)
    assert lib("plant_step", case.controller, case.state, case.command, None, 1e-4) == "OK"
    assert lib("plant_step", case.controller, at_rest, case.command, lib.array("base", 3), 1e-4) == "OK"
    assert values(case.state) == values(at_rest) != before


def test_every_status_has_a_sentence(library: Callable[[str], Library]) -> None:
    lib = library("tunable")
    texts = [lib.text(status) for status in range(len(STATUS))]
    assert len(set(texts)) == len(STATUS)
    assert all(re.fullmatch(r"[a-z][^\n]+", text) for text in texts)
    assert "arm_init" in texts[2]  # names carry the prefix
    assert lib.text(-1) == lib.text(999) == "no status of this library"


def test_instances_do_not_know_of_each_other(library: Callable[[str], Library]) -> None:
    lib = library("tunable")
    alone = Case(lib, control_mu_lift=2.0)
    assert alone.step() == "OK"
    one, two = Case(lib, control_mu_lift=2.0), Case(lib, fallback=1, control_mu_lift=4.0)
    assert (one.step(), two.step(), one.step()) == ("OK", "OK", "OK")
    assert values(one.command) == values(alone.command) != values(two.command)


# --- the simulator's bits ------------------------------------------------------------------------------------


def columns(text: str) -> dict[str, np.ndarray]:
    header, *rows = text.splitlines()
    table = np.array([[float(number) for number in row.split(",")] for row in rows])
    return dict(zip(header.split(","), table.T, strict=True))


_QUANTITIES = ("q1", "dq1", "q2", "dq2", "q1d", "e", "sigma", "U")


@pytest.mark.parametrize(
    ("scenario", "made", "engine"),
    [
        ("paper/nominal", "baked", "lanes"),
        ("paper/nominal", "all", "casadi"),
        ("paper/group1_shake", "none", "lanes"),
        ("paper/group1_shake", "control", "casadi"),
        ("paper/group3_payload_plus", "none", "lanes"),
    ],
)
def test_the_exported_loop_gives_the_simulators_bits(
    scenario: str, made: str, engine: Any, export: Folder, tmp_path: Path
) -> None:
    """main.c: control at 1 kHz, plant steps of 0.1 ms, against the sampled loop with the same rates, bit for bit."""
    loaded = load_scenario(scenario)
    structure, numbers = loaded.structure(), loaded.values()
    if made in EXPORTS:
        folder, prefix = export(made)
    else:
        folder, prefix = tmp_path / "c", "springline"
        write_tree(folder, *generate_files(bind(structure, numbers, tunable=made)))
    program = compile_c("cc", [folder / "src" / f"{prefix}.c", folder / "main.c"], tmp_path / "main", *FLAGS)
    printed = columns(run(program, "1"))

    options = KernelOptions(engine=engine, width=1, groups=1, flags=("-O1",))
    loop = kernel(KernelSpec(structure, True, options=options))
    runs = loop.run(numbers[None], LoopSettings(steps=10_000, step=1e-4, hold=10, output_every=100))
    rows = runs.trajectory[0].T
    names = [
        "t",
        *(f"{q}_{j}" for q in ("q1", "dq1", "q2", "dq2", "q1d", "e", "sigma", "U") for j in ("lift", "rotation")),
    ]
    simulated = dict(zip(names, rows, strict=False))
    for name, column in printed.items():
        assert np.array_equal(column, simulated[name]), name


def test_single_precision_against_double(export: Folder, tmp_path: Path) -> None:
    """A closed loop of one second, control at 1 kHz: docs/embedding.md states these bounds."""
    trajectories = []
    for name in ("baked", "single"):
        folder, prefix = export(name)
        units = [folder / "src" / f"{prefix}.c", folder / "main.c"]
        program = compile_c("cc", units, tmp_path / name, *FLAGS)
        trajectories.append(columns(run(program, "1")))
    double, single = trajectories
    error = {name: float(np.abs(single[name] - double[name]).max()) for name in double}
    assert error["q1_lift"] < 1e-5
    assert error["q1_rotation"] < 1e-5
    assert max(error["U_lift"], error["U_rotation"]) < 1.0


def test_single_precision_step_by_step(library: Callable[[str], Library], export: Folder) -> None:
    """The same thousand inputs in both: the difference against the largest command and sliding variable."""
    vectors = (export("single")[0] / "test_vectors.txt").read_text().splitlines()
    rows = [[float.fromhex(word) for word in line.split()[1:13]] for line in vectors if line.startswith("control")]
    results = []
    for name in ("baked", "single"):
        case = Case(library(name))
        places = [(part, field) for part in (case.reference, case.measurement) for field in fields(part)]
        outputs = []
        for row in rows:
            for (part, field), number in zip(places, row, strict=True):
                setattr(part, field, number)
            assert case.step() == "OK"
            outputs.append([*values(case.command), case.diagnostics.sigma_lift, case.diagnostics.sigma_rotation])
        results.append(np.array(outputs))
    double, single = results
    relative = np.abs(single - double).max(axis=0) / np.abs(double).max(axis=0)
    assert relative.max() < 3e-7, relative


def test_single_precision_keeps_a_parameter_that_looks_like_a_guard(tmp_path: Path) -> None:
    """700 is where the model caps exponents, and 85 where floats have to; as a limit of a motor it stays 700."""
    loaded = load_scenario("paper/nominal", {"control.U_max": [700.0, 350.0]})
    write_tree(tmp_path / "c", *generate_files(bind(loaded.structure(), loaded.values(), real="float")))
    case = Case(Library(tmp_path / "c", "springline", compile_library(tmp_path / "c", "springline", tmp_path / "c.so")))
    case.measurement.q1_lift = 1.5
    assert case.step() == "OK"
    assert abs(case.command.U_lift) == 700.0


def test_structures_of_tables_export_without_their_data_and_say_so(tmp_path: Path) -> None:
    """Signals from tables are inputs of the C; its own are zero there: header, README and what main prints say it."""
    record = tmp_path / "reference.csv"
    record.write_text("t,lift\n" + "".join(f"{k},{0.01 * k}\n" for k in range(20)))
    wish = {"reference.kind": "table", "reference.path": str(record), "reference.columns": {"t": "t", "lift": "lift"}}
    tracked = load_scenario("paper/nominal", wish)
    for name, loaded, table in (
        ("base", load_scenario("ship/vessel_10hz"), "base motion table is"),
        ("reference", tracked, "reference table is"),
    ):
        folder = tmp_path / name
        write_tree(folder, *generate_files(bind(loaded.structure(), loaded.values())))
        for file in ("include/springline.h", "README.md"):
            words = re.sub(r"\s+(\* )?", " ", (folder / file).read_text())
            assert f"{table} not part of the export" in words, (name, file)
        units = sources(folder, "springline", "self_check.c")
        run(compile_c("cc", units, tmp_path / "check", *WARNINGS, "-O0"), folder / "test_vectors.txt")
        main = compile_c("cc", [folder / "src" / "springline.c", folder / "main.c"], tmp_path / "main", *WARNINGS)
        done = subprocess.run([main, "1"], capture_output=True, text=True, check=True)
        assert f"{table} not part of the export: main runs with zero" in done.stderr
        printed = columns(done.stdout)
        assert any(printed["q1d_rotation"]) == (name == "base")


# --- sampling ------------------------------------------------------------------------------------------------


_DELAYED = """
#include <stdio.h>
#include <stdlib.h>
#include "springline.h"
/* delayed PERIOD DELAY, in plant steps of 0.1 ms: prints when the arm is beyond 10 m or 10 rad, or 0 if it stays */
int main(int argc, char **argv) {
  const int period = atoi(argv[1]), delay = atoi(argv[2]);
  springline_controller controller;
  springline_state arm;
  springline_reference wanted;
  springline_base base;
  springline_command sent[32] = {{0.0}}, given = {0.0};
  int k;
  if (argc != 3 || springline_init(&controller, &springline_default_config) != SPRINGLINE_OK) return 1;
  if (springline_start(&controller, &arm) != SPRINGLINE_OK) return 1;
  for (k = 0; k < 120000; k++) {
    springline_measurement seen = {arm.q1_lift, arm.q1_rotation, arm.dq1_lift, arm.dq1_rotation, arm.dq2_lift,
                                   arm.dq2_rotation};
    int status = springline_signals(&controller, 1e-4 * k, &wanted, &base);
    if (k % period == 0) status |= springline_step(&controller, &wanted, &seen, &given, NULL);
    sent[k % 32] = given;
    status |= springline_plant_step(&controller, &arm, &sent[(k - delay + 32) % 32], NULL, 1e-4);
    if (status != 0 || arm.q1_lift > 10.0 || arm.q1_lift < -10.0 || arm.q1_rotation > 10.0 || arm.q1_rotation < -10.0) {
      printf("%g\\n", 1e-4 * k);
      return 0;
    }
  }
  printf("0\\n");
  return 0;
}
"""


def test_the_delays_that_the_documents_promise_survive_and_the_next_ones_do_not(export: Folder, tmp_path: Path) -> None:
    """Twelve seconds of the nominal scenario, in the C that is exported, against the table of the page."""
    folder, prefix = export("baked")
    (tmp_path / "delayed.c").write_text(_DELAYED)
    units = [folder / "src" / f"{prefix}.c", tmp_path / "delayed.c"]
    program = compile_c("cc", units, tmp_path / "delayed", *FLAGS)
    text = (Path(__file__).parents[4] / "docs" / "embedding.md").read_text()
    assert "any sample rate" not in text
    rows = re.findall(r"^\| ((?:[\d.]+ ms(?:, )?)+) \| ([\d.]+) ms \|$", text, re.MULTILINE)
    survived = {
        round(10 * float(period)): round(10 * float(delay))
        for periods, delay in rows
        for period in re.findall(r"[\d.]+", periods)
    }
    assert survived == {1: 9, 5: 7, 10: 5, 20: 1}
    for period, delay in survived.items():
        assert float(run(program, str(period), str(delay))) == 0.0, (period, delay)
    for period, delay in ((1, 11), (5, 8), (10, 6), (20, 2), (21, 0), (10, 10)):
        assert 0.0 < float(run(program, str(period), str(delay))) < 12.0, (period, delay)


@pytest.mark.parametrize(
    ("law", "form"), [("double_power", "power"), ("power", "power"), ("variable_power_log", "base")]
)
def test_every_law_exports(law: str, form: Any, tmp_path: Path) -> None:
    loaded = load_scenario("paper/nominal")
    structure = replace(loaded.structure(), law=law, log_form=form)
    write_tree(tmp_path / "c", *generate_files(bind(structure, loaded.values(), tunable=["control.alpha"])))
    units = sources(tmp_path / "c", "springline", "self_check.c")
    run(compile_c("cc", units, tmp_path / "check", *WARNINGS, "-O0"), tmp_path / "c" / "test_vectors.txt")
