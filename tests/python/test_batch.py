"""The job script for Slurm, with a queue that only takes note."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
from jobs import ENVIRONMENT, TIMEOUT, chain, table, wait_for, write_job
from patient import PROGRAM

from attrito.results.journal import read_journal

SCRIPT = Path(__file__).resolve().parents[2] / "input" / "slurm.sh"


def start(folder: Path, program: str = "-m attrito.cli") -> subprocess.Popen[str]:
    """The batch job as Slurm starts it."""
    for name, text in (
        ("attrito", f'exec "{sys.executable}" {program} "$@"'),
        ("sbatch", f'echo "$@" >> "{folder}/queue"'),
    ):
        path = folder / "bin" / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(f"#!/bin/sh\n{text}\n")
        path.chmod(0o755)
    environment = os.environ | ENVIRONMENT | {"PATH": f"{folder / 'bin'}:{os.environ['PATH']}", "SLURM_NTASKS": "2"}
    shutil.copy(SCRIPT, folder)
    return subprocess.Popen(
        ["bash", "slurm.sh", "job.toml", "result.h5"],
        cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip


def test_a_batch_job_whose_time_is_up_goes_on_in_another_one(tmp_path):
    job = chain()
    job["sweep"] = {"start_hz": 84.0, "stop_hz": 83.0, "levels": np.linspace(0.5, 1.0, 15).tolist()}
    write_job(tmp_path, job)
    first = start(tmp_path, PROGRAM)
    journal = tmp_path / "result.h5.partial"
    wait_for(lambda: journal.is_file() and len(list(read_journal(str(journal)))) >= 4, first)
    first.send_signal(signal.SIGUSR1)
    said, _ = first.communicate(timeout=TIMEOUT)
    assert first.returncode == 1, said
    assert "stopped by SIGUSR1" in said
    assert (tmp_path / "queue").read_text() == "slurm.sh job.toml result.h5\n"
    (tmp_path / "queue").unlink()
    second = start(tmp_path)
    said, _ = second.communicate(timeout=TIMEOUT)
    assert second.returncode == 0, said
    assert "going on after" in said and not (tmp_path / "queue").exists() and not journal.exists()
    assert len({row["branch"] for row in table(tmp_path)}) >= 1
