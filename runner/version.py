"""The version of springline that is installed."""

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("springline")
except PackageNotFoundError:
    __version__ = "unknown"
"""As installed; "unknown" in a source tree that is not."""
