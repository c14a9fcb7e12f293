"""From a gmsh script of touching bodies to CalculiX matrices: what the geometry scripts of this folder share.

Bodies that touch share their faces in gmsh's mesh. Here every body gets its own copy of the nodes there, so that the
bodies hang together by nothing, and contact pairs find two nodes at one place.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import meshio
import numpy as np

STEEL = """\
*MATERIAL, NAME=steel
*ELASTIC
210000.0, 0.3
*DENSITY
7.85e-9
"""


@dataclass(frozen=True)
class Scene:
    """Bodies that touch, with nodes of their own.

    Parameters
    ----------
    coordinates : [N, 3], mm; the node's id is its row + 1
    elements : connectivity [E, 10] or [E, 20] by body, rows of `coordinates`, CalculiX order
    touching : for a pair of bodies meshed together the rows of nodes that coincide, ascending in those of the first
    node_sets : rows of `coordinates` by name
    """

    coordinates: np.ndarray
    elements: dict[str, np.ndarray]
    touching: dict[tuple[str, str], tuple[np.ndarray, np.ndarray]]
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
    (folder / "bodies.geo").write_text(script)
    run(["gmsh", "-3", "-order", "2", "-format", "msh22", "bodies.geo", "-o", "bodies.msh"], folder)
    return meshio.read(folder / "bodies.msh")


def part_bodies(mesh: meshio.Mesh, names: list[str]) -> Scene:
    """Give each body (a physical volume) its own nodes."""
    cells = mesh.cells_dict["tetra10"]
    tags = mesh.cell_data_dict["gmsh:physical"]["tetra10"]
    points, elements, used = [], {}, {}
    count = 0
    for name in names:
        own = cells[tags == int(mesh.field_data[name][0])]
        used[name], rows = np.unique(own, return_inverse=True)
        elements[name] = count + rows.reshape(own.shape)
        points.append(mesh.points[used[name]])
        count += len(used[name])
    first = dict(zip(names, np.cumsum([0, *map(len, points[:-1])]), strict=True))
    touching = {}
    for i, a in enumerate(names):
        for b in names[i + 1 :]:
            _, in_a, in_b = np.intersect1d(used[a], used[b], assume_unique=True, return_indices=True)
            if len(in_a):
                touching[a, b] = first[a] + in_a, first[b] + in_b
    return Scene(np.concatenate(points), elements, touching, {})


def joined(scenes: list[Scene]) -> Scene:
    """Bodies meshed each by itself as one scene; their nodes coincide by chance only."""
    elements: dict[str, np.ndarray] = {}
    first = 0
    for scene in scenes:
        elements |= {name: first + cells for name, cells in scene.elements.items()}
        first += len(scene.coordinates)
    return Scene(np.concatenate([scene.coordinates for scene in scenes]), elements, {}, {})


def write_inp(path: Path, scene: Scene, title: str) -> None:
    """Write the mesh in CalculiX's format, all of its bodies of steel."""
    lines = [f"** {title}; mm, t, s", "*NODE"]
    lines += [f"{k}, {x:.12g}, {y:.12g}, {z:.12g}" for k, (x, y, z) in enumerate(scene.coordinates.tolist(), start=1)]
    element = 0
    for body, connectivity in scene.elements.items():
        lines.append(f"*ELEMENT, TYPE=C3D{connectivity.shape[1]}, ELSET={body}")
        for nodes in (connectivity + 1).tolist():
            element += 1
            # Sixteen numbers a line at most.
            numbers = list(map(str, [element, *nodes]))
            lines += [", ".join(part) + "," * (len(numbers) > 16) for part in (numbers[:16], numbers[16:]) if part]
    for name, rows in scene.node_sets.items():
        lines.append(f"*NSET, NSET={name}")
        ids = (rows + 1).tolist()
        lines += [", ".join(map(str, ids[k : k + 8])) for k in range(0, len(ids), 8)]
    lines += [STEEL.rstrip(), *(f"*SOLID SECTION, ELSET={body}, MATERIAL=steel" for body in scene.elements)]
    path.write_text("\n".join(lines) + "\n")


def centrifugal(bodies: list[str], speed_hz: float) -> str:
    """CalculiX's load of a rotation about the y axis."""
    omega_squared = (2 * np.pi * speed_hz) ** 2
    return "*DLOAD\n" + "".join(f"{body}, CENTRIF, {omega_squared:.13g}, 0., 0., 0., 0., 1., 0.\n" for body in bodies)


def make_model(
    out: Path,
    name: str,
    title: str,
    script: str | dict[str, str] | Scene,
    bodies: list[str],
    node_sets: Callable[[Scene], dict[str, np.ndarray]] | None,
    steps: dict[str, str],
    products: dict[str, str],
    loads: dict[str, Callable[[Scene], str]] | None = None,
) -> None:
    """Mesh, matrices and whatever else CalculiX is asked for, unless they are there already.

    Parameters
    ----------
    out, name : folder, and first part of the names in it
    title : comment of the mesh file
    script : gmsh script with a physical volume for each of `bodies`; or one a body, whose meshes then do not match; or
        the mesh itself
    node_sets : finds the node sets of a scene; None where it has them
    steps : CalculiX jobs by name, from their boundary conditions on
    products : what to keep: CalculiX's file (`matrices.sti`) -> its name in `out`
    loads : files of forces: name in `out` -> what writes its text for a scene
    """
    loads = loads or {}
    decks = {job: f"*INCLUDE, INPUT={name}.inp\n{text}" for job, text in steps.items()}
    caller = Path(sys.argv[0]).read_text() if Path(sys.argv[0]).is_file() else ""
    scripts = {"": script} if isinstance(script, str) else {} if isinstance(script, Scene) else script
    drawn = [script.coordinates.tobytes().hex()] if isinstance(script, Scene) else [*scripts.values()]
    sources = [*drawn, *decks.values(), repr(sorted(products.items())), caller, Path(__file__).read_text()]
    stamp = hashlib.sha256("\0".join(sources).encode()).hexdigest()
    stamp_file = out / f"{name}.stamp"
    kept = [out / product for product in (f"{name}.inp", *products.values(), *loads)]
    if stamp_file.exists() and stamp_file.read_text() == stamp and all(path.exists() for path in kept):
        return

    out.mkdir(parents=True, exist_ok=True)
    stamp_file.unlink(missing_ok=True)
    with tempfile.TemporaryDirectory(dir=out) as scratch:
        folder = Path(scratch)
        if isinstance(script, Scene):
            scene = script
        else:
            parts = [(mesh_bodies(text, folder), [body] if body else bodies) for body, text in scripts.items()]
            meshed = [part_bodies(mesh, names) for mesh, names in parts]
            scene = meshed[0] if isinstance(script, str) else joined(meshed)
        if node_sets is not None:
            scene.node_sets.update(node_sets(scene))
        write_inp(folder / f"{name}.inp", scene, title)
        for job, deck in decks.items():
            (folder / f"{job}.inp").write_text(deck)
            run(["ccx", "-i", job], folder)
        for file, text_of in loads.items():
            (folder / file).write_text(text_of(scene))
        for product, final in {**products, **{file: file for file in (f"{name}.inp", *loads)}}.items():
            os.replace(folder / product, out / final)
    stamp_file.write_text(stamp)

    sizes = ", ".join(f"{set_name} {len(rows)}" for set_name, rows in scene.node_sets.items())
    elements = sum(len(connectivity) for connectivity in scene.elements.values())
    kind = next(iter(scene.elements.values())).shape[1]
    print(f"{len(scene.coordinates)} nodes, {elements} C3D{kind} elements; node sets: {sizes}")
