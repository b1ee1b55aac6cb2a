"""What all tests share: one kernel cache, one rule for missing tools, no deadlines."""

import os
import shutil
import signal
import threading
from collections.abc import Callable

import pytest
from hypothesis import settings

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
