"""Backbones: linear modes, the Jenkins element in closed form, the forced balance, the true peaks, the command."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import h5py
import jobs
import numpy as np
import pytest
from figures import line
from mpi4py import MPI
from rubbing_mass import DAMPING, KT, element, jenkins

from attrito.library.peak_tracker import PeakTracker
from attrito.library.points import LinearModes, StoredPoint
from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options, Solver
from attrito.peaks.backbone import BackboneTracker, LeadingMode, follow_backbone, leading_mode, lost_in_words
from attrito.peaks.curve import Backbone, BackbonePoint, Found
from attrito.peaks.file import read_backbone, read_peaks
from attrito_verification.paper.wedge import PARAMETER_SETS, Wedge


@contextmanager
def backbone(
    scene: ReducedScene, options: Options, amplitude: float, mode: int = 1
) -> Iterator[tuple[Solver, BackboneTracker]]:
    """A tracker of a scene's backbone from an amplitude of a tangent mode, its static loads walked."""
    with Solver(MPI.COMM_SELF, scene, options) as solver:
        solver.follow_static_path(np.array([[1.0]]), 4, 0.2)
        modes = solver.linear_modes("tangent", mode)
        begun = LeadingMode(mode, modes.shapes[mode - 1 :], modes.natural_hz[mode - 1], amplitude)
        yield solver, BackboneTracker(solver, begun, 0, "first_harmonic")


@pytest.mark.parametrize("kind", ["viscous", "mass", "ratio", "loss_factor", "none"])
def test_a_mode_that_sticks_has_the_backbone_of_the_linear_one(kind):
    scene = jenkins()
    omega, value = np.sqrt(1.0 + KT), 0.03
    # A loss factor acts on the structure's spring, 1, not on the contact's.
    excitation = {
        "viscous": DAMPING,
        "mass": value,
        "ratio": 2.0 * value * omega,
        "loss_factor": value / omega,
        "none": 0.0,
    }
    scene = replace(scene, damping_kind=kind, damping_value=value, damping=scene.damping if kind == "viscous" else None)
    # Of the stuck modes the normal one, at sqrt(2), is the second: sqrt(1.5) is the mass's own.
    with backbone(scene, Options(harmonics=3, tolerance=1e-12), 0.1) as (_, tracker):
        point = tracker.begin()
        assert point.converged and sum(point.point.states[2:]) == 0
        assert 2.0 * np.pi * point.frequency_hz == pytest.approx(omega, rel=1e-11)
        assert point.excitation == pytest.approx(excitation[kind], rel=1e-10, abs=1e-11)
        # At its phase resonance a force of 1 moves a linear oscillator by 1/(c omega).
        assert point.level == pytest.approx(point.amplitude * excitation[kind] * omega, rel=1e-10, abs=1e-11)


def test_the_backbone_of_a_mass_that_rubs_is_that_of_the_describing_function():
    with backbone(jenkins(), Options(harmonics=1, tolerance=1e-12), 1.0) as (_, tracker):
        tracker.begin()
        for modal_amplitude in (1.5, 3.0, 6.0, 40.0, 4.0):
            point = tracker.at(modal_amplitude)
            stiffness, loss = element(point.amplitude)
            omega = np.sqrt(1.0 + stiffness)
            assert point.converged
            # The mode's stiffness is 1 where that of the mass is 1 + kt.
            assert point.amplitude == pytest.approx(modal_amplitude / np.sqrt(1.0 + KT), rel=1e-11)
            assert 2.0 * np.pi * point.frequency_hz == pytest.approx(omega, rel=1e-10)
            assert point.excitation == pytest.approx(DAMPING + loss / omega, rel=1e-9)
            assert point.level == pytest.approx(point.amplitude * (DAMPING * omega + loss), rel=1e-9)


def beside_an_open_contact() -> ReducedScene:
    """The mass that rubs, before a stop that it never meets: with all contacts stuck it is four times as fast."""
    scene = jenkins()
    laws = {name: np.repeat(values, 2) for name, values in scene.laws.items()}
    laws["gap"], laws["preload"] = np.array([0.0, 100.0]), np.array([1.0, 0.0])
    laws["tangential_stiffness"], laws["normal_stiffness"] = np.array([KT, 0.1]), np.array([1.0, 30.0])
    # The stop's normal is the mass's own direction.
    rows = np.vstack([np.eye(2), [[0.0, 1.0], [1.0, 0.0]]])
    return replace(scene, laws=laws, directions=rows)


def test_a_backbone_begins_at_the_tangent_mode_where_pairs_are_open_at_rest():
    levels, path = (0.01, 0.5, 3.0), np.array([[1.0]])
    options = Options(harmonics=1, tolerance=1e-12)
    with Solver(MPI.COMM_SELF, beside_an_open_contact(), options) as solver:
        solver.follow_static_path(path, 1, 0.2)
        stuck, tangent = (solver.linear_modes(name, 2) for name in ("stuck", "tangent"))
        assert stuck.natural_hz[1] > 4.0 * tangent.natural_hz[0]
        tracker = PeakTracker(solver, 0, "first_harmonic", (0.13, 0.25), np.ones(1))
        peaks = [Found(tracker.begin(levels[0], tracker.linear_peak_hz()), "value")]
        first = solver.coordinates()
        peaks += [Found(tracker.at(level), "value") for level in levels[1:]]
    with Solver(MPI.COMM_SELF, beside_an_open_contact(), options) as solver:
        solver.follow_static_path(path, 1, 0.2)
        mode = leading_mode(solver.linear_modes("tangent", 2), np.eye(2), first)
        found = follow_backbone(BackboneTracker(solver, mode, 0, "first_harmonic"), peaks)
    assert mode.frequency_hz == pytest.approx(np.sqrt(1.0 + KT) / (2.0 * np.pi), rel=1e-12)
    for level, expected in zip(levels, found.at_peaks, strict=True):
        assert expected is not None and expected.level == pytest.approx(level, rel=1e-9)
        stiffness, loss = element(expected.amplitude)
        omega = np.sqrt(1.0 + stiffness)
        assert 2.0 * np.pi * expected.frequency_hz == pytest.approx(omega, rel=1e-9)
        assert expected.excitation == pytest.approx(DAMPING + loss / omega, rel=1e-8)


@pytest.mark.parametrize("turn", [0.0, 0.4])
def test_of_equal_modes_the_mixture_in_the_motion_leads(turn):
    shapes = np.array([[0.0, 0.0, 0.5], [np.cos(turn), np.sin(turn), 0.0], [-np.sin(turn), np.cos(turn), 0.0]])
    modes = LinearModes(np.array([1.0, 2.0, 2.0]), np.zeros(3), shapes, 0)
    mass = np.diag([1.0, 1.0, 4.0])
    # In phase along (3, 4), with a little of the mode of another frequency, at a phase of 0.7.
    motion = np.outer([3.0, 4.0, 0.1], [9.0, np.cos(0.7), np.sin(0.7)])
    mode = leading_mode(modes, mass, motion)
    assert mode.frequency_hz == 2.0 and mode.amplitude == pytest.approx(5.0, rel=1e-12)
    assert abs(mode.shapes[0] @ np.array([0.6, 0.8, 0.0])) == pytest.approx(1.0, rel=1e-12)
    assert abs(mode.shapes.conj() @ mass @ mode.shapes.T) == pytest.approx(np.eye(2), abs=1e-12)


def forced_by_its_own_damping(scene: ReducedScene, point: BackbonePoint, coordinates: np.ndarray) -> ReducedScene:
    """The scene under xi M q' as an excitation, for the motion `[m, 2 H + 1]` of a backbone."""
    harmonic = np.zeros(coordinates.T.shape)
    for h in range(1, len(harmonic) // 2 + 1):
        factor = point.excitation * 2.0 * np.pi * point.frequency_hz * h
        harmonic[2 * h - 1] = factor * scene.mass @ coordinates[:, 2 * h]
        harmonic[2 * h] = -factor * scene.mass @ coordinates[:, 2 * h - 1]
    return replace(scene, harmonic=harmonic)


def in_the_plane() -> ReducedScene:
    """A mass on springs along two tangents, 10 % apart, that rubs along both."""
    laws = jenkins().laws | {"tangents": np.full(1, 2, dtype=np.int32), "tangential_stiffness": np.full(1, 0.3)}
    mixed = np.array([[0.1, 0.02, 0.0], [0.02, 0.08, 0.01], [0.0, 0.01, 0.1]])
    return ReducedScene(
        np.eye(3),
        np.array([[1.0, 0.05, 0.0], [0.05, 1.1, 0.1], [0.0, 0.1, 2.0]]),
        "viscous",
        0.0,
        mixed,
        laws,
        np.eye(3),
        np.array([[0.0, 0.0, 3.0]]),
        np.array([[0.0, 0.0, 0.0], [1.0, 0.3, 0.0], [0.0, 0.4, 0.0]]),
        np.array([[1.0, 0.0, 0.0]]),
        ["x"],
    )


@pytest.mark.parametrize("scene", ["inclined wall", "two tangents", "mode damping"])
def test_a_backbone_solves_the_forced_balance_that_its_negative_damping_makes(scene):
    reduced, options, amplitude = {
        "inclined wall": (
            Wedge(PARAMETER_SETS["unrounded"], 45.0, "C", 5).scene,
            Options(harmonics=5, tolerance=1e-12),
            0.4,
        ),
        "two tangents": (in_the_plane(), Options(harmonics=4, samples=128, tolerance=1e-12), 8.0),
        "mode damping": (
            replace(in_the_plane(), damping_kind="ratio", damping_value=0.03, damping=None),
            Options(harmonics=4, samples=128, tolerance=1e-12),
            8.0,
        ),
    }[scene]  # fmt: skip
    with backbone(reduced, options, amplitude) as (solver, tracker):
        point = tracker.begin()
        coordinates = solver.coordinates()
    assert point.converged and sum(point.point.states[2:]) == 1
    forced = forced_by_its_own_damping(reduced, point, coordinates)
    with Solver(MPI.COMM_SELF, forced, options) as solver:
        solver.follow_static_path(np.array([[1.0]]), 4, point.frequency_hz)
        start = StoredPoint(point.frequency_hz, coordinates, np.zeros((1, 2)))
        assert solver.start_from(start, 1.0)
        # Had it to move, it would go to another solution: this one is unique. Balances end at 1e-12 of their scales.
        assert np.abs(solver.coordinates() - coordinates).max() <= 1e-9 * np.abs(coordinates).max()
    # The work of both loads is the same: level and loads in quadrature.
    work = reduced.mass @ coordinates
    first = coordinates[:, 1:3] @ np.array([1.0, -1.0j])
    load = reduced.harmonic[1:3].T @ np.array([1.0, -1.0j])
    kinetic = sum((h // 2 + h % 2) ** 2 * coordinates[:, h] @ work[:, h] for h in range(1, coordinates.shape[1]))
    level = point.excitation * 2.0 * np.pi * point.frequency_hz * kinetic / abs(np.conj(first) @ load)
    assert point.level == pytest.approx(level, rel=1e-12)


def test_a_backbone_tells_the_true_peaks_to_the_square_of_the_damping():
    path = np.array([[1.0]])
    options = Options(harmonics=1, tolerance=1e-12)
    with Solver(MPI.COMM_SELF, jenkins(), options) as solver:
        solver.follow_static_path(path, 1, 0.2)
        tracker = PeakTracker(solver, 0, "first_harmonic", (0.13, 0.25), np.ones(1))
        peaks = [Found(tracker.begin(0.01, tracker.linear_peak_hz()), "value")]
        peaks += [Found(tracker.at(level), "value") for level in (0.5, 3.0)]
    with backbone(jenkins(), options, 0.1) as (_, tracker):
        found = follow_backbone(tracker, peaks)
    for one, expected in zip(peaks, found.at_peaks, strict=True):
        assert expected is not None and expected.level == pytest.approx(one.peak.level, rel=1e-9)
    # While it sticks the mass is linear: in quadrature it is moved sqrt(1 - zeta^2) of the farthest.
    ratio = 0.5 * DAMPING / np.sqrt(1.0 + KT)
    peak, expected = peaks[0].peak, found.at_peaks[0]
    assert expected.response / peak.response == pytest.approx(np.sqrt(1.0 - ratio**2), rel=1e-9)
    assert peak.frequency_hz / expected.frequency_hz == pytest.approx(np.sqrt(1.0 - 2.0 * ratio**2), rel=1e-7)
    levels = [point.level for stretch in found.stretches for point in stretch]
    assert len(found.stretches) == 1 and levels[0] <= 0.01 and levels[-1] >= 3.0


def test_the_command_adds_the_backbone_to_the_peaks(tmp_path, capfd, written):
    done = jobs.attrito_here(tmp_path, capfd, "peak", jobs.write_job(tmp_path, jobs.peak_of_wedge(backbone=True)))
    assert done.returncode == 0, done.stderr
    rows = list(csv.DictReader(io.StringIO(done.stdout[done.stdout.index("kind,level") :])))
    rows = [row for row in rows if row["outcome"] == "converged"]
    file = str(tmp_path / "result.peaks.h5")
    data, attributes = read_peaks(file)
    assert attributes["backbone_mode"] == 1
    for name in ("backbone_response", "backbone_frequency_hz"):
        assert np.allclose([float(row[name]) for row in rows], data[name], rtol=1e-11, equal_nan=True)
    # On the inclined wall the mean moves with the phase of the motion: 12 % is the method's own error at one level, and
    # where the first slip folds the curve in its amplitude it has no point.
    there = np.isfinite(data["backbone_response"])
    assert there.sum() >= len(there) - 4
    assert np.all(np.abs(data["backbone_response"][there] / data["response"][there] - 1.0) < 0.15)
    curve = read_backbone(file)
    assert np.allclose(curve["damping_ratio"], curve["excitation"] / (4 * np.pi * curve["frequency_hz"]), rtol=1e-14)
    assert (
        np.all(np.diff(curve["modal_amplitude"]) > 0.0)
        and np.all(np.diff(curve["stretch"]) >= 0)
        and curve["residual"].max() < 1e-9
    )
    with h5py.File(file) as stored:
        for name in stored["backbone"]:
            assert stored[f"backbone/{name}"].attrs["description"] and stored[f"backbone/{name}"].attrs["unit"]
    # Drawn over the levels of the peaks, within a twentieth of them, and below how far it is from the peaks.
    response, _, differences = written[-1].axes
    here = (curve["level"] >= 0.95 * data["level"].min()) & (curve["level"] <= 1.05 * data["level"].max())
    dashed = np.concatenate([one.get_xydata() for one in response.get_lines() if one.get_linestyle() == "--"])
    assert dashed == pytest.approx(np.column_stack([curve["level"], curve["response"]])[here])
    away = 100.0 * (data["backbone_response"] / data["response"] - 1.0)
    assert line(differences, "response").get_ydata() == pytest.approx(away, nan_ok=True)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"peak": {"parameter": "preload"}}, "expected false: a backbone is followed over levels"),
        ({"harmonic": 2}, "expected false, or a harmonic load with harmonic = 1"),
    ],
)
def test_a_backbone_that_cannot_be_is_a_fault_of_the_job(tmp_path, capfd, change, told):
    made = jobs.peak_of_wedge(backbone=True, **change.get("peak", {}))
    for load in made["load"]:
        if load["kind"] == "harmonic" and "harmonic" in change:
            load["harmonic"] = change["harmonic"]
    done = jobs.attrito_here(tmp_path, capfd, "peak", jobs.write_job(tmp_path, made))
    assert done.returncode == 2 and "[peak] backbone = True" in done.stderr and told in done.stderr


def test_a_backbone_without_points_is_warned_of():
    assert lost_in_words(None) == []
    assert "no backbone was found" in lost_in_words(Backbone(1, [], [None]))[0]
