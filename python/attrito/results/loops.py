"""Hysteresis loops of a solved point, from the law in the library."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from attrito.library.kernels import contact_at_instants
from attrito.library.laws import are_coulomb, cone_coefficients
from attrito.library.structures import make_law
from attrito.results.result import Result
from attrito.support.errors import Fault, InputError


@dataclass(frozen=True)
class Loop:
    """One contact over one period.

    Parameters
    ----------
    name : title of its panel
    displacement, tangential : [nt] or [nt, tangents], relative displacement and force along the tangents
    normal : [nt], normal force
    friction_coefficient : if given, the limits +- mu N are drawn
    """

    name: str
    displacement: np.ndarray
    tangential: np.ndarray
    normal: np.ndarray
    friction_coefficient: float | None = None


INSTANTS = 1024


def contact_loops(result: Result, point: int, contacts: Sequence[int]) -> list[Loop]:
    """Loops T(u) with N over a period for some contacts of a point; two tangents: along the largest motion."""
    result.check_point(point)
    laws = {name: result.array(f"contacts/parameters/{name}") for name in _laws(result)}
    loops = []
    for contact in contacts:
        if not 0 <= contact < result.contacts:
            raise InputError(Fault(result.path, "contact", contact, f"a number from 0 to {result.contacts - 1}"))
        tangents = int(laws["tangents"][contact])
        rows = [*range(tangents), 2]
        coefficients = result.dataset("contacts/displacement")[point, contact][rows]
        slider = result.dataset("contacts/slider")[point, contact]
        u, force = contact_at_instants(make_law(laws, contact), coefficients, slider, INSTANTS)
        friction = float(cone_coefficients(laws)[contact]) if are_coulomb(laws) else None
        along = main_direction(u[:tangents])
        loops.append(Loop(f"contact {contact}", along @ u[:tangents], along @ force[:tangents], force[-1], friction))
    return loops


def main_direction(motion: np.ndarray) -> np.ndarray:
    """Unit vector `[tangents]` of the largest motion `[tangents, samples]`."""
    if len(motion) == 1:
        return np.ones(1)
    directions: np.ndarray = np.linalg.svd(motion - motion.mean(axis=1, keepdims=True), full_matrices=False)[0]
    return directions[:, 0]


def most_dissipating(result: Result, point: int, count: int = 4) -> list[int]:
    """The contacts that dissipate most at a point, the largest first."""
    result.check_point(point)
    energy = np.nan_to_num(result.dataset("contacts/dissipated_energy")[point])
    return [int(contact) for contact in np.argsort(-energy, kind="stable")[:count]]


def _laws(result: Result) -> tuple[str, ...]:
    others = ("law", "law_numbers") if result.has("contacts/parameters/law") else ()
    return (
        *others,
        "tangents",
        "tangential_stiffness",
        "normal_stiffness",
        "friction_coefficient",
        "gap",
        "preload",
    )
