"""What is installed works by itself, away from the source tree."""

from __future__ import annotations

import os
import subprocess
import tomllib
from pathlib import Path

from jobs import ENVIRONMENT, TIMEOUT, wedge, write_job

ROOT = Path(__file__).resolve().parents[2]
VERSION = tomllib.loads((ROOT / "python" / "pyproject.toml").read_text())["project"]["version"]


def ended(*command: str, folder: Path, **environment: str) -> str:
    """What a command says that is expected to end well, in an environment without our own paths."""
    clean = {"PATH": "/usr/bin:/bin", "HOME": os.environ.get("HOME", "/")} | ENVIRONMENT | environment
    done = subprocess.run(command, cwd=folder, env=clean, capture_output=True, text=True, timeout=TIMEOUT, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_an_installed_attrito_needs_nothing_set(tmp_path):
    place = tmp_path / "place"
    ended("cmake", "--install", str(ROOT / "build" / "release"), "--prefix", str(place), folder=tmp_path)
    command = str(place / "bin" / "attrito")
    assert ended(command, "--version", folder=tmp_path) == f"attrito {VERSION}\n"
    ended(command, "run", write_job(tmp_path, wedge()), folder=tmp_path)
    assert len(ended(command, "table", "result.h5", folder=tmp_path).splitlines()) == 2
    ended(command, "verify", "torture", "--scenes", "1", "-o", "torture", folder=tmp_path)
    where = "import attrito.library.loading as found; print(found.load()._name)"
    library = ended("/usr/bin/python3", "-c", where, folder=tmp_path, PYTHONPATH=str(place / "lib" / "attrito"))
    assert [path.name for path in place.rglob("*bench*")] == []
    assert (place / "include" / "attrito.h").is_file()
    assert Path(library.strip()) == place / "lib" / "attrito" / "attrito" / "libattrito.so"
