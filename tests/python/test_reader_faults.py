"""Faulty twins of matrix files: each is told in one message with file, place, value and what was expected."""

from __future__ import annotations

import importlib.util
import os
import re
from pathlib import Path

import matrix_writers as write
import numpy as np
import pytest
import scipy.io
import scipy.sparse as sparse
from edited import edited
from faulty_files import cut, fault_of, replaced
from two_springs import DATA, STIFFNESS

from attrito.importers import read_matrix, read_mesh, unpacked
from attrito.importers.dof_file import read_dof_file
from attrito.support.errors import InputError

STIF, HB, PCH, SMALL, OP4 = (
    f"two_springs{end}" for end in ("_STIF1.mtx", "_stiffness.hb", ".pch:KAAX", "_small.bdf:KAAX", ".op4:KAA")
)
MARKET = "symmetric.mtx"
NUMBERS = "numbers row node, dof, column node, dof, value"

# File, change, place, what was expected.
TWINS = {
    "Abaqus: cut off in a line": (
        STIF,
        cut(5),
        "last line = '1000,3, 1000,3,  4.00000000000000'",
        "the file is cut off",
    ),
    "Abaqus: a field missing": (STIF, replaced("12,2, 12,2,", "12,2, 12,"), "line 3", NUMBERS),
    "Abaqus: no number": (STIF, replaced("2.50000000000000e+00", "2.5x"), "line 5", NUMBERS),
    "Abaqus: not finite": (STIF, replaced("2.50000000000000e+00", "nan"), "line 5", NUMBERS),
    "Abaqus: node 0": (STIF, replaced("1000,3, 1000,3", "0,1, 0,1"), "line 6", "node ids, but for 0"),
    "Abaqus: a dof of an internal node": (STIF, replaced("1000,3, 1000,3", "-1,10, -1,10"), "line 6", "dofs 1 to 6"),
    "Abaqus: a temperature": (STIF, replaced("1000,3, 1000,3", "1000,11, 1000,11"), "line 6", "dofs 1 to 6"),
    "Abaqus: half a node": (STIF, replaced("1000,3, 1000,3", "1.5,3, 1000,3"), "line 6", "node ids, but for 0"),
    "Abaqus: an entry twice": (
        STIF,
        lambda text: text + "12,2, 1000,1, 1.0\n12,2, 12,2, 3.0\n",
        "stiffness",
        "every entry once",
    ),
    "Abaqus: triangles that differ": (
        STIF,
        lambda text: text + "12,2, 1000,1, -1.1\n",
        "-1.1000000000000001 against -1 at node 12 direction 2, node 1000 direction 1 and its mirror",
        "a symmetric matrix",
    ),
    "Abaqus: half of a triangle twice": (
        STIF,
        lambda text: text + "12,2, 1000,3, 1.0\n12,2, 1000,1, -1.0\n",
        "node 12 direction 2, node 1000 direction 3 without its mirror image (1 such entries)",
        "one triangle, or both of them with the same entries",
    ),
    "Abaqus: an element's matrix": (
        STIF,
        lambda text: "*MATRIX,TYPE=STIFFNESS\n" + text,
        "line 1 = '*MATRIX,TYPE=STIFFNESS'",
        "a global matrix, of *MATRIX OUTPUT",
    ),
    "Abaqus: nothing but comments": (STIF, lambda text: "** nothing\n", "stiffness", "a matrix file"),
    "Harwell-Boeing: values missing": (HB, lambda text: "\n".join(text.split("\n")[:8]) + "\n", "3 values", "4 values"),
    "Harwell-Boeing: cut off in a line": (
        HB,
        lambda text: text[: text.index("2.5000E+00") + 4],
        "'3 values'",
        "4 values",
    ),
    "Harwell-Boeing: complex": (HB, replaced("RSA", "CSA"), "line 3 = 'CSA'", "RSA or RUA"),
    "Harwell-Boeing: not square": (
        HB,
        replaced("3             3             4", "3             2             4"),
        "3 x 2",
        "square",
    ),
    "Harwell-Boeing: no format": (
        HB,
        replaced("(8I5)           (8I5)", "8I5             hello"),
        "lines 2 to 4",
        "header",
    ),
    "Harwell-Boeing: no number": (
        HB,
        replaced("-1.0000E+00", "-1.00x0E+00"),
        "line 8",
        "values in 3 fields of 12 characters",
    ),
    "Harwell-Boeing: a row too far": (
        HB,
        replaced("    1    2    2    3", "    1    2    2    4"),
        "4 among the row numbers",
        "1 to 3",
    ),
    "Harwell-Boeing: pointers that fall": (
        HB,
        replaced("    1    3    4    5", "    1    4    3    5"),
        "column pointers",
        "ascending",
    ),
    "Harwell-Boeing: an entry twice": (
        HB,
        replaced("    1    2    2    3", "    1    1    2    3"),
        "row 1, column 1 twice",
        "every entry once",
    ),
    "DMIG: complex": (
        PCH,
        replaced("       6       2       0", "       6       4       0"),
        "line 2",
        "type 1 or 2, a real matrix",
    ),
    "DMIG: rectangular": (
        PCH,
        replaced("       6       2       0", "       9       2       0"),
        "line 2",
        "a square matrix",
    ),
    "DMIG: no such form": (
        PCH,
        replaced("       6       2       0", "       5       2       0"),
        "line 2",
        "form 6 (symmetric) or 1",
    ),
    "DMIG: no header": (PCH, replaced("DMIG    KAAX           0", "$"), "line 3", "a header DMIG, KAAX, 0, ..."),
    "DMIG: a value missing": (PCH, replaced("3.000000000D+00", ""), "line 4", "a real value"),
    "DMIG: no number": (PCH, replaced("3.000000000D+00", "3.0000000xxD+00"), "line 4", "a real value"),
    "DMIG: a component that is none": (
        PCH,
        replaced("1000               3 4.0", "1000               7 4.0"),
        "line 9",
        "its component (1 to 6; 0 of a scalar point)",
    ),
    "DMIG: an entry twice": (
        PCH,
        replaced(
            "*                   1000               3 4.0",
            "*                   1000               3 4.0D0\n" + "*                   1000               3 4.0",
        ),
        "KAAX = 'node 1000 direction 3, node 1000 direction 3 twice'",
        "every entry once",
    ),
    "DMIG: both triangles in form 6": (
        PCH,
        replaced(
            "*                   1000               1 2.5",
            "*                     12               2-1.0D0\n*                   1000               1 2.5",
        ),
        "twice",
        "every entry once",
    ),
    "DMIG: a header twice": (PCH, lambda text: text + text.split("\n")[1] + "\n", "line 17", "one header of KAAX"),
    "DMIG: an imaginary part": (
        SMALL,
        replaced("12       2      3.", "12       2      3.      1."),
        "line 3",
        "a real value",
    ),
    "DMIG: cut off": (SMALL, cut(4), "last line", "the file is cut off"),
    "DMIG: no such matrix": ("two_springs.pch:BAAX", lambda text: text, "BAAX", "it holds: KAAX, MAAX"),
    "DMIG: two matrices and no name": ("two_springs.pch", lambda text: text, "no name", "it holds: KAAX, MAAX"),
    "OUTPUT4: cut off": (
        OP4,
        lambda text: text[: text.index("  196611")],
        "KAA = 'ends in column 3'",
        "a whole matrix",
    ),
    "OUTPUT4: complex": (OP4, replaced("       6       2KAA", "       6       4KAA"), "type 4", "type 1 or 2"),
    "OUTPUT4: not square": (
        OP4,
        replaced("       3       3       6", "       3       2       6"),
        "2 x 3",
        "a square matrix",
    ),
    "OUTPUT4: a number too few": (
        OP4,
        replaced("-1.0000000000000000E+00\n       2", "\n       2"),
        "1 numbers",
        "as 4 words make",
    ),
    "OUTPUT4: no number": (
        OP4,
        replaced("2.5000000000000000E+00", "2.5000000000000x00E+00"),
        "line 9",
        "the format of the header",
    ),
    "OUTPUT4: a row too far": (OP4, replaced("196611", "196612"), "rows 4 to 4", "from 1 to 3"),
    "OUTPUT4: no such matrix": ("two_springs.op4:KGG", lambda text: text, "KGG", "it holds: KAA, MAA"),
    "Matrix Market: cut off": (MARKET, cut(8), "3 entries", "4 entries"),
    "Matrix Market: an entry too many": (MARKET, lambda text: text + "3 2 1.0\n", "5 entries", "4 entries"),
    "Matrix Market: complex": (MARKET, replaced("real", "complex"), "complex entries", "a real matrix"),
    "Matrix Market: skew": (MARKET, replaced("symmetric", "skew-symmetric"), "skew-symmetric", "general or symmetric"),
    "Matrix Market: an upper entry": (MARKET, replaced("2 1 -1.0", "1 2 -1.0"), "line 5", "the lower triangle only"),
    "Matrix Market: a row too far": (MARKET, replaced("3 3 4.0", "4 3 4.0"), "line 7", "from 1 to 3"),
    "Matrix Market: not square": (MARKET, replaced("3 3 4\n", "3 4 4\n"), "3 x 4", "a square matrix"),
    "Matrix Market: not finite": (MARKET, replaced("2.5", "inf"), "line 6", "row, column and value"),
}


@pytest.mark.parametrize("twin", TWINS.values(), ids=TWINS)
def test_faulty_matrix_files_are_told_with_their_place(twin, tmp_path):
    source, change, place, expected = twin
    name, _, matrix = source.partition(":")
    (tmp_path / name).write_text(change((DATA / name).read_text()))
    told = fault_of(read_matrix, str(tmp_path / name) + (f":{matrix}" if matrix else ""), "stiffness")
    assert name in told and place in told and expected in told.partition(": expected ")[2]


def written(folder: Path, name: str) -> bytes:
    """Bytes of a binary file of the stiffness."""
    matrix, path = sparse.csr_matrix(STIFFNESS), folder / name
    if name.endswith(".npz"):
        sparse.save_npz(path, matrix)
    elif name == "new.mat":
        write.write_matlab_73(path, {"K": matrix})
    elif name == "oldest.mat":
        scipy.io.savemat(path, {"K": matrix}, format="4")
    elif name.endswith(".mat"):
        write.write_matlab(path, {"K": matrix})
    else:
        write.write_op4_binary(path, {"KAA": matrix}, name.partition(".")[0])
    return path.read_bytes()


BINARY = {
    "npz: cut off": ("k.npz", lambda data: data[:-100], "a file of scipy.sparse.save_npz"),
    "MATLAB 5: cut off": ("old.mat", lambda data: data[:-30], "a MATLAB file"),
    "MATLAB 4: cut off": ("oldest.mat", lambda data: data[:-3], "a MATLAB file"),
    "MATLAB 4: more rows than the file holds": (
        "oldest.mat",
        lambda data: data[:4] + np.array([2**31 - 1, 2**31 - 1], "<i4").tobytes() + data[12:],
        "a MATLAB file",
    ),
    "MATLAB 4: a name without letters": ("oldest.mat", lambda data: data[:16] + bytes(4) + data[20:], "a MATLAB file"),
    "MATLAB 4: zeros after it": ("oldest.mat", lambda data: data + bytes(64), "a MATLAB file"),
    "MATLAB 7.3: cut off": ("new.mat", lambda data: data[:700], "a MATLAB file"),
    "OUTPUT4: cut off": ("sparse.op4", lambda data: data[:-20], "the file is cut off"),
    "OUTPUT4: cut off in a column": ("dense.op4", lambda data: data[:50], "the file is cut off"),
    "OUTPUT4: a string too long": (
        "bigmat.op4",
        lambda data: data.replace(np.array([5, 1], "<i4").tobytes(), np.array([9, 1], "<i4").tobytes(), 1),
        "strings that fit their record",
    ),
    "OUTPUT4: complex": (
        "dense.op4",
        lambda data: data.replace(np.array([6, 2], "<i4").tobytes(), np.array([6, 4], "<i4").tobytes(), 1),
        "type 1 or 2, a real matrix",
    ),
}


@pytest.mark.parametrize("twin", BINARY.values(), ids=BINARY)
def test_faulty_binary_files_are_told(twin, tmp_path):
    name, change, expected = twin
    data = written(tmp_path, name)
    changed = change(data)
    assert changed != data
    (tmp_path / name).write_bytes(changed)
    told = fault_of(read_matrix, tmp_path / name, "stiffness")
    assert name in told and expected in told


def test_gigabytes_of_zeros_are_no_matlab_file_and_are_not_read_to_their_end(tmp_path, monkeypatch):
    path = tmp_path / "k.mat"
    path.touch()
    os.truncate(path, 2**33)
    # Which takes them for hundreds of millions of variables.
    monkeypatch.setattr(scipy.io, "whosmat", lambda path: pytest.fail("read by SciPy"))
    told = fault_of(read_matrix, path, "stiffness")
    assert "whose name has 0 letters at byte 0" in told and "expected a MATLAB file" in told


@pytest.mark.parametrize("order", ["<", ">"])
def test_variables_of_version_4_are_known_in_either_order_of_bytes(order, tmp_path):
    path = tmp_path / "k.mat"
    numbers = np.array(STIFFNESS, f"{order}f8")
    rows, columns = numbers.shape
    head = np.array([0 if order == "<" else 1000, rows, columns, 0, 2], f"{order}i4")
    path.write_bytes(head.tobytes() + b"K\0" + numbers.T.tobytes())
    assert np.array_equal(read_matrix(path, "stiffness").toarray(), STIFFNESS)


@pytest.mark.parametrize(
    ("save", "said", "expected"),
    [
        (lambda path: np.savez(path, a=np.eye(3)), "", "a file of scipy.sparse.save_npz"),
        (lambda path: sparse.save_npz(path, sparse.csr_matrix(1j * STIFFNESS)), "complex entries", "a real matrix"),
        (lambda path: scipy.io.savemat(path, {"K": 1j * STIFFNESS}), "complex entries", "a real matrix"),
        (lambda path: scipy.io.savemat(path, {"K": STIFFNESS, "M": STIFFNESS}), "no name", "it holds: K, M"),
        (lambda path: scipy.io.savemat(path, {"a": "text"}), "no name", "it holds: a"),
        (lambda path: write.write_matlab_73(path, {"K": STIFFNESS, "M": STIFFNESS}), "no name", "it holds: K, M"),
    ],
    ids=["a dense npz", "a complex npz", "a complex .mat", "two in a .mat", "none in a .mat", "two in a new .mat"],
)
def test_binary_files_of_something_else_are_told(save, said, expected, tmp_path):
    path = tmp_path / (
        "k.mat" if "mat" in save.__code__.co_names[-1] or "matlab" in str(save.__code__.co_names) else "k.npz"
    )
    save(path)
    told = fault_of(read_matrix, path, "stiffness")
    assert said in told and expected in told


# First bytes of files that are known but not read; what is said of them as a mesh, and as a matrix.
FOREIGN = {
    "k.op2": (b"\4\0\0\0\3\0\0\0NASTRAN FORT TAPE ID CODE - ", "OUTPUT2", "the bulk data", "DMIG"),
    "k.unv": (b"    -1\n  2411\n", "a universal file", "a deck", "Matrix Market"),
    "k.frd": (b"    1C\n    1UUSER\n", "results of CalculiX", "the deck", "--calculix"),
    "k.odb": (b"HKSRD0 $ABAQUS\0", "Abaqus's database", "the deck", ".mtx"),
    "k.step": (b"ISO-10303-21;\n", "geometry in STEP", "mesh the geometry first", "a matrix file"),
    "k.stl": (b"solid part\n facet normal 0 0 1\n", "a surface in STL", "mesh the geometry first", "a matrix file"),
    "k.cdb": (b"version https://git-lfs.github.com/spec/v1\n", "a pointer of Git LFS", "git lfs pull", "git lfs pull"),
    "k.inp": (b"\x1f\x8b\x08\0", "packed by gzip", "unpack it", "unpack it"),
    "k.full": (np.array([100, -(2**31), 4], "<i4").tobytes(), "binary file .full", "CDWRITE", "HBMAT"),
    "k.h5": (b"\x89HDF\r\n\x1a\n", "an HDF5 file", ".med or .exo", ".mat"),
    "k.nc": (b"CDF\1\0\0\0\0", "a NetCDF file", ".exo or .g", "a matrix file"),
}


@pytest.mark.parametrize(("name", "kind"), FOREIGN.items(), ids=FOREIGN)
def test_files_of_other_kinds_are_refused_by_what_they_are(name, kind, tmp_path):
    start, what, mesh, matrix = kind
    (tmp_path / name).write_bytes(start + bytes(400))
    for read, expected, arguments in ((read_mesh, mesh, ()), (read_matrix, matrix, ("stiffness",))):
        told, _, remedy = fault_of(read, tmp_path / name, *arguments).partition(": expected ")
        assert name in told and what in told and expected in remedy


@pytest.mark.parametrize("name", ["m.g", "m.e", "m.exo", "m.ex2"])
@pytest.mark.parametrize("start", [b"CDF\1", b"\x89HDF\r\n\x1a\n"], ids=["NetCDF 3", "NetCDF 4"])
def test_exodus_without_the_module_that_reads_it_says_what_to_install(name, start, tmp_path, monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda module: None)
    (tmp_path / name).write_bytes(start + bytes(100))
    assert "install python3-netcdf4, or export the mesh as .med or .vtu" in fault_of(read_mesh, tmp_path / name)


def of_class(path: Path, kind: str, values: np.ndarray) -> None:
    """A file of version 7.3 whose variable K is of a class of MATLAB's."""
    write.write_matlab_73(path, {"K": values})
    with edited(path) as file:
        file["K"].attrs["MATLAB_class"] = np.bytes_(kind)


HELD = {
    "an object in a new .mat": (lambda path: of_class(path, "ss", np.eye(3)), "ss"),
    "text in a new .mat": (lambda path: of_class(path, "char", np.eye(3)), "char"),
    "a structure": (lambda path: scipy.io.savemat(path, {"K": {"k": np.eye(3)}}), "struct"),
    "a cell": (lambda path: scipy.io.savemat(path, {"K": np.array([[np.eye(2)]], dtype=object)}), "cell"),
    "text": (lambda path: scipy.io.savemat(path, {"K": "a"}), "char"),
}


@pytest.mark.parametrize(("save", "kind"), HELD.values(), ids=HELD)
def test_what_is_no_matrix_in_matlab_is_refused_by_its_class(save, kind, tmp_path):
    save(tmp_path / "k.mat")
    assert f"K ({kind})" in fault_of(read_matrix, tmp_path / "k.mat", "stiffness")
    told = fault_of(read_matrix, f"{tmp_path / 'k.mat'}:K", "stiffness")
    assert f"of MATLAB's class {kind}" in told and "as K = model.K, and save that" in told


@pytest.mark.parametrize("save", [write.write_matlab_73, scipy.io.savemat], ids=["7.3", "5"])
def test_numbers_beside_a_matrix_are_no_matrices(save, tmp_path):
    save(tmp_path / "k.mat", {"n": np.ones((1, 1)), "K": STIFFNESS})
    assert np.array_equal(read_matrix(tmp_path / "k.mat", "stiffness").toarray(), STIFFNESS)
    save(tmp_path / "n.mat", {"n": np.ones((1, 1))})
    assert "'no name': expected one matrix of the file" in fault_of(read_matrix, tmp_path / "n.mat", "stiffness")
    assert read_matrix(f"{tmp_path / 'n.mat'}:n", "stiffness").toarray() == 1.0


@pytest.mark.parametrize(
    ("name", "text", "place"),
    [
        ("a.dof", "1.1\n{id}.2\n", "line 2"),
        ("a.map", "1 1 UX\n2 {id} UY\n", "line 2"),
        ("a.bdf", "BEGIN BULK\nASET,{id},1\n", "line 2, ASET"),
        ("a.bdf", "BEGIN BULK\nASET1,1,{id}\n", "line 2, ASET1"),
        ("mesh.bdf", "BEGIN BULK\nGRID,{id},,0.,0.,0.\n", "line 2, GRID"),
        ("mesh.bdf", "BEGIN BULK\nGRID,1,,0.,0.,0.\nSET1,1,1,{id}\n", "line 3, SET1"),
        ("mesh.bdf", "BEGIN BULK\nGRID,1,,0.,0.,0.\nCTETRA,1,1,1,1,1,{id}\n", "line 3, CTETRA"),
    ],
)
@pytest.mark.parametrize("number", [10**18, 2**64, 10**40])
def test_an_id_beyond_64_bits_is_a_fault_of_its_line(tmp_path, name, text, place, number):
    (tmp_path / name).write_text(text.format(id=number))
    read = read_mesh if name.startswith("mesh") else read_dof_file
    with pytest.raises(InputError) as caught:
        read(tmp_path / name)
    (fault,) = caught.value.faults
    assert fault.key == place and str(number) in str(fault.value)


@pytest.mark.parametrize("damage", ["\0" * 20 + "\n", "*GARBAGE\n", "\n"])
@pytest.mark.parametrize("what", ["nodes", "elements", "numbers"])
def test_a_block_of_ansys_that_ends_early_is_told(tmp_path, what, damage):
    """What followed a damaged line was left out without a word."""
    node = "{:9d}        0        0" + " 0.0000000000000E+000" * 3 + "\n"
    element = ("        1" * 8 + "        4        0{:9d}" + "        1        2        3        4") + "\n"
    rows = {"nodes": [node.format(k) for k in (1, 2, 3, 4)], "elements": [element.format(k) for k in (1, 2)]}
    rows["numbers"] = ["         1\n", "         2\n"]
    rows[what].insert(1, damage)
    (tmp_path / "mesh.cdb").write_text(
        f"NBLOCK,6,SOLID,4,4\n(3i9,6e21.13e3)\n{''.join(rows['nodes'])}N,R5.3,LOC,-1,\nET,1,185\n"
        f"EBLOCK,19,SOLID,2,2\n(19i9)\n{''.join(rows['elements'])}       -1\n"
        f"CMBLOCK,LOW,NODE,       2\n(1i10)\n{''.join(rows['numbers'])}"
    )
    with pytest.raises(InputError, match=f"{what}, as it declares, not 1: the file is cut off or damaged"):
        read_mesh(tmp_path / "mesh.cdb")


@pytest.mark.parametrize("ending", [".npz", ".mat"])
def test_what_unpacks_to_more_than_the_memory_is_refused_before_it_is(tmp_path, monkeypatch, ending):
    matrix, path = sparse.identity(40_000, format="csr"), tmp_path / f"k{ending}"
    if ending == ".npz":
        sparse.save_npz(path, matrix)
    else:
        scipy.io.savemat(path, {"K": matrix.tocsc()}, do_compression=True)
    assert read_matrix(path, "stiffness").nnz == 40_000
    monkeypatch.setattr(unpacked, "most_bytes", lambda: 100_000)
    with pytest.raises(InputError, match="bytes when it is unpacked.*expected at most 100000, half of the memory"):
        read_matrix(path, "stiffness")


LONG = ["9223372036854775807", "9223372036854775808", "18446744073709551619", "9" * 40, "1" + "0" * 18]


@pytest.mark.parametrize("long", LONG)
@pytest.mark.parametrize(
    ("line", "place"),
    [
        ("4, 0, 0, 1", "*NODE"),
        ("1, 1, 2, 3, 4", "*ELEMENT"),
        ("*NSET, NSET=a\n1", "*NSET"),
        ("*NSET, NSET=a, GENERATE\n1", "*NSET"),
        ("*RIGID BODY, NSET=all, ROT NODE=1", "*RIGID BODY"),
    ],
)
def test_ids_of_more_digits_than_numbers_hold_are_refused(tmp_path, long, line, place):
    text = "*NODE, NSET=all\n1, 0, 0, 0\n2, 1, 0, 0\n3, 0, 1, 0\n4, 0, 0, 1\n*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4\n"
    if line in text:
        text = text.replace(line, f"{long}{line[1:]}")
    else:
        text += f"{line[:-1]}{long}{', 1, 1' if 'GENERATE' in line else ''}\n"
    (tmp_path / "m.inp").write_text(text)
    with pytest.raises(InputError, match=rf"{re.escape(place)} = '{long}': expected .* of at most 18 digits"):
        read_mesh(tmp_path / "m.inp")


@pytest.mark.parametrize("word", ["--2", "+-2", "1.0", "0" * 5000])
def test_what_is_no_id_is_named(tmp_path, word):
    (tmp_path / "m.inp").write_text(
        "*NODE, NSET=all\n1, 0, 0, 0\n2, 1, 0, 0\n3, 0, 1, 0\n4, 0, 0, 1\n*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4\n"
        f"*NSET, NSET=a\n1, {word}\n"
    )
    with pytest.raises(InputError, match=rf"NSET = '{re.escape(word[:80])}.*: expected node ids"):
        read_mesh(tmp_path / "m.inp")


@pytest.mark.parametrize("long", [*LONG, "9" * 5000, "0" * 5000 + "7", "7", "11"])
def test_directions_beyond_six_hold_nothing(tmp_path, long):
    """Their list had taken all memory."""
    (tmp_path / "m.inp").write_text(
        "*NODE, NSET=all\n1, 0, 0, 0\n2, 1, 0, 0\n3, 0, 1, 0\n4, 0, 0, 1\n*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4\n"
        f"*BOUNDARY\n1, 3, {long}\n2, {long}, {long}\n{long[:19]}9, 1, 1\n"
    )
    held = read_mesh(tmp_path / "m.inp").held
    assert [row for row in held.tolist() if row[0] == 1] == [[1, 3], [1, 4], [1, 5], [1, 6]]
    assert not [row for row in held.tolist() if row[0] == 2]
