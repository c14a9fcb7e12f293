"""Faulty input: exit code 2, one message with file, key, value and what was expected; no result is touched."""

from __future__ import annotations

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
from edited import edited
from fault_cases import Case, both, drop, frequencies, put
from faults_of_jobs import CAMPBELL, JOB
from faults_of_models import MESH, MODEL
from faults_of_sectors import SECTOR
from jobs import attrito, attrito_here, run, toml, wedge, without_lines, write_blocks, write_job
from scipy.sparse import coo_matrix, eye

from attrito.support.errors import Fault, InputError

OLD_RESULT = b"a result of yesterday"
NAN = float("nan")
STIFFNESS = coo_matrix(np.diag([4.0e5, 2.5e6]))
ALL = JOB + CAMPBELL + MODEL + MESH + SECTOR
ON_RANKS = [
    "a line that is not TOML",
    "an unknown key",
    "a negative stiffness",
    "a matrix file that is missing",
    "a truncated Matrix Market file",
    "a Matrix Market file that ends after its header",
    "an unsymmetric stiffness",
    "a mass that is not positive, found by the library",
    "contacts that leave a motion free, found by the library",
    "a contact on a dof that is not there",
    "a model file that is another HDF5 file",
    "pairs out of tolerance",
    "more modes than interior dofs",
    "a body that floats with the boundary held, found by the library",
]


@pytest.fixture(scope="session")
def faulty_files(tmp_path_factory) -> Path:
    """Files that jobs refer to, most of them at fault."""
    folder = tmp_path_factory.mktemp("faulty_files")
    (folder / "job.toml.bak").write_text("neither matrix nor model\n")
    scipy.io.mmwrite(folder / "K.mtx", STIFFNESS)
    text = (folder / "K.mtx").read_text()
    (folder / "truncated.mtx").write_text("\n".join(text.splitlines()[:-1]) + "\n")
    (folder / "header.mtx").write_text(text.splitlines()[0] + "\n")
    scipy.io.mmwrite(folder / "nan.mtx", coo_matrix(np.diag([4.0e5, NAN])))
    scipy.io.mmwrite(folder / "large.mtx", eye(5000))
    (folder / "load.txt").write_text("1.0\n2.0\n3.0\n")
    write_blocks(folder / "model.h5")
    write_blocks(folder / "floating.h5", floating=True)
    shutil.copy(folder / "model.h5", folder / "nan.h5")
    with edited(folder / "nan.h5") as file:
        file["mass/values"][0] = NAN
    shutil.copy(folder / "model.h5", folder / "nowhere.h5")
    with edited(folder / "nowhere.h5") as file:
        file["nodes/coordinates"][2, 1] = NAN
    with h5py.File(folder / "other.h5", "w") as file:
        file["numbers"] = np.arange(3)
    return folder


@pytest.fixture
def folder(tmp_path, faulty_files) -> Path:
    """A folder with those files and a result that must survive."""
    for path in faulty_files.iterdir():
        (tmp_path / path.name).symlink_to(path)
    (tmp_path / "result.h5").write_bytes(OLD_RESULT)
    return tmp_path


def write(folder: Path, case: Case) -> None:
    """The case's job in the folder."""
    job = case.base()
    text = case.change(job)
    (folder / "job.toml").write_text(text or toml(job))


def check(done, folder: Path, messages: tuple[str, ...]) -> None:
    """Exit code 2, every message once, nothing else from the program, the old result untouched and no new one."""
    assert done.returncode == 2, done.stdout + done.stderr
    assert "Traceback" not in done.stdout + done.stderr
    assert done.stderr.count("attrito: ") == 1, done.stderr
    said = without_lines(done.stderr)
    for message in messages:
        assert said.count(message) == 1, f"{message!r} is not (or not once) in {said!r}"
    assert (folder / "result.h5").read_bytes() == OLD_RESULT
    assert not list(folder.glob("*.partial"))


@pytest.mark.parametrize("case", ALL, ids=lambda case: case.sentence)
def test_a_fault_is_told_with_file_key_value_and_what_was_expected(folder, capfd, case):
    write(folder, case)
    done = attrito_here(folder, capfd, "run", "job.toml")
    check(done, folder, case.messages)
    # One process: nothing but the message is on standard error.
    assert done.stderr.startswith("attrito: "), done.stderr
    assert ": expected " in done.stderr


@pytest.mark.parametrize("ranks", [2, 4])
@pytest.mark.parametrize("sentence", ON_RANKS)
def test_a_fault_is_told_once_by_all_ranks_and_none_hangs(folder, sentence, ranks):
    case = next(case for case in ALL if case.sentence == sentence)
    write(folder, case)
    check(attrito(folder, "run", "job.toml", ranks=ranks), folder, case.messages)


@pytest.mark.parametrize("ranks", [None, 2])
def test_a_job_that_is_not_there_is_told(folder, ranks):
    done = attrito(folder, "run", "jbo.toml", ranks=ranks)
    check(done, folder, ("jbo.toml: file = 'No such file or directory': expected a job file that can be read",))


def test_a_job_that_is_a_folder_is_told(folder, capfd):
    (folder / "jobs").mkdir()
    done = attrito_here(folder, capfd, "run", "jobs")
    check(done, folder, ("jobs: file = 'Is a directory': expected a job file that can be read",))


def test_a_job_that_is_not_text_is_told(folder, capfd):
    (folder / "job.toml").write_bytes(b"\xff\xfe\x00binary")
    check(attrito_here(folder, capfd, "run", "job.toml"), folder, ("job.toml: file = ", ": expected a job in TOML"))


def test_several_faults_are_told_together(folder, capfd):
    changes = both(
        put("contact", 0, normal_stiffness=-1.0),
        put("balance", harmonic=3),
        put("load", 1, harmonic=9),
        frequencies(start_hz=100.0),
        drop("output", "file"),
    )
    write(folder, Case("", changes, ()))
    expected = (
        "contact[0] normal_stiffness = -1.0",
        "[balance] harmonic = 3",
        "load[1] harmonic = 9",
        "[sweep] stop_hz is missing",
        "[output] file is missing",
    )
    done = attrito_here(folder, capfd, "run", "job.toml")
    check(done, folder, expected)
    *_, last = lines = done.stderr.splitlines()
    assert (len(lines), last) == (len(expected) + 1, f"{len(expected)} faults")


def test_several_faults_of_places_in_the_model_are_told_together(folder, capfd):
    changes = both(
        put("contact", 0, normal=[[5, 1.0]]),
        put("load", 0, dofs=[[6, 1.0]]),
        put("output", monitors=[{"name": "z", "dofs": [[7, 1.0]]}]),
    )
    write(folder, Case("", changes, ()))
    done = attrito_here(folder, capfd, "run", "job.toml")
    check(done, folder, ("contact[0] normal = 5", "load[0] dofs = 6", "[output] monitors[0] = 7"))


def test_reducing_a_job_that_does_not_ask_for_it_is_told(folder, capfd):
    write(folder, Case("", lambda job: None, ()))
    done = attrito_here(folder, capfd, "reduce", "job.toml")
    check(done, folder, ("job.toml: [reduction] is missing: expected this table",))


# --- the other commands ----------------------------------------------------------------------------------------------


@pytest.fixture(scope="session")
def wedge_result(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("wedge_result")
    run(folder, wedge())
    return folder / "result.h5"


@pytest.mark.parametrize("command", ["table", "plot", "export"])
@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("absent.h5", "absent.h5: file = 'absent': expected a result of `attrito run`"),
        ("result.h5", "result.h5: file = 'not HDF5': expected a result of `attrito run`"),
        ("model.h5", "model.h5: format = 'attrito model': expected a result of `attrito run`"),
        (".", ".: file = 'absent': expected a result of `attrito run`"),
    ],
    ids=["a file that is not there", "a file that is not HDF5", "a model file", "a folder"],
)
def test_what_is_not_a_result_is_told(folder, capfd, command, name, message):
    check(attrito_here(folder, capfd, command, name), folder, (message,))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["plot", "--loops", "--point", "1"], "wedge.h5: point = 1: expected a number from 0 to 0"),
        (["plot", "--loops", "--point", "-1"], "wedge.h5: point = -1: expected a number from 0 to 0"),
        (["plot", "--loops", "--contact", "1"], "wedge.h5: contact = 1: expected a number from 0 to 0"),
        (["plot", "--monitor", "z"], "wedge.h5: --monitor = 'z': expected one of x, y"),
        (["plot", "-o", "nowhere/frf.png"], "nowhere/frf.png: figure = "),
        (["plot", "-o", "frf.xyz"], "frf.xyz: "),
        (["plot", "--map"], "wedge.h5: "),
        (["export"], "wedge.h5: model_file = 'none': expected a result of a model with a mesh"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "told",
)
def test_what_a_result_does_not_hold_is_told(folder, capfd, wedge_result, arguments, message):
    (folder / "wedge.h5").symlink_to(wedge_result)
    command, *options = arguments
    check(attrito_here(folder, capfd, command, "wedge.h5", *options), folder, (message, ": expected "))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--stiffness", "K.mtx"], "import: mass is missing: expected a matrix file"),
        (["--stiffness", "K.mtx", "--mass", "M.mtx"], "import: mass = 'M.mtx': expected a file that can be read"),
        (["--stiffness", "nan.mtx", "--mass", "K.mtx"], "nan.mtx: line 5 = '2 2 nan'"),
        (["--stiffness", "large.mtx", "--mass", "K.mtx"], "K.mtx: mass = '2 x 2': expected the size of the stiffness"),
        (["--calculix", "blade", "--mesh", "blade.inp"], "blade.dof: file = "),
        (
            ["--stiffness", "K.mtx", "--mass", "K.mtx", "--spin-hz", "nan"],
            "import: spin_hz = nan: expected no speed for a stiffness that holds nothing of it",
        ),
        (["--calculix", "blade"], "import: mesh is missing: expected a file that goes with dofs"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "told",
)
def test_faults_of_an_import_are_told(folder, capfd, arguments, message):
    done = attrito_here(folder, capfd, "import", "result.h5", *arguments)
    check(done, folder, (message,))


def test_an_import_into_a_folder_that_is_a_file_is_told(folder, capfd):
    done = attrito_here(folder, capfd, "import", "result.h5/model.h5", "--stiffness", "K.mtx", "--mass", "K.mtx")
    check(done, folder, ("result.h5/model.h5: file = ", "expected a file that can be written"))


def test_what_a_faulty_key_may_have_meant_is_not_missing(folder, capfd):
    job = wedge()
    job["sweep"] = {"frequencies_hz": [-1.0]}
    write_job(folder, job)
    told = attrito_here(folder, capfd, "run", "job.toml").stderr.splitlines()
    assert len(told) == 1 and "[sweep] frequencies_hz" in told[0]


def test_a_message_of_very_many_faults_lists_the_first():
    faults = [Fault("job.toml", f"contact[{k}]", "missing", "a normal") for k in range(3000)]
    lines = str(InputError(*faults)).split("\n")
    assert len(lines) == 21 and lines[-1] == "and 2980 faults more, which may have the same cause"
