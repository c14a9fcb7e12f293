"""Text of files that others wrote: byte order marks, encodings of old editors, Fortran's exponents."""

from __future__ import annotations

import codecs
import os
import re
from pathlib import Path

from attrito.support.errors import Fault, InputError

_FORTRAN = re.compile(r"(?<=[\d.])[dD](?=[+-]?\d+$)")


def decoded(content: bytes) -> str:
    """UTF-8, what is not taken for Windows's Western encoding; UTF-16 with its mark. A mark is left out."""
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return content.decode("utf-16", errors="replace")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.removeprefix(codecs.BOM_UTF8).decode("cp1252", errors="replace")


def read_lines(path: str | os.PathLike[str], expected: str = "a text file that can be read") -> list[str]:
    """The lines of a file, without their ends, those of Windows and old Macs included.

    Raises
    ------
    InputError : it cannot be read
    """
    try:
        content = Path(path).read_bytes()
    except OSError as error:
        raise InputError(Fault(str(path), "file", error.strerror or str(error), expected)) from None
    return re.split(r"\r\n|\r|\n", decoded(content))


def number(word: str) -> float:
    """A number, with an exponent of `D` as Fortran writes it, too; `ValueError` if it is none.

    `1_000` is one for Python alone.
    """
    if "_" in word:
        raise ValueError(f"could not convert string to float: {word.strip()!r}")
    return float(_FORTRAN.sub("e", word.strip()))
