"""Commands that share a folder: locks, names of reduced models, files that are nobody else's. More: `job_arrays.py`."""

from __future__ import annotations

import errno
import fcntl
import json
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import h5py
import pytest
from edited import edited
from job_arrays import job_arrays
from jobs import attrito, attrito_here, blocks, table, wedge, write_blocks, write_job
from mpi4py import MPI

from attrito.job.reading import read_job
from attrito.results.journal import MAGIC
from attrito.scene import reduced_model as rom
from attrito.scene.build import build_scene
from attrito.scene.rom_claim import claim, steps_of
from attrito.support.atomic_files import whole_file
from attrito.support.errors import InputError
from attrito.support.locks import Lock
from attrito.support.own_folders import take_folder

MINE, OTHERS = "a" * 64, "b" * 64


@pytest.mark.parametrize("first", [0, 1], ids=["left alone", "some killed"])
def test_jobs_started_together_give_what_each_gives_alone(tmp_path, first):
    found = job_arrays(tmp_path, 1, seed=5, first=first)
    assert found["commands"] >= 4
    assert found["wrong"] == {}


def test_a_lock_is_gone_with_the_process_that_held_it(tmp_path):
    path = tmp_path / "result.h5"
    script = "import sys, time; from attrito.support.locks import Lock; lock = Lock(sys.argv[1])"
    script += "; print(lock.take('me'), flush=True); time.sleep(600)"
    with subprocess.Popen([sys.executable, "-c", script, str(path)], stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout.readline() == "True\n"
        lock = Lock(path)
        assert not lock.take()
        assert lock.is_held() and lock.note() == "me"
        holder.send_signal(signal.SIGKILL)
        holder.wait()
    assert lock.take()
    lock.release()
    assert list(tmp_path.iterdir()) == []


def test_a_folder_without_locks_is_told_and_the_job_is_done(tmp_path, capfd, monkeypatch):
    def none(*_: object) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(fcntl, "flock", none)
    done = attrito_here(tmp_path, capfd, "run", write_job(tmp_path, wedge()))
    assert done.returncode == 0, done.stdout + done.stderr
    (warning,) = [line for line in done.stdout.splitlines() if line.startswith("warning: ")]
    assert f"the file system of {tmp_path} has no locks" in warning
    assert sorted(path.name for path in tmp_path.iterdir()) == ["job.toml", "result.h5"]


def test_a_lock_that_the_system_fails_to_give_is_told(tmp_path, capfd, monkeypatch):
    def broken(*_: object) -> None:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(fcntl, "flock", broken)
    done = attrito_here(tmp_path, capfd, "run", write_job(tmp_path, wedge()))
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert (
        "result.h5: file = 'Input/output error (lock)': expected a place where a file can be written and locked" in line
    )


def test_a_model_is_read_whatever_locks_it(tmp_path):
    """HDF5 would refuse it, and all others where there are no locks."""
    write_blocks(tmp_path / "model.h5")
    with open(tmp_path / "model.h5", "rb") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        done = attrito(tmp_path, "info", "model.h5")
    assert done.returncode == 0, done.stderr


def test_a_lock_that_is_a_link_is_not_followed(tmp_path):
    (tmp_path / "theirs").write_text("theirs")
    (tmp_path / "result.h5.lock").symlink_to("theirs")
    with pytest.raises(OSError):
        Lock(tmp_path / "result.h5").take()
    assert (tmp_path / "theirs").read_text() == "theirs"


def made(fingerprints: dict[str, str]):
    return lambda path: fingerprints.get(Path(path).name, "")


def test_another_reduction_beside_the_first_has_a_name_of_its_own(tmp_path):
    first = str(tmp_path / "rom.h5")
    (tmp_path / "rom.h5").write_text("there")
    here = claim(first, MINE, False, made({"rom.h5": OTHERS}), print)
    assert (Path(here.path).name, here.fresh) == ("rom.aaaaaaaa.h5", False)
    here.release()
    assert claim(first, MINE, False, made({"rom.h5": MINE}), print).fresh
    again = claim(first, MINE, False, made({"rom.h5": OTHERS, "rom.aaaaaaaa.h5": MINE}), print)
    assert (Path(again.path).name, again.fresh) == ("rom.aaaaaaaa.h5", True)


def test_an_interrupted_reduction_of_another_is_left_to_be_gone_on_with(tmp_path):
    first = str(tmp_path / "rom.h5")
    take_folder(steps_of(first), f"1 {OTHERS}")
    mine = claim(first, MINE, False, made({}), print)
    theirs = claim(first, OTHERS, False, made({}), print)
    assert [Path(one.path).name for one in (mine, theirs)] == ["rom.aaaaaaaa.h5", "rom.h5"]
    mine.release()
    theirs.release()


@pytest.mark.parametrize("given", [False, True], ids=["rom.h5", "a file that the job names"])
def test_the_same_reduction_by_another_process_is_waited_for_and_used(tmp_path, given):
    first = str(tmp_path / "rom.h5")
    known: dict[str, str] = {}
    theirs = claim(first, MINE, given, made(known), print)
    said: list[str] = []

    def finish() -> None:
        known["rom.h5"] = MINE
        theirs.release()

    threading.Timer(1.0, finish).start()
    mine = claim(first, MINE, given, made(known), said.append)
    mine.release()
    assert (mine.path, mine.fresh) == (first, True)
    assert said == [f"waiting for another process, which makes {first}", f"another process made {first}"]


def test_another_reduction_under_way_is_not_waited_for_unless_the_job_names_its_file(tmp_path):
    first = str(tmp_path / "rom.h5")
    theirs = claim(first, OTHERS, False, made({}), print)
    mine = claim(first, MINE, False, made({}), print)
    assert Path(mine.path).name == "rom.aaaaaaaa.h5"
    mine.release()
    threading.Timer(0.5, theirs.release).start()
    said: list[str] = []
    named = claim(first, MINE, True, made({}), said.append)
    named.release()
    assert named.path == first and said[0].startswith("waiting for")


def test_what_was_read_is_what_was_asked_for(tmp_path, monkeypatch):
    write_blocks(tmp_path / "model.h5")
    job = read_job(tmp_path / write_job(tmp_path, blocks()))
    scene = build_scene(job)
    made_by, _ = rom.make_rom(MPI.COMM_SELF, job, scene)
    with edited(made_by.path) as file:
        file.attrs["fingerprint"] = OTHERS
    # As where another process puts its own in the file's place after it was looked at.
    monkeypatch.setattr(rom, "rom_fingerprint", lambda path: made_by.fingerprint)
    with pytest.raises(InputError, match="fingerprint = 'of another reduction, again and again'"):
        rom.make_rom(MPI.COMM_SELF, job, build_scene(job))


def test_two_reductions_in_a_folder_are_named_in_their_results_and_stay(tmp_path, capfd):
    write_blocks(tmp_path / "model.h5")
    files = []
    for modes, output in ((5, "one.h5"), (3, "other.h5"), (5, "again.h5")):
        job = blocks()
        job["reduction"]["modes"], job["output"]["file"] = modes, output
        done = attrito_here(tmp_path, capfd, "run", write_job(tmp_path, job))
        assert done.returncode == 0, done.stderr
        with h5py.File(tmp_path / output) as file:
            files.append(Path(file.attrs["rom_file"]).name)
            with h5py.File(tmp_path / files[-1]) as reduced:
                assert reduced.attrs["fingerprint"] == file.attrs["rom_fingerprint"]
                assert json.loads(reduced.attrs["job"])["reduction"]["modes"] == modes
    assert files[0] == files[2] == "rom.h5"
    assert len(files[1]) == len("rom.12345678.h5")
    assert done.stdout.count("rom.h5: up to date") == 1
    for output in ("one.h5", "other.h5"):
        assert attrito_here(tmp_path, capfd, "export", output).returncode == 0


@pytest.mark.parametrize("command", ["run", "integrate", "peak", "study"])
def test_an_output_that_another_process_writes_is_refused(tmp_path, capfd, command):
    job = wedge()
    job["sweep"] = {"start_hz": 140.0, "stop_hz": 130.0}
    job["integrate"] = {"frequency_hz": 132.0}
    job["peak"] = {"start": 1.0, "stop": 2.0, "file": "peaks.h5"}
    write_job(tmp_path, job)
    vary = {"name": "mu", "keys": ["contact[0].friction_coefficient"], "low": 0.4, "high": 0.5}
    write_job(tmp_path, {"job": "job.toml", "file": "result.h5", "samples": 2, "vary": [vary]}, "study.toml")
    output = "peaks.h5" if command == "peak" else "result.h5"
    lock = Lock(tmp_path / output)
    assert lock.take()
    done = attrito_here(tmp_path, capfd, command, "study.toml" if command == "study" else "job.toml")
    lock.release()
    assert done.returncode == 2
    assert done.stderr.count("attrito: ") == 1
    assert f"{output}: file = 'in use': expected that no other process writes it" in done.stderr
    assert not (tmp_path / output).exists()


def test_unfinished_files_are_nobody_elses(tmp_path):
    path = tmp_path / "result.h5"
    (tmp_path / "theirs").write_text("theirs")
    (tmp_path / "result.h5.new").symlink_to("theirs")
    with whole_file(path) as one, whole_file(path) as other:
        assert one != other
        Path(one).write_text("one")
        Path(other).write_text("other")
    assert path.read_text() == "one"
    assert (tmp_path / "theirs").read_text() == "theirs" and os.path.islink(tmp_path / "result.h5.new")


@pytest.mark.parametrize("name", ["rom.h5.partial", "rom.h5.partial.steps", "result.h5.partial"])
def test_a_link_in_the_place_of_an_unfinished_file_is_refused_and_not_followed(tmp_path, capfd, name):
    write_blocks(tmp_path / "model.h5")
    theirs = tmp_path / "theirs"
    if name.endswith("steps"):
        theirs.mkdir()
        (theirs / "file").write_text("theirs")
    else:
        theirs.write_bytes(MAGIC if name.startswith("result") else b"theirs")
    (tmp_path / name).symlink_to("theirs")
    done = attrito_here(tmp_path, capfd, "run", "--resume", write_job(tmp_path, blocks()))
    assert done.returncode == 2, done.stdout
    assert done.stderr.count("attrito: ") == 1 and name in done.stderr
    assert (theirs / "file" if theirs.is_dir() else theirs).read_bytes() in (MAGIC, b"theirs")


@pytest.mark.parametrize("theirs", ["theirs", ""])
def test_a_file_that_is_no_journal_is_not_set_aside(tmp_path, capfd, theirs):
    write_job(tmp_path, wedge())
    (tmp_path / "result.h5.partial").write_text("theirs")
    done = attrito_here(tmp_path, capfd, "run", "job.toml")
    assert done.returncode == 2 and "result.h5.partial: file = 'not a journal'" in done.stderr
    (tmp_path / "result.h5.partial").unlink()
    (tmp_path / "result.h5.partial.old").write_text(theirs)
    (tmp_path / "result.h5.partial").write_text("")
    # An empty file is as foreign as any other: a journal has its first line when it gets its name.
    assert attrito_here(tmp_path, capfd, "run", "job.toml").returncode == 2
    (tmp_path / "result.h5.partial").unlink(missing_ok=True)
    assert attrito_here(tmp_path, capfd, "run", "job.toml").returncode == 0
    assert (tmp_path / "result.h5.partial.old").read_text() == theirs
    assert len(table(tmp_path)) == 1
