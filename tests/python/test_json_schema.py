"""The job's schema for editors: Taplo takes the jobs of input/ and refuses faults of key, type and range."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from jobs import TIMEOUT

from attrito.job.json_schema import as_json_schema

ROOT = Path(__file__).resolve().parents[2]
TAPLO = Path(sys.executable).parent / "taplo"
SCHEMA = "#:schema job.schema.json"

# What a line of input/wedge.toml is replaced by: misspelt keys and tables, wrong types, values out of range
FAULTS = [
    ("harmonics = 5", "harmonic = 5"),
    ("harmonics = 5", "harmonics = 5.5"),
    ("harmonics = 5", "harmonics = 0"),
    ("harmonics = 5", 'harmonics = "many"'),
    ("harmonics = 5", "tolerance = 0.0"),
    ("harmonics = 5", 'tolerance = "0.01"'),
    ("harmonics = 5", 'approach = "couple"'),
    ("[balance]", "[balanse]"),
    ("start_hz = 140.0", 'start_hz = "140"'),
    ("start_hz = 140.0", "start_hz = -1.0"),
    ("start_hz = 140.0", "begin_hz = 140.0"),
    ("friction_coefficient = 0.5", "friction_coefficient = -0.5"),
    ("friction_coefficient = 0.5", ""),
    ("tangential_stiffness = 3.0e5", "tangential_stiffness = 0.0"),
    ("normal_stiffness = 3.0e5", "normal_stiffness = [3.0e5]"),
    ("normal = [[0, 0.7071067811865476], [1, 0.7071067811865476]]", "normal = [[0], [1]]"),
    ("dofs = [[1, 420.0]]", 'dofs = [[1, "420"]]'),
    ('kind = "static"', 'kind = "statik"'),
    ('units = "m, kg, s"', "units = 3"),
    ('file = "../out/wedge/wedge.h5"', ""),
]


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "job.schema.json").write_text(as_json_schema())
    return tmp_path


def accepts(path: Path) -> bool:
    """Does Taplo take a file by the schema that its first line names?"""
    done = subprocess.run([TAPLO, "check", path], cwd=path.parent, capture_output=True, text=True, timeout=TIMEOUT)
    return done.returncode == 0


def test_jobs_of_the_project_pass(folder):
    jobs = [path for path in sorted((ROOT / "input").glob("*.toml")) if path.read_text().startswith("#:schema ")]
    assert len(jobs) > 10
    for path in jobs:
        shutil.copy(path, folder)
        text = path.read_text()
        assert text.startswith("#:schema ../docs/reference/job.schema.json\n")
        (folder / path.name).write_text(SCHEMA + text[text.index("\n") :])
        assert accepts(folder / path.name), path.name


@pytest.mark.parametrize(("line", "fault"), FAULTS, ids=[fault or f"without {line}" for line, fault in FAULTS])
def test_a_fault_of_key_type_or_range_is_refused(folder, line, fault):
    text = (ROOT / "input" / "wedge.toml").read_text()
    assert line in text
    (folder / "bad.toml").write_text(SCHEMA + text[text.index("\n") :].replace(line, fault, 1))
    assert not accepts(folder / "bad.toml")


@pytest.mark.parametrize("monitors", ["", "monitors = []"])
def test_a_job_of_a_mode_needs_no_monitors(folder, monitors):
    text = (ROOT / "input" / "wedge.toml").read_text()
    mode = f"[mode]\nstart = 1e-6\nstop = 1e-3\n\n[output]\nfile = 'm.h5'\n{monitors}\n"
    (folder / "mode.toml").write_text(SCHEMA + text[text.index("\n") : text.index("[sweep]")] + mode)
    assert accepts(folder / "mode.toml")
