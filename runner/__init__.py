"""Scenarios in, tables and figures out: `load_scenario`, `simulate`, `batch`."""

# Not imported on demand: two of these functions have their submodule's name, and whichever is bound last stays.
from springline.runner.batch import batch
from springline.runner.scenario import load_scenario
from springline.runner.simulate import simulate

__all__ = ["batch", "load_scenario", "simulate"]
