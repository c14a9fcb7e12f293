"""Bifurcations: where a branch turns, and where its multipliers cross the unit circle; in records and in result.h5."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np

from attrito.library.names import BIFURCATION_KINDS as KINDS
from attrito.support.hdf5_writing import described

FOLDS = KINDS[:2]
FOLD_CROSSINGS = KINDS[4:]
# Steps and part of the frequency between the folds of the balance's orbit and of the event-exact one that multipliers
# may be of: what few harmonics leave out.
FOLD_POINTS = 3
FOLD_WIDTH = 1e-3
# Of frequencies in distances from the drawn curve, as a part of the frequency (src/continuation/arc.f90)
FREQUENCY_UNIT = 1e-3


@dataclass(frozen=True)
class Bifurcation:
    """A turning point or a crossing on the step that ends at point `point`; `amplitude` of the monitors there."""

    kind: str
    point: int
    branch: int
    level: float
    frequency_hz: float
    uncertain_hz: float
    multiplier: complex
    amplitude: np.ndarray


def as_rows(found: list[Bifurcation]) -> np.ndarray:
    """Those of one point as its record has them."""
    rows = [
        [KINDS.index(one.kind), one.branch, one.level, one.frequency_hz, one.uncertain_hz, one.multiplier.real,
         one.multiplier.imag, *one.amplitude]
        for one in found
    ]  # fmt: skip
    return np.array(rows, dtype=float)


def of_rows(point: int, rows: Iterable[np.ndarray]) -> list[Bifurcation]:
    """The bifurcations of a point, by its number, out of what `as_rows` made."""
    return [
        Bifurcation(
            KINDS[int(kind)],
            point,
            int(branch),
            float(level),
            float(frequency),
            float(uncertain),
            complex(real, imaginary),
            np.array(amplitude),
        )
        for kind, branch, level, frequency, uncertain, real, imaginary, *amplitude in rows
    ]


def narrowest_fold(job: Mapping[str, Any]) -> float:
    """How far a branch has to go back from a fold, as a part of the frequency: farther than the curve is drawn.

    A job of before there was such a tolerance reports every fold.
    """
    return FREQUENCY_UNIT * float(job.get("continuation", {}).get("curve_tolerance", 0.0))


def added(found: list[Bifurcation], new: Bifurcation, narrow: float) -> list[Bifurcation]:
    """Those found and a new one; a fold goes before its own crossing, by an orbit that turns at another frequency.

    Two folds in a row that are nearer than `narrow`, a part of the frequency, are neither: between them the branch does
    not go back farther than the curve is drawn, as where a contact's samples change one after another.
    """
    if any(_is_of_fold(new, fold) for fold in found):
        return found
    if new.kind in FOLDS:
        last = next((one for one in reversed(found) if one.kind in FOLDS), None)
        if last is not None and _are_one_corner(last, new, narrow):
            return [one for one in found if one is not last]
    return [*(one for one in found if not _is_of_fold(one, new)), new]


def _is_of_fold(crossing: Bifurcation, fold: Bifurcation) -> bool:
    """Whether a multiplier that passes 1, or jumps, does so at a fold: of the event-exact orbit, near the balance's."""
    return (
        crossing.kind in FOLD_CROSSINGS
        and fold.kind in FOLDS
        and (crossing.branch, crossing.level) == (fold.branch, fold.level)
        and abs(crossing.point - fold.point) <= FOLD_POINTS
        and abs(crossing.frequency_hz - fold.frequency_hz) < FOLD_WIDTH * fold.frequency_hz
    )


def _are_one_corner(last: Bifurcation, new: Bifurcation, narrow: float) -> bool:
    return (last.branch, last.level) == (new.branch, new.level) and abs(
        new.frequency_hz - last.frequency_hz
    ) <= narrow * last.frequency_hz


def write_bifurcations(file: h5py.File, found: list[Bifurcation], monitors: list[str]) -> None:
    """Add them to a result file that is open, as `/bifurcations`."""
    columns = {
        "frequency_hz": ("Hz", float, "frequency", [one.frequency_hz for one in found]),
        "uncertain_hz": ("Hz", float, "what is left open of the frequency", [one.uncertain_hz for one in found]),
        "level": ("1", float, "factor on the harmonic loads", [one.level for one in found]),
        "branch": ("1", np.int32, "number of the branch", [one.branch for one in found]),
        "point": ("1", np.int32, "number of the point that its step leads to", [one.point for one in found]),
        "kind": ("1", np.int32, "index into the attribute names", [KINDS.index(one.kind) for one in found]),
        "real": ("1", float, "real part of the multiplier that crosses", [one.multiplier.real for one in found]),
        "imag": ("1", float, "its imaginary part", [one.multiplier.imag for one in found]),
    }
    group = file.create_group("bifurcations")
    for name, (unit, kind, description, values) in columns.items():
        names = KINDS if name == "kind" else ()
        described(group, name, description, unit, names, data=np.array(values, dtype=kind))
    for i, name in enumerate(monitors):
        amplitude = [float(one.amplitude[i]) for one in found]
        described(
            group, f"amplitude/{name}", "half the range of the monitor over the period", "user length", data=amplitude
        )
