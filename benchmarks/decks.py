"""Are displacements those of CalculiX's own static step? Random decks, imported, loaded from files and by mass.

    .venv/bin/python benchmarks/decks.py --decks 200 --seed 1

A deck is a block of random size, or a sector of a ring, of one kind of element, clamped at an end or at the bore, with
or without what makes dofs depend on others: a tie, an equation, a rigid body, a cyclic tie. `cyclic job` is a sector
whose deck has no tie: the job's `[cyclic]` joins its sides. CalculiX writes the matrices and solves the static load;
attrito imports, reduces and runs with a contact that stays open. Compared are displacements of three nodes, by the
largest of them. What differs by more than `SAME` has to be refused, or be warned of. Prints JSON: `silent` is to be
zero.
"""

from __future__ import annotations

import argparse
import random
import re
import subprocess
import sys
import tempfile
from collections import Counter
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any

import common  # isort: skip (sets the threads of BLAS before numpy is loaded)
import numpy as np

import attrito
from attrito.importers import import_model
from attrito.results.result import Result
from attrito.support.errors import InputError, NumericsError

SAME = 1e-4
KINDS = ("C3D4", "C3D8", "C3D8R", "C3D10", "C3D20", "C3D20R")
JOINS = ("none", "tie", "equation", "rigid body", "cyclic tie", "cyclic job")
LOADS = ("force", "force on a dependent node", "pressure", "pressure on a part", "gravity", "centrifugal")
SECTORS, SPEED_HZ = 12, 50.0
# Corners of a brick on the grid of corners, edges in CalculiX's order, and six tetrahedra about its diagonal
CORNERS = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2)]
EDGES = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
TETRAHEDRA = [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]
TETRA_EDGES = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]
FACES = {4: [(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)]} | {
    8: [(0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)]
}
LAW = {"normal_stiffness": 1.0, "tangential_stiffness": 1.0, "friction_coefficient": 0.3, "gap": 1e3}


@dataclass
class Grid:
    """Elements on a grid of bricks; nodes by their places on the doubled grid, numbered from `first` on."""

    kind: str
    size: tuple[int, int, int]
    first: int
    nodes: dict[tuple[int, ...], int] = field(default_factory=dict)
    elements: dict[int, list[int]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for place in product(*map(range, self.size)):
            corners = [tuple(2 * np.add(place, np.divide(corner, 2).astype(int))) for corner in CORNERS]
            tetra = self.kind in ("C3D4", "C3D10")
            for chosen in TETRAHEDRA if tetra else [tuple(range(8))]:
                own = [corners[i] for i in chosen]
                if self.kind[3:5] in ("10", "20"):
                    own += [tuple(np.add(own[a], own[b]) // 2) for a, b in (TETRA_EDGES if tetra else EDGES)]
                numbers = [self.nodes.setdefault(tuple(map(int, at)), self.first + len(self.nodes)) for at in own]
                self.elements[self.first + len(self.elements)] = numbers

    def on(self, axis: int, end: int) -> list[int]:
        """Nodes of a side of the grid, at its low (0) or high (1) end along an axis."""
        return [number for place, number in self.nodes.items() if place[axis] == 2 * end * self.size[axis]]

    def faces(self, axis: int, end: int) -> list[tuple[int, int]]:
        """Elements and numbers of their faces on a side, from 1."""
        side = set(self.on(axis, end))
        corners = 4 if self.kind in ("C3D4", "C3D10") else 8
        return [
            (element, k + 1)
            for element, nodes in self.elements.items()
            for k, face in enumerate(FACES[corners])
            if all(nodes[i] in side for i in face)
        ]


def lines_of(values: list[Any], count: int = 8) -> str:
    """A list over lines that end in commas but for the last."""
    return ",\n".join(", ".join(map(str, values[i : i + count])) for i in range(0, len(values), count)) + "\n"


class Deck:
    """One random deck with its load."""

    def __init__(self, seed: int, number: int):
        chance = self._chance = random.Random(f"{seed} {number}")
        self.kind, self.join, self.load = chance.choice(KINDS), chance.choice(JOINS), chance.choice(LOADS)
        self.wheel = self.join.startswith("cyclic")
        self.grids = [Grid(self.kind, (chance.randint(2, 4), 2, 2), 1)]
        self._length = 10.0 * self.grids[0].size[0]
        if self.join == "tie":
            self.grids.append(Grid(self.kind, (3, 3, 3), 5001))
        self._end = self.grids[0].on(0, 1)
        self.places = {n: self._place(grid, at) for grid in self.grids for at, n in grid.nodes.items()}
        inside = set(self.grids[-1].nodes.values()) - set(self.grids[-1].on(0, 0))
        if self.wheel:
            inside -= {*self.grids[0].on(1, 0), *self.grids[0].on(1, 1)}
        elif self.join in ("equation", "rigid body"):
            inside -= set(self._end)
        self.shown = chance.sample(sorted(inside), 3)
        self.mesh, self.joins = self._mesh(), self._joins()
        self.loading, self.described = self._loading()

    def _place(self, grid: Grid, at: tuple[int, ...]) -> tuple[float, ...]:
        """Coordinates of a place of a grid: a block of 10 by 10, a second one at its end, or a sector of a ring."""
        x, y, z = (part / (2.0 * count) for part, count in zip(at, grid.size, strict=True))
        if self.wheel:
            radius, angle = 30.0 + self._length * x, 2.0 * np.pi * y / SECTORS
            return radius * np.cos(angle), radius * np.sin(angle), 10.0 * z
        return (0.0 if grid is self.grids[0] else self._length) + 10.0 * grid.size[0] * x, 10.0 * y, 10.0 * z

    def _mesh(self) -> str:
        """Nodes, elements, sets, the material and supports."""
        nodes = "".join(f"{n}, {', '.join(f'{v:.13g}' for v in at)}\n" for n, at in self.places.items())
        elements = "".join(lines_of([n, *own], 10) for grid in self.grids for n, own in grid.elements.items())
        sets = {"clamp": self.grids[0].on(0, 0), "end": self._end}
        if self.wheel:
            # A tie makes its first side depend on the other, also at the bore.
            low = self.grids[0].on(1, 0)
            sets |= {"low": low, "high": self.grids[0].on(1, 1), "corner": [n for n in sets["clamp"] if n in low]}
            sets["clamp"] = [n for n in sets["clamp"] if n not in low]
        if self.join == "tie":
            sets["slave"] = self.grids[1].on(0, 0)
        if self.join == "rigid body":
            nodes += "".join(f"{n}, {self._length + 5.0}, 5., 5.\n" for n in (9001, 9002))
        listed = "".join(f"*NSET, NSET={name}\n{lines_of(sorted(own))}" for name, own in sets.items())
        return (
            f"*NODE, NSET=all\n{nodes}*ELEMENT, TYPE={self.kind}, ELSET=E\n{elements}{listed}*MATERIAL, NAME=s\n"
            "*ELASTIC\n210000., 0.3\n*DENSITY\n7.8e-9\n*SOLID SECTION, ELSET=E, MATERIAL=s\n*BOUNDARY\nclamp, 1, 3\n"
        )

    def _joins(self) -> str:
        """What makes dofs depend on others."""
        if self.join == "tie":
            faces = "".join(f"{element}, S{face}\n" for element, face in self.grids[0].faces(0, 1))
            return (
                f"*SURFACE, NAME=MASTER\n{faces}*SURFACE, NAME=SLAVE, TYPE=NODE\nslave\n"
                "*TIE, NAME=T, POSITION TOLERANCE=0.1\nSLAVE, MASTER\n"
            )
        if self.join == "equation":
            return f"*EQUATION\n2\n{self._end[0]}, 3, 1.0, {self._end[1]}, 3, -1.0\n"
        if self.join == "rigid body":
            return "*RIGID BODY, NSET=end, REF NODE=9001, ROT NODE=9002\n"
        if self.wheel:
            return (
                "*SURFACE, NAME=LOW, TYPE=NODE\nlow\n*SURFACE, NAME=HIGH, TYPE=NODE\nhigh\n"
                "*TIE, NAME=T, CYCLIC SYMMETRY, POSITION TOLERANCE=0.1\nLOW, HIGH\n"
                f"*CYCLIC SYMMETRY MODEL, N={SECTORS}, NGRAPH=1, TIE=T\n0., 0., 0., 0., 0., 1.\n"
            )
        return ""

    def _loading(self) -> tuple[str, dict[str, Any]]:
        """The load for CalculiX's step, and for a job."""
        if self.load.startswith("force"):
            dependent = {"tie": self.grids[-1].on(0, 0)[0], "cyclic tie": self.grids[0].on(1, 0)[-1]}
            node = self.shown[0]
            if self.load != "force":
                node = dependent.get(self.join, self._end[0])
            elif self.join == "rigid body" and self._chance.random() < 0.7:
                node = 9001
            return f"*CLOAD\n{node}, 3, -30.\n{node}, 2, 7.\n", {"kind": "static", "file": "load.inp"}
        if self.load.startswith("pressure"):
            top = self.grids[-1].faces(2, 1)
            top = top if self.load == "pressure" else top[: max(1, len(top) // 3)]
            text = "".join(f"{element}, P{face}, 1.0\n" for element, face in top)
            return f"*DLOAD\n{text}", {"kind": "static", "file": "load.inp"}
        if self.load == "gravity":
            return "*DLOAD\nE, GRAV, 9810., 0., 0., -1.\n", {"kind": "static", "gravity": [0.0, 0.0, -9810.0]}
        axis = [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]] if self.wheel else [[-20.0, 5.0, 5.0], [0.0, 1.0, 0.0]]
        numbers = ", ".join(f"{v:.15g}" for v in [(2.0 * np.pi * SPEED_HZ) ** 2, *axis[0], *axis[1]])
        spin = dict(zip(("axis_point", "axis_direction"), axis, strict=True))
        return f"*DLOAD\nE, CENTRIF, {numbers}\n", {
            "kind": "centrifugal", "speed_hz": SPEED_HZ, "spin_softening": False
        } | spin  # fmt: skip

    def job(self) -> dict[str, Any]:
        """Monitors of the shown nodes; a contact that is open; a harmonic load, since a run needs one."""
        node = self.shown[0]
        monitors = [
            {"name": f"n{n}{axis}", "dofs": [[["node", n, axis], 1.0]]} for n in self.shown for axis in ("x", "y", "z")
        ]
        cyclic = {
            "sectors": SECTORS, "engine_order": 0, "lower": "low", "upper": "high", "axis_point": [0.0, 0.0, 0.0],
            "axis_direction": [0.0, 0.0, 1.0],
        }  # fmt: skip
        return {
            "model": {"file": "model.h5"},
            "damping": {"ratio": 0.01},
            "reduction": {"modes": 3},
            "load": [
                self.described | {"name": "given"},
                {"kind": "harmonic", "name": "shaken", "cosine": [[["node", node, "z"], 1e-3]]},
            ],
            "contact": [{"normal": [[["node", node, "z"], 1.0]], "tangents": [[[["node", node, "y"], 1.0]]]} | LAW],
            "balance": {"harmonics": 1},
            "sweep": {"frequencies_hz": [10.0]},
            "output": {"file": "result.h5", "monitors": monitors},
        } | ({"cyclic": cyclic} if self.join == "cyclic job" else {})


def calculix(folder: Path, name: str, text: str) -> str:
    """Solve a deck; what CalculiX prints in `.dat`."""
    (folder / f"{name}.inp").write_text(text)
    subprocess.run(["ccx", "-i", name], cwd=folder, capture_output=True, check=False)
    printed = folder / f"{name}.dat"
    return printed.read_text() if printed.exists() else ""


def expected_of(deck: Deck, folder: Path) -> np.ndarray | None:
    """Displacements of the shown nodes by CalculiX's static step; none if it does not solve it."""
    shown = f"*NSET, NSET=shown\n{lines_of(deck.shown)}"
    step = f"*STEP\n*STATIC\n{deck.loading}*NODE PRINT, NSET=shown\nU\n*END STEP\n"
    printed = calculix(folder, "static", deck.mesh + shown + deck.joins + step)
    rows = [re.search(rf"^ +{node} +(\S+) +(\S+) +(\S+)", printed, re.MULTILINE) for node in deck.shown]
    return None if None in rows else np.array([[float(word) for word in row.groups()] for row in rows if row]).ravel()


def look_at(deck: Deck, folder: Path) -> tuple[str, str]:
    """How a deck ends, and what there is to say of it."""
    expected = expected_of(deck, folder)
    if expected is None:
        return "CalculiX gave up", ""
    joins = "*BOUNDARY\ncorner, 1, 3\n" if deck.join == "cyclic job" else deck.joins
    calculix(folder, "m", f"{deck.mesh}{joins}*STEP\n*FREQUENCY, SOLVER=MATRIXSTORAGE\n1\n*END STEP\n")
    (folder / "load.inp").write_text(deck.loading)
    try:
        import_model(folder / "model.h5", calculix_job=folder / "m", mesh=folder / "m.inp")
        attrito.run(deck.job(), folder=folder, quiet=True).close()
    except (InputError, NumericsError) as error:
        return "refused", str(error).replace(str(folder), "")
    with Result(folder / "result.h5") as result:
        found = np.array([result.array(f"/monitors/{one['name']}/mean")[0] for one in deck.job()["output"]["monitors"]])
        said = result.attribute("warnings")
    error = float(np.abs(found - expected).max() / np.abs(expected).max())
    if error <= SAME:
        return "equal", f"{error:.1e}"
    return ("warned" if "lack" in said else "silent"), f"{error:.1e} {said}"


def main() -> None:
    """Look, report."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--decks", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="number of the first deck")
    arguments = parser.parse_args()
    ends: Counter[str] = Counter()
    by: dict[str, Counter[str]] = {}
    reasons: Counter[str] = Counter()
    for number in range(arguments.first, arguments.first + arguments.decks):
        deck = Deck(arguments.seed, number)
        with tempfile.TemporaryDirectory() as folder:
            end, said = look_at(deck, Path(folder))
        ends[end] += 1
        for key in (deck.kind, deck.join, deck.load):
            by.setdefault(key, Counter())[end] += 1
        if end == "refused":
            reasons[re.sub(r"[\d.]+(e[-+]?\d+)?", "#", said)[:200]] += 1
        line = f"{number} {deck.kind}, {deck.join}, {deck.load}: {end} {said}"
        print(line, file=sys.stderr, flush=True)
    common.report({"decks": dict(ends), "silent": ends["silent"], "by": {k: dict(v) for k, v in by.items()}} | {
        "reasons": dict(reasons)
    })  # fmt: skip


if __name__ == "__main__":
    main()
