"""The tables of a result, as CSV."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from attrito.results.curve import curve_of, points_along
from attrito.results.derivatives import sensitivity_columns
from attrito.results.motion import quantity_of
from attrito.results.result import Result, reading
from attrito.support.csv_text import cell, numbers
from attrito.support.hdf5_reading import as_text

# Of the most that a set dissipates: less has no shares, it is rounding.
SHARED = 1e-9
# Not in files of attrito 0.2
ENERGY_ERROR = "/contacts/dissipated_energy_error"


@reading
def table(result: Result, quantities: Sequence[str] = ()) -> str:
    """CSV, one line a point.

    `point, branch, frequency_hz, converged, outcome, stable, unique, period, iterations, estimate`, then four columns
    a monitor. What was not examined is empty. A last column `level` if the result holds several.

    Parameters
    ----------
    result : what `attrito.run` returns, an open `Result`, or the name of its file
    quantities : columns more of every monitor, of `first_harmonic`, `phase` (degrees), `velocity`, `acceleration`
    """
    columns: dict[str, Iterable[str]] = {
        "point": map(str, range(result.points)),
        "branch": _integers(result.array("/points/branch")),
        "frequency_hz": numbers(result.array("/points/frequency_hz")),
        "converged": _booleans(result.converged),
        "outcome": map(cell, result.outcome),
        "stable": _booleans(result.array("/points/stable")),
        "unique": _booleans(result.array("/points/unique")),
        "period": _integers(result.array("/points/period")),
        "iterations": _integers(result.array("/points/iterations")),
        "estimate": numbers(result.array("/points/estimate")),
    }
    for name in result.monitors:
        for quantity in ("amplitude", "mean", "low", "high"):
            columns[f"{name}_{quantity}"] = numbers(result.monitor(name, quantity))
        for quantity in quantities:
            values = np.where(result.converged, quantity_of(result, name, quantity), np.nan)
            columns[f"{name}_{quantity}"] = numbers(values)
    return _csv(columns | _level_column(result, np.arange(result.points)))


@reading
def contact_table(result: Result) -> str:
    """CSV, one line a point and contact, contacts counted from 0; the columns `t2_...` if the file has them."""
    real = ["n_mean", "n_min", "n_low", "n_high", "t1_mean", "t1_low", "t1_high"]
    if result.has("/contacts/t2_mean"):
        real += ["t2_mean", "t2_low", "t2_high"]
    real += ["stick", "slip", "open", "dissipated_energy"]
    nc = result.contacts
    point = np.repeat(np.arange(result.points), nc)
    columns: dict[str, Iterable[str]] = {
        "point": map(str, point),
        "frequency_hz": numbers(result.array("/points/frequency_hz")[point]),
        "contact": map(str, np.tile(np.arange(nc), result.points)),
        "state": [],
    }
    if nc:
        columns["state"] = map(cell, result.named("/contacts/state"))
    for name in real:
        columns[name] = numbers(result.array(f"/contacts/{name}").ravel()) if nc else []
    columns["unique"] = _booleans(result.array("/contacts/unique").ravel()) if nc else []
    return _csv(columns | _level_column(result, point))


def set_table(result: Result) -> str:
    """CSV, one line a point and contact set: totals of its contacts.

    `point, frequency_hz, set, contacts`, then how many are in each state, `stick, slip, open` (means of the fractions
    of the period), `n_mean` (the sum of mean normal forces), `dissipated_energy` a period and its share of that of all
    contacts; blank where hardly anything is dissipated; `dissipated_energy_error`, the sum of their estimated errors.
    Contacts of `[[contact]]` are a set without a name.
    """
    sets = contact_sets(result)
    counts, nc = result.points, result.contacts
    point = np.repeat(np.arange(counts), len(sets))
    member = np.zeros((len(sets), nc))
    for row, contacts in enumerate(sets.values()):
        member[row, contacts] = 1.0
    columns: dict[str, Iterable[str]] = {
        "point": map(str, point),
        "frequency_hz": numbers(result.array("/points/frequency_hz")[point]),
        "set": map(cell, [*sets] * counts),
        "contacts": map(str, np.tile(member.sum(axis=1).astype(int), counts)),
    }
    if nc:
        names = result.names("/contacts/state")
        state = result.array("/contacts/state")
        for number, name in enumerate(names):
            columns[name if name != "open" else "opened"] = map(str, _per_set(state == number, member).astype(int))
        for name in ("stick", "slip", "open"):
            columns[name] = numbers(_per_set(result.array(f"/contacts/{name}"), member / member.sum(axis=1)[:, None]))
        for name in ("n_mean", "dissipated_energy"):
            columns[name] = numbers(_per_set(result.array(f"/contacts/{name}"), member))
        energy = _per_set(result.array("/contacts/dissipated_energy"), member).reshape(counts, len(sets))
        whole = energy.sum(axis=1, keepdims=True)
        if result.has(ENERGY_ERROR):
            columns["dissipated_energy_error"] = numbers(_per_set(result.array(ENERGY_ERROR), member))
        columns["share"] = numbers(
            np.divide(
                energy, whole, out=np.full(energy.shape, np.nan), where=whole > SHARED * np.abs(energy).max(initial=0.0)
            ).ravel()
        )
    return _csv(columns | _level_column(result, point))


def contact_sets(result: Result) -> dict[str, np.ndarray]:
    """Numbers of the contacts of each contact set, by its name; those without one under an empty name."""
    if not result.contacts:
        return {}
    names = np.full(result.contacts, "", dtype=object)
    if result.has("/contacts/parameters/set"):
        names = np.array([as_text(name).strip() for name in result.array("/contacts/parameters/set")], dtype=object)
    return {name: np.flatnonzero(names == name) for name in dict.fromkeys(names.tolist())}


def _per_set(values: np.ndarray, member: np.ndarray) -> np.ndarray:
    """Sums over contacts `[np, nc]` weighted by set `[sets, nc]`, point by point, flat."""
    return np.asarray((np.asarray(values, dtype=float) @ member.T).ravel())


def sensitivity_table(result: Result) -> str:
    """CSV, one line a point, quantity and parameter: `point, frequency_hz, quantity, parameter, value, derivative`.

    Quantities are amplitudes and means of the monitors, as `tip_amplitude`; of modes `frequency_hz` and damping ratios.
    `value` is the parameter's; blank where its contacts differ. No line if the job asked for none.
    """
    point, columns = sensitivity_columns(result)
    return _csv(columns | _level_column(result, point))


@reading
def multiplier_table(result: Result) -> str:
    """CSV, one line a multiplier: `point, frequency_hz, method, real, imag, kind`; no line if none was computed.

    Of a sector of a wheel also `wavenumber`, blank for sliders.
    """
    header = ("method", "real", "imag", "kind")
    point = result.array("/multipliers/point") if result.has("/multipliers/point") else np.empty(0, dtype=int)
    columns: dict[str, Iterable[str]] = {
        "point": map(str, point),
        "frequency_hz": numbers(result.array("/points/frequency_hz")[point]),
    } | dict.fromkeys(header, ())
    if len(point):
        for name in ("method", "kind"):
            names = result.names(f"/multipliers/{name}")
            columns[name] = [cell(names[index]) for index in result.array(f"/multipliers/{name}")]
        for name in ("real", "imag"):
            columns[name] = numbers(result.array(f"/multipliers/{name}"))
    if result.has("/multipliers/wavenumber"):
        columns["wavenumber"] = ["" if n < 0 else str(n) for n in result.array("/multipliers/wavenumber")]
    return _csv(columns | _level_column(result, point))


@reading
def bifurcation_table(result: Result) -> str:
    """CSV, one line a bifurcation: `branch, point, frequency_hz, kind, real, imag, uncertain_hz`, then amplitudes."""
    if not result.has("/bifurcations/kind"):
        return "branch,point,frequency_hz,kind,real,imag,uncertain_hz\n"
    names = result.names("/bifurcations/kind")
    column = {name: result.array(f"/bifurcations/{name}") for name in ("branch", "point", "kind", "level")}
    columns: dict[str, Iterable[str]] = {
        "branch": map(str, column["branch"]),
        "point": map(str, column["point"]),
        "frequency_hz": numbers(result.array("/bifurcations/frequency_hz")),
        "kind": [cell(names[index]) for index in column["kind"]],
    }
    for name in ("real", "imag", "uncertain_hz"):
        columns[name] = numbers(result.array(f"/bifurcations/{name}"))
    for name in result.monitors:
        columns[f"{name}_amplitude"] = numbers(result.array(f"/bifurcations/amplitude/{name}"))
    return _csv(columns | _level_column(result, column["point"]))


def curve_table(result: Result, count: int) -> str:
    """CSV, `count` lines along the drawn curve: `level, branch, frequency_hz`, then the amplitude of each monitor."""
    places = points_along(result, count)
    curve = curve_of(result)
    point = places.astype(int)
    frequency, *amplitudes = curve.at(places)
    columns: dict[str, Iterable[str]] = {
        "level": numbers(result.array("/points/level")[point]),
        "branch": _integers(result.array("/points/branch")[point]),
        "frequency_hz": numbers(frequency),
    }
    for name, amplitude in zip(curve.monitors, amplitudes, strict=True):
        columns[f"{name}_amplitude"] = numbers(amplitude)
    return _csv(columns)


def _level_column(result: Result, point: np.ndarray) -> dict[str, Iterable[str]]:
    """The column `level`, if there is more than one."""
    level = result.array("/points/level") if result.has("/points/level") else np.empty(0)
    return {"level": numbers(level[point])} if len(np.unique(level)) > 1 else {}


def _csv(columns: dict[str, Iterable[str]]) -> str:
    lines = [",".join(map(cell, columns))]
    lines.extend(",".join(row) for row in zip(*columns.values(), strict=True))
    return "\n".join(lines) + "\n"


def _integers(values: np.ndarray) -> Iterator[str]:
    """Negative means not examined."""
    return ("" if value < 0 else str(value) for value in values.tolist())


def _booleans(values: np.ndarray) -> Iterator[str]:
    """1 true, 0 false, -1 not examined."""
    return ({1: "true", 0: "false"}.get(value, "") for value in np.asarray(values, dtype=int).tolist())
