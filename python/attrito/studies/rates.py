"""Exact derivatives of a point by parameters of a job: of contact laws, factors on static loads, and damping."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from attrito.job.laws import LAW_KEYS
from attrito.library.derivatives import LAW_NUMBERS, Inquiry, Rates, zero_rates
from attrito.library.family import Family
from attrito.library.names import LAWS
from attrito.library.reduced_scene import ReducedScene, Sector
from attrito.library.session import Options

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

# A scene, its load path `[corners, loads]`, and the solver's options
Solvable = tuple[ReducedScene, np.ndarray, Options]
# Columns of `Rates.damping` by the kind of damping whose value they are by
DAMPING = {"mass": 0, "ratio": 2, "loss_factor": 3}
# Numbers of further laws that forces have derivatives by: places in the order of `RULES` in `job/laws.py`
NUMBERS = {"iwan": slice(0, 2), "pressure": slice(2, None, 2)}


class Bounded(Protocol):
    """A parameter of a job between two values of it."""

    @property
    def low(self) -> float:
        """The least value."""

    @property
    def high(self) -> float:
        """The largest value."""

    def rate(self, value: float) -> float:
        """What a step of it is a part of: the width between both, or the value of one sought by its logarithm."""


def rates_of(
    parameters: Sequence[Bounded], values: np.ndarray, here: Solvable, at: Callable[[np.ndarray], Solvable]
) -> Rates:
    """Rates of each parameter; NaN of one that changes something else. Collective.

    Parameters
    ----------
    parameters, values : and where they are
    here, at : what is solved there; what is solved at other values
    """
    reduced, load_path, options = here
    rates = zero_rates(reduced, len(values), LAW_NUMBERS + _further(reduced))
    rates.laws[:], rates.static_factors[:] = np.nan, np.nan
    if options.uncoupled or reduced.gyroscopic is not None:
        # A frozen mean follows the static solution; with Coriolis forces there are no derivatives.
        return rates
    for i, parameter in enumerate(parameters):
        # Laws are linear in each of their numbers: any change gives the rate.
        step = 0.5 * (parameter.high - parameter.low)
        beside = values.copy()
        beside[i] += step if values[i] + step <= parameter.high else -step
        there, path, other_options = at(beside)
        stiffer = any(not np.array_equal(there.laws[key], reduced.laws[key]) for key in LAW_KEYS[:2])
        same = _but_for_numbers(there, reduced) and other_options == options and path.shape == load_path.shape
        if not same or (stiffer and reduced.damping_kind == "ratio"):
            continue
        change = beside[i] - values[i]
        damping = (there.damping_value - reduced.damping_value) / change
        if not np.array_equal(path[:-1], load_path[:-1]) or (damping and not _is_known_damping(reduced)):
            continue
        laws = _rates_of_laws(there, reduced, change)
        if laws is None:
            continue
        rates.laws[i] = laws
        if damping:
            rates.damping[i, DAMPING[reduced.damping_kind]] = damping
        rates.static_factors[i] = (path[-1] - load_path[-1]) / change
    return rates


def _further(scene: ReducedScene) -> int:
    """How many numbers laws have beside those of all."""
    return scene.laws["law_numbers"].shape[1] if "law_numbers" in scene.laws else 0


def _is_known_damping(scene: ReducedScene) -> bool:
    """Whether there are derivatives by the value of the damping."""
    return scene.damping_kind in DAMPING and not (scene.damping_kind == "ratio" and scene.sector is not None)


def _rates_of_laws(there: ReducedScene, here: ReducedScene, change: float) -> np.ndarray | None:
    """Of all numbers of the contacts' laws `[nc, columns]`; None where one changes that there are no derivatives by."""
    rates = np.column_stack([(there.laws[key] - here.laws[key]) / change for key in LAW_KEYS])
    if not _further(here):
        return rates
    further = np.nan_to_num((there.laws["law_numbers"] - here.laws["law_numbers"]) / change)
    known = np.zeros(further.shape, dtype=bool)
    for name, places in NUMBERS.items():
        known[here.laws["law"] == LAWS.index(name), places] = True
    # The law has the coefficients of its table; there is no other.
    rates[here.laws["law"] == LAWS.index("pressure"), LAW_KEYS.index("friction_coefficient")] = 0.0
    return None if np.any(further[~known]) else np.column_stack([rates, further])


def amplitude_slopes(comm: Comm, family: Family, scene: ReducedScene, monitor: int, rates: Rates) -> np.ndarray:
    """Derivatives of half a monitor's range as of `monitor_slopes`, `[parameters]`."""
    return monitor_slopes(comm, family, scene, monitor, rates, ("amplitude",))[0]


def monitor_slopes(
    comm: Comm, family: Family, scene: ReducedScene, monitor: int, rates: Rates, kinds: Sequence[str]
) -> np.ndarray:
    """Derivatives of quantities of a monitor at the solver's last point, at its frequency, `[kinds, parameters]`.

    NaN where the equations are singular, and of parameters without rates. Collective.

    Parameters
    ----------
    kinds : names of `QUANTITIES`, of monitors
    """
    known = known_rates(rates)
    slopes = np.full((len(kinds), len(rates)), np.nan)
    if not np.any(known):
        return slopes
    wanted = rates.at(known)

    def work(family: Family) -> np.ndarray | None:
        return None if family.describe() is None else family.differentiate_along(wanted, scene.sector is None)

    family.ask(inquiry_of_monitor(scene, monitor, wanted, kinds))
    found: np.ndarray | None = comm.bcast(family.visit(work))
    if found is not None:
        slopes[:, known] = found
    return slopes


def inquiry_of_monitor(scene: ReducedScene, monitor: int, rates: Rates | None, kinds: Sequence[str]) -> Inquiry:
    """What asks for derivatives of kinds of a monitor's quantities by what has rates; None: by frequency alone."""
    factors = np.arange(len(scene.monitors)) == monitor
    quantities = [(kind, factors) for kind in kinds]
    if rates is None:
        return Inquiry(quantities, scene)
    further = _further(scene)
    sliders = rates.laws.shape[2] > LAW_NUMBERS + further
    return Inquiry(quantities, scene, numbers=further > 0, sliders=sliders, damping=bool(np.any(rates.damping)))


def known_rates(rates: Rates) -> np.ndarray:
    """Which parameters have rates, `[parameters]`."""
    return np.asarray(np.isfinite(rates.laws).all(axis=(1, 2)) & np.isfinite(rates.static_factors).all(axis=1))


def _but_for_numbers(one: ReducedScene, other: ReducedScene) -> bool:
    """Whether two scenes differ in numbers of their contacts' laws and the value of their damping at most."""
    keys = [*LAW_KEYS, *(("law_numbers",) if _further(one) and _further(one) == _further(other) else ())]
    laws = one.laws | {key: other.laws[key] for key in keys}
    aligned = replace(one, laws=laws, damping_value=other.damping_value)
    return aligned.laws.keys() == other.laws.keys() and all(
        _same(getattr(aligned, each.name), getattr(other, each.name)) for each in fields(ReducedScene)
    )


def _same(one: object, other: object) -> bool:
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(_same(one[key], other[key]) for key in one)
    if isinstance(one, Sector) and isinstance(other, Sector):
        return one.digest == other.digest
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        return np.array_equal(np.asarray(one), np.asarray(other), equal_nan=np.asarray(one).dtype.kind == "f")
    return one is other or one == other
