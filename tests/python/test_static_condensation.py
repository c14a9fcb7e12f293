"""The boundary condensed by one complex elimination, against constraint modes and dense algebra."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
import pytest
from elastic import elastic_block
from jobs import TIMEOUT, clean_environment
from mpi4py import MPI
from reduced import COUNTS, SIZE, worst
from scipy.linalg import block_diag, eigh
from scipy.sparse import csr_matrix

from attrito.library.reduction import Options, Report, reduce_model
from attrito.model.model import Model
from attrito.model.model_file import write_model

EPSILON = np.finfo(float).eps


@dataclass
class Scene:
    """A model on disk, and what of it is kept."""

    folder: Path
    stiffness: np.ndarray
    mass: np.ndarray
    boundary: np.ndarray
    vectors: np.ndarray
    recovered: list[int]

    def reduce(self, condense: bool | None, **options) -> tuple[Report, h5py.File]:
        path = self.folder / f"rom{len(list(self.folder.glob('rom*')))}.h5"
        recovered = options.pop("recovered", self.recovered)
        asked = Options(**({"modes": 6, "condense": condense} | options))
        arguments = MPI.COMM_WORLD, self.folder / "model.h5", path, self.boundary, asked, self.vectors
        report = reduce_model(*arguments, recovered=recovered)
        return report, h5py.File(path)

    @property
    def blocks(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """K_ii, the constraint modes `[n, nb]`, and the interior's dofs."""
        interior = np.setdiff1d(np.arange(len(self.mass)), self.boundary)
        inside = self.stiffness[np.ix_(interior, interior)]
        modes = np.zeros((len(self.mass), len(self.boundary)))
        modes[self.boundary] = np.eye(len(self.boundary))
        modes[interior] = -np.linalg.solve(inside, self.stiffness[np.ix_(interior, self.boundary)])
        return inside, modes, interior


def scene(folder: Path, stiffness, mass, boundary, extra=()) -> Scene:
    """Two forces inside, one on the boundary; motion of some dofs of either."""
    write_model(folder / "model.h5", Model(csr_matrix(stiffness), csr_matrix(mass), *extra), [])
    size = mass.shape[0]
    interior = np.setdiff1d(np.arange(size), boundary)
    vectors = np.eye(size)[[interior[1], interior[-2], boundary[2]]]
    recovered = sorted({int(boundary[1]), int(interior[0]), int(interior[len(interior) // 2]), int(interior[-1])})
    dense = (csr_matrix(matrix).toarray() for matrix in (stiffness, mass))
    return Scene(folder, *dense, np.asarray(boundary), vectors, recovered)


def network(rng: np.random.Generator, size: int, links: int) -> tuple[np.ndarray, np.ndarray]:
    """Springs between random masses, some of them coupled: it floats; stiffnesses over three decades."""
    stiffness, mass = np.zeros((2, size, size))
    for a in range(size):
        for b in rng.choice(np.delete(np.arange(size), a), links, replace=False):
            unit = np.zeros(size)
            unit[a], unit[b] = 1.0, -1.0
            stiffness += 10.0 ** rng.uniform(3, 6) * np.outer(unit, unit)
            mass += 0.1 * rng.uniform() * np.outer(abs(unit), abs(unit))
    return stiffness, mass + np.diag(rng.uniform(0.5, 2.0, size))


def random_scene(folder: Path, seed: int) -> Scene:
    """Two parts that float apart, each with some boundary, and a boundary dof that is tied to nothing."""
    rng = np.random.default_rng(seed)
    sizes = rng.integers(20, 60, 2)
    parts = [network(rng, size, 3) for size in sizes] + [(np.zeros((1, 1)), np.ones((1, 1)))]
    stiffness, mass = (block_diag(*matrices) for matrices in zip(*parts, strict=True))
    kept = [
        rng.choice(size, rng.integers(3, size // 2), replace=False) + before
        for size, before in ((sizes[0], 0), (sizes[1], sizes[0]))
    ]
    order = rng.permutation(len(mass))
    place = np.argsort(order)
    boundary = np.sort(place[np.concatenate([*kept, [len(mass) - 1]])])
    return scene(folder, stiffness[np.ix_(order, order)], mass[np.ix_(order, order)], boundary)


def block_scene(folder: Path, extra: tuple = ()) -> Scene:
    """The elastic block in free space, all of one face kept."""
    model, points = elastic_block(COUNTS, SIZE)
    return scene(folder, model.stiffness, model.mass, np.flatnonzero(np.repeat(points[:, 2] < 1e-9, 3)), extra)


@pytest.fixture(params=[*range(6), "block"])
def case(request, tmp_path) -> Scene:
    return block_scene(tmp_path) if request.param == "block" else random_scene(tmp_path, request.param)


def test_condensed_matrices_are_the_schur_complement_and_the_mass_on_constraint_modes(case):
    report, rom = case.reduce(True)
    inside, modes, _ = case.blocks
    kept = slice(len(case.boundary))
    # Elimination of a positive definite matrix errs by eps a step relative to its own entries; what Psi errs by, the
    # condition of K_ii times eps, the mass has twice.
    size, condition = len(case.mass), np.linalg.cond(inside)
    assert report.condensed == 1 and report.constraint_residual == 0.0
    expected = case.stiffness[case.boundary] @ modes
    assert np.abs(rom["stiffness"][kept, kept] - expected).max() < size * EPSILON * np.abs(case.stiffness).max()
    tolerance = size * EPSILON * condition
    assert tolerance < 1e-6
    assert worst(rom["mass"][kept, kept], modes.T @ case.mass @ modes) < tolerance
    assert worst(rom["vectors/reduced"][:, kept], case.vectors @ modes) < tolerance
    assert worst(rom["recovery/basis"][kept], modes[case.recovered].T) < tolerance
    for name in ("stiffness", "mass"):
        assert np.array_equal(rom[name][:], rom[name][:].T)


def test_the_reduced_model_is_that_of_constraint_modes(case):
    (by_modes, first), (condensed, second) = case.reduce(False), case.reduce(True)
    assert (by_modes.condensed, condensed.condensed) == (0, 1)
    tolerance = len(case.mass) * EPSILON * np.linalg.cond(case.blocks[0])
    # Modes and corrections are known but for their signs, and to the residual 1e-12 of the eigensolver over their gaps.
    inner = slice(len(case.boundary), None)
    signs = np.ones(len(first["mass"]))
    products = np.sum(first["mass"][: len(case.boundary), inner] * second["mass"][: len(case.boundary), inner], axis=0)
    signs[inner] = np.sign(products)
    for name in ("stiffness", "mass"):
        assert worst(second[name][:] * np.outer(signs, signs), first[name][:]) < max(tolerance, 1e-9)
    for name in ("vectors/reduced", "recovery/basis"):
        turned = signs if name == "vectors/reduced" else signs[:, None]
        assert worst(second[name][:] * turned, first[name][:]) < max(tolerance, 1e-9)
    pencils = [(rom["stiffness"][:], rom["mass"][:]) for rom in (first, second)]
    one, other = (eigh(*pencil, eigvals_only=True) for pencil in pencils)
    # Rounding of the stiffness moves an eigenvalue by as much of the largest.
    assert worst(other, one) < tolerance
    for name in ("frequency_hz", "frequency_error", "receptance", "receptance_error"):
        assert first[f"quality/{name}"].shape == second[f"quality/{name}"].shape
    assert first["quality/frequency_hz"].shape[0] > 0
    assert worst(second["quality/frequency_hz"][:], first["quality/frequency_hz"][:]) < tolerance


def test_interior_dofs_without_mass_are_condensed_too(tmp_path):
    whole = block_scene(tmp_path)
    massless = np.setdiff1d(np.arange(150, 170), whole.boundary)
    whole.mass[massless] = 0.0
    whole.mass[:, massless] = 0.0
    write_model(tmp_path / "model.h5", Model(csr_matrix(whole.stiffness), csr_matrix(whole.mass)), [])
    _, rom = whole.reduce(True)
    inside, modes, _ = whole.blocks
    kept = slice(len(whole.boundary))
    tolerance = len(whole.mass) * EPSILON * np.linalg.cond(inside)
    assert worst(rom["mass"][kept, kept], modes.T @ whole.mass @ modes) < tolerance


def test_damping_and_the_motion_of_all_dofs_need_constraint_modes(tmp_path):
    free = block_scene(tmp_path)
    assert free.reduce(True, recovered=None)[0].condensed == 0
    write_model(
        tmp_path / "model.h5", Model(csr_matrix(free.stiffness), csr_matrix(free.mass), csr_matrix(free.mass)), []
    )
    report, rom = free.reduce(True)
    assert report.condensed == 0
    assert worst(rom["damping"][:], rom["mass"][:]) < 1e-13


def test_a_large_boundary_is_condensed_and_a_small_one_is_not(tmp_path):
    model, points = elastic_block((12, 6, 2), (0.2, 0.1, 0.04))
    face = np.flatnonzero(np.repeat(points[:, 2] < 1e-9, 3))
    three_nodes = face.reshape(-1, 3)[[0, 40, 90]].ravel()
    large, small = (scene(tmp_path, model.stiffness, model.mass, boundary) for boundary in (face, three_nodes))
    assert large.reduce(None)[0].condensed == 1
    assert small.reduce(None)[0].condensed == 0


IN_LITTLE_MEMORY = """
import json, resource, sys
import numpy as np
from mpi4py import MPI
from attrito.library.reduction import Options, reduce_model
model, rom, asked = sys.argv[1], sys.argv[2], json.loads(sys.argv[3])
def hear(text, done, total):
    print(text, flush=True)
    if text.startswith("condensing the boundary takes"):
        pages = int(open("/proc/self/statm").read().split()[0])
        # The result alone, 16 bytes a number, takes more than is left.
        left = 8 * len(asked["boundary"]) ** 2
        resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + left, resource.RLIM_INFINITY))
    if text.startswith("the boundary cannot be condensed"):
        resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY,) * 2)
report = reduce_model(
    MPI.COMM_WORLD, model, rom, np.array(asked["boundary"]), Options(modes=6), np.array(asked["vectors"]),
    listener=hear, recovered=asked["recovered"],
)
assert report.condensed == 0
"""


def test_a_boundary_that_cannot_be_condensed_gets_constraint_modes(tmp_path):
    model, points = elastic_block((12, 6, 2), (0.2, 0.1, 0.04))
    face = np.flatnonzero(np.repeat(points[:, 2] < 1e-9, 3))
    case = scene(tmp_path, model.stiffness, model.mass, face)
    asked = json.dumps(
        {"boundary": face.tolist(), "vectors": case.vectors.tolist(), "recovered": list(map(int, case.recovered))}
    )
    words = sys.executable, "-c", IN_LITTLE_MEMORY, str(tmp_path / "model.h5"), str(tmp_path / "little.h5"), asked
    done = subprocess.run(words, env=clean_environment(), capture_output=True, text=True, timeout=TIMEOUT)
    assert done.returncode == 0, done.stdout + done.stderr
    lines = [line for line in done.stdout.splitlines() if line.startswith("the boundary cannot be condensed")]
    assert len(lines) == 1 and lines[0].endswith(": constraint modes")
    _, by_modes = case.reduce(False)
    with h5py.File(tmp_path / "little.h5") as found:
        for name in ("stiffness", "mass"):
            assert worst(found[name][:], by_modes[name][:]) < 1e-12


def test_modes_are_doubled_on_a_condensed_boundary_as_on_constraint_modes(tmp_path):
    free = block_scene(tmp_path)
    reports = [
        free.reduce(condense, modes=None, error_target=1e-4, top_frequency_hz=40000.0)[0] for condense in (False, True)
    ]
    assert reports[0].modes == reports[1].modes > 20
    assert reports[1].worst_error == pytest.approx(reports[0].worst_error, rel=1e-6)


ON_RANKS = """
import sys, json
import numpy as np
from mpi4py import MPI
from attrito.library.reduction import Options, reduce_model
model, rom, asked = sys.argv[1], sys.argv[2], json.loads(sys.argv[3])
vectors = np.array(asked["vectors"]) if MPI.COMM_WORLD.rank == 0 else None
options = Options(modes=6, condense=True)
report = reduce_model(MPI.COMM_WORLD, model, rom, asked["boundary"], options, vectors, recovered=asked["recovered"])
assert report.condensed == 1
"""


def test_one_two_and_four_ranks_condense_alike(tmp_path):
    free = block_scene(tmp_path)
    asked = {"boundary": free.boundary.tolist(), "vectors": free.vectors.tolist(), "recovered": free.recovered}
    roms = []
    for ranks in (1, 2, 4):
        path = tmp_path / f"on{ranks}.h5"
        words = [str(tmp_path / "model.h5"), str(path), json.dumps(asked)]
        command = ["mpirun", "-n", str(ranks), sys.executable, "-c", ON_RANKS, *words]
        ran = subprocess.run(command, env=clean_environment(), capture_output=True, text=True, timeout=TIMEOUT)
        assert ran.returncode == 0, ran.stderr
        roms.append(h5py.File(path))
    kept = slice(len(free.boundary))
    tolerance = len(free.mass) * EPSILON * np.linalg.cond(free.blocks[0])
    for rom in roms[1:]:
        for name in ("stiffness", "mass"):
            assert worst(rom[name][kept, kept], roms[0][name][kept, kept]) < tolerance
        for name in ("vectors/reduced", "recovery/basis"):
            found, expected = (np.abs(file[name][:]) for file in (rom, roms[0]))
            assert worst(found, expected) < max(tolerance, 1e-9)


KILLED_AT_ITS_MODES = """
import os, signal, sys, json
import numpy as np
from mpi4py import MPI
from attrito.library.reduction import Options, reduce_model
asked = json.loads(sys.argv[2])
def listen(text, done, total):
    if text == "fixed-interface modes":
        os.kill(os.getpid(), signal.SIGKILL)
reduce_model(MPI.COMM_WORLD, sys.argv[1] + "/model.h5", sys.argv[1] + "/rom.h5", asked["boundary"],
             Options(modes=6, condense=True), np.array(asked["vectors"]), recovered=asked["recovered"],
             fingerprint="it", listener=listen)
"""


def test_a_reduction_that_was_killed_goes_on_with_its_condensed_boundary(tmp_path):
    free = block_scene(tmp_path)
    asked = {"boundary": free.boundary.tolist(), "vectors": free.vectors.tolist(), "recovered": free.recovered}
    command = [sys.executable, "-c", KILLED_AT_ITS_MODES, str(tmp_path), json.dumps(asked)]
    assert subprocess.run(command, env=clean_environment(), stderr=subprocess.DEVNULL).returncode < 0
    assert (tmp_path / "rom.h5.steps/condensed.h5").exists()
    _, whole = free.reduce(True)
    steps = []
    options = Options(modes=6, condense=True)
    report = reduce_model(
        *(MPI.COMM_WORLD, tmp_path / "model.h5", tmp_path / "rom.h5", free.boundary, options, free.vectors),
        recovered=free.recovered,
        fingerprint="it",
        listener=lambda text, *_: steps.append(text),
    )
    assert report.condensed == 1 and "condensation" not in steps
    kept = slice(len(free.boundary))
    with h5py.File(tmp_path / "rom.h5") as rom:
        for name in ("stiffness", "mass"):
            assert worst(rom[name][kept, kept], whole[name][kept, kept]) < 1e-9
