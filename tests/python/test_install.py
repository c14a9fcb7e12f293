"""What is installed works by itself, away from the source tree."""

from __future__ import annotations

import fcntl
import gzip
import os
import re
import subprocess
import tomllib
from pathlib import Path

import pytest
from jobs import ENVIRONMENT, TIMEOUT, wedge, write_job

from attrito.library.loading import places

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "python" / "pyproject.toml").read_text())["project"]
VERSION = PROJECT["version"]


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


@pytest.fixture(scope="module")
def package(tmp_path_factory) -> Path:
    """The package of Debian, unpacked; `attrito.deb` beside it."""
    folder = tmp_path_factory.mktemp("package")
    build = ROOT / "build" / "release"
    # What the package has beside the source tree is made in the build folder, which all workers share.
    with (build / "package.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        ended("cpack", "-G", "DEB", "--config", str(build / "CPackConfig.cmake"), "-B", str(folder), folder=folder)
    (made,) = folder.glob("attrito_*.deb")
    made.rename(folder / "attrito.deb")
    ended("dpkg-deb", "--extract", str(folder / "attrito.deb"), str(folder / "unpacked"), folder=folder)
    return folder / "unpacked"


def test_a_package_of_debian_has_the_library_where_python_looks_and_runs_a_job(package, tmp_path, monkeypatch):
    """Dependencies and behaviour on a bare Debian 12 are tried by `script/package --try`."""
    monkeypatch.delenv("ATTRITO_LIBRARY", raising=False)
    library = package / places()[-1].relative_to("/")
    assert library.name == f"libattrito.so.{VERSION}"
    # Debian's linker needs no search path, and a policy refuses one.
    assert not re.search("RPATH|RUNPATH", ended("readelf", "--dynamic", str(library), folder=tmp_path))
    where = {"PYTHONPATH": str(package / "usr/lib/python3/dist-packages"), "ATTRITO_LIBRARY": str(library)}
    command = str(package / "usr/bin/attrito")
    assert ended(command, "--version", folder=tmp_path, **where) == f"attrito {VERSION}\n"
    ended(command, "run", str(package / "usr/share/doc/attrito/examples/input/wedge.toml"), "--set",
          f"output.file={tmp_path / 'wedge.h5'}", folder=tmp_path, **where)  # fmt: skip
    assert (tmp_path / "wedge.h5").is_file()
    page = gzip.decompress((package / "usr/share/man/man1/attrito.1.gz").read_bytes()).decode()
    assert "attrito \\- the steady" in page and "OPTIONS 'attrito linear-modes'" in page and "UNSET" not in page


def test_a_package_of_debian_names_the_libraries_and_the_python_packages_that_it_needs(package):
    field = ended("dpkg-deb", "--field", str(package.parent / "attrito.deb"), "Depends", folder=package)
    names = {entry.split()[0] for entry in field.split(",")}
    linked = ["petsc-real", "slepc-real", "mumps-ptscotch", "hdf5-openmpi-fortran", "fftw3", "openmpi", "openblas"]
    assert [start for start in linked if not any(name.startswith(f"lib{start}") for name in names)] == []
    wanted = {re.split("[>=<]", entry)[0].strip() for entry in PROJECT["dependencies"]}
    assert {f"python3-{name}".replace("h5py", "h5py-mpi") for name in wanted} <= names
    # Versions, too, but for Debian's epochs.
    for entry in PROJECT["dependencies"]:
        name, least = entry.split(">=")
        assert re.search(rf"python3-{name}\S* \(>= (\d+:)?{re.escape(least)}\)", field), entry
