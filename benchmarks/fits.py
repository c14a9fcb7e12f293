"""How often intervals of a fit hold the truth, and how wide they are beside the least there is.

    .venv/bin/python benchmarks/fits.py --trials 100 > fits.json

The wedge of `input/wedge.toml` answers at 30 frequencies, level 4, with stiffness 3e5 N/m, friction 0.5; noise of 3 %
is put on that, again in each trial, and both parameters are fitted from half of their values. Counted are trials in
which a parameter's interval of 95 % holds its truth, by the linear interval and by the profile. The Cramer-Rao bound is
that of the truth: the width of an interval whose deviations are known, 2 * 1.96 sqrt(diag (J^T J)^-1) there.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import tempfile
from pathlib import Path

import common  # isort: skip  # noqa: F401 (sets the threads of BLAS before numpy is loaded)
import h5py
import numpy as np
from mpi4py import MPI
from scipy.stats import norm

from attrito.fits.design import read_fit
from attrito.fits.run import run_fit
from attrito.fits.solution import Solution
from attrito.job.reading import read_job
from attrito.runs.progress import Progress

TRUTH = np.array([3.0e5, 0.5])
NOISE = 0.03
FREQUENCIES = np.linspace(112.0, 141.0, 30)
LEVEL = 4.0
WEDGE = Path(__file__).resolve().parents[1] / "input" / "wedge.toml"
KEYS = {
    "contact stiffness": ["contact[*].tangential_stiffness", "contact[*].normal_stiffness"],
    "friction coefficient": ["contact[*].friction_coefficient"],
}


def fit_of(folder: Path, amplitude: np.ndarray, profile: bool) -> dict:
    """The fit to a response."""
    rows = [
        f"{frequency!r},{value!r}" for frequency, value in zip(FREQUENCIES.tolist(), amplitude.tolist(), strict=True)
    ]
    (folder / "measured.csv").write_text("\n".join(["frequency_hz,amplitude", *rows]) + "\n")
    parameters = [
        {"name": name, "keys": keys, "low": 0.05 * value, "high": 20.0 * value, "start": 0.5 * value}
        for (name, keys), value in zip(KEYS.items(), TRUTH.tolist(), strict=True)
    ]
    data = {"name": "response", "file": str(folder / "measured.csv"), "monitor": "x", "level": LEVEL}
    return {
        "job": str(WEDGE),
        "file": str(folder / "fit.h5"),
        "profile": profile,
        "parameter": parameters,
        "data": [data | {"amplitude_deviation": NOISE}],
    }


def main() -> None:
    """Trials, as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--no-profile", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name, contextlib.redirect_stdout(io.StringIO()):
        found = trials(Path(name), options.trials, options.seed, not options.no_profile)
    print(json.dumps(found, indent=1))


def trials(folder: Path, count: int, seed: int, profile: bool) -> dict:
    """Fit as many noisy responses."""
    fit = read_fit(fit_of(folder, np.ones(len(FREQUENCIES)), profile), folder)
    progress = Progress(MPI.COMM_SELF)
    solved, rates = Solution(MPI.COMM_SELF, fit, fit.data[0], read_job(str(WEDGE)), progress).at(TRUTH)
    jacobian = rates["amplitude"] * TRUTH / (NOISE * solved["amplitude"][:, np.newaxis])
    bound = 2.0 * norm.ppf(0.975) * np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    random = np.random.default_rng(seed)
    held, widths = {"interval": [], "profile_interval": []}, []
    for _ in range(count):
        noisy = solved["amplitude"] * np.exp(NOISE * random.standard_normal(len(FREQUENCIES)))
        run_fit(MPI.COMM_SELF, read_fit(fit_of(folder, noisy, profile), folder))
        with h5py.File(folder / "fit.h5") as file:
            for name, rows in held.items():
                low, high = file[f"parameters/{name}"][()].T
                rows.append((low <= TRUTH) & (high >= TRUTH))
            low, high = file["parameters/interval"][()].T
            widths.append(np.log(high / low) / bound)
    by_parameter = range(len(TRUTH))
    return {
        "trials": count,
        "noise": NOISE,
        "parameters": list(KEYS),
        "held by the interval": [int(np.sum(held["interval"], axis=0)[i]) for i in by_parameter],
        "held by the profile": [int(np.sum(held["profile_interval"], axis=0)[i]) for i in by_parameter],
        "width over the Cramer-Rao bound, median": np.median(widths, axis=0).tolist(),
        "largest": np.max(widths, axis=0).tolist(),
    }


if __name__ == "__main__":
    main()
