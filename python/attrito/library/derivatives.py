"""What derivatives of a point are asked for, and numbers for all that parameters change."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from attrito.library.names import QUANTITIES
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Solver
from attrito.library.structures import RawRates, make_laws, pointer

# Numbers of every contact's law, and of damping: alpha, beta, ratio, loss factor
LAW_NUMBERS, DAMPING_NUMBERS = 5, 4


@dataclass(frozen=True)
class Rates:
    """What parameters change of a scene, or derivatives of quantities by that, `n` of them.

    Parameters
    ----------
    laws : of contacts' columns: tangential and normal stiffness, friction coefficient, gap, preload; then further
        numbers of laws; then sliders, `[n, nc, columns]`
    static_factors : on static loads, `[n, loads]`
    level : `[n]`
    harmonic_factors : on the loads of harmonics 1, 2, ..., `[n, harmonics]`
    damping : Rayleigh's alpha and beta, ratio of the stuck modes, loss factor, `[n, 4]`
    """

    laws: np.ndarray
    static_factors: np.ndarray
    level: np.ndarray
    harmonic_factors: np.ndarray
    damping: np.ndarray

    def __len__(self) -> int:
        return len(self.level)

    def at(self, which: np.ndarray) -> Rates:
        """Of some parameters, `[n]` of them true."""
        return Rates(*(getattr(self, each.name)[which] for each in fields(self)))

    def with_preload(self, factor: float) -> Rates:
        """Where all static loads have a factor."""
        return Rates(self.laws, factor * self.static_factors, self.level, self.harmonic_factors, self.damping)

    def along(self, parameters: Rates) -> np.ndarray:
        """Derivatives `[n, parameters]`, these being derivatives by everything."""
        found = np.einsum("qcn,pcn->qp", self.laws, parameters.laws, optimize=True)
        found += np.outer(self.level, parameters.level)
        for name in ("static_factors", "harmonic_factors", "damping"):
            found += getattr(self, name) @ getattr(parameters, name).T
        return np.asarray(found)

    def raw(self) -> RawRates:
        """For the library, which may write into the arrays; they live as long as these."""
        sizes = len(self), self.laws.shape[2], self.static_factors.shape[1], self.harmonic_factors.shape[1]
        arrays = [getattr(self, each.name) for each in fields(self)]
        return RawRates(*sizes, *(ctypes.c_void_p(array.ctypes.data) for array in arrays))


@dataclass(frozen=True)
class Inquiry:
    """What derivatives are asked for.

    Parameters
    ----------
    quantities : a name of `QUANTITIES`, and factors on the monitors or on all contacts
    scene : what is solved
    numbers, sliders, damping : whether by further numbers of laws, by sliders, by numbers of damping
    """

    quantities: Sequence[tuple[str, np.ndarray]]
    scene: ReducedScene
    numbers: bool = False
    sliders: bool = False
    damping: bool = False

    def tell(self, solver: Solver) -> None:
        """Tell the library. Collective."""
        scene = self.scene
        width = max([1, *(len(factors) for _, factors in self.quantities)])
        factors = np.zeros((len(self.quantities), width))
        for row, (_, own) in zip(factors, self.quantities, strict=True):
            row[: len(own)] = own
        kinds = np.array([QUANTITIES.index(kind) for kind, _ in self.quantities], dtype=np.int32)
        plain = scene.laws if self.numbers else {name: scene.laws[name] for name in scene.laws if name != "law"}
        laws = make_laws(plain)
        flags = int(self.sliders), int(self.damping)
        solver.call(
            "attrito_ask_derivatives",
            len(kinds),
            pointer(kinds),
            width,
            pointer(factors),
            len(laws),
            laws,
            *flags,
        )

    def zeros(self, solver: Solver, count: int) -> Rates:
        """As many rates of nothing."""
        return zero_rates(self.scene, count, self.columns(solver))

    def columns(self, solver: Solver) -> int:
        """Of a contact."""
        further = self.scene.laws["law_numbers"].shape[1] if self.numbers and "law" in self.scene.laws else 0
        return LAW_NUMBERS + further + (solver.slider_width if self.sliders else 0)


def zero_rates(scene: ReducedScene, count: int, columns: int = LAW_NUMBERS) -> Rates:
    """Rates of nothing."""
    return Rates(
        np.zeros((count, len(scene.laws["tangents"]), columns)),
        np.zeros((count, len(scene.static))),
        np.zeros(count),
        np.zeros((count, len(scene.harmonic) // 2)),
        np.zeros((count, DAMPING_NUMBERS)),
    )
