"""Forces of a CalculiX or Abaqus deck: `*CLOAD` at nodes, `*DLOAD` with pressures `P1` ... `P6` on element faces.

    *CLOAD                        *DLOAD
    812, 3, -2.5                  4711, P2, 0.35
    tip, 1, 1.0                   blades, P1, 0.1

Nodes by id or node set, of the model or of the deck; elements by id or by an `*ELSET` of the deck. Lines add up. At a
node of `*TRANSFORM` forces go along the axes that the mesh's deck gives it. Forces at held dofs and on held nodes go
into the support. Amplitudes, steps and frames are not read.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from attrito.importers.deck import Block, read_blocks
from attrito.importers.deck_ids import set_members
from attrito.model.pressure import pressure_forces
from attrito.model.surfaces import FACES, element_family
from attrito.support.errors import Fault, InputError
from attrito.support.text_files import number

if TYPE_CHECKING:
    from attrito.model.model import Model

# Part of all forces that is rounding where they are added up
ROUNDING = 1e-9
KEYWORDS = ("CLOAD", "DLOAD", "NSET", "ELSET", "HEADING")


def deck_force(path: str | Path, model: Model) -> tuple[np.ndarray, str]:
    """Sum of the deck's forces on the model's dofs, `[n]`, user force, and what is given, applied and held in words.

    Raises
    ------
    InputError : all faults of the deck together
    """
    reader = _Reader(model)
    blocks = list(read_blocks(path))
    faults = []
    for block in blocks:
        try:
            reader.take(block)
        except InputError as error:
            faults += error.faults
    if not faults and not any(block.keyword in ("CLOAD", "DLOAD") for block in blocks):
        faults.append(blocks[0].fault("neither *CLOAD nor *DLOAD", "a deck with forces or pressures"))
    if not faults:
        faults = _lost(path, reader.forces, model)
    if faults:
        raise InputError(*faults)
    force = model.on_dofs(reader.forces)
    return force, f"{path}: {_balance(reader, force)}"


def _balance(reader: _Reader, force: np.ndarray) -> str:
    """What was given along x, y, z, line by line, and what of it goes into supports, the rest being on dofs."""
    moves = reader.model.translates
    applied = np.bincount(reader.model.dof_direction[moves] - 1, force[moves], 3)
    size = np.abs(reader.forces).sum()
    given, held = (np.where(abs(sums) <= ROUNDING * size, 0.0, sums) for sums in (reader.given, reader.given - applied))
    words = f"forces of {', '.join(f'{value:.6g}' for value in given)} along x, y, z"
    return f"{words}, {', '.join(f'{value:.6g}' for value in held)} of them into supports" if held.any() else words


def _lost(path: str | Path, forces: np.ndarray, model: Model) -> list[Fault]:
    """Faults where forces fall on displacements that depend on others, which the matrices do not tell, or on none.

    Instead of displacements a node of a rigid body may have angles, and one of a pre-tension section an elongation.
    """
    faults = []
    rows = np.searchsorted(np.sort(model.node_ids), model.dependent[:, 0])
    on_dependent = np.abs(forces[np.argsort(model.node_ids)[rows], model.dependent[:, 1] - 1]).sum()
    if on_dependent > 0.0:
        value = (
            f"{on_dependent:.6g} of {np.abs(forces).sum():.6g} on nodes that *TIE, *EQUATION, *RIGID BODY or the like"
            " move"
        )
        expected = "forces on nodes that move by themselves, or on the reference node"
        faults.append(Fault(str(path), "forces", value, expected))
    turn = np.isin(model.node_ids, np.intersect1d(model.undisplaced, model.dof_node))
    if lost := np.flatnonzero(turn & forces.any(axis=1)).tolist():
        value = f"{np.abs(forces[turn]).sum():.6g} of {np.abs(forces).sum():.6g} on node {model.node_ids[lost[0]]}"
        expected = 'a node that is displaced (a moment, or a pre-tension: by `dofs` of the load, ["node", number, "rx"]'
        faults.append(Fault(str(path), "forces", value, f'{expected} or "q")'))
    return faults


class _Reader:
    """Sets known so far, and forces summed so far: at nodes `[N, 3]`, and by lines `[3]`."""

    def __init__(self, model: Model):
        self.model = model
        self.order = np.argsort(model.node_ids)
        self.forces, self.given = np.zeros((len(model.node_ids), 3)), np.zeros(3)
        self.node_sets = {name.upper(): ids for name, ids in model.node_sets.items()}
        self.element_sets: dict[str, np.ndarray] = {}
        self.elements = _Elements(model)
        self.begun: set[str] = set()

    def row_of(self, nodes: np.ndarray) -> np.ndarray:
        return self.order[np.searchsorted(self.model.node_ids, nodes, sorter=self.order)]

    def take(self, block: Block) -> None:
        if block.keyword not in KEYWORDS:
            raise InputError(block.fault("a keyword", "one of *" + ", *".join(KEYWORDS)))
        if block.keyword in ("NSET", "ELSET"):
            sets = self.node_sets if block.keyword == "NSET" else self.element_sets
            name = block.parameters.get(block.keyword, "").upper()
            sets[name] = np.union1d(sets.get(name, []), set_members(block, sets)).astype(np.int64)
        elif block.keyword != "HEADING":
            given = set(block.parameters) - {"INPUT", ""}
            # Forces are added to those before; if there are none a new list is the same.
            if block.parameters.get("OP", "").upper() in ("MOD", "NEW" if block.keyword not in self.begun else "MOD"):
                given -= {"OP"}
            self.begun.add(block.keyword)
            if given:
                raise InputError(block.fault(", ".join(block.parameters), f"*{block.keyword} without parameters"))
            for line in block.data:
                (self._force if block.keyword == "CLOAD" else self._pressure)(block, line)

    def _force(self, block: Block, line: str) -> None:
        where, direction, value = self._fields(block, line, "node or node set, direction 1, 2 or 3, force")
        if direction not in ("1", "2", "3"):
            raise InputError(block.fault(line, "a direction 1, 2 or 3"))
        nodes = self._members(block, where, self.node_sets, "a node or node set of the model")
        unknown = np.setdiff1d(nodes, self.model.node_ids)
        if len(unknown):
            raise InputError(block.fault(f"node {unknown[0]}", "a node of the model"))
        along = np.tile(np.eye(3)[int(direction) - 1], (len(nodes), 1))
        for i, node in enumerate(nodes.tolist()):
            if node in self.model.load_axes:
                along[i] = self.model.load_axes[node][int(direction) - 1]
            if not np.all(np.isfinite(along[i])):
                raise InputError(block.fault(f"node {node}", "a node off the axis of its *TRANSFORM"))
        np.add.at(self.forces, self.row_of(nodes), value * along)
        self.given += value * along.sum(axis=0)

    def _pressure(self, block: Block, line: str) -> None:
        where, label, value = self._fields(block, line, "element or element set, P1 to P6, pressure")
        if not (label.upper().startswith("P") and label[1:].isdecimal()):
            expected = "a pressure P1 to P6 (rotation: a [[load]] of kind centrifugal; weight: gravity of a static one)"
            raise InputError(block.fault(line, expected))
        ids = self._members(block, where, self.element_sets, "an element of the model, or an *ELSET of this deck")
        for faces in self.elements.faces(ids, int(label[1:]), block):
            pressure = np.full(len(faces), value)
            forces = pressure_forces(self.model.coordinates, self.row_of(faces), pressure)
            self.forces += forces
            self.given += forces.sum(axis=0)

    def _fields(self, block: Block, line: str, expected: str) -> tuple[str, str, float]:
        words = [word.strip() for word in line.rstrip(", ").split(",")]
        try:
            where, kind, value = words
            size = number(value)
        except ValueError:
            raise InputError(block.fault(line, expected)) from None
        if not np.isfinite(size):
            raise InputError(block.fault(line, "a finite number"))
        return where, kind, size

    def _members(self, block: Block, where: str, sets: dict[str, np.ndarray], expected: str) -> np.ndarray:
        if where.isdecimal():
            return np.array([int(where)])
        if where.upper() not in sets:
            raise InputError(block.fault(where, f"{expected}: {', '.join(sets) or 'there is no set'}"))
        return sets[where.upper()]


class _Elements:
    """Elements of a model by id."""

    def __init__(self, model: Model):
        self.kinds = [(element_family(name), *parts) for name, parts in model.elements.items()]

    def faces(self, ids: np.ndarray, number: int, block: Block) -> list[np.ndarray]:
        """Face `number` (from 1) of elements: node ids, an array for each kind of element."""
        found, left = [], np.unique(ids)
        for family, own, connectivity in self.kinds:
            here = np.isin(own, left)
            if not here.any():
                continue
            if family is None or number > len(FACES[family]):
                raise InputError(block.fault(f"P{number} on element {own[here][0]}", "a face that the element has"))
            found.append(connectivity[here][:, list(FACES[family][number - 1])])
            left = np.setdiff1d(left, own)
        if len(left):
            raise InputError(block.fault(f"element {left[0]}", "an element of the model"))
        return found
