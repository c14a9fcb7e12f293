"""Memory that is limited, signals at one rank of any command, names that a terminal or XML could not show."""

from __future__ import annotations

import io
import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest
from jobs import ENVIRONMENT, TIMEOUT, attrito, attrito_here, blocks, wait_for, wedge, write_blocks, write_job

from attrito.cli import standard_output
from attrito.scene import reduced_model
from attrito.support.errors import Fault, InputError

EXHAUSTED = """
    import ctypes, sys
    from attrito.library import loading
    from attrito.support.locks import Lock
    Lock("result.h5").take()
    allocate = loading.load()["__wrap_malloc"]
    allocate.argtypes, allocate.restype = (ctypes.c_size_t,), ctypes.c_void_p
    if {rank}:
        # More than any processor can address
        allocate(1 << 60)
    from mpi4py import MPI
    MPI.COMM_WORLD.Barrier()
"""


@pytest.mark.parametrize("ranks", [1, 2])
def test_an_allocation_of_the_library_that_fails_ends_all_with_a_message_and_without_a_lock(tmp_path, ranks):
    rank = "True" if ranks == 1 else "__import__('mpi4py.MPI').MPI.COMM_WORLD.rank == 1"
    (tmp_path / "script.py").write_text(textwrap.dedent(EXHAUSTED).format(rank=rank))
    command = [sys.executable, "script.py"] if ranks == 1 else ["mpirun", "-n", "2", sys.executable, "script.py"]
    environment = os.environ | ENVIRONMENT
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=TIMEOUT,
                          check=False)  # fmt: skip
    assert done.returncode == 2, done.stderr
    expected = f"attrito: memory = {1 << 60} bytes more: expected input that fits into the memory there is\n"
    assert done.stderr.count(expected) == 1
    assert ranks == 2 or not (tmp_path / "result.h5.lock").exists()


LIMITED = """
    import resource, sys
    import numpy
    from attrito.cli import main
    pages = int(open("/proc/self/statm").read().split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + (100 << 20), resource.RLIM_INFINITY))
    sys.exit(main(sys.argv[1:]))
"""


def test_a_limit_without_room_for_blas_is_told_instead_of_waited_for(tmp_path):
    (tmp_path / "script.py").write_text(textwrap.dedent(LIMITED))
    command = [sys.executable, "script.py", "run", write_job(tmp_path, wedge())]
    environment = os.environ | ENVIRONMENT
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=TIMEOUT,
                          check=False)  # fmt: skip
    assert done.returncode == 2, done.stderr
    assert "bytes for OpenBLAS within ulimit -v" in done.stderr and done.stderr.count("attrito: ") == 1


def spinning(folder: Path, speeds: int) -> str:
    """A job whose every speed is reduced by itself."""
    write_blocks(folder / "model.h5")
    job = blocks()
    job["load"].append({"kind": "centrifugal", "name": "spin", "speed_hz": 1.0, "axis_point": [0.0, 0.0, 0.0],
                        "axis_direction": [0.0, 0.0, 1.0], "spin_softening": True})  # fmt: skip
    job["campbell"] = {"speeds_hz": [0.01 * i for i in range(speeds)], "modes": 2}
    return write_job(folder, job)


def test_more_coordinates_than_sizes_can_count_are_refused_before_anything_is_reduced(tmp_path, capfd, monkeypatch):
    monkeypatch.setattr(reduced_model, "LARGEST_REDUCED", 5)
    write_blocks(tmp_path / "model.h5")
    done = attrito_here(tmp_path, capfd, "reduce", write_job(tmp_path, blocks()))
    assert done.returncode == 2 and "expected at most 5 boundary dofs and modes" in done.stderr
    assert "reducing" not in done.stdout


def test_an_interrupt_at_one_rank_of_campbell_ends_both(tmp_path):
    command = ["mpirun", "-n", "2", sys.executable, "-m", "attrito.cli", "campbell", spinning(tmp_path, 2000)]
    started = subprocess.Popen(
        command, cwd=tmp_path, env=os.environ | ENVIRONMENT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    wait_for(lambda: len(list(tmp_path.glob("result.campbell.h5.reductions/speed_*.h5"))) > 1, started)
    ranks = Path(f"/proc/{started.pid}/task/{started.pid}/children").read_text().split()
    os.kill(int(ranks[1]), signal.SIGINT)
    started.communicate(timeout=TIMEOUT)
    assert started.returncode != 0
    wait_for(lambda: not any(Path(f"/proc/{rank}").exists() for rank in ranks))
    assert not (tmp_path / "result.campbell.h5").exists()
    assert attrito(tmp_path, "campbell", spinning(tmp_path, 2)).returncode == 0
    assert not list(tmp_path.glob("*.reductions"))


def test_a_fault_of_campbell_is_told_once_for_all_ranks(tmp_path):
    done = attrito(tmp_path, "campbell", write_job(tmp_path, wedge()), ranks=2)
    assert done.returncode == 2 and done.stderr.count("attrito: ") == 1


class Terminal(io.StringIO):
    """What says that it is one."""

    def isatty(self) -> bool:
        return True


def test_control_characters_of_names_are_shown_on_a_terminal_and_attrito_s_own_are_left(monkeypatch):
    terminal = Terminal()
    monkeypatch.setattr(sys, "stdout", terminal)
    monkeypatch.setattr(sys, "stderr", terminal)
    standard_output.escape_controls()
    error = InputError(Fault("a\x1b]0;title\x07.toml", "\x1b[2Jkey", 1, "another\r"))
    print(f"\r\x1b[K\x1b[1;31mattrito:\x1b[0m {error}\tend", file=sys.stderr)
    assert terminal.getvalue() == (
        "\r\x1b[K\x1b[1;31mattrito:\x1b[0m a\\x1b]0;title\\x07.toml: \\x1b[2Jkey = 1: expected another\\x0d\tend\n"
    )


def test_a_name_that_xml_cannot_hold_is_refused(tmp_path, capfd):
    write_blocks(tmp_path / "model.h5")
    job = blocks()
    job["sweep"] = {"frequencies_hz": [1.0]}
    assert attrito_here(tmp_path, capfd, "run", write_job(tmp_path, job)).returncode == 0
    done = attrito_here(tmp_path, capfd, "export", "result.h5", "-o", "a\x01b.vtu", "--phases", "2")
    assert done.returncode == 2, done.stderr
    assert r"export: -o = 'a\x01b.vtu': expected a name of printable characters" in done.stderr
