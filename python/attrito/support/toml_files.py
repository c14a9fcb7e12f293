"""TOML files, read with one message where that fails."""

from __future__ import annotations

import codecs
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
        content = Path(path).read_bytes().removeprefix(codecs.BOM_UTF8)
        if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
            raise InputError(Fault(str(path), "file", "UTF-16", f"{what} in TOML, which is UTF-8"))
        # TOML is UTF-8, whatever the locale.
        return tomllib.loads(content.decode("utf-8").replace("\r\n", "\n"))
    except OSError as error:
        raise InputError(Fault(str(path), "file", error.strerror, f"{what} file that can be read")) from None
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        value = repr(content[error.start : error.end])
        raise InputError(Fault(str(path), f"line {line}", value, f"{what} in UTF-8")) from None
    except (ValueError, RecursionError) as error:
        raise InputError(Fault(str(path), "file", str(error), f"{what} in TOML")) from None
