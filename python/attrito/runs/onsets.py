"""Derivatives where a contact is at the onset of slip: of both branches that meet there.

Friction coefficients of all contacts are taken a little larger, so that the contact sticks, and a little smaller, so
that it slips. Which branch is that of smaller and which that of larger values of a parameter follows from what the
contact dissipates, nothing at the onset: it grows towards the side on which it slips.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from attrito.library.family import Family

# Part of friction within which a contact is at the onset of slip: ten times what points are solved to (1e-10). With so
# much less it slips for some sqrt(MARGIN) of a period, and by events derivatives are off by as much: with four times as
# much less by twice that, so that both together are as exact as MARGIN.
MARGIN = 1e-9
# With two tangents members are solved again, so that friction differs by more than what sliders are found to.
MARGIN_OF_SLIDERS = 1e-7
# Members that are solved again may stick where they are missed by as much as they are solved to: how much more is tried
FACTORS = (1.0, 10.0, 100.0)
# By how much rates of dissipation with friction smaller by one and by four margins may differ: by events some 1e-4, by
# samples as the next ones slip
ALIKE = 0.5
SIDES = ("below", "above")
# Derivatives at the present member, or None
Find = Callable[[Family], "np.ndarray | None"]


@dataclass(frozen=True)
class Onset:
    """Contacts at the onset of slip: 1, else 0, `[nc]`, and the part of friction that was taken for little."""

    contacts: np.ndarray
    margin: float

    @property
    def dissipation(self) -> tuple[str, np.ndarray]:
        """What these contacts dissipate, as a quantity of an `Inquiry`."""
        return "dissipated_energy", self.contacts


def find_onset(family: Family, margin: float) -> Onset | None:
    """The contacts at the onset; None: there are none."""
    contacts = family.find_onsets(margin)
    return Onset(contacts, margin) if contacts is not None and np.any(contacts) else None


def margin_of(sliders_move: bool) -> float:
    """What is taken for little."""
    return MARGIN_OF_SLIDERS if sliders_move else MARGIN


def branches(family: Family, onset: Onset, find: Find, sliders_move: bool) -> tuple[np.ndarray, np.ndarray] | None:
    """Derivatives with the contacts sticking, and slipping; None where one of them has none, or slip is not found.

    Parameters
    ----------
    find : what describes the member and gives its derivatives
    sliders_move : are there contacts with two tangents, whose sliders are unknowns: members are solved again
    """
    family.keep(0)

    def at(part: float) -> tuple[np.ndarray | None, bool]:
        """Derivatives with other friction, and whether the contacts slip there."""
        family.scale_friction(1.0 + part)
        member = family.describe()
        if member is not None and sliders_move:
            member = family.describe() if family.move(member.slider) else None
        slips = member is not None and not np.any(member.free[onset.contacts > 0.0] > 0.0)
        found = None if member is None else find(family)
        family.go_back(0)
        return found, slips

    sticking, _ = at(onset.margin)
    slipping = None
    for factor in FACTORS:
        near, slips = at(-factor * onset.margin)
        if not slips:
            continue
        far, _ = at(-4.0 * factor * onset.margin)
        if near is None or far is None:
            break
        if _are_of_one_branch(near, far):
            slipping = 2.0 * near - far
            break
    family.scale_friction(1.0)
    return None if sticking is None or slipping is None else (sticking, slipping)


def _are_of_one_branch(near: np.ndarray, far: np.ndarray) -> bool:
    """Whether both slip: where events are too near one another to be distinguished, one dissipates nothing."""
    dissipates = far[-1] != 0.0
    if not np.any(dissipates):
        return True
    return bool(np.median(np.abs(near[-1, dissipates] / far[-1, dissipates] - 1.0)) < ALIKE)


def sides(sticking: np.ndarray, slipping: np.ndarray) -> dict[str, np.ndarray]:
    """By smaller and by larger parameters `[quantities, parameters]`.

    The last quantity given is what the contacts at the onset dissipate, and left out.
    """
    slips_above = slipping[-1] > 0.0
    both = np.where(slips_above, sticking, slipping)[:-1], np.where(slips_above, slipping, sticking)[:-1]
    return dict(zip(SIDES, both, strict=True))
