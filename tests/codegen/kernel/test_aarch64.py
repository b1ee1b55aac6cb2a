"""The same kernel on another architecture: aarch64 under user-mode emulation gives this machine's bits."""

import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from springline.codegen.kernel import KernelOptions, KernelSpec, LoopSettings, print_kernel
from springline.codegen.kernel.compiled import compile_kernel
from springline.codegen.program import Program

# Reads the parameters of all runs as raw doubles, simulates, writes final states and metrics as raw doubles.
DRIVER = """
#include "loop.c"
#include <stdio.h>
enum { RUNS = %d };
static double parameters[RUNS * SL_NP], bands[RUNS][SL_NBANDS];
static double metrics[RUNS * SL_NMETRICS], state[RUNS * SL_NX], end[RUNS];
static int32_t status[RUNS], quantity[RUNS];
int main(void) {
  sl_job job = {0};
  if (fread(parameters, sizeof parameters, 1, stdin) != 1) return 1;
  job.last = RUNS, job.steps = %d, job.step = %r, job.bound = 1e6, job.hold = 1;
  for (int i = 0; i < RUNS; i++) bands[i][SL_RESPONSE_BAND] = 0.10, bands[i][SL_SETTLING_BAND] = 0.05;
  job.parameters = parameters, job.bands = bands[0], job.metrics = metrics, job.final_state = state, job.end_time = end;
  job.status = status, job.quantity = quantity;
  springline_simulate(&job);
  return fwrite(state, sizeof state, 1, stdout) == 1 && fwrite(metrics, sizeof metrics, 1, stdout) == 1 ? 0 : 1;
}
"""


@pytest.mark.parametrize("options", [
    KernelOptions(engine="casadi", flags=("-O2",)),
    KernelOptions(width=1, groups=1, flags=("-O0",)),
    KernelOptions(width=2, groups=2, flags=("-O3",)),
    KernelOptions(width=4, groups=1, flags=("-O2",)),
], ids=["casadi", "W1", "W2G2", "W4"])  # fmt: skip
def test_aarch64_gives_the_same_bits(
    options: KernelOptions, shaken: Program, values_of: Callable[..., NDArray[np.float64]], tmp_path: Path,
    require_tool: Callable[..., str],
) -> None:  # fmt: skip
    compiler = require_tool("aarch64-linux-gnu-gcc", "apt-get install gcc-aarch64-linux-gnu")
    emulator = require_tool("qemu-aarch64", "apt-get install qemu-user")
    settings = LoopSettings(200, 1e-4)
    table = np.tile(values_of(shaken), (5, 1))
    table[:, 1] *= np.linspace(0.9, 1.1, 5)
    expected = compile_kernel(shaken, KernelSpec(shaken.system.structure)).run(table, settings)

    source = print_kernel(shaken, KernelSpec(shaken.system.structure, options=options))
    for name, text in source.files:
        (tmp_path / name).write_text(text)
    (tmp_path / "driver.c").write_text(DRIVER % (len(table), settings.steps, settings.step))
    flags = [flag for flag in source.flags if not flag.startswith("-Wno-psabi")]
    options = [*flags, "-ffp-contract=off", "-fno-math-errno", "-static", "-w"]
    command = [compiler, *options, "driver.c", "-o", "driver", "-lm"]  # libraries come after what needs them
    subprocess.run(command, cwd=tmp_path, check=True)
    output = subprocess.run([emulator, "driver"], cwd=tmp_path, input=table.tobytes(), capture_output=True, check=True)
    assert output.stdout == expected.final_state.tobytes() + expected.metrics.tobytes()
