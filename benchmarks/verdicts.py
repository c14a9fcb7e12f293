"""Verdicts near folds, flips and Neimark-Sacker points, each held against motion in time of the perturbed orbit.

    .venv/bin/python benchmarks/verdicts.py --seed 1 --verdicts 200 --output verdicts.csv

Random masses, one or two, stand on springs and meet walls at random angles, with one tangent or two. A sweep follows a
branch and locates its bifurcations; the points on both sides of each are examined. Every verdict is then checked by
time integration alone: the periodic orbit next to the point is found by Newton's method on the period map with a
finite-difference Jacobian, perturbed in random directions, and marched until the perturbations fade or grow.

A verdict is wrong if perturbations of a `stable` orbit grow or those of an `unstable` one fade. `indeterminate` is not
wrong; it is counted. Prints JSON with the counts; `--output` keeps one row a point, with the seed of its scene.
"""

from __future__ import annotations

import argparse
import csv
import ctypes
import itertools
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields, replace

import common  # isort: skip (sets the threads of BLAS before numpy is loaded)
import numpy as np
from mpi4py import MPI

from attrito.library.family import Family
from attrito.library.integrator import Integrator, Run
from attrito.library.names import BIFURCATION_KINDS as BIFURCATIONS
from attrito.library.names import ENGINES, ORBITS
from attrito.library.points import Point
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options, Solver
from attrito.library.structures import RawBifurcation, pointer
from attrito.runs.stability import examine_point, fetch_multipliers
from attrito.support.errors import NumericsError

PATH = np.array([[0.0], [1.0]])
STATIC_STEPS = 20
FORCE = 10.0
BASE = (200.0 * np.pi) ** 2
# A point counts as near a bifurcation within so many steps of the sweep.
NEAR_STEPS = 2
TOLERANCE = 0.01
VERDICTS = {0: "unstable", 1: "stable", 2: "indeterminate", -1: "not_examined"}
# Perturbation of the orbit, part of its amplitude; periods before its growth counts, and at most; growth that decides.
PERTURBATION, SETTLED = 1e-6, 1e-11
TRANSIENT, PERIODS, DECIDES = 40, 1500, np.log(20.0)
# Longest step of Newton's method, part of the amplitude: beside a fold there are two orbits.
LONGEST_STEP = 0.03
# Of a perturbation that is gone within a period: what is left of it is the error of the orbit.
FADED = 1e-3
# Farthest that the periodic orbit may lie from the balance's where its period starts, part of the amplitude.
FARTHEST = 0.2
# Periods after which motion in time has settled, if it does; samples that show whether a contact moves.
SETTLING, SAMPLES = 500, 256


def random_scene(rng: np.random.Generator, tangents: int) -> tuple[ReducedScene, dict]:
    """A scene, and the sweep it is asked for: `start_hz`, `stop_hz`."""
    masses = int(rng.integers(1, 3)) if tangents == 1 else 1
    axes = tangents + 1
    size = masses * axes
    natural = np.array([1.0, rng.uniform(1.5, 8.0), rng.uniform(0.8, 2.0)])[:axes]
    stiffness = np.kron(np.eye(masses), BASE * np.diag(natural))
    links = rng.uniform(0.2, 1.5) * BASE * np.eye(axes)
    for i in range(masses - 1):
        pair = slice(i * axes, (i + 2) * axes)
        stiffness[pair, pair] += np.kron([[1.0, -1.0], [-1.0, 1.0]], links)
    damping = 20.0 * np.pi * rng.uniform(0.3, 2.0) * np.eye(size)
    rows = []
    for i in range(masses):
        frame = np.linalg.qr(rng.normal(size=(axes, axes)))[0]
        block = np.zeros((axes, size))
        block[:, i * axes : (i + 1) * axes] = frame
        rows.append(block)
    directions = np.vstack(rows)
    normals = directions[tangents :: tangents + 1]
    normal_stiffness = BASE * 10.0 ** rng.uniform(0.0, 2.3, masses)
    laws = {
        "tangents": np.full(masses, tangents, dtype=np.int32),
        "tangential_stiffness": normal_stiffness * rng.uniform(0.5, 1.5, masses),
        "normal_stiffness": normal_stiffness,
        "friction_coefficient": rng.uniform(0.05, 1.0, masses),
        "gap": np.zeros(masses),
        "preload": np.zeros(masses),
    }
    pressed = FORCE * rng.choice([0.0, 0.3, 1.0, 3.0]) * rng.uniform(0.5, 1.5)
    harmonic = np.zeros((3, size))
    harmonic[1:] = FORCE * rng.normal(size=(2, size)) / np.sqrt(size)
    scene = ReducedScene(
        np.eye(size),
        stiffness,
        "viscous",
        0.0,
        damping,
        laws,
        directions,
        (pressed * normals.sum(axis=0))[None, :],
        harmonic,
        np.eye(size),
        [f"q{i}" for i in range(size)],
    )
    ends = rng.permutation([rng.uniform(50.0, 90.0), rng.uniform(180.0, 320.0)])
    return scene, {"start_hz": float(ends[0]), "stop_hz": float(ends[1])}


@dataclass
class Examined:
    """A point of a sweep, as it was examined there."""

    point: Point
    verdict: str
    reason: str
    largest: float
    coordinates: np.ndarray
    slider: np.ndarray
    near: str = ""


def examine(solver: Solver, point: Point, contacts: int, orbit: str) -> Examined:
    """The point at which a solver stands."""
    members = Family(MPI.COMM_SELF, solver, contacts, len(point.amplitude))
    report, reason = examine_point(solver, ENGINES["monodromy"], ORBITS[orbit])
    largest = np.nan
    if report.monodromy:
        real, imaginary, kind = fetch_multipliers(solver, ENGINES["monodromy"], report.monodromy)
        largest = float(np.hypot(real, imaginary)[kind == 0].max(initial=0.0))
    slider = members.visit(lambda family: family.describe().slider)
    return Examined(point, VERDICTS[report.verdict], reason, largest, solver.coordinates(), slider)


def options() -> Options:
    """As a job with `tolerance = 0.01` alone."""
    return Options(harmonics=3, samples=64, choose_harmonics=True, accepted_error=TOLERANCE)


def sweep(scene: ReducedScene, start_hz: float, stop_hz: float, most: int, orbit: str) -> list[Examined]:
    """Points of a sweep, those near a bifurcation marked with its kind."""
    found: list[Examined] = []
    near: dict[int, str] = {}
    contacts = len(scene.laws["tangents"])
    with Solver(MPI.COMM_SELF, scene, options()) as solver:
        solver.follow_static_path(PATH, STATIC_STEPS, start_hz)
        for point in solver.sweep(start_hz, stop_hz, 1.0, 0, most):
            if point.outcome not in ("converged", "above_tolerance"):
                found.append(Examined(point, "not_solved", "", np.nan, np.empty(0), np.empty(0)))
                continue
            found.append(examine(solver, point, contacts, orbit))
            count = solver.call("attrito_find_bifurcations", ENGINES["monodromy"], ORBITS[orbit])
            for kind in bifurcations(solver, count, len(point.amplitude)):
                for place in range(len(found) - 1 - NEAR_STEPS, len(found) + NEAR_STEPS):
                    near.setdefault(place, kind)
    for place, kind in near.items():
        if 0 <= place < len(found):
            found[place].near = kind
    return found


def bifurcations(solver: Solver, count: int, monitors: int) -> Iterator[str]:
    """Kinds of those found on the last step."""
    for i in range(count):
        report, amplitude = RawBifurcation(), np.zeros(monitors)
        solver.call("attrito_bifurcation", i, ctypes.byref(report), pointer(amplitude))
        yield BIFURCATIONS[report.kind]


class PeriodMap:
    """One period of motion in time, of the coordinates that a contact law leaves free where the period starts.

    A contact that sticks there keeps its slider as coordinates; one that slips along two tangents keeps the direction
    of slip; else the slider follows the motion.
    """

    def __init__(self, scene: ReducedScene, frequency_hz: float, integrator: Integrator):
        self._scene, self._integrator = scene, integrator
        self.tangents = int(scene.laws["tangents"].max())
        # Without cycles to settle in: the one period that is recorded.
        self.run = Run(frequency_hz, 1.0, cycles=0, max_period_multiple=1, samples=1)
        self._regimes: list[int] = []

    def start(self, coordinates: np.ndarray, frequency_hz: float, slider: np.ndarray) -> np.ndarray:
        """Free coordinates of a balance's point `[m, 2 H + 1]` with sliders `[nc, 2]`; fixes what they are."""
        order = np.arange(1, (coordinates.shape[1] - 1) // 2 + 1)
        position = coordinates[:, 0] + coordinates[:, 1::2].sum(axis=1)
        velocity = 2.0 * np.pi * frequency_hz * coordinates[:, 2::2] @ order
        return self.take(position, velocity, slider)

    def take(self, position: np.ndarray, velocity: np.ndarray, slider: np.ndarray) -> np.ndarray:
        """The same of a state; 0 sticks, 1 slips, 2 open."""
        self._omega = 2.0 * np.pi * self.run.frequency_hz
        self._regimes = []
        for i in range(len(slider)):
            u, radius = self._of_contact(position, i)
            reach = np.linalg.norm(u - slider[i, : self.tangents])
            self._regimes.append(2 if radius <= 0.0 else int(reach >= radius * (1.0 - 1e-6)))
            self._sides = getattr(self, "_sides", {})
            self._sides[i] = np.sign(u[0] - slider[i, 0]) or 1.0
        return self.pack(position, velocity, slider)

    def _of_contact(self, position: np.ndarray, i: int) -> tuple[np.ndarray, float]:
        laws, n = self._scene.laws, self.tangents
        rows = self._scene.directions[i * (n + 1) : (i + 1) * (n + 1)] @ position
        normal = laws["preload"][i] + laws["normal_stiffness"][i] * (rows[n] - laws["gap"][i])
        return rows[:n], laws["friction_coefficient"][i] * max(normal, 0.0) / laws["tangential_stiffness"][i]

    def pack(self, position: np.ndarray, velocity: np.ndarray, slider: np.ndarray) -> np.ndarray:
        """Coordinates of a state; lengths, velocities over omega, angles times the radius."""
        parts = [position, velocity / self._omega]
        for i, regime in enumerate(self._regimes):
            u, radius = self._of_contact(position, i)
            if regime == 0:
                parts.append(slider[i, : self.tangents])
            elif regime == 1 and self.tangents == 2:
                back = u - slider[i]
                parts.append(np.array([np.arctan2(back[1], back[0]) * max(self._scale(i), 1e-300)]))
        return np.concatenate(parts)

    def _scale(self, i: int) -> float:
        """Length of a radian: a typical radius."""
        laws = self._scene.laws
        return FORCE * laws["friction_coefficient"][i] / laws["tangential_stiffness"][i]

    def unpack(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The state of coordinates."""
        m, n = len(self._scene.mass), self.tangents
        position, velocity = x[:m], x[m : 2 * m] * self._omega
        slider, at = np.zeros((len(self._regimes), 2)), 2 * m
        for i, regime in enumerate(self._regimes):
            u, radius = self._of_contact(position, i)
            slider[i, :n] = u
            if regime == 0:
                slider[i, :n] = x[at : at + n]
                at += n
            elif regime == 1 and n == 2:
                angle = x[at] / max(self._scale(i), 1e-300)
                # A little beyond the rim: the law puts it back and knows that it slips.
                slider[i] = u - radius * (1.0 + 1e-10) * np.array([np.cos(angle), np.sin(angle)])
                at += 1
            elif regime == 1:
                slider[i, 0] = u[0] - self._sides[i] * radius * (1.0 + 1e-10)
        return position, velocity, slider

    def one_period(self, x: np.ndarray) -> np.ndarray:
        """Coordinates after a period."""
        self._integrator.start(*self.unpack(x), PATH[-1])
        self._integrator.run(self.run)
        return self.pack(*self._integrator.state())

    def not_held(self, x: np.ndarray) -> np.ndarray:
        """Which coordinates are none of a slider that stays where it is over the period from x."""
        self.stand(x)
        held = np.all(self._integrator.run(replace(self.run, samples=SAMPLES)).regime == 0, axis=0)
        free = np.full(len(x), True)
        at = 2 * len(self._scene.mass)
        for i, regime in enumerate(self._regimes):
            width = self.tangents if regime == 0 else int(regime == 1 and self.tangents == 2)
            free[at : at + width] = not held[i]
            at += width
        return free

    def stand(self, x: np.ndarray) -> None:
        """Let the integrator stand there."""
        self._integrator.start(*self.unpack(x), PATH[-1])


def shoot(period: PeriodMap, x: np.ndarray, amplitude: float) -> np.ndarray | None:
    """The fixed point next to some coordinates; None if Newton's method finds none."""
    for _ in range(25):
        try:
            away = period.one_period(x) - x
            if np.linalg.norm(away) < SETTLED * amplitude:
                return x
            jacobian = np.empty((len(x), len(x)))
            step = 0.1 * PERTURBATION * amplitude
            for k in range(len(x)):
                moved = x.copy()
                moved[k] += step
                jacobian[:, k] = (period.one_period(moved) - moved - away) / step
        except NumericsError:
            return None
        correction = np.linalg.lstsq(jacobian, -away, rcond=1e-9)[0]
        size = np.linalg.norm(correction) / amplitude
        if not size < 10.0:
            return None
        x = x + correction * min(1.0, LONGEST_STEP / max(size, 1e-300))
    return x if np.linalg.norm(away) < 1e3 * SETTLED * amplitude else None


def in_time(period: PeriodMap, orbit: np.ndarray, amplitude: float, rng: np.random.Generator) -> str:
    """What becomes of a perturbation: `comes_back`, `leaves`, or `slow` where PERIODS periods do not decide.

    Every period the difference from the orbit is scaled back to the size of the perturbation, so that what grows least
    slowly remains (Benettin et al. 1980, doi:10.1007/BF02128236); its growth adds up after the first TRANSIENT periods.
    """
    free = period.not_held(orbit)
    size, growth = PERTURBATION * amplitude, 0.0
    push = np.where(free, rng.normal(size=len(orbit)), 0.0)
    for count in range(PERIODS):
        push *= size / np.linalg.norm(push)
        push = np.where(free, period.one_period(orbit + push) - orbit, 0.0)
        if np.linalg.norm(push) < FADED * size:
            return "comes_back"
        if count < TRANSIENT:
            continue
        growth += np.log(np.linalg.norm(push) / size)
        if abs(growth) > DECIDES:
            return "leaves" if growth > 0.0 else "comes_back"
    return "slow"


def check(scene: ReducedScene, one: Examined, rng: np.random.Generator) -> tuple[str, float]:
    """What motion in time says of a point, and how far its orbit lies from the balance's."""
    amplitude = float(np.linalg.norm(one.point.amplitude))
    frequency = one.point.frequency_hz
    m2 = 2 * len(scene.mass)
    with Integrator(scene) as integrator:
        period = PeriodMap(scene, frequency, integrator)
        balance = period.start(one.coordinates, frequency, one.slider)
        try:
            orbit = shoot(period, balance, amplitude)
            if distance(orbit, balance, m2, amplitude) > FARTHEST:
                # What motion in time comes to from the balance's own state, if that repeats.
                period.stand(balance)
                integrator.run(replace(period.run, cycles=SETTLING, fewest_cycles=SETTLING))
                orbit = shoot(period, period.take(*integrator.state()), amplitude)
            far = distance(orbit, balance, m2, amplitude)
            return ("no_periodic_solution" if far > FARTHEST else in_time(period, orbit, amplitude, rng)), far
        except NumericsError:
            return "no_periodic_solution", np.inf


def distance(orbit: np.ndarray | None, balance: np.ndarray, size: int, amplitude: float) -> float:
    """How far motions lie apart where the period starts, part of the amplitude; infinite if there is no orbit."""
    return np.inf if orbit is None else float(np.linalg.norm(orbit[:size] - balance[:size])) / amplitude


@dataclass
class Row:
    """A verdict and what motion in time says of it."""

    seed: int
    tangents: int
    place: int
    frequency_hz: float
    near: str
    verdict: str
    largest: float
    estimate: float
    in_time: str
    distance: float
    wrong: bool
    reason: str


def is_wrong(verdict: str, answer: str) -> bool:
    """Whether motion in time contradicts a verdict; a stable orbit is one that it comes to."""
    return (verdict, answer) in {
        ("stable", "leaves"),
        ("unstable", "comes_back"),
        ("stable", "no_periodic_solution"),
    }


def rows_of(seed: int, tangents: int, arguments: argparse.Namespace) -> list[Row]:
    """All points near bifurcations of one random scene."""
    rng = np.random.default_rng([seed, tangents])
    scene, ends = random_scene(rng, tangents)
    try:
        points = sweep(scene, **ends, most=arguments.max_points, orbit=arguments.orbit)
    except NumericsError:
        return []
    near = [(i, one) for i, one in enumerate(points) if one.near and one.verdict != "not_solved"]
    # A few of every scene: neither one scene nor one bifurcation is to fill the count.
    chosen = rng.permutation(len(near))[: arguments.per_scene]
    rows = []
    for i, one in (near[k] for k in sorted(chosen)):
        answer, far = check(scene, one, rng)
        wrong = is_wrong(one.verdict, answer)
        rows.append(
            Row(
                seed, tangents, i, one.point.frequency_hz, one.near, one.verdict, one.largest, one.point.estimate,
                answer, far, wrong, one.reason,
            )
        )  # fmt: skip
        if wrong:
            common.progress(str(rows[-1]))
    return rows


def main() -> None:
    """Draw scenes until there are enough verdicts with one tangent and with two."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--verdicts", type=int, default=200, help="stable or unstable, half of them with two tangents")
    parser.add_argument("--max-points", type=int, default=150, help="of a sweep")
    parser.add_argument("--per-scene", type=int, default=6, help="points at most")
    parser.add_argument("--orbit", default="auto", choices=list(ORBITS))
    parser.add_argument("--tangents", type=int, nargs="*", default=[1, 2])
    parser.add_argument("--seconds", type=float, default=1e9, help="no new scene after so long")
    parser.add_argument("--output", help="CSV, one row a point")
    arguments = parser.parse_args()
    rows: list[Row] = []
    started = time.time()
    for tangents in arguments.tangents:
        given, begun = 0, time.time()
        for seed in itertools.count(arguments.seed):
            if given >= arguments.verdicts // 2 or time.time() - begun > arguments.seconds:
                break
            new = rows_of(seed, tangents, arguments)
            rows += new
            given += sum(row.verdict in ("stable", "unstable") for row in new)
            common.progress(f"{tangents} tangent(s), seed {seed}: {given} verdicts, {time.time() - started:.0f} s")
    if arguments.output:
        with open(arguments.output, "w", newline="") as file:
            writer = csv.DictWriter(file, [field.name for field in fields(Row)])
            writer.writeheader()
            writer.writerows(asdict(row) for row in rows)
    common.report({"arguments": vars(arguments), **summary(rows)})


def summary(rows: list[Row]) -> dict:
    """Counts by tangents."""
    found = {}
    for tangents in sorted({row.tangents for row in rows}):
        own = [row for row in rows if row.tangents == tangents]
        decided = [row for row in own if row.verdict in ("stable", "unstable")]
        found[f"{tangents} tangent(s)"] = {
            "points": len(own),
            "verdicts": len(decided),
            "borne out wrong": sum(row.wrong for row in decided),
            "indeterminate": sum(row.verdict == "indeterminate" for row in own),
            "in time": dict(Counter(f"{row.verdict}: {row.in_time}" for row in own)),
            "near": dict(Counter(row.near for row in own)),
        }
    return found


if __name__ == "__main__":
    main()
