"""Names of the packaged scenarios and sweeps, for lists and shells that must not wait for the model."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import resources
from importlib.resources.abc import Traversable


def packaged_scenarios() -> tuple[str, ...]:
    """Names of the scenarios that come with springline, sorted."""
    return tuple(sorted(name for name in packaged_names(scenarios_folder(), ".toml") if not name.startswith("sweeps/")))


def scenarios_folder() -> Traversable:
    """The folder of the packaged scenarios."""
    return resources.files("springline.runner") / "scenarios"


def packaged_file(name: str) -> Traversable:
    """A file of that folder."""
    return scenarios_folder().joinpath(*name.split("/"))


def packaged_names(folder: Traversable, suffix: str, prefix: str = "") -> Iterator[str]:
    """Names of the packaged files below `folder`, with slashes; without the suffix if it is ".toml"."""
    for item in folder.iterdir():
        if item.is_dir():
            yield from packaged_names(item, suffix, f"{prefix}{item.name}/")
        elif item.name.endswith(suffix):
            yield prefix + (item.name.removesuffix(suffix) if suffix == ".toml" else item.name)


def packaged_sweeps() -> tuple[str, ...]:
    """Names of the sweeps that come with springline, sorted."""
    return tuple(sorted(packaged_names(scenarios_folder() / "sweeps", ".toml")))
