"""A steel block that stands on its underside: mesh of bricks and CalculiX matrices.

    python meshes/block.py --out out/block

leaves block.inp, block.sti .mas .dof, and press.inp, the pressure on its top: 10 kN in all, more to one end than to the
other. 100 x 75 x 50 mm (x, y, z), lower face at z = 0; nothing holds it but what its
contacts will: its stiffness has six free motions. Units are mm, t, s.

Node sets: `foot`, the five by four nodes of the underside; `push`, one node of the top, off its centre, where the
block is shaken; `corner`, one node of the top, where one looks.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from bodies import STEEL, run

SIZE = (100.0, 75.0, 50.0)
COUNTS = (4, 3, 2)
PRESS, UNEVEN = 1.0e4, 0.6
PUSH, CORNER = (2, 1, 2), (4, 3, 2)
# Corners of a brick in CalculiX's order.
BRICK = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))


def deck() -> str:
    """The input file of CalculiX, whose only step writes the matrices."""
    ends = [count + 1 for count in COUNTS]
    number = 1 + np.arange(np.prod(ends)).reshape(ends)
    axes = [np.linspace(0.0, length, count) for length, count in zip(SIZE, ends, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    bricks = [number[tuple(slice(o, o + n) for o, n in zip(at, COUNTS, strict=True))].ravel() for at in BRICK]
    sets = {
        "foot": number[:, :, 0].ravel(),
        "push": [number[PUSH]],
        "corner": [number[CORNER]],
    }
    lines = ["** A steel block, 100 x 75 x 50 mm, held by nothing; mm, t, s.", "*NODE"]
    lines += [f"{i}, {x:.12g}, {y:.12g}, {z:.12g}" for i, (x, y, z) in enumerate(points, start=1)]
    lines += ["*ELEMENT, TYPE=C3D8, ELSET=block"]
    lines += [f"{i}, {', '.join(map(str, nodes))}" for i, nodes in enumerate(zip(*bricks, strict=True), start=1)]
    for name, nodes in sets.items():
        lines += [f"*NSET, NSET={name}", *(f"{node}," for node in nodes)]
    lines += [STEEL.rstrip(), "*SOLID SECTION, ELSET=block, MATERIAL=steel"]
    lines += ["*STEP", "*FREQUENCY, SOLVER=MATRIXSTORAGE", "1", "*END STEP", ""]
    return "\n".join(lines)


def pressure() -> str:
    """The pressure on the top faces, a `*DLOAD` list."""
    element = 1 + np.arange(np.prod(COUNTS)).reshape(COUNTS)[:, :, -1]
    along, across = ((2.0 * np.arange(count) + 1.0) / count - 1.0 for count in COUNTS[:2])
    values = PRESS / (SIZE[0] * SIZE[1]) * (1.0 + UNEVEN * (along[:, None] + 0.3 * across))
    rows = [f"{one}, P2, {value:.12g}" for one, value in zip(element.flat, values.flat, strict=True)]
    return "\n".join(["*DLOAD", *rows, ""])


def main() -> None:
    """Command line: mesh and matrices."""
    parser = argparse.ArgumentParser(description="A steel block: mesh and CalculiX matrices.")
    parser.add_argument("--out", type=Path, default=Path("out/block"), help="folder for the results")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    (arguments.out / "block.inp").write_text(deck())
    (arguments.out / "press.inp").write_text(pressure())
    run(["ccx", "-i", "block"], arguments.out)


if __name__ == "__main__":
    main()
