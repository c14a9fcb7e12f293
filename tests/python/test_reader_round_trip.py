"""The coarse blade written in every format and read again: the same matrices, reduced model and frequencies."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import h5py
import matrix_writers as write
import numpy as np
import pytest
import scipy.io
import scipy.sparse as sparse
from elastic import elastic_block
from mpi4py import MPI
from scipy.linalg import eigh, subspace_angles
from scipy.sparse.linalg import eigsh

from attrito.importers import entries, import_model, text
from attrito.library.reduction import Options, reduce_model
from attrito.model.model import Model

REPOSITORY = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def blade(tmp_path_factory) -> tuple[Path, Model]:
    """The coarse blade of CalculiX in a folder, its matrices divided by three, so that they need all 17 digits."""
    folder = tmp_path_factory.mktemp("readers")
    script = REPOSITORY / "meshes" / "blade.py"
    subprocess.run([sys.executable, script, "--size", "coarse", "--out", folder], check=True)
    model, _ = import_model(folder / "given.h5", calculix_job=folder / "blade", mesh=folder / "blade.inp")
    model.stiffness, model.mass = model.stiffness / 3.0, model.mass / 3.0
    mesh = (model.node_ids, model.coordinates, model.elements, model.node_sets)
    write.write_deck(folder / "mesh.inp", *mesh)
    write.write_cdb(folder / "mesh.cdb", *mesh)
    write.write_bdf(folder / "mesh.bdf", *mesh)
    write.write_dofs(folder / "rows.dof", model.dof_node, model.dof_direction)
    write.write_mapping(folder / "rows.mapping", model.dof_node, model.dof_direction)
    return folder, model


@dataclass(frozen=True)
class Format:
    """How a model is written and read; `{}` in a file's name stands for K or M. `digits`: significant ones; 17: all."""

    write: Callable[[Path, Model], None]
    read: dict[str, str]
    digits: int = 17


def each(writer: Callable, name: str, *options: object) -> Callable[[Path, Model], None]:
    """Write one file a matrix."""

    def write_both(folder: Path, model: Model) -> None:
        for letter, matrix in (("K", model.stiffness), ("M", model.mass)):
            writer(folder / name.format(letter), matrix, *options)

    return write_both


def together(writer: Callable, name: str, stiffness: str, mass: str, *options: object) -> Callable[[Path, Model], None]:
    """Write both matrices into one file."""
    return lambda folder, model: writer(folder / name, {stiffness: model.stiffness, mass: model.mass}, *options)


def named(writer: Callable, *options: object) -> Callable[[Path, Model], None]:
    """Hand the dofs' names to the writer, too."""
    return lambda folder, model: writer(folder, model, *options)


def abaqus(folder: Path, model: Model, triangle: str) -> None:
    for part, matrix in (("STIF1", model.stiffness), ("MASS1", model.mass)):
        path = folder / f"job_{part}.mtx"
        write.write_abaqus(path, matrix, model.dof_node, model.dof_direction, triangle)


def punch(folder: Path, model: Model, fields: str, form: int) -> None:
    matrices = {"KAAX": model.stiffness, "MAAX": model.mass}
    write.write_dmig(folder / "job.pch", matrices, model.dof_node, model.dof_direction, fields, form)


def market(path: Path, matrix: sparse.csr_matrix, symmetry: str) -> None:
    scipy.io.mmwrite(path, matrix, symmetry=symmetry, precision=17)


def petsc(path: Path, matrix: sparse.csr_matrix) -> None:
    path.write_bytes(write.petsc_bytes(matrix))


def calculix(folder: Path, model: Model) -> None:
    write.write_calculix(folder / "job", model.stiffness, model.mass)
    write.write_dofs(folder / "job.dof", model.dof_node, model.dof_direction)


def files(name: str, **others: str) -> dict[str, str]:
    """What to read of files named after K and M."""
    return {"stiffness": name.format("K"), "mass": name.format("M")} | others


FORMATS = {
    "CalculiX": Format(calculix, {"calculix_job": "job", "mesh": "mesh.inp"}, 14),
    "Abaqus, lower triangle": Format(named(abaqus, "lower"), {"abaqus_job": "job", "mesh": "mesh.inp"}, 15),
    "Abaqus, both triangles": Format(named(abaqus, "both"), {"abaqus_job": "job", "mesh": "mesh.inp"}, 15),
    "Abaqus, coordinates": Format(
        each(write.write_abaqus_coordinate, "{}.mtx"), files("{}.mtx", dofs="rows.dof", mesh="mesh.inp")
    ),
    "ANSYS, Harwell-Boeing": Format(
        each(write.write_harwell_boeing, "{}.hb"), files("{}.hb", dofs="rows.mapping", mesh="mesh.cdb")
    ),
    "ANSYS, unsymmetric Harwell-Boeing": Format(
        each(write.write_harwell_boeing, "{}.hb", False), files("{}.hb", dofs="rows.mapping", mesh="mesh.cdb")
    ),
    "ANSYS, Matrix Market": Format(
        each(market, "{}.mmf.mtx", "symmetric"), files("{}.mmf.mtx", dofs="rows.mapping", mesh="mesh.cdb")
    ),
    "Nastran punch": Format(named(punch, "large", 6), {"nastran_file": "job.pch", "mesh": "mesh.bdf"}, 10),
    "Nastran punch, square": Format(named(punch, "large", 1), {"nastran_file": "job.pch", "mesh": "mesh.bdf"}, 10),
    "Nastran free fields": Format(named(punch, "free", 6), {"nastran_file": "job.pch", "mesh": "mesh.bdf"}),
    "Nastran OUTPUT4, text": Format(
        together(write.write_op4_text, "job.op4", "KAA", "MAA", "sparse"),
        {"nastran_file": "job.op4", "dofs": "rows.dof", "mesh": "mesh.bdf"},
    ),
    "Nastran OUTPUT4, binary": Format(
        together(write.write_op4_binary, "job.op4", "KAA", "MAA", "bigmat", ">"),
        {"nastran_file": "job.op4", "dofs": "rows.dof", "mesh": "mesh.bdf"},
    ),
    "Matrix Market": Format(each(market, "{}.mtx", "general"), files("{}.mtx", dofs="rows.dof", mesh="mesh.inp")),
    "PETSc": Format(each(petsc, "{}.petsc"), files("{}.petsc", dofs="rows.dof", mesh="mesh.inp")),
    "SciPy npz": Format(each(sparse.save_npz, "{}.npz"), files("{}.npz", dofs="rows.dof", mesh="mesh.inp")),
    "MATLAB 5": Format(
        together(write.write_matlab, "job.mat", "K", "M"),
        {"stiffness": "job.mat:K", "mass": "job.mat:M", "dofs": "rows.dof", "mesh": "mesh.inp"},
    ),
    "MATLAB 7.3": Format(
        together(write.write_matlab_73, "job.mat", "K", "M"),
        {"stiffness": "job.mat:K", "mass": "job.mat:M", "dofs": "rows.dof", "mesh": "mesh.inp"},
    ),
}
EXACT = [name for name, one in FORMATS.items() if one.digits == 17]
PRINTED = [name for name, one in FORMATS.items() if one.digits < 17]


def imported(blade: tuple[Path, Model], name: str, monkeypatch: pytest.MonkeyPatch) -> Model:
    folder, model = blade
    monkeypatch.chdir(folder)
    FORMATS[name].write(folder, model)
    read, _ = import_model(folder / "read.h5", **FORMATS[name].read)
    assert np.array_equal(read.dof_node, model.dof_node)
    assert np.array_equal(read.dof_direction, model.dof_direction)
    assert np.array_equal(read.node_ids, model.node_ids)
    assert np.array_equal(read.elements["C3D10"][1], model.elements["C3D10"][1])
    assert sorted(map(tuple, read.node_sets.values())) == sorted(map(tuple, model.node_sets.values()))
    return read


def reduced(path: Path, model: Model) -> dict[str, np.ndarray]:
    """The reduced model of a file onto the flanks of the root."""
    made = path.with_name("rom.h5")
    flanks = np.concatenate([model.node_sets[name] for name in ("root_left", "root_right", "slot_left", "slot_right")])
    boundary = np.flatnonzero(np.isin(model.dof_node, flanks))
    # SCOTCH draws random numbers that go on from one reduction of a process to the next: not the same to the last bit.
    reduce_model(MPI.COMM_WORLD, path, made, boundary, Options(modes=10, ordering="pord"))
    with h5py.File(made) as file:
        return {name: file[name][()] for name in ("mass", "stiffness", "modes/frequency_hz")}


def matrices_in(path: Path) -> dict[str, np.ndarray]:
    """All that a reduction reads of a model's file."""
    with h5py.File(path) as file:
        return {f"{part}/{name}": file[part][name][()] for part in ("stiffness", "mass") for name in file[part]}


@pytest.fixture(scope="module")
def reference(blade) -> Path:
    """The model's file as it is written without a detour."""
    from attrito.model.model_file import write_model

    folder, model = blade
    write_model(folder / "reference.h5", model, [])
    return folder / "reference.h5"


@pytest.mark.parametrize("name", EXACT)
def test_files_with_all_digits_give_the_same_matrices(blade, reference, name, monkeypatch):
    folder, model = blade
    read = imported(blade, name, monkeypatch)
    for given, got in ((model.stiffness, read.stiffness), (model.mass, read.mass)):
        assert np.array_equal(given.indptr, got.indptr) and np.array_equal(given.indices, got.indices)
        assert np.array_equal(given.data, got.data)
    # So every reduction of it is the same, too.
    written, expected = matrices_in(folder / "read.h5"), matrices_in(reference)
    assert list(written) == list(expected) and len(expected) == 6
    for part, values in expected.items():
        assert np.array_equal(written[part], values), part


def test_a_model_that_was_read_gives_the_same_reduced_model(blade, reference, monkeypatch):
    folder, model = blade
    imported(blade, "Nastran OUTPUT4, binary", monkeypatch)
    rom = reduced(folder / "read.h5", model)
    for part, expected in reduced(reference, model).items():
        assert np.array_equal(rom[part], expected), part


@pytest.fixture(scope="module")
def reference_modes(blade) -> tuple[np.ndarray, np.ndarray]:
    return elastic_modes(blade[1])


def elastic_modes(model: Model) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues and modes above the six rigid motions of the floating blade."""
    values, modes = eigsh(model.stiffness.tocsc(), 16, model.mass.tocsc(), sigma=-1.0e6)
    order = np.argsort(values)[6:]
    return values[order], modes[:, order]


@pytest.mark.parametrize("name", PRINTED)
def test_files_with_fewer_digits_give_what_they_print(blade, reference_modes, name, monkeypatch):
    _, model = blade
    read = imported(blade, name, monkeypatch)
    # Half a unit in the last digit printed, of a number as small as its first digit allows.
    precision = 0.5 * 10.0 ** (1 - FORMATS[name].digits)
    for given, got in ((model.stiffness, read.stiffness), (model.mass, read.mass)):
        assert np.array_equal(given.indptr, got.indptr) and np.array_equal(given.indices, got.indices)
        # The decimal written and the double read are each rounded once more.
        assert np.all(np.abs(got.data - given.data) <= (precision + 2.0e-16) * np.abs(given.data))
    values, modes = reference_modes
    got_values, got_modes = elastic_modes(read)
    change = np.abs(np.sqrt(got_values / values) - 1.0)
    # To first order |d lambda| <= |phi|^T (|dK| + lambda |dM|) |phi|: a slender model loses many digits.
    lost = [
        abs(phi) @ (abs(model.stiffness) + value * abs(model.mass)) @ abs(phi)
        for value, phi in zip(values, modes.T, strict=True)
    ]
    bound = precision * np.array(lost) / (2.0 * values)
    assert np.all(change <= 1.01 * bound + 1.0e-9)
    if FORMATS[name].digits > 10:
        assert change.max() < 1.0e-8
    # Up to sign, and to the subspace of all of them.
    overlap = np.abs(np.einsum("ij,ij->j", got_modes, model.mass @ modes))
    assert overlap == pytest.approx(np.ones(len(overlap)), abs=1.0e-6)
    assert subspace_angles(got_modes, modes).max() < 1.0e-3


def test_ten_digits_of_a_punch_keep_frequencies_of_a_stout_block_to_eight_digits(tmp_path):
    # A floating, slender blade loses more, as its bound to first order tells above; for a block on a wall that is 3e-8.
    given, points = elastic_block((3, 3, 3), (0.02, 0.02, 0.02), lambda points: points[:, 2] < 1e-9)
    node, direction = np.repeat(np.arange(1, len(points) + 1), 3), np.tile([1, 2, 3], len(points))
    write.write_dmig(tmp_path / "job.pch", {"KAAX": given.stiffness, "MAAX": given.mass}, node, direction, "large")
    read, _ = import_model(tmp_path / "model.h5", nastran_file=tmp_path / "job.pch")
    assert not np.array_equal(read.stiffness.toarray(), given.stiffness.toarray())
    values, got = (eigh(model.stiffness.toarray(), model.mass.toarray(), eigvals_only=True) for model in (given, read))
    assert np.abs(np.sqrt(got / values) - 1.0).max() < 1.0e-8


@pytest.mark.parametrize("name", ["Abaqus, both triangles", "Nastran punch", "Nastran OUTPUT4, text", "CalculiX"])
def test_files_are_the_same_in_blocks_of_any_size(blade, name, monkeypatch):
    whole = imported(blade, name, monkeypatch)
    monkeypatch.setattr(text, "BLOCK_BYTES", 5003)
    monkeypatch.setattr(entries, "CHUNK", 977)
    monkeypatch.setattr(entries, "BUFFER", 7919)
    parts = imported(blade, name, monkeypatch)
    for a, b in ((whole.stiffness, parts.stiffness), (whole.mass, parts.mass)):
        assert np.array_equal(a.indptr, b.indptr) and np.array_equal(a.indices, b.indices)
        assert np.array_equal(a.data, b.data)
