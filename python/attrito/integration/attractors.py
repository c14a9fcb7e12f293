"""Motions that a scene comes to by itself: event-exact integration from eight stated starts.

Starts are states at the beginning of a period: the end of the static load path; rest with nothing loaded; the given
point, pushed by 1e-6 of its amplitude; and from the motion that the first of these comes to, its distance d = (dq, dv)
from the static solution, turned about and enlarged: 2 d, -d, (dq, -dv), (-dq, dv), 5 d. The list is finite, so there
may be motions that none of them meets.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import h5py
import numpy as np

from attrito.library.integrator import Integrator, Orbit, Run
from attrito.support.hdf5_writing import described

PUSH = 1e-6
# Two motions are one if they differ by less than this part of their amplitude: that of the integration's end.
ALIKE = 1e-3
TURNS = {
    "twice": (2.0, 2.0),
    "opposite": (-1.0, -1.0),
    "backwards": (1.0, -1.0),
    "mirrored": (-1.0, 1.0),
    "far": (5.0, 5.0),
}


@dataclass(frozen=True)
class State:
    """Displacement `[m]`, velocity `[m]` and sliders `[nc, 2]` at the beginning of a period."""

    displacement: np.ndarray
    velocity: np.ndarray
    sliders: np.ndarray


@dataclass(frozen=True)
class Attractor:
    """A motion, and the starts that came to it.

    Parameters
    ----------
    period : in periods of the excitation; 0: none up to the longest that was looked for
    settled : whether it is periodic, or at least not settling any more (period 0)
    family : whether a contact neither slips nor opens: it keeps the slider it has, and the mean with it
    amplitude, mean : of the monitors, `[monitors]`; of a family the mean of the first member met
    starts : names
    """

    period: int
    settled: bool
    family: bool
    amplitude: np.ndarray
    mean: np.ndarray
    starts: tuple[str, ...]


def pushed(state: State, amplitude: float, omega: float) -> State:
    """A state moved by `PUSH` of an amplitude, in a direction without pattern (turns by the golden angle)."""
    m = len(state.displacement)
    direction = np.cos(2.399963229728653 * np.arange(1, 2 * m + 1))
    step = PUSH * amplitude * direction / np.linalg.norm(direction)
    return State(state.displacement + step[:m], state.velocity + omega * step[m:], state.sliders)


def find_attractors(
    session: Integrator, choices: Run, path: np.ndarray, point: State | None = None, amplitude: float = 0.0
) -> list[Attractor]:
    """Every motion that the eight starts come to (seven without a point), in the order they are met.

    Parameters
    ----------
    session : of the scene
    choices : of each run; its `max_period_multiple` is the longest period that is recognised
    path : static load path, `[corners, loads]`
    point, amplitude : a solution's state at the beginning of the period, and its largest amplitude, if there is one
    """
    contacts, m = session.contacts, session.size
    rest = np.zeros((contacts, 2))

    def from_static() -> None:
        session.start_static(path)

    met: list[tuple[str, Orbit]] = []
    from_static()
    static = State(*session.state())
    met.append(("static", session.run(choices)))
    reached = State(*session.state())
    starts: dict[str, Callable[[], None]] = {
        "rest": lambda: session.start(np.zeros(m), np.zeros(m), rest, path[-1]),
    }
    if point is not None:
        moved = pushed(point, amplitude, 2.0 * np.pi * choices.frequency_hz)
        starts["point"] = lambda: session.start(moved.displacement, moved.velocity, moved.sliders, path[-1])
    away = reached.displacement - static.displacement
    for name, (by, rate) in TURNS.items():
        starts[name] = lambda by=by, rate=rate: session.start(
            static.displacement + by * away, rate * reached.velocity, static.sliders, path[-1]
        )
    for name, start in starts.items():
        start()
        met.append((name, session.run(choices)))
    return _gathered(met)


def _gathered(met: list[tuple[str, Orbit]]) -> list[Attractor]:
    """Runs that came to the same motion, together. Motions without period are taken for one."""
    found: list[Attractor] = []
    for name, orbit in met:
        for i, one in enumerate(found):
            if _alike(one, orbit):
                found[i] = dataclasses.replace(one, starts=(*one.starts, name))
                break
        else:
            settled = orbit.outcome != "not_converged"
            found.append(Attractor(orbit.period, settled, _holds(orbit), orbit.amplitude, orbit.mean, (name,)))
    return found


def _holds(orbit: Orbit) -> bool:
    # At its limit a contact still slips by what the integration leaves open.
    return bool(np.any(orbit.stick >= 1.0 - ALIKE))


def _alike(one: Attractor, orbit: Orbit) -> bool:
    if one.period != orbit.period or one.settled != (orbit.outcome != "not_converged"):
        return False
    if one.period == 0:
        return True
    scale = ALIKE * max(one.amplitude.max(), orbit.amplitude.max())
    far = np.abs(one.amplitude - orbit.amplitude).max()
    if not (one.family and _holds(orbit)):
        far = max(far, np.abs(one.mean - orbit.mean).max())
    return bool(far <= scale)


def summary_of(monitors: list[str], met: list[Attractor]) -> list[str]:
    """One line a motion."""
    lines = []
    for one in met:
        period = f"period {one.period}" if one.period else "no period" if one.settled else "still settling"
        sizes = ", ".join(f"{name} {value:.6g}" for name, value in zip(monitors, one.amplitude, strict=True))
        family = " (a contact keeps its slider: one of a family)" if one.family else ""
        lines.append(f"  from {', '.join(one.starts)}: {period}, amplitude {sizes}{family}")
    return lines


def write_attractors(file: h5py.File, monitors: list[str], met: list[Attractor]) -> None:
    """Add them to the group /integration of a file, if any were looked for."""
    if not met:
        return
    group = file.create_group("integration/attractors")
    data = {
        "period": ([one.period for one in met], "in periods of the excitation; 0: none recognised", "1"),
        "settled": ([int(one.settled) for one in met], "1: it does not settle any more", "1"),
        "family": ([int(one.family) for one in met], "1: a contact keeps its slider, means differ by start", "1"),
        "starts": ([", ".join(one.starts) for one in met], "starts that came to it", "1"),
    }
    for i, name in enumerate(monitors):
        data[f"{name}/amplitude"] = ([one.amplitude[i] for one in met], "half the range", "user length")
        data[f"{name}/mean"] = ([one.mean[i] for one in met], "mean over the period", "user length")
    for name, (values, description, unit) in data.items():
        described(group, name, description, unit, data=values)
