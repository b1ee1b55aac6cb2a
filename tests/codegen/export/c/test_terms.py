"""Exported C reads as the law does: sections, the model's names, parameters by theirs; nothing else is computed."""

import itertools
import re
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from arms import structure_of, values_of
from chains import chain, numbers_for
from printed import with_whole_comments

from springline.codegen.elementary import math_header
from springline.codegen.export import bind
from springline.codegen.export.c import generate_files
from springline.codegen.export.c.interface import TypedInterface
from springline.codegen.export.c.model import model_files
from springline.codegen.kernel import toolchain
from springline.model import Law, Parameter, Structure, System
from springline.model.control import LAWS
from springline.model.mechanisms import MECHANISMS
from springline.model.parameters import Values
from springline.model.structure import SignalShape
from springline.model.terms import Term, named, noted, of_joint, section
from springline.runner.scenario import load_scenario

SECTIONS = [
    "tracking error and sliding variable, (22), E3",
    "reaching law: variable power log, (18), (19), E8, limit E4",
    "slow control: computed torque, (14), (25)",
    "fast control, (33)",
    "command, limited per motor, (13), E4",
    "springs, (1)",
    "motors, (1)",
    "mass matrix of the arm, (1)",
    "Coriolis, centrifugal and gravity forces less what the moving base adds, (1)",
    "accelerations of the joints, (1)",
]


@cache
def source(scenario: str = "paper/nominal", **changes: object) -> str:
    loaded = load_scenario(scenario, {key.replace("__", "."): value for key, value in changes.items()})
    files, _ = generate_files(bind(loaded.structure(), loaded.values()))
    return files["src/springline.c"].decode()


def constants(text: str) -> Iterator[tuple[str, float, str]]:
    """Name, value and comment of each constant."""
    found = re.findall(r"^  const double (\w+) = (\S+); +/\* (.*) \*/$", with_whole_comments(text), re.MULTILINE)
    for name, value, comment in found:
        yield name, float(value), comment


def test_the_parts_stand_in_order_under_the_numbers_of_the_equations() -> None:
    found = re.findall(r"^  /\* (.*) \*/$", source(), re.MULTILINE)
    assert [text for text in found if not text.startswith("stage") and not text.endswith(".")] == SECTIONS


@pytest.mark.parametrize(
    ("name", "statement"),
    [
        ("e", "q1d_{j} - q1_{j}"),
        ("de", "dq1d_{j} - dq1_{j}"),
        ("exponent", r"a\d+ \* a\d+"),
        ("f", r"sl_exp\(a\d+\)"),
        ("L_terms", r"L_near_{j} \* a\d+"),
        ("a", r"a\d+ \* a\d+"),
        ("u_e", "a_{j} - dsurface_{j}"),
        ("ddq", "ddq1d_{j} - u_e_{j}"),
        ("u_f", r"control_K_f_{j} \* a\d+"),
        ("u", r"u_s_{j} \+ u_f_{j}"),
    ],
)
@pytest.mark.parametrize("joint", ["lift", "rotation"])
def test_values_are_called_as_in_the_model(name: str, statement: str, joint: str) -> None:
    wanted = rf"^  const double {name}_{joint} = {statement.replace('{j}', joint)};$"
    assert re.search(wanted, source(), re.MULTILINE), wanted


def test_baked_parameters_are_called_by_their_names_and_have_their_values() -> None:
    scenario = load_scenario("paper/nominal")
    values = {slot.symbol: value for slot, value in zip(scenario.system().slots, scenario.values(), strict=True)}
    found = [item for item in constants(source()) if ";" in item[2]]
    assert {"control_k2", "control_lambda", "control_a_max_rotation", "plant_k_s2"} <= {name for name, _, _ in found}
    for name, value, _ in found:
        assert value == values[name]


def test_a_body_tells_the_names_of_its_constants() -> None:
    loaded = load_scenario("paper/nominal")
    body = TypedInterface(bind(loaded.structure(), loaded.values())).bodies["control"]
    assert {"control_a_max_lift", "control_a_max_rotation", "H_lift_lift", "c0"} <= body.constants
    assert body.constants == {line.split()[2] for line in body.lines if re.match(r"const \w+ \w+ = .*/\*", line)}


def test_flags_of_limits_name_the_limit() -> None:
    for joint in ("lift", "rotation"):
        limit, law = f"control_a_max_{joint}", f"dsigma_{joint}"
        assert f"({law} < -{limit}) || ({law} > {limit});" in " ".join(source().split())


def test_what_comes_from_several_says_how_to_the_last_bit() -> None:
    scenario = load_scenario("paper/nominal")
    values = {slot.symbol: value for slot, value in zip(scenario.system().slots, scenario.values(), strict=True)}
    found = [item for item in constants(source()) if ";" not in item[2]]
    assert len(found) > 10
    assert ("M1_lift_lift", 50.0, "plant_m3 + plant_m2") in found
    for _, value, formula in found:
        python = re.sub(r"(?<=[\w)]) (?=[\w(])", " * ", formula).replace("^", "**")
        assert eval(python, {}, values) == value, formula  # noqa: S307 - our own text


def test_what_is_too_long_for_a_formula_names_the_parameters_it_comes_from(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two links in space, whose frames are parameters: a constant says in a few lines what changes it."""
    arm = chain("rr")
    monkeypatch.setitem(MECHANISMS, "frames", arm)
    structure = structure_of("frames", reference=SignalShape("sine", (0, 0)))
    numbers = numbers_for(2, np.random.default_rng(3))
    others = {f"{table}.{name}": value for name, value in numbers.items() for table in ("plant", "mechanism")}

    def exported(values: dict[str, float]) -> dict[str, tuple[float, str]]:
        text = generate_files(bind(structure, values_of(structure, values)))[0]["src/springline.c"].decode()
        bodies = text.split("\nstatic ")
        return {f"{k} {name}": (value, told) for k, body in enumerate(bodies) for name, value, told in constants(body)}

    found = exported(others)
    assert max(len(told) for _, told in found.values()) <= 150
    changed = exported(others | {"plant.u1x": others["plant.u1x"] * 1.5})
    assert found.keys() == changed.keys()
    moved = {name for name in found if found[name][0] != changed[name][0]}
    named = {name for name, (_, told) in found.items() if "plant_u1x" in told or name.endswith(" plant_u1x")}
    several = {name for name, (_, told) in found.items() if re.match(r"from .* and \d+ more$", told)}
    told = [told for _, told in found.values() if told.startswith("from plant_") and " more" not in told]
    assert told and len(several) > 5
    assert len(moved) > 5 and named <= moved <= named | several


@pytest.mark.parametrize("tunable", [(), "all"])
@pytest.mark.parametrize("real", ["double", "float"])
@pytest.mark.parametrize("prefix", ["springline", "manipulator_on_a_ship_number_7"])
def test_no_line_of_the_models_functions_is_too_long(prefix: str, real: Any, tunable: Any) -> None:
    """And what follows a comment's first line stands below its first word."""
    loaded = load_scenario("paper/nominal", {"control.mu": 12.25})
    export = bind(loaded.structure(), loaded.values(), prefix=prefix, real=real, tunable=tunable)
    for path, content in model_files(export).items():
        lines = content.decode().splitlines()
        assert [line for line in lines if len(line) > 100] == [], path
        for first, second in itertools.pairwise(lines):
            if re.match(r"  const \w+ \w+ = .*; +/\*(?!.*\*/)", first):
                assert second.index(second.split()[0]) == first.index("/*") + 3, second


def test_no_line_of_the_mathematics_is_too_long() -> None:
    folder = resources.files("springline.codegen") / "runtime"
    headers = {path.name: path.read_text() for path in folder.iterdir() if path.name.startswith("sl_")}
    assert len(headers) >= 4
    for name, text in {**headers, "sl_math.h": math_header()}.items():
        assert [line for line in text.splitlines() if len(line) > 100] == [], name


@pytest.mark.parametrize("drive", ["elastic", "rigid"])
def test_names_change_nothing_but_the_order_of_sums(monkeypatch: pytest.MonkeyPatch, drive: str) -> None:
    """What has a name is computed as such; without one, sums and products are put together across it."""
    structure = Structure(drive=drive)  # type: ignore[arg-type] # parametrized
    system = System(structure)
    with_names, values = system.functions, [slot.default for slot in system.slots]

    @contextmanager
    def deaf() -> Iterator[list[Term]]:
        yield []

    monkeypatch.setattr("springline.model.system.noted", deaf)
    without = System(structure).functions
    terms = {f"{prefix}{name}_terms" for prefix in ("", "loop_") for name in ("control", "plant")}
    assert {name for name in with_names if name not in without} == terms
    rng = np.random.default_rng(5)
    for name, function in without.items():
        inputs = [rng.normal(size=function.size1_in(i)) for i in range(function.n_in() - 1)]
        pairs = zip(function.call([*inputs, values]), with_names[name].call([*inputs, values]), strict=True)
        for here, there in pairs:
            np.testing.assert_allclose(np.array(here), np.array(there), rtol=1e-12, atol=1e-12 * scale(there))


def scale(value: ca.DM) -> float:
    return float(np.abs(np.array(value)).max(initial=0.0))


def test_no_limit_is_no_operation_and_no_flag() -> None:
    text = source(control__a_max=float("inf"))
    assert "SL_INF" not in text
    assert text.count("diagnostics->a_limited_lift = 0;") == 1
    assert "control_a_max" not in text


def test_an_own_law_is_named_as_its_class_says(monkeypatch: pytest.MonkeyPatch) -> None:
    class Soft(Law):
        title = "soft sign"
        equations = "(7) of somebody"
        parameters = (Parameter("width", "SI", 0.5, "of the soft middle"),)

        def rate(self, sigma: ca.SX, p: Values) -> ca.SX:
            root = named("root", ca.sqrt(sigma**2 + p.width**2))
            return -30 * sigma / root

    monkeypatch.setitem(LAWS, "soft", Soft())
    files, _ = generate_files(bind(*of_law("soft")))
    text = files["src/springline.c"].decode()
    assert "/* reaching law: soft sign, (7) of somebody, limit E4 */" in text
    assert re.search(r"const double root_rotation = sl_sqrt\(a\d+\);", text)


@pytest.mark.parametrize(
    "name", ["c1", "a5", "r0", "command", "x", "double", "class", "sin_q1", "sl_exp", "derived", "u"]
)
def test_a_name_that_is_another_s_gives_way(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, name: str) -> None:
    """As a scalar of the arm, and as one of each joint: the C compiles, and the value has a number."""

    class Colliding(Law):
        def rate(self, sigma: ca.SX, p: Values) -> ca.SX:
            return -30 * named(name, ca.tanh(sigma) / (1 + sigma**2))

    monkeypatch.setitem(LAWS, "colliding", Colliding())
    monkeypatch.setattr(Term, "labels", lambda term, joints: [term.name] * term.value.numel())
    files, _ = generate_files(bind(*of_law("colliding")))
    for path, content in files.items():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_bytes(content)
    flags = ["-std=c99", "-Werror", "-fsyntax-only", f"-I{tmp_path / 'include'}", f"-I{tmp_path / 'src'}"]
    command = [*toolchain.find_compiler().argv, *flags, str(tmp_path / "src/springline.c")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    told = re.findall(rf"const double {name} = (.*);", files["src/springline.c"].decode())
    assert not any("tanh" in text for text in told)


def of_law(law: str) -> tuple[Structure, list[float]]:
    """A structure with a law, and numbers for it."""
    structure = Structure(law=law)
    return structure, [slot.default or 1.0 for slot in System(structure).slots]


def test_a_name_has_to_be_one_in_c() -> None:
    x = ca.SX.sym("x")
    assert named("no name", x) is x, "nobody listens"
    with noted(), pytest.raises(ValueError, match="'no name'"):
        named("no name", x)


def test_what_is_noted() -> None:
    x = ca.SX.sym("x", 2)
    with noted() as terms, section("part", "(1)"):
        named("x", x)
        with of_joint(1):
            named("half", x[1] / 2)
        named("outer", x @ x.T)
    labels = [label for term in terms for label in term.labels(("a", "b"))]
    assert labels == ["x_a", "x_b", "half_b", "outer_a_a", "outer_b_a", "outer_a_b", "outer_b_b"]
    assert {term.section for term in terms} == {("part", "(1)")}
    assert named("x", x) is x


@pytest.mark.parametrize("prefix", ["springline", "p", "transfer_arm_controller"])
def test_what_goes_over_several_lines_is_aligned_for_every_prefix(prefix: str) -> None:
    loaded = load_scenario("paper/nominal")
    files, _ = generate_files(bind(loaded.structure(), loaded.values(), prefix=prefix))
    for name in (f"include/{prefix}.h", f"src/{prefix}.c", "main.c", "self_check.c"):
        text = files[name].decode()
        assert f"{prefix}_" in text
        assert not re.findall(r"^ {10,}(?:const |\w+ \*)\w.*$", text, re.MULTILINE), name


def test_a_law_that_cites_nothing_leaves_no_gap(monkeypatch: pytest.MonkeyPatch) -> None:
    class Plain(Law):
        def rate(self, sigma: ca.SX, p: Values) -> ca.SX:
            return -p.k1 * sigma

    monkeypatch.setitem(LAWS, "plain", Plain())
    structure = Structure(law="plain")
    values = np.array([slot.default for slot in System(structure).slots])
    text = generate_files(bind(structure, values))[0]["src/springline.c"].decode()
    assert "/* reaching law: plain, limit E4 */" in text
