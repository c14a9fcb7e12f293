"""`attrito verify integrators`: the largest stable step of each scheme of time integration, over scenes of the grid.

Steps are measured as h omega, omega being the highest angular frequency with every contact stuck, in which theory
shows them. On one combination of contact states the structure is linear:

    central difference:   h omega_s <= 2, whatever the damping, with omega_s the highest frequency in that combination,
    Newmark with average acceleration, HHT (alpha = -0.1), generalised alpha (radius 0.8), exponential:   any h.

A contact that opens and closes leaves that theory. From the static solution a scheme is marched for `SECONDS` and ten
periods. It is stable if every implicit step is solved and it stays within `BOUND` of the force over kx (at resonance
the open structure reaches 10, so that an error in the frequency alone cannot exceed it). It settles if, besides, it
comes to the excitation's period where event-exact integration does. Steps are halved from a quarter of a period down
to `FINEST`; a step counts as stable, or as settling, if the next finer one is, too.
Sources: Newmark 1959; Hilber, Hughes & Taylor 1977, doi:10.1002/eqe.4290050306; Chung & Hulbert 1993,
doi:10.1115/1.2900803.
"""

from __future__ import annotations

import csv
import os
import random
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from attrito.library.integrator import Integrator, Orbit, Run
from attrito.library.reduced_scene import ReducedScene
from attrito.plots.style import BRANCH_COLOURS, STYLE, save
from attrito.support.errors import NumericsError
from attrito_verification.scene_grid.scenes import FORCE, RATIOS, STIFFNESS, Family, families, frequencies

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

SCHEMES = ("central_difference", "newmark", "hht", "generalised_alpha", "exponential")
SCENES, QUICK, SEED = 500, 20, 2
# Seconds after which what the start has left is down by 4e-4, damping being exp(-10 pi t).
SECONDS, MORE_CYCLES, BOUND = 0.25, 10, 20.0
# Change over a period, relative to the motion, that counts as none. Rates of modes above the excitation weigh more.
PERIODICITY = 1e-2
FINEST, FEWEST_STEPS = 0.5, 4
# The limit of central difference, in h omega.
LIMIT = 2.0
# A period, of the event-exact march, and what its samples tell of contacts.
SAMPLES, SLIP, OPEN = 64, 1, 2
# Why a step is not stable.
CAUSES = ("", "a step is not solved", "beyond all bounds")
PATH = np.array([[0.0], [1.0]])


@dataclass(frozen=True)
class Limits:
    """What was found of one scheme in one scene.

    Parameters
    ----------
    family, frequency_hz : the scene
    scheme : one of `SCHEMES`
    stable, settles : the largest step of which that holds, and of the next finer one, h omega; 0: of none tried; NaN
        of the second: event-exact motion has not come to the excitation's period
    fails : the smallest step beyond `stable`; infinite: there is none up to a quarter of a period
    cause : why it is not stable, one of `CAUSES`
    opens, slips : whether any contact does so in the event-exact march, as sampled
    """

    family: Family
    frequency_hz: float
    scheme: str
    stable: float
    settles: float
    fails: float
    cause: str
    opens: bool
    slips: bool


def verify_integrators(
    comm: Comm, folder: str | os.PathLike[str], scenes: int | None = None, say: Callable[[str], None] = print
) -> str:
    """Measure the steps in a folder, scenes shared out over ranks; returns the report's path.

    Parameters
    ----------
    folder : gets `steps.csv`, `report.md` and `steps.png`
    scenes : how many, drawn from the grid without pattern; `SCENES` unless given
    say : receives a line at the end, at the root
    """
    mine = draw(scenes or SCENES)[comm.rank :: comm.size]
    found = [one for family, frequency_hz in mine for one in limits(family, frequency_hz)]
    parts = comm.gather(found)
    place = Path(folder)
    if comm.rank == 0:
        place.mkdir(parents=True, exist_ok=True)
        every = [one for part in parts for one in part]
        _write_csv(place / "steps.csv", every)
        (place / "report.md").write_text(table(every))
        save(picture(every), place / "steps.png")
        say(f"{len(every) // len(SCHEMES)} scenes: {place / 'report.md'}")
    return str(place / "report.md")


def draw(count: int) -> list[tuple[Family, float]]:
    """So many scenes of the grid, each at most once; all if there are no more."""
    every = [(family, float(frequency_hz)) for family in families() for frequency_hz in frequencies()]
    return random.Random(SEED).sample(every, min(count, len(every)))


def limits(family: Family, frequency_hz: float) -> list[Limits]:
    """Of every scheme in a scene; none where the load path has no end."""
    scene = family.scene()
    stuck, _ = highest_frequencies(scene)
    omega = 2.0 * np.pi * frequency_hz
    counts = steps_tried(stuck / omega)
    with Integrator(scene) as session:
        try:
            session.start_static(PATH)
        except NumericsError:
            return []
        start = session.state()
        exact = march(session, start, frequency_hz, "event", None)
        deeds = bool(np.any(exact.regime == OPEN)), bool(np.any(exact.regime == SLIP))
        found = []
        for scheme in SCHEMES:
            marches = ((count, march(session, start, frequency_hz, scheme, count)) for count in counts)
            (stable, settles, fails), cause = _largest(marches, exact, family)
            sizes = [size * stuck / omega for size in (stable, settles, fails)]
            found.append(Limits(family, frequency_hz, scheme, *sizes, cause, *deeds))
    return found


def _largest(
    marches: Iterable[tuple[int, Orbit]], exact: Orbit, family: Family
) -> tuple[tuple[float, float, float], str]:
    """`stable`, `settles` and `fails` of one scheme, in radians of the excitation a step, and the cause."""
    periodic = exact.outcome == "converged"
    stable, settles, fails, cause = 0.0, 0.0, np.inf, ""
    for count, orbit in marches:
        size = 2.0 * np.pi / count
        why = failure(orbit, family)
        if why:
            stable, settles, fails, cause = 0.0, 0.0, size, why
            continue
        settled = orbit.outcome == "converged" or not periodic
        if stable and settles and settled:
            break
        stable = stable or size
        settles = (settles or size) if settled else 0.0
    return (stable, settles if periodic else np.nan, fails), cause


def cycles(frequency_hz: float) -> int:
    """Periods that are marched."""
    return MORE_CYCLES + round(SECONDS * frequency_hz)


def march(session: Integrator, start: tuple, frequency_hz: float, scheme: str, steps: int | None) -> Orbit:
    """As many periods from a state, and one more that is measured; the event-exact march is sampled throughout."""
    session.start(*start, PATH[-1])
    choices = Run(
        frequency_hz,
        scheme=scheme,
        steps_per_period=steps,
        cycles=cycles(frequency_hz),
        fewest_cycles=cycles(frequency_hz),
        periodicity_tolerance=PERIODICITY,
        max_period_multiple=1,
        samples=SAMPLES if scheme == "event" else 1,
        whole_run=scheme == "event",
    )
    return session.run(choices)


def failure(orbit: Orbit, family: Family) -> str:
    """Why a march is not stable, one of `CAUSES`: what got to its end is sampled there."""
    farthest = BOUND * np.sqrt(family.masses) * FORCE / STIFFNESS[0]
    if orbit.motion_amplitude > farthest:
        return CAUSES[2]
    return CAUSES[1 if orbit.time.size == 0 else 0]


def highest_frequencies(scene: ReducedScene) -> tuple[float, float]:
    """Angular frequencies, rad/s, with every contact stuck and with all open; masses are units."""
    laws, rows = scene.laws, scene.directions
    springs = np.stack([laws["tangential_stiffness"], laws["normal_stiffness"]], axis=1).ravel()
    stuck = scene.stiffness + rows.T @ (springs[:, None] * rows)
    return tuple(float(np.sqrt(np.linalg.eigvalsh(k)[-1])) for k in (stuck, scene.stiffness))


def steps_tried(ratio: float) -> list[int]:
    """Steps a period, the fewest first, for a highest frequency so many times the excitation's."""
    most = 2.0 * np.pi * ratio / FINEST
    halvings = max(1, int(np.ceil(np.log2(most / FEWEST_STEPS))))
    # The finest exactly, the others by doubling: the limit of central difference is one of them.
    return sorted({max(FEWEST_STEPS, int(np.ceil(most / 2**k))) for k in range(halvings + 1)})


def table(found: list[Limits]) -> str:
    """Markdown: by scheme and contact stiffness, what holds for all scenes and for half of them."""
    count = len(found) // len(SCHEMES)
    lines = [
        f"# Largest stable steps, {count} scenes\n",
        "Scenes that are stable at every step up to a quarter of a period, %; least step that is not stable, h omega;"
        " median of the largest step that settles, h omega.\n",
        "| scheme | " + " | ".join(f"kn/k = {ratio:g}" for ratio in RATIOS) + " |",
        "|" + "---|" * (len(RATIOS) + 1),
    ]
    for scheme in SCHEMES:
        own = [one for one in found if one.scheme == scheme]
        cells = [_cell([one for one in own if one.family.ratio == ratio]) for ratio in RATIOS]
        lines.append(f"| {scheme} | " + " | ".join(cells) + " |")
    return "\n".join([*lines, "", *_against_theory(found), ""])


def _cell(chosen: list[Limits]) -> str:
    if not chosen:
        return ""
    fails = min(one.fails for one in chosen)
    numbers = [100.0 * np.mean([np.isinf(one.fails) for one in chosen]), fails]
    settled = [one for one in chosen if not np.isnan(one.settles)]
    if settled:
        numbers.append(float(np.median([one.settles for one in settled])))
    return "; ".join("none" if np.isinf(number) else f"{number:.3g}" for number in numbers)


def _against_theory(found: list[Limits]) -> list[str]:
    central = [one for one in found if one.scheme == SCHEMES[0]]
    counts = [
        f"{sum(one.fails <= LIMIT for one in chosen)} of {len(chosen)}"
        for chosen in (_linear(central), [one for one in central if one.slips or one.opens])
    ]
    lines = [
        f"central_difference: a step within h omega = {LIMIT:g} is not stable in {counts[0]} scenes whose contacts"
        f" stick throughout, and in {counts[1]} others.\n"
    ]
    for scheme in SCHEMES[1:]:
        own = [one for one in found if one.scheme == scheme]
        others = [one for one in own if one.slips or one.opens]
        lines.append(
            f"{scheme}: stable at every step in {_whole(_linear(own))} of {len(_linear(own))} scenes whose contacts"
            f" stick throughout, and in {_whole(others)} of {len(others)} others; {_count(own, 1)} fail since a step is"
            f" not solved, {_count(own, 2)} go beyond all bounds.\n"
        )
    return lines


def _linear(chosen: list[Limits]) -> list[Limits]:
    return [one for one in chosen if not (one.slips or one.opens)]


def _count(chosen: list[Limits], cause: int) -> int:
    return sum(one.cause == CAUSES[cause] for one in chosen)


def _whole(chosen: list[Limits]) -> int:
    return sum(np.isinf(one.fails) for one in chosen)


def picture(found: list[Limits]) -> Figure:
    """Largest stable step against contact stiffness, a panel a scheme; open triangles: none that was tried fails."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(14.0, 3.8), constrained_layout=True)
        spread = np.random.default_rng(SEED)
        panels = figure.subplots(1, len(SCHEMES), sharex=True, sharey=True)
        for panel, scheme, colour in zip(panels, SCHEMES, BRANCH_COLOURS, strict=False):
            for whole, marker in ((False, "o"), (True, "^")):
                chosen = [one for one in found if one.scheme == scheme and np.isinf(one.fails) == whole]
                ratio = np.array([one.family.ratio for one in chosen])
                across = ratio * 10.0 ** spread.uniform(-0.25, 0.25, len(chosen))
                sizes = [one.stable for one in chosen]
                label = "up to a quarter of a period" if whole else "largest stable step"
                face = "none" if whole else colour
                panel.loglog(across, sizes, marker, color=colour, mfc=face, markersize=3, label=label)
            panel.set(title=scheme.replace("_", " "), xlabel="kn/k")
            panel.legend(loc="upper left", fontsize=7)
        panels[0].axhline(LIMIT, color="black", linewidth=0.8)
        panels[0].set_ylabel("h omega")
    return figure


def _write_csv(path: Path, found: list[Limits]) -> None:
    names = ("scheme", "stable", "settles", "fails", "cause", "opens", "slips")
    parameters = ("masses", "ratio", "friction", "preload", "degrees")
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow([*parameters, "frequency_hz", *names])
        for one in found:
            values = [getattr(one, name) for name in names]
            rows.writerow([*(getattr(one.family, name) for name in parameters), f"{one.frequency_hz:.9g}", *values])
