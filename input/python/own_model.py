"""A model of one's own: CalculiX's matrices and mesh, reduced, its response, and its shape for ParaView."""

# %%
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
from mpi4py import MPI

import attrito

inputs = Path(__file__).parents[1]
job = tomllib.loads((inputs / "strip.toml").read_text())

# %% CalculiX writes the matrices that the deck's only step asks for.
folder = Path("strip")
folder.mkdir(exist_ok=True)
shutil.copy(inputs / "strip.inp", folder)
subprocess.run(["ccx", "strip"], cwd=folder, check=True, stdout=subprocess.DEVNULL)

# %% Matrices and mesh into one file. Check the mass: in mm and N it is in tonnes.
model, notes = attrito.import_model(folder / "model.h5", calculix_job=folder / "strip", mesh=folder / "strip.inp")
print("\n".join(notes))

# %% Reduce it: how far is the reduced model from the full one?
job["model"]["file"] = "model.h5"
job["output"]["file"] = "result.h5"
with attrito.reduce(job, MPI.COMM_SELF, folder=folder, quiet=True) as rom:
    worst = rom.quality.frequency_error.max()
    print(f"{model.size} dofs onto {len(rom.coordinates.kind)}; frequencies off by at most {worst:.1e}")

# %% Its response at two levels, and the peaks per unit of force.
with attrito.run(job, MPI.COMM_SELF, folder=folder, quiet=True) as result:
    level, amplitude = result.points.level.values, result.monitors.tip.amplitude.values
    for one in np.unique(level):
        at = np.flatnonzero(level == one)[np.argmax(amplitude[level == one])]
        frequency, response = result.points.frequency_hz[at], amplitude[at] / one
        print(f"level {one:g}: {response:.4f} mm/N at {frequency:.1f} Hz; stuck {result.linear.stuck.tip.max():.4f}")

# %% The motion of all nodes at the last peak, 24 instants of a period.
export = [sys.executable, "-m", "attrito.cli", "export", folder / "result.h5"]
subprocess.run([*export, "--points", str(at), "--phases", "24"], check=True, stdout=subprocess.DEVNULL)
print(folder / "shape.pvd")
