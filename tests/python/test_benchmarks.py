"""The benchmarks run at their smallest size and say what they should; times are never asserted."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"
sys.path.insert(0, str(BENCHMARKS))

import scenes  # noqa: E402 (a folder of scripts, not a package)


def run(script: str, *arguments: str) -> Any:
    """What a benchmark prints."""
    command = [sys.executable, str(BENCHMARKS / script), *arguments]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True, timeout=300).stdout)


def test_an_element_carries_its_mass_and_no_stress_in_rigid_motion():
    for edges in ([0.1, 0.2], [0.1, 0.2, 0.3]):
        stiffness, mass = scenes.element(np.array(edges))
        moved = np.tile(np.eye(len(edges)), 2 ** len(edges))
        assert moved @ mass @ moved.T == pytest.approx(scenes.DENSITY * np.prod(edges) * np.eye(len(edges)), rel=1e-12)
        assert np.abs(stiffness @ moved.T).max() < 1e-12 * np.abs(stiffness).max()


def test_a_hexahedral_block_has_the_contacts_asked_for_and_a_unit_mass():
    scene = scenes.hexahedral_block(11, 30)
    assert len(scene.laws["tangents"]) == 11
    assert scene.directions.shape == (33, 30)
    assert scene.mass == pytest.approx(np.eye(30), abs=1e-9)


def test_below_the_least_threshold_every_contact_sticks_and_far_above_none_does():
    found = run(
        "kernels.py", "--plane", "3", "--hexahedral", "9", "--modes", "20", "--harmonics", "1", "--samples", "16"
    )
    for row in found["scenes"]:
        tangents = (2 if row["scene"] == "hexahedral" else 1) * row["contacts"] * (2 * row["harmonics"] + 1)
        assert row["active_rows"] == 0 if row["share"] == 0.0 else row["active_rows"] >= row["share"] * tangents
    assert {row["kernel"] for row in found["contacts"]} == {"event_line", "sampled_line", "sampled_disc"}


def test_the_sweep_of_a_block_solves_points():
    for row in run(
        "block.py", "--contacts", "3", "--modes", "3", "--harmonics", "1", "--samples", "32", "--load", "1.0"
    ):
        assert row["points"] > row["not_converged"]


def test_scaling_fits_an_exponent_to_each_quantity():
    small = (
        "--harmonics",
        "1",
        "3",
        "--modes",
        "20",
        "30",
        "--slipping",
        "1",
        "2",
        "--base",
        "9",
        "--wanted",
        "1",
        "--usual-modes",
        "20",
    )
    found = run("scaling.py", "--contacts", "9", "12", "--samples", "32", *small)
    assert set(found) == {"contacts", "slipping", "harmonics", "modes"}
    assert all(row["points"] == 5 for series in found.values() for row in series["rows"])
