"""Faulty input: exit code 2, one message with file, key, value and what was expected; no result is touched."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.io
from jobs import attrito, attrito_here, blocks, chain, run, toml, wedge, write_blocks
from scipy.sparse import coo_matrix, eye

OLD_RESULT = b"a result of yesterday"
NAN, INFINITE = float("nan"), float("inf")
STIFFNESS = coo_matrix(np.diag([4.0e5, 2.5e6]))


@dataclass(frozen=True)
class Case:
    """A fault: a sentence that names it, how it gets into a job, and the messages (or their parts) it must cause.

    `change` gets the job, may alter it in place, and may return a text to be written in its stead.
    """

    sentence: str
    change: Callable[[dict[str, Any]], str | None]
    messages: tuple[str, ...]
    base: Callable[[], dict[str, Any]] = wedge


def put(*path: str | int, **values: Any) -> Callable[[dict[str, Any]], None]:
    """Set keys of the table at a path."""

    def change(job: dict[str, Any]) -> None:
        table = job
        for part in path:
            table = table.setdefault(part, {}) if isinstance(part, str) else table[part]
        table.update(values)

    return change


def drop(*path: str | int) -> Callable[[dict[str, Any]], None]:
    """Delete the key or table at a path."""

    def change(job: dict[str, Any]) -> None:
        table = job
        for part in path[:-1]:
            table = table[part]
        del table[path[-1]]

    return change


def both(*changes: Callable[[dict[str, Any]], None]) -> Callable[[dict[str, Any]], None]:
    """One change after another."""

    def change(job: dict[str, Any]) -> None:
        for one in changes:
            one(job)

    return change


def frequencies(**values: Any) -> Callable[[dict[str, Any]], None]:
    """Another table [sweep]."""
    return lambda job: job.update(sweep=values)


def in_words(old: str, new: str) -> Callable[[dict[str, Any]], str]:
    """The job's text with one piece replaced."""

    def change(job: dict[str, Any]) -> str:
        text = toml(job)
        assert old in text
        return text.replace(old, new, 1)

    return change


def undamped_wedge() -> dict[str, Any]:
    """The wedge without its damping matrix."""
    job = wedge()
    del job["model"]["damping"]
    return job


JOB = [
    Case(
        "a line that is not TOML",
        in_words("[sweep]", "[sweep"),
        ("job.toml: file = ", "line ", ": expected a job in TOML"),
    ),
    Case(
        "an unknown table",
        put("continuatoin", branches=1),
        ("job.toml: [continuatoin] = 'unknown table': expected one of balance, contact,",),
    ),
    Case(
        "an unknown key",
        put("balance", sample=128),
        ("job.toml: [balance] sample = 128: expected a known key: approach, harmonics,",),
    ),
    Case(
        "an unknown key of a contact",
        put("contact", 0, stiffness=1.0),
        ("job.toml: contact[0] stiffness = 1.0: expected a known key: normal, tangents, tangential_stiffness,",),
    ),
    Case(
        "a table that is a number",
        lambda job: job.update(balance=5),
        ("job.toml: balance = 5: expected a table [balance]",),
    ),
    Case(
        "one table where a list of tables belongs",
        lambda job: job.update(load=job["load"][1]),
        ("job.toml: load = 'dict': expected tables [[load]]",),
    ),
    Case(
        "a text where a number belongs",
        put("contact", 0, normal_stiffness="stiff"),
        ("job.toml: contact[0] normal_stiffness = 'stiff': expected a number above 0",),
    ),
    Case(
        "true where a number belongs",
        put("contact", 0, gap=True),
        ("job.toml: contact[0] gap = True: expected a number",),
    ),
    Case(
        "a negative stiffness",
        put("contact", 0, normal_stiffness=-3.0e5),
        ("job.toml: contact[0] normal_stiffness = -300000.0: expected a number above 0",),
    ),
    Case(
        "a stiffness of zero",
        put("contact", 0, tangential_stiffness=0.0),
        ("job.toml: contact[0] tangential_stiffness = 0.0: expected a number above 0",),
    ),
    Case(
        "a stiffness that is not a number",
        put("contact", 0, tangential_stiffness=NAN),
        ("job.toml: contact[0] tangential_stiffness = nan: expected a number above 0",),
    ),
    Case(
        "an infinite stiffness",
        put("contact", 0, normal_stiffness=INFINITE),
        ("job.toml: contact[0] normal_stiffness = inf: expected a number above 0",),
    ),
    Case(
        "a number beyond all floating point",
        put("contact", 0, normal_stiffness=10**400),
        ("job.toml: contact[0] normal_stiffness = 1000", ": expected a number above 0"),
    ),
    Case(
        "a negative friction coefficient",
        put("contact", 0, friction_coefficient=-0.5),
        ("job.toml: contact[0] friction_coefficient = -0.5: expected a number of at least 0",),
    ),
    Case(
        "a contact without a friction coefficient",
        drop("contact", 0, "friction_coefficient"),
        ("job.toml: contact[0] friction_coefficient = 'missing': expected this key to be given",),
    ),
    Case(
        "no harmonics",
        put("balance", harmonics=0),
        ("job.toml: [balance] harmonics = 0: expected an integer from 1 to 1000",),
    ),
    Case(
        "a broken number of harmonics",
        put("balance", harmonics=2.5),
        ("job.toml: [balance] harmonics = 2.5: expected an integer from 1 to 1000",),
    ),
    Case(
        "too few samples for the harmonics",
        put("balance", samples=16),
        ("job.toml: [balance] samples = 16: expected at least 22 samples for 5 harmonics",),
    ),
    Case(
        "more samples than memory holds",
        put("balance", samples=10**9),
        ("job.toml: [balance] samples = 1000000000: expected an integer from 8 to 1048576",),
    ),
    Case(
        "an integer beyond 32 bits",
        put("static", steps=2**32 + 1),
        ("job.toml: [static] steps = 4294967297: expected an integer from 1 to 2147483647",),
    ),
    Case(
        "a load on a harmonic that is not solved for",
        put("load", 1, harmonic=6),
        ("job.toml: load[1] harmonic = 6: expected a harmonic that is solved for: at most 5",),
    ),
    Case(
        "a sweep that stops where it starts",
        frequencies(start_hz=140.0, stop_hz=140.0),
        ("job.toml: [sweep] stop_hz = 140.0: expected a frequency other than start_hz",),
    ),
    Case(
        "a sweep without its stop",
        frequencies(start_hz=140.0),
        ("job.toml: [sweep] stop_hz = 'missing': expected start_hz and stop_hz, or frequencies_hz",),
    ),
    Case(
        "listed frequencies beside a sweep",
        put("sweep", start_hz=140.0, stop_hz=100.0),
        (
            "job.toml: [sweep] start_hz = 140.0: expected no such key beside frequencies_hz",
            "job.toml: [sweep] stop_hz = 100.0: expected no such key beside frequencies_hz",
        ),
    ),
    Case(
        "a negative frequency in a list",
        frequencies(frequencies_hz=[132.0, -1.0]),
        ("job.toml: [sweep] frequencies_hz = [132.0, -1.0]: expected a number above 0, not -1.0, as item 1",),
    ),
    Case(
        "no sweep at all",
        drop("sweep"),
        ("job.toml: [sweep] = 'missing': expected a table with start_hz, stop_hz,",),
    ),
    Case(
        "no contact",
        drop("contact"),
        ("job.toml: contact = 'missing': expected at least one [[contact]] or [[contact_set]]",),
    ),
    Case(
        "no harmonic load",
        drop("load", 1),
        ("job.toml: load = 'missing': expected at least one [[load]] of kind harmonic",),
    ),
    Case(
        "a harmonic load without terms",
        put("load", 1, cosine=[]),
        ("job.toml: load[1] cosine = []: expected cosine or sine terms",),
    ),
    Case(
        "a load of an unknown kind",
        put("load", 0, kind="thermal"),
        ('job.toml: load[0] kind = \'thermal\': expected one of "static", "harmonic", "centrifugal"',),
    ),
    Case(
        "a key of another kind of load",
        put("load", 0, harmonic=2),
        ("job.toml: load[0] harmonic = 2: expected no such key on a load of kind static",),
    ),
    Case(
        "two loads of one name",
        put("load", 1, name="preload"),
        ("job.toml: load[1] name = 'preload': expected a name that no other load has",),
    ),
    Case(
        "a load path with an unknown load",
        put("static", load_path=[{"preload": 0.0}, {"prelaod": 1.0}]),
        ("job.toml: [static] load_path[1] = 'prelaod': expected names of static loads: preload",),
    ),
    Case(
        "no monitors",
        drop("output", "monitors"),
        ("job.toml: [output] monitors = 'missing': expected this key to be given",),
    ),
    Case(
        "two monitors of one name",
        put("output", monitors=[{"name": "x", "dofs": [[0, 1.0]]}, {"name": "x", "dofs": [[1, 1.0]]}]),
        ("job.toml: [output] monitors = 'x': expected names that differ",),
    ),
    Case(
        "a monitor with a slash in its name",
        put("output", monitors=[{"name": "tip/x", "dofs": [[0, 1.0]]}]),
        ("job.toml: [output] monitors = [{'name': 'tip/x'", "expected a name of at most 64 bytes without slash"),
    ),
    Case(
        "a dof without its coefficient, deep in a list",
        put("contact", 0, tangents=[[0, 1.0]]),
        ("job.toml: contact[0] tangents = [[0, 1.0]]: expected a pair [dof, coefficient], not 0, as item 0 of item 0",),
    ),
    Case(
        "two kinds of damping",
        both(drop("model", "damping"), put("damping", ratio=0.01, loss_factor=0.01)),
        ("job.toml: [damping] = 'ratio, loss_factor': expected only one kind of damping",),
    ),
    Case(
        "a damping ratio beside a damping matrix",
        put("damping", ratio=0.01),
        ("job.toml: [damping] ratio = 0.01: expected no such key beside the model's own damping matrix",),
    ),
    Case(
        "neither modes nor a frequency for the reduction",
        put("reduction"),
        ("job.toml: [reduction] modes = None: expected either modes or max_frequency_hz",),
    ),
    Case(
        "both modes and a frequency for the reduction",
        put("reduction", modes=1, max_frequency_hz=500.0),
        ("job.toml: [reduction] modes = 1: expected either modes or max_frequency_hz",),
    ),
    Case(
        "nothing to reduce",
        put("reduction", modes=0),
        ("job.toml: [reduction] = 'given': expected none: all 2 dofs are boundary dofs",),
    ),
    Case(
        "a quadrature nobody knows",
        put("balance", quadrature="exact"),
        ('job.toml: [balance] quadrature = \'exact\': expected one of "event", "sampled", "auto"',),
    ),
    Case(
        "harmonics in words",
        put("balance", harmonics="many"),
        ("job.toml: [balance] harmonics = 'many': expected an integer from 1 to 1000, or \"auto\"",),
    ),
    Case(
        "a tolerance with nothing left to choose",
        put("balance", harmonics=5, quadrature="event", tolerance=0.01),
        ("job.toml: [balance] tolerance = 0.01: expected no such key but with harmonics, quadrature or [reduction]",),
    ),
    Case(
        "a tolerance out of reach",
        put("balance", tolerance=1e-9),
        ("job.toml: [balance] tolerance = 1e-09: expected a number of at least 1e-08 and of at most 1",),
    ),
    Case(
        "an error to meet beside a number of modes",
        put("reduction", modes=1, error=0.1),
        ('job.toml: [reduction] error = 0.1: expected no such key but with modes = "auto"',),
    ),
    Case(
        "an ordering nobody knows",
        put("reduction", modes=1, ordering="metis"),
        ('job.toml: [reduction] ordering = \'metis\': expected one of "scotch", "pord", "amf", "qamd", "amd"',),
    ),
    Case(
        "a word for the factors' place",
        put("reduction", modes=1, out_of_core="maybe"),
        ("job.toml: [reduction] out_of_core = 'maybe': expected true or false, or \"auto\"",),
    ),
    Case(
        "a stability method",
        put("stability", method="floquet"),
        ('job.toml: [stability] method = \'floquet\': expected one of "none", "monodromy", "hill", "both"',),
    ),
    Case(
        "stability of an uncoupled balance",
        lambda job: job.update(stability={"method": "both"}) or job["balance"].update(approach="uncoupled"),
        ("job.toml: [stability] method = 'both': expected \"none\": an uncoupled balance",),
    ),
    Case(
        "stability under a loss factor",
        lambda job: job.update(stability={"method": "hill"}, damping={"loss_factor": 0.01}),
        ("job.toml: [damping] loss_factor = 0.01: expected ratio, rayleigh or a matrix",),
    ),
    Case(
        "a result that would overwrite the job",
        put("output", file="job.toml"),
        ("job.toml: [output] file = 'job.toml': expected a file other than that of the job",),
    ),
    Case(
        "a result in a folder that is a file",
        put("output", file="result.h5/wedge.h5"),
        ("job.toml: [output] file = 'result.h5/wedge.h5': expected a file in a folder (result.h5 is a file)",),
    ),
    Case(
        "a result that is a folder",
        put("output", file="."),
        ("job.toml: [output] file = '.': expected a file, not a folder",),
    ),
]

MODEL = [
    Case(
        "a matrix file that is missing",
        put("model", mass="M.mtx"),
        ("job.toml: [model] mass = 'M.mtx': expected a file that can be read (No such file or directory)",),
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
        ("job.toml: [model] mass = 'missing': expected a matrix to go with stiffness",),
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
        ("job.toml: [model]: mass = 'no mass at dof 1': expected mass at every dof",),
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
        ("job.toml: [reduction] = 'missing': expected a reduction: 5000 dofs are too many",),
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
        ("job.toml.bak: file = ", ": expected an HDF5 file written by attrito import"),
    ),
    Case(
        "a model file that is another HDF5 file",
        put("model", file="other.h5"),
        ("other.h5: format = 'missing': expected \"attrito model\", a file written by attrito import",),
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
        "an unknown set among the boundary",
        put("reduction", boundary=["tip", "tipp"]),
        ("job.toml: [reduction] boundary[1] = 'tipp': expected a node set or node of the model: bottom, empty, held,",),
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
ALL = JOB + MODEL + MESH
ON_RANKS = [
    "a line that is not TOML",
    "an unknown key",
    "a negative stiffness",
    "a matrix file that is missing",
    "a truncated Matrix Market file",
    "a Matrix Market file that ends after its header",
    "an unsymmetric stiffness",
    "a mass that is not positive, found by the library",
    "contacts that leave a motion free, found by the library",
    "a contact on a dof that is not there",
    "a model file that is another HDF5 file",
    "pairs out of tolerance",
    "more modes than interior dofs",
    "a body that floats with the boundary held, found by the library",
]


@pytest.fixture(scope="session")
def faulty_files(tmp_path_factory) -> Path:
    """Files that jobs refer to, most of them at fault."""
    folder = tmp_path_factory.mktemp("faulty_files")
    (folder / "job.toml.bak").write_text("neither matrix nor model\n")
    scipy.io.mmwrite(folder / "K.mtx", STIFFNESS)
    text = (folder / "K.mtx").read_text()
    (folder / "truncated.mtx").write_text("\n".join(text.splitlines()[:-1]) + "\n")
    (folder / "header.mtx").write_text(text.splitlines()[0] + "\n")
    scipy.io.mmwrite(folder / "nan.mtx", coo_matrix(np.diag([4.0e5, NAN])))
    scipy.io.mmwrite(folder / "large.mtx", eye(5000))
    (folder / "load.txt").write_text("1.0\n2.0\n3.0\n")
    write_blocks(folder / "model.h5")
    write_blocks(folder / "floating.h5", floating=True)
    shutil.copy(folder / "model.h5", folder / "nan.h5")
    with h5py.File(folder / "nan.h5", "r+") as file:
        file["mass/values"][0] = NAN
    with h5py.File(folder / "other.h5", "w") as file:
        file["numbers"] = np.arange(3)
    return folder


@pytest.fixture
def folder(tmp_path, faulty_files) -> Path:
    """A folder with those files and a result that must survive."""
    for path in faulty_files.iterdir():
        (tmp_path / path.name).symlink_to(path)
    (tmp_path / "result.h5").write_bytes(OLD_RESULT)
    return tmp_path


def write(folder: Path, case: Case) -> None:
    """The case's job in the folder."""
    job = case.base()
    text = case.change(job)
    (folder / "job.toml").write_text(text or toml(job))


def check(done, folder: Path, messages: tuple[str, ...]) -> None:
    """Exit code 2, every message once, nothing else from the program, the old result untouched and no new one."""
    assert done.returncode == 2, done.stdout + done.stderr
    assert "Traceback" not in done.stdout + done.stderr
    assert done.stderr.count("attrito: ") == 1, done.stderr
    for message in messages:
        assert done.stderr.count(message) == 1, f"{message!r} is not (or not once) in {done.stderr!r}"
    assert (folder / "result.h5").read_bytes() == OLD_RESULT
    assert not list(folder.glob("*.partial"))


@pytest.mark.parametrize("case", ALL, ids=lambda case: case.sentence)
def test_a_fault_is_told_with_file_key_value_and_what_was_expected(folder, capfd, case):
    write(folder, case)
    done = attrito_here(folder, capfd, "run", "job.toml")
    check(done, folder, case.messages)
    # One process: nothing but the message is on standard error.
    assert done.stderr.startswith("attrito: "), done.stderr
    assert ": expected " in done.stderr


@pytest.mark.parametrize("ranks", [2, 4])
@pytest.mark.parametrize("sentence", ON_RANKS)
def test_a_fault_is_told_once_by_all_ranks_and_none_hangs(folder, sentence, ranks):
    case = next(case for case in ALL if case.sentence == sentence)
    write(folder, case)
    check(attrito(folder, "run", "job.toml", ranks=ranks), folder, case.messages)


@pytest.mark.parametrize("ranks", [None, 2])
def test_a_job_that_is_not_there_is_told(folder, ranks):
    done = attrito(folder, "run", "jbo.toml", ranks=ranks)
    check(done, folder, ("jbo.toml: file = 'No such file or directory': expected a job file that can be read",))


def test_a_job_that_is_a_folder_is_told(folder, capfd):
    (folder / "jobs").mkdir()
    done = attrito_here(folder, capfd, "run", "jobs")
    check(done, folder, ("jobs: file = 'Is a directory': expected a job file that can be read",))


def test_a_job_that_is_not_text_is_told(folder, capfd):
    (folder / "job.toml").write_bytes(b"\xff\xfe\x00binary")
    check(attrito_here(folder, capfd, "run", "job.toml"), folder, ("job.toml: file = ", ": expected a job in TOML"))


def test_several_faults_are_told_together(folder, capfd):
    changes = both(
        put("contact", 0, normal_stiffness=-1.0),
        put("balance", harmonic=3),
        put("load", 1, harmonic=9),
        frequencies(start_hz=100.0),
        drop("output", "file"),
    )
    write(folder, Case("", changes, ()))
    expected = (
        "contact[0] normal_stiffness = -1.0",
        "[balance] harmonic = 3",
        "load[1] harmonic = 9",
        "[sweep] stop_hz = 'missing'",
        "[output] file = 'missing'",
    )
    done = attrito_here(folder, capfd, "run", "job.toml")
    check(done, folder, expected)
    assert len(done.stderr.splitlines()) == len(expected)


def test_several_faults_of_places_in_the_model_are_told_together(folder, capfd):
    changes = both(
        put("contact", 0, normal=[[5, 1.0]]),
        put("load", 0, dofs=[[6, 1.0]]),
        put("output", monitors=[{"name": "z", "dofs": [[7, 1.0]]}]),
    )
    write(folder, Case("", changes, ()))
    done = attrito_here(folder, capfd, "run", "job.toml")
    check(done, folder, ("contact[0] normal = 5", "load[0] dofs = 6", "[output] monitors[0] = 7"))


def test_reducing_a_job_that_does_not_ask_for_it_is_told(folder, capfd):
    write(folder, Case("", lambda job: None, ()))
    done = attrito_here(folder, capfd, "reduce", "job.toml")
    check(done, folder, ("job.toml: [reduction] = 'missing': expected this table",))


# --- the other commands ----------------------------------------------------------------------------------------------


@pytest.fixture(scope="session")
def wedge_result(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("wedge_result")
    run(folder, wedge())
    return folder / "result.h5"


@pytest.mark.parametrize("command", ["table", "plot", "export"])
@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("absent.h5", "absent.h5: file = 'absent': expected a result of `attrito run`"),
        ("result.h5", "result.h5: file = 'not HDF5': expected a result of `attrito run`"),
        ("model.h5", "model.h5: format = 'attrito model': expected a result of `attrito run`"),
        (".", ".: file = 'absent': expected a result of `attrito run`"),
    ],
    ids=["a file that is not there", "a file that is not HDF5", "a model file", "a folder"],
)
def test_what_is_not_a_result_is_told(folder, capfd, command, name, message):
    check(attrito_here(folder, capfd, command, name), folder, (message,))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["plot", "--loops", "--point", "1"], "wedge.h5: point = 1: expected a number from 0 to 0"),
        (["plot", "--loops", "--point", "-1"], "wedge.h5: point = -1: expected a number from 0 to 0"),
        (["plot", "--loops", "--contact", "1"], "wedge.h5: contact = 1: expected a number from 0 to 0"),
        (["plot", "--monitor", "z"], "wedge.h5: --monitor = 'z': expected one of x, y"),
        (["plot", "-o", "nowhere/frf.png"], "nowhere/frf.png: figure = "),
        (["plot", "-o", "frf.xyz"], "frf.xyz: "),
        (["plot", "--map"], "wedge.h5: "),
        (["export"], "wedge.h5: model_file = 'none': expected a result of a model with a mesh"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "told",
)
def test_what_a_result_does_not_hold_is_told(folder, capfd, wedge_result, arguments, message):
    (folder / "wedge.h5").symlink_to(wedge_result)
    command, *options = arguments
    check(attrito_here(folder, capfd, command, "wedge.h5", *options), folder, (message, ": expected "))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--stiffness", "K.mtx"], "import: mass = 'missing': expected a matrix file"),
        (["--stiffness", "K.mtx", "--mass", "M.mtx"], "import: mass = 'M.mtx': expected a file that can be read"),
        (["--stiffness", "nan.mtx", "--mass", "K.mtx"], "nan.mtx: line 5 = '2 2 nan'"),
        (["--stiffness", "large.mtx", "--mass", "K.mtx"], "K.mtx: mass = '2 x 2': expected the size of the stiffness"),
        (["--calculix", "blade", "--mesh", "blade.inp"], "blade.dof: file = "),
        (["--calculix", "blade"], "import: mesh = 'missing': expected a file that goes with dofs"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "told",
)
def test_faults_of_an_import_are_told(folder, capfd, arguments, message):
    done = attrito_here(folder, capfd, "import", "result.h5", *arguments)
    check(done, folder, (message,))


def test_an_import_into_a_folder_that_is_a_file_is_told(folder, capfd):
    done = attrito_here(folder, capfd, "import", "result.h5/model.h5", "--stiffness", "K.mtx", "--mass", "K.mtx")
    check(done, folder, ("result.h5/model.h5: file = ", "expected a file that can be written"))
