"""A full model: matrices, dofs, mesh and node sets."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.sparse import csr_matrix

STRESS_STIFFENING, SPIN_SOFTENING = "stress_stiffening", "spin_softening"
# What a stiffness may hold besides that of the structure at rest without load.
HOLDINGS = (STRESS_STIFFENING, SPIN_SOFTENING)


@dataclass
class Model:
    """A full model.

    Parameters
    ----------
    stiffness, mass, damping : `[n, n]`, both triangles; damping may be absent; all None where a file was read
        without its matrices
    gyroscopic : G of the Coriolis forces at 1 rad/s, `[n, n]`, skew; None where it is not known or not asked for
    dof_node, dof_direction : `[n]`, node id and direction of each dof (1, 2, 3 for displacements along x, y, z; 4, 5, 6
        for rotations about them; 0 for generalised coordinates, whose node is a number of their own); None where dofs
        are only numbered
    node_ids, coordinates : `[N]` and `[N, 3]`, user length; None without a mesh
    elements : for each type its ids `[E]` and its connectivity `[E, k]` (node ids, CalculiX order)
    elastic : for each type of elements Young's modulus (user force/length^2) and Poisson's ratio `[E, 2]`, NaN where
        not known; no type: not known of any of its elements
    density : for each type of elements that of each `[E]`, user mass/length^3, NaN where not known; or no type
    point_mass : at nodes, user mass by id, as the mesh file says
    node_sets : for each name its node ids, ascending
    load_axes : for nodes with axes of their own, which a deck's forces go along, directions 1, 2, 3 as rows `[3, 3]`
    dependent : `[k, 2]`, nodes and directions of displacements that depend on others, as the mesh file says
    undisplaced : ids of nodes that stand for the angles of a rigid body, or for the elongation of a pre-tension section
    size : number of dofs n; taken from the stiffness matrix when there is one
    stiffness_holds : what the stiffness holds besides that of the structure at rest: names of `HOLDINGS`
    spin_hz : speed of rotation of what it holds; None where it comes from other loads
    """

    stiffness: csr_matrix | None
    mass: csr_matrix | None
    damping: csr_matrix | None = None
    dof_node: np.ndarray | None = None
    dof_direction: np.ndarray | None = None
    node_ids: np.ndarray | None = None
    coordinates: np.ndarray | None = None
    elements: dict[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)
    elastic: dict[str, np.ndarray] = field(default_factory=dict)
    density: dict[str, np.ndarray] = field(default_factory=dict)
    point_mass: dict[int, float] = field(default_factory=dict)
    node_sets: dict[str, np.ndarray] = field(default_factory=dict)
    load_axes: dict[int, np.ndarray] = field(default_factory=dict)
    dependent: np.ndarray = field(default_factory=lambda: np.empty((0, 2), np.int64))
    undisplaced: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64))
    size: int = 0
    stiffness_holds: tuple[str, ...] = ()
    spin_hz: float | None = None
    gyroscopic: csr_matrix | None = None

    def __post_init__(self) -> None:
        if self.stiffness is not None:
            self.size = self.stiffness.shape[0]

    @property
    def has_mesh(self) -> bool:
        """Whether the dofs belong to nodes of a mesh."""
        return self.node_ids is not None and self.names_dofs

    @property
    def names_dofs(self) -> bool:
        """Whether dofs have a node and a direction, with a mesh or without."""
        return self.dof_node is not None

    def knows_node(self, node: int) -> bool:
        """Whether there is a node of this id."""
        ids = self.node_ids if self.has_mesh else self.dof_node
        return ids is not None and bool(np.any(ids == node))

    @property
    def translates(self) -> np.ndarray:
        """Which dofs are displacements, `[n]` bool: neither rotations nor generalised coordinates."""
        return (self.dof_direction >= 1) & (self.dof_direction <= 3)

    def rows_of(self, dofs: np.ndarray) -> np.ndarray:
        """Row in `node_ids` of the node of each of some dofs, none of them a generalised coordinate."""
        order = np.argsort(self.node_ids)
        return order[np.searchsorted(self.node_ids, self.dof_node[dofs], sorter=order)]

    def on_dofs(self, field: np.ndarray) -> np.ndarray:
        """A vector field on the nodes, `[N, 3]`, as a vector on the dofs, `[n]`; zero on all but displacements."""
        moves = self.translates
        values = np.zeros(len(self.dof_node))
        values[moves] = field[self.rows_of(moves), self.dof_direction[moves] - 1]
        return values
