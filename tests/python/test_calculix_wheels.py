"""CalculiX's test decks of cyclic symmetry, `segment` and `fullseg`, of Debian's package of them."""

from __future__ import annotations

import gzip
import subprocess

import numpy as np
import pytest
from calculix_printed import calculix_frequencies
from jobs import attrito, table, write_job
from scipy.sparse import csc_matrix, csr_matrix
from scipy.sparse.linalg import eigsh

from attrito.job.reading import read_job
from attrito.library.reduced_scene import Sector
from attrito.model.model_file import read_model
from attrito.scene.build import build_scene

SECTORS, PACKAGE = 12, "calculix-ccx-test"
# Seven digits are printed: the last one is worth up to 1e-6 of the number.
PRINTED = 1e-6

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def package(tmp_path_factory):
    """A folder with the decks and their printed results."""
    folder = tmp_path_factory.mktemp("calculix")
    got = subprocess.run(["apt-get", "download", "-q", PACKAGE], cwd=folder, check=False, capture_output=True)
    if got.returncode != 0:
        pytest.skip(f"Debian's {PACKAGE} cannot be fetched")
    (archive,) = folder.glob("*.deb")
    subprocess.run(["dpkg-deb", "-x", archive, folder], check=True)
    return folder / f"usr/share/doc/{PACKAGE}/examples/test"


def imported(package, folder, deck, **cyclic):
    """The name of a job on a deck's sector, and CalculiX's frequencies by nodal diameter, each of them once.

    A contact far apart from the ground, whose springs hold the free wheel where contacts count as closed.
    """
    mesh = gzip.decompress((package / f"{deck}.inp.gz").read_bytes()).decode().partition("*SURFACE,NAME=left")[0]
    (folder / "mesh.inp").write_text(mesh)
    (folder / "job.inp").write_text(f"{mesh}*STEP\n*FREQUENCY, SOLVER=MATRIXSTORAGE\n1\n*END STEP\n")
    subprocess.run(["ccx", "job"], cwd=folder, check=True, capture_output=True)
    done = attrito(folder, "import", "model.h5", "--calculix", "job", "--mesh", "mesh.inp")
    assert done.returncode == 0, done.stderr
    model = read_model(str(folder / "model.h5"))
    y, z = model.coordinates[:, 1:].T
    row = np.argmax(np.hypot(y, z) * ~np.isin(model.node_ids, np.concatenate([*map(model.node_sets.get, ENDS)])))
    node, (y, z) = int(model.node_ids[row]), model.coordinates[row, 1:] / np.hypot(y[row], z[row])
    outward, around = ([[["node", node, "y"], float(a)], [["node", node, "z"], float(b)]] for a, b in ((y, z), (-z, y)))
    law = {"normal_stiffness": 1e-7, "tangential_stiffness": 1e3, "friction_coefficient": 0.3}
    # Along -x the next sector lies beyond the right side.
    axis = {"axis_point": [0.0, 0.0, 0.0], "axis_direction": [-1.0, 0.0, 0.0]}
    job = {
        "model": {"file": "model.h5"},
        "cyclic": {"sectors": SECTORS, "engine_order": 0, "lower": ENDS[0], "upper": ENDS[1], **axis, **cyclic},
        "reduction": {"modes": 200},
        "contact": [{"normal": outward, "tangents": [[[["node", node, "x"], 1.0]], around], **law}],
        "output": {"file": "result.h5", "monitors": []},
    }
    printed = package / f"{deck}.dat.ref"
    text = printed.read_bytes() if printed.exists() else gzip.decompress((package / f"{deck}.dat.ref.gz").read_bytes())
    (folder / "deck.dat").write_bytes(text)
    return write_job(folder, job), calculix_frequencies(folder / "deck.dat")


ENDS = "Nright", "Nleft"


def frequencies(scene, number, count, sector=None):
    """The lowest in Hz of the sparse sector, without contacts."""
    own, model = scene.sector, scene.model
    if sector is None:
        sector = Sector(SECTORS, 0, own.lower, own.upper, np.zeros((0, model.size)), None, own.along, own.across)
    shape = csr_matrix(own.axes @ sector.expansion(model.size, number))
    stiffness, mass = (csc_matrix(shape.conj().T @ matrix @ shape) for matrix in (model.stiffness, model.mass))
    # Rigid motions are in it: the shift is small beside elastic frequencies' 1e9 and large beside rounding.
    values = eigsh(stiffness, count, mass, sigma=-1e6, return_eigenvectors=False)
    return np.sqrt(np.abs(np.sort(values.real))) / (2.0 * np.pi)


def check_listed(folder, job, scene, diameters, rigid):
    """`attrito linear-modes` of the reduced sector: from above, and what 200 modes inside leave out."""
    done = attrito(folder, "linear-modes", job, "--state", "frictionless", "--count", "5")
    assert done.returncode == 0, done.stderr
    rows = table(folder, result="result.frictionless.modes.h5")
    for number in diameters:
        own = [row for row in rows if row["nodal_diameter"] == str(number)]
        assert [row["kind"] for row in own] == ["rigid"] * rigid[number] + ["elastic"] * (5 - rigid[number])
        found = np.array([float(row["frequency_hz"]) for row in own])[rigid[number] :]
        error = found / frequencies(scene, number, 5)[rigid[number] :] - 1.0
        # Rounding of the reduction, some 1e-14 of stiffness, beside frequencies 1e3 times lower than the highest
        assert error.min() > -1e-7 and error.max() < 2e-4


def test_a_free_ring_has_the_frequencies_that_calculix_prints(package, tmp_path):
    """The deck `segment`: one nodal diameter; the first two modes are rigid motions, whose frequencies are rounding."""
    job, expected = imported(package, tmp_path, "segment")
    scene = build_scene(read_job(tmp_path / job, excited=False))
    once = np.array(expected[1][4::2])
    assert len(once) == 3
    assert frequencies(scene, 1, 5)[2:] == pytest.approx(once, rel=PRINTED)
    check_listed(tmp_path, job, scene, [1], {1: 2})


def test_a_disc_with_its_axis_has_the_frequencies_that_calculix_prints(package, tmp_path):
    """The deck `fullseg`, whose ends differ by 1 % of the radius: it pairs the nearest nodes.

    So only rigid motions that move both ends alike cost nothing: rotation about the axis and tilting are elastic modes.
    """
    job, expected = imported(package, tmp_path, "fullseg", tolerance=0.02)
    scene = build_scene(read_job(tmp_path / job, excited=False))
    notes = " ".join(scene.contacts.notes)
    assert "nodes at most 0.0111 from their partners' images, 5 along the axis and 10 across it" in notes
    for number, rigid in ((0, 1), (2, 0)):
        once = np.array(expected[number][2 * rigid :: 2])
        assert len(once) >= 4
        assert frequencies(scene, number, 6)[rigid : rigid + len(once)] == pytest.approx(once, rel=PRINTED)
    once = np.array(expected[1][2::2])
    # At nodal diameter 1 CalculiX holds nodes on the axis along it, and lets each direction across it move by itself,
    # also against the wave's sense, which tears the axis of the wheel.
    own = scene.sector
    torn = Sector(SECTORS, 0, own.lower, own.upper, np.zeros((0, scene.model.size)), along=own.along)
    assert frequencies(scene, 1, 5, torn)[1:] == pytest.approx(once, rel=PRINTED)
    # What is left free lowers frequencies.
    lowered = frequencies(scene, 1, 5)[1:] / once - 1.0
    assert np.all(lowered > -PRINTED) and 1e-5 < lowered.max() < 1e-3
    assert frequencies(scene, 1, 3)[1:] == pytest.approx(of_whole_disc(scene, 1, 3), rel=1e-7)
    check_listed(tmp_path, job, scene, [0, 1, 2], {0: 1, 1: 1, 2: 0})


def of_whole_disc(scene, number, count):
    """Of all twelve sectors assembled, those nearest to a sector's elastic ones; nodes on the axis once, in space."""
    model, own = scene.model, scene.sector
    sector = Sector(SECTORS, 0, own.lower, own.upper, np.zeros((0, model.size)), None, own.along, own.across)
    coordinates = sector.own(model.size)
    last = SECTORS * len(coordinates)
    place = np.full(model.size, -1)
    whole = [csr_matrix((last + 3 * len(own.along),) * 2) for _ in range(2)]
    for j in range(SECTORS):
        place[coordinates] = j * len(coordinates) + np.arange(len(coordinates))
        place[own.upper] = (j + 1) % SECTORS * len(coordinates) + np.searchsorted(coordinates, own.lower)
        tied = np.flatnonzero(place >= 0)
        rows, columns, values = [tied], [place[tied]], [np.ones(len(tied))]
        angle = 2.0 * np.pi * j / SECTORS
        turn = np.array([[np.cos(angle), np.sin(angle), 0.0], [-np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
        for i, node in enumerate(np.column_stack([own.across, own.along])):
            rows.append(np.repeat(node, 3))
            columns.append(np.tile(last + 3 * i + np.arange(3), 3))
            values.append(turn.ravel())
        entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
        seen = own.axes @ csr_matrix(entries, shape=(model.size, whole[0].shape[0]))
        for i, matrix in enumerate((model.stiffness, model.mass)):
            whole[i] = whole[i] + seen.T @ matrix @ seen
    # Shifted close to each frequency of the sector, which must be one of the wheel's, twice.
    found = []
    for frequency in frequencies(scene, number, count)[1:]:
        shift = (2.0 * np.pi * frequency) ** 2 * (1.0 + 1e-5)
        values = eigsh(csc_matrix(whole[0]), 2, csc_matrix(whole[1]), sigma=shift, return_eigenvectors=False)
        found.append(np.sqrt(np.abs(values).max()) / (2.0 * np.pi))
    return np.array(found)
