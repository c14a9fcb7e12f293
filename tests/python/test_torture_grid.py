"""`attrito verify torture` on a few scenes: every scene ends in a verdict that motion in time bears out."""

from __future__ import annotations

import contextlib
import csv

import h5py
import numpy as np
import pytest
from figures import written_figures

from attrito.cli import main
from attrito_verification.scene_grid.grid import COLUMNS, VERDICTS
from attrito_verification.scene_grid.methods import METHODS, motion, solve_family
from attrito_verification.scene_grid.scenes import DAMPING, FORCE, STIFFNESS, Family, families, frequencies


@pytest.fixture(scope="module")
def few(tmp_path_factory):
    """The folder of two families of 40 scenes, and the figures that were written into it."""
    folder = tmp_path_factory.mktemp("torture")
    with written_figures() as figures, contextlib.chdir(folder):
        assert main(["verify", "torture", "--scenes", "80", "-o", "few"]) == 0
    return folder / "few", figures


@pytest.fixture(scope="module")
def folder(few):
    return few[0]


def test_the_grid_has_ten_thousand_scenes_over_the_whole_range():
    every = families()
    assert len(every) * len(frequencies()) >= 10_000
    assert len(frequencies()) == 40
    assert {min(f.ratio for f in every), max(f.ratio for f in every)} == {0.1, 1e4}
    assert {min(f.friction for f in every), max(f.friction for f in every)} == {0.0, 3.0}
    assert {f.preload for f in every} == {"none", "small", "large", "apart"}
    assert {f.degrees for f in every} == {0.0, 45.0, 80.0}


def test_every_scene_ends_in_a_verdict_and_every_dataset_says_what_it_is(folder):
    with h5py.File(folder / "torture.h5") as file:
        scenes = file["scenes"]
        assert scenes["verdict"].shape == (2, 40)
        assert list(scenes["verdict"].attrs["names"]) == list(VERDICTS)
        for name in scenes:
            assert scenes[name].attrs["description"], name
            assert scenes[name].attrs["unit"] in ("1", "m", "s", "Hz"), name
        assert set(COLUMNS) - set(scenes) <= {"iterations", "amplitude"}
    with (folder / "scenes.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 80
    assert all(row["verdict"] in VERDICTS for row in rows)
    # Nothing fails in silence: what is called solved has a verdict on its stability.
    solved = [row for row in rows if row["coupled_outcome"] == "converged"]
    assert len(solved) > len(rows) // 2
    assert all(row["stable"] in ("0", "1", "2") for row in solved)
    assert (folder / "report.md").read_text().startswith("# 80 scenes, 2 families\n")


def test_pictures_show_the_verdicts_of_the_scenes_and_what_each_method_solves(few):
    folder, (verdicts, methods) = few
    assert {path.name for path in folder.glob("*.png")} == {"verdicts.png", "methods.png"}
    with (folder / "scenes.csv").open() as file:
        rows = list(csv.DictReader(file))
    # The map has the wedge alone, the scenes with one mass.
    expected = sorted(VERDICTS.index(row["verdict"]) for row in rows if row["masses"] == "1")
    assert len(expected) >= 40
    shown = np.concatenate(
        [image.get_array().filled(np.nan).ravel() for axes in verdicts.axes for image in axes.images]
    )
    assert sorted(shown[np.isfinite(shown)]) == expected
    # A number a method, for each stiffness and preload that the families have.
    tried: dict[tuple[str, str, str], list[bool]] = {}
    for row in rows:
        for method in METHODS:
            if outcome := row[f"{method}_outcome"]:
                tried.setdefault((row["ratio"], row["preload"], method), []).append(outcome == "converged")
    percents = [f"{100.0 * np.mean(solved):.0f}" for solved in tried.values()]
    assert len(percents) >= len(METHODS)
    assert sorted(text.get_text() for axes in methods.axes for text in axes.texts) == sorted(percents)


def test_verdicts_are_borne_out_by_motion_in_time_on_the_few_scenes(folder):
    with (folder / "figures.csv").open() as file:
        figures = {row["figure"]: float(row["value"]) for row in csv.DictReader(file)}
    assert figures["verdicts_checked"] > 0
    assert figures["verdicts_right"] == figures["verdicts_checked"]


@pytest.fixture(scope="module")
def apart():
    return solve_family(Family(1, 10.0, 0.3, "apart", 0.0))


def test_where_the_wall_is_level_and_out_of_reach_every_method_gives_the_response_of_the_free_mass(apart):
    omega = 2.0 * np.pi * frequencies()
    free = FORCE / np.abs(STIFFNESS[0] - omega**2 + 1j * omega * DAMPING)
    for method in METHODS:
        tried = np.isfinite(apart[f"{method}_outcome"])
        solved = apart[f"{method}_outcome"] == 0
        # What it calls solved is right. Motion in time settles slowly, and may well solve nothing here.
        assert tried.any(), method
        assert apart[f"{method}_amplitude"][solved] == pytest.approx(free[solved], rel=1e-7), method
    assert np.all(apart["coupled_outcome"] == 0)
    assert np.all(apart["stable"] == 1)


def test_motion_of_a_series_is_its_sum():
    series = np.array([[0.5, 2.0, -1.0, 0.0, 3.0]])
    theta = 2.0 * np.pi * np.arange(64) / 64
    expected = 0.5 + 2.0 * np.cos(theta) - np.sin(theta) + 3.0 * np.sin(2.0 * theta)
    assert motion(series, 64)[:, 0] == pytest.approx(expected, abs=1e-14)
