"""A chart of the ways to let two faces meet: kinds of points on them, and other meshes."""

from __future__ import annotations

import csv
import io
import re
from pathlib import Path

import h5py
import numpy as np
import pytest
import solids
from jobs import attrito_here, write_job
from scipy.sparse import diags
from unlike_meshes import unlike_joint

from attrito.charts import contacts as chart
from attrito.model.model_file import write_model
from attrito.support.errors import InputError, NumericsError


def boxes(folder: Path, name: str, counts: tuple[int, int]) -> dict:
    """A job on two elastic boxes with so many cells along an edge, the lower one held, the upper one pressed on it."""
    model = unlike_joint(("C3D8", "C3D8"), counts, held=lambda points: points[:, 2] < 1e-9)
    whole = solids.stiffness(model)
    free = np.repeat(model.coordinates[:, 2] > 1e-9, 3)
    rows, _, volume = solids.gradients(model, "C3D8")
    mass = np.bincount(rows.ravel(), np.repeat(volume.sum(axis=1) / 8, 8), len(model.node_ids))
    model.stiffness = whole[free][:, free]
    model.mass = diags(np.repeat(mass, 3)[free]).tocsr()
    lid = model.node_ids[model.coordinates[:, 2] > 2 - 1e-9]
    write_model(folder / f"{name}.h5", model, [])
    share = 1.0 / len(lid)
    return {
        "model": {"file": f"{name}.h5"},
        "damping": {"ratio": 0.02},
        "reduction": {"modes": 4},
        "contact_set": [
            {
                "a": "bottom",
                "b": "top",
                "tolerance": 1e-3,
                "normal_stiffness": 5.0,
                "tangential_stiffness": 5.0,
                "stiffness_per": "area",
                "friction_coefficient": 0.3,
                "tangents": 2,
            }
        ],
        "load": [
            {"name": "press", "kind": "static", "dofs": [[["node", int(node), "z"], -share] for node in lid]},
            {"kind": "harmonic", "cosine": [[["node", int(node), "x"], 0.008 * share] for node in lid]},
        ],
        "static": {"bounds": "none"},
        "balance": {"harmonics": 1},
        "sweep": {"start_hz": 0.04, "stop_hz": 0.07},
        "output": {
            "file": f"{name}.result.h5",
            "monitors": [{"name": "lid", "dofs": [[["node", int(node), "x"], share] for node in lid]}],
        },
    }


def on_faces(job: dict, points: str) -> dict:
    job["contact_set"][0] |= {"pairing": "face", "points": points}
    return job


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Jobs on boxes with 2 x 2 cells below 3 x 3, with 3 x 3 on 3 x 3, and 4 x 4 on 4 x 4."""
    where = tmp_path_factory.mktemp("boxes")
    write_job(where, on_faces(boxes(where, "unlike", (2, 3)), "gauss"), "unlike.toml")
    write_job(where, boxes(where, "matching", (3, 3)), "matching.toml")
    write_job(where, boxes(where, "fine", (4, 4)), "fine.toml")
    return where


def test_points_and_meshes_are_charted_by_the_peaks_of_their_own_sweeps(folder, capfd, written):
    done = attrito_here(folder, capfd, "chart", "unlike.toml", "--contacts", "matching.toml", "fine.toml", "-o", "c.h5")
    assert done.returncode == 0, done.stderr
    rows = list(csv.DictReader(io.StringIO(done.stdout)))
    labels = ["nodes", "Gauss points", "Gauss points in cut faces", "matching", "fine"]
    assert [row["setting"] for row in rows] == labels
    assert [row["series"] for row in rows] == ["points"] * 3 + ["meshes"] * 2
    # Side a, the upper box: nodes; four points a face; 3 x 3 on 2 x 2 faces make 4 x 4 pieces of two triangles each.
    assert [int(row["contacts"]) for row in rows] == [16, 36, 96, 16, 25]
    assert [row["chosen"] for row in rows] == ["false", "true", "false", "false", "false"]
    # The same peaks come from `attrito run` of each job.
    peaks = {}
    for name in ("unlike", "matching", "fine"):
        ran = attrito_here(folder, capfd, "run", f"{name}.toml")
        assert ran.returncode == 0, ran.stderr
        with h5py.File(folder / f"{name}.result.h5") as file:
            top = np.nanargmax(file["monitors/lid/amplitude"][:])
            peaks[name] = file["monitors/lid/amplitude"][top], file["points/frequency_hz"][top]
    error = {row["setting"]: float(row["error"]) for row in rows[:4]}
    for label, name in (("Gauss points", "unlike"), ("matching", "matching")):
        assert error[label] == pytest.approx(abs(peaks[name][0] / peaks["fine"][0] - 1), rel=1e-5)
    assert float(rows[1]["frequency_hz"]) == pytest.approx(peaks["unlike"][1], rel=1e-5)
    assert rows[4]["note"] == chart.REFERENCE and not rows[4]["error"]
    # Each way but the reference is a mark with its label in both panels; the title says what they are compared with.
    (figure,) = written
    for axes in figure.axes:
        texts = [text.get_text() for text in axes.texts]
        assert texts == ["nodes: 16", "Gauss points: 36", "Gauss points in cut faces: 96", "matching: 16"]
    assert re.search(r"level 1; reference: fine, peak at 0\.05\d* Hz$", figure.texts[0].get_text())
    with h5py.File(folder / "c.h5") as file:
        assert file["contacts"][:].tolist() == [16, 36, 96, 16, 25]
        assert file["error"][:4] == pytest.approx(list(error.values()), rel=1e-5)


def test_without_other_jobs_kinds_of_points_are_held_against_cut_faces(folder):
    said = []
    found = chart.chart_contacts(str(folder / "unlike.toml"), say=said.append)
    ways = {way.label: way for way in found.ways}
    assert list(ways) == ["nodes", "Gauss points", "Gauss points in cut faces"]
    assert ways["nodes"].error > 2 * ways["Gauss points"].error > 0
    assert ways["Gauss points in cut faces"].note == chart.REFERENCE
    assert ways["Gauss points"].own and found.quantity == "Relative error of the peak"
    assert any(re.match(r"nodes: 16 contacts, peak of lid 2\.8\d* at 0\.052\d* Hz, ", line) for line in said)


def test_a_job_of_node_pairs_is_charted_against_other_meshes_alone(folder):
    found = chart.chart_contacts(str(folder / "matching.toml"), [str(folder / "fine.toml")])
    assert [(way.series, way.label) for way in found.ways] == [("points", "pairs of nodes"), ("meshes", "fine")]
    with pytest.raises(
        InputError, match='= .no pairing.: expected a contact set with pairing = "face", or another job'
    ):
        chart.chart_contacts(str(folder / "matching.toml"))


def test_contacts_on_the_ground_are_not_cut(tmp_path):
    job = on_faces(boxes(tmp_path, "ground", (1, 2)), "node")
    job["contact_set"][0] |= {"b": "ground"}
    write_job(tmp_path, job)
    found = chart.chart_contacts(str(tmp_path / "job.toml"))
    assert [(way.label, way.contacts) for way in found.ways] == [("nodes", 9), ("Gauss points", 16)]


def test_jobs_with_other_monitors_or_levels_are_refused_together(folder):
    other = boxes(folder, "other", (2, 2))
    other["output"]["monitors"][0]["name"] = "top"
    other["sweep"]["levels"] = [1.0, 2.0]
    path = folder / write_job(folder, other, "other.toml")
    with pytest.raises(InputError) as caught:
        chart.chart_contacts(str(folder / "unlike.toml"), [str(path)])
    assert f"{path}: [output] monitors = ['top']: expected ['lid'], as in " in str(caught.value)
    assert f"{path}: [sweep] levels = [2.0]: expected [1.0], as in " in str(caught.value)


def test_a_way_without_a_solution_is_noted_and_a_reference_without_one_ends_the_chart(folder, monkeypatch):
    lost = []
    at_peak = chart._at_peak

    def lose(way, points, monitors):
        points = [point._replace(outcome="not_converged") if way.label in lost else point for point in points]
        return at_peak(way, points, monitors)

    monkeypatch.setattr(chart, "_at_peak", lose)
    lost[:] = ["nodes"]
    ways = {way.label: way for way in chart.chart_contacts(str(folder / "unlike.toml")).ways}
    assert ways["nodes"].note == "no point of the sweep converged: not_converged" and np.isnan(ways["nodes"].error)
    lost[:] = ["Gauss points in cut faces"]
    with pytest.raises(NumericsError, match="the reference, Gauss points in cut faces, has no solution"):
        chart.chart_contacts(str(folder / "unlike.toml"))
    lost[:] = ["nodes", "Gauss points"]
    with pytest.raises(NumericsError, match="no way but the reference has a solution"):
        chart.chart_contacts(str(folder / "unlike.toml"))


def test_a_chart_of_contacts_spares_the_other_jobs_and_is_none_of_the_mode(folder, capfd):
    before = (folder / "fine.toml").read_text()
    done = attrito_here(folder, capfd, "chart", "unlike.toml", "--contacts", "fine.toml", "-o", "fine.toml")
    assert done.returncode == 2 and (folder / "fine.toml").read_text() == before
    with pytest.raises(SystemExit, match="2"):
        attrito_here(folder, capfd, "chart", "unlike.toml", "--mode", "--contacts")
    assert "argument --contacts: not allowed with argument --mode" in capfd.readouterr().err
