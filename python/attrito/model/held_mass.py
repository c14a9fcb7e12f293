"""Loads by mass: what free nodes share with held ones is not in matrices without held dofs, and comes from the mesh.

A structure whose nodes all have the accelerations a is loaded by

    f_i = sum_j m_ij a_j,    m_ij = integral rho N_i N_j dV,

over all nodes j of the shape functions N. Free ones are in the matrices, held ones are not. The mesh has the shape
functions, and the matrices tell the density, by which alone entries of both differ: for each kind of element and its
constants, and by that of two rules of integration with which they agree best. If no entries can be compared, the
deck's density counts if with it the mesh has the mass of the matrices, r^T M r along a direction, held nodes left out:

    r^T M r = sum_ij m_ij over all nodes that are not held, and what the deck puts at these by `*MASS`.

Nodes that depend on others are in the matrices of these. They move as the others say, which need not be as the
accelerations do: those of rotation are no rigid motion. Rows next to such nodes are held against the mesh: what they
differ by is about what the load lacks on others.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix, diags

from attrito.model.solid_shapes import KINDS, mass_shapes

if TYPE_CHECKING:
    from attrito.model.model import Model

# Part of a row's mass by which matrices and mesh may differ: rules of integration do in distorted elements
SAME_MASS = 1e-3
# Part of a load that may not be known: displacements are those of all dofs together to about as much
MISSED = 1e-4


class UnknownMassError(Exception):
    """A load by mass that matrices and mesh do not tell; says why."""


@dataclass
class _Block:
    """Solids of one kind and one material.

    Parameters
    ----------
    rows : of their nodes, `[E, k]`
    masses : m_ij of unit density by each rule, `[rules, E, k, k]`
    density : that the deck gives, NaN where it gives none
    mass : by the rule chosen, and of its density; none where it is not known, `[E, k, k]`
    is_lumped : nodes share no mass with others: all of it is in the rows
    """

    rows: np.ndarray
    masses: list[np.ndarray]
    density: float = np.nan
    mass: np.ndarray | None = None
    is_lumped: bool = False

    def sums(self, masses: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
        """sum_j m_ij v_j of values at the nodes `[N]`, `[count]`."""
        return np.bincount(
            self.rows.ravel(), weights=np.einsum("eij,ej->ei", masses, values[self.rows]).ravel(), minlength=count
        )


def inertia_of(model: Model, acceleration: np.ndarray) -> np.ndarray:
    """The load of an acceleration of all nodes `[N, 3]` of a mesh, held ones included, `[n]`, user force.

    Raises
    ------
    UnknownMassError : nodes that depend on others do not follow the acceleration
    """
    return SharedMass(model).inertia(acceleration)


def other_mass(model: Model, supports: np.ndarray, is_part: bool = False) -> str | None:
    """What to say of matrices that have another mass than the mesh by its densities; None where nothing is to be said.

    Nodes that depend on others need not move along as these do, others without dofs may have been reduced, and what a
    lumped mass has at free nodes next to supports depends on how it was lumped.

    Parameters
    ----------
    supports : nodes and directions that the deck holds, `[k, 2]`
    is_part : elements were left out of the mesh whose mass is not known, which matrices may have more
    """
    if not model.has_mesh or len(model.dependent) or not model.density:
        return None
    shared = SharedMass(model)
    errors = None if shared.has_held_beyond(supports) else shared.mass_errors
    if errors is None:
        return None
    best = np.take_along_axis(errors, np.argmin(np.abs(errors), axis=0)[None], axis=0).ravel()
    worst = best[np.nanargmax(np.abs(best))]
    if abs(worst) <= SAME_MASS or (is_part and worst < 0.0):
        return None
    return (
        f"the matrices have {100.0 * abs(worst):.2g} % {'less' if worst > 0.0 else 'more'} mass than the mesh's solids"
        " by the deck's *DENSITY, and *MASS, held dofs left out in both: is there mass of elements left out of"
        " the mesh, or do files not go together?"
    )


class SharedMass:
    """The solids of a mesh that have a node without a dof."""

    def __init__(self, model: Model):
        self._model, self._count = model, len(model.node_ids)
        self._order = np.argsort(model.node_ids)
        self.dof = np.full((self._count, 3), -1)
        moves = np.flatnonzero(model.translates)
        self.dof[self._rows_of(model.dof_node[moves]), np.asarray(model.dof_direction, dtype=int)[moves] - 1] = moves
        self.depends = np.zeros(self.dof.shape, dtype=bool)
        own = np.isin(model.dependent[:, 0], model.node_ids) & np.isin(model.dependent[:, 1], (1, 2, 3))
        self.depends[self._rows_of(model.dependent[own, 0]), model.dependent[own, 1] - 1] = True
        self.depends &= self.dof < 0
        self.held = (self.dof < 0) & ~self.depends
        self.blocks = self._blocks()
        for block in self.blocks:
            block.is_lumped = self._is_lumped(block)
            if not block.is_lumped:
                self._choose(block)
        if any(block.mass is None for block in self.blocks):
            self._take_densities()

    def inertia(self, acceleration: np.ndarray) -> np.ndarray:
        """As `inertia_of`."""
        model = self._model
        load = np.asarray(model.mass @ model.on_dofs(acceleration))
        known = [(block, block.mass) for block in self.blocks if block.mass is not None]
        missed = 0.0
        for d in range(3):
            moves, values = self.dof[:, d] >= 0, acceleration[:, d]
            shared = sum((one.sums(mass, self.held[:, d] * values, self._count) for one, mass in known), np.zeros(1))
            load[self.dof[moves, d]] += np.broadcast_to(shared, self._count)[moves]
            missed += float(np.abs(self._missed(load, known, d, values)).sum())
        if missed > MISSED * np.abs(load).sum():
            raise UnknownMassError(
                f"forces in a file: the matrices do not tell {missed / np.abs(load).sum():.1e} of these, by how nodes"
                " that *RIGID BODY, *EQUATION, *TIE or the like move follow the acceleration"
            )
        beside = [block for block in self.blocks if not self._alone[block.rows].all()]
        if (share := self._unknown_share(beside, False)) > MISSED:
            raise UnknownMassError(
                f"*DENSITY in the deck, imported again, or forces in a file: the matrices do not tell {share:.1e} of"
                " the mass, which nodes next to supports share with them, nor does the mesh, since *RIGID BODY,"
                " *EQUATION, *TIE or the like move nodes there"
            )
        return load

    @cached_property
    def unknown_share(self) -> float:
        """Part of the mass of the mesh, its density being the same everywhere, that loads by mass lack."""
        return self._unknown_share(self.blocks, bool(self.kinds_not_told))

    def _unknown_share(self, blocks: list[_Block], crossing: bool) -> float:
        """That of some blocks; `crossing`: other elements hide what those share whose density is known."""
        lost = 0.0
        for block in (block for block in blocks if not block.is_lumped):
            for d in range(3):
                held, depends = (which[block.rows, d] for which in (self.held, self.depends))
                free = depends if block.mass is not None and not crossing else ~held
                lost += float(np.sum(block.masses[0] * held[:, None, :] * free[:, :, None])) / 3.0
        whole = sum(
            float(np.sum(_volumes(self._model, kind, part, 0)))
            for kind, (_, nodes) in self._model.elements.items()
            if kind in KINDS
            for part in np.array_split(self._rows_of(nodes), len(nodes) // 10000 + 1)
        )
        return abs(lost) / whole if lost else 0.0

    def has_held_beyond(self, supports: np.ndarray) -> bool:
        """Whether a node of an element has no dof along a direction in which no support `[k, 2]` holds it."""
        held = np.zeros(self.held.shape, dtype=bool)
        own = np.isin(supports[:, 0], self._model.node_ids) & np.isin(supports[:, 1], (1, 2, 3))
        held[self._rows_of(supports[own, 0]), supports[own, 1] - 1] = True
        return any(bool((self.held & ~held)[self._rows_of(nodes)].any()) for _, nodes in self._model.elements.values())

    def _rows_of(self, nodes: np.ndarray) -> np.ndarray:
        """Rows in `Model.node_ids`."""
        order = self._order
        return np.asarray(order[np.searchsorted(self._model.node_ids, nodes, sorter=order)])

    def _blocks(self) -> list[_Block]:
        """Solids that share a node with one that has nodes without dofs, by kind and elastic constants."""
        model = self._model
        solids = {kind: self._rows_of(nodes) for kind, (_, nodes) in model.elements.items() if kind in KINDS}
        near = np.zeros(self._count, dtype=bool)
        for rows in solids.values():
            near[rows[(self.dof[rows] < 0).any(axis=(1, 2)) & (self.dof[rows] >= 0).any(axis=(1, 2))]] = True
        blocks = []
        for kind, rows in solids.items():
            adjacent = np.flatnonzero(near[rows].any(axis=1))
            elastic = model.elastic.get(kind, np.full((len(rows), 2), np.nan))[adjacent]
            density = model.density.get(kind, np.full(len(rows), np.nan))[adjacent]
            of = np.nan_to_num(np.column_stack([elastic, density]))
            material = np.unique(of, axis=0, return_inverse=True)[1].ravel()
            for number in range(material.max(initial=-1) + 1):
                own = rows[adjacent[material == number]]
                masses = []
                for rule in range(2):
                    values = mass_shapes(kind, rule)[0]
                    volumes = _volumes(model, kind, own, rule)
                    masses.append(np.einsum("ep,pi,pj->eij", volumes, values, values, optimize=True))
                blocks.append(_Block(own, masses, float(density[material == number][0])))
        return blocks

    def _take_densities(self) -> None:
        """The deck's densities of blocks whose entries cannot be compared, by the rule that has the matrices' mass.

        What that mass lacks is a part of what these blocks have between free nodes, and by the same part what they
        share with held ones, and loads take, may be wrong.
        """
        unknown = [block for block in self.blocks if block.mass is None]
        errors = self.mass_errors
        if errors is None or not np.isfinite([block.density for block in unknown]).all():
            return
        wrong = np.full(errors.shape, np.inf)
        for rule, d in np.ndindex(*errors.shape):
            free, between = 0.0, np.zeros(3)
            for block in unknown:
                mass = block.density * block.masses[rule]
                moves = 1.0 - self.held[block.rows].astype(float)
                free += float(np.einsum("ei,eij,ej->", moves[..., d], mass, moves[..., d], optimize=True))
                between += np.einsum("eid,eij,ejd->d", moves, np.abs(mass), 1.0 - moves, optimize=True)
            if free > 0.0 and np.isfinite(errors[rule, d]):
                wrong[rule, d] = abs(errors[rule, d]) * between.max() / free
        rule, d = np.unravel_index(np.argmin(wrong), errors.shape)
        if wrong[rule, d] <= MISSED:
            for block in unknown:
                block.mass = block.density * block.masses[rule]

    @cached_property
    def mass_errors(self) -> np.ndarray | None:
        """What the matrices have less of mass than a mesh whose densities are all known, a part of it, `[rules, 3]`.

        Elements that are held as a whole along a direction are left out: no free node shares their mass. NaN along
        directions in which all are. None where a mass is lumped: what it has at free nodes depends on how.
        """
        model, whole = self._model, np.zeros(3)
        if any(kind not in KINDS for kind in model.elements) or any(block.is_lumped for block in self.blocks):
            return None
        for kind, (_, nodes) in model.elements.items():
            density = model.density.get(kind, np.full(len(nodes), np.nan))
            for part in np.array_split(np.arange(len(nodes)), len(nodes) // 10000 + 1):
                rows = self._rows_of(nodes[part])
                masses = density[part] * _volumes(model, kind, rows, 0).sum(axis=1)
                moves = ~self.held[rows].all(axis=1)
                whole += [masses[moves[:, d]].sum() for d in range(3)]
        if np.isnan(whole).any() or not whole.any():
            return None
        at = self._rows_of(np.array(list(model.point_mass), dtype=int))
        whole += np.array(list(model.point_mass.values())) @ ~self.held[at]
        found = np.array([[self._along(d) + self._of_held(d, rule) for d in range(3)] for rule in (0, 1)])
        return 1.0 - found / np.where(whole > 0.0, whole, np.nan)

    def _along(self, d: int) -> float:
        """r^T M r of a translation of all that moves."""
        return float(self._own_sums(d)[self.dof[:, d] >= 0].sum())

    def _of_held(self, d: int, rule: int) -> float:
        """What of the mass of elements with free nodes is between nodes of which one is held along d, or both are."""
        found = 0.0
        for block in self.blocks:
            mass = block.density * block.masses[rule] if block.mass is None else block.mass
            free = 1.0 - self.held[block.rows, d]
            mass, free = mass[free.any(axis=1)], free[free.any(axis=1)]
            found += float(mass.sum() - np.einsum("ei,eij,ej->", free, mass, free, optimize=True))
        return found

    def _choose(self, block: _Block) -> None:
        """The rule and the density of a block, by entries of the matrix that belong to it alone."""
        inside, best = self._surrounded(block), np.inf
        for masses in block.masses:
            pairs = [self._comparable(block, masses, inside, d) for d in range(3)]
            diagonal = np.concatenate([own.diagonal()[alone] for own, _, alone in pairs])
            if not len(diagonal):
                continue
            density = float(np.median(diagonal))
            worst = 0.0
            for own, mesh, alone in pairs:
                # Point masses are on the diagonal.
                row, column = mesh.nonzero()
                counts = alone[row] & (row != column)
                if not counts.any():
                    continue
                differs = np.abs(np.asarray((own - density * mesh)[row[counts], column[counts]]))
                worst = max(worst, differs.max(initial=0.0) / density if density > 0.0 else np.inf)
            if worst <= SAME_MASS and worst < best:
                best, block.mass = worst, density * masses

    def _comparable(
        self, block: _Block, masses: np.ndarray, inside: np.ndarray, d: int
    ) -> tuple[csr_matrix, csr_matrix, np.ndarray]:
        """Of nodes along a direction the mass, that of unit density, both by its diagonal, and which are alone."""
        row, column = (np.broadcast_to(rows, masses.shape) for rows in (block.rows[:, :, None], block.rows[:, None, :]))
        entries = masses.ravel(), (row.ravel(), column.ravel())
        nodes = np.flatnonzero(inside & (self.dof[:, d] >= 0))
        mesh = coo_matrix(entries, shape=(self._count, self._count)).tocsr()[nodes][:, nodes]
        own = self._model.mass[self.dof[nodes, d]][:, self.dof[nodes, d]]
        inverse = diags(mesh.diagonal() ** -0.5, shape=mesh.shape)
        return csr_matrix(inverse @ own @ inverse), csr_matrix(inverse @ mesh @ inverse), self._alone[nodes]

    def _own_sums(self, d: int) -> np.ndarray:
        """Sums of the rows of the matrix over what moves along a direction, `[N]`; 0 at nodes that do not."""
        moves = self.dof[:, d] >= 0
        along = np.zeros(self._model.size)
        along[self.dof[moves, d]] = 1.0
        sums = np.zeros(self._count)
        sums[moves] = (self._model.mass @ along)[self.dof[moves, d]]
        return sums

    @cached_property
    def _alone(self) -> np.ndarray:
        """Nodes whose rows of the mass have nothing that belongs to dependent ones, `[N]` bool.

        They have no element in common with these, and no other depends on them: its neighbours would have entries with
        them, though they share no element.
        """
        if not self.depends.any():
            return np.ones(self._count, dtype=bool)
        nodes = [row for _, connectivity in self._model.elements.values() for row in self._rows_of(connectivity)]
        element, node = np.repeat(np.arange(len(nodes)), [len(row) for row in nodes]), np.concatenate(nodes)
        lies_in = coo_matrix((np.ones(len(node)), (element, node)), shape=(len(nodes), self._count)).tocsr()
        alone = np.asarray(lies_in.T @ (lies_in @ self.depends.any(axis=1).astype(float))) == 0.0
        of_dof = np.full(self._model.size, -1)
        row, direction = np.nonzero(self.dof >= 0)
        of_dof[self.dof[row, direction]] = row
        near = np.zeros(self._count, dtype=bool)
        for block in self.blocks:
            near[block.rows] = True
        near &= alone
        moves = self.dof[near][self.dof[near] >= 0]
        entries = self._model.mass[moves].tocoo()
        row, column = of_dof[moves[entries.row]], of_dof[entries.col]
        # A column of no node is an angle, or the like, that moves dependent ones.
        strange = (entries.data != 0.0) & (row != column)
        shared = (lies_in[:, np.flatnonzero(near)].T @ lies_in).tocoo()
        place, width = np.cumsum(near) - 1, self._count + 1
        strange[strange] = ~np.isin(
            place[row[strange]] * width + column[strange] + 1, shared.row.astype(np.int64) * width + shared.col + 1
        )
        alone[row[strange]] = False
        return alone

    def _surrounded(self, block: _Block) -> np.ndarray:
        """Nodes all of whose elements are in a block, `[N]` bool."""
        every = np.zeros(self._count, dtype=int)
        for _, nodes in self._model.elements.values():
            every += np.bincount(self._rows_of(nodes).ravel(), minlength=self._count)
        inside = np.bincount(block.rows.ravel(), minlength=self._count)
        return np.asarray((inside > 0) & (inside == every))

    def _missed(
        self, load: np.ndarray, known: list[tuple[_Block, np.ndarray]], d: int, values: np.ndarray
    ) -> np.ndarray:
        """What the load lacks at dependent nodes, and what rows next to them differ by from the mesh, `[rows]`.

        Those that others depend on are left out.
        """
        ones = np.ones(self._count)
        found = [np.empty(0)]
        for block, mass in known:
            lost = block.sums(mass, self.held[:, d] * values, self._count)[self.depends[:, d]]
            adjacent = block.sums(np.abs(mass), self.depends[:, d].astype(float), self._count) > 0.0
            rows = np.flatnonzero(adjacent & self._surrounded(block) & (self.dof[:, d] >= 0))
            whole = block.sums(mass, ones, self._count)[rows]
            size = block.sums(np.abs(mass), ones, self._count)[rows]
            rows = rows[self._own_sums(d)[rows] <= whole + SAME_MASS * size]
            found += [lost, load[self.dof[rows, d]] - block.sums(mass, values, self._count)[rows]]
        return np.concatenate(found)

    def _is_lumped(self, block: _Block) -> bool:
        """Whether nodes of a block share no mass: those that belong to it alone, or all where none do."""
        inside = self._surrounded(block)
        own = self.dof[inside if (self.dof[inside] >= 0).any() else np.unique(block.rows)]
        own = own[own >= 0]
        entries = abs(self._model.mass[own])
        return bool(entries.sum() <= (1.0 + SAME_MASS) * entries[np.arange(len(own)), own].sum())

    @property
    def kinds_not_told(self) -> list[str]:
        """Kinds of elements, without shape functions here, that have both free and held nodes."""
        others = {kind: self._rows_of(nodes) for kind, (_, nodes) in self._model.elements.items() if kind not in KINDS}
        return [
            kind
            for kind, rows in others.items()
            if np.any(self.held[rows].any(axis=(1, 2)) & (self.dof[rows] >= 0).any(axis=(1, 2)))
        ]


def _volumes(model: Model, kind: str, rows: np.ndarray, rule: int) -> np.ndarray:
    """Of the points of integration of solids of a kind, `[E, points]`."""
    _, gradients, weights = mass_shapes(kind, rule)
    jacobian = np.einsum("eix,pir->eprx", model.coordinates[rows], gradients, optimize=True)
    return np.asarray(np.abs(np.linalg.det(jacobian)) * weights)
