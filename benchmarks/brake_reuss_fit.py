"""The Brake-Reuss beam: stiffnesses and friction of its joint from backbones, attrito's own and a published one.

    .venv/bin/python benchmarks/brake_reuss_fit.py FOLDER --work out/brb \
        --picture docs/pictures/brake_reuss_fit.png > fit.json

FOLDER and `--work` are those of `brake_reuss.py`. A fit takes some dozens of backbones, so neighbouring pairs are
merged into patches of at most `--size`, closed and open ones at rest apart: a patch moves by the mean of its pairs,
weighted by their areas, and has all of their area. The structure is projected on its answers to forces on the patches
and its lowest modes, which is exact for static loads.

*Own backbone*: `attrito fit` of the quasi-static mode at the stiffnesses and friction of the folder's job, with noise
on frequency and damping, from other values than the truth.

*Published backbone*, above the amplitude `--lowest` and below Q = 1e-2: frequency over that at low amplitude, and 2 pi
times the damping ratio, which is Masing's rule on the first loading (docs/evidence/brake-reuss.md). It is by
`first_loading.py`, by dense algebra a hundred times quicker than cycles that close. `--whole N` then takes N steps of
Newton's method by residuals of the first loading of all pairs, with the patches' Jacobian, and ends with all pairs.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import brake_reuss
import h5py
import numpy as np
from first_loading import Loading, at_rest
from matplotlib.figure import Figure
from mpi4py import MPI
from scipy.linalg import cho_factor, cho_solve, eigh

from attrito.fits.design import read_fit
from attrito.fits.estimate import estimate
from attrito.fits.run import run_fit
from attrito.fits.solution import Solution
from attrito.job.job import Job
from attrito.job.reading import read_job
from attrito.modes.scene_at_rest import prepare, solver_at_rest
from attrito.runs.progress import Progress
from attrito.scene.build import build_scene

# Lowest modes that the projection keeps, the beam's own at low amplitude the seventh
MODES = 12
HIGHEST = 1.0e-2
PARAMETERS = {
    "kt": ("contact[*].tangential_stiffness", 0.02, 20.0, True),
    "kn": ("contact[*].normal_stiffness", 0.02, 20.0, True),
    "mu": ("contact[*].friction_coefficient", 0.02, 1.0, False),
}
STARTS = {"kt": 0.5, "kn": 2.0, "mu": 0.4}
# Standard deviations of the published ratio of frequencies, relative, and of its damping, relative and absolute, which
# are taken to be independent; step of differences
DEVIATIONS, STEP = (2e-3, 0.1, 1e-3), 1e-3


def merged(job: Path, size: int) -> dict[str, Any]:
    """The beam on patches of at most so many pairs: matrices, rows of the patches `[3 patches, m]`, load, areas."""
    file = job.with_name(f"merged-{size}.npz")
    if not file.exists():
        np.savez(file, **_merge(job, size))
    with np.load(file) as values:
        return dict(values)


def _merge(path: Path, size: int) -> dict[str, np.ndarray]:
    comm, job = MPI.COMM_SELF, read_job(str(path), excited=False)
    scene, progress = build_scene(job), Progress(comm)
    prepared = prepare(comm, job, scene, progress)
    with solver_at_rest(comm, job, prepared, progress) as solver:
        closed = np.asarray(solver.closed_contacts(), dtype=bool)
    area, reduced = scene.contacts.places["area"], prepared.reduced
    parts = []
    for kind in (True, False):
        waiting = [np.flatnonzero(closed == kind)]
        while waiting:
            pairs = waiting.pop()
            if len(pairs) > size:
                waiting += halves(pairs, scene.contacts.places["position"][pairs])
            elif len(pairs):
                parts.append(pairs)
    partition = np.empty(len(closed), dtype=np.int64)
    for number, pairs in enumerate(parts):
        partition[pairs] = number
    whole = np.bincount(partition, area)
    weights = np.zeros((len(whole), len(closed)))
    weights[partition, np.arange(len(closed))] = area / whole[partition]
    rows = np.einsum("pc,cim->pim", weights, reduced.directions.reshape(len(closed), 3, -1)).reshape(3 * len(whole), -1)
    springs = np.stack([reduced.laws[f"{way}_stiffness"] for way in ("tangential", "tangential", "normal")], 1)
    springs = np.stack([np.bincount(partition, column * closed) for column in springs.T], 1).ravel()
    load = prepared.load_path[-1] @ reduced.static
    basis = _answers(reduced.stiffness + (rows.T * springs) @ rows, reduced.mass, rows, load)
    laws = {name: float(reduced.laws[f"{name}_stiffness"].sum() / area.sum()) for name in ("tangential", "normal")}
    return {
        "mass": _symmetric(basis.T @ reduced.mass @ basis),
        "stiffness": _symmetric(basis.T @ reduced.stiffness @ basis),
        "rows": rows @ basis,
        "load": basis.T @ load,
        "end": reduced.monitors[0] @ basis,
        "area": whole,
        "friction": reduced.laws["friction_coefficient"].mean(),
        **laws,
    }


def halves(pairs: np.ndarray, positions: np.ndarray) -> list[np.ndarray]:
    """Two parts of some pairs, across the direction that their positions `[n, 3]` spread most in."""
    centred = positions - positions.mean(axis=0)
    along = centred @ np.linalg.svd(centred, full_matrices=False)[2][0]
    order = np.argsort(along, kind="stable")
    middle = len(pairs) // 2
    return [np.sort(pairs[order[:middle]]), np.sort(pairs[order[middle:]])]


def _answers(stiffness: np.ndarray, mass: np.ndarray, rows: np.ndarray, load: np.ndarray) -> np.ndarray:
    """Lowest modes and answers to forces on the rows and to the load, of unit energy and orthogonal, `[m, columns]`."""
    factor = cho_factor(stiffness)
    shapes = np.random.default_rng(1).standard_normal((len(mass), 2 * MODES))
    for _ in range(6):
        shapes = np.linalg.qr(cho_solve(factor, mass @ shapes))[0]
        shapes = shapes @ eigh(shapes.T @ stiffness @ shapes, shapes.T @ mass @ shapes)[1]
    columns = np.column_stack([shapes[:, :MODES], cho_solve(factor, np.column_stack([rows.T, load]))])
    columns /= np.sqrt(np.einsum("ij,ij->j", columns, stiffness @ columns))
    sizes, turned = np.linalg.eigh(columns.T @ stiffness @ columns)
    known = sizes > 1e-10 * sizes.max()
    return np.asarray(columns @ (turned[:, known] / np.sqrt(sizes[known])))


def _symmetric(matrix: np.ndarray) -> np.ndarray:
    return np.asarray(0.5 * (matrix + matrix.T))


def job_of(beam: dict[str, Any], amplitudes: np.ndarray) -> dict[str, Any]:
    """Its quasi-static mode."""

    def row(values: np.ndarray) -> list:
        return [[dof, value] for dof, value in enumerate(values.tolist())]

    contacts = [
        {
            "normal": row(normal),
            "tangents": [row(first), row(second)],
            "tangential_stiffness": float(beam["tangential"] * area),
            "normal_stiffness": float(beam["normal"] * area),
            "friction_coefficient": float(beam["friction"]),
        }
        for (first, second, normal), area in zip(
            beam["rows"].reshape(len(beam["area"]), 3, -1), beam["area"], strict=True
        )
    ]
    return {
        "model": {"mass": beam["mass"].tolist(), "stiffness": beam["stiffness"].tolist()},
        "contact": contacts,
        "load": [{"name": "bolts", "kind": "static", "dofs": row(beam["load"])}],
        "balance": {"harmonics": 1, "samples": 64},
        "mode": {
            "method": "quasi_static",
            "steps": 8,
            "near_hz": 167.0,
            "start": float(amplitudes[0]),
            "stop": float(amplitudes[-1]),
        },
        "output": {"file": "mode.h5", "monitors": [{"name": "end", "dofs": row(beam["end"])}]},
    }


def fit_of(beam: dict[str, Any], work: Path, name: str, columns: dict[str, np.ndarray], **data: Any) -> dict[str, Any]:
    """What is looked for, from a backbone of these columns."""
    lines = [",".join(columns), *(",".join(f"{x:.12g}" for x in row) for row in zip(*columns.values(), strict=True))]
    (work / f"{name}.csv").write_text("\n".join(lines) + "\n")
    return {
        "job": job_of(beam, columns["amplitude"]),
        "file": f"{name}.h5",
        "profile": False,
        "parameter": [
            {"name": one, "keys": [key], "low": low, "high": high, "factor": factor, "start": STARTS[one]}
            for one, (key, low, high, factor) in PARAMETERS.items()
        ],
        "data": [{"name": "backbone", "of": "mode", "file": f"{name}.csv", **data}],
    }


def solved_at(beam: dict[str, Any], fit: dict[str, Any], work: Path, values: np.ndarray) -> dict[str, np.ndarray]:
    """Of the fit's backbone at values of its parameters."""
    asked = read_fit(fit, work)
    job = read_job(fit["job"], work, excited=False)
    return Solution(MPI.COMM_SELF, asked, asked.data[0], job, Progress(MPI.COMM_SELF)).found(values)


def found_by(fit: dict[str, Any], work: Path, beam: dict[str, Any]) -> dict[str, Any]:
    """Fit; values and intervals, stiffnesses per area, and the solution beside the measurements."""
    with contextlib.redirect_stdout(sys.stderr):
        path = run_fit(MPI.COMM_SELF, read_fit(fit, work))
    scale = np.array([beam["tangential"], beam["normal"], 1.0])
    with h5py.File(path) as file:
        values, interval = file["parameters/value"][()], file["parameters/interval"][()]
        rows = file["data/backbone"]
        return {
            "factors": values.tolist(),
            "values": dict(zip(PARAMETERS, (values * scale).tolist(), strict=True)),
            "intervals": dict(zip(PARAMETERS, (interval * scale[:, np.newaxis]).tolist(), strict=True)),
            "correlation": file["parameters/correlation"][()].tolist(),
            "warnings": file.attrs["warnings"],
            "amplitude": rows["amplitude"][()].tolist(),
            "measured": {name: rows[f"measured/{name}"][()].tolist() for name in rows["measured"]},
            "solved": {name: rows[f"solved/{name}"][()].tolist() for name in rows["measured"]},
        }


def own_backbone(
    beam: dict[str, Any], work: Path, amplitudes: np.ndarray, noise: tuple[float, float], seed: int
) -> dict:
    """From attrito's own with noise, relative, of frequency and damping; with the errors of the parameters."""
    truth = np.array([1.0, 1.0, float(beam["friction"])])
    ones = np.ones(len(amplitudes))
    blank = {"amplitude": amplitudes, "frequency_hz": ones, "damping_ratio": ones}
    clean = solved_at(beam, fit_of(beam, work, "own", blank), work, truth)
    random = np.random.default_rng(seed)
    # Where nothing slips there is no damping to measure.
    columns = {
        "amplitude": amplitudes,
        "frequency_hz": clean["frequency_hz"] * np.exp(noise[0] * random.standard_normal(len(ones))),
        "damping_ratio": clean["damping_ratio"] * np.exp(noise[1] * random.standard_normal(len(ones))),
    }
    data = {"frequency_deviation": noise[0], "damping_deviation": noise[1]}
    found = found_by(fit_of(beam, work, "own", columns, **data), work, beam)
    return found | {"error": dict(zip(PARAMETERS, (np.array(found["factors"]) / truth - 1.0).tolist(), strict=True))}


class FirstLoading:
    """Residuals of the first loading of a job beside the published backbone.

    Parameters
    ----------
    job_at : the job where logarithms of stiffnesses over those of the folder's job and of friction are so
    published : its points that are compared
    low : the published frequency at low amplitude
    way : 1 or -1, of the beam's end: it is not said which way the published beam was loaded
    """

    def __init__(self, job_at: Callable[[np.ndarray], Job], published: np.ndarray, low: float, way: int):
        self._job_at, self._way, self.amplitude = job_at, way, published["modal_amplitude"]
        self.measured = {
            "frequency_ratio": published["frequency_hz"] / low,
            "damping_ratio": 2.0 * np.pi * published["damping_ratio"],
        }

    def solved(self, x: np.ndarray) -> dict[str, np.ndarray]:
        """Frequency over that at low amplitude, and damping by Masing's rule, at the amplitudes."""
        rest = at_rest(self._job_at(x))
        loading = Loading(rest | {"shape": self._way * rest["shape"]})
        curve = loading.curve(loading.omega**2 * np.geomspace(1.0e-6, 2.0 * HIGHEST, 80))
        at, known = np.log(self.amplitude), np.log(curve.amplitude)
        return {
            "frequency_ratio": np.interp(at, known, curve.omega / curve.omega[0]),
            "damping_ratio": np.interp(at, known, curve.masing),
        }

    def residuals(self, solved: dict[str, np.ndarray]) -> np.ndarray:
        """Over standard deviations."""
        frequency = np.log(solved["frequency_ratio"] / self.measured["frequency_ratio"])
        damping = solved["damping_ratio"] - self.measured["damping_ratio"]
        deviation = np.hypot(DEVIATIONS[1] * self.measured["damping_ratio"], DEVIATIONS[2])
        return np.concatenate([frequency / DEVIATIONS[0], damping / deviation])

    def with_jacobian(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residuals and their derivatives, by differences."""
        here = self.residuals(self.solved(x))
        beside = [self.residuals(self.solved(x + STEP * unit)) for unit in np.eye(len(x))]
        size = np.sqrt(np.mean(here**2))
        print(f"kt, kn, mu {np.exp(x).round(5).tolist()}  residual {size:.4g}", file=sys.stderr)
        return here, np.column_stack([(there - here) / STEP for there in beside])


def published_backbone(
    beam: dict[str, Any], job: Path, published: np.ndarray, lowest: float, whole: int, way: int
) -> dict[str, Any]:
    """Values and intervals from the published backbone, on patches and then on all pairs."""
    points = published[(published["modal_amplitude"] >= lowest) & (published["modal_amplitude"] < HIGHEST)]
    low = float(published["frequency_hz"][0])
    tables = job_of(beam, points["modal_amplitude"])

    def on_patches(x: np.ndarray) -> Job:
        kt, kn, mu = np.exp(x)
        contacts = [
            one
            | {
                "tangential_stiffness": kt * one["tangential_stiffness"],
                "normal_stiffness": kn * one["normal_stiffness"],
                "friction_coefficient": mu,
            }
            for one in tables["contact"]
        ]
        return read_job(tables | {"contact": contacts}, job.parent, excited=False)

    def on_pairs(x: np.ndarray) -> Job:
        scale = beam["tangential"], beam["normal"], 1.0
        return read_job(str(_with_laws(job, dict(zip(PARAMETERS, np.exp(x) * scale, strict=True)))), excited=False)

    bounds = np.log([(low, high) for _, low, high, _ in PARAMETERS.values()])
    patches, pairs = (FirstLoading(job_at, points, low, way) for job_at in (on_patches, on_pairs))
    best = estimate(patches.with_jacobian, np.log(list(STARTS.values())), bounds, known_deviations=False)
    truth = np.array([0.0, 0.0, np.log(beam["friction"])])
    found = {
        "on patches": _told(best.x, best.intervals, beam),
        "correlation": best.correlation.tolist(),
        "residual": float(np.sqrt(np.mean(best.residuals**2))),
        "residual at the values of the folder": float(np.sqrt(np.mean(patches.residuals(patches.solved(truth)) ** 2))),
        "amplitude": patches.amplitude.tolist(),
        "measured": {name: values.tolist() for name, values in patches.measured.items()},
        "solved": {name: values.tolist() for name, values in patches.solved(best.x).items()},
    }
    x = best.x
    for step in range(whole + 1 if whole else 0):
        solved = pairs.solved(x)
        residuals = pairs.residuals(solved)
        found[f"on all pairs, {step} steps"] = _told(x, best.intervals - best.x[:, np.newaxis] + x[:, np.newaxis], beam)
        found[f"residual, {step} steps"] = float(np.sqrt(np.mean(residuals**2)))
        found["whole"] = {name: values.tolist() for name, values in solved.items()}
        print(f"all pairs: {np.exp(x)}, residual {found[f'residual, {step} steps']:.4g}", file=sys.stderr)
        x = np.clip(x - np.linalg.lstsq(best.jacobian, residuals, rcond=None)[0], *bounds.T)
    return found


def _told(x: np.ndarray, intervals: np.ndarray, beam: dict[str, Any]) -> dict[str, list[float]]:
    """Value, and interval of 95 %, of each parameter; stiffnesses per area."""
    scale = np.array([beam["tangential"], beam["normal"], 1.0])
    rows = np.exp(np.column_stack([x, intervals])) * scale[:, np.newaxis]
    return dict(zip(PARAMETERS, rows.tolist(), strict=True))


def _with_laws(job: Path, values: dict[str, float]) -> Path:
    """The folder's job with other stiffnesses and friction."""
    text = job.read_text()
    for key, name in (("tangential_stiffness", "kt"), ("normal_stiffness", "kn"), ("friction_coefficient", "mu")):
        (line,) = (line for line in text.splitlines() if line.startswith(f"{key} = "))
        text = text.replace(line, f"{key} = {float(values[name])!r}")
    path = job.with_name("fitted.toml")
    path.write_text(text)
    return path


def draw(found: dict[str, dict[str, Any]], path: str) -> None:
    """Measurements and solutions."""
    figure = Figure(figsize=(9.0, 5.6), constrained_layout=True)
    titles = {"own": "attrito's own, with noise", "published": "published"}
    for column, (name, one) in zip(figure.subplots(2, len(found), squeeze=False).T, found.items(), strict=True):
        for axes, quantity in zip(column, one["measured"], strict=True):
            axes.semilogx(one["amplitude"], one["measured"][quantity], "ks", ms=4, mfc="none", label=titles[name])
            axes.semilogx(one["amplitude"], one["solved"][quantity], color="#0072B2", label="fitted, on patches")
            if "whole" in one:
                axes.semilogx(one["amplitude"], one["whole"][quantity], "--", color="#D55E00", label="all pairs")
        column[0].set(ylabel="Frequency (Hz)" if name == "own" else "Frequency / that at low amplitude")
        column[0].legend(frameon=False)
        column[1].set(ylabel="Damping ratio", yscale="log", xlabel=r"Amplitude $Q$ (m kg$^{1/2}$)")
    figure.savefig(path, dpi=110)


def main() -> None:
    """Both fits, as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--work", type=Path, default=Path("out/brb"))
    parser.add_argument("--size", type=int, default=16)
    parser.add_argument("--noise", type=float, nargs=2, default=(1e-3, 0.03), metavar=("FREQUENCY", "DAMPING"))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--lowest", type=float, default=2e-5)
    parser.add_argument("--of", nargs="*", choices=("own", "published"), default=("own", "published"))
    parser.add_argument("--way", type=int, choices=(1, -1), default=1)
    parser.add_argument("--whole", type=int, default=0)
    parser.add_argument("--picture")
    options = parser.parse_args()
    brake_reuss.prepare(options.folder, options.work)
    published = brake_reuss.reference(options.folder)
    keys = argparse.Namespace(harmonics=1, samples=64, steps=32)
    job = brake_reuss.job_of(options.folder, options.work, "quasi-static", keys)
    beam, found = merged(job, options.size), {}
    if "own" in options.of:
        at = published["modal_amplitude"]
        at = at[(at > 3e-5) & (at < 3e-3)]
        found["own"] = own_backbone(beam, options.work, at, options.noise, options.seed)
    if "published" in options.of:
        found["published"] = published_backbone(beam, job, published, options.lowest, options.whole, options.way)
    print(json.dumps(found, indent=1))
    if options.picture:
        draw(found, options.picture)


if __name__ == "__main__":
    main()
