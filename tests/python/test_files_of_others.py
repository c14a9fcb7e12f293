"""What attrito keeps until a command has ended: no file of others is touched, and nothing damaged is taken up."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import h5py
import numpy as np
import pytest
from jobs import attrito_here, blocks, clean_environment, wedge, write_blocks, write_job
from mpi4py import MPI
from rubbing_fit import measured, rubbing, write_fit

import attrito.fits.run as fits_run
import attrito.studies.run as studies_run
from attrito.results.journal import MAGIC, Journal, Record, read_journal
from attrito.support.errors import InputError
from attrito.support.locks import Lock
from attrito.support.own_folders import MARK, owner_of, take_folder

JOB = wedge(force=1.0) | {
    "sweep": {"start_hz": 150.0, "stop_hz": 85.0},
    "peak": {"start": 10.0, "stop": 11.0, "file": "peaks.h5"},
    "mode": {"start": 1e-6, "stop": 1e-5, "points": 2},
    "campbell": {"speeds_hz": [0.0]},
    "integrate": {"frequency_hz": 132.0},
}
VARY = {"name": "mu", "keys": ["contact[0].friction_coefficient"], "low": 0.4, "high": 0.5}


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """A job, a study, a fit and a search of it; they are read, and nothing is solved before that is in order."""
    (tmp_path / "measured.csv").write_text("frequency_hz,x_amplitude\n110.0,1e-4\n120.0,2e-4\n130.0,1e-4\n")
    write_fit(tmp_path, profile=False, job="fitted.toml")
    write_job(tmp_path, rubbing(), "fitted.toml")
    write_job(tmp_path, JOB)
    write_job(tmp_path, {"job": "job.toml", "file": "study.h5", "samples": 4, "batch": 1, "vary": [VARY]}, "study.toml")
    write_job(tmp_path, {"job": "job.toml", "file": "optimum.h5", "levels": [1.0], "parameter": [VARY]}, "optimum.toml")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def put(place: Path, kind: str) -> Path:
    """Something of somebody in a place; returns the file that is to stay."""
    theirs = place.parent / "theirs"
    if kind == "file":
        place.write_text("theirs")
        return place
    if kind == "link":
        theirs.write_bytes(MAGIC)
        place.symlink_to(theirs)
        return theirs
    (place if kind == "folder" else theirs).mkdir()
    if kind == "link to a folder":
        place.symlink_to(theirs)
    (place / "0123456789abcdef").mkdir()
    (place / "0123456789abcdef" / "batch_000000").write_bytes(MAGIC)
    return place / "0123456789abcdef" / "batch_000000"


@pytest.mark.parametrize(
    ("command", "name", "kind"),
    [
        ("fit", "fit.h5.partial", "file"),
        ("fit", "fit.h5.partial", "link"),
        ("fit", "fit.h5.partial", "folder"),
        ("fit", "fit.h5.lock", "file"),
        ("study", "study.h5.parts", "file"),
        ("study", "study.h5.parts", "folder"),
        ("study", "study.h5.parts", "link to a folder"),
        ("mode", "result.mode.h5.partial", "file"),
        ("run", "result.h5.lock", "file"),
    ],
)
def test_what_is_in_the_place_of_an_unfinished_file_stays_and_is_named(folder, capfd, command, name, kind):
    theirs = put(folder / name, kind)
    before = theirs.read_bytes()
    done = attrito_here(folder, capfd, command, f"{command}.toml" if command in ("fit", "study") else "job.toml")
    assert done.returncode == 2, done.stdout
    assert done.stderr.count("attrito: ") == 1 and name in done.stderr
    assert theirs.read_bytes() == before


@pytest.mark.parametrize("name", ["rom.h5.partial", "rom.h5.altered", "rom.h5.partial.steps"])
def test_what_is_in_the_place_of_a_file_of_a_reduction_stays_and_is_named(tmp_path, capfd, name):
    write_blocks(tmp_path / "model.h5")
    theirs = put(tmp_path / name, "folder" if name.endswith("steps") else "file")
    before = theirs.read_bytes()
    job = blocks()
    # Only a stiffness that the job changes is written.
    job["load"].append({"kind": "centrifugal", "name": "spin", "speed_hz": 1.0, "axis_point": [0.0, 0.0, 0.0],
                        "axis_direction": [0.0, 0.0, 1.0], "spin_softening": True})  # fmt: skip
    done = attrito_here(tmp_path, capfd, "reduce", write_job(tmp_path, job))
    assert done.returncode == 2 and f"{name}: " in done.stderr and "in the way" in done.stderr, done.stderr
    assert theirs.read_bytes() == before


def test_the_journal_of_another_command_is_neither_gone_on_from_nor_removed(folder, capfd):
    with_run = Journal(str(folder / "fit.h5.partial"))
    with_run.append(Record({"attributes": {"format": "attrito result"}}))
    with_run.close()
    before = (folder / "fit.h5.partial").read_bytes()
    done = attrito_here(folder, capfd, "fit", "fit.toml")
    assert done.returncode == 2
    assert "fit.h5.partial: format = 'attrito result': expected what an unfinished attrito fit has left" in done.stderr
    assert (folder / "fit.h5.partial").read_bytes() == before


def interrupted(work, module, name, monkeypatch) -> None:
    """Do some work but for what it does last."""

    def killed(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(module, name, killed)
        work()


def spoil(path: Path) -> None:
    """Change a digit of the last number that a journal holds."""
    (*_, (record, end)) = read_journal(str(path))
    data = bytearray(path.read_bytes())
    place = max(i for i in range(end) if chr(data[i]) in "12345678")
    data[place] ^= 1
    path.write_bytes(data)
    assert record.note != {} and [found.note for found, _ in read_journal(str(path))] != [record.note]


def numbers(path: Path) -> dict[str, np.ndarray]:
    """Every dataset of a file."""
    found: dict[str, np.ndarray] = {}
    with h5py.File(path) as file:
        file.visititems(lambda name, item: found.update({name: item[()]}) if isinstance(item, h5py.Dataset) else None)
    return found


def test_a_changed_digit_of_an_evaluation_does_not_enter_a_fit(tmp_path, monkeypatch):
    measured(tmp_path, rubbing(), noise=0.02)
    write_fit(tmp_path, profile=False)
    monkeypatch.chdir(tmp_path)
    fits_run.run_fit(MPI.COMM_SELF, "fit.toml")
    whole = numbers(tmp_path / "fit.h5")
    interrupted(lambda: fits_run.run_fit(MPI.COMM_SELF, "fit.toml"), fits_run, "write_fit", monkeypatch)
    spoil(tmp_path / "fit.h5.partial")
    fits_run.run_fit(MPI.COMM_SELF, "fit.toml")
    again = numbers(tmp_path / "fit.h5")
    assert whole.keys() == again.keys()
    assert all(np.array_equal(whole[name], again[name], equal_nan=whole[name].dtype.kind == "f") for name in whole)


def test_a_changed_digit_of_a_batch_does_not_enter_a_study(folder, monkeypatch, capfd):
    studies_run.run_study(MPI.COMM_SELF, "study.toml")
    whole = numbers(folder / "study.h5")
    interrupted(lambda: studies_run.run_study(MPI.COMM_SELF, "study.toml"), studies_run, "write_study", monkeypatch)
    spoil(next(folder.glob("study.h5.parts/*/batch_000002")))
    capfd.readouterr()
    studies_run.run_study(MPI.COMM_SELF, "study.toml")
    assert "in 4 batches, 3 of them there already" in capfd.readouterr().out
    again = numbers(folder / "study.h5")
    assert whole.keys() == again.keys()
    assert all(np.array_equal(whole[name], again[name], equal_nan=True) for name in whole)
    assert not (folder / "study.h5.parts").exists()


OUTPUTS = {
    "run": "output.file", "mode": "mode.file", "peak": "peak.file", "linear-modes": "output.file",
    "campbell": "campbell.file", "integrate": "output.file", "study": "", "fit": "", "optimise": "",
}  # fmt: skip


@pytest.mark.parametrize("bad", ["a folder", "no place", "too long a name", "a picture that is a folder"])
@pytest.mark.parametrize("command", OUTPUTS)
def test_an_output_that_cannot_be_written_is_told_before_anything_is_solved(folder, capfd, command, bad):
    name = {"no place": "job.toml/out.h5", "too long a name": f"{'n' * 240}.h5"}.get(bad, "out.h5")
    made = {"linear-modes": "out.modes.h5"}.get(command, "out.h5")
    if bad == "a folder":
        (folder / made).mkdir()
    if bad == "a picture that is a folder":
        if command in ("run", "linear-modes", "integrate", "optimise"):
            pytest.skip("it draws no picture")
        (folder / "out.png").mkdir()
    arguments = ["job.toml", "--set", f'{OUTPUTS[command]}="{name}"']
    if not OUTPUTS[command]:
        source = {"optimise": "optimum"}.get(command, command)
        text = (folder / f"{source}.toml").read_text()
        lines = [line for line in text.splitlines() if not line.startswith('file = "') or "measured" in line]
        (folder / f"{source}.toml").write_text(f'file = "{name}"\n' + "\n".join(lines))
        arguments = [f"{source}.toml"]
    done = attrito_here(folder, capfd, command, *arguments)
    assert done.returncode == 2, done.stderr
    assert "batches" not in done.stdout and "Hz" not in done.stdout and "residual" not in done.stdout
    assert done.stderr.count("attrito: ") == 1 and ("out" in done.stderr or "nnn" in done.stderr)


TAKES = """
import sys
from attrito.support.errors import InputError
from attrito.support.locks import Lock
from attrito.support.own_folders import MARK, owner_of, take_folder
lock = Lock(sys.argv[1])
assert lock.take("mine") and Lock(sys.argv[1]).is_held()
lock.release()
assert not Lock(sys.argv[1]).is_held()
"""


@pytest.mark.skipif(os.geteuid() != 0, reason="takes a second user")
@pytest.mark.parametrize("sticky", [False, True])
def test_a_lock_that_a_dead_process_of_another_user_has_left_does_not_block(sticky):
    with tempfile.TemporaryDirectory() as name:
        # In a sticky folder the file of another user can be neither written nor removed.
        os.chmod(name, 0o1777 if sticky else 0o777)
        place = Path(name) / "result.h5"
        left = Path(f"{place}.lock")
        left.write_text("attrito lock\n")
        left.chmod(0o644)
        done = subprocess.run(
            [sys.executable, "-c", TAKES, str(place)], env=clean_environment(), user=65534, check=False
        )
        assert done.returncode == 0 and left.exists() == sticky
        lock = Lock(place)
        assert lock.take()
        lock.release()
        assert not left.exists()


def test_a_file_of_others_in_the_place_of_a_lock_keeps_its_mode(tmp_path):
    theirs = tmp_path / "result.h5.lock"
    theirs.write_text("mine")
    theirs.chmod(0o600)
    with pytest.raises(InputError):
        Lock(tmp_path / "result.h5").take()
    assert theirs.read_text() == "mine" and theirs.stat().st_mode & 0o777 == 0o600


def test_an_empty_file_in_the_place_of_a_journal_stays(tmp_path):
    """A run that was killed leaves none: it had been taken for what one left at its first moment, and was removed."""
    write_blocks(tmp_path / "model.h5")
    path = write_job(tmp_path, blocks())
    partial = tmp_path / "result.h5.partial"
    partial.touch()
    before = partial.stat()
    done = subprocess.run(
        [sys.executable, "-m", "attrito.cli", "run", path], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 2 and "result.h5.partial: file = 'not a journal'" in done.stderr
    assert partial.stat().st_ino == before.st_ino and partial.read_bytes() == b""


@pytest.mark.parametrize("code", [errno.EPERM, errno.ENOTSUP, errno.ENOSYS])
def test_a_journal_begins_where_a_file_system_has_no_hard_links(tmp_path, monkeypatch, code):
    def refuse(source, target):
        raise OSError(code, os.strerror(code), source, None, target)

    monkeypatch.setattr(os, "link", refuse)
    path = str(tmp_path / "result.h5.partial")
    journal = Journal(path)
    journal.append(Record({"point": 1}))
    journal.close()
    assert [record.note for record, _ in read_journal(path)] == [{"point": 1}]
    assert os.listdir(tmp_path) == ["result.h5.partial"]


def test_what_another_process_puts_in_the_place_of_a_journal_stays_without_hard_links(tmp_path, monkeypatch):
    path = tmp_path / "result.h5.partial"

    def refuse(source, target):
        path.write_bytes(MAGIC + b"of another run")
        raise OSError(errno.EPERM, os.strerror(errno.EPERM))

    monkeypatch.setattr(os, "link", refuse)
    Journal(str(path), len(MAGIC) + 14).close()
    assert path.read_bytes() == MAGIC + b"of another run"


def test_an_empty_mark_makes_a_folder_attritos_only_if_there_is_nothing_else(tmp_path):
    place = tmp_path / "study.h5.parts"
    place.mkdir()
    (place / MARK).write_text("")
    (place / "thesis").mkdir()
    with pytest.raises(InputError):
        take_folder(place, "mine")
    (place / "thesis").rmdir()
    take_folder(place, "mine")
    (place / "batch").write_text("half")
    take_folder(place, "mine")
    assert (place / "batch").exists()
    take_folder(place, "another")
    assert owner_of(place) == "another" and [entry.name for entry in place.iterdir()] == [MARK]
