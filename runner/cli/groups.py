"""Groups of commands that are imported when they are asked for: whoever calls one does not wait for the others.

A command is a function. Its docstring is its help: the first line stands in the list of commands, and a last paragraph
"Example: springline ..." goes below the options.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterator, Mapping, MutableMapping
from typing import Any

import typer
from typer.core import TyperGroup

Function = Callable[..., Any]
Sources = Mapping[str, Callable[[], Function] | None]
"""What imports the function of each command, in the order of the help; None: for what was added as a group."""

_EXAMPLE = "Example: "


class LazyGroup(TyperGroup):
    """A group of the commands that `sources` names. Built, as click wants them, are those alone that are asked for."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.commands = _Commands(self.sources, self.more, dict(self.commands))

    def sources(self) -> Sources:
        """The commands of the group."""
        return {}

    def more(self) -> Sources:
        """Further ones, which it takes longer to find: looked for only where `sources` lacks what is asked for."""
        return {}

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """The list of commands in the help. None is built for it: its docstring says it all."""
        rows = [(name, title) for name, title in self.commands.titles()]  # type: ignore[attr-defined]
        with formatter.section("Commands"):
            formatter.write_dl(rows)


class _Commands(MutableMapping[str, Any]):
    """Commands by name: functions until one is asked for, then what click calls."""

    def __init__(self, sources: Callable[[], Sources], more: Callable[[], Sources], built: dict[str, Any]) -> None:
        self._sources, self._built = dict(sources()), built
        self._more = functools.cache(more)  # which looks through all that is installed

    def _source(self, name: str) -> Callable[[], Function] | None:
        return self._sources[name] if name in self._sources else self._more()[name]

    def __getitem__(self, name: str) -> Any:
        if name not in self._built:
            source = self._source(name)
            if source is None:
                raise KeyError(name)
            self._built[name] = _built(name, source())
        return self._built[name]

    def __setitem__(self, name: str, command: Any) -> None:
        self._built[name] = command

    def __delitem__(self, name: str) -> None:
        raise TypeError(f"the command {name} stays")

    def __iter__(self) -> Iterator[str]:
        return iter(dict.fromkeys([*self._sources, *self._more(), *self._built]))

    def __len__(self) -> int:
        return len(list(iter(self)))

    def titles(self) -> Iterator[tuple[str, str]]:
        """Each command with the first line of what it says of itself."""
        for name in self:
            text = self._built[name].help if name in self._built else ""
            if not text and (source := self._source(name)) is not None:
                text = inspect.getdoc(source())
            yield name, (text or "").partition("\n")[0]


def example_epilog(example: str) -> str:
    r"""What stands below the options: the example on a line of its own, not folded (which \b asks for)."""
    return f"\b\nExample:\n  {example}"


def _built(name: str, function: Function) -> Any:
    """The command as click calls it."""
    text, marked, example = (inspect.getdoc(function) or "").rpartition(_EXAMPLE)
    alone = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
    epilog = example_epilog(example.strip()) if marked else None
    alone.command(name, help=text.strip() if marked else example, epilog=epilog)(function)
    return typer.main.get_command(alone)
