"""`attrito chart`: error against cost for a job's own scene, by every way that the program has to solve it.

The peak of the job's sweep is found first. Each way then solves the same few frequencies, from the start of the sweep
up the flank to the peak, so that every one of them has come along the branch; the error is that of the amplitudes at
the last,

    e = max over monitors |a - a_ref| / a_ref,

a_ref being the balance with harmonics chosen for the smallest error that the time allows. A run that would take too
long, by what the coarser ones have taken, is not begun, and all series have their coarse ways before any has finer
ones: when the time is spent the chart shows what there is. Cost is processor time without the static load path, and
counted work: operations by the formulas of src/balance/work.f90, for time integration 4 m (m + rows) a step. A way is
on the efficient front if none is both cheaper in time and nearer.

A sector under a travelling wave is charted beside its whole wheel, which is solved and integrated in time by itself;
the monitors are those of the first sector.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from attrito.charts.drawn_curve import curve_ways
from attrito.charts.fewer_modes import restricted
from attrito.charts.file import LEAST_SHARE, SOLVED, Chart, Way
from attrito.charts.flank import up_the_flank
from attrito.charts.limited import processor_seconds, within
from attrito.charts.turns import in_turn
from attrito.job.defaults import TOLERANCE
from attrito.job.job import Job
from attrito.job.reading import read_job
from attrito.library.integrator import Integrator, Run
from attrito.library.laws import are_coulomb
from attrito.library.points import Point
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options, Solver
from attrito.scene.build import build_scene
from attrito.scene.reduced_model import make_rom, reduced_scene
from attrito.scene.solver_options import solver_options
from attrito.scene.wheel import whole_wheel
from attrito.support.errors import InputError, NumericsError

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

HARMONICS = (1, 2, 3, 5, 7, 10, 14, 20, 30)
TOLERANCES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
STEPS = (32, 64, 128, 256, 512, 1024)
MODE_PARTS = (0.0, 0.1, 0.25, 0.5, 0.75)
SCHEMES = ("central_difference", "newmark", "hht", "generalised_alpha", "event")
CYCLES = 400
# What is estimated for the reference at best
REFERENCE = {1: 1e-9, 2: 1e-5}
# What the reference, and the whole chart, may take, in units of what one run of a series may
REFERENCE_SHARE, WHOLE = 3.0, 15.0
# Cost of a run against its harmonics: power of what is foreseen
HARMONICS_POWER = 2.0
# Shorter runs are repeated, and the least of the times is taken
SHORT = 0.2


class Bench:
    """A job's scene, brought to its peak again and again; `seconds`: what one run of a series may take.

    All is coupled but the series that is not, whatever the job's own approach.
    """

    def __init__(self, comm: Comm, job: Job, seconds: float, say: Callable[[str], None]):
        self._comm, self._job, self._seconds, self._say = comm, job, seconds, say
        self._begun = processor_seconds()
        whole = build_scene(job)
        self._path = whole.load_path
        self._rom, _ = make_rom(comm, job, whole, say)
        self._scene = reduced_scene(job, whole, self._rom)
        # Where the job's model is a sector, all of them; otherwise the scene itself
        self._wheel = whole_wheel(self._scene)
        self._options = solver_options(job, self._rom)
        self._tangents = int(self._scene.laws["tangents"].max())
        self._level = job["sweep"]["levels"][-1]
        self._frequencies: list[float] = []
        self._amplitude = np.full(len(self._scene.monitors), np.nan)
        self._iterations = 0
        # What coupled runs of fixed harmonics have taken: harmonics, seconds
        self._taken: list[tuple[int, float]] = []
        # Of the last run, and iterations by label
        self._last_amplitude, self._iterations_of = self._amplitude, dict[str, int]()
        self._accepted = REFERENCE[self._tangents]

    def chart(self, keep: Callable[[Chart], None] = lambda _: None) -> Chart:
        """Find the peak and the reference, then go all ways.

        Parameters
        ----------
        keep : receives the chart as it is after each way
        """
        self._find_peak()
        reference, ways = self._references()
        tolerance = self._job["balance"]["tolerance"] or TOLERANCE
        places = {"frequency_hz": self._frequencies[-1], "level": self._level, "tolerance": tolerance}
        title = f"{self._frequencies[-1]:.5g} Hz, level {self._level:g}"
        for way in ways:
            self._say_way(way)
        found = Chart(ways, places, title, "Relative error of the peak", reference)
        for way in in_turn(self._series(reference), self._is_spent):
            ways.append(way)
            self._say_way(way)
            keep(found)
        if self._is_spent():
            self._say(f"{WHOLE * self._seconds:g} s are spent: finer ways are left out (--seconds)")
        return found

    def _is_spent(self) -> bool:
        return processor_seconds() - self._begun > WHOLE * self._seconds

    def _say_way(self, way: Way) -> None:
        outcome = f"error {way.error:.1e}, {way.seconds:.3g} s" if np.isfinite(way.error) else way.note
        self._say(f"{way.series}, {way.label}: {outcome}")

    def _band(self) -> tuple[float, float]:
        sweep = self._job["sweep"]
        listed = sweep["frequencies_hz"]
        return (listed[0], listed[-1]) if listed else (sweep["start_hz"], sweep["stop_hz"])

    def _swept(self, solver: Solver) -> Iterator[Point]:
        """Points of the job's sweep, or of its list, after the static path."""
        start, stop = self._band()
        solver.follow_static_path(self._path, self._job["static"]["steps"], start)
        if listed := self._job["sweep"]["frequencies_hz"]:
            return solver.solve_at(listed, self._level, 0)
        return solver.sweep(start, stop, self._level, 0, self._job["continuation"]["max_points"])

    def _find_peak(self) -> None:
        with Solver(self._comm, self._scene, self._own()) as solver:
            points = [point for point in self._swept(solver) if point.outcome in SOLVED]
        if not points:
            raise NumericsError("no point of the sweep converged: there is no peak to chart")
        start, _ = self._band()
        heights = np.array([point.amplitude[0] for point in points])
        self._frequencies = up_the_flank(start, np.array([point.frequency_hz for point in points]), heights)
        self._say(
            f"peak of {self._scene.monitor_names[0]} at {self._frequencies[-1]:.6g} Hz, level {self._level:g}, "
            f"{processor_seconds() - self._begun:.3g} s"
        )

    def _references(self) -> tuple[Way, list[Way]]:
        """The finest balance by tolerance that there is time for, and the coarser ones."""
        own = self._job["balance"]["tolerance"] or TOLERANCE
        least = min(REFERENCE[self._tangents], own)
        ladder = sorted({least, own, *(one for one in TOLERANCES if one > least)}, reverse=True)
        found: list[tuple[Way, np.ndarray]] = []
        for tolerance in ladder:
            if self._is_too_long([way.seconds for way, _ in found]):
                break
            way = self._balance(
                "tolerance",
                self._scene,
                self._automatic(tolerance),
                label=f"{tolerance:g}",
                # There is no chart without the coarsest.
                limit=REFERENCE_SHARE * self._seconds if found else np.inf,
                tolerance=tolerance,
            )
            way = replace(way, own=tolerance == own and self._is_automatic())
            found.append((way, self._last_amplitude))
            outcome = way.note or f"estimated error {way.estimate:.1e}, {way.seconds:.3g} s"
            self._say(f"tolerance {way.label}: {outcome}")
            if way.note:
                break
        solved = [one for one in found if not one[0].note]
        if not solved:
            way = found[-1][0]
            raise NumericsError(f"the reference, {way.harmonics} harmonics, has no solution: {way.note}")
        reference, self._amplitude = solved[-1]
        self._iterations, self._accepted = self._iterations_of[reference.label], reference.tolerance
        self._say(f"reference: {reference.harmonics} harmonics, estimated error {reference.estimate:.1e}")
        ways = [
            replace(way, error=np.nan if way.note else self._error(amplitude))
            for way, amplitude in found
            if way is not reference
        ]
        if reference.own:
            ways.append(replace(reference, error=reference.estimate, note="the reference"))
        return reference, ways

    def _is_too_long(self, taken: list[float]) -> bool:
        """Whether the next tolerance would take too long: as much longer again, at least twice as long."""
        if not taken:
            return False
        growth = taken[-1] / taken[-2] if len(taken) > 1 else 1.0
        return taken[-1] * max(growth, 2.0) > REFERENCE_SHARE * self._seconds

    def _is_automatic(self) -> bool:
        return self._options.choose_harmonics

    def _own(self) -> Options:
        """The job's own options, coupled."""
        return replace(self._options, uncoupled=False)

    def _automatic(self, tolerance: float) -> Options:
        first = max((len(self._scene.harmonic) - 1) // 2, 3)
        choices = {"choose_harmonics": True, "accepted_error": tolerance}
        return replace(self._options, harmonics=first, uncoupled=False, **choices)

    def _fixed(self, harmonics: int, **other: object) -> Options:
        choices = {"uncoupled": False, "choose_harmonics": False} | other
        return replace(self._options, harmonics=harmonics, **choices)

    def _series(self, reference: Way) -> list[Iterator[Way]]:
        """All series but that of tolerances; the job's own way is the first if it is not among those."""
        loaded = (len(self._scene.harmonic) - 1) // 2
        ladder = [harmonics for harmonics in HARMONICS if harmonics >= loaded]
        series = [] if self._is_automatic() else [self._own_way()]
        series.append(self._climb("event", (self._fixed(h) for h in ladder)))
        series.append(self._drawn_curves())
        series.append(self._climb("uncoupled", (self._fixed(h, uncoupled=True) for h in ladder)))
        series.append(self._fewer_modes())
        if self._scene.sector is not None:
            runs = (self._fixed(h) for h in ladder if h <= 20)
            series.append(self._climb("wheel", runs, self._wheel))
        return [*series, *self._integrations()]

    def _own_way(self) -> Iterator[Way]:
        """The job's own harmonics."""
        options = self._own()
        way = self._balance("event", self._scene, options, label=f"H = {options.harmonics}")
        self._take_time(options, way)
        yield replace(way, own=True)

    def _take_time(self, options: Options, way: Way) -> None:
        """What a run has taken foretells finer ones; one that was given up has taken at least its limit."""
        seconds = 2.0 * self._seconds if way.too_long else way.seconds
        self._taken.append((options.harmonics, seconds))

    def _climb(self, series: str, runs: Iterator[Options], scene: ReducedScene | None = None) -> Iterator[Way]:
        """Ever finer, until one run takes too long, or would; of another scene than the job's, if one is given."""
        for options in runs:
            label = f"H = {options.harmonics}"
            counts = series == "event"
            foreseen = self._foreseen(options) if counts else 0.0
            if foreseen > self._seconds:
                yield Way(
                    series, label, harmonics=options.harmonics, note=f"would take some {foreseen:.0f} s", too_long=True
                )
                return
            way = self._balance(series, scene or self._scene, options, label=label)
            if counts:
                self._take_time(options, way)
            yield way
            if series == "event" and not way.note:
                yield self._uncondensed(way)
            if way.too_long or way.seconds > self._seconds:
                return

    def _foreseen(self, options: Options) -> float:
        """Seconds, by the run with the most harmonics up to those; 0 where there is none."""
        below = [one for one in self._taken if one[0] <= options.harmonics]
        if not below:
            return 0.0
        harmonics, seconds = max(below)
        growth = (2 * options.harmonics + 1) / (2 * harmonics + 1)
        return seconds * growth**HARMONICS_POWER

    def _drawn_curves(self) -> Iterator[Way]:
        """Sweeps with ever more points."""
        if not self._job["sweep"]["frequencies_hz"]:
            yield from curve_ways(self._comm, self._scene, self._own(), self._swept, 2.0 * self._seconds)

    def _fewer_modes(self) -> Iterator[Way]:
        """The reduced model without its highest fixed-interface modes, against the reduced model as it is."""
        if self._rom is None:
            return
        modes = np.flatnonzero(self._scene_kinds() == 1)
        for count in dict.fromkeys(round(part * len(modes)) for part in MODE_PARTS):
            kept = np.setdiff1d(np.arange(len(self._scene.mass)), modes[count:])
            scene = restricted(self._scene, kept)
            options = self._automatic(max(1e-4, 10.0 * REFERENCE[self._tangents], self._accepted))
            way = self._balance("modes", scene, options, label=f"{count} modes", modes=count)
            yield way
            if way.too_long or way.seconds > self._seconds:
                return

    def _scene_kinds(self) -> np.ndarray:
        """Kinds of the coordinates that are solved, as in `Rom`: interface modes come last."""
        kind, interface, sector = self._rom.kind, self._rom.interface, self._scene.sector
        if interface is None or sector is None:
            return kind
        inside = np.zeros(len(self._scene.mass), dtype=kind.dtype)
        others = kind[len(kind) - (len(inside) - len(sector.lower) - len(sector.upper)) :]
        inside[: len(others)] = others
        return inside

    def _balance(
        self,
        series: str,
        scene: ReducedScene,
        options: Options,
        label: str = "",
        limit: float | None = None,
        **settings: float,
    ) -> Way:
        """Solve the frequencies with these options; `limit`: seconds after which they are given up."""
        limit = 2.0 * self._seconds if limit is None else limit
        solved = within(limit, lambda: self._solve(scene, options))
        if solved is None:
            asked = {"harmonics": options.harmonics} | settings
            return Way(series, label, **asked, note=f"given up after {limit:.0f} s", too_long=True)
        seconds, points = solved
        last = points[-1]
        found = {
            "harmonics": (last.harmonics.shape[1] - 1) // 2,
            "seconds": seconds,
            "work": last.work,
        } | settings
        self._last_amplitude = last.amplitude
        self._iterations_of[label] = sum(point.iterations for point in points)
        if any(point.outcome not in SOLVED for point in points):
            return Way(series, label, **found, note="a point did not converge")
        return Way(series, label, **found, error=self._error(last.amplitude), estimate=last.estimate)

    def _error(self, amplitude: np.ndarray) -> float:
        """Of the monitors; one that hardly moves is measured against the others, as in the estimate."""
        scale = np.maximum(self._amplitude, LEAST_SHARE * self._amplitude.max())
        return float(np.max(np.abs(amplitude - self._amplitude) / scale))

    def _solve(self, scene: ReducedScene, options: Options) -> tuple[float, list[Point]]:
        """Seconds, the least of several runs where they are short, and points."""
        seconds, repeats = np.inf, 0
        while repeats == 0 or (seconds < SHORT and repeats < min(5, SHORT / max(seconds, 1e-6))):
            with Solver(self._comm, scene, options) as solver:
                solver.follow_static_path(self._path, self._job["static"]["steps"], self._frequencies[0])
                started = time.process_time()
                points = list(solver.solve_at(self._frequencies, self._level, 0))
                seconds = min(seconds, time.process_time() - started)
                static, repeats = solver.static_work, repeats + 1
        return seconds, [point._replace(work=point.work - static) for point in points]

    def _uncondensed(self, way: Way) -> Way:
        """Work of as many iterations on all coordinates, (2/3) (m (2 H + 1))^3 each, without the contacts' forces."""
        unknowns = self._scene.coordinates * (2 * way.harmonics + 1)
        work = self._iterations * 2.0 / 3.0 * unknowns**3
        return replace(way, series="uncondensed", label=f"H = {way.harmonics}", seconds=np.nan, work=work)

    def _integrations(self) -> list[Iterator[Way]]:
        """From the static solution to the steady state at the peak, ever shorter steps; a series a scheme."""
        exact = self._tangents == 1 and are_coulomb(self._scene.laws)
        return [self._shorter_steps(scheme) for scheme in SCHEMES if scheme != "event" or exact]

    def _shorter_steps(self, scheme: str) -> Iterator[Way]:
        for steps in STEPS if scheme != "event" else STEPS[:1]:
            way = self._integrate(scheme, steps)
            yield way
            if way.too_long:
                return

    def _integrate(self, scheme: str, steps: int) -> Way:
        exact = scheme == "event"
        name = scheme.replace("_", " ")
        settings = {"steps": 0 if exact else steps}
        series, label = ("events in time", "exact") if exact else ("integration", f"{name}, {steps} steps")
        run = Run(self._frequencies[-1], self._level, scheme, None if exact else steps, samples=max(steps, 256))
        try:
            with Integrator(self._wheel) as integrator:
                integrator.start_static(self._path, self._job["static"]["steps"])
                brief = replace(run, cycles=2, fewest_cycles=2)
                started = time.process_time()
                integrator.run(brief)
                foreseen = (time.process_time() - started) * CYCLES / 2
                if foreseen > self._seconds:
                    note = f"would take up to {foreseen:.0f} s"
                    return Way(series, label, **settings, note=note, too_long=True)
                started = time.process_time()
                orbit = integrator.run(replace(run, cycles=CYCLES, periodicity_tolerance=1e-9))
                seconds = time.process_time() - started
        except (InputError, NumericsError) as error:
            return Way(series, label, **settings, note=str(error))
        m, rows = len(self._wheel.mass), len(self._wheel.directions)
        work = np.nan if exact else 4.0 * m * (m + rows) * steps * orbit.cycles
        found = settings | {"seconds": seconds, "work": work}
        if orbit.outcome != "converged":
            return Way(series, label, **found, note=f"not steady after {orbit.cycles} cycles")
        return Way(series, label, **found, error=self._error(orbit.amplitude))


def chart_job(
    path: str | Job,
    seconds: float = 20.0,
    say: Callable[[str], None] = lambda _: None,
    keep: Callable[[Chart], None] = lambda _: None,
) -> Chart:
    """Chart a job, on one process.

    Parameters
    ----------
    path : the job file, or the job
    seconds : of the processor; a series ends where a run of it takes longer, and the chart after `WHOLE` times as long
    say : receives what is done, a line each
    keep : receives the chart as it is after each way
    """
    from mpi4py import MPI

    job = path if isinstance(path, Job) else read_job(path)
    return Bench(MPI.COMM_SELF, job, seconds, say).chart(keep)
