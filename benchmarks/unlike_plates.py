"""The lap joint with matching and with unlike meshes: peak and its frequency under refinement.

    .venv/bin/python benchmarks/unlike_plates.py [--folder out/unlike_plates] [--cases coarse-1-pair coarse-1.7-node]

`meshes/lap_joint.py` makes the plates, node on node or meshed 1 : 1.7, in its sizes; `input/lap_joint.toml` is swept
about its peak, without bounds. A case is the size, the ratio, and `pair` for node pairs, or the points on faces.
Results that are there are not made again. `off` is the peak over that of the last case, less 1. JSON on stdout.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np

ROOT = Path(__file__).resolve().parent.parent
BAND = "start_hz = 130.0\nstop_hz = 142.0"
CASES = ("coarse-1-pair", "coarse-1.7-node", "coarse-1.7-gauss", "default-1-pair")


def model_of(folder: Path, size: str, ratio: float) -> None:
    """Mesh, matrices and model of one pair of plates."""
    command = [sys.executable, ROOT / "meshes/lap_joint.py", "--size", size, "--ratio", str(ratio), "--out", folder]
    subprocess.run(command, check=True, stdout=sys.stderr)
    attrito(folder, "import", "model.h5", "--calculix", "lap_joint", "--mesh", "lap_joint.inp")


def attrito(folder: Path, *arguments: str) -> None:
    """Run the command in a folder."""
    subprocess.run([sys.executable, "-m", "attrito.cli", *arguments], cwd=folder, check=True, stdout=sys.stderr)


def job_of(points: str) -> str:
    """The lap joint's job with contacts of a kind, swept about its peak."""
    face = "tolerance = 1e-6" if points == "pair" else f'pairing = "face"\npoints = "{points}"\ntolerance = 1e-3'
    text = re.sub(r"\.\./out/\w+/", "", (ROOT / "input/lap_joint.toml").read_text())
    changes = {
        r"tolerance = .*": face,
        r"start_hz = .*\nstop_hz = .*": BAND,
        r"result\.h5": f"{points}.h5",
        r"modes = 20": f'modes = 20\nfile = "rom_{points}.h5"',
        r"\[static\]": '[static]\nbounds = "none"',
    }
    for old, new in changes.items():
        text, count = re.subn(old, new, text)
        assert count == 1, old
    return text


def peak_of(path: Path) -> dict[str, float]:
    """Highest point of a sweep (every peak is a point of it), and what is solved with."""
    with h5py.File(path) as file:
        amplitude = file["monitors/tip/amplitude"][:]
        top = int(np.nanargmax(amplitude))
        return {
            "contacts": len(file["contacts/parameters/area"]),
            "peak": float(amplitude[top]),
            "frequency_hz": float(file["points/frequency_hz"][top]),
            "tangent_hz": float(file["linear/tangent/natural_hz"][0]),
            "inside": bool(0 < top < len(amplitude) - 1),
        }


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="Peak of the lap joint with matching and unlike meshes.")
    parser.add_argument("--folder", type=Path, default=Path("out/unlike_plates"), help="for models and results")
    parser.add_argument("--cases", nargs="+", default=CASES, help="size-ratio-points, the last one the truth")
    arguments = parser.parse_args()
    found: list[dict] = []
    for case in arguments.cases:
        size, ratio, points = case.split("-")
        folder = arguments.folder / f"{size}_{ratio}"
        result = folder / f"{points}.h5"
        if not result.exists():
            if not (folder / "model.h5").exists():
                model_of(folder.resolve(), size, float(ratio))
            (folder / f"{points}.toml").write_text(job_of(points))
            attrito(folder, "run", f"{points}.toml")
        found.append({"case": case} | peak_of(result))
    for row in found:
        row["off"] = row["peak"] / found[-1]["peak"] - 1
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
