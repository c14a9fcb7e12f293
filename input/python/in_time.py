"""The balance against integration in time: how many harmonics are enough?"""

# %%
import tomllib
from pathlib import Path

from mpi4py import MPI

import attrito

wedge = tomllib.loads((Path(__file__).parents[1] / "wedge.toml").read_text())
wedge = wedge | {"sweep": {"frequencies_hz": [132.0]}, "integrate": {"frequency_hz": 132.0}}

# %% Event-exact integration until steady: the truth of this scene.
with attrito.integrate(wedge | {"output": wedge["output"] | {"file": "time.h5"}}, MPI.COMM_SELF, quiet=True) as file:
    truth = float(file.integration.monitors.x.amplitude)
    print(f"in time: {truth:.6e} after {int(file.integration.cycles)} cycles")

# %% The balance with ever more harmonics, with its own estimate of what truncation costs.
for harmonics in (1, 3, 5, 9, 15):
    job = wedge | {"balance": {"harmonics": harmonics}, "output": wedge["output"] | {"file": "balance.h5"}}
    with attrito.run(job, MPI.COMM_SELF, quiet=True) as result:
        amplitude, estimate = float(result.monitors.x.amplitude[0]), float(result.points.estimate[0])
        print(f"{harmonics:2d} harmonics: off by {abs(amplitude / truth - 1):.1e}, estimated {estimate:.1e}")
