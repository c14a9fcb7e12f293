"""attrito: the steady vibration of finite-element structures that rub."""

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("attrito")
except PackageNotFoundError:  # run from a source tree
    __version__ = "unknown"
