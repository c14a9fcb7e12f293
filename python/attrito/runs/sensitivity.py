"""Derivatives of a run's points by parameters of its job: found as each point is solved.

At a point's frequency, with the sliders of contacts that never slip held where they are, directly or by the adjoint:
`src/sensitivity/parameter_derivatives.f90`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from attrito.job.job import Job
from attrito.job.laws import LAW_KEYS
from attrito.job.sensitivity import DAMPING, Parameter, parameters_of, quantities_of
from attrito.library.derivatives import LAW_NUMBERS, Inquiry, Rates, zero_rates
from attrito.library.family import Family
from attrito.library.points import Point
from attrito.library.reduced_scene import ReducedScene
from attrito.library.series import Series
from attrito.library.session import Solver
from attrito.runs.onsets import SIDES, Find, branches, find_onset, margin_of, sides
from attrito.runs.peak_slopes import of_peak
from attrito.runs.recorder import Recorder
from attrito.runs.slider_rates import LoadPath, slider_rates
from attrito.scene.build import laws_of
from attrito.scene.scene import Scene
from attrito.support.parallel import on_root

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

CORNER = (
    "a contact is at the onset of slip: derivatives towards smaller and larger parameters are in columns below, above"
)
SOLVED = ("converged", "above_tolerance", "unstable", "indeterminate")
HELD = "by each parameter of [sensitivity] to, at the point's frequency, sliders of contacts that never slip held"
OF_A_MODE = "by each parameter of [sensitivity] to, at the mode's amplitude Q; NaN: none"
SERIES = {
    name: Series("real64", f"derivative of the monitors' {name} {HELD}; NaN: none", f"{name} per unit of the parameter")
    for name in ("amplitude", "mean")
} | {
    "quantities": Series(
        "real64",
        f"derivative of each quantity of [sensitivity] of {HELD}; NaN: none",
        "quantity per unit of the parameter",
    ),
    "value": Series(
        "real64", "the parameters, in the order of [sensitivity] to; NaN: its contacts differ", "each its own"
    ),
    "frequency_hz": Series(
        "real64",
        "derivative of the frequency by each parameter of [sensitivity] to; NaN: none, as of rigid-body modes",
        "Hz per unit of the parameter",
    ),
    "damping_ratio": Series("real64", f"derivative of the contacts' damping ratio {OF_A_MODE}", "1 per unit of it"),
    "damping_ratio_structure": Series("real64", f"derivative of the structure's {OF_A_MODE}", "1 per unit of it"),
}


class Differentiator:
    """Derivatives at one point after another.

    Parameters
    ----------
    comm, solver : what solves
    job, scene, reduced : what is solved; `scene` at the root
    path : what the start sliders of points come from; None: they are given

    Attributes
    ----------
    family : members of the last point
    values : of the parameters
    rates : what each changes
    """

    def __init__(
        self,
        comm: Comm,
        solver: Solver,
        job: Job,
        scene: Scene | None,
        reduced: ReducedScene,
        path: LoadPath | None = None,
    ):
        self._comm, self._solver, self._root = comm, solver, comm.rank == 0
        self.family = Family(comm, solver, len(reduced.laws["tangents"]), len(reduced.monitors))
        parameters = parameters_of(job)
        self.values = np.array([one.value(job) for one in parameters])
        self._shape = len(parameters), len(reduced.monitors)
        self._others = len(job["sensitivity"]["of"])
        if not parameters:
            return
        self._sector = reduced.sector is not None
        # With two tangents sliders of contacts that slip are unknowns of the point.
        self._sliders_move = bool(np.any(reduced.laws["tangents"] == 2))
        inquiry = on_root(comm, lambda: inquiry_of(job, scene, reduced, path is not None))
        self._inquiry = inquiry
        self.family.ask(inquiry)
        self.rates: Rates = on_root(comm, lambda: rates_of(job, scene, reduced, parameters, inquiry.columns(solver)))
        if path is not None:
            sliders = slider_rates(comm, job, scene, reduced, parameters, path)
            self.rates.laws[:, :, -sliders.shape[2] :] = sliders

    def visit(self, point: Point, recorder: Recorder) -> str:
        """Add the derivatives at the point where the solver stands to its record; what is to be said. Collective."""
        if not len(self.values):
            return ""
        found = self.derivatives(point)
        if self._root:
            self.record(recorder, found, np.where(self.rates.level != 0.0, point.level, self.values))
        both = self.at_onset(point, lambda family: self._find(family, self.rates))
        if self._root:
            for name, there in both.items():
                self.record(recorder, there, None, f"{name}/")
        return CORNER if self._root and np.any(np.isfinite(both["below"])) else ""

    def record(self, recorder: Recorder, found: np.ndarray, values: np.ndarray | None, folder: str = "") -> None:
        """Add derivatives `[quantities, parameters]` and the parameters' values to a point's record. At the root."""
        amplitude, mean, others = self._parts(found)
        series = {"amplitude": amplitude, "mean": mean}
        if values is not None:
            series["value"] = values
        if self._others:
            series["quantities"] = others
        for name, numbers in series.items():
            recorder.add(f"/sensitivity/{folder}{name}", SERIES[name], np.ascontiguousarray(numbers))

    def at_onset(self, point: Point, find: Find, rows: int = 0) -> dict[str, np.ndarray]:
        """Derivatives towards smaller and larger parameters, where contacts are at the onset of slip.

        NaN where none is. Collective.

        Parameters
        ----------
        find : gives derivatives of so many things and of all quantities, `[rows + quantities, parameters]`
        """
        nothing = dict.fromkeys(SIDES, np.vstack(self.nothing(rows)))
        if point.outcome not in SOLVED:
            return nothing
        margin = margin_of(self._sliders_move)
        onset = self._comm.bcast(self.family.visit(lambda family: find_onset(family, margin)))
        if onset is None:
            return nothing
        self.family.ask(replace(self._inquiry, quantities=[*self._inquiry.quantities, onset.dissipation]))
        found = self.family.visit(lambda family: branches(family, onset, find, self._sliders_move))
        self.family.ask(self._inquiry)
        return nothing if found is None else sides(*found)

    def of_peak(self, point: Point, monitor: int, at_corner: bool, preload: float = 1.0) -> np.ndarray:
        """Of the height and the frequency, Hz, of a monitor's peak where the solver stands.

        `[2, parameters]`, as `derivatives`. Collective.
        """
        rates = self.rates.with_preload(preload)

        def find(family: Family) -> np.ndarray | None:
            found = self._find(family, rates)
            by_frequency = family.differentiate_by_frequency()
            return None if found is None or by_frequency is None else np.append(found[monitor], by_frequency[monitor])

        def work(family: Family) -> np.ndarray | None:
            return of_peak(family, monitor, point.frequency_hz, at_corner, find, rates)

        found = self.family.visit(work) if point.outcome in SOLVED else None
        return self.nothing(2)[0] if found is None else found

    def derivatives(self, point: Point, preload: float = 1.0) -> np.ndarray:
        """Of all quantities at the point where the solver stands, `[quantities, parameters]` on the root.

        Amplitudes of the monitors, their means, then those of `[sensitivity] of`. `preload`: factor on the load path.
        NaN where the point is not solved, or is singular. Collective.
        """
        found: np.ndarray | None = None
        if len(self.values) and point.outcome in SOLVED:
            found = self.family.visit(lambda family: self._find(family, self.rates.with_preload(preload)))
        return self.nothing(0)[1] if found is None else found

    def nothing(self, rows: int) -> tuple[np.ndarray, np.ndarray]:
        """NaN in place of derivatives of so many things, and of all quantities."""
        parameters, monitors = self._shape
        return np.full((rows, parameters), np.nan), np.full((2 * monitors + self._others, parameters), np.nan)

    def _find(self, family: Family, rates: Rates) -> np.ndarray | None:
        """Directly or by the adjoint, whichever takes fewer linear systems."""
        if family.describe() is None:
            return None
        parameters, monitors = self._shape
        return family.differentiate_along(rates, not self._sector and parameters > 2 * monitors + self._others)

    def _parts(self, found: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of amplitudes and means, `[parameters, monitors]`, and of other quantities."""
        monitors = self._shape[1]
        return found[:monitors].T, found[monitors : 2 * monitors].T, found[2 * monitors :].T


def inquiry_of(job: Job, scene: Scene, reduced: ReducedScene, sliders: bool = False) -> Inquiry:
    """What a job asks derivatives of: amplitudes of the monitors, their means, then other quantities."""
    units = np.eye(len(reduced.monitors))
    quantities = [(kind, row) for kind in ("amplitude", "mean") for row in units]
    quantities += [(one.kind, one.factors(job, scene.contacts.tables)) for one in quantities_of(job)]
    parameters = parameters_of(job)
    return Inquiry(
        quantities,
        reduced,
        numbers=any(one.places and (one.key not in LAW_KEYS or one.row is not None) for one in parameters),
        sliders=sliders,
        damping=any(one.name in DAMPING for one in parameters),
    )


def rates_of(
    job: Job, scene: Scene, reduced: ReducedScene, parameters: list[Parameter], columns: int = LAW_NUMBERS
) -> Rates:
    """What parameters change of a scene; `columns`: of a contact."""
    rates = zero_rates(reduced, len(parameters), columns)
    for i, parameter in enumerate(parameters):
        rates.level[i] = parameter.name == "level"
        if parameter.places:
            _add_laws(job, scene, parameter, rates.laws[i])
        elif parameter.name in DAMPING:
            rates.damping[i, DAMPING.index(parameter.name)] = 1.0
        elif parameter.key:
            _add_load(job, scene, parameter.key, rates, i)
    return rates


def _add_laws(job: Job, scene: Scene, parameter: Parameter, laws: np.ndarray) -> None:
    """Rates of contacts' columns `[nc, columns]`; laws are linear in each of their numbers: any change gives them."""
    here = scene.contacts.laws
    value = parameter.value(job)
    change = abs(value) if value and np.isfinite(value) else 1.0
    there = laws_of(parameter.moved(job, change), scene.contacts)
    laws[:, :LAW_NUMBERS] = np.column_stack([(there[key] - here[key]) / change for key in LAW_KEYS])
    if parameter.row is not None:
        # The law has the coefficients of the table; mu is not asked for.
        laws[:, LAW_KEYS.index("friction_coefficient")] = 0.0
    if "law_numbers" in here and laws.shape[1] > LAW_NUMBERS:
        further = (there["law_numbers"] - here["law_numbers"]) / change
        laws[:, LAW_NUMBERS : LAW_NUMBERS + further.shape[1]] = np.nan_to_num(further)


def _add_load(job: Job, scene: Scene, name: str, rates: Rates, place: int) -> None:
    """Rates of the factor on a load; of harmonic ones on all loads of its harmonic, where it is alone."""
    if name in scene.static:
        number = list(scene.static).index(name)
        rates.static_factors[place, number] = scene.load_path[-1, number] if len(scene.load_path) else 1.0
        return
    harmonic = next(keys["harmonic"] for keys in job["load"] if keys["name"] == name)
    rates.harmonic_factors[place, harmonic - 1] = 1.0
