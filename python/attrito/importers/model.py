"""From other programs' files to model.h5."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from attrito.faults import Fault, InputError
from attrito.importers import calculix
from attrito.importers.check import check_matrices
from attrito.importers.matrix import read_matrix
from attrito.importers.mesh import Mesh, read_mesh
from attrito.importers.prestress import check_holdings, hold
from attrito.model_file import Model, write_model


def import_model(
    output: str | Path,
    *,
    calculix_job: str | Path | None = None,
    mesh: str | Path | None = None,
    stiffness: str | Path | None = None,
    mass: str | Path | None = None,
    damping: str | Path | None = None,
    dofs: str | Path | None = None,
    holds: Sequence[str] = (),
    spin_hz: float | None = None,
    geometric_stiffness: str | Path | None = None,
) -> tuple[Model, list[str]]:
    """Read matrices and mesh, check them, and write model.h5.

    Parameters
    ----------
    output : the model file to write
    calculix_job : CalculiX's files without their ending: `job` for job.sti, job.mas and job.dof
    mesh : CalculiX or Abaqus deck with nodes, elements and node sets; needed with `calculix_job`
    stiffness, mass, damping : matrix files instead of `calculix_job` (damping also beside it)
    dofs : file with a line `node.direction` for each row of the matrices; needed for matrix files with a mesh
    holds : what the stiffness holds already: `stress_stiffening`, `spin_softening`
    spin_hz : speed of the rotation that it comes from
    geometric_stiffness : matrix file with the stress stiffening, to be added to the stiffness

    Returns
    -------
    the model, and notes for the user: numbers of dofs and nodes, total mass, node sets with their sizes
    """
    check_holdings(holds, spin_hz, geometric_stiffness is not None)
    if calculix_job is not None:
        dofs = f"{calculix_job}.dof"
    if (mesh is None) != (dofs is None):
        known, absent = ("dofs", "mesh") if mesh is None else ("mesh", "dofs")
        raise InputError(Fault("import", absent, "missing", f"a file that goes with {known}: which row is which node"))
    if calculix_job is not None:
        files = {"stiffness": f"{calculix_job}.sti", "mass": f"{calculix_job}.mas"}
        node, direction = calculix.read_dofs(dofs)
        matrices = {name: calculix.read_matrix(path, len(node)) for name, path in files.items()}
    else:
        given = {"stiffness": stiffness, "mass": mass}
        missing = [Fault("import", name, "missing", "a matrix file") for name, path in given.items() if path is None]
        if missing:
            raise InputError(*missing)
        files = {name: str(path) for name, path in given.items()}
        node, direction = calculix.read_dofs(dofs) if dofs is not None else (None, None)
        matrices = {name: read_matrix(path, name, "import") for name, path in files.items()}
    if damping is not None:
        files["damping"] = str(damping)
        matrices["damping"] = read_matrix(damping, "damping", "import")
    geometric = None
    if geometric_stiffness is not None:
        geometric = read_matrix(geometric_stiffness, "geometric stiffness", "import")

    def label(dof: int) -> str:
        if node is None or dof >= len(node):
            return f"dof {dof}"
        return f"dof {dof}, node {node[dof]} {'xyz'[direction[dof] - 1]}"

    faults = check_matrices(matrices["stiffness"], matrices["mass"], matrices.get("damping"), files, label)
    size = matrices["stiffness"].shape[0]
    if geometric is not None:
        files["geometric_stiffness"] = str(geometric_stiffness)
        faults += check_matrices(
            geometric, matrices["mass"], None, files | {"stiffness": str(geometric_stiffness)}, label
        )
    if node is not None and len(node) != size:
        faults.append(
            Fault(str(dofs), "file", f"{len(node)} dofs", f"one for each of the {size} rows of the stiffness")
        )
    read = None if mesh is None else read_mesh(mesh)
    if read is not None:
        faults += _stray_nodes(node, str(dofs), str(mesh), read)
    if faults:
        raise InputError(*faults)

    model = Model(matrices["stiffness"], matrices["mass"], matrices.get("damping"), node, direction)
    sources = list(files.values())
    if read is not None:
        model.node_ids, model.coordinates = read.node_ids, read.coordinates
        model.elements, model.node_sets = read.elements, read.node_sets
        sources += [str(dofs), *map(str, read.files)]
    held = hold(model, holds, spin_hz, geometric)
    write_model(output, model, sources)
    notes = _notes(model) + held
    if read is not None and read.constraints:
        named = "; ".join(read.constraints)
        notes.append(
            f"the mesh file makes dofs depend on others ({named}): those are not in the matrices, and count as 0"
        )
    return model, notes


def _stray_nodes(node: np.ndarray, dofs: str, mesh: str, read: Mesh) -> list[Fault]:
    stray = np.setdiff1d(node, read.node_ids)
    if len(stray) == 0:
        return []
    return [Fault(dofs, "file", f"node {stray[0]} ({len(stray)} such nodes)", f"nodes of the mesh {mesh}")]


def _notes(model: Model) -> list[str]:
    notes = [f"{model.size} dofs, {model.stiffness.nnz} entries of stiffness, {model.mass.nnz} of mass"]
    if not model.has_mesh:
        return notes
    along_x = (model.dof_direction == 1).astype(float)
    mass = along_x @ model.mass @ along_x
    notes.append(
        f"{len(model.node_ids)} nodes, {len(np.unique(model.dof_node))} of them free, with a mass of {mass:.6g}"
    )
    notes += [f"{len(ids)} elements {kind}" for kind, (ids, _) in model.elements.items()]
    notes += [f"node set {name}: {len(ids)} nodes" for name, ids in model.node_sets.items()]
    return notes
