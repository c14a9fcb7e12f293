"""What a deck makes depend on others: forces on it are refused, angles and elongations are no displacements."""

from __future__ import annotations

import re
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from attrito.importers import import_model
from attrito.importers.deck_mesh import read_deck_mesh
from attrito.model.model_file import read_model
from attrito.scene.deck_loads import deck_force
from attrito.support.errors import InputError

STRIP = (Path(__file__).resolve().parents[2] / "input" / "strip.inp").read_text()
TOP = 6.0


def corners() -> dict[int, tuple[float, float, float]]:
    """Corner nodes and others of the strip by id."""
    lines = STRIP.split("*NODE")[1].split("*")[0].splitlines()[1:]
    rows = [[float(word) for word in line.split(",")] for line in lines if line.strip()]
    return {int(row[0]): tuple(row[1:]) for row in rows}


PAD = [node for node, (x, _, z) in corners().items() if z == TOP and 45.0 <= x <= 55.0]
OTHERS = [node for node, (x, _, z) in corners().items() if z == TOP and x > 100.0]
RIGID = (
    "*NODE, NSET=ref\n9001, 50., 4., 20.\n*NODE, NSET=rot\n9002, 50., 4., 20.\n*NSET, NSET=pad\n{pad}\n",
    "*RIGID BODY, NSET=pad, REF NODE=9001, ROT NODE=9002\n",
)
EQUATION = ("", f"*EQUATION\n2\n{PAD[0]}, 3, 1.0, {PAD[1]}, 3, -1.0\n")


def imported(folder: Path, parts: tuple[str, str]):
    """The strip with lines before its elements and before its supports, through CalculiX and the import."""
    nodes, constraint = (part.format(pad=",\n".join(map(str, PAD))) for part in parts)
    deck = STRIP.replace("*ELEMENT", f"{nodes}*ELEMENT", 1).replace("*BOUNDARY", f"{constraint}*BOUNDARY", 1)
    (folder / "deck.inp").write_text(deck)
    subprocess.run(["ccx", "-i", "deck"], cwd=folder, check=True, capture_output=True)
    _, notes = import_model(folder / "m.h5", calculix_job=folder / "deck", mesh=folder / "deck.inp")
    return read_model(folder / "m.h5"), notes


@pytest.fixture(scope="module", params=["rigid body", "equation"])
def case(request, tmp_path_factory):
    return imported(tmp_path_factory.mktemp("deck"), RIGID if request.param == "rigid body" else EQUATION)


def force_of(folder: Path, model, text: str) -> np.ndarray:
    (folder / "load.inp").write_text(text)
    return deck_force(folder / "load.inp", model)[0]


def test_forces_on_nodes_that_depend_on_others_are_refused(case, tmp_path):
    model, notes = case
    assert any("forces on them are refused" in note for note in notes)
    with pytest.raises(InputError, match=r"3 of 5 on nodes that"):
        force_of(tmp_path, model, f"*CLOAD\n{PAD[0]}, 3, -3.0\n{OTHERS[0]}, 1, 2.0\n")
    force = force_of(tmp_path, model, f"*CLOAD\n{OTHERS[0]}, 3, -3.0\n{OTHERS[1]}, 3, 2.0\n")
    assert force.sum() == -1.0


def test_forces_on_what_is_no_displacement_are_refused(tmp_path):
    """In CalculiX a force at the node of the angles is a moment; a reference node may depend on others, too."""
    model, _ = imported(tmp_path, RIGID)
    assert force_of(tmp_path, model, "*CLOAD\n9001, 3, 10.0\n").sum() == 10.0
    with pytest.raises(InputError, match=r"10 of 15 on node 9002.*a moment"):
        force_of(tmp_path, model, "*CLOAD\n9002, 3, -10.0\n9001, 3, 5.0\n")
    model, _ = imported(tmp_path, (RIGID[0], f"{RIGID[1]}*BOUNDARY\n9002, 1, 3\n"))
    assert force_of(tmp_path, model, "*CLOAD\n9002, 3, -10.0\n9001, 3, 5.0\n").sum() == 5.0
    model, _ = imported(tmp_path, ("*NODE\n9001, 50., 4., 20.\n", EQUATION[1]))
    with pytest.raises(InputError, match="10 of 10 on nodes that"):
        force_of(tmp_path, model, "*CLOAD\n9001, 3, -10.0\n")


@pytest.mark.parametrize("turns", [False, True])
def test_a_force_on_a_support_is_no_fault(case, tmp_path, turns):
    """If that is pinned it may have rotations left, of a beam that joins the solids."""
    model, _ = case
    held = next(node for node, (x, _, _) in corners().items() if x == 0.0)
    if turns:
        names = {
            "dof_node": np.append(model.dof_node, [held] * 3),
            "dof_direction": np.append(model.dof_direction, [4, 5, 6]),
        }
        model = replace(model, **names)
    assert not force_of(tmp_path, model, f"*CLOAD\n{held}, 3, -3.0\n").any()


def test_angles_of_a_rigid_body_are_no_displacements(tmp_path):
    model, notes = imported(tmp_path, RIGID)
    plain, _ = imported(tmp_path, ("", ""))

    def mass(of) -> float:
        along = of.on_dofs(np.tile([0.0, 0.0, 1.0], (len(of.node_ids), 1)))
        return float(along @ (of.mass @ along))

    assert mass(model) == pytest.approx(mass(plain), rel=1e-12)
    assert sorted(model.dof_direction[model.dof_node == 9002]) == [4, 5, 6]
    assert any("3 of the dofs are rotations" in note for note in notes)


def test_what_is_given_and_what_goes_into_supports_is_said(tmp_path):
    model, _ = imported(tmp_path, ("", ""))
    held = [node for node, (x, _, _) in corners().items() if x == 0.0]
    lines = f"*CLOAD\n{OTHERS[0]}, 1, 2.0\n{OTHERS[1]}, 3, -3.0\n{OTHERS[1]}, 3, -1.0\n"
    for more, said in (
        ("", "forces of 2, 0, -4 along x, y, z"),
        (f"{held[0]}, 3, -0.5\n{held[1]}, 2, 1.5\n", "forces of 2, 1.5, -4.5 along x, y, z, 0, 1.5, -0.5 of them into"),
    ):
        (tmp_path / "load.inp").write_text(lines + more)
        force, words = deck_force(tmp_path / "load.inp", model)
        assert said in words and words.endswith("supports" if more else "x, y, z")
        applied = [force[model.dof_direction == direction].sum() for direction in (1, 2, 3)]
        assert applied == pytest.approx([2.0, 0.0, -4.0])


def test_supports_by_name_hold_what_they_do_by_numbers(tmp_path):
    def held(support):
        deck = tmp_path / "deck.inp"
        deck.write_text(re.sub(r"(?<=\*BOUNDARY\n)[^*]*", f"{PAD[0]}, {support}\n", STRIP))
        return read_deck_mesh(deck).held.tolist()

    assert held("ENCASTRE") == held("1, 6") and held("pinned") == held("1, 3") == held("PINNED")
    assert [direction for _, direction in held("YSYMM")] == [2, 4, 6]


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        ("*CONTACT PAIR, INTERACTION=i\nfoot, foot\n", "not read: *CONTACT PAIR, line {line}; what"),
        ("*MODEL CHANGE, TYPE=ELEMENT, REMOVE\nstrip\n", "not read: *MODEL CHANGE, line {line}; what"),
        ("*BOUNDARY\nfoot, 3, 3, 0.1\n", "supports that move (*BOUNDARY, line {line}) are held at zero"),
        ("*TRANSFORM, NSET=tip\n0., 1., 0., -1., 0., 0.\n", "go along these"),
        ("*DISTRIBUTING COUPLING, ELSET=strip\n1, 1.\n", "depend on others (*DISTRIBUTING COUPLING, line {line})"),
        ("*BOUNDARY\nfoot, 3, 3, 0.\n*AMPLITUDE, NAME=a\n0., 0.\n", None),
    ],
)
def test_what_a_deck_says_without_an_effect_here_is_told(tmp_path, lines, expected):
    (tmp_path / "deck.inp").write_text(STRIP.replace("*STEP", f"{lines}*STEP", 1))
    mesh = read_deck_mesh(tmp_path / "deck.inp")
    said = mesh.remarks + [f"depend on others ({'; '.join(mesh.constraints)})" for _ in mesh.constraints]
    line = STRIP[: STRIP.index("*STEP")].count("\n") + 1
    assert any(expected.format(line=line) in one for one in said) if expected else said == []
