"""The Craig-Bampton reduction against dense algebra."""

from __future__ import annotations

import json
import subprocess
import sys

import h5py
import numpy as np
import pytest
from edited import edited
from elastic import elastic_block, rigid_motions
from jobs import TIMEOUT, clean_environment
from mpi4py import MPI
from reduced import COUNTS, SIZE, Case, make_case, unit, worst
from scipy.linalg import eigh
from scipy.sparse import csr_matrix, diags

from attrito.library.reduction import Options, reduce_model
from attrito.model.model import Model
from attrito.model.model_file import write_model
from attrito.support.errors import InputError


def test_constraint_modes_agree_with_a_dense_solve(free):
    _, rom = free.reduce(modes=0)
    inside, across = np.ix_(free.interior, free.interior), np.ix_(free.interior, free.boundary)
    expected = -np.linalg.solve(free.stiffness[inside], free.stiffness[across])
    basis = rom["recovery/basis"][:].T
    assert worst(basis[free.interior], expected) < 1e-11
    assert np.array_equal(basis[free.boundary], np.eye(len(free.boundary)))


def test_rigid_motions_pass_through_the_constraint_modes(free):
    _, rom = free.reduce(modes=0)
    motions = rigid_motions(free.points)
    assert worst(rom["recovery/basis"][:].T @ motions[free.boundary], motions) < 1e-10


def test_fixed_interface_frequencies_agree_with_a_dense_eigensolver(free):
    report, rom = free.reduce(modes=15)
    assert worst(rom["modes/frequency_hz"][:] / free.clamped_frequencies[:15], 1.0) < 1e-10
    assert rom["modes/residual"][:].max() == report.mode_residual < 1e-10


def test_reduced_matrices_are_projections_and_exactly_symmetric(free):
    report, rom = free.reduce(vectors=unit(free, 100, 50), modes=6)
    basis = rom["recovery/basis"][:].T
    assert report.coordinates == basis.shape[1] == len(free.boundary) + 6 + 2
    for name in ("mass", "stiffness", "damping"):
        expected = basis.T @ getattr(free, name) @ basis
        assert worst(rom[name][:], expected) < 1e-13
        assert np.array_equal(rom[name][:], rom[name][:].T)
    assert worst(rom["vectors/reduced"][:], rom["vectors/full"][:] @ basis) < 1e-13
    assert np.array_equal(rom["vectors/full"][:], unit(free, 100, 50))


@pytest.mark.parametrize("dofs", [[], [7], [160, 3, 90, 91]])
def test_the_basis_holds_the_dofs_whose_motion_is_asked_for(free, dofs):
    _, whole = free.reduce(modes=3)
    _, part = free.reduce(modes=3, recovered=dofs)
    assert part["recovery/dof"][:].tolist() == sorted(dofs)
    assert np.array_equal(part["recovery/basis"][:], whole["recovery/basis"][:][:, sorted(dofs)])
    assert np.array_equal(part["stiffness"][:], whole["stiffness"][:])


def test_modes_and_corrections_are_orthonormal_in_mass(free):
    _, rom = free.reduce(vectors=unit(free, 100, 50), modes=6)
    inside = rom["coordinates/kind"][:] > 0
    assert np.abs(rom["mass"][:][np.ix_(inside, inside)] - np.eye(8)).max() < 1e-11


def static_response(case: Case, rom: h5py.File) -> tuple[float, float]:
    """Response of the second vector to the first: reduced, and full."""
    load, monitor = rom["vectors/reduced"][:]
    full_load, full_monitor = rom["vectors/full"][:]
    reduced = monitor @ np.linalg.solve(rom["stiffness"][:], load)
    return reduced, full_monitor @ np.linalg.solve(case.stiffness, full_load)


def test_static_response_to_a_load_inside_is_exact_at_a_monitor_inside(held):
    _, rom = held.reduce(vectors=unit(held, 100, 50), modes=3)
    reduced, full = static_response(held, rom)
    assert reduced == pytest.approx(full, rel=1e-10)


def test_static_response_is_wrong_without_the_corrections(held):
    vectors = unit(held, 100, 50)
    _, rom = held.reduce(modes=3)
    basis = rom["recovery/basis"][:].T
    reduced = (vectors[1] @ basis) @ np.linalg.solve(rom["stiffness"][:], vectors[0] @ basis)
    assert abs(reduced / (vectors[1] @ np.linalg.solve(held.stiffness, vectors[0])) - 1.0) > 1e-3


def test_a_correction_that_adds_nothing_is_dropped(held):
    twice = np.concatenate([unit(held, 100, 50), 3.0 * unit(held, 100), unit(held, held.boundary[4])])
    report, rom = held.reduce(vectors=twice, modes=3)
    assert report.corrections == 2
    assert rom["vectors/reduced"].shape == (4, len(held.boundary) + 5)
    assert list(rom["coordinates/kind"][-6:]) == [0, 1, 1, 1, 2, 2]


def test_dofs_without_mass_follow_at_rest(tmp_path):
    model, points = elastic_block(COUNTS, SIZE)
    massless = np.flatnonzero(np.repeat(points[:, 1] > SIZE[1] - 1e-9, 3))
    keep = np.ones(model.size)
    keep[massless] = 0.0
    model.mass = diags(keep) @ model.mass @ diags(keep)
    case = make_case(tmp_path, model, points)
    _, rom = case.reduce(modes=10)
    shapes = rom["recovery/basis"][len(case.boundary) :]
    forces = shapes @ case.stiffness
    follow = np.setdiff1d(massless, case.boundary)
    assert np.abs(forces[:, follow]).max() < 1e-9 * np.abs(forces[:, case.boundary]).max()
    heavy = ~np.isin(case.interior, massless)
    flexibility = np.linalg.inv(case.stiffness[np.ix_(case.interior, case.interior)])[heavy][:, heavy]
    mass = case.mass[np.ix_(case.interior, case.interior)][heavy][:, heavy]
    expected = eigh(np.linalg.inv(flexibility), mass, eigvals_only=True)[:10]
    assert worst((2 * np.pi * rom["modes/frequency_hz"][:]) ** 2 / expected, 1.0) < 1e-9


def test_a_mass_of_one_point_an_element_has_the_modes_that_it_sees(tmp_path):
    """As that of a C3D8R: eight elements give 54 dofs a mass of rank 24, and a search for nine modes finds more."""
    model, points = elastic_block((2, 2, 2), SIZE)
    centres = np.array(np.meshgrid(*[[0.25, 0.75]] * 3)).reshape(3, -1).T * SIZE
    at_points = (np.abs(points - centres[:, None]) < 0.25 * np.array(SIZE) + 1e-9).all(axis=2) / 8.0
    assert np.all(at_points.sum(axis=1) == 1.0), "eight corners each"
    one = at_points.T @ at_points
    free = np.flatnonzero(np.repeat(points[:, 0] > 1e-9, 3))
    model.mass = csr_matrix(np.kron(one, np.eye(3))[free][:, free])
    model.stiffness, model.damping = (matrix.tocsr()[free][:, free] for matrix in (model.stiffness, model.damping))
    case = make_case(tmp_path, Model(model.stiffness, model.mass, model.damping), points)
    boundary = np.array([51, 52, 53])
    _, rom = case.reduce(boundary=boundary, modes=3)
    inside = np.delete(np.arange(len(free)), boundary)
    flexibility = np.linalg.inv(case.stiffness[np.ix_(inside, inside)])
    squares = 1.0 / eigh(case.mass[np.ix_(inside, inside)], np.linalg.inv(flexibility), eigvals_only=True)[::-1][:3]
    assert worst((2 * np.pi * rom["modes/frequency_hz"][:]) ** 2 / squares, 1.0) < 1e-9


def test_the_count_by_inertia_agrees_with_a_dense_eigensolver(free):
    report, _ = free.reduce(modes=9)
    assert report.modes_below_shift == np.sum(free.clamped_frequencies < report.shift_hz)
    assert report.modes_below_shift >= 9
    assert report.negative_pivots == 0


def test_all_modes_up_to_a_frequency_are_kept(free):
    frequencies = free.clamped_frequencies
    report, rom = free.reduce(max_frequency_hz=0.5 * (frequencies[11] + frequencies[12]))
    assert report.modes == 12
    assert worst(rom["modes/frequency_hz"][:], frequencies[:12]) < 1e-10


def test_a_frequency_below_the_first_mode_keeps_none(free):
    assert free.reduce(max_frequency_hz=1.0)[0].modes == 0


def test_all_modes_reproduce_the_whole_spectrum(free):
    report, rom = free.reduce(modes=len(free.interior))
    assert report.coordinates == len(free.mass)
    reduced = eigh(rom["stiffness"][:], rom["mass"][:], eigvals_only=True)
    assert worst(reduced[6:] / eigh(free.stiffness, free.mass, eigvals_only=True)[6:], 1.0) < 1e-7


def test_lowest_frequencies_come_down_to_the_full_ones_with_more_modes(held):
    full = np.sqrt(eigh(held.stiffness, held.mass, eigvals_only=True)[:5])
    errors = []
    for modes in (2, 8, 30):
        _, rom = held.reduce(modes=modes)
        reduced = np.sqrt(eigh(rom["stiffness"][:], rom["mass"][:], eigvals_only=True)[:5])
        assert np.all(reduced > full * (1 - 1e-9))
        errors.append(worst(reduced / full, 1.0))
    assert errors[0] > 5 * errors[1] > 25 * errors[2]


def test_a_model_without_boundary_is_reduced_to_its_modes(held):
    report, rom = held.reduce(boundary=[], vectors=unit(held, 100), modes=7)
    assert (report.boundary, report.modes, report.corrections) == (0, 7, 1)
    full = eigh(held.stiffness, held.mass, eigvals_only=True)[:7]
    assert worst(np.diag(rom["stiffness"][:])[:7] / full, 1.0) < 1e-9
    assert rom["boundary/dof"].shape == (0,)


def test_without_modes_the_stiffness_is_the_schur_complement(held):
    report, rom = held.reduce(modes=0)
    assert report.modes_below_shift == -1
    compliance = np.linalg.inv(held.stiffness)[np.ix_(held.boundary, held.boundary)]
    assert worst(rom["stiffness"][:], np.linalg.inv(compliance)) < 1e-9
    assert rom["modes/frequency_hz"].shape == rom["modes/residual"].shape == (0,)
    assert rom["vectors/full"].shape == (0, len(held.mass))


def test_without_modes_or_a_frequency_nothing_is_examined_yet_loads_and_monitors_keep_their_places(held):
    report, rom = held.reduce(vectors=unit(held, 100, 50), modes=0)
    assert report.worst_error == -1.0
    assert rom["quality/frequency_hz"].shape == (0,)
    assert rom["quality/receptance"].shape == rom["quality/receptance_error"].shape == (0, 2, 2)


def test_a_mode_is_not_torn_from_its_twin(tmp_path):
    square = make_case(tmp_path, *elastic_block((4, 2, 2), (0.1, 0.03, 0.03)))
    report, rom = square.reduce(modes=1)
    first, second = rom["modes/frequency_hz"][:]
    assert report.modes == 2
    assert second == pytest.approx(first, rel=1e-9)


def test_every_dataset_says_what_it_is_and_in_which_unit(free):
    _, rom = free.reduce(vectors=unit(free, 100), modes=2)
    datasets = []
    rom.visititems(lambda _, item: datasets.append(item) if isinstance(item, h5py.Dataset) else None)
    assert len(datasets) == 15
    assert all({"description", "unit"} <= set(dataset.attrs) for dataset in datasets)
    assert {"format", "format_version", "description"} <= set(rom.attrs)
    wanted = "negative_pivots shift_hz modes_below_shift ordering factor_seconds constraint_seconds modes_seconds"
    assert set(wanted.split()) <= set(rom["reduction"].attrs)


@pytest.mark.parametrize("nodes", [0, 1, 2])
def test_a_rigid_motion_left_free_is_told_in_words(free, nodes):
    boundary = np.arange(3 * nodes)
    with pytest.raises(InputError, match=r"rigid motion or mechanism stays free.*: expected a constrained model"):
        free.reduce(boundary=boundary, modes=3)


def test_a_stiffness_that_is_not_positive_is_told_in_words(held):
    model = Model(csr_matrix(np.diag([1.0, 2.0, -3.0, 4.0])), csr_matrix(np.eye(4)))
    write_model(held.folder / "model.h5", model, [])
    with pytest.raises(InputError, match=r"not positive with the boundary held \(1 negative pivots\)"):
        held.reduce(boundary=[0], modes=1)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"boundary": [0, 10_000]}, "a boundary dof is not a dof of the model"),
        ({"boundary": range(216)}, "every dof is a boundary dof"),
        ({"vectors": np.ones((1, 7))}, "loads and monitors are of another size than the model"),
    ],
)
def test_what_does_not_fit_the_model_is_told_in_words(free, change, message):
    with pytest.raises(InputError, match=message):
        free.reduce(**change, modes=1)


def test_a_missing_model_is_told_with_its_name(free):
    with pytest.raises(InputError, match=r"nowhere\.h5 cannot be opened"):
        reduce_model(MPI.COMM_WORLD, free.folder / "nowhere.h5", free.folder / "rom.h5", [0], Options(modes=1))


def test_a_model_without_mass_is_told_with_the_dataset(free):
    with edited(free.folder / "model.h5") as file:
        del file["mass"]
    with pytest.raises(InputError, match="/mass/row_offsets is not in the file"):
        free.reduce(modes=1)


ON_RANKS = """
import json
import sys
from mpi4py import MPI
import numpy as np
from attrito.support.errors import InputError
from attrito.library.reduction import Options, reduce_model
model, rom, modes, boundary, n = *sys.argv[1:3], int(sys.argv[3]), int(sys.argv[4]), int(sys.argv[5])
recovered = json.loads(sys.argv[6])
vectors = np.eye(n)[[100, 50]] if MPI.COMM_WORLD.rank == 0 else None
try:
    reduce_model(MPI.COMM_WORLD, model, rom, np.arange(boundary), Options(modes=modes), vectors, recovered=recovered)
except InputError as error:
    print(error, flush=True)
"""


def reduce_on_ranks(
    case: Case, ranks: int, modes: int, boundary: int, recovered: list[int] | None = None
) -> subprocess.CompletedProcess:
    """Reduce under mpirun, onto the first dofs."""
    size, kept = len(case.mass), json.dumps(recovered)
    arguments = [case.folder / "model.h5", case.folder / f"rom{ranks}.h5", modes, boundary, size, kept]
    command = ["mpirun", "-n", str(ranks), sys.executable, "-c", ON_RANKS, *map(str, arguments)]
    return subprocess.run(command, env=clean_environment(), capture_output=True, text=True, timeout=TIMEOUT)


@pytest.mark.parametrize("boundary", [0, 36])
def test_one_two_and_four_ranks_give_the_same_model(held, boundary):
    frequencies, bases = [], []
    for ranks in (1, 2, 4):
        ran = reduce_on_ranks(held, ranks, 10, boundary)
        assert ran.returncode == 0, ran.stderr
        with h5py.File(held.folder / f"rom{ranks}.h5") as rom:
            frequencies.append(np.sqrt(eigh(rom["stiffness"][:], rom["mass"][:], eigvals_only=True)))
            bases.append(rom["recovery/basis"][:])
            assert np.array_equal(rom["vectors/full"][:], unit(held, 100, 50))
    for i in (1, 2):
        assert worst(frequencies[i] / frequencies[0], 1.0) < 1e-10
        assert worst(bases[i], bases[0]) < 1e-7


@pytest.mark.parametrize("dofs", [[5, 6, 50], [40, 100, 150]])
def test_ranks_may_have_none_of_the_dofs_that_are_recovered(held, dofs):
    bases = []
    for ranks in (1, 4):
        ran = reduce_on_ranks(held, ranks, 10, 36, dofs)
        assert ran.returncode == 0, ran.stderr
        with h5py.File(held.folder / f"rom{ranks}.h5") as rom:
            bases.append(rom["recovery/basis"][:])
            assert rom["recovery/dof"][:].tolist() == dofs
    assert bases[0].shape[1] == 3 and worst(bases[1], bases[0]) < 1e-7


def test_two_ranks_agree_on_a_failure(free):
    ran = reduce_on_ranks(free, 2, 3, 3)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.count("rigid motion or mechanism stays free") == 2
