"""Bounds of a point that is not unique by visiting other members of its family: bounds marked `sampled`.

The linear model of the family at a member (`attrito.runs.linear_family`) says which sliders take a quantity farthest,
and the solver goes there. Where every contact sticks the model is exact and that is the bound; elsewhere the next step
starts from the member found, half as long where the solver does not follow or nothing is gained, until there is nothing
to gain. The contact law takes sliders back that were moved too far, so whatever the solver returns is a member: bounds
are never too wide. They are too narrow where the family bends so much that the way uphill ends before its top.

A search may have a budget of work, counted in floating-point operations by formulas and never in seconds, so that it
ends at the same member on every machine, after a restart, and on any number of ranks. An operation of a visit or of a
linear program counts as many of the solver's as take as long. What the rest of the budget will hardly pay, a linear
model or the bounds of all contacts, is not begun. Quantities whose search was cut off have no bounds; one other member
is visited all the same.

The members are those of a truncated balance. Its estimated error e, a part of the forces, widens every bound; and where
a free contact has less room between its limits than that,

    -max_t (x . T - mu N) - max_t (-x . T - mu N) < e F,    or    min_t N < e F,

along a direction x, with F the largest sum of a contact's coefficients, the contact may slip or
open in every period of the true motion: then its mean forces are none of the family's, and no bounds are given.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from attrito.library.family import Family, Member
from attrito.library.laws import cone_coefficients
from attrito.runs.linear_family import LinearFamily, basis_at, scale_of, values_of

# Part of the forces that is no width, nor worth a step: residual (1e-10) and cones drawn in (1e-9), with a margin.
WORTHLESS = 1e-8
# Steps gain ten to a hundred times less than the one before: after one that gains less than this comes none of worth.
LAST = 1e-6
MOST_STEPS = 12
MOST_HALVINGS = 6
MOST_RELEASES = 3
# Part by which free sliders are moved of what would leave no mean force, and of that if it fails: far members are dear.
RELEASED = 0.25
# Time of an operation of visits and of linear programs, in those of a point's solve, where they are slowest: on five
# models 4 to 14 and 1.9 against 9 to 15 Gflop/s.
VISITS, PROGRAMS = 3.0, 8.0
# Instants and directions at which the room of a contact is looked for.
INSTANTS, ROOM_DIRECTIONS = 256, 8
# Places where the family remembers members.
SHOWN, BEST = 0, 1

T = TypeVar("T")


@dataclass
class Hull:
    """Least and greatest value over the members visited.

    Parameters
    ----------
    force : mean forces t1, t2, n, `[2, nc, 3]`
    mean, amplitude : of the monitors, `[2, monitors]`
    members : how many were visited
    accuracy : force below which a width is none
    complete : whether the search of every quantity came to its end; NaN is the bound of one that did not
    work : of the search, in operations of the solver
    visited : amplitudes of the monitors, `[2, monitors]`, over all members visited, also where they are no bounds
    """

    force: np.ndarray
    mean: np.ndarray
    amplitude: np.ndarray
    members: int
    accuracy: float
    complete: bool = True
    work: float = 0.0
    visited: np.ndarray = field(default_factory=lambda: np.full((2, 0), np.nan))


class Ended(Exception):  # noqa: N818
    """A search is not to go on: its budget is spent, the run is to stop, or bounds would say nothing of the truth."""


class _Budget:
    """What the search of one point may still do: `most` operations of the solver's, or what takes as long."""

    def __init__(self, family: Family, most: float):
        self._family, self.most, self._programs = family, most, 0.0
        self._before = family.work()

    def farthest(self, model: LinearFamily, gradient: np.ndarray) -> tuple[np.ndarray, bool]:
        """`model.farthest`, counted."""
        before = model.work
        found = model.farthest(gradient)
        self._programs += model.work - before
        return found

    def check(self, ahead: float = 0.0) -> None:
        """Raise Ended where nothing is left, or not the work ahead, or the run is to stop."""
        if self._family.is_interrupted() or self.spent() + ahead > self.most:
            raise Ended

    def afforded(self, items: Sequence[T], again: int = 0) -> Iterator[T]:
        """Items, until the rest of them, each at the cost of the last one, is more than what is left: Ended.

        `again`: how often as many of the same kind follow.
        """
        cost = 0.0
        for done, item in enumerate(items):
            self.check(((1 + again) * len(items) - done) * cost)
            before = self.spent()
            yield item
            cost = self.spent() - before

    def move(self, slider: np.ndarray, most: float | None = None) -> bool:
        """`family.move`, given up when more than `most` is spent, or the budget if that is not given."""
        left = (self.most if most is None else most) - self.spent()
        return self._family.move(slider, left / VISITS)

    def spent(self) -> float:
        """Operations so far, in those of the solver."""
        return VISITS * (self._family.work() - self._before) + PROGRAMS * self._programs


class _Extremes:
    """Least and greatest values so far, `[quantities]` each."""

    def __init__(self, values: np.ndarray):
        self.lowest, self.highest, self.count = values.copy(), values.copy(), 1

    def add(self, values: np.ndarray) -> None:
        self.lowest, self.highest = np.minimum(self.lowest, values), np.maximum(self.highest, values)
        self.count += 1

    def open(self, quantity: int, side: float) -> None:
        """There is no end on this side."""
        (self.highest if side > 0.0 else self.lowest)[quantity] = side * np.inf


class Search:
    """The search for the bounds of one point after another, on contacts of some laws, `[nc]` by key."""

    def __init__(self, laws: dict[str, np.ndarray]):
        self._laws = laws

    def __call__(self, family: Family, work: float = np.inf, error: float = 0.0, least: float = np.inf) -> Hull | None:
        """Visit members; None where the point itself cannot be described. The family ends where it began.

        `work`: operations of the solver after which the search ends, whatever it has found; where that is before any
        other member was visited, one is all the same if its visit takes no more than `least`. `error`: of the balance,
        estimated, a part of the motion; NaN: not known.
        """
        budget = _Budget(family, work)
        shown = family.describe()
        if shown is None:
            return None
        family.keep(SHOWN)
        hull = _Extremes(values_of(shown))
        ended = np.full(len(hull.lowest), False)
        try:
            if not least_room(shown, self._laws) >= error * scale_of(shown):
                raise Ended
            budget.check()
            groups = _groups(shown)
            # Where contacts slip, the least and the greatest value both need a model at the member found first.
            # Where all stick members are linear in their sliders: one model is that of all.
            others = 0 if shown.free.all() else 2 * len(groups[0])
            model = self._model(family, shown, budget, others)
            for group in groups:
                for quantity in budget.afforded(group):
                    for side in (1.0, -1.0) if model is not None else ():
                        self._climb(family, model, quantity, side, hull, budget)
                    ended[quantity] = True
        except Ended:
            family.go_back(SHOWN)
            # Where all contacts hold, amplitudes are the same in all members.
            if hull.count == 1 and not shown.free.all() and not family.is_interrupted():
                self._release(family, shown, hull, budget, least)
        count, monitors = len(shown.force), len(shown.monitors)
        both = np.where(ended, [hull.lowest, hull.highest], np.nan)
        both += np.array([[-1.0], [1.0]]) * _errors(shown, error)
        force, mean, amplitude = np.split(both, [3 * count, 3 * count + monitors], axis=1)
        accuracy = (WORTHLESS + 2.0 * error) * scale_of(shown)
        found = force.reshape(2, count, 3), mean, amplitude
        visited = np.array([hull.lowest, hull.highest])[:, 3 * count + monitors :]
        return Hull(*found, hull.count, accuracy, bool(ended.all()), budget.spent(), visited)

    def _release(self, family: Family, shown: Member, hull: _Extremes, budget: _Budget, least: float) -> None:
        """Visit a member whose free contacts have less mean tangential force.

        T = kt (u - w): a slider moved by T_0 / kt would leave none if nothing else moved. A part of that is tried, and
        less where the solver does not follow, as long as the budget lasts, or what is left to this at `least`.
        """
        rest = shown.force[:, :2, 0] / self._laws["tangential_stiffness"][:, None]
        rest[~shown.free.astype(bool)] = 0.0
        part = RELEASED
        most = max(budget.most, budget.spent() + least)
        for _ in range(MOST_RELEASES):
            slider = shown.slider.copy()
            slider[:, :2] += part * rest
            if budget.move(slider, most):
                member = family.describe()
                if member is not None:
                    hull.add(values_of(member))
                family.go_back(SHOWN)
                return
            if budget.spent() > most:
                return
            part *= RELEASED

    def _climb(
        self, family: Family, model: LinearFamily, quantity: int, side: float, hull: _Extremes, budget: _Budget
    ) -> None:
        """From the member shown towards the greatest value of `side` times a quantity, and back."""
        place, endless = SHOWN, False
        for _ in range(MOST_STEPS):
            budget.check()
            gradient = side * model.gradients[quantity]
            worthless = WORTHLESS * model.scale * model.units[quantity]
            step, leans = budget.farthest(model, gradient)
            expected = gradient @ step
            endless = False
            if expected <= worthless:
                break
            gain, part, member = self._advance(family, model, place, step, (quantity, side), hull, budget)
            if gain <= worthless:
                break
            endless = leans
            last = LAST * model.scale * model.units[quantity]
            if part == 1.0 and (gain <= last or abs(gain - expected) <= worthless):
                break
            place = BEST
            family.keep(place)
            model = self._model(family, member, budget)
            if model is None:
                break
        if endless:
            hull.open(quantity, side)
        family.go_back(SHOWN)

    def _advance(
        self,
        family: Family,
        model: LinearFamily,
        place: int,
        step: np.ndarray,
        aim: tuple[int, float],
        hull: _Extremes,
        budget: _Budget,
    ) -> tuple[float, float, Member | None]:
        """Go as much of a step as gains something: what it gains, the part, and the member reached."""
        quantity, side = aim
        before = side * values_of(model.member)[quantity]
        part = 1.0
        for _ in range(MOST_HALVINGS):
            budget.check()
            if budget.move(model.slider(part * step)):
                member = family.describe()
                if member is not None:
                    values = values_of(member)
                    hull.add(values)
                    if side * values[quantity] > before:
                        return side * values[quantity] - before, part, member
                family.go_back(place)
            part *= 0.5
        return 0.0, part, None

    def _model(self, family: Family, member: Member, budget: _Budget, others: int = 0) -> LinearFamily | None:
        """The linear model at the member that the family stands at; None where no slider is free, or it is singular.

        `others`: models that follow if this one is made.
        """
        moves = [(int(i), t) for i in np.flatnonzero(member.free) for t in range(self._laws["tangents"][i])]
        changes = [family.differentiate(*move) for move in budget.afforded(moves, others)]
        if not moves or any(change is None for change in changes):
            return None
        return LinearFamily(member, moves, changes, self._laws)


def _groups(shown: Member) -> list[list[int]]:
    """Quantities of `values_of` in the order in which they are sought.

    The first monitor's amplitude, by which points are high; then all that is asked for by name; then forces.
    """
    forces, monitors = shown.force[:, :, 0].size, len(shown.monitors)
    first = [forces + monitors] if monitors else []
    return [first, [i for i in range(forces, forces + 2 * monitors) if i not in first], list(range(forces))]


def _errors(shown: Member, error: float) -> np.ndarray:
    """What truncation may make wrong of `values_of`, `[quantities]`, for a relative error of the motion."""
    means = np.abs(shown.monitors[:, 1:]).sum(axis=1)
    return error * np.concatenate([np.full(shown.force[:, :, 0].size, scale_of(shown)), means, shown.amplitude])


def least_room(member: Member, laws: dict[str, np.ndarray]) -> float:
    """The least force by which limits leave a free contact room, over contacts and directions; infinite: none is free.

    Between the limits of T it does not depend on the mean of T.
    """
    room = np.inf
    coefficients = member.force.shape[2]
    basis = basis_at(2.0 * np.pi * np.arange(INSTANTS) / INSTANTS, coefficients)
    friction = cone_coefficients(laws)
    for contact in np.flatnonzero(member.free):
        t1, t2, n = member.force[contact] @ basis.T
        angles = np.pi * np.arange(ROOM_DIRECTIONS) / ROOM_DIRECTIONS if laws["tangents"][contact] == 2 else np.zeros(1)
        along = np.cos(angles)[:, None] * t1 + np.sin(angles)[:, None] * t2
        limit = friction[contact] * n
        room = min(room, *(-(along - limit).max(axis=1) - (-along - limit).max(axis=1)), n.min())
    return float(room)
