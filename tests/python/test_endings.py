"""How a command ends where its output breaks, where a signal reaches one rank alone, and where ranks disagree."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from jobs import ENVIRONMENT, TIMEOUT, chain, table, wait_for, wedge, write_job

from attrito.cli import program


def attrito_with_output(folder: Path, output: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the command with standard output closed, to a pipe that nobody reads, or to a disk that is full."""
    command = [sys.executable, "-m", "attrito.cli", *arguments]
    options = {"cwd": folder, "env": os.environ | ENVIRONMENT, "stderr": subprocess.PIPE, "text": True}
    if output == "closed":
        return subprocess.run(["sh", "-c", 'exec "$@" >&-', "sh", *command], timeout=TIMEOUT, check=False, **options)
    if output == "full":
        with open("/dev/full", "w") as full:
            return subprocess.run(command, stdout=full, timeout=TIMEOUT, check=False, **options)
    read, write = os.pipe()
    os.close(read)
    try:
        return subprocess.run(command, stdout=write, timeout=TIMEOUT, check=False, **options)
    finally:
        os.close(write)


OUTPUTS = ["closed", "a pipe nobody reads", "full"]


@pytest.mark.parametrize("output", OUTPUTS)
def test_a_run_whose_output_breaks_still_writes_its_result(tmp_path, output):
    job = wedge()
    job["sweep"] = {"frequencies_hz": [131.0, 132.0]}
    done = attrito_with_output(tmp_path, output, "run", write_job(tmp_path, job))
    assert (done.returncode, done.stderr) == (0, "")
    assert [row["outcome"] for row in table(tmp_path)] == ["converged"] * 2
    assert sorted(path.name for path in tmp_path.iterdir()) == ["job.toml", "result.h5"]


@pytest.mark.parametrize("output", OUTPUTS)
def test_a_failure_stays_one_where_the_output_breaks(tmp_path, output):
    job = chain()
    job["sweep"] = {"start_hz": 82.0, "stop_hz": 80.0}
    job["continuation"] = {"max_points": 2}
    unsolved = attrito_with_output(tmp_path, output, "run", write_job(tmp_path, job))
    assert unsolved.returncode == 1 and "max_points was reached" in unsolved.stderr
    absent = attrito_with_output(tmp_path, output, "run", "absent.toml")
    assert absent.returncode == 2 and absent.stderr.startswith("attrito: absent.toml: file = ")


@pytest.mark.parametrize(("output", "code"), [("closed", 2), ("a pipe nobody reads", 0), ("full", 2)])
def test_a_table_that_cannot_be_printed_is_no_success_unless_its_reader_has_left(tmp_path, output, code):
    from synthetic import write_result

    write_result(tmp_path / "result.h5", [100.0], {"tip": [1.0]})
    done = attrito_with_output(tmp_path, output, "table", "result.h5")
    assert done.returncode == code
    assert done.stderr.count("attrito: ") == (1 if code else 0) and "Traceback" not in done.stderr


def processes_of(launcher: int) -> list[int]:
    return [int(child) for child in Path(f"/proc/{launcher}/task/{launcher}/children").read_text().split()]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
@pytest.mark.parametrize("other_answers", [True, False], ids=["the other answers", "the other hangs"])
def test_a_signal_at_one_rank_of_two_ends_both(tmp_path, number, other_answers):
    job = chain(contacts=5)
    job["sweep"] = {"start_hz": 84.0, "stop_hz": 76.0, "levels": [0.5 + 0.01 * i for i in range(50)]}
    command = ["mpirun", "-n", "2", sys.executable, "-m", "attrito.cli", "run", write_job(tmp_path, job)]
    started = subprocess.Popen(
        command, cwd=tmp_path, env=os.environ | ENVIRONMENT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    journal = tmp_path / "result.h5.partial"
    wait_for(lambda: journal.is_file() and journal.stat().st_size > 100_000)
    ranks = processes_of(started.pid)
    assert len(ranks) == 2
    if not other_answers:
        # The rank that the signal reaches waits for it, in MPI, and Python cannot answer there.
        os.kill(ranks[0], signal.SIGSTOP)
        time.sleep(0.5)
    os.kill(ranks[1], number)
    started.communicate(timeout=TIMEOUT)
    assert started.returncode != 0
    wait_for(lambda: not any(Path(f"/proc/{rank}").exists() for rank in ranks))
    assert not (tmp_path / "result.h5").exists()


def on_two_ranks(folder: Path, script: str) -> subprocess.CompletedProcess[str]:
    (folder / "script.py").write_text(textwrap.dedent(script))
    return subprocess.run(
        ["mpirun", "-n", "2", sys.executable, "script.py"],
        cwd=folder, env=os.environ | ENVIRONMENT, capture_output=True, text=True, timeout=TIMEOUT, check=False,
    )  # fmt: skip


@pytest.mark.parametrize("what", ["file", "dictionary"])
def test_ranks_that_ask_for_different_jobs_are_told_so(tmp_path, what):
    write_job(tmp_path, wedge(), "one.toml")
    write_job(tmp_path, wedge(force=4.0), "other.toml")
    script = f"""
        import tomllib
        from mpi4py import MPI
        import attrito
        job = ["one.toml", "other.toml"][MPI.COMM_WORLD.rank]
        if {what!r} == "dictionary":
            job = tomllib.loads(open(job).read())
        try:
            attrito.run(job, MPI.COMM_WORLD, quiet=True)
        except attrito.InputError as error:
            print(error)
    """
    done = on_two_ranks(tmp_path, script)
    assert done.returncode == 0, done.stderr
    told = "job: on rank(s) 1 = 'another than on rank 0': expected the same job on every rank"
    assert done.stdout.count(told) == 2
    assert not (tmp_path / "result.h5").exists()


def test_a_library_that_one_rank_alone_does_not_have_ends_all(tmp_path):
    write_job(tmp_path, chain())
    script = """
import os, sys
from mpi4py import MPI
if MPI.COMM_WORLD.rank == 1:
    os.environ["ATTRITO_LIBRARY"] = "absent.so"
from attrito.cli.program import main
sys.exit(main(["run", "-q", "job.toml"]))
"""
    done = on_two_ranks(tmp_path, script)
    assert done.returncode == 2 and done.stderr.count("absent.so") == 1


def test_ranks_that_have_come_at_the_deadline_are_there(monkeypatch):
    """What has not come then is not waited for."""

    class Ranks:
        rank, size = 0, 2

        def __init__(self, comes: bool):
            self.irecv = lambda **_: SimpleNamespace(test=lambda: (comes, None))
            self.isend = lambda *_: SimpleNamespace(wait=lambda: None)

    monkeypatch.setattr(program, "PATIENCE", -1.0)
    assert program._all_come(Ranks(comes=True))
    assert not program._all_come(Ranks(comes=False))
