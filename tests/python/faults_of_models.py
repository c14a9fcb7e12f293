"""Faults of what a job refers to: matrices, models with a mesh, contacts and loads on them."""

from __future__ import annotations

from typing import Any

import numpy as np
from fault_cases import Case, both, drop, put
from jobs import blocks, chain, wedge

NAN = float("nan")


def undamped_wedge() -> dict[str, Any]:
    """The wedge without its damping matrix."""
    job = wedge()
    del job["model"]["damping"]
    return job


MODEL = [
    Case(
        "a matrix file that is missing",
        put("model", mass="M.mtx"),
        ("job.toml: [model] mass = 'M.mtx': expected a file that can be read (No such file or directory)",),
    ),
    Case(
        "coefficients of a load whose sum is beyond what numbers hold",
        put("load", 0, dofs=[[1, 1e308], [1, 1e308]]),
        ("job.toml: load preload = 'beyond what numbers hold': expected smaller numbers",),
    ),
    Case(
        "coefficients of a harmonic load, a monitor and a contact likewise",
        both(
            put("load", 1, cosine=[[1, 1e308], [1, 1e308]]),
            put("output", monitors=[{"name": "x", "dofs": [[0, -1e308], [0, -1e308]]}]),
            put("contact", 0, normal=[[0, 1e308], [0, 1e308]]),
        ),
        (
            "job.toml: contact[0] coefficients = 'beyond what numbers hold': expected smaller numbers",
            "job.toml: harmonic loads = 'beyond what numbers hold': expected smaller numbers",
            "job.toml: [output] monitors x = 'beyond what numbers hold': expected smaller numbers",
        ),
    ),
    Case(
        "factors whose damping is beyond what numbers hold",
        put("damping", rayleigh=[0.0, 1e304]),
        ("job.toml: [damping] rayleigh = [0.0, 1e+304]: expected factors whose damping is finite",),
    ),
    Case(
        "a matrix file that holds no matrix",
        put("model", mass="job.toml.bak"),
        ("job.toml: [model] mass = 'job.toml.bak': expected a matrix file: Matrix Market, PETSc binary",),
    ),
    Case(
        "a truncated Matrix Market file",
        put("model", stiffness="truncated.mtx"),
        ("truncated.mtx: [model] stiffness = ", ": expected a Matrix Market file"),
    ),
    Case(
        "a Matrix Market file that ends after its header",
        put("model", stiffness="header.mtx"),
        ("header.mtx: [model] stiffness = 'nothing after the header': expected a Matrix Market file",),
    ),
    Case(
        "a stiffness without its mass",
        drop("model", "mass"),
        ("job.toml: [model] mass is missing: expected a matrix to go with stiffness",),
    ),
    Case(
        "NaN in the mass",
        put("model", mass=[[1.0, 0.0], [0.0, NAN]]),
        ("job.toml: [model]: mass = 'nan at row 1, column 1 (dof 1, dof 1)': expected finite numbers",),
    ),
    Case(
        "NaN in a matrix file",
        put("model", stiffness="nan.mtx"),
        ("nan.mtx: line 5 = '2 2 nan': expected row, column and value, finite numbers",),
    ),
    Case(
        "sizes that do not match",
        put("model", mass=[[1.0]]),
        ("job.toml: [model]: mass = '1 x 1': expected the size of the stiffness, 2 x 2",),
    ),
    Case(
        "a mass that is not square",
        put("model", mass=[[1.0, 0.0]]),
        ("job.toml: [model]: mass = '1 x 2': expected a square matrix",),
    ),
    Case(
        "rows of different lengths",
        put("model", mass=[[1.0, 0.0], [1.0]]),
        ("job.toml: [model] mass = [[1.0, 0.0], [1.0]]: expected rows of numbers, all of one length",),
    ),
    Case(
        "an unsymmetric stiffness",
        put("model", stiffness=[[4.0e5, 1.0e4], [0.0, 2.5e6]]),
        ("job.toml: [model]: stiffness = ", "10000 against 0 at row 0, column 1", ": expected a symmetric matrix"),
    ),
    Case(
        "an unsymmetric mass",
        put("model", mass=[[1.0, 0.0], [0.1, 1.0]]),
        ("job.toml: [model]: mass = ", "against", ": expected a symmetric matrix"),
    ),
    Case(
        "a dof without mass",
        put("model", mass=[[1.0, 0.0], [0.0, 0.0]]),
        ("job.toml: [model]: mass = 'no mass at dof 1': expected mass at every dof, or [reduction], in which",),
    ),
    Case(
        "a negative mass",
        put("model", mass=[[1.0, 0.0], [0.0, -2.0]]),
        ("job.toml: [model]: mass = '-2 at dof 1': expected a diagonal above zero",),
    ),
    Case(
        "a mass with a coupling too large",
        put("model", mass=[[1.0, 1.5], [1.5, 1.0]]),
        ("job.toml: [model]: mass = '1.5 at row 0, column 1 (dof 0, dof 1) and 1 more': expected at most 1,",),
    ),
    Case(
        "a mass that is not positive, found by the library",
        put("model", mass=(1.4 * np.eye(4) - 0.7).tolist()),
        ("job.toml: mass: ", "is not positive definite: expected every dof to carry mass"),
        lambda: chain(contacts=2),
    ),
    Case(
        "contacts that leave a motion free, found by the library",
        put("model", stiffness=np.diag([4.0e5, 2.5e6, 0.0]).tolist(), mass=np.eye(3).tolist()),
        ("job.toml: stiffness: ", "leaves 1 motion(s) free: expected supports or contacts that hold every body"),
        undamped_wedge,
    ),
    Case(
        "a contact on a dof that is not there",
        put("contact", 0, normal=[[0, 1.0], [2, 1.0]]),
        ("job.toml: contact[0] normal = 2: expected a dof of the model: 0 to 1",),
    ),
    Case(
        "a load on a dof that is not there",
        put("load", 0, dofs=[[7, 420.0]]),
        ("job.toml: load[0] dofs = 7: expected a dof of the model: 0 to 1",),
    ),
    Case(
        "a monitor on a dof that is not there",
        put("output", monitors=[{"name": "z", "dofs": [[2, 1.0]]}]),
        ("job.toml: [output] monitors[0] = 2: expected a dof of the model: 0 to 1",),
    ),
    Case(
        "a negative dof",
        put("load", 0, dofs=[[-1, 420.0]]),
        ('job.toml: load[0] dofs = [[-1, 420.0]]: expected a dof: a number from 0, or ["node", id, "x"]',),
    ),
    Case(
        "a node on a model without mesh",
        put("load", 0, dofs=[[["node", 812, "x"], 1.0]]),
        (
            'job.toml: load[0] dofs = \'["node", 812, "x"]\': expected a dof\'s number, since the model does not '
            "name its nodes",
        ),
    ),
    Case(
        "a contact row of zeros",
        put("contact", 0, normal=[[0, 1.0], [0, -1.0]]),
        ("job.toml: contact[0] normal = [[0, 1.0], [0, -1.0]]: expected a coefficient that is not zero",),
    ),
    Case(
        "a centrifugal load on a model without mesh",
        put("load", 0, kind="centrifugal", speed_hz=9.0, axis_point=[0.0] * 3, axis_direction=[0.0, 0.0, 1.0], dofs=[]),
        ("job.toml: load[0]",),
    ),
    Case(
        "a load file of another size",
        lambda job: job["load"].__setitem__(0, {"name": "preload", "kind": "static", "file": "load.txt"}),
        ("load.txt: contents = 'shape (3,)': expected 2 finite numbers, one for each dof",),
    ),
    Case(
        "too many dofs to be used as they stand",
        put("model", mass="large.mtx", stiffness="large.mtx", damping="large.mtx"),
        ("job.toml: [reduction] is missing: expected a reduction: 5000 dofs are too many",),
    ),
]

MESH = [
    Case(
        "a model file that is missing",
        put("model", file="modle.h5"),
        ("modle.h5: file = ", ": expected a file"),
    ),
    Case(
        "a model file that is a text",
        put("model", file="job.toml.bak"),
        ("job.toml.bak: file = ", ": expected a file that attrito import has written, intact"),
    ),
    Case(
        "a model file that is another HDF5 file",
        put("model", file="other.h5"),
        ('other.h5: format is missing: expected "attrito model", a file written by attrito import',),
    ),
    Case(
        "a model file with NaN",
        put("model", file="nan.h5"),
        ("nan.h5: mass = 'nan at row 0, column 0 (dof 0, dof 0)': expected finite numbers",),
    ),
    Case(
        "a model file beside a matrix",
        put("model", mass="M.mtx"),
        ("job.toml: [model] file = 'model.h5': expected no matrices beside a model file",),
    ),
    Case(
        "a result that would overwrite the model",
        put("output", file="model.h5"),
        ("job.toml: [output] file = 'model.h5': expected a file other than that of [model] file",),
    ),
    Case(
        "a reduced model that would overwrite the model",
        put("reduction", file="model.h5"),
        ("job.toml: [reduction] file = 'model.h5': expected a file other than that of [model] file",),
    ),
    Case(
        "a node that is not in the model",
        put("load", 0, dofs=[[["node", 99999, "z"], 1.0]]),
        ('job.toml: load[0] dofs = \'["node", 99999, "z"]\': expected a node of the model',),
    ),
    Case(
        "a node that is held",
        put("load", 0, dofs=[[["node", 101, "z"], 1.0]]),
        ('job.toml: load[0] dofs = \'["node", 101, "z"]\': expected a free dof (this one is held)',),
    ),
    Case(
        "a direction that is none",
        put("load", 0, dofs=[[["node", "tip", "r"], 1.0]]),
        ("job.toml: load[0] dofs = ", 'expected a dof: a number from 0, or ["node", id, "x"]'),
    ),
    Case(
        "a set of many nodes where one is wanted",
        put("load", 0, dofs=[[["node", "top", "z"], 1.0]]),
        ('job.toml: load[0] dofs = \'["node", "top", "z"]\': expected a node id, or a node set of one node: tip',),
    ),
    Case(
        "an unknown node set",
        put("contact_set", 0, b="botom"),
        ("job.toml: contact_set[0].b = 'botom': expected \"ground\" or a node set of the model (bottom, empty, held,",),
    ),
    Case(
        "an empty node set",
        put("contact_set", 0, a="empty"),
        ("job.toml: contact_set[0].a = 'empty': expected a node set that has nodes",),
    ),
    Case(
        "the same nodes on both sides of a contact",
        put("contact_set", 0, b="top"),
        ("job.toml: contact_set[0].b = 'top (nodes ", ": expected a node set without nodes of top"),
    ),
    Case(
        "pairs out of tolerance",
        put("contact_set", 0, a="bottom", b="tip"),
        (
            "job.toml: contact_set[0].tolerance = 0.001: expected a distance that pairs nodes of bottom and tip;",
            "the closest are 1 apart",
        ),
    ),
    Case(
        "a negative tolerance",
        put("contact_set", 0, tolerance=-1.0),
        ("job.toml: contact_set[0] tolerance = -1.0: expected a number of at least 0",),
    ),
    Case(
        "three tangents",
        put("contact_set", 0, tangents=3),
        ("job.toml: contact_set[0] tangents = 3: expected an integer from 1 to 2",),
    ),
    Case(
        "a contact set on a model without mesh",
        lambda job: job.update(model=wedge()["model"], damping={}),
        ("job.toml: contact_set[0] a = 'top': expected a model with a mesh: node sets need one",),
    ),
    Case(
        "a node that is nowhere",
        put("model", file="nowhere.h5"),
        ("nowhere.h5: nodes/coordinates = 'nan at (2, 1)': expected finite numbers",),
    ),
    Case(
        "an unknown set among the boundary",
        put("reduction", boundary=["tip", "tipp"]),
        ("job.toml: [reduction] boundary[1] = 'tipp': expected a node set or node of the model: bottom, empty, held,",),
    ),
    Case(
        "an unknown set among those to recover",
        put("reduction", recovery=["tip", "tipp"]),
        ("job.toml: [reduction] recovery[1] = 'tipp': expected a node set of the model: bottom, empty, held,",),
    ),
    Case(
        "an unknown word for what to recover",
        put("reduction", recovery="some"),
        ('job.toml: [reduction] recovery = \'some\': expected one of "all", "monitors", "none", or a list',),
    ),
    Case(
        "more modes than interior dofs",
        put("reduction", modes=500),
        ("job.toml: [reduction] modes = 500: expected at most 27, the number of interior dofs",),
    ),
    Case(
        "a body that floats with the boundary held, found by the library",
        put("model", file="floating.h5"),
        ("job.toml: ", "a rigid motion or mechanism stays free with the boundary held"),
    ),
]

MESH = [Case(case.sentence, case.change, case.messages, blocks) for case in MESH]
