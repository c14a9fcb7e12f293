"""A frequency response from Python: a job as a dictionary, its result as arrays, figures and a page.

Cells (`# %%`) run one by one in an editor or a notebook; `mpirun -n 2 python frequency_response.py` runs on two ranks.
"""

# %% The wedge of Zucca & Firrone 2014: a mass on springs (100 and 250 Hz), pressed against a wall at 45 degrees.
import numpy as np
from mpi4py import MPI

import attrito

along, across = np.array([-1.0, 1.0]) / np.sqrt(2), np.array([1.0, 1.0]) / np.sqrt(2)
job = {
    "model": {
        "mass": np.eye(2),
        "stiffness": np.diag([(2 * np.pi * 100) ** 2, (2 * np.pi * 250) ** 2]),
        "damping": 20 * np.pi * np.eye(2),
    },
    "contact": [
        {
            "normal": list(enumerate(across)),
            "tangents": [list(enumerate(along))],
            "tangential_stiffness": 3.0e5,
            "normal_stiffness": 3.0e5,
            "friction_coefficient": 0.5,
        }
    ],
    "load": [
        {"name": "preload", "kind": "static", "dofs": [[1, 420.0]]},
        {"kind": "harmonic", "cosine": list(enumerate(5.0 * along))},
    ],
    "sweep": {"start_hz": 140.0, "stop_hz": 100.0},
    "output": {"file": "wedge.h5", "monitors": [{"name": "x", "dofs": [[0, 1.0]]}]},
}

# %% Run it, on all ranks there are. Each rank has the result.
result = attrito.run(job, MPI.COMM_WORLD, quiet=True)

# %% Arrays by name; they know their units and compute like numpy's.
frequency, amplitude = result.points.frequency_hz, result.monitors.x.amplitude
peak = int(np.argmax(amplitude))
if MPI.COMM_WORLD.rank == 0:
    print(f"peak {amplitude[peak]:.4e} ({amplitude.unit}) at {frequency[peak]:.2f} {frequency.unit}")
    print("of the stuck peak:", round(amplitude[peak] / result.linear.stuck.x.max(), 3))
    print("contact at the peak:", result.contacts.state.labels[peak, 0], "- slips", result.contacts.slip[peak, 0])

# %% The same as a picture and as a page (one rank writes).
if MPI.COMM_WORLD.rank == 0:
    from attrito.plots import Look, frequency_response, save

    with attrito.Result(result.path) as opened:
        save(frequency_response(opened, "x", look=Look(width=85.0, font_size=8.0)), "wedge.pdf")
        attrito.write_report(opened, "wedge.html")
result.close()
