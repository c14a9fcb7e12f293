"""What other programs read in matrix and mesh files, for `real_files.py` to compare with.

OUTPUT4 by pyYeti, DMIG and bulk data by pyNastran, Matrix Market and MATLAB by SciPy, gmsh's and MED meshes by gmsh.
Where there is none to install, and for decks: a plain parse of a few lines.
"""

from __future__ import annotations

import re
from pathlib import Path

import h5py
import numpy as np
import scipy.io
from scipy.sparse import coo_matrix, csc_matrix, csr_matrix, issparse

# Name of each matrix; None where it is rectangular or complex.
Matrices = dict[str, csr_matrix | None]
# Node ids, coordinates in their order, and tetrahedra and bricks by their number of nodes: rows of coordinates
MeshParts = tuple[np.ndarray, np.ndarray, dict[int, np.ndarray]]


def usable(matrix: object) -> csr_matrix | None:
    """A square real matrix; None for anything else."""
    found = csr_matrix(matrix if issparse(matrix) else np.atleast_2d(np.asarray(matrix)))
    return None if found.shape[0] != found.shape[1] or np.iscomplexobj(found) else found.astype(float)


def of_names(row: np.ndarray, column: np.ndarray, value: np.ndarray, mirrored: bool) -> csr_matrix:
    """A matrix of entries between dofs that have names `[entries, 2]`: by node, then component; zeros are left out."""
    keep = value != 0.0
    row, column, value = row[keep], column[keep], value[keep]
    names, index = np.unique(np.concatenate([row, column]), axis=0, return_inverse=True)
    i, j = index.reshape(2, -1)
    if mirrored:
        off = i != j
        i, j, value = np.append(i, j[off]), np.append(j, i[off]), np.append(value, value[off])
    return coo_matrix((value, (i, j)), shape=(len(names), len(names))).tocsr()


def output4(path: Path) -> Matrices:
    """By pyYeti; of two matrices of a name the last."""
    from pyyeti.nastran import op4

    names, matrices, forms, _ = op4.load(str(path), into="list")
    # Forms 4 and 5 are triangular factors.
    return {
        name.upper(): None if form in (4, 5) else usable(matrix)
        for name, matrix, form in zip(names, matrices, forms, strict=True)
    }


def dmig(path: Path) -> Matrices:
    """By pyNastran, whose values of type 1 are in single precision; plainly where it fails."""
    from pyNastran.bdf.bdf import BDF

    model = BDF(log=_silent())
    model.disable_cards([name for name in model.cards_to_read if name != "DMIG"])
    try:
        model.read_bdf(str(path), validate=False, xref=False, punch="BEGIN BULK" not in path.read_text().upper())
    except Exception:
        return plain_dmig(path)
    found: Matrices = {}
    if not model.dmig:
        return plain_dmig(path)
    for name, matrix in model.dmig.items():
        if matrix.matrix_form not in (1, 6) or matrix.is_complex:
            found[name] = None
            continue
        row, column = np.array(matrix.GCi).reshape(-1, 2), np.array(matrix.GCj).reshape(-1, 2)
        found[name] = of_names(row, column, np.array(matrix.Real, float), matrix.matrix_form == 6)
    return found


def plain_dmig(path: Path) -> Matrices:
    """Cards of fixed fields."""
    forms: dict[str, int] = {}
    entries: dict[str, list[tuple[int, int, int, int, float]]] = {}
    name, column = "", (0, 0)

    def number(word: str) -> float:
        mantissa, exponent = re.fullmatch(r"([-+]?[\d.]+)[DE]?([-+]?\d*)", word.upper()).groups()
        return float(f"{mantissa}e{exponent or 0}")

    for line in path.read_text(errors="replace").splitlines():
        text = line.partition("$")[0].rstrip()
        large = text[:8].endswith("*") or text.startswith("*")
        width, count = (16, 4) if large or text[:5] == "DMIG*" else (8, 8)
        fields = [text[8 + k * width : 8 + (k + 1) * width].strip() for k in range(count)]
        if text[:4] == "DMIG":
            name = fields[0]
            if fields[1] == "0":
                forms[name], entries[name] = int(fields[2]), []
                name = ""
                continue
            column = (int(fields[1]), int(fields[2] or 0))
            fields = fields[4:8]
        elif text[:1] not in ("*", "+", " "):
            name = ""
        for k in range(0, len(fields), 4):
            if name and fields[k]:
                row = (int(fields[k]), int(fields[k + 1] or 0))
                entries[name].append((*row, *column, number(fields[k + 2])))
    found: Matrices = {}
    for name, form in forms.items():
        table = np.array(entries[name], float).reshape(-1, 5)
        row, column_of = table[:, :2].astype(int), table[:, 2:4].astype(int)
        found[name] = of_names(row, column_of, table[:, 4], form == 6) if form in (1, 6) else None
    return found


def abaqus(path: Path) -> Matrices:
    """Lines of five numbers, or of three: one triangle, or both."""
    table = np.array([[float(x) for x in re.split(r"[,\s]+", line.strip())] for line in path.read_text().splitlines()])
    if table.shape[1] == 3:
        table = np.insert(table, [1, 2], 0.0, axis=1)
    row, column, value = table[:, :2].astype(int), table[:, 2:4].astype(int), table[:, 4]
    for names in (row, column):
        # Dofs of internal nodes in an order of their own
        names[names[:, 0] < 0, 0] = 10 * names[names[:, 0] < 0, 0] - names[names[:, 0] < 0, 1]
    both = {tuple(x) for x in np.hstack([row, column]).tolist()}
    return {"": of_names(row, column, value, not any((c, d, a, b) in both for a, b, c, d in both if (a, b) != (c, d)))}


def harwell_boeing(path: Path) -> Matrices:
    """Numbers without blanks between them, by the widths in the header."""
    lines = path.read_text().splitlines()
    counts = [int(x) for x in lines[1].split()]
    kind, (rows, columns) = lines[2][:3].upper(), (int(x) for x in lines[2][3:].split()[:2])
    if kind[0] != "R" or rows != columns or counts[3] == 0:
        return {"": None}
    begin = 5 if len(counts) > 4 and counts[4] > 0 else 4
    numbers = []
    for form, count in zip((lines[3][:16], lines[3][16:32], lines[3][32:52]), counts[1:4], strict=True):
        width = int(re.search(r"[IEDFG](\d+)", form.upper())[1])
        text = [line[k : k + width] for line in lines[begin : begin + count] for k in range(0, len(line), width)]
        numbers.append(np.array([float(x.upper().replace("D", "E")) for x in text if x.strip()]))
        begin += count
    pointers, index, value = numbers[0].astype(int) - 1, numbers[1].astype(int) - 1, numbers[2]
    lower = csr_matrix((value, index, pointers), shape=(rows, rows))
    return {"": lower + lower.T - csr_matrix(np.diag(lower.diagonal())) if kind[1] == "S" else lower.T.tocsr()}


def matrix_market(path: Path) -> Matrices:
    """By SciPy."""
    return {"": usable(scipy.io.mmread(path))}


def petsc(path: Path) -> Matrices:
    """Rows, columns, entries; lengths of rows; columns; values: all with the first byte first."""
    raw = path.read_bytes()
    head = np.frombuffer(raw[:16], ">i4")
    lengths = np.frombuffer(raw, ">i4", head[1], 16)
    index = np.frombuffer(raw, ">i4", head[3], 16 + 4 * head[1])
    if len(raw) != 16 + 4 * head[1] + 12 * head[3]:
        return {"": None}
    value = np.frombuffer(raw, ">f8", head[3], 16 + 4 * head[1] + 4 * head[3])
    return {"": usable(csr_matrix((value, index, np.append(0, np.cumsum(lengths))), shape=tuple(head[1:3])))}


def matlab(path: Path) -> Matrices:
    """By SciPy; 7.3 is HDF5, whose sparse matrices are by columns."""
    if path.read_bytes()[:10] == b"MATLAB 7.3":
        found: Matrices = {}
        with h5py.File(path) as file:
            for name, group in file.items():
                if isinstance(group, h5py.Group) and "MATLAB_sparse" in group.attrs:
                    parts = [group[part][()] for part in ("data", "ir", "jc")]
                    shape = (int(group.attrs["MATLAB_sparse"]), len(parts[2]) - 1)
                    found[name] = usable(csc_matrix(parts, shape=shape)) if parts[0].dtype.kind == "f" else None
        return found
    read = scipy.io.loadmat(path)
    arrays = {name: x for name, x in read.items() if not name.startswith("__") and getattr(x, "ndim", 0) == 2}
    return {name: usable(x) if x.dtype.kind in "iufc" else None for name, x in arrays.items() if x.shape[0] > 1}


def gmsh_mesh(path: Path) -> MeshParts:
    """By gmsh."""
    import gmsh

    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.open(str(path))
        ids, points, _ = gmsh.model.mesh.getNodes()
        kinds, _, elements = gmsh.model.mesh.getElements(3)
        order = np.argsort(ids)
        ids = ids[order].astype(int)
        solids = {}
        for kind, nodes in zip(kinds, elements, strict=True):
            if kind in (4, 5, 11, 17):
                width = int(gmsh.model.mesh.getElementProperties(kind)[3])
                solids[width] = np.searchsorted(ids, nodes.reshape(-1, width).astype(int))
        return ids, points.reshape(-1, 3)[order], solids
    finally:
        gmsh.finalize()


def deck(path: Path) -> MeshParts:
    """Lines below *NODE and *ELEMENT; numbers of an element go on in further lines."""
    nodes: dict[int, list[float]] = {}
    parts: dict[int, list[int]] = {}
    keyword, width = "", 0
    for line in path.read_text().splitlines():
        text = line.strip()
        if text.startswith("**") or not text:
            continue
        words = [word.strip() for word in text.rstrip(",").split(",")]
        if text.startswith("*"):
            keyword = words[0].upper()
            kind = re.search(r"TYPE *= *C3D(4|8|10|20)[A-Z]*\b", text.upper())
            width = int(kind[1]) if kind else 0
        elif keyword == "*NODE":
            nodes[int(words[0])] = [float(x) for x in [*words[1:4], "0", "0"][:3]]
        elif keyword == "*ELEMENT" and width:
            parts.setdefault(width, []).extend(int(x) for x in words)
    ids = np.array(sorted(nodes))
    tables = {k: np.array(found).reshape(-1, 1 + k)[:, 1:] for k, found in parts.items()}
    points = np.array([nodes[k] for k in ids.tolist()])
    return ids, points, {k: np.searchsorted(ids, table) for k, table in tables.items()}


def bulk_data(path: Path) -> MeshParts:
    """By pyNastran."""
    from pyNastran.bdf.bdf import BDF

    model = BDF(log=_silent())
    model.read_bdf(str(path), validate=False, xref=False, punch="BEGIN BULK" not in path.read_text().upper())
    ids = np.array(sorted(model.nodes))
    points = np.array([model.nodes[k].get_position_no_xref(model) for k in ids.tolist()])
    parts: dict[int, list[list[int]]] = {}
    for element in model.elements.values():
        if element.type in ("CTETRA", "CHEXA"):
            nodes = [k for k in element.nodes if k]
            parts.setdefault(len(nodes), []).append(nodes)
    return ids, points, {width: np.searchsorted(ids, np.array(found)) for width, found in parts.items()}


def archive(path: Path) -> MeshParts:
    """Lines of NBLOCK by the widths of its format; elements are not counted."""
    nodes: dict[int, list[float]] = {}
    lines = path.read_text(errors="replace").splitlines()
    for k, line in enumerate(lines):
        if not line.upper().startswith("NBLOCK"):
            continue
        form = lines[k + 1].replace(" ", "").lower()
        integers = [int(n) * int(width) for n, width in re.findall(r"(\d+)i(\d+)", form)]
        first = int(re.search(r"i(\d+)", form)[1])
        start, wide = sum(integers), int(re.search(r"\d+e(\d+)", form)[1])
        for text in lines[k + 2 :]:
            if not text[:first].strip().isdecimal():
                break
            words = [text[start + j * wide : start + (j + 1) * wide].strip() for j in range(3)]
            nodes[int(text[:first])] = [float(word or 0) for word in words]
    ids = np.array(sorted(nodes))
    return ids, np.array([nodes[i] for i in ids.tolist()]), {}


def _silent() -> object:
    from cpylog import SimpleLogger

    return SimpleLogger("critical")
