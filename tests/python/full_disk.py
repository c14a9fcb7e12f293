"""Commands where no file may grow beyond a size: the system's answer is that of a disk that is full."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from jobs import ENVIRONMENT, TIMEOUT

OLD = b"the result of yesterday"


# MPI makes files of its own while it starts; only then is there no room, or when the result is begun.
COMMAND = """
import resource, signal, sys
from mpi4py import MPI
from attrito.runs import run as running
from attrito.cli import main

def fill_disk():
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]),) * 2)

def begin(*arguments):
    fill_disk()
    return write(*arguments)

if sys.argv[2] == "result":
    write, running.whole_hdf5 = running.whole_hdf5, begin
else:
    fill_disk()
sys.exit(main(sys.argv[3:]))
"""


def with_room_for(
    size: int, folder: Path, *arguments: str, of: str = "anything", ranks: int = 1
) -> subprocess.CompletedProcess[str]:
    """Run the command; `of`: what finds no room, anything or the result alone."""
    command = [sys.executable, "-c", COMMAND, str(size), of, *arguments]
    command = command if ranks == 1 else ["mpirun", "-n", str(ranks), *command]
    return subprocess.run(
        command, cwd=folder, env=os.environ | ENVIRONMENT, capture_output=True, text=True, timeout=TIMEOUT, check=False
    )


def one_message(done: subprocess.CompletedProcess[str]) -> str:
    """What is told, if it is one line; mpirun's own lines and warnings do not count."""
    lines = [line for line in done.stderr.splitlines() if line.strip() and not line.startswith("warning: ")]
    ours = [line for line in lines if line.startswith("attrito: ")]
    assert len(ours) == 1 and (lines == ours or "mpirun" in done.stderr), done.stderr
    return ours[0]
