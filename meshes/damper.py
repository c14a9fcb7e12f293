r"""Two blades with a wedge damper under their platforms: mesh, CalculiX matrices and frequencies.

    python meshes/damper.py --size default --out out/damper

leaves damper.inp, damper.sti .mas .dof and damper_frequencies.dat, CalculiX's own frequencies of the blades without
friction or contact (and four zero ones of the damper).

Axes: x circumferential, y along the rotation axis, z radial; the rotation axis is the y axis (x = z = 0). Units are mm,
t, s. Cross-section in the x-z plane, the right blade the mirror image of the left one::

      airfoil
        ||                          z = 330 tip
        ||
    +---++--------+  +----          z = 247
    |             |  |
    |             /__\              z = 243 = top of the damper's faces
    |            //  \\             z = 240.75 = their bottom; the damper reaches down to z = 239
    +--+  +-----+ +--+ +---         z = 239.5
       |  |      damper
       |  |                         z = 200 foot, held

In the plane nothing holds the damper but its contacts: the pull of rotation (+z) presses its two faces, 37 degrees
from the tangential direction, against the platforms. Along the axis a line of nodes at one end is held, as cover plates
do: while everything slips friction alone says nothing of where the damper stands along its length. Blades and damper
are three bodies; every node of a contact face exists twice at one position.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from blade_geometry import GeoScript
from bodies import Scene, make_model

# (largest edge, contact edges along y, contact edges along the slope), edges of second-order triangles.
SIZES = {"coarse": (12.0, 2, 1), "default": (5.0, 3, 1)}
BODIES = ["left", "right", "damper"]
HALF_LENGTH = 12.0
PITCH = 44.0
FOOT, TIP = 200.0, 330.0
FACE_TOP, FACE_BOTTOM = (1.5, 243.0), (4.5, 240.75)
PLATFORM_TOP, PLATFORM_BOTTOM = 247.0, 239.5
DAMPER_BOTTOM = 239.0
SHANK, AIRFOIL = 10.0, 4.0
FREQUENCIES = 16

HELD = "*BOUNDARY\nfoot, 1, 3\nretained, 2, 2\n*STEP\n"
STEPS = {
    "matrices": f"{HELD}*FREQUENCY, SOLVER=MATRIXSTORAGE\n1\n*END STEP\n",
    "frequencies": f"{HELD}*FREQUENCY\n{FREQUENCIES}\n*END STEP\n",
}
PRODUCTS = {
    "matrices.sti": "damper.sti",
    "matrices.mas": "damper.mas",
    "matrices.dof": "damper.dof",
    "frequencies.dat": "damper_frequencies.dat",
}


def blade_outline() -> list[tuple[float, float]]:
    """Cross-section (x, z) of the left blade, anticlockwise from its foot."""
    middle, gap = -PITCH / 2, FACE_TOP[0]
    shank, airfoil = SHANK / 2, AIRFOIL / 2
    return [
        (middle - shank, FOOT),
        (middle + shank, FOOT),
        (middle + shank, PLATFORM_BOTTOM),
        (-FACE_BOTTOM[0] - 1.0, PLATFORM_BOTTOM),
        (-FACE_BOTTOM[0], FACE_BOTTOM[1]),
        (-FACE_TOP[0], FACE_TOP[1]),
        (-gap, PLATFORM_TOP),
        (middle + airfoil, PLATFORM_TOP),
        (middle + airfoil, TIP),
        (middle - airfoil, TIP),
        (middle - airfoil, PLATFORM_TOP),
        (2 * middle + gap, PLATFORM_TOP),
        (2 * middle + gap, PLATFORM_BOTTOM),
        (middle - shank, PLATFORM_BOTTOM),
    ]


def radial(outline: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """The outline between radii instead of parallels: a blade that stood askew would be bent by its own pull."""
    return [(x * z / PLATFORM_BOTTOM, z) for x, z in outline]


def damper_outline() -> list[tuple[float, float]]:
    """Cross-section (x, z) of the damper."""
    (xt, zt), (xb, zb) = FACE_TOP, FACE_BOTTOM
    return [(-xb, DAMPER_BOTTOM), (xb, DAMPER_BOTTOM), (xb, zb), (xt, zt), (-xt, zt), (-xb, zb)]


def geometry_script(element: float, along: int, across: int) -> str:
    """The gmsh script: three volumes that share the damper's two faces."""
    script = GeoScript()
    left = blade_outline()
    for name, outline in (
        ("left", left),
        ("right", [(-x, z) for x, z in reversed(left)]),
        ("damper", damper_outline()),
    ):
        prism(script, name, outline)
    script.add(
        "bodies() = BooleanFragments{ Volume{left[1]}; Delete; }{ Volume{right[1]}; Volume{damper[1]}; Delete; };"
    )
    for place, name in enumerate(BODIES):
        script.add(f'Physical Volume("{name}") = {{bodies[{place}]}};')
    y = HALF_LENGTH
    for side in (-1.0, 1.0):
        (xa, za), (xb, zb) = ((side * x, z) for x, z in radial([FACE_TOP, FACE_BOTTOM]))
        for x, z in ((xa, za), (xb, zb)):
            script.add(f"edge() = Curve In BoundingBox{{{box(x, -y, z, x, y, z)}}};")
            script.add(f"Transfinite Curve {{edge()}} = {along + 1};")
        for end in (-y, y):
            script.add(f"edge() = Curve In BoundingBox{{{box(xa, end, za, xb, end, zb)}}};")
            script.add(f"Transfinite Curve {{edge()}} = {across + 1};")
        script.add(f"face() = Surface In BoundingBox{{{box(xa, -y, za, xb, y, zb)}}};")
        script.add("Transfinite Surface {face()};")
    script.add(f"Mesh.CharacteristicLengthMax = {element:.12g};")
    script.add("Mesh.SecondOrderLinear = 1;")
    script.add("Mesh.Optimize = 1;")
    return "\n".join(script.lines) + "\n"


def prism(script: GeoScript, name: str, outline: list[tuple[float, float]]) -> None:
    """Extrude an outline along y; its volume is `name[1]`."""
    points = [script.point(x, -HALF_LENGTH, z) for x, z in radial(outline)]
    lines = [script.curve("Line", [a, b]) for a, b in zip(points, points[1:] + points[:1], strict=True)]
    loop = script.loop(lines)
    script.add(f"Plane Surface({1000 + loop}) = {{{loop}}};")
    script.add(f"{name}() = Extrude {{0, {2 * HALF_LENGTH:.12g}, 0}} {{ Surface{{{1000 + loop}}}; }};")
    script.reserve_numbers()


def box(x0: float, y0: float, z0: float, x1: float, y1: float, z1: float) -> str:
    """Corners of a bounding box, a little larger, in gmsh's order."""
    margin = 1.0e-4
    low = (min(x0, x1) - margin, y0 - margin, min(z0, z1) - margin)
    high = (max(x0, x1) + margin, y1 + margin, max(z0, z1) + margin)
    return ", ".join(f"{value:.12g}" for value in low + high)


def node_sets(scene: Scene) -> dict[str, np.ndarray]:
    """Node sets (rows of `coordinates`), found by position and by body."""
    x, y, z = scene.coordinates.T
    margin = 1.0e-4
    sets = {"foot": np.flatnonzero(np.abs(z - FOOT) < margin), "damper": np.unique(scene.elements["damper"])}
    bottom = sets["damper"][np.abs(z[sets["damper"]] - DAMPER_BOTTOM) < margin]
    sets["retained"] = bottom[np.abs(y[bottom] + HALF_LENGTH) < margin]
    for side in ("left", "right"):
        platform, damper = scene.touching[side, "damper"]
        sets[f"platform_{side}"], sets[f"damper_{side}"] = np.sort(platform), np.sort(damper)
        body = np.unique(scene.elements[side])
        tip = body[np.abs(z[body] - TIP) < margin]
        # A corner, at the outer side: the same place on both blades.
        sets[f"tip_{side}"] = tip[[np.lexsort((np.round(y[tip], 6), -np.round(np.abs(x[tip]), 6)))[0]]]
    return sets


def main() -> None:
    """Command line: mesh, matrices and frequencies, unless they are there already."""
    parser = argparse.ArgumentParser(description="Two blades and a wedge damper: mesh, CalculiX matrices, frequencies.")
    parser.add_argument("--size", choices=SIZES, default="default", help="size of the mesh")
    parser.add_argument("--out", type=Path, default=Path("out/damper"), help="folder for the results")
    arguments = parser.parse_args()
    script = geometry_script(*SIZES[arguments.size])
    title = "Two blades and the wedge damper under their platforms"
    make_model(arguments.out, "damper", title, script, BODIES, node_sets, STEPS, PRODUCTS)


if __name__ == "__main__":
    main()
