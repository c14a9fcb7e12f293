"""TOML files, read with one message where that fails."""

from __future__ import annotations

import os
import tomllib
from pathlib import Path
from typing import Any

from attrito.support.errors import Fault, InputError


def read_toml(path: str | os.PathLike[str], what: str) -> dict[str, Any]:
    """The tables of a file; `what` it is to be, as `a study`, for faults.

    Raises
    ------
    InputError : it cannot be read, or is no TOML
    """
    try:
        return tomllib.loads(Path(path).read_text())
    except OSError as error:
        raise InputError(Fault(str(path), "file", error.strerror, f"{what} file that can be read")) from None
    except (ValueError, RecursionError) as error:
        raise InputError(Fault(str(path), "file", str(error), f"{what} in TOML")) from None
