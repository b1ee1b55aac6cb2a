"""The work of a sweep: what a worker is sent, and what it makes of it."""

import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np

from springline.codegen.kernel import ONE_RUN, KernelSpec, LoopSettings, Watch, kernel
from springline.model.structure import Structure
from springline.model.system import System
from springline.runner.sweep import Plan, load_sweep
from springline.runner.sweep.work import Inputs, parcel, perform, perform_parcel

FILES = {
    "law.py": """
import casadi as ca
from helper import smooth
from springline.model import Law

class Smooth(Law):
    def rate(self, sigma, p):
        return -smooth(sigma) - p.k1 * sigma
""",
    "helper.py": "import casadi as ca\n\ndef smooth(s):\n    return s / ca.sqrt(1 + s**2)\n",
    "law.toml": '[control]\nlaw = "law.py:Smooth"\n[simulation]\nduration = 0.05\n',
    "sweep.toml": 'scenario = "law.toml"\nsamples = 4\n[vary]\ncontrol.k1 = { uniform = [10.0, 40.0] }\n',
}


def test_kept_runs_are_stopped_too_and_counted_once() -> None:
    loop = kernel(KernelSpec(Structure(), options=ONE_RUN))
    inputs = Inputs(np.array([[slot.default for slot in System().slots]] * 4), range(4))
    watch = Watch()
    perform(loop, LoopSettings(5000, 1e-5, output_every=500), (), inputs, [0, 2], watch)
    assert watch.progress.value == 4 * 5000
    watch.stop.value = 1
    stopped = perform(loop, LoopSettings(1_000_000_000, 1e-5, output_every=100_000_000), (), inputs, [0, 2], watch)
    assert [len(rows) < 5 for rows in stopped.trajectories] == [True, True]


def test_workers_need_no_file(tmp_path: Path) -> None:
    """A parcel is simulated where nothing of the user's can be read or run."""
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    plan = Plan(load_sweep(tmp_path / "sweep.toml"))
    chunk = plan.chunk(0)
    sent = parcel(chunk.group.work), plan.inputs(chunk, plan.columns(chunk))
    (tmp_path / "parcel").write_bytes(pickle.dumps(sent))
    here = perform_parcel(*sent).runs.metrics
    for name in FILES:
        (tmp_path / name).unlink()
    program = (
        "import pickle, sys; from springline.runner.sweep.work import perform_parcel\n"
        "outcome = perform_parcel(*pickle.load(open(sys.argv[1], 'rb')))\n"
        "sys.stdout.buffer.write(outcome.runs.metrics.tobytes())\n"
        "assert not any('springline_user' in name for name in sys.modules)\n"
    )
    done = subprocess.run([sys.executable, "-c", program, tmp_path / "parcel"], check=True, capture_output=True)
    metrics = np.frombuffer(done.stdout).reshape(here.shape)
    np.testing.assert_array_equal(metrics, here)
    assert len(metrics) == 4 and np.isfinite(metrics[:, 0, 5]).all()
