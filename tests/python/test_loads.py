"""Loads by rotation, by file and by pressure, and what rotation takes from the stiffness."""

from __future__ import annotations

import json

import h5py
import numpy as np
import pytest
import synthetic
from bricks import SPEED_HZ, brick, centrifugal, faults_of, job, scene_of
from calculix_beam import CALCULIX_HZ, HEIGHT, LENGTH, RADIUS, WIDTH, beam_model, solve, write_mesh
from edited import edited
from elastic import DENSITY
from jobs import attrito_here, run, write_job
from scipy.linalg import eigh
from scipy.sparse import csr_matrix, diags, identity

from attrito.model.model import Model
from attrito.model.model_file import read_model, write_model
from attrito.model.rotation import Spin, centrifugal_load, projector, softening, softening_within
from attrito.scene.deck_loads import deck_force
from attrito.support.errors import InputError

OBLIQUE = np.array([1.0, -2.0, 2.0]) / 3.0
SPRING_HZ = 50.0
KINDS = ("C3D4", "C3D8", "C3D10", "C3D20")


def bent(points):
    """Curved faces, so that nothing cancels by symmetry."""
    return points + 0.1 * np.column_stack([points[:, 1] ** 2, np.sin(points[:, 2]), points[:, 0] * points[:, 1]])


def positions(model: Model) -> np.ndarray:
    """Coordinates of the nodes of a model none of whose nodes is held, in the order of its dofs, `[N, 3]`."""
    order = np.argsort(model.node_ids)
    return model.coordinates[order[np.searchsorted(model.node_ids[order], model.dof_node[::3])]]


@pytest.mark.parametrize("axis", [np.array([0.0, 1.0, 0.0]), OBLIQUE])
def test_the_centrifugal_load_is_that_of_the_centre_of_mass_and_turns_nothing_about_the_axis(axis):
    model = brick(shape=lambda points: points + 0.1 * points[:, [1, 2, 0]] ** 2)
    point = np.array([0.3, -0.2, 0.1])
    force = centrifugal_load(model, Spin(100.0, point, axis)).reshape(-1, 3)
    weights = np.asarray(model.mass.sum(axis=1)).reshape(-1, 3)[:, 0]
    mass, x = weights.sum(), positions(model)
    offset = weights @ x / mass - point
    radius = offset - offset @ axis * axis
    assert force.sum(axis=0) == pytest.approx(mass * 100.0**2 * radius, rel=1e-12)
    torque = np.cross(x - point, force) @ axis
    # Each node has a torque of its own, since the mass is consistent; all together none.
    assert abs(torque.sum()) < 1e-12 * np.abs(torque).sum() < 1e-9 * mass * 100.0**2
    volume = 0.1 * 0.04 * 0.03
    assert mass == pytest.approx(DENSITY * volume, rel=0.05)


def test_the_projector_removes_the_axis_and_nothing_else():
    model = brick(held=lambda points: points[:, 2] < 1e-9)
    across = projector(model, OBLIQUE)
    assert abs(across @ across - across).max() < 1e-15
    assert np.abs(across @ np.tile(OBLIQUE, model.size // 3)).max() < 1e-15
    sideways = np.tile(np.cross(OBLIQUE, [1.0, 0.0, 0.0]), model.size // 3)
    assert across @ sideways == pytest.approx(sideways)


def masses() -> Model:
    """Equal masses in space, each on springs that are the same in all directions."""
    model = synthetic.assemble([synthetic.block("C3D8", (1, 1, 1))], {}, seed=2)
    model.elements = {}
    model.mass = csr_matrix(2.0 * identity(model.size))
    model.stiffness = csr_matrix(2.0 * (2 * np.pi * SPRING_HZ) ** 2 * identity(model.size))
    return model


@pytest.mark.parametrize("reduced", [False, True])
def test_a_spinning_mass_on_springs_is_softer_across_the_axis_only(tmp_path, reduced):
    model = masses()
    write_model(tmp_path / "model.h5", model, [])
    first = int(model.node_ids.min())
    description = job(centrifugal(axis_direction=[3.0, 6.0, -6.0], spin_softening=True))
    del description["contact_set"]
    if reduced:
        # The node of the contact is the boundary, and the modes are those of the other seven.
        description["reduction"] = {"modes": 21}
    else:
        del description["reduction"]
    description["contact"] = [
        {
            "normal": [[["node", first, "x"], 1.0]],
            "tangents": [[[["node", first, "y"], 1.0]]],
            "normal_stiffness": 1.0e9,
            "tangential_stiffness": 1.0e9,
            "friction_coefficient": 0.3,
        }
    ]
    run(tmp_path, description)
    with h5py.File(tmp_path / "result.h5") as file:
        natural = np.sort(file["linear/stuck/natural_hz"][:])
    softened = np.sqrt(SPRING_HZ**2 - SPEED_HZ**2)
    # Seven free masses: two directions across the axis and one along it; the eighth moves obliquely, in between.
    assert natural[:14] == pytest.approx(softened, rel=1e-9)
    assert softened < natural[14] < SPRING_HZ
    assert natural[15:20] == pytest.approx(SPRING_HZ, rel=1e-9)


def test_a_reduced_softened_model_has_the_frequencies_of_the_full_one(tmp_path):
    model = brick(held=lambda points: points[:, 0] < 1e-9)
    speed = 2000.0
    description = job(
        centrifugal(speed_hz=speed, axis_direction=[1.0, 2.0, 2.0], spin_softening=True), reduction={"modes": 54}
    )
    write_model(tmp_path / "model.h5", model, [])
    run(tmp_path, description)
    assert not list(tmp_path.glob("*.altered"))
    description["load"] = [centrifugal(), *description["load"][1:]]
    rows = scene_of(tmp_path, model, description).contacts
    springs = np.full(rows.rows.shape[0], 1.0e11) * np.repeat(rows.places["area"], 3)
    axis = np.tile([1 / 3, 2 / 3, 2 / 3], model.size // 3)
    # P written out: x - a (a . x) at every node.
    across = np.eye(model.size)
    for node in range(model.size // 3):
        own = slice(3 * node, 3 * node + 3)
        across[own, own] -= np.outer(axis[own], axis[own])
    stuck = model.stiffness.toarray() + (rows.rows.T @ diags(springs) @ rows.rows).toarray()
    mass = model.mass.toarray()
    plain = eigh(stuck, mass, eigvals_only=True)
    expected = eigh(stuck - (2 * np.pi * speed) ** 2 * across @ mass @ across, mass, eigvals_only=True)
    with h5py.File(tmp_path / "result.h5") as file:
        natural = np.sort(file["linear/stuck/natural_hz"][:])
    # All interior modes are kept, so the reduction is exact.
    assert natural == pytest.approx(np.sqrt(expected[: len(natural)]) / (2 * np.pi), rel=1e-8)
    assert np.sqrt(expected[0] / plain[0]) < 0.99


def test_another_speed_is_another_reduced_model_and_the_same_one_is_used_again(tmp_path, capfd):
    write_model(tmp_path / "model.h5", brick(held=lambda points: points[:, 0] < 1e-9), [])
    said = []
    for speed in (100.0, 100.0, 101.0):
        name = write_job(tmp_path, job(centrifugal(speed_hz=speed, spin_softening=True)))
        done = attrito_here(tmp_path, capfd, "reduce", name)
        assert done.returncode == 0, done.stderr
        said.append("up to date" in done.stdout)
    assert said == [False, True, False]


@pytest.mark.parametrize(
    ("loads", "static", "said"),
    [
        (
            [centrifugal(spin_softening=True)],
            {"load_path": [0.0, 0.5]},
            "load_path[1] = 0.5: expected 1 at the end for spin: its spin softening is that of speed_hz",
        ),
        (
            [centrifugal()],
            {"load_path": [0.0, {"spin": -1.0}]},
            "load_path[1] = -1.0: expected at least 0 for spin, a factor on the square of its speed",
        ),
        (
            [centrifugal(spin_softening=True), centrifugal(name="again", spin_softening=True)],
            {},
            "load[1] spin_softening = True: expected one load with spin softening",
        ),
    ],
)
def test_a_load_path_that_rotation_cannot_follow_is_a_fault(tmp_path, loads, static, said):
    assert said in faults_of(tmp_path, brick(), job(*loads, static=static))


def test_softening_is_never_added_twice(tmp_path):
    model = brick(held=lambda points: points[:, 0] < 1e-9)
    model.stiffness_holds, model.spin_hz = ("stress_stiffening", "spin_softening"), SPEED_HZ
    said = faults_of(tmp_path, model, job(centrifugal(spin_softening=True)))
    assert "the stiffness of model.h5 holds spin softening already" in said
    assert scene_of(tmp_path, model, job(centrifugal())).static["spin"].any()
    kept = read_model(tmp_path / "model.h5", matrices=False)
    assert kept.stiffness_holds == model.stiffness_holds and kept.spin_hz == SPEED_HZ


def test_a_stiffness_of_another_speed_is_a_fault(tmp_path):
    model = brick(held=lambda points: points[:, 0] < 1e-9)
    model.stiffness_holds, model.spin_hz = ("stress_stiffening",), 31.0
    said = faults_of(tmp_path, model, job(centrifugal(spin_softening=True)))
    assert "speed_hz = 30.0: expected 31, the speed of the stress stiffening" in said


def test_softening_about_an_oblique_axis_needs_nodes_free_or_held_in_all_directions(tmp_path):
    model = brick()
    low = np.isin(model.dof_node, model.node_sets["low"]) & (model.dof_direction == 1)
    keep = np.flatnonzero(~low)
    model.stiffness, model.mass = (matrix[keep][:, keep] for matrix in (model.stiffness, model.mass))
    model.dof_node, model.dof_direction, model.size = model.dof_node[keep], model.dof_direction[keep], len(keep)
    oblique = centrifugal(axis_direction=[1.0, 1.0, 0.0], spin_softening=True)
    assert "no node held in part" in faults_of(tmp_path, model, job(oblique))
    assert scene_of(tmp_path, model, job(centrifugal(axis_direction=[1.0, 0.0, 0.0], spin_softening=True)))


def test_softening_in_a_stiffness_is_seen_beside_supports():
    model = brick(held=lambda points: points[:, 0] < 1e-9)
    assert softening_within(model) == 0.0
    model.stiffness = model.stiffness - softening(model, Spin(2 * np.pi * 17.0, np.zeros(3), OBLIQUE))
    assert softening_within(model) == pytest.approx(17.0, rel=1e-6)


# --- CalculiX -------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def beam(tmp_path_factory):
    """CalculiX matrices of a cantilever along z that turns about y: at rest, stiffened, and softened as well."""
    folder = tmp_path_factory.mktemp("beam")
    shape = np.array([-WIDTH / 2, -HEIGHT / 2, RADIUS])
    body = synthetic.block("C3D20", (2, 1, 12), (WIDTH, HEIGHT, LENGTH), lambda points: points + shape)
    write_mesh(folder / "mesh.inp", body, {"root": np.flatnonzero(body.points[:, 2] < RADIUS + 1e-6)})
    load = f"*DLOAD\nbody, CENTRIF, {(2 * np.pi * CALCULIX_HZ) ** 2:.17g}, 0., 0., 0., 0., 1., 0.\n"
    matrices = "*FREQUENCY, SOLVER=MATRIXSTORAGE\n1\n"
    steps = {
        "rest": f"*STEP\n{matrices}*END STEP\n",
        "both": f"*STEP\n*STATIC\n{load}*END STEP\n*STEP, PERTURBATION\n{matrices}*END STEP\n",
        "stiffened": f"*STEP\n*STATIC\n{load}*END STEP\n*STEP, PERTURBATION\n{matrices}*DLOAD, OP=NEW\n*END STEP\n",
    }
    for name, text in steps.items():
        solve(folder, name, "*BOUNDARY\nroot, 1, 3\n" + text)
    return folder


def lowest(model, count=2):
    return eigh(model.stiffness.toarray(), model.mass.toarray(), eigvals_only=True, subset_by_index=[0, count - 1])


def test_a_rotating_beam_stiffens_as_southwell_says_and_softens_in_its_plane_by_the_square_of_the_speed(beam):
    """omega^2 = omega_0^2 + (1.193 + 1.571 r/L - c) Omega^2, c = 0 for flapping along the axis, 1 across it."""
    rest = lowest(beam_model(beam, "rest"))
    both = beam_model(beam, "both", holds=["stress_stiffening", "spin_softening"], spin_hz=CALCULIX_HZ)
    model = beam_model(beam, "stiffened", holds=["stress_stiffening"], spin_hz=CALCULIX_HZ)
    spin = Spin(2 * np.pi * CALCULIX_HZ, np.zeros(3), np.array([0.0, 1.0, 0.0]))
    flap, lag = (lowest(model) - rest) / spin.omega**2
    # Southwell's coefficient is of the mode at rest: an upper bound, and a good one while the mode keeps its shape.
    coefficient = 1.193 + 1.571 * RADIUS / LENGTH
    assert flap == pytest.approx(coefficient, rel=0.03) and lag == pytest.approx(coefficient, rel=0.03)
    model.stiffness = model.stiffness - softening(model, spin)
    softened = (lowest(model) - rest) / spin.omega**2
    assert softened[0] == pytest.approx(flap, rel=1e-4) and softened[1] == pytest.approx(lag - 1.0, rel=1e-4)
    # CalculiX's own centrifugal stiffness is Omega^2 P M P to the 14 digits of its files.
    assert abs(model.stiffness - both.stiffness).max() < 5e-14 * abs(both.stiffness).max()
    assert lowest(model) == pytest.approx(lowest(both), rel=1e-6)


def test_calculix_softening_that_the_user_does_not_tell_of_is_a_fault(beam):
    for holds, spin_hz, said in (
        ([], None, "rigid translations show that of 150 Hz"),
        (["stress_stiffening"], CALCULIX_HZ, "expected spin_softening as well"),
        (["spin_softening"], 140.0, "spin_hz = 140.0: expected 150"),
        (["spin_softening"], None, "spin_hz is missing"),
        (["softening"], 1.0, "holds = 'softening': expected a list of stress_stiffening, spin_softening"),
        ([], 1.0, "no speed for a stiffness that holds nothing of it"),
    ):
        with pytest.raises(InputError, match="import") as raised:
            beam_model(beam, "both", holds=holds, spin_hz=spin_hz)
        assert said in str(raised.value)


def test_a_geometric_stiffness_is_added_once(beam):
    from scipy.io import mmwrite

    at_rest, stiffened = (
        beam_model(beam, "rest"),
        beam_model(beam, "stiffened", holds=["stress_stiffening"], spin_hz=CALCULIX_HZ),
    )
    path = beam / "geometric.mtx"
    mmwrite(path, (stiffened.stiffness - at_rest.stiffness).tocoo(), precision=17)
    model = beam_model(beam, "rest", geometric_stiffness=path, spin_hz=CALCULIX_HZ)
    assert model.stiffness_holds == ("stress_stiffening",)
    assert abs(model.stiffness - stiffened.stiffness).max() < 1e-14 * abs(stiffened.stiffness).max()
    with pytest.raises(InputError, match="hold stress stiffening already"):
        beam_model(beam, "stiffened", holds=["stress_stiffening"], geometric_stiffness=path)


# --- Forces and pressures by file -----------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_pressure_all_round_a_body_adds_up_to_nothing(tmp_path, kind):
    model = synthetic.assemble([synthetic.block(kind, (2, 1, 1), shape=bent)], {}, seed=3)
    count = len(next(iter(model.elements.values()))[0])
    faces = 4 if kind in ("C3D4", "C3D10") else 6
    # On every face of every element: inner faces cancel each other, too.
    deck = f"*ELSET, ELSET=all, GENERATE\n1, {count}\n*DLOAD\n" + "".join(f"all, P{n + 1}, 2.5\n" for n in range(faces))
    (tmp_path / "all.inp").write_text(deck)
    force = deck_force(tmp_path / "all.inp", model)[0].reshape(-1, 3)
    assert np.abs(force.sum(axis=0)).max() < 1e-13 * np.abs(force).max() * len(force)
    moment = np.cross(positions(model), force)
    assert np.abs(moment.sum(axis=0)).max() < 1e-13 * np.abs(moment).max() * len(force)


@pytest.mark.parametrize("kind", KINDS)
def test_pressure_on_one_end_has_the_force_and_moment_of_a_uniform_one(tmp_path, kind):
    """The resultant of -p n dA over a closed body is zero, so that of a cap follows from its flat opposite."""
    body = synthetic.block(kind, (2, 2, 1), (1.0, 2.0, 0.5))
    model = synthetic.assemble([body], {}, seed=3)
    (kind_ids, connectivity), top = next(iter(model.elements.values())), 0.5
    from attrito.model.surfaces import FACES

    height = dict(zip(model.node_ids.tolist(), model.coordinates[:, 2].tolist(), strict=True))
    lines = [
        f"{element}, P{number}, 3.0"
        for element, nodes in zip(kind_ids, connectivity, strict=True)
        for number, face in enumerate(FACES[kind], start=1)
        if all(abs(height[nodes[place]] - top) < 1e-9 for place in face)
    ]
    (tmp_path / "top.inp").write_text("*DLOAD\n" + "\n".join(lines))
    force = deck_force(tmp_path / "top.inp", model)[0].reshape(-1, 3)
    assert force.sum(axis=0) == pytest.approx([0.0, 0.0, -3.0 * 2.0], abs=1e-13)
    moment = np.cross(positions(model), force).sum(axis=0)
    assert moment == pytest.approx(np.cross([0.5, 1.0, 0.5], [0.0, 0.0, -6.0]), abs=1e-13)


@pytest.mark.parametrize("kind", KINDS)
def test_forces_and_pressures_are_those_of_calculix(tmp_path, kind):
    """Where nothing is held the forces of the stresses, as CalculiX prints them, balance the loads to seven digits."""
    body = synthetic.block(kind, (1, 2, 1), (1.0, 2.0, 0.7))
    write_mesh(tmp_path / "mesh.inp", body, {"all": np.arange(len(body.points)), "some": [0, 3], "base": [0, 1, 2]})
    faces = 4 if kind in ("C3D4", "C3D10") else 6
    loads = "*CLOAD\nsome, 2, 1.5\n4, 1, -0.5\n*DLOAD\n" + "".join(
        f"{n % 2 + 1}, P{n + 1}, {n + 1}.\n" for n in range(faces)
    )
    (tmp_path / "loads.inp").write_text(loads)
    solve(tmp_path, "held", f"*BOUNDARY\nbase, 1, 3\n*STEP\n*STATIC\n{loads}*NODE PRINT, NSET=all\nRF\n*END STEP\n")
    rows = [line.split() for line in (tmp_path / "held.dat").read_text().splitlines() if line.strip()]
    reactions = np.array([[float(word) for word in row[1:]] for row in rows if len(row) == 4 and row[0].isdigit()])
    model = synthetic.assemble([body], {})
    model.node_ids, model.dof_node = model.node_ids - 100, model.dof_node - 100
    model.elements = {name: (ids, nodes - 100) for name, (ids, nodes) in model.elements.items()}
    model.node_sets = {"some": np.array([1, 4])}
    force = deck_force(tmp_path / "loads.inp", model)[0].reshape(-1, 3)
    assert force[3:] == pytest.approx(reactions[3:], abs=2e-6 * np.abs(reactions).max())


def test_forces_by_numbers_lists_and_files_are_one_and_the_same(tmp_path):
    model = brick(held=lambda points: points[:, 0] < 1e-9)
    node = int(model.node_sets["high"][0])
    dof = int(np.flatnonzero((model.dof_node == node) & (model.dof_direction == 3))[0])
    vector = np.zeros(model.size)
    vector[dof] = -2.5
    np.save(tmp_path / "force.npy", vector)
    np.savetxt(tmp_path / "force.txt", vector)
    (tmp_path / "force.inp").write_text(f"*CLOAD\n{node}, 3, -1.5\nlast, 3, -1.0\n*NSET, NSET=last\n{node}")
    with pytest.raises(InputError, match="last"):
        deck_force(tmp_path / "force.inp", model)
    (tmp_path / "force.inp").write_text(f"*NSET, NSET=last\n{node}\n*CLOAD\n{node}, 3, -1.5\nLast, 3, -1.0\n")
    for name in ("force.npy", "force.txt", "force.inp"):
        harmonic = {"kind": "harmonic", "harmonic": 1, "cosine": [[["node", node, "z"], -2.5]], "sine": name}
        scene = scene_of(tmp_path, model, job({"name": "push", "kind": "static", "file": name}, harmonic))
        assert np.array_equal(scene.static["push"], vector)
        assert np.array_equal(scene.harmonic[2], vector)
        assert np.array_equal(scene.harmonic[1] - scene.harmonic[2], np.eye(model.size)[0])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("*CLOAD\n1, 3\n", "line 1, *CLOAD = '1, 3': expected node or node set, direction 1, 2 or 3, force"),
        ("*CLOAD\nnowhere, 3, 1.0\n", "'nowhere': expected a node or node set of the model: HIGH, LOW"),
        ("*CLOAD\n9999, 3, 1.0\n", "'node 9999': expected a node of the model"),
        ("*CLOAD\nlow, 4, 1.0\n", "'low, 4, 1.0': expected a direction 1, 2 or 3"),
        ("*CLOAD\nlow, 1, inf\n", "'low, 1, inf': expected a finite number"),
        ("*CLOAD, AMPLITUDE=ramp\nlow, 1, 1.0\n", "expected *CLOAD without parameters"),
        ("*CLOAD, FOLLOWER\nlow, 1, 1.0\n", "expected *CLOAD without parameters"),
        (
            "*CLOAD, OP=MOD\nlow, 1, 1.0\n*CLOAD, OP=NEW\nlow, 2, 1.0\n",
            "line 3, *CLOAD = 'OP': expected *CLOAD without",
        ),
        ("*DLOAD\n1, P7, 1.0\n", "'P7 on element 1': expected a face that the element has"),
        ("*DLOAD\n77, P1, 1.0\n", "'element 77': expected an element of the model"),
        (
            "*DLOAD\n1, CENTRIF, 1.0\n",
            "expected a pressure P1 to P6 (rotation: a [[load]] of kind centrifugal; weight: gravity of a static one)",
        ),
        ("*STEP\n*CLOAD\n1, 1, 1.0\n", "expected one of *CLOAD, *DLOAD"),
        ("*NSET, NSET=two\n101, 102\n", "expected a deck with forces or pressures"),
    ],
)
def test_a_faulty_list_of_forces_is_told_with_its_line(tmp_path, text, said):
    (tmp_path / "force.inp").write_text(text)
    harmonic = {"kind": "harmonic", "harmonic": 1, "cosine": "force.inp"}
    assert said in faults_of(tmp_path, brick(), job(harmonic))


def test_json_of_holdings_that_is_none_is_a_fault(tmp_path):
    write_model(tmp_path / "model.h5", brick(), [])
    with edited(tmp_path / "model.h5") as file:
        assert json.loads(file.attrs["stiffness_holds"]) == []
        file.attrs["stiffness_holds"] = '["magic"]'
    with pytest.raises(InputError, match="stiffness_holds"):
        read_model(tmp_path / "model.h5")
