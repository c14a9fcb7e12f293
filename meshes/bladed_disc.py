r"""One sector of a bladed disc with shrouds: mesh, CalculiX matrices and, if asked for, CalculiX's cyclic frequencies.

    python meshes/bladed_disc.py --sectors 24 --size default --out out/bladed_disc

leaves in the folder

    bladed_disc.inp               mesh and node sets
    bladed_disc.sti .mas .dof     stiffness, mass and dof numbering, written by CalculiX
    bladed_disc_frequencies.dat   with --diameters K: its `*CYCLIC SYMMETRY MODEL` up to K nodal diameters

With --whole the model is the wheel, to compare a sector with.

The rotation axis is z; the sector lies about the x axis, the next one is it turned by +2 pi / N about z. Units are mm,
t, s. Seen along the axis, and from outside::

           shroud                r = 246              |   /-------/ shroud_a of this sector,
        +----------+             r = 240              |  /       /  shroud_b of the next
            |  |                                      | /-------/
            |  | blade                            z = 0 ->  slanted by 35 degrees
            |  |
      +-----+--+-----+ rim       r = 150
       \            /
        \   disc   /  low, high: the cuts
         \________/
            bore                 r = 60, held

The blade turns into the shroud's slant over its height. The shrouds of neighbours touch, without a gap: their faces are
one another's image, so node meets node. Elements are 20-node bricks in a structured mesh.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from bodies import Scene, make_model

BORE, RIM, TIP, TOP = 60.0, 150.0, 240.0, 246.0
BLADE, CHORD, RIM_WIDTH, WEB_WIDTH = 4.0, 30.0, 40.0, 18.0
SLANT = np.tan(np.radians(35.0))
MODES = 8
MARGIN = 1.0e-6
# Corners of a brick, then the middles of its edges at the bottom, at the top and upright, on a lattice of half steps
CORNERS = ((0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2))
EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))


@dataclass(frozen=True)
class MeshSize:
    """Numbers of bricks.

    Parameters
    ----------
    disc, blade, shroud : along the radius
    beside, thickness : round the axis on each side of the blade, and through it; of 24 sectors
    overhang, chord : along the axis before and behind the blade, and along it
    """

    disc: int
    blade: int
    shroud: int
    beside: int
    thickness: int
    overhang: int
    chord: int


SIZES = {
    "coarse": MeshSize(disc=3, blade=5, shroud=1, beside=1, thickness=1, overhang=1, chord=2),
    "default": MeshSize(disc=4, blade=44, shroud=2, beside=11, thickness=3, overhang=1, chord=4),
}


class Lattice:
    """The structured mesh: half steps along radius, circumference and axis, and where they are."""

    def __init__(self, size: MeshSize, sectors: int, shroud: bool):
        self.sectors = sectors
        radii = [(BORE, RIM, size.disc), (RIM, TIP, size.blade), (TIP, TOP, size.shroud)]
        # As many as keep bricks of few sectors from growing long.
        beside = max(size.beside, round(size.beside * 24 / sectors))
        # Circumference: -2 and 2 the cuts, -1 to 1 the blade; axis: -1 to 1 the chord.
        around = [(-2.0, -1.0, beside), (-1.0, 1.0, size.thickness), (1.0, 2.0, beside)]
        along = [(-2.0, -1.0, size.overhang), (-1.0, 1.0, size.chord), (1.0, 2.0, size.overhang)]
        self.axes = [half_steps(spans) for spans in (radii, around, along)]
        r, u, w = (axis[1::2] for axis in self.axes)
        blade, chord = np.abs(u) < 1.0, np.abs(w) < 1.0
        self.present = np.zeros((len(r), len(u), len(w)), dtype=bool)
        self.present[r < RIM] = True
        self.present[np.ix_((r > RIM) & (r < TIP), blade, chord)] = True
        self.present[np.ix_(r > TIP, np.full(len(u), shroud) | blade, chord)] = True

    def places(self, index: np.ndarray) -> np.ndarray:
        """Coordinates `[n, 3]` of lattice points `[n, 3]`."""
        r, u, w = (axis[index[:, i]] for i, axis in enumerate(self.axes))
        # Straight lines from the blade's sides to the cuts.
        side, share = BLADE / 2.0 * np.clip(u, -1.0, 1.0), np.clip(np.abs(u) - 1.0, 0.0, 1.0) * np.sign(u)
        arc = side + share * (np.pi * r / self.sectors - BLADE / 2.0)
        height = np.clip((r - RIM) / (TIP - RIM), 0.0, 1.0)
        web = np.clip(np.sin(np.pi * (r - BORE) / (RIM - BORE)), 0.0, 1.0) * (r < RIM)
        width = RIM_WIDTH - (RIM_WIDTH - WEB_WIDTH) * web
        chord = CHORD * width / RIM_WIDTH
        z = chord / 2.0 * np.clip(w, -1.0, 1.0)
        z += np.clip(np.abs(w) - 1.0, 0.0, 1.0) * np.sign(w) * (width - chord) / 2.0
        angle = (arc + SLANT * height * z) / r
        return np.column_stack([r * np.cos(angle), r * np.sin(angle), z])


def half_steps(spans: list[tuple[float, float, int]]) -> np.ndarray:
    """Ends and middles of steps: of spans one after the other, each from, to, and how many steps."""
    parts = [np.linspace(first, last, 2 * count + 1)[:-1] for first, last, count in spans]
    return np.concatenate([*parts, [spans[-1][1]]])


def make_scene(size: MeshSize, sectors: int, shroud: bool) -> Scene:
    """The mesh and its node sets."""
    lattice = Lattice(size, sectors, shroud)
    corners = np.array(CORNERS)
    offsets = np.vstack([corners, [(corners[a] + corners[b]) // 2 for a, b in EDGES]])
    points = 2 * np.argwhere(lattice.present)[:, None, :] + offsets
    index, rows = np.unique(points.reshape(-1, 3), axis=0, return_inverse=True)
    r, u, w = (axis[index[:, i]] for i, axis in enumerate(lattice.axes))
    # Nodes that are held need no partner.
    cut, ring = (r > BORE) & (r <= RIM), r >= TIP
    edge = np.flatnonzero((u == 1.0) & (w == 1.0))
    sets = {
        "low": np.flatnonzero(cut & (u == -2.0)),
        "high": np.flatnonzero(cut & (u == 2.0)),
        "bore": np.flatnonzero(r == BORE),
        "tip": edge[[np.argmin(np.abs(r[edge] - TIP))]],
    }
    if shroud:
        sets |= {"shroud_a": np.flatnonzero(ring & (u == 2.0)), "shroud_b": np.flatnonzero(ring & (u == -2.0))}
    return Scene(lattice.places(index), {"sector": rows.reshape(-1, 20)}, {}, sets)


def make_wheel(sector: Scene, sectors: int) -> Scene:
    """All sectors: joined at their cuts, with node sets `tip_3`, `shroud_a_3`, ... of each, numbered from 0."""
    count = len(sector.coordinates)
    radius = np.hypot(*sector.coordinates[:, :2].T)
    angle = np.arctan2(*sector.coordinates[:, 1::-1].T)
    disc = np.flatnonzero(radius <= RIM + MARGIN)
    # Both cuts hold their nodes in the same order.
    low, high = (disc[np.abs(angle[disc] - way * np.pi / sectors) * radius[disc] < MARGIN] for way in (-1, 1))
    number = np.arange(sectors * count).reshape(sectors, count)
    for j in range(sectors):
        number[j, high] = number[(j + 1) % sectors, low]
    kept, rows = np.unique(number, return_inverse=True)
    rows = rows.reshape(number.shape)
    turns = (2 * np.pi * j / sectors for j in range(sectors))
    axes = (np.array([[np.cos(t), np.sin(t), 0.0], [-np.sin(t), np.cos(t), 0.0], [0.0, 0.0, 1.0]]) for t in turns)
    points = np.concatenate([sector.coordinates @ turned for turned in axes])[kept]
    sets = {"bore": np.unique(rows[:, sector.node_sets["bore"]])}
    for name in ("tip", "shroud_a", "shroud_b"):
        sets |= {f"{name}_{j}": rows[j, own] for j in range(sectors) for own in [sector.node_sets.get(name, [])]}
    cells = np.concatenate([rows[j][sector.elements["sector"]] for j in range(sectors)])
    return Scene(points, {"wheel": cells}, {}, {name: own for name, own in sets.items() if len(own)})


def steps(sectors: int, diameters: int | None) -> dict[str, str]:
    """What CalculiX is asked for: the matrices of the sector, and frequencies of the wheel by nodal diameter."""
    held = "*BOUNDARY\nbore, 1, 3\n"
    asked = {"matrices": f"{held}*STEP\n*FREQUENCY, SOLVER=MATRIXSTORAGE\n1\n*END STEP\n"}
    if diameters is not None:
        wheel = (
            "*SURFACE, NAME=cut_low, TYPE=NODE\nlow\n*SURFACE, NAME=cut_high, TYPE=NODE\nhigh\n"
            "*TIE, CYCLIC SYMMETRY, NAME=cuts, POSITION TOLERANCE=0.001\ncut_low, cut_high\n"
            f"*CYCLIC SYMMETRY MODEL, N={sectors}, NGRAPH=1, TIE=cuts, ELSET=sector\n0., 0., 0., 0., 0., 1.\n"
        )
        chosen = f"*SELECT CYCLIC SYMMETRY MODES, NMIN=0, NMAX={min(diameters, sectors // 2)}\n"
        asked["frequencies"] = f"{wheel}{held}*STEP\n*FREQUENCY\n{MODES}\n{chosen}*END STEP\n"
    return asked


def main() -> None:
    """Command line: mesh, matrices and frequencies, unless they are there already."""
    parser = argparse.ArgumentParser(description="One sector of a bladed disc: mesh, CalculiX matrices, frequencies.")
    parser.add_argument("--sectors", type=int, default=24, help="how many make the wheel (at least 3)")
    parser.add_argument("--size", choices=SIZES, default="default", help="size of the mesh")
    parser.add_argument("--shroud", action=argparse.BooleanOptionalAction, default=True, help="blades with shrouds")
    parser.add_argument("--diameters", type=int, help="also frequencies by CalculiX, up to so many nodal diameters")
    parser.add_argument("--out", type=Path, default=Path("out/bladed_disc"), help="folder for the results")
    parser.add_argument("--whole", action="store_true", help="all sectors in one model")
    arguments = parser.parse_args()
    if arguments.whole and arguments.diameters is not None:
        parser.error("--diameters: of one sector, not with --whole")
    if arguments.sectors < 3:
        parser.error("at least 3 sectors")
    scene = make_scene(SIZES[arguments.size], arguments.sectors, arguments.shroud)
    products = {f"matrices.{kind}": f"bladed_disc.{kind}" for kind in ("sti", "mas", "dof")}
    if arguments.diameters is not None:
        products["frequencies.dat"] = "bladed_disc_frequencies.dat"
    asked = steps(arguments.sectors, arguments.diameters)
    body, title = "sector", "A sector of a bladed disc"
    if arguments.whole:
        body, title, scene = "wheel", "A bladed disc", make_wheel(scene, arguments.sectors)
    make_model(arguments.out, "bladed_disc", title, scene, [body], None, asked, products)


if __name__ == "__main__":
    main()
