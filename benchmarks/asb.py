"""One bolted joint's stiffness and friction fitted to the measured backbone of one assembly, and predicted for others.

    .venv/bin/python benchmarks/asb.py FOLDER --fit C1 --predict C2 C3 C4 --picture asb.png > asb.json

FOLDER holds the matrices `MAT_NULLRED_<assembly>.mat` and measured backbones `ASB_<assembly>_20Nm_BB.mat` of
Nidish96/Computational-Work-For-ASB-Project. C1 to C4a are assemblies of one joint, 64 mm by 64 mm in four patches; CD1
has another, 121 mm by 25 mm with three bolts in five patches. A patch moves as a rigid face: it is a contact at its
centre or, with `--points 4`, at four points with its second moments of area, which turn with it. A contact has two
tangents or, with `--law iwan`, is two with one; all share stiffnesses per area, friction and the law's numbers. The
structures' own damping ratio is fitted, too, one for all. Several assemblies after `--fit` are fitted together; with
`--shift` by their frequencies over that at the lowest amplitude, as matrices err by more than joints shift.
The structures float: (2 pi 1 Hz)^2 M is added to their stiffness.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import common  # isort: skip  # noqa: F401 (sets the threads of BLAS before numpy is loaded)
import h5py
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from mpi4py import MPI
from scipy.io import loadmat

from attrito.fits.design import Fit, read_fit
from attrito.fits.run import run_fit
from attrito.fits.solution import Solution
from attrito.job.reading import read_job
from attrito.runs.progress import Progress

BOLT = 11580.0
POINTS = 12
# The mode that was measured is the first of C1, C3 and CD1, the second of the others.
SECOND = ("C2", "C4", "C4a")


def rows_of(data: dict, patch: int, points: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Rows x, y, n `[3, dofs]` of a patch's points, and area of each.

    A rigid face moves by u + theta x r; (x, y) of four points have the patch's moments: integral of x^2 = A x^2.
    """
    motion = data["LamT"][:, 6 * patch : 6 * patch + 6].T
    area = data["PatchAreas"].ravel()[patch]
    if points == 1:
        return [(motion[:3], area)]
    moments = data["GTG"].tocsr()[6 * patch : 6 * patch + 6, 6 * patch : 6 * patch + 6].diagonal()
    across, along = np.sqrt(moments[3:5] / area)
    found = []
    for x, y in ((along, across), (-along, across), (-along, -across), (along, -across)):
        turned = np.array([-y * motion[5], x * motion[5], y * motion[3] - x * motion[4]])
        found.append((motion[:3] + turned, area / 4.0))
    return found


def job_of(folder: Path, assembly: str, law: dict, points: int) -> dict:
    """The assembly's mode, contacts as the law says, stiffnesses at 1e11 N/m^3."""
    data = loadmat(folder / f"MAT_NULLRED_{assembly}.mat")
    mass, stiffness = data["M"], data["K"]
    stiffness = stiffness + (2.0 * np.pi) ** 2 * mass
    measured = backbone(folder, assembly)

    def row(column: np.ndarray) -> list:
        return [[dof, value] for dof, value in enumerate(column.tolist()) if value != 0.0]

    contacts = []
    one_tangent = law.get("law") == "iwan"
    for patch in range(data["PatchAreas"].size):
        for rows, area in rows_of(data, patch, points):
            x, y, n = (row(one) for one in rows)
            parts = [([x], 0.5), ([y], 0.5)] if one_tangent else [([x, y], 1.0)]
            for tangents, part in parts:
                contacts.append(
                    {
                        "normal": n,
                        "tangents": tangents,
                        "tangential_stiffness": 1e11 * area,
                        "normal_stiffness": 1e11 * area * part,
                        "friction_coefficient": 0.3,
                        **law,
                    }
                )
    return {
        "model": {"mass": mass.tolist(), "stiffness": (0.5 * (stiffness + stiffness.T)).tolist()},
        "damping": {"ratio": 1e-3},
        "contact": contacts,
        "load": [{"name": "bolts", "kind": "static", "dofs": row(BOLT * data["Fv"].ravel())}],
        "balance": {"harmonics": 3, "samples": 128},
        "mode": {
            "near_hz": float(measured[1][0]),
            "start": float(measured[0][0]),
            "stop": float(measured[0][-1]),
        },
        "output": {"file": f"{assembly}.h5", "monitors": [{"name": "first", "dofs": [[0, 1.0]]}]},
    }


def backbone(folder: Path, assembly: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Amplitude, frequency and damping ratio as measured, at some amplitudes equal in ratio."""
    data = loadmat(folder / f"ASB_{assembly}_20Nm_BB.mat")
    amplitude, frequency, damping = (data[name].ravel() for name in "QWZ")
    order = np.argsort(amplitude)
    at = np.geomspace(amplitude.min(), amplitude.max(), POINTS)
    return at, np.interp(at, amplitude[order], frequency[order]), np.interp(at, amplitude[order], damping[order])


def write_backbone(folder: Path, place: Path, assembly: str, shift: bool) -> str:
    """The same as a file of measurements."""
    path = place / f"{assembly}.csv"
    amplitude, frequency, damping = backbone(folder, assembly)
    frequency = frequency / frequency[0] if shift else frequency
    lines = [",".join(f"{value:.10g}" for value in row) for row in zip(amplitude, frequency, damping, strict=True)]
    path.write_text(
        "\n".join([f"amplitude,{'frequency_ratio' if shift else 'frequency_hz'},damping_ratio", *lines]) + "\n"
    )
    return str(path)


def fit_of(place: Path, folder: Path, assemblies: list[str], law: dict, points: int, shift: bool = False) -> Fit:
    """What is looked for, from the backbones of some assemblies."""
    parameters = [
        ("kt", ["contact[*].tangential_stiffness"], 1e-3, 1e3, True),
        ("kn", ["contact[*].normal_stiffness"], 1e-3, 1e3, True),
        ("mu", ["contact[*].friction_coefficient"], 1e-3, 3.0, False),
        ("structure", ["damping.ratio"], 1e-5, 1e-2, False),
    ]
    if law.get("law") == "iwan":
        parameters += [("chi", ["contact[*].chi"], -0.99, -0.05, False)]
    keys = {
        "job": job_of(folder, assemblies[0], law, points),
        "file": str(place / "fit.h5"),
        "profile": False,
        "parameter": [
            {"name": name, "keys": keys, "low": low, "high": high, "factor": factor}
            | ({"start": 0.01} if name == "mu" else {})
            for name, keys, low, high, factor in parameters
        ],
        "data": [
            {
                "name": assembly,
                "of": "mode",
                "file": write_backbone(folder, place, assembly, shift),
                "frequency_deviation": 1e-4,
                "damping_deviation": 0.03,
            }
            for assembly in assemblies
        ],
    }
    fit = read_fit(keys, place)
    jobs = [read_job(job_of(folder, assembly, law, points), place, excited=False) for assembly in assemblies]
    return replace(fit, data=tuple(replace(one, job=job) for one, job in zip(fit.data, jobs, strict=True)))


def main() -> None:
    """Fit, predict, and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--fit", nargs="+", default=["C1"])
    parser.add_argument("--predict", nargs="*", default=["C3"])
    parser.add_argument("--law", choices=("coulomb", "iwan"), default="coulomb")
    parser.add_argument("--points", type=int, choices=(1, 4), default=1)
    parser.add_argument("--shift", action="store_true")
    parser.add_argument("--picture")
    options = parser.parse_args()
    law = {"law": "iwan", "chi": -0.8, "beta": 1.0, "sliders": 16} if options.law == "iwan" else {}
    with tempfile.TemporaryDirectory() as name:
        place = Path(name)
        fit = fit_of(place, options.folder, options.fit, law, options.points, options.shift)
        with contextlib.redirect_stdout(sys.stderr):
            run_fit(MPI.COMM_SELF, fit)
        with h5py.File(place / "fit.h5") as file:
            values = file["parameters/value"][()]
            found = {"values": values.tolist(), "intervals": file["parameters/interval"][()].tolist()}
            found["warnings"] = file.attrs["warnings"]
        found["parameters"] = [parameter.name for parameter in fit.parameters]
        found["assemblies"] = {}
        for assembly in (*options.fit, *options.predict):
            other = fit_of(place, options.folder, [assembly], law, options.points)
            one = other.data[0]
            solution = Solution(MPI.COMM_SELF, other, one, read_job(one.job, excited=False), Progress(MPI.COMM_SELF))
            found["assemblies"][assembly] = compared(options.folder, assembly, solution.found(values))
    print(json.dumps(found, indent=1))
    if options.picture:
        draw(found, options.fit, options.picture)


def compared(folder: Path, assembly: str, solved: dict[str, np.ndarray]) -> dict:
    """Measured and solved, and both errors."""
    amplitude, frequency, damping = backbone(folder, assembly)
    return {
        "amplitude": amplitude.tolist(),
        "measured_hz": frequency.tolist(),
        "solved_hz": solved["frequency_hz"].tolist(),
        "measured_damping": damping.tolist(),
        "solved_damping": solved["damping_ratio"].tolist(),
        "largest error of frequency": float(np.nanmax(np.abs(solved["frequency_hz"] / frequency - 1.0))),
        "largest error of damping": float(np.nanmax(np.abs(solved["damping_ratio"] / damping - 1.0))),
    }


def draw(found: dict, fitted: list[str], path: str) -> None:
    """Frequency and damping of every assembly, measured and solved, with the largest error of each."""
    count = len(found["assemblies"])
    figure = Figure(figsize=(3.2 * count, 5.2), constrained_layout=True)
    for columns, (assembly, rows) in zip(
        figure.subplots(2, count, squeeze=False).T, found["assemblies"].items(), strict=True
    ):
        for axes, name, label in ((columns[0], "hz", "Frequency in Hz"), (columns[1], "damping", "Damping ratio")):
            axes.semilogx(rows["amplitude"], rows[f"measured_{name}"], "o", ms=3, color="#8a8a8a", label="measured")
            axes.semilogx(rows["amplitude"], rows[f"solved_{name}"], color="#0072B2", label="attrito")
            axes.set(ylabel=label)
            axes.xaxis.set_minor_formatter(NullFormatter())
        frequency, damping = (100.0 * rows[f"largest error of {name}"] for name in ("frequency", "damping"))
        way = "fitted" if assembly in fitted else "predicted"
        columns[0].set_title(f"{assembly}, {way}\nwithin {frequency:.2g} %", fontsize=9)
        columns[1].set_title(f"within {damping:{'.2g' if damping < 100.0 else '.0f'}} %", fontsize=9)
        columns[0].ticklabel_format(axis="y", useOffset=False)
        columns[1].ticklabel_format(axis="y", style="sci", scilimits=(0, 0))
        columns[1].set_xlabel("Amplitude Q")
        columns[0].legend(frameon=False)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()
