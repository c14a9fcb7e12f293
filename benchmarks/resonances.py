"""Forced resonance peaks beside what the nonlinear mode expects of them: the lap joint and the demo blade.

    .venv/bin/python benchmarks/resonances.py [lap_joint blade] [--picture docs/resonances.png]

The jobs `input/<scene>.toml`, whose models must be there, are given a table `[peak]`: `attrito peak` follows the forced
peak in the level of the load, and the backbone of its mode by the extended periodic motion concept, which expects a
peak at the level whose work a period, in quadrature with the motion, is that of the damping. A line a peak: level, both
frequencies and amplitudes, their relative differences, the damping ratio of the mode there, how far the monitor's mean
has moved since the first peak, part of its amplitude, and slipping contacts. `worst` is of the peaks at which damping
is below DAMPED and the mean has moved by less than STILL. JSON on standard output.
"""

from __future__ import annotations

import argparse
import tomllib
from pathlib import Path

import common  # isort: skip (sets the threads of BLAS before numpy is loaded)
import h5py
import numpy as np

import attrito
from attrito.library.names import OUTCOMES
from attrito.peaks.curve import KINDS
from attrito.peaks.file import read_backbone, read_peaks

ROOT = Path(__file__).resolve().parent.parent
# Levels from and to, and values in between
RANGES = {
    "lap_joint": (0.01, 0.12, [0.02, 0.035, 0.055, 0.08, 0.1]),
    "blade": (0.2, 4.0, [0.4, 0.7, 1.2, 2.0, 2.8]),
}
# Damping ratio, and change of the mean by the amplitude, below which the mode should have the peak
DAMPED, STILL = 0.01, 0.05


def followed(scene: str, folder: Path) -> Path:
    """The file of a scene's peaks and backbone."""
    tables = tomllib.loads((ROOT / f"input/{scene}.toml").read_text())
    start, stop, values = RANGES[scene]
    tables["peak"] = {"start": start, "stop": stop, "values": values, "backbone": True}
    tables["peak"] |= {"optimum": False, "look_for_higher": False}
    tables["sweep"] = {key: value for key, value in tables["sweep"].items() if key != "levels"}
    tables["output"] = tables["output"] | {"file": str(folder / f"{scene}.h5")}
    attrito.peak(tables, folder=ROOT / "input", quiet=True).close()
    return folder / f"{scene}.peaks.h5"


def compared(path: Path) -> list[dict[str, float]]:
    """A line a peak of a file."""
    data, attributes = read_peaks(str(path))
    backbone = read_backbone(str(path))
    assert backbone is not None
    with h5py.File(path) as file:
        mean = file[f"peaks/monitors/{attributes['monitor']}/harmonics"][:, 0]
    order = np.argsort(backbone["level"])
    damping = np.interp(data["level"], backbone["level"][order], backbone["damping_ratio"][order])
    expected = data["backbone_response"] * data["level"]
    rows = []
    for i in np.flatnonzero(data["outcome"] != OUTCOMES.index("not_converged")):
        amplitude, frequency = data["amplitude"][i], data["frequency_hz"][i]
        rows.append(
            {
                "level": data["level"][i],
                "asked for": bool(data["kind"][i] == KINDS.index("value")),
                "frequency_hz": frequency,
                "amplitude": amplitude,
                "by the mode": data["backbone_frequency_hz"][i],
                "amplitude by the mode": expected[i],
                "frequency differs": data["backbone_frequency_hz"][i] / frequency - 1.0,
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
    parser.add_argument("--kept", action="store_true", help="do not follow anew what the folder holds")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    found = {}
    for scene in options.scenes:
        path = options.folder / f"{scene}.peaks.h5"
        if not (options.kept and path.is_file()):
            path = followed(scene, options.folder)
        found[scene] = compared(path)
    if options.picture:
        draw(found, options.picture)
    common.report({scene: {"worst": worst(rows), "peaks": rows} for scene, rows in found.items()})


if __name__ == "__main__":
    main()
