"""The Brake-Reuss beam: backbone of its first mode by both methods, beside a published one.

    .venv/bin/python benchmarks/brake_reuss.py FOLDER --work out/brb --picture docs/pictures/brake_reuss.png > brb.md

FOLDER holds `stiffness.npz`, `mass.npz`, `rows.dof`, `mesh.inp`, `bolts.npy`, the job `brb.toml` and the published
points `backbone_reference.csv` (Balaji, Dreher, Krack & Brake 2021, doi:10.1016/j.ymssp.2020.107249: quasi-static modal
analysis with Masing's rule). All is made in the folder of `--work`; what is there already is taken as it is, a mode
that was cut short goes on. Amplitudes are those that are published. The table has frequencies as parts of the lowest
amplitude's, because the published model's elements are softer, and damping ratios of the contacts alone.

Published damping is 1 / (2 pi) of what Masing's rule makes of the published frequencies,

    D = 8 integral_0^Q omega^2 q dq - 4 omega^2 Q^2,   zeta = D / (2 pi omega^2 Q^2),

the damping of an oscillator that loses pi (2 zeta omega) omega Q^2 a period. The table has that zeta, from the
published frequencies alone, and damping by Masing's rule is compared with 2 pi times what is published.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import resource
import subprocess
import sys
import tomllib
from dataclasses import asdict
from pathlib import Path

import h5py
import numpy as np
from first_loading import Loading, at_rest
from matplotlib.figure import Figure
from scipy.interpolate import PchipInterpolator

from attrito.library.names import OUTCOMES

INPUTS = ("stiffness.npz", "mass.npz", "rows.dof", "mesh.inp", "bolts.npy")
WAYS = {
    "quasi-static": {"mode": {"method": "quasi_static"}},
    "EPMC": {"mode": {"method": "epmc"}},
}
COLOURS = {"quasi-static": "#0072B2", "EPMC": "#D55E00"}


def prepare(folder: Path, work: Path) -> None:
    """Model and reduced model, where they are not there."""
    work.mkdir(parents=True, exist_ok=True)
    for name in INPUTS:
        if not (work / name).exists():
            (work / name).symlink_to((folder / name).resolve())
    if not (work / "model.h5").exists():
        matrices = ["--stiffness", "stiffness.npz", "--mass", "mass.npz", "--dofs", "rows.dof", "--mesh", "mesh.inp"]
        attrito(work, "import", "model.h5", *matrices)


def job_of(folder: Path, work: Path, way: str, options: argparse.Namespace) -> Path:
    """The folder's job with a mode by one way."""
    published = reference(folder)["modal_amplitude"]
    mode = {
        "start": float(published[0]),
        "stop": float(published[-1]),
        "points": len(published),
        "near_hz": 167.0,
        "file": f"{way}.mode.h5",
        "steps": options.steps,
    }
    tables = {"mode": mode, "balance": {"harmonics": options.harmonics, "samples": options.samples}}
    tables["reduction"] = {"recovery": "monitors"}
    for table, keys in WAYS[way].items():
        tables[table] = tables.get(table, {}) | keys
    own = tomllib.loads((folder / "brb.toml").read_text())
    text = (folder / "brb.toml").read_text()
    for table, keys in tables.items():
        lines = [f"{key} = {json.dumps(value)}" for key, value in keys.items() if key not in own.get(table, {})]
        heading = f"[{table}]\n"
        text = text if heading in text else f"{text}\n{heading}"
        text = text.replace(heading, heading + "".join(f"{line}\n" for line in lines))
        for key in keys.keys() & own.get(table, {}).keys():
            before = re.escape(json.dumps(own[table][key]))
            text = re.sub(rf"(?m)^{key} = {before}$", f"{key} = {json.dumps(keys[key])}", text)
    path = work / f"{way}.toml"
    path.write_text(text)
    return path


def attrito(work: Path, *words: str) -> float:
    """Run a command, and return its processor seconds; what was found of a mode that is lost is taken."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [str(Path(sys.executable).parent / "attrito"), *words]
    done = subprocess.run(
        command, cwd=work, stdout=subprocess.PIPE, text=True, env=os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode not in (0, 1):
        raise SystemExit(f"{' '.join(command)}: exit code {done.returncode}")
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def reference(folder: Path) -> np.ndarray:
    """The published points."""
    points: np.ndarray = np.genfromtxt(folder / "backbone_reference.csv", delimiter=",", names=True)
    return points


def backbone(work: Path, job: Path) -> dict[str, np.ndarray]:
    """Of a mode's file, by its points; `seconds` of the run that made it, NaN where the file was there."""
    file = job.with_suffix(".mode.h5")
    seconds = np.nan if file.exists() else attrito(work, "mode", "--resume", job.name)
    with h5py.File(file) as found:
        names = ("amplitude", "frequency_hz", "damping_ratio", "iterations", "outcome")
        values = {name: found[f"points/{name}"][()] for name in names}
        values["states"] = found["contacts/state"][()]
        if found.attrs["method"] == "quasi_static":
            values["first_harmonic"] = first_harmonic(work, found["points/coordinates"][()]) / values["amplitude"]
        values["tangent_hz"] = found.attrs["tangent_hz"]
    return values | {"seconds": np.array(seconds)}


def first_harmonic(work: Path, coordinates: np.ndarray) -> np.ndarray:
    """Of the tangent mode's coordinate, whose shape is the motion at the lowest amplitude, where nothing slips."""
    with h5py.File(work / "rom.h5") as reduced:
        mass = reduced["mass"][()]
    shape = coordinates[0, :, 1]
    reader = mass @ shape / np.sqrt(shape @ mass @ shape)
    amplitudes: np.ndarray = np.linalg.norm(np.einsum("n,pnk->pk", reader, coordinates[:, :, 1:3]), axis=1)
    return amplitudes


def masing(published: np.ndarray) -> np.ndarray:
    """Damping ratio by Masing's rule from the published frequencies: omega^2 is a monotone cubic in log Q."""
    q, square = published["modal_amplitude"], (2.0 * np.pi * published["frequency_hz"]) ** 2
    curve = PchipInterpolator(np.log(q), square)
    ratios = []
    for amplitude, stiffness in zip(q, square, strict=True):
        x = np.linspace(np.log(q[0]), np.log(amplitude), 4001)
        half = 0.5 * square[0] * q[0] ** 2 + np.trapz(curve(x) * np.exp(2.0 * x), x)
        ratios.append((8.0 * half - 4.0 * stiffness * amplitude**2) / (2.0 * np.pi * stiffness * amplitude**2))
    return np.array(ratios)


def first_loading_of(work: Path, job: Path) -> dict[str, np.ndarray]:
    """The dense solution of the first loading, from its file if that is there."""
    file = work / "first_loading.npz"
    if not file.exists():
        loading = Loading(at_rest(job))
        steps = np.concatenate([np.geomspace(1.0e-6, 1.5e-2, 64), np.linspace(1.6e-2, 2.9e-2, 14)])
        np.savez(file, **asdict(loading.curve(loading.omega**2 * steps)))
    with np.load(file) as values:
        return dict(values)


def write_table(published: np.ndarray, first: dict[str, np.ndarray], found: dict[str, dict[str, np.ndarray]]) -> None:
    """Markdown, a line an amplitude; f are parts of that at low amplitude."""
    columns = [
        "Q",
        "published: f, 2 pi zeta",
        "Masing's rule on its f",
        "first loading: f, Masing's rule",
        "differences",
    ]
    columns += ["contact by contact"]
    for way, mode in found.items():
        columns += [f"{way}: f, zeta", "stuck, slipping, open, outcome"]
        columns += ["by its first harmonic: f, zeta"] if "first_harmonic" in mode else []
    print("|".join(["", *columns, ""]))
    print("|" + "---|" * len(columns))
    own_rule, q = masing(published), np.log(published["modal_amplitude"])
    last = first["amplitude"][-1]
    loaded = {name: np.interp(q, np.log(first["amplitude"]), first[name]) for name in first}
    for i, point in enumerate(published):
        ratio, zeta = point["frequency_hz"] / published["frequency_hz"][0], 2.0 * np.pi * point["damping_ratio"]
        cells = [f"{point['modal_amplitude']:.2e}", f"{ratio:.4f}, {zeta:.2e}", f"{own_rule[i]:.2e}"]
        if point["modal_amplitude"] <= last:
            own, rule = loaded["omega"][i] / first["omega"][0], loaded["masing"][i]
            cells += [f"{own:.4f}, {rule:.2e}", f"{own / ratio - 1:+.2%}, {rule / zeta - 1:+.0%}"]
            cells += [f"{loaded['by_contacts'][i]:.2e}"]
        else:
            cells += [""] * 3
        for mode in found.values():
            cells += _cells(mode, i)
        print("|".join(["", *cells, ""]))
    for way, mode in found.items():
        if np.isfinite(mode["seconds"]):
            print(f"\n{way}: {mode['seconds']:.0f} s of a processor, {mode['iterations'].sum()} iterations")


def _cells(mode: dict[str, np.ndarray], i: int) -> list[str]:
    """Of one way at one amplitude."""
    if i >= len(mode["amplitude"]) or not np.isfinite(mode["damping_ratio"][i]):
        return [""] * (2 + ("first_harmonic" in mode))
    counts = np.bincount(mode["states"][i], minlength=4)
    states = f"{counts[0] + counts[1]}, {counts[2]}, {counts[3]}, {OUTCOMES[mode['outcome'][i]]}"
    f, zeta = mode["frequency_hz"][i] / mode["tangent_hz"], mode["damping_ratio"][i]
    cells = [f"{f:.4f}, {zeta:.2e}", states]
    if "first_harmonic" in mode:
        # omega^2 = A/q_1 and zeta = W/(2 pi A q_1) in place of Q, half the range of q.
        part = mode["first_harmonic"][i]
        cells.append(f"{f / np.sqrt(part):.4f}, {zeta / part:.2e}")
    return cells


def draw(
    published: np.ndarray, first: dict[str, np.ndarray], found: dict[str, dict[str, np.ndarray]], path: str
) -> None:
    """Frequency and damping against amplitude."""
    figure = Figure(figsize=(10.5, 4.4), constrained_layout=True)
    left, right = figure.subplots(1, 2)
    q = published["modal_amplitude"]
    left.semilogx(q, published["frequency_hz"] / published["frequency_hz"][0], "ks", ms=4, mfc="none")
    right.loglog(q, published["damping_ratio"], "ks", ms=4, mfc="none", label="published")
    right.loglog(q, 2.0 * np.pi * published["damping_ratio"], "k+", ms=6, label=r"$2\pi$ times published")
    style = {"color": "#56B4E9", "linewidth": 1.2}
    left.semilogx(first["amplitude"], first["omega"] / first["omega"][0], **style)
    shown = first["masing"] > 1e-6
    right.loglog(first["amplitude"][shown], first["masing"][shown], label="first loading, Masing's rule", **style)
    shown = first["by_contacts"] > 1e-6
    label = "the same, contact by contact"
    right.loglog(first["amplitude"][shown], first["by_contacts"][shown], linestyle="--", label=label, **style)
    for way, mode in found.items():
        style = {"color": COLOURS[way], "label": way, "marker": ".", "linestyle": "none"}
        # A point at which the mode was lost has no damping.
        solved = np.isfinite(mode["damping_ratio"])
        left.semilogx(mode["amplitude"][solved], mode["frequency_hz"][solved] / mode["tangent_hz"], **style)
        damping = np.where(mode["damping_ratio"] > 1e-6, mode["damping_ratio"], np.nan)
        right.loglog(mode["amplitude"], damping, **style)
    left.set(xlabel=r"Amplitude $Q$ (m kg$^{1/2}$)", ylabel="Frequency / that at low amplitude")
    right.set(xlabel=r"Amplitude $Q$ (m kg$^{1/2}$)", ylabel="Damping ratio of the contacts", ylim=(1e-5, 1.0))
    right.legend(frameon=False, loc="lower right", fontsize=8)
    figure.savefig(path, dpi=110)


def main() -> None:
    """Follow the mode by each way, print the table, and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--work", type=Path, default=Path("out/brb"))
    parser.add_argument("--ways", nargs="*", choices=list(WAYS), default=list(WAYS))
    parser.add_argument("--harmonics", type=int, default=3)
    parser.add_argument("--samples", type=int, default=128)
    parser.add_argument("--steps", type=int, default=32)
    parser.add_argument("--picture")
    options = parser.parse_args()
    prepare(options.folder, options.work)
    published = reference(options.folder)
    jobs = {way: job_of(options.folder, options.work, way, options) for way in options.ways}
    found = {way: backbone(options.work, job) for way, job in jobs.items()}
    first = first_loading_of(options.work, next(iter(jobs.values())))
    write_table(published, first, found)
    if options.picture:
        draw(published, first, found, options.picture)


if __name__ == "__main__":
    main()
