"""The data of the paper's figures, as columns: each figure is one CSV file and one picture."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from attrito_verification.paper.study import INCLINED_WALL, LEVEL_WALL, Study
from attrito_verification.paper.wedge import FORCES, PRELOAD

Columns = dict[str, np.ndarray]
FREQUENCIES = (160.0, 80.0)
TRANSIENT_CYCLES = 48
LOOP_POINTS = 512
# Fpl/Fexc of Figs. 11 to 13; and the frequency of Fig. 13.
RATIOS = (84.0, 30.0)
PEAK_84_HZ = 132.0


def frequency_responses(
    study: Study, degrees: float, forces: list[float], approaches: list[str], step: float
) -> Columns:
    """Pseudo-FRFs of x (Figs. 5 and 11), m/N, each with its located peak among the points."""
    blocks = []
    grid = np.arange(FREQUENCIES[0], FREQUENCIES[1] - 0.5 * step, -step)
    for force in forces:
        for approach in approaches:
            wedge = study.wedge(degrees, approach)
            peak = wedge.peak(force)
            frequencies = np.sort(np.append(grid, peak.frequency_hz))[::-1]
            response = [point.amplitude[0] / force for point in wedge.respond(frequencies, force)]
            blocks.append(_block(approach, force, frequency_hz=frequencies, x_per_force=response))
    return _join(blocks)


def optimisation_curves(study: Study, degrees: float, approaches: list[str], count: int) -> Columns:
    """Peak of the pseudo-FRF against Fpl/Fexc (Figs. 7 and 10), m/N; `DTI` at C's peaks of the forces of Table 1."""
    forces = sorted({*FORCES, *np.geomspace(FORCES[0], FORCES[-1], count).tolist()})
    blocks = []
    for approach in approaches:
        peaks = [study.wedge(degrees, approach).peak(force) for force in forces]
        blocks.append(
            _block(
                approach,
                np.array(forces),
                frequency_hz=[peak.frequency_hz for peak in peaks],
                x_per_force=[peak.response for peak in peaks],
            )
        )
    peaks = [study.wedge(degrees, "C").peak(force) for force in FORCES]
    orbits = [study.orbit(degrees, peak.force, peak.frequency_hz) for peak in peaks]
    blocks.append(
        _block(
            "DTI",
            np.array(FORCES),
            frequency_hz=[peak.frequency_hz for peak in peaks],
            x_per_force=[orbit.amplitude[0] / force for orbit, force in zip(orbits, FORCES, strict=True)],
        )
    )
    return _join(blocks)


def hysteresis_loops(study: Study, degrees: float, forces: list[float], approaches: list[str]) -> Columns:
    """Loops at the peak of each approach (Figs. 6 and 12), and `DTI` at C's: u, m, T and N, N."""
    blocks = []
    for force in forces:
        for approach in approaches:
            peak = study.wedge(degrees, approach).peak(force)
            loop = study.wedge(degrees, approach).contact(peak.point).loop
            every = slice(None, None, len(loop.normal) // LOOP_POINTS)
            columns = {"u": loop.displacement[every], "t": loop.tangential[every], "n": loop.normal[every]}
            hertz = np.full(len(columns["u"]), peak.frequency_hz)
            blocks.append(_block(approach, force, frequency_hz=hertz, **columns))
        hertz = study.wedge(degrees, "C").peak(force).frequency_hz
        orbit = study.orbit(degrees, force, hertz)
        every = slice(None, None, len(orbit.time) // LOOP_POINTS or 1)
        columns = {"u": orbit.displacement[every, 0], "t": orbit.force[every, 0], "n": orbit.force[every, 1]}
        blocks.append(_block("DTI", force, frequency_hz=np.full(len(columns["u"]), hertz), **columns))
    return _join(blocks)


def preloading(study: Study) -> Columns:
    """The preload's histories and what they do (Fig. 9), for U1 and U2: s, N, m."""
    blocks = []
    for start in ("U1", "U2"):
        orbit, profile = study.preloading(start)
        every = slice(None, None, 4)
        time = orbit.time[every]
        columns = {"time": time, "preload": PRELOAD * np.interp(time, *profile.T)}
        columns |= _forces_and_displacements(orbit.force[every], orbit.monitors[every])
        blocks.append(_block(start, 0.0, **columns))
    return _join(blocks)


def transients(study: Study) -> Columns:
    """From the two preloads to the common steady state (Fig. 13), for U1 and U2: s, N, m."""
    blocks = []
    for start in ("U1", "U2"):
        orbit = study.transient(PRELOAD / RATIOS[0], PEAK_84_HZ, TRANSIENT_CYCLES, start)
        columns = {"time": orbit.time} | _forces_and_displacements(orbit.force, orbit.monitors)
        blocks.append(_block(start, PRELOAD / RATIOS[0], **columns))
    return _join(blocks)


def paper_figures(study: Study, quick: bool) -> dict[str, Callable[[], Columns]]:
    """What makes the data of each figure, by its number in the paper."""
    step, count = (2.0, 0) if quick else (0.25, 90)
    ratios = [PRELOAD / ratio for ratio in RATIOS]
    uncoupled = ["C", "U1", "U2"]
    return {
        "5": lambda: frequency_responses(study, LEVEL_WALL, list(FORCES), ["C", "U1"], step),
        "6": lambda: hysteresis_loops(study, LEVEL_WALL, [1.0, 24.0, 60.0], ["C", "U1"]),
        "7": lambda: optimisation_curves(study, LEVEL_WALL, ["C", "U1"], count),
        "9": lambda: preloading(study),
        "10": lambda: optimisation_curves(study, INCLINED_WALL, uncoupled, count),
        "11": lambda: frequency_responses(study, INCLINED_WALL, ratios, uncoupled, step),
        "12": lambda: hysteresis_loops(study, INCLINED_WALL, ratios, uncoupled),
        "13": lambda: transients(study),
    }


def select(columns: Columns, approach: str, force: float | None = None) -> Columns:
    """The rows of an approach, and of a force."""
    chosen = columns["approach"] == approach
    if force is not None:
        chosen &= np.isclose(columns["force"], force)
    return {name: values[chosen] for name, values in columns.items()}


def write_csv(path: Path, columns: Columns) -> None:
    """Write columns, 10 significant digits; units are SI."""
    texts = [
        [f"{value:.10g}" for value in column] if column.dtype.kind == "f" else column for column in columns.values()
    ]
    lines = [",".join(columns), *(",".join(row) for row in zip(*texts, strict=True))]
    path.write_text("\n".join(lines) + "\n")


def _forces_and_displacements(force: np.ndarray, monitors: np.ndarray) -> Columns:
    return {"t": force[:, 0], "n": force[:, 1], "x": monitors[:, 0], "y": monitors[:, 1]}


def _block(approach: str, force: float | np.ndarray, **columns: np.ndarray | list[float]) -> Columns:
    arrays = {name: np.asarray(values, dtype=float) for name, values in columns.items()}
    count = len(next(iter(arrays.values())))
    return {"approach": np.full(count, approach), "force": np.broadcast_to(force, count).astype(float)} | arrays


def _join(blocks: list[Columns]) -> Columns:
    return {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}
