"""What a disk or a copy has changed in a file of attrito, and what a file does not hold itself, is noticed."""

from __future__ import annotations

import random
import shutil
from pathlib import Path

import h5py
import meshio
import numpy as np
import pytest
from edited import edited, without_sums
from jobs import attrito, attrito_here, blocks, table, write_blocks, write_job

from attrito.importers import read_mesh
from attrito.support import file_sums
from attrito.support.errors import InputError
from attrito.support.hdf5_reading import stored

# What reads each file.
READERS = {"model.h5": ("run", "job.toml"), "rom.h5": ("run", "job.toml"), "result.h5": ("table", "result.h5")}


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """A model, its reduced model and a result."""
    folder = tmp_path_factory.mktemp("made")
    write_blocks(folder / "model.h5")
    assert attrito(folder, "run", write_job(folder, blocks())).returncode == 0
    return folder


@pytest.fixture
def folder(made, tmp_path) -> Path:
    """A copy of them."""
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    return tmp_path


def numbers(path: Path) -> list[tuple[str, int, int]]:
    """Datasets of numbers, each with where its bytes begin in the file and how many there are."""
    found: list[tuple[str, int, int]] = []

    def look(name: str, thing: h5py.Group | h5py.Dataset) -> None:
        if not isinstance(thing, h5py.Dataset) or thing.dtype.kind not in "iuf" or thing.size == 0:
            return
        if thing.chunks is None:
            found.append((name, thing.id.get_offset(), thing.nbytes))
        else:
            chunks = [thing.id.get_chunk_info(k) for k in range(thing.id.get_num_chunks())]
            found.extend((name, chunk.byte_offset, chunk.size) for chunk in chunks)

    with h5py.File(path) as file:
        file.visititems(look)
    return found


@pytest.mark.parametrize("name", READERS)
def test_a_bit_that_flips_in_a_number_is_told(folder, capfd, name):
    good, places, chance = (folder / name).read_bytes(), numbers(folder / name), random.Random(5)
    for _ in range(8):
        dataset, start, size = chance.choice(places)
        bad, at = bytearray(good), start + chance.randrange(size)
        bad[at] ^= 1 << chance.randrange(8)
        (folder / name).write_bytes(bad)
        done = attrito_here(folder, capfd, *READERS[name])
        assert done.returncode == 2, (dataset, done.stdout)
        assert f"{name}: /{dataset} = 'changed': expected bytes as attrito wrote them" in done.stderr


@pytest.mark.parametrize("change", ["an attribute", "a dataset less"])
def test_other_changes_are_told_and_what_somebody_adds_is_not_looked_at(folder, capfd, change):
    with h5py.File(folder / "result.h5", "r+") as file:
        file["own"], file.attrs["crc32"] = [1.0, 2.0], file.attrs["crc32"]
    assert attrito_here(folder, capfd, "table", "result.h5").returncode == 0
    with h5py.File(folder / "result.h5", "r+") as file:
        if change == "an attribute":
            file["points/level"].attrs["unit"] = "m"
        else:
            del file["points/level"]
    assert "expected" in attrito_here(folder, capfd, "table", "result.h5").stderr
    with edited(folder / "result.h5"):
        pass
    assert "damaged" not in attrito_here(folder, capfd, "table", "result.h5").stderr


def test_files_without_sums_are_read_and_said_once(folder, capfd):
    before = table(folder)
    for name in READERS:
        without_sums(folder / name)
    done = attrito_here(folder, capfd, "run", "job.toml")
    assert done.returncode == 0
    for name in ("model.h5", "rom.h5"):
        assert done.stderr.count(f"warning: {name}: no sums of what it holds") == 1
    without_sums(folder / "result.h5")
    assert table(folder) == before


def test_a_large_dataset_of_a_model_is_looked_at_where_it_is_read(folder, capfd, monkeypatch):
    monkeypatch.setattr(file_sums, "LARGE", 100)
    with h5py.File(folder / "rom.h5", "r+") as file:
        file["recovery/basis"][0, 0] += 1.0
    assert attrito_here(folder, capfd, "run", "job.toml").returncode == 0
    done = attrito_here(folder, capfd, "export", "result.h5", "--point", "0")
    assert done.returncode == 2 and "rom.h5: /recovery/basis = 'changed'" in done.stderr


def link_soft(file: h5py.File, place: str, other: Path) -> None:
    file[place] = h5py.SoftLink("/stolen")


def link_external(file: h5py.File, place: str, other: Path) -> None:
    file[place] = h5py.ExternalLink(str(other), "/x")


def link_group(file: h5py.File, place: str, other: Path) -> None:
    file["points"] = h5py.ExternalLink(str(other), "/")


def link_virtual(file: h5py.File, place: str, other: Path) -> None:
    layout = h5py.VirtualLayout(shape=(3,), dtype="f8")
    layout[:] = h5py.VirtualSource(str(other), "x", shape=(3,))
    file.create_virtual_dataset(place, layout)


def link_to_bytes(file: h5py.File, place: str, other: Path) -> None:
    file.create_dataset(place, (3,), "f8", external=[(str(other), 0, 24)])


def link_round(file: h5py.File, place: str, other: Path) -> None:
    file[place] = h5py.SoftLink(f"/{place}")


LINKS = [link_soft, link_external, link_group, link_virtual, link_to_bytes, link_round]


@pytest.mark.parametrize("link", LINKS)
@pytest.mark.parametrize("name", READERS)
def test_links_to_what_lies_elsewhere_are_refused_in_one_message(folder, capfd, name, link):
    with h5py.File(folder / "other.h5", "w") as file:
        file["x"] = np.ones(3)
    with h5py.File(folder / name, "r+") as file:
        if link is link_group and "points" in file:
            del file["points"]
        link(file, "extra/x", folder / "other.h5")
    done = attrito_here(folder, capfd, *READERS[name])
    assert done.returncode == 2, done.stdout
    assert done.stderr.count("attrito: ") == 1 and len(done.stderr.splitlines()) == 1
    assert f"{name}: " in done.stderr and ("link" in done.stderr or "data in other places" in done.stderr)


def test_links_in_a_mesh_of_salome_are_refused(tmp_path):
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    meshio.Mesh(corners, [("tetra", np.array([[0, 1, 2, 3]]))]).write(tmp_path / "mesh.med")
    assert len(read_mesh(tmp_path / "mesh.med").node_ids) == 4
    with h5py.File(tmp_path / "mesh.med", "r+") as file:
        file["ENS_MAA/theirs"] = h5py.ExternalLink("other.med", "/")
    with pytest.raises(InputError, match="ENS_MAA/theirs = 'an external link': expected the data in the file itself"):
        read_mesh(tmp_path / "mesh.med")


def test_hard_links_are_what_the_file_itself_holds(tmp_path):
    with h5py.File(tmp_path / "x.h5", "w") as file:
        file["a/x"] = np.ones(3)
        file["a/again"], file["a/up"] = file["a/x"], file["a"]
    with stored(tmp_path / "x.h5", "a file") as file:
        assert np.array_equal(file["a/up/again"][:], np.ones(3))
