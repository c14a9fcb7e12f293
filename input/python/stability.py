"""Is what was found stable? Floquet multipliers where a contact lifts off, and what motion in time does there."""

# %%
import tomllib
from pathlib import Path

import numpy as np
from mpi4py import MPI

import attrito

wedge = tomllib.loads((Path(__file__).parents[1] / "wedge.toml").read_text())
stiff = [contact | {"tangential_stiffness": 3.0e6, "normal_stiffness": 3.0e6} for contact in wedge["contact"]]
loads = [
    wedge["load"][0] | {"dofs": [[1, 20.0]]},
    wedge["load"][1] | {"cosine": [[0, 60.0]]},
]
job = wedge | {
    "contact": stiff,
    "load": loads,
    "stability": {"method": "monodromy"},
    "balance": {"harmonics": 20},
    "sweep": {"frequencies_hz": [105.0, 115.0, 130.0]},
    "output": wedge["output"] | {"file": "stiff.h5"},
}

# %% Every point carries its outcome; unstable ones are solutions, too.
with attrito.run(job, MPI.COMM_SELF, quiet=True) as result:
    for point, hertz in enumerate(result.points.frequency_hz):
        largest = result.stability.largest_multiplier[point]
        print(f"{hertz:.1f} Hz: {result.points.outcome.labels[point]}, largest multiplier {largest:.3f}")
    unstable = np.flatnonzero(result.points.stable.values == 0)

# %% Motion in time, started near the unstable orbit, leaves it: the period doubles.
if len(unstable):
    frequency = [105.0, 115.0, 130.0][unstable[0]]
    there = job | {"integrate": {"frequency_hz": frequency, "start": f"point:{unstable[0]}", "max_period_multiple": 8}}
    with attrito.integrate(there, MPI.COMM_SELF, quiet=True) as file:
        print(
            f"in time at {frequency} Hz: {file.integration.attributes['outcome']}, of {file.integration.period} periods"
        )
