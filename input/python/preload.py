"""A small study: which preload damps best? One job a preload, shared out over the ranks."""

# %%
import tomllib
from pathlib import Path

import numpy as np
from mpi4py import MPI

import attrito

comm = MPI.COMM_WORLD
wedge = tomllib.loads((Path(__file__).parents[1] / "wedge.toml").read_text())
preloads = np.array([42.0, 84.0, 168.0, 420.0, 840.0])

# %% Each rank solves its own jobs, on itself alone.
peaks = np.zeros(len(preloads))
for index in range(comm.rank, len(preloads), comm.size):
    job = wedge | {
        "load": [wedge["load"][0] | {"dofs": [[1, preloads[index]]]}, wedge["load"][1]],
        "output": wedge["output"] | {"file": f"preload_{index}.h5"},
    }
    with attrito.run(job, MPI.COMM_SELF, quiet=True) as result:
        peaks[index] = np.nanmax(result.monitors.x.amplitude.values)
peaks = comm.allreduce(peaks)

# %%
if comm.rank == 0:
    for preload, peak in zip(preloads, peaks, strict=True):
        print(f"{preload:6.0f} N: peak {peak:.4e} m")
    print(f"best of these: {preloads[np.argmin(peaks)]:.0f} N")
