"""Hysteresis loops of one contact: its law along the displacement that was measured, under a known normal force.

No structure is solved: the law of the job's contact is marched over the points of the loop
(`src/contact/given_path.f90`).
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix

from attrito.fits.source import Solved, Source
from attrito.job.job import Job
from attrito.library.kernels import follow_path
from attrito.library.structures import make_law
from attrito.scene.build import laws_of
from attrito.scene.scene import Contacts
from attrito.support.parallel import on_root


class Loop(Source):
    """Of one contact, along one tangent."""

    def solve(self, values: np.ndarray, derivatives: bool) -> Solved:
        """See `Source.solve`."""

        def work() -> np.ndarray:
            measured, keys = self._data.measured, self._data.keys
            law = make_law(law_of(self.changed(values), *self._data.place(), keys["area"]), 0)
            return follow_path(law, measured.at, measured.beside["normal_force"], steady=keys["closed"])

        return {"tangential_force": on_root(self._comm, work)}, self.unknown_rates()


def law_of(job: Job, table: str, index: int, area: float | None) -> dict[str, np.ndarray]:
    """The law that a [[contact]] or [[contact_set]] gives to one contact of an area, with one tangent, `[1]` by key."""
    row = index + (len(job["contact"]) if table == "contact_set" else 0)
    places = {"area": np.array([0.0 if area is None else area]), "clearance": np.zeros(1)}
    one = Contacts({"tangents": np.ones(1, dtype=np.int32)}, csr_matrix((0, 0)), places, np.array([row]), np.zeros(1))
    return laws_of(job, one)
