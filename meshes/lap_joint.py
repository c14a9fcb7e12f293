r"""A bolted lap joint of two plates: mesh, CalculiX matrices and the pressure of the bolt.

    python meshes/lap_joint.py --size default --out out/lap_joint

leaves in the folder

    lap_joint.inp             mesh and node sets
    lap_joint.sti .mas .dof   stiffness, mass and dof numbering, written by CalculiX
    bolt.inp                  the bolt's force of 1 kN, a pressure on both washers' rings

Axes: x along the plates, y across, z through the thickness; the plates touch on z = 0. Units are mm, t, s. The lower
plate is held at its left end; contact alone holds the upper one::

                                 1 kN
    x = -85         -30          | |          30        85
                     ============| |====================    upper plate, z = 0 to 5
     |===========================| |==========              lower plate, z = -5 to 0
                                 | |
                                 1 kN

The bolt has no body of its own: it is the pressure on a ring about the hole, the same on both outer faces. It closes
the joint about the hole; as the plates bend under it, the rest of the overlap opens.

Node sets: `lower_face` and `upper_face`, the overlap's two sides, node on node; `clamped`; `tip`, one node at the free
end, in the middle of its upper edge.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from blade_geometry import GeoScript
from bodies import Scene, make_model

LENGTH, WIDTH, THICKNESS = 115.0, 30.0, 5.0
OVERLAP = 60.0
HOLE, WASHER = 4.5, 9.0  # radii: an M8 bolt's clearance hole and its washer
BOLT = 1000.0  # N
BODIES = ["lower", "upper"]
MARGIN = 1.0e-3
# Faces of a tetrahedron in CalculiX's numbering, by the rows of their corners.
FACES = ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0))

STEPS = {"matrices": "*BOUNDARY\nclamped, 1, 3\n*STEP\n*FREQUENCY, SOLVER=MATRIXSTORAGE\n1\n*END STEP\n"}
PRODUCTS = {f"matrices.{kind}": f"lap_joint.{kind}" for kind in ("sti", "mas", "dof")}


@dataclass(frozen=True)
class MeshSize:
    """Element sizes of one mesh.

    Parameters
    ----------
    plate : largest edge away from the overlap, mm
    overlap : edge on the overlap's two sides, mm
    around : second-order triangles' edges around hole and washer
    """

    plate: float
    overlap: float
    around: int


SIZES = {
    "coarse": MeshSize(plate=30.0, overlap=30.0, around=5),
    "default": MeshSize(plate=12.0, overlap=15.0, around=7),
    "fine": MeshSize(plate=8.0, overlap=8.0, around=10),
}


def geometry_script(size: MeshSize) -> str:
    """The gmsh script: plates with a hole each, cut along the washer's cylinder, that share the overlap."""
    script = GeoScript()
    ends = {"lower": (OVERLAP / 2 - LENGTH, -THICKNESS), "upper": (-OVERLAP / 2, 0.0)}
    for number, (name, (x, z)) in enumerate(ends.items()):
        box, hole, washer, disc = (10 * number + k for k in range(1, 5))
        for tag, radius in ((hole, HOLE), (washer, WASHER), (disc, HOLE)):
            script.add(f"Cylinder({tag}) = {{0, 0, {z:.12g}, 0, 0, {THICKNESS:.12g}, {radius:.12g}}};")
        corner = f"{x:.12g}, {-WIDTH / 2:.12g}, {z:.12g}"
        script.add(f"Box({box}) = {{{corner}, {LENGTH:.12g}, {WIDTH:.12g}, {THICKNESS:.12g}}};")
        script.add(f"plate() = BooleanDifference{{ Volume{{{box}}}; Delete; }}{{ Volume{{{hole}}}; Delete; }};")
        script.add(f"ring() = BooleanDifference{{ Volume{{{washer}}}; Delete; }}{{ Volume{{{disc}}}; Delete; }};")
        script.add(f"{name}() = BooleanFragments{{ Volume{{plate()}}; Delete; }}{{ Volume{{ring()}}; Delete; }};")
    script.add("all() = BooleanFragments{ Volume{lower()}; Delete; }{ Volume{upper()}; Delete; };")
    for name, low in (("lower", -THICKNESS), ("upper", 0.0)):
        script.add(f"own() = Volume In BoundingBox{{{box_of(LENGTH, WIDTH, low, low + THICKNESS)}}};")
        script.add(f'Physical Volume("{name}") = {{own()}};')
    script.add(f"Characteristic Length {{ PointsOf{{ Volume{{:}}; }} }} = {size.plate:.12g};")
    script.add(f"corner() = Point In BoundingBox{{{box_of(OVERLAP / 2, WIDTH, -THICKNESS, THICKNESS)}}};")
    script.add(f"Characteristic Length {{ corner() }} = {size.overlap:.12g};")
    for level in (-THICKNESS, 0.0, THICKNESS):
        for radius in (WASHER, HOLE):
            script.add(f"circle() = Curve In BoundingBox{{{box_of(radius, 2 * radius, level, level)}}};")
            script.add(f"Transfinite Curve {{circle()}} = {size.around + 1};")
    script.add(f"Mesh.CharacteristicLengthMax = {size.plate:.12g};")
    script.add("Mesh.SecondOrderLinear = 1;")
    script.add("Mesh.Optimize = 1;")
    return "\n".join(script.lines) + "\n"


def box_of(half_length: float, width: float, low: float, high: float) -> str:
    """A bounding box about the bolt's axis, a little larger, in gmsh's order."""
    lower = (-half_length - MARGIN, -width / 2 - MARGIN, low - MARGIN)
    upper = (half_length + MARGIN, width / 2 + MARGIN, high + MARGIN)
    return ", ".join(f"{value:.12g}" for value in lower + upper)


def node_sets(scene: Scene) -> dict[str, np.ndarray]:
    """Node sets (rows of `coordinates`), found by position."""
    x, y, z = scene.coordinates.T
    lower, upper = scene.touching["lower", "upper"]
    tip = np.flatnonzero((x > x.max() - MARGIN) & (z > THICKNESS - MARGIN))
    return {
        "lower_face": lower,
        "upper_face": upper,
        "clamped": np.flatnonzero(x < x.min() + MARGIN),
        "tip": tip[[np.argmin(np.abs(y[tip]))]],
    }


def washer_faces(scene: Scene) -> list[tuple[int, int, float]]:
    """Element, face (both as CalculiX counts them) and area of what lies under the washers."""
    found, first = [], 1
    for body, level in (("lower", -THICKNESS), ("upper", THICKNESS)):
        corners = scene.coordinates[scene.elements[body][:, :4]]
        for face, rows in enumerate(FACES, start=1):
            points = corners[:, rows]
            radius = np.hypot(points[..., 0], points[..., 1])
            under = np.all((np.abs(points[..., 2] - level) < MARGIN) & (radius < WASHER + MARGIN), axis=1)
            sides = points[:, 1:] - points[:, :1]
            area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / 2
            found += [(first + int(row), face, float(area[row])) for row in np.flatnonzero(under)]
        first += len(corners)
    return found


def bolt(scene: Scene) -> str:
    """The pressure of the bolt, a `*DLOAD` list: the same pressure everywhere, its force 1 kN on each side."""
    faces = washer_faces(scene)
    pressure = 2 * BOLT / sum(area for _, _, area in faces)
    return "\n".join(["*DLOAD", *(f"{element}, P{face}, {pressure:.12g}" for element, face, _ in faces), ""])


def main() -> None:
    """Command line: mesh, matrices and bolt, unless they are there already."""
    parser = argparse.ArgumentParser(description="A bolted lap joint: mesh, CalculiX matrices and the bolt's pressure.")
    parser.add_argument("--size", choices=SIZES, default="default", help="size of the mesh")
    parser.add_argument("--out", type=Path, default=Path("out/lap_joint"), help="folder for the results")
    arguments = parser.parse_args()
    script = geometry_script(SIZES[arguments.size])
    title = "A bolted lap joint of two plates"
    loads = {"bolt.inp": bolt}
    make_model(arguments.out, "lap_joint", title, script, BODIES, node_sets, STEPS, PRODUCTS, loads)


if __name__ == "__main__":
    main()
