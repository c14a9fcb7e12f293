r"""A bolted lap joint of two plates: mesh, CalculiX matrices and the pressure of the bolt.

    python meshes/lap_joint.py --size default --out out/lap_joint
    python meshes/lap_joint.py --ratio 1.7 --out out/lap_joint_faces

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
end, in the middle of its upper edge. With `--ratio` the plates are meshed one by one, the lower with edges shorter by
that factor: faces meet whose meshes do not match.
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


def size_of(text: str) -> MeshSize:
    """A named size, or edges as a part of those of `default`: "0.5" halves them."""
    if text in SIZES:
        return SIZES[text]
    try:
        part = float(text)
    except ValueError:
        part = np.nan
    if not 0.0 < part <= 2.0:
        raise argparse.ArgumentTypeError(f"expected one of {', '.join(SIZES)}, or a number above 0 up to 2")
    usual = SIZES["default"]
    return MeshSize(usual.plate * part, usual.overlap * part, round(usual.around / part))


ENDS = {"lower": (OVERLAP / 2 - LENGTH, -THICKNESS), "upper": (-OVERLAP / 2, 0.0)}  # x and z of a corner


def geometry_script(size: MeshSize) -> str:
    """The gmsh script: plates with a hole each, cut along the washer's cylinder, that share the overlap."""
    script = GeoScript()
    for number, name in enumerate(BODIES):
        x, z = ENDS[name]
        add_plate(script, number, name, z, [(x, LENGTH)])
    script.add("all() = BooleanFragments{ Volume{lower()}; Delete; }{ Volume{upper()}; Delete; };")
    return finished(script, size, BODIES)


def plate_script(size: MeshSize, name: str) -> str:
    """The gmsh script of one plate, which has the overlap's edge on its face as the other plate would leave it."""
    script = GeoScript()
    x, z = ENDS[name]
    rest = (x, LENGTH - OVERLAP) if name == "lower" else (OVERLAP / 2, LENGTH - OVERLAP)
    add_plate(script, 0, name, z, [(-OVERLAP / 2, OVERLAP), rest])
    return finished(script, size, [name])


def add_plate(script: GeoScript, number: int, name: str, z: float, spans: list[tuple[float, float]]) -> None:
    """Add a plate of boxes side by side, each from an x over a length; the first has the hole."""
    first, hole, washer, disc, *others = (10 * number + k for k in range(1, 4 + len(spans)))
    boxes = [first, *others]
    for tag, radius in ((hole, HOLE), (washer, WASHER), (disc, HOLE)):
        script.add(f"Cylinder({tag}) = {{0, 0, {z:.12g}, 0, 0, {THICKNESS:.12g}, {radius:.12g}}};")
    for box, (x, length) in zip(boxes, spans, strict=True):
        corner = f"{x:.12g}, {-WIDTH / 2:.12g}, {z:.12g}"
        script.add(f"Box({box}) = {{{corner}, {length:.12g}, {WIDTH:.12g}, {THICKNESS:.12g}}};")
    script.add(f"plate() = BooleanDifference{{ Volume{{{boxes[0]}}}; Delete; }}{{ Volume{{{hole}}}; Delete; }};")
    for box in boxes[1:]:
        script.add(f"plate() = BooleanFragments{{ Volume{{plate()}}; Delete; }}{{ Volume{{{box}}}; Delete; }};")
    script.add(f"ring() = BooleanDifference{{ Volume{{{washer}}}; Delete; }}{{ Volume{{{disc}}}; Delete; }};")
    script.add(f"{name}() = BooleanFragments{{ Volume{{plate()}}; Delete; }}{{ Volume{{ring()}}; Delete; }};")


def finished(script: GeoScript, size: MeshSize, bodies: list[str]) -> str:
    """The script with the bodies' names and the sizes of their elements."""
    for name in bodies:
        low = ENDS[name][1]
        script.add(f"own() = Volume In BoundingBox{{{box_of(LENGTH, WIDTH, low, low + THICKNESS)}}};")
        script.add(f'Physical Volume("{name}") = {{own()}};')
    script.add(f"Characteristic Length {{ PointsOf{{ Volume{{:}}; }} }} = {size.plate:.12g};")
    script.add(f"corner() = Point In BoundingBox{{{box_of(OVERLAP / 2, WIDTH, -THICKNESS, THICKNESS)}}};")
    script.add(f"Characteristic Length {{ corner() }} = {size.overlap:.12g};")
    for level in sorted({z for name in bodies for z in (ENDS[name][1], ENDS[name][1] + THICKNESS)}):
        for radius in (WASHER, HOLE):
            script.add(f"circle() = Curve In BoundingBox{{{box_of(radius, 2 * radius, level, level)}}};")
            script.add(f"Transfinite Curve {{circle()}} = {size.around + 1};")
    script.add(f"Mesh.CharacteristicLengthMax = {size.plate:.12g};")
    script.add("Mesh.SecondOrderLinear = 1;")
    script.add("Mesh.Optimize = 1;")
    return "\n".join(script.lines) + "\n"


def scripts(size: MeshSize, ratio: float) -> str | dict[str, str]:
    """One script for both plates, or one for each: the lower with edges shorter by the ratio."""
    if ratio == 1.0:
        return geometry_script(size)
    finer = MeshSize(size.plate / ratio, size.overlap / ratio, round(size.around * ratio))
    return {"lower": plate_script(finer, "lower"), "upper": plate_script(size, "upper")}


def box_of(half_length: float, width: float, low: float, high: float) -> str:
    """A bounding box about the bolt's axis, a little larger, in gmsh's order."""
    lower = (-half_length - MARGIN, -width / 2 - MARGIN, low - MARGIN)
    upper = (half_length + MARGIN, width / 2 + MARGIN, high + MARGIN)
    return ", ".join(f"{value:.12g}" for value in lower + upper)


def node_sets(scene: Scene) -> dict[str, np.ndarray]:
    """Node sets (rows of `coordinates`), found by position."""
    x, y, z = scene.coordinates.T
    if scene.touching:
        lower, upper = scene.touching["lower", "upper"]
    else:
        of = np.repeat(BODIES, [cells.max() + 1 - cells.min() for cells in scene.elements.values()])
        meets = (np.abs(z) < MARGIN) & (np.abs(x) < OVERLAP / 2 + MARGIN)
        lower, upper = (np.flatnonzero(meets & (of == name)) for name in BODIES)
    tip = np.flatnonzero((x > x.max() - MARGIN) & (z > THICKNESS - MARGIN))
    return {
        "lower_face": lower,
        "upper_face": upper,
        "clamped": np.flatnonzero(x < x.min() + MARGIN),
        "tip": tip[[np.argmin(np.abs(y[tip]))]],
    }


def washer_faces(scene: Scene) -> dict[str, list[tuple[int, int, float]]]:
    """Element, face (both as CalculiX counts them) and area of what lies under the washer of each plate."""
    found, first = {}, 1
    for body, level in (("lower", -THICKNESS), ("upper", THICKNESS)):
        corners = scene.coordinates[scene.elements[body][:, :4]]
        for face, rows in enumerate(FACES, start=1):
            points = corners[:, rows]
            radius = np.hypot(points[..., 0], points[..., 1])
            under = np.all((np.abs(points[..., 2] - level) < MARGIN) & (radius < WASHER + MARGIN), axis=1)
            sides = points[:, 1:] - points[:, :1]
            area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / 2
            own = found.setdefault(body, [])
            own += [(first + int(row), face, float(area[row])) for row in np.flatnonzero(under)]
        first += len(corners)
    return found


def bolt(scene: Scene) -> str:
    """The pressure of the bolt, a `*DLOAD` list: the same everywhere under a washer, its force 1 kN on each side."""
    lines = ["*DLOAD"]
    for faces in washer_faces(scene).values():
        pressure = BOLT / sum(area for _, _, area in faces)
        lines += [f"{element}, P{face}, {pressure:.12g}" for element, face, _ in faces]
    return "\n".join([*lines, ""])


def main() -> None:
    """Command line: mesh, matrices and bolt, unless they are there already."""
    parser = argparse.ArgumentParser(description="A bolted lap joint: mesh, CalculiX matrices and the bolt's pressure.")
    sizes = f"{', '.join(SIZES)}, or edges over those of default"
    parser.add_argument("--size", type=size_of, default="default", help=sizes)
    parser.add_argument("--out", type=Path, default=Path("out/lap_joint"), help="folder for the results")
    parser.add_argument("--ratio", type=float, default=1.0, help="of the plates' element sizes; 1: nodes coincide")
    arguments = parser.parse_args()
    script = scripts(arguments.size, arguments.ratio)
    title = "A bolted lap joint of two plates"
    loads = {"bolt.inp": bolt}
    make_model(arguments.out, "lap_joint", title, script, BODIES, node_sets, STEPS, PRODUCTS, loads)


if __name__ == "__main__":
    main()
