"""Both engines, any width, any compiler: the same bits (docs/equal-bits.md)."""

import itertools
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any, get_args

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from springline.codegen.kernel import (
    Engine,
    Kernel,
    KernelOptions,
    KernelSource,
    KernelSpec,
    LoopSettings,
    Runs,
    Shape,
    Span,
    lanes,
    print_kernel,
    toolchain,
)
from springline.codegen.kernel.compiled import compile_kernel
from springline.codegen.program import LoopGraph, Program
from springline.model.symbolic import as_written
from springline.model.terms import Term

Values = Callable[..., NDArray[np.float64]]
SHORT = LoopSettings(steps=400, step=1e-4, output_every=50)
VARIED = ("control.delta", "plant.m3", "base_motion.heave.0.amplitude", "initial.q.0")


def spread(program: Program, values_of: Values, runs: int) -> NDArray[np.float64]:
    """Nominal values, with the varied keys different in every run."""
    table = np.tile(values_of(program), (runs, 1))
    keys = [slot.key for slot in program.system.slots]
    rng = np.random.default_rng(7)
    for key in VARIED:
        table[:, keys.index(key)] *= rng.uniform(0.9, 1.1, runs)
    return table


def run(
    program: Program,
    table: NDArray[np.float64],
    options: KernelOptions,
    *,
    tunable: tuple[str, ...] | None = None,
    sampled: bool = False,
    settings: LoopSettings = SHORT,
) -> Runs:
    baked = () if tunable is None else tuple(table[0])
    kernel = compile_kernel(program, KernelSpec(program.system.structure, sampled, tunable, baked, options))
    keys = [slot.key for slot in program.system.slots]
    return kernel.run(table[:, [keys.index(key) for key in kernel.parameters]], settings)


def assert_same(actual: Runs, expected: Runs) -> None:
    for name in ("final_state", "end_time", "status", "quantity", "rows", "trajectory", "metrics"):
        a, b = getattr(actual, name), getattr(expected, name)
        assert a.shape == b.shape
        differ = np.argwhere(~((a.view(f"i{a.itemsize}") == b.view(f"i{b.itemsize}")) | (np.isnan(a) & np.isnan(b))))
        assert not len(differ), f"{name}: {len(differ)} of {a.size} entries differ, first at {differ[0]}"


@pytest.fixture(scope="module")
def table(shaken: Program, values_of: Values) -> NDArray[np.float64]:
    return spread(shaken, values_of, 37)


@pytest.fixture(scope="module", params=[False, True], ids=["continuous", "sampled"])
def reference(request: pytest.FixtureRequest, shaken: Program, table: NDArray[np.float64]) -> tuple[bool, Runs]:
    sampled = request.param
    return sampled, run(
        shaken, table, KernelOptions(engine="casadi", flags=("-O2",)), sampled=sampled, settings=replace(SHORT, hold=5)
    )


LANES = [
    (KernelOptions(width=1, groups=1, flags=("-O0",)), None),
    (KernelOptions(width=1, groups=1), VARIED),
    (KernelOptions(width=2, groups=1, packs=3, flags=("-O1",)), None),
    (KernelOptions(width=4, groups=2, packs=2, flags=("-O2",)), VARIED),
    (KernelOptions(width=4, groups=1), None),
    (KernelOptions(width=8, groups=2, flags=("-O2",)), None),
    (KernelOptions(width=16, groups=1, flags=("-O1",)), VARIED),
    (KernelOptions(), None),
    (KernelOptions(width=2, alone=True, paired=True, flags=("-O1",)), VARIED),
    (KernelOptions(width=4, alone=True, paired=True, flags=("-O2",)), None),
]


def name_of(options: KernelOptions, tunable: tuple[str, ...] | None) -> str:
    shape = f"W{options.width}G{options.groups}P{options.packs}{'-alone' * options.alone}"
    return f"{shape}{''.join(options.flags or ())}{'-baked' * bool(tunable)}"


@pytest.mark.parametrize(("options", "tunable"), LANES, ids=[name_of(*each) for each in LANES])
def test_lanes_equal_casadi(
    options: KernelOptions,
    tunable: tuple[str, ...] | None,
    reference: tuple[bool, Runs],
    shaken: Program,
    table: NDArray[np.float64],
) -> None:
    sampled, expected = reference
    settings = replace(SHORT, hold=5)
    assert_same(run(shaken, table, options, tunable=tunable, sampled=sampled, settings=settings), expected)


@pytest.mark.parametrize("flags", [("-O0",), ("-O3", "-march=native")], ids=["O0", "O3native"])
def test_clang_equals_gcc(
    flags: tuple[str, ...],
    reference: tuple[bool, Runs],
    shaken: Program,
    table: NDArray[np.float64],
    require_tool: Callable[..., str],
) -> None:
    clang = toolchain.probe_compiler([require_tool("clang", "apt-get install clang")])
    assert clang is not None
    sampled, expected = reference
    for engine in get_args(Engine):
        options = KernelOptions(engine=engine, flags=flags, compiler=clang)
        assert_same(run(shaken, table, options, sampled=sampled, settings=replace(SHORT, hold=5)), expected)


Build = dict[str, Any]
BUILDS: dict[str, tuple[Any, ...]] = {
    "loop": ("continuous", "sampled"),
    "compiler": ("gcc", "clang"),
    "level": ("-O0", "-O1", "-O2", "-O3"),
    "machine": ("x86-64", "x86-64-v3", "native", "x86-64-v4"),
    "kind": ("casadi", 1, 2, 4, 8, 16, "alone 2", "alone 4"),
    "groups": (1, 2),
    "packs": (1, 2, 3),
    "span": get_args(Span),
    "parameters": ("tunable", "baked"),
}
"""What a build may differ in. Kind: CasADi's C, so many lanes, or a run alone in so many."""


def exists(build: Build) -> bool:
    """Whether there is such a build, as far as it is said what it is: a dimension without a choice has its first."""
    kind = build.get("kind")
    if isinstance(kind, str):  # one run at a time
        free = ("groups", "packs", *(("span", "parameters") if kind == "casadi" else ()))
        return all(build.get(name, BUILDS[name][0]) == BUILDS[name][0] for name in free)
    # Vectors that a machine lacks are taken apart: whole steps of them keep gcc busy for a minute.
    return kind != 16 or build.get("span", "evaluation") == "evaluation"


def pairs_of(builds: list[Build]) -> set[frozenset[tuple[str, Any]]]:
    """What any two dimensions are together in some build."""
    return {frozenset(pair) for build in builds for pair in itertools.combinations(build.items(), 2)}


def pairwise(dimensions: dict[str, tuple[Any, ...]]) -> list[Build]:
    """Few builds in which every value of each dimension meets every one of each other, as far as both can be."""
    values = [[(name, value) for value in choice] for name, choice in dimensions.items()]
    pairs = (pair for both in itertools.combinations(values, 2) for pair in itertools.product(*both))
    left = {frozenset(pair): None for pair in pairs if exists(dict(pair))}  # in this order, which a set has not
    found = []
    while left:
        build = dict(next(iter(left)))

        def new(value: tuple[str, Any], build: Build = build) -> int:
            return sum(frozenset((value, each)) in left for each in build.items())

        for name, choice in zip(dimensions, values, strict=True):
            if name not in build:
                build.update([max((value for value in choice if exists({**build, name: value[1]})), key=new)])
        found.append({name: build[name] for name in dimensions})
        for pair in pairs_of([build]):
            left.pop(pair, None)
    return found


# With AVX-512 apart, so that machines without it leave no pair out.
PAIRS = [
    build
    for machines in (BUILDS["machine"][:-1], BUILDS["machine"][-1:])
    for build in pairwise({**BUILDS, "machine": machines})
]


def options_of(build: Build) -> KernelOptions:
    """How it is printed; what the build does not say, as it pays."""
    kind = build["kind"]
    if kind == "casadi":
        return KernelOptions(engine="casadi")
    shape = {name: build[name] for name in ("groups", "packs", "span") if name in build}
    if isinstance(kind, str):
        return KernelOptions(width=int(kind.removeprefix("alone ")), alone=True, **shape)
    return KernelOptions(width=kind, **shape)


@pytest.fixture(scope="module")
def assert_build(
    shaken: Program, table: NDArray[np.float64], require_tool: Callable[..., str]
) -> Callable[[Build], None]:
    """assert_build(build): it gives the bits of CasADi's C by gcc -O2, one run at a time."""
    settings, keys = replace(SHORT, hold=5), [slot.key for slot in shaken.system.slots]

    @cache
    def expected(sampled: bool) -> Runs:
        options = KernelOptions(engine="casadi", flags=("-O2",))
        return run(shaken, table, options, sampled=sampled, settings=settings)

    @cache
    def printed(spec: KernelSpec) -> KernelSource:
        return print_kernel(shaken, spec)

    def check(build: Build) -> None:
        compiler = toolchain.probe_compiler([require_tool(build["compiler"])])
        assert compiler is not None
        if build["machine"] == "x86-64-v4" and toolchain.native_vector_width(compiler) < 8:
            pytest.skip("this machine has no AVX-512")
        sampled, baked = build["loop"] == "sampled", build["parameters"] == "baked"
        constants = (VARIED, tuple(table[0])) if baked else (None, ())
        spec = KernelSpec(shaken.system.structure, sampled, *constants, replace(options_of(build), flags=()))
        source = printed(spec)
        source = replace(source, flags=(build["level"], f"-march={build['machine']}", *source.flags))
        kernel = Kernel(Shape.of(shaken.system), source, compiler)
        found = kernel.run(table[:, [keys.index(key) for key in kernel.parameters]], settings)
        assert_same(found, expected(sampled))

    return check


def test_pairs_of_builds_leave_none_out() -> None:
    """Every build that there is has no pair that is not tested, and the tested ones are builds that there are."""
    whole = [dict(zip(BUILDS, values, strict=True)) for values in itertools.product(*BUILDS.values())]
    assert pairs_of([build for build in whole if exists(build)]) == pairs_of(PAIRS)
    assert all(exists(build) for build in PAIRS)
    assert len(PAIRS) < 100


@pytest.mark.full
@pytest.mark.parametrize("build", PAIRS, ids=lambda build: " ".join(map(str, build.values())))
def test_builds_that_meet_in_pairs(build: Build, assert_build: Callable[[Build], None]) -> None:
    assert_build(build)


@pytest.mark.product
@pytest.mark.parametrize("loop", BUILDS["loop"])
@pytest.mark.parametrize("machine", BUILDS["machine"])
@pytest.mark.parametrize("level", BUILDS["level"])
@pytest.mark.parametrize("compiler", BUILDS["compiler"])
def test_every_build(compiler: str, level: str, machine: str, loop: str, assert_build: Callable[[Build], None]) -> None:
    """The product with all kinds, groups and parameters; blocks and packs as they pay."""
    code = {"loop": loop, "compiler": compiler, "level": level, "machine": machine}
    for kind, groups, parameters in itertools.product(*(BUILDS[name] for name in ("kind", "groups", "parameters"))):
        build = {**code, "kind": kind, "groups": groups, "parameters": parameters}
        if exists(build) and (kind, groups) != (16, 2):  # a pair as well, and gcc's longest
            assert_build({**build, "span": "evaluation"} if kind == 16 else build)


@pytest.mark.parametrize(
    "options",
    [KernelOptions(width=4, groups=2), KernelOptions(width=2, groups=1, packs=3, flags=("-O1",))],
    ids=["groups", "packs"],
)
def test_neighbours_do_not_matter(options: KernelOptions, shaken: Program, table: NDArray[np.float64]) -> None:
    """A run alone, first in a pack, last in a pack, beside runs that diverge: the same bits."""
    kernel = compile_kernel(shaken, KernelSpec(shaken.system.structure, options=options))
    together = kernel.run(table, SHORT)
    keys = [slot.key for slot in shaken.system.slots]
    wild = table.copy()
    wild[::3, keys.index("plant.m3")] = 1e-9
    wild[::3, keys.index("initial.q.0")] = 1e5
    beside = kernel.run(wild, SHORT)
    assert set(beside.status[::3]) == {2} or set(beside.status[::3]) <= {1, 2}
    for i in (1, 5, 20, 36):
        alone = kernel.run(table[i : i + 1], SHORT)
        assert alone.final_state.tobytes() == together.final_state[i : i + 1].tobytes()
        if i % 3:
            assert beside.final_state[i].tobytes() == together.final_state[i].tobytes()
            assert beside.metrics[i].tobytes() == together.metrics[i].tobytes()


def random_program(program: Program, seed: int) -> Program:
    """The same loop around random functions: every operation the emitter knows, masks used as numbers and as masks."""
    rng = np.random.default_rng(seed)
    unary = [
        ca.sin,
        ca.cos,
        ca.tan,
        ca.exp,
        ca.expm1,
        ca.fabs,
        ca.sign,
        ca.floor,
        ca.ceil,
        ca.tanh,
        ca.atan,
        lambda a: ca.asin(ca.sin(a) / 2),
        lambda a: ca.sinh(ca.sin(a)),
        lambda a: -a,
        lambda a: a**2,
        lambda a: 2 * a,
        lambda a: 1 / (a + 3.5),
        lambda a: ca.sqrt(ca.fabs(a)),
        lambda a: ca.log(ca.fabs(a) + 0.1),
        lambda a: ca.log1p(ca.fabs(a)),
        lambda a: ca.fabs(a) ** 1.5,
        lambda a: (a**2 + 0.01) ** (-1 / 3),
    ]
    binary = [
        lambda a, b: a + b,
        lambda a, b: a - b,
        lambda a, b: a * b,
        lambda a, b: a / (b**2 + 1),
        ca.fmin,
        ca.fmax,
        lambda a, b: ca.fabs(a) ** ca.sin(b),
        lambda a, b: ca.if_else(a < b, a, b),
        lambda a, b: (a <= b) * a,
        lambda a, b: ca.if_else(ca.logic_and(a < 1, ca.logic_not(b == a)), 2 * b, a),
        ca.copysign,
        ca.hypot,
        ca.atan2,
        lambda a, b: ca.logic_or(a != b, b < 0) + a,
    ]
    functions = dict(program.functions)
    for name in ("run", "time", "error", "control", "plant"):
        old = functions[name]
        inputs = old.sx_in()
        pool = [e for vector in inputs for e in ca.vertsplit(vector)] if inputs else []
        outputs = []
        with as_written():
            for k in range(old.n_out()):
                row = []
                for _ in range(old.numel_out(k)):
                    for _ in range(3):
                        a, b = (pool[i] for i in rng.integers(len(pool), size=2))
                        pool.append(unary[rng.integers(len(unary))](a))
                        pool.append(binary[rng.integers(len(binary))](pool[-1], b))
                    row.append(ca.sin(pool[-1]) if name == "plant" else ca.cos(pool[-1]))
                outputs.append(ca.vertcat(*row))
            names = [[old.name_in(i) for i in range(old.n_in())], [old.name_out(i) for i in range(old.n_out())]]
            functions[name] = ca.Function(old.name(), inputs, ca.cse(outputs), *names)
    return Program(program.system, functions)


@pytest.mark.parametrize("seed", range(6))
def test_random_functions_equal_casadi(seed: int, shaken: Program, table: NDArray[np.float64]) -> None:
    random = random_program(shaken, seed)
    settings = LoopSettings(steps=12, step=1e-2, output_every=3)
    expected = run(random, table[:9], KernelOptions(engine="casadi", flags=("-O0",)), settings=settings)
    assert np.isfinite(expected.final_state).all()
    for width, level, tunable in ((4, "-O0", None), (2, "-O1", VARIED)):
        options = KernelOptions(width=width, groups=2, flags=(level,))
        assert_same(run(random, table[:9], options, tunable=tunable, settings=settings), expected)
    options = KernelOptions(width=2 + seed % 2 * 2, alone=True, paired=True, flags=("-O0",))
    assert_same(run(random, table[:9], options, settings=settings), expected)


def test_an_operation_without_c_is_refused_by_name(shaken: Program) -> None:
    old = shaken.functions["plant"]
    inputs = old.sx_in()
    bad = ca.Function("loop_plant", inputs, [ca.erf(inputs[2])])
    with pytest.raises(ValueError, match=r"OP_ERF.*plant"):
        lanes.emit(Program(shaken.system, {**shaken.functions, "plant": bad}), {})


RARE: dict[str, dict[str, float]] = {
    "angle beyond the fast reduction": {"initial.q.1": 3e5},
    "signals with angles beyond the fast reduction": {
        "reference.lift.terms.0.omega": 3e9, "base_motion.heave.0.omega": 4e9,
    },
    "exponents other than their defaults": {"control.alpha": 0.6, "control.nu": 4.0},
    "literal law that starts on the reference": {
        "control.delta": 0.0, "initial.q.0": 0.0, "initial.q.1": 1.0,
        "initial.dq.0": np.pi, "initial.dq.1": 0.5 * np.pi,
    },
    "no limit": {"control.a_max.0": np.inf, "control.a_max.1": np.inf},
    "tiny state": {"initial.q.0": 5e-324, "reference.lift.terms.0.amplitude": 1e-310},
}  # fmt: skip


@pytest.mark.parametrize("case", RARE)
def test_rare_cases_leave_the_fast_path_with_the_same_bits(case: str, shaken: Program, values_of: Values) -> None:
    """Lanes that need a complete function stand beside lanes that do not."""
    table = np.stack([values_of(shaken), values_of(shaken, RARE[case]), values_of(shaken)])
    expected = run(shaken, table, KernelOptions(engine="casadi", flags=("-O2",)))
    for options in (
        KernelOptions(width=4, groups=1, flags=("-O2",)),
        KernelOptions(width=1, groups=2, flags=("-O2",)),
        KernelOptions(width=4, alone=True, paired=True, flags=("-O2",)),
    ):
        assert_same(run(shaken, table, options), expected)


def test_the_kernel_is_written_for_a_reader(shaken: Program, values_of: Values) -> None:
    """Names of the model, sections, operation counts, and what each staged value is."""
    keys = [slot.key for slot in shaken.system.slots]
    baked = dict(zip(keys, values_of(shaken), strict=True))
    del baked["control.delta"]
    emission = lanes.emit(shaken, baked)
    for text in (
        "once per run",
        "once per time",
        "at every evaluation",
        "operations a run",
        "sin_q1_rotation",
        "const sl_v control_delta = p[0][g]",
        "/* sq(control_delta) */",
        "slv_sincos(q1_rotation, &sin_q1_rotation, &cos_q1_rotation);",
        "const sl_v de_lift = dq1d_lift - dq1_lift;",
        "const sl_v u_e_rotation = ",
        "const sl_v z_lift = slv_set(2000000.0) * a",
    ):
        assert text in emission.text, text
    assert emission.tunable == ("control.delta",)
    assert emission.sizes["p"] == 1
    assert emission.sizes["varying"] == 0, "nothing that depends on time varies from run to run"
    assert emission.counts["closed"] < 200
    assert emission.text == lanes.emit(shaken, baked).text


@pytest.mark.parametrize("parameters", ["tunable", "baked"])
def test_names_of_parts_change_nothing_but_names(
    shaken: Program, values_of: Values, parameters: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    keys = [slot.key for slot in shaken.system.slots]
    baked = dict(zip(keys, values_of(shaken), strict=True)) if parameters == "baked" else {}
    named = lanes.emit(shaken, baked)
    monkeypatch.setattr(LoopGraph, "_labelled", lambda *_: [])
    numbered = lanes.emit(shaken, baked)

    def statements(text: str) -> str:
        """Without comments, every identifier by when it came first in its function."""
        functions = re.split(r"^}$", re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL), flags=re.MULTILINE)
        found = []
        for function in functions:
            order: dict[str, str] = {}
            found.append(re.sub(r"\b[A-Za-z_]\w*", lambda word: order.setdefault(word[0], f"i{len(order)}"), function))  # noqa: B023
        return "}".join(found)

    assert statements(named.text) == statements(numbered.text)
    assert named.text.count("dsurface_lift") > 2 and "dsurface" not in numbered.text
    assert (named.sizes, named.counts) == (numbered.sizes, numbered.counts)


def test_a_part_gives_way_where_another_is_called_so(shaken: Program, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the parts are called, the kernel compiles: who comes later, or against C, has a number."""
    words = itertools.cycle(["ok", "x", "a7", "r0", "now", "double", "e_lift", "sin_q1_rotation", "slv_exp", "mine"])
    monkeypatch.setattr(Term, "labels", lambda term, _: list(itertools.islice(words, term.value.numel())))
    options = KernelOptions(width=2, groups=2, flags=("-O0",))
    source = print_kernel(shaken, KernelSpec(shaken.system.structure, options=options))
    assert "const sl_v mine_0 = " in dict(source.files)["kernel.h"]
    toolchain.build_library(dict(source.files), main="loop.c", flags=source.flags)


def test_signals_of_its_own_make_a_run_compute_them(shaken: Program, values_of: Values) -> None:
    """Only what the varied amplitude reaches is computed per run; the reference stays shared."""
    keys = [slot.key for slot in shaken.system.slots]
    baked = dict(zip(keys, values_of(shaken), strict=True))
    del baked["base_motion.heave.0.amplitude"]
    sizes = lanes.emit(shaken, baked).sizes
    assert sizes["uniform"] > 5
    assert 0 < sizes["varying"] < 8


def test_constants_keep_the_signs_of_their_zeros(shaken: Program, values_of: Values) -> None:
    """What is folded when the lanes are printed, what C computes, and what CasADi prints: the same zeros.

    fmin(a, b) is a < b ? a : b, and fmax likewise; a sign becomes a rate of -1 or 1.
    """
    keys = [slot.key for slot in shaken.system.slots]
    minus, plus = keys.index("initial.dq.0"), keys.index("initial.dq.1")
    old = shaken.functions["plant"]
    inputs = old.sx_in()
    p = inputs[4]
    zeros = [
        (ca.sign(p[minus]), -1.0),
        (ca.sign(p[plus]), 1.0),
        (ca.fmin(p[plus], p[minus]), -1.0),
        (ca.fmin(p[minus], p[plus]), 1.0),
        (ca.fmax(p[plus], p[minus]), -1.0),
        (ca.fmax(p[minus], p[plus]), 1.0),
        (-p[plus], -1.0),
        (p[minus] + p[minus], -1.0),
    ]
    with as_written():
        slope = ca.vertcat(*(ca.copysign(ca.SX(1.0), zero) for zero, _ in zeros))
        plant = ca.Function(old.name(), inputs, [slope], [old.name_in(i) for i in range(old.n_in())], ["dx"])
    signs = Program(shaken.system, {**shaken.functions, "plant": plant})
    table = values_of(shaken, {"initial.dq.0": -0.0, "initial.dq.1": 0.0, "initial.q.0": 0.0, "initial.q.1": 0.0})[None]
    one_step = LoopSettings(steps=1, step=1.0)
    for options, tunable in (
        (KernelOptions(engine="casadi", flags=("-O1",)), None),
        (KernelOptions(width=2, flags=("-O1",)), None),
        (KernelOptions(width=1, flags=("-O1",)), ()),
        (KernelOptions(width=2, flags=("-O1",)), ()),
        (KernelOptions(width=2, flags=("-O1",)), ("initial.dq.1",)),
    ):
        state = run(signs, table, options, tunable=tunable, settings=one_step).final_state[0]
        assert np.round(state).tolist() == [sign for _, sign in zeros], (options, tunable)
