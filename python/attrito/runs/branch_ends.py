"""Where a branch of a sweep ends, and why, as far as its last point shows it.

Friction carries at most its limit (`attrito.runs.carrying_capacity`). Where it has nothing left along a direction in
which a body slides, no periodic motion is left beyond. A structure that holds its bodies by itself lets none slide.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from attrito.library.names import LAWS, NO_SOLUTION, STATES
from attrito.library.points import Point
from attrito.results.bifurcations import FOLDS, Bifurcation
from attrito.runs.carrying_capacity import NOTHING_LEFT, Closed, least_reserve, over_period
from attrito.support.parallel import on_root

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

    from attrito.library.reduced_scene import ReducedScene
    from attrito.library.session import Solver
    from attrito.runs.recorder import Recorder
    from attrito.scene.scene import Contacts, Scene

FRICTION = ("/contacts/t1_mean", "/contacts/t2_mean")
NEEDED = ("/points/frequency_hz", "/contacts/state", "/contacts/displacement", *FRICTION)
# Part of a direction that its other components may be, to be along an axis
ALONG = 0.05
# Modes among which those of rigid motion are sought
MOST_RIGID = 50
# Part of mu times all normal forces up to which a load is what the balance is solved to
ROUNDING = 1e-6


class BranchEnds:
    """Watches the points of a run for the ends of branches.

    Parameters
    ----------
    comm, scene : the scene is at the root
    solver, reduced : of the run
    """

    def __init__(self, comm: Comm, scene: Scene | None, solver: Solver, reduced: ReducedScene):
        self._comm, self._solver, self._reduced = comm, solver, reduced
        self._contacts = None if scene is None else scene.contacts
        self._last: dict[str, np.ndarray] = {}
        self._now: dict[str, np.ndarray] = {}

    def visit(
        self, point: Point, recorder: Recorder, before: tuple[int, str] | None, found: list[Bifurcation]
    ) -> str | None:
        """A sentence if the branch of the point before ended there. Collective.

        Parameters
        ----------
        point : what the recorder has taken down
        before : branch and outcome of the point before in the same sweep; None: there is none
        found : bifurcations so far
        """
        self._last, self._now = self._now, {}
        if self._comm.rank == 0:
            self._now = {name: recorder.heard(name) for name in NEEDED if recorder.has_heard(name)}
        if before is None or before[0] == point.branch or before[1] in NO_SOLUTION:
            return None
        rigid = rigid_motions(self._solver, self._reduced)
        return on_root(self._comm, lambda: self._sentence(before[0], found, rigid))

    def _sentence(self, branch: int, found: list[Bifurcation], rigid: np.ndarray) -> str:
        frequency = float(np.ravel(self._last["/points/frequency_hz"])[0])
        folds = [one.frequency_hz for one in found if one.branch == branch and one.kind in FOLDS]
        behind = f" (behind its fold at {folds[-1]:.6g} Hz)" if folds else ""
        return f"branch {branch} ends at {frequency:.6g} Hz{behind}: {reason(self._last, self._contacts, rigid)}"

    def save_state(self) -> dict[str, np.ndarray]:
        """Nothing: what is needed of a point is in its record."""
        return {}

    def load_state(self, found: dict[str, np.ndarray]) -> None:
        """Go on after a point of this record."""
        self._now = {name: found[name] for name in NEEDED if name in found}


def rigid_motions(solver: Solver, reduced: ReducedScene) -> np.ndarray:
    """Of contacts' rows `[rows, r]`, the rigid motions of the structure without friction. Collective.

    A wheel's mean motion, which is what a body slides by, is that of nodal diameter 0.
    """
    if reduced.sector is None:
        modes, rows = solver.linear_modes("frictionless", MOST_RIGID), reduced.directions
    else:
        modes = solver.diameter_modes("frictionless", 0, MOST_RIGID)
        rows = reduced.directions + reduced.sector.next_directions
    return rows @ modes.shapes[: modes.rigid].real.T


def reason(last: dict[str, np.ndarray], contacts: Contacts, rigid: np.ndarray) -> str:
    """Why a branch ends at a point, by the series `NEEDED` of it and `rigid_motions`."""
    state = np.ravel(last["/contacts/state"])
    closed = state != STATES.index("open")
    if not closed.any():
        return "all contacts are open"
    closing, holding = int(closed.sum()), int((state[closed] == STATES.index("stuck")).sum())
    lost = f"no step along it converges; {closing - holding} of {closing} contacts that close come to their limit"
    names = list(dict.fromkeys(contacts.places["set"].astype(str)[closed].tolist()))
    words = ", ".join(name.replace(" - ", "/") for name in names)
    which = (
        f"contact sets {words}" if names != ["explicit"] else f"contacts {', '.join(map(str, np.flatnonzero(closed)))}"
    )
    others = np.any(contacts.laws.get("law", LAWS.index("coulomb")) != LAWS.index("coulomb"))
    if others or np.isnan(contacts.places["frame"][closed]).any():
        return lost if holding or not rigid.any() else f"{which} slide, each at its limit of friction in the period"
    found = _closed_contacts(last, contacts, closed, rigid)
    least = least_reserve(found)
    if least is None or least.capacity - least.load > NOTHING_LEFT * least.most:
        return lost
    load, most = (0.0 if abs(force) < ROUNDING * least.most else force for force in (least.load, least.capacity))
    carries = f"friction at this alternating motion carries at most {max(most, load):.4g}"
    return f"{which} slide along {_axis(least.direction)}: load {load:.4g}, {carries}"


def _closed_contacts(last: dict[str, np.ndarray], contacts: Contacts, closed: np.ndarray, rigid: np.ndarray) -> Closed:
    """What friction carries follows from this."""
    laws = {name: values[closed] for name, values in contacts.laws.items()}
    moved = np.nan_to_num(last["/contacts/displacement"].reshape(len(closed), 3, -1)[closed])
    pressed = laws["preload"][:, None] + laws["normal_stiffness"][:, None] * (
        over_period(moved[:, 2]) - laws["gap"][:, None]
    )
    frame = contacts.places["frame"][closed].copy()
    one = laws["tangents"] == 1
    frame[one, 1] = 0.0
    # Each contact's tangents before its normal
    first = (np.cumsum(contacts.laws["tangents"] + 1) - contacts.laws["tangents"] - 1)[closed]
    slips = rigid[first[:, None] + [0, 1]]
    slips[one, 1] = 0.0
    mean = [np.nan_to_num(np.ravel(last[name])[closed]) if name in last else np.zeros(len(moved)) for name in FRICTION]
    return Closed(
        frame,
        laws["tangential_stiffness"],
        moved[:, :2],
        laws["friction_coefficient"][:, None] * np.maximum(pressed, 0.0),
        np.stack(mean, axis=1),
        np.isin(np.ravel(last["/contacts/state"])[closed], [STATES.index(name) for name in ("stuck", "shaken_down")]),
        slips,
    )


def _axis(direction: np.ndarray) -> str:
    """A unit vector in words."""
    axis = int(np.argmax(np.abs(direction)))
    if np.delete(np.abs(direction), axis).max() <= ALONG * abs(direction[axis]):
        return "xyz"[axis]
    return f"({', '.join(f'{part:.2f}' for part in direction)})"
