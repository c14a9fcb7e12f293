"""The version of the package."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("attrito")
except PackageNotFoundError:  # run from a source tree
    __version__ = "unknown"
