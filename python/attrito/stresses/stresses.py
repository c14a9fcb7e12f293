"""Stresses at nodes at a point of a result: what they are, as a table and in words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from attrito.stresses.cycle import Cycle, principal_of
from attrito.stresses.recovery import COMPONENTS, strain_of
from attrito.support.csv_text import numbers
from attrito.support.errors import Fault, InputError


@dataclass(frozen=True)
class Stresses:
    """Stresses at n places: nodes, of those between materials one for each.

    Parameters
    ----------
    point, frequency_hz : of the result
    row, node, coordinates : row in the model's nodes, id, and place in user length, `[n]`, `[n]`, `[n, 3]`
    elastic : Young's modulus and Poisson's ratio of the material, `[n, 2]`
    harmonics : Fourier coefficients mean, cos 1, sin 1, ... of xx, yy, zz, xy, yz, zx, `[nk, n, 6]`
    cycle : alternating and mean stress, see `Cycle`
    stress_unit, length_unit : names, of a job with `[model] units`; else empty
    notes : what was left out
    is_mode : of a linear mode, whose number is `point` + 1
    level : of excitation, of a result with several; None: one alone
    strengths : under stress that alternates about zero, and in tension; None: not given
    """

    point: int
    frequency_hz: float
    row: np.ndarray
    node: np.ndarray
    coordinates: np.ndarray
    elastic: np.ndarray
    harmonics: np.ndarray
    cycle: Cycle
    stress_unit: str = ""
    length_unit: str = ""
    notes: tuple[str, ...] = ()
    is_mode: bool = False
    level: float | None = None
    strengths: tuple[float, float] | None = None

    @property
    def alternating_strain(self) -> np.ndarray:
        """Strain tensors of `cycle.alternating`, `[n, 6]`; shear strains are half the engineer's."""
        return strain_of(self.cycle.alternating, self.elastic)

    @property
    def mean_strain(self) -> np.ndarray:
        """Strain tensors of `cycle.mean`, `[n, 6]`."""
        return strain_of(self.cycle.mean, self.elastic)

    def columns(self, strain: bool = False) -> dict[str, np.ndarray]:
        """Columns of the table by their names, with units where these are known; strains, too, if asked for."""
        length = f" [{self.length_unit}]" if self.length_unit else ""
        stress = f" [{self.stress_unit}]" if self.stress_unit else ""
        cycle = self.cycle
        found: dict[str, np.ndarray] = {
            self.what: np.full(len(self.node), self.number),
            "frequency_hz": np.full(len(self.node), self.frequency_hz),
            "node": self.node,
        }
        found |= {f"{axis}{length}": self.coordinates[:, k] for k, axis in enumerate("xyz")}
        for name in (
            "alternating_von_mises",
            "mean_signed_von_mises",
            "alternating_principal",
            "mean_principal",
            "peak_von_mises",
        ):
            found[f"{name}{stress}"] = getattr(cycle, name)
        if self.goodman is not None:
            found["goodman"] = self.goodman
        for name, tensor in (("alternating", cycle.alternating), ("mean", cycle.mean)):
            found |= {f"{name}_{part}{stress}": tensor[:, k] for k, part in enumerate(COMPONENTS)}
        if strain:
            found |= self._strain_columns()
        found |= {f"phase_{k + 1}_deg": np.degrees(cycle.phases[:, k]) for k in range(2)}
        found[f"young_modulus{stress}"] = self.elastic[:, 0]
        if self.level is not None:
            found["level"] = np.full(len(self.node), self.level)
        return found

    def _strain_columns(self) -> dict[str, np.ndarray]:
        both = {"alternating_strain": self.alternating_strain, "mean_strain": self.mean_strain}
        found = dict(
            zip(("alternating_principal_strain", "mean_principal_strain"), principal_of(*both.values()), strict=True)
        )
        for name, tensor in both.items():
            found |= {f"{name}_{part}": tensor[:, k] for k, part in enumerate(COMPONENTS)}
        return found

    @property
    def what(self) -> str:
        """What `number` counts: points from 0, linear modes from 1."""
        return "mode" if self.is_mode else "point"

    @property
    def number(self) -> int:
        """Of the point or the mode."""
        return self.point + self.is_mode

    @property
    def title(self) -> str:
        """Which point or mode it is, in words."""
        level = "" if self.level is None else f", level {self.level:.4g}"
        return f"{self.what} {self.number}, {self.frequency_hz:.6g} Hz{level}"

    @property
    def goodman(self) -> np.ndarray | None:
        """Alternating stress over fatigue strength and tensile mean stress over tensile strength, summed, `[n]`.

        1 is Goodman's line; None without strengths.
        """
        if self.strengths is None:
            return None
        fatigue, tensile = self.strengths
        mean = np.maximum(self.cycle.mean_signed_von_mises, 0.0)
        return np.asarray(self.cycle.alternating_von_mises / fatigue + mean / tensile)

    def to_csv(self, header: bool = True, strain: bool = False) -> str:
        """The table as CSV, a line a place; 12 significant digits."""
        columns = self.columns(strain)
        cells = [
            [str(value) for value in values.tolist()] if values.dtype.kind == "i" else numbers(values)
            for values in columns.values()
        ]
        lines = [",".join(columns)] if header else []
        lines += [",".join(row) for row in zip(*cells, strict=True)]
        return "\n".join(lines) + "\n"

    def to_dataframe(self, strain: bool = False) -> Any:
        """The table as a frame of pandas, which must be installed; with strains if asked for."""
        try:
            import pandas
        except ImportError:
            raise InputError(Fault("to_dataframe", "pandas", "absent", "pandas, of Debian python3-pandas")) from None
        return pandas.DataFrame(self.columns(strain))

    def summary(self) -> list[str]:
        """The greatest stresses in words."""
        cycle = self.cycle
        unit = f" {self.stress_unit}" if self.stress_unit else ""
        lines = [f"{self.title}: {len(np.unique(self.node))} nodes"]
        worst = int(np.argmax(cycle.alternating_von_mises))
        lines.append(
            f"largest alternating von Mises stress {cycle.alternating_von_mises[worst]:.5g}{unit}"
            f" {self._place(worst)}, about a mean of {cycle.mean_signed_von_mises[worst]:.5g}{unit}"
        )
        worst = int(np.argmax(cycle.peak_von_mises))
        lines.append(
            f"largest von Mises stress of the period {cycle.peak_von_mises[worst]:.5g}{unit} {self._place(worst)}"
        )
        if self.goodman is not None:
            worst = int(np.argmax(self.goodman))
            lines.append(f"largest part of the strength by Goodman {self.goodman[worst]:.4g} {self._place(worst)}")
        return [*lines, *self.notes]

    def _place(self, one: int) -> str:
        where = ", ".join(f"{value:.5g}" for value in self.coordinates[one])
        return f"at node {self.node[one]} ({where}{' ' + self.length_unit if self.length_unit else ''})"
