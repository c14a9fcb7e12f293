"""The lap joint's peak against its contacts' stiffnesses, for docs/how-to/contact-stiffness.md.

    python meshes/lap_joint.py --out out/lap_joint
    attrito import out/lap_joint/model.h5 --calculix out/lap_joint/lap_joint --mesh out/lap_joint/lap_joint.inp
    .venv/bin/python benchmarks/contact_stiffness.py --picture docs/pictures/contact_stiffness.png > peaks.json

Stiffnesses per area are parts of E / t, t the thickness of a plate: both with kt = 0.8 kn, or one of them while the
other stays at E / t and 0.8 E / t. `--rows peaks.json` draws again what an earlier run has printed. The stiffest
joints take a minute of a processor each.
"""

from __future__ import annotations

import argparse
import json
import time
import tomllib
from pathlib import Path

import attrito

ROOT = Path(__file__).resolve().parents[1]
# Of one plate's steel, MPa, and its thickness, mm
MODULUS, THICKNESS = 2.1e5, 5.0
SERIES = {
    "both": (0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0),
    "kn": (0.01, 0.03, 0.1, 0.3, 1.0, 3.0),
    "kt": (0.01, 0.03, 0.1, 0.3, 1.0, 3.0),
}
LABELS = {"both": "both, kt = 0.8 kn", "kn": "kn alone", "kt": "kt alone"}


def peak(level: float, normal: float, tangential: float) -> dict[str, float]:
    """Frequency, amplitude and processor seconds of the peak with stiffnesses per area in parts of E / t."""
    job = tomllib.loads((ROOT / "input" / "lap_joint.toml").read_text())
    unit = MODULUS / THICKNESS
    job["contact_set"][0] |= {"normal_stiffness": normal * unit, "tangential_stiffness": 0.8 * tangential * unit}
    job["peak"] = {"start": level, "stop": level * 1.0001, "optimum": False, "look_for_higher": False}
    job["output"]["file"] = "../out/lap_joint/contact_stiffness.h5"
    started = time.process_time()
    with attrito.peak(job, folder=ROOT / "input", quiet=True) as found:
        row = {name: float(found[f"peaks/{name}"][0]) for name in ("frequency_hz", "amplitude")}
    return row | {"seconds": time.process_time() - started}


def compute(level: float) -> list[dict[str, float | str]]:
    """A row a series and stiffness."""
    rows = []
    for name, parts in SERIES.items():
        for part in parts:
            normal, tangential = (part if name in ("both", one) else 1.0 for one in ("kn", "kt"))
            rows.append({"series": name, "part": part} | peak(level, normal, tangential))
    return rows


def draw(rows: list[dict[str, float | str]], level: float, path: str) -> None:
    """Frequency, amplitude per newton and seconds against the stiffness."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.0), layout="constrained")
    titles = {"frequency_hz": "frequency of the peak, Hz", "amplitude": "peak, mm/N", "seconds": "processor, s"}
    for axes, (name, title) in zip(figure.subplots(1, 3), titles.items(), strict=True):
        for series, marker in zip(LABELS, "osv", strict=True):
            held = [row for row in rows if row["series"] == series]
            scale = level if name == "amplitude" else 1.0
            heights = [row[name] / scale for row in held]
            axes.plot([row["part"] for row in held], heights, marker + "-", ms=4, label=LABELS[series])
        axes.set(xscale="log", title=title, xlabel="stiffness per area over E/t")
        axes.title.set_fontsize(10)
        if name == "seconds":
            axes.set_ylim(bottom=0.0)
        axes.grid(alpha=0.3)
    figure.axes[1].legend(fontsize=8)
    figure.savefig(path, dpi=160)


def main() -> None:
    """Compute or read the rows, print them, draw them."""
    parser = argparse.ArgumentParser(description="peak of the lap joint against contact stiffness")
    parser.add_argument("--level", type=float, default=0.1, help="of the harmonic load, N")
    parser.add_argument("--rows", help="JSON of an earlier run")
    parser.add_argument("--picture", help="file of the picture")
    arguments = parser.parse_args()
    rows = json.loads(Path(arguments.rows).read_text()) if arguments.rows else compute(arguments.level)
    print(json.dumps(rows, indent=1))
    if arguments.picture:
        draw(rows, arguments.level, arguments.picture)


if __name__ == "__main__":
    main()
