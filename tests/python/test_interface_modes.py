"""Interface modes: a sector whose boundaries move in a few shapes, against the same with all dofs of its boundaries."""

from __future__ import annotations

import h5py
import meshio
import numpy as np
import pytest
from edited import edited
from jobs import attrito_here, write_job
from mpi4py import MPI
from wheels import ring, sector_job

from attrito.job.reading import read_job
from attrito.library.session import Options, Solver
from attrito.model.model_file import write_model
from attrito.scene.build import build_scene
from attrito.scene.reduced_model import make_rom, reduced_scene
from attrito.support.errors import InputError

SECTORS, MODES = 6, 12
# 16 nodes of a boundary move; the highest frequency that matters is three harmonics of the last.
SECTION, HZ = (4, 3), [1500.0, 2500.0]


def sector():
    return ring(SECTORS, 3, seed=3, section=SECTION)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("ring")
    write_model(place / "model.h5", sector(), [])
    return place


def job_of(interface, **keys):
    """A sector that rubs at its rim; its own file for each kind of boundary."""
    job = sector_job(sector(), SECTORS, interface_modes=interface)
    # Preload, so that the rim slips under a larger force
    job["contact_set"][0] |= {"gap": -1e-6, "tangential_stiffness": 1e8, "normal_stiffness": 1e8}
    job["load"][0] |= {"cosine": [[dof, 300.0 * force] for dof, force in job["load"][0]["cosine"]]}
    job["reduction"] = {"modes": MODES, "file": f"rom_{interface}.h5"}
    return job | {"balance": {"harmonics": 3}, "sweep": {"frequencies_hz": HZ}} | keys


def reduced(folder, interface, **keys):
    """The scene that is solved, and what was said."""
    write_job(folder, job_of(interface, **keys))
    job = read_job(folder / "job.toml")
    scene, said = build_scene(job), []
    rom, _ = make_rom(MPI.COMM_SELF, job, scene, say=said.append)
    return reduced_scene(job, scene, rom), rom, " ".join(said)


def frequencies(scene, count):
    """Hz of the lowest modes with all contacts stuck, `[nodal diameters, count]`."""
    with Solver(MPI.COMM_SELF, scene, Options(harmonics=1)) as solver:
        return np.array([solver.diameter_modes("stuck", n, count).natural_hz for n in range(SECTORS // 2 + 1)])


@pytest.mark.parametrize("error", [1e-2, 1e-4, 1e-7])
def test_natural_frequencies_are_from_above_and_within_the_error_that_is_asked_for(folder, error):
    (folder / "rom_auto.h5").unlink(missing_ok=True)
    exact, whole, _ = reduced(folder, "all")
    few, rom, said = reduced(folder, "auto", reduction={"modes": MODES, "file": "rom_auto.h5", "error": error})
    assert "interface modes: natural frequencies" in said
    shapes = rom.interface.shape[1]
    assert shapes <= len(exact.sector.lower) and len(few.mass) == len(whole.mass) - 2 * (
        len(exact.sector.lower) - shapes
    )
    assert rom.interface.T @ rom.interface == pytest.approx(np.eye(shapes), abs=1e-12)
    expected, found = frequencies(exact, 10), frequencies(few, 10)
    known = expected < 3.0 * HZ[-1]
    off = found[known] / expected[known] - 1.0
    assert known.sum() > 4 and off.min() > -1e-9
    assert off.max() < error + 1e-9


def test_all_shapes_of_a_boundary_leave_nothing_out(folder):
    exact, _, _ = reduced(folder, "all")
    same, rom, _ = reduced(folder, 40)
    assert rom.interface.shape == (len(exact.sector.lower), len(exact.sector.lower))
    assert frequencies(same, 20) == pytest.approx(frequencies(exact, 20), rel=1e-8)


def test_contacts_that_slip_move_and_are_drawn_alike(folder, capfd):
    """Frequencies within 1e-7, and responses some ten half widths from a resonance."""
    motion, drawn = {}, {}
    for interface in ("all", "auto"):
        job = job_of(interface)
        if interface == "auto":
            job["reduction"]["error"] = 1e-7
        (folder / f"rom_{interface}.h5").unlink(missing_ok=True)
        (folder / "result.h5").unlink(missing_ok=True)
        for arguments in (("run", write_job(folder, job)), ("export", "result.h5", "--point", "1", "--wheel")):
            done = attrito_here(folder, capfd, *arguments)
            assert done.returncode == 0, done.stderr
        with h5py.File(folder / "result.h5") as result:
            assert (result["contacts/state"][:] == 2).any(), "no contact slips: the test is void"
            motion[interface] = result["monitors/rim/harmonics"][:]
        (picture,) = folder.glob("*.vtu")
        drawn[interface] = meshio.read(picture).point_data
        picture.unlink()
    largest = np.abs(motion["all"]).max()
    assert motion["auto"] == pytest.approx(motion["all"], abs=1e-4 * largest)
    for name in ("mean", "cosine_1", "sine_1"):
        assert drawn["auto"][name] == pytest.approx(drawn["all"][name], abs=1e-4 * np.abs(drawn["all"][name]).max())


def test_a_reduced_model_is_used_again_and_made_anew_for_other_shapes(folder):
    (folder / "rom_3.h5").unlink(missing_ok=True)
    _, first, _ = reduced(folder, 3)
    _, again, said = reduced(folder, 3)
    assert "up to date" in said and np.array_equal(first.interface, again.interface)
    keys = {"reduction": {"modes": MODES, "file": "rom_3.h5"}}
    _, other, said = reduced(folder, 1, **keys)
    assert "replacing" in said and other.interface.shape[1] < first.interface.shape[1]


@pytest.mark.parametrize("damage", [lambda basis: basis[1:], lambda basis: basis * np.nan, lambda basis: basis[:, 0]])
def test_a_damaged_basis_is_a_fault_of_the_file(folder, damage):
    reduced(folder, 40)
    path = folder / "rom_40.h5"
    intact = path.read_bytes()
    with edited(path) as file:
        basis = file["interface/basis"][()]
        del file["interface/basis"]
        file["interface/basis"] = damage(basis)
    with pytest.raises(InputError, match="interface/basis = 'float64 of shape .*: expected finite numbers of shape"):
        reduced(folder, 40)
    path.write_bytes(intact)
