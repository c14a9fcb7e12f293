"""Limit cycles of modes that negative damping feeds, and damping ratios by mode."""

from __future__ import annotations

from dataclasses import replace

import h5py
import numpy as np
import pytest
from jobs import Job, attrito, chain, run, table, write_job
from mode_jobs import KT, LIMIT, MASS, K, cut_short, rubbing
from mpi4py import MPI
from scipy.linalg import eigh
from scipy.optimize import brentq
from wheels import lumped_sector

from attrito.job.reading import read_job
from attrito.library.points import StoredPoint
from attrito.library.session import Options, Solver
from attrito.results.result import Result
from attrito.scene.build import build_scene
from attrito.scene.reduced_model import reduced_scene
from attrito.scene.wheel import wave_in_wheel, whole_wheel

FED = 0.01
STUCK = np.sqrt((K + KT) / MASS)


def fed(harmonics: int, ratio: float = -FED) -> Job:
    """The mass that rubs, fed by a flow that takes no notice of whether it slips: C = 2 zeta omega_stuck M."""
    job = rubbing(harmonics)
    job["damping"] = {"ratio": ratio}
    return job


def surplus(amplitude: float) -> float:
    """Work a period of the element less that of the flow, one harmonic, at an amplitude of the mass."""
    ratio = min(LIMIT / (KT * amplitude), 1.0)
    angle = np.arccos(1.0 - 2.0 * ratio)
    omega = np.sqrt((K + KT / np.pi * (angle - np.sin(angle) * np.cos(angle))) / MASS)
    return 4.0 * LIMIT * (amplitude - LIMIT / KT) - np.pi * 2.0 * FED * STUCK * MASS * omega * amplitude**2


def cycles(rows: list[dict[str, str]]) -> dict[str, float]:
    """Amplitude of the mass at each limit cycle, by its name."""
    found = {row["limit_cycle"]: float(row["amplitude"]) / np.sqrt(MASS) for row in rows if row["limit_cycle"] != "no"}
    assert sum(row["limit_cycle"] != "no" for row in rows) == len(found)
    return found


def test_limit_cycles_are_where_the_describing_function_takes_what_the_flow_gives(tmp_path):
    done = attrito(tmp_path, "mode", write_job(tmp_path, fed(1)))
    assert done.returncode == 0, done.stderr
    rows = table(tmp_path, result="result.mode.h5")
    assert len(rows) == 12 + 2
    amplitudes = [float(row["amplitude"]) for row in rows]
    assert amplitudes == sorted(amplitudes)
    found = cycles(rows)
    # The surplus is largest in between, where the element takes most for the square of its amplitude.
    most = 2.0 * LIMIT / KT
    assert surplus(most) > 0.0
    # The amplitude is met to 1e-9, and twice the damping's slope in it is that of Q^2: 1e-8 has room.
    assert found["attracts"] == pytest.approx(brentq(surplus, 1.001 * LIMIT / KT, most, xtol=1e-14), rel=1e-7)
    assert found["repels"] == pytest.approx(brentq(surplus, most, 1.4e-2, xtol=1e-14), rel=1e-7)
    for row in rows:
        if row["limit_cycle"] != "no":
            # Against 15 harmonics one errs by a few per cent; xi vanishes, and no error is a part of it.
            assert 0.0 < float(row["estimate"]) < 0.1
            assert float(row["damping_ratio"]) == pytest.approx(-float(row["damping_ratio_structure"]), rel=1e-7)


def marched(amplitude: float, periods: int, steps: int = 400) -> float:
    """Half the range over the last period of the mass that rubs and is fed, released at an amplitude.

    Velocity Verlet.
    """
    h = 2.0 * np.pi / STUCK / steps
    # The slider is where the last slip, outwards, has left it.
    x, v, slider = amplitude, 0.0, amplitude - LIMIT / KT
    rate = 2.0 * FED * STUCK
    half, low, high = 0.5 * h, x, x
    acceleration = (-K * x - KT * (x - slider)) / MASS + rate * v
    for step in range(periods * steps):
        v += half * acceleration
        x += h * v
        slider = min(max(slider, x - LIMIT / KT), x + LIMIT / KT)
        acceleration = (-K * x - KT * (x - slider)) / MASS + rate * v
        v += half * acceleration
        if step == (periods - 2) * steps:
            low = high = x
        low, high = min(low, x), max(high, x)
    return 0.5 * (high - low)


def test_motion_marched_in_time_goes_to_the_limit_cycle_that_attracts_and_away_from_the_other(tmp_path):
    done = attrito(tmp_path, "mode", write_job(tmp_path, fed(15)))
    assert done.returncode == 0, done.stderr
    with Result(tmp_path / "result.mode.h5") as result:
        series = result.array("/points/coordinates")[:, 0]
        motion = dict(zip(result.named("/points/limit_cycle"), series, strict=True))
    angle = np.linspace(0.0, 2.0 * np.pi, 4000)
    half = {}
    for kind in ("attracts", "repels"):
        harmonics = np.arange(1, 16)
        series = motion[kind][1::2] @ np.cos(np.outer(harmonics, angle))
        series += motion[kind][2::2] @ np.sin(np.outer(harmonics, angle))
        half[kind] = 0.5 * np.ptp(series)
    # The march errs by the square of the step, (2 pi / 400)^2 / 24 = 1e-5 in frequency and alike in the work of slip.
    assert marched(1.3 * half["attracts"], 300) == pytest.approx(half["attracts"], rel=1e-3)
    assert marched(0.9 * half["attracts"], 300) == pytest.approx(half["attracts"], rel=1e-3)
    assert marched(0.98 * half["repels"], 60) < 0.9 * half["repels"]
    assert marched(1.02 * half["repels"], 60) > 1.1 * half["repels"]


@pytest.mark.parametrize("known", [4, 5])
def test_a_mode_killed_about_a_limit_cycle_goes_on_to_the_same_table(known, tmp_path, monkeypatch):
    attrito(tmp_path, "mode", write_job(tmp_path, fed(1)))
    whole = table(tmp_path, result="result.mode.h5")
    assert whole[4]["limit_cycle"] == "attracts", "known points are to end before it, with it and after it"
    (tmp_path / "result.mode.h5").unlink()
    cut_short(tmp_path, monkeypatch, known)
    done = attrito(tmp_path, "mode", "job.toml", "--resume")
    assert done.returncode == 0, done.stderr
    rows = table(tmp_path, result="result.mode.h5")
    assert [row["limit_cycle"] for row in rows] == [row["limit_cycle"] for row in whole]
    assert [row["iterations"] for row in rows] == [row["iterations"] for row in whole]
    # Q is met to 1e-9; two processes may differ by rounding.
    assert [float(row["frequency_hz"]) for row in rows] == pytest.approx(
        [float(row["frequency_hz"]) for row in whole], rel=1e-7
    )


def test_the_limit_cycle_of_a_nodal_diameter_is_a_wave_that_the_whole_wheel_keeps_up_by_itself(tmp_path):
    sectors, harmonics = 5, 7
    job = lumped_sector(sectors, 1) | {"balance": {"harmonics": harmonics}, "damping": {"ratio": -0.004}}
    job["mode"] = {"start": 1e-4, "stop": 3e-4, "points": 4}
    done = attrito(tmp_path, "mode", write_job(tmp_path, job))
    assert done.returncode == 0, done.stderr
    with Result(tmp_path / "result.mode.h5") as result:
        point = result.named("/points/limit_cycle").index("attracts")
        motion, frequency = (
            result.array("/points/coordinates")[point],
            float(result.array("/points/frequency_hz")[point]),
        )
    read = read_job(tmp_path / "job.toml", excited=False)
    scene = reduced_scene(read, build_scene(read))
    wheel = whole_wheel(replace(scene, harmonic=np.zeros((2 * harmonics + 1, len(scene.mass)))))
    wave = wave_in_wheel(motion, scene.sector)
    # The amplitude is met to 1e-9: nothing is left to solve. No step could be taken, for a free motion has any phase.
    with Solver(MPI.COMM_SELF, wheel, Options(harmonics=harmonics, tolerance=1e-7)) as solver:
        solver.follow_static_path(np.empty((2, 0)), 10, frequency)
        solver.set_excitation(0.9 * frequency, 1.1 * frequency, 1.0)
        assert solver.start_from(StoredPoint(frequency, wave, np.zeros((2 * sectors, 2))), 1.0)
        assert solver.coordinates() == pytest.approx(wave, abs=1e-8 * np.abs(wave).max())


def modal_damping(job: Job, ratios: list[float]) -> list[list[float]]:
    """The viscous damping M X diag(2 zeta omega) X^T M of the stuck modes X of a job on matrices."""
    mass, stiffness = (np.array(job["model"][name]) for name in ("mass", "stiffness"))
    for contact in job["contact"]:
        springs = [(terms, contact["tangential_stiffness"]) for terms in contact["tangents"]]
        for terms, spring in [*springs, (contact["normal"], contact["normal_stiffness"])]:
            row = np.zeros(len(mass))
            for dof, coefficient in terms:
                row[dof] += coefficient
            stiffness = stiffness + spring * np.outer(row, row)
    squares, modes = eigh(stiffness, mass)
    all_ratios = np.array([*ratios, *[ratios[-1]] * (len(mass) - len(ratios))])
    inertia = mass @ modes
    return ((inertia * 2.0 * all_ratios * np.sqrt(squares)) @ inertia.T).tolist()


RATIOS = [0.02, 0.05, 0.001, 0.03]


def shaken_chain(contacts: int) -> Job:
    """Driven until its contacts slip; its damping is left to others."""
    job = chain(contacts)
    del job["damping"]
    job["load"][1] |= {"cosine": [[0, 60.0]], "sine": [[0, 30.0]]}
    return job


def test_a_ratio_of_each_mode_is_the_viscous_damping_that_has_them(tmp_path):
    job = shaken_chain(2)
    matrix = modal_damping(job, RATIOS)
    (tmp_path / "list").mkdir()
    (tmp_path / "matrix").mkdir()
    run(tmp_path / "list", job | {"damping": {"ratio": RATIOS}})
    run(tmp_path / "matrix", job | {"model": job["model"] | {"damping": matrix}})
    pairs = list(zip(table(tmp_path / "list"), table(tmp_path / "matrix"), strict=True))
    for one, other in pairs:
        for name in one:
            if name.endswith(("_amplitude", "_mean")):
                # Both solve to a residual of 1e-10 of the loads.
                assert float(one[name]) == pytest.approx(float(other[name]), rel=1e-7, abs=1e-14)
    with Result(tmp_path / "list" / "result.h5") as result:
        assert np.any(np.array(result.named("/contacts/state")) == "slipping"), "the test is void unless contacts slip"
    for folder, model in (("list", {"damping": {"ratio": RATIOS}}), ("matrix", {})):
        linear = job | model
        if folder == "matrix":
            linear = job | {"model": job["model"] | {"damping": matrix}}
        done = attrito(tmp_path / folder, "linear-modes", write_job(tmp_path / folder, linear), "--state", "stuck")
        assert done.returncode == 0, done.stderr
        rows = table(tmp_path / folder, result="result.stuck.modes.h5")
        expected = [*RATIOS, *[RATIOS[-1]] * (len(rows) - len(RATIOS))]
        assert [float(row["damping_ratio"]) for row in rows] == pytest.approx(expected, rel=1e-9)


def test_integration_in_time_takes_a_ratio_of_each_mode(tmp_path):
    found = []
    job = shaken_chain(1)
    matrix = modal_damping(job, RATIOS[:2])
    job["integrate"] = {"frequency_hz": 80.0}
    for name, one in (
        ("list", job | {"damping": {"ratio": RATIOS[:2]}}),
        ("matrix", job | {"model": job["model"] | {"damping": matrix}}),
    ):
        (tmp_path / name).mkdir()
        done = attrito(tmp_path / name, "integrate", write_job(tmp_path / name, one))
        assert done.returncode == 0, done.stdout + done.stderr
        (written,) = (tmp_path / name).glob("*.h5")
        with h5py.File(written) as file:
            found.append(np.array([file[f"integration/contacts/{end}"][0] for end in ("t1_mean", "n_mean", "slip")]))
    # Both come to the same steady motion, to 1e-9 a period.
    assert found[0] == pytest.approx(found[1], rel=1e-6)
    assert found[0][2] > 0.0, "the test is void unless the contact slips"


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"damping": {"ratio": -0.01}}, "[damping] ratio = -0.01: expected at least 0, but in attrito mode"),
        ({"damping": {"ratio": [0.01, -0.01]}}, "but in attrito mode"),
        ({"damping": {"ratio": [0.01] * 50}}, "a list of 50"),
        ({"damping": {"ratio": []}}, "[damping] ratio"),
        ({"damping": {"ratio": [0.01]}, "sensitivity": {"to": ["damping.ratio"]}}, "no derivatives by a list"),
    ],
)
def test_a_ratio_that_no_response_can_have_is_refused(change, expected, tmp_path):
    job = shaken_chain(1)
    done = attrito(tmp_path, "run", write_job(tmp_path, job | change))
    assert done.returncode == 2, done.stdout
    assert expected in " ".join(done.stderr.split()), done.stderr
