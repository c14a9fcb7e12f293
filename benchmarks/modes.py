"""Modes of random scenes, followed from stick through the onset of slip until every contact slips: is one lost?

    .venv/bin/python benchmarks/modes.py --scenes 30 --seed 1 --tangents 2

Scenes are those of `peaks_scenes.py`, without their harmonic loads. The first tangent mode is followed through
AMPLITUDES from BELOW of the amplitude at which its first contact would slip, all stuck and none with friction at rest,

$$ Q_c = \\mu N_0 / (|k_t B_t \\phi| + \\mu |k_n B_n \\phi|), $$

to BEYOND times that of the median contact. `equal`: modes of that frequency; `folds`: amplitudes before which the curve
folds; `drifts`: points at which sliders creep on; `lost`: the first amplitude that was not found. JSON on standard
output.
"""

from __future__ import annotations

import argparse
import time

import common  # isort: skip (sets the threads of BLAS before numpy is loaded)
import numpy as np
import peaks_scenes
import scenes
from mpi4py import MPI

from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options, Solver
from attrito.modes.tracker import ModeTracker
from attrito.runs.tangent_modes import equal_modes

BELOW, BEYOND, AMPLITUDES = 0.5, 10.0, 30
PATH, STATIC_STEPS = np.array([[0.0], [1.0]]), 20


def amplitudes(scene: ReducedScene, shape: np.ndarray) -> np.ndarray:
    """Those at which a mode of unit modal mass is located."""
    stuck = scenes.stuck_system(scene)
    rows = (stuck.springs * (scene.directions @ shape)).reshape(len(scene.laws["tangents"]), -1)
    at_rest = stuck.modes @ (stuck.modes.T @ scene.static[0] / (2 * np.pi * stuck.frequencies_hz) ** 2)
    pressed = (stuck.springs * (scene.directions @ at_rest)).reshape(rows.shape)[:, -1]
    friction = scene.laws["friction_coefficient"]
    first = friction * np.maximum(pressed, 0.0) / (np.linalg.norm(rows[:, :-1], axis=1) + friction * abs(rows[:, -1]))
    return np.geomspace(BELOW * first[first > 0.0].min(), BEYOND * np.median(first[first > 0.0]), AMPLITUDES)


def follow(scene: ReducedScene, options: Options) -> dict[str, object]:
    """The first mode of a scene."""
    started = time.process_time()
    with Solver(MPI.COMM_SELF, scene, options) as solver:
        lowest = scenes.stuck_system(scene).frequencies_hz[0]
        solver.follow_static_path(PATH, STATIC_STEPS, 0.5 * lowest / (solver.coefficients // 2))
        modes = solver.linear_modes("tangent", 4)
        equal = [number - 1 for number in equal_modes(modes.natural_hz, 1)]
        tracker = ModeTracker(solver, scene, modes.shapes[equal], modes.natural_hz[0])
        found, lost = [], None
        for value in amplitudes(scene, modes.shapes[0].real).tolist():
            one = tracker.at(value)
            if not one.converged:
                lost = value
                break
            found.append(one)
    last = found[-1] if found else one
    return {
        "equal": len(equal),
        "states": common.states(last.point),
        "points": len(found),
        "iterations": sum(one.iterations for one in found),
        "from_hz": modes.natural_hz[0],
        "to_hz": last.point.frequency_hz,
        "folds": [one.amplitude for one in found if one.folded],
        "drifts": sum(one.point.outcome == "indeterminate" for one in found),
        "lost": lost,
        "seconds": time.process_time() - started,
    }


def main() -> None:
    """Follow all scenes; JSON."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--scenes", type=int, default=30)
    parser.add_argument("--first", type=int, default=0, help="number of the first scene")
    parser.add_argument("--tangents", type=int, choices=(1, 2), help="of contacts; both unless given")
    parser.add_argument("--harmonics", type=int, default=5)
    arguments = parser.parse_args()
    found = []
    for number in range(arguments.first, arguments.first + arguments.scenes):
        scene = peaks_scenes.make(arguments.seed, number, arguments.tangents)
        one = {"scene": number, "kind": scene.kind} | follow(scene.reduced, Options(arguments.harmonics))
        found.append(one)
        common.progress(f"scene {number}, {scene.kind}: {'followed' if one['lost'] is None else 'lost'}")
    common.report({"modes": found, "followed": sum(one["lost"] is None for one in found)})


if __name__ == "__main__":
    main()
