"""Where a branch of a sweep ends, and why, as far as its last point shows it.

Friction carries at most its limit. If every contact that closes comes to its limit in the period, a body that moves on
pushes all sliders along, and the mean force of friction stays what it is: no more load is carried at this motion.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from attrito.library.names import NO_SOLUTION, STATES
from attrito.library.points import Point
from attrito.results.bifurcations import FOLDS, Bifurcation
from attrito.support.parallel import on_root

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

    from attrito.runs.recorder import Recorder
    from attrito.scene.scene import Contacts, Scene

NEEDED = ("/points/frequency_hz", "/contacts/state", "/contacts/t1_mean", "/contacts/t2_mean")
# Part of a force that its other components may be, to be along an axis
ALONG = 0.05


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
    holding = int((state[closed] == STATES.index("stuck")).sum())
    if holding > 0:
        closing = int(closed.sum())
        return f"no step along it converges; {closing - holding} of {closing} contacts that close come to their limit"
    sets = contacts.places["set"].astype(str)
    names = list(dict.fromkeys(sets[closed].tolist()))
    words = ", ".join(name.replace(" - ", "/") for name in names)
    which = (
        f"contact sets {words}" if names != ["explicit"] else f"contacts {', '.join(map(str, np.flatnonzero(closed)))}"
    )
    return f"{which} slide{_carried(last, contacts, closed)}"


def _carried(last: dict[str, np.ndarray], contacts: Contacts, closed: np.ndarray) -> str:
    """Mean friction of the contacts that close, as a vector in words; empty if nothing is known of their directions."""
    frame = contacts.places["frame"][closed]
    if np.isnan(frame).any():
        return ", each at its limit of friction in the period"
    force = np.zeros(3)
    for direction, name in enumerate(("/contacts/t1_mean", "/contacts/t2_mean")):
        if name in last:
            values = np.nan_to_num(np.ravel(last[name])[closed])
            force += values @ frame[:, direction]
    size = float(np.linalg.norm(force))
    if size <= 0.0:
        return ", each at its limit of friction in the period"
    axis = int(np.argmax(np.abs(force)))
    others = np.delete(np.abs(force), axis).max()
    along = "xyz"[axis] if others <= ALONG * size else f"({', '.join(f'{part:.2f}' for part in force / size)})"
    return f" along {along}: each is at its limit, and friction at this alternating motion carries at most {size:.4g}"
