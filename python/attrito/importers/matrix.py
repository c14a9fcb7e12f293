"""One matrix, whatever it is written in."""

from __future__ import annotations

from pathlib import Path

from scipy.sparse import csr_matrix

from attrito.faults import Fault, InputError
from attrito.importers.inline import read_inline
from attrito.importers.matrix_market import HEADER, read_matrix_market
from attrito.importers.petsc_binary import HEADERS, read_petsc_binary


def read_matrix(source: str | Path | list[list[float]], key: str, file: str = "job") -> csr_matrix:
    """A matrix from a Matrix Market file, a PETSc binary file, or rows of numbers.

    Parameters
    ----------
    source : path (the kind of file is told by its first bytes) or rows
    key : where it is asked for, such as `model.mass`
    file : the file that asks for it
    """
    if isinstance(source, list):
        return read_inline(source, key, file)
    if not isinstance(source, (str, Path)):
        raise InputError(Fault(file, key, source, "the name of a file, or rows of numbers"))
    try:
        with Path(source).open("rb") as opened:
            start = opened.read(32)
        if start.startswith(HEADER):
            return read_matrix_market(source, key)
        if start.startswith(HEADERS):
            return read_petsc_binary(source, key)
    except OSError as error:
        raise InputError(Fault(file, key, str(source), f"a file that can be read ({error.strerror})")) from error
    raise InputError(Fault(file, key, str(source), "a Matrix Market or a PETSc binary file"))
