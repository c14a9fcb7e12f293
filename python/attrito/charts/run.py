"""`attrito chart`: error against cost for a job's own scene, by every way that the program has to solve it.

The peak of the job's sweep is found first. Each way then solves the same few frequencies, from the start of the sweep
to the peak, so that every one of them has come along the branch; the error is that of the amplitudes at the last,

    e = max over monitors |a - a_ref| / a_ref,

a_ref being the balance with harmonics, and samples where contacts have two tangents, that leave the error estimated for
it far below what is charted. Cost is processor time without the static load path, and counted work: operations by the
formulas of src/balance/work.f90, for time integration 4 m (m + rows) a step. A way is on the efficient front if none is
both cheaper in time and nearer.

A sector under a travelling wave is charted beside its whole wheel, which is solved and integrated in time by itself;
the monitors are those of the first sector.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from attrito.charts.file import LEAST_SHARE, SOLVED, Chart, Way
from attrito.charts.patches import can_merge, patched_ways
from attrito.job.defaults import TOLERANCE
from attrito.job.job import Job
from attrito.job.reading import read_job
from attrito.library.integrator import Integrator, Run
from attrito.library.laws import are_coulomb
from attrito.library.points import Point
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options, Solver
from attrito.patches.solver import places_of
from attrito.scene.build import build_scene
from attrito.scene.reduced_model import make_rom, reduced_scene
from attrito.scene.solver_options import solver_options
from attrito.scene.wheel import whole_wheel
from attrito.support.errors import InputError, NumericsError

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

HARMONICS = (1, 2, 3, 5, 7, 10, 14, 20, 30)
SAMPLES = (32, 64, 128, 256, 512, 1024)
SAMPLED_HARMONICS = (3, 5, 10, 20)
TOLERANCES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
STEPS = (32, 64, 128, 256, 512, 1024)
MODE_PARTS = (0.0, 0.1, 0.25, 0.5, 0.75)
SCHEMES = ("central_difference", "newmark", "hht", "generalised_alpha", "event")
CYCLES = 400
# What is estimated for the reference; with two tangents samples limit it
REFERENCE = {1: 1e-9, 2: 1e-5}
POINTS = 5
# Shorter runs are repeated, and the least of the times is taken
SHORT = 0.2


class Bench:
    """A job's scene, brought to its peak again and again; `seconds`: what one run of a series may take.

    All is coupled but the series that is not, whatever the job's own approach.
    """

    def __init__(self, comm: Comm, job: Job, seconds: float, say: Callable[[str], None]):
        self._comm, self._job, self._seconds, self._say = comm, job, seconds, say
        whole = build_scene(job)
        self._path = whole.load_path
        self._places = places_of(whole.contacts.tables, whole.contacts.places)
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

    def chart(self) -> Chart:
        """Find the peak and the reference, then go all ways."""
        self._find_peak()
        accepted = REFERENCE[self._tangents]
        reference = self._balance("reference", self._scene, self._automatic(accepted), count=False)
        if reference.note:
            raise NumericsError(f"the reference, {reference.harmonics} harmonics, has no solution: {reference.note}")
        self._say(f"reference: {reference.harmonics} harmonics, estimated error {reference.estimate:.1e}")
        ways = []
        for way in self._ways():
            ways.append(way)
            outcome = f"error {way.error:.1e}, {way.seconds:.3g} s" if np.isfinite(way.error) else way.note
            self._say(f"{way.series}, {way.label}: {outcome}")
        tolerance = self._job["balance"]["tolerance"] or TOLERANCE
        places = {"frequency_hz": self._frequencies[-1], "level": self._level, "tolerance": tolerance}
        title = f"{self._frequencies[-1]:.5g} Hz, level {self._level:g}"
        return Chart(ways, places, title, "Relative error of the peak", reference)

    def _find_peak(self) -> None:
        sweep = self._job["sweep"]
        listed = sweep["frequencies_hz"]
        start, stop = (listed[0], listed[-1]) if listed else (sweep["start_hz"], sweep["stop_hz"])
        with Solver(self._comm, self._scene, self._automatic(1e-3)) as solver:
            solver.follow_static_path(self._path, self._job["static"]["steps"], start)
            if listed:
                points = solver.solve_at(listed, self._level, 0)
            else:
                points = solver.sweep(start, stop, self._level, 0, self._job["continuation"]["max_points"])
            found = [(point.amplitude[0], point.frequency_hz) for point in points if point.outcome in SOLVED]
        if not found:
            raise NumericsError("no point of the sweep converged: there is no peak to chart")
        peak = max(found)[1]
        self._frequencies = np.linspace(start, peak, POINTS).tolist() if peak != start else [start]
        self._say(f"peak of {self._scene.monitor_names[0]} at {peak:.6g} Hz, level {self._level:g}")

    def _automatic(self, tolerance: float) -> Options:
        first = max((len(self._scene.harmonic) - 1) // 2, 3)
        samples = max(64, 6 * first + 2)
        choices = {"choose_harmonics": True, "choose_samples": True, "accepted_error": tolerance}
        return replace(self._options, harmonics=first, samples=samples, by_events=True, uncoupled=False, **choices)

    def _fixed(self, harmonics: int, samples: int, **other: object) -> Options:
        fixed = {"choose_harmonics": False, "choose_samples": False}
        choices = {"by_events": True, "uncoupled": False} | fixed | other
        return replace(self._options, harmonics=harmonics, samples=samples, **choices)

    def _ways(self) -> Iterator[Way]:
        own = self._job["balance"]["tolerance"] or TOLERANCE
        tolerances = {*TOLERANCES, own}
        for tolerance in sorted(tolerances, reverse=True):
            if tolerance > REFERENCE[self._tangents] or tolerance == own:
                way = self._balance(
                    "tolerance", self._scene, self._automatic(tolerance), label=f"{tolerance:g}", tolerance=tolerance
                )
                yield replace(way, own=tolerance == own)
        loaded = (len(self._scene.harmonic) - 1) // 2
        ladder = [harmonics for harmonics in HARMONICS if harmonics >= loaded]
        if self._tangents == 1:
            yield from self._climb("event", ((h, self._fixed(h, 8 * h + 2)) for h in ladder))
            yield from self._climb("uncoupled", ((h, self._fixed(h, 8 * h + 2, uncoupled=True)) for h in ladder))
        for harmonics in SAMPLED_HARMONICS:
            fits = [samples for samples in SAMPLES if samples >= 4 * harmonics + 2 and harmonics >= loaded]
            yield from self._climb("sampled", ((j, self._fixed(harmonics, j, by_events=False)) for j in fits))
        if self._tangents == 2:
            yield from self._climb(
                "uncoupled", ((h, self._fixed(h, 256, by_events=False, uncoupled=True)) for h in ladder if h <= 20)
            )
        yield from self._fewer_modes()
        yield from self._fewer_contacts()
        if self._scene.sector is not None:
            by_events = self._tangents == 1
            runs = (
                (h, self._fixed(h, 8 * h + 2 if by_events else 256, by_events=by_events)) for h in ladder if h <= 20
            )
            yield from self._climb("wheel", runs, self._wheel)
        yield from self._uncondensed(ladder)
        yield from self._integrations()

    def _climb(
        self, series: str, runs: Iterator[tuple[int, Options]], scene: ReducedScene | None = None
    ) -> Iterator[Way]:
        """Ever finer, until one run takes too long; of another scene than the job's, if one is given."""
        for _, options in runs:
            label = f"H = {options.harmonics}" + (f", J = {options.samples}" if series == "sampled" else "")
            way = self._balance(series, scene or self._scene, options, label=label)
            yield way
            if way.seconds > self._seconds:
                return

    def _fewer_modes(self) -> Iterator[Way]:
        """The reduced model without its highest fixed-interface modes, against the reduced model as it is."""
        if self._rom is None:
            return
        modes = np.flatnonzero(self._scene_kinds() == 1)
        for count in dict.fromkeys(round(part * len(modes)) for part in MODE_PARTS):
            kept = np.setdiff1d(np.arange(len(self._scene.mass)), modes[count:])
            scene = restricted(self._scene, kept)
            options = self._automatic(max(1e-4, 10.0 * REFERENCE[self._tangents]))
            yield self._balance("modes", scene, options, label=f"{count} modes", modes=count)

    def _fewer_contacts(self) -> Iterator[Way]:
        """Pairs merged into patches, ever more of them."""
        if not can_merge(self._scene, self._places):
            return

        def come_to_rest(solver: Solver) -> None:
            solver.follow_static_path(self._path, self._job["static"]["steps"], self._frequencies[0])

        options = self._automatic(max(1e-3, 10.0 * REFERENCE[self._tangents]))
        asked = self._frequencies, come_to_rest, self._level, self._error
        yield from patched_ways(self._comm, self._scene, options, self._places, *asked)

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
        self, series: str, scene: ReducedScene, options: Options, label: str = "", count: bool = True, **settings: float
    ) -> Way:
        """Solve the frequencies with these options; the reference is what the others are held against."""
        seconds, points = self._solve(scene, options)
        while count and seconds < SHORT and self._repeats_left(seconds):
            seconds = min(seconds, self._solve(scene, options)[0])
        self._repeated = 0
        last = points[-1]
        found = {
            "harmonics": (last.harmonics.shape[1] - 1) // 2,
            "samples": last.samples if self._tangents == 2 or not options.by_events else 0,
            "seconds": seconds,
            "work": last.work,
        } | settings
        if any(point.outcome not in SOLVED for point in points):
            return Way(series, label, **found, note="a point did not converge")
        if not count:
            self._amplitude, self._iterations = last.amplitude, sum(point.iterations for point in points)
        return Way(series, label, **found, error=self._error(last.amplitude), estimate=last.estimate)

    def _error(self, amplitude: np.ndarray) -> float:
        """Of the monitors; one that hardly moves is measured against the others, as in the estimate."""
        scale = np.maximum(self._amplitude, LEAST_SHARE * self._amplitude.max())
        return float(np.max(np.abs(amplitude - self._amplitude) / scale))

    _repeated = 0

    def _repeats_left(self, seconds: float) -> bool:
        self._repeated += 1
        return self._repeated < min(5, SHORT / max(seconds, 1e-6))

    def _solve(self, scene: ReducedScene, options: Options) -> tuple[float, list[Point]]:
        with Solver(self._comm, scene, options) as solver:
            solver.follow_static_path(self._path, self._job["static"]["steps"], self._frequencies[0])
            started = time.process_time()
            points = list(solver.solve_at(self._frequencies, self._level, 0))
            seconds = time.process_time() - started
            return seconds, [point._replace(work=point.work - solver.static_work) for point in points]

    def _uncondensed(self, ladder: list[int]) -> Iterator[Way]:
        """Work of as many iterations on all coordinates, (2/3) (m (2 H + 1))^3 each, without the contacts' forces."""
        for harmonics in ladder:
            options = self._fixed(harmonics, max(256, 8 * harmonics + 2))
            way = self._balance("uncondensed", self._scene, options, label=f"H = {harmonics}")
            unknowns = self._scene.coordinates * (2 * harmonics + 1)
            yield replace(way, seconds=np.nan, work=self._iterations * 2.0 / 3.0 * unknowns**3)
            if way.seconds > self._seconds:
                return

    def _integrations(self) -> Iterator[Way]:
        """From the static solution to the steady state at the peak, ever shorter steps."""
        for scheme in SCHEMES:
            if scheme == "event" and (self._tangents == 2 or not are_coulomb(self._scene.laws)):
                continue
            for steps in STEPS if scheme != "event" else STEPS[:1]:
                way = self._integrate(scheme, steps)
                yield way
                if way.too_long:
                    break

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


def restricted(scene: ReducedScene, kept: np.ndarray) -> ReducedScene:
    """The scene without some of its coordinates; those of a sector's boundaries and axis must be kept."""
    number = np.full(len(scene.mass), -1)
    number[kept] = np.arange(len(kept))
    sector = scene.sector
    if sector is not None:
        sector = replace(
            sector,
            lower=number[sector.lower].astype(np.int32),
            upper=number[sector.upper].astype(np.int32),
            along=number[sector.along].astype(np.int32),
            across=number[sector.across].astype(np.int32),
            next_directions=np.ascontiguousarray(sector.next_directions[:, kept]),
            # Nothing is drawn of it along the model's own axes.
            axes=None,
        )
    square, wide = np.ix_(kept, kept), (slice(None), kept)
    return replace(
        scene,
        sector=sector,
        mass=np.ascontiguousarray(scene.mass[square]),
        stiffness=np.ascontiguousarray(scene.stiffness[square]),
        damping=None if scene.damping is None else np.ascontiguousarray(scene.damping[square]),
        damping_ratios=None if scene.damping_ratios is None else scene.damping_ratios[: len(kept)],
        **{
            name: np.ascontiguousarray(getattr(scene, name)[wide])
            for name in ("directions", "static", "harmonic", "monitors")
        },
    )


def chart_job(path: str | Job, seconds: float = 20.0, say: Callable[[str], None] = lambda _: None) -> Chart:
    """Chart a job, on one process; `seconds`: a series ends where a run of it takes longer."""
    from mpi4py import MPI

    job = path if isinstance(path, Job) else read_job(path)
    return Bench(MPI.COMM_SELF, job, seconds, say).chart()
