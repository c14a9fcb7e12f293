"""The file model.h5: matrices, dofs, mesh and node sets of a full model.

Its schema is written down in docs/reference/files.md. Units are the user's own consistent set.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
from collections.abc import Sequence
from pathlib import Path

import h5py
import numpy as np
from scipy.sparse import csr_matrix

from attrito.model.model import HOLDINGS, Model
from attrito.support.atomic_files import whole_hdf5
from attrito.support.errors import NO_ROOM, Fault, InputError, unusable_file
from attrito.support.file_sums import checked
from attrito.support.hdf5_reading import stored
from attrito.support.hdf5_writing import described

FORMAT = "attrito model"
FORMAT_VERSION = 1
MATRICES = {
    "stiffness": ("stiffness matrix", "user force/length"),
    "mass": ("mass matrix", "user mass"),
    "damping": ("viscous damping matrix", "user force*time/length"),
    "gyroscopic": ("matrix of the Coriolis forces at a speed of rotation of 1 rad per unit of time", "user mass"),
}


def write_model(path: str | Path, model: Model, source: Sequence[str | Path]) -> None:
    """Write model.h5 in one piece: whoever reads finds the old file or the new one, never half of one.

    Parameters
    ----------
    path : the file
    model : with its stiffness and mass
    source : the files it was read from, for the root attribute `source`
    """
    try:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        with whole_hdf5(path) as file:
            _fill(file, model, source)
    except OSError as error:
        if error.errno in NO_ROOM:
            raise unusable_file(error) from error
        raise InputError(
            Fault(str(path), "file", error.strerror or str(error), "a file that can be written")
        ) from error


def _fill(file: h5py.File, model: Model, source: Sequence[str | Path]) -> None:
    file.attrs["format"] = FORMAT
    file.attrs["format_version"] = FORMAT_VERSION
    file.attrs["attrito_version"] = _version()
    file.attrs["description"] = "full model: matrices, dofs, mesh and node sets"
    file.attrs["stiffness_holds"] = json.dumps(model.stiffness_holds)
    if model.spin_hz is not None:
        file.attrs["spin_hz"] = model.spin_hz
    file.attrs["source"] = json.dumps([_fingerprint(Path(name)) for name in source])

    def put(name: str, values: np.ndarray, kind: type, description: str, unit: str = "1") -> None:
        described(file, name, description, unit, data=np.asarray(values, dtype=kind))

    for name, (description, unit) in MATRICES.items():
        matrix = getattr(model, name)
        if matrix is not None:
            if not matrix.has_canonical_format:
                matrix = matrix.tocsr(copy=True)
                matrix.sum_duplicates()  # sorts the columns, too
            put(f"{name}/row_offsets", matrix.indptr, np.int64, f"{description}, CSR: first entry of each row, from 0")
            put(f"{name}/columns", matrix.indices, np.int32, f"{description}, CSR: column of each entry, from 0")
            put(f"{name}/values", matrix.data, np.float64, f"{description}, CSR: value of each entry", unit)
    if model.names_dofs:
        put("dofs/node", model.dof_node, np.int64, "node id of each dof")
        words = "direction of each dof: 1, 2, 3 for x, y, z; 4, 5, 6 for rotations about them; 0: generalised"
        put("dofs/direction", model.dof_direction, np.int8, words)
    if model.has_mesh:
        put("nodes/id", model.node_ids, np.int64, "node ids")
        if model.point_mass:
            put("nodes/point_mass/node", list(model.point_mass), np.int64, "nodes with a mass at a point")
            put("nodes/point_mass/mass", list(model.point_mass.values()), np.float64, "mass of each", "user mass")
        if len(model.dependent):
            words = "node and direction of displacements that depend on others, which no row of the matrices has"
            put("nodes/dependent", model.dependent, np.int64, words)
        if len(model.undisplaced):
            words = "nodes that stand for the angles of a rigid body, or for the elongation of a pre-tension section"
            put("nodes/undisplaced", model.undisplaced, np.int64, words)
        if model.load_axes:
            put("nodes/load_axes/node", list(model.load_axes), np.int64, "nodes whose forces have axes of their own")
            axes = np.array(list(model.load_axes.values()))
            put("nodes/load_axes/directions", axes, np.float64, "directions 1, 2, 3 of each, as rows")
        put("nodes/coordinates", model.coordinates, np.float64, "node coordinates x, y, z", "user length")
    for kind, (ids, connectivity) in model.elements.items():
        put(f"elements/{kind}/id", ids, np.int64, f"ids of the {kind} elements")
        put(f"elements/{kind}/connectivity", connectivity, np.int64, f"node ids of each {kind} element, CalculiX order")
        if kind in model.elastic:
            words = f"of each {kind} element, isotropic; NaN: not known"
            young, poisson = model.elastic[kind].T
            put(f"elements/{kind}/young_modulus", young, np.float64, f"Young's modulus {words}", "user force/length^2")
            put(f"elements/{kind}/poisson_ratio", poisson, np.float64, f"Poisson's ratio {words}")
        if kind in model.density:
            words = f"density of each {kind} element; NaN: not known"
            put(f"elements/{kind}/density", model.density[kind], np.float64, words, "user mass/length^3")
    for name, ids in model.node_sets.items():
        put(f"node_sets/{name}", ids, np.int64, f"node ids of the set {name}, ascending")


def _version() -> str:
    try:
        return importlib.metadata.version("attrito")
    except importlib.metadata.PackageNotFoundError:
        return "unknown"


def _fingerprint(path: Path) -> dict[str, str | int]:
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while chunk := file.read(1 << 20):
            digest.update(chunk)
    return {"file": str(path), "bytes": path.stat().st_size, "sha256": digest.hexdigest()}


def read_model(path: str | Path, matrices: bool = True) -> Model:
    """Read model.h5.

    Parameters
    ----------
    path : the file
    matrices : False leaves the matrices out and reads dofs, mesh and node sets only

    Raises
    ------
    InputError : no such file, not a model file, or its parts do not fit together
    """
    with stored(path, "a file that attrito import has written") as file:
        _check_format(file, str(path))
        return _Reader(file, str(path)).model(matrices)


def _check_format(file: h5py.File, path: str) -> None:
    written = file.attrs.get("format")
    if written != FORMAT:
        value = "missing" if written is None else str(written)
        raise InputError(Fault(path, "format", value, f'"{FORMAT}", a file written by attrito import'))
    version = file.attrs.get("format_version")
    if version != FORMAT_VERSION:
        raise InputError(Fault(path, "format_version", version, f"{FORMAT_VERSION}, which this version reads"))


class _Reader:
    """Reads the parts of one open file and collects what does not fit together."""

    def __init__(self, file: h5py.File, path: str):
        self.file = file
        self.path = path
        self.faults: list[Fault] = []

    def model(self, matrices: bool) -> Model:
        offsets = self.array("stiffness/row_offsets", 1)
        size = len(offsets) - 1
        read = {name: self.matrix(name, size) for name in MATRICES if matrices and self.wanted(name)}
        model = Model(read.get("stiffness"), read.get("mass"), read.get("damping"), size=size)
        model.gyroscopic = read.get("gyroscopic")
        self.holdings(model)
        if "dofs" in self.file:
            self.dofs(model)
        if "nodes" in self.file:
            self.nodes(model)
            self.mesh(model)
        if self.faults:
            raise InputError(*self.faults)
        return model

    def holdings(self, model: Model) -> None:
        written = self.file.attrs.get("stiffness_holds", "[]")
        try:
            model.stiffness_holds = tuple(json.loads(written))
        except (TypeError, ValueError):
            model.stiffness_holds = ("",)
        known = all(name in HOLDINGS for name in model.stiffness_holds)
        self.expect(known, "stiffness_holds", written, f"a list of {', '.join(HOLDINGS)}")
        if (speed := self.file.attrs.get("spin_hz")) is not None:
            model.spin_hz = float(speed)
            self.expect(bool(np.isfinite(model.spin_hz)), "spin_hz", speed, "a finite number")

    def dofs(self, model: Model) -> None:
        model.dof_node, model.dof_direction = self.array("dofs/node", 1), self.array("dofs/direction", 1)
        nodes, directions = len(model.dof_node), len(model.dof_direction)
        self.expect(nodes == model.size, "dofs/node", f"{nodes} nodes", f"one node for each of {model.size} dofs")
        self.expect(directions == model.size, "dofs/direction", f"{directions} directions", f"{model.size} directions")
        known = np.isin(model.dof_direction, range(7)).all()
        expected = "1, 2, 3 (displacements), 4, 5, 6 (rotations) or 0 (generalised coordinates) only"
        self.expect(known, "dofs/direction", "others", expected)

    def nodes(self, model: Model) -> None:
        model.node_ids, model.coordinates = self.array("nodes/id", 1), self.array("nodes/coordinates", 2)
        shape, expected = model.coordinates.shape, (len(model.node_ids), 3)
        self.expect(shape == expected, "nodes/coordinates", f"shape {shape}", f"shape {expected}")
        if "point_mass" in self.file["nodes"]:
            nodes, masses = self.array("nodes/point_mass/node", 1), self.array("nodes/point_mass/mass", 1)
            self.known(nodes, "nodes/point_mass/node", model.node_ids)
            self.expect(len(nodes) == len(masses), "nodes/point_mass/mass", len(masses), f"one of each of {len(nodes)}")
            model.point_mass = dict(zip(nodes.tolist(), masses.tolist(), strict=False))
        if "dependent" in self.file["nodes"]:
            model.dependent = self.array("nodes/dependent", 2)
            self.expect(model.dependent.shape[1] == 2, "nodes/dependent", model.dependent.shape, "two columns")
            self.known(model.dependent[:, :1], "nodes/dependent", model.node_ids)
        if "undisplaced" in self.file["nodes"]:
            model.undisplaced = self.array("nodes/undisplaced", 1)
            self.known(model.undisplaced, "nodes/undisplaced", model.node_ids)
        if "load_axes" in self.file["nodes"]:
            ids, axes = self.array("nodes/load_axes/node", 1), self.array("nodes/load_axes/directions", 3, unknown=True)
            shape, expected = axes.shape, (len(ids), 3, 3)
            self.expect(shape == expected, "nodes/load_axes/directions", f"shape {shape}", f"shape {expected}")
            self.known(ids, "nodes/load_axes/node", model.node_ids)
            model.load_axes = dict(zip(ids.tolist(), axes, strict=False))
        if model.names_dofs and len(model.dof_node) == len(model.dof_direction):
            self.known(model.dof_node[model.dof_direction > 0], "dofs/node", model.node_ids)

    def mesh(self, model: Model) -> None:
        for kind in self.file.get("elements", ()):
            ids, connectivity = self.array(f"elements/{kind}/id", 1), self.array(f"elements/{kind}/connectivity", 2)
            key = f"elements/{kind}/connectivity"
            rows = f"{len(connectivity)} rows"
            self.expect(len(ids) == len(connectivity), key, rows, f"a row for each of {len(ids)} elements")
            self.known(connectivity, key, model.node_ids)
            model.elements[kind] = (ids, connectivity)
            self.elastic(model, kind)
            self.density(model, kind)
        for name in self.file.get("node_sets", ()):
            model.node_sets[name] = self.array(f"node_sets/{name}", 1)
            self.known(model.node_sets[name], f"node_sets/{name}", model.node_ids)

    def elastic(self, model: Model, kind: str) -> None:
        names = [f"elements/{kind}/{name}" for name in ("young_modulus", "poisson_ratio")]
        if not any(name in self.file for name in names):
            return
        constants = [self.array(name, 1, unknown=True) for name in names]
        for name, values in zip(names, constants, strict=True):
            count = len(model.elements[kind][0])
            self.expect(len(values) == count, name, f"{len(values)} values", f"one for each of {count} elements")
        if len(constants[0]) != len(constants[1]):
            return
        young, poisson = constants
        solid = (young > 0.0) & (poisson > -1.0) & (poisson < 0.5) & np.isfinite(young)
        wrong = np.flatnonzero(~solid & ~(np.isnan(young) & np.isnan(poisson)))
        if len(wrong):
            value = f"{young[wrong[0]]}, {poisson[wrong[0]]} of element {wrong[0]}"
            self.expect(False, names[0], value, "a modulus above 0 and a Poisson's ratio between -1 and 0.5, or NaN")
        model.elastic[kind] = np.column_stack(constants)

    def density(self, model: Model, kind: str) -> None:
        name = f"elements/{kind}/density"
        if name not in self.file:
            return
        values = self.array(name, 1, unknown=True)
        count = len(model.elements[kind][0])
        self.expect(len(values) == count, name, f"{len(values)} values", f"one for each of {count} elements")
        wrong = np.flatnonzero(~(np.isfinite(values) & (values > 0.0)) & ~np.isnan(values))
        if len(wrong):
            self.expect(False, name, f"{values[wrong[0]]} of element {wrong[0]}", "a density above 0, or NaN")
        model.density[kind] = values

    def wanted(self, name: str) -> bool:
        return name in ("stiffness", "mass") or name in self.file

    def array(self, name: str, dimensions: int, unknown: bool = False) -> np.ndarray:
        """A dataset; `unknown`: it may hold NaN."""
        dataset = self.file.get(name)
        is_array = isinstance(dataset, h5py.Dataset) and dataset.ndim == dimensions and dataset.dtype.kind in "iuf"
        if not is_array:
            value = "missing" if dataset is None else str(dataset)
            raise InputError(*self.faults, Fault(self.path, name, value, f"numbers in {dimensions} dimension(s)"))
        read = checked(dataset, self.path)[()]
        # Entries of matrices are looked at with the matrix, which names their place.
        if read.dtype.kind == "f" and not unknown and not name.endswith("/values") and not np.all(np.isfinite(read)):
            place = tuple(int(i) for i in np.argwhere(~np.isfinite(read))[0])
            self.faults.append(Fault(self.path, name, f"{read[place]} at {place}", "finite numbers"))
        return read

    def matrix(self, name: str, size: int) -> csr_matrix | None:
        offsets, columns, values = (self.array(f"{name}/{part}", 1) for part in ("row_offsets", "columns", "values"))
        fits = (
            len(offsets) == size + 1
            and offsets[0] == 0
            and bool(np.all(np.diff(offsets) >= 0))
            and offsets[-1] == len(columns) == len(values)
            and (len(columns) == 0 or (columns.min() >= 0 and columns.max() < size))
        )
        value = f"{len(offsets) - 1} rows, {len(columns)} columns, {len(values)} values"
        self.expect(fits, name, value, f"the CSR parts of a matrix of {size} dofs")
        return csr_matrix((values, columns, offsets), shape=(size, size)) if fits else None

    def expect(self, condition: bool, key: str, value: object, expected: str) -> None:
        if not condition:
            self.faults.append(Fault(self.path, key, value, expected))

    def known(self, nodes: np.ndarray, key: str, node_ids: np.ndarray) -> None:
        unknown = np.setdiff1d(nodes, node_ids)
        self.expect(len(unknown) == 0, key, unknown[:5], "ids that nodes/id lists")
