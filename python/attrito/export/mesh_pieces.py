"""Nodal fields on a mesh in files for ParaView, each rank writing its part: VTU pieces, or XDMF with one HDF5 file.

A VTU piece holds a share of the cells and the nodes that they use; a `.pvtu` names the pieces, a `.pvd` the instants of
a series. In an XDMF series mesh and constant fields are stored once; every rank writes its part of each dataset.
Formats: VTK file formats (kitware), XDMF model and format (xdmf.org).
"""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING
from xml.sax.saxutils import escape, quoteattr

import h5py
import meshio
import numpy as np

from attrito.support.atomic_files import whole_file, whole_hdf5
from attrito.support.errors import NO_ROOM, Fault, InputError, unusable_file
from attrito.support.parallel import everywhere, on_root

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

# XDMF's name and number of a cell, by meshio's name.
XDMF_CELLS = {
    "tetra": ("Tetrahedron", 6),
    "hexahedron": ("Hexahedron", 9),
    "tetra10": ("Tetrahedron_10", 38),
    "hexahedron20": ("Hexahedron_20", 48),
}
# Bytes of a file that one rank alone writes to.
BLOCK = 1 << 16
VTK_TYPES = {"float64": "Float64", "int32": "Int32", "int64": "Int64"}


@dataclass(frozen=True)
class Snapshot:
    """The mesh at an instant.

    Parameters
    ----------
    time : user's seconds
    points : `[N, 3]`, user length
    fields : by name, `[N]` or `[N, 3]`
    """

    time: float
    points: np.ndarray
    fields: dict[str, np.ndarray]


def share(count: int, comm: Comm) -> slice:
    """This rank's rows of `count`."""
    return slice(count * comm.rank // comm.size, count * (comm.rank + 1) // comm.size)


def write_vtu(comm: Comm, path: str, cells: list[tuple[str, np.ndarray]], snapshot: Snapshot) -> str:
    """One instant: `path`.vtu from one rank, `path`.pvtu and a piece from each of several; returns the file to open."""
    own = [(name, rows[share(len(rows), comm)]) for name, rows in cells]
    used = np.unique(np.concatenate([rows.ravel() for _, rows in own])) if own else np.empty(0, dtype=int)
    local = [(name, np.searchsorted(used, rows)) for name, rows in own if len(rows)]
    data = {name: values[used] for name, values in snapshot.fields.items()}
    if comm.size == 1:
        # Nodes that no cell uses stay in the file of a single rank.
        data, local, used = snapshot.fields, cells, slice(None)
    piece = f"{path}.vtu" if comm.size == 1 else f"{path}_rank{comm.rank}.vtu"
    with _writing(piece), whole_file(piece) as new:
        meshio.write(new, meshio.Mesh(snapshot.points[used], local, point_data=data), file_format="vtu")
    if comm.size == 1:
        return piece
    if comm.rank == 0:
        _write_text(f"{path}.pvtu", _pvtu(path, comm.size, snapshot))
    return f"{path}.pvtu"


def write_collection(path: str, times: list[float], files: list[str]) -> str:
    """A `.pvd` file that names the instants of a series (rank 0)."""
    entries = [
        f'    <DataSet timestep="{time:.17g}" file={quoteattr(Path(file).name)}/>'
        for time, file in zip(times, files, strict=True)
    ]
    lines = ['<?xml version="1.0"?>', '<VTKFile type="Collection" version="0.1">', "  <Collection>", *entries]
    _write_text(f"{path}.pvd", "\n".join([*lines, "  </Collection>", "</VTKFile>", ""]))
    return f"{path}.pvd"


def _pvtu(path: str, pieces: int, snapshot: Snapshot) -> str:
    lines = ['<?xml version="1.0"?>', '<VTKFile type="PUnstructuredGrid" version="0.1">']
    lines += ['  <PUnstructuredGrid GhostLevel="0">', "    <PPoints>"]
    lines += ['      <PDataArray type="Float64" NumberOfComponents="3"/>', "    </PPoints>", "    <PPointData>"]
    for name, values in snapshot.fields.items():
        width = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 else ""
        lines.append(f'      <PDataArray type="{VTK_TYPES[str(values.dtype)]}" Name={quoteattr(name)}{width}/>')
    lines.append("    </PPointData>")
    lines += [f"    <Piece Source={quoteattr(f'{Path(path).name}_rank{rank}.vtu')}/>" for rank in range(pieces)]
    return "\n".join([*lines, "  </PUnstructuredGrid>", "</VTKFile>", ""])


class XdmfSeries:
    """An XDMF series in `path`.xdmf and `path`.h5; use in a `with` block, on all ranks together.

    The root alone makes the HDF5 file; every rank then puts its part of the numbers at their place in it.
    So the system reports a disk that is full to the rank that writes: HDF5 on several ranks would never come back.
    """

    def __init__(self, comm: Comm, path: str, cells: list[tuple[str, np.ndarray]], constant: dict[str, np.ndarray]):
        self.comm, self.path = comm, path
        self._open = contextlib.ExitStack()
        self.file: h5py.File | None = None

        def begin() -> str:
            names: list[str] = []
            with _writing(f"{path}.h5"):
                self.file = self._open.enter_context(whole_hdf5(f"{path}.h5", named=names.append))
            return names[0]

        # What it is called until it is whole: on a name that all ranks write to.
        self._unfinished = on_root(comm, begin)
        self.grids: list[str] = []
        self.cells = cells
        self.points = ""
        try:
            self.topology = self._topology()
            self.constant = [self._attribute(name, values, f"constant/{name}") for name, values in constant.items()]
        except InputError:
            self.__exit__(*sys.exc_info())
            raise

    def __enter__(self) -> XdmfSeries:
        return self

    def __exit__(self, *failure: object) -> None:
        def end() -> None:
            with _writing(f"{self.path}.h5"):
                self._open.__exit__(*failure)

        on_root(self.comm, end)

    def add(self, snapshot: Snapshot, moved: bool) -> None:
        """One instant; `moved` where its points are not those of the instant before."""
        step = len(self.grids)
        if moved or not self.points:
            self.points = f'<Geometry GeometryType="XYZ">{self._item(f"points/{step}", snapshot.points)}</Geometry>'
        fields = [self._attribute(name, values, f"steps/{step}/{name}") for name, values in snapshot.fields.items()]
        body = "\n".join([f'<Time Value="{snapshot.time:.17g}"/>', self.topology, self.points, *fields, *self.constant])
        self.grids.append(f'<Grid Name="step_{step}" GridType="Uniform">\n{body}\n</Grid>')

    def finish(self) -> str:
        """Write the text that describes the data (rank 0); returns its file."""
        grids = "\n".join(self.grids)
        text = f'<Grid Name="series" GridType="Collection" CollectionType="Temporal">\n{grids}\n</Grid>'
        if self.comm.rank == 0:
            _write_text(f"{self.path}.xdmf", f'<Xdmf Version="3.0"><Domain>\n{text}\n</Domain></Xdmf>\n')
        return f"{self.path}.xdmf"

    def _fill(self, offset: int, values: np.ndarray) -> None:
        """Write this rank's part of a dataset; it is on disk afterwards."""
        data = memoryview(values).cast("B") if values.size else b""
        try:
            with open(self._unfinished, "r+b", buffering=0) as file:
                for first, end in own_bytes(offset, values.nbytes, self.comm):
                    file.seek(offset + first)
                    rest = data[first:end]
                    while rest:
                        rest = rest[file.write(rest) :]
                if self.comm.size > 1:
                    os.fsync(file.fileno())
        except OSError as error:
            error.filename = f"{self.path}.h5"
            raise

    def _topology(self) -> str:
        count = sum(len(rows) for _, rows in self.cells)
        if len(self.cells) == 1:
            name, rows = self.cells[0]
            kind, values = XDMF_CELLS[name][0], rows.astype(np.int64)
            size = f' NodesPerElement="{rows.shape[1]}"'
        else:
            kind, size = "Mixed", ""
            blocks = [np.insert(rows, 0, XDMF_CELLS[name][1], axis=1).ravel() for name, rows in self.cells]
            values = np.concatenate(blocks or [np.empty(0)]).astype(np.int64)
        item = self._item("cells", values)
        return f'<Topology TopologyType="{kind}" NumberOfElements="{count}"{size}>{item}</Topology>'

    def _attribute(self, name: str, values: np.ndarray, place: str) -> str:
        kind = "Vector" if values.ndim == 2 else "Scalar"
        item = self._item(place, values)
        return f'<Attribute Name={quoteattr(name)} AttributeType="{kind}" Center="Node">{item}</Attribute>'

    def _item(self, place: str, values: np.ndarray) -> str:
        """Store an array, every rank its rows; returns its reference."""
        offset = on_root(self.comm, lambda: _create(self.file, place, values))
        everywhere(self.comm, lambda: self._fill(offset, np.ascontiguousarray(values)))
        number = "Float" if values.dtype.kind == "f" else "Int"
        shape = " ".join(map(str, values.shape))
        where = escape(f"{Path(self.path).name}.h5:/{place}")
        head = f'<DataItem DataType="{number}" Dimensions="{shape}" Format="HDF" Precision="{values.dtype.itemsize}">'
        return f"{head}{where}</DataItem>"


def own_bytes(offset: int, size: int, comm: Comm) -> list[tuple[int, int]]:
    """This rank's parts (first, end) of the bytes of a dataset that begins at `offset` of its file.

    Whole blocks of the file are shared out, what is left at both ends is the root's: no two ranks write to one page.
    """
    first, end = -(-offset // BLOCK) * BLOCK, (offset + size) // BLOCK * BLOCK
    if end <= first:
        return [(0, size)] if comm.rank == 0 else []
    blocks = share((end - first) // BLOCK, comm)
    parts = [(first + blocks.start * BLOCK - offset, first + blocks.stop * BLOCK - offset)]
    return [(0, first - offset), *parts, (end - offset, size)] if comm.rank == 0 else parts


def _create(file: h5py.File, place: str, values: np.ndarray) -> int:
    """Make a dataset whose place in the file is settled, and left to others to fill; returns its offset."""
    how = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    how.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    how.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    return file.create_dataset(place, values.shape, values.dtype, dcpl=how).id.get_offset() or 0


def _write_text(path: str, text: str) -> None:
    with _writing(path), whole_file(path) as new:
        Path(new).write_text(text)


@contextlib.contextmanager
def _writing(path: str) -> Iterator[None]:
    """What the system says against writing a file, as a fault."""
    try:
        yield
    except OSError as error:
        if error.errno in NO_ROOM:
            raise unusable_file(error) from error
        raise InputError(
            Fault(path, "file", error.strerror or str(error), "a place where a file can be written")
        ) from error
