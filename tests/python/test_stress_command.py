"""`attrito stress` and `attrito.stress`: from a deck with its material to a table and a field."""

from __future__ import annotations

import csv
import json
from dataclasses import replace

import h5py
import matplotlib
import meshio
import numpy as np
import pytest
import synthetic
from edited import edited
from figures import line
from jobs import attrito_here
from scipy.sparse import identity

import attrito
from attrito.importers.mesh import read_mesh
from attrito.model.model_file import read_model, write_model
from attrito.stresses.cycle import cycle_of
from attrito.stresses.picture import DARKEST, DIRECTIONS, MAP
from attrito.support.errors import InputError

YOUNG, POISSON = 2000.0, 0.25
# A bar along x, stretched by 1e-3 at rest and by +-2e-3 over the period, without lateral contraction
STATIC, ALTERNATING = 1e-3, 2e-3
# Stress along x over strain without lateral contraction
CONSTRAINED = YOUNG * (1 - POISSON) / ((1 + POISSON) * (1 - 2 * POISSON))
VON_MISES = YOUNG / (1 + POISSON)


def bar(folder, elastic: bool = True, units: str = ""):
    """A model of bricks and a result of two points, the second with twice the motion."""
    model = synthetic.assemble(
        [synthetic.block("C3D8", (3, 1, 1), (3.0, 1.0, 1.0))],
        {"root": lambda points, _: points[:, 0] < 1e-9, "tip": lambda points, _: points[:, 0] > 3 - 1e-9},
        seed=2,
    )
    model.stiffness = model.mass = identity(model.size, format="csr")
    if elastic:
        model.elastic = {"C3D8": np.tile([YOUNG, POISSON], (3, 1))}
    write_model(folder / "model.h5", model, [])
    stretch = model.on_dofs(model.coordinates * [1.0, 0.0, 0.0])
    motion = np.stack([STATIC * stretch, np.zeros(model.size), ALTERNATING * stretch], axis=1)
    field = np.stack([motion, motion * [1.0, 2.0, 2.0]])
    synthetic.write_result(folder / "result.h5", [100.0, 101.0], {"tip": [1.0, 2.0]}, coordinates=field)
    with edited(folder / "result.h5") as file:
        file.attrs["model_file"] = str(folder / "model.h5")
        file.attrs["units"] = units
    return model


def rows(path):
    with path.open() as file:
        return list(csv.DictReader(file))


def test_a_table_has_the_cycle_at_the_point_of_the_largest_amplitude(tmp_path, capfd):
    model = bar(tmp_path)
    done = attrito_here(tmp_path, capfd, "stress", "result.h5")
    assert done.returncode == 0, done.stderr
    assert "point 1, 101 Hz: 16 nodes" in done.stdout
    found = rows(tmp_path / "stress.csv")
    assert [int(row["node"]) for row in found] == model.node_ids.tolist()
    for row, place in zip(found, model.coordinates, strict=True):
        values = {name: float(text) for name, text in row.items()}
        assert [values["x"], values["y"], values["z"]] == place.tolist()
        # Twelve digits are written.
        expected = {
            "point": 1,
            "frequency_hz": 101.0,
            "alternating_von_mises": 2 * ALTERNATING * VON_MISES,
            "mean_signed_von_mises": STATIC * VON_MISES,
            "alternating_principal": 2 * ALTERNATING * CONSTRAINED,
            "mean_principal": STATIC * CONSTRAINED,
            "peak_von_mises": (2 * ALTERNATING + STATIC) * VON_MISES,
            "alternating_xx": 2 * ALTERNATING * CONSTRAINED,
            "mean_xx": STATIC * CONSTRAINED,
            "mean_yy": STATIC * CONSTRAINED * POISSON / (1 - POISSON),
            "mean_xy": 0.0,
            "phase_1_deg": 90.0,
            "phase_2_deg": 270.0,
            "young_modulus": YOUNG,
        }
        assert {name: values[name] for name in expected} == pytest.approx(expected, rel=1e-11, abs=1e-11)


def test_node_sets_points_and_units_are_those_asked_for(tmp_path, capfd):
    model = bar(tmp_path, units="mm, t, s")
    arguments = ("--set", "root", "tip", "--points", "0,1", "-o", "some.csv", "--vtu", "some.vtu")
    done = attrito_here(tmp_path, capfd, "stress", "result.h5", *arguments)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split()[:3] == ["some.csv", "some_0.vtu", "some_1.vtu"]
    assert "about a mean of 1.6 N/mm^2" in done.stdout and " mm), about" in done.stdout
    found = rows(tmp_path / "some.csv")
    assert len(found) == 16 and {row["point"] for row in found} == {"0", "1"}
    chosen = np.isin(model.node_ids, [*model.node_sets["root"], *model.node_sets["tip"]])
    assert {int(row["node"]) for row in found} == set(model.node_ids[chosen].tolist())
    stress = [float(row["alternating_von_mises [N/mm^2]"]) for row in found]
    assert stress == pytest.approx([ALTERNATING * VON_MISES] * 8 + [2 * ALTERNATING * VON_MISES] * 8)
    assert "x [mm]" in found[0] and "young_modulus [N/mm^2]" in found[0]
    mesh = meshio.read(tmp_path / "some_1.vtu")
    drawn = mesh.point_data["alternating_von_mises"]
    assert np.array_equal(np.isnan(drawn), ~chosen) and np.nanmax(drawn) == pytest.approx(max(stress))
    # Between the instant of the greater stress and the mean
    assert mesh.point_data["displacement"][:, 0] == pytest.approx(2 * ALTERNATING * model.coordinates[:, 0])


def test_constants_that_no_deck_gives_are_given_by_options(tmp_path, capfd):
    bar(tmp_path, elastic=False)
    done = attrito_here(tmp_path, capfd, "stress", "result.h5")
    assert done.returncode == 2 and "elastic constants" in done.stderr and "--young and --poisson" in done.stderr
    assert not (tmp_path / "stress.csv").exists()
    arguments = ("--young", "2000", "--poisson", "0.25")
    assert attrito_here(tmp_path, capfd, "stress", "result.h5", *arguments).returncode == 0
    assert float(rows(tmp_path / "stress.csv")[0]["mean_xx"]) == pytest.approx(STATIC * CONSTRAINED)
    # Those of the deck count.
    bar(tmp_path)
    assert attrito_here(tmp_path, capfd, "stress", "result.h5", "--young", "7", "--poisson", "0").returncode == 0
    assert float(rows(tmp_path / "stress.csv")[0]["mean_xx"]) == pytest.approx(STATIC * CONSTRAINED)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--set", "root", "rout"), "--set = 'rout': expected a node set of the model (root, tip)"),
        (("--young", "2000"), "--young = 'given': expected --poisson with it"),
        (("--young", "0", "--poisson", "0.3"), "--young = 0.0: expected a number above 0"),
        (("--young", "1", "--poisson", "0.5"), "--poisson = 0.5: expected a number above -1 and below 0.5"),
        (("--tensile-strength", "9"), "--tensile-strength = 'given': expected --fatigue-strength with it"),
        (("--fatigue-strength", "-1", "--tensile-strength", "9"), "--fatigue-strength = -1.0: expected a number above"),
        (("--picture", "stress.vtu"), "a writable .png, .pdf or .svg file"),
        (("--points", "7"), "point = 7: expected a number from 0 to 1"),
        (("--monitor", "root"), "--monitor = 'root': expected one of tip"),
        (("--mode", "1"), "--mode = 1: expected a file of `attrito linear-modes` or `attrito mode`"),
        (("--amplitude", "2"), "--amplitude = 2.0: expected a file of `attrito linear-modes`"),
        (("--wheel",), "--wheel = 'given': expected --vtu with it"),
        (("--wheel", "--vtu", "a.vtu"), "--wheel = 'given': expected a result of a job with [cyclic]"),
        (("-o", "stress.h5"), "-o = 'stress.h5': expected a file .csv"),
        (("--vtu", "stress.csv"), "--vtu = 'stress.csv': expected a file .vtu"),
        (("-o", "nowhere/stress.csv"), "nowhere/stress.csv"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_a_fault_of_the_options_is_told(tmp_path, capfd, arguments, said):
    bar(tmp_path)
    done = attrito_here(tmp_path, capfd, "stress", "result.h5", *arguments)
    assert done.returncode == 2 and said in done.stderr.replace("\n", " "), done.stderr


def test_linear_modes_have_the_stress_of_an_amplitude(tmp_path, capfd):
    bar(tmp_path)
    with edited(tmp_path / "result.h5") as file:
        file.attrs["format"] = "attrito linear modes"
        file["points/coordinates"][:, :, 0] = 0.0
    (tmp_path / "result.h5").rename(tmp_path / "bar.modes.h5")
    done = attrito_here(tmp_path, capfd, "stress", "bar.modes.h5", "--mode", "2", "--amplitude", "0.5")
    assert done.returncode == 0, done.stderr
    row = rows(tmp_path / "bar.modes.stress.csv")[0]
    assert row["mode"] == "2" and "mode 2, 101 Hz" in done.stdout
    assert float(row["alternating_xx"]) == pytest.approx(ALTERNATING * CONSTRAINED) and float(row["mean_xx"]) == 0.0
    assert attrito_here(tmp_path, capfd, "stress", "bar.modes.h5").returncode == 2


def test_nodes_whose_motion_was_not_recovered_are_left_out_or_refused_where_asked_for(tmp_path, capfd):
    model = bar(tmp_path)
    kept = np.flatnonzero(~np.isin(model.dof_node, model.node_sets["tip"]))
    with edited(tmp_path / "result.h5") as file, h5py.File(tmp_path / "rom.h5", "w") as rom:
        file.attrs["rom_file"] = str(tmp_path / "rom.h5")
        rom["recovery/basis"], rom["recovery/dof"] = np.eye(model.size)[:, kept], kept.astype(np.int64)
        rom["boundary/dof"] = np.arange(0)
    done = attrito_here(tmp_path, capfd, "stress", "result.h5")
    assert done.returncode == 0, done.stderr
    # The last of three bricks has no stress, and its nodes have elements that lack it.
    assert "left out: nodes of 1 elements for their motion" in done.stdout and "8 nodes" in done.stdout
    done = attrito_here(tmp_path, capfd, "stress", "result.h5", "--set", "tip")
    assert done.returncode == 2 and "motion = '1 elements C3D8 at the chosen nodes'" in done.stderr


def test_a_result_of_several_levels_names_them(tmp_path, capfd):
    bar(tmp_path)
    with edited(tmp_path / "result.h5") as file:
        file["points/level"][:] = [0.5, 2.0]
    done = attrito_here(tmp_path, capfd, "stress", "result.h5", "--points", "0,1")
    assert "point 0, 100 Hz, level 0.5: 16 nodes" in done.stdout, done.stderr
    assert [row["level"] for row in rows(tmp_path / "stress.csv")] == ["0.5"] * 16 + ["2"] * 16


def test_strengths_add_goodman_s_sum(tmp_path, capfd):
    bar(tmp_path)
    arguments = ("--points", "0", "--fatigue-strength", "8", "--tensile-strength", "16")
    done = attrito_here(tmp_path, capfd, "stress", "result.h5", *arguments)
    expected = ALTERNATING * VON_MISES / 8 + STATIC * VON_MISES / 16
    assert done.returncode == 0 and f"largest part of the strength by Goodman {expected:.4g} at node" in done.stdout
    assert [float(row["goodman"]) for row in rows(tmp_path / "stress.csv")] == pytest.approx([expected] * 16)
    found = attrito.stress(tmp_path / "result.h5", 0, strengths=(8.0, 16.0))
    # Compression neither helps nor harms.
    squeezed = replace(found, cycle=cycle_of(found.harmonics * [[[-1.0]], [[1.0]], [[1.0]]]))
    assert squeezed.goodman == pytest.approx(np.full(16, ALTERNATING * VON_MISES / 8))


def test_the_picture_shows_the_stress_of_faces_and_the_nodes_on_a_goodman_diagram(tmp_path, capfd, written):
    bar(tmp_path, units="mm, t, s")
    arguments = ("--set", "tip", "--fatigue-strength", "8", "--tensile-strength", "16", "--picture", "bar.png")
    done = attrito_here(tmp_path, capfd, "stress", "result.h5", *arguments)
    assert done.returncode == 0 and done.stdout.split()[1] == "bar.png", done.stderr
    (figure,) = written
    body, diagram = figure.axes[:2]
    (faces,) = body.collections
    # Of the 14 outer faces of three bricks seven are seen from a corner, one of them with four known nodes.
    colours = faces.get_facecolor()[:, :3]
    known = np.ptp(colours, axis=1) > 1e-9
    assert len(colours) == 7 and known.sum() == 1
    # Bricks without curvature have the largest stress at all nodes.
    towards = np.abs(DIRECTIONS[0]) / np.linalg.norm(DIRECTIONS[0])
    shade = DARKEST + (1 - DARKEST) * towards[0]
    assert colours[known][0] == pytest.approx(np.array(matplotlib.colormaps[MAP](1.0))[:3] * shade)
    nodes = line(diagram, "nodes")
    assert nodes.get_ydata() == pytest.approx(np.full(4, 2 * ALTERNATING * VON_MISES))
    assert nodes.get_xdata() == pytest.approx(np.full(4, STATIC * VON_MISES))
    limit = line(diagram, "Goodman's line")
    assert limit.get_xydata().tolist() == [[0.0, 8.0], [0.0, 8.0], [16.0, 0.0]]
    assert "(N/mm\u00b2)" in diagram.get_ylabel()


def test_strains_are_those_of_the_motion(tmp_path, capfd):
    bar(tmp_path)
    assert attrito_here(tmp_path, capfd, "stress", "result.h5", "--strain", "--points", "0").returncode == 0
    for row in rows(tmp_path / "stress.csv"):
        values = {name: float(text) for name, text in row.items() if "strain" in name}
        expected = {"alternating_strain_xx": ALTERNATING, "alternating_principal_strain": ALTERNATING}
        expected |= {"mean_strain_xx": STATIC, "mean_principal_strain": STATIC}
        assert len(values) == 14
        assert values == pytest.approx(dict.fromkeys(values, 0.0) | expected, abs=1e-12)


def test_what_is_read_is_not_written_over(tmp_path, capfd):
    bar(tmp_path)
    (tmp_path / "result.h5").rename(tmp_path / "result.csv")
    done = attrito_here(tmp_path, capfd, "stress", "result.csv", "-o", "result.csv")
    assert done.returncode == 2 and "which is read" in done.stderr


def test_python_gives_the_same_as_arrays(tmp_path):
    model = bar(tmp_path, units="mm, t, s")
    found = attrito.stress(tmp_path / "result.h5", 0, sets=["root"])
    assert found.node.tolist() == [node for node in model.node_ids if node in model.node_sets["root"]]
    assert found.cycle.alternating_von_mises == pytest.approx(np.full(4, ALTERNATING * VON_MISES))
    assert found.harmonics.shape == (3, 4, 6) and found.stress_unit == "N/mm^2"
    assert found.harmonics[2, :, 0] == pytest.approx(np.full(4, ALTERNATING * CONSTRAINED))
    frame = found.to_dataframe()
    assert len(frame) == 4 and "mean_principal [N/mm^2]" in frame
    with attrito.Result(tmp_path / "result.h5") as result:
        assert attrito.stress(result).point == 1
    with pytest.raises(InputError, match="a number from 0 to 1"):
        attrito.stress(tmp_path / "result.h5", 2)


DECK = """*NODE
1, 0, 0, 0
2, 1, 0, 0
3, 0, 1, 0
4, 0, 0, 1
5, 1, 1, 1
6, 2, 2, 2
*ELEMENT, TYPE=C3D4, ELSET=first
11, 1, 2, 3, 4
*ELEMENT, TYPE=C3D4
12, 2, 3, 4, 5
13, 3, 4, 5, 6
14, 2, 4, 5, 6
15, 2, 3, 5, 6
*ELSET, ELSET=Range, GENERATE
12, 13
*ELSET, ELSET=Both
FIRST, range, 14
*Elset, elset=last
15
*Material, name=Steel
*Density
7.8e-9
*Elastic
2.1D5, 0.3, 20.
1.9D5, 0.3, 500.
*MATERIAL, NAME=CRYSTAL
*ELASTIC, TYPE=ENGINEERING CONSTANTS
1., 1., 1., 0.3, 0.3, 0.3, 1., 1.
1.
*MATERIAL, NAME=CORK
*ELASTIC
30.
*SOLID SECTION, ELSET=BOTH, MATERIAL=STEEL
*SOLID SECTION, ELSET=range, MATERIAL=cork
*SOLID SECTION, ELSET=last, MATERIAL=crystal
"""


def test_constants_of_a_deck_reach_their_elements(tmp_path):
    """By sets of sets and ranges; a later section counts; of temperatures the first; no Poisson's ratio is none."""
    (tmp_path / "deck.inp").write_text(DECK)
    mesh = read_mesh(tmp_path / "deck.inp")
    steel, cork, unknown = (2.1e5, 0.3), (30.0, 0.0), (np.nan, np.nan)
    expected = [steel, cork, cork, steel, unknown]
    assert mesh.elements["C3D4"][0].tolist() == [11, 12, 13, 14, 15]
    assert np.array_equal(mesh.elastic["C3D4"], expected, equal_nan=True)


def test_a_later_section_of_unknown_constants_unsets_those_of_an_earlier_one(tmp_path):
    later = "*SOLID SECTION, ELSET=BOTH, MATERIAL=STEEL\n"
    (tmp_path / "deck.inp").write_text(f"{DECK}{later}*SOLID SECTION, ELSET=range, MATERIAL=crystal\n")
    mesh = read_mesh(tmp_path / "deck.inp")
    assert np.isnan(mesh.elastic["C3D4"]).all(axis=1).tolist() == [False, True, True, False, True]
    assert np.array_equal(mesh.density["C3D4"], [7.8e-9, np.nan, np.nan, 7.8e-9, np.nan], equal_nan=True)


@pytest.mark.parametrize(
    ("lines", "known"),
    [
        ("7.8e-9, 20.\n7.8e-9, 600.", True),
        ("7.8e-9, 20.\n7e-9, 600.", False),
        ("7.8e-9\n*Density\n7.8e-9, 20.\n7e-9, 600.", False),
        ("7.8e-9, 20.\n7e-9, 600.\n*Density\n7.8e-9", True),
    ],
)
def test_a_density_that_depends_on_the_temperature_is_not_known(tmp_path, lines, known):
    (tmp_path / "deck.inp").write_text(DECK.replace("*Density\n7.8e-9", f"*Density\n{lines}"))
    assert ("C3D4" in read_mesh(tmp_path / "deck.inp").density) == known


@pytest.mark.parametrize("constants", ["<young>, 0.3", "-1., 0.3", "1e3, 0.5", ",", "abc"])
def test_constants_that_are_none_stay_unknown(tmp_path, constants):
    (tmp_path / "deck.inp").write_text(DECK.replace("2.1D5, 0.3, 20.\n1.9D5, 0.3, 500.", constants))
    assert np.isnan(read_mesh(tmp_path / "deck.inp").elastic["C3D4"][0]).all()


def test_a_model_file_gives_back_constants_and_refuses_those_of_no_solid(tmp_path):
    model = bar(tmp_path)
    model.elastic["C3D8"][1] = np.nan
    write_model(tmp_path / "model.h5", model, [])
    read = read_model(str(tmp_path / "model.h5"), matrices=False)
    assert np.array_equal(read.elastic["C3D8"], model.elastic["C3D8"], equal_nan=True)
    for name, value in (("young_modulus", -1.0), ("young_modulus", np.inf), ("poisson_ratio", 0.5)):
        write_model(tmp_path / "model.h5", model, [])
        with edited(tmp_path / "model.h5") as file:
            file[f"elements/C3D8/{name}"][2] = value
        with pytest.raises(InputError, match="of element 2'?: expected a modulus above 0"):
            read_model(str(tmp_path / "model.h5"), matrices=False)


def test_a_mode_s_file_without_a_model_is_refused(tmp_path, capfd):
    bar(tmp_path)
    with edited(tmp_path / "result.h5") as file:
        file.attrs["model_file"] = ""
        file.attrs["job"] = json.dumps({"output": {"monitors": [{"name": "tip"}]}})
    done = attrito_here(tmp_path, capfd, "stress", "result.h5")
    assert done.returncode == 2 and "a result of a model with a mesh" in done.stderr
