"""`attrito campbell`: tangent modes against the speed of rotation, of blades and of wheels."""

from __future__ import annotations

import re

import h5py
import numpy as np
import pytest
import synthetic
from calculix_beam import CALCULIX_HZ, RADIUS, beam_model, solve, write_mesh
from edited import edited
from jobs import attrito, attrito_here, table, write_job
from scipy.sparse import csr_matrix, identity
from wheels import lumped_sector, ring, sector_job

from attrito.job.cyclic import folded_diameter
from attrito.model.model_file import write_model
from attrito.modes.crossings import crossings
from attrito.plots.campbell import campbell_diagram
from attrito.results.result import Result
from attrito.support.own_folders import take_folder

SPRING_HZ = 50.0
SPEEDS = [0.0, 10.0, 25.0, 30.0]
LAW = {"tangential_stiffness": 1.0e9, "normal_stiffness": 1.0e9, "friction_coefficient": 0.3}
SOFT = {"tangential_stiffness": 1.0e3, "normal_stiffness": 1.0e3, "friction_coefficient": 0.3}


def campbell(folder, capfd, job):
    """The rows of the diagram's table."""
    done = attrito_here(folder, capfd, "campbell", write_job(folder, job))
    assert done.returncode == 0, done.stderr
    return table(folder, result="result.campbell.h5"), done.stdout


def spinning_masses(folder):
    """Eight equal masses in space on springs that are the same in all directions; the first one in a contact."""
    model = synthetic.assemble([synthetic.block("C3D8", (1, 1, 1))], {}, seed=2)
    model.elements = {}
    model.mass = csr_matrix(2.0 * identity(model.size))
    model.stiffness = csr_matrix(2.0 * (2 * np.pi * SPRING_HZ) ** 2 * identity(model.size))
    write_model(folder / "model.h5", model, [])
    first = int(model.node_ids.min())
    return {
        "model": {"file": "model.h5"},
        "contact": [
            {
                "normal": [[["node", first, "x"], 1.0]],
                "tangents": [[[["node", first, "y"], 1.0]], [[["node", first, "z"], 1.0]]],
                "preload": 1.0e6,
                **LAW,
            }
        ],
        "load": [
            {
                "kind": "centrifugal",
                "speed_hz": 40.0,
                "axis_point": [0.0, 0.0, 0.0],
                "axis_direction": [1.0, 2.0, -2.0],
                "spin_softening": True,
            }
        ],
        "campbell": {"speeds_hz": SPEEDS, "modes": 21},
        "output": {"file": "result.h5"},
    }


@pytest.mark.parametrize("reduced", [False, True])
def test_masses_on_springs_soften_across_the_axis_by_the_square_of_the_speed(tmp_path, capfd, reduced):
    job = spinning_masses(tmp_path)
    if reduced:
        job["reduction"] = {"modes": 21}
        # What a process that was killed has left is removed.
        take_folder(tmp_path / "result.campbell.h5.reductions", "")
        (tmp_path / "result.campbell.h5.reductions" / "speed_0.h5").write_text("half a reduction")
    rows, said = campbell(tmp_path, capfd, job)
    assert list(rows[0]) == ["speed_hz", "nodal_diameter", "mode", "frequency_hz"]
    assert "stress stiffening is left out: [campbell] stiffness_at_rest" in said
    for speed in SPEEDS:
        found = [row for row in rows if float(row["speed_hz"]) == speed]
        assert [row["mode"] for row in found] == [str(i) for i in range(1, 22)]
        assert {row["nodal_diameter"] for row in found} == {""}
        # Seven masses that touch nothing: two directions across the axis and one along it.
        expected = [np.sqrt(SPRING_HZ**2 - speed**2)] * 14 + [SPRING_HZ] * 7
        assert [float(row["frequency_hz"]) for row in found] == pytest.approx(expected, rel=1e-9)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "job.toml",
        "model.h5",
        "result.campbell.h5",
        "result.campbell.png",
    ]


def rotor(**keys):
    """Two masses of 2 on springs of 1e5 at 80 Hz, of 6e4 and 9e4 at rest; a contact on the first, held at mass 2's."""
    return {
        "model": {"mass": [[2.0, 0.0], [0.0, 2.0]], "stiffness": [[1.0e5, 0.0], [0.0, 1.0e5]]},
        "contact": [{"normal": [[0, 1.0]], "tangents": [[[1, 1.0]]], "gap": 1.0, **SOFT}],
        "campbell": {
            "speeds_hz": [0.0, 20.0, 80.0, 120.0],
            "stiffness_at_rest": [[6.0e4, 0.0], [0.0, 9.0e4]],
            "stiffness_hz": 80.0,
            **keys,
        },
        "output": {"file": "result.h5"},
    }


def test_a_stiffness_at_rest_beside_that_at_speed_gives_those_between_and_beyond(tmp_path, capfd):
    rows, said = campbell(tmp_path, capfd, rotor(engine_orders=[2, 1]))
    squares = np.array([0.0, 20.0, 80.0, 120.0]) ** 2 / 80.0**2
    stiffness = [np.sort([6.0e4 + 4.0e4 * s, 9.0e4 + 1.0e4 * s]) for s in squares]
    expected = np.sqrt(np.concatenate(stiffness) / 2.0) / (2.0 * np.pi)
    assert [float(row["frequency_hz"]) for row in rows] == pytest.approx(expected, rel=1e-11)
    assert "warning: stress" not in said and "depends on the speed" not in said
    # 4 pi^2 m e^2 Omega^2 = k_0 + k_2 Omega^2
    critical = []
    for order in (1, 2):
        for mode, (rest, more) in enumerate(((6.0e4, 4.0e4), (9.0e4, 1.0e4)), start=1):
            speed = np.sqrt(rest / (8.0 * np.pi**2 * order**2 - more / 80.0**2))
            critical.append((speed, order, mode))
    critical = sorted(one for one in critical if one[0] < 120.0)
    assert len(critical) == 4
    with h5py.File(tmp_path / "result.campbell.h5") as file:
        found = [file[f"crossings/{name}"][:] for name in ("speed_hz", "engine_order", "mode")]
        assert file["crossings/frequency_hz"][:] == pytest.approx(found[0] * found[1], rel=1e-14)
        assert file["crossings/drawn"][:].tolist() == [1, 2]
    assert found[0] == pytest.approx([one[0] for one in critical], rel=1e-12)
    assert found[1].tolist() == [one[1] for one in critical] and found[2].tolist() == [one[2] for one in critical]
    assert f"engine order 2 meets mode 1 at {critical[0][0]:.5g} Hz" in said


def test_crossings_are_where_an_engine_order_has_the_frequency_of_a_mode():
    speeds = np.array([0.0, 3.0, 10.0])
    hz = np.sqrt(np.array([[16.0], [16.0 + 9.0 * 0.5], [16.0 + 100.0 * 0.5]]))
    found = crossings(speeds, hz, [1, 2, 4], diameter=3)
    # f^2 = 16 + Omega^2 / 2 = (e Omega)^2
    exact = [np.sqrt(16.0 / (order**2 - 0.5)) for order in (1, 2, 4)]
    assert [one.speed_hz for one in found] == pytest.approx(exact, rel=1e-14)
    assert [(one.engine_order, one.diameter, one.mode) for one in found] == [(1, 3, 1), (2, 3, 1), (4, 3, 1)]
    assert crossings(speeds, hz + 100.0, [1, 2]) == []


def spinning_ring(folder, **load):
    """A sector of an elastic ring whose rim grows onto the ground as it turns; another contact of it is closed."""
    model = ring(6, seed=3)
    write_model(folder / "model.h5", model, [])
    job = sector_job(model, 6)
    rim = [int(node) for node in model.node_sets["rim"]]
    touching = {"normal": [[["node", rim[1], "x"], 1.0]], "tangents": [[[["node", rim[1], "z"], 1.0]]]}
    held = {"normal": [[["node", rim[0], "z"], 1.0]], "tangents": [[[["node", rim[0], "y"], 1.0]]]}
    job["contact"] = [touching | LAW | {"gap": 2.0e-7}, held | LAW | {"preload": 1.0}]
    spin = {"name": "spin", "kind": "centrifugal", "speed_hz": 50.0, "axis_point": [0.0, 0.0, 1.0]}
    job["load"] = [spin | {"axis_direction": [0.0, 0.0, 2.0]} | load]
    job["campbell"] = {"speeds_hz": [0.0, 20.0, 60.0, 300.0], "modes": 5}
    for name in ("contact_set", "sweep"):
        del job[name]
    job["output"] = {"file": "result.h5"}
    return job


@pytest.mark.parametrize("tables", [{}, {"reduction": {"modes": 10}}], ids=["full", "reduced"])
@pytest.mark.parametrize("softened", [True, False])
def test_a_wheel_s_diagram_is_its_linear_modes_at_each_speed(tmp_path, capfd, softened, tables):
    """Contacts that close or open with the speed included; reduced with all modes inside, nothing is lost."""
    job = spinning_ring(tmp_path, spin_softening=softened) | tables
    rows, _ = campbell(tmp_path, capfd, job)
    with h5py.File(tmp_path / "result.campbell.h5") as file:
        closed = file["speeds/closed"][:]
    assert not closed[0, 0] and closed[-1, 0] and closed[0, 1] and not closed[-1, 1], "the test is void"
    for place, speed in enumerate(job["campbell"]["speeds_hz"]):
        job["load"][0]["speed_hz"] = speed
        done = attrito_here(tmp_path, capfd, "linear-modes", write_job(tmp_path, job), "--count", "5")
        assert done.returncode == 0, done.stderr
        expected = table(tmp_path, result="result.modes.h5")
        found = [row for row in rows if float(row["speed_hz"]) == speed]
        assert [row["nodal_diameter"] for row in found] == [row["nodal_diameter"] for row in expected]
        # The same matrices but for rounding, of condition 1e4; modes of a reduction have residuals of 1e-12.
        assert [float(row["frequency_hz"]) for row in found] == pytest.approx(
            [float(row["frequency_hz"]) for row in expected], rel=1e-9
        )
        with h5py.File(tmp_path / "result.modes.h5") as file:
            assert file["closed"][:].tolist() == closed[place].tolist()


def test_engine_orders_meet_modes_of_the_nodal_diameter_that_they_excite(tmp_path, capfd):
    job = spinning_ring(tmp_path)
    job["cyclic"]["engine_order"] = -14
    # The lowest modes are at some kHz.
    job["campbell"] |= {"speeds_hz": [0.0, 400.0, 4000.0], "modes": 2}
    campbell(tmp_path, capfd, job)
    with h5py.File(tmp_path / "result.campbell.h5") as file:
        orders, diameters = file["crossings/engine_order"][:], file["crossings/nodal_diameter"][:]
        speeds, hz = file["crossings/speed_hz"][:], file["crossings/frequency_hz"][:]
        assert file["crossings/drawn"][:].tolist() == [*range(1, 13), 14]
    assert len(orders) > 5 and 14 in orders
    assert diameters.tolist() == [folded_diameter(6, int(order)) for order in orders]
    assert hz == pytest.approx(orders * speeds) and np.all(np.diff(speeds) >= 0.0)


def test_two_ranks_find_what_one_does(tmp_path, capfd):
    job = spinning_ring(tmp_path, spin_softening=True) | {"reduction": {"modes": 8}}
    one, _ = campbell(tmp_path, capfd, job)
    done = attrito(tmp_path, "campbell", "job.toml", ranks=2)
    assert done.returncode == 0, done.stderr
    two = table(tmp_path, result="result.campbell.h5")
    found = [[float(row["frequency_hz"]) for row in rows] for rows in (one, two)]
    # Modes of the reduction are solved to residuals of 1e-12.
    assert found[0] == pytest.approx(found[1], rel=1e-9)


def test_stiffness_of_calculix_at_one_speed_and_at_rest_gives_that_at_another(tmp_path, capfd):
    """Stress stiffening and softening at 60 Hz from those at 150 Hz, against CalculiX's own at 60 Hz.

    CalculiX also has the tangent stiffness about the stretched beam, which adds parts of Omega^4: of what rotation
    does, they are as large as the strain, rho Omega^2 ((R + L)^2 - R^2) / 2 E at the root.
    """
    shape = np.array([-3.0, -1.0, RADIUS])
    body = synthetic.block("C3D20", (1, 1, 8), (6.0, 2.0, 100.0), lambda points: points + shape)
    write_mesh(tmp_path / "mesh.inp", body, {"root": np.flatnonzero(body.points[:, 2] < RADIUS + 1e-6)})
    matrices = "*FREQUENCY, SOLVER=MATRIXSTORAGE\n1\n"
    steps = {"rest": f"*STEP\n{matrices}*END STEP\n"}
    for name, hz in (("fast", CALCULIX_HZ), ("slow", 60.0)):
        load = f"*DLOAD\nbody, CENTRIF, {(2 * np.pi * hz) ** 2:.17g}, 0., 0., 0., 0., 1., 0.\n"
        steps[name] = f"*STEP\n*STATIC\n{load}*END STEP\n*STEP, PERTURBATION\n{matrices}*END STEP\n"
    for name, text in steps.items():
        solve(tmp_path, name, "*BOUNDARY\nroot, 1, 3\n" + text)
    beam_model(tmp_path, "rest")
    both = ["stress_stiffening", "spin_softening"]
    for name, hz in (("fast", CALCULIX_HZ), ("slow", 60.0)):
        beam_model(tmp_path, name, holds=both, spin_hz=hz)
    job = {
        "model": {"file": "fast.h5"},
        "reduction": {"modes": 12},
        "contact": [{"normal": [[0, 1.0]], "tangents": [[[1, 1.0]]], "gap": 1.0, **SOFT}],
        "load": [
            {
                "kind": "centrifugal",
                "speed_hz": CALCULIX_HZ,
                "axis_point": [0.0, 0.0, 0.0],
                "axis_direction": [0.0, 1.0, 0.0],
            }
        ],
        "campbell": {"speeds_hz": [60.0], "modes": 4, "stiffness_at_rest": "rest.h5"},
        "output": {"file": "result.h5"},
    }
    rows, _ = campbell(tmp_path, capfd, job)
    job["model"]["file"], job["load"][0]["speed_hz"] = "slow.h5", 60.0
    done = attrito_here(tmp_path, capfd, "linear-modes", write_job(tmp_path, job), "--count", "4")
    assert done.returncode == 0, done.stderr
    expected = [float(row["frequency_hz"]) for row in table(tmp_path, result="result.modes.h5")]
    done = attrito_here(tmp_path, capfd, "linear-modes", write_job(tmp_path, job | {"model": {"file": "rest.h5"}}))
    assert done.returncode == 0, done.stderr
    rest = [float(row["frequency_hz"]) for row in table(tmp_path, result="result.modes.h5")[:4]]
    assert expected[0] > 1.01 * rest[0], "rotation does nothing: the test is void"
    found, expected, rest = np.array([float(row["frequency_hz"]) for row in rows]), np.array(expected), np.array(rest)
    strain = 7.85e-9 * (2 * np.pi * CALCULIX_HZ) ** 2 * ((RADIUS + 100.0) ** 2 - RADIUS**2) / (2 * 210000.0)
    assert found**2 - rest**2 == pytest.approx(expected**2 - rest**2, rel=strain)


@pytest.mark.parametrize("kind", ["file", "folder", "link"])
def test_what_is_in_the_place_of_the_folder_of_reductions_is_spared(tmp_path, capfd, kind):
    job = spinning_masses(tmp_path) | {"reduction": {"modes": 21}}
    place, theirs = tmp_path / "result.campbell.h5.reductions", tmp_path / "theirs"
    theirs.mkdir()
    (theirs / "speed_0.h5").write_text("theirs")
    if kind == "file":
        place.write_text("theirs")
    elif kind == "folder":
        theirs.rename(place)
    else:
        place.symlink_to(theirs)
    assert "result.campbell.h5.reductions: folder = 'in the way'" in said_of(tmp_path, capfd, job)
    assert (place if kind == "file" else place / "speed_0.h5").read_text() == "theirs"


def test_a_job_of_another_folder_leaves_no_reductions_in_it(tmp_path, capfd):
    (tmp_path / "input").mkdir()
    job = spinning_masses(tmp_path / "input") | {"reduction": {"modes": 21}}
    job["output"]["file"] = "../out/result.h5"
    write_job(tmp_path / "input", job)
    done = attrito_here(tmp_path, capfd, "campbell", "input/job.toml")
    assert done.returncode == 0, done.stderr
    assert sorted(path.name for path in (tmp_path / "input").iterdir()) == ["job.toml", "model.h5"]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["result.campbell.h5", "result.campbell.png"]


def said_of(folder, capfd, job):
    done = attrito_here(folder, capfd, "campbell", write_job(folder, job))
    assert done.returncode == 2, done.stdout
    assert done.stderr.count("\n") == 1, done.stderr
    return done.stderr


def without(job, *keys):
    for key in keys:
        del job["campbell"][key]
    return job


FAULTS = [
    (
        lambda: without(rotor(), "stiffness_hz"),
        "job.toml: [campbell] stiffness_hz is missing: expected the speed of rotation that the stiffness of the model",
    ),
    (
        lambda: without(rotor(), "stiffness_at_rest"),
        "job.toml: [campbell] stiffness_hz = 80.0: expected no such key without stiffness_at_rest",
    ),
    (
        lambda: rotor(stiffness_at_rest=[[1.0]]),
        "job.toml: [campbell] stiffness_at_rest = '1 dofs': expected 2 dofs, those of the model",
    ),
    (
        lambda: rotor(stiffness_at_rest=[[1.0, 2.0], [3.0, 1.0]]),
        "job.toml: [campbell] stiffness_at_rest: stiffness",
    ),
    (
        lambda: rotor(stiffness_at_rest="nowhere.mtx"),
        "nowhere.mtx",
    ),
    (
        lambda: {key: value for key, value in rotor().items() if key != "campbell"},
        "job.toml: [campbell] is missing: expected this table, with speeds_hz",
    ),
    (
        lambda: (
            rotor(stiffness_at_rest=[[2.0e5, 0.0], [0.0, 2.0e5]], speeds_hz=[0.0, 80.0, 200.0])
            | {"contact": [{"normal": [[0, 1.0]], "tangents": [[[1, 1.0]]], **SOFT}]}
        ),
        "job.toml: [campbell] speeds_hz = 200.0: expected speeds at which the structure stands; stiffness",
    ),
]


@pytest.mark.parametrize(("job", "said"), FAULTS)
def test_a_diagram_that_cannot_be_had_is_refused_with_the_key_that_is_needed(tmp_path, capfd, job, said):
    assert said in said_of(tmp_path, capfd, job())
    assert not (tmp_path / "result.campbell.h5").exists()


def test_stress_stiffening_that_the_model_holds_asks_for_the_stiffness_at_rest(tmp_path, capfd):
    job = spinning_ring(tmp_path)
    with edited(tmp_path / "model.h5") as file:
        file.attrs["stiffness_holds"], file.attrs["spin_hz"] = '["stress_stiffening"]', 50.0
    said = said_of(tmp_path, capfd, job)
    assert "[campbell] stiffness_at_rest is missing: expected the stiffness of the same structure at rest" in said
    assert "that of model.h5 holds stress stiffening of 50 Hz" in said
    job["campbell"]["stiffness_at_rest"] = "model.h5"
    said = said_of(tmp_path, capfd, job)
    assert "stiffness_at_rest = 'model.h5': expected a stiffness at rest: this one holds stress stiffening" in said


def test_softening_that_the_model_holds_is_known_by_the_axis_of_the_load(tmp_path, capfd):
    """Held at 50 Hz or asked for in the job: the same wheel."""
    job = spinning_ring(tmp_path, spin_softening=True)
    asked, _ = campbell(tmp_path, capfd, job)
    from attrito.model.model_file import read_model
    from attrito.model.rotation import softening, spin_of

    model = read_model(tmp_path / "model.h5")
    model.stiffness = (model.stiffness - softening(model, spin_of(job["load"][0]))).tocsr()
    model.stiffness_holds, model.spin_hz = ("spin_softening",), 50.0
    write_model(tmp_path / "model.h5", model, [])
    job["load"][0]["spin_softening"] = False
    held, _ = campbell(tmp_path, capfd, job)
    found = [[float(row["frequency_hz"]) for row in rows] for rows in (asked, held)]
    assert found[0] == pytest.approx(found[1], rel=1e-9) and len(found[0]) == 4 * 4 * 5
    job["load"] = []
    assert "load is missing: expected a [[load]] of kind centrifugal, whose axis" in said_of(tmp_path, capfd, job)


def test_a_load_path_that_ends_at_another_speed_is_refused(tmp_path, capfd):
    job = spinning_ring(tmp_path) | {"static": {"load_path": [0.0, 0.5]}}
    assert "[static] load_path[1] = 0.5: expected 1 at the end for spin" in said_of(tmp_path, capfd, job)


def test_a_job_in_which_nothing_turns_is_told_so(tmp_path, capfd):
    job = lumped_sector() | {"campbell": {"speeds_hz": [1.0, 2.0], "modes": 1}}
    rows, said = campbell(tmp_path, capfd, job)
    assert "warning: nothing in the job depends on the speed" in said
    one, other = rows[:3], rows[3:]
    assert [row["frequency_hz"] for row in one] == [row["frequency_hz"] for row in other]
    with h5py.File(tmp_path / "result.campbell.h5") as file:
        assert "nothing in the job depends on the speed" in file.attrs["warnings"]


def test_modes_that_grow_by_themselves_are_told(tmp_path, capfd):
    job = rotor(stiffness_at_rest=[[2.0e5, 0.0], [0.0, 2.0e5]], speeds_hz=[0.0, 80.0, 130.0])
    # Stuck it would stand.
    job["contact"][0] |= LAW
    _, said = campbell(tmp_path, capfd, job)
    assert "warning: at 130 Hz 2 modes are unstable, omega^2 < 0" in said


@pytest.fixture
def diagram(tmp_path, capfd):
    """A folder with the diagram of the elastic ring."""
    job = spinning_ring(tmp_path)
    job["campbell"]["speeds_hz"] = [0.0, 400.0, 2000.0, 4000.0]
    campbell(tmp_path, capfd, job)
    return tmp_path


def test_the_picture_has_all_modes_the_engine_orders_and_where_they_meet(diagram):
    with Result(diagram / "result.campbell.h5") as result:
        figure = campbell_diagram(result)
        frequency, speed = result.array("/points/frequency_hz"), result.array("/points/speed_hz")
        met = result.array("/crossings/speed_hz"), result.array("/crossings/frequency_hz")
    axes = figure.axes[0]
    assert axes.get_xlabel() == "Speed of rotation (Hz)" and axes.get_ylabel() == "Frequency (Hz)"
    drawn = np.concatenate([line.get_xydata() for line in axes.get_lines() if line.get_marker() == "."])
    assert sorted(map(tuple, drawn)) == sorted(zip(speed, frequency, strict=True))
    labels = [line.get_label() for line in axes.get_lines()]
    assert [f"nodal diameter {n}" in labels for n in range(4)] == [True] * 4
    (circles,) = [line for line in axes.get_lines() if line.get_label() == "an engine order meets a mode"]
    assert np.array(circles.get_data()) == pytest.approx(np.array(met)) and len(met[0])
    assert [text.get_text() for text in axes.texts] == [str(order) for order in range(1, 13)]


@pytest.mark.parametrize(
    ("command", "said"), [("plot", "campbell.png"), ("info", "4 speeds, 0 to 4000 Hz"), ("report", "report.html")]
)
def test_what_shows_results_shows_a_diagram(diagram, capfd, command, said):
    done = attrito_here(diagram, capfd, command, "result.campbell.h5")
    assert done.returncode == 0 and said in done.stdout, done.stderr
    if command == "report":
        page = (diagram / "result.campbell.report.html").read_text()
        assert "Campbell diagram" in page and "Critical speeds" in page and "[campbell]" in page
        assert "Southwell" in page
        assert attrito_here(diagram, capfd, command, "result.campbell.h5", "--pdf").returncode == 0
        printed = (diagram / "result.campbell.report.pdf").read_bytes()
        assert len(re.findall(rb"/Type /Page\b", printed)) == 2


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("plot", "--map"), "--map = 'given': expected a result of `attrito run`"),
        (("plot", "--speed-hz", "3"), "--speed-hz = 3.0: expected a file of `attrito linear-modes`"),
        (("table", "--contacts"), "--contacts = 'given': expected a file of `attrito run`"),
        (("export",), "expected"),
    ],
)
def test_what_a_diagram_does_not_have_is_refused(diagram, capfd, options, said):
    done = attrito_here(diagram, capfd, options[0], "result.campbell.h5", *options[1:])
    assert done.returncode == 2 and said in done.stderr, done.stderr
