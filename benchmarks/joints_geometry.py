"""Five kinds of joints, drawn at random in bricks of 20 nodes: what `joints.py` sweeps. mm, t, s.

Dovetails, dampers, laps and angles are prisms along y, z up or radial; tubes and rings turn about z. Every body is
meshed by itself, with divisions unlike those of its neighbours, and meets them in nothing but contacts.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

NEAR = 1.0e-6
# Corners and middles of edges of a brick on a lattice of half edges, in CalculiX's order.
CORNERS = ((0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2))
EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
BRICK = np.array([*CORNERS, *(np.add(CORNERS[a], CORNERS[b]) // 2 for a, b in EDGES)])

Pair = tuple[float, float]
Quad = Sequence[Pair]
# Which rows of points [N, 3] belong to a node set
Chosen = Callable[[np.ndarray], np.ndarray]


class Body:
    """Blocks of bricks, which share their nodes where they meet."""

    def __init__(self) -> None:
        self.points: list[np.ndarray] = []
        self.bricks: list[list[int]] = []
        self._rows: dict[tuple[float, ...], int] = {}

    def block(self, shape: Callable[..., np.ndarray], counts: tuple[int, int, int]) -> None:
        """A cube of `counts` bricks, put in place by a map of its coordinates, `[3, N]` from 0 to 1."""
        around = np.full((3, 4), 0.5)
        around[:, 1:] += 1e-4 * np.eye(3)
        places = shape(around)
        turned = np.linalg.det(places[:, 1:] - places[:, :1]) < 0.0
        for first in itertools.product(*map(range, counts)):
            lattice = ((2 * np.array(first) + BRICK) / (2.0 * np.array(counts))).T
            if turned:
                lattice[2] = 1.0 - lattice[2]
            self.bricks.append([self._row(point) for point in shape(lattice).T])

    def _row(self, point: np.ndarray) -> int:
        key = tuple(np.round(point, 5) + 0.0)
        if key not in self._rows:
            self._rows[key] = len(self.points)
            self.points.append(point)
        return self._rows[key]

    def prism(self, quad: Quad, length: Pair, counts: tuple[int, int, int], side: float = 1.0) -> None:
        """A quadrilateral of x and z, or with `side` -1 its mirror image, along y; counts along its sides and y."""
        (a, b, c, d), (low, high) = np.array(quad) * (side, 1.0), length

        def shape(at: np.ndarray) -> np.ndarray:
            r, s, t = at
            x, z = (a[k] * (1 - r) * (1 - s) + b[k] * r * (1 - s) + c[k] * r * s + d[k] * (1 - r) * s for k in (0, 1))
            return np.array([x, low + (high - low) * t, z])

        self.block(shape, counts)

    def turn(self, radii: Pair, heights: Pair, counts: tuple[int, int, int], opening: float = 0.0) -> None:
        """A rectangle turned about z, all round or but for an opening (radians) about x < 0."""

        def shape(at: np.ndarray) -> np.ndarray:
            radius, z = radii[0] + (radii[1] - radii[0]) * at[0], heights[0] + (heights[1] - heights[0]) * at[1]
            angle = opening / 2 - np.pi + (2 * np.pi - opening) * at[2]
            return np.array([radius * np.cos(angle), radius * np.sin(angle), z])

        self.block(shape, counts)


@dataclass
class Joint:
    """Bodies, node sets, and what a job says of them.

    Parameters
    ----------
    kind : name of its drawing
    bodies : by name; contact forces and static loads balance on the one called `free`
    sets : body and choice of its points; `tip` is shaken along `driven` and monitored; `clamp...` are held
    pairs : node sets a, with the smaller faces, and b
    spin : speed (Hz), a point of the axis and its direction; none: nothing rotates
    bolts : node set, force along z that its nodes share
    contact : keys of the contact sets besides those that are drawn for all kinds
    moved : body and change of its points after the sets are chosen: gaps that the mesh has
    oval : largest gap of a ring that is out of round, by a gap file
    driven : direction
    """

    kind: str
    bodies: dict[str, Body]
    free: str
    sets: dict[str, tuple[str, Chosen]]
    pairs: list[tuple[str, str]]
    spin: tuple[float, list[float], list[float]] | None = None
    bolts: list[tuple[str, float]] = field(default_factory=list)
    contact: dict[str, object] = field(default_factory=dict)
    moved: tuple[str, Callable[[np.ndarray], np.ndarray]] | None = None
    oval: float = 0.0
    driven: str = "x"


def at_height(height: float, low: float = -np.inf, high: float = np.inf) -> Chosen:
    """Points at a z, between two x."""
    return lambda p: (np.abs(p[:, 2] - height) < NEAR) & (p[:, 0] > low - NEAR) & (p[:, 0] < high + NEAR)


def at_end(x: float) -> Chosen:
    """Points at an x."""
    return lambda p: np.abs(p[:, 0] - x) < NEAR


def at_radius(radius: float, low: float, high: float) -> Chosen:
    """Points at a radius about z, between two heights."""
    return lambda p: (
        (np.abs(np.hypot(p[:, 0], p[:, 1]) - radius) < NEAR)
        & (np.abs(p[:, 2] - (low + high) / 2) < (high - low) / 2 + NEAR)
    )


def on_line(a: Pair, b: Pair) -> Chosen:
    """Points between two points of the x-z plane, at all y."""
    start, along = np.array(a), np.subtract(b, a)

    def chosen(p: np.ndarray) -> np.ndarray:
        way = p[:, [0, 2]] - start
        part = way @ along / (along @ along)
        return (np.hypot(*(way - part[:, None] * along).T) < NEAR) & (np.abs(part - 0.5) < 0.5 + NEAR)

    return chosen


def nearest(place: Sequence[float]) -> Chosen:
    """The point nearest to a place."""
    return lambda p: np.arange(len(p)) == np.argmin(np.linalg.norm(p - np.array(place), axis=1))


def under_washers(height: float, places: Sequence[Pair], radius: float, clear: Chosen) -> Chosen:
    """Points at a z under washers about places `(x, y)`, where the face is clear of the rest of the body."""

    def chosen(p: np.ndarray) -> np.ndarray:
        away = np.min([np.hypot(*(p[:, :2] - place).T) for place in places], axis=0)
        return (np.abs(p[:, 2] - height) < NEAR) & (away < radius) & clear(p)

    return chosen


def dovetail(rng: np.random.Generator, number: int) -> Joint:
    """A blade whose root hangs by two flanks in the slot of a disc."""
    wide, flank, half = rng.uniform(9.0, 13.0), rng.uniform(4.0, 7.0), rng.uniform(6.0, 11.0)
    angle = np.radians(rng.uniform(35.0, 60.0))
    narrow, z1 = wide - flank * np.cos(angle), rng.uniform(4.0, 7.0)
    z2, thin = z1 + flank * np.sin(angle), rng.uniform(1.5, 3.0)
    z3, tip = z2 + rng.uniform(3.0, 6.0), z2 + rng.uniform(70.0, 110.0)
    y, along, across = (-half, half), int(rng.integers(4, 7)), int(rng.integers(2, 4))
    blade, disc = Body(), Body()
    rows = [(0.0, wide, 1), (z1, wide, across), (z2, narrow, 1), (z3, narrow, 1), (z3 + 6.0, thin, 6), (tip, thin, 0)]
    for (low, a, count), (high, b, _) in itertools.pairwise(rows):
        blade.prism([(-a, low), (a, low), (b, high), (-b, high)], y, (2, count, along))
    outer, floor, depth = wide + rng.uniform(10.0, 16.0), -rng.uniform(1.5, 3.0), -18.0
    slot, finer = wide + 1.0, along + 1 + number % 2
    wall = [(floor, slot, 1), (z1, wide, across + 1), (z2, narrow, 1), (z2 + 3.0, narrow + 1.0, 0)]
    disc.prism([(-slot, depth), (slot, depth), (slot, floor), (-slot, floor)], y, (3, 2, finer))
    sets = {"clamp": ("disc", at_height(depth)), "tip": ("blade", nearest((thin, half, tip)))}
    for name, side in (("left", -1.0), ("right", 1.0)):
        disc.prism([(slot, depth), (outer, depth), (outer, floor), (slot, floor)], y, (2, 2, finer), side)
        for (low, a, count), (high, b, _) in itertools.pairwise(wall):
            disc.prism([(a, low), (outer, low), (outer, high), (b, high)], y, (2, count, finer), side)
        line = on_line((side * wide, z1), (side * narrow, z2))
        sets |= {f"root_{name}": ("blade", line), f"slot_{name}": ("disc", line)}
    spin = (rng.uniform(30.0, 150.0), [0.0, 0.0, -rng.uniform(150.0, 300.0)], [0.0, 1.0, 0.0])
    pairs = [("slot_left", "root_left"), ("slot_right", "root_right")]
    return Joint("dovetail", {"blade": blade, "disc": disc}, "blade", sets, pairs, spin)


def damper(rng: np.random.Generator, number: int) -> Joint:
    """Two blades, of unlike lengths, and a wedge that rotation presses under their platforms."""
    middle, shank, half = rng.uniform(16.0, 23.0), rng.uniform(4.0, 6.0), rng.uniform(8.0, 14.0)
    foot, gap, thin = 200.0, rng.uniform(0.8, 1.6), rng.uniform(1.5, 2.5)
    z1 = foot + rng.uniform(30.0, 50.0)
    z2, y, along = z1 + 6.0, (-half, half), int(rng.integers(3, 6))
    slopes = np.tan(np.radians(rng.uniform(30.0, 55.0, 2)))
    if number % 2 == 0:
        slopes[1] = slopes[0]
    bodies, sets, ends = {"damper": Body()}, {}, {}
    tips = (z2 + rng.uniform(60.0, 100.0)) * np.array([1.0, rng.uniform(0.98, 1.02)])
    for name, side, slope, tip in zip(("left", "right"), (-1.0, 1.0), slopes, tips, strict=True):
        a, b, low = middle - shank, middle + shank, gap + 6.0 * slope
        body = bodies[name] = Body()
        body.prism([(a, foot), (b, foot), (b, z1), (a, z1)], y, (2, 3, along), side)
        body.prism([(a, z1), (b, z1), (b, z2), (a, z2)], y, (2, 2, along), side)
        body.prism([(low, z1), (a, z1), (a, z2), (gap, z2)], y, (2, 2, along), side)
        body.prism([(b, z1), (b + 6.0, z1), (b + 6.0, z2), (b, z2)], y, (1, 2, along), side)
        c, d, z3 = middle - thin, middle + thin, z2 + 8.0
        body.prism([(a, z2), (b, z2), (d, z3), (c, z3)], y, (2, 1, along), side)
        body.prism([(c, z3), (d, z3), (d, tip), (c, tip)], y, (2, 5, along), side)
        ends[name] = [(side * (gap + slope * 6.0 * (1 - part)), z1 + 6.0 * part) for part in (0.1, 0.8)]
        sets[f"wedge_{name}"] = ("damper", on_line(*ends[name]))
        sets[f"under_{name}"] = (name, on_line((side * low, z1), (side * gap, z2)))
        sets[f"clamp_{name}"] = (name, at_height(foot))
        if side < 0:
            sets["tip"] = (name, nearest((-d, half, tip)))
    (a, b), (c, d) = ends.values()
    own = half * rng.uniform(0.7, 0.95)
    bodies["damper"].prism([a, c, d, b], (-own, own), (3, 2 + number // 2, along + 2))
    spin = (rng.uniform(40.0, 120.0), [0.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    pairs = [("wedge_left", "under_left"), ("wedge_right", "under_right")]
    return Joint("damper", bodies, "damper", sets, pairs, spin)


def flange(rng: np.random.Generator, number: int) -> Joint:
    """Two tubes, or two angles, bolted flange on flange; two of four are open by a cone outwards or inwards."""
    thick, force, tall = rng.uniform(4.0, 7.0), 10.0 ** rng.uniform(2.5, 4.0), rng.uniform(80.0, 140.0)
    bodies = {"upper": Body(), "lower": Body()}
    sizes = zip(bodies.values(), (1.0, -1.0), (tall, 28.0), (5, 2), (1, 0), strict=True)
    angle = number % 2 == 1
    inner, wall = (0.0, rng.uniform(3.0, 5.0)) if angle else (rng.uniform(20.0, 30.0), rng.uniform(2.0, 4.0))
    brim = rng.uniform(20.0, 30.0) if angle else rng.uniform(10.0, 15.0)
    web, edge, half, count = inner + wall, inner + wall + brim, rng.uniform(18.0, 28.0), int(rng.choice([3, 4, 6]))
    # Around a tube there is a node at every bolt.
    around = {1: 24, 0: 16 if count == 4 else 18}
    for body, side, end, rows, more in sizes:
        z1, z2 = side * thick, side * end
        if angle:
            body.prism([(inner, 0), (web, 0), (web, z1), (inner, z1)], (-half, half), (1, 1, 5 + more))
            body.prism([(web, 0), (edge, 0), (edge, z1), (web, z1)], (-half, half), (3 + more, 1, 5 + more))
            body.prism([(inner, z1), (web, z1), (web, z2), (inner, z2)], (-half, half), (1, rows, 5 + more))
        else:
            body.turn((inner, web), (0.0, z1), (1, 1, around[more]))
            body.turn((web, edge), (0.0, z1), (2 + more, 1, around[more]))
            body.turn((inner, web), (z1, z2), (1, rows, around[more]))

    def out(p: np.ndarray) -> np.ndarray:
        return p[:, 0] if angle else np.hypot(p[:, 0], p[:, 1])

    if angle:
        places = [(web + 0.45 * brim, y) for y in (-0.55 * half, 0.55 * half)]
    else:
        turns = 2 * np.pi * np.arange(count) / count
        places = [((web + 0.5 * brim) * np.cos(turn), (web + 0.5 * brim) * np.sin(turn)) for turn in turns]
    sets = {
        "clamp": ("lower", at_height(-28.0)),
        "tip": ("upper", nearest((web, half if angle else 0.0, tall))),
        "upper_face": ("upper", at_height(0.0)),
        "lower_face": ("lower", at_height(0.0)),
    }
    bolts = []
    for name, side in zip(bodies, (1.0, -1.0), strict=True):
        chosen = under_washers(side * thick, places, 0.45 * brim, lambda p: out(p) > web + NEAR)
        sets[f"washer_{name}"] = (name, chosen)
        bolts.append((f"washer_{name}", -side * force * len(places)))
    joint = Joint("flange", bodies, "upper", sets, [("upper_face", "lower_face")], None, bolts)
    if number >= 2:
        cone = rng.uniform(0.002, 0.015)
        joint.contact = {"gap": "geometry", "tolerance": 0.1}
        joint.moved = ("upper", lambda p: p + cone * ((out(p) - inner) / (edge - inner))[:, None] * (0.0, 0.0, 1.0))
    return joint


def lap(rng: np.random.Generator, number: int) -> Joint:
    """A plate bolted on another, or between two others; two of four are bowed."""
    over, width = rng.uniform(30.0, 55.0), rng.uniform(9.0, 15.0)
    t1, t2 = rng.uniform(3.0, 6.0, 2)
    reach, back, force = rng.uniform(60.0, 100.0), rng.uniform(30.0, 60.0), 10.0 ** rng.uniform(2.5, 4.0)
    nx, ny = int(rng.integers(5, 8)), int(rng.integers(3, 5))
    y, double = (-width, width), number % 2 == 1
    bodies = {"plate": Body(), "under": Body()} | ({"cover": Body()} if double else {})

    def plate(body: Body, first: Pair, rest: Pair, z: Pair, counts: tuple[int, int, int]) -> None:
        for (x0, x1), count in ((first, counts[0]), (rest, counts[1])):
            body.prism([(x0, z[0]), (x1, z[0]), (x1, z[1]), (x0, z[1])], y, (count, 1, counts[2]))

    plate(bodies["plate"], (0.0, over), (over, over + reach), (0.0, t2), (nx, 6, ny))
    plate(bodies["under"], (0.0, over), (-back, 0.0), (-t1, 0.0), (nx + 1, 4, ny + 1))
    places = [(part * over, 0.0) for part in ((0.5,) if number < 2 else (0.25, 0.75))]
    radius = rng.uniform(0.15, 0.22) * over
    sets = {
        "tip": ("plate", nearest((over + reach, width, t2))),
        "clamp_under": ("under", at_end(-back)),
        "plate_low": ("plate", at_height(0.0, 0.0, over)),
        "under_top": ("under", at_height(0.0, 0.0, over)),
        "washer_under": ("under", under_washers(-t1, places, radius, lambda p: p[:, 0] > 0.0)),
    }
    pairs, upper, height = [("under_top", "plate_low")], "plate", t2
    if double:
        plate(bodies["cover"], (0.0, over), (-back, 0.0), (t2, t2 + t1), (nx + 2, 4, ny + 1))
        sets |= {
            "plate_top": ("plate", at_height(t2, 0.0, over)),
            "cover_low": ("cover", at_height(t2, 0.0, over)),
            "clamp_cover": ("cover", at_end(-back)),
        }
        pairs, upper, height = [*pairs, ("cover_low", "plate_top")], "cover", t2 + t1
    sets["washer_upper"] = (upper, under_washers(height, places, radius, lambda p: p[:, 0] > 0.0))
    bolts = [("washer_under", force * len(places)), ("washer_upper", -force * len(places))]
    joint = Joint("lap", bodies, "plate", sets, pairs, None, bolts, driven="z")
    if number >= 2:
        bow = rng.uniform(0.003, 0.02)
        joint.contact = {"gap": "geometry", "tolerance": 0.1}
        joint.moved = ("under", lambda p: p - bow * ((p[:, 0] / over - 0.5) ** 2)[:, None] * (0.0, 0.0, 1.0))
    return joint


def ring(rng: np.random.Generator, number: int) -> Joint:
    """A ring about a drum, shrunk on it and perhaps oval, or a split one inside, which rotation presses outwards."""
    radius, wall, tall = rng.uniform(40.0, 70.0), rng.uniform(2.0, 4.0), rng.uniform(35.0, 60.0)
    thick, wide, split = rng.uniform(2.5, 5.0), rng.uniform(5.0, 9.0), number % 2 == 1
    low = tall - wide - rng.uniform(2.0, 6.0)
    drum, own = Body(), Body()
    for heights, count in (((0.0, low), 2), ((low, low + wide), 2), ((low + wide, tall), 1)):
        drum.turn((radius - wall, radius), heights, (1, count, 24))
    meets = radius - wall if split else radius
    radii = (meets - thick, meets) if split else (meets, meets + thick)
    opening = np.radians(rng.uniform(4.0, 15.0)) if split else 0.0
    own.turn(radii, (low + 0.5, low + wide - 0.5), (1, 1 + number // 2, 28), opening)
    sets = {
        "clamp": ("drum", at_height(0.0)),
        "tip": ("drum", nearest((radius, 0.0, tall))),
        "drum_face": ("drum", at_radius(meets, low, low + wide)),
        "ring_face": ("ring", at_radius(meets, low, low + wide)),
    }
    joint = Joint("ring", {"drum": drum, "ring": own}, "ring", sets, [("ring_face", "drum_face")])
    joint.contact = {"tolerance": 0.1}
    if split:
        joint.spin = (rng.uniform(20.0, 100.0), [0.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    else:
        joint.contact["gap"] = -rng.uniform(0.002, 0.02)
        joint.oval = rng.uniform(0.5, 1.5) * -joint.contact["gap"] if number >= 2 else 0.0
    return joint


KINDS = (dovetail, damper, flange, lap, ring)
