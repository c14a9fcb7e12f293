"""Forced resonance peaks beside what the nonlinear mode predicts of them: the lap joint and the demo blade.

    .venv/bin/python benchmarks/resonances.py [lap_joint blade] [--picture docs/pictures/resonances.png]

The jobs `input/<scene>.toml`, whose models must be there, are given tables `[peak]` and `[mode]`. `attrito peak`
follows the forced peak in the level of the load, `attrito mode` the tangent mode nearest to it by the extended periodic
motion concept, at POINTS amplitudes. Both scenes are shaken where they are looked at, so that a load F cos(omega t) in
quadrature with the monitor's first harmonic a_1 does the work pi F a_1 a period, and

    F = 2 omega^2 zeta sum_h h^2 q_h^H M q_h / a_1,    zeta = xi/(2 omega), contacts and structure together,

keeps the mode up (docs/how-to/nonlinear-modes.md): the level at which it predicts a peak of its frequency and
amplitude, interpolated in log F. A line a peak: level, both frequencies and amplitudes, their relative differences,
the damping ratio of the mode there, how far the monitor's mean has moved since the first peak, part of its amplitude,
and slipping contacts. `worst` is of the peaks at which damping is below DAMPED and the mean has moved by less than
STILL. JSON on standard output.
"""

from __future__ import annotations

import argparse
import tomllib
from pathlib import Path

import common  # isort: skip (sets the threads of BLAS before numpy is loaded)
import h5py
import numpy as np
from scipy.interpolate import PchipInterpolator

import attrito
from attrito.library.names import OUTCOMES
from attrito.peaks.curve import KINDS
from attrito.peaks.file import read_peaks

ROOT = Path(__file__).resolve().parent.parent
# Levels from and to, and values in between
RANGES = {
    "lap_joint": (0.01, 0.12, [0.02, 0.035, 0.055, 0.08, 0.1]),
    "blade": (0.2, 4.0, [0.4, 0.7, 1.2, 2.0, 2.8]),
}
# Damping ratio, and change of the mean by the amplitude, below which the mode should have the peak
DAMPED, STILL = 0.01, 0.05
# Amplitudes of a mode, and how far they go beyond the peaks'
POINTS, BEYOND = 16, 1.3


def job_of(scene: str, folder: Path, **tables: dict[str, object]) -> dict[str, object]:
    """The scene's job with other tables, its results in a folder."""
    job = tomllib.loads((ROOT / f"input/{scene}.toml").read_text()) | tables
    job["sweep"] = {key: value for key, value in job["sweep"].items() if key != "levels"}
    job["output"] = job["output"] | {"file": str(folder / f"{scene}.h5")}
    return job


def follow_peaks(scene: str, folder: Path) -> None:
    """Into `<scene>.peaks.h5`."""
    start, stop, values = RANGES[scene]
    keys = {"start": start, "stop": stop, "values": values, "optimum": False, "look_for_higher": False}
    attrito.peak(job_of(scene, folder, peak=keys), folder=ROOT / "input", quiet=True).close()


def follow_mode(scene: str, folder: Path) -> None:
    """Into `<scene>.mode.h5`, over the amplitudes of the peaks, nearest in frequency to the lowest of them."""
    data, _ = read_peaks(str(folder / f"{scene}.peaks.h5"))
    with attrito.linear_modes(job_of(scene, folder), folder=ROOT / "input", quiet=True) as modes:
        number = int(np.abs(modes["points/frequency_hz"][:] - data["frequency_hz"][0]).argmin())
        entry = abs(modes["monitors/tip/shape"][number])
    at_ends = data["amplitude"].min() / entry / BEYOND, data["amplitude"].max() / entry * BEYOND
    keys = {"start": at_ends[0], "stop": at_ends[1], "points": POINTS, "near_hz": data["frequency_hz"][0]}
    attrito.mode(job_of(scene, folder, mode=keys), folder=ROOT / "input", quiet=True).close()


def predicted(path: Path) -> dict[str, np.ndarray]:
    """Level, frequency, amplitude and damping ratio of the points of a mode at which contacts dissipate, by level."""
    with h5py.File(path) as file:
        points, monitor = file["points"], file["monitors/tip"]
        work = file["contacts/dissipated_energy"][:].sum(axis=1)
        dissipates = work > 0.0
        by_contacts, frequency = points["damping_ratio"][dissipates], points["frequency_hz"][dissipates]
        damping = by_contacts + points["damping_ratio_structure"][dissipates]
        first = np.hypot(*monitor["harmonics"][dissipates, 1:3].T)
        amplitude = monitor["amplitude"][dissipates]
    # The contacts' ratio is their work over 2 pi omega^2 sum h^2 q_h^H M q_h.
    level = work[dissipates] * damping / by_contacts / (np.pi * first)
    order = np.argsort(level)
    found = {"level": level, "frequency_hz": frequency, "amplitude": amplitude, "damping_ratio": damping}
    return {name: values[order] for name, values in found.items()}


def compared(scene: str, folder: Path) -> list[dict[str, float]]:
    """A line a peak, where the mode has its level."""
    path = folder / f"{scene}.peaks.h5"
    data, attributes = read_peaks(str(path))
    mode = predicted(folder / f"{scene}.mode.h5")
    with h5py.File(path) as file:
        mean = file[f"peaks/monitors/{attributes['monitor']}/harmonics"][:, 0]

    def at_peaks(name: str) -> np.ndarray:
        places, values = np.log(mode["level"]), mode[name]
        inside = (data["level"] >= mode["level"][0]) & (data["level"] <= mode["level"][-1])
        return np.where(inside, PchipInterpolator(places, values)(np.log(data["level"])), np.nan)

    damping, expected, natural = (at_peaks(name) for name in ("damping_ratio", "amplitude", "frequency_hz"))
    solved = (data["outcome"] != OUTCOMES.index("not_converged")) & np.isfinite(expected)
    rows = []
    for i in np.flatnonzero(solved):
        amplitude, frequency = data["amplitude"][i], data["frequency_hz"][i]
        rows.append(
            {
                "level": data["level"][i],
                "asked for": bool(data["kind"][i] == KINDS.index("value")),
                "frequency_hz": frequency,
                "amplitude": amplitude,
                "by the mode": natural[i],
                "amplitude by the mode": expected[i],
                "frequency differs": natural[i] / frequency - 1.0,
                "amplitude differs": expected[i] / amplitude - 1.0,
                "damping ratio": damping[i],
                "mean moved": (mean[i] - mean[0]) / amplitude,
                "slipping": int(data["states"][i][2]),
            }
        )
    return rows


def worst(rows: list[dict[str, float]]) -> dict[str, float]:
    """Largest differences of the peaks that the mode should have, and how many these are."""
    held = [row for row in rows if row["damping ratio"] < DAMPED and abs(row["mean moved"]) < STILL]
    return {"peaks": len(held)} | {
        name: max((abs(row[name]) for row in held), default=np.nan)
        for name in ("frequency differs", "amplitude differs", "damping ratio", "mean moved")
    }


def draw(found: dict[str, list[dict[str, float]]], path: str) -> None:
    """Frequency and amplitude by level of both against the level, and how far the mode is off."""
    import matplotlib

    matplotlib.use("agg")
    from matplotlib.figure import Figure

    from attrito.plots.style import Look

    look = Look()
    with matplotlib.rc_context(look.style()):
        figure = Figure(figsize=(4.2 * len(found), 6.6), layout="constrained")
        grid = figure.subplots(3, len(found), sharex="col", squeeze=False, height_ratios=(2, 2, 1.2))
        for column, (scene, rows) in zip(grid.T, found.items(), strict=True):
            data = {name: np.array([row[name] for row in rows]) for name in rows[0]}
            level = data["level"]
            column[0].plot(level, data["amplitude"] / level, "k.", label="forced peak")
            column[0].plot(level, data["amplitude by the mode"] / level, "--", label="by the mode")
            column[1].plot(level, data["frequency_hz"], "k.")
            column[1].plot(level, data["by the mode"], "--")
            for name, marker, label in (
                ("amplitude differs", "o", "amplitude"),
                ("frequency differs", "s", "frequency"),
            ):
                column[2].plot(level, 100.0 * data[name], marker + "-", markersize=3, linewidth=0.9, label=label)
            column[2].axhline(0.0, color="k", linewidth=0.6)
            column[2].set_xscale("log")
            column[2].set_xlabel("Level (N)")
            column[0].set_title(scene.replace("_", " "))
            column[0].set_ylim(bottom=0.0)
        grid[0, 0].set_ylabel("Amplitude by level (mm/N)")
        grid[1, 0].set_ylabel("Frequency (Hz)")
        grid[2, 0].set_ylabel("Mode over\npeak (%)")
        grid[0, 0].legend(loc="best")
        grid[2, 0].legend(loc="best")
        figure.savefig(path, dpi=160)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="*", default=list(RANGES), help="of lap_joint, blade")
    parser.add_argument("--folder", type=Path, default=ROOT / "out/resonances", help="where files go")
    parser.add_argument("--picture", help="file of a figure")
    parser.add_argument("--kept", action="store_true", help="do not follow again what the folder holds")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    found = {}
    for scene in options.scenes:
        for ending, follow in (("peaks", follow_peaks), ("mode", follow_mode)):
            if not (options.kept and (options.folder / f"{scene}.{ending}.h5").is_file()):
                follow(scene, options.folder)
        found[scene] = compared(scene, options.folder)
    if options.picture:
        draw(found, options.picture)
    common.report({scene: {"worst": worst(rows), "peaks": rows} for scene, rows in found.items()})


if __name__ == "__main__":
    main()
