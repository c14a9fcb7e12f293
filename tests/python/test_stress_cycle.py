"""The stress cycle of a period, against closed forms, all pairs of many instants, and other axes."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.distance import pdist
from scipy.spatial.transform import Rotation

from attrito.results.periodic_vectors import fourier, longest, widest
from attrito.stresses.cycle import Cycle, cycle_of, deviator, von_mises

XX, YY, ZZ, XY, YZ, ZX = range(6)


def history(nk: int = 3, **coefficients: dict[int, float]) -> np.ndarray:
    """One stress `[nk, 1, 6]`: of each component named (`xx = {0: 3.0, 1: 1.0}`) coefficients by their numbers."""
    found = np.zeros((nk, 1, 6))
    for name, values in coefficients.items():
        for k, value in values.items():
            found[k, 0, {"xx": XX, "yy": YY, "zz": ZZ, "xy": XY, "yz": YZ, "zx": ZX}[name]] = value
    return found


def assert_cycle(found: Cycle, **expected: float) -> None:
    for name, value in expected.items():
        assert getattr(found, name)[0] == pytest.approx(value, rel=1e-12, abs=1e-12), name


def test_uniaxial_stress_has_half_its_range_about_its_middle():
    """m + 4 cos t + 2 cos 2t is between m - 3, at cos t = -1/2, and m + 6: its middle is not its mean."""
    found = cycle_of(history(5, xx={0: 10.0, 1: 4.0, 3: 2.0}))
    assert_cycle(
        found,
        alternating_von_mises=4.5,
        mean_signed_von_mises=11.5,
        alternating_principal=4.5,
        mean_principal=11.5,
        peak_von_mises=16.0,
    )
    assert found.alternating[0] == pytest.approx([4.5, 0, 0, 0, 0, 0], abs=1e-12)
    assert found.mean[0] == pytest.approx([11.5, 0, 0, 0, 0, 0], abs=1e-12)
    # The greater first; of its two least instants either.
    assert np.cos(found.phases[0]) == pytest.approx([1.0, -0.5], abs=1e-7)


def test_compression_has_a_negative_mean_and_pure_shear_a_positive_one():
    assert_cycle(cycle_of(history(xx={0: -10.0, 1: 1.0})), mean_signed_von_mises=-10.0, peak_von_mises=11.0)
    shear = cycle_of(history(xy={0: 2.0, 1: 1.0}))
    assert_cycle(shear, mean_signed_von_mises=2.0 * np.sqrt(3.0), alternating_von_mises=np.sqrt(3.0))
    # Both principal directions alternate by 1; along one of them the mean is tension.
    assert_cycle(shear, alternating_principal=1.0, mean_principal=2.0)


def test_a_rotating_shear_alternates_by_its_own_size():
    """xx = -yy = cos t, xy = sin t: principal stresses +-1 that turn, von Mises sqrt(3) at all instants."""
    found = cycle_of(history(xx={1: 1.0}, yy={1: -1.0}, xy={2: 1.0}, zz={0: 5.0}))
    assert_cycle(
        found,
        alternating_von_mises=np.sqrt(3.0),
        alternating_principal=1.0,
        mean_signed_von_mises=5.0,
        mean_principal=0.0,
        peak_von_mises=np.sqrt(28.0),
    )


@pytest.mark.parametrize(("bending", "torsion", "expected"), [(3.0, 1.0, 3.0), (1.0, 2.0, 2.0 * np.sqrt(3.0))])
def test_bending_and_torsion_out_of_phase_alternate_by_the_larger(bending, torsion, expected):
    """vm^2 = a^2 cos^2 + 3 b^2 sin^2, an ellipse with semi-axes a and sqrt(3) b."""
    assert_cycle(cycle_of(history(xx={1: bending}, xy={2: torsion})), alternating_von_mises=expected)


def test_the_instants_are_those_of_the_tensors():
    random = np.random.default_rng(1)
    harmonics = random.normal(size=(7, 40, 6))
    found = cycle_of(harmonics)
    first, second = (np.einsum("nk,knc->nc", fourier(found.phases[:, k], 7), harmonics) for k in (0, 1))
    assert found.alternating == pytest.approx((first - second) / 2, abs=1e-12)
    assert found.mean == pytest.approx((first + second) / 2, abs=1e-12)
    assert von_mises(found.alternating) == pytest.approx(found.alternating_von_mises, rel=1e-12)
    assert np.all(found.alternating[:, :3].sum(axis=1) >= 0.0)


@pytest.mark.parametrize("nk", [3, 7, 11])
def test_no_two_of_many_instants_differ_more(nk):
    """Of 501 instants some lie within pi/501 of the extremes: by Riesz f >= f* (1 + cos(2 H pi/501)) / 2 there."""
    random = np.random.default_rng(nk)
    harmonics = random.normal(size=(nk, 25, 6))
    found = cycle_of(harmonics)
    values = np.einsum("tk,knc->ntc", fourier(2 * np.pi * np.arange(501) / 501, nk), deviator(harmonics))
    for one, path in enumerate(values):
        apart = pdist(path).max() / 2
        largest = np.linalg.norm(path, axis=1).max()
        for exact, sampled in ((found.alternating_von_mises[one], apart), (found.peak_von_mises[one], largest)):
            assert sampled * (1 - 1e-12) <= exact <= sampled * (1 + (nk // 2 * np.pi / 501) ** 2)


def test_equivalent_stresses_do_not_depend_on_the_axes():
    random = np.random.default_rng(5)
    harmonics = random.normal(size=(5, 20, 6))
    turn = Rotation.from_rotvec([0.3, -1.1, 0.7]).as_matrix()
    tensors = np.zeros((5, 20, 3, 3))
    for k, (a, b) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))):
        tensors[..., a, b] = tensors[..., b, a] = harmonics[..., k]
    tensors = turn @ tensors @ turn.T
    turned = np.stack([tensors[..., a, b] for a, b in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))], axis=-1)
    one, other = cycle_of(harmonics), cycle_of(turned)
    for name in ("alternating_von_mises", "mean_signed_von_mises", "alternating_principal", "peak_von_mises"):
        assert getattr(other, name) == pytest.approx(getattr(one, name), rel=1e-9), name


def test_small_motion_about_a_large_mean_is_not_lost():
    found = cycle_of(history(xx={0: 1e8, 1: 1e-3}, xy={2: 2e-4}))
    assert found.alternating_von_mises[0] == pytest.approx(1e-3, rel=1e-12)


def test_what_stands_still_has_a_mean_alone():
    found = cycle_of(np.concatenate([history(xx={0: -3.0}), history(xy={1: 1.0})], axis=1))
    assert found.alternating_von_mises == pytest.approx([0.0, np.sqrt(3.0)])
    assert found.mean_signed_von_mises == pytest.approx([-3.0, 0.0], abs=1e-12)
    assert found.phases[0].tolist() == [0.0, 0.0]
    assert cycle_of(np.zeros((3, 0, 6))).alternating.shape == (0, 6)


def test_blocks_of_vectors_give_what_all_at_once_give(monkeypatch):
    vectors = np.random.default_rng(2).normal(size=(5, 30, 4))
    whole = [*longest(vectors), *widest(vectors)]
    monkeypatch.setattr("attrito.results.periodic_vectors.BLOCK", 5000)
    assert all(
        np.array_equal(one, other) for one, other in zip(whole, [*longest(vectors), *widest(vectors)], strict=True)
    )
