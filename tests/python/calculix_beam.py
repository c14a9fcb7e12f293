"""A cantilever along z that turns about y, at a distance from the axis: meshed here, its matrices by CalculiX."""

from __future__ import annotations

import subprocess

from attrito.importers import import_model

RADIUS, LENGTH, WIDTH, HEIGHT, CALCULIX_HZ = 100.0, 100.0, 6.0, 2.0, 150.0


def write_mesh(path, body, sets):
    lines = ["*NODE", *(f"{k}, {x:.17g}, {y:.17g}, {z:.17g}" for k, (x, y, z) in enumerate(body.points, start=1))]
    lines.append(f"*ELEMENT, TYPE={body.kind}, ELSET=body")
    for k, nodes in enumerate(body.connectivity + 1, start=1):
        words = [k, *nodes]
        lines += [
            ", ".join(map(str, words[i : i + 15])) + ("," if i + 15 < len(words) else "")
            for i in range(0, len(words), 15)
        ]
    for name, rows in sets.items():
        lines += [f"*NSET, NSET={name}", *(f"{row + 1}," for row in rows)]
    path.write_text("\n".join(lines) + "\n")


def solve(folder, name, steps):
    material = (
        "*MATERIAL, NAME=steel\n*ELASTIC\n210000., 0.3\n*DENSITY\n7.85e-9\n*SOLID SECTION, ELSET=body, MATERIAL=steel\n"
    )
    (folder / f"{name}.inp").write_text(f"*INCLUDE, INPUT=mesh.inp\n{material}{steps}")
    done = subprocess.run(["ccx", "-i", name], cwd=folder, capture_output=True, text=True, check=True)
    assert "*ERROR" not in done.stdout, done.stdout[-2000:]


def beam_model(folder, name, **options):
    return import_model(folder / f"{name}.h5", calculix_job=folder / name, mesh=folder / "mesh.inp", **options)[0]
