"""From other programs' files to model.h5."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from attrito.importers.calculix import read_calculix
from attrito.importers.check import check_matrices, lost_diagonals, massless
from attrito.importers.deck_mesh import AT_NODES
from attrito.importers.dof_file import names_cards, read_dof_file
from attrito.importers.dof_numbers import DofNumbers
from attrito.importers.fe_jobs import abaqus_matrices, nastran_matrices
from attrito.importers.first_look import first_look
from attrito.importers.lost_lines import lost_lines
from attrito.importers.matrices import Matrices, assemble
from attrito.importers.matrix import open_matrix, split_name
from attrito.importers.mesh import Mesh, read_mesh
from attrito.importers.nastran_mesh import read_axes
from attrito.importers.prestress import check_holdings, hold
from attrito.importers.source import Source
from attrito.importers.turning import turn
from attrito.job.checks import DIRECTIONS
from attrito.model.held_mass import other_mass
from attrito.model.model import Model
from attrito.model.model_file import write_model
from attrito.model.rigidity import resisted_rotation
from attrito.support.errors import Fault, InputError
from attrito.support.overwrite_check import check_spared


def import_model(
    output: str | Path,
    *,
    calculix_job: str | Path | None = None,
    abaqus_job: str | Path | None = None,
    nastran_file: str | Path | None = None,
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
    abaqus_job : Abaqus's files without their ending: `job` for job_STIF1.mtx, job_MASS1.mtx and the like; or the file
        of a substructure, which holds all
    nastran_file : punch, bulk data or OUTPUT4 file with the matrices
    mesh : file with nodes, elements and node sets; needed with `calculix_job`
    stiffness, mass, damping : matrix files, or `FILE:NAME`, instead of a job's (damping also beside it)
    dofs : file that says which row is which dof, where the matrix files do not; needed for those with a mesh
    holds : what the stiffness holds already: `stress_stiffening`, `spin_softening`
    spin_hz : speed of the rotation that it comes from
    geometric_stiffness : matrix file, or `FILE:NAME`, with the stress stiffening, to be added to the stiffness

    Returns
    -------
    the model, and notes for the user: numbers of dofs and nodes, total mass, extents, first natural
    frequencies, node sets with their sizes
    """
    check_holdings(holds, spin_hz, geometric_stiffness is not None)
    files = {name: file for name, file in (("stiffness", stiffness), ("mass", mass), ("damping", damping)) if file}
    _check_one_source({"calculix": calculix_job, "abaqus": abaqus_job, "nastran": nastran_file}, files)
    numbers = DofNumbers()
    read: dict[str, Source] = {}
    notes: list[str] = []
    known_dofs = None
    if calculix_job is not None:
        dofs = f"{calculix_job}.dof"
        read, known_dofs = _calculix_matrices(calculix_job, dofs, mesh)
    elif abaqus_job is not None:
        of_job, read = abaqus_matrices(abaqus_job, numbers)
        files = of_job | files
    elif nastran_file is not None:
        read, notes = nastran_matrices(nastran_file, numbers)
    if not read:
        missing = [name for name in ("stiffness", "mass") if name not in files]
        if missing:
            raise InputError(*(Fault("import", name, "missing", "a matrix file") for name in missing))
    if dofs is not None and known_dofs is None:
        known_dofs = read_dof_file(dofs)
    if geometric_stiffness is not None:
        files["geometric stiffness"] = geometric_stiffness
    for name, file in files.items():
        read[name] = open_matrix(file, name, "import", numbers)
    if mesh is not None and known_dofs is None and any(source.numbers is None for source in read.values()):
        raise InputError(Fault("import", "dofs", "missing", "a file that goes with mesh: which row is which node"))
    model, found = _model(output, read, numbers, known_dofs, dofs, mesh, holds, spin_hz)
    return model, found + notes


def _check_one_source(jobs: dict[str, str | Path | None], files: dict[str, str | Path]) -> None:
    """Raise where matrices come from two jobs, or from a job and from files."""
    given = [name for name, job in jobs.items() if job is not None]
    matrices = [name for name in ("stiffness", "mass") if name in files]
    if len(given + matrices[:1]) > 1:
        other = [*given, *matrices][1]
        raise InputError(Fault("import", other, "given", f"one source of matrices: {given[0]} is given, too"))


def _calculix_matrices(
    job: str | Path, dofs: str, mesh: str | Path | None
) -> tuple[dict[str, Source], tuple[np.ndarray, np.ndarray]]:
    """Stiffness and mass of a job of CalculiX, and node and direction of each row."""
    if mesh is None:
        raise InputError(Fault("import", "mesh", "missing", "a file that goes with dofs: which row is which node"))
    known_dofs = read_dof_file(dofs)
    thermal = known_dofs[0][known_dofs[1] == 0]
    if len(thermal):
        expected = "displacements: the matrices of a mechanical step"
        raise InputError(Fault(dofs, "file", f"{thermal[0]}.0, a temperature", expected))
    return read_calculix(job, len(known_dofs[0])), known_dofs


def _model(
    output: str | Path,
    read: dict[str, Source],
    numbers: DofNumbers,
    known_dofs: tuple[np.ndarray, np.ndarray] | None,
    dofs: str | Path | None,
    mesh: str | Path | None,
    holds: Sequence[str],
    spin_hz: float | None,
) -> tuple[Model, list[str]]:
    """Assemble, check, write."""
    where = {name: source.path for name, source in read.items()}
    parts = assemble(read, numbers, known_dofs, str(dofs or ""))
    matrices = parts.matrices
    nodes = None if mesh is None else read_mesh(mesh, skip=not str(where["stiffness"]).endswith(".sti"))
    if nodes is not None and parts.node is not None:
        # What CalculiX numbers 1 to 3 at these nodes are no displacements.
        parts.direction = np.where(np.isin(parts.node, nodes.angles), parts.direction + 3, parts.direction)
        parts.direction[np.isin(parts.node, nodes.elongations)] = 0
    turned = _turned(parts, dofs, mesh, nodes)

    def label(dof: int) -> str:
        return dof_label(dof, parts)

    faults = check_matrices(matrices["stiffness"], matrices["mass"], matrices.get("damping"), where, label)
    if not faults and not holds:
        faults = lost_diagonals(matrices["stiffness"], str(where["stiffness"]), label)
    size = matrices["stiffness"].shape[0]
    geometric = matrices.get("geometric stiffness")
    if geometric is not None:
        at = where | {"stiffness": where["geometric stiffness"]}
        faults += check_matrices(geometric, matrices["mass"], None, at, label)
    if parts.node is not None and len(parts.node) != size:
        expected = f"one for each of the {size} rows of the stiffness"
        faults.append(Fault(str(dofs), "file", f"{len(parts.node)} dofs", expected))
    if nodes is not None:
        faults += _stray_nodes(parts.node, parts.direction, str(dofs or where["stiffness"]), str(mesh), nodes)
    if faults:
        raise InputError(*faults)
    model = Model(matrices["stiffness"], matrices["mass"], matrices.get("damping"), parts.node, parts.direction)
    files = [split_name(path)[0] for path in where.values()] + ([] if dofs is None else [str(dofs)])
    if nodes is not None:
        model.node_ids, model.coordinates = nodes.node_ids, nodes.coordinates
        model.elements, model.node_sets = nodes.elements, nodes.node_sets
        model.elastic, model.density, model.load_axes = nodes.elastic, nodes.density, nodes.load_axes
        model.point_mass = nodes.point_mass or {}
        model.undisplaced = np.intersect1d(nodes.node_ids, np.append(nodes.angles, nodes.elongations))
        model.dependent = _dependent(parts, nodes)
        files += map(str, nodes.files)
    faults, doubts = ([], []) if holds else lost_lines(model, where, label)
    if faults:
        raise InputError(*faults)
    check_spared("import", "output", [output], files)
    held = hold(model, holds, spin_hz, geometric)
    write_model(output, model, list(dict.fromkeys(files)))
    said = [resisted_rotation(model), None if nodes is None else other_mass(model, nodes.held, _lacks_mass(nodes))]
    warnings = [f"warning: {what}" for what in said if what is not None]
    return model, _notes(model) + first_look(model) + turned + held + doubts + parts.notes + _mesh_notes(
        nodes
    ) + warnings


def _lacks_mass(mesh: Mesh) -> bool:
    """Whether what was left out of a mesh may have mass that is not known."""
    massless = tuple(f"elements of type {kind}" for kind in AT_NODES if kind != "MASS" or mesh.point_mass is not None)
    return any(not what.startswith(massless) for what in mesh.skipped)


def _dependent(parts: Matrices, mesh: Mesh) -> np.ndarray:
    """Nodes and directions `[k, 2]` that neither a row of the matrices nor a support has: they depend on others."""
    if not mesh.constraints:
        return np.empty((0, 2), np.int64)
    nodes = np.setdiff1d(mesh.node_ids, np.append(mesh.angles, mesh.elongations)).astype(np.int64)
    known = np.concatenate([np.column_stack([parts.node, parts.direction]), mesh.held]).astype(np.int64)
    all_three = 8 * np.repeat(nodes, 3) + np.tile([1, 2, 3], len(nodes))
    left = np.setdiff1d(all_three, 8 * known[:, 0] + known[:, 1])
    return np.column_stack([left // 8, left % 8])


def _turned(parts: Matrices, dofs: str | Path | None, mesh: str | Path | None, nodes: Mesh | None) -> list[str]:
    """Matrices turned to global directions where grid points move along axes of their own; a note on that."""
    if parts.node is None or any(matrix.shape != (len(parts.node),) * 2 for matrix in parts.matrices.values()):
        return []
    axes = {} if dofs is None or not names_cards(dofs) else read_axes(dofs)
    count = turn(
        parts.matrices, parts.node, parts.direction, axes | ({} if nodes is None else nodes.axes), str(mesh or dofs)
    )
    return [f"{count} nodes with displacements along axes of their own (CD): turned to x, y, z"] if count else []


def dof_label(dof: int, parts: Matrices) -> str:
    """A dof as its number and, if it has one, its node and direction."""
    if parts.node is None or dof >= len(parts.node):
        return f"dof {dof}"
    direction = next(name for name, number in DIRECTIONS.items() if number == parts.direction[dof])
    return f"dof {dof}, node {parts.node[dof]} {direction}"


def _stray_nodes(node: np.ndarray, direction: np.ndarray, dofs: str, mesh: str, read: Mesh) -> list[Fault]:
    """Nodes with dofs in space that the mesh does not have."""
    stray = np.setdiff1d(node[direction > 0], read.node_ids)
    if len(stray) == 0:
        return []
    remedy = "do matrices and mesh belong together? elements C3D8I add nodes of their own: use C3D8, C3D10 or C3D20"
    if any(what.startswith(("*RIGID BODY", "*COUPLING")) for what in read.constraints):
        remedy = (
            "a *COUPLING, and a *RIGID BODY without REF NODE and ROT NODE, add nodes of their own: take a *RIGID BODY"
            " and name both, with lines under *NODE"
        )
    if any(re.match("elements of type (S(?!PRING)|B|CPS|CPE|M3D|T3D)", what) for what in read.skipped):
        remedy = "CalculiX expands shells, beams and plane elements to solids with nodes of their own: use solids"
    expected = f"nodes of the mesh {mesh} ({remedy})"
    return [Fault(dofs, "file", f"node {stray[0]} ({len(stray)} such nodes)", expected)]


def _notes(model: Model) -> list[str]:
    notes = [f"{model.size} dofs, {model.stiffness.nnz} entries of stiffness, {model.mass.nnz} of mass"]
    bare = massless(model.mass)
    if len(bare):
        turning = 0 if model.dof_direction is None else int(np.count_nonzero(model.dof_direction[bare] > 3))
        notes.append(
            f"dofs without mass: {len(bare)}, {turning} of them rotations; a job needs [reduction], in which they"
            " follow the others statically"
        )
    if not model.names_dofs:
        return notes
    along_x = (model.dof_direction == 1).astype(float)
    mass = along_x @ (model.mass @ along_x)
    free = len(np.unique(model.dof_node[model.dof_direction > 0]))
    if model.has_mesh:
        notes.append(f"{len(model.node_ids)} nodes, {free} of them free, with a mass of {mass:.6g}")
    else:
        notes.append(f"{free} nodes, with a mass of {mass:.6g}; no mesh: dofs by node and direction, no node sets")
    rotations = int(np.count_nonzero(model.dof_direction > 3))
    if rotations:
        notes.append(f"{rotations} of the dofs are rotations")
    generalised = int(np.count_nonzero(model.dof_direction == 0))
    if generalised:
        notes.append(f'{generalised} of the dofs are generalised coordinates: ["node", number, "q"] in a job')
    notes += [f"{len(ids)} elements {kind}" for kind, (ids, _) in model.elements.items()]
    if model.has_mesh and not any(len(ids) for ids, _ in model.elements.values()):
        notes.append(
            "no solid elements in the mesh: contacts go by nodes alone, without faces and areas, and nothing is drawn"
        )
    known = sum(int(np.count_nonzero(~np.isnan(one).any(axis=1))) for one in model.elastic.values())
    if known:
        notes.append(f"elastic constants of {known} elements, for `attrito stress`")
    notes += [f"node set {name}: {len(ids)} nodes" for name, ids in model.node_sets.items()]
    return notes


def _mesh_notes(mesh: Mesh | None) -> list[str]:
    if mesh is None:
        return []
    notes = []
    for what in mesh.skipped:
        # What lies at nodes has no mass between them.
        at_nodes = what.startswith(tuple(f"elements of type {kind}" for kind in AT_NODES))
        lost = "" if at_nodes else ", and loads by mass lack what they share with supports"
        notes.append(f"left out of the mesh: {what} (not drawn; no contact lies on them{lost})")
    notes += mesh.remarks
    if mesh.constraints:
        named = "; ".join(mesh.constraints)
        notes.append(
            f"the mesh file makes dofs depend on others ({named}): those are not in the matrices; forces on them are"
            " refused, and pictures show them at rest"
        )
    return notes
