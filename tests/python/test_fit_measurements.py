"""Measurements of other kinds: hysteresis loops, responses over force, columns as instruments write them."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from jobs import Job, attrito_here, run, table, toml, wedge, write_job
from mpi4py import MPI

from attrito.fits.columns import read_columns
from attrito.fits.design import read_fit
from attrito.fits.run import run_fit
from attrito.fits.solution import Solution
from attrito.job.reading import read_job
from attrito.library.kernels import follow_path
from attrito.library.structures import make_law
from attrito.results.loops import contact_loops
from attrito.results.result import Result
from attrito.runs.progress import Progress
from attrito.support.errors import InputError

STIFFNESS, FRICTION, NORMAL = 2.0e7, 0.6, 50.0
LIMITS = {
    "contact stiffness": (["contact[0].tangential_stiffness"], 1e5, 1e9, 4e6),
    "friction coefficient": (["contact[0].friction_coefficient"], 0.05, 2.0, 0.2),
}


def jenkins_loop(displacement: float, turns: np.ndarray) -> np.ndarray:
    """Steady force at part `turns` of a cycle that begins at the largest displacement, of triangular displacement.

    Closed form: it unloads from mu N by the spring until -mu N, 2 mu N / kt further on, and the other way round.
    """
    limit = FRICTION * NORMAL
    u = triangle(displacement, turns)
    down = np.maximum(limit - STIFFNESS * (displacement - u), -limit)
    up = np.minimum(-limit + STIFFNESS * (u + displacement), limit)
    return np.where(turns % 1.0 < 0.5, down, up)


def triangle(size: float, turns: np.ndarray) -> np.ndarray:
    """From `size` down and back."""
    return size * (4.0 * np.abs(turns % 1.0 - 0.5) - 1.0)


def write_csv(path: Path, columns: dict[str, np.ndarray], separator: str = ",") -> None:
    """A file of measurements."""
    rows = zip(*columns.values(), strict=True)
    lines = [separator.join(columns), *(separator.join(f"{value:.12g}" for value in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n")


def write_fit(folder: Path, data: list[Job], **keys: object) -> str:
    """A fit of both parameters, or of what `keys` say."""
    parameters = [
        {"name": name, "keys": names, "low": low, "high": high, "start": start}
        for name, (names, low, high, start) in LIMITS.items()
    ]
    given = {"job": "job.toml", "profile": False, "parameter": parameters, "data": data} | keys
    (folder / "fit.toml").write_text(toml(given))
    return str(folder / "fit.toml")


LOOP = {"name": "loop", "of": "loop", "file": "loop.csv", "contact": "contact[0]"}


def test_a_noisy_loop_gives_the_stiffness_and_friction_of_its_closed_form(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """In micrometres, with an offset of the load cell, two cycles, separated by semicolons, with decimal commas."""
    write_job(tmp_path, wedge())
    turns = np.arange(0.0, 2.0, 1.0 / 64.0)
    noise = 0.6 * np.random.default_rng(5).standard_normal(len(turns))
    force = jenkins_loop(6e-6, turns) + 4.0 + noise
    write_csv(tmp_path / "loop.csv", {"Slip [um]": 1e6 * triangle(6e-6, turns), "Q [N]": force}, ";")
    (tmp_path / "loop.csv").write_text((tmp_path / "loop.csv").read_text().replace(".", ","))
    layout = {
        "columns": {"displacement": "Slip [um]", "tangential_force": "Q [N]"},
        "factors": {"displacement": 1e-6},
        "normal_force": NORMAL,
    }
    write_fit(tmp_path, [LOOP | layout])
    done = attrito_here(tmp_path, capfd, "fit", "fit.toml")
    assert done.returncode == 0, done.stderr
    found = {row["parameter"]: row for row in table(tmp_path, result="fit.h5")}
    for name, truth in (("contact stiffness", STIFFNESS), ("friction coefficient", FRICTION)):
        low, value, high = (float(found[name][key]) for key in ("low", "value", "high"))
        # Three standard deviations to either side, of which the interval has nearly two
        assert abs(np.log(value / truth)) < 0.75 * np.log(high / low)
        assert high / low < 1.1 and found[name]["identified"] == "true"
    with h5py.File(tmp_path / "fit.h5") as file:
        # Residuals have the noise's size, 128 of them: chi's deviation is 1/16.
        size = np.sqrt(np.mean((file["data/loop/solved/tangential_force"][:] - force) ** 2))
        assert size == pytest.approx(0.6, rel=0.25)
    assert (tmp_path / "fit.png").exists()


@pytest.mark.parametrize("steady", [True, False])
def test_a_law_follows_a_given_path_as_its_closed_form_says(steady: bool) -> None:
    law = {"tangents": [1], "tangential_stiffness": [STIFFNESS], "friction_coefficient": [FRICTION]}
    law |= {"normal_stiffness": [0.0], "gap": [0.0], "preload": [0.0]}
    laws = {name: np.array(values) for name, values in law.items()}
    turns = np.arange(0.25, 1.25, 1.0 / 400.0)
    u, limit = triangle(6e-6, turns), FRICTION * NORMAL
    expected = jenkins_loop(6e-6, turns)
    if not steady:
        # It begins without force at u = 0, on its way down, and has slipped before it turns.
        first = turns < 0.5
        expected[first] = np.maximum(STIFFNESS * u[first], -limit)
    force = follow_path(make_law(laws, 0), u, np.full(len(u), NORMAL), steady)
    # Turning points are among the samples, so only rounding is left.
    assert force == pytest.approx(expected, abs=1e-9 * limit)
    # An open contact has no force; where it lands it sticks.
    normal = np.where(turns < 0.75, NORMAL, -1.0)
    assert np.all(follow_path(make_law(laws, 0), u, normal, steady)[turns >= 0.75] == 0.0)


def test_a_loop_and_a_response_are_fitted_together(tmp_path: Path) -> None:
    """The loop has the friction alone, as it slips at once; the response, stuck, the stiffness alone."""
    job = wedge(3.0e5, force=0.1)
    job["contact"] = [contact | {"preload": 30.0} for contact in job["contact"]]
    job["balance"] = {"harmonics": 1}
    write_job(tmp_path, job)
    frequencies = np.linspace(110.0, 140.0, 7)
    turns = np.arange(0.0, 1.0, 1.0 / 16.0)
    # Wide by so much that the spring's part of a cycle lies between two samples
    force = np.where((turns > 0.0) & (turns <= 0.5), -FRICTION * NORMAL, FRICTION * NORMAL)
    write_csv(tmp_path / "loop.csv", {"displacement": triangle(1.0, turns), "tangential_force": force})
    both = LIMITS["contact stiffness"][0] + ["contact[0].normal_stiffness"]
    parameters = [
        {"name": "contact stiffness", "keys": both, "low": 1e4, "high": 1e7, "start": 1.5e5},
        {"name": "friction coefficient", "keys": LIMITS["friction coefficient"][0], "low": 0.05, "high": 2.0},
    ]
    loop = LOOP | {"normal_force": NORMAL}
    response = {"name": "response", "file": "response.csv", "monitor": "x"}
    write_csv(tmp_path / "response.csv", {"frequency_hz": frequencies, "amplitude": np.ones(7)})
    path = write_fit(tmp_path, [loop, response], parameter=parameters)
    fit = read_fit(path)
    solution = Solution(MPI.COMM_SELF, fit, fit.data[1], read_job(str(tmp_path / "job.toml")), Progress(MPI.COMM_SELF))
    truth, _ = solution.at(np.array([3.0e5, FRICTION]))
    write_csv(tmp_path / "response.csv", {"frequency_hz": frequencies, "amplitude": truth["amplitude"]})
    run_fit(MPI.COMM_SELF, path)
    with h5py.File(tmp_path / "fit.h5") as file:
        assert file["parameters/value"][:] == pytest.approx([3.0e5, FRICTION], rel=1e-5)


@pytest.mark.parametrize("monitor", [None, "x"])
def test_a_loop_of_a_solved_point_gives_stiffness_and_friction(tmp_path: Path, monitor: str | None) -> None:
    """From the loop that the result of a run has, begun somewhere, with other zeros."""
    job = wedge(3.0e5, force=60.0)
    job["contact"] = [contact | {"preload": 30.0, "friction_coefficient": 0.6} for contact in job["contact"]]
    job["balance"] = {"harmonics": 3}
    job["sweep"] = {"frequencies_hz": [125.0]}
    run(tmp_path, job)
    with Result(str(tmp_path / "result.h5")) as result:
        (loop,) = contact_loops(result, 0, [0])
        _, cosine, sine, *rest = result.dataset("monitors/x/harmonics")[0]
    turns = np.arange(1024) / 1024.0
    displacement = loop.displacement
    if monitor is not None:
        angles = 2.0 * np.pi * turns
        displacement = cosine * np.cos(angles) + sine * np.sin(angles)
        for i, (c, s) in enumerate(zip(rest[::2], rest[1::2], strict=True), 2):
            displacement = displacement + c * np.cos(i * angles) + s * np.sin(i * angles)
    chosen = (np.arange(0, 1024, 16) + 200) % 1024
    measured = {"displacement": displacement + 1.0, "tangential_force": loop.tangential - 7.0}
    write_csv(tmp_path / "loop.csv", {name: values[chosen] for name, values in measured.items()})
    data = {"name": "loop", "of": "loop", "file": "loop.csv", "contact": "contact[0]", "frequency_hz": 125.0}
    both = ["contact[0].tangential_stiffness", "contact[0].normal_stiffness"]
    parameters = [
        {"name": "contact stiffness", "keys": both, "low": 1e4, "high": 1e7, "start": 2e5},
        {"name": "friction coefficient", "keys": ["contact[0].friction_coefficient"], "low": 0.05, "high": 2.0},
    ]
    data |= {} if monitor is None else {"monitor": monitor}
    path = run_fit(MPI.COMM_SELF, read_fit(write_fit(tmp_path, [data], parameter=parameters)))
    with h5py.File(path) as file:
        # Forces between samples are straight: (pi / 2048)^2 / 2, 1e-6, of their size.
        assert file["parameters/value"][:] == pytest.approx([3.0e5, 0.6], rel=1e-4)


@pytest.mark.parametrize(
    ("quantity", "power", "over_force"),
    [("velocity", 1, False), ("accelerance", 2, True), ("mobility", 1, True), ("receptance", 0, True)],
)
def test_responses_over_force_are_those_of_a_linear_oscillator(
    tmp_path: Path, quantity: str, power: int, over_force: bool
) -> None:
    """Without contact the wedge's x is one: (k - omega^2 + i omega c) x = f, with the load's f = -5 sin 45 degrees."""
    job = wedge()
    job["contact"] = [contact | {"gap": 1.0} for contact in job["contact"]]
    job["load"] = job["load"][1:]
    write_job(tmp_path, job)
    frequencies = np.linspace(90.0, 110.0, 5)
    omega = 2.0 * np.pi * frequencies
    load = -5.0 * np.sqrt(0.5)
    exact = load / ((2.0 * np.pi * 100.0) ** 2 - omega**2 + 20j * np.pi * omega)
    exact = exact * (1j * omega) ** power / (-load if over_force else 1.0)
    measured = {"f": frequencies, "re": exact.real / 1e-3, "im": exact.imag / 1e-3}
    write_csv(tmp_path / "measured.csv", measured, "\t")
    data = {
        "name": "frf",
        "file": "measured.csv",
        "monitor": "x",
        "quantity": quantity,
        "columns": {"frequency_hz": "f", "real": "re", "imaginary": "im"},
        "factors": {"amplitude": 1e-3},
        "phase": True,
    } | ({"force": -load} if over_force else {})
    fit = read_fit(write_fit(tmp_path, [data]))
    solution = Solution(MPI.COMM_SELF, fit, fit.data[0], read_job(str(tmp_path / "job.toml")), Progress(MPI.COMM_SELF))
    found, _ = solution.at(np.array([1e6, 0.5]))
    # Points are solved to 1e-10; deviations are 5 % and 5 degrees.
    assert np.abs(fit.data[0].measured.residuals(found, 1.0)).max() < 1e-6


def test_decibels_are_amplitudes(tmp_path: Path) -> None:
    write_job(tmp_path, wedge())
    write_csv(
        tmp_path / "measured.csv", {"frequency_hz": np.array([1.0, 2.0]), "amplitude": np.array([-120.0, 6.0206])}
    )
    data = {"name": "frf", "file": "measured.csv", "monitor": "x", "decibel": True, "factors": {"amplitude": 2.0}}
    measured = read_fit(write_fit(tmp_path, [data])).data[0].measured
    # 20 log10 2 = 6.0206, to 1e-5 of a decibel
    assert measured.values["amplitude"] == pytest.approx([2e-6, 4.0], rel=1e-5)


def test_columns_as_instruments_write_them(tmp_path: Path) -> None:
    path = tmp_path / "some.csv"
    path.write_text("\ufeff# rig 3\n% again\n f ;note; a\nHz;;g\n1,5;x;2\n2,5;;\n", encoding="utf-8")
    columns = read_columns(str(path))
    assert columns.numbers["f"].tolist() == [1.5, 2.5]
    assert columns.numbers["a"][0] == 2.0 and np.isnan(columns.numbers["a"][1])
    assert columns.words == {"note": ("x", 1)}


@pytest.mark.parametrize("encoding", ["utf-8", "cp1252", "utf-16"])
def test_an_instrument_s_own_lines_and_encoding_are_understood(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "some.csv"
    text = "Test, wedge: 3\r\nDate;25.11.2026\r\n\r\nf;phase;a\r\nkHz;\u00b0;g\r\n1,5;NaN;2\r\n2,5;3;\r\n"
    path.write_bytes(text.encode(encoding))
    columns = read_columns(str(path))
    assert list(columns.numbers) == ["f", "phase", "a"] and not columns.words
    assert columns.numbers["f"].tolist() == [1.5, 2.5]
    assert np.isnan(columns.numbers["phase"][0]) and columns.numbers["phase"][1] == 3.0


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        ({"contact": "contact[1]"}, r"a \[\[contact\]\] of the job, which has 1"),
        ({"contact": "joint"}, "the contact whose law it is of"),
        ({"normal_force": None}, "a column of it in the file, or the key normal_force"),
        ({"area": 1.0}, "no such key where stiffnesses are not per area"),
        ({"decibel": True}, 'no such key but with of = "response"'),
        ({"columns": {"slip": "u"}}, "one of displacement, tangential_force, normal_force"),
        ({"columns": {"displacement": "u"}}, "a column 'u', the displacement of the data"),
        ({"columns": {"displacement": "note"}}, "a number, or a blank, in every line of numbers"),
        ({"frequency_hz": 100.0}, "no such key beside frequency_hz"),
        ({"level": 2.0}, "no such key without frequency_hz"),
        ({"columns": [1]}, "names of the file by those of columns"),
    ],
)
def test_faults_of_loops(tmp_path: Path, data: Job, expected: str) -> None:
    write_job(tmp_path, wedge())
    turns = np.arange(0.0, 1.0, 1.0 / 16.0)
    write_csv(tmp_path / "loop.csv", {"displacement": triangle(1.0, turns), "tangential_force": turns})
    lines = (tmp_path / "loop.csv").read_text().splitlines()
    (tmp_path / "loop.csv").write_text("\n".join([f"{lines[0]},note", *(f"{line},mm" for line in lines[1:])]) + "\n")
    keys = {name: value for name, value in (LOOP | {"normal_force": NORMAL} | data).items() if value is not None}
    with pytest.raises(InputError, match=expected):
        run_fit(MPI.COMM_SELF, write_fit(tmp_path, [keys]))


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        ({"quantity": "mobility"}, "the amplitude of the force that the response was divided by"),
        ({"force": 2.0}, "no such key but with quantity one of receptance, mobility, accelerance"),
        ({"phase": True}, "a range has no phase"),
        ({"quantity": "velocity", "phase": True}, "with phase = true a phase_deg"),
        ({"quantity": "gain"}, 'one of "range", "displacement"'),
        ({}, "decibel = true where they are in decibels"),
    ],
)
def test_faults_of_responses(tmp_path: Path, data: Job, expected: str) -> None:
    write_job(tmp_path, wedge())
    write_csv(tmp_path / "measured.csv", {"frequency_hz": np.array([1.0, 2.0]), "amplitude": np.array([1.0, -2.0])})
    with pytest.raises(InputError, match=expected):
        read_fit(write_fit(tmp_path, [{"name": "frf", "file": "measured.csv", "monitor": "x"} | data]))
