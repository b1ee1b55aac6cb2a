"""What all tests share: one kernel cache, one folder for what is made once, one rule for missing tools, other arms."""

import fcntl
import os
import shutil
import signal
import threading
from collections.abc import Callable
from pathlib import Path
from typing import ClassVar

import casadi as ca
import pytest
from hypothesis import settings

from springline.benchmarks.spatial_arm import SpatialArm
from springline.model.mechanisms import MECHANISMS, Mechanism
from springline.model.parameters import POSITIVE, Joint, Parameter, Values
from springline.model.signals import SineTerm

# Two cores shared by several workers: a wall-clock deadline would fail at random. In CI a red test must be
# red again on the next machine, so examples are drawn from a fixed seed.
settings.register_profile("springline", deadline=None, derandomize=os.environ.get("CI") == "true")
settings.load_profile("springline")


def pytest_configure(config: pytest.Config) -> None:
    # Not the user's cache, but one for all workers and sessions: entries are keyed by content, so an old
    # one can only be the right one.
    os.environ["SPRINGLINE_CACHE"] = str(config.rootpath / ".pytest_cache" / "springline")
    os.environ["MPLBACKEND"] = "Agg"
    # A shell that starts the tests in the background has them ignore Ctrl-C, which is part of what is tested.
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(autouse=True)
def _no_width(monkeypatch: pytest.MonkeyPatch) -> None:
    """Commands print whole lines, as into a pipe, whatever width a shell or a library has left in the environment."""
    monkeypatch.delenv("COLUMNS", raising=False)


@pytest.fixture(scope="session")
def once(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, Callable[[Path], object]], Path]:
    """``once(name, make)``: a file or folder that the first of all workers to ask has made with ``make(path)``.

    It is for reading: whoever changes it does so in a copy.
    """
    root = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        root = root.parent  # the workers' folders lie side by side
    root = root / "once"

    def made(name: str, make: Callable[[Path], object]) -> Path:
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.with_name(f"{path.name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not path.exists():
                unfinished = path.with_name(f"{path.name}.unfinished")
                shutil.rmtree(unfinished, ignore_errors=True)  # of a worker that failed
                make(unfinished)
                unfinished.rename(path)
        return path

    return made


@pytest.fixture(scope="session")
def require_tool() -> Callable[..., str]:
    """``require_tool(name, hint="")``: the path of a program that a test needs.

    Where it is missing the test is skipped and says so; in CI (CI=true) it fails, for there .ci/run installs
    every tool and a skip would hide a gap.
    """

    def require(name: str, hint: str = "") -> str:
        path = shutil.which(name)
        if path is not None:
            return path
        reason = f"{name} is not installed" + (f": {hint}" if hint else "")
        if os.environ.get("CI") == "true":
            pytest.fail(reason)
        pytest.skip(reason)

    return require


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """In CI a skipped test is a gap in what was checked, whoever skipped it."""
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    if os.environ.get("CI") == "true" and reporter is not None and reporter.stats.get("skipped"):
        reporter.write_line(f"{len(reporter.stats['skipped'])} tests were skipped, and in CI none may be")
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


class _PlanarArm(Mechanism):
    """Links of 1 kg and 0.5 m with their mass in the middle, turning about z one after the other."""

    parameters = (
        Parameter("mass", "kg", 1.0, "mass of a link", POSITIVE, per_joint=True),
        Parameter("length", "m", 0.5, "length of a link", POSITIVE, per_joint=True),
        Parameter("inertia", "kg m^2", 0.02, "inertia of a link about its centroid", POSITIVE, per_joint=True),
        Parameter("g", "m/s^2", 9.81, "gravity"),
    )
    motor_inertia = (Parameter("rotor", "kg m^2", 0.05, "inertia of a motor", POSITIVE, per_joint=True),)
    stiffness = (Parameter("spring", "{F}/{q}", 4.0e3, "stiffness of a spring", POSITIVE, per_joint=True),)

    def _centroids(self, q: ca.SX, p: Values) -> list[ca.SX]:
        places, joint, angle = [], ca.SX.zeros(3), ca.SX(0)
        for i in range(q.numel()):
            angle = angle + q[i]
            along = p.length[i] * ca.vertcat(ca.cos(angle), ca.sin(angle), 0)
            places.append(joint + along / 2)
            joint = joint + along
        return places

    def kinetic_energy(self, q: ca.SX, dq: ca.SX, omega: ca.SX, p: Values) -> ca.SX:
        energy, turning = ca.SX(0), omega[2]
        for i, r in enumerate(self._centroids(q, p)):
            v = ca.jtimes(r, q, dq) + ca.cross(omega, r)
            turning = turning + dq[i]
            energy = energy + (p.mass[i] * ca.dot(v, v) + p.inertia[i] * turning**2) / 2
        return energy

    def potential_energy(self, q: ca.SX, gravity: ca.SX, p: Values) -> ca.SX:
        places = self._centroids(q, p)
        return sum((p.mass[i] * ca.dot(gravity, r) for i, r in enumerate(places)), ca.SX(0))


class OneLink(_PlanarArm):
    """One joint."""

    joints = (Joint("elbow", "rad", "N m"),)


class Slider(Mechanism):
    """A mass that slides up and down: linear, so that its motion can be written down."""

    joints = (Joint("lift", "m", "N"),)
    parameters = (Parameter("m", "kg", 3.0, "mass", POSITIVE), Parameter("g", "m/s^2", 9.81, "gravity"))
    motor_inertia = (Parameter("motor", "kg", 1.0, "mass of the motor", POSITIVE),)
    stiffness = (Parameter("spring", "N/m", 50.0, "stiffness of the spring", POSITIVE),)

    def kinetic_energy(self, q: ca.SX, dq: ca.SX, omega: ca.SX, p: Values) -> ca.SX:
        r = ca.vertcat(0, q, 0)
        v = ca.jtimes(r, q, dq) + ca.cross(omega, r)
        return p.m * ca.dot(v, v) / 2

    def potential_energy(self, q: ca.SX, gravity: ca.SX, p: Values) -> ca.SX:
        return p.m * gravity[1] * q


class ThreeLinks(_PlanarArm):
    """Three joints, one of them with gains of its own, off their reference at first."""

    joints = (Joint("shoulder", "rad", "N m"), Joint("elbow", "rad", "N m"), Joint("wrist", "rad", "N m"))
    reference_offset = (0.5, -0.4, 0.3)
    reference_terms = ((SineTerm(0.2, 2.0),), (SineTerm(0.1, 3.0), SineTerm(0.05, 5.0)), ())
    start_position = (0.6, -0.5, 0.2)
    control_defaults: ClassVar = {"mu": (8.0, 6.0, 5.0)}


OTHER_ARMS: tuple[Mechanism, ...] = (OneLink(), ThreeLinks(), Slider())


@pytest.fixture
def other_arms(monkeypatch: pytest.MonkeyPatch) -> None:
    """Arms with one, three and (in space) seven joints, known by name as the packaged ones are."""
    for arm in (*OTHER_ARMS, SpatialArm()):
        monkeypatch.setitem(MECHANISMS, arm.name, arm)


@pytest.fixture(params=[arm.name for arm in OTHER_ARMS if arm.name != "slider"])
def other_arm(request: pytest.FixtureRequest, other_arms: None) -> str:
    """The name of an arm that is not the paper's."""
    return str(request.param)
