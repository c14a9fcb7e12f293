"""Where a branch of a sweep ends, and why, as far as its last point shows it.

Friction carries at most its limit (`attrito.runs.carrying_capacity`). Where it has nothing left along a direction in
which a body slides, no periodic motion is left beyond.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from attrito.library.names import LAWS, NO_SOLUTION, STATES
from attrito.library.points import Point
from attrito.results.bifurcations import FOLDS, Bifurcation
from attrito.runs.carrying_capacity import Closed, least_reserve, over_period
from attrito.support.parallel import on_root

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

    from attrito.runs.recorder import Recorder
    from attrito.scene.scene import Contacts, Scene

FRICTION = ("/contacts/t1_mean", "/contacts/t2_mean")
NEEDED = ("/points/frequency_hz", "/contacts/state", "/contacts/displacement", *FRICTION)
# Part of a direction that its other components may be, to be along an axis
ALONG = 0.05
# What friction has left, of mu times all normal forces: the last steps of a branch show less than 1 % on the curve
NOTHING_LEFT = 0.01  # guess
# Part of these forces up to which a load is what the balance is solved to
ROUNDING = 1e-6


class BranchEnds:
    """Watches the points of a run for the ends of branches.

    Parameters
    ----------
    comm, scene : the scene is at the root
    """

    def __init__(self, comm: Comm, scene: Scene | None):
        self._comm = comm
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
        return on_root(self._comm, lambda: self._sentence(before[0], found))

    def _sentence(self, branch: int, found: list[Bifurcation]) -> str:
        frequency = float(np.ravel(self._last["/points/frequency_hz"])[0])
        folds = [one.frequency_hz for one in found if one.branch == branch and one.kind in FOLDS]
        behind = f" (behind its fold at {folds[-1]:.6g} Hz)" if folds else ""
        return f"branch {branch} ends at {frequency:.6g} Hz{behind}: {reason(self._last, self._contacts)}"

    def save_state(self) -> dict[str, np.ndarray]:
        """Nothing: what is needed of a point is in its record."""
        return {}

    def load_state(self, found: dict[str, np.ndarray]) -> None:
        """Go on after a point of this record."""
        self._now = {name: found[name] for name in NEEDED if name in found}


def reason(last: dict[str, np.ndarray], contacts: Contacts) -> str:
    """Why a branch ends at a point, by the series `NEEDED` of it."""
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
        return lost if holding else f"{which} slide, each at its limit of friction in the period"
    found = _closed_contacts(last, contacts, closed)
    least = least_reserve(found)
    limits = float(found.limit.mean(axis=1).sum())
    if least is None or least[2] - least[1] > NOTHING_LEFT * limits:
        return lost
    load, most = (0.0 if abs(force) < ROUNDING * limits else force for force in least[1:])
    return (
        f"{which} slide along {_axis(least[0])}: load {load:.4g}, friction at this alternating motion carries at most "
        f"{max(most, load):.4g}"
    )


def _closed_contacts(last: dict[str, np.ndarray], contacts: Contacts, closed: np.ndarray) -> Closed:
    """What friction carries follows from this."""
    laws = {name: values[closed] for name, values in contacts.laws.items()}
    moved = np.nan_to_num(last["/contacts/displacement"].reshape(len(closed), 3, -1)[closed])
    pressed = laws["preload"][:, None] + laws["normal_stiffness"][:, None] * (
        over_period(moved[:, 2]) - laws["gap"][:, None]
    )
    frame = contacts.places["frame"][closed].copy()
    frame[laws["tangents"] == 1, 1] = 0.0
    mean = [np.nan_to_num(np.ravel(last[name])[closed]) if name in last else np.zeros(len(moved)) for name in FRICTION]
    return Closed(
        frame,
        laws["tangential_stiffness"],
        moved[:, :2],
        laws["friction_coefficient"][:, None] * np.maximum(pressed, 0.0),
        np.stack(mean, axis=1),
        np.isin(np.ravel(last["/contacts/state"])[closed], [STATES.index(name) for name in ("stuck", "shaken_down")]),
    )


def _axis(direction: np.ndarray) -> str:
    """A unit vector in words."""
    axis = int(np.argmax(np.abs(direction)))
    if np.delete(np.abs(direction), axis).max() <= ALONG * abs(direction[axis]):
        return "xyz"[axis]
    return f"({', '.join(f'{part:.2f}' for part in direction)})"
