"""Arguments and options that several exporting commands share."""

from __future__ import annotations

from typing import Annotated, Literal

import typer

ScenarioName = Annotated[str, typer.Argument(help="A TOML file, or the name of a packaged scenario.")]
Force = Annotated[bool, typer.Option("--force", help="Replace files that springline did not write.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print what was done to each file as JSON.")]

TUNABLE = "NAMES|all|none"


def tunable_names(text: str) -> list[str] | Literal["all", "none"]:
    """What --tunable names: parameters, comma-separated, or all or none of them."""
    match text:
        case "all" | "none":
            return text
    return [name.strip() for name in text.split(",")]
