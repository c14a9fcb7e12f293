"""Dofs of a model by number or node, as a job names them."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from attrito.job.checks import DIRECTIONS
from attrito.job.job import Job
from attrito.model.model import Model
from attrito.scene.scene import Contacts, CyclicSector
from attrito.support.errors import Fault


class DofResolver:
    """Dofs of a model by number or node, and the faults found on the way, and notes for the user."""

    def __init__(self, job: Job, model: Model):
        self.job, self.model = job, model
        self.faults: list[Fault] = []
        self.notes: list[str] = []
        self.dofs = {}
        if model.dof_node is not None:
            pairs = zip(model.dof_node.tolist(), model.dof_direction.tolist(), strict=True)
            self.dofs = {pair: dof for dof, pair in enumerate(pairs)}

    def dof(self, place: Any, key: str) -> int | None:
        """Number of a dof; a fault and None where there is none."""
        if isinstance(place, int):
            if place < self.model.size:
                return place
            self.add(key, place, f"a dof of the model: 0 to {self.model.size - 1}")
            return None
        _, node, direction = place
        shown = json.dumps(place)
        if not self.model.names_dofs:
            self.add(key, shown, "a dof's number, since the model does not name its nodes")
            return None
        if isinstance(node, str):
            nodes = self.model.node_sets.get(node, np.array([], dtype=int))
            if len(nodes) != 1:
                sets = ", ".join(name for name, ids in self.model.node_sets.items() if len(ids) == 1) or "none"
                self.add(key, shown, f"a node id, or a node set of one node: {sets}")
                return None
            node = int(nodes[0])
        found = self.dofs.get((node, DIRECTIONS[direction]))
        if found is None:
            known = self.model.knows_node(node)
            self.add(key, shown, "a free dof (this one is held)" if known else "a node of the model")
        return found

    def vector(self, terms: list, key: str) -> np.ndarray:
        """Sum of coefficients at dofs, `[n]`."""
        vector = np.zeros(self.model.size)
        for place, coefficient in terms:
            dof = self.dof(place, key)
            if dof is not None:
                with np.errstate(over="ignore"):
                    vector[dof] += coefficient
        return vector

    def boundary(self, contacts: Contacts, sector: CyclicSector | None = None) -> np.ndarray:
        """Dofs to keep: of contacts, all of their nodes, of nodes that the job names, of a sector's ends and axis.

        What contacts touch of the next sector is kept of this one, which is its equal.
        """
        rows = contacts.rows if contacts.next_rows is None else contacts.rows + contacts.next_rows
        keep = [np.unique(rows.indices)]
        if sector is not None:
            keep += [sector.lower, sector.upper, sector.along, sector.across.ravel()]
        nodes = [contacts.places["node_a"], contacts.places["node_b"]]
        if self.model.dof_node is not None:
            # Contacts on faces have several nodes a side; one dof of each is in their rows.
            explicit = len(self.job["contact"])
            paired = np.repeat(contacts.tables >= explicit, contacts.laws["tangents"] + 1)
            nodes.append(self.model.dof_node[np.unique(rows[paired].indices)])
        for i, name in enumerate(self.job["reduction"]["boundary"]):
            key = f"[reduction] boundary[{i}]"
            if isinstance(name, str) and name in self.model.node_sets:
                nodes.append(self.model.node_sets[name])
            elif isinstance(name, int) and self.model.knows_node(name):
                nodes.append(np.array([name]))
            else:
                self.add(key, name, "a node set or node of the model: " + (", ".join(self.model.node_sets) or "none"))
        if self.model.dof_node is not None:
            keep.append(np.flatnonzero(np.isin(self.model.dof_node, np.concatenate(nodes))))
        return np.unique(np.concatenate(keep)).astype(np.int64)

    def recovered(self, monitors: dict[str, np.ndarray]) -> np.ndarray | None:
        """Dofs whose motion the reduced model is to give back, beside the boundary's; None: of all.

        Of monitors `[n]` all dofs of their nodes.
        """
        asked = self.job["reduction"]["recovery"]
        if asked == "all":
            return None
        dofs = np.zeros(0, dtype=np.int64)
        nodes = np.zeros(0, dtype=np.int64)
        if asked == "monitors":
            dofs = np.flatnonzero(np.any(list(monitors.values()), axis=0)) if monitors else dofs
            nodes = nodes if self.model.dof_node is None else self.model.dof_node[dofs]
        elif asked != "none":
            for i, name in enumerate(asked):
                if name not in self.model.node_sets:
                    expected = "a node set of the model: " + (", ".join(self.model.node_sets) or "none")
                    self.add(f"[reduction] recovery[{i}]", name, expected)
                    continue
                nodes = np.concatenate([nodes, self.model.node_sets[name]])
        if self.model.dof_node is not None:
            dofs = np.union1d(dofs, np.flatnonzero(np.isin(self.model.dof_node, nodes)))
        return dofs.astype(np.int64)

    def add(self, key: str, value: object, expected: str) -> None:
        """One more fault."""
        self.faults.append(self.job.fault(key, value, expected))
