"""Iwan's model, from job to table: against contacts side by side, integration in time, and Segalman's closed forms."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from jobs import Job, attrito, chain, run, table, wedge, write_job
from restarts import differences, run_in_pieces, run_to_the_end

from attrito.peaks.file import read_peaks
from attrito.results.loops import contact_loops
from attrito.results.result import Result

CHI, BETA = -0.4, 0.25


def iwan(sliders: int, chi: float = CHI, beta: float = BETA) -> dict:
    """Keys of the law."""
    return {"law": "iwan", "chi": chi, "beta": beta, "sliders": sliders}


def cells_of(sliders: int, beta: float) -> np.ndarray:
    """Ends of the cells of breaks in units of the largest, as the law's description has them."""
    cells = sliders - 1 if beta > 0 else sliders
    return np.array([0.0, *np.exp(-1.5 / np.sqrt(cells) * np.arange(cells - 1, -1, -1))])


def parts_of(sliders: int, chi: float, beta: float) -> tuple[np.ndarray, np.ndarray]:
    """Parts of stiffness and slip force, by integrals of Segalman's distribution over the cells and of its end."""
    ends = cells_of(sliders, beta)
    stiffness, force = (np.diff(ends ** (chi + power)) / (chi + power) for power in (1, 2))
    # S = K_T beta/(1 + beta) at the break 1
    end = [beta * stiffness.sum()] if beta > 0 else []
    stiffness, force = np.array([*stiffness, *end]), np.array([*force, *end])
    return stiffness / stiffness.sum(), force / force.sum()


def side_by_side(job: Job) -> Job:
    """The job with a plain contact for every slider: springs in parallel, and the normal one cut to equal parts."""
    contacts = []
    for contact in job["contact"]:
        plain = {key: value for key, value in contact.items() if key not in ("law", "chi", "beta", "sliders")}
        n = contact["sliders"]
        for stiffness, force in zip(*parts_of(n, contact["chi"], contact["beta"]), strict=True):
            contacts.append(
                plain
                | {
                    "tangential_stiffness": stiffness * contact["tangential_stiffness"],
                    "normal_stiffness": contact["normal_stiffness"] / n,
                    "friction_coefficient": n * force * contact["friction_coefficient"],
                    "preload": contact.get("preload", 0.0) / n,
                }
            )
    return job | {"contact": contacts}


def rubbing_wedge(sliders: int = 6, **balance: object) -> Job:
    """The wedge, whose normal force varies with its motion."""
    job = wedge()
    job["contact"][0] |= iwan(sliders)
    job["balance"] |= balance
    return job


def joint(sliders: int, chi: float, beta: float, force: float = 10.0) -> Job:
    """A mass on a spring and a joint under a normal force of 40 N that nothing changes, well below resonance."""
    return {
        "model": {"mass": [[1.0, 0.0], [0.0, 1.0]], "stiffness": [[1.0e5, 0.0], [0.0, 1.0e6]]},
        "damping": {"ratio": 0.01},
        "contact": [
            {
                "normal": [[1, 1.0]],
                "tangents": [[[0, 1.0]]],
                "tangential_stiffness": 3.0e5,
                "normal_stiffness": 1.0e6,
                "friction_coefficient": 0.5,
                **iwan(sliders, chi, beta),
            }
        ],
        "load": [
            {"name": "press", "kind": "static", "dofs": [[1, 80.0]]},
            {"name": "shake", "kind": "harmonic", "cosine": [[0, force]]},
        ],
        "static": {},
        "balance": {"harmonics": 5},
        "sweep": {"frequencies_hz": [20.0]},
        "output": {"file": "result.h5", "monitors": [{"name": "x", "dofs": [[0, 1.0]]}]},
    }


def block(sliders: int, press: float = 80.0, **harmonic: object) -> Job:
    """A mass on springs that rubs along two tangents, alike along both but for what is in `harmonic`."""
    job = joint(sliders, CHI, BETA)
    job["model"] = {"mass": np.eye(3).tolist(), "stiffness": np.diag([1.0e5, 1.0e5, 1.0e6]).tolist()}
    job["contact"][0] |= {"normal": [[2, 1.0]], "tangents": [[[0, 1.0]], [[1, 1.0]]]}
    job["load"] = [
        {"name": "press", "kind": "static", "dofs": [[2, press]]},
        {"name": "shake", "kind": "harmonic", **harmonic},
    ]
    return job


def in_folder(folder: Path, job: Job, ranks: int | None = None) -> Path:
    """Run a job in a folder of its own."""
    folder.mkdir()
    run(folder, job, ranks=ranks)
    return folder


def test_a_point_is_that_of_plain_contacts_side_by_side(tmp_path):
    job = rubbing_wedge()
    folders = [in_folder(tmp_path / name, each) for name, each in (("law", job), ("plain", side_by_side(job)))]
    together, apart = (table(folder)[0] for folder in folders)
    for key in ("x_amplitude", "x_mean", "y_amplitude", "y_mean"):
        # Residuals are below 1e-10 of the stuck response, errors a few times that.
        assert float(together[key]) == pytest.approx(float(apart[key]), rel=1e-8)
    rows = table(folders[0], "--contacts")[0], table(folders[1], "--contacts")
    for key in ("n_mean", "t1_mean", "dissipated_energy"):
        assert float(rows[0][key]) == pytest.approx(sum(float(row[key]) for row in rows[1]), rel=1e-7)
    states = {row["state"] for row in rows[1]}
    assert len(states) > 1, "all sliders do the same: the test is void"
    assert rows[0]["state"] == "slipping"
    assert float(rows[0]["slip"]) >= max(float(row["slip"]) for row in rows[1]) - 1e-9
    assert rows[0]["unique"] == "false"
    with h5py.File(folders[0] / "result.h5") as law, h5py.File(folders[1] / "result.h5") as plain:
        sliders = law["contacts/slider"][0, 0].reshape(-1, 2)
        assert np.allclose(sliders, plain["contacts/slider"][0], rtol=0, atol=1e-8 * np.abs(sliders).max())


def test_the_balance_has_the_amplitude_of_exact_integration_in_time(tmp_path):
    job = rubbing_wedge(harmonics=40)
    balance = table(in_folder(tmp_path / "law", job))[0]
    # Sliders that never slip stay where the point has them: another start would lead to another member of the family.
    exact = side_by_side(job)
    exact["integrate"] = {"frequency_hz": 132.0, "cycles": 2000, "periodicity_tolerance": 1e-9, "start": "point:0"}
    folder = in_folder(tmp_path / "plain", exact)
    done = attrito(folder, "integrate", "job.toml")
    assert done.returncode == 0, done.stdout + done.stderr
    with h5py.File(folder / "result.h5") as file:
        in_time = {f"{name}_amplitude": float(file[f"integration/monitors/{name}/amplitude"][()]) for name in "xy"}
    for key, value in in_time.items():
        # Forces fade like h^-2 and receptances like h^-2: what 40 harmonics leave out is some 40^-3 of them.
        assert float(balance[key]) == pytest.approx(value, rel=2e-5)
    plain = table(in_folder(tmp_path / "coulomb", wedge()))[0]
    assert abs(float(balance["x_amplitude"]) / float(plain["x_amplitude"]) - 1.0) > 1e-2, "Coulomb's law gives the same"


def test_a_point_along_two_tangents_is_that_of_plain_contacts_side_by_side(tmp_path):
    job = block(6, cosine=[[0, 15.0], [2, 30.0]], sine=[[1, 9.0]])
    folders = [in_folder(tmp_path / name, each) for name, each in (("law", job), ("plain", side_by_side(job)))]
    together, apart = (table(folder)[0] for folder in folders)
    for key in ("x_amplitude", "x_mean"):
        # Panels of slip leave 1e-8 of each slider's force.
        assert float(together[key]) == pytest.approx(float(apart[key]), rel=1e-7)
    rows = table(folders[0], "--contacts")[0], table(folders[1], "--contacts")
    for key in ("n_mean", "t1_mean", "t2_mean", "dissipated_energy"):
        assert float(rows[0][key]) == pytest.approx(sum(float(row[key]) for row in rows[1]), rel=1e-6)
    slips = [float(row["slip"]) for row in rows[1]]
    assert min(slips) < 1.0 and max(slips) > 0.99, "all sliders do the same: the test is void"


def test_sliders_that_go_round_lose_2_pi_times_force_times_their_radius(tmp_path):
    """|u| = a all over the period: w goes round with z = u - w at right angles to it, |w|^2 = a^2 - phi^2."""
    job = block(20, cosine=[[0, 12.0]], sine=[[1, 12.0]])
    job["sweep"]["levels"] = [0.05, 0.3, 1.0]
    folder = in_folder(tmp_path / "round", job)
    amplitudes = np.array([float(row["x_amplitude"]) for row in table(folder)])
    energy = np.array([float(row["dissipated_energy"]) for row in table(folder, "--contacts")])
    k, f = (whole * parts for whole, parts in zip((3.0e5, 20.0), parts_of(20, CHI, BETA), strict=True))
    slipping = np.array([np.count_nonzero(a > f / k) for a in amplitudes])
    assert 0 < slipping[0] < slipping[1] < slipping[2], "as many slip at all levels: the test is void"
    expected = np.array([np.sum(2.0 * np.pi * f * np.sqrt(np.maximum(a**2 - (f / k) ** 2, 0.0))) for a in amplitudes])
    assert energy == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("beta", [0.0, 0.5])
def test_dissipation_at_constant_normal_force_follows_amplitude_to_the_power_3_plus_chi(tmp_path, beta):
    chi, sliders = -0.5, 60
    job = joint(sliders, chi, beta)
    job["sweep"]["levels"] = [float(level) for level in np.geomspace(0.01, 2.4, 9)]
    folder = in_folder(tmp_path / "joint", job)
    amplitude = np.array([float(row["x_amplitude"]) for row in table(folder)])
    contacts = table(folder, "--contacts")
    assert all(float(row["n_min"]) == pytest.approx(40.0, rel=1e-12) for row in contacts)
    energy = np.array([float(row["dissipated_energy"]) for row in contacts])
    stiffness, force = 3.0e5, 20.0
    largest = force / stiffness * (1.0 + beta) / (beta + (chi + 1.0) / (chi + 2.0))
    cells = cells_of(sliders, beta)
    x = amplitude / largest
    assert 2.0 * cells[1] < x[0] < 0.02 < 0.5 < x[-1] < 1.0, "amplitudes not between the sliders: the test is void"
    # Every slider of break phi < a loses 4 k phi (a - phi) a period: exact, a motion with one turn each way.
    k, f = (whole * parts for whole, parts in zip((stiffness, force), parts_of(sliders, chi, beta), strict=True))
    discrete = np.array([np.sum(4.0 * f * np.maximum(a - f / k, 0.0)) for a in amplitude])
    assert energy == pytest.approx(discrete, rel=1e-6)
    # Segalman's: 4 R a^(chi + 3)/((chi + 2)(chi + 3)), R = K_T (chi + 1)/((1 + beta) largest^(chi + 1))
    rate = stiffness * (chi + 1.0) / ((1.0 + beta) * largest ** (chi + 1.0))
    continuous = 4.0 * rate * amplitude ** (chi + 3.0) / ((chi + 2.0) * (chi + 3.0))
    bound = np.array([_bound(cells, k[: len(cells) - 1], largest, a) for a in amplitude]) / continuous
    assert bound.max() < 0.3
    assert np.all(np.abs(energy / continuous - 1.0) <= bound)
    # The slope of a least-squares line through log D: weights times what each log D may be wrong by.
    logs = np.log(amplitude) - np.log(amplitude).mean()
    weights = logs / np.sum(logs**2)
    slope = float(weights @ np.log(energy))
    allowed = float(np.abs(weights) @ -np.log1p(-bound))
    assert allowed < 0.15
    assert abs(slope - (3.0 + chi)) <= allowed


def _bound(cells: np.ndarray, stiffness: np.ndarray, largest: float, amplitude: float) -> float:
    """How far cells as single sliders may be from the continuous distribution in energy at an amplitude.

    g(phi) = phi (a - phi), less than zero where it sticks, has g'' = -2: a cell below the amplitude, of width w, is
    wrong by its stiffness times its variance, at most w^2/4; the one that holds it by no more than g, at most a w.
    """
    ends = largest * cells
    widths, below = np.diff(ends), ends[1:] <= amplitude
    holds = (ends[:-1] < amplitude) & ~below
    return float(4.0 * (np.sum((stiffness * widths**2 / 4.0)[below]) + np.sum((stiffness * widths)[holds]) * amplitude))


def test_a_large_motion_slips_at_mu_times_n_and_a_small_one_has_the_tangential_stiffness(tmp_path):
    job = joint(20, CHI, BETA)
    job["sweep"]["levels"] = [1e-5, 20.0]
    result = Result(str(in_folder(tmp_path / "joint", job) / "result.h5"))
    small, large = (contact_loops(result, point, [0])[0] for point in (0, 1))
    # The smallest slider, of break 5e-7 m and a part 1e-2 of the stiffness, barely moves.
    assert np.ptp(small.tangential) / np.ptp(small.displacement) == pytest.approx(3.0e5, rel=1e-9)
    assert np.abs(large.tangential).max() == pytest.approx(20.0, rel=1e-12)
    area = abs(np.sum(large.tangential * np.gradient(large.displacement)))
    # The table's energy by the loop's area, at 1024 samples.
    energy = float(table(tmp_path / "joint", "--contacts")[1]["dissipated_energy"])
    assert area == pytest.approx(energy, rel=1e-3)


def several(sliders: int = 5) -> Job:
    """A chain with laws of one and of several elements, side by side."""
    job = chain(contacts=5)
    for i in (1, 2, 4):
        job["contact"][i] |= iwan(sliders + i)
    return job


def test_one_two_and_four_ranks_have_the_same_points_and_sliders(tmp_path):
    folders = [in_folder(tmp_path / f"on_{ranks}", several(), ranks) for ranks in (1, 2, 4)]
    rows = [table(folder) for folder in folders]
    assert len(rows[0]) > 5
    for other in rows[1:]:
        assert len(other) == len(rows[0])
        for a, b in zip(rows[0], other, strict=True):
            for key in ("frequency_hz", "end_amplitude", "end_mean"):
                # Solved to 1e-10 of the stuck response, on a mesh of frequencies that follows rounding.
                assert float(a[key]) == pytest.approx(float(b[key]), rel=1e-6)
    sliders = []
    for folder in folders:
        with h5py.File(folder / "result.h5") as file:
            sliders.append(file["contacts/slider"][()])
            states = set(file["contacts/state"][()].ravel())
    assert sliders[0].shape[1:] == (5, 2 * 9)
    assert len(states) > 1, "all contacts do the same: the test is void"
    for other in sliders[1:]:
        assert np.allclose(other, sliders[0], rtol=0, atol=1e-6 * np.abs(sliders[0]).max())


def test_a_run_resumed_after_every_point_gives_the_same_file_bit_for_bit(tmp_path):
    job = several()
    job["sweep"] = {"start_hz": 82.0, "stop_hz": 80.0}
    job["continuation"] = {"max_points": 9}
    path = tmp_path / write_job(tmp_path, job)
    complaint = run_to_the_end(path)
    whole = (tmp_path / "result.h5").rename(tmp_path / "whole.h5")
    runs, same = run_in_pieces(path)
    assert runs > 2
    assert complaint == same
    assert differences(tmp_path / "result.h5", whole) == []


def test_a_sweep_that_begins_at_a_stored_point_takes_up_all_sliders(tmp_path):
    job = rubbing_wedge()
    job["sweep"] = {"start_hz": 134.0, "stop_hz": 131.0}
    in_folder(tmp_path / "first", job)
    job["continuation"] = {"start": "point:2", "start_file": str(tmp_path / "first/result.h5")}
    in_folder(tmp_path / "second", job)
    with h5py.File(tmp_path / "first/result.h5") as first, h5py.File(tmp_path / "second/result.h5") as second:
        before, after = first["contacts/slider"][2, 0], second["contacts/slider"][0, 0]
        assert first["points/frequency_hz"][2] == pytest.approx(second["points/frequency_hz"][0], rel=1e-9)
    assert np.abs(before[-2]) > 0.0, "the largest slider rests where it began: the test is void"
    assert np.allclose(after, before, rtol=0, atol=1e-8 * np.abs(before).max())


def rubbing_block() -> Job:
    """Along two tangents, near resonance."""
    job = block(3, cosine=[[0, 15.0], [2, 30.0]], sine=[[1, 9.0]])
    job["balance"] = {"harmonics": 3}
    job["sweep"] = {"start_hz": 75.0, "stop_hz": 45.0}
    return job


def rubbing_line() -> Job:
    """Along one."""
    job = rubbing_wedge(harmonics=3)
    job["sweep"] = {"start_hz": 150.0, "stop_hz": 110.0}
    return job


@pytest.mark.parametrize("make", [rubbing_line, rubbing_block])
def test_peaks_and_their_derivatives_are_those_of_plain_contacts_side_by_side(tmp_path, make):
    job = make()
    # Every slider slips there, so that points are unique.
    job["peak"] = {"parameter": "level", "start": 2.0, "stop": 4.0, "values": [2.6, 3.2]}
    found = []
    for name, each in (("law", job), ("plain", side_by_side(job))):
        (tmp_path / name).mkdir()
        done = attrito(tmp_path / name, "peak", write_job(tmp_path / name, each))
        assert done.returncode == 0, done.stdout + done.stderr
        found.append(read_peaks(str(tmp_path / name / "result.peaks.h5"))[0])
    law, plain = found
    places = [[list(data["level"]).index(level) for level in (2.0, 2.6, 3.2, 4.0)] for data in found]
    # Newton's method ends at 1e-10 of the response; the curvature follows from the forces' second derivative there.
    for name in ("frequency_hz", "amplitude", "curvature"):
        assert law[name][places[0]] == pytest.approx(plain[name][places[1]], rel=1e-7)


def test_tables_plots_and_the_report_take_contacts_of_several_elements(tmp_path):
    job = rubbing_wedge()
    job["static"]["bounds"] = "auto"
    run(tmp_path, job)
    for command in (
        ["plot", "result.h5"],
        ["plot", "result.h5", "--loops"],
        ["report", "result.h5"],
    ):
        done = attrito(tmp_path, *command)
        assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize(("force", "state"), [(1.0, "slipping"), (0.01, "shaken_down")])
def test_bounds_by_themselves_leave_the_law_out_and_say_so(tmp_path, force, state):
    job = wedge(force=force)
    job["contact"][0] |= iwan(6)
    job["static"]["bounds"] = "auto"
    run(tmp_path, job)
    assert table(tmp_path, "--contacts")[0]["state"] == state
    row = table(tmp_path)[0]
    assert (row["unique"], row["x_low"], row["x_high"]) == ("false", "", "")
    with h5py.File(tmp_path / "result.h5") as file:
        bounds = file["points/bounds"]
        assert bounds.attrs["names"][int(bounds[0])] == b"not_examined"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"stability": {"method": "monodromy"}}, "contact[0] law = 'iwan': expected \"coulomb\" where stability"),
        ({"static": {"bounds": "sampled"}}, "contact[0] law = 'iwan': expected \"coulomb\" where bounds are"),
    ],
)
def test_engines_without_the_law_refuse_it_by_name(tmp_path, change, words):
    done = run(tmp_path, rubbing_wedge() | change, code=2)
    assert words in done.stderr


@pytest.mark.parametrize("scheme", ["event", "exponential", "newmark"])
def test_integration_in_time_refuses_the_law_by_name(tmp_path, scheme):
    steps = {} if scheme == "event" else {"steps_per_period": 200}
    job = rubbing_wedge() | {"integrate": {"frequency_hz": 132.0, "scheme": scheme, **steps}}
    done = attrito(tmp_path, "integrate", write_job(tmp_path, job))
    assert done.returncode == 2
    assert 'contact[0] law = \'iwan\': expected "coulomb" or "pressure" (integration in time' in done.stderr


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"chi": None}, 'contact[0] chi is missing: expected a number above -1, below 0, with law = "iwan"'),
        ({"beta": None}, 'contact[0] beta is missing: expected a number of at least 0, with law = "iwan"'),
        ({"chi": 0.0}, "contact[0] chi = 0.0: expected a number above -1 and below 0"),
        ({"chi": -1.0}, "contact[0] chi = -1.0: expected a number above -1 and below 0"),
        ({"beta": -0.1}, "contact[0] beta = -0.1: expected a number of at least 0"),
        ({"sliders": 1}, "contact[0] sliders = 1: expected an integer from 2 to 1000"),
        ({"law": "coulomb"}, 'contact[0] chi = -0.4: expected no such key but with law = "iwan"'),
        ({"friction_coefficient": [[1.0, 0.2]]}, 'expected a number with law = "iwan"'),
    ],
)
def test_keys_that_do_not_go_with_the_law_are_refused(tmp_path, keys, words):
    job = rubbing_wedge()
    contact = job["contact"][0] | keys
    job["contact"][0] = {key: value for key, value in contact.items() if value is not None}
    assert words in run(tmp_path, job, code=2).stderr
