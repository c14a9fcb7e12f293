"""Matrices written for other programs, and read again: the same model, to the digits of the format."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
from elastic import elastic_block
from jobs import attrito_here
from scipy.linalg import eigh

from attrito.export.matrices import KINDS, export_matrices
from attrito.importers import import_model
from attrito.importers.deck import read_blocks
from attrito.model.model import Model
from attrito.model.model_file import write_model
from attrito.support.errors import InputError

# What is read of each kind, and to which part of an entry it is written: half a unit of its last digit.
FORMATS = {
    "matrix-market": (
        {
            "stiffness": "rom_stiffness.mtx",
            "mass": "rom_mass.mtx",
            "damping": "rom_damping.mtx",
            "dofs": "rom.dof",
        },
        0.0,
    ),
    "matlab": (
        {"stiffness": "rom.mat:K", "mass": "rom.mat:M", "damping": "rom.mat:C", "dofs": "rom.dof"},
        0.0,
    ),
    "dmig": ({"nastran_file": "rom.pch"}, 0.5e-9),
    "abaqus": ({"abaqus_job": "rom"}, 0.0),
}
TIP = 15

JOB = """
[model]
file = "{model}"
{reduction}
[[contact]]
normal = [[["node", {tip}, "y"], 1.0]]
tangents = [[[["node", {tip}, "z"], 1.0]]]
normal_stiffness = 1e6
tangential_stiffness = 1e6
friction_coefficient = 0.5
preload = 10.0
[[load]]
kind = "harmonic"
cosine = [[["node", {tip}, "z"], 20.0]]
[balance]
harmonics = 3
[sweep]
frequencies_hz = [400.0, 700.0, 1000.0]
[output]
file = "{result}.h5"
monitors = [{{ name = "tip", dofs = [[["node", {tip}, "z"], 1.0]] }}]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A bar held at one end, reduced onto its tip, and its response with a contact there that slips."""
    place = tmp_path_factory.mktemp("rom")
    model, points = elastic_block((4, 1, 1), (0.12, 0.02, 0.01), fixed=lambda points: points[:, 0] < 1e-9)
    count = len(points)
    model.node_ids, model.coordinates = np.arange(1, count + 1), points
    model.dof_node, model.dof_direction = np.repeat(model.node_ids, 3), np.tile([1, 2, 3], count)
    write_model(place / "model.h5", model, [])
    return place


@pytest.fixture
def rom(folder, capfd) -> Path:
    if not (folder / "rom.h5").is_file():
        reduction = "[reduction]\nmodes = 6\nfile = 'rom.h5'"
        text = JOB.format(model="model.h5", reduction=reduction, tip=TIP, result="result")
        (folder / "job.toml").write_text(text)
        done = attrito_here(folder, capfd, "run", "job.toml")
        assert done.returncode == 0, done.stderr
    return folder / "rom.h5"


def reduced(rom: Path) -> dict[str, np.ndarray]:
    with h5py.File(rom) as file:
        return {name: file[name][()] for name in ("stiffness", "mass", "damping")}


def amplitudes(path: Path) -> np.ndarray:
    with h5py.File(path) as file:
        return file["monitors/tip/amplitude"][()]


@pytest.mark.parametrize("kind", FORMATS)
def test_a_reduced_model_goes_out_and_comes_in_again(kind, rom, capfd, monkeypatch):
    folder, (files, digits) = rom.parent, FORMATS[kind]
    monkeypatch.chdir(folder)
    done = attrito_here(folder, capfd, "export", "rom.h5", "--matrices", kind)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "rom.dof: 8 rows, 6 of them generalised coordinates"
    model, _ = import_model(f"{kind}.h5", **files)
    # Rows come by node, then direction: boundary dofs, then the modes, whose numbers are beyond those of nodes.
    assert model.dof_node.tolist() == [TIP] * 2 + [1001 + k for k in range(6)]
    assert model.dof_direction.tolist() == [2, 3] + [0] * 6
    given = reduced(rom)
    for name, matrix in given.items():
        assert np.all(abs(getattr(model, name) - matrix) <= digits * np.maximum(abs(matrix), 1e-300))
    # An entry that is off by a part d moves an eigenvalue by at most d times phi' |K| phi.
    values, modes = eigh(given["stiffness"], given["mass"])
    again = eigh(model.stiffness.toarray(), model.mass.toarray(), eigvals_only=True)
    size = abs(given["stiffness"]), abs(given["mass"])
    within = [np.einsum("ij,ik,kj->j", abs(modes), part, abs(modes)) for part in size]
    assert np.all(abs(again - values) <= (2.0 * digits + 1e-13) * (within[0] + values * within[1]))


@pytest.mark.parametrize("kind", FORMATS)
def test_a_nonlinear_sweep_of_the_model_that_came_back_is_the_same(kind, rom, capfd, monkeypatch):
    folder = rom.parent
    monkeypatch.chdir(folder)
    export_matrices(rom, kind, None, None)
    import_model(f"{kind}.h5", **FORMATS[kind][0])
    (folder / "again.toml").write_text(JOB.format(model=f"{kind}.h5", reduction="", tip=TIP, result=f"again_{kind}"))
    done = attrito_here(folder, capfd, "run", "again.toml")
    assert done.returncode == 0, done.stderr
    with h5py.File(folder / "result.h5") as file:
        assert np.any(file["contacts/slip"][()] > 0.1)
    # The balance is solved to 1e-10 of the force; ten digits of the matrices cost some 1e-7.
    tolerance = 1e-8 if FORMATS[kind][1] == 0.0 else 1e-6
    assert amplitudes(folder / f"again_{kind}.h5") == pytest.approx(amplitudes(folder / "result.h5"), rel=tolerance)


def test_what_nastran_and_abaqus_read_is_in_their_words(rom, monkeypatch):
    monkeypatch.chdir(rom.parent)
    export_matrices(rom, "dmig", None, None)
    cards = Path("rom.pch").read_text().splitlines()
    assert [line for line in cards if line.startswith("SPOINT")] == [f"SPOINT  {1001 + k:8d}" for k in range(6)]
    assert [line.split()[1:5] for line in cards if line.startswith("DMIG ")] == [
        [name, "0", "6", "2"] for name in ("KAAX", "MAAX", "BAAX")
    ]
    assert max(map(len, cards)) <= 72
    export_matrices(rom, "abaqus", None, None)
    lines = Path("rom_STIF1.mtx").read_text().splitlines()
    assert lines[0] == "** GENERALISED COORDINATES: NODES 1001 TO 1006"
    assert lines[1].startswith(f"{TIP},2, {TIP},2, ") and lines[-1].startswith("1006,1, 1006,1, ")
    Path("read.inp").write_text("*MATRIX INPUT, NAME=K, INPUT=rom_STIF1.mtx\n")
    assert [block.parameters["INPUT"] for block in read_blocks("read.inp")] == ["rom_STIF1.mtx"]


def test_matlab_has_the_table_of_dofs_too(rom, monkeypatch):
    monkeypatch.chdir(rom.parent)
    export_matrices(rom, "matlab", "out/tip", None)
    read = scipy.io.loadmat("out/tip.mat")
    assert read["dofs"].tolist() == [[TIP, k] for k in (2, 3)] + [[1001 + k, 0] for k in range(6)]
    assert np.array_equal(read["K"].toarray(), reduced(rom)["stiffness"])
    table = [line.split(".") for line in Path("out/tip.dof").read_text().splitlines()]
    assert np.array_equal(np.array(table, float), read["dofs"])


@pytest.mark.parametrize("kind", FORMATS)
def test_a_full_model_goes_out_and_comes_in_again(kind, folder, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    export_matrices(folder / "model.h5", kind, "rom", None)
    files, digits = FORMATS[kind]
    model, _ = import_model("again.h5", **files)
    written, _ = elastic_block((4, 1, 1), (0.12, 0.02, 0.01), fixed=lambda points: points[:, 0] < 1e-9)
    lower = (abs(written.stiffness) > 0).multiply(abs(model.stiffness - written.stiffness))
    # One triangle is written: the other may differ by rounding of the assembly.
    assert lower.max() <= (digits + 1e-15) * abs(written.stiffness).max()


def test_a_reduced_model_that_recovers_little_has_all_of_its_matrices(rom, capfd, tmp_path, monkeypatch):
    text = (rom.parent / "job.toml").read_text().replace("modes = 6", "modes = 6\nrecovery = 'monitors'")
    (tmp_path / "job.toml").write_text(text)
    (tmp_path / "model.h5").write_bytes((rom.parent / "model.h5").read_bytes())
    done = attrito_here(tmp_path, capfd, "reduce", "job.toml")
    assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "rom.h5") as file:
        assert "recovery/dof" in file
    monkeypatch.chdir(tmp_path)
    assert export_matrices("rom.h5", "dmig", None, None)[1].startswith("rom.dof: 8 rows")


def test_dofs_without_names_are_points_from_1(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    model, _ = elastic_block((1, 1, 1), (1.0, 1.0, 1.0))
    write_model("plain.h5", Model(model.stiffness, model.mass), [])
    assert export_matrices("plain.h5", "dmig", None, None) == [
        "plain.pch",
        "plain.dof: 24 rows, 24 of them generalised coordinates",
    ]
    read, _ = import_model("again.h5", nastran_file="plain.pch")
    assert read.dof_node.tolist() == list(range(1, 25)) and not read.dof_direction.any()


def test_internal_coordinates_of_abaqus_get_numbers_that_nastran_can_have(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for part in ("STIF", "MASS"):
        Path(f"job_{part}1.mtx").write_text("2005,1, 2005,1, 2.0\n-1,2, -1,2, 3.0\n")
    import_model("model.h5", abaqus_job="job")
    export_matrices("model.h5", "dmig", None, None)
    read, _ = import_model("again.h5", nastran_file="model.pch")
    assert read.dof_node.tolist() == [2005, 3001] and read.stiffness.diagonal().tolist() == [2.0, 3.0]


def test_faults_of_an_export_name_what_was_expected(rom, tmp_path, capfd, monkeypatch):
    folder = rom.parent
    (tmp_path / "rom.h5").write_bytes(rom.read_bytes())
    faults = {
        (
            "rom.h5",
            "--matrices",
            "dmig",
        ): "model = 'not found': expected the model that it was made of: --model",
        ("none.h5", "--matrices", "dmig"): "none.h5",
        ("rom.h5", "--model", "model.h5"): "expected --matrices with it",
        (str(folder / "result.h5"), "--matrices", "dmig"): 'expected "attrito model" or "attrito rom"',
        ("rom.h5", "--matrices", "dmig", "-o", "rom.h5/k"): "expected a place to write to",
    }
    for arguments, message in faults.items():
        model = ["--model", str(folder / "model.h5")] if "rom.h5/k" in arguments else []
        done = attrito_here(tmp_path, capfd, "export", *arguments, *model)
        assert done.returncode == 2 and message in done.stderr, (arguments, done.stderr)
    small, _ = elastic_block((1, 1, 1), (1.0, 1.0, 1.0))
    write_model(tmp_path / "small.h5", small, [])
    with pytest.raises(InputError, match="dofs = 24: expected 48, those of the model that"):
        export_matrices(tmp_path / "rom.h5", "dmig", None, tmp_path / "small.h5")
    (tmp_path / "x.h5").write_bytes((folder / "model.h5").read_bytes())
    (tmp_path / "x.mat").symlink_to(tmp_path / "x.h5")
    with pytest.raises(InputError, match="a file other than .*, which is read"):
        export_matrices(tmp_path / "x.h5", "matlab", None, None)


def test_the_command_line_knows_every_kind():
    from attrito.cli.arguments import MATRICES

    assert tuple(KINDS) == MATRICES
