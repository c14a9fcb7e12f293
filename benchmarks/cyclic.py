"""One sector under a travelling wave beside the whole wheel: the same motion, its stability, and what it costs.

    .venv/bin/python benchmarks/cyclic.py waves > waves.json
    .venv/bin/python benchmarks/cyclic.py breaking > breaking.json
    .venv/bin/python benchmarks/cyclic.py cost > cost.json

`waves`: random sectors of wheels of 3, 5, 6, 8 and 12, waves forward, backward and standing, by events and by samples,
at 50 points each, at four levels between sticking and lift-off. `alike` counts the points where the wheel by itself
comes to the sector's motion. Elsewhere it may come to another: sliders that contacts do not forget start at one instant
in all sectors there, and some points have several motions. It is solved again, started near the wave, each sector's
sliders as they are in the wave then (`from_wave`). `left` counts the rest.

`breaking`: the same wave in a wheel of 3 sectors, where it is stable, and of 6, where it is not: how far motion in time
of the whole wheel is from it after so many periods, started from the wave with a perturbation of 1e-6 of its amplitude.

`cost`: processor seconds of a Newton iteration and of a point of a sweep of a sector beside those of a structure by
itself of the same size and contacts, of an iteration of the whole wheel of 12 and of 60 beside the sector's, of the
wave's multipliers beside those of the wheel by the flow of a whole period, and by Hill's problem beside a structure's.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from typing import Any

import common  # isort: skip (sets the threads of BLAS before numpy is loaded)
import numpy as np
from cyclic_scenes import PAIRS, random_sector
from mpi4py import MPI

from attrito.library.integrator import Integrator, Run
from attrito.library.kernels import contact_at_instants
from attrito.library.names import ENGINES, ORBITS, VERDICTS
from attrito.library.points import Point, StoredPoint
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options, Solver
from attrito.library.structures import make_law
from attrito.runs.stability import examine_point, fetch_multipliers
from attrito.scene.wheel import wave_in_wheel, whole_wheel

WHEELS = (3, 5, 6, 8, 12)
LEVELS = (0.05, 0.3, 1.0, 4.0)
# A multiple of N / gcd(N, EO) for all wheels
SAMPLES = 120
# A difference that is of another solution, and none of rounding
SAME_BRANCH = 1e-6
# How far from the wave a start near it is: the second where the first makes contacts slip that do not
NEAR = (1e-3, 1e-6)


def solved(scene: ReducedScene, options: Options, frequencies: np.ndarray, level: float) -> list[Any]:
    """Points at frequencies, each from the one before, with motion `[m, 2 H + 1]` and sliders `[nc, width]`."""
    with Solver(MPI.COMM_SELF, scene, options) as solver:
        solver.follow_static_path(np.array([[0.0], [1.0]]), 10, frequencies[0])
        points = solver.solve_at(list(frequencies), level, 0)
        return [(point, solver.coordinates(), sliders_of(solver)) for point in points]


def sliders_of(solver: Solver) -> np.ndarray:
    """Sliders at the start of the period of the solver's point, `[nc, width]`."""
    found = {}
    solver.report_point(lambda path, _, entry: found.update({path: entry}))
    sliders: np.ndarray = found["/contacts/slider"]
    return sliders


def wave_sliders(wheel: ReducedScene, wave: np.ndarray, slider: np.ndarray) -> np.ndarray:
    """Sliders of all sectors `[N nc, width]` at the start of the first one's period: what contacts make of the wave.

    A contact that sticks keeps its slider, one of the sector's `[nc, width]`, others have it from the motion.
    """
    tangents, stiffness = wheel.laws["tangents"], wheel.laws["tangential_stiffness"]
    rows = np.split(wheel.directions @ wave, np.cumsum(tangents + 1)[:-1])
    sliders = np.tile(slider, (len(tangents) // len(slider), 1))
    for i, (count, motion) in enumerate(zip(tangents, rows, strict=True)):
        u, force = contact_at_instants(make_law(wheel.laws, i), motion, sliders[i], SAMPLES)
        sliders[i, :count] = u[:count, -1] - force[:count, -1] / stiffness[i]
    return sliders


def difference(one: Point, other: Point) -> float:
    """The largest of any harmonic of any monitor, relative to the largest harmonic."""
    return float(np.abs(one.harmonics - other.harmonics).max() / np.abs(other.harmonics).max())


def compare_wave(scene: ReducedScene, points: int) -> dict[str, Any]:
    """Differences where both come to the same motion by themselves, and where the wheel starts near the wave."""
    assert scene.sector is not None
    sector, wheel = scene.sector, whole_wheel(scene)
    options = Options(harmonics=5, tolerance=1e-13)
    frequencies = np.linspace(0.4, 0.08, -(-points // len(LEVELS)))
    kept = np.delete(np.arange(len(scene.mass)), sector.upper)
    draw = np.random.default_rng(1)
    tally = {"points": 0, "solved": 0, "alike": 0, "from_wave": 0, "left": 0}
    worst = {"worst_alike": 0.0, "worst_from_wave": 0.0}
    for level in LEVELS:
        wheels = solved(wheel, options, frequencies, level)
        with Solver(MPI.COMM_SELF, wheel, options) as solver:
            solver.follow_static_path(np.array([[0.0], [1.0]]), 10, frequencies[0])
            solver.set_excitation(frequencies[-1], frequencies[0], level)
            for (one, motion, slider), (whole, _, _) in zip(
                solved(scene, options, frequencies, level), wheels, strict=True
            ):
                tally["points"] += 1
                if not one.is_solved:
                    continue
                tally["solved"] += 1
                if whole.is_solved and difference(one, whole) < SAME_BRANCH and one.unique and whole.unique:
                    tally["alike"] += 1
                    worst["worst_alike"] = max(worst["worst_alike"], difference(one, whole))
                    continue
                wave = wave_in_wheel(motion, sector)
                sliders = wave_sliders(wheel, wave, slider)
                away = np.inf
                for near in NEAR:
                    kick = near * np.abs(motion[:, 1:]).max() * draw.uniform(-1.0, 1.0, wave.shape)
                    if away >= SAME_BRANCH and solver.start_from(
                        StoredPoint(one.frequency_hz, wave + kick, sliders), level
                    ):
                        found = solver.coordinates()[: len(kept)]
                        away = float(np.abs(found - motion[kept]).max() / np.abs(motion).max())
                if away >= SAME_BRANCH:
                    tally["left"] += 1
                    continue
                tally["from_wave"] += 1
                worst["worst_from_wave"] = max(worst["worst_from_wave"], away)
    return tally | worst


def waves(arguments: argparse.Namespace) -> list[dict[str, Any]]:
    """All wheels, three waves each."""
    rows = []
    for sectors in arguments.sectors:
        orders = {1, sectors - 1, sectors // 2 if sectors % 2 == 0 else 2}
        for engine_order in sorted(orders):
            for tangents in (1, 2):
                seed = arguments.seed + sectors
                scene = random_sector(seed, sectors, engine_order, tangents=tangents)
                row = {"sectors": sectors, "engine_order": engine_order, "seed": seed, "tangents": tangents}
                rows.append(row | compare_wave(scene, arguments.points))
                print(rows[-1], file=sys.stderr, flush=True)
    return rows


def breaking(arguments: argparse.Namespace) -> list[dict[str, Any]]:
    """One random sector in two wheels; nodal diameters 1 of 3 and 2 of 6 are one and the same wave."""
    frequency, options = 0.18, Options(harmonics=31, tolerance=1e-12)
    rows = []
    for sectors, engine_order in ((3, 1), (6, 2)):
        scene = random_sector(121, sectors, engine_order)
        with Solver(MPI.COMM_SELF, scene, options) as solver:
            solver.follow_static_path(np.array([[0.0], [1.0]]), 10, frequency)
            list(solver.solve_at([0.22, 0.2, frequency], 1.0, 0))
            wave = wave_in_wheel(solver.coordinates(), scene.sector)
            report, reason = examine_point(solver, ENGINES["monodromy"], ORBITS["balance"])
            real, imaginary, kind = fetch_multipliers(solver, ENGINES["monodromy"], report.monodromy)
        largest = float(np.abs(real + 1j * imaginary)[kind == 0].max())
        rate = 2.0 * np.pi * frequency * np.arange(1, options.harmonics + 1)
        start = wave[:, 0] + wave[:, 1::2].sum(axis=1)
        amplitude = np.linalg.norm(wave[:, 1:3])
        kick = 1e-6 * amplitude * np.random.default_rng(1).uniform(-1.0, 1.0, len(start))
        away = []
        with Integrator(whole_wheel(scene)) as integrator:
            integrator.start(start + kick, wave[:, 2::2] @ rate, np.zeros((2 * sectors, 2)), np.ones(1))
            for _ in range(arguments.periods):
                integrator.run(Run(frequency, cycles=1, samples=1))
                away.append(float(np.linalg.norm(integrator.state()[0] - start) / amplitude))
        rows.append(
            {
                "sectors": sectors,
                "engine_order": engine_order,
                "verdict": VERDICTS[report.verdict],
                "largest_multiplier": largest,
                "reason": reason,
                "away": away,
            }
        )
    return rows


def seconds_of_iterations(scene: ReducedScene, options: Options, turns: int = 3) -> float:
    """Processor seconds a Newton iteration of 40 frequencies that are solved, the least of some turns."""
    least = np.inf
    for _ in range(turns):
        with Solver(MPI.COMM_SELF, scene, options) as solver:
            solver.follow_static_path(np.array([[0.0], [1.0]]), 10, 0.1)
            begun = time.process_time()
            points = list(solver.solve_at(list(np.linspace(0.06, 0.05, 40)), 1.0, 0))
            least = min(least, (time.process_time() - begun) / sum(point.iterations for point in points))
    return least


def seconds_of_sweep(scene: ReducedScene, options: Options, turns: int = 3) -> tuple[float, int]:
    """Processor seconds of a sweep through the band, the least of some turns, and its points."""
    least, number = np.inf, 0
    for _ in range(turns):
        with Solver(MPI.COMM_SELF, scene, options) as solver:
            solver.follow_static_path(np.array([[0.0], [1.0]]), 10, 0.4)
            begun = time.process_time()
            number = len(list(solver.sweep(0.4, 0.08, 1.0, 0, 5000)))
            least = min(least, time.process_time() - begun)
    return least, number


def seconds_of_examination(scene: ReducedScene, engine: str) -> float:
    """Processor seconds of the multipliers of one point, without what is made once."""
    with Solver(MPI.COMM_SELF, scene, Options(harmonics=5)) as solver:
        solver.follow_static_path(np.array([[0.0], [1.0]]), 10, 0.15)
        list(solver.solve_at([0.15], 1.0, 0))
        examine_point(solver, ENGINES[engine], ORBITS["balance"])
        begun = time.process_time()
        examine_point(solver, ENGINES[engine], ORBITS["balance"])
        return time.process_time() - begun


def by_itself(scene: ReducedScene) -> ReducedScene:
    """The structure that is left of a sector whose next one is itself, tied to nothing."""
    assert scene.sector is not None
    return replace(scene, directions=scene.directions + scene.sector.next_directions, sector=None)


def cost(arguments: argparse.Namespace) -> dict[str, Any]:
    """Ratios of processor times in one run."""
    sectors, engine_order = 12, 5
    options = Options(harmonics=5)
    sector = random_sector(arguments.seed, sectors, engine_order, inside=arguments.size)
    size = len(sector.mass) - PAIRS
    plain = by_itself(random_sector(arguments.seed, 1, 0, inside=size, boundary=False))
    swept = {"plain": plain, "sector": sector, "wheel": whole_wheel(sector)}
    seconds = {name: seconds_of_iterations(scene, options) for name, scene in swept.items()}
    small = random_sector(32, sectors, engine_order)
    alone = by_itself(random_sector(32, 1, 0, inside=len(small.mass) - PAIRS, boundary=False))
    sweeps = {name: seconds_of_sweep(swept[name], options) for name in ("plain", "sector")}
    large = random_sector(arguments.seed, 60, 25, inside=arguments.size)
    of_60 = {"sector": large, "wheel": whole_wheel(large)}
    seconds |= {f"{name} of 60": seconds_of_iterations(scene, options, turns=1) for name, scene in of_60.items()}
    for name, scene, engine in (
        ("part of the wheel's flow", small, "monodromy"),
        ("wheel's flow", whole_wheel(small), "monodromy"),
        ("Hill of all wavenumbers", small, "hill"),
        ("Hill of a structure by itself", alone, "hill"),
    ):
        seconds[name] = seconds_of_examination(scene, engine)
    return {
        "sectors": sectors,
        "coordinates": size,
        "seconds": seconds,
        "sector_over_plain": seconds["sector"] / seconds["plain"],
        "sweeps": {name: {"seconds": taken, "points": points} for name, (taken, points) in sweeps.items()},
        "point_of_sector_s_sweep_over_plain": np.divide(*sweeps["sector"]) / np.divide(*sweeps["plain"]),
        "wheel_over_sector": seconds["wheel"] / seconds["sector"],
        "wheel_of_60_over_sector": seconds["wheel of 60"] / seconds["sector of 60"],
        "flow_over_its_part": seconds["wheel's flow"] / seconds["part of the wheel's flow"],
        "hill_over_plain": seconds["Hill of all wavenumbers"] / seconds["Hill of a structure by itself"],
    }


def main() -> None:
    """Print JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["waves", "breaking", "cost"])
    parser.add_argument("--sectors", type=int, nargs="*", default=list(WHEELS))
    parser.add_argument("--seed", type=int, default=20)
    parser.add_argument("--points", type=int, default=50, help="of each wave, at least")
    parser.add_argument("--periods", type=int, default=40, help="of motion in time")
    parser.add_argument("--size", type=int, default=40, help="coordinates inside a sector whose cost is measured")
    arguments = parser.parse_args()
    common.report({"waves": waves, "breaking": breaking, "cost": cost}[arguments.what](arguments))


if __name__ == "__main__":
    main()
