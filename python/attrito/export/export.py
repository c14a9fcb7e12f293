"""The vibration of the whole structure at one point, for ParaView."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import h5py
import numpy as np
from mpi4py import MPI

from attrito.export.mesh_pieces import Snapshot, XdmfSeries, share, write_collection, write_vtu
from attrito.export.wheel import along_own_axes, wheel_of
from attrito.model.surfaces import element_family
from attrito.results.periodic_vectors import fourier, longest
from attrito.results.result import LINEAR_MODES, Result
from attrito.support.errors import Fault, InputError
from attrito.support.file_sums import checked
from attrito.support.hdf5_reading import stored
from attrito.support.locks import writing_alone
from attrito.support.overwrite_check import check_spared
from attrito.support.parallel import everywhere

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

    from attrito.model.model import Model

# CalculiX numbers the mid-side nodes of its input as VTK does: bottom, top, upright edges. (Its output files do not.)
CELLS = {"C3D4": "tetra", "C3D8": "hexahedron", "C3D10": "tetra10", "C3D20": "hexahedron20"}
# Of the files that are written, instants and pieces apart.
ENDINGS = ("vtu", "pvtu", "pvd", "xdmf", "h5")
# Rows of the recovery basis read at once.
ROWS = 16


@dataclass(frozen=True)
class Options:
    """How a point is written.

    Parameters
    ----------
    phases : instants of a period; None: the coefficients of the motion, once
    format : `vtu` or `xdmf`
    scale : the geometry is the stress-free one plus `scale` times the displacement (at its peak without phases)
    wheel : all sectors, of a model that is one of them
    """

    phases: int | None = None
    format: str = "vtu"
    scale: float = 0.0
    wheel: bool = False


@dataclass(frozen=True)
class Motion:
    """Periodic displacement of the mesh nodes.

    Parameters
    ----------
    harmonics : [nk, N, 3], Fourier coefficients in the order mean, cos 1, sin 1, ... (user length)
    amplitude : [N], largest |displacement - mean| over the period (user length)
    phase : instant of the largest motion of any node, omega t in [0, 2 pi)
    """

    harmonics: np.ndarray
    amplitude: np.ndarray
    phase: float

    def shape_at(self, phase: float) -> np.ndarray:
        """Displacement [N, 3], mean included, at omega t = `phase`."""
        return np.tensordot(fourier(phase, len(self.harmonics)), self.harmonics, axes=1)


def export_point(
    result: Result,
    point: int,
    model: Model,
    path: str | os.PathLike[str],
    rom_file: str | None = None,
    options: Options | None = None,
    comm: Comm | None = None,
) -> tuple[str, list[str]]:
    """Write the motion at a point, all ranks together; each holds the field of one point, `[n, nk]`.

    Without phases, point data are vectors `mean`, `cosine_1`, `sine_1`, ...; `amplitude`, the largest
    |displacement - mean| over the period; `shape_at_peak`, the displacement (mean included) at the instant of the
    largest motion of any node. With phases, `displacement` at as many instants of a period. With contacts between node
    sets also, on the nodes of both sides: `contact_state` (index into stuck, shaken_down, slipping, open; -1 elsewhere;
    of several contacts the last state in this order), `normal_force` (mean, summed), `slip_fraction` (largest) and
    `dissipated_energy` (summed); 0 elsewhere. Of a linear mode `shape`, with unit modal mass, and its `amplitude`; of a
    wheel's `cosine` and `sine` in place of `shape`.

    Parameters
    ----------
    result : an open result, on every rank
    point : from 0
    model : the finite-element model the result belongs to
    path : the file to write; its ending is replaced
    rom_file : `rom.h5` of a reduced model; None: the coordinates are the model's dofs
    options : see `Options`
    comm : the ranks; None: this process alone

    Returns
    -------
    the file to open, and what was left out, one sentence each
    """
    options, comm = options or Options(), comm or MPI.COMM_SELF
    result.check_point(point)
    if not model.has_mesh:
        raise InputError(Fault(result.path, "model", "without nodes", "a finite-element model, to draw its shape"))
    field = _gathered_field(result, point, model, rom_file, comm)
    cells, notes = mesh_cells(model)
    wheel = everywhere(comm, lambda: wheel_of(result, point)) if options.wheel else None
    if np.isnan(field[:, 0]).any():
        cells, left_out = _recovered_cells(cells, field, model, rom_file)
        notes.append(left_out)
        field = np.nan_to_num(field)
    contact = contact_fields(result, point, model)
    points, harmonics = model.coordinates, node_harmonics(field, model)
    if wheel is not None:
        cells, points, harmonics = wheel.cells(cells, len(points)), wheel.points(points), wheel.harmonics(harmonics)
        contact = {name: np.tile(values, wheel.sectors) for name, values in contact.items()}
    base = str(Path(path).with_suffix(""))
    read = [result.path, result.attribute("model_file"), *([] if rom_file is None else [rom_file])]
    written = [f"{base}.{ending}" for ending in ENDINGS]
    everywhere(comm, lambda: check_spared("export", "-o", written, filter(None, read)))
    everywhere(comm, lambda: _check_name(path))
    with writing_alone(comm, base, makes_folder=False):
        written = everywhere(
            comm,
            lambda: _write(comm, base, cells, _snapshots(result, point, points, harmonics, options), contact, options),
        )
    return written, notes


def _check_name(path: str) -> None:
    """Raise where files that name each other could not name this one."""
    if not Path(path).name.isprintable():
        raise InputError(Fault("export", "-o", path, "a name of printable characters: XML can hold no others"))


def _gathered_field(result: Result, point: int, model: Model, rom_file: str | None, comm: Comm) -> np.ndarray:
    """`full_field` on every rank, of which each recovers a part."""
    dofs = len(model.dof_node)
    own = share(dofs, comm)
    part = everywhere(comm, lambda: full_field(result, point, dofs, rom_file, own))
    return np.concatenate(comm.allgather(part)) if comm.size > 1 else part


def _recovered_cells(
    cells: list[tuple[str, np.ndarray]], field: np.ndarray, model: Model, rom_file: str | None
) -> tuple[list[tuple[str, np.ndarray]], str]:
    """Cells of whose nodes all motion was recovered, and a sentence on the others.

    Raises
    ------
    InputError : there are none
    """
    known = ~np.isnan(field[:, 0])
    moves = model.translates
    unknown = model.rows_of(moves)[~known[moves]]
    cells, left_out = _cells_of(cells, ~np.isin(np.arange(len(model.node_ids)), unknown))
    if not cells:
        expected = 'the motion of all nodes of some element: [reduction] recovery = "all", or a list of node sets'
        raise InputError(Fault(rom_file, "/recovery/dof", f"{np.count_nonzero(known)} of {len(known)} dofs", expected))
    why = "[reduction] recovery leaves out the motion of some of their nodes"
    return cells, f"{left_out} elements are not drawn: {why}"


def _snapshots(
    result: Result, point: int, points: np.ndarray, harmonics: np.ndarray, options: Options
) -> Iterator[Snapshot]:
    """What is drawn: the motion's coefficients once, or the displacement at instants of a period.

    Parameters
    ----------
    points, harmonics : of the nodes, `[N, 3]` and `[nk, N, 3]`
    """
    if options.phases is None and result.attribute("format") == LINEAR_MODES:
        shape = harmonics[1]
        data = {"shape": shape, "amplitude": np.linalg.norm(shape, axis=1)}
        if result.has("/points/nodal_diameter"):
            data = {"cosine": shape, "sine": harmonics[2], "amplitude": motion_of(harmonics).amplitude}
        yield Snapshot(0.0, points + options.scale * shape, data)
        return
    if options.phases is None:
        motion = motion_of(harmonics)
        peak = motion.shape_at(motion.phase)
        data = {"mean": motion.harmonics[0]}
        for harmonic in range(1, (len(motion.harmonics) + 1) // 2):
            data[f"cosine_{harmonic}"] = motion.harmonics[2 * harmonic - 1]
            data[f"sine_{harmonic}"] = motion.harmonics[2 * harmonic]
        data |= {"amplitude": motion.amplitude, "shape_at_peak": peak}
        yield Snapshot(0.0, points + options.scale * peak, data)
        return
    frequency = float(result.array("/points/frequency_hz")[point])
    period = 1.0 / frequency if frequency > 0.0 else 1.0
    for step in range(options.phases):
        moved = np.tensordot(fourier(2 * np.pi * step / options.phases, len(harmonics)), harmonics, axes=1)
        time = period * step / options.phases
        yield Snapshot(time, points + options.scale * moved, {"displacement": moved})


def _write(
    comm: Comm,
    base: str,
    cells: list[tuple[str, np.ndarray]],
    snapshots: Iterator[Snapshot],
    contact: dict[str, np.ndarray],
    options: Options,
) -> str:
    if options.format == "xdmf":
        if ":" in Path(base).name:
            # Readers part the file from the place in it at a colon.
            raise InputError(Fault(base, "output", f"{Path(base).name}.xdmf", "a name without a colon for XDMF"))
        with XdmfSeries(comm, base, cells, contact) as series:
            for snapshot in snapshots:
                series.add(snapshot, moved=options.scale != 0.0)
            return series.finish()
    files, times = [], []
    for step, snapshot in enumerate(snapshots):
        name = base if options.phases is None else f"{base}_phase_{step:03d}"
        full = Snapshot(snapshot.time, snapshot.points, snapshot.fields | contact)
        files.append(write_vtu(comm, name, cells, full))
        times.append(snapshot.time)
    if options.phases is None:
        return files[0]
    if comm.rank == 0:
        write_collection(base, times, files)
    return f"{base}.pvd"


def _cells_of(cells: list[tuple[str, np.ndarray]], known: np.ndarray) -> tuple[list[tuple[str, np.ndarray]], int]:
    """Cells whose nodes all are known, and the number of the others."""
    kept = [(name, nodes[known[nodes].all(axis=1)]) for name, nodes in cells]
    left_out = sum(len(nodes) for _, nodes in cells) - sum(len(nodes) for _, nodes in kept)
    return [(name, nodes) for name, nodes in kept if len(nodes)], left_out


def full_field(result: Result, point: int, dofs: int, rom_file: str | None, part: slice = slice(None)) -> np.ndarray:
    """Fourier coefficients [n, nk] on the full model's dofs, `basis^T q`, or on a part of them; NaN: not recovered."""
    coordinates = along_own_axes(result, result.dataset("/points/coordinates")[point])
    if rom_file is None:
        if len(coordinates) != dofs:
            expected = f"{dofs}, as many as the model has dofs, or the rom.h5 that made them"
            raise InputError(Fault(result.path, "/points/coordinates", f"{len(coordinates)} coordinates", expected))
        return coordinates[part]
    with stored(rom_file, "a rom.h5 of `attrito reduce`") as rom:
        made_with = result.attribute("rom_fingerprint")
        if made_with and str(rom.attrs.get("fingerprint", "")) != made_with:
            expected = f"the reduced model that {result.path} was made with: run its job again"
            raise InputError(Fault(rom_file, "fingerprint", "of another reduction", expected))
        basis = checked(rom["/recovery/basis"], rom_file)
        kept = rom["/recovery/dof"][:] if "recovery/dof" in rom else None
        width = dofs if kept is None else len(kept)
        if basis.shape != (len(coordinates), width):
            expected = f"{len(coordinates)} x {width} to match {result.path} and the model"
            raise InputError(Fault(rom_file, "/recovery/basis", " x ".join(map(str, basis.shape)), expected))
        if kept is None:
            return _recovered(basis, coordinates, part)
        first, last = range(dofs)[part].start, range(dofs)[part].stop
        field = np.full((last - first, coordinates.shape[1]), np.nan)
        boundary = rom["/boundary/dof"][:]
        here = (boundary >= first) & (boundary < last)
        field[boundary[here] - first] = coordinates[: len(boundary)][here]
        columns = slice(*np.searchsorted(kept, [first, last]))
        field[kept[columns] - first] = _recovered(basis, coordinates, columns)
        return field


def _recovered(basis: h5py.Dataset, coordinates: np.ndarray, part: slice) -> np.ndarray:
    """`basis^T q` of a part of the columns; a few rows at a time, for a large basis need not fit into memory."""
    field = np.zeros((len(range(basis.shape[1])[part]), coordinates.shape[1]))
    for begin in range(0, len(coordinates), ROWS):
        field += basis[begin : begin + ROWS, part].T @ coordinates[begin : begin + ROWS]
    return field


def node_motion(field: np.ndarray, model: Model) -> Motion:
    """Motion of every node from the coefficients `[n, nk]` at the dofs; constrained dofs do not move."""
    return motion_of(node_harmonics(field, model))


def motion_of(harmonics: np.ndarray) -> Motion:
    """Motion of nodes with coefficients `[nk, N, 3]`; peaks are those of the continuous motion."""
    about_mean = harmonics.copy()
    about_mean[0] = 0
    amplitude, phase = longest(about_mean)
    return Motion(harmonics, amplitude, float(phase[np.argmax(amplitude)]))


def node_harmonics(field: np.ndarray, model: Model) -> np.ndarray:
    """Coefficients [nk, N, 3] at the nodes from those [n, nk] at the dofs, zero where held; others are left out."""
    moves = model.translates
    node = model.rows_of(moves)
    harmonics = np.zeros((field.shape[1], len(model.node_ids), 3))
    harmonics[:, node, np.asarray(model.dof_direction[moves], dtype=int) - 1] = field[moves].T
    return harmonics


def contact_fields(result: Result, point: int, model: Model) -> dict[str, np.ndarray]:
    """Contact quantities on the mesh nodes; empty if the contacts are not between nodes."""
    if not (result.contacts and result.has("/contacts/parameters/node_a")):
        return {}
    state = np.full(len(model.node_ids), -1, dtype=np.int32)
    force, slip, energy = (np.zeros(len(model.node_ids)) for _ in range(3))
    values = {
        name: result.dataset(f"/contacts/{name}")[point] for name in ("state", "n_mean", "slip", "dissipated_energy")
    }
    order = np.argsort(model.node_ids)
    for side in ("node_a", "node_b"):
        nodes = result.array(f"/contacts/parameters/{side}")
        here = np.isin(nodes, model.node_ids)
        row = order[np.searchsorted(model.node_ids, nodes[here], sorter=order)]
        np.maximum.at(state, row, values["state"][here])
        np.add.at(force, row, np.nan_to_num(values["n_mean"][here]))
        np.maximum.at(slip, row, np.nan_to_num(values["slip"][here]))
        np.add.at(energy, row, np.nan_to_num(values["dissipated_energy"][here]))
    return {"contact_state": state, "normal_force": force, "slip_fraction": slip, "dissipated_energy": energy}


def mesh_cells(model: Model) -> tuple[list[tuple[str, np.ndarray]], list[str]]:
    """Cells of the mesh on rows of `coordinates`, and what has no counterpart in VTK."""
    order = np.argsort(model.node_ids)
    cells, notes = [], []
    for name, (ids, connectivity) in model.elements.items():
        family = element_family(name)
        if family is None:
            notes.append(f"{len(ids)} elements of type {name} are not drawn (drawn are {', '.join(CELLS)})")
            continue
        cells.append((CELLS[family], order[np.searchsorted(model.node_ids, connectivity, sorter=order)]))
    return cells, notes
