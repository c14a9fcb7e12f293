"""A disk that is full while a file is written: the old file stays whole, and one message says so."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
import scipy.sparse as sparse
from full_disk import OLD, one_message, with_room_for
from jobs import ENVIRONMENT, blocks, chain, wedge, write_blocks, write_job

from attrito.results.result import Result
from attrito.support.atomic_files import whole_file, whole_hdf5


@pytest.fixture(scope="module")
def size(tmp_path_factory) -> int:
    """How large the result of the chain's run becomes; its journal is larger."""
    folder = tmp_path_factory.mktemp("whole")
    write_job(folder, rubbing())
    assert with_room_for(1 << 30, folder, "run", "job.toml").returncode in (0, 1)
    return (folder / "result.h5").stat().st_size


def rubbing() -> dict:
    job = chain()
    job["sweep"] = {"start_hz": 84.0, "stop_hz": 80.0}
    job["continuation"] = {"max_points": 12}
    return job


def test_a_result_that_does_not_fit_leaves_the_old_one_and_the_points(tmp_path, size):
    (tmp_path / "result.h5").write_bytes(OLD)
    write_job(tmp_path, rubbing())
    done = with_room_for(size - 100, tmp_path, "run", "job.toml", of="result")
    assert done.returncode == 2
    assert one_message(done).endswith("result.h5: file = 'File too large': expected room on the disk to write it")
    assert (tmp_path / "result.h5").read_bytes() == OLD
    assert list(tmp_path.glob("*.new")) == []
    # With room again the run goes on from what is there.
    done = with_room_for(1 << 30, tmp_path, "run", "--resume", "job.toml")
    assert "going on after 12 points" in done.stdout and done.returncode in (0, 1)
    with h5py.File(tmp_path / "result.h5") as file:
        assert len(file["points/frequency_hz"]) == 12


def test_a_journal_that_does_not_fit_ends_with_whole_points(tmp_path, size):
    done = with_room_for(size // 2, tmp_path, "run", write_job(tmp_path, rubbing()))
    assert done.returncode == 2
    assert "result.h5.partial: file = 'File too large'" in one_message(done)
    assert "go on with attrito run --resume job.toml" in done.stdout
    with Result(tmp_path / "result.h5.partial") as result:
        assert 1 <= len(result.outcome) < 12


@pytest.fixture(scope="module")
def inputs(tmp_path_factory) -> Path:
    """A folder with input for every command that writes a file of its own."""
    folder = tmp_path_factory.mktemp("inputs")
    write_blocks(folder / "blocks.h5")
    write_job(folder, blocks() | {"model": {"file": "blocks.h5"}}, "blocks.toml")
    scipy.io.mmwrite(folder / "K.mtx", sparse.identity(300, format="csr"))
    job = wedge(force=1.0)
    job["sweep"] = {"start_hz": 150.0, "stop_hz": 85.0}
    job["static"] = {"load_path": [0.0, 1.0]}
    job["integrate"] = {"frequency_hz": 132.0, "cycles": 3}
    job["peak"] = {"start": 10.0, "stop": 11.0, "file": "peaks.h5"}
    write_job(folder, job, "wedge.toml")
    vary = {"name": "mu", "keys": ["contact[*].friction_coefficient"], "low": 0.4, "high": 0.5}
    write_job(folder, {"job": "wedge.toml", "file": "study.h5", "samples": 2, "vary": [vary]}, "study.toml")
    return folder


# Less than each file becomes, and more than what is written on the way to it.
@pytest.mark.parametrize(
    ("arguments", "output", "size"),
    [
        (("import", "model.h5", "--stiffness", "K.mtx", "--mass", "K.mtx"), "model.h5", 10_000),
        (("reduce", "blocks.toml"), "rom.h5", 30_000),
        (("integrate", "wedge.toml"), "result.h5", 20_000),
        (("peak", "wedge.toml"), "peaks.h5", 20_000),
        (("study", "study.toml"), "study.h5", 10_000),
    ],
    ids=["import", "reduce", "integrate", "peak", "study"],
)
def test_no_command_spoils_an_old_file(inputs, tmp_path, arguments, output, size):
    shutil.copytree(inputs, tmp_path, dirs_exist_ok=True)
    (tmp_path / output).write_bytes(OLD)
    done = with_room_for(size, tmp_path, *arguments)
    assert done.returncode == 2
    assert output in one_message(done) and "room on the disk" in done.stderr
    assert (tmp_path / output).read_bytes() == OLD


def test_hdf5_never_sees_that_the_disk_is_full(tmp_path):
    code = """
import resource, signal, sys
import numpy as np
from attrito.results.result import Result
from attrito.support.atomic_files import whole_hdf5
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
try:
    with whole_hdf5("data.h5") as file:
        for i in range(50):
            file[f"group_{i}/data"] = np.full(1000, float(i))
except OSError as error:
    sys.exit(f"{error.filename}: {error.strerror}")
"""
    (tmp_path / "data.h5").write_bytes(OLD)
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (1, "data.h5: File too large\n")
    assert (tmp_path / "data.h5").read_bytes() == OLD
    assert list(tmp_path.glob("*.new")) == []


def test_a_file_appears_when_it_is_whole(tmp_path):
    path = tmp_path / "data.h5"
    with whole_hdf5(path) as file:
        file["x"] = np.arange(3.0)
        assert not path.exists()
    with whole_hdf5(path, start=str(path)) as file:
        file["y"] = file["x"][:] + 1.0
    with h5py.File(path) as file:
        assert (list(file["x"]), list(file["y"])) == ([0.0, 1.0, 2.0], [1.0, 2.0, 3.0])
    with pytest.raises(KeyError), whole_hdf5(path, start=str(path)) as file:
        del file["x"]
        del file["z"]
    with h5py.File(path) as file:
        assert sorted(file) == ["x", "y"]
    assert [found.name for found in tmp_path.iterdir()] == ["data.h5"]


def test_what_is_no_file_is_written_as_it_is():
    with whole_file("/dev/null") as new:
        Path(new).write_text("anything")
    assert Path("/dev/null").is_char_device()


def test_a_result_that_is_printed_and_finds_no_room_is_told_in_one_message(tmp_path):
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "attrito.cli", "keys"],
            cwd=tmp_path, env=os.environ | ENVIRONMENT, stdout=full, stderr=subprocess.PIPE, text=True, check=False,
        )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr == "attrito: output: file = 'No space left on device': expected room on the disk to write it\n"
