"""Twenty joints as a stranger would draw them, swept with default settings: does every sweep arrive?

    .venv/bin/python benchmarks/joints.py --folder out/joints > joints.json
    .venv/bin/python benchmarks/joints.py --folder out/joints --only 3 7 --set 'static.bounds="none"'
    .venv/bin/python benchmarks/joints.py --check out/joints > check.json
    .venv/bin/python benchmarks/joints.py --folder out/joints --only 3 --pictures

Four each of dovetails, underplatform dampers, bolted flanges, lap joints and rings (`joints_geometry.py`), drawn from a
seed: unlike meshes, gaps, friction 0.1 to 0.6. At the resonance that the tip's excitation moves most the sum of normal
forces at rest is 0.01 to 100 times that of alternating contact forces, were contacts as at rest. The band goes from
12 % below to 12 % above it. CalculiX writes the matrices. Joints that a folder holds are not built again.

Prints JSON, a row a joint. `balance` is what contact forces and static loads leave over on the free body at rest, part
of the sum of normal forces. `outcome`: "arrived" if one branch led to the stop, "said" if the log says why each branch
ended before, else "silent", or "out of time"; `left_at_hz`, where branches were left.

`--check` solves points of the sweeps again: as listed frequencies, each begun at the sweep's neighbouring point with
its sliders; and, beyond the place at which a sweep left its branch, from the static sliders. Errors are parts of the
largest amplitude of the sweep.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import itertools
import json
import os
import re
import resource
import subprocess
import sys
from pathlib import Path

import common  # isort: skip  # noqa: F401 (sets the threads of BLAS before numpy is loaded)
import h5py
import numpy as np
from joints_geometry import KINDS, Joint
from matplotlib.figure import Figure
from mpi4py import MPI
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from scipy.sparse import csr_array

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "meshes"))
from bodies import Scene, make_model  # noqa: E402

from attrito.job.reading import read_job  # noqa: E402
from attrito.library.names import STATES  # noqa: E402
from attrito.library.points import StoredPoint  # noqa: E402
from attrito.library.session import Solver  # noqa: E402
from attrito.scene.build import build_scene  # noqa: E402
from attrito.scene.reduced_model import make_rom, reduced_scene  # noqa: E402
from attrito.scene.solver_options import solver_options  # noqa: E402

JOINTS = 20
STEPS = {"matrices": "*STEP\n*FREQUENCY, SOLVER=MATRIXSTORAGE\n1\n*END STEP\n"}
PRODUCTS = {f"matrices.{kind}": f"joint.{kind}" for kind in ("sti", "mas", "dof")}
# The band about the mode, and a force and a frequency that leave a joint at rest
SIDE, FAINT, SLOW = 0.12, 1.0e-3, 1.0
# Points of a sweep that are solved again
CHECKED = 12
# Faces of a brick by its corners
FACES = ((0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
Row = dict[str, object]


def draw(number: int, seed: int) -> tuple[Joint, Row]:
    """A joint, and what is drawn for joints of all kinds."""
    joint = KINDS[number % len(KINDS)](np.random.default_rng([seed, number]), number // len(KINDS))
    rng = np.random.default_rng([seed, number, 1])
    ratios = np.random.default_rng(seed).permutation(np.linspace(-2.0, 2.0, JOINTS))
    stiffness = 10.0 ** rng.uniform(3.3, 4.7)
    drawn = {
        "ratio": 10.0 ** ratios[number],
        "damping": 10.0 ** rng.uniform(-3.3, -2.3),
        "upwards": bool(rng.integers(2)),
        "contact": {
            "pairing": "face",
            "tolerance": 1.0e-3,
            "normal_stiffness": stiffness,
            "tangential_stiffness": stiffness * rng.uniform(0.5, 1.0),
            "friction_coefficient": rng.uniform(0.1, 0.6),
        },
    }
    if number // len(KINDS) == 1:
        drawn["contact"]["points"] = "gauss"
    return joint, drawn


def scene_of(joint: Joint) -> Scene:
    """The mesh, with the node sets."""
    points, elements, sets, first = [], {}, {}, 0
    for name, body in joint.bodies.items():
        own = np.array(body.points)
        chosen = {key: first + np.flatnonzero(choose(own)) for key, (of, choose) in joint.sets.items() if of == name}
        sets |= chosen
        points.append(joint.moved[1](own) if joint.moved and joint.moved[0] == name else own)
        elements[name] = first + np.array(body.bricks)
        first += len(own)
    return Scene(np.concatenate(points), elements, {}, sets)


def bolt_text(joint: Joint, scene: Scene) -> str:
    """The bolts as nodal forces."""
    return "*CLOAD\n" + "".join(
        f"{name}, 3, {force / len(scene.node_sets[name]):.12g}\n" for name, force in joint.bolts
    )


def oval_text(joint: Joint, scene: Scene) -> str:
    """A gap for each node of the ring's face, which is out of round."""
    rows = scene.node_sets[joint.pairs[0][0]]
    x, y, _ = scene.coordinates[rows].T
    gaps = joint.oval * x**2 / (x**2 + y**2)
    return "".join(f"{row + 1}, {gap:.12g}\n" for row, gap in zip(rows, gaps, strict=True))


def table(name: str, keys: Row) -> str:
    """A table of a job; JSON's values are TOML's."""
    return f"[{name}]\n" + "".join(f"{key} = {json.dumps(value)}\n" for key, value in keys.items()) + "\n"


def job_text(joint: Joint, drawn: Row, sweep: Row, file: str) -> str:
    """A job as short as a user's."""
    text = table("model", {"file": "model.h5", "units": "mm, t, s"})
    text += table("damping", {"ratio": drawn["damping"]}) + table("reduction", {"modes": 15, "file": "rom.h5"})
    gaps = {"gap_file": "gap.txt"} if joint.oval else {}
    for a, b in joint.pairs:
        text += table("[contact_set]", {"a": a, "b": b} | drawn["contact"] | joint.contact | gaps)
    if joint.bolts:
        text += table("[load]", {"name": "bolts", "kind": "static", "file": "bolt.inp"})
    if joint.spin:
        keys = dict(zip(("speed_hz", "axis_point", "axis_direction"), joint.spin, strict=True))
        text += table("[load]", {"name": "spin", "kind": "centrifugal"} | keys)
    tip = [[["node", "tip", joint.driven], 1.0]]
    text += table("[load]", {"kind": "harmonic", "cosine": tip}) + table("sweep", sweep)
    return text + f'[output]\nfile = "{file}"\nmonitors = [{{ name = "tip", dofs = {json.dumps(tip)} }}]\n'


def attrito(folder: Path, *arguments: str) -> None:
    """Run the command in a folder; what it says goes to `steps.log`."""
    if timed(folder, "steps.log", 0, *arguments)[0] != 0:
        sys.exit(f"attrito {' '.join(arguments)} failed: {folder}/steps.log")


def timed(folder: Path, log: str, limit: int, *arguments: str) -> tuple[int, float]:
    """Run the command within a limit of seconds: exit code, negative after a signal, and seconds of the processor."""

    def limited() -> None:
        if limit:
            resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 5))

    with (folder / log).open("a") as out:
        command = [sys.executable, "-m", "attrito.cli", *arguments]
        process = subprocess.Popen(command, cwd=folder, stdout=out, stderr=out, preexec_fn=limited)
        _, status, usage = os.wait4(process.pid, 0)
    return os.waitstatus_to_exitcode(status), usage.ru_utime + usage.ru_stime


def build(folder: Path, number: int, seed: int) -> Row:
    """Mesh, model, rest and band of a joint, and its job, unless they are there."""
    kept = folder / "joint.json"
    if kept.exists():
        return json.loads(kept.read_text())
    folder.mkdir(parents=True, exist_ok=True)
    joint, drawn = draw(number, seed)
    held = "".join(f"{name}, 1, 3\n" for name in joint.sets if name.startswith("clamp"))
    steps = {name: f"*BOUNDARY\n{held}{text}" for name, text in STEPS.items()}
    loads = {"bolt.inp": lambda scene: bolt_text(joint, scene)} if joint.bolts else {}
    loads |= {"gap.txt": lambda scene: oval_text(joint, scene)} if joint.oval else {}
    with contextlib.redirect_stdout(sys.stderr):
        make_model(folder, "joint", f"Joint {number}", scene_of(joint), [*joint.bodies], None, steps, PRODUCTS, loads)
    attrito(folder, "import", "model.h5", "--calculix", "joint", "--mesh", "joint.inp")
    rest = {"frequencies_hz": [SLOW], "levels": [FAINT]}
    (folder / "rest.toml").write_text(job_text(joint, drawn, rest, "rest.h5"))
    attrito(folder, "linear-modes", "rest.toml", "--state", "tangent")
    with h5py.File(folder / "rest.modes.h5") as file:
        natural, shapes = file["points/frequency_hz"][:], file["monitors/tip/shape"][:]
    mode = float(natural[np.argmax(np.where(natural > SLOW, (shapes / np.maximum(natural, SLOW)) ** 2, 0.0))])
    rest["frequencies_hz"].append(mode)
    (folder / "rest.toml").write_text(job_text(joint, drawn, rest, "rest.h5"))
    attrito(folder, "run", "rest.toml", "--set", "balance.harmonics=1", "--set", 'static.bounds="none"')
    row = {"joint": number, "kind": joint.kind, **at_rest(folder, joint)}
    row |= {"seed": seed, "ratio": drawn["ratio"], "mode_hz": mode}
    band = [round(mode * (1 + side), 3) for side in (-SIDE, SIDE)][:: 1 if drawn["upwards"] else -1]
    level = FAINT * row["normal"] / (drawn["ratio"] * row.pop("alternating"))
    sweep = {"start_hz": band[0], "stop_hz": band[1], "levels": [float(f"{level:.6g}")]}
    (folder / "job.toml").write_text(job_text(joint, drawn, sweep, "result.h5"))
    kept.write_text(json.dumps(row))
    return row


def at_rest(folder: Path, joint: Joint) -> Row:
    """Pairs, normal forces, those that alternate at the resonance, and how loads balance on the free body."""
    with h5py.File(folder / "rest.h5") as file:
        state, frame = file["contacts/state"][0], file["contacts/parameters/frame"][:]
        forces, normal = file["contacts/force"][0, :, :, 0], float(file["contacts/n_mean"][0].sum())
        alternating = np.linalg.norm(file["contacts/force"][1, :, :, 1:], axis=(1, 2)).sum()
        sides = [name.decode().split(" - ")[0] for name in file["contacts/parameters/set"]]
    # On side a the contact's force is -B^T (T, N), on side b the opposite.
    signs = [-1.0 if joint.sets[side][0] == joint.free else 1.0 for side in sides]
    total = np.einsum("c,ck,ckx->x", signs, forces, frame)
    left = total + applied(folder, joint)
    return {
        "pairs": len(state),
        "open": int(np.sum(state == STATES.index("open"))),
        "normal": normal,
        "alternating": float(alternating),
        "balance": float(np.linalg.norm(left) / normal),
    }


def applied(folder: Path, joint: Joint) -> np.ndarray:
    """Resultant of the static loads on the free body."""
    total = np.array([0.0, 0.0, sum(force for name, force in joint.bolts if joint.sets[name][0] == joint.free)])
    if joint.spin:
        speed, point, axis = joint.spin
        with h5py.File(folder / "model.h5") as file:
            mass = csr_array(tuple(file[f"mass/{name}"][:] for name in ("values", "columns", "row_offsets")))
            node, direction = file["dofs/node"][:], file["dofs/direction"][:] - 1
            places = dict(zip(file["nodes/id"][:], file["nodes/coordinates"][:], strict=True))
        first = 1 + sum(len(body.points) for body in [*joint.bodies.values()][: [*joint.bodies].index(joint.free)])
        own = (node >= first) & (node < first + len(joint.bodies[joint.free].points))
        away = np.array([places[one] for one in node]) - point
        radius = (away - np.outer(away @ axis, axis))[np.arange(len(node)), direction]
        force = (2 * np.pi * speed) ** 2 * (mass @ radius) * own
        total += np.bincount(direction, force, minlength=3)
    return total


def measure(folder: Path, settings: list[str], limit: int) -> Row:
    """Sweep a joint: what it cost and how it ended."""
    for old in [*folder.glob("result.h5*"), folder / "run.log"]:
        old.unlink(missing_ok=True)
    arguments = [part for setting in settings for part in ("--set", setting)]
    code, seconds = timed(folder, "run.log", limit, "run", "job.toml", *arguments)
    row: Row = {"exit": code, "seconds": round(seconds, 1)}
    file = "result.h5" if (folder / "result.h5").exists() else "result.h5.partial"
    points = rows_of(folder, file)
    outcomes = [point["outcome"] for point in points]
    row["points"], row["iterations"] = len(points), sum(int(point["iterations"]) for point in points)
    row["outcomes"] = {name: outcomes.count(name) for name in sorted(set(outcomes))}
    row["turns"] = len(rows_of(folder, file, "--bifurcations"))
    # A sweep that leaves its branch goes on with the next number, and says why in its log. A point not solved has none.
    solved = [point for point in points if point["outcome"] not in {"no_period_one_orbit", "not_converged"}]
    ends = [a["frequency_hz"] for a, b in itertools.pairwise(solved) if a["branch"] != b["branch"]]
    stop = read_job(str(folder / "job.toml"))["sweep"]["stop_hz"]
    at_stop = bool(points) and abs(float(points[-1]["frequency_hz"]) / stop - 1.0) < 1e-6
    log = (folder / "run.log").read_text().splitlines()
    row["ends"] = [line for line in log if re.search(r"branch \d+ ends at", line)]
    arrived = at_stop and not ends and code == 0
    said = at_stop and code == 1 and len(ends) <= len(row["ends"])
    row["outcome"] = "out of time" if code < 0 else "arrived" if arrived else "said" if said else "silent"
    row["left_at_hz"], row["last"] = [float(end) for end in ends], log[-3:]
    return row


def rows_of(folder: Path, file: str, *options: str) -> list[dict[str, str]]:
    """A table of a result."""
    command = [sys.executable, "-m", "attrito.cli", "table", file, *options]
    text = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False).stdout
    return list(csv.DictReader(text.splitlines()))


def check(folder: Path) -> Row:
    """Points of a sweep against listed frequencies, and what follows an end against a list from the static sliders."""
    job = read_job(str(folder / "job.toml"))
    with h5py.File(folder / "result.h5") as file:
        frequency, level = file["points/frequency_hz"][:], float(file["points/level"][0])
        branch, amplitude = file["points/branch"][:], file["monitors/tip/amplitude"][:]
        motion, slider = file["points/coordinates"][:], file["contacts/slider"][:]
    scene = build_scene(job)
    rom, _ = make_rom(MPI.COMM_SELF, job, scene)
    solved = np.flatnonzero(np.isfinite(amplitude))
    pairs = [(a, b) for a, b in itertools.pairwise(solved) if branch[a] == branch[b]]
    chosen = [pairs[i] for i in np.unique(np.linspace(0, len(pairs) - 1, CHECKED).astype(int))]
    later = [
        rows[:: -(-len(rows) // CHECKED)] for one in np.unique(branch)[1:] if len(rows := solved[branch[solved] == one])
    ]
    errors: dict[str, list] = {"neighbour": [], "static": []}
    with Solver(MPI.COMM_SELF, reduced_scene(job, scene, rom), solver_options(job, rom)) as solver:

        def compare(kind: str, row: int) -> None:
            point = next(solver.solve_at([float(frequency[row])], level, 0))
            off = abs(point.amplitude[0] - amplitude[row]) / amplitude[solved].max() if point.is_solved else np.inf
            errors[kind].append([float(frequency[row]), float(f"{off:.3g}")])

        solver.follow_static_path(scene.load_path, job["static"]["steps"], float(frequency[0]))
        for before, here in chosen:
            if solver.start_from(StoredPoint(float(frequency[before]), motion[before], slider[before]), level):
                compare("neighbour", here)
            else:
                errors["neighbour"].append([float(frequency[here]), np.inf])
        for rows in later:
            solver.follow_static_path(scene.load_path, job["static"]["steps"], float(frequency[rows[0]]))
            for row in rows:
                compare("static", row)
    return {f"worst_{kind}": max((off for _, off in found), default=0.0) for kind, found in errors.items()} | errors


def picture(folder: Path, joint: Joint) -> None:
    """The bodies' surfaces, and the pairs with what presses them at rest."""
    figure = Figure(figsize=(9.0, 7.0), constrained_layout=True)
    axes = figure.add_subplot(projection="3d")
    scene = scene_of(joint)
    for name, colour in zip(joint.bodies, ("tab:blue", "tab:orange", "tab:green"), strict=False):
        corners = scene.elements[name][:, :8]
        faces = np.concatenate([corners[:, rows] for rows in FACES])
        _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
        outside = scene.coordinates[faces[first[count == 1]]]
        axes.add_collection3d(Poly3DCollection(outside, alpha=0.15, edgecolor=colour, facecolor=colour, linewidth=0.4))
    with h5py.File(folder / "rest.h5") as file:
        places, pressed = file["contacts/parameters/position"][:], file["contacts/n_mean"][0]
    shown = axes.scatter(*places.T, c=pressed, s=8, cmap="inferno")
    figure.colorbar(shown, label="Normal force at rest (N)", shrink=0.6)
    low, high = scene.coordinates.min(axis=0), scene.coordinates.max(axis=0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]), box_aspect=high - low)
    figure.savefig(folder / "joint.png", dpi=110)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="Sweeps of twenty joints that are drawn at random.")
    parser.add_argument("--folder", type=Path, default=Path("out/joints"), help="for models, jobs and results")
    parser.add_argument("--only", type=int, nargs="+", default=range(JOINTS), help="joints, from 0")
    parser.add_argument("--seed", type=int, default=42)
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="as of attrito run")
    parser.add_argument("--limit", type=int, default=300, help="seconds of the processor for a sweep; 0: build alone")
    parser.add_argument("--pictures", action="store_true", help="draw each joint: joint.png")
    parser.add_argument("--check", type=Path, metavar="FOLDER", help="instead: check the sweeps of a folder")
    arguments = parser.parse_args()
    rows = []
    for number in arguments.only:
        folder = (arguments.check or arguments.folder).resolve() / f"{number:02d}"
        if arguments.check:
            row = {"joint": number} | check(folder)
        else:
            row = build(folder, number, arguments.seed)
            if arguments.limit:
                row |= measure(folder, arguments.set, arguments.limit)
            if arguments.pictures:
                picture(folder, draw(number, arguments.seed)[0])
        rows.append(row)
        common.progress(json.dumps(row))
    common.report(rows)


if __name__ == "__main__":
    main()
