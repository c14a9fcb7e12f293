"""Jobs end to end through the command: the wedge of the paper, tables, ranks, branches, failures that are told."""

from __future__ import annotations

import math
import re
from itertools import pairwise
from typing import Any

import h5py
import numpy as np
import pytest
from jobs import attrito, attrito_here, blocks, by_pressure, chain, run, table, wedge, write_blocks, write_job

from attrito.support.errors import InputError

POINT_COLUMNS = (
    "point,branch,frequency_hz,converged,outcome,stable,unique,period,iterations,estimate,"
    "x_amplitude,x_mean,x_low,x_high,y_amplitude,y_mean,y_low,y_high"
)
CONTACT_COLUMNS = (
    "point,frequency_hz,contact,state,n_mean,n_min,n_low,n_high,t1_mean,t1_low,t1_high,{}"
    "stick,slip,open,dissipated_energy,unique"
)
STIFFNESS_X = (2 * math.pi * 100.0) ** 2


def shaken(force: float, contacts: int = 3, tangents: int = 1) -> dict[str, Any]:
    """The chain, driven until its contacts slip."""
    job = chain(contacts, tangents)
    job["load"][1]["cosine"], job["load"][1]["sine"] = [[0, force]], [[(tangents - 1) * contacts, force / 2]]
    return job


def column(rows: list[dict[str, str]], name: str) -> np.ndarray:
    """A column as numbers; empty is NaN."""
    return np.array([float(row[name] or "nan") for row in rows])


# --- the wedge -------------------------------------------------------------------------------------------------------


def test_the_wedge_meets_the_figures_of_time_integration(tmp_path):
    run(tmp_path, wedge())
    (point,), (contact,) = table(tmp_path), table(tmp_path, "--contacts")
    assert (point["outcome"], point["converged"], point["unique"]) == ("converged", "true", "true")
    assert contact["state"] == "slipping"
    found = [float(contact["t1_mean"]), float(contact["n_mean"]), float(point["x_mean"]), float(point["y_mean"])]
    assert found == pytest.approx([-6.045, 23.724, -5.332e-5, 1.6515e-4], rel=5e-4)


@pytest.mark.parametrize(
    ("stiffness", "load_path", "tangential", "normal"),
    [(3.04e5, [0.0, 1.0], 14.24, 28.48), (3.0e5, [0.0, 2.5, 1.0], -11.28, 22.56)],
    ids=["U1, a ramp", "U2, a path that overshoots"],
)
def test_the_uncoupled_approach_keeps_the_static_solution(tmp_path, stiffness, load_path, tangential, normal):
    job = wedge(stiffness)
    job["balance"]["approach"] = "uncoupled"
    job["static"]["load_path"] = load_path
    run(tmp_path, job)
    (point,), (contact,) = table(tmp_path), table(tmp_path, "--contacts")
    # Full contact: the mean of N is that of the static solution; T follows from equilibrium along x.
    n = float(contact["n_mean"])
    t = math.sqrt(2) * STIFFNESS_X * float(point["x_mean"]) + n
    assert (t, n) == pytest.approx((tangential, normal), rel=1e-3)


def test_the_coupled_mean_leaves_the_static_solution(tmp_path):
    run(tmp_path, wedge())
    (coupled,) = table(tmp_path)
    job = wedge()
    job["balance"]["approach"] = "uncoupled"
    run(tmp_path, job)
    (uncoupled,) = table(tmp_path)
    assert float(coupled["x_mean"]) < 2 * float(uncoupled["x_mean"]) < 0


# --- tables ----------------------------------------------------------------------------------------------------------


def test_tables_have_the_columns_of_the_design(tmp_path):
    run(tmp_path, wedge())
    contact_columns = CONTACT_COLUMNS.format("t2_mean,t2_low,t2_high,")
    for options, columns in ((), POINT_COLUMNS), (("--contacts",), contact_columns):
        assert attrito(tmp_path, "table", "result.h5", *options).stdout.splitlines()[0] == columns


def test_two_tangents_fill_their_columns(tmp_path):
    job = shaken(40.0, tangents=2)
    job["sweep"] = {"frequencies_hz": [80.0]}
    run(tmp_path, job)
    rows = table(tmp_path, "--contacts")
    assert list(rows[0]) == CONTACT_COLUMNS.format("t2_mean,t2_low,t2_high,").split(",")
    assert np.all(np.isfinite(column(rows, "t2_mean")))
    assert column(rows, "stick") + column(rows, "slip") + column(rows, "open") == pytest.approx(1.0)


def test_levels_add_a_column_and_a_branch_each(tmp_path):
    job = shaken(20.0)
    job["sweep"]["levels"] = [1.0, 2.0]
    run(tmp_path, job)
    rows = table(tmp_path)
    assert list(rows[0])[-1] == "level"
    assert {(row["branch"], row["level"]) for row in rows} == {("0", "1"), ("1", "2")}


def test_both_directions_come_back_on_a_branch_of_their_own(tmp_path):
    job = shaken(20.0)
    job["continuation"] = {"both_directions": True}
    run(tmp_path, job)
    rows = table(tmp_path)
    there, back = ([row for row in rows if row["branch"] == branch] for branch in ("0", "1"))
    assert len(there) + len(back) == len(rows)
    ends = [(float(part[0]["frequency_hz"]), float(part[-1]["frequency_hz"])) for part in (there, back)]
    assert ends[0] == pytest.approx((85.0, 70.0))
    assert ends[1] == pytest.approx((70.0, 85.0))
    assert all(a["frequency_hz"] != b["frequency_hz"] for a, b in pairwise(there))


# --- ranks and orders ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("tangents", [1, 2])
def test_any_number_of_ranks_gives_the_same_tables(tmp_path, tangents):
    # Three contacts: four ranks are more than there are contacts.
    job = shaken(60.0, tangents=tangents)
    job["sweep"]["stop_hz"] = 80.0
    run(tmp_path, job)
    expected = table(tmp_path), table(tmp_path, "--contacts")
    assert "slipping" in {row["state"] for row in expected[1]}
    for ranks in (1, 2, 4):
        run(tmp_path, job, ranks=ranks)
        assert (table(tmp_path), table(tmp_path, "--contacts")) == expected


def test_a_reduced_model_gives_the_same_table_on_any_number_of_ranks(tmp_path):
    write_blocks(tmp_path / "model.h5")
    tables = []
    for ranks in (None, 2, 4):
        (tmp_path / "rom.h5").unlink(missing_ok=True)
        run(tmp_path, blocks(), ranks=ranks)
        tables.append(table(tmp_path))
    same_rows(tables[1], tables[0])
    same_rows(tables[2], tables[0])


def same_rows(found: list[dict[str, str]], expected: list[dict[str, str]]) -> None:
    """Words equal, numbers to 1e-10 of the largest of their column."""
    assert len(found) == len(expected)
    for name in expected[0]:
        try:
            numbers = column(found, name), column(expected, name)
        except ValueError:
            assert [row[name] for row in found] == [row[name] for row in expected], name
            continue
        scale = np.nanmax(np.abs(numbers[1]), initial=0.0)
        np.testing.assert_allclose(*numbers, rtol=1e-10, atol=1e-10 * scale, err_msg=name)


def test_the_order_of_loads_and_contacts_does_not_matter(tmp_path):
    job = shaken(60.0)
    job["sweep"] = {"frequencies_hz": [80.0, 76.0]}
    run(tmp_path, job)
    expected = table(tmp_path)
    job["load"].reverse()
    job["contact"].reverse()
    run(tmp_path, job)
    for name in ("end_amplitude", "end_mean"):
        assert column(table(tmp_path), name) == pytest.approx(column(expected, name), rel=1e-9)


# --- the slider ------------------------------------------------------------------------------------------------------


def test_a_slider_that_is_kept_remembers_the_point_before(tmp_path):
    means = {}
    for slider in ("keep", "reset"):
        job = wedge(force=1.0)
        # Between two points where the contact is stuck stands one where it slipped.
        job["load"][1]["cosine"] = [[0, -3.0], [1, 3.0]]
        job["static"]["slider"] = slider
        job["sweep"] = {"frequencies_hz": [200.0, 132.0, 200.0]}
        run(tmp_path, job)
        rows = table(tmp_path)
        assert all(row["converged"] == "true" for row in rows)
        means[slider] = column(rows, "x_mean")
    assert means["reset"][2] == pytest.approx(means["reset"][0], rel=1e-9)
    assert means["keep"][0] == pytest.approx(means["reset"][0], rel=1e-9)
    assert abs(means["keep"][2] / means["keep"][0] - 1) > 0.1


# --- points that fail, and files -------------------------------------------------------------------------------------


@pytest.mark.parametrize("ranks", [None, 2])
def test_a_point_that_does_not_converge_is_in_the_table_and_told(tmp_path, ranks):
    job = wedge(force=500.0)
    # Uncoupled, there is no start out of motion in time: coupled, two iterations from that do.
    job["balance"] |= {"approach": "uncoupled", "max_iterations": 2, "residual_tolerance": 1e-13}
    job["sweep"] = {"frequencies_hz": [200.0, 120.0]}
    done = run(tmp_path, job, ranks=ranks, code=1)
    rows = table(tmp_path)
    assert len(rows) == 2
    failed = [row for row in rows if row["outcome"] == "not_converged"]
    assert failed
    assert all(row["converged"] == "false" for row in failed)
    told = re.findall(r"attrito: job\.toml: result\.h5: (\d+) point\(s\) did not converge", done.stderr)
    assert told == [str(len(failed))]
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(("along", "towards"), [(211.0, 420.0), (0.0, -10.0)], ids=["slides", "opens"])
def test_a_static_path_says_that_a_body_drifts_and_leaves_the_old_result(tmp_path, along, towards):
    # A free mass on one contact, mu = 0.5: 420 N hold 210 N and no more, and nothing holds what pulls it off.
    (tmp_path / "result.h5").write_bytes(b"old")
    job = wedge()
    job["model"] = {"mass": [[1.0, 0.0], [0.0, 1.0]], "stiffness": [[0.0, 0.0], [0.0, 0.0]]}
    job["contact"][0] |= {"normal": [[1, 1.0]], "tangents": [[[0, 1.0]]]}
    job["load"][0]["dofs"] = [[0, along], [1, towards]]
    done = run(tmp_path, job, code=1)
    found = "static load path, corner 2: no equilibrium found: a body drifts, no contact holds it ("
    # Open MPI may have said something of its own before, about the machine.
    (line,) = [line for line in done.stderr.splitlines() if "attrito" in line]
    assert line.startswith(f"attrito: job.toml: {found}")
    assert (tmp_path / "result.h5").read_bytes() == b"old"
    job["load"][0]["dofs"] = [[0, 200.0], [1, 420.0]]
    run(tmp_path, job)


def test_a_rerun_replaces_the_result_only_when_it_is_complete(tmp_path):
    run(tmp_path, wedge())
    before = (tmp_path / "result.h5").read_bytes()
    identity = (tmp_path / "result.h5").stat().st_ino
    job = wedge()
    job["contact"][0]["normal_stiffness"] = -1.0
    run(tmp_path, job, code=2)
    assert (tmp_path / "result.h5").read_bytes() == before
    run(tmp_path, wedge(force=4.0))
    # A new file took the old one's name: nobody ever read half of one.
    assert (tmp_path / "result.h5").stat().st_ino != identity
    assert not list(tmp_path.glob("*.partial"))


@pytest.mark.parametrize("quiet", ["", "1"])
@pytest.mark.parametrize("fault", [InputError("spoilt"), OSError("gone")])
def test_a_complete_run_does_not_fail_because_its_result_cannot_be_read_again(
    tmp_path, monkeypatch, capfd, fault, quiet
):
    """What is said of the peaks is read from the file, and not at all if nobody reads it."""
    asked = []

    def refuse(result):
        asked.append(result.path)
        raise fault

    monkeypatch.setattr("attrito.runs.run.answer", refuse)
    monkeypatch.setenv("ATTRITO_QUIET", quiet)
    done = attrito_here(tmp_path, capfd, "run", write_job(tmp_path, wedge()))
    assert done.returncode == 0, done.stderr
    assert bool(asked) != bool(quiet)
    assert "Result: result.h5" in done.stdout
    assert (tmp_path / "result.h5").exists()


def test_a_result_goes_to_the_folder_named_beside_the_job(tmp_path):
    (tmp_path / "input").mkdir()
    job = wedge()
    job["output"]["file"] = "../out/wedge/wedge.h5"
    write_job(tmp_path / "input", job)
    assert attrito(tmp_path, "run", "input/job.toml").returncode == 0
    assert len(table(tmp_path, result="out/wedge/wedge.h5")) == 1


def test_a_reduced_model_is_made_once(tmp_path):
    write_blocks(tmp_path / "model.h5")
    assert "reducing 81 dofs" in run(tmp_path, blocks()).stdout
    assert "rom.h5: up to date" in run(tmp_path, blocks()).stdout
    job = blocks()
    # Both eigensolvers find the same modes.
    job["reduction"]["eigensolver"] = "block_lanczos"
    assert "rom.h5: up to date" in run(tmp_path, job).stdout
    job["reduction"]["modes"] = 3
    assert "reducing 81 dofs" in run(tmp_path, job).stdout


@pytest.mark.parametrize("asked, dofs", [("monitors", 3), ("none", 0), (["tip"], 3)])
def test_a_reduced_model_gives_back_the_motion_that_is_asked_for(tmp_path, asked, dofs):
    write_blocks(tmp_path / "model.h5")
    run(tmp_path, blocks())
    whole = table(tmp_path)
    job = blocks()
    job["reduction"]["recovery"] = asked
    job["output"]["file"] = "part.h5"
    # Another file, the same reduced model.
    assert "this one is rom." in run(tmp_path, job).stdout
    assert table(tmp_path, result="part.h5") == whole
    (path,) = tmp_path.glob("rom.*.h5")
    with h5py.File(path) as rom:
        assert len(rom["recovery/dof"]) == rom["recovery/basis"].shape[1] == dofs
    assert f"motion of {dofs} dofs" in attrito(tmp_path, "info", path.name).stdout


@pytest.mark.parametrize("asked", [{"modes": 0}, {"max_frequency_hz": 1.0}])
def test_a_reduced_model_without_modes_inside_goes_through_every_command(tmp_path, asked):
    write_blocks(tmp_path / "model.h5")
    job = blocks() | {"reduction": asked}
    # Two frequencies of the reduced model below the end of the sweep, between which a response is examined.
    job["sweep"] = {"frequencies_hz": [60.0, 4000.0]}
    reduced = attrito(tmp_path, "reduce", write_job(tmp_path, job))
    assert reduced.returncode == 0, reduced.stderr
    assert "no modes, 2 corrections" in reduced.stdout
    assert "error" in attrito(tmp_path, "info", "rom.h5").stdout
    run(tmp_path, job)
    rows = table(tmp_path)
    assert [row["outcome"] for row in rows] == ["converged", "converged"]
    for command in ("report", "export"):
        done = attrito(tmp_path, command, "result.h5", *(["--point", "0"] if command == "export" else []))
        assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "rom.h5") as rom:
        assert not np.any(rom["coordinates/kind"][:] == 1)
        receptance = rom["quality/receptance"]
        assert receptance.shape == rom["quality/receptance_error"].shape
        assert receptance.shape[1:] == (len(rom["vectors/name"]),) * 2
        assert rom["reduction"].attrs["worst_error"] > 1e-3


@pytest.mark.parametrize("law", [dict, by_pressure], ids=["coulomb", "pressure"])
def test_bodies_that_only_friction_holds_find_their_equilibrium(tmp_path, law):
    """Two masses joined by a spring k and pressed on the ground by P each are pushed apart by F > mu P: both slip.

    Nothing else holds them along x, so the Jacobian of the slipping state is singular. Each moves by (F - mu P)/(2 k).
    """
    k, pressing, friction, pushing = 1.0e5, 100.0, 0.3, 80.0
    contact = {"tangential_stiffness": 2.0e6, "normal_stiffness": 2.0e6, "friction_coefficient": friction}
    stiffness = [[k, -k, 0.0, 0.0], [-k, k, 0.0, 0.0], [0.0] * 4, [0.0] * 4]
    job = {
        "model": {"mass": np.eye(4).tolist(), "stiffness": stiffness},
        "damping": {"ratio": 0.01},
        "contact": [contact | {"tangents": [[[i, 1.0]]], "normal": [[2 + i, 1.0]]} for i in range(2)],
        "load": [
            {"kind": "static", "dofs": [[0, -pushing], [1, pushing], [2, pressing], [3, pressing]]},
            {"kind": "harmonic", "cosine": [[0, 1.0e-6], [1, 2.0e-6]]},
        ],
        "sweep": {"frequencies_hz": [50.0]},
        "output": {"file": "result.h5", "monitors": [{"name": "apart", "dofs": [[0, -0.5], [1, 0.5]]}]},
    }
    run(tmp_path, law(job))
    (row,) = table(tmp_path)
    # The excitation of 1e-6 N moves the limit of friction, and so the means, by some 1e-8 of them.
    assert row["outcome"] == "converged"
    assert float(row["apart_mean"]) == pytest.approx((pushing - friction * pressing) / (2.0 * k), rel=1.0e-6)


@pytest.mark.parametrize(("force", "opens"), [(5.0, False), (30.0, True)])
def test_the_least_normal_force_is_located(tmp_path, force, opens):
    stiffness = 3.0e5
    run(tmp_path, wedge(stiffness, force))
    (row,) = table(tmp_path, "--contacts")
    with h5py.File(tmp_path / "result.h5") as file:
        closing = file["contacts/displacement"][0, 0, 2]
    angle = np.linspace(0.0, 2.0 * np.pi, 100_001)
    orders = np.arange(1, (len(closing) + 1) // 2)
    v = closing[0] + closing[1::2] @ np.cos(np.outer(orders, angle)) + closing[2::2] @ np.sin(np.outer(orders, angle))
    assert (float(row["n_min"]) == 0.0) == opens
    assert (float(row["open"]) > 0.0) == opens
    # A grid of 1e5 points misses a minimum by some (2 pi / 1e5)^2 / 2 of the curvature, 1e-8 of N.
    assert float(row["n_min"]) == pytest.approx(max(stiffness * v.min(), 0.0), rel=1.0e-6)
    # Mean N is that of max(kn v, 0) but for the truncation of the series, which leaves the mean alone.
    assert float(row["n_mean"]) == pytest.approx(stiffness * np.maximum(v[:-1], 0.0).mean(), rel=1.0e-6)


@pytest.mark.parametrize(
    "damping",
    [
        {"damping": {"ratio": 0.01}},
        {"model": {"damping": [[10.0, 0.0], [0.0, 10.0]]}},
        {"damping": {"rayleigh": [1.0, 1.0e-5]}},
        {"damping": {"loss_factor": 0.01}},
    ],
    ids=["ratio", "viscous", "rayleigh", "loss factor"],
)
def test_a_mass_that_only_its_contact_holds_is_solved_with_every_damping(tmp_path, damping):
    """Stuck at 1 N the mass moves along x by F / (kt - m omega^2), but for damping; without friction x is free."""
    kt, frequency = 3.0e5, 20.0
    job = wedge(kt, 1.0)
    job["model"] = {"mass": [[1.0, 0.0], [0.0, 1.0]], "stiffness": [[0.0, 0.0], [0.0, 2.5e6]]} | damping.get(
        "model", {}
    )
    job |= {name: value for name, value in damping.items() if name != "model"}
    job["contact"][0] |= {"normal": [[1, 1.0]], "tangents": [[[0, 1.0]]]}
    job["load"][1]["cosine"] = [[0, 1.0]]
    job["sweep"] = {"frequencies_hz": [frequency]}
    run(tmp_path, job)
    (row,) = table(tmp_path)
    omega = 2.0 * np.pi * frequency
    assert row["outcome"] == "converged"
    # Damping of at most 1 % at a sixth of the resonance changes the amplitude by less than (2 * 0.01 / 6)^2.
    assert float(row["x_amplitude"]) == pytest.approx(1.0 / (kt - omega**2), rel=2.0e-5)
    with h5py.File(tmp_path / "result.h5") as file:
        free = file["linear/frictionless/x"][:]
    # A free mass: F / (m omega^2), a little less with damping.
    assert free == pytest.approx(1.0 / omega**2, rel=1.0e-2)


@pytest.mark.parametrize("law", [dict, by_pressure], ids=["coulomb", "pressure"])
def test_a_static_path_passes_the_closing_of_a_gap(tmp_path, law):
    """One step ends where the contact just closes, N = 0 to the last digit, and the next begins to slip."""
    job = wedge(1.0e6, 1.0)
    job["contact"][0]["gap"] = 9.0e-6
    job["load"][0]["dofs"] = [[0, 30.0], [1, 100.0]]
    job["static"] = {"load_path": [0.0, 0.22500000000000003, 0.23, 1.0]}
    run(tmp_path, law(job))
    (row,) = table(tmp_path)
    assert row["outcome"] == "converged"


def test_a_sweep_that_does_not_reach_its_stop_says_so(tmp_path):
    job = wedge()
    job["sweep"] = {"start_hz": 140.0, "stop_hz": 100.0}
    job["continuation"] = {"max_points": 5}
    done = run(tmp_path, job, code=1)
    assert "before its stop at 100 Hz" in done.stderr
    assert len(table(tmp_path)) == 5
    with h5py.File(tmp_path / "result.h5") as file:
        assert "before its stop" in file["points"].attrs["incomplete"]


def test_an_uncoupled_point_does_not_claim_to_be_unique(tmp_path):
    job = wedge(3.0e5, 20.0)
    job["balance"]["approach"] = "uncoupled"
    run(tmp_path, job)
    (row,) = table(tmp_path)
    assert row["unique"] == "" and row["x_low"] == ""
    (contact,) = table(tmp_path, "--contacts")
    assert contact["unique"] == "" and contact["n_low"] == ""
