"""The usual schemes of time integration charted against event-exact integration, on the inclined wedge.

Smooth: the contact sticks; stick-slip: it slips in contact; lift-off: it opens and lands too. The error is that of the
first harmonic of the steady motion of x, a complex number, which samples at the steps give without an error of their
own.
"""

from __future__ import annotations

from dataclasses import dataclass

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from attrito.library.integrator import Integrator, Run
from attrito.plots.style import BRANCH_COLOURS, STYLE
from attrito_verification.paper.study import INCLINED_WALL
from attrito_verification.paper.wedge import Parameters, load_path, wedge_scene

SCHEMES = {
    "central_difference": "central difference",
    "newmark": "Newmark, average acceleration",
    "hht": "HHT, alpha = -0.1",
    "generalised_alpha": "generalised alpha, radius 0.8",
}
# Force, N, and frequency, Hz.
MOTIONS = {"smooth": (1.0, 132.0), "stick-slip": (5.0, 132.0), "lift-off": (14.0, 122.0)}
# Steps a period; the order is that of the last three, where the error is the scheme's own.
STEPS = (32, 64, 128, 256, 512, 1024, 2048)
CYCLES = 150


@dataclass(frozen=True)
class Convergence:
    """Relative errors by steps a period, `[steps]`, and the order that the last of them show."""

    motion: str
    scheme: str
    error: np.ndarray

    @property
    def order(self) -> float:
        """Slope of error over step."""
        return float(-np.polyfit(np.log(STEPS[-3:]), np.log(self.error[-3:]), 1)[0])


def measure(parameters: Parameters) -> list[Convergence]:
    """Errors of every scheme on both motions."""
    found = []
    for motion in MOTIONS:
        exact = _first_harmonic(parameters, motion, "event", STEPS[-1])
        for scheme in SCHEMES:
            error = [abs(_first_harmonic(parameters, motion, scheme, steps) / exact - 1.0) for steps in STEPS]
            found.append(Convergence(motion, scheme, np.array(error)))
    return found


def picture(measured: list[Convergence]) -> Figure:
    """Error against steps a period, a panel a motion, the orders in the legend."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(12.6, 4.2), constrained_layout=True)
        panels = dict(zip(MOTIONS, figure.subplots(1, len(MOTIONS), sharey=True), strict=True))
        for one in measured:
            colour = BRANCH_COLOURS[list(SCHEMES).index(one.scheme)]
            label = f"{SCHEMES[one.scheme]}: order {one.order:.2f}"
            panels[one.motion].loglog(STEPS, one.error, "o-", color=colour, markersize=4, label=label)
        for motion, axes in panels.items():
            force, frequency = MOTIONS[motion]
            axes.set(title=f"{motion}: {force:g} N, {frequency:g} Hz", xlabel="Steps a period")
            axes.set_xticks(STEPS, [str(steps) for steps in STEPS])
            axes.minorticks_off()
            axes.legend(loc="lower left", fontsize=8)
        panels["smooth"].set_ylabel("Relative error of the first harmonic of x")
    return figure


def table(measured: list[Convergence]) -> str:
    """Errors and orders as Markdown."""
    head = "| motion | scheme | " + " | ".join(f"{steps} steps" for steps in STEPS) + " | order |\n"
    lines = [head, "|---" * (len(STEPS) + 3) + "|\n"]
    for one in measured:
        errors = " | ".join(f"{error:.1e}" for error in one.error)
        lines.append(f"| {one.motion} | {SCHEMES[one.scheme]} | {errors} | {one.order:.2f} |\n")
    return "".join(lines)


def _first_harmonic(parameters: Parameters, motion: str, scheme: str, steps: int) -> complex:
    force, frequency = MOTIONS[motion]
    with Integrator(wedge_scene(parameters, INCLINED_WALL)) as integrator:
        integrator.start_static(np.array(load_path(parameters, "U1"))[:, None])
        orbit = integrator.run(
            Run(
                frequency,
                level=force,
                scheme=scheme,
                steps_per_period=None if scheme == "event" else steps,
                cycles=CYCLES,
                fewest_cycles=CYCLES,
                samples=steps,
            )
        )
    x = orbit.monitors[:steps, 0]
    return complex(np.fft.rfft(x)[1]) / steps
