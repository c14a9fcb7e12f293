r"""The blade and its disc slot as a gmsh geometry script (OpenCASCADE kernel).

Axes: x circumferential, y along the rotation axis, z radial; the rotation axis is the y axis (x = z = 0).
Lengths in millimetres. The cross-section of the dovetail in the x-z plane, right half::

        |  platform  |               z = 250 (airfoil above, to 370)
        +-----+------+               z = 244
              |   ___________        z = 241  disc rim
        neck  |  /
              A /                    A = (7, 238)
               \\   flank              blade faces up and outward, disc faces down and inward
                 B                   B = A + 8 (cos 50, -sin 50)
        root    |  |  slot
        -------/   |                 z = 226 root bottom, z = 223 slot bottom

Blade and disc share the flanks A-B only; elsewhere there is clearance. Their normal is 50 degrees off the radial
direction, so that the pull of rotation (+z) closes them.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, radians, sin, tan

import numpy as np

BLADES = 32
ROOT_HALF_LENGTH = 17.0
FLANK_ANGLE = radians(50.0)
FLANK_LENGTH = 8.0
FLANK_TOP = (7.0, 238.0)
FLANK_BOTTOM = (FLANK_TOP[0] + FLANK_LENGTH * cos(FLANK_ANGLE), FLANK_TOP[1] - FLANK_LENGTH * sin(FLANK_ANGLE))
PLATFORM_TOP = 250.0
TIP = 370.0
DISC_BOTTOM = 205.0
DISC_TOP = 241.0
SECTOR_SLOPE = tan(pi / BLADES)
AIRFOIL_VOLUME = 100


@dataclass(frozen=True)
class MeshSize:
    """Element sizes of one mesh.

    Parameters
    ----------
    element : largest edge, mm
    flank_axial, flank_radial : second-order triangles' edges along the two sides of each flank
    """

    element: float
    flank_axial: int
    flank_radial: int


SIZES = {
    "coarse": MeshSize(element=20.0, flank_axial=2, flank_radial=1),
    "default": MeshSize(element=4.2, flank_axial=4, flank_radial=2),
}


def root_outline() -> list[tuple[float, float]]:
    """Right half of the root's outline (x, z), from the platform down."""
    x, z = FLANK_BOTTOM
    return [
        (14.0, PLATFORM_TOP),
        (14.0, 244.0),
        (FLANK_TOP[0], 244.0),
        FLANK_TOP,
        FLANK_BOTTOM,
        (x, z - 2.0),
        (9.0, 226.0),
    ]


def disc_outline() -> list[tuple[float, float]]:
    """Right half of the disc sector's outline (x, z): up the side, then down the slot."""
    x, z = FLANK_BOTTOM
    return [
        (SECTOR_SLOPE * DISC_BOTTOM, DISC_BOTTOM),
        (SECTOR_SLOPE * DISC_TOP, DISC_TOP),
        (FLANK_TOP[0] + 1.5, DISC_TOP),
        FLANK_TOP,
        FLANK_BOTTOM,
        (x + 1.0, z - 0.5),
        (x + 1.0, z - 2.5),
        (10.0, 223.0),
    ]


def airfoil_sides(fraction: float, points: int = 9) -> tuple[np.ndarray, np.ndarray]:
    """Suction and pressure side of the section at a fraction (0 to 1) of the span.

    Returns
    -------
    two arrays [points, 3], mm, both from the leading to the trailing edge: a parabolic camber line with a
    parabolic thickness and blunt edges
    """
    chord = 31.0 - 6.0 * fraction
    camber = 4.0 - 2.5 * fraction
    thickness = 7.0 - 3.6 * fraction
    edge = 2.0 - 0.8 * fraction
    stagger = radians(12.0 + 30.0 * fraction)
    s = np.linspace(-1.0, 1.0, points)
    shape = 1.0 - s**2
    half = 0.5 * (edge + (thickness - edge) * shape)
    middle = camber * (shape - 2.0 / 3.0)
    sides = []
    for sign in (1.0, -1.0):
        along, across = 0.5 * chord * s, middle + sign * half
        x = along * sin(stagger) + across * cos(stagger)
        y = along * cos(stagger) - across * sin(stagger)
        # The loft starts inside the platform, so that the union never has to find coplanar faces.
        z = np.full(points, PLATFORM_TOP - 2.0 + fraction * (TIP - PLATFORM_TOP + 2.0))
        sides.append(np.column_stack([x, y, z]))
    return sides[0], sides[1]


class GeoScript:
    """Lines of a gmsh script with running numbers for points, curves and surfaces."""

    def __init__(self) -> None:
        self.lines = ['SetFactory("OpenCASCADE");']
        self.count = {"Point": 0, "Curve": 0, "Loop": 0}

    def add(self, line: str) -> None:
        self.lines.append(line)

    def number(self, kind: str) -> int:
        self.count[kind] += 1
        return self.count[kind]

    def point(self, x: float, y: float, z: float) -> int:
        tag = self.number("Point")
        self.add(f"Point({tag}) = {{{x:.12g}, {y:.12g}, {z:.12g}}};")
        return tag

    def curve(self, kind: str, points: list[int]) -> int:
        tag = self.number("Curve")
        self.add(f"{kind}({tag}) = {{{', '.join(map(str, points))}}};")
        return tag

    def loop(self, curves: list[int]) -> int:
        tag = self.number("Loop")
        self.add(f"Curve Loop({tag}) = {{{', '.join(map(str, curves))}}};")
        return tag

    def prism(self, name: str, right_half: list[tuple[float, float]]) -> None:
        """Mirror a right half outline about x = 0 and extrude it along y; its volume is `name[1]`."""
        outline = right_half + [(-x, z) for x, z in reversed(right_half)]
        points = [self.point(x, -ROOT_HALF_LENGTH, z) for x, z in outline]
        lines = [self.curve("Line", [a, b]) for a, b in zip(points, points[1:] + points[:1], strict=True)]
        loop = self.loop(lines)
        # Surfaces of extrusions take numbers of their own: plane ones start far above them.
        self.add(f"Plane Surface({1000 + loop}) = {{{loop}}};")
        self.add(f"{name}() = Extrude {{0, {2 * ROOT_HALF_LENGTH:.12g}, 0}} {{ Surface{{{1000 + loop}}}; }};")

    def reserve_numbers(self) -> None:
        """Continue above the points and curves an extrusion has made."""
        self.count["Point"] += 1000
        self.count["Curve"] += 1000
        self.count["Loop"] += 1000


def geometry_script(size: MeshSize) -> str:
    """The gmsh script: two volumes, physical groups `blade` and `disc`, that share the two flanks."""
    script = GeoScript()
    script.prism("root", root_outline())
    script.reserve_numbers()
    script.prism("sector", disc_outline())
    script.reserve_numbers()
    wires = []
    for fraction in np.linspace(0.0, 1.0, 5):
        suction, pressure = ([script.point(*p) for p in side] for side in airfoil_sides(fraction))
        wires.append(
            script.loop(
                [
                    script.curve("Spline", suction),
                    script.curve("Line", [suction[-1], pressure[-1]]),
                    script.curve("Spline", pressure[::-1]),
                    script.curve("Line", [pressure[0], suction[0]]),
                ]
            )
        )
    script.add(f"ThruSections({AIRFOIL_VOLUME}) = {{{', '.join(map(str, wires))}}};")
    script.add(f"blade() = BooleanUnion{{ Volume{{root[1]}}; Delete; }}{{ Volume{{{AIRFOIL_VOLUME}}}; Delete; }};")
    script.add("bodies() = BooleanFragments{ Volume{blade[0]}; Delete; }{ Volume{sector[1]}; Delete; };")
    script.add('Physical Volume("blade") = {bodies[0]};')
    script.add('Physical Volume("disc") = {bodies[1]};')
    script.lines += flank_mesh(size)
    script.add(f"Mesh.CharacteristicLengthMax = {size.element:.12g};")
    # Straight edges: the flanks are plane, and a coarse mesh of the thin edges must not fold.
    script.add("Mesh.SecondOrderLinear = 1;")
    script.add("Mesh.Optimize = 1;")
    return "\n".join(script.lines) + "\n"


def flank_mesh(size: MeshSize) -> list[str]:
    """Script lines that lay a regular mesh on both flanks, found by their bounding boxes."""
    lines = []
    y = ROOT_HALF_LENGTH

    def box(x0: float, y0: float, z0: float, x1: float, y1: float, z1: float) -> str:
        margin = 1.0e-4
        low = (min(x0, x1) - margin, y0 - margin, min(z0, z1) - margin)
        high = (max(x0, x1) + margin, y1 + margin, max(z0, z1) + margin)
        return ", ".join(f"{value:.12g}" for value in low + high)

    for side in (-1.0, 1.0):
        (xa, za), (xb, zb) = ((side * x, z) for x, z in (FLANK_TOP, FLANK_BOTTOM))
        for x, z in ((xa, za), (xb, zb)):
            lines.append(f"edge() = Curve In BoundingBox{{{box(x, -y, z, x, y, z)}}};")
            lines.append(f"Transfinite Curve {{edge()}} = {size.flank_axial + 1};")
        for end in (-y, y):
            lines.append(f"edge() = Curve In BoundingBox{{{box(xa, end, za, xb, end, zb)}}};")
            lines.append(f"Transfinite Curve {{edge()}} = {size.flank_radial + 1};")
        lines.append(f"flank() = Surface In BoundingBox{{{box(xa, -y, za, xb, y, zb)}}};")
        lines.append("Transfinite Surface {flank()};")
    return lines
