"""What a run says while it runs: on a terminal one line, which every point writes over; in a file a line now and then.

Either way the first and the last point of a level, a branch or an outcome have a line that stays, and so has the last
before anything else is said.
"""

from __future__ import annotations

import math
import os
import shutil
import sys
import textwrap
import time
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from attrito.library.names import NO_SOLUTION
from attrito.runs.linear_references import in_words
from attrito.support.verbosity import is_quiet, is_verbose

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

    from attrito.library.points import Point
    from attrito.library.reduction import Report
    from attrito.runs.linear_references import LinearReference
    from attrito.runs.position import RunPosition
    from attrito.support.timing import Stages


# Seconds between words on what takes long
SILENCE = 2.0
# Of a sweep: less says nothing of the time left
LEAST_SHARE = 0.02
# Set by mpirun of Open MPI, by MPICH's, and by srun: their output may look like a terminal, and is passed on in lines.
LAUNCHERS = ("OMPI_COMM_WORLD_RANK", "PMI_RANK", "SLURM_STEP_ID")
CLEAR_LINE = "\r\x1b[K"


class Progress:
    """Lines on standard output, from rank 0."""

    def __init__(self, comm: Comm):
        self._speaks = comm.rank == 0
        self._terminal = self._speaks and sys.stdout.isatty() and not any(name in os.environ for name in LAUNCHERS)
        self.count = 0
        self.iterations = 0
        # The last point's line, where it may be written over or was not written; level, branch, outcome of that point.
        self._pending: str | None = None
        self._last: tuple[float, int, str] | None = None
        self._step = ""
        self._begun = (0.0, 0)
        self._told = -math.inf
        self._sweep: dict[str, Any] | None = None
        # When the first point of this sweep was said, and how much was done by then.
        self._swept: tuple[float, float] | None = None
        self.warnings: list[str] = []

    def say(self, line: str) -> None:
        """A line of its own."""
        if not self._speaks:
            return
        self._leave_standing()
        print(wrapped(line, shutil.get_terminal_size().columns - 1) if self._terminal else line, flush=True)

    def warn(self, warnings: Iterable[str]) -> None:
        """Warnings, each once however often it is found."""
        for warning in warnings:
            if warning not in self.warnings:
                self.warnings.append(warning)
                if is_quiet() and self._speaks:
                    print(f"warning: {warning}", file=sys.stderr, flush=True)
                else:
                    self.say(f"warning: {warning}")

    def _leave_standing(self) -> None:
        """The last point's line is to be read."""
        if self._pending is None:
            return
        print("" if self._terminal else self._pending, flush=True)
        self._pending = None

    def step(self, name: str, done: int, total: int) -> None:
        """How far a step of a reduction has come, and the time left for it at this rate; a sentence if total is 0."""
        if total == 0:
            self.say(name)
            return
        now = time.monotonic()
        if name != self._step:
            self._step, self._begun, self._told = name, (now, done), -math.inf
        # A step that is soon done needs no word; a long one some.
        begun, before = self._begun
        if now - self._told < SILENCE or now - begun < SILENCE or done <= before or done >= total:
            return
        self._told = now
        left = (now - begun) / (done - before) * (total - done)
        self.say(f"{name}: {done} of {total}, some {left:.0f} s left")

    def reduction(self, report: Report | None) -> None:
        """How the reduction went; None where it was up to date."""
        if report is None:
            return
        counted = (
            f"{report.modes} modes below {report.shift_hz:.5g} Hz (inertia counts {report.modes_below_shift})"
            if report.modes
            else "no modes"
        )
        self.say(
            f"reduced to {report.coordinates} coordinates: {report.boundary} boundary dofs, {counted},"
            f" {report.corrections} corrections"
        )
        if report.worst_error >= 0.0:
            self.say(f"estimated errors: at most {report.worst_error:.1e} (`attrito info` lists them)")
        each = ", ".join(f"{step} {time:.1f}" for step, time in report.seconds.items() if time > 0.0)
        self.say(f"in {sum(report.seconds.values()):.1f} s and {max(report.megabytes.values()) / 1024:.1f} GB: {each}")

    def begin(self, coordinates: int, contacts: int, linear: dict[str, LinearReference]) -> None:
        """What is going to be solved."""
        lowest = ", ".join(f"{name} {in_words(one.natural_hz, one.rigid, 3)}" for name, one in linear.items())
        size = f"{counted(coordinates, 'coordinate')}, {counted(contacts, 'contact')}"
        self.say(f"{size}; natural frequencies in Hz: {lowest}")

    def static(self, means: np.ndarray) -> None:
        """The static load path was followed."""
        words = ", ".join(f"{value:.4g}" for value in means)
        self.say("static load path followed" + (f": monitors {words}" if words else ""))

    def point(self, point: Point, monitor: str, number: int) -> None:
        """The line of a point, the `number`th of the run."""
        self.iterations += point.iterations
        self.count += 1
        if not self._speaks:
            return
        stuck, shaken_down, slipping, opened = point.states
        # In the order of the line, each with how soon it is left out where the line is too long.
        parts = [
            (f"{number - 1:5d}  {point.frequency_hz:11.5g} Hz", 0),
            (f"  level {point.level:<8.4g}", 3),
            (f" {monitor} " + (f"{point.amplitude[0]:11.4e}" if point.outcome not in NO_SOLUTION else " " * 11), 1),
            (f"  stuck {stuck + shaken_down:3d} slipping {slipping:3d} open {opened:3d}", 4),
            (f"  {point.iterations:3d} iterations", 5),
            (f"  {point.outcome}", 0),
        ]
        if self._terminal and (left := self._time_left(point, number)):
            parts.append((f"  {left} left", 2))
        line = fitted(parts, shutil.get_terminal_size().columns - 1 if self._terminal else None)
        now, kind = time.monotonic(), (point.level, point.branch, point.outcome)
        news, self._last = kind != self._last, kind
        if news:
            self._leave_standing()
        if self._terminal:
            print(CLEAR_LINE + line, end="", flush=True)
        self._pending = line
        if news or is_verbose() or (not self._terminal and now - self._told >= SILENCE):
            self._leave_standing()
            self._told = now

    def expect(self, sweep: Mapping[str, Any], branches: int) -> None:
        """What is to be swept, for the time left; of several branches nobody knows how long they are."""
        self._sweep = dict(sweep) if branches == 1 else None
        self._swept = None

    def _time_left(self, point: Point, number: int) -> str:
        """Time left at the rate so far, in words; empty where it is not known."""
        if self._sweep is None:
            return ""
        done, now = share_done(self._sweep, point.frequency_hz, point.level, number), time.monotonic()
        if self._swept is None:
            self._swept = (now, done)
        begun, before = self._swept
        if now - begun < SILENCE or done <= before + LEAST_SHARE:
            return ""
        return in_time((now - begun) * (1.0 - done) / (done - before))

    def end(self, result: str, stages: Stages, place: RunPosition, bounds: str, answer: Sequence[str]) -> None:
        """What came out, where it is, and what it took. Collective.

        Parameters
        ----------
        result : the file
        stages, place : times, and the points
        bounds : of points that are not unique, in a sentence; empty: none was examined
        answer : the lines on peaks
        """
        megabytes = stages.peak_megabytes()
        for line in answer:
            self.line(line)
        ways = ", ".join(f"{count} {name}" for name, count in place.outcomes.items())
        solved = "all solved" if set(place.outcomes) == {"converged"} else ways
        each = ", ".join(f"{stage} {seconds:.1f} s" for stage, seconds in stages.seconds.items() if seconds >= 0.05)
        held = f"{max(megabytes):.0f} MB on the largest of {len(megabytes)} ranks, {sum(megabytes):.0f} MB in all"
        self.say(
            f"{counted(place.points, 'point')}, {solved}, in {stages.total:.1f} s{f' ({each})' if each else ''},"
            f" {counted(self.iterations, 'iteration')} of Newton's method,"
            f" {held if len(megabytes) > 1 else f'{megabytes[0]:.0f} MB'}"
        )
        if bounds:
            self.say(bounds)
        self.say(f"Result: {result}. Next: attrito report {result}")

    def line(self, line: str) -> None:
        """A row of a table, which is not broken."""
        if self._speaks:
            self._leave_standing()
            print(line, flush=True)


def counted(count: int, what: str) -> str:
    """`1 point`, `2 points`."""
    return f"{count} {what}{'' if count == 1 else 's'}"


def fitted(parts: Sequence[tuple[str, int]], width: int | None) -> str:
    """Texts one after another, without those of the highest numbers where they are longer than a width."""
    left = list(parts)
    while width is not None and sum(len(text) for text, _ in left) > width and any(rank for _, rank in left):
        left.remove(max(left, key=lambda part: part[1]))
    line = "".join(text for text, _ in left)
    return line if width is None else line[: max(width, 1)]


def wrapped(line: str, width: int) -> str:
    """A sentence in lines of at most a width, broken between words; names of files stay whole."""
    if len(line) <= width:
        return line
    return textwrap.fill(line, max(width, 1), subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)


def share_done(sweep: Mapping[str, Any], frequency_hz: float, level: float, number: int) -> float:
    """How much of a sweep over its levels is done, from 0 to 1, at the `number`th point."""
    levels = list(sweep.get("levels") or [level])
    nearest = min(range(len(levels)), key=lambda index: abs(levels[index] - level))
    listed = sweep.get("frequencies_hz")
    if listed:
        return min(number / (len(listed) * len(levels)), 1.0)
    start, stop = sweep["start_hz"], sweep["stop_hz"]
    part = (frequency_hz - start) / (stop - start) if stop != start else 1.0
    return (nearest + min(max(part, 0.0), 1.0)) / len(levels)


def in_time(seconds: float) -> str:
    """A time in words: `40 s`, `3 min`, `2.5 h`."""
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 6000.0 else f"{seconds / 3600.0:.1f} h"
