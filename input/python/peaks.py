"""The resonance peak against the level, without sweeps, and what it depends on."""

# %%
import tomllib
from pathlib import Path

import numpy as np
from mpi4py import MPI

import attrito

inputs = Path(__file__).parents[1]
job = tomllib.loads((inputs / "wedge_peak.toml").read_text())
job["output"]["file"] = "wedge.h5"

# %% The optimisation curve: stuck, through lock-up, to where friction damps best.
with attrito.peak(job, MPI.COMM_WORLD, quiet=True) as curve:
    kind, level, response = curve.peaks.kind.labels, curve.peaks.level, curve.peaks.response
    best = int(np.argmin(response))
    if MPI.COMM_WORLD.rank == 0:
        print(f"stuck {response[0]:.4e} m/N; least {response[best]:.4e} m/N at level {level[best]:.3f} ({kind[best]})")

# %% What the peak at level 20 depends on: 40 samples. Ranks share them; a study that was killed goes on when run again.
study = {
    "job": job | {"peak": {"start": 20.0}},
    "file": "study.h5",
    "design": "latin_hypercube",
    "samples": 40,
    "vary": [
        {"name": "friction coefficient", "keys": ["contact[0].friction_coefficient"], "low": 0.3, "high": 0.7},
        {"name": "preload", "keys": ["static.load_path[1]"], "low": 0.8, "high": 1.2},
    ],
}
with attrito.study(study, MPI.COMM_WORLD, quiet=True) as samples:
    friction, amplitude = samples["values"]["friction coefficient"].values, samples.peaks.amplitude.values[:, 0]
    if MPI.COMM_WORLD.rank == 0:
        low, middle, high = np.quantile(amplitude, [0.05, 0.5, 0.95])
        print(f"peak {middle:.3e} m, 90 % of samples {low:.3e} to {high:.3e}")
        print(f"correlation with friction {np.corrcoef(friction, amplitude)[0, 1]:+.2f}")
