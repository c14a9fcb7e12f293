"""The family that a point is one of, member by member: the root asks, every rank of the solver follows."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from attrito.library.derivatives import Inquiry, Rates
from attrito.library.session import Solver
from attrito.library.structures import omega, pointer

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

Found = TypeVar("Found")


@dataclass(frozen=True)
class Member:
    """One member of a family, or how it changes with a slider (`slider`, `free` and `amplitude` then say nothing).

    Parameters
    ----------
    force : coefficients of contact forces, rows t1, t2, n, `[nc, 3, 2 H + 1]`
    monitors : coefficients `[monitors, 2 H + 1]`
    amplitude : half the monitors' ranges over the period, `[monitors]`
    slider : at the start of the period, `[nc, width]`
    free : whether the contact holds its slider, whatever that is, `[nc]`
    """

    force: np.ndarray
    monitors: np.ndarray
    amplitude: np.ndarray
    slider: np.ndarray
    free: np.ndarray


class Family:
    """The other members at a solver's last point. While they are visited the solver's state is theirs; see `visit`.

    `interrupted` says why to stop, or nothing; it is collective (`Stop.interrupted` of `support/stop_signals.py`).
    """

    def __init__(
        self, comm: Comm, solver: Solver, contacts: int, monitors: int, interrupted: Callable[[], str] | None = None
    ):
        self._comm, self._solver, self._interrupted = comm, solver, interrupted
        self._sizes = contacts, monitors
        self._inquiry: Inquiry | None = None
        # Why visits were to stop, on every rank; empty: nothing asked for it
        self.stopped = ""

    @property
    def tolerance(self) -> float:
        """What points are solved to."""
        return self._solver.tolerance

    def ask(self, inquiry: Inquiry) -> None:
        """Say what derivatives are asked for from now on. Collective."""
        inquiry.tell(self._solver)
        self._inquiry = inquiry

    def visit(self, work: Callable[[Family], Found]) -> Found | None:
        """Do some work on the root, where its result is, all ranks at hand; the solver is left as it was."""
        self.stopped = ""
        self._solver.call("attrito_enter_family")
        try:
            if self._comm.rank != 0:
                while (request := self._comm.bcast(None)) is not None:
                    self._follow(*request)
                return None
            try:
                return work(self)
            finally:
                self._comm.bcast(None)
        finally:
            self._solver.call("attrito_leave_family")

    def describe(self) -> Member | None:
        """The present member; None if it cannot be evaluated."""
        member: Member | None = self._ask("describe")
        return member

    def differentiate(self, contact: int, tangent: int) -> Member | None:
        """How the member described last changes with one component of -kt w; None if that is singular."""
        change: Member | None = self._ask("differentiate", contact, tangent)
        return change

    def scale_friction(self, factor: float) -> None:
        """Scale the friction coefficients that contacts have; within a visit, whose work gives them back by 1."""
        self._ask("scale_friction", factor)

    def find_onsets(self, margin: float) -> np.ndarray | None:
        """1 of contacts that rest with friction larger by this part and slip with friction as much smaller, `[nc]`.

        Else 0; None where the point cannot be evaluated.
        """
        begins: np.ndarray | None = self._ask("find_onsets", margin)
        return begins

    def differentiate_by_frequency(self) -> np.ndarray | None:
        """Derivatives `[quantities]` by the frequency, per Hz, of the member described last; None if singular."""
        found: np.ndarray | None = self._ask("differentiate_by_frequency")
        return found

    def differentiate_directly(self, parameters: Rates) -> np.ndarray | None:
        """Derivatives `[quantities, parameters]` of the member described last; None if singular.

        The quantities are those of the last `Inquiry`.
        """
        found: np.ndarray | None = self._ask("differentiate_directly", parameters)
        return found

    def differentiate_by_adjoint(self) -> Rates | None:
        """Derivatives of the quantities by everything, of the member described last; None if singular."""
        found: Rates | None = self._ask("differentiate_by_adjoint")
        return found

    def differentiate_along(self, parameters: Rates, by_adjoint: bool) -> np.ndarray | None:
        """As `differentiate_directly`, or with a linear system a quantity instead of one a parameter.

        `by_adjoint` is not for sectors, whose receptances are not symmetric.
        """
        if not by_adjoint:
            return self.differentiate_directly(parameters)
        gradient = self.differentiate_by_adjoint()
        return None if gradient is None else gradient.along(parameters)

    def differentiate_peak_frequency(self, monitor: int, parameters: Rates) -> np.ndarray | None:
        """Derivatives of the frequency, Hz, of a peak of a monitor's half range that the solver is at, `[parameters]`.

        NaN where there are none: by samples; None if singular.
        """
        found: np.ndarray | None = self._ask("differentiate_peak_frequency", monitor, parameters)
        return found

    def differentiate_mode(
        self, parameters: Rates, weight: np.ndarray, own: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Derivatives at a mode's point, its amplitude Q = |weight . q_1| held; None if singular.

        Parameters
        ----------
        parameters : level and harmonic factors have no meaning
        weight : complex `[m]`
        own : of Q by the parameters, the motion held, `[parameters]`

        Returns
        -------
        of frequency, Hz, of xi and of the structure's damping ratio, `[3, parameters]`; of the quantities,
        `[quantities, parameters]`
        """
        found: tuple[np.ndarray, np.ndarray] | None = self._ask("differentiate_mode", parameters, weight, own)
        return found

    def move(self, slider: np.ndarray, most_work: float = np.inf) -> bool:
        """Move the sliders, `[nc, width]`; False if that gives no member, and nothing has changed.

        `most_work`: operations after which it is given up.
        """
        moved: bool = self._ask("move", slider, most_work)
        return moved

    def move_to(self, frequency_hz: float) -> bool:
        """Go to the point at a frequency from here, sliders as they are; False: there is none, nothing has changed."""
        moved: bool = self._ask("move_to", frequency_hz)
        return moved

    def work(self) -> float:
        """Floating-point operations of the library since the visit began, by formulas, over all ranks."""
        operations: float = self._ask("work")
        return operations

    def is_interrupted(self) -> bool:
        """Whether a signal or the limit of time asks to stop; `stopped` then says which."""
        interrupted: bool = self._ask("is_interrupted")
        return interrupted

    def keep(self, place: int) -> None:
        """Remember the present member in a place, 0 or 1."""
        self._ask("keep", place)

    def go_back(self, place: int) -> None:
        """Return to the member remembered there."""
        self._ask("go_back", place)

    def _ask(self, what: str, *arguments: Any) -> Any:
        self._comm.bcast((what, *arguments))
        return self._follow(what, *arguments)

    def _follow(self, what: str, *arguments: Any) -> Any:
        if what == "work":
            return self._solver.work_of_visits()
        if what == "is_interrupted":
            self.stopped = self._interrupted() if self._interrupted is not None else ""
            return bool(self.stopped)
        if what == "keep":
            return self._solver.call("attrito_keep_member", *arguments)
        if what == "go_back":
            return self._solver.call("attrito_return_to_member", *arguments)
        if what == "scale_friction":
            return self._solver.call("attrito_scale_friction", *arguments)
        if what == "move":
            slider, most_work = arguments
            return self._solver.call("attrito_solve_member", pointer(np.ascontiguousarray(slider)), most_work) == 1
        if what == "move_to":
            return self._solver.call("attrito_solve_member_at", *map(omega, arguments)) == 1
        (contacts, monitors), coefficients = self._sizes, self._solver.coefficients
        if what == "find_onsets":
            begins = np.zeros(contacts)
            return begins if self._solver.call("attrito_find_onsets", *arguments, pointer(begins)) == 0 else None
        if what.startswith("differentiate_"):
            return self._differentiate(what, *arguments)
        member = Member(
            np.zeros((contacts, 3, coefficients)),
            np.zeros((monitors, coefficients)),
            np.zeros(monitors),
            np.zeros((contacts, self._solver.slider_width)),
            np.zeros(contacts),
        )
        series = pointer(member.force), pointer(member.monitors)
        if what == "describe":
            rest = pointer(member.amplitude), pointer(member.slider), pointer(member.free)
            status = self._solver.call("attrito_describe_member", *series, *rest)
        else:
            status = self._solver.call("attrito_differentiate_member", *arguments, *series)
        return member if status == 0 else None

    def _differentiate(self, what: str, *arguments: Any) -> Any:
        """By parameters or by everything; None where the equations are singular."""
        name = f"attrito_{what}"
        if self._inquiry is None:
            raise TypeError("an Inquiry is needed first: ask")
        quantities = len(self._inquiry.quantities)
        if what == "differentiate_by_adjoint":
            gradients = self._inquiry.zeros(self._solver, quantities)
            return gradients if self._solver.call(name, ctypes.byref(gradients.raw())) == 0 else None
        if what == "differentiate_by_frequency":
            slopes = np.zeros(quantities)
            return 2.0 * np.pi * slopes if self._solver.call(name, pointer(slopes)) == 0 else None
        if what == "differentiate_peak_frequency":
            monitor, rates = arguments
            slopes = np.zeros(len(rates))
            status = self._solver.call(name, monitor, ctypes.byref(rates.raw()), pointer(slopes))
            return slopes / (2.0 * np.pi) if status == 0 else None
        rates = arguments[0]
        found = np.zeros((quantities, len(rates)))
        if what == "differentiate_directly":
            status = self._solver.call(name, ctypes.byref(rates.raw()), pointer(found))
            return found if status == 0 else None
        _, weight, own = arguments
        parts = [np.ascontiguousarray(part, dtype=float) for part in (weight.real, -weight.imag, own)]
        mode = np.zeros((3, len(rates)))
        status = self._solver.call(name, ctypes.byref(rates.raw()), *map(pointer, parts), pointer(mode), pointer(found))
        mode[0] /= 2.0 * np.pi
        return (mode, found) if status == 0 else None
