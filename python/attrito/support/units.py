"""Names of the user's own units: `"mm, t, s"` makes `N/mm` of `user force/length`.

A consistent set is given by its length, mass and time; force is mass length / time^2, energy force length.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache

# In metres and in kilograms
LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "km": 1e3, "in": 0.0254, "ft": 0.3048}
POUND, STANDARD_GRAVITY = 0.45359237, 9.80665
MASSES = {
    "kg": 1.0,
    "g": 1e-3,
    "mg": 1e-6,
    "t": 1e3,
    "lb": POUND,
    "slug": POUND * STANDARD_GRAVITY / LENGTHS["ft"],
    "slinch": POUND * STANDARD_GRAVITY / LENGTHS["in"],
}
EXPECTED = (
    'length, mass and time of one consistent set, such as "mm, t, s": '
    f"length one of {', '.join(LENGTHS)}; mass one of {', '.join(MASSES)}; time s, for frequencies are in Hz"
)
PREFIXES = {"n": 1e-9, "u": 1e-6, "m": 1e-3, "": 1.0, "k": 1e3, "M": 1e6, "G": 1e9}
# In newtons and in joules
FORCES = {f"{prefix}N": factor for prefix, factor in PREFIXES.items()} | {"dyn": 1e-5, "lbf": POUND * STANDARD_GRAVITY}
ENERGIES = {f"{prefix}J": factor for prefix, factor in PREFIXES.items()} | {"erg": 1e-7}
# Numbers that differ by less are rounding of products of units
ROUNDING = 1e-9


@dataclass(frozen=True)
class Units:
    """A consistent set; `force` and `energy` follow."""

    length: str
    mass: str
    time: str

    @property
    def force(self) -> str:
        """N with a prefix, dyn or lbf; else written out."""
        newtons = MASSES[self.mass] * LENGTHS[self.length]
        return _named(newtons, FORCES) or f"{self.mass}*{self.length}/s^2"

    @property
    def energy(self) -> str:
        """J with a prefix, or erg; else force times length."""
        return _named(MASSES[self.mass] * LENGTHS[self.length] ** 2, ENERGIES) or f"{self.force}*{self.length}"

    def name(self, unit: str) -> str:
        """A unit of a file, in these units.

        >>> Units("mm", "t", "s").name("user force/length")
        'N/mm'
        """
        if not unit.startswith("user "):
            return unit
        words = {
            "area": f"{self.length}^2",
            "length": self.length,
            "mass": self.mass,
            "time": self.time,
            "force": self.force,
            "energy": self.energy,
            "velocity": f"{self.length}/{self.time}",
        }
        plain = unit.replace("user ", "").replace("force*length", "energy")
        named = re.sub(r"[a-z]+", lambda found: _bracketed(words.get(found[0], found[0]), plain), plain)
        return re.sub(r"\(\(?([A-Za-z]+)\)?\)", r"\1", named).replace("((", "(").replace("))", ")")


def _named(factor: float, names: dict[str, float]) -> str:
    """The name of a unit that is so many SI units; "" where it has none."""
    return next((name for name, value in names.items() if abs(factor / value - 1.0) < ROUNDING), "")


def _bracketed(name: str, unit: str) -> str:
    """A name that is a product or quotient, in brackets where the unit is one, too."""
    return f"({name})" if re.search(r"[*/^]", name) and re.search(r"[*/^ ]", unit) else name


@cache
def units_of(text: str) -> Units | None:
    """The set that a job or a file names; None: the user's own, not named.

    Raises
    ------
    ValueError : with what was expected
    """
    if not text:
        return None
    parts = [part.strip() for part in text.split(",")]
    if len(parts) != 3 or parts[0] not in LENGTHS or parts[1] not in MASSES or parts[2] != "s":
        raise ValueError(EXPECTED)
    return Units(*parts)


def axis_unit(unit: str, units: str = "") -> str:
    """A unit, of a set if that is named, for an axis label: `length, user units` where not; empty for pure numbers."""
    known = units_of(units)
    unit = unit if known is None else known.name(unit)
    if unit == "1":
        return ""
    return f"{unit.removeprefix('user ')}, user units" if unit.startswith("user ") else unit
