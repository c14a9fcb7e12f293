"""Variables of MATLAB's .mat files of version 4, looked over by their headers before any is read.

A variable is a header of five 32-bit numbers (type, rows, columns, whether there is an imaginary part, length of the
name with its closing zero), the name, and the numbers. The type is 1000 M + 100 O + 10 P + T: the machine's order of
bytes, zero, the kind of number, and whether they are numbers, text or a sparse matrix. There is no sum and no mark, so
that SciPy takes any bytes for variables and reads a file of gigabytes to its end before it finds none.
"""

from __future__ import annotations

import struct
from pathlib import Path

HEADER_BYTES = 20
# Of a number, by P of the type.
_BYTES = (8, 4, 4, 2, 2, 1)
# MATLAB's names have 63 letters at most; other programs' may be longer.
_LONGEST_NAME = 4096


def is_version_4(path: str | Path) -> bool:
    """Whether a .mat file has no header of its own: a byte of its first number is zero, as no text's is."""
    with Path(path).open("rb") as file:
        return 0 in file.read(4)


def fault_of_version_4(path: str | Path) -> str:
    """What is wrong with the first variable that cannot be one, in words; empty where all lie within the file."""
    size, place = Path(path).stat().st_size, 0
    with Path(path).open("rb") as file:
        while place < size:
            file.seek(place)
            header = file.read(HEADER_BYTES)
            taken, fault = _bytes_of(header)
            if fault:
                return f"{fault} at byte {place}"
            if place + taken > size:
                return f"a variable of {taken} bytes at byte {place}, {size - place} of them in the file"
            place += taken
    return ""


def _bytes_of(header: bytes) -> tuple[int, str]:
    """Bytes that a variable takes, header included, and what is wrong with its header."""
    if len(header) < HEADER_BYTES:
        return 0, f"{len(header)} bytes of a header"
    for order in "<>":
        kind, rows, columns, imaginary, name = struct.unpack(f"{order}5i", header)
        machine, rest = divmod(kind, 1000)
        number, what = divmod(rest, 10)
        if kind >= 0 and machine <= 4 and number < len(_BYTES) and what <= 2:
            break
    else:
        return 0, f"a variable of type {kind}"
    if rows < 0 or columns < 0 or imaginary not in (0, 1) or not 0 < name <= _LONGEST_NAME:
        return 0, f"a variable of {rows} rows and {columns} columns whose name has {name} letters"
    return HEADER_BYTES + name + rows * columns * _BYTES[number] * (1 + imaginary), ""
