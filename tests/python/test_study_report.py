"""`attrito report` of studies: its numbers are those of the samples, and it says how far to trust them."""

from __future__ import annotations

from pathlib import Path

import h5py
import jobs
import mode_jobs
import numpy as np
import pytest
from edited import edited
from report_pages import Outline, check_page
from scipy.stats import spearmanr

from attrito.studies.report import distribution, trust, varied, write_study_report
from attrito.studies.summary import read_summary
from attrito.support.errors import InputError

MU = {"name": "mu", "keys": ["contact[*].friction_coefficient"], "low": 0.3, "high": 0.6}
PRELOAD = {"name": "preload", "keys": ["static.load_path[1]"], "low": 0.8, "high": 1.2}


def study(folder: Path, capfd, name: str, **changes) -> Path:
    """A study of the wedge; its file."""
    made = jobs.wedge(force=1.0)
    made["sweep"] = {"start_hz": 150.0, "stop_hz": 85.0}
    made["static"] = {"load_path": [0.0, 1.0]}
    made["peak"] = {"start": 10.0}
    jobs.write_job(folder, made)
    keys = {"job": "job.toml", "file": f"{name}.h5", "samples": 12, "picture": False, "vary": [MU, PRELOAD]} | changes
    jobs.write_job(folder, keys, f"{name}.toml")
    done = jobs.attrito_here(folder, capfd, "study", f"{name}.toml")
    assert done.returncode == 0, done.stderr
    return folder / f"{name}.h5"


def mode_study(folder: Path, capfd) -> Path:
    """A study of the modes of a mass on a Coulomb element; its file."""
    jobs.write_job(folder, mode_jobs.rubbing(stop=5.0e-3), "mode_job.toml")
    keys = {"job": "mode_job.toml", "of": "modes", "file": "modes.h5", "samples": 3, "picture": False, "vary": [MU]}
    jobs.write_job(folder, keys, "modes.toml")
    done = jobs.attrito_here(folder, capfd, "study", "modes.toml")
    assert done.returncode == 0, done.stderr
    return folder / "modes.h5"


def words_of(path: Path) -> str:
    """Of a page that is well-formed and stands alone."""
    outline: Outline = check_page(path.read_text())
    return " ".join("".join(outline.text).split())


def test_a_study_by_gradients_stands_beside_one_whose_samples_are_solved(tmp_path, capfd):
    modelled = study(tmp_path, capfd, "model", design="second_order")
    sampled = study(tmp_path, capfd, "sampled", design="latin_hypercube")
    done = jobs.attrito_here(tmp_path, capfd, "report", "model.h5", "--beside", "sampled.h5")
    assert done.returncode == 0 and done.stdout.strip() == "model.report.html", done.stderr
    words = words_of(tmp_path / "model.report.html")
    for said in ("The resonance peak of 12 samples, from 7 solved, second order", "of other solved samples", "Job"):
        assert said in words
    header, rows = distribution(read_summary(str(modelled)), read_summary(str(sampled)))
    assert [row[2] for row in rows] == ["second order", "latin hypercube", "difference, %"]
    for path, row in ((modelled, rows[0]), (sampled, rows[1])):
        with h5py.File(path) as file:
            amplitude = file["peaks/amplitude"][:, 0]
        exact = [amplitude.mean(), amplitude.std(ddof=1), *np.quantile(amplitude, [0.05, 0.25, 0.5, 0.75, 0.95])]
        # Five digits are shown.
        assert [float(cell) for cell in row[3:]] == pytest.approx(exact, rel=1e-4)
        assert all(cell in words for cell in row[3:])
    differences = 100.0 * (np.array(rows[0][3:], dtype=float) / np.array(rows[1][3:], dtype=float) - 1.0)
    # Of numbers with five digits, two digits of what differs: 0.01 and 5 % of it
    assert [float(cell) for cell in rows[2][3:]] == pytest.approx(differences, rel=0.06, abs=0.02)
    assert len(header) == len(rows[0])


def test_what_is_varied_is_listed_with_how_the_peak_goes_with_it(tmp_path, capfd):
    path = study(tmp_path, capfd, "sampled", samples=8, vary=[MU])
    header, rows = varied(read_summary(str(path)))
    with h5py.File(path) as file:
        mu, amplitude = file["values/mu"][:], file["peaks/amplitude"][:, 0]
    assert header[-1] == "rank correlation with amplitude, level 10"
    assert rows == [["mu", "contact[*].friction_coefficient", f"{mu.min():.5g}", f"{mu.max():.5g}", rows[0][-1]]]
    assert float(rows[0][-1]) == pytest.approx(spearmanr(mu, amplitude).statistic, abs=0.005)


def test_studies_of_responses_and_modes_have_pages_too_and_each_fits_two_sheets(tmp_path, capfd):
    files = [
        study(tmp_path, capfd, "response", of="response", design="second_order", samples=4, vary=[MU]),
        mode_study(tmp_path, capfd),
    ]
    for path, said in zip(
        files, ("The frequency response of 4 samples", "The nonlinear mode of 3 samples"), strict=True
    ):
        page, sheets = path.with_suffix(".html"), path.with_suffix(".pdf")
        write_study_report(path, page)
        assert said in words_of(page)
        write_study_report(path, sheets)
        assert sheets.read_bytes().startswith(b"%PDF")


def test_what_is_not_to_be_trusted_is_a_warning(tmp_path, capfd):
    path = study(tmp_path, capfd, "model", design="second_order")
    assert not any(warn for *_, warn in trust(read_summary(str(path))))
    with edited(path) as file:
        file["model_error/amplitude"][0] = 0.2
        file["peaks/outcome"][3] = list(file["peaks/outcome"].attrs["names"]).index("not_converged")
        file.attrs["warnings"] = "something is amiss"
    warned = [(about, line) for about, line, warn in trust(read_summary(str(path))) if warn]
    assert [about for about, _ in warned] == ["Solved", "Model", "Warnings"]
    assert "1 not_converged" in warned[0][1] and "does not hold" in warned[1][1] and "Something" in warned[2][1]


def test_what_is_no_study_to_stand_beside_is_a_fault(tmp_path, capfd):
    path = study(tmp_path, capfd, "sampled", samples=2, vary=[MU])
    with pytest.raises(InputError, match="modes over amplitude"):
        write_study_report(path, tmp_path / "page.html", mode_study(tmp_path, capfd))
    for options, key in (
        (("sampled.h5", "--beside", "absent.h5"), "absent.h5"),
        (("sampled.h5", "--point", "1"), "--point"),
        (("sampled.h5", "-o", "sampled.h5"), "-o"),
    ):
        done = jobs.attrito_here(tmp_path, capfd, "report", *options)
        assert done.returncode == 2 and key in done.stderr
    made = jobs.wedge(force=1.0)
    made["sweep"] = {"frequencies_hz": [132.0]}
    jobs.write_job(tmp_path, made, "run.toml")
    assert jobs.attrito_here(tmp_path, capfd, "run", "run.toml").returncode == 0
    done = jobs.attrito_here(tmp_path, capfd, "report", "result.h5", "--beside", "sampled.h5")
    assert done.returncode == 2 and "--beside" in done.stderr
