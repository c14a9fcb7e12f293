"""`attrito verify torture`: every method on thousands of small scenes, and what integration in time says of it."""

from __future__ import annotations

import csv
import os
import random
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from attrito.plots.style import save
from attrito_verification.scene_grid import pictures, report
from attrito_verification.scene_grid.grid import Grid, gather, write_csv, write_hdf5
from attrito_verification.scene_grid.methods import solve_family
from attrito_verification.scene_grid.scenes import FREQUENCIES, Family, families

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

# Of the order in which families are taken, so that a part of them is of all kinds.
SEED = 1
SILENCE = 10.0
QUICK_SCENES = 160


def verify_torture(
    comm: Comm, folder: str | os.PathLike[str], scenes: int | None = None, say: Callable[[str], None] = print
) -> str:
    """Run the grid into a folder, families shared out over ranks; returns the report's path.

    Every family is kept in the folder `parts` as it is done, until all are: a run that was ended goes on from there.

    Parameters
    ----------
    folder : gets `torture.h5`, `scenes.csv`, `figures.csv`, `report.md`, `verdicts.png` and `methods.png`
    scenes : at least so many, of all kinds; all unless given
    say : receives a line for each step, at the root
    """
    chosen = choose(scenes)
    started = time.perf_counter()
    mine = chosen[comm.rank :: comm.size]
    columns, said = [], started
    place = Path(folder)
    for number, family in enumerate(mine, 1):
        columns.append(_solved(place / "parts", family))
        if comm.rank == 0 and time.perf_counter() - said > SILENCE:
            said = time.perf_counter()
            say(f"{number} of {len(mine)} families, {said - started:.0f} s")
    parts = comm.gather((mine, columns))
    if comm.rank == 0:
        place.mkdir(parents=True, exist_ok=True)
        known = {family: one for families_of, found in parts for family, one in zip(families_of, found, strict=True)}
        ordered = [family for family in families() if family in known]
        write(place, gather(ordered, [known[family] for family in ordered]))
        shutil.rmtree(place / "parts")
        say(f"{len(ordered) * FREQUENCIES} scenes in {time.perf_counter() - started:.0f} s: {place / 'report.md'}")
    return str(place / "report.md")


def choose(scenes: int | None) -> list[Family]:
    """Families with at least so many scenes, in a fixed order without pattern; all unless given."""
    every = families()
    random.Random(SEED).shuffle(every)
    return every if scenes is None else every[: -(-scenes // FREQUENCIES)]


def _solved(parts: Path, family: Family) -> dict[str, np.ndarray]:
    """Columns of a family, from its file if that is there."""
    path = parts / f"{family.name.replace('/', '_')}.npz"
    if path.is_file():
        with np.load(path) as file:
            return dict(file)
    columns = solve_family(family)
    parts.mkdir(parents=True, exist_ok=True)
    with path.with_suffix(".new").open("wb") as file:
        np.savez(file, **columns)
    path.with_suffix(".new").replace(path)
    return columns


def write(place: Path, grid: Grid) -> None:
    """All files of a grid."""
    write_hdf5(place / "torture.h5", grid)
    write_csv(place / "scenes.csv", grid)
    with (place / "figures.csv").open("w", newline="") as file:
        csv.writer(file).writerows(
            [("figure", "value"), *((name, f"{x:.9g}") for name, x in report.figures(grid).items())]
        )
    (place / "report.md").write_text(report.markdown(grid))
    save(pictures.verdict_map(grid), place / "verdicts.png")
    save(pictures.method_map(grid), place / "methods.png")
