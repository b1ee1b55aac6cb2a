"""What is wrong with the toolchain, and where its results lie."""

import os
from pathlib import Path

ANOTHER_FOLDER = "set SPRINGLINE_CACHE to a folder of yours that can be written to"
"""The remedy where the cache cannot be used."""


class ToolchainError(RuntimeError):
    """No compiler, a failed build or an unusable cache; the message says what to do about it."""


def cache_root() -> Path:
    """$SPRINGLINE_CACHE, else $XDG_CACHE_HOME/springline, else ~/.cache/springline.

    Raises ToolchainError where none of them is set and the user has no home.
    """
    own = os.environ.get("SPRINGLINE_CACHE")
    if own:
        return Path(own).absolute()
    shared = os.environ.get("XDG_CACHE_HOME")
    try:
        return (Path(shared) if shared else Path.home() / ".cache").absolute() / "springline"
    except RuntimeError as error:  # no HOME, and the user database does not know this user
        raise ToolchainError(
            f"no folder for compiled libraries: you have no home here ({error}); {ANOTHER_FOLDER}"
        ) from error
