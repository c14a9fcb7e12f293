"""Text files as other programs and editors write them: the same mesh, gaps and job, or a message that says the line."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from attrito.importers import read_mesh
from attrito.job.reading import read_job
from attrito.scene.gap_file import read_gaps
from attrito.support.errors import InputError
from attrito.support.text_files import number

CORNERS = [(0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0), (0, 0, 3), (2, 0, 3), (2, 1, 3), (0, 1, 3)]
NODES = "\n".join(f"{k + 1}, {x}.0, {y}.0, {z}.0" for k, (x, y, z) in enumerate(CORNERS))
BRICK = "7, 1, 2, 3, 4, 5, 6, 7, 8"
DECK = f"*NODE\n{NODES}\n*ELEMENT, TYPE=C3D8, ELSET=all\n{BRICK}\n*NSET, NSET=foot\n1, 2, 3, 4\n"
GRIDS = "\n".join(f"GRID,{k + 1},,{x}.0,{y}.0,{z}.0" for k, (x, y, z) in enumerate(CORNERS))
HEXA = "CHEXA,7,1,1,2,3,4,5,6,+A\n+A,7,8"


def check(mesh) -> None:
    assert mesh.coordinates.tolist() == [list(corner) for corner in CORNERS]
    (elements,) = mesh.elements.values()
    assert elements[0].tolist() == [7] and elements[1].tolist() == [[1, 2, 3, 4, 5, 6, 7, 8]]


ENCODED = {
    "a mark of UTF-8": b"\xef\xbb\xbf" + DECK.encode(),
    "ends of lines of Windows": DECK.replace("\n", "\r\n").encode(),
    "ends of lines of old Macs": DECK.replace("\n", "\r").encode(),
    "a comment in latin-1": b"** Pr\xfcfk\xf6rper\n" + DECK.encode(),
    "UTF-16": DECK.encode("utf-16"),
    "exponents of Fortran": DECK.replace(".0", ".0D0").encode(),
    "small exponents of Fortran": DECK.replace("2.0", "20.d-1").encode(),
}


@pytest.mark.parametrize("content", ENCODED.values(), ids=ENCODED)
def test_a_deck_is_the_same_in_whatever_encoding(content, tmp_path):
    (tmp_path / "mesh.inp").write_bytes(content)
    mesh = read_mesh(tmp_path / "mesh.inp")
    check(mesh)
    assert mesh.node_sets["foot"].tolist() == [1, 2, 3, 4]


SAID_OTHERWISE = {
    "nodes in a file": DECK.replace(f"*NODE\n{NODES}", "*NODE, INPUT=nodes.txt"),
    "elements in a file": DECK.replace(f"ELSET=all\n{BRICK}", "ELSET=all, INPUT=elements.txt"),
    "a set in a file": DECK.replace("NSET=foot\n1, 2, 3, 4", "NSET=foot, INPUT=foot.txt"),
    "a set of elements' nodes": DECK.replace("NSET=foot\n1, 2, 3, 4", "NSET=foot, ELSET=all"),
    "normals at nodes": DECK.replace(NODES, NODES.replace("\n", ", 0.0, 0.6, 0.8\n")),
    "a keyword that ends in a comma": DECK.replace("NSET=foot", "NSET=foot,"),
    "a keyword that ends in a comma before a name": f"{DECK}*NSET, NSET=foot,\nFOOT\n",
    "a keyword over lines": DECK.replace("*NSET, NSET=foot", "*NSET,\n** between\nNSET=foot,\nUNSORTED,"),
    "an element over lines": DECK.replace(BRICK, BRICK.replace("4, 5", "4,\n5")),
    "a node of pre-tension by its set": f"{DECK}*PRE-TENSION SECTION, SURFACE=s, NODE=FOOT\n",
    "elements at nodes": f"{DECK}*ELEMENT, TYPE=DCOUP3D, ELSET=c\n8, 1\n*ELEMENT, TYPE=MASS, ELSET=m\n9, 2\n",
    "a comma in a name": DECK.replace("NSET=foot", 'NSET="foot, left"'),
}


@pytest.mark.parametrize("deck", SAID_OTHERWISE.values(), ids=SAID_OTHERWISE)
def test_what_a_deck_says_in_other_ways_is_read(deck, tmp_path):
    (tmp_path / "nodes.txt").write_text(f"** nodes\n{NODES}\n")
    (tmp_path / "elements.txt").write_text(f"{BRICK}\n")
    (tmp_path / "foot.txt").write_text("1, 2\n\n3, 4\n")
    (tmp_path / "mesh.inp").write_text(deck)
    mesh = read_mesh(tmp_path / "mesh.inp")
    check(mesh)
    ((name, nodes),) = mesh.node_sets.items()
    assert name == ("foot, left" if '"' in deck else "foot")
    assert nodes.tolist() == list(range(1, 9 if "ELSET=all\n" in deck.split("*NSET")[1] else 5))


NOT_READ = {
    "*NODE, SYSTEM=C": DECK.replace("*NODE", "*NODE, SYSTEM=C"),
    "*SYSTEM": f"*SYSTEM\n10.0, 20.0, 30.0\n{DECK}",
    "*ELGEN": f"{DECK}*ELGEN\n7, 2, 4, 1\n",
    "*ELCOPY": f"{DECK}*ELCOPY, OLD SET=all, NEW SET=more, SHIFT NODES=8, ELEMENT SHIFT=1\n",
    "*NCOPY": f"{DECK}*NCOPY, OLD SET=foot, CHANGE NUMBER=100, SHIFT\n0.0, 0.0, 9.0\n",
    "*NGEN": f"{DECK}*NGEN\n1, 5, 1\n",
    "*NSET, UNKNOWN": DECK.replace("NSET=foot", "NSET=foot, ANYTHING"),
    "an empty set": f"{DECK}*NSET, NSET=none\n",
    "an empty range": f"{DECK}*NSET, NSET=none, GENERATE\n20, 30, 1\n",
    "commas for points": DECK.replace("3, 2.0, 1.0", "3, 2,5, 1.0"),
    "groups of digits in an id": DECK.replace("2, 2.0", "2_000, 2.0"),
    "groups of digits in a number": DECK.replace("2, 2.0", "2, 2_0"),
    "no number": DECK.replace("2, 2.0", "2, 2.x0"),
    "a node too many": DECK.replace(BRICK, f"{BRICK}, 9"),
    "a node of pre-tension that is none": f"{DECK}*PRE-TENSION SECTION, SURFACE=s, NODE=none\n",
    "a file that is missing": DECK.replace(f"*NODE\n{NODES}", "*NODE, INPUT=missing.txt"),
}


@pytest.mark.parametrize("deck", NOT_READ.values(), ids=NOT_READ)
def test_what_a_deck_says_that_is_not_read_is_a_fault_with_its_line(deck, tmp_path):
    (tmp_path / "mesh.inp").write_text(deck)
    with pytest.raises(InputError, match=r"mesh\.inp: line \d+, \*"):
        read_mesh(tmp_path / "mesh.inp")


BULK = {
    "by continuations": f"{GRIDS}\n{HEXA}\nENDDATA\n",
    "by itself": f"{GRIDS}\nCHEXA,7,1,1,2,3,4,5,6,7,8\nENDDATA\n",
    "with a mark": f"\ufeff{GRIDS}\n{HEXA}\nENDDATA\n",
    "with what follows the end": f"{GRIDS}\n{HEXA}\nENDDATA\nGRID,1,,9.0,9.0,9.0\n",
    "from a file named in two lines": f"INCLUDE 'sub folder/\n  grids.dat'\n{HEXA}\nENDDATA\n",
}


@pytest.mark.parametrize("bulk", BULK.values(), ids=BULK)
def test_bulk_data_goes_on_in_several_ways(bulk, tmp_path):
    (tmp_path / "sub folder").mkdir()
    (tmp_path / "sub folder" / "grids.dat").write_text(GRIDS)
    (tmp_path / "mesh.bdf").write_text(bulk, encoding="utf-8")
    check(read_mesh(tmp_path / "mesh.bdf"))


def test_an_archive_of_ansys_in_compact_form_is_refused_by_that_name(tmp_path):
    nodes = "\n".join(f"{k + 1:9d}" + "".join(f"{x:20.9E}" for x in corner) for k, corner in enumerate(CORNERS))
    elements = "        7" + "".join(f"{k:9d}" for k in range(1, 9))
    archive = f"et,1,185\nnblock,3\n(1i9,3e20.9e3)\n{nodes}\n-1\neblock,10,COMPACT,,1\n(10i9)\n{elements}\n-1\n"
    (tmp_path / "mesh.cdb").write_text(archive)
    with pytest.raises(InputError, match="COMPACT"):
        read_mesh(tmp_path / "mesh.cdb")


GAPS = {
    "commas": "3, 0.5\n4, 1.5D-1\n",
    "a line of names": "node, gap\n3, 0.5\n4, 0.15\n",
    "decimal commas": "Knoten;Spalt\r\n3;0,5\r\n4;0,15\r\n",
    "tabs": "3\t0.5\n4\t0.15\n",
    "a mark": "\ufeff3 0.5\n4 0.15\n",
}


@pytest.mark.parametrize("text", GAPS.values(), ids=GAPS)
def test_gaps_are_the_same_in_whatever_dialect(text, tmp_path):
    (tmp_path / "gaps.txt").write_text(text, encoding="utf-8", newline="")
    model = SimpleNamespace(node_ids=np.array([3, 4]))
    pairs = SimpleNamespace(nodes=np.array([[0], [1]]), shape=np.ones((2, 1)))
    assert read_gaps(str(tmp_path / "gaps.txt"), model, pairs).tolist() == [0.5, 0.15]


def test_a_job_may_begin_with_a_mark_and_what_is_not_utf_8_is_said_with_its_line(tmp_path):
    path = tmp_path / "job.toml"
    path.write_bytes(b'# first line\n# Pr\xe4zision\n[model]\nfile = "m.h5"\n')
    with pytest.raises(InputError, match=r"job\.toml: line 2 .*UTF-8"):
        read_job(str(path))
    path.write_bytes(b'\xef\xbb\xbf[model]\nfil = "m.h5"\n')
    with pytest.raises(InputError, match="fil"):
        read_job(str(path))


@pytest.mark.parametrize(("word", "value"), [("1.5D-3", 1.5e-3), ("2d0", 2.0), (" -3.D+2", -300.0), ("4e1", 40.0)])
def test_exponents_of_fortran_are_exponents(word, value):
    assert number(word) == value


@pytest.mark.parametrize("word", ["d", "1d", "D5", "1.0DD0", "nodes", "1_000", "1.5e1_0"])
def test_what_is_no_number_stays_none(word):
    with pytest.raises(ValueError, match="could not convert"):
        number(word)
