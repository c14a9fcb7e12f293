"""Is the estimated error the true one, is the tolerance kept, and at what cost? Random scenes, JSON on standard output.

    .venv/bin/python benchmarks/accuracy.py > accuracy.json
    .venv/bin/python benchmarks/accuracy.py --scenes 100 --seed 7 --blade input/blade.toml

Scenes: wedges, chains of masses (one and two tangents), plane and hexahedral blocks on a soft foundation, and the blade
of a job that has been run; each with random loads, friction, stiffness and preload, solved at frequencies across its
first resonance between frictionless and stuck. A scene's error is that of its peak, the largest amplitude of the first
monitor over these frequencies, against the same scene with many harmonics. Points must converge in both runs.

Estimates are held against the truth at every point of every run, where the true error is above 1e-7 and above ten times
the estimate of the reference's own. Cost is processor time of the sweep, without the static path, and counted work
(floating-point operations by formulas, `src/balance/work.f90`).
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import common  # isort: skip (sets the threads of BLAS before numpy is loaded)
import numpy as np
import scenes
from mpi4py import MPI

from attrito.library.points import Point
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options, Solver

TOLERANCES = (1e-1, 1e-2, 1e-3)
# Fixed runs beside them: what costs are told against, and short series whose estimates are checked
FIXED = (3, 5, 20)
POINTS = 7
# Of the reference, by tangents
REFERENCE = {1: (40, 512), 2: (20, 1024)}
# Of a blade, whose 90 contacts make a point of 20 harmonics slow: series beside the tolerances, reference, and where it
# is solved, parts of the stuck natural frequency
BLADE_FIXED = (3, 5)
BLADE_REFERENCE = (12, 512)
BLADE_POINTS = (1.003, 0.998, 0.993)


@dataclass(frozen=True)
class Case:
    """A scene, the kind it is of, the frequencies it is solved at, Hz, and by how many harmonics besides."""

    kind: str
    scene: ReducedScene
    frequencies_hz: np.ndarray
    fixed: tuple[int, ...] = FIXED
    # Harmonics and samples
    reference: tuple[int, int] | None = None


def wedge(random: np.random.Generator) -> Case:
    """A mass on springs pressed against a wall, as the paper's."""
    angle = random.choice([0.0, random.uniform(0.0, np.pi / 3)])
    rows = np.array([[-np.cos(angle), np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    stiffness = 10 ** random.uniform(4.8, 6.0, 2)
    scene = ReducedScene(
        np.eye(2),
        np.diag((2 * np.pi * np.array([100.0, 250.0])) ** 2),
        "mass",
        20 * np.pi,
        None,
        laws(1, 1, stiffness, random.uniform(0.2, 0.8)),
        rows,
        np.array([[0.0, 420.0]]) * random.uniform(0.5, 2.0),
        np.array([0.0 * rows[0], 10 ** random.uniform(0.3, 1.6) * rows[0], 0.0 * rows[0]]),
        np.eye(2)[:1],
        ["x"],
    )
    return Case("wedge", scene, across(scene))


def chain(random: np.random.Generator, tangents: int) -> Case:
    """Masses in a row, each pressed against a wall; a little of their sliding motion presses too."""
    masses = int(random.integers(2, 6 if tangents == 1 else 4))
    size = (tangents + 1) * masses
    ladder = 2 * np.eye(masses) - np.eye(masses, k=1) - np.eye(masses, k=-1)
    stiffness = np.kron(np.eye(tangents + 1), 2.0e5 * ladder) + 1.0e5 * np.eye(size)
    tilt = random.uniform(0.0, 0.4)
    rows = []
    for i in range(masses):
        for axis in range(tangents):
            rows.append(np.eye(size)[axis * masses + i] - tilt * np.eye(size)[tangents * masses + i])
        rows.append(np.eye(size)[tangents * masses + i] + tilt * np.eye(size)[i])
    press, shake = np.zeros((2, size))
    press[tangents * masses :] = random.uniform(30.0, 90.0, masses)
    level = 10 ** random.uniform(0.7, 1.7)
    shake[0] = level
    other = np.zeros(size)
    other[(tangents - 1) * masses] = 0.5 * level
    scene = ReducedScene(
        np.eye(size),
        stiffness,
        "ratio",
        random.uniform(0.005, 0.03),
        None,
        laws(masses, tangents, 10 ** random.uniform(4.7, 5.7, 2), random.uniform(0.2, 0.7)),
        np.array(rows),
        press[None, :],
        np.array([0.0 * shake, shake, other]),
        np.eye(size)[:1],
        ["end"],
    )
    return Case(f"chain, {tangents} tangent{'s'[: tangents - 1]}", scene, across(scene))


def block(random: np.random.Generator, tangents: int) -> Case:
    """A steel block on friction contacts and a soft foundation, which holds it where all contacts slip."""
    contacts = int(random.integers(3, 6))
    stiffness = 10 ** random.uniform(9.0, 10.0)
    if tangents == 1:
        scene = scenes.plane_block(contacts, 6, stiffness)
    else:
        scene = scenes.hexahedral_block(max(contacts, 4), 24, 10 * stiffness)
    first = scenes.stuck_system(scene).frequencies_hz[0]
    foundation = (2 * np.pi * random.uniform(0.3, 0.7) * first) ** 2 * scene.mass
    scene = replace(scene, stiffness=scene.stiffness + foundation, damping_value=random.uniform(0.003, 0.02))
    frequencies = across(scene)
    threshold = np.median(scenes.slip_thresholds(scene, scenes.stuck_system(scene), 0.95 * first))
    level = threshold * 10 ** random.uniform(-0.5, 0.4)
    return Case(f"block, {tangents} tangent{'s'[: tangents - 1]}", loaded(scene, level), frequencies)


def blade(scene: ReducedScene) -> Callable[[np.random.Generator], Case]:
    """The blade of a job with other friction, load and speed."""
    frequencies = scenes.stuck_system(scene).frequencies_hz[0] * np.array(BLADE_POINTS)

    def make(random: np.random.Generator) -> Case:
        laws = scene.laws | {"friction_coefficient": scene.laws["friction_coefficient"] * random.uniform(0.5, 1.5)}
        other = replace(scene, laws=laws, static=scene.static * random.uniform(0.6, 1.4))
        level = 10 ** random.uniform(-0.6, 0.5)
        return Case("blade", loaded(other, level), frequencies, BLADE_FIXED, BLADE_REFERENCE)

    return make


def loaded(scene: ReducedScene, level: float) -> ReducedScene:
    """The scene with its harmonic load times a level."""
    return replace(scene, harmonic=np.ascontiguousarray(level * scene.harmonic))


def laws(contacts: int, tangents: int, stiffness: np.ndarray, friction: float) -> dict[str, np.ndarray]:
    """Equal laws; stiffness along tangents and normal."""
    return {
        "tangents": np.full(contacts, tangents, dtype=np.int32),
        "tangential_stiffness": np.full(contacts, stiffness[0]),
        "normal_stiffness": np.full(contacts, stiffness[1]),
        "friction_coefficient": np.full(contacts, friction),
        "gap": np.zeros(contacts),
        "preload": np.zeros(contacts),
    }


def across(scene: ReducedScene) -> np.ndarray:
    """Frequencies, downwards, across the first resonance, stuck and free of friction."""
    stuck = scenes.stuck_system(scene).frequencies_hz[0]
    kept = scene.laws | {"tangential_stiffness": 1e-9 * scene.laws["tangential_stiffness"]}
    free = scenes.stuck_system(replace(scene, laws=kept)).frequencies_hz[0]
    return np.linspace(1.03 * stuck, 0.97 * max(free, 0.6 * stuck), POINTS)


@dataclass(frozen=True)
class Run:
    """What a run found: amplitudes and estimates at its points, harmonics, which converged and are unique, cost."""

    amplitude: np.ndarray
    estimate: np.ndarray
    harmonics: np.ndarray
    converged: np.ndarray
    unique: np.ndarray
    slipping: np.ndarray
    seconds: float
    work: float


def run(case: Case, options: Options) -> Run:
    """Walk the static loads and solve the frequencies one by one."""
    with Solver(MPI.COMM_SELF, case.scene, options) as solver:
        solver.follow_static_path(np.array([[0.0], [1.0]]), 10, case.frequencies_hz[0])
        started = time.process_time()
        points: list[Point] = list(solver.solve_at(list(case.frequencies_hz), 1.0, 0))
        seconds = time.process_time() - started
    return Run(
        np.array([point.amplitude[0] for point in points]),
        np.array([point.estimate for point in points]),
        np.array([point.harmonics.shape[1] // 2 for point in points]),
        np.array([point.outcome == "converged" for point in points]),
        np.array([point.unique for point in points]),
        np.array([sum(point.states[2:]) for point in points]),
        seconds,
        points[-1].work,
    )


def options_of(case: Case, harmonics: int, samples: int = 0) -> Options:
    """A fixed series; contacts with two tangents by enough samples for it."""
    return Options(harmonics=harmonics, samples=max(samples, 128, 6 * harmonics + 2))


def automatic(tolerance: float) -> Options:
    """Harmonics as a job's tolerance has them."""
    return Options(
        harmonics=3,
        samples=64,
        choose_harmonics=True,
        accepted_error=tolerance,
    )


def examine(case: Case) -> dict | None:
    """All runs of a case; None where a run does not converge, or nothing slips."""
    tangents = int(case.scene.laws["tangents"][0])
    truth = run(case, options_of(case, *(case.reference or REFERENCE[tangents])))
    if not truth.converged.all() or not truth.slipping.any():
        return None
    runs = {f"tolerance {tolerance:g}": run(case, automatic(tolerance)) for tolerance in TOLERANCES}
    runs |= {f"H = {harmonics}": run(case, options_of(case, harmonics)) for harmonics in case.fixed}
    if not all(one.converged.all() for one in runs.values()):
        return None
    peak = truth.amplitude.max()
    told = {
        "kind": case.kind,
        "reference": float(truth.estimate[truth.amplitude.argmax()]),
        "runs": {name: {"error": float(abs(one.amplitude.max() / peak - 1.0)),
                        "estimate": float(one.estimate[one.amplitude.argmax()]),
                        "harmonics": int(one.harmonics.max()), "seconds": one.seconds, "work": one.work}
                 for name, one in runs.items()},
        "ratios": [],
        "unique": [],
    }  # fmt: skip
    for one in runs.values():
        true = np.abs(one.amplitude / truth.amplitude - 1.0)
        # The estimate is relative to the finer amplitude.
        known = (true > 1e-7) & (true > 10.0 * truth.estimate)
        told["ratios"] += (one.estimate[known] / true[known]).tolist()
        told["unique"] += (one.unique & truth.unique)[known].tolist()
    return told


def summary(cases: list[dict]) -> dict:
    """Shares and quantiles over all cases."""
    ratios = np.array([ratio for case in cases for ratio in case["ratios"]])
    found: dict = {
        "scenes": len(cases),
        "points with an estimate to check": len(ratios),
        "estimate over truth within 0.3 and 10": float(np.mean((ratios > 0.3) & (ratios < 10.0))),
        "estimate over truth, quantiles 1, 5, 50, 95, 99 %": np.quantile(
            ratios, [0.01, 0.05, 0.5, 0.95, 0.99]
        ).tolist(),
    }
    # None were told by runs kept of an earlier version.
    unique = np.array([flag for case in cases for flag in case.get("unique", [])], dtype=bool)
    if len(unique) == len(ratios):
        inside = (ratios > 0.3) & (ratios < 10.0)
        found |= {f"the same, {len(part)} points that are {name}": float(np.mean(part)) if len(part) else None
                  for name, part in (("unique", inside[unique]), ("not", inside[~unique]))}  # fmt: skip
    charged = [case for case in cases if "H = 20" in case["runs"]]
    for tolerance in TOLERANCES:
        name = f"tolerance {tolerance:g}"
        errors = np.array([case["runs"][name]["error"] for case in cases])
        rows = {"error within": float(np.mean(errors <= tolerance)), "median error": float(np.median(errors))}
        for cost in ("seconds", "work"):
            if not charged:
                continue
            total, fixed = (sum(case["runs"][key][cost] for case in charged) for key in (name, "H = 20"))
            each = [case["runs"]["H = 20"][cost] / case["runs"][name][cost] for case in charged]
            rows |= {f"H = 20 over it, {cost}": fixed / total, f"the same, median of scenes, {cost}": np.median(each)}
        found[name] = rows
    if charged:
        found["median error, H = 20"] = float(np.median([case["runs"]["H = 20"]["error"] for case in charged]))
    return found


def blade_maker(path: str) -> Callable[[np.random.Generator], Case]:
    """Scenes like a job that has been run, its rom.h5 at hand."""
    from attrito.job.reading import read_job
    from attrito.scene.build import build_scene
    from attrito.scene.reduced_model import make_rom, reduced_scene

    job = read_job(path)
    whole = build_scene(job)
    return blade(reduced_scene(job, whole, make_rom(MPI.COMM_SELF, job, whole)[0]))


def kept(path: str | None) -> Iterator[dict | None]:
    """What an earlier run with the same seed has come to."""
    if path and Path(path).exists():
        yield from map(json.loads, Path(path).read_text().splitlines())


def main() -> None:
    """Solve scenes until there are enough, and report."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--scenes", type=int, default=500)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", metavar="FILE", help="what each try came to, a line each; a run goes on from there")
    parser.add_argument("--blade", metavar="JOB", help="a job that has been run: a scene in fifty is like it")
    parser.add_argument("--only", choices=("wedge", "chain", "block", "blade"), help="one kind of scene")
    arguments = parser.parse_args()
    makers = [wedge, wedge, lambda r: chain(r, 1), lambda r: chain(r, 2), lambda r: block(r, 1)]
    hexahedral, bladed = (lambda r: block(r, 2)), blade_maker(arguments.blade) if arguments.blade else None
    cases = list(kept(arguments.keep))
    while sum(case is not None for case in cases) < arguments.scenes:
        tried = len(cases)
        random = np.random.default_rng([arguments.seed, tried])
        maker = makers[tried % len(makers)]
        if tried % 20 == 19:
            maker = hexahedral
        if bladed is not None and (tried % 50 == 49 or arguments.only == "blade"):
            maker = bladed
        if arguments.only in ("wedge", "chain", "block"):
            of_kind = {"wedge": (wedge, wedge), "chain": makers[2:4], "block": (makers[4], hexahedral)}
            maker = of_kind[arguments.only][tried % 2]
        cases.append(examine(maker(random)))
        if arguments.keep:
            with open(arguments.keep, "a") as stream:
                stream.write(json.dumps(cases[-1]) + "\n")
        if len(cases) % 20 == 0:
            common.progress(f"{sum(case is not None for case in cases)} scenes, {len(cases)} tried")
    tried, cases = len(cases), [case for case in cases if case is not None]
    common.report({"tried": tried, "seed": arguments.seed, "summary": summary(cases), "cases": cases})


if __name__ == "__main__":
    main()
