"""`springline generate` and `springline export c`: the C of a scenario, ready to be compiled elsewhere."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from springline.runner.cli.commands.target import tree_command

if TYPE_CHECKING:
    from springline.codegen.export import Export

DEFAULT = "paper/nominal"


def _tree(export: Export) -> tuple[dict[str, bytes], dict[str, Any]]:
    from springline.codegen.export.c import generate_files

    return generate_files(export)


generate = tree_command(
    "generate",
    """Generate the C of a scenario: controller, plant and model.

    Its parameters are constants, but for those that --tunable names.

    Example: springline generate paper/nominal --tunable control.k1,control.k2""",
    _tree,
    folder="generated",
    default=DEFAULT,
)
export_c = tree_command(
    "export c",
    """The same files as `springline generate SCENARIO`.

    Example: springline export c paper/nominal -o generated""",
    _tree,
    folder="generated",
)
