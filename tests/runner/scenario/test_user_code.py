"""Mechanisms, laws and controllers of a user's own file: used wherever the packaged ones are, and never unasked."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet
from typer.testing import CliRunner

from springline.codegen.kernel import toolchain
from springline.runner.cli import app
from springline.runner.files import InputError
from springline.runner.run import simulate
from springline.runner.scenario import load_scenario, without_code
from springline.runner.sweep import batch

LAW = """
import casadi as ca
from helper import smooth
from springline.model import Law, Parameter

class Smooth(Law):
    parameters = (Parameter("gain", "1/s", 30.0, "slope"),)

    def rate(self, sigma, p):
        return -p.gain * smooth(sigma) - p.k1 * sigma
"""
HELPER = "import casadi as ca\n\ndef smooth(s):\n    return s / ca.sqrt(1 + s**2)\n"
ARM = """
import casadi as ca
from springline.model import Joint, Mechanism, Parameter

class Boom(Mechanism):
    joints = (Joint("luff", "rad", "N m"), Joint("telescope", "m", "N"), Joint("hook", "m", "N"))
    parameters = (
        Parameter("m1", "kg", 120.0, "mass of the boom"), Parameter("m2", "kg", 60.0, "mass of the load"),
        Parameter("L", "m", 2.0, "length"), Parameter("g", "m/s^2", 9.81, "gravity"),
    )
    motor_inertia = (Parameter("motor", "{F} s^2/{q}", 4.0, "inertia of a motor", per_joint=True),)
    stiffness = (Parameter("spring", "{F}/{q}", 2.0e5, "stiffness of a spring", per_joint=True),)
    start_position = (0.3, 0.2, 0.1)

    def places(self, q, p):
        along = ca.vertcat(ca.cos(q[0]), ca.sin(q[0]), 0)
        tip = (p.L + q[1]) * along
        return [(p.m1, p.L / 2 * along), (p.m2, tip), (p.m2, tip - ca.vertcat(0, q[2], 0))]

    def kinetic_energy(self, q, dq, omega, p):
        rates = [(m, ca.jtimes(r, q, dq) + ca.cross(omega, r)) for m, r in self.places(q, p)]
        return sum(m * ca.dot(v, v) / 2 for m, v in rates)

    def potential_energy(self, q, gravity, p):
        return sum(m * ca.dot(gravity, r) for m, r in self.places(q, p))
"""
CONTROLLER = """
from springline.model import Control, Controller, Parameter

class Servo(Controller):
    parameters = (Parameter("bandwidth", "1/s", 20.0, "of the error", per_joint=True),)

    def control(self, r, y, z, model, p):
        w, e, arm = p.bandwidth, r.q - y.q1, model(y.q1, y.dq1)
        return Control(arm.H @ (r.ddq + 2 * w * (r.dq - y.dq1) + w**2 * e) + arm.c + arm.G, e)
"""
RUN = "\n[simulation]\nduration = 0.05\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A user's folder: law.py with helper.py beside it, arm.py, servo.py, and scenarios."""
    place = tmp_path / "user"
    place.mkdir()
    texts = {
        "law.py": LAW, "helper.py": HELPER, "arm.py": ARM, "servo.py": CONTROLLER,
        "law.toml": f'[control]\nlaw = "law.py:Smooth"\nsmooth = {{ gain = 25.0 }}\n{RUN}',
        "arm.toml": f'[mechanism]\nname = "arm.py:Boom"\nm2 = 70.0\n{RUN}',
        "servo.toml": f'[control]\ncontroller = "servo.py:Servo"\nservo.bandwidth = [15.0, 25.0]\n{RUN}',
        "all.toml": '[mechanism]\nname = "arm.py:Boom"\n[control]\nlaw = "law.py:Smooth"\nmode = "sampled"\n'
                    f"period = 1e-3\n{RUN}",
        "sweep.toml": 'scenario = "law.toml"\nmethod = "random"\nsamples = 8\nseed = 1\nchunk = 4\n[vary]\n'
                      'control.smooth.gain = { uniform = [10.0, 40.0] }\n[keep]\ntrajectories = 4\n',
    }  # fmt: skip
    for name, text in texts.items():
        (place / name).write_text(text)
    return place


def springline(*arguments: object) -> tuple[int, str]:
    result = CliRunner().invoke(app, [str(item) for item in arguments], catch_exceptions=False)
    return result.exit_code, result.output


# What they are good for


def test_a_law_of_a_users_file_is_the_law_of_the_run(folder: Path) -> None:
    scenario = load_scenario(folder / "law.toml")
    assert scenario.values()[[slot.key for slot in scenario.system().slots].index("control.smooth.gain")] == 25.0
    sigma = 0.3
    rate = scenario.system().function("law_smooth")(sigma, scenario.values())
    assert float(rate) == pytest.approx(-25.0 * sigma / np.sqrt(1 + sigma**2) - 3.0 * sigma, rel=1e-15)
    lanes, casadi = (simulate(scenario, engine=engine) for engine in ("lanes", "casadi"))  # type: ignore[arg-type]
    assert lanes.status == "ok"
    assert lanes.trajectory.equals(casadi.trajectory)
    assert not lanes.trajectory.equals(
        simulate(load_scenario(folder / "law.toml", {"control.law": "power"})).trajectory
    )


def test_a_mechanism_of_a_users_file_brings_its_joints_and_defaults(folder: Path) -> None:
    scenario = load_scenario(folder / "arm.toml")
    result = simulate(scenario)
    assert result.status == "ok"
    assert {"q1_luff", "q2_telescope", "U_hook"} <= set(result.trajectory.column_names)
    assert scenario.value_of("plant.m2") == 70.0
    assert scenario.document["initial"]["q"] == [0.3, 0.2, 0.1]


def test_a_controller_of_a_users_file_has_a_table_of_its_own(folder: Path) -> None:
    scenario = load_scenario(folder / "servo.toml")
    assert scenario.document["control"]["servo"] == {"bandwidth": [15.0, 25.0]}
    assert "sigma_lift" not in simulate(scenario).trajectory.column_names
    changed = scenario.with_overrides({"control.controller": "terminal_sliding"})
    assert "servo" not in changed.document["control"], "what it excludes goes"


def test_batch_varies_what_an_own_law_declares(folder: Path) -> None:
    scenario = load_scenario(folder / "law.toml")
    gains = np.array([10.0, 25.0, 40.0])
    table = batch(scenario, {"control.smooth.gain": gains})
    alone = simulate(scenario).metrics
    for name in alone.column_names:
        assert table[name][1] == alone[name][0]


@pytest.mark.parametrize("scenario", ["law.toml", "arm.toml", "servo.toml", "all.toml"])
def test_exported_c_checks_itself(folder: Path, scenario: str, tmp_path: Path) -> None:
    code, told = springline("export", "c", folder / scenario, "-o", tmp_path / "c")
    assert code == 0, told
    sources = [str(tmp_path / "c" / name) for name in ("src/springline.c", "src/springline_model.c", "self_check.c")]
    command = [
        *toolchain.find_compiler().argv,
        "-std=c99",
        "-O0",
        f"-I{tmp_path / 'c/include'}",
        f"-I{tmp_path / 'c/src'}",
    ]
    subprocess.run([*command, *sources, "-o", str(tmp_path / "check")], check=True)
    checking = [tmp_path / "check", tmp_path / "c/test_vectors.txt"]
    checked = subprocess.run(checking, capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stdout
    for file in (tmp_path / "c").rglob("*.*"):
        assert str(folder).encode() not in file.read_bytes(), f"{file.name} holds a path"


def test_fmus_hold_them_too(folder: Path, tmp_path: Path) -> None:
    for kind in ("fmu2", "fmu3"):
        code, told = springline("export", kind, folder / "all.toml", "-o", tmp_path / kind)
        assert code == 0, told


# Where they lie


def test_paths_count_from_the_file_and_in_overrides_from_here(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder.parent)
    scenario = load_scenario("user/law.toml")
    assert load_scenario("paper/nominal", {"control.law": "user/law.py:Smooth"}).code == scenario.code
    with pytest.raises(InputError, match=r"there is no file .*law\.py"):
        load_scenario("paper/nominal", {"control.law": "law.py:Smooth"})
    text = scenario.to_toml(folder.parent / "results")
    assert 'law = "../user/law.py:Smooth"' in text
    (folder.parent / "results").mkdir()
    (folder.parent / "results/scenario.toml").write_text(text)
    assert load_scenario("results/scenario.toml") == scenario


def test_equal_files_in_two_folders_are_one_law_and_other_content_is_another(folder: Path, tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.mkdir()
    for name in ("law.py", "helper.py", "law.toml"):
        (other / name).write_bytes((folder / name).read_bytes())
    first, second = load_scenario(folder / "law.toml"), load_scenario(other / "law.toml")
    assert first == second
    assert first.structure() == second.structure()
    (other / "helper.py").write_text(HELPER.replace("1 +", "2 +"))
    third = load_scenario(other / "law.toml")
    assert third != first
    assert third.structure() != first.structure()
    results = [simulate(scenario).trajectory for scenario in (first, third)]
    assert not results[0].equals(results[1]), "each has the helper beside it"


def test_what_is_imported_is_private_and_comes_before_what_is_installed(folder: Path) -> None:
    (folder / "helper.py").write_text(HELPER.replace("import casadi as ca", "import casadi as ca\nimport typer"))
    (folder / "typer.py").write_text("raise RuntimeError('the one beside the file')")
    with pytest.raises(InputError, match=r"the one beside the file \(law\.py, line 3.*typer\.py, line 1"):
        load_scenario(folder / "law.toml")
    assert "helper" not in sys.modules
    assert Path(sys.modules["typer"].__file__ or "").parent != folder


@pytest.mark.parametrize(
    ("statement", "files"),
    [
        ("from tools.shapes import smooth", {"tools/__init__.py": "", "tools/shapes.py": HELPER}),
        ("import tools.shapes\nsmooth = tools.shapes.smooth", {"tools/shapes.py": HELPER}),
        ("from tools import smooth", {"tools/__init__.py": "from .shapes import smooth", "tools/shapes.py": HELPER}),
        ("from . import shapes\nsmooth = shapes.smooth", {"shapes.py": HELPER}),
        ("from .shapes import smooth", {"shapes.py": HELPER}),
    ],
)
def test_packages_beside_the_file(folder: Path, statement: str, files: dict[str, str]) -> None:
    (folder / "law.py").write_text(LAW.replace("from helper import smooth", statement))
    for name, text in files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)
    scenario = load_scenario(folder / "law.toml")
    assert {name for name, _ in scenario.code[0].files} == {"", *files}


def test_an_import_inside_a_method_is_found_and_counted(folder: Path) -> None:
    late = LAW.replace("from helper import smooth\n", "").replace(
        "        return", "        from helper import smooth\n        return"
    )
    (folder / "law.py").write_text(late)
    assert [name for name, _ in load_scenario(folder / "law.toml").code[0].files] == ["", "helper.py"]


# Only when asked for


def test_a_stranger_s_scenario_can_be_refused(folder: Path) -> None:
    (folder / "law.py").write_text("raise RuntimeError('has run')")
    with without_code(), pytest.raises(InputError, match="names a file to run, and --no-code refuses that"):
        load_scenario(folder / "law.toml")
    with pytest.raises(InputError, match="has run"):
        load_scenario(folder / "law.toml")
    for command in (
        ["run", folder / "law.toml"], ["generate", folder / "law.toml"], ["export", "fmu2", folder / "law.toml"],
        ["batch", folder / "sweep.toml"], ["export", "c", folder / "law.toml"],
        ["reproduce", "--set", f"control.law={folder / 'law.py'}:Smooth"],
    ):  # fmt: skip
        code, told = springline(*command, "--no-code", "-o", folder / "out")
        assert (code, "refuses that" in told) == (2, True), told
        assert not (folder / "out").exists()
        with pytest.raises(InputError, match="has run"):  # a command refuses for itself alone
            load_scenario(folder / "law.toml")


@pytest.fixture
def dataset(folder: Path) -> Path:
    code, told = springline("batch", folder / "sweep.toml", "-o", folder / "data", "--no-plot", "--jobs", "1")
    assert code == 0, told
    return folder / "data"


def test_a_dataset_names_its_code_and_a_replay_is_given_it(folder: Path, dataset: Path) -> None:
    described = json.loads((dataset / "sweep.json").read_text())
    assert list(described["code"]) == ["law.py:Smooth"]
    assert str(folder) not in (dataset / "sweep.json").read_text()
    digest = described["code"]["law.py:Smooth"]["sha256"]
    code, told = springline("replay", dataset, 4, "-o", folder / "again")
    assert (code, not (folder / "again").exists()) == (2, True)
    assert f"its runs need law.py with the SHA-256 {digest}: give it with --code FILE" in told
    code, told = springline("replay", dataset, 4, "-o", folder / "again", "--code", folder / "law.py", "--no-plot")
    assert code == 0, told
    assert "bit for bit" in told
    kept = parquet.read_table(dataset / "trajectories/run-000000004.parquet").replace_schema_metadata(None)
    again = parquet.read_table(folder / "again/trajectory.parquet").replace_schema_metadata(None)
    assert kept.equals(again)
    assert load_scenario(folder / "again/scenario.toml").code[0].hash == digest


def test_other_code_neither_replays_nor_resumes(folder: Path, dataset: Path) -> None:
    (dataset / "part-000001.parquet").unlink()
    (folder / "helper.py").write_text(HELPER + "# changed\n")
    code, told = springline("replay", dataset, 0, "-o", folder / "again", "--code", folder / "law.py")
    assert (code, "and the one given has" in told) == (2, True)
    code, told = springline("batch", folder / "sweep.toml", "-o", dataset, "--resume", "--no-plot")
    assert code == 2
    assert "code.law.py:Smooth.sha256" in told
    (folder / "helper.py").write_text(HELPER)
    code, told = springline("batch", folder / "sweep.toml", "-o", dataset, "--resume", "--no-plot")
    assert code == 0, told
    code, told = springline(
        "replay", dataset, 0, "-o", folder / "x", "--code", folder / "law.py", "--code", folder / "arm.py"
    )
    assert (code, "needs no such file" in told) == (2, True)


@pytest.mark.parametrize("place", ["scenario", "vary"])
def test_a_dataset_cannot_make_anyone_run_a_file(folder: Path, dataset: Path, place: str, tmp_path: Path) -> None:
    evil, ran = tmp_path / "evil.py", tmp_path / "ran"
    evil.write_text(f"open({str(ran)!r}, 'w').close()\n")
    described = json.loads((dataset / "sweep.json").read_text())
    if place == "scenario":
        described["scenario"] = described["scenario"].replace("law.py:Smooth", f"{evil}:Smooth")
    else:
        described["sweep"]["vary"].append({"key": "control.law", "axis": f'{{ each = ["{evil}:Smooth"] }}'})
    (dataset / "sweep.json").write_text(json.dumps(described))
    for given in ([], ["--code", folder / "law.py"]):
        code, _ = springline("replay", dataset, 0, "-o", folder / "again", *given)
        assert code == 2
    assert not ran.exists()


def test_a_law_that_varies_is_found_again(folder: Path) -> None:
    (folder / "sweep.toml").write_text(
        'scenario = "law.toml"\nmethod = "grid"\n[vary]\n'
        'control.law = { values = ["law.py:Smooth", "power"] }\ncontrol.k1 = { values = [2.0, 3.0] }\n'
    )
    data = folder / "data"
    code, told = springline("batch", folder / "sweep.toml", "-o", data, "--no-plot")
    assert code == 0, told
    table = pa.concat_tables([parquet.read_table(file) for file in sorted(data.glob("part-*.parquet"))])
    assert table["control.law"].to_pylist() == ["law.py:Smooth"] * 2 + ["power"] * 2
    for run in (0, 3):
        code, told = springline("replay", data, run, "-o", folder / f"r{run}", "--code", folder / "law.py", "--no-plot")
        assert code == 0, told
        assert "bit for bit" in told


# What is wrong with them


HEAD = (
    "import casadi as ca\n"
    "from springline.model import BaseMotion, Body, Control, Controller, Joint\n"
    "from springline.model import Law, Link, Mechanism, Parameter, Quantity, section\n"
)
OF_ARM = (
    "class Bad(Mechanism):\n  joints = (Joint('a', 'm', 'N'),)\n  parameters = (Parameter('m', 'kg', 1.0, 'mass'), "
    "Parameter('g', 'm/s^2', 9.8, 'gravity'))\n  motor_inertia = (Parameter('I', 'kg', 1.0, 'motor'),)\n"
    "  stiffness = (Parameter('k', 'N/m', 100.0, 'spring'),)\n  def potential_energy(self, q, gravity, p): return 0\n"
    "  def kinetic_energy(self, q, dq, omega, p): "
)
RATE = "class Bad(Law):\n  def rate(self, sigma, p): "
A, OF_LAW = (
    "class Bad(Law):\n  parameters = (Parameter('a', '1', 1.0, 'x'),)\n",
    "  def rate(self, sigma, p): return sigma\n",
)
OF_BODIES = OF_ARM[: OF_ARM.index("  def potential_energy")]
LINK = f"{OF_BODIES}  def links(self, p): return [Link('a', 'prismatic', mass=p.m, "
BODY = f"{OF_BODIES}  def bodies(self, q, p): return [Body(p.m, (q[0], 0, 0), ca.SX.eye(3), "
TWO = (
    OF_ARM.replace("(Joint('a', 'm', 'N'),)", "(Joint('a', 'm', 'N'), Joint('s_a', 'm', 'N'))")
    .replace("'motor')", "'motor', per_joint=True)")
    .replace("'spring')", "'spring', per_joint=True)")
)
FULL = f"{OF_BODIES}  def bodies(self, q, p): return [Body(p.m, (q[0], 0, 0))]\n"
CONTROL = "class Bad(Controller):\n  def control(self, r, y, z, model, p): "
STATE = "class Bad(Controller):\n  states = (Quantity('s', 's', '1', 'state', initial='x'),)\n"


@pytest.mark.parametrize(
    ("door", "text", "expected"),
    [
        ("control.law", "class Good(Law):\n  def rate(self, sigma, p): return -sigma\n", "unknown class in bad.py"),
        ("control.law", "class Bad: pass\n", "expected a subclass of springline.model.Law"),
        ("control.law", "class Bad(Law): pass\n", "abstract method rate"),
        ("control.law", "class Bad(Law:\n", "bad.py, line 4: invalid syntax"),
        ("control.law", "x = '\0'\n", "bad.py"),
        ("control.law", "import nothere\n", "No module named 'nothere' (bad.py, line 4"),
        ("control.law", "import sys\nsys.exit(3)\n", "SystemExit: 3 (bad.py, line 5"),
        ("control.law", f"{RATE}return -sigma * p.k9\n", "there is no 'k9' here, but k1,"),
        ("control.law", f"{RATE}return ca.vertcat(sigma, sigma)\n", "law bad: rate: expected a scalar, got 2 x 1"),
        ("control.law", f"{RATE}pass\n", "expected a CasADi SX expression, got NoneType"),
        ("control.law", f"{RATE}return -sigma * ca.SX.sym('k')\n", "depends on 'k', which it was not given"),
        ("control.law", f"{RATE}return -ca.erf(sigma)\n", "the operation OP_ERF of the Function 'control'"),
        ("control.law", A.replace("'a'", "'a b'") + OF_LAW,
         "expected a letter, then letters, digits and underscores, got 'a b'"),
        ("control.law", A.replace("'x'", "'x */'") + OF_LAW,
         "expected a line of text without /* and */"),
        ("control.law", A.replace("1.0", "'b'") + OF_LAW,
         "expected as default a finite number, got 'b'"),
        ("control.law", f"{A}  name = 'mode'\n{OF_LAW}", "'mode' is a key of [control] already"),
        ("control.law", f"class Bad(Law):\n  name = 'power'\n{OF_LAW}", "its name is 'power'"),
        ("mechanism.name", "class Bad(Mechanism):\n  def kinetic_energy(self, *a): return 0\n"
         "  def potential_energy(self, *a): return 0\n", "joints: expected a tuple of at least one Joint"),
        ("mechanism.name", OF_BODIES, "does not say what the arm consists of: expected links(p), bodies(q, p), or"),
        ("mechanism.name", f"{LINK}parent=0)]\n", "mechanism bad: links: a -> a is a circle, expected a tree"),
        ("mechanism.name", f"{LINK}origin=(0.3, 0, 0))]\n", "link 'a': origin: expected 0, 1, -1 or an expression of"),
        ("mechanism.name", f"{LINK}com=(ca.SX.sym('z'), 0, 0))]\n", "com: depends on 'z', which it was not given"),
        ("mechanism.name", f"{LINK}inertia=-p.m)]\n", "link 'a': inertia: expected a number >= 0, got -1"),
        ("mechanism.name", f"{LINK}inertia=p.m*ca.diag(ca.SX([1, 1, 3])))]\n", "no body has a principal moment above"),
        ("mechanism.name", f"{BODY}-p.m*ca.SX.eye(3))]\n", "bodies[0]: inertia: expected principal moments >= 0"),
        ("mechanism.name", f"{BODY}p.m*ca.diag(ca.SX([1, 1, 3])))]\n", "above the sum of the other two"),
        ("mechanism.name", f"{BODY}p.m*ca.SX([[1, 1, 0], [0, 1, 0], [0, 0, 1]]))]\n", "expected a symmetric matrix"),
        ("mechanism.name", f"{OF_BODIES}  def bodies(self, q, p): return [Body(-p.m, (q[0], 0, 0))]\n",
         "bodies[0]: mass: expected a number >= 0, got -1"),
        ("mechanism.name", f"{OF_BODIES}  def bodies(self, q, p): return [Body(p.m, (1.0, 0, 0))]\n",
         "the mass matrix at the start (a = "),
        ("mechanism.name", f"{OF_ARM}return 0\n", "the mass matrix at the start (a = "),
        ("mechanism.name", f"{OF_ARM}return -p.m * dq**2\n", "the mass matrix at the start (a = "),
        ("mechanism.name", f"{OF_ARM}return p.m * ca.SX.sym('z') * dq**2\n", "kinetic_energy: depends on 'z'"),
        ("mechanism.name", f"{OF_ARM}return p.m * dq**2 * (1 + omega[0]**2)\n", "depends on the base's rate"),
        ("mechanism.name", f"{OF_ARM}return p.m * dq**3\n", "depends on the joint rates"),
        ("mechanism.name", f"{OF_ARM}return p.m * dq**2 / 2\n".replace("return 0", "return p.m * gravity[1]**2 * q[0]"),
         "potential_energy: it is not linear in gravity"),
        ("mechanism.name", f"{OF_ARM}return p.m * ca.dot(dq, omega)\n", "dot: Dimension mismatch (bad.py, line 10"),
        ("mechanism.name", f"{OF_ARM}return p.m * dq[1]**2\n", "out of bounds"),
        ("mechanism.name", f"{TWO}return p.m * ca.dot(dq, dq)\n", "two numbers would be called 'U_s_a'"),
        ("mechanism.name", f"{OF_ARM}return p.m * dq**2\n".replace("'g'", "'G'"), "expected one called g"),
        ("mechanism.name", f"{OF_ARM}return p.m * dq**2\n".replace("'a'", "'2 a'"), "got '2 a'"),
        ("control.controller", "class Bad(Controller):\n  def control(self, r, y, z, model, p): return r.q\n",
         "control: expected a Control, got SX"),
        ("control.controller",
         "class Bad(Controller):\n  def control(self, r, y, z, model, p): return Control(r.q, r.q[0])\n",
         "error has shape 1 x 1, expected 2 x 1"),
        ("control.law", "class Bad(Law):\n  def rate(self, sigma): return -sigma\n",
         "Bad: expected rate(self, sigma, p), got rate(self, sigma)"),
        ("control.law", f"class Bad(Law):\n  equations = '*/ int x;'\n{OF_LAW}", "law Bad: equations: expected"),
        ("control.law", f"{RATE}\n    with section('a', '*/'): return -sigma\n",
         "section: title and equations: expected a line of text without /* and */, got '*/' (bad.py, line 6"),
        ("control.law", f"{RATE}return sigma if sigma > 0 else 0\n", "RuntimeError: Cannot compute the truth value"),
        ("control.law", "class Odd(BaseException): pass\nraise Odd('so')\n", "Odd: so (bad.py, line 5"),
        ("base_motion.kind", "class Bad(BaseMotion):\n  def motion(self, t): return (t,) * 6\n",
         "Bad: expected motion(self, t, p), got motion(self, t)"),
        ("mechanism.name", f"{FULL}  def tip(self, q): return q\n", "Bad: expected tip(self, q, p), got tip(self, q)"),
        ("mechanism.name", f"{FULL}  tip = 5\n", "Bad: expected tip(self, q, p), got 5"),
        ("mechanism.name", f"{FULL}  start_position = 0.3\n", "start_position: expected 1 entries, one per"),
        ("mechanism.name", f"{FULL}  start_rate = ('a',)\n", "start_rate: expected finite numbers, got ('a',)"),
        ("mechanism.name", f"{FULL}  limits = (0, 1)\n", "limits: expected () or a pair low < high per"),
        ("mechanism.name", f"{FULL}  limits = (('a', 'b'),)\n", "limits: expected () or a pair low < high per"),
        ("mechanism.name", f"{FULL}  reference_terms = ((1, 2),)\n", "reference_terms: expected a tuple of SineTerm"),
        ("mechanism.name", f"{FULL}  control_defaults = 5\n", "control_defaults: expected a dict of names and numbers"),
        ("mechanism.name", f"{FULL}  control_defaults = {{'mu': (1, 2)}}\n", "control_defaults, mu: expected 1"),
        ("control.controller", f"{CONTROL}return Control(r.q, r.q, [r.q])\n",
         "controller bad: dz: expected a dict of names and expressions, got list"),
        ("control.controller", f"{CONTROL}return Control(r.q, r.q, {{}}, 3)\n",
         "controller bad: diagnostics: expected a dict of names and expressions, got int"),
        ("control.controller", f"{CONTROL}return Control(r.q + ca.SX.sym('h'), r.q)\n",
         "controller bad: control: depends on 'h', which it was not given"),
        ("control.controller", f"{CONTROL}return Control(r.q + float(y.q1[0]), r.q)\n",
         "controller bad: control: contains NaN, which float() and the functions of math make of an expression"),
        ("control.controller", f"{STATE}{CONTROL[CONTROL.index('  def'):]}return Control(r.q, r.q, {{'s': r.q}})\n",
         "states, s: expected a finite initial value, got 'x'"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told_with_file_class_and_lines(tmp_path: Path, door: str, text: str, expected: str) -> None:
    (tmp_path / "bad.py").write_text(HEAD + text)
    table, _, key = door.partition(".")
    (tmp_path / "bad.toml").write_text(f'[{table}]\n{key} = "bad.py:Bad"\n')
    code, told = springline("run", tmp_path / "bad.toml", "-o", tmp_path / "out")
    assert (code, "Traceback" in told) == (2, False), told
    assert expected in told
    assert f"{door.partition('.')[0]}" in told
    assert "bad.py" in told or "is a key of" in told
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("gone.py:Bad", "there is no file"),
        ("law.py", "expected a file and the name of a class in it"),
        ("law.py:2x", "expected a file and the name of a class in it"),
        ("law.py:", "expected a file and the name of a class in it"),
        (".:X.py:Y", "there is no file"),
        ("lawe.py:Smooth", "did you mean 'law.py'"),
        ("/dev/zero.py:Smooth", "there is no file"),
    ],
)
def test_a_reference_that_leads_nowhere(folder: Path, name: str, expected: str) -> None:
    (folder / "bad.toml").write_text(f'[control]\nlaw = "{name}"\n')
    with pytest.raises(InputError, match=r"control\.law") as told:
        load_scenario(folder / "bad.toml")
    assert expected in str(told.value)


def test_a_table_of_a_law_that_is_not_chosen_is_an_unknown_key(folder: Path) -> None:
    (folder / "bad.toml").write_text("[control]\nsmooth = { gain = 2.0 }\n")
    with pytest.raises(InputError, match=r"control\.smooth: unknown key"):
        load_scenario(folder / "bad.toml")
    (folder / "bad.toml").write_text('[control]\nlaw = "law.py:Smooth"\nsmooth = { gian = 2.0 }\n')
    with pytest.raises(InputError, match=r"control\.smooth\.gian: unknown key.*did you mean 'gain'"):
        load_scenario(folder / "bad.toml")


def test_a_law_may_ask_for_the_same_always(folder: Path) -> None:
    """A number is an expression too."""
    (folder / "law.py").write_text(f"from springline.model import Law\n{RATE}return -1.5\n")
    system = load_scenario("paper/nominal", {"control.law": f"{folder / 'law.py'}:Bad"}).system()
    (name,) = (name for name in system.functions if name == "law_bad")
    values = [slot.default for slot in system.slots]
    assert float(system.function(name)(0.3, values)) == -1.5


def test_a_fault_of_our_own_is_none_of_the_user_s(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        raise KeyError("of ours")

    monkeypatch.setattr("springline.codegen.kernel.lanes.emit", broken)
    (folder / "law.py").write_text(LAW + "# as no other test has it\n")
    with pytest.raises(KeyError, match="of ours"):
        load_scenario(folder / "law.toml")


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("mi", "there is no parameter 'mi'; did you mean 'mu'?"),
        ("super_twisting.slop", "there is no parameter 'super_twisting.slop'; did you mean 'super_twisting.slope'?"),
        ("super_twisting.slope", ""),
        ("slope", ""),
        ("of_another_file.gain", ""),
    ],
)
def test_control_defaults_name_parameters_that_there_are(name: str, expected: str, tmp_path: Path) -> None:
    file = tmp_path / "arm.py"
    file.write_text(f"from springline.model import *\n{FULL}  control_defaults = {{{name!r}: 1.0}}\n")
    if not expected:
        load_scenario("paper/nominal", {"mechanism.name": f"{file}:Bad"})
        return
    with pytest.raises(InputError) as error:
        load_scenario("paper/nominal", {"mechanism.name": f"{file}:Bad"})
    assert expected in str(error.value)
