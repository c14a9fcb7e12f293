"""Good input of every kind, each with the command that reads it: what `fuzz.py` spoils."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path

import matrix_writers as write
import meshio
import numpy as np
import scipy.io
import scipy.sparse as sparse
from gmsh_writer import POINTS, TAGS, gmsh
from jobs import attrito, blocks, wedge, write_blocks, write_job

LAWS = ("friction_coefficient", "normal_stiffness")
DATA = Path(__file__).parent / "data"


@dataclass(frozen=True)
class Source:
    """Good input: a folder, the command on it, and the file of it to spoil, as `kind`."""

    folder: Path
    arguments: tuple[str, ...]
    spoilt: str
    kind: str


def sources(folder: Path) -> list[Source]:
    """Good input of every kind, made in a folder."""
    found = [*_jobs(folder), *_matrices(folder), *_decks(folder), *_meshes(folder), *_superelements(folder)]
    return [*found, *_stored(folder)]


def _jobs(folder: Path) -> list[Source]:
    (folder / "wedge").mkdir()
    write_job(folder / "wedge", wedge())
    (folder / "blocks").mkdir()
    write_blocks(folder / "blocks" / "model.h5")
    write_job(folder / "blocks", blocks())
    run = ("run", "job.toml")
    (folder / "study").mkdir()
    job = wedge(force=1.0)
    job["sweep"], job["peak"] = {"start_hz": 150.0, "stop_hz": 85.0}, {"start": 10.0, "stop": 10.5}
    job["balance"] = {"harmonics": 3}
    write_job(folder / "study", job)
    vary = [{"name": key, "keys": [f"contact[*].{key}"], "low": 1.0, "high": 1.1, "factor": True} for key in LAWS]
    write_job(folder / "study", {"job": "job.toml", "samples": 2, "vary": vary}, "study.toml")
    study = ("study", "study.toml")
    return [
        Source(folder / "study", study, "study.toml", "text"),
        Source(folder / "study", study, "job.toml", "job"),
        Source(folder / "study", ("peak", "job.toml"), "job.toml", "job"),
        Source(folder / "wedge", run, "job.toml", "job"),
        Source(folder / "blocks", run, "job.toml", "job"),
        Source(folder / "wedge", ("integrate", "job.toml"), "job.toml", "job"),
        Source(folder / "wedge", run, "job.toml", "text"),
    ]


def _matrices(folder: Path) -> list[Source]:
    """A matrix in every format, as the stiffness of a job."""
    matrix = sparse.csr_matrix(np.array([[4.0e5, -1.0e4, 0.0], [-1.0e4, 2.5e6, 0.0], [0.0, 0.0, 1.0e6]]))
    node, direction = np.array([1, 1, 2]), np.array([1, 2, 1])
    place = folder / "matrices"
    place.mkdir()
    scipy.io.mmwrite(place / "K.mtx", matrix, symmetry="symmetric")
    sparse.save_npz(place / "K.npz", matrix)
    write.write_matlab(place / "K.mat", {"K": matrix})
    write.write_matlab_73(place / "K73.mat", {"K": matrix})
    write.write_harwell_boeing(place / "K.hb", matrix)
    (place / "K.petsc").write_bytes(write.petsc_bytes(matrix))
    write.write_op4_text(place / "K.op4", {"KAA": matrix}, "sparse")
    write.write_abaqus(place / "K_STIF1.mtx", matrix, node, direction)
    for name in ("two_springs.pch", "two_springs_small.bdf"):
        shutil.copy(DATA / name, place)
    np.save(place / "unused.npy", np.eye(2))
    return [
        Source(place, ("import", "out.h5", "--stiffness", name, "--mass", "K.mtx"), name.split(":")[0], kind)
        for name, kind in (
            ("K.mtx", "text"), ("K.npz", "bytes"), ("K.mat", "bytes"), ("K73.mat", "bytes"), ("K.hb", "text"),
            ("K.petsc", "bytes"), ("K.op4", "text"), ("K_STIF1.mtx", "text"), ("two_springs.pch:KAAX", "text"),
        )
    ]  # fmt: skip


def _decks(folder: Path) -> list[Source]:
    """Models with mesh and dofs."""
    place = folder / "decks"
    shutil.copytree(DATA, place)
    springs = "two_springs"
    calculix = ("import", "out.h5", "--calculix", springs)
    ansys = ("--stiffness", f"{springs}_stiffness.hb", "--mass", f"{springs}_mass.hb", "--dofs", f"{springs}.mapping")
    abaqus = ("import", "out.h5", "--abaqus", springs, "--mesh", f"{springs}.inp")
    nastran = ("import", "out.h5", "--nastran")
    return [
        *(
            Source(place, (*calculix, "--mesh", f"{springs}.inp"), f"{springs}{end}", "text")
            for end in (".sti", ".mas", ".dof", ".inp")
        ),
        *(Source(place, abaqus, f"{springs}{end}", "text") for end in ("_STIF1.mtx", "_MASS1.mtx", ".inp")),
        *(
            Source(place, ("import", "out.h5", *ansys, "--mesh", f"{springs}.cdb"), f"{springs}{end}", "text")
            for end in ("_stiffness.hb", ".mapping", ".cdb")
        ),
        Source(place, (*nastran, f"{springs}.pch", "--mesh", f"{springs}_mesh.bdf"), f"{springs}.pch", "text"),
        Source(place, (*nastran, f"{springs}.pch", "--mesh", f"{springs}_mesh.bdf"), f"{springs}_mesh.bdf", "text"),
        Source(place, (*nastran, f"{springs}.op4", "--dofs", f"{springs}.aset"), f"{springs}.op4", "text"),
        Source(place, (*nastran, f"{springs}.op4", "--dofs", f"{springs}.aset"), f"{springs}.aset", "text"),
    ]  # fmt: skip


def _meshes(folder: Path) -> list[Source]:
    """Meshes of gmsh and of meshio beside matrices."""
    place = folder / "meshes"
    place.mkdir()
    scipy.io.mmwrite(place / "K.mtx", sparse.csr_matrix(np.diag([4.0, 3.0])), symmetry="symmetric")
    (place / "rows.dof").write_text(f"{TAGS[0]}.1\n{TAGS[19]}.3\n")
    (place / "places.dof").write_text("1.1\n20.3\n")
    found = []
    for version, binary in (("2.2", False), ("2.2", True), ("4.1", False), ("4.1", True)):
        name = f"mesh{version[0]}{'b' * binary}.msh"
        (place / name).write_bytes(gmsh(version, binary))
        found.append((name, "rows.dof", "bytes" if binary else "text"))
    for name, kind in (("mesh.med", "hdf5"), ("mesh.vtu", "text"), ("mesh.vtk", "bytes")):
        meshio.write_points_cells(place / name, POINTS, [("hexahedron20", np.arange(20)[None])])
        found.append((name, "places.dof", kind))
    matrices = ("import", "out.h5", "--stiffness", "K.mtx", "--mass", "K.mtx")
    return [Source(place, (*matrices, "--dofs", dofs, "--mesh", name), name, kind) for name, dofs, kind in found]


def _superelements(folder: Path) -> list[Source]:
    """Reduced models of Nastran and Abaqus, with generalised coordinates."""
    place = folder / "superelements"
    place.mkdir()
    matrix = sparse.csr_matrix(np.array([[4.0, -1.0, 0.5], [-1.0, 3.0, 0.0], [0.5, 0.0, 9.0]]))
    write.write_dmig(place / "job.pch", {"KAAX": matrix, "MAAX": matrix}, np.array([7, 7, 1001]), np.array([1, 2, 0]))
    write.write_op4_text(place / "job.op4", {"KAA": matrix, "MAA": matrix}, "dense")
    (place / "job.aset").write_text(
        "GRID           7              1.      2.      3.\nEXTRN          7      12    1001       0\n"
    )
    values = ", ".join(str(value) for value in matrix.toarray()[np.tril_indices(3)])
    blocks = "".join(f"*MATRIX, TYPE={kind}\n{values}\n" for kind in ("STIFFNESS", "MASS"))
    (place / "sub.mtx").write_text(f"*USER ELEMENT, NODES=2, LINEAR\n** ELEMENT NODES\n** 7, -1\n1, 2\n2, 1\n{blocks}")
    nastran = ("import", "out.h5", "--nastran")
    return [
        Source(place, (*nastran, "job.pch"), "job.pch", "text"),
        *(Source(place, (*nastran, "job.op4", "--dofs", "job.aset"), name, "text") for name in ("job.op4", "job.aset")),
        Source(place, ("import", "out.h5", "--abaqus", "sub.mtx"), "sub.mtx", "text"),
    ]


def _stored(folder: Path) -> list[Source]:
    """What the program itself has written: model, reduced model, result and journal."""
    place = folder / "stored"
    shutil.copytree(folder / "blocks", place)
    attrito(place, "run", "job.toml")
    shutil.copytree(folder / "wedge", folder / "cut")
    job = wedge() | {"sweep": {"frequencies_hz": [131.0, 132.0, 133.0]}}
    write_job(folder / "cut", job)
    attrito(folder / "cut", "run", "job.toml", "--max-seconds", "1e-9")
    result = "result.h5"
    return [
        *(Source(place, ("run", "job.toml"), "model.h5", kind) for kind in ("hdf5", "bytes")),
        *(Source(place, ("run", "job.toml"), "rom.h5", kind) for kind in ("hdf5", "bytes")),
        *(Source(place, ("info", name), name, kind) for name in ("model.h5", "rom.h5") for kind in ("hdf5", "bytes")),
        *(
            Source(place, (*command, result), result, kind)
            for command in (
                ("table",), ("table", "--contacts"), ("plot",), ("plot", "--loops"), ("plot", "--map"), ("export",),
                ("report",),
            )
            for kind in ("hdf5", "bytes")
        ),
        *(
            Source(place, ("export", name, "--matrices", "abaqus", "-o", "out"), name, kind)
            for name in ("model.h5", "rom.h5")
            for kind in ("hdf5", "bytes")
        ),
        Source(folder / "cut", ("table", f"{result}.partial"), f"{result}.partial", "bytes"),
        Source(folder / "cut", ("run", "--resume", "job.toml"), f"{result}.partial", "bytes"),
    ]  # fmt: skip
