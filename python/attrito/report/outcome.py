"""The first lines of a report: what came out, in numbers.

An equivalent damping ratio follows from the height of a peak where one mode responds, zeta = zeta_stuck A_stuck / A,
A by level; zeta_stuck is that of the half-power width of the stuck response, (f_2 - f_1) / (2 f_peak).
"""

from __future__ import annotations

import numpy as np

from attrito.report.view import View
from attrito.results.tables import contact_sets

# Contact sets whose shares are named; the rest are counted.
MOST_SETS = 4
# Shifts and dissipation below these parts are none.
NO_SHIFT, NO_ENERGY = 1e-6, 1e-9


def outcome(view: View) -> list[str]:
    """Sentences on the largest peak: where and how high, against stuck contacts, what damps it; empty without one."""
    if view.point is None or not view.monitors:
        return []
    return [_peak(view), *_against_stuck(view), *_dissipated(view)]


def _peak(view: View) -> str:
    name, point = view.monitors[0], view.point
    amplitude = view.result.monitor(name, "amplitude")[point]
    unit = view.result.unit(f"/monitors/{name}/amplitude")
    level = f" at level {view.level[point]:.4g}" if len(view.peaks) > 1 or view.level[point] != 1.0 else ""
    return (
        f"{name} moves by at most {amplitude:.4g} ({unit}), half its range, at {view.frequency[point]:.6g} Hz{level}."
    )


def _against_stuck(view: View) -> list[str]:
    linear = view.result.linear("stuck", view.monitors[0])
    if linear is None or len(linear[0]) < 3 or not np.max(linear[1]) > 0:
        return []
    hertz, response = linear
    top = int(np.argmax(response))
    if top in (0, len(hertz) - 1):
        return []
    point, stuck_hz = view.point, hertz[top]
    reached = view.result.monitor(view.monitors[0], "amplitude")[point] / view.level[point]
    shift = view.frequency[point] / stuck_hz - 1.0
    words = (
        "at the frequency"
        if abs(shift) < NO_SHIFT
        else f"{100 * abs(shift):.3g} % {'above' if shift > 0 else 'below'} that"
    )
    lower = 1.0 - reached / response[top]
    by = f"{100 * abs(lower):.3g} % {'lower' if lower >= 0 else 'higher'}"
    found = f"Against stuck contacts the peak is {by} by level and lies {words} of theirs, {stuck_hz:.6g} Hz"
    width = half_power_width(hertz, response)
    if width is not None and reached > 0:
        ratio = 0.5 * width / stuck_hz
        damped = 100 * ratio * response[top] / reached
        found += f"; as one mode it is damped by {damped:.3g} % of critical, stuck {100 * ratio:.3g} %"
    return [found + "."]


def half_power_width(hertz: np.ndarray, response: np.ndarray) -> float | None:
    """Width in Hz of the largest peak at 1 / sqrt(2) of its height; None where a side does not come down so far."""
    top = int(np.argmax(response))
    half = response[top] / np.sqrt(2.0)
    ends = []
    for step in (-1, 1):
        place = top
        while 0 <= place + step < len(response) and response[place] > half:
            place += step
        if response[place] > half:
            return None
        low, high = response[place], response[place - step]
        ends.append(hertz[place] + (hertz[place - step] - hertz[place]) * (half - low) / (high - low))
    return float(abs(ends[1] - ends[0]))


def _dissipated(view: View) -> list[str]:
    result = view.result
    if not result.contacts:
        return []
    energy = np.nan_to_num(result.array("/contacts/dissipated_energy"))
    own = energy[view.point]
    if not own.sum() > NO_ENERGY * np.abs(energy).sum(axis=1).max(initial=0.0):
        return ["The contacts dissipate nothing there."]
    unit = result.unit("/contacts/dissipated_energy")
    words = f"The contacts dissipate {_measured(own.sum(), unit)} a period there"
    shares = {name: own[contacts].sum() / own.sum() for name, contacts in contact_sets(result).items()}
    named = sorted(((share, name) for name, share in shares.items() if name), reverse=True)
    if len(shares) < 2 or not named:
        return [f"{words}."]
    places = ", ".join(f"{100 * share:.0f} % in {name}" for share, name in named[:MOST_SETS])
    rest = f", the rest in {len(named) - MOST_SETS} more sets" if len(named) > MOST_SETS else ""
    return [f"{words}: {places}{rest}."]


def _measured(value: float, unit: str) -> str:
    """`2.02 mm`; a unit that is the user's own in brackets."""
    if not unit:
        return f"{value:.4g}"
    return f"{value:.4g} ({unit})" if "," in unit else f"{value:.4g} {unit}"
