"""What is read of a rom.h5, the file of a reduced model, and whether it can be solved with."""

from __future__ import annotations

from dataclasses import dataclass

import h5py
import numpy as np

from attrito.support.errors import Fault, InputError
from attrito.support.file_sums import checked
from attrito.support.hdf5_reading import UNREADABLE, stored

ROM = "a rom.h5 of `attrito reduce` (delete it, and it is made again)"
# Error below which modes, solved to residuals of 1e-12, tell nothing
LEAST_ERROR = 1e-12


@dataclass(frozen=True)
class Rom:
    """What is solved with of a reduced model, read at once; `m` coordinates, the `nb` boundary dofs first.

    Parameters
    ----------
    path, fingerprint : the file, and what it was made from
    mass, stiffness, damping : `[m, m]`; damping may be None
    vectors : loads and monitors, `[nv, m]`
    boundary : dofs of the full model, `[nb]`
    kind : of each coordinate, `[m]`: 0 a boundary dof, 1 a mode, 2 a correction
    mode_error : what the modes left out cost the monitors, relative to the largest response; 0 where it is not known
    interface : W of a sector's boundaries, `[k, r]`; None: all their dofs are solved
    gyroscopic : of the Coriolis forces at 1 rad/s, `[m, m]`; None without them
    """

    path: str
    fingerprint: str
    mass: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray | None
    vectors: np.ndarray
    boundary: np.ndarray
    kind: np.ndarray
    mode_error: float
    interface: np.ndarray | None = None
    gyroscopic: np.ndarray | None = None


def read_rom(path: str, vectors: int, dofs: int, paired: int) -> Rom:
    """What is solved with of a reduced model; all of one state of the file.

    Parameters
    ----------
    vectors, dofs, paired : how many loads and monitors, dofs of the model, and dofs of a sector's lower boundary
    """
    with stored(path, ROM) as file:
        size = len(file["mass"])
        wanted = {"mass": (size, size), "stiffness": (size, size), "vectors/reduced": (vectors, size)}
        wanted |= {name: (size, size) for name in ("damping", "gyroscopic") if name in file}
        read = {name: checked(file[name], path)[()] for name in wanted}
        boundary, kind = file["boundary/dof"][:], file["coordinates/kind"][:]
        interface = file["interface/basis"][()] if "interface" in file else None
        fingerprint, cost = str(file.attrs.get("fingerprint", "")), _mode_error(file)
    faults = [
        Fault(path, name, f"{values.dtype} of shape {values.shape}", f"finite numbers of shape {wanted[name]}")
        for name, values in read.items()
        if values.shape != wanted[name] or values.dtype.kind != "f" or not np.all(np.isfinite(values))
    ]
    if boundary.dtype.kind != "i" or len(boundary) > size or np.any((boundary < 0) | (boundary >= dofs)):
        faults.append(Fault(path, "boundary/dof", boundary, f"at most {size} dofs of the model, 0 to {dofs - 1}"))
    if interface is not None:
        faults += _faults_of_interface(path, interface, paired)
    if kind.shape != (size,):
        faults.append(Fault(path, "coordinates/kind", f"shape {kind.shape}", f"one for each of {size} coordinates"))
    if faults:
        raise InputError(*faults)
    damping, reduced, gyroscopic = read.get("damping"), read["vectors/reduced"], read.get("gyroscopic")
    matrices = read["mass"], read["stiffness"], damping
    return Rom(path, fingerprint, *matrices, reduced, boundary, kind, cost, interface, gyroscopic)


def _faults_of_interface(path: str, basis: np.ndarray, paired: int) -> list[Fault]:
    """What is wrong with the shapes of a lower boundary of so many dofs."""
    fits = basis.ndim == 2 and basis.shape[0] == paired and basis.shape[1] <= paired
    if fits and basis.dtype.kind == "f" and np.all(np.isfinite(basis)):
        return []
    expected = f"finite numbers of shape ({paired}, at most {paired})"
    return [Fault(path, "interface/basis", f"{basis.dtype} of shape {basis.shape}", expected)]


def _mode_error(file: h5py.File) -> float:
    """What the modes left out cost the monitors, relative to the largest response.

    The largest estimated error of a receptance between a monitor and a load (docs/explanation/reduction.md).
    """
    if "quality" not in file or "vectors/name" not in file:
        return 0.0
    names = [name.decode() for name in file["vectors/name"][:]]
    errors = receptance_errors(file["quality/receptance"][:], file["quality/receptance_error"][:])
    watched = [i for i, name in enumerate(names) if name.startswith("monitor:")]
    loads = [i for i in range(len(names)) if i not in watched] or watched
    worst = float(np.nan_to_num(errors[np.ix_(watched, loads)]).max(initial=0.0))
    return worst if worst > LEAST_ERROR else 0.0


def rom_fingerprint(path: str | None) -> str:
    """Fingerprint of a rom.h5; empty where there is none."""
    try:
        with h5py.File(path or "") as file:
            return str(file.attrs.get("fingerprint", ""))
    except UNREADABLE:
        return ""


def receptance_errors(receptance: np.ndarray, errors: np.ndarray) -> np.ndarray:
    """Largest error over frequencies relative to the largest receptance, for each pair `[nv, nv]`; NaN without one.

    Parameters
    ----------
    receptance, errors : `[frequencies, nv, nv]`, as in rom.h5
    """
    if receptance.ndim != 3 or receptance.shape != errors.shape or receptance.dtype.kind != "f":
        raise ValueError(f"quality/receptance of shape {receptance.shape}, receptance_error of {errors.shape}")
    if len(receptance) == 0:
        return np.full(receptance.shape[1:], np.nan)
    largest = np.abs(receptance).max(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(largest > 0.0, np.abs(errors).max(axis=0) / largest, np.nan)
