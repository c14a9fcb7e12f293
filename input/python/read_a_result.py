"""Reading a result: points, bounds, contacts, multipliers; usage: python read_a_result.py result.h5"""

# %%
import sys

import numpy as np

import attrito

path = sys.argv[1] if len(sys.argv) > 1 else "../../out/blade/result.h5"

# %% What is in it.
result = attrito.open(path)
print(result)
print(result.points)
print({name: quantity.unit for name, quantity in result.monitors[next(iter(result.monitors))].items()})

# %% Points by outcome.
names, counts = np.unique(result.points.outcome.labels.astype(str), return_counts=True)
print(dict(zip(names, counts.tolist(), strict=True)))

# %% The peak of the first monitor, and its contacts: those that slip, and where they are.
monitor = next(iter(result.monitors))
peak = int(np.nanargmax(result.monitors[monitor].amplitude))
slip, energy = result.contacts.slip[peak], result.contacts.dissipated_energy[peak]
busiest = np.argsort(-energy.values)[:3]
frequency = result.points.frequency_hz[peak]
print(f"peak of {monitor} at {frequency:.4g} Hz: {np.sum(slip > 0)} of {len(slip)} contacts slip")
for contact in busiest:
    place = result.contacts.parameters.position[contact].values
    print(f"  contact {contact} at {place}: {energy[contact]:.3g} ({energy.unit}) a period")

# %% The job that made it, which `attrito.run(result.job | {...})` runs again, changed; the table of `attrito table`.
print("harmonics:", result.resolved_job["balance"]["harmonics"])
with attrito.Result(path) as opened:
    print("\n".join(attrito.table(opened).splitlines()[:3]))
result.close()
