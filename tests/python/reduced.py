"""Small models reduced: what tests of the reduction share."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from mpi4py import MPI
from scipy.linalg import eigh

from attrito.library.reduction import Options, Report, reduce_model
from attrito.model.model import Model
from attrito.model.model_file import write_model

COUNTS, SIZE = (5, 3, 2), (0.1, 0.04, 0.03)


@dataclass
class Case:
    """A model file, its matrices as dense arrays, and its boundary dofs, the nodes at x = 0."""

    folder: Path
    points: np.ndarray
    mass: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    boundary: np.ndarray

    @property
    def interior(self) -> np.ndarray:
        """Dofs that are not boundary."""
        return np.setdiff1d(np.arange(len(self.mass)), self.boundary)

    @property
    def clamped_frequencies(self) -> np.ndarray:
        """All fixed-interface frequencies in Hz."""
        inside = np.ix_(self.interior, self.interior)
        return np.sqrt(eigh(self.stiffness[inside], self.mass[inside], eigvals_only=True)) / (2 * np.pi)

    def reduce(self, boundary=None, vectors=None, recovered=None, **options) -> tuple[Report, h5py.File]:
        """The report, and rom.h5 open."""
        chosen = self.boundary if boundary is None else boundary
        # A name of its own: h5py would take a file written over for the one that it still holds open.
        path = self.folder / f"rom{len(list(self.folder.glob('rom*')))}.h5"
        report = reduce_model(
            MPI.COMM_WORLD, self.folder / "model.h5", path, chosen, Options(**options), vectors, recovered=recovered
        )
        return report, h5py.File(path)


def make_case(folder: Path, model: Model, points: np.ndarray) -> Case:
    write_model(folder / "model.h5", model, [])
    boundary = np.flatnonzero(np.repeat(points[:, 0] < 1e-9, 3))
    matrices = (matrix.toarray() for matrix in (model.mass, model.stiffness, model.damping))
    return Case(folder, points, *matrices, boundary)


def unit(case: Case, *dofs: int) -> np.ndarray:
    """Unit vectors as rows."""
    return np.eye(len(case.mass))[list(dofs)]


def worst(found, expected) -> float:
    """Largest difference relative to the largest expected value."""
    return np.abs(np.asarray(found) - expected).max() / np.abs(expected).max()
