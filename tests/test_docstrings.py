"""Every public name of the packages says what it is."""

import dataclasses
import importlib
import inspect
import pkgutil

import pytest

from springline.model.control import Law
from springline.model.mechanisms import Mechanism

PACKAGES = ("springline.model", "springline.codegen", "springline.runner")


def modules():
    for package in PACKAGES:
        root = importlib.import_module(package)
        yield package
        for found in pkgutil.walk_packages(root.__path__, f"{package}."):
            yield found.name


def undocumented(name):
    """Public classes, functions, methods and properties defined in the module, without a docstring of their own."""
    module = importlib.import_module(name)
    if not module.__doc__:
        yield name
    for key, value in vars(module).items():
        here = getattr(value, "__module__", None) == name
        if key.startswith("_") or not here or not (inspect.isclass(value) or inspect.isroutine(value)):
            continue
        if not value.__doc__ or (dataclasses.is_dataclass(value) and value.__doc__.startswith(f"{key}(")):
            yield f"{name}.{key}"
        if inspect.isclass(value):
            yield from (f"{name}.{key}.{member}" for member in undocumented_members(value))


def undocumented_members(cls):
    # a base class or protocol says once what its methods do
    inherited = {key for base in cls.__mro__[1:] for key in vars(base)} | set(protocol_members(cls))
    for key, value in vars(cls).items():
        if key.startswith("_") or key in inherited:
            continue
        # a property's, staticmethod's or classmethod's function, or the function itself
        function = value.fget if isinstance(value, property) else getattr(value, "__func__", value)
        if inspect.isroutine(function) and not function.__doc__:
            yield key


def protocol_members(cls):
    """Methods that a documented Protocol of springline.model describes for the classes that fulfil it."""
    for protocol in (Mechanism, Law):
        names = [key for key, value in vars(protocol).items() if inspect.isfunction(value) and key[0] != "_"]
        if all(hasattr(cls, key) for key in names):
            yield from names


@pytest.mark.parametrize("name", list(modules()))
def test_public_names_have_docstrings(name):
    assert list(undocumented(name)) == []


def test_a_gap_would_be_found():
    class Documented:
        """Says something."""

        def gap(self):
            pass

        @property
        def other_gap(self):
            return None

        def _private(self):
            pass

    assert list(undocumented_members(Documented)) == ["gap", "other_gap"]
