"""Weight, and a base that shakes, as loads on the motion relative to it."""

from __future__ import annotations

import numpy as np
import pytest
import synthetic
from bricks import brick, centrifugal, faults_of, job, scene_of
from jobs import Job, table, wedge, write_job
from jobs import run as run_job
from scipy.sparse import csr_matrix, identity
from wheels import lumped_sector

ACCELERATION = np.array([3.0, -4.0])
SPRING_HZ = 50.0


def shaken_wedge(**load) -> Job:
    """The wedge on a base that shakes both ways, with part of it twice as fast."""
    shaken = wedge()
    both = [
        {"kind": "harmonic", "base_cosine": [[0, ACCELERATION[0]], [1, ACCELERATION[1]]], "base_sine": [[0, 1.0]]},
        {"kind": "harmonic", "harmonic": 2, "base_sine": [[1, 20.0]]},
    ]
    shaken["load"] = [shaken["load"][0], *both]
    shaken["balance"] = {"harmonics": 5, "residual_tolerance": 1e-12}
    return shaken


def wedge_on_a_heavy_body() -> Job:
    """The same in axes that stand still: springs, dampers and contact on a body so heavy that it moves as it is driven.

    Its mass is 1e9 times the wedge's, so that the wedge's forces change its acceleration by 1e6 / (1e9 omega^2) = 2e-9;
    the springs that keep it in its place have 0.01 Hz, (0.01/132)^2 = 6e-9.
    """
    heavy, kept = 1.0e9, 1.0e9 * (2 * np.pi * 0.01) ** 2
    driven = shaken_wedge()
    model = driven["model"]
    for name, own in (("mass", heavy), ("stiffness", kept), ("damping", 0.0)):
        matrix = np.array(model[name])
        between = np.zeros((2, 2)) if name == "mass" else matrix
        model[name] = np.block([[matrix, -between], [-between, between + own * np.eye(2)]]).tolist()
    contact = driven["contact"][0]
    across = [[dof + 2, -value] for dof, value in contact["normal"]]
    along = [[dof + 2, -value] for dof, value in contact["tangents"][0]]
    contact["normal"], contact["tangents"] = contact["normal"] + across, [contact["tangents"][0] + along]
    # The preload pushes back on the body.
    driven["load"] = [
        {"name": "preload", "kind": "static", "dofs": [[1, 420.0], [3, -420.0]]},
        {
            "kind": "harmonic",
            "cosine": [[2, heavy * ACCELERATION[0]], [3, heavy * ACCELERATION[1]]],
            "sine": [[2, heavy]],
        },
        {"kind": "harmonic", "harmonic": 2, "sine": [[3, heavy * 20.0]]},
    ]
    monitors = [{"name": "x", "dofs": [[0, 1.0], [2, -1.0]]}, {"name": "y", "dofs": [[1, 1.0], [3, -1.0]]}]
    driven["output"]["monitors"] = monitors
    return driven


def test_motion_relative_to_a_shaken_base_is_that_on_a_heavy_body_that_is_driven(tmp_path):
    values = []
    for name, one in (("base", shaken_wedge()), ("body", wedge_on_a_heavy_body())):
        (tmp_path / name).mkdir()
        run_job(tmp_path / name, one)
        (row,) = table(tmp_path / name)
        values.append([float(row[key]) for key in ("x_amplitude", "y_amplitude", "y_mean")])
        (contact,) = table(tmp_path / name, "--contacts")
        assert min(float(contact[key]) for key in ("stick", "slip", "open")) > 0.1
    # A resonance multiplies the 1e-8 of the body's motion by its quality, some 10.
    assert values[0] == pytest.approx(values[1], rel=1e-6)


def test_the_load_of_masses_is_their_weight_times_the_acceleration(tmp_path):
    model = synthetic.assemble([synthetic.block("C3D8", (1, 1, 1))], {}, seed=2)
    model.elements = {}
    model.mass = csr_matrix(2.0 * identity(model.size))
    model.stiffness = csr_matrix(2.0 * (2 * np.pi * SPRING_HZ) ** 2 * identity(model.size))
    description = job()
    del description["contact_set"], description["reduction"]
    first = int(model.node_ids.min())
    law = {"normal_stiffness": 1.0, "tangential_stiffness": 1.0, "friction_coefficient": 0.3}
    rows = {"normal": [[["node", first, "x"], 1.0]], "tangents": [[[["node", first, "y"], 1.0]]]}
    description["contact"] = [rows | law]
    description["load"] = [{"kind": "harmonic", "base_cosine": [1.0, 2.0, 3.0], "base_sine": [0.0, -0.5, 0.0]}]
    harmonic = scene_of(tmp_path, model, description).harmonic
    along = np.asarray(model.dof_direction, dtype=int) - 1
    assert harmonic[1] == pytest.approx(-2.0 * np.array([1.0, 2.0, 3.0])[along])
    assert harmonic[2] == pytest.approx(-2.0 * np.array([0.0, -0.5, 0.0])[along])


def beside_support(whole, model, moves: np.ndarray) -> np.ndarray:
    """Sums of the rows of the whole body's mass, held dofs included, at the dofs of a model that has none of these."""
    row = {place: i for i, place in enumerate(zip(whole.dof_node, whole.dof_direction, strict=True))}
    own = [row[place] for place in zip(model.dof_node, model.dof_direction, strict=True)]
    sums = whole.mass @ (np.asarray(whole.dof_direction) == 3).astype(float)
    return np.where(moves, sums[own], 0.0)


def test_an_elastic_body_is_pushed_by_its_mass_and_what_it_shares_with_the_support(tmp_path):
    model, whole = brick(held=lambda points: points[:, 0] < 1e-9), brick()
    description = job()
    description["load"] = [{"kind": "harmonic", "base_cosine": [0.0, 0.0, 9.81]}]
    harmonic = scene_of(tmp_path, model, description).harmonic
    upward = np.asarray(model.dof_direction) == 3
    assert harmonic[1] @ upward == pytest.approx(-9.81 * beside_support(whole, model, upward).sum())
    assert np.abs(harmonic[1][~upward]).max() < 1e-12 * np.abs(harmonic[1]).max()


def base(**keys):
    return {"kind": "harmonic"} | (keys or {"base_cosine": [0.0, 0.0, 1.0]})


@pytest.mark.parametrize(
    ("loads", "said"),
    [
        ([base(base_cosine=[0.0, 0.0, 0.0])], "load[0] base_cosine = [0.0, 0.0, 0.0]: expected an acceleration that"),
        ([base(base_cosine=[])], "load[0] base_cosine = []: expected a list of 3 numbers, along x, y, z, or of pairs"),
        ([base(base_cosine=[1.0, 0.0])], "load[0] base_cosine = [1.0, 0.0]: expected a list of 3 numbers"),
        (
            [base(), base() | {"kind": "static", "name": "s", "dofs": [[0, 1.0]]}],
            "no such key on a load of kind static",
        ),
        (
            [centrifugal(), base(base_sine=[1.0, 0.0, 0.0])],
            "load[1] base_sine = [1.0, 0.0, 0.0]: expected along [0.0, 0.0, 1.0], the axis of load[0]",
        ),
    ],
)
def test_a_base_motion_that_is_none_or_has_other_frequencies_where_it_turns_is_a_fault(tmp_path, loads, said):
    description = job()
    description["load"] = loads
    assert said in faults_of(tmp_path, brick(held=lambda points: points[:, 0] < 1e-9), description)


def test_weight_is_mass_times_gravity_and_no_load_has_two_of_its_kinds(tmp_path):
    model, whole = brick(held=lambda points: points[:, 0] < 1e-9), brick()
    weight = {"kind": "static", "name": "weight", "gravity": [0.0, 0.0, -9.81]}
    force = scene_of(tmp_path, model, job(weight)).static["weight"]
    upward = np.asarray(model.dof_direction) == 3
    assert force == pytest.approx(-9.81 * beside_support(whole, model, upward))
    said = "expected either dofs or file or gravity"
    assert said in faults_of(tmp_path, model, job(weight | {"dofs": [[0, 1.0]]}))
    turning = job(centrifugal(), weight | {"gravity": [0.0, 9.81, 0.0]})
    assert "the axis of load[0]: in axes that turn, weight across is not steady" in faults_of(tmp_path, model, turning)


def test_a_body_that_nothing_holds_does_not_feel_the_base(tmp_path):
    description = job()
    description["load"] = [base()]
    # The high end lies on the ground along x, and slides along z with friction: that holds it.
    scene_of(tmp_path, brick(), description)
    description["contact_set"][0]["b"] = "low"
    description["contact_set"][0]["tolerance"] = 1.0
    assert "a structure that something holds along it" in faults_of(tmp_path, brick(), description)


def test_a_model_without_directions_is_told_the_motion_of_its_dofs(tmp_path):
    description = shaken_wedge()
    description["load"][1] = base()
    with pytest.raises(AssertionError, match=r"pairs \[dof, acceleration\], since the model does not say where"):
        run_job(tmp_path, description)


def test_a_base_takes_all_sectors_of_a_wheel_along(tmp_path):
    description = lumped_sector()
    description["load"] = [load for load in description["load"] if load["kind"] != "harmonic"]
    description["load"] += [base(base_cosine=[[0, 1.0]])]
    write_job(tmp_path, description)
    with pytest.raises(AssertionError, match=r"\[cyclic\] engine_order 0, not 2: the base takes all sectors along"):
        run_job(tmp_path, description)
