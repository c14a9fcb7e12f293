"""The reduction at size: a twisted blade of up to 50 thousand dofs, memory, restart, and the error that it tells."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import blade_solid
import h5py
import numpy as np
import pytest
from elastic import elastic_block, rigid_motions
from jobs import TIMEOUT, attrito, clean_environment, wait_for
from mpi4py import MPI
from reduced import Case, make_case, unit, worst
from scipy.linalg import block_diag, eigh
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import eigsh

from attrito.library.names import EIGENSOLVERS
from attrito.library.reduction import Options, reduce_model
from attrito.model.model import Model
from attrito.model.model_file import read_model
from attrito.runs.progress import Progress
from attrito.scene.rom_file import receptance_errors
from attrito.support.errors import InputError, NumericsError
from attrito.support.own_folders import MARK

REPOSITORY = Path(__file__).parents[2]


class Blade(NamedTuple):
    """Folder of a free blade with its reduced model; contact nodes, dofs, entries of the stiffness."""

    folder: Path
    nodes: int
    dofs: int
    entries: int


SIZES = [(120, 9975, 720315), pytest.param((200, 50025, 3698145), marks=pytest.mark.slow)]


@pytest.fixture(scope="module", params=SIZES, ids=["10 thousand dofs", "50 thousand dofs"])
def blade(request, tmp_path_factory) -> Blade:
    """Reduced onto its contact nodes and 100 modes on two ranks."""
    nodes, dofs, entries = request.param
    folder = tmp_path_factory.mktemp("blade")
    script, arguments = REPOSITORY / "benchmarks" / "blade_solid.py", [str(folder), str(dofs)]
    subprocess.run([sys.executable, script, *arguments], check=True, env=clean_environment(), timeout=TIMEOUT)
    script = REPOSITORY / "benchmarks" / "reduction.py"
    command = ["mpirun", "-n", "2", sys.executable, str(script), str(folder), "--modes", "100", "--keep"]
    ran = subprocess.run(command, env=clean_environment(), capture_output=True, text=True, timeout=TIMEOUT)
    assert ran.returncode == 0, ran.stderr
    return Blade(folder, nodes, dofs, entries)


def test_a_blade_has_all_its_modes(blade):
    with h5py.File(blade.folder / "rom.h5") as rom:
        assert rom["recovery/basis"].shape == (3 * blade.nodes + 102, blade.dofs)
        assert np.bincount(rom["coordinates/kind"][:]).tolist() == [3 * blade.nodes, 100, 2]
        assert rom["modes/residual"][:].max() < 1e-8
        told = rom["reduction"].attrs
        found = np.sum(rom["modes/frequency_hz"][:] < told["shift_hz"])
        assert told["modes_below_shift"] == found == 100
        assert told["negative_pivots"] == 0
    assert not (blade.folder / "rom.h5.steps").exists()


def test_rigid_motions_of_a_free_blade_pass_through_its_constraint_modes(blade):
    model = read_model(blade.folder / "model.h5", matrices=False)
    motions = rigid_motions(model.coordinates)
    with h5py.File(blade.folder / "rom.h5") as rom:
        boundary = rom["boundary/dof"][:]
        recovered = rom["recovery/basis"][: len(boundary)].T @ motions[boundary]
    assert worst(recovered, motions) < 1e-7


def test_a_free_blade_has_six_rigid_modes_far_below_the_elastic_ones(blade):
    with h5py.File(blade.folder / "rom.h5") as rom:
        frequencies = np.sqrt(np.abs(eigh(rom["stiffness"][:], rom["mass"][:], eigvals_only=True)))
    assert frequencies[5] < 1e-4 * frequencies[6]


def test_info_tells_of_the_blade_how_good_it_is(blade):
    told = attrito(blade.folder, "info", "rom.h5")
    assert told.returncode == 0, told.stderr
    assert f"{3 * blade.nodes} boundary dofs, 100 fixed-interface modes, 2 static corrections" in told.stdout
    assert "inertia counts 100 below" in told.stdout
    assert "mode 1: " in told.stdout
    told = attrito(blade.folder, "info", "model.h5")
    assert f"model of {blade.dofs} dofs, {blade.entries} entries" in told.stdout
    assert f"node set flanks: {blade.nodes} nodes" in told.stdout


def test_info_of_another_file_is_a_fault(tmp_path):
    with h5py.File(tmp_path / "other.h5", "w"):
        pass
    told = attrito(tmp_path, "info", "other.h5")
    assert told.returncode == 2
    assert "other.h5: format is missing: expected a file that attrito writes" in told.stderr


def quadratic_shapes(place: np.ndarray) -> np.ndarray:
    """The ten functions of a tetrahedron at barycentric coordinates `[4]`."""
    return np.array([*place * (2 * place - 1), *(4 * place[a] * place[b] for a, b in blade_solid.EDGES)])


def test_the_mass_of_the_benchmark_elements_is_exact():
    # Keast's rule of fifteen points is exact to the fifth degree, a product of two functions is of the fourth.
    root = np.sqrt(15.0)
    points = [(np.full(4, 0.25), 16 / 135)]
    for near, weight in (((7 + root) / 34, (2665 - 14 * root) / 37800), ((7 - root) / 34, (2665 + 14 * root) / 37800)):
        points += [(np.where(np.arange(4) == i, 1 - 3 * near, near), weight) for i in range(4)]
    near = (10 - 2 * root) / 40
    pairs = [(i, j) for i in range(4) for j in range(i)]
    points += [(np.where(np.isin(np.arange(4), pair), near, 0.5 - near), 20 / 378) for pair in pairs]
    expected = sum(weight * np.outer(*[quadratic_shapes(place)] * 2) for place, weight in points)
    assert np.abs(blade_solid.unit_mass() - expected).max() < 1e-15


def test_the_benchmark_blade_has_the_frequencies_that_calculix_finds(tmp_path, monkeypatch):
    near, far = 0.5854101966249685, 0.1381966011250105
    points = np.full((4, 4), far) + (near - far) * np.eye(4)
    # CalculiX integrates the mass, too, with four points only.
    mass = sum(np.outer(*[quadratic_shapes(place)] * 2) for place in points) / 4
    monkeypatch.setattr(blade_solid, "unit_mass", lambda: mass)
    model = blade_solid.blade_model(6000)
    blade_solid.write_deck(tmp_path / "blade.inp", model, 5)
    ran = subprocess.run(["ccx", "blade"], cwd=tmp_path, capture_output=True, text=True, timeout=TIMEOUT)
    assert ran.returncode == 0, ran.stdout
    lines = [line.split() for line in (tmp_path / "blade.dat").read_text().splitlines()]
    expected = np.array([float(line[3]) for line in lines if len(line) == 5 and line[0].isdigit()])
    assert len(expected) == 5
    held = np.isin(model.dof_node, model.node_sets["flanks"])
    stiffness, mass = (matrix[~held][:, ~held].tocsc() for matrix in (model.stiffness, model.mass))
    found = np.sqrt(np.sort(eigsh(stiffness, 5, mass, sigma=0.0, return_eigenvectors=False))) / (2 * np.pi)
    # CalculiX prints seven digits.
    assert found == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(("name", "modes", "count"), [("held", 4, 6), ("held", 12, 9), ("free", 12, 4)])
def test_the_estimated_error_of_a_mode_is_within_a_factor_ten_of_the_truth(name, modes, count, request):
    case: Case = request.getfixturevalue(name)
    _, rom = case.reduce(vectors=unit(case, 100, 50), modes=modes)
    rigid = 6 if name == "free" else 0
    full = np.sqrt(eigh(case.stiffness, case.mass, eigvals_only=True)[rigid:]) / (2 * np.pi)
    frequency, estimate = (rom[f"quality/frequency_{what}"][:] for what in ("hz", "error"))
    assert len(frequency) == count
    truth = frequency / full[: len(frequency)] - 1.0
    assert np.all(estimate < 10.0 * truth)
    assert np.all(truth < 10.0 * estimate)


def test_the_estimated_error_of_a_monitor_is_within_a_factor_ten_of_the_truth(held):
    vectors = unit(held, 100, 50)
    _, rom = held.reduce(vectors=vectors, modes=6)
    receptance, estimate = rom["quality/receptance"][:], rom["quality/receptance_error"][:]
    full = np.zeros_like(receptance)
    for i, frequency in enumerate(rom["quality/response_hz"][:]):
        matrix = held.stiffness - (2 * np.pi * frequency) ** 2 * held.mass
        full[i] = vectors @ np.linalg.solve(matrix, vectors.T)
    assert len(full) >= 3
    truth = full - receptance
    # Where the error is as large as the response itself, a first-order estimate says no more than that.
    small = np.abs(truth) < 0.3 * np.abs(receptance)
    assert np.sum(small) > 0.7 * small.size
    ratio = estimate[small] / truth[small]
    assert ratio.min() > 0.1
    assert ratio.max() < 10.0
    assert receptance_errors(receptance, estimate).shape == (2, 2)


def test_errors_of_two_bodies_that_are_nearly_alike_are_not_held_against_what_cancels(held, tmp_path):
    twins = tmp_path / "twins"
    twins.mkdir()
    matrices = [
        csr_matrix(block_diag(one, factor * one)) for one, factor in ((held.stiffness, 1.0004), (held.mass, 1.0))
    ]
    points = np.vstack([held.points, held.points])
    case = make_case(twins, Model(*matrices, 0.0 * matrices[1]), points)
    left, right = unit(case, 100, 100 + len(held.mass))
    _, rom = case.reduce(vectors=np.array([left - right]), modes=12)
    _, single = held.reduce(vectors=unit(held, 100), modes=6)
    # Half way between a mode of the one and that of the other their difference vanishes, its error does not.
    errors = [
        receptance_errors(file["quality/receptance"][:], file["quality/receptance_error"][:]) for file in (rom, single)
    ]
    assert len(rom["quality/response_hz"][:]) == len(single["quality/response_hz"][:])
    assert errors[0] == pytest.approx(errors[1], rel=0.1)


@pytest.mark.parametrize("target", [1e-2, 1e-4])
def test_modes_are_kept_until_the_error_meets_its_target(held, target):
    report, rom = held.reduce(vectors=unit(held, 100, 50), error_target=target, top_frequency_hz=15000.0)
    full = np.sqrt(eigh(held.stiffness, held.mass, eigvals_only=True)) / (2 * np.pi)
    found = np.sqrt(eigh(rom["stiffness"][:], rom["mass"][:], eigvals_only=True)) / (2 * np.pi)
    below = np.sum(full < 15000.0)
    assert below >= 4
    assert np.all(found[:below] / full[:below] - 1.0 < target)
    assert 0.0 < report.worst_error <= target
    # Not all of them, which would meet any target.
    assert report.modes < 0.9 * len(held.interior)


@pytest.mark.parametrize(
    ("eigensolver", "width"),
    [("slepc", 1), ("slepc", 16), *(("block_lanczos", width) for width in (1, 7, 16, 50))],
)
def test_eigensolvers_with_blocks_of_any_width_find_the_modes_of_a_dense_one(free, eigensolver, width):
    for modes in (1, 20, 60):
        report, rom = free.reduce(modes=modes, eigensolver=eigensolver, block_vectors=width)
        assert worst(rom["modes/frequency_hz"][:] / free.clamped_frequencies[: report.modes], 1.0) < 1e-10
        assert report.mode_residual < 1e-10
        assert report.mode_solves >= report.modes
        assert rom["reduction"].attrs["eigensolver"] == eigensolver
        assert rom["reduction"].attrs["mode_solves"] == report.mode_solves


@pytest.mark.parametrize("eigensolver", EIGENSOLVERS)
def test_modes_that_come_in_pairs_are_all_found(tmp_path, eigensolver):
    square = make_case(tmp_path, *elastic_block((6, 2, 2), (0.1, 0.02, 0.02)))
    report, rom = square.reduce(modes=30, eigensolver=eigensolver)
    expected = square.clamped_frequencies[: report.modes]
    assert np.sum(expected[1:] / expected[:-1] < 1.0 + 1e-9) >= 5
    assert worst(rom["modes/frequency_hz"][:] / expected, 1.0) < 1e-9
    assert report.modes_below_shift == report.modes


def test_both_eigensolvers_give_the_same_modes_to_a_residual_of_rounding(tmp_path):
    slender = make_case(tmp_path, *elastic_block((12, 3, 2), (0.2, 0.03, 0.02)))
    bases = []
    for eigensolver in EIGENSOLVERS:
        report, rom = slender.reduce(modes=60, eigensolver=eigensolver)
        assert report.mode_residual < 1e-10
        assert report.modes_below_shift == 60
        bases.append(rom["recovery/basis"][len(slender.boundary) :])
    assert worst(bases[1], bases[0]) < 1e-8


WITHOUT_PATIENCE = """
import sys
from mpi4py import MPI
import numpy as np
from attrito.support.errors import NumericsError
from attrito.library.reduction import Options, reduce_model
try:
    reduce_model(MPI.COMM_WORLD, *sys.argv[1:3], np.arange(30), Options(modes=40))
except NumericsError as error:
    print(error)
"""


def test_modes_that_slepc_does_not_find_are_an_error_in_words_and_no_object_is_left(held):
    arguments = [sys.executable, "-c", WITHOUT_PATIENCE, held.folder / "model.h5", held.folder / "rom.h5"]
    environment = clean_environment() | {"PETSC_OPTIONS": "-modes_eps_max_it 1 -objects_dump"}
    ran = subprocess.run(list(map(str, arguments)), env=environment, capture_output=True, text=True, timeout=600)
    assert ran.returncode == 0, ran.stderr
    assert re.match(r"only \d+ of 40 fixed-interface modes were found: ask for fewer", ran.stdout)
    assert "never freed" not in ran.stdout + ran.stderr


def test_factors_on_disk_give_the_same_model(free):
    in_core, one = free.reduce(modes=8, out_of_core=False)
    on_disk, other = free.reduce(modes=8, out_of_core=True)
    assert (in_core.out_of_core, on_disk.out_of_core) == (0, 1)
    assert worst(other["modes/frequency_hz"][:] / one["modes/frequency_hz"][:], 1.0) < 1e-11
    assert worst(other["stiffness"][:], one["stiffness"][:]) < 1e-11


@pytest.fixture(scope="module")
def middling(tmp_path_factory) -> Path:
    """Folder of a blade of ten thousand dofs."""
    folder = tmp_path_factory.mktemp("blade_10k")
    blade_solid.write_model(folder / "model.h5", blade_solid.blade_model(10000), [])
    return folder


def flanks(folder: Path) -> np.ndarray:
    model = read_model(folder / "model.h5", matrices=False)
    return np.flatnonzero(np.isin(model.dof_node, model.node_sets["flanks"]))


def test_factors_go_to_disk_where_memory_is_short_and_nothing_is_begun_where_it_is_too_short(middling):
    told = []
    arguments = (MPI.COMM_WORLD, middling / "model.h5", middling / "rom.h5", flanks(middling)[:30])

    def reduce(memory_gb):
        return reduce_model(
            *arguments,
            Options(modes=5, block_size=16, memory_gb=memory_gb),
            listener=lambda text, *_: told.append(text),
        )

    report = reduce(None)
    assert report.out_of_core == 0
    beside = 10000 * 250 * 8 / 2**30
    between = beside + 0.5 * (report.factor_megabytes + report.factor_megabytes_out_of_core) / 1024
    assert reduce(between / 0.95).out_of_core == 1
    words = [text for text in told if "factors of" in text]
    assert words[0].endswith(": in core")
    assert words[-1].endswith(": on disk")
    with pytest.raises(NumericsError, match=r"memory is too short for the reduction even with the factors on disk"):
        reduce(beside)


# Once a step has left the file, the reduction waits to be killed.
RESTARTED = """
import signal, sys
from pathlib import Path
from mpi4py import MPI
import numpy as np
from attrito.library.reduction import Options, reduce_model
folder, boundary = sys.argv[1], np.load(sys.argv[1] + "/boundary.npy")
def listen(text, done, total):
    if list(Path(folder, "rom.h5.steps").glob(sys.argv[2])):
        signal.pause()
reduce_model(MPI.COMM_WORLD, folder + "/model.h5", folder + "/rom.h5", boundary, Options(modes=60, block_size=4),
             fingerprint="it", listener=listen)
"""


def kill_when(folder: Path, pattern: str, ranks: int) -> dict[str, float]:
    """Start the reduction, kill it hard once a step has left such a file; the files whole by then, with their times."""
    command = ["mpirun", "-n", str(ranks), sys.executable, "-c", RESTARTED, str(folder), pattern]
    running = subprocess.Popen(command, env=clean_environment(), start_new_session=True, stderr=subprocess.DEVNULL)
    wait_for(lambda: bool(list((folder / "rom.h5.steps").glob(pattern))), running)
    children = subprocess.run(["pgrep", "-P", str(running.pid)], capture_output=True, text=True).stdout.split()
    for process in [*map(int, children), running.pid]:
        os.kill(process, signal.SIGKILL)
    running.wait()
    return {path.name: path.stat().st_mtime_ns for path in (folder / "rom.h5.steps").glob("*.h5")}


@pytest.fixture(scope="module")
def whole(middling) -> Path:
    """The reduction that none of those that were killed may differ from, made at once; `boundary.npy` beside it."""
    boundary = flanks(middling)[:120]
    np.save(middling / "boundary.npy", boundary)
    options = Options(modes=60, block_size=4)
    reduce_model(MPI.COMM_WORLD, middling / "model.h5", middling / "whole.h5", boundary, options)
    return middling / "whole.h5"


@pytest.mark.parametrize("name", ["constraint_*.h5", "constraint_000001_*.h5"])
def test_a_bit_that_has_turned_over_in_a_finished_step_is_seen(middling, name):
    boundary = flanks(middling)[:120]
    np.save(middling / "boundary.npy", boundary)
    kill_when(middling, "constraint_000029_*.h5", 2)
    steps = middling / "rom.h5.steps"
    damaged = sorted(steps.glob(name))[-1]
    with h5py.File(damaged, "r+") as file:
        bits = file["columns"][:].view(np.uint64)
        bits[-1, bits.shape[1] // 2] ^= np.uint64(1)
        file["columns"][:] = bits.view(np.float64)
    files = middling / "model.h5", middling / "rom.h5"
    with pytest.raises((InputError, NumericsError, OSError), match=f"{damaged.name} is damaged"):
        reduce_model(MPI.COMM_WORLD, *files, boundary, Options(modes=60, block_size=4), fingerprint="it")
    shutil.rmtree(steps)


@pytest.mark.parametrize("pattern", ["constraint_000029_*.h5", "mode_000009_*.h5", "mass.h5"])
def test_a_reduction_that_was_killed_goes_on_from_its_last_finished_step(middling, whole, pattern):
    boundary = np.load(middling / "boundary.npy")
    left = kill_when(middling, pattern, 2)
    steps = middling / "rom.h5.steps"
    seen: dict[str, int] = {}

    def listen(text, done, total):
        for path in steps.glob("*.h5"):
            seen[path.name] = path.stat().st_mtime_ns

    options = Options(modes=60, block_size=4)
    files = middling / "model.h5", middling / "rom.h5"
    reduce_model(MPI.COMM_WORLD, *files, boundary, options, fingerprint="it", listener=listen)
    kept = [name for name in left if name.startswith("constraint")]
    assert len(kept) >= 8
    assert all(seen[name] == left[name] for name in kept)
    assert not steps.exists()
    with h5py.File(whole) as at_once, h5py.File(middling / "rom.h5") as rom:
        pencils = [(file["stiffness"][:], file["mass"][:]) for file in (at_once, rom)]
        assert rom["reduction"].attrs["modes_below_shift"] == 60
        # Factors of one and of two ranks differ by rounding, 1e-16, times the condition of K_ii, some 1e8.
        assert worst(rom["recovery/basis"][:120], at_once["recovery/basis"][:120]) < 1e-7
    one, other = (np.sqrt(np.abs(eigh(*pencil, eigvals_only=True)[6:])) for pencil in pencils)
    assert worst(other / one, 1.0) < 1e-9


KILLED_AMONG_FORTY_MODES = """
import os, signal, sys
from mpi4py import MPI
import numpy as np
from attrito.library.reduction import Options, reduce_model
folder, boundary = sys.argv[1], np.load(sys.argv[1] + "/boundary.npy")
def listen(text, done, total):
    if text == "fixed-interface modes" and total == 40:
        os.kill(os.getpid(), signal.SIGKILL)
reduce_model(MPI.COMM_WORLD, folder + "/model.h5", folder + "/auto.h5", boundary,
             Options(error_target=1e-4, top_frequency_hz=float(sys.argv[2])), fingerprint="it", listener=listen)
"""


def test_doubling_the_modes_goes_on_from_the_number_it_had_come_to(middling):
    boundary = flanks(middling)[:120]
    np.save(middling / "boundary.npy", boundary)
    first = reduce_model(MPI.COMM_WORLD, middling / "model.h5", middling / "few.h5", boundary, Options(modes=20))
    with h5py.File(middling / "few.h5") as file:
        # Just above the twenty modes, so that these cannot be enough.
        top = float(file["modes/frequency_hz"][-1]) * 1.01
    assert first.modes == 20
    command = [sys.executable, "-c", KILLED_AMONG_FORTY_MODES, str(middling), str(top)]
    assert subprocess.run(command, env=clean_environment(), stderr=subprocess.DEVNULL).returncode == -signal.SIGKILL
    totals = []
    report = reduce_model(
        MPI.COMM_WORLD,
        middling / "model.h5",
        middling / "auto.h5",
        boundary,
        Options(error_target=1e-4, top_frequency_hz=top),
        fingerprint="it",
        listener=lambda text, done, total: totals.append(total if text == "fixed-interface modes" else 0),
    )
    assert 20 not in totals
    assert 40 in totals
    assert report.modes >= 40
    assert report.worst_error <= 1e-4


def test_what_another_reduction_left_is_not_taken_up(middling):
    boundary = flanks(middling)[:30]
    steps = middling / "other.h5.steps"
    steps.mkdir()
    (steps / MARK).write_text("attrito intermediate files 1\nof another\n")
    (steps / "constraint_000001_000030.h5").write_text("no columns")
    files = middling / "model.h5", middling / "other.h5"
    reduce_model(MPI.COMM_WORLD, *files, boundary, Options(modes=3), fingerprint="mine")
    assert not steps.exists()


def test_long_steps_tell_how_much_time_is_left(monkeypatch, capsys):
    clock = iter([100.0, 101.0, 110.0, 111.0, 130.0, 140.0])
    monkeypatch.setattr("attrito.runs.progress.time.monotonic", lambda: next(clock))
    progress = Progress(MPI.COMM_SELF)
    for done in (0, 10, 100, 110, 300, 600):
        progress.step("constraint modes", done, 600)
    told = capsys.readouterr().out.splitlines()
    assert told == ["constraint modes: 100 of 600, some 50 s left", "constraint modes: 300 of 600, some 30 s left"]
