"""Which packages there are: those found in the rooms, a new folder too. All else is in pyproject.toml."""

from setuptools import find_packages, setup

FACE = "springline"
ROOMS = ("benchmarks", "codegen", "generated", "model", "runner")  # generated/ is data: no Python marks it as a package

setup(
    package_dir={FACE: FACE, **{f"{FACE}.{room}": room for room in ROOMS}},
    packages=[
        FACE,
        *(f"{FACE}.{room}" for room in ROOMS),
        *(f"{FACE}.{room}.{package}" for room in ROOMS for package in find_packages(room)),
    ],
)
