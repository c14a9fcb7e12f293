"""Would series of their own length for each contact pay? Harmonics that contacts need beside the common number.

    .venv/bin/python benchmarks/contact_harmonics.py > contact_harmonics.json
    .venv/bin/python benchmarks/contact_harmonics.py --blade input/blade.toml

Scenes of `accuracy.py`, and a block of 24 contacts, are solved by tolerances. At a point of H harmonics contact c is
said to need as many, h, as leave no more than an equal share of what the common number leaves out,

    T_c(h) <= |T(H - 1)| / sqrt(n),   T_c(h)^2 = sum_{l = h + 1 ... H} |g_cl|^2 / l^(2 p),   T(h)^2 = sum_c T_c(h)^2,

g the contact's force less its springs', n contacts, p = 2 where inertia answers the harmonics left out and 0 where the
static flexibility does. Contacts that stick or are shaken down have no harmonics as it is. Prints JSON: for each point
that slips H, contacts, those that slip, and the unknowns that lengths of their own would leave of theirs, for p = 2, 0.
"""

from __future__ import annotations

import argparse

import common  # isort: skip (sets the threads of BLAS before numpy is loaded)
import accuracy
import numpy as np
import scenes
from mpi4py import MPI

from attrito.library.session import Solver

TOLERANCES = (1e-2, 1e-3)
# Levels of the block, in median slip thresholds, and where it is solved, parts of the stuck natural frequency
LEVELS, PLACES = (1.0, 1.5, 3.0), (0.9, 0.91, 0.92)


def deviation(case: accuracy.Case, series: dict[str, np.ndarray]) -> np.ndarray:
    """Coefficients of the contacts' forces less their springs', [contacts, 3, 2 H + 1]."""
    laws = case.scene.laws
    springs = np.stack([laws["tangential_stiffness"], laws["tangential_stiffness"], laws["normal_stiffness"]], axis=1)
    return np.nan_to_num(series["/contacts/force"] - springs[:, :, None] * series["/contacts/displacement"])


def needed(force: np.ndarray, power: int) -> np.ndarray:
    """Harmonics that each contact needs, `[contacts]`, of forces `[contacts, 3, 2 H + 1]`."""
    highest = force.shape[2] // 2
    pairs = force[:, :, 1:].reshape(len(force), 3, highest, 2)
    squares = (pairs**2).sum(axis=(1, 3)) / np.arange(1, highest + 1) ** (2.0 * power)
    tails = np.cumsum(squares[:, ::-1], axis=1)[:, ::-1]
    return (tails > tails[:, -1].mean()).sum(axis=1)


def examine(case: accuracy.Case, tolerance: float) -> list[dict]:
    """The points of a case at which a contact slips."""
    found = []
    with Solver(MPI.COMM_SELF, case.scene, accuracy.automatic(tolerance)) as solver:
        solver.follow_static_path(np.array([[0.0], [1.0]]), 10, case.frequencies_hz[0])
        for point in solver.solve_at(list(case.frequencies_hz), 1.0, 0):
            slipping = sum(point.states[2:])
            if point.outcome != "converged" or not slipping:
                continue
            series: dict[str, np.ndarray] = {}
            solver.report_point(lambda path, _, values, series=series: series.__setitem__(path, np.array(values)))
            force, highest = deviation(case, series), point.harmonics.shape[1] // 2
            left = [float(np.sum(2 * needed(force, power) + 1, where=needed(force, power) > 0)) for power in (2, 0)]
            whole = slipping * (2 * highest + 1)
            found.append({"kind": case.kind, "tolerance": tolerance, "harmonics": highest, "contacts": len(force),
                          "slipping": slipping, "unknowns left": [part / whole for part in left]})  # fmt: skip
    return found


def block_cases() -> list[accuracy.Case]:
    """A block of 24 contacts with two tangents at several levels."""
    scene = scenes.hexahedral_block(24, 80, 2e10)
    stuck = scenes.stuck_system(scene)
    first = stuck.frequencies_hz[0]
    threshold = float(np.median(scenes.slip_thresholds(scene, stuck, 0.95 * first)))
    frequencies = first * np.array(PLACES)
    return [accuracy.Case("block, 24 contacts", accuracy.loaded(scene, level * threshold), frequencies)
            for level in LEVELS]  # fmt: skip


def main() -> None:
    """Examine the scenes and report."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--scenes", type=int, default=6, help="of each kind")
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--blade", metavar="JOB", help="a job that has been run: scenes like it as well")
    arguments = parser.parse_args()
    makers = [lambda r: accuracy.chain(r, 1), lambda r: accuracy.block(r, 1), lambda r: accuracy.block(r, 2)]
    if arguments.blade:
        makers.append(accuracy.blade_maker(arguments.blade))
    seeds = range(arguments.scenes)
    cases = [maker(np.random.default_rng([arguments.seed, seed])) for maker in makers for seed in seeds] + block_cases()
    points = [point for case in cases for tolerance in TOLERANCES for point in examine(case, tolerance)]
    kinds = {point["kind"]: [other for other in points if other["kind"] == point["kind"]] for point in points}
    quantiles = {
        kind: {f"p = {power}": np.quantile([point["unknowns left"][i] for point in group], [0, 0.25, 0.5, 1]).tolist()
               for i, power in enumerate((2, 0))} | {"points": len(group)}
        for kind, group in kinds.items()
    }  # fmt: skip
    common.report({"unknowns left, least, lower quartile, median, most": quantiles, "points": points})


if __name__ == "__main__":
    main()
