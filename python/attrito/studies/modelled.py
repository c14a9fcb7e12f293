"""Many samples from few solved ones: which are solved, what the model says of the others, and how far it is to trust.

Models are those of `gradient_nodes.py` where derivatives by all that is varied are exact, else of `value_nodes.py`.
Further samples are solved to see how far the model is from them: kinks, as at the onset of slip, folds, and peaks that
change places are what it cannot have.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from attrito.runs.progress import Progress
from attrito.studies import gradient_nodes, value_nodes
from attrito.studies.design import Study
from attrito.studies.statistics import ACCEPTED
from attrito.support.errors import UnsolvedError

# Samples that are solved beside the nodes
MOST_CHECKED = 4

Rows = list[dict[str, Any]]


@dataclass(frozen=True)
class Nodes:
    """Solved places of a study's model.

    Parameters
    ----------
    study : the study
    sloped : are gradients taken?
    stops : values at which each sample is located
    """

    study: Study
    sloped: bool
    stops: tuple[float, ...]

    @property
    def places(self) -> np.ndarray:
        """From -1 to 1 between the bounds, `[nodes, quantities]`."""
        count = len(self.study.vary)
        if self.study.design == "first_order":
            return np.zeros((1, count))
        if not self.sloped:
            return value_nodes.nodes(count)
        return gradient_nodes.gradient_nodes(count, self.study.hessian == "central_gradients")

    def solved(self, values: np.ndarray) -> np.ndarray:
        """Values that are solved: at the nodes, then of the first samples."""
        low, high = self.study.bounds
        return np.vstack([0.5 * (low + high) + 0.5 * (high - low) * self.places, values[:MOST_CHECKED]])

    def rows(
        self, values: np.ndarray, found: list[dict[str, Any]], progress: Progress
    ) -> tuple[list[dict[str, Any]], dict[str, np.ndarray]]:
        """All samples by the model, as one batch, and how far it is from solved ones, which is said.

        That is the largest difference of a number at each stop `[stops]`: relative, of damping part of its largest.

        Parameters
        ----------
        values : of the samples
        found : batches of what `solved` gives

        Raises
        ------
        UnsolvedError : a node is without a solution
        """
        rows = rows_in_order(found)
        count = len(self.places)
        self.check([one["outcome"] for row in rows[:count] for one in row])
        modelled = self._modelled(rows[:count], self.study.places(values))
        errors = self._errors(rows[count:], modelled)
        self._judge(len(rows) - count, errors, progress)
        return [{"samples": list(range(self.study.samples)), "rows": modelled}], errors

    def check(self, outcomes: list[str]) -> None:
        """Raise `UnsolvedError` where a node has no solution."""
        lost = outcomes.count("not_converged")
        if lost:
            raise UnsolvedError(
                self.study.file,
                f"{lost} of {len(outcomes)} nodes of the model are without a solution: take another design",
            )

    def _errors(self, checked: list[Rows], modelled: list[Rows]) -> dict[str, np.ndarray]:
        """Of what a study is of, by name."""
        beside = modelled[: len(checked)]
        if self.study.of == "peaks":
            return {"amplitude": differences(checked, beside, "amplitude")}
        damping = differences_of_largest(checked, beside, "damping_ratio")
        return {"frequency_hz": differences(checked, beside, "frequency_hz"), "damping_ratio": damping}

    def _judge(self, checked: int, errors: dict[str, np.ndarray], progress: Progress) -> None:
        """Say how far the model is from solved samples."""
        name, first = next(iter(errors.items()))
        what = self.study.design.replace("_", "-")
        words = f"{what} model: {name} within {100.0 * first.max():.2g} %"
        others, beyond = f"of {checked} other solved samples", first.max() > ACCEPTED
        if self.study.of == "modes":
            damping = errors["damping_ratio"]
            words += f", damping ratio within {100.0 * damping.max():.2g} % of its largest, {others}"
            if np.any(damping > ACCEPTED):
                beyond = True
                off = np.array(self.stops)[damping > ACCEPTED]
                words += f" (beyond {100.0 * ACCEPTED:g} % at amplitudes {off[0]:.3g} to {off[-1]:.3g})"
        else:
            words += f" {others}"
        progress.say(words)
        if beyond:
            progress.warn([f'{words}; it does not hold: take design = "latin_hypercube"'])

    def _modelled(self, at_nodes: list[Rows], places: np.ndarray) -> list[Rows]:
        """What a file has of samples at some places `[n, quantities]`, from the rows of the nodes, `[nodes][stops]`.

        Numbers come from the model, estimated errors are the largest of all nodes; contacts' states are not known, -1.
        """
        first = at_nodes[0]
        errors = [name for name in first[0] if name.endswith("_error")]
        names = [name for name, value in first[0].items() if isinstance(value, float) and name not in errors]
        worst = [
            {name: float(np.max([row[stop][name] for row in at_nodes])) for name in errors}
            for stop in range(len(first))
        ]
        numbers = {name: self._model(at_nodes, name, places) for name in names}
        # What is wrong with one node may be so with all that go through it.
        outcomes = [
            next((row[stop]["outcome"] for row in at_nodes if row[stop]["outcome"] != "converged"), "converged")
            for stop in range(len(first))
        ]
        rows = []
        for sample in range(len(places)):
            row = []
            for stop, one in enumerate(first):
                own = {name: float(numbers[name][sample, stop]) for name in names}
                method = self.study.design
                row.append(one | own | worst[stop] | {"states": [-1] * 4, "method": method, "outcome": outcomes[stop]})
            rows.append(row)
        return rows

    def _model(self, at_nodes: list[Rows], name: str, places: np.ndarray) -> np.ndarray:
        """A number at places, `[n, stops]`."""
        values = np.array([[one[name] for one in row] for row in at_nodes], dtype=float)
        if not self.sloped:
            return value_nodes.model(values, places)
        low, high = self.study.bounds
        nothing = [np.nan] * len(low)
        slopes = np.array([[one["slopes"].get(name, nothing) for one in row] for row in at_nodes], dtype=float)
        order = 1 if self.study.design == "first_order" else 2
        return gradient_nodes.expand(self.places, values, slopes * 0.5 * (high - low), order).at(places)


def differences_of_largest(solved: list[Rows], modelled: list[Rows], name: str) -> np.ndarray:
    """Of a number over samples, at each stop, part of the largest at any; infinite where one has not been solved."""
    own, other = (np.array([[one[name] for one in row] for row in rows], dtype=float) for rows in (solved, modelled))
    found = np.nan_to_num(np.abs(other - own), nan=np.inf).max(axis=0)
    return np.asarray(found / max(np.nanmax(np.abs(own), initial=0.0), np.finfo(float).tiny))


def rows_in_order(found: list[dict[str, Any]]) -> list[Rows]:
    """Of what was solved in batches."""
    rows = dict(pair for batch in found for pair in zip(batch["samples"], batch["rows"], strict=True))
    return [rows[number] for number in range(len(rows))]


def differences(solved: list[Rows], modelled: list[Rows], name: str) -> np.ndarray:
    """The largest of a number over samples, relative, at each stop; infinite where one has not been solved."""
    own, other = (np.array([[one[name] for one in row] for row in rows], dtype=float) for rows in (solved, modelled))
    return np.asarray(np.nan_to_num(np.abs(other / own - 1.0), nan=np.inf).max(axis=0))
