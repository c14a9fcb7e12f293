"""The lap joint with matching and with unlike meshes: peak and its frequency under refinement.

    .venv/bin/python benchmarks/unlike_plates.py --picture docs/pictures/unlike_plates.png [--folder out/unlike_plates]
    .venv/bin/python benchmarks/unlike_plates.py --cases 1.4-1.7-gauss 0.7-1-pair --band 136 138

`meshes/lap_joint.py` makes the plates, node on node or meshed 1 : 1.7; `input/lap_joint.toml` is swept about its peak,
without bounds. A case is size-ratio-points: the size of the mesh, the upper plate's where the ratio is not 1; the
ratio; and `pair` for node pairs, or the points on faces. Results that are there are not made again.

Meshes are compared at the geometric mean of both plates' element edges, that of the default mesh being 1. `off` is the
peak over that of the last case, less 1, `off_matching` over that of matching meshes with this edge, interpolated
between the cases with `pair`; null outside of them. JSON on stdout.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
from pathlib import Path

import h5py
import matplotlib
import numpy as np
from matplotlib.figure import Figure

from attrito.plots.style import BRANCH_COLOURS, STYLE, save

ROOT = Path(__file__).resolve().parent.parent
BAND = (136.0, 141.0)
CASES = (
    *("2-1.7-node", "1.4-1.7-node", "1-1.7-node", "2-1.7-gauss", "1.4-1.7-gauss", "2-1.7-cut"),
    *("2-1-pair", "1.4-1-pair", "1-1-pair", "0.7-1-pair", "0.5-1-pair"),
)
KINDS = {
    "pair": ("matching, node pairs", "o-", "#000000"),
    "node": ("1 : 1.7, nodes on faces", "s-", BRANCH_COLOURS[0]),
    "gauss": ("1 : 1.7, Gauss points", "^-", BRANCH_COLOURS[1]),
    "cut": ("1 : 1.7, cut faces", "D", BRANCH_COLOURS[2]),
}
# What is allowed between the two kinds of meshes
ALLOWED = 0.01


def model_of(folder: Path, size: str, ratio: float) -> None:
    """Mesh, matrices and model of one pair of plates."""
    command = [sys.executable, ROOT / "meshes/lap_joint.py", "--size", size, "--ratio", str(ratio), "--out", folder]
    subprocess.run(command, check=True, stdout=sys.stderr)
    attrito(folder, "import", "model.h5", "--calculix", "lap_joint", "--mesh", "lap_joint.inp")


def attrito(folder: Path, *arguments: str) -> None:
    """Run the command in a folder."""
    subprocess.run([sys.executable, "-m", "attrito.cli", *arguments], cwd=folder, check=True, stdout=sys.stderr)


def job_of(points: str, band: tuple[float, float] = BAND) -> str:
    """The lap joint's job with contacts of a kind, swept about its peak."""
    face = "tolerance = 1e-6" if points == "pair" else f'pairing = "face"\npoints = "{points}"\ntolerance = 1e-3'
    text = re.sub(r"\.\./out/\w+/", "", (ROOT / "input/lap_joint.toml").read_text())
    changes = {
        r"tolerance = .*": face,
        r"start_hz = .*\nstop_hz = .*": f"start_hz = {band[0]}\nstop_hz = {band[1]}",
        r"result\.h5": f"{points}.h5",
        r"modes = 20": f'modes = 20\nfile = "rom_{points}.h5"',
        r"\[static\]": '[static]\nbounds = "none"',
    }
    for old, new in changes.items():
        text, count = re.subn(old, new, text)
        assert count == 1, old
    return text


def run_case(folder: Path, case: str, band: tuple[float, float]) -> dict[str, object]:
    """Mesh, reduce and sweep one case, as far as that is not done, and read its peak."""
    size, ratio, points = case.split("-")
    own = folder / f"{size}_{ratio}"
    result = own / f"{points}.h5"
    if not result.exists():
        if not (own / "model.h5").exists():
            model_of(own.resolve(), size, float(ratio))
        (own / f"{points}.toml").write_text(job_of(points, band))
        attrito(own, "run", f"{points}.toml")
    mean = float(size) / float(ratio) ** 0.5
    return {"case": case, "points": points, "mean_size": round(mean, 4)} | peak_of(result)


def peak_of(path: Path) -> dict[str, float]:
    """Highest point of a sweep (every peak is a point of it), and what is solved with."""
    with h5py.File(path) as file:
        amplitude = file["monitors/tip/amplitude"][:]
        top = int(np.nanargmax(amplitude))
        return {
            "contacts": len(file["contacts/parameters/area"]),
            "peak": float(amplitude[top]),
            "frequency_hz": float(file["points/frequency_hz"][top]),
            "stuck_hz": float(file["linear/stuck/natural_hz"][0]),
            "tangent_hz": float(file["linear/tangent/natural_hz"][0]),
            "inside": bool(0 < top < len(amplitude) - 1),
        }


def matching_peaks(found: list[dict]) -> tuple[np.ndarray, np.ndarray]:
    """Edges, ascending, and peaks of the matching meshes."""
    rows = sorted((row["mean_size"], row["peak"]) for row in found if row["points"] == "pair")
    edges, peaks = np.array(rows).reshape(-1, 2).T
    return edges, peaks


def compare(found: list[dict]) -> None:
    """Put the distance from the last case, and from matching meshes with the same edge, into the rows."""
    edges, peaks = matching_peaks(found)
    for row in found:
        row["off"] = row["peak"] / found[-1]["peak"] - 1
        inside = len(edges) > 0 and edges[0] <= row["mean_size"] <= edges[-1]
        row["off_matching"] = row["peak"] / float(np.interp(row["mean_size"], edges, peaks)) - 1 if inside else None


def picture(found: list[dict]) -> Figure:
    """Peak and frequency against the mean edge, a line a kind of contact; grey: what is allowed about matching ones."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 3.8), constrained_layout=True)
        panels = figure.subplots(1, 2)
        for axes, key, label in zip(panels, ("peak", "frequency_hz"), ("Peak (mm)", "Its frequency (Hz)"), strict=True):
            for points, (name, look, colour) in KINDS.items():
                own = sorted((row["mean_size"], row[key]) for row in found if row["points"] == points)
                if own:
                    axes.plot(*zip(*own, strict=True), look, color=colour, markersize=5, label=name)
            axes.set(xlabel="Element edge, mean of both plates (default mesh: 1)", ylabel=label)
            axes.set_xlim(left=0.0)
        edges, peaks = matching_peaks(found)
        low, high = peaks * (1 - ALLOWED), peaks * (1 + ALLOWED)
        panels[0].fill_between(edges, low, high, color="#e6e6e6", label="1 % about matching meshes")
        panels[0].legend(loc="best")
    return figure


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="Peak of the lap joint with matching and unlike meshes.")
    parser.add_argument("--folder", type=Path, default=Path("out/unlike_plates"), help="for models and results")
    parser.add_argument("--cases", nargs="+", default=CASES, help="size-ratio-points, the last one the truth")
    parser.add_argument("--band", nargs=2, type=float, default=BAND, help="to sweep, Hz")
    parser.add_argument("--picture", type=Path, help="file to draw")
    arguments = parser.parse_args()
    found = [run_case(arguments.folder, case, tuple(arguments.band)) for case in arguments.cases]
    compare(found)
    if arguments.picture:
        save(picture(found), str(arguments.picture))
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
