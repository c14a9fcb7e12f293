"""Coordinate systems of Nastran's bulk data: where grid points are (CP), and along which axes they move (CD).

`CORD2R`, `CORD2C`, `CORD2S`: rectangular, cylindrical (r, theta, z), spherical (r, theta from the z axis, phi) systems
by three points A, B, C of another system: A the origin, B on the z axis, C in the half-plane of x and z. `CORD1R` and
the like: the same by three grid points.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from attrito.importers.mesh_data import is_id
from attrito.importers.nastran_cards import Card
from attrito.support.errors import InputError

CARDS = ("CORD1R", "CORD1C", "CORD1S", "CORD2R", "CORD2C", "CORD2S")
_REAL = re.compile(r"([-+]?\d*\.?\d*)[EeDd]?([-+]?\d*)")
# Cosines below are rounding of axes at right angles.
_ROUNDING = 1.0e-15


def real(card: Card, word: str) -> float:
    """A real number, whose exponent may lack its letter; a blank is zero."""
    found = _REAL.fullmatch(word)
    try:
        return float(f"{found[1] or 0}e{found[2] or 0}")
    except (TypeError, ValueError):
        raise InputError(card.fault("real coordinates")) from None


def whole(card: Card, word: str) -> int:
    """A whole number; a blank is zero."""
    if word and not is_id(word):
        raise InputError(card.fault("whole numbers"))
    return int(word or 0)


@dataclass(frozen=True)
class System:
    """Kind (`R`, `C`, `S`), origin `[3]` and axes `[3, 3]` (rows x, y, z) in the basic system."""

    kind: str
    origin: np.ndarray
    axes: np.ndarray

    def position(self, coordinates: np.ndarray) -> np.ndarray:
        """A point `[3]` in the basic system, of its coordinates (angles in degrees)."""
        if not np.all(np.isfinite(coordinates)):
            # The message that names its node comes when all are read.
            return np.full(3, np.nan)
        a, b, c = coordinates
        if self.kind == "C":
            coordinates = np.array([a * np.cos(np.radians(b)), a * np.sin(np.radians(b)), c])
        elif self.kind == "S":
            theta, phi = np.radians(b), np.radians(c)
            across = a * np.sin(theta)
            coordinates = np.array([across * np.cos(phi), across * np.sin(phi), a * np.cos(theta)])
        return self.origin + coordinates @ self.axes

    def directions(self, point: np.ndarray) -> np.ndarray:
        """Unit vectors `[3, 3]`, as rows, of the directions 1, 2, 3 at a point of the basic system."""
        x, y, z = self.axes @ (point - self.origin)
        along = np.eye(3)
        if self.kind != "R":
            across = np.hypot(x, y)
            cosine, sine = (x / across, y / across) if across > 0.0 else (1.0, 0.0)
            radial, around = np.array([cosine, sine, 0.0]), np.array([-sine, cosine, 0.0])
            along = np.array([radial, around, [0.0, 0.0, 1.0]])
            if self.kind == "S":
                far = np.hypot(across, z)
                up, out = (z / far, across / far) if far > 0.0 else (1.0, 0.0)
                upright = np.array([0.0, 0.0, 1.0])
                along = np.array([out * radial + up * upright, up * radial - out * upright, around])
        found = along @ self.axes
        return np.where(abs(found) < _ROUNDING, 0.0, found)


class Systems:
    """Systems and grid points of a deck, each worked out once it is asked for."""

    def __init__(self, cards: list[Card]):
        self._systems: dict[int, System] = {0: System("R", np.zeros(3), np.eye(3))}
        self._cards: dict[int, tuple[Card, list[str]]] = {}
        self._grids: dict[int, Card] = {}
        self._open: list[int] = []
        defaults = ["", ""]
        for card in cards:
            if card.name == "GRDSET":
                fields = [*card.fields, *[""] * 8]
                defaults = [fields[1], fields[5]]
            elif card.name.startswith("CORD1"):
                # Two systems a card
                for part in (card.fields[:4], card.fields[4:8]):
                    if part and part[0]:
                        self._cards[whole(card, part[0])] = (card, part)
            elif card.name in CARDS:
                self._cards[whole(card, card.fields[0])] = (card, card.fields)
            elif card.name == "GRID":
                self._grids[whole(card, card.fields[0])] = card
        self._defaults = defaults

    def place(self, card: Card) -> np.ndarray:
        """Coordinates `[3]` of a grid point in the basic system."""
        fields = [*card.fields, *[""] * 6]
        coordinates = np.array([real(card, word) for word in fields[2:5]])
        return self._system(whole(card, fields[1] or self._defaults[0]), card).position(coordinates)

    def directions(self, card: Card, place: np.ndarray) -> np.ndarray | None:
        """Unit vectors of a grid point's directions, None where they are those of the basic system."""
        fields = [*card.fields, *[""] * 6]
        word = fields[5] or self._defaults[1]
        # -1: a point of a fluid, which has a pressure
        number = 0 if word == "-1" else whole(card, word)
        found = self._system(number, card).directions(place)
        return None if number == 0 or np.array_equal(found, np.eye(3)) else found

    def _system(self, number: int, asking: Card) -> System:
        if number in self._systems:
            return self._systems[number]
        if number not in self._cards or number in self._open:
            raise InputError(asking.fault(f"coordinate system {number}: CORD1 or CORD2 R, C, S, not made of itself"))
        card, fields = self._cards[number]
        self._open.append(number)
        if card.name.startswith("CORD1"):
            points = [self._grid(whole(card, word), card) for word in [*fields[1:4], *[""] * 3][:3]]
        else:
            numbers = [real(card, word) for word in [*fields[2:11], *[""] * 9][:9]]
            base = self._system(whole(card, fields[1]), card)
            points = [base.position(np.array(numbers[k : k + 3])) for k in (0, 3, 6)]
        self._open.pop()
        z = points[1] - points[0]
        y = np.cross(z, points[2] - points[0])
        if not np.linalg.norm(y) > 0.0:
            raise InputError(card.fault("three points that are not on one line"))
        z, y = z / np.linalg.norm(z), y / np.linalg.norm(y)
        self._systems[number] = System(card.name[-1], points[0], np.array([np.cross(y, z), y, z]))
        return self._systems[number]

    def _grid(self, number: int, asking: Card) -> np.ndarray:
        if number not in self._grids:
            raise InputError(asking.fault("three grid points of the file"))
        return self.place(self._grids[number])
