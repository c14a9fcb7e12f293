"""Stability through the command: multipliers by both engines, verdicts, and what is refused or left open."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from jobs import Job, attrito, chain, examined, run, stiff_wedge, table, wedge
from scipy.linalg import eigvals

# Of the wedge at 45 degrees, 132 Hz, 5 N, to four digits, by the direction of the force.
KNOWN = {
    "x": [0.7899, 0.6728 + 0.0402j, 0.6728 - 0.0402j, 0.3453, 0.0],
    "tangent": [0.7873, 0.7643, 0.7510, 0.2385, 0.0],
}
MULTIPLIER_COLUMNS = "point,frequency_hz,method,real,imag,kind"


def multipliers(rows: list[dict[str, str]], method: str, kind: str | None = None) -> np.ndarray:
    """Multipliers of one engine, in the order of the table."""
    chosen = [row for row in rows if row["method"] == method and kind in (None, row["kind"])]
    return np.array([complex(float(row["real"]), float(row["imag"])) for row in chosen])


@pytest.mark.parametrize("direction", KNOWN)
def test_multipliers_of_the_wedge_are_those_that_are_known_by_both_engines(tmp_path, direction):
    job = examined(wedge())
    if direction == "x":
        job["load"][1]["cosine"] = [[0, 5.0]]
    # At 5 harmonics the balance's orbit leaves out 3e-4 of them, at 20 less than 1e-5.
    job["balance"]["harmonics"] = 20
    run(tmp_path, job)
    rows = table(tmp_path, "--multipliers")
    for method in ("monodromy", "hill"):
        assert np.abs(multipliers(rows, method) - KNOWN[direction]).max() < 1e-4
    assert [row["kind"] for row in rows] == 2 * (4 * ["floquet"] + ["slip"])
    (point,) = table(tmp_path)
    assert (point["outcome"], point["stable"]) == ("converged", "true")
    assert attrito(tmp_path, "table", "result.h5", "--multipliers").stdout.splitlines()[0] == MULTIPLIER_COLUMNS


def test_on_the_event_exact_orbit_five_harmonics_are_enough(tmp_path):
    job = examined(wedge(), orbit="exact")
    job["load"][1]["cosine"] = [[0, 5.0]]
    run(tmp_path, job)
    rows = table(tmp_path, "--multipliers")
    for method in ("monodromy", "hill"):
        assert np.abs(multipliers(rows, method) - KNOWN["x"]).max() < 1e-4
    with h5py.File(tmp_path / "result.h5") as file:
        # What five harmonics leave out of the motion itself.
        assert 0.0 < file["stability/distance"][0] < 1e-2


def test_eleven_of_the_stiff_wedges_points_are_unstable_by_both_engines(tmp_path):
    frequencies = [85.0 + 2.5 * i for i in range(23)]
    run(tmp_path, examined(stiff_wedge(frequencies)))
    rows = table(tmp_path)
    unstable = [float(row["frequency_hz"]) for row in rows if row["outcome"] == "unstable"]
    expected = [85.0, 102.5, 105.0, 107.5, 110.0, 112.5, 117.5, 120.0, 122.5, 125.0, 127.5]
    assert unstable == pytest.approx(expected)
    assert {row["outcome"] for row in rows} == {"converged", "unstable"}
    assert all(row["stable"] == ("false" if row["outcome"] == "unstable" else "true") for row in rows)
    every = table(tmp_path, "--multipliers")
    for point in range(len(rows)):
        own = [row for row in every if row["point"] == str(point)]
        flow, hill = (multipliers(own, method, "floquet") for method in ("monodromy", "hill"))
        # Hill's problem looks for those of at least 0.01.
        assert max(np.abs(hill - value).min() for value in flow if abs(value) > 0.011) < 1e-4


def test_the_stiff_wedge_has_two_stable_orbits_at_90_hz(tmp_path):
    amplitudes = []
    # From below, and from above over 92.5 Hz, where Newton's method from the stuck response fails.
    for path in ([87.5, 90.0], [92.5, 90.0]):
        run(tmp_path, examined(stiff_wedge(path), "monodromy"))
        rows = table(tmp_path)
        assert {(row["outcome"], row["stable"]) for row in rows} == {("converged", "true")}
        amplitudes.append(float(rows[-1]["x_amplitude"]))
    assert amplitudes == pytest.approx([1.613e-4, 1.269e-4], rel=5e-3)


def test_where_all_stick_multipliers_are_those_of_the_linear_system_beside_neutral_ones(tmp_path):
    job = examined(chain(3))
    job["load"][1]["cosine"], job["load"][1]["sine"] = [[0, 0.1]], []
    job["sweep"] = {"frequencies_hz": [80.0]}
    job.pop("damping")
    damping = 30.0 * np.eye(6) + np.diag([0.0, 5.0, 10.0, 0.0, 20.0, 0.0])
    job["model"]["damping"] = damping.tolist()
    run(tmp_path, job)
    springs = np.array(job["model"]["stiffness"])
    for contact in job["contact"]:
        for rows, stiffness in (([contact["normal"]], "normal"), (contact["tangents"], "tangential")):
            for terms in rows:
                row = np.zeros(6)
                row[[dof for dof, _ in terms]] = [factor for _, factor in terms]
                springs += contact[f"{stiffness}_stiffness"] * np.outer(row, row)
    companion = np.block([[np.zeros((6, 6)), np.eye(6)], [-springs, -damping]])
    expected = np.exp(eigvals(companion) / 80.0)
    found = table(tmp_path, "--multipliers")
    for method in ("monodromy", "hill"):
        dynamic = multipliers(found, method, "floquet")
        assert len(dynamic) == 12
        assert max(np.abs(expected - value).min() for value in dynamic) < 1e-10
        assert multipliers(found, method, "stuck").tolist() == [1.0, 1.0, 1.0]
    assert table(tmp_path)[0]["stable"] == "true"


def shaken_chain(force: float) -> Job:
    """The chain, driven until its contacts slip."""
    job = chain(3)
    job["load"][1]["cosine"], job["load"][1]["sine"] = [[0, force]], []
    job["sweep"] = {"frequencies_hz": [80.0]}
    return job


def test_multipliers_are_the_same_on_1_2_and_4_ranks(tmp_path):
    found = []
    for ranks in (1, 2, 4):
        run(tmp_path, examined(shaken_chain(60.0)), ranks=ranks)
        rows = table(tmp_path, "--multipliers")
        found.append([(row["point"], row["method"], row["kind"]) for row in rows])
        values = np.concatenate([multipliers(rows, method) for method in ("monodromy", "hill")])
        if ranks == 1:
            reference = values
            # Of three contacts, some slip.
            assert multipliers(rows, "monodromy", "slip").size > 0
        assert found[-1] == found[0]
        assert np.array_equal(values, reference)


def test_every_multiplier_of_the_chain_is_found_by_both_engines(tmp_path):
    run(tmp_path, examined(shaken_chain(60.0), orbit="exact"))
    rows = [row for row in table(tmp_path, "--multipliers") if row["point"] == "0"]
    flow, hill = (multipliers(rows, method, "floquet") for method in ("monodromy", "hill"))
    large = flow[np.abs(flow) > 0.011]
    assert len(large) == len(hill)
    assert max(np.abs(hill - value).min() for value in large) < 1e-4


def rubbing_in_space() -> Job:
    """A chain of which every contact slips along both tangents."""
    job = chain(3, 2)
    job["load"][1]["cosine"], job["load"][1]["sine"] = [[0, 60.0]], [[3, 30.0]]
    job["sweep"] = {"frequencies_hz": [80.0]}
    return job


def test_contacts_that_slip_along_two_tangents_have_the_same_multipliers_on_the_orbit_of_motion_in_time(tmp_path):
    found = []
    for orbit, ranks in (("balance", None), ("exact", 2)):
        run(tmp_path, examined(rubbing_in_space(), orbit=orbit), ranks=ranks)
        (point,) = table(tmp_path)
        assert (point["outcome"], point["stable"]) == ("converged", "true")
        rows = table(tmp_path, "--multipliers")
        assert {row["method"] for row in rows} == {"monodromy"}
        # Two of each of nine modes and one of each contact's direction; a zero of each contact's slider.
        assert [row["kind"] for row in rows] == 21 * ["floquet"] + 3 * ["slip"]
        found.append(multipliers(rows, "monodromy", "floquet"))
        with h5py.File(tmp_path / "result.h5") as file:
            assert file["stability/change"][0] == 0.0
    # Five harmonics leave out as much.
    assert max(np.abs(found[1] - value).min() for value in found[0]) < 2e-3


def test_a_contact_without_friction_remembers_no_direction(tmp_path):
    largest = []
    for friction in (0.0, 1e-12):
        job = rubbing_in_space()
        job["contact"][0]["friction_coefficient"] = friction
        run(tmp_path, examined(job, orbit="exact"))
        (point,) = table(tmp_path)
        assert (point["outcome"], point["stable"]) == ("converged", "true")
        with h5py.File(tmp_path / "result.h5") as file:
            largest.append(file["stability/largest_multiplier"][0])
    assert largest[0] < 1.0
    assert abs(largest[0] - largest[1]) < 1e-8


def test_hills_problem_alone_does_not_examine_contacts_that_slip_along_two_tangents_and_that_is_told(tmp_path):
    run(tmp_path, examined(rubbing_in_space(), "hill"))
    (point,) = table(tmp_path)
    assert (point["outcome"], point["stable"]) == ("converged", "")
    with h5py.File(tmp_path / "result.h5") as file:
        assert "two tangents" in file["stability/reason"].asstr()[0]
    assert table(tmp_path, "--multipliers") == []


def test_two_tangents_that_stick_have_two_neutral_multipliers_each(tmp_path):
    job = chain(3, 2)
    job["load"][1]["cosine"], job["load"][1]["sine"] = [[0, 0.1]], []
    job["sweep"] = {"frequencies_hz": [80.0]}
    run(tmp_path, examined(job))
    (point,) = table(tmp_path)
    assert (point["outcome"], point["stable"]) == ("converged", "true")
    rows = table(tmp_path, "--multipliers")
    for method in ("monodromy", "hill"):
        assert len(multipliers(rows, method, "stuck")) == 6
        # The damping ratio is that of the stuck modes: |mu| = exp(-zeta omega_r T).
        assert np.all(np.abs(multipliers(rows, method, "floquet")) < 1.0)


def test_a_loss_factor_is_examined_as_the_viscous_damping_equal_to_it(tmp_path):
    found = []
    for damping in ({"loss_factor": 0.05}, {"rayleigh": [0.0, 0.05 / (2 * np.pi * 80.0)]}):
        job = examined(shaken_chain(0.1), "monodromy")
        job["damping"] = damping
        job["integrate"] = {"equivalent_viscous": True}
        job["sweep"] = {"frequencies_hz": [80.0]}
        run(tmp_path, job)
        found.append(np.sort_complex(multipliers(table(tmp_path, "--multipliers"), "monodromy", "floquet")))
    assert np.abs(found[0] - found[1]).max() < 1e-9


def test_at_a_graze_the_interval_of_the_largest_multiplier_begins_at_that_of_the_free_mass(tmp_path):
    # Level wall at the amplitude of the free response along y: no contact on one side of it, a touch on the other.
    job = wedge()
    omega, damping = 2.0 * np.pi * 200.0, 20.0 * np.pi
    gap = 5.0 / abs((500.0 * np.pi) ** 2 - omega**2 + 1j * damping * omega)
    job["contact"][0] |= {"normal": [[1, 1.0]], "tangents": [[[0, 1.0]]], "gap": gap}
    job["load"][0]["dofs"] = []
    job["load"][1]["cosine"] = [[1, 5.0]]
    job["sweep"] = {"frequencies_hz": [200.0]}
    run(tmp_path, examined(job, "monodromy", orbit="balance"))
    (point,) = table(tmp_path)
    assert point["outcome"] == "indeterminate"
    with h5py.File(tmp_path / "result.h5") as file:
        low, high = (file[f"stability/{name}"][0] for name in ("low", "high"))
        assert file["stability/reason"].asstr()[0] == "contact 0 grazes"
    # Free: exp(-c T / 2), less the 1e-5 that is left open of a modulus. A touch of 1e-8 of the amplitude lasts
    # 2 sqrt(2e-8)/omega, in which kn changes the flow by kn 2.8e-4/omega^2 at most.
    free = np.exp(-0.5 * damping / 200.0)
    assert low == pytest.approx(free - 1e-5, abs=1e-9)
    assert 2e-5 < high - low < 2e-5 + 3.0e5 * 2.9e-4 / omega**2
