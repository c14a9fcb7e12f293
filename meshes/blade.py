"""A turbine-like blade in its disc slot: mesh, CalculiX matrices and CalculiX's own frequencies.

    python meshes/blade.py --size default --out out/blade

leaves in the folder

    blade.inp                 mesh and node sets
    blade.sti .mas .dof       stiffness, mass and dof numbering, written by CalculiX
    blade_frequencies.dat     CalculiX's own frequencies of the same model

Blade and disc are two bodies: every node of a flank exists twice at one position, once for each body. The blade is
held by contact alone (six rigid motions in the matrices); the disc sector is fixed at its bottom and both sides.
Units are mm, t, s, so forces are N and stresses MPa. Rotation axis: the y axis; z is radial.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import meshio
import numpy as np
from blade_geometry import DISC_BOTTOM, SECTOR_SLOPE, SIZES, TIP, geometry_script

YOUNG_MODULUS = 210000.0
POISSON_RATIO = 0.3
DENSITY = 7.85e-9
FREQUENCIES = 16

MATERIAL = f"""\
*INCLUDE, INPUT=blade.inp
*MATERIAL, NAME=steel
*ELASTIC
{YOUNG_MODULUS}, {POISSON_RATIO}
*DENSITY
{DENSITY}
*SOLID SECTION, ELSET=blade, MATERIAL=steel
*SOLID SECTION, ELSET=disc, MATERIAL=steel
*BOUNDARY
disc_fixed, 1, 3
*STEP
"""
MATRICES_DECK = MATERIAL + "*FREQUENCY, SOLVER=MATRIXSTORAGE\n1\n*END STEP\n"
FREQUENCIES_DECK = MATERIAL + f"*FREQUENCY\n{FREQUENCIES}\n*END STEP\n"
PRODUCTS = {
    "matrices.sti": "blade.sti",
    "matrices.mas": "blade.mas",
    "matrices.dof": "blade.dof",
    "frequencies.dat": "blade_frequencies.dat",
}


@dataclass(frozen=True)
class Scene:
    """Both bodies, their flank nodes doubled.

    Parameters
    ----------
    coordinates : [N, 3], mm; the node's id is its row + 1
    elements : connectivity [E, 10] of body `blade` and of body `disc`, rows of `coordinates`, CalculiX order
    node_sets : rows of `coordinates` by name
    """

    coordinates: np.ndarray
    elements: dict[str, np.ndarray]
    node_sets: dict[str, np.ndarray]


def run(command: list[str], folder: Path) -> None:
    """Run a program in a folder; on failure stop with the end of what it said."""
    try:
        result = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        sys.exit(f"{command[0]} is not installed")
    # CalculiX reports some faults with exit code 0.
    if result.returncode != 0 or "*ERROR" in result.stdout:
        said = result.stdout[-1000:] + result.stderr[-1000:]
        sys.exit(f"{' '.join(command)} failed ({result.returncode}):\n{said}")


def mesh_bodies(script: str, folder: Path) -> meshio.Mesh:
    """Mesh the geometry script with second-order tetrahedra."""
    (folder / "blade.geo").write_text(script)
    run(["gmsh", "-3", "-order", "2", "-format", "msh22", "blade.geo", "-o", "blade.msh"], folder)
    return meshio.read(folder / "blade.msh")


def part_bodies(mesh: meshio.Mesh) -> Scene:
    """Double the nodes that blade and disc share, and name the node sets."""
    blade_tag, disc_tag = (int(mesh.field_data[name][0]) for name in ("blade", "disc"))
    cells = mesh.cells_dict["tetra10"]
    tags = mesh.cell_data_dict["gmsh:physical"]["tetra10"]
    blade, disc = cells[tags == blade_tag], cells[tags == disc_tag]

    shared = np.intersect1d(blade, disc)
    twin = np.arange(len(mesh.points))
    twin[shared] = len(mesh.points) + np.arange(len(shared))
    disc = twin[disc]

    # Numbers without gaps: gmsh also lists nodes that no tetrahedron uses.
    used, renumbered = np.unique(np.concatenate([blade.ravel(), disc.ravel()]), return_inverse=True)
    coordinates = np.concatenate([mesh.points, mesh.points[shared]])[used]
    blade, disc = renumbered[: blade.size].reshape(blade.shape), renumbered[blade.size :].reshape(disc.shape)
    root, slot = np.searchsorted(used, shared), np.searchsorted(used, twin[shared])
    return Scene(coordinates, {"blade": blade, "disc": disc}, node_sets(coordinates, root, slot, np.unique(disc)))


def node_sets(coordinates: np.ndarray, root: np.ndarray, slot: np.ndarray, disc: np.ndarray) -> dict[str, np.ndarray]:
    """Node sets (rows of `coordinates`), found by position."""
    x, y, z = coordinates.T
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


def write_inp(path: Path, scene: Scene) -> None:
    """Write the mesh in CalculiX's format."""
    lines = ["** Blade in its disc slot; mm, t, s", "*NODE"]
    lines += [f"{k}, {x:.12g}, {y:.12g}, {z:.12g}" for k, (x, y, z) in enumerate(scene.coordinates.tolist(), start=1)]
    element = 0
    for body, connectivity in scene.elements.items():
        lines.append(f"*ELEMENT, TYPE=C3D10, ELSET={body}")
        for nodes in (connectivity + 1).tolist():
            element += 1
            lines.append(", ".join(map(str, [element, *nodes])))
    for name, rows in scene.node_sets.items():
        lines.append(f"*NSET, NSET={name}")
        ids = (rows + 1).tolist()
        lines += [", ".join(map(str, ids[k : k + 8])) for k in range(0, len(ids), 8)]
    path.write_text("\n".join(lines) + "\n")


def main() -> None:
    """Command line: mesh, matrices and frequencies, unless they are there already."""
    parser = argparse.ArgumentParser(description="Blade in its disc slot: mesh, CalculiX matrices and frequencies.")
    parser.add_argument("--size", choices=SIZES, default="default", help="size of the mesh")
    parser.add_argument("--out", type=Path, default=Path("out/blade"), help="folder for the results")
    arguments = parser.parse_args()

    script = geometry_script(SIZES[arguments.size])
    sources = [script, MATRICES_DECK, FREQUENCIES_DECK, Path(__file__).read_text()]
    stamp = hashlib.sha256("\0".join(sources).encode()).hexdigest()
    stamp_file = arguments.out / "blade.stamp"
    products = [arguments.out / name for name in ("blade.inp", *PRODUCTS.values())]
    if stamp_file.exists() and stamp_file.read_text() == stamp and all(path.exists() for path in products):
        return

    arguments.out.mkdir(parents=True, exist_ok=True)
    stamp_file.unlink(missing_ok=True)
    with tempfile.TemporaryDirectory(dir=arguments.out) as name:
        folder = Path(name)
        scene = part_bodies(mesh_bodies(script, folder))
        write_inp(folder / "blade.inp", scene)
        (folder / "matrices.inp").write_text(MATRICES_DECK)
        (folder / "frequencies.inp").write_text(FREQUENCIES_DECK)
        for job in ("matrices", "frequencies"):
            run(["ccx", "-i", job], folder)
        for product, final in {**PRODUCTS, "blade.inp": "blade.inp"}.items():
            os.replace(folder / product, arguments.out / final)
    stamp_file.write_text(stamp)

    sizes = ", ".join(f"{name} {len(rows)}" for name, rows in scene.node_sets.items())
    elements = sum(len(connectivity) for connectivity in scene.elements.values())
    print(f"{len(scene.coordinates)} nodes, {elements} C3D10 elements; node sets: {sizes}")


if __name__ == "__main__":
    main()
