"""What the library says of its own interface: numbers of names, and sizes of structures."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

from attrito.library.structures import STRUCTURES


@dataclass(frozen=True)
class Description:
    """The interface as the library has it.

    Parameters
    ----------
    names : of each enumeration of `names.ENUMERATIONS`, the number of each name
    sizes : of each structure of `structures.STRUCTURES`, bytes
    rows : of each table that documentation shows, the cells of each row
    """

    names: dict[str, dict[str, int]]
    sizes: dict[str, int]
    rows: dict[str, list[list[str]]]


def describe(library: ctypes.CDLL) -> Description:
    """Ask a library whose entries have their types."""
    room = ctypes.create_string_buffer(library.attrito_describe(0, ctypes.create_string_buffer(1)))
    library.attrito_describe(len(room), room)
    found = Description({}, {}, {})
    for line in room.value.decode().splitlines():
        what, name, *rest = line.split()
        if what == "names":
            pairs = (word.split("=") for word in rest)
            found.names[name] = {key: int(number) for key, number in pairs}
        elif what == "row":
            cells = line.split(maxsplit=2)[2].split("|")
            found.rows.setdefault(name, []).append([cell.strip() for cell in cells])
        else:
            found.sizes[name] = int(rest[0])
    return found


def differing_sizes(library: ctypes.CDLL) -> list[str]:
    """Structures that are not as large there as here: the library is of another version than the package."""
    theirs, ours = describe(library).sizes, {name: ctypes.sizeof(kind) for name, kind in STRUCTURES.items()}
    return sorted(name for name in theirs.keys() | ours.keys() if theirs.get(name) != ours.get(name))
