"""Studies by second-order models from values: exact for quadratics, near sampled peaks, warned of where they fail."""

from __future__ import annotations

from pathlib import Path

import h5py
import jobs
import numpy as np
import pytest

from attrito.studies.value_nodes import model, nodes

MU = {"name": "mu", "keys": ["contact[*].friction_coefficient"], "low": 0.4, "high": 0.5}
PRELOAD = {"name": "preload", "keys": ["static.load_path[1]"], "low": 0.9, "high": 1.1}


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_a_quadratic_is_its_own_model(count: int) -> None:
    random = np.random.default_rng(count)
    bend, slope = random.standard_normal((count, count)), random.standard_normal(count)

    def function(x: np.ndarray) -> np.ndarray:
        return 2.0 + x @ slope + np.einsum("ni,ij,nj->n", x, bend, x)

    at = nodes(count)
    assert len(at) == (count + 1) * (count + 2) // 2
    places = random.uniform(-1.0, 1.0, (20, count))
    assert model(function(at), places) == pytest.approx(function(places), rel=1e-12)


def study(folder: Path, capfd: pytest.CaptureFixture[str], design: str, **changes: object) -> tuple[h5py.File, str]:
    """The peaks of the wedge where it slips, for some friction and preload."""
    made = jobs.wedge(force=1.0)
    made["sweep"] = {"start_hz": 150.0, "stop_hz": 85.0}
    made["balance"] = {"harmonics": 3}
    made["static"] = {"load_path": [0.0, 1.0]}
    made["peak"] = {"start": 25.0}
    jobs.write_job(folder, made)
    keys = {"job": "job.toml", "file": f"{design}.h5", "samples": 30, "design": design, "vary": [MU, PRELOAD]} | changes
    jobs.write_job(folder, keys, f"{design}.toml")
    done = jobs.attrito_here(folder, capfd, "study", f"{design}.toml")
    assert done.returncode == 0, done.stderr
    return h5py.File(folder / f"{design}.h5"), done.stdout + done.stderr


def test_the_model_is_near_sampled_peaks(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    modelled, words = study(tmp_path, capfd, "second_order", hessian="values")
    assert "10 of 30 samples" in words and "it does not hold" not in words
    sampled, _ = study(tmp_path, capfd, "latin_hypercube")
    with modelled, sampled:
        for name in ("mu", "preload"):
            assert np.array_equal(modelled[f"values/{name}"], sampled[f"values/{name}"])
        for name, tolerance in (("amplitude", 0.01), ("frequency_hz", 1e-3)):
            # Third derivatives over a tenth of the values: some 1e-3 of the amplitude.
            assert modelled[f"peaks/{name}"][:] == pytest.approx(sampled[f"peaks/{name}"][:], rel=tolerance)
        assert set(modelled["peaks/states"][:].ravel()) == {-1}


def test_where_it_does_not_hold_it_says_so(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    # From slip all over the period to stuck contacts.
    found, words = study(tmp_path, capfd, "second_order", vary=[PRELOAD | {"low": 0.2, "high": 6.0}])
    with found:
        assert "it does not hold" in words
        assert "it does not hold" in found.attrs["warnings"]


def test_a_model_of_values_is_refused(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    jobs.write_job(tmp_path, jobs.wedge())
    vary = [{"name": "mu", "keys": MU["keys"], "values": [0.2, 0.3]}]
    jobs.write_job(tmp_path, {"job": "job.toml", "samples": 5, "design": "second_order", "vary": vary}, "study.toml")
    done = jobs.attrito_here(tmp_path, capfd, "study", "study.toml")
    assert done.returncode == 2
    assert 'low and high with design = "second_order"' in done.stderr
