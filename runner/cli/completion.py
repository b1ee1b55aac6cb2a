"""What a shell completes: names of packaged scenarios and sweeps, and what --set takes.

For names alone the model is not imported. Whatever goes wrong is silent: `main` has seen to it.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import typer

from springline.runner.cli.shell_words import KEY

if TYPE_CHECKING:
    from pathlib import Path

    from springline.runner.scenario import Settable


def scenario_names(incomplete: str) -> list[str]:
    """The packaged scenarios that begin so; files the shell completes itself."""
    from springline.runner.scenario import packaged_scenarios

    return [name for name in packaged_scenarios() if name.startswith(incomplete)]


def sweep_names(incomplete: str) -> list[str]:
    """The packaged sweeps that begin so."""
    from springline.runner.scenario import packaged_sweeps

    return [name for name in packaged_sweeps() if name.startswith(incomplete)]


def settings(ctx: typer.Context, incomplete: str) -> list[tuple[str, str]]:
    """What --set takes that begins so, with what is to be said of it: keys, and values of the one that is given.

    The keys are those of the scenario on the command line, as the options --set before this one change it.
    """
    apart = os.environ.get(KEY, "")
    key, equals, _ = (f"{apart}={incomplete}" if apart else incomplete).partition("=")
    # An option that lacks its value, as this one does, ends the parsing before arguments get their names.
    arguments = [str(each.name) for each in ctx.command.params if each.param_type_name == "argument"]
    known = _known({**ctx.params, **dict(zip(arguments, ctx.args, strict=False))})
    if equals:
        found = dict(_values(key, known[key])) if key in known else {}
        begins = f"{apart}=" if apart else ""
        return [(text.removeprefix(begins), said) for text, said in found.items()]
    keys = [name for name in known if name.startswith(key)]
    found = {f"{name}=": ", ".join(known[name].names) or known[name].expected for name in keys}
    if len(keys) == 1:  # with its values, lest the shell end the word
        [name] = keys
        found = ({} if known[name].names else found) | dict(_values(name, known[name]))
    return [(text, said.translate(_NO_MARKUP)) for text, said in found.items()]


_NO_MARKUP = str.maketrans("[]", "()")  # which typer would take for Rich's


def _values(key: str, known: Settable) -> Iterator[tuple[str, str]]:
    """KEY=VALUE for the names that a key may have, and for the number that it has."""
    yield from ((f"{key}={name}", "") for name in known.names)
    if isinstance(known.value, int | float) and not isinstance(known.value, bool):
        from springline.runner.scenario import given_text

        yield f"{key}={given_text(known.value)}", "as it is"


def _known(given: Mapping[str, Any]) -> dict[str, Settable]:
    """The keys of the scenario that a command is given; of the paper's where it is given none."""
    from springline.runner.cli.overrides import overrides
    from springline.runner.files import InputError
    from springline.runner.scenario import draft_scenario, settable_keys, settable_without_code, without_code

    source = given.get("scenario") or "paper/nominal"
    with without_code():  # nobody who asks for a key means a file to be run
        try:
            if given.get("sweep"):
                source = _varied(given["sweep"])
            scenario = draft_scenario(source)
        except InputError:
            return settable_without_code(source)
        try:
            return settable_keys(scenario.with_overrides(overrides(given.get("changes"), ""), read=False))
        except InputError:  # one that needs another beside it, which may be still to come
            return settable_keys(scenario)


def _varied(sweep: str) -> str | Path:
    """The scenario that a sweep varies. Raises InputError."""
    from springline.runner.files import InputError, Problem, read_toml
    from springline.runner.scenario import read_sweep

    text, folder = read_sweep(sweep)
    try:
        source = str(read_toml(text).get("scenario", "paper/nominal"))
    except ValueError as error:
        raise InputError(Problem(sweep, "", f"is no valid TOML: {error}")) from error
    path = folder / source
    return path if path.is_file() else source
