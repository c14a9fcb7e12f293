"""Faults of `[cyclic]` and of contacts across a sector's boundary."""

from __future__ import annotations

from dataclasses import replace

from fault_cases import Case, both, drop, put
from wheels import lumped_sector

NUMBERS = [
    Case(
        "no sectors",
        put("cyclic", sectors=0),
        ("job.toml: [cyclic] sectors = 0: expected an integer from 1 to 2147483647",),
    ),
    Case(
        "sectors that are no integer",
        put("cyclic", sectors=5.5),
        ("job.toml: [cyclic] sectors = 5.5: expected an integer",),
    ),
    Case(
        "an engine order that is no integer",
        put("cyclic", engine_order=1.5),
        ("job.toml: [cyclic] engine_order = 1.5: expected an integer from -1000000 to 1000000",),
    ),
    Case(
        "a wheel without an engine order",
        drop("cyclic", "engine_order"),
        ("job.toml: [cyclic] engine_order is missing: expected this key to be given",),
    ),
    Case(
        "an axis without a direction",
        put("cyclic", axis_direction=[0.0, 0.0, 0.0]),
        ("job.toml: [cyclic] axis_direction = [0.0, 0.0, 0.0]: expected a vector that is not zero",),
    ),
]
SPINS = [
    Case(
        "a wheel that turns about another axis",
        both(
            put("cyclic", axis_point=[0.0, 0.0, 0.0], axis_direction=[0.0, 0.0, 2.0]),
            lambda job: job["load"].append(
                {
                    "kind": "centrifugal",
                    "speed_hz": 10.0,
                    "axis_point": [0.1, 0.0, 5.0],
                    "axis_direction": [0.0, 1e-3, 1.0],
                }
            ),
        ),
        (
            "job.toml: load[1] axis_direction = [0.0, 0.001, 1.0]: expected [0.0, 0.0, 2.0], the axis_direction",
            "job.toml: load[1] axis_point = [0.1, 0.0, 5.0]: expected a point of the axis of [cyclic], which",
        ),
    ),
]
BOUNDARIES = [
    Case(
        "interface modes of a sector that is not reduced",
        put("cyclic", interface_modes="auto"),
        ("job.toml: [cyclic] interface_modes = 'auto': expected \"all\" without [reduction] or without lower and",),
    ),
    Case(
        "no interface modes at all",
        put("cyclic", interface_modes=0),
        ("job.toml: [cyclic] interface_modes = 0: expected",),
    ),
    Case(
        "boundaries of unequal length",
        put("cyclic", upper=[3, 1]),
        ("job.toml: [cyclic] upper = '2 dofs': expected 1 dofs, one for each of lower",),
    ),
    Case(
        "one boundary without the other",
        drop("cyclic", "upper"),
        ("job.toml: [cyclic] upper is missing: expected this key, to go with lower",),
    ),
    Case(
        "a dof of both boundaries",
        put("cyclic", upper=[2]),
        ("job.toml: [cyclic] upper = 2: expected dofs that are not in lower; those of a node on the axis go into",),
    ),
    Case(
        "a distance of nodes between lists of dofs",
        put("cyclic", tolerance=1e-3),
        ("job.toml: [cyclic] tolerance = 0.001: expected no such key without node sets",),
    ),
    Case(
        "a node on the axis that a boundary has too",
        put("cyclic", on_axis=[[0, 1], [3]]),
        ("job.toml: [cyclic] on_axis = 'dof 3': expected dofs that are in no other place of [cyclic]",),
    ),
    Case(
        "a node on the axis with four dofs",
        put("cyclic", on_axis=[[0, 1, 2, 3]]),
        ("job.toml: [cyclic] on_axis = [[0, 1, 2, 3]]: expected a list of 1 to 3 items, not [0, 1, 2, 3], as item 0",),
    ),
    Case(
        "nodes on the axis beside node sets",
        put(
            "cyclic",
            lower="low",
            upper="high",
            on_axis=[[0]],
            axis_point=[0.0, 0.0, 0.0],
            axis_direction=[0.0, 0.0, 1.0],
        ),
        ("job.toml: [cyclic] on_axis = 'given': expected no such key beside node sets, whose nodes on the axis are",),
    ),
    Case(
        "a dof that a boundary has twice",
        put("cyclic", lower=[2, 2], upper=[3, 1]),
        ("job.toml: [cyclic] lower = 2: expected dofs that differ",),
    ),
    Case(
        "a boundary on a dof that is not there",
        put("cyclic", upper=[7]),
        ("job.toml: [cyclic] upper = 7: expected a dof of the model: 0 to 3",),
    ),
    Case(
        "a boundary of dofs and one of nodes",
        put("cyclic", upper="high"),
        ("job.toml: [cyclic] upper = 'high': expected a node set or a list of dofs, as lower is",),
    ),
    Case(
        "node sets without an axis",
        put("cyclic", lower="low", upper="high"),
        (
            "job.toml: [cyclic] axis_point is missing: expected this key, since node sets are turned about the axis",
            "job.toml: [cyclic] axis_direction is missing: expected this key, since node sets are turned",
        ),
    ),
    Case(
        "one node set as both boundaries",
        put("cyclic", lower="low", upper="low", axis_point=[0.0, 0.0, 0.0], axis_direction=[0.0, 0.0, 1.0]),
        ("job.toml: [cyclic] upper = 'low': expected a node set other than lower",),
    ),
    Case(
        "node sets of a model without a mesh",
        put("cyclic", lower="low", upper="high", axis_point=[0.0, 0.0, 0.0], axis_direction=[0.0, 0.0, 1.0]),
        ("job.toml: [cyclic] lower = 'low': expected a list of dofs, or a model with a mesh: node sets need one",),
    ),
]
CONTACTS = [
    Case(
        "a contact across that lacks its tangents on the next sector",
        drop("contact", 0, "tangents_next"),
        ("job.toml: contact[0] tangents_next is missing: expected this key, to go with normal_next",),
    ),
    Case(
        "a contact across with more tangents on the next sector",
        put("contact", 0, tangents_next=[[[1, 1.0]], [[0, 1.0]]]),
        ("job.toml: contact[0] tangents_next = 2: expected 1, one for each of tangents",),
    ),
    Case(
        "a contact to the next sector of a model that is no sector",
        drop("cyclic"),
        (
            "job.toml: contact[0] normal_next = 'given': expected a table [cyclic], which says what the next sector is",
            "job.toml: contact[0] tangents_next = 'given': expected a table [cyclic]",
        ),
    ),
    Case(
        "a contact on a dof that the next sector does not have",
        put("contact", 0, normal_next=[[4, -1.0]]),
        ("job.toml: contact[0] normal_next = 4: expected a dof of the model: 0 to 3",),
    ),
    Case(
        "a contact across to the ground",
        both(
            put("cyclic", axis_point=[0.0, 0.0, 0.0], axis_direction=[0.0, 0.0, 1.0]),
            lambda job: job.update(
                contact_set=[
                    {
                        "a": "tip",
                        "b": "ground",
                        "across": True,
                        "tolerance": 1.0,
                        "tangential_stiffness": 1.0,
                        "normal_stiffness": 1.0,
                        "friction_coefficient": 0.3,
                    }
                ]
            ),
        ),
        ("job.toml: contact_set[0] across = True: expected false on the ground, which is of no sector",),
    ),
]
NOT_TAKEN = [
    Case(
        "a sector whose orbit in time is examined",
        put("stability", method="monodromy", orbit="exact"),
        ('job.toml: [stability] orbit = \'exact\': expected "balance" or "auto", which here is the same',),
    ),
]


def turning(name):
    """Add a centrifugal load."""

    def change(job):
        load = {"name": name, "kind": "centrifugal", "speed_hz": 10.0, "axis_point": [0.0, 0.0, 0.0]}
        job["load"].append(load | {"axis_direction": [0.0, 0.0, 1.0]})

    return change


SKEW = [[0.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 2.0, 0.0], [0.0, -2.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0]]
CORIOLIS = [
    Case(
        "Coriolis forces of no speed",
        put("cyclic", coriolis=True),
        (
            "job.toml: [cyclic] coriolis = True: expected false without a [[load]] of kind centrifugal, whose speed"
            " they are of, or [model] gyroscopic",
        ),
    ),
    Case(
        "Coriolis forces of a speed that is not reached",
        both(put("cyclic", coriolis=True), turning("spin"), put("static", load_path=[0.0, 0.5])),
        (
            "job.toml: [static] load_path[1] = 0.5: expected 1 at the end for spin: the Coriolis forces are of its"
            " speed_hz",
        ),
    ),
    Case(
        "Coriolis forces of two speeds",
        both(put("cyclic", coriolis=True), turning("spin"), turning("more")),
        (
            "job.toml: load[2] kind = 'centrifugal': expected one centrifugal load with Coriolis forces, which are of"
            " its speed",
        ),
    ),
    Case(
        "a matrix of Coriolis forces that nobody asks for",
        put("model", gyroscopic=SKEW),
        ("job.toml: [cyclic] coriolis = False: expected true, to go with [model] gyroscopic",),
    ),
    Case(
        "a speed of no matrix",
        put("model", gyroscopic_hz=10.0),
        ("job.toml: [model] gyroscopic_hz = 10.0: expected no such key without gyroscopic",),
    ),
    Case(
        "a matrix of Coriolis forces that is not skew",
        both(put("cyclic", coriolis=True), put("model", gyroscopic=[[abs(x) for x in row] for row in SKEW])),
        (
            "job.toml: [model] gyroscopic = '2 and 2 at (1, 2) and its mirror image': expected a skew matrix, G^T = -G"
            " (to 1e-09 of its largest entry)",
        ),
    ),
    Case(
        "a matrix of Coriolis forces of another size",
        both(put("cyclic", coriolis=True), put("model", gyroscopic=[[0.0, 1.0], [-1.0, 0.0]])),
        ("job.toml: [model] gyroscopic = '2 x 2': expected",),
    ),
    Case(
        "a nonlinear mode with Coriolis forces",
        both(
            put("cyclic", coriolis=True),
            put("model", gyroscopic=SKEW),
            put("mode", start=1e-3, stop=1e-2),
        ),
        ("job.toml: [mode] method = 'epmc': expected no table [mode]: modes are followed without Coriolis forces",),
    ),
]

SECTOR = [replace(case, base=lumped_sector) for case in NUMBERS + SPINS + BOUNDARIES + CONTACTS + NOT_TAKEN + CORIOLIS]
