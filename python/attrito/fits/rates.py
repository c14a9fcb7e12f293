"""Exact derivatives of an amplitude by parameters of a job: those that change contact laws and static loads alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import TYPE_CHECKING

import numpy as np

from attrito.fits.design import Parameter
from attrito.job.laws import LAW_KEYS
from attrito.library.derivatives import Inquiry, Rates, zero_rates
from attrito.library.family import Family
from attrito.library.reduced_scene import ReducedScene, Sector
from attrito.library.session import Options

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

# A scene, its load path `[corners, loads]`, and the solver's options
Solvable = tuple[ReducedScene, np.ndarray, Options]


def rates_of(
    parameters: Sequence[Parameter], values: np.ndarray, here: Solvable, at: Callable[[np.ndarray], Solvable]
) -> Rates:
    """Rates of each parameter; NaN of one that changes something else. Collective.

    Parameters
    ----------
    parameters, values : and where they are
    here, at : what is solved there; what is solved at other values
    """
    reduced, load_path, options = here
    rates = zero_rates(reduced, len(values))
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
        same = _but_for_laws(there, reduced) and other_options == options and path.shape == load_path.shape
        if not same or (stiffer and reduced.damping_kind == "ratio"):
            continue
        if not np.array_equal(path[:-1], load_path[:-1]):
            continue
        change = beside[i] - values[i]
        rates.laws[i] = np.column_stack([(there.laws[key] - reduced.laws[key]) / change for key in LAW_KEYS])
        rates.static_factors[i] = (path[-1] - load_path[-1]) / change
    return rates


def amplitude_slopes(comm: Comm, family: Family, scene: ReducedScene, monitor: int, rates: Rates) -> np.ndarray:
    """Derivatives of a monitor's amplitude at the solver's last point, at its frequency, `[parameters]`.

    NaN where the equations are singular, and of parameters without rates. Collective.
    """
    known = known_rates(rates)
    slopes = np.full(len(rates), np.nan)
    if not np.any(known):
        return slopes
    wanted = Rates(*(getattr(rates, each.name)[known] for each in fields(Rates)))

    def work(family: Family) -> np.ndarray | None:
        if family.describe() is None:
            return None
        if scene.sector is not None:
            # Receptances of a sector are not symmetric: there is no adjoint.
            found = family.differentiate_directly(wanted)
            return None if found is None else found[0]
        gradient = family.differentiate_by_adjoint()
        return None if gradient is None else gradient.along(wanted)[0]

    family.ask(Inquiry([("amplitude", np.arange(len(scene.monitors)) == monitor)], scene))
    found: np.ndarray | None = comm.bcast(family.visit(work))
    if found is not None:
        slopes[known] = found
    return slopes


def known_rates(rates: Rates) -> np.ndarray:
    """Which parameters have rates, `[parameters]`."""
    return np.asarray(np.isfinite(rates.laws).all(axis=(1, 2)) & np.isfinite(rates.static_factors).all(axis=1))


def _but_for_laws(one: ReducedScene, other: ReducedScene) -> bool:
    """Whether two scenes differ in `LAW_KEYS` of their contacts at most."""
    aligned = replace(one, laws=one.laws | {key: other.laws[key] for key in LAW_KEYS})
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
