"""Folders of what a command keeps until it has ended: made, marked, taken up again and removed in one way.

A file `attrito` in the folder says that it is one, and whose. What has no such file is somebody else's: it is neither
written to nor removed, and neither is what a link leads to.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from attrito.support.errors import Fault, InputError

MARK = "attrito"
_MAGIC = "attrito intermediate files 1\n"


def take_folder(folder: str | os.PathLike[str], owner: str) -> None:
    """Make a folder, or take up one that is there: what another owner has left in it is removed first.

    Parameters
    ----------
    folder : whose lock, or that of the file it belongs to, this process holds
    owner : what its contents depend on; empty: nothing is taken up

    Raises
    ------
    InputError : something that attrito has not made is in the way
    """
    place = Path(folder)
    if os.path.lexists(place):
        there = owner_of(place)
        if there is None:
            expected = "a folder in which attrito keeps what it has not finished, or none of this name: rename it"
            raise InputError(Fault(str(place), "folder", "in the way", expected))
        if there and there == owner:
            return
        _remove(place)
    place.mkdir(parents=True)
    with (place / MARK).open("w") as mark:
        mark.write(f"{_MAGIC}{owner}\n")
        mark.flush()
        os.fsync(mark.fileno())


def owner_of(folder: str | os.PathLike[str]) -> str | None:
    """Whose a folder is, empty where that has not been written; None: it is none of attrito, or there is none."""
    place = Path(folder)
    if place.is_symlink() or not place.is_dir():
        return None
    try:
        text = (place / MARK).read_text()
    except FileNotFoundError:
        text = ""
    except ValueError:
        return None
    if not text.startswith(_MAGIC):
        # As a process leaves it that was killed while it made or removed it: with nothing else.
        return "" if _MAGIC.startswith(text) and {entry.name for entry in place.iterdir()} <= {MARK} else None
    return text.removeprefix(_MAGIC).removesuffix("\n")


def remove_folder(folder: str | os.PathLike[str]) -> None:
    """Remove a folder of attrito's; anything else of this name stays."""
    if owner_of(folder) is not None:
        _remove(Path(folder))


def _remove(place: Path) -> None:
    """Remove a folder, its mark at last: until then it says whose the rest is."""
    for entry in place.iterdir():
        if entry.is_dir() and not entry.is_symlink():
            shutil.rmtree(entry)
        elif entry.name != MARK:
            entry.unlink()
    (place / MARK).unlink(missing_ok=True)
    place.rmdir()
