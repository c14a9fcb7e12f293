"""The moving view of a report: its surface, its numbers, and that the page asks nothing of a network."""

from __future__ import annotations

import base64
import json
import re
import shutil
import subprocess
from html import unescape

import h5py
import numpy as np
import pytest
import synthetic
from edited import edited
from jobs import TIMEOUT, attrito_here, blocks, write_blocks, write_job

from attrito.model.outer_surface import outer_surface
from attrito.plots.solid import seen_faces
from attrito.report.motion import STEPS, drawn_harmonics, moving
from attrito.report.page import viewer
from attrito.report.report import make_page, make_printout
from attrito.report.trust import trust
from attrito.report.view import View
from attrito.results.mesh import mass_of, reduction_errors
from attrito.results.result import Result

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


def area_vector(points, faces):
    """Sum of the faces' area vectors, and of their areas' products with the first corner: volume times three."""
    last = np.where(faces[:, 3] >= 0, faces[:, 3], faces[:, 0])
    a, b, c, d = (points[corner] for corner in (*faces[:, :3].T, last))
    normal = 0.5 * np.cross(c - a, d - b)
    return normal, np.einsum("fd,fd->f", normal, (a + b + c + d) / 4).sum() / 3


@pytest.mark.parametrize("kind", ["C3D4", "C3D8", "C3D10", "C3D20"])
def test_the_outer_surface_is_closed_and_looks_outward(kind):
    model = synthetic.joint(kind, (3, 2, 1))
    surface = outer_surface(model, 10**6)
    points = model.coordinates[surface.nodes]
    normal, volume = area_vector(points, surface.faces)
    # Two unit boxes, of twelve unit squares in all.
    assert np.linalg.norm(normal, axis=1).sum() == pytest.approx(12.0, rel=1e-12)
    assert normal.sum(axis=0) == pytest.approx(0.0, abs=1e-12)
    assert volume == pytest.approx(2.0, rel=1e-12)


def test_fewer_vertices_are_nodes_of_the_mesh_and_keep_bodies_apart():
    model = synthetic.joint("C3D8", (8, 8, 8))
    whole, few = outer_surface(model, 10**6), outer_surface(model, 150)
    assert len(few.nodes) <= 150 < len(whole.nodes)
    assert np.isin(few.nodes, whole.nodes).all() and len(np.unique(few.nodes)) == len(few.nodes)
    assert set(np.unique(few.faces[few.faces >= 0])) == set(range(len(few.nodes)))
    # Nodes of the two boxes that meet lie at the same places; no face joins one to the other.
    lower = model.coordinates[few.nodes][:, 2] < 1 - 1e-9
    upper = model.coordinates[few.nodes][:, 2] > 1 + 1e-9
    rings = [face[face >= 0] for face in few.faces]
    assert not any(lower[ring].any() and upper[ring].any() for ring in rings)
    normal, volume = area_vector(model.coordinates[few.nodes], few.faces)
    # Cut corners take less than a layer of cells off every side of either box.
    assert (1 - 2 / 8) ** 3 * 2 < volume < 2 + 1e-9 and np.abs(normal.sum(axis=0)).max() < 1e-9


def test_faces_are_seen_from_outside_and_the_nearest_is_drawn_last():
    model = synthetic.joint("C3D8", (1, 1, 1))
    surface = outer_surface(model, 10**6)
    points = model.coordinates[surface.nodes]
    seen = seen_faces(points, surface.faces)
    # Three sides of either cube look at the viewer.
    assert len(seen.polygons) == 6 and np.all(seen.light > 0)
    assert points[seen.corners[-1]][:, 2].max() == pytest.approx(2.0)


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    folder = tmp_path_factory.mktemp("motion")
    write_blocks(folder / "model.h5")
    write_job(folder, blocks())
    return folder


@pytest.fixture
def result(solved, capfd):
    if not (solved / "result.h5").exists():
        done = attrito_here(solved, capfd, "run", "job.toml")
        assert done.returncode == 0, done.stderr
    with Result(solved / "result.h5") as opened:
        yield opened


def unpacked(text, kind, step):
    return step * np.frombuffer(base64.b64decode(text), kind)


def test_the_numbers_of_the_view_are_the_motion_of_the_monitor_s_node(result):
    view = View(result)
    found = moving(view)
    given = json.loads(found.numbers())
    monitor = view.job()["output"]["monitors"][0]
    ((_, node, direction), factor), *_ = monitor["dofs"]
    assert factor == 1.0
    (number,) = view.model.node_sets[node] if isinstance(node, str) else [node]
    place = int(np.flatnonzero(view.model.node_ids[outer_surface(view.model, 10**6).nodes] == number)[0])
    axis = {"x": 0, "y": 1, "z": 2}[direction]
    coefficients = result.monitor(view.monitors[0], "harmonics")[view.point]
    assert given["harmonics"][0] == 1
    for index, harmonic in enumerate(given["harmonics"]):
        for side in (0, 1):
            values = unpacked(given["series"][2 * index + side], "<i2", given["series_step"]).reshape(-1, 3)
            # Whole numbers of steps: half a step is lost.
            assert values[place, axis] == pytest.approx(
                coefficients[2 * harmonic - 1 + side], abs=0.501 * given["series_step"]
            )
    places = unpacked(given["places"], "<i2", given["place_step"]).reshape(-1, 3)
    apart = places - (found.points - 0.5 * (found.points.min(axis=0) + found.points.max(axis=0)))
    assert np.abs(apart).max() <= 0.501 * given["place_step"]
    assert given["series_step"] == pytest.approx(np.abs(found.motion.harmonics[1:]).max() / STEPS)


def test_harmonics_that_cannot_be_seen_are_left_out():
    harmonics = np.zeros((11, 2, 3))
    harmonics[1, 0, 0], harmonics[4, 1, 2], harmonics[5, 0, 0], harmonics[9, 0, 1] = 1.0, 0.02, 0.2, 1e-3
    assert drawn_harmonics(harmonics) == [1, 2, 3]


def test_the_script_asks_nothing_of_a_network_and_a_still_is_printed(result):
    text = make_page(result).html()
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', text).group(1)
    assert policy.startswith("default-src 'none'") and "http" not in policy
    scripts = re.findall(r"<script([^>]*)>(.*?)</script>", text, flags=re.DOTALL)
    assert [attributes.strip() for attributes, _ in scripts] == ['type="application/json"', ""]
    assert scripts[1][1].strip() == viewer().strip()
    assert not re.search(r"fetch|XMLHttp|WebSocket|import|eval|https?:|\.src", viewer())
    assert "prefers-reduced-motion" in viewer()
    (figure,) = re.findall(r'<figure class="motion">.*?</figure>', text, flags=re.DOTALL)
    assert '<div class="still"><svg' in figure


def test_the_mass_that_moves_is_that_of_the_free_nodes(result):
    # The mass matrix is that of unit masses at every node.
    model = View(result).model
    assert mass_of(result) == pytest.approx(model.size / 3, rel=1e-12)


def test_the_reduction_s_own_errors_are_among_what_to_trust(result, solved):
    with h5py.File(solved / "rom.h5") as rom:
        hertz, errors = rom["quality/frequency_hz"][:], rom["quality/frequency_error"][:]
    assert reduction_errors(result)[0] == pytest.approx(hertz)
    near = hertz <= max(1.5 * 60.0, hertz.min())
    lines = [words for about, words, _ in trust(View(result)) if about == "Reduction"]
    assert any(f"up to {hertz[near].max():.5g} Hz" in line and f"{errors[near].max():.1e}" in line for line in lines)
    labels = [about for about, *_ in trust(View(result))]
    assert [label for label in dict.fromkeys(labels) if label != "Warnings"] == [
        "Solved",
        "Error",
        "Stability",
        "Uniqueness",
        "Reduction",
    ]


def test_the_report_of_a_nonlinear_mode_moves_and_is_printed_too(solved, tmp_path, capfd):
    job = blocks() | {"mode": {"number": 4, "start": 1e-7, "stop": 1.2e-7, "points": 2, "file": "result.mode.h5"}}
    # Softer along its normals the fourth mode is there once; of equal modes any mixture could be the one.
    job["contact_set"] = [job["contact_set"][0] | {"normal_stiffness": 5.0e5}]
    job["model"]["file"] = str(solved / "model.h5")
    write_job(tmp_path, job)
    attrito_here(tmp_path, capfd, "mode", "job.toml")
    with Result(tmp_path / "result.mode.h5") as mode:
        text = make_page(mode).html()
        found = moving(View(mode))
        assert make_printout(mode)._panels[0][-1][0] == "Frequency and damping against amplitude"
    assert text.count('<figure class="motion">') == 1 and "Q = 1" in text
    assert json.loads(found.numbers())["harmonics"] == [1]


def test_faces_whose_motion_is_not_recovered_are_left_out_and_too_few_are_no_view(solved, tmp_path, capfd, monkeypatch):
    job = blocks()
    job["model"]["file"], job["reduction"]["recovery"] = str(solved / "model.h5"), "monitors"
    write_job(tmp_path, job)
    done = attrito_here(tmp_path, capfd, "run", "job.toml")
    assert done.returncode == 0, done.stderr
    with Result(tmp_path / "result.h5") as few:
        view = View(few)
        whole, found = outer_surface(view.model, 10**6), moving(view)
        part = len(found.faces) / len(whole.faces)
        # Nodes of the contact and held ones are known: of the upper box one side of six.
        assert 0.5 < part < 1.0
        monkeypatch.setattr("attrito.report.motion.LEAST_KNOWN", part + 0.01)
        assert moving(view) is None


def test_an_unfinished_mode_says_what_its_job_asked_for(tmp_path):
    path = synthetic.write_result(tmp_path / "m.h5", [100.0], {"tip": [1.0]})
    with edited(path) as file:
        file.attrs["format"] = "attrito mode"
        job = json.loads(file.attrs["job"]) | {"mode": {"method": "quasi_static", "near_hz": 99.0}}
        file.attrs["job"] = json.dumps(job)
        for name in ("amplitude", "damping_ratio", "damping_ratio_structure", "dissipated_energy"):
            file[f"points/{name}"] = np.full(1, 0.01)
    with Result(path) as result:
        text = make_page(result).html()
    assert "Tangent mode near 99.0 Hz, followed by cycles of quasi-static loading" in text and "100 Hz." in text


def test_without_its_reduced_model_a_report_has_no_moving_view(result, solved, tmp_path):
    path = tmp_path / "r.h5"
    path.write_bytes((solved / "result.h5").read_bytes())
    with edited(path) as file:
        file.attrs["rom_file"] = str(tmp_path / "gone.h5")
    with Result(path) as other:
        assert moving(View(other)) is None
        assert "<script" not in make_page(other).html()


WATCH = """<script>
  const canvas = document.querySelector("canvas"), shot = () => canvas.toDataURL(), found = {};
  const button = document.querySelector(".steer button"), wait = time => new Promise(done => setTimeout(done, time));
  (async () => {
    canvas.scrollIntoView();
    const first = shot(), empty = document.createElement("canvas");
    [empty.width, empty.height] = [canvas.width, canvas.height];
    found.drawn = first !== empty.toDataURL();
    for (let tries = 0; tries < 40 && shot() === first; tries++) await wait(100);
    found.moves = shot() !== first;
    found.offers = button.textContent;
    button.click();
    found.then_offers = button.textContent;
    const before = shot();
    canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowLeft" }));
    found.turns = shot() !== before;
    found.still = getComputedStyle(document.querySelector(".still")).display;
    document.body.dataset.found = JSON.stringify(found);
  })();
</script></body>"""


@pytest.mark.skipif(BROWSER is None, reason="no browser here: the tests above read the page, this one runs its script")
@pytest.mark.parametrize("reduced", [False, True])
def test_a_browser_moves_and_turns_the_view_and_starts_still_where_less_motion_is_wanted(result, tmp_path, reduced):
    page = tmp_path / "page.html"
    page.write_text(make_page(result).html().replace("</body>", WATCH))
    options = ["--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path}/profile"]
    options += ["--force-prefers-reduced-motion"] * reduced
    command = [BROWSER, *options, "--virtual-time-budget=8000", "--window-size=900,900", "--dump-dom", page.as_uri()]
    dumped = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT, check=True).stdout
    found = json.loads(unescape(re.search(r'data-found="([^"]*)"', dumped).group(1)))
    offers = ["Play", "Pause"] if reduced else ["Pause", "Play"]
    assert found == {
        "drawn": True,
        "moves": not reduced,
        "offers": offers[0],
        "then_offers": offers[1],
        "turns": True,
        "still": "none",
    }
