"""What coupling static and dynamic balance changes: the same job both ways, over the level of excitation."""

# %%
import tomllib
from pathlib import Path

import numpy as np
from mpi4py import MPI

import attrito

wedge = tomllib.loads((Path(__file__).parents[1] / "wedge.toml").read_text())

# %% Two runs, three levels each; ranks could share them: a rank a job with MPI.COMM_SELF.
peaks = {}
for approach in ("coupled", "uncoupled"):
    job = wedge | {
        "balance": wedge["balance"] | {"approach": approach},
        "sweep": wedge["sweep"] | {"levels": [0.5, 2.0, 6.0]},
        "output": wedge["output"] | {"file": f"{approach}.h5"},
    }
    with attrito.run(job, MPI.COMM_SELF, quiet=True) as result:
        level, amplitude = result.points.level.values, result.monitors.x.amplitude.values
        peaks[approach] = [float(np.nanmax(amplitude[level == one])) for one in np.unique(level)]

# %%
for index, one in enumerate((0.5, 2.0, 6.0)):
    coupled, uncoupled = (peaks[approach][index] for approach in ("coupled", "uncoupled"))
    print(f"{5 * one:4.1f} N: coupled {coupled:.4e}, uncoupled {uncoupled:.4e}, {uncoupled / coupled - 1:+.1%}")
