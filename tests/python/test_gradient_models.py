"""Studies by models of first and second order from gradients: peaks and whole curves, closed forms, where they fail."""

from __future__ import annotations

import contextlib
from pathlib import Path

import h5py
import jobs
import numpy as np
import pytest
from mpi4py import MPI
from scipy.stats import qmc

from attrito.job.reading import read_job
from attrito.runs.progress import Progress
from attrito.studies.design import read_study
from attrito.studies.gradient_nodes import expand, gradient_nodes
from attrito.studies.samples import shared_scene
from attrito.studies.sloped_peaks import SlopedPeaks
from attrito.studies.statistics import latin_hypercube

STIFFNESS = {"keys": ["contact[*].tangential_stiffness"], "name": "kt", "low": 2.4e5, "high": 3.6e5}
MU = {"name": "mu", "keys": ["contact[*].friction_coefficient"], "low": 0.4, "high": 0.5}
PRELOAD = {"name": "preload", "keys": ["static.load_path[1]"], "low": 0.9, "high": 1.1}
LEVEL = {"name": "level", "keys": ["peak.start"], "low": 20.0, "high": 30.0}
QUANTILES = np.array([0.05, 0.25, 0.5, 0.75, 0.95])


@pytest.mark.parametrize("central", [False, True])
@pytest.mark.parametrize("count", [1, 2, 3, 4, 5])
def test_a_quadratic_is_its_own_model_by_gradients(count: int, central: bool) -> None:
    random = np.random.default_rng(count)
    bend, slope = random.standard_normal((count, count)), random.standard_normal(count)

    def function(x: np.ndarray) -> np.ndarray:
        return 2.0 + x @ slope + np.einsum("ni,ij,nj->n", x, bend, x)

    at = gradient_nodes(count, central)
    assert len(at) == (2 * count if central else count + 1)
    places = random.uniform(-1.0, 1.0, (20, count))
    found = expand(at, function(at), slope + at @ (bend + bend.T))
    assert found.at(places) == pytest.approx(function(places), rel=1e-12, abs=1e-12)
    assert found.slopes(places) == pytest.approx(slope + places @ (bend + bend.T), rel=1e-11, abs=1e-11)


@pytest.mark.parametrize("central", [False, True])
@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 6])
def test_nodes_are_inside_and_have_the_moments_of_the_samples(count: int, central: bool) -> None:
    at = gradient_nodes(count, central)
    assert np.abs(at).max() < 1.0
    assert at.mean(axis=0) == pytest.approx(np.zeros(count), abs=1e-14)
    assert at.T @ at / len(at) == pytest.approx(np.eye(count) / 3.0, abs=1e-14)
    if central:
        thirds = np.einsum("ni,nj,nk->ijk", at, at, at) / len(at)
        assert thirds == pytest.approx(np.zeros(thirds.shape), abs=1e-14)


@pytest.mark.parametrize(("samples", "count"), [(1, 1), (7, 3), (1000, 2)])
def test_samples_are_those_of_scipy_s_latin_hypercube(samples: int, count: int) -> None:
    known = qmc.LatinHypercube(count, seed=np.random.default_rng(5)).random(samples)
    assert np.array_equal(latin_hypercube(samples, count, seed=5), known)


def amplitude(omega: float, stiffness: np.ndarray) -> np.ndarray:
    """Of an oscillator of unit mass with damping 0.1 under a unit force."""
    return 1.0 / np.hypot(stiffness - omega**2, 0.1 * omega)


@pytest.mark.parametrize(("order", "nodes"), [(1, 0), (2, 2)])
def test_quantiles_of_a_linear_oscillator_have_the_order_of_the_model(order: int, nodes: int) -> None:
    """Halving the spread divides what is missed of the quantiles by 2^(order + 1), to its next order."""
    omega, errors = 1.05, []
    x = np.linspace(-1.0, 1.0, 20001)
    for spread in (0.02, 0.01):
        stiffness = 1.0 + spread * x
        at = gradient_nodes(1) if nodes else np.zeros((1, 1))
        there = 1.0 + spread * at[:, 0]
        step = 1e-5
        slope = spread * (amplitude(omega, there + step) - amplitude(omega, there - step)) / (2.0 * step)
        model = expand(at, amplitude(omega, there), slope[:, np.newaxis], order).at(x[:, np.newaxis])
        exact = np.quantile(amplitude(omega, stiffness), QUANTILES)
        errors.append(np.abs(np.quantile(model, QUANTILES) - exact).max() / np.ptp(exact))
    # Relative to the spread of the quantiles, which halves as well
    assert errors[0] / errors[1] == pytest.approx(2.0**order, rel=0.25)


def wedge(folder: Path, **changes: object) -> str:
    """The wedge where it slips, with its study."""
    made = jobs.wedge(force=1.0)
    made["sweep"] = {"start_hz": 150.0, "stop_hz": 85.0}
    made["balance"] = {"harmonics": 3}
    made["static"] = {"load_path": [0.0, 1.0]}
    made["peak"] = {"start": 25.0}
    jobs.write_job(folder, made)
    keys = {"job": "job.toml", "samples": 60, "design": "second_order", "vary": [MU, PRELOAD]} | changes
    keys |= {"file": f"{keys['design']}.h5"}
    name = f"{keys['design']}.toml"
    jobs.write_job(folder, keys, name)
    return str(folder / name)


def study(folder: Path, capfd: pytest.CaptureFixture[str], **changes: object) -> tuple[h5py.File, str]:
    """The file of a study of the wedge, and what it said."""
    name = Path(wedge(folder, **changes)).name
    done = jobs.attrito_here(folder, capfd, "study", name)
    assert done.returncode == 0, done.stderr
    return h5py.File(folder / name.replace(".toml", ".h5")), done.stdout + done.stderr


@pytest.mark.parametrize("amplitude_of", ["half_range", "first_harmonic"])
def test_slopes_of_peaks_are_those_of_differences_and_so_is_the_hessian(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, amplitude_of: str
) -> None:
    comm = MPI.COMM_WORLD
    monkeypatch.chdir(tmp_path)
    asked = read_study(wedge(tmp_path, vary=[STIFFNESS, MU, PRELOAD, LEVEL]))
    job = read_job(asked.job)
    job["peak"]["amplitude"] = amplitude_of
    base, rom = shared_scene(comm, job, asked.keeps_places(job), Progress(comm), reads=True)
    low, high = asked.bounds
    with contextlib.closing(SlopedPeaks(comm, base, rom, asked, job)) as peaks:
        assert peaks.unknown() == []

        def at(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            # By x, -1 to 1 over what is varied
            (row,) = peaks.at(asked.middle + 0.5 * (high - low) * x)
            names = ("amplitude", "frequency_hz")
            return np.array([row[name] for name in names]), 0.5 * (high - low) * [row["slopes"][name] for name in names]

        step = 0.02
        middle, slopes = at(np.zeros(4))
        hessian = np.empty((4, 4))
        for i, unit in enumerate(np.eye(4)):
            (above, slopes_above), (below, slopes_below) = at(step * unit), at(-step * unit)
            # The third derivative over a step of 0.02 of half the range leaves some 1e-4 of the slope.
            known = 1 if amplitude_of == "first_harmonic" else 2
            scale = np.abs(slopes[:known]).max(axis=1)
            assert np.abs(slopes[:known, i] - (above - below)[:known] / (2.0 * step)) / scale == pytest.approx(
                0.0, abs=1e-3
            )
            hessian[i] = (slopes_above - slopes_below)[0] / (2.0 * step)
            second = (above - 2.0 * middle + below)[0] / step**2
            # Peaks are located to 1e-9 of their height: over a step of 0.02 that is 1e-5 of the second difference.
            assert hessian[i, i] == pytest.approx(second, abs=2e-3 * np.abs(hessian[: i + 1]).max())
    assert hessian == pytest.approx(hessian.T, abs=2e-3 * np.abs(hessian).max())


def test_bands_of_peaks_are_near_sampled_ones(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    modelled, words = study(tmp_path, capfd)
    assert "7 of 60 samples" in words and "does not hold" not in words
    first, words = study(tmp_path, capfd, design="first_order", picture=False)
    assert "5 of 60 samples" in words
    assert (tmp_path / "second_order.png").exists() and not (tmp_path / "first_order.png").exists()
    sampled, _ = study(tmp_path, capfd, design="latin_hypercube")
    with modelled, first, sampled:
        exact = sampled["peaks/amplitude"][:]
        for file, tolerance in ((modelled, 0.01), (first, 0.05)):
            # Third, second derivatives over a tenth of the values
            assert file["peaks/amplitude"][:] == pytest.approx(exact, rel=tolerance)
            assert file["mean/amplitude"][0] == pytest.approx(file["peaks/amplitude"][:, 0].mean(), rel=1e-12)
            assert file["deviation/amplitude"][0] == pytest.approx(exact.std(ddof=1), rel=10.0 * tolerance)
    done = jobs.attrito_here(tmp_path, capfd, "table", "second_order.h5", "--bands")
    assert done.stdout.startswith("level,amplitude_mean,amplitude_deviation,amplitude_05,amplitude_25,")


def test_bands_of_the_curve_are_near_sampled_ones(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    modelled, words = study(tmp_path, capfd, of="response")
    assert "7 of 60 samples" in words
    sampled, _ = study(tmp_path, capfd, of="response", design="latin_hypercube")
    with modelled, sampled:
        assert np.array_equal(modelled["parameter"], sampled["parameter"])
        exact = sampled["quantiles/amplitude"][:]
        # Of the largest amplitude; both curves are drawn to 1e-2 of it between their points.
        apart = np.abs(modelled["quantiles/amplitude"][:] - exact).max() / exact.max()
        assert apart < 0.02
        mean = np.abs(modelled["mean/amplitude"][:] - sampled["mean/amplitude"][:]).max() / exact.max()
        assert mean < 0.01
        # The test is void unless the band is wider than what it is found to.
        assert np.ptp(exact, axis=0).max() > 0.1 * exact.max()
    done = jobs.attrito_here(tmp_path, capfd, "table", "second_order.h5", "--bands")
    assert done.stdout.startswith("frequency_hz,amplitude_mean,amplitude_deviation,amplitude_05,")
    assert (tmp_path / "second_order.png").exists()


def test_groups_of_ranks_find_the_curves_of_one_process(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    alone, _ = study(tmp_path, capfd, of="response", batch=3)
    with alone:
        known = alone["response/amplitude"][:]
    (tmp_path / "second_order.h5").unlink()
    done = jobs.attrito(tmp_path, "study", "second_order.toml", ranks=2)
    assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "second_order.h5") as found:
        assert np.array_equal(found["response/amplitude"][:], known)


def test_bands_of_a_stuck_contact_are_those_of_the_linear_system(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """At every frequency the quantiles over the contact's stiffness, which is the oscillator's."""
    made = jobs.wedge(force=1.0)
    made["contact"] = [contact | {"normal_stiffness": 3.0e5} for contact in made["contact"]]
    made["sweep"] = {"start_hz": 95.0, "stop_hz": 150.0}
    made["balance"] = {"harmonics": 1}
    made["static"] = {"load_path": [0.0, 1.0]}
    made["peak"] = {"start": 1e-3}
    jobs.write_job(tmp_path, made)
    keys = {"job": "job.toml", "samples": 400, "design": "second_order", "of": "response", "vary": [STIFFNESS]}
    jobs.write_job(tmp_path, keys, "study.toml")
    done = jobs.attrito_here(tmp_path, capfd, "study", "study.toml")
    assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "study.h5") as found:
        at_hz, values = found["parameter"][:], found["values/kt"][:]
        stiffness, mass, damping = (np.array(made["model"][name]) for name in ("stiffness", "mass", "damping"))
        normal, tangent = np.array([1.0, 1.0]) / np.sqrt(2.0), np.array([-1.0, 1.0]) / np.sqrt(2.0)
        exact = np.empty((len(values), len(at_hz)))
        for row, kt in zip(exact, values, strict=True):
            whole = stiffness + kt * np.outer(tangent, tangent) + 3.0e5 * np.outer(normal, normal)
            omega = 2.0 * np.pi * at_hz[:, np.newaxis, np.newaxis]
            dynamic = whole - omega**2 * mass + 1j * omega * damping
            row[:] = np.abs(1e-3 * np.linalg.inv(dynamic)[:, 0] @ tangent)
        bands = np.quantile(exact, QUANTILES, axis=0)
        # Between points the curve is drawn to 1e-2 of the largest amplitude.
        assert np.abs(found["quantiles/amplitude"][:] - bands).max() < 0.01 * bands.max()
        assert np.ptp(bands, axis=0).max() > 0.3 * bands.max()


def test_where_the_model_of_a_curve_does_not_hold_it_says_so(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    # From slip all over the period to stuck contacts
    found, words = study(tmp_path, capfd, of="response", vary=[PRELOAD | {"low": 0.2, "high": 6.0}])
    with found:
        assert "it does not hold at " in words
        assert "how many contacts slip or are open differs between samples at " in words
        assert np.any(found["response/model_error"][:] > 0.05)


def test_gradients_that_there_are_not_are_refused_or_done_without(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    mass = {"name": "mass", "keys": ["model.mass[0][0]"], "low": 0.99, "high": 1.01}
    found, words = study(tmp_path, capfd, vary=[mass])
    found.close()
    assert "no exact derivatives by mass: the model is made of values alone" in words
    for changes in ({"design": "first_order"}, {"hessian": "gradients"}):
        name = Path(wedge(tmp_path, vary=[mass], **changes)).name
        done = jobs.attrito_here(tmp_path, capfd, "study", name)
        assert done.returncode == 2
        assert "quantities that they have exact derivatives by" in done.stderr
