"""Jobs as functions of their parameters: values and derivatives, and what JAX makes of them."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from jobs import Job, wedge
from mpi4py import MPI
from slopes import STEP, pressed

import attrito
from attrito.support.errors import InputError

NAMES = ["contact[0].friction_coefficient", "contact[0].tangential_stiffness", "load.preload", "damping.rayleigh[0]"]
VALUES = np.array([0.5, 3.0e5, 1.1, 3.0])


@pytest.fixture
def job() -> Job:
    """The wedge, slipping, at two frequencies."""
    job = pressed(wedge(force=30.0)) | {"damping": {"rayleigh": [2.0, 1e-4]}}
    job["balance"] = {"harmonics": 5, "residual_tolerance": 1e-13}
    job["sweep"] = {"frequencies_hz": [120.0, 130.0]}
    return job


@pytest.mark.parametrize("quantity", ["x_amplitude", "dissipated_energy"])
def test_gradients_are_the_differences_of_values(tmp_path: Path, job: Job, quantity: str) -> None:
    names, start = [*NAMES, "level"], np.append(VALUES, 1.2)

    def at(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return attrito.value_and_gradient(job, names, quantity, values, MPI.COMM_SELF, folder=tmp_path)

    found, slopes = at(start)
    assert found.shape == (2,)
    differences = []
    for unit, scale in zip(np.eye(len(start)), start, strict=True):
        reached = [
            (at(start + step * unit)[0] - at(start - step * unit)[0]) / 2.0 for step in (STEP * scale, 2 * STEP * scale)
        ]
        differences.append((8.0 * reached[0] - reached[1]) / (6.0 * STEP))
    expected = np.stack(differences, axis=1)
    # Extrapolated differences leave the fourth power of the step.
    assert np.max(np.abs(slopes * start - expected)) < 1e-6 * np.max(np.abs(expected))


def test_values_are_those_of_the_job_that_has_them(tmp_path: Path, job: Job) -> None:
    found, _ = attrito.value_and_gradient(job, NAMES, "x_mean", VALUES, MPI.COMM_SELF, folder=tmp_path)
    (contact,) = job["contact"]
    job["contact"] = [contact | {"friction_coefficient": 0.5, "tangential_stiffness": 3.0e5}]
    job["static"] = {"load_path": [0.0, 1.1]}
    job["damping"] = {"rayleigh": [3.0, 1e-4]}
    with attrito.run(job, MPI.COMM_SELF, folder=tmp_path, quiet=True) as result:
        assert np.array_equal(result.monitors.x.mean, found)


@pytest.mark.parametrize(
    ("names", "quantity", "values", "expected"),
    [
        (["contact[7].gap"], "x_amplitude", [0.0], "one of the job's"),
        (["load.excitation"], "x_amplitude", [1.0], "a static load; of harmonic loads their level"),
        ([], "x_amplitude", [], "at least one"),
        (["load.preload"], "x_amplitude", [0.0], "a factor other than 0"),
        (["level"], "x", [1.0], "one of x_amplitude, x_mean"),
        (["level"], "x_amplitude", [1.0, 2.0], "1 numbers, one of each parameter"),
        (["level"], "x_amplitude", [-1.0], "above"),
    ],
)
def test_what_is_no_function(
    tmp_path: Path, job: Job, names: list[str], quantity: str, values: list[float], expected: str
) -> None:
    with pytest.raises(InputError, match=expected.replace("[", r"\[")):
        attrito.value_and_gradient(job, names, quantity, values, MPI.COMM_SELF, folder=tmp_path)


def test_a_level_among_several_is_no_parameter(tmp_path: Path, job: Job) -> None:
    job["sweep"]["levels"] = [1.0, 2.0]
    with pytest.raises(InputError, match="one, where it is a parameter"):
        attrito.value_and_gradient(job, ["level"], "x_amplitude", [1.0], MPI.COMM_SELF, folder=tmp_path)


def test_jax_differentiates_through_a_job(tmp_path: Path, job: Job) -> None:
    """By the chain rule: of a sum of squares of p^2."""
    jax = pytest.importorskip("jax", reason="JAX is not installed: pip install jax")
    with jax.experimental.enable_x64():
        function = attrito.jax_function(job, NAMES, "x_amplitude", MPI.COMM_SELF, folder=tmp_path)
        found, slopes = attrito.value_and_gradient(job, NAMES, "x_amplitude", VALUES, MPI.COMM_SELF, folder=tmp_path)
        roots = jax.numpy.sqrt(jax.numpy.array(VALUES))
        for transformed in (jax.value_and_grad, lambda work: jax.jit(jax.value_and_grad(work))):
            value, gradient = transformed(lambda x: (function(x**2) ** 2).sum())(roots)
            # The square of a root is the value but for rounding, which the tolerance of points carries on.
            assert float(value) == pytest.approx((found**2).sum(), rel=1e-9)
            assert np.allclose(gradient, 2.0 * np.asarray(roots) * (2.0 * found @ slopes), rtol=1e-7, atol=0.0)
        assert np.allclose(function(jax.numpy.array(VALUES)), found, rtol=1e-9, atol=0.0)
    job["sweep"] = {"start_hz": 120.0, "stop_hz": 130.0}
    with pytest.raises(InputError, match="JAX has to know the number of points"):
        attrito.jax_function(job, NAMES, "x_amplitude", MPI.COMM_SELF, folder=tmp_path)


def test_without_jax_its_function_says_so(tmp_path: Path, job: Job, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "jax", None)
    with pytest.raises(InputError, match="pip install jax"):
        attrito.jax_function(job, NAMES, "x_amplitude", MPI.COMM_SELF, folder=tmp_path)
