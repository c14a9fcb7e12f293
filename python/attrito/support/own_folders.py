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
        shutil.rmtree(place)
    place.mkdir(parents=True)
    (place / MARK).write_text(f"{_MAGIC}{owner}\n")


def owner_of(folder: str | os.PathLike[str]) -> str | None:
    """Whose a folder is, empty where that has not been written; None: it is none of attrito, or there is none."""
    place = Path(folder)
    if place.is_symlink() or not place.is_dir():
        return None
    try:
        text = (place / MARK).read_text()
    except FileNotFoundError:
        # As a process that was killed leaves it.
        return None if any(place.iterdir()) else ""
    except ValueError:
        return None
    if not text.startswith(_MAGIC):
        return "" if _MAGIC.startswith(text) else None
    return text.removeprefix(_MAGIC).removesuffix("\n")


def remove_folder(folder: str | os.PathLike[str]) -> None:
    """Remove a folder of attrito's; anything else of this name stays."""
    if owner_of(folder) is not None:
        shutil.rmtree(folder)
