"""What is known of every scene: columns over families and frequencies, their verdicts, and the files that keep them."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from attrito.support.atomic_files import whole_hdf5
from attrito.support.hdf5_writing import described
from attrito.support.version import __version__
from attrito_verification.scene_grid.methods import METHODS, OUTCOME_CODES, REASONS
from attrito_verification.scene_grid.scenes import Family, frequencies

VERDICTS = (
    "stable",
    "unstable",
    "indeterminate",
    "no_period_one_orbit",
    "not_converged",
    "no_static_solution",
)
# Motion in time that ends within this part of the amplitude of where it began has stayed; the verdict "stable" means
# an event-exact orbit at most so far from the balance's.
NEAR = 0.1
# What explains a verdict that motion in time does not bear out, in this order.
EXPLANATIONS = ("", "truncation", "near_neutral", "grazing", "slow", "unexplained")
COARSE, NEUTRAL = 1e-3, 0.05

COLUMNS = {
    "frequency_hz": "frequency of the excitation, Hz",
    "coupled_outcome": "of the coupled balance by all strategies in turn",
    "uncoupled_outcome": "of the balance with its mean frozen",
    "newton_early_stop_outcome": "of Newton's method from the point before, given up early, alone",
    "mean_regularisation_outcome": "of the same with springs on the mean that are relaxed, alone",
    "time_integration_outcome": "of Newton's method from means of integrated periods, alone",
    "period_march_outcome": "of Newton's method from periods marched one after another, alone",
    "newton_outcome": "of Newton's method from the point before, alone",
    "stuck_response_outcome": "of Newton's method from the stuck response, alone",
    "frequency_homotopy_outcome": "of small steps in frequency, alone",
    "level_homotopy_outcome": "of small steps in the level of the loads, alone",
    "stiffness_homotopy_outcome": "of contacts that are soft at first, alone",
    "iterations": "Newton iterations of the method named before",
    "amplitude": "half range of x of the first mass by the method named before, m",
    "estimate": "estimated relative error of the coupled balance's peak by truncation",
    "stable": "0 unstable, 1 stable, 2 indeterminate, -1 not examined",
    "reason": "why there is no verdict, or what decided: index into the attribute names",
    "largest_multiplier": "largest modulus of the dynamic multipliers",
    "orbit_distance": "of the event-exact orbit from the balance's, the largest over the period, part of its amplitude",
    "time_outcome": "of motion in time, from the solution pushed by 1e-6, or else from the static one",
    "time_period": "its period in periods of the excitation, 0: none up to 32",
    "time_cycles": "cycles until that was seen",
    "time_amplitude": "half range of x of the first mass in its last period, m",
    "time_distance": "of the motion it ends in from the balance's, part of the amplitude",
    "static_failed": "1: no static solution was found",
    "verdict": "index into the attribute names",
    "right": "1: motion in time bears the verdict out, 0: it does not, -1: it says nothing of it",
    "explanation": "of a verdict that is not borne out: index into the attribute names",
    "seconds_verdict": "processor time of solution and verdict, and of motion in time where there is none, s",
    "seconds_check": "processor time of the motion in time that a verdict is held against, s",
    "seconds_methods": "processor time of all other methods, s",
}


@dataclass(frozen=True)
class Grid:
    """Families `[nf]` and their columns `[nf, frequencies]`."""

    families: list[Family]
    data: dict[str, np.ndarray]

    @property
    def scenes(self) -> int:
        """How many."""
        return self.data["verdict"].size

    def verdict(self, name: str) -> np.ndarray:
        """Where a verdict was reached, `[nf, frequencies]`."""
        return self.data["verdict"] == VERDICTS.index(name)


def gather(families: list[Family], columns: list[dict[str, np.ndarray]]) -> Grid:
    """One grid of the columns of families; what a family lacks is NaN."""
    count = len(frequencies())
    names = sorted({name for one in columns for name in one})
    blank = np.full(count, np.nan)
    data = {name: np.array([one.get(name, blank) for one in columns]) for name in names}
    for name in (
        "stable",
        "time_distance",
        "orbit_distance",
        "largest_multiplier",
        "estimate",
        "reason",
        *_of_methods(),
    ):
        data.setdefault(name, np.full((len(families), count), np.nan))
    data["frequency_hz"] = np.tile(frequencies(), (len(families), 1))
    data["verdict"] = _verdicts(data)
    data["right"] = _borne_out(data)
    data["explanation"] = _explanations(data)
    return Grid(families, data)


def _of_methods() -> list[str]:
    return [f"{method}_{what}" for method in METHODS for what in ("outcome", "iterations", "amplitude")]


def _verdicts(data: dict[str, np.ndarray]) -> np.ndarray:
    """Every scene ends as one of `VERDICTS`."""
    stable, period = data["stable"], data["time_period"]
    solved = data["coupled_outcome"] == OUTCOME_CODES["converged"]
    verdict = np.where(period == 1, VERDICTS.index("not_converged"), VERDICTS.index("no_period_one_orbit"))
    verdict = np.where(solved, VERDICTS.index("indeterminate"), verdict)
    verdict = np.where(solved & (stable == 1), VERDICTS.index("stable"), verdict)
    verdict = np.where(solved & (stable == 0), VERDICTS.index("unstable"), verdict)
    unsettled = ~solved & (data["time_outcome"] == OUTCOME_CODES["not_converged"])
    verdict = np.where(unsettled, VERDICTS.index("not_converged"), verdict)
    return np.where(data["static_failed"] == 1, VERDICTS.index("no_static_solution"), verdict)


def _borne_out(data: dict[str, np.ndarray]) -> np.ndarray:
    stays = (data["time_period"] == 1) & (data["time_distance"] <= NEAR)
    right = np.full(stays.shape, -1)
    right = np.where(data["verdict"] == VERDICTS.index("stable"), stays, right)
    return np.where(data["verdict"] == VERDICTS.index("unstable"), ~stays, right)


def _explanations(data: dict[str, np.ndarray]) -> np.ndarray:
    wrong = data["right"] == 0
    slow = (data["time_outcome"] == OUTCOME_CODES["not_converged"]) & (data["time_distance"] <= NEAR)
    cases = {
        "slow": slow,
        "grazing": data["reason"] == 3,
        "near_neutral": np.abs(data["largest_multiplier"] - 1.0) <= NEUTRAL,
        "truncation": data["estimate"] > COARSE,
    }
    explanation = np.full(wrong.shape, EXPLANATIONS.index("unexplained"))
    for name, holds in cases.items():
        explanation = np.where(holds, EXPLANATIONS.index(name), explanation)
    return np.where(wrong, explanation, 0)


def write_hdf5(path: Path, grid: Grid) -> None:
    """All columns, each with its description."""
    with whole_hdf5(path) as file:
        file.attrs["format"] = "attrito torture"
        file.attrs["format_version"] = 1
        file.attrs["attrito_version"] = __version__
        file.attrs["description"] = "Methods and verdicts over a grid of small scenes; see docs/explanation/limits.md"
        for name, description in _parameters().items():
            values = [getattr(family, name) for family in grid.families]
            kind = h5py.string_dtype() if name == "preload" else None
            described(file, f"families/{name}", description, data=values, dtype=kind)
        for name, values in grid.data.items():
            described(file, f"scenes/{name}", *describe(name), data=values, compression="gzip")
        for name, names in (
            ("verdict", VERDICTS),
            ("explanation", EXPLANATIONS),
            ("reason", tuple(REASONS.values())),
            *((f"{method}_outcome", tuple(OUTCOME_CODES)) for method in METHODS),
            ("time_outcome", tuple(OUTCOME_CODES)),
        ):
            file[f"scenes/{name}"].attrs["names"] = list(names)


def describe(name: str) -> tuple[str, str]:
    """Description and unit of a column."""
    if name not in COLUMNS:
        method, what = name.rsplit("_", 1)
        description, unit = COLUMNS[what], "m" if what == "amplitude" else "1"
        return f"{description.replace('the method named before', method)}", unit
    unit = {"frequency_hz": "Hz", "time_amplitude": "m"}.get(name, "s" if name.startswith("seconds") else "1")
    return COLUMNS[name], unit


def _parameters() -> dict[str, str]:
    return {
        "masses": "1: the wedge; more: the chain",
        "ratio": "contact stiffness, kn = kt, in kx",
        "friction": "friction coefficient",
        "preload": "static force towards the wall",
        "degrees": "inclination of the wall",
    }


def write_csv(path: Path, grid: Grid) -> None:
    """One row a scene."""
    names = [name for name in grid.data if not name.startswith("seconds")]
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow([*_parameters(), *names])
        for i, family in enumerate(grid.families):
            parameters = [getattr(family, name) for name in _parameters()]
            for values in zip(*(grid.data[name][i] for name in names), strict=True):
                rows.writerow([*parameters, *(_text(name, value) for name, value in zip(names, values, strict=True))])


def _text(name: str, value: float) -> str:
    if np.isnan(value):
        return ""
    words = {"verdict": VERDICTS, "explanation": EXPLANATIONS}
    if name in words:
        return words[name][int(value)]
    if name.endswith("_outcome"):
        return tuple(OUTCOME_CODES)[int(value)]
    return f"{value:.9g}"
