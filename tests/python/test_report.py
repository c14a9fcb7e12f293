"""The report: one page that stands alone, says what the result says, and is laid out well in a browser."""

from __future__ import annotations

import json
import re
import shutil
import subprocess

import h5py
import numpy as np
import pytest
import synthetic
from edited import edited
from jobs import TIMEOUT, attrito_here, chain, wedge, write_job
from report_pages import check_page

from attrito.report.report import glance, make_page
from attrito.report.view import View
from attrito.results.result import Result
from attrito.support.errors import InputError

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
SECTIONS = (
    "How far to trust it",
    "Model",
    "Frequency response",
    "Contacts",
    "Hysteresis",
    "Harmonic content",
    "Uniqueness",
    "Stability",
    "Convergence",
    "Run",
    "Job",
    "Versions and references",
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Results of the wedge, with stability, and of a chain with two tangents."""
    place = tmp_path_factory.mktemp("report")
    job = wedge()
    job["sweep"] = {"start_hz": 138.0, "stop_hz": 126.0}
    job["stability"] = {"method": "monodromy"}
    write_job(place, job | {"output": job["output"] | {"file": "wedge.h5"}}, "wedge.toml")
    job = chain(2, tangents=2)
    job["sweep"] = {"frequencies_hz": [75.0, 78.0], "levels": [0.5, 1.0]}
    write_job(place, job | {"output": job["output"] | {"file": "chain.h5"}}, "chain.toml")
    return place


def report_of(folder, capfd, name: str) -> str:
    if not (folder / f"{name}.h5").exists():
        done = attrito_here(folder, capfd, "run", f"{name}.toml")
        assert done.returncode == 0, done.stderr
    done = attrito_here(folder, capfd, "report", f"{name}.h5", "-o", f"{name}.html")
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == f"{name}.html"
    return (folder / f"{name}.html").read_text()


@pytest.mark.parametrize("name", ["wedge", "chain"])
def test_a_report_stands_alone_and_has_every_section(folder, capfd, name):
    text = report_of(folder, capfd, name)
    outline = check_page(text)
    assert re.findall(r"<h2[^>]*>([^<]*)</h2>", text) == list(SECTIONS)
    assert "friction_coefficient = 0." in " ".join(outline.text)
    assert "doi:10.1016/j.jsv.2013.09.032" in " ".join(outline.text)
    # For those who hear a page, or have no mouse.
    assert text.count("<main>") == 1 and text.count('<div class="wide"') == text.count('role="region"') > 0


def test_the_numbers_of_a_report_are_those_of_the_result(folder, capfd):
    text = report_of(folder, capfd, "wedge")
    with Result(folder / "wedge.h5") as result:
        amplitude = result.monitor("x", "amplitude")
        peak = int(np.nanargmax(amplitude))
        energy = result.dataset("/contacts/dissipated_energy")[peak, 0]
        widest = float(np.max(result.array("/contacts/t1_high") - result.array("/contacts/t1_low")))
        loose, stable = (
            int((result.array(f"/points/{name}") == value).sum()) for name, value in (("unique", 0), ("stable", 1))
        )
        frequency = result.array("/points/frequency_hz")[peak]
    row = re.search(r"<tr><td>x</td>.*?</tr>", text).group(0)
    assert f"<td>{amplitude[peak]:.5g}</td>" in row and f"<td>{frequency:.6g}</td>" in row
    assert f"Contact 0: {energy:.3g} a period" in text
    assert f"whose T is {widest:.4g} wide" in text
    assert f"not unique at {loose} of" in text and f"{stable} points are stable" in text


def test_what_failed_and_what_is_unstable_is_told_first(tmp_path):
    outcome = ["converged", "not_converged", "unstable", "unstable", "converged", "no_period_one_orbit"]
    path = synthetic.write_result(
        tmp_path / "r.h5",
        [90.0, 91.0, 92.0, 93.0, 94.0, 95.0],
        {"tip": [1.0, np.nan, 3.0, 2.0, 1.0, np.nan]},
        outcome=outcome,
        stable=[1, -1, 0, 0, 1, -1],
        unique=[1, -1, 1, 1, 0, -1],
        estimate=[1e-3, np.nan, 0.2, 1e-3, 1e-3, np.nan],
    )
    with edited(path) as file:
        file["points"].attrs["incomplete"] = "the sweep ended at 95 Hz"
    with Result(path) as result:
        told = glance(View(result))
    warnings = [line for line, warn in told if warn]
    assert "2 points have no solution: 1 no_period_one_orbit, 1 not_converged." in warnings
    assert "2 points are stable. Unstable: 92 to 93 Hz." in warnings
    assert any("at most 2.0e-01" in line and "92 Hz" in line for line in warnings)
    assert "the sweep ended at 95 Hz" in warnings
    assert any("family" in line and "94 Hz" in line for line, _ in told)


def test_points_above_the_tolerance_and_without_an_estimate_are_counted_first(tmp_path):
    path = synthetic.write_result(
        tmp_path / "r.h5",
        [90.0, 91.0, 92.0, 93.0],
        {"tip": [1.0, 3.0, 2.0, 1.0]},
        outcome=["converged", "above_tolerance", "above_tolerance", "converged"],
        estimate=[1e-3, 2e-2, np.nan, np.nan],
    )
    with Result(path) as result:
        lines = glance(View(result))
    assert ("2 points are above the tolerance, or of unknown error: 91 to 92 Hz.", True) in lines
    assert ("2 points are without an estimated error: 92 to 93 Hz.", True) in lines


def test_sliders_that_drift_are_no_examination_of_stability(tmp_path):
    path = synthetic.write_result(
        tmp_path / "r.h5", [90.0, 91.0], {"tip": [1.0, 2.0]}, outcome=["converged", "indeterminate"]
    )
    with Result(path) as result:
        lines = glance(View(result))
    assert ("Stability was not examined ([stability] method).", False) in lines
    assert ("1 point is indeterminate: sliders still move from period to period.", True) in lines
    assert not any("stable." in line for line, _ in lines)
    with edited(path) as file:
        reasons = ["", "a multiplier is too near the unit circle"]
        file.create_dataset("stability/reason", data=reasons, dtype=h5py.string_dtype())
        file["points/stable"][:] = [1, -1]
    with Result(path) as result:
        lines = glance(View(result))
    assert ("1 points are stable. No point that was examined is unstable.", False) in lines
    assert ("1 points have no verdict on their stability.", True) in lines


def test_a_report_says_of_how_many_families_the_reach_is_not_known_and_that_the_mean_was_frozen(tmp_path):
    path = synthetic.write_result(
        tmp_path / "r.h5",
        [90.0, 91.0, 92.0],
        {"tip": [1.0, 2.0, 4.0]},
        unique=[0, 0, 0],
        tip_low=[1.0, 1.9, np.nan],
        tip_high=[1.0, 2.1, np.nan],
    )
    with edited(path) as file:
        file.attrs["job"] = json.dumps({"balance": {"approach": "uncoupled"}})
    with Result(path) as result:
        assert View(result).amplitude_widths() == pytest.approx([0.0, 0.1, np.nan], rel=1e-12, nan_ok=True)
        told = glance(View(result))
    family = next(line for line, _ in told if "family" in line)
    assert "not unique at 3 of 3 points, each one of a family of solutions (90 to 92 Hz)" in family
    assert "differ by at most 10 %, 1 points not examined" in family
    assert any(line.startswith("Uncoupled: ") and warn for line, warn in told)


def test_bifurcations_are_counted_first_and_listed(tmp_path):
    path = synthetic.write_result(tmp_path / "r.h5", [90.0, 91.0], {"tip": [1.0, 2.0]}, level=[3.0, 3.0])
    with edited(path) as file:
        file["monitors/tip"].create_dataset("harmonics", data=np.ones((2, 3)))
        group = file.create_group("bifurcations")
        columns = {"frequency_hz": [90.25, 90.5], "uncertain_hz": [1e-6, 1e-7], "level": [3.0, 3.0], "kind": [0, 1]}
        columns |= {"real": [np.nan, -1.0], "imag": [np.nan, 0.0], "branch": [0, 0], "point": [1, 1]}
        columns |= {"amplitude/tip": [1.2, 1.5]}
        for name, values in columns.items():
            group.create_dataset(name, data=values)
        group["kind"].attrs["names"] = np.array(["contact_fold", "flip"], dtype="S16")
    with Result(path) as result:
        assert ("Located along sweeps: 1 contact fold, 1 flip.", False) in glance(View(result))
        text = make_page(result).html()
    check_page(text)
    assert "<tr><td>contact fold</td><td>90.25</td><td>1.0e-06</td><td>3</td><td>-</td></tr>" in text
    assert "<tr><td>flip</td><td>90.5</td><td>1.0e-07</td><td>3</td><td>-1.0000 +0.0000i</td></tr>" in text


def test_stretches_end_where_level_or_branch_changes(tmp_path):
    path = synthetic.write_result(
        tmp_path / "r.h5", [1.0, 2.0, 1.0, 2.0, 3.0], {"tip": [1.0] * 5}, level=[1, 1, 2, 2, 2], branch=[0, 0, 1, 1, 2]
    )
    with Result(path) as result:
        words = View(result).ranges(np.array([True, True, True, True, True]))
    assert words == "1 to 2 Hz at level 1; 1 to 2 Hz at level 2; 3 Hz at level 2"


@pytest.mark.parametrize("amplitude", ([], [np.nan], [0.0, 1.0]), ids=["no point", "nothing solved", "no contacts"])
def test_a_result_with_little_in_it_still_makes_a_page(tmp_path, amplitude):
    outcome = ["converged" if np.isfinite(value) else "not_converged" for value in amplitude]
    frequency = np.linspace(1.0, 2.0, len(amplitude))
    path = synthetic.write_result(tmp_path / "r.h5", frequency, {"tip": amplitude}, outcome=outcome)
    with edited(path) as file:
        file["monitors/tip"].create_dataset("harmonics", data=np.ones((len(amplitude), 3)))
        file["monitors/tip/harmonics"].attrs["unit"] = "user length"
    with Result(path) as result:
        check_page(make_page(result).html())


def test_names_in_a_file_are_text_on_the_page_and_nothing_else(tmp_path):
    name = "<script>alert(1)</script>&\"'"
    path = synthetic.write_result(tmp_path / "r.h5", [1.0, 2.0], {"tip": [1.0, 2.0]})
    with edited(path) as file:
        file["monitors/tip"].create_dataset("harmonics", data=np.ones((2, 3)))
        file.attrs["job_file"], file.attrs["references"] = name, f"{name}; {name}"
        file["points"].attrs["incomplete"] = name
        file.create_group("run").attrs[name] = name
    with Result(path) as result:
        outline = check_page(make_page(result).html())
    assert " ".join(outline.text).count(name) == 6


def test_a_linear_response_of_another_length_than_its_frequencies_is_a_fault(tmp_path):
    path = synthetic.write_result(tmp_path / "r.h5", [1.0, 2.0], {"tip": [1.0, 2.0]})
    with edited(path) as file:
        file["linear/stuck/frequency_hz"], file["linear/stuck/tip"] = np.ones(1), np.ones(0)
    with (
        Result(path) as result,
        pytest.raises(InputError, match="/linear/stuck/tip = .*one amplitude for each of the 1"),
    ):
        make_page(result)


def test_a_page_that_cannot_be_written_is_a_fault(folder, capfd):
    report_of(folder, capfd, "wedge")
    done = attrito_here(folder, capfd, "report", "wedge.h5", "-o", "none/page.html")
    assert done.returncode == 2 and "none/page.html" in done.stderr
    done = attrito_here(folder, capfd, "report", "wedge.h5", "--point", "100000")
    assert done.returncode == 2 and "expected a number from 0 to" in done.stderr


@pytest.mark.skipif(BROWSER is None, reason="no browser here: the tests above read the page, this one lays it out")
@pytest.mark.parametrize("width", [500, 1280])
def test_a_browser_lays_the_page_out_within_its_width(folder, capfd, width):
    report_of(folder, capfd, "wedge")
    measure = """<script>
      const wide = [...document.querySelectorAll('svg')].map(s => s.getBoundingClientRect());
      document.body.dataset.told = JSON.stringify([innerWidth, document.documentElement.scrollWidth, wide.length,
        Math.min(...wide.map(b => b.width)), Math.min(...wide.map(b => b.height)),
        Math.min(...[...document.querySelectorAll('svg text')].map(t => t.getBoundingClientRect().height))]);
    </script></body>"""
    page = folder / f"measured_{width}.html"
    page.write_text((folder / "wedge.html").read_text().replace("</body>", measure))
    options = [
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        f"--user-data-dir={folder}/profile",
        "--virtual-time-budget=2000",
    ]
    command = [BROWSER, *options, f"--window-size={width},900", "--dump-dom", page.as_uri()]
    dumped = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT, check=True).stdout
    told = re.search(r'data-told="\[([^\]]*)\]"', dumped).group(1)
    inner, scroll, figures, narrowest, lowest, letters = map(float, told.split(","))
    assert scroll <= inner and figures >= 8
    assert narrowest > 200 and lowest > 100
    # 9 pixels on a phone is the least that can be read.
    assert letters >= 9
