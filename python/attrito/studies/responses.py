"""The file of a study of frequency responses, with the bands over its samples, and its picture."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from attrito.job.job import Job
from attrito.library.names import OUTCOMES
from attrito.runs.progress import Progress
from attrito.studies.design import Study
from attrito.studies.modelled import Nodes, rows_in_order
from attrito.studies.response_bands import changes_of_state, curves_of, fine, modelled, outcome_of
from attrito.studies.sample_responses import Reference
from attrito.studies.statistics import ACCEPTED, QUANTILES, moments_of, quantiles_of, spans
from attrito.support.atomic_files import whole_hdf5
from attrito.support.hdf5_writing import described
from attrito.support.units import axis_unit
from attrito.support.version import __version__

UNIT = "user length"


@dataclass(frozen=True)
class Responses:
    """What was found of all samples.

    Parameters
    ----------
    at_hz : frequencies of the bands, `[F]`
    amplitude : of the samples, `[samples, F]`; NaN: no solution
    outcome : by sample
    error : of a model, relative, the largest of some solved samples, `[F]`; None: all samples are solved
    """

    at_hz: np.ndarray
    amplitude: np.ndarray
    outcome: list[str]
    error: np.ndarray | None

    @property
    def failing(self) -> np.ndarray:
        """Where a model does not hold, `[F]`."""
        return np.zeros(len(self.at_hz), dtype=bool) if self.error is None else ~(self.error <= ACCEPTED)


def gather(
    study: Study,
    nodes: Nodes | None,
    reference: Reference,
    values: np.ndarray,
    found: list[dict[str, Any]],
    progress: Progress,
) -> Responses:
    """Put batches together; of a model all samples, and says where it does not hold.

    Raises
    ------
    UnsolvedError : a node of the model is without a solution
    """
    rows = [row[0] for row in rows_in_order(found)]
    at_hz, count = fine(reference.frequencies_hz), len(reference.frequencies_hz)
    if reference.turns_hz:
        ends = " to ".join(f"{end:.6g}" for end in reference.turns_hz)
        words = (
            f"the response turns back between {ends} Hz: bands are of what is found there one frequency after another"
        )
        progress.warn([words])
    if nodes is None:
        return Responses(at_hz, curves_of(rows, count).drawn(at_hz), [outcome_of(row) for row in rows], None)
    at_nodes, checked = rows[: len(nodes.places)], rows[len(nodes.places) :]
    outcomes = [outcome_of(row) for row in at_nodes]
    nodes.check(outcomes)
    low, high = study.bounds
    half = 0.5 * (high - low) if nodes.sloped else None
    order = 1 if study.design == "first_order" else 2
    curves = modelled(reference, nodes.places, at_nodes, half, order, study.places(values))
    amplitude = curves.drawn(at_hz)
    solved = curves_of(checked, count).drawn(at_hz)
    # NaN where none of these has a solution
    error = np.fmax.reduce(np.abs(amplitude[: len(checked)] / solved - 1.0), axis=0)
    worst = next((one for one in outcomes if one != "converged"), "converged")
    responses = Responses(at_hz, amplitude, [worst] * study.samples, error)
    _judge(study, responses, len(checked), progress)
    changing = changes_of_state([*at_nodes, *(row for row in checked if "curve" in row)])
    if np.any(changing):
        progress.say(
            f"how many contacts slip or are open differs between samples {_named(reference.frequencies_hz, changing)}"
        )
    return responses


def _judge(study: Study, responses: Responses, checked: int, progress: Progress) -> None:
    """Say how far a model is from solved samples, and where it does not hold."""
    assert responses.error is not None
    largest = np.nanmax(responses.error, initial=0.0)
    what = study.design.replace("_", "-")
    words = f"{what} model: amplitudes within {100.0 * largest:.2g} % of {checked} other solved samples"
    progress.say(words)
    if np.any(responses.failing):
        where = _named(responses.at_hz, responses.failing)
        progress.warn([f'{words}; it does not hold {where}: take design = "latin_hypercube"'])


def _named(at_hz: np.ndarray, which: np.ndarray) -> str:
    """Spans of frequencies in words, at most four."""
    shown = [f"{low:.5g} to {high:.5g} Hz" for low, high in spans(at_hz, which)]
    rest = [] if len(shown) <= 4 else [f"{len(shown) - 4} spans more"]
    return "at " + ", ".join([*shown[:4], *rest])


def write_responses(
    study: Study, job: Job, values: np.ndarray, reference: Reference, found: Responses, progress: Progress, solved: int
) -> dict[str, int]:
    """The file and picture; how many samples have an outcome to report, by name. `solved`: how many samples are."""
    outcome = np.array([OUTCOMES.index(one) for one in found.outcome], dtype=np.int32)
    Path(study.file).parent.mkdir(parents=True, exist_ok=True)
    with whole_hdf5(study.file) as file:
        file.attrs["format"], file.attrs["format_version"] = "attrito study", 1
        file.attrs["attrito_version"] = __version__
        file.attrs["description"] = (
            "Frequency responses over samples of a job's values; see docs/how-to/studies.md of attrito"
        )
        file.attrs.update(job.attributes)
        file.attrs["study"], file.attrs["solved"] = json.dumps(study.as_table()), solved
        file.attrs["parameter"] = "frequency_hz"
        file.attrs["warnings"] = "\n".join(progress.warnings)

        def put(name: str, data: np.ndarray, description: str, unit: str) -> h5py.Dataset:
            return described(file, name, description, unit, data=data)

        put("parameter", found.at_hz, "frequencies of the bands", "Hz")
        put("drawn_hz", reference.frequencies_hz, "points of the drawn curve in the middle of what is varied", "Hz")
        for i, vary in enumerate(study.vary):
            put(f"values/{vary.name}", values[:, i], ", ".join(vary.keys), "that of the job's key, or a factor on it")
        put("response/amplitude", found.amplitude, "of the monitor, sample by frequency; NaN: no solution", UNIT)
        put("response/outcome", outcome, "how the sample ended", "1").attrs["names"] = list(OUTCOMES)
        if found.error is not None:
            put("response/model_error", found.error, "largest of solved samples, relative, by frequency", "1")
        for name, moment in moments_of(found.amplitude).items():
            words = {"mean": "mean", "deviation": "standard deviation"}[name]
            put(f"{name}/amplitude", moment, f"{words} over the samples, by frequency", UNIT)
        quantiles = quantiles_of(found.amplitude)
        put("quantiles/amplitude", quantiles, "over the samples, by quantile and frequency", UNIT)
        put("quantiles/probability", np.array(QUANTILES), "of the quantiles", "1")
    if study.draws:
        from attrito.plots.style import save
        from attrito.studies.picture import picture_of_responses

        unit, failing = axis_unit(UNIT, job.attributes["units"]), spans(found.at_hz, found.failing)
        mean = moments_of(found.amplitude)["mean"]
        save(picture_of_responses(found.at_hz, quantiles, mean, unit, failing), study.picture)
    names = ("not_converged", "above_tolerance")
    return {name: int((outcome == OUTCOMES.index(name)).sum()) for name in names}
