"""Figures of a report that only it has, and its two pages of PDF: they say what the result says."""

from __future__ import annotations

import re

import numpy as np
import pytest
import synthetic
from edited import edited
from jobs import attrito_here, chain, write_job

from attrito.report.figures import dissipation
from attrito.report.outcome import outcome
from attrito.report.period import amplitudes, contact_forces, content, motion
from attrito.report.printout import MARGIN, SHEET, Printout, wrapped
from attrito.report.report import make_printout
from attrito.report.view import View
from attrito.results.loops import Loop
from attrito.results.result import Result


def test_amplitudes_of_harmonics_and_the_motion_are_those_of_a_closed_form():
    # 2 + 3 cos x - 4 sin x + 0.5 sin 2 x
    coefficients = np.array([2.0, 3.0, -4.0, 0.0, 0.5])
    assert amplitudes(coefficients) == pytest.approx([5.0, 0.5])
    instants = np.array([0.0, 0.1, 0.7])
    x = 2 * np.pi * instants
    assert motion(coefficients, instants) == pytest.approx(2 + 3 * np.cos(x) - 4 * np.sin(x) + 0.5 * np.sin(2 * x))


def test_the_content_of_a_monitor_is_drawn_as_it_is_stored(tmp_path):
    path = synthetic.write_result(tmp_path / "r.h5", [1.0, 2.0], {"tip": [1.0, 2.0]})
    stored = np.array([[0.0] * 7, [2.0, 3.0, -4.0, 0.0, 0.5, 0.0, 0.0]])
    with edited(path) as file:
        file["monitors/tip"].create_dataset("harmonics", data=stored).attrs["unit"] = "mm"
    with Result(path) as result:
        upper, lower = content(result, "tip", 1).axes
        lines = {line.get_label(): line.get_xydata() for line in upper.get_lines()}
    assert [bar.get_height() for bar in lower.patches] == pytest.approx([5.0, 0.5, 0.0])
    # About the mean: what is drawn at the start of the period is 3, and the first harmonic alone has an amplitude of 5.
    assert lines["motion"][0] == pytest.approx([0.0, 3.0])
    assert np.ptp(lines["first harmonic"][:, 1]) == pytest.approx(10.0, rel=1e-3)
    assert "mm" in upper.get_ylabel() and "mm" in lower.get_ylabel()


def test_forces_of_a_contact_close_and_stay_within_the_limits_that_are_drawn():
    phase = 2 * np.pi * np.arange(64) / 64
    loop = Loop("contact 0", np.cos(phase), 3.0 * np.cos(phase), 10.0 + 2.0 * np.sin(phase), 0.3)
    (axes,) = contact_forces(loop, "N").axes
    lines = {line.get_label(): line.get_xydata() for line in axes.get_lines()}
    assert lines["tangential"][0, 1] == lines["tangential"][-1, 1] and lines["normal"][16, 1] == pytest.approx(12.0)
    (band,) = axes.collections
    assert band.get_paths()[0].vertices[:, 1].max() == pytest.approx(0.3 * 12.0)
    assert "(N)" in axes.get_ylabel()


def test_dissipation_of_contact_sets_adds_up_to_that_of_all(tmp_path):
    data = synthetic.contact_data(3, 4)
    parameters = {"set": np.array([b"root", b"root", b"shroud", b"shroud"])}
    path = synthetic.write_result(
        tmp_path / "r.h5", [1.0, 2.0, 3.0], {"tip": [1.0, 2.0, 1.0]}, contacts=data, parameters=parameters
    )
    with Result(path) as result:
        (axes,) = dissipation(result, np.ones(3, dtype=bool)).axes
    lines = {line.get_label(): line.get_ydata() for line in axes.get_lines()}
    assert lines["all"] == pytest.approx(data["dissipated_energy"].sum(axis=1))
    assert lines["root"] + lines["shroud"] == pytest.approx(lines["all"])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("printout")
    job = chain(2, tangents=2)
    job["sweep"] = {"frequencies_hz": [75.0, 78.0], "levels": [0.5, 1.0]}
    write_job(place, job)
    return place


def solved(folder, capfd):
    if not (folder / "result.h5").exists():
        done = attrito_here(folder, capfd, "run", "job.toml")
        assert done.returncode == 0, done.stderr
    return folder / "result.h5"


def test_the_printout_has_two_pages_of_a4_for_the_file(folder, capfd):
    solved(folder, capfd)
    done = attrito_here(folder, capfd, "report", "result.h5", "--pdf")
    assert done.returncode == 0 and done.stdout.strip() == "report.pdf", done.stderr
    data = (folder / "report.pdf").read_bytes()
    assert data.startswith(b"%PDF-") and len(re.findall(rb"/Type /Page\b", data)) == 2
    boxes = re.findall(rb"/MediaBox \[ ?([\d. ]+)\]", data)
    for box in boxes:
        assert [float(side) for side in box.split()] == pytest.approx([0, 0, 595.276, 841.89], abs=0.01)
    # Letters are letters, not outlines.
    assert b"/Type /Font" in data


def test_an_ending_that_is_not_of_a_pdf_is_refused_with_pdf(folder, capfd):
    solved(folder, capfd)
    done = attrito_here(folder, capfd, "report", "result.h5", "--pdf", "-o", "page.html")
    assert done.returncode == 2 and "page.html" in done.stderr and not (folder / "page.html").exists()


def test_the_printout_says_what_the_page_says_and_stays_on_its_sheets(folder, capfd):
    with Result(solved(folder, capfd)) as result:
        printout = make_printout(result)
        first = outcome(View(result))[0]
        for page in (0, 1):
            sheet = printout._sheet(page)
            sheet.draw_without_rendering()
            words = " ".join(text.get_text() for text in sheet.texts)
            assert (first in words) == (page == 0)
            box = sheet.get_tightbbox()
            # Inches; nothing lies in the outer half of the margin.
            edge = 0.5 * MARGIN / 25.4
            assert box.x0 >= edge and box.y0 >= edge
            assert box.x1 <= SHEET[0] / 25.4 - edge and box.y1 <= SHEET[1] / 25.4 - edge
            drawn = [axes for part in sheet.subfigs for row in part.subfigs for one in row.subfigs for axes in one.axes]
            assert len(drawn) >= 2


def test_long_text_is_wrapped_within_its_width_and_none_is_lost():
    text = " ".join(f"word{i}" for i in range(60)) + " " + "w" * 300
    lines = wrapped(text, 200.0, 8.5)
    assert " ".join(lines) == text and len(lines) > 10
    assert wrapped("", 200.0, 8.5) == [""]


def test_more_text_than_a_page_holds_leaves_its_figures_room(tmp_path):
    printout = Printout("title", "line")
    for number in range(200):
        printout.text(0, f"sentence {number}")
    printout.panel(0, "loops", lambda look: look.figure((1, 1)).subplots())
    sheet = printout._sheet(0)
    sheet.draw_without_rendering()
    lowest = min(text.get_position()[1] for text in sheet.texts)
    assert lowest > 0.4 and "more" in sheet.texts[-1].get_text()
    assert sheet.subfigs
