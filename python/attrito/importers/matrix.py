"""One matrix, whatever it is written in."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.sparse import csr_matrix

from attrito.importers.abaqus import is_abaqus, read_abaqus
from attrito.importers.abaqus_superelement import is_superelement, read_superelement
from attrito.importers.dof_numbers import DofNumbers
from attrito.importers.foreign import ZIP, foreign
from attrito.importers.harwell_boeing import is_harwell_boeing, read_harwell_boeing
from attrito.importers.inline import read_inline
from attrito.importers.matlab import HEADER as MATLAB
from attrito.importers.matlab import read_matlab
from attrito.importers.matrices import Matrices, assemble
from attrito.importers.matrix_market import HEADER as MATRIX_MARKET
from attrito.importers.matrix_market import read_matrix_market
from attrito.importers.nastran_dmig import is_dmig, read_dmig
from attrito.importers.nastran_op4 import is_op4, read_op4
from attrito.importers.npz import read_npz
from attrito.importers.petsc_binary import HEADERS as PETSC
from attrito.importers.petsc_binary import read_petsc_binary
from attrito.importers.source import Source
from attrito.support.errors import Fault, InputError

KINDS = (
    "a matrix file: Matrix Market, PETSc binary, SciPy npz, MATLAB, Harwell-Boeing, Nastran DMIG or OUTPUT4, "
    "or lines of Abaqus or CalculiX"
)
# The first line of what Nastran punches but for matrices
PUNCHED_RESULTS = b"$TITLE"
# Enough to come past the comments and other cards at the beginning of a file.
START = 1 << 20


def split_name(source: str | Path) -> tuple[str, str | None]:
    """File and matrix of `FILE:NAME`; no name where the whole is a file."""
    text = str(source)
    file, colon, name = text.rpartition(":")
    return (text, None) if not colon or Path(text).exists() or not name else (file, name)


def open_matrix(source: str | Path, key: str, file: str, numbers: DofNumbers) -> Source:
    """Read one matrix; the kind of file is recognised by its beginning.

    Parameters
    ----------
    source : a file, or `FILE:NAME` for one matrix of a file of several (MATLAB, DMIG, OUTPUT4, substructures)
    key : where it is asked for, such as `model.mass`
    file : the file that asks for it
    numbers : of the dofs that the file may name
    """
    path, name = split_name(source)
    try:
        with Path(path).open("rb") as opened:
            start = opened.read(START)
        known = None if start.startswith(ZIP) else foreign(start)
        if known is not None:
            raise InputError(Fault(path, key, known.what, known.matrix))
        if start.startswith(MATLAB) or path.lower().endswith(".mat"):
            return read_matlab(path, key, name)
        if is_op4(start):
            return read_op4(path, key, name)
        if is_dmig(start):
            return read_dmig(path, key, numbers, name)
        if is_superelement(start):
            return read_superelement(path, key, numbers, name)
        if name is not None:
            raise InputError(Fault(file, key, str(source), "a file of one matrix without a name, or one that is there"))
        if start.startswith(MATRIX_MARKET):
            return read_matrix_market(path, key)
        if start.startswith(PETSC):
            return Source(path, key, matrix=read_petsc_binary(path, key))
        if start.startswith(ZIP):
            return read_npz(path, key)
        if is_harwell_boeing(start):
            return read_harwell_boeing(path, key)
        if is_abaqus(start):
            return read_abaqus(path, key, numbers)
    except OSError as error:
        expected = f"a file that can be read ({error.strerror or error})"
        raise InputError(Fault(file, key, str(source), expected)) from error
    if start.startswith(PUNCHED_RESULTS):
        raise InputError(Fault(path, key, "a punch file of results", "one of matrices: DMIG, as EXTSEOUT writes it"))
    raise InputError(Fault(file, key, str(source), KINDS))


def inline_or_file(source: object, key: str, file: str, numbers: DofNumbers) -> Source:
    """A matrix of rows of numbers, or of a file."""
    if isinstance(source, list):
        return Source(file, key, matrix=read_inline(source, key, file))
    if not isinstance(source, (str, Path)):
        raise InputError(Fault(file, key, source, "the name of a file, or rows of numbers"))
    return open_matrix(source, key, file, numbers)


def read_matrices(sources: dict[str, object], key: str, file: str) -> Matrices:
    """The matrices of one model, on the same dofs.

    Parameters
    ----------
    sources : files, `FILE:NAME`, or rows of numbers, by name: `stiffness`, `mass`, perhaps `damping`
    key : where each is asked for, with `{}` for its name
    file : the file that asks for them
    """
    numbers = DofNumbers()
    read = {name: inline_or_file(source, key.format(name), file, numbers) for name, source in sources.items()}
    return assemble(read, numbers)


def read_matrix(source: str | Path | list[list[float]], key: str, file: str = "job") -> csr_matrix:
    """A matrix from a file of any kind, or from rows of numbers; dofs named by node come by node, then direction.

    Parameters
    ----------
    source : file, `FILE:NAME`, or rows
    key : where it is asked for, such as `model.mass`
    file : the file that asks for it
    """
    numbers = DofNumbers()
    read = inline_or_file(source, key, file, numbers)
    if read.numbers is None:
        matrix = read.assembled()
        if matrix.shape[0] != matrix.shape[1]:
            shown = f"{matrix.shape[0]} x {matrix.shape[1]}"
            raise InputError(Fault(file if isinstance(source, list) else str(source), key, shown, "a square matrix"))
        return matrix
    used = read.rows(len(numbers)).used
    renumber, *names = numbers.order(used)
    return read.assembled(int(np.count_nonzero(used)), renumber, tuple(names))
