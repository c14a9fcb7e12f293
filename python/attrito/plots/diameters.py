"""The nodal-diameter diagram of a wheel: natural frequencies against nodal diameter, and what engine orders excite.

Engine order e at a speed of rotation Omega excites the nodal diameter that it folds to, at the frequency e Omega:

    n(e) = |e - N round(e / N)|,   f = e Omega.

Drawn for all e this is a line through the origin up to N/2 (SAFE diagram) that is reflected at N/2 and at 0 (ZZENF
diagram). A mode of diameter n is in resonance where the line passes it at n.
Sources: Singh et al. 1988, Proc. 17th Turbomachinery Symposium (SAFE); Wildheim 1979, J. Appl. Mech. 46, 878-882.
"""

from __future__ import annotations

import json
from dataclasses import dataclass

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from attrito.plots.style import BRANCH_COLOURS, Look, legend_below
from attrito.results.result import Result

# Of a mode's frequency: how near an engine order counts as meeting it in the picture
MARGIN = 0.05
# Reflections of the line that are drawn at most
MOST_REFLECTIONS = 12


@dataclass(frozen=True)
class Meeting:
    """A mode that an engine order comes near to.

    Parameters
    ----------
    engine_order, diameter : e, and n(e)
    frequency_hz : natural frequency of the mode
    """

    engine_order: int
    diameter: int
    frequency_hz: float


def folded(engine_order: np.ndarray | int, sectors: int) -> np.ndarray:
    """The nodal diameter 0 ... N/2 that an engine order excites."""
    rest = np.mod(engine_order, sectors)
    return np.minimum(rest, sectors - rest)


def excited(engine_order: np.ndarray | int, sectors: int, way: int) -> np.ndarray:
    """The nodal diameter that an engine order excites, below 0 of a wave running backward.

    Parameters
    ----------
    way : 1 where engine orders run forward, -1 backward; 0: whichever way, as without Coriolis forces
    """
    if way == 0:
        return folded(engine_order, sectors)
    rest = np.mod(way * np.asarray(engine_order), sectors)
    return np.where(2 * rest > sectors, rest - sectors, rest)


def way_of(result: Result) -> int:
    """Which way the job's engine order runs, 1 or -1, where modes of waves both ways differ; else 0."""
    parted = np.any(result.array("/points/nodal_diameter") < 0)
    return (-1 if int(result.attribute("engine_order")) < 0 else 1) if parted else 0


def zigzag(sectors: int, speed_hz: float, highest_hz: float) -> np.ndarray:
    """Corners of the line of engine orders up to a frequency, `[corners, 2]`: nodal diameter and Hz."""
    last = highest_hz / speed_hz
    half = sectors / 2.0
    corners = half * np.arange(min(int(last / half), MOST_REFLECTIONS) + 1)
    if len(corners) <= MOST_REFLECTIONS:
        corners = np.append(corners, last)
    return np.column_stack([folded(corners, sectors), corners * speed_hz])


def meetings(
    diameter: np.ndarray, frequency_hz: np.ndarray, sectors: int, speed_hz: float, way: int = 0
) -> list[Meeting]:
    """Modes that some engine order comes as near to as `MARGIN`, at its own nodal diameter; `way` as in `excited`."""
    found = []
    for n, hz in zip(diameter, frequency_hz, strict=True):
        low, high = (hz * (1.0 + sign * MARGIN) / speed_hz for sign in (-1.0, 1.0))
        orders = np.arange(max(int(np.ceil(low)), 1), int(high) + 1)
        found += [Meeting(int(e), int(n), float(hz)) for e in orders[excited(orders, sectors, way) == n]]
    return found


def speed_of(result: Result) -> tuple[float | None, str]:
    """A speed for the line of engine orders in Hz, and what it is: of the job, or where its engine order is critical.

    None where the job turns at none and its engine order is 0.
    """
    job = json.loads(result.attribute("job"))
    speeds = [load["speed_hz"] for load in job["load"] if load["kind"] == "centrifugal" and load["speed_hz"]]
    if speeds:
        return float(speeds[0]), "the job's speed"
    order, sectors = abs(int(result.attribute("engine_order"))), int(result.attribute("sectors"))
    own = result.array("/points/nodal_diameter") == excited(order, sectors, way_of(result))
    elastic = (result.array("/points/kind") == 0) & own
    if order == 0 or not np.any(elastic):
        return None, ""
    return float(result.array("/points/frequency_hz")[elastic].min() / order), f"where engine order {order} is critical"


def diameter_diagram(result: Result, speed_hz: float | None = None, look: Look | None = None) -> Figure:
    """Natural frequencies of a file of `attrito linear-modes` of a wheel, and engine orders at a speed, Hz.

    Without a speed at that of `speed_of`. Circles: modes that an engine order comes near to.
    """
    look = look or Look()
    sectors = int(result.attribute("sectors"))
    diameter, frequency = result.array("/points/nodal_diameter"), result.array("/points/frequency_hz")
    given, what = (speed_hz, "") if speed_hz is not None else speed_of(result)
    with matplotlib.rc_context(look.style()):
        figure = look.figure((6.4, 4.8))
        axes = figure.subplots()
        _draw_both_ways(axes, diameter, frequency, f"modes, {result.attribute('state')}", sectors)
        axes.set_xlim(-0.4, sectors // 2 + 0.4)
        axes.set_ylim(0.0, 1.08 * max(frequency.max(), 1e-300))
        axes.xaxis.set_major_locator(matplotlib.ticker.MaxNLocator(integer=True))
        if given is not None:
            _draw_orders(axes, meetings(diameter, frequency, sectors, given, way_of(result)), sectors, given, what)
        axes.set_xlabel("Nodal diameter")
        axes.set_ylabel("Frequency (Hz)")
        legend_below(axes, 2)
    return figure


def _draw_both_ways(axes: Axes, diameter: np.ndarray, frequency: np.ndarray, label: str, sectors: int) -> None:
    """Modes of each diameter; where they differ those of waves running forward and those running backward."""
    if not np.any(diameter < 0):
        _draw_families(axes, diameter, frequency, label)
        return
    standing = np.mod(2 * diameter, sectors) == 0
    for own, way, look in ((diameter >= 0, "forward", ".-"), ((diameter < 0) | standing, "backward", "x--")):
        _draw_families(axes, np.abs(diameter[own]), frequency[own], f"{label}, running {way}", look)


def _draw_families(axes: Axes, diameter: np.ndarray, frequency: np.ndarray, label: str, look: str = ".-") -> None:
    """Modes of each diameter as dots, those of equal number joined."""
    numbers = np.array([np.count_nonzero(diameter[:i] == n) for i, n in enumerate(diameter)])
    for number in range(numbers.max(initial=-1) + 1):
        own = numbers == number
        axes.plot(
            diameter[own],
            frequency[own],
            look,
            color=BRANCH_COLOURS[0],
            linewidth=0.8,
            markersize=5,
            label=None if number else label,
        )


def _draw_orders(axes: Axes, met: list[Meeting], sectors: int, speed_hz: float, what: str) -> None:
    """The line of engine orders, its reflections, and the modes that are met."""
    line = zigzag(sectors, speed_hz, axes.get_ylim()[1])
    words = f"engine orders at {speed_hz:.4g} Hz" + (f", {what}" if what else "")
    axes.plot(*line[:2].T, color=BRANCH_COLOURS[1], label=words)
    if len(line) > 2:
        ends = f"reflected at {sectors / 2:g}" + (" and 0" if len(line) > 3 else "")
        axes.plot(*line[1:].T, color=BRANCH_COLOURS[1], linestyle="--", linewidth=1.0, label=ends)
    axes.plot(
        [abs(one.diameter) for one in met],
        [one.frequency_hz for one in met],
        "o",
        markerfacecolor="none",
        color=BRANCH_COLOURS[3],
        markersize=9,
        label=f"within {MARGIN:.0%} of an engine order" if met else None,
    )
    # Of several modes that an order meets the highest has its number, above it.
    for order in {one.engine_order for one in met}:
        top = max((one for one in met if one.engine_order == order), key=lambda one: one.frequency_hz)
        axes.annotate(
            str(order),
            (abs(top.diameter), top.frequency_hz),
            xytext=(0, 7),
            textcoords="offset points",
            ha="center",
            fontsize=0.85 * matplotlib.rcParams["font.size"],
            color=BRANCH_COLOURS[3],
            path_effects=[withStroke(linewidth=2.5, foreground="white")],
        )
