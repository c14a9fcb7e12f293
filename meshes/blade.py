"""A turbine-like blade in its disc slot: mesh, CalculiX matrices and CalculiX's own frequencies.

    python meshes/blade.py --size default --out out/blade [--spin-hz 100]

leaves in the folder

    blade.inp                 mesh and node sets
    blade.sti .mas .dof       stiffness, mass and dof numbering, written by CalculiX
    blade_frequencies.dat     CalculiX's own frequencies of the same model

Blade and disc are two bodies: every node of a flank exists twice at one position, once for each body. The blade is
held by contact alone (six rigid motions in the matrices); the disc sector is fixed at its bottom and both sides.
Units are mm, t, s, so forces are N and stresses MPa. Rotation axis: the y axis; z is radial.

With a speed the stiffness holds the stress stiffening of a static step at that speed, and no spin softening. In that
step both sides of the flanks are held, since nothing else holds the blade: the stress near the flanks is that of a
clamped root, above the platform it is what any root gives. The frequencies are then those with the flanks held and
with CalculiX's own spin softening.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from blade_geometry import DISC_BOTTOM, SECTOR_SLOPE, SIZES, TIP, geometry_script
from bodies import Scene, centrifugal, make_model

FREQUENCIES = 16
BODIES = ["blade", "disc"]
FLANKS = ("root_left", "root_right", "slot_left", "slot_right")

HELD = "*BOUNDARY\ndisc_fixed, 1, 3\n"
FREED = "*BOUNDARY, OP=NEW\ndisc_fixed, 1, 3\n"
CLAMPED = HELD + "".join(f"{name}, 1, 3\n" for name in FLANKS)
MATRICES = "*FREQUENCY, SOLVER=MATRIXSTORAGE\n1\n"
OWN_FREQUENCIES = f"*FREQUENCY\n{FREQUENCIES}\n"
PRODUCTS = {
    "matrices.sti": "blade.sti",
    "matrices.mas": "blade.mas",
    "matrices.dof": "blade.dof",
    "frequencies.dat": "blade_frequencies.dat",
}


def steps(speed_hz: float) -> dict[str, str]:
    """What CalculiX is asked for: matrices and frequencies, at rest or after a static step of rotation."""
    if speed_hz == 0.0:
        return {
            "matrices": f"{HELD}*STEP\n{MATRICES}*END STEP\n",
            "frequencies": f"{HELD}*STEP\n{OWN_FREQUENCIES}*END STEP\n",
        }
    static = f"{CLAMPED}*STEP\n*STATIC\n{centrifugal(BODIES, speed_hz)}*END STEP\n*STEP, PERTURBATION\n"
    return {
        # Without the load in the step of the matrices CalculiX leaves its spin softening out.
        "matrices": f"{static}{MATRICES}{FREED}*DLOAD, OP=NEW\n*END STEP\n",
        "frequencies": f"{static}{OWN_FREQUENCIES}*END STEP\n",
    }


def node_sets(scene: Scene) -> dict[str, np.ndarray]:
    """Node sets (rows of `coordinates`), found by position."""
    x, y, z = scene.coordinates.T
    root, slot = scene.touching["blade", "disc"]
    disc = np.unique(scene.elements["disc"])
    margin = 1.0e-4
    sides = np.abs(np.abs(x[disc]) - SECTOR_SLOPE * z[disc]) < margin
    bottom = np.abs(z[disc] - DISC_BOTTOM) < margin
    tip = np.flatnonzero(np.abs(z - TIP) < margin)
    # The trailing edge moves in bending as well as in torsion.
    tip_node = tip[[np.argmax(y[tip])]]
    return {
        "root_left": np.sort(root[x[root] < 0.0]),
        "root_right": np.sort(root[x[root] > 0.0]),
        "slot_left": np.sort(slot[x[slot] < 0.0]),
        "slot_right": np.sort(slot[x[slot] > 0.0]),
        "disc_fixed": disc[sides | bottom],
        "tip": tip,
        "tip_node": tip_node,
    }


def main() -> None:
    """Command line: mesh, matrices and frequencies, unless they are there already."""
    parser = argparse.ArgumentParser(description="Blade in its disc slot: mesh, CalculiX matrices and frequencies.")
    parser.add_argument("--size", choices=SIZES, default="default", help="size of the mesh")
    parser.add_argument("--out", type=Path, default=Path("out/blade"), help="folder for the results")
    parser.add_argument("--spin-hz", type=float, default=0.0, help="speed of the stress stiffening (default: none)")
    arguments = parser.parse_args()
    script = geometry_script(SIZES[arguments.size])
    title = "Blade in its disc slot"
    make_model(arguments.out, "blade", title, script, BODIES, node_sets, steps(arguments.spin_hz), PRODUCTS)


if __name__ == "__main__":
    main()
