"""What a shell completes: names of packaged scenarios and sweeps. The model is not imported for it."""

from __future__ import annotations


def scenario_names(incomplete: str) -> list[str]:
    """The packaged scenarios that begin so; files the shell completes itself."""
    from springline.runner.scenario import packaged_scenarios

    return [name for name in packaged_scenarios() if name.startswith(incomplete)]


def sweep_names(incomplete: str) -> list[str]:
    """The packaged sweeps that begin so."""
    from springline.runner.scenario import packaged_sweeps

    return [name for name in packaged_sweeps() if name.startswith(incomplete)]
