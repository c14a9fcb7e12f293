"""No command writes over what it reads, under whatever name."""

from __future__ import annotations

import os
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
import scipy.sparse as sparse
import synthetic
from edited import edited
from jobs import attrito_here, toml, wedge, write_job

from attrito.model.model_file import write_model
from attrito.support.locks import Lock


@pytest.fixture
def folder(tmp_path) -> Path:
    """A job, a study of it, matrices, a model with a mesh and a result of it."""
    job = wedge()
    job["sweep"] = {"start_hz": 140.0, "stop_hz": 100.0}
    job["peak"] = {"start": 1.0}
    write_job(tmp_path, job)
    vary = {"name": "mu", "keys": ["contact[0].friction_coefficient"], "low": 0.4, "high": 0.5}
    (tmp_path / "study.toml").write_text(toml({"job": "job.toml", "file": "job.toml", "samples": 2, "vary": [vary]}))
    scipy.io.mmwrite(tmp_path / "K.mtx", sparse.identity(2, format="csr"))
    model = synthetic.joint("C3D8", (2, 1, 1), seed=4)
    model.stiffness = model.mass = sparse.identity(model.size, format="csr")
    write_model(tmp_path / "model.h5", model, [])
    motion = np.zeros((1, model.size, 3))
    synthetic.write_result(tmp_path / "result.h5", [100.0], {"tip": [1.0]}, coordinates=motion)
    with edited(tmp_path / "result.h5") as file:
        file.attrs["model_file"] = str(tmp_path / "model.h5")
    os.symlink("result.h5", tmp_path / "link.h5")
    os.symlink("result.h5", tmp_path / "link.html")
    return tmp_path


@pytest.mark.parametrize(
    ("arguments", "spared"),
    [
        (("import", "K.mtx", "--stiffness", "K.mtx", "--mass", "K.mtx"), "K.mtx"),
        (("study", "study.toml"), "job.toml"),
        (("chart", "job.toml", "-o", "job.toml"), "job.toml"),
        (("report", "result.h5", "-o", "link.html"), "result.h5"),
        (("report", "link.h5", "-o", "./link.html"), "result.h5"),
        (("export", "result.h5", "--format", "xdmf", "-o", "result.xdmf"), "result.h5"),
        (("export", "result.h5", "--format", "xdmf", "-o", "model.xdmf"), "model.h5"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_what_is_read_is_not_written_over(folder, capfd, arguments, spared):
    before = (folder / spared).read_bytes()
    done = attrito_here(folder, capfd, *arguments)
    assert done.returncode == 2, done.stderr
    assert "expected a file other than" in done.stderr and "which is read" in done.stderr
    assert (folder / spared).read_bytes() == before


def test_an_output_that_is_a_link_stays_one_and_keeps_its_mode(folder, tmp_path, capfd):
    other = tmp_path / "elsewhere"
    other.mkdir()
    (other / "old.h5").write_bytes(b"old")
    (other / "old.h5").chmod(0o640)
    (folder / "result.h5").unlink()
    (folder / "result.h5").symlink_to(other / "old.h5")
    assert attrito_here(folder, capfd, "run", "job.toml").returncode == 0
    (folder / "table.csv").symlink_to(other / "new.csv")
    assert attrito_here(folder, capfd, "table", "result.h5", "-o", "table.csv").returncode == 0
    assert os.path.islink(folder / "result.h5") and os.path.islink(folder / "table.csv")
    assert os.stat(other / "old.h5").st_mode & 0o777 == 0o640
    with h5py.File(other / "old.h5") as file:
        assert len(file["points/frequency_hz"])
    assert (other / "new.csv").read_text().startswith("point,")
    assert sorted(path.name for path in other.iterdir()) == ["new.csv", "old.h5"]


def test_two_processes_that_write_one_file_by_two_names_are_told_apart(tmp_path):
    (tmp_path / "link.h5").symlink_to("result.h5")
    lock = Lock(tmp_path / "result.h5")
    assert lock.take() and Lock(tmp_path / "link.h5").is_held()
    lock.release()


@pytest.mark.parametrize("name", ["/", ".", "..", "a/.."])
def test_an_output_without_a_name_is_refused_in_one_message(folder, capfd, name):
    before = sorted(folder.iterdir())
    for arguments in (
        ("export", "result.h5"), ("export", "model.h5", "--matrices", "dmig"), ("chart", "job.toml"),
        ("plot", "result.h5"), ("report", "result.h5"), ("table", "result.h5"), ("stress", "result.h5"),
    ):  # fmt: skip
        done = attrito_here(folder, capfd, *arguments, "-o", name)
        assert done.returncode == 2
        assert done.stderr == f"attrito: {arguments[0]}: output = {name!r}: expected the name of a file\n"
    for command in ("run", "linear-modes", "mode", "peak", "campbell", "integrate"):
        done = attrito_here(folder, capfd, command, "job.toml", "--set", f'output.file="{name}"')
        assert done.returncode == 2 and f"[output] file = {name!r}: expected the name of a file" in done.stderr
    study = (folder / "study.toml").read_text()
    (folder / "study.toml").write_text(study.replace('file = "job.toml"', f'file = "{name}"'))
    done = attrito_here(folder, capfd, "study", "study.toml")
    assert (
        done.returncode == 2 and "study.toml: file = " in done.stderr and "expected a file, not a folder" in done.stderr
    )
    assert sorted(folder.iterdir()) == before
