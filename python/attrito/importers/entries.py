"""Entries of a matrix as they come out of a file, and the full matrix they make.

Peak memory is that of the finished matrix (12 bytes an entry, both triangles) and the entries not yet placed: a file
that stores one triangle is held at 16 bytes an entry, 8 per entry of the full matrix, and let go chunk by chunk while
the matrix fills.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from scipy.sparse import csr_matrix

from attrito.support.errors import Fault, InputError

# Entries placed into the matrix at once.
CHUNK = 1 << 19
# Entries of a buffer, whose arrays are so large that the C library gives them back to the system when they are freed.
BUFFER = 9 << 20
# Two triangles of a symmetric matrix agree to this part of their rows' diagonal, or of the matrix's largest entry.
SYMMETRY_TOLERANCE = 1.0e-10

Chunk = tuple[np.ndarray, np.ndarray, np.ndarray]


class Entries:
    """Rows, columns (int32, from 0) and values, kept in chunks; zeros are dropped.

    Parameters
    ----------
    path : the file they come from
    key : what is read, for faults
    """

    def __init__(self, path: str, key: str):
        self.path, self.key = path, key
        # Node and direction of each row, for faults, once they are known.
        self.names: tuple[np.ndarray, np.ndarray] | None = None
        self._buffers: list[Chunk] = []
        self._room = 0

    def add(self, row: np.ndarray, column: np.ndarray, value: np.ndarray) -> None:
        """Add entries; the arrays are copied."""
        keep = value != 0.0
        if not keep.all():
            row, column, value = row[keep], column[keep], value[keep]
        begin = 0
        while begin < len(value):
            if self._room == 0:
                self._buffers.append((np.empty(BUFFER, np.int32), np.empty(BUFFER, np.int32), np.empty(BUFFER)))
                self._room = BUFFER
            count = min(self._room, len(value) - begin)
            there, here = slice(BUFFER - self._room, BUFFER - self._room + count), slice(begin, begin + count)
            for kept, given in zip(self._buffers[-1], (row, column, value), strict=True):
                kept[there] = given[here]
            self._room -= count
            begin += count

    @property
    def count(self) -> int:
        """How many there are."""
        return BUFFER * len(self._buffers) - self._room

    def _chunks(self) -> Iterator[Chunk]:
        """All entries, as views."""
        for number, buffer in enumerate(self._buffers):
            length = len(buffer[0]) - (self._room if number == len(self._buffers) - 1 else 0)
            for begin in range(0, length, CHUNK):
                part = slice(begin, min(begin + CHUNK, length))
                yield buffer[0][part], buffer[1][part], buffer[2][part]

    def used(self, size: int) -> np.ndarray:
        """Which of `size` numbers occur as a row or a column, bool."""
        used = np.zeros(size, bool)
        for row, column, _ in self._chunks():
            used[row] = True
            used[column] = True
        return used

    def diagonal(self, size: int) -> np.ndarray:
        """Sum of the entries on the diagonal, `[size]`."""
        diagonal = np.zeros(size)
        for row, column, value in self._chunks():
            on = row == column
            diagonal += np.bincount(row[on], value[on], minlength=size)
        return diagonal

    def coupled(self, size: int) -> np.ndarray:
        """Which rows have an entry off the diagonal, bool."""
        coupled = np.zeros(size, bool)
        for row, column, _ in self._chunks():
            off = row != column
            coupled[row[off]] = True
            coupled[column[off]] = True
        return coupled

    def full(self, size: int, repeated: str = "refuse", renumber: np.ndarray | None = None) -> csr_matrix:
        """The matrix `[size, size]` of entries that are all there. The entries are used up.

        Parameters
        ----------
        repeated : what to do with an entry that occurs again: `"refuse"`, `"sum"` or `"keep"`
        renumber : the new number of each row and column; below zero: left out
        """
        self._renumber(renumber)
        counts = sum((np.bincount(row, minlength=size) for row, _, _ in self._chunks()), np.zeros(size, np.int64))
        matrix = _filled(self._consume(), counts)
        if repeated == "sum":
            matrix.sum_duplicates()
        elif repeated == "refuse":
            self._refuse_repeated(matrix)
        return matrix

    def symmetric(self, size: int, repeated: str = "refuse", renumber: np.ndarray | None = None) -> csr_matrix:
        """The matrix `[size, size]` of one triangle, or one entry of each pair, in any order. Entries are used up."""
        self._renumber(renumber)
        counts = np.zeros(size, np.int64)
        for row, column, _ in self._chunks():
            off = row != column
            counts += np.bincount(row, minlength=size) + np.bincount(column[off], minlength=size)
        matrix = _filled(map(_mirrored, self._consume()), counts)
        if repeated == "sum":
            matrix.sum_duplicates()
        else:
            self._refuse_repeated(matrix)
        return matrix

    def either(self, size: int, renumber: np.ndarray | None = None) -> csr_matrix:
        """The matrix `[size, size]` of a file that does not say whether it stores one triangle or both."""
        self._renumber(renumber)
        above = sum(int(np.count_nonzero(row < column)) for row, column, _ in self._chunks())
        below = sum(int(np.count_nonzero(row > column)) for row, column, _ in self._chunks())
        if above == 0 or below == 0:
            return self.symmetric(size)
        matrix = self.full(size, repeated="keep")
        if above == below and looks_symmetric(matrix) and len(_repeated(matrix)) == 0:
            return matrix
        counts = np.zeros(size, np.int64)
        for row, column, _ in _rows(matrix):
            counts += np.bincount(np.minimum(row, column), minlength=size)
        upper = _filled(map(_above, _rows(matrix)), counts)
        del matrix
        return _unfolded(self._folded(upper))

    def _folded(self, upper: csr_matrix) -> csr_matrix:
        """One entry of each pair: entries below the diagonal lie on their mirror images, all of them or none."""
        again = _repeated(upper)
        if len(again) == 0:
            return upper
        row = _rows_of(upper, again)
        on_diagonal = np.flatnonzero(row == upper.indices[again])
        thrice = np.flatnonzero(np.diff(again) == 1)
        if len(on_diagonal) > 0 or len(thrice) > 0:
            raise self._twice(upper, again[on_diagonal[0] if len(on_diagonal) else thrice[0]])
        single = np.ones(upper.nnz, bool)
        single[again] = single[again - 1] = False
        lonely = np.flatnonzero(single)
        lonely = lonely[_rows_of(upper, lonely) != upper.indices[lonely]]
        if len(lonely) > 0:
            value = f"{self._place(upper, lonely[0])} without its mirror image ({len(lonely)} such entries)"
            raise InputError(Fault(self.path, self.key, value, "one triangle, or both of them with the same entries"))
        first, second = upper.data[again - 1], upper.data[again]
        # Against the diagonal of both rows: one held by 1e36 must not excuse all others.
        diagonal = np.sqrt(np.abs(upper.diagonal()))
        scale = np.maximum(np.abs(first), diagonal[row] * diagonal[upper.indices[again]])
        worst = int(np.argmax(np.abs(first - second) / scale))
        if abs(first[worst] - second[worst]) > SYMMETRY_TOLERANCE * scale[worst]:
            place = self._place(upper, again[worst])
            value = f"{first[worst]:.17g} against {second[worst]:.17g} at {place} and its mirror image"
            raise InputError(Fault(self.path, self.key, value, "a symmetric matrix"))
        upper.data[again - 1] = 0.5 * first + 0.5 * second
        keep = np.ones(upper.nnz, bool)
        keep[again] = False
        removed = np.zeros(upper.nnz + 1, np.int64)
        np.cumsum(~keep, out=removed[1:])
        indptr = upper.indptr - removed[upper.indptr]
        return csr_matrix((upper.data[keep], upper.indices[keep], indptr), shape=upper.shape)

    def _refuse_repeated(self, matrix: csr_matrix) -> None:
        again = _repeated(matrix)
        if len(again) > 0:
            raise self._twice(matrix, again[0])

    def _twice(self, matrix: csr_matrix, entry: int) -> InputError:
        return InputError(Fault(self.path, self.key, f"{self._place(matrix, entry)} twice", "every entry once"))

    def _place(self, matrix: csr_matrix, entry: int) -> str:
        row, column = int(_rows_of(matrix, np.array([entry]))[0]), int(matrix.indices[entry])
        if self.names is None:
            return f"row {row + 1}, column {column + 1}"
        node, direction = self.names
        return f"node {node[row]} direction {direction[row]}, node {node[column]} direction {direction[column]}"

    def _renumber(self, renumber: np.ndarray | None) -> None:
        if renumber is None:
            return
        for k, buffer in enumerate(self._buffers):
            length = len(buffer[0]) - (self._room if k == len(self._buffers) - 1 else 0)
            done = 0
            for begin in range(0, length, CHUNK):
                part = slice(begin, min(begin + CHUNK, length))
                row, column = renumber[buffer[0][part]], renumber[buffer[1][part]]
                keep = (row >= 0) & (column >= 0)
                there = slice(done, done + np.count_nonzero(keep))
                for kept, given in zip(buffer, (row, column, buffer[2][part]), strict=True):
                    kept[there] = given[keep]
                done = there.stop
            # The last buffer says how full it is by its room, the others by their length.
            if k == len(self._buffers) - 1:
                self._room = len(buffer[0]) - done
            else:
                self._buffers[k] = tuple(array[:done] for array in buffer)

    def _consume(self) -> Iterator[Chunk]:
        """All entries, chunk by chunk; a buffer is let go with its last chunk."""
        self._buffers.reverse()
        while self._buffers:
            row, column, value = self._buffers.pop()
            length = len(row) - (self._room if not self._buffers else 0)
            for begin in range(0, length, CHUNK):
                part = slice(begin, min(begin + CHUNK, length))
                yield row[part], column[part], value[part]
            del row, column, value


def _mirrored(chunk: Chunk) -> Chunk:
    row, column, value = chunk
    off = row != column
    return np.concatenate([row, column[off]]), np.concatenate([column, row[off]]), np.concatenate([value, value[off]])


def _above(chunk: Chunk) -> Chunk:
    row, column, value = chunk
    return np.minimum(row, column), np.maximum(row, column), value


def _filled(chunks: Iterable[Chunk], counts: np.ndarray) -> csr_matrix:
    """A CSR matrix with sorted columns, repeated entries kept, from chunks with `counts` entries in each row."""
    size, total = len(counts), int(counts.sum())
    offsets = np.zeros(size + 1, np.int64)
    np.cumsum(counts, out=offsets[1:])
    indices, data = np.empty(total, np.int32), np.empty(total)
    place = offsets[:-1].copy()
    for row, column, value in chunks:
        count = len(row)
        # A matrix with one entry a row, turned into columns, is a stable counting sort.
        by_row = csr_matrix((value, row, np.arange(count + 1)), shape=(count, size)).tocsc()
        here = np.diff(by_row.indptr)
        target = np.arange(count) + np.repeat(place - by_row.indptr[:-1], here)
        indices[target] = column[by_row.indices]
        data[target] = by_row.data
        place += here
    matrix = csr_matrix((size, size))
    index = np.int32 if total < np.iinfo(np.int32).max else np.int64
    matrix.data, matrix.indices, matrix.indptr = data, indices.astype(index, copy=False), offsets.astype(index)
    matrix.sort_indices()
    return matrix


def _unfolded(upper: csr_matrix) -> csr_matrix:
    """Both triangles of a matrix from its upper one."""
    size = upper.shape[0]
    on_diagonal = upper.diagonal() != 0.0
    counts = np.diff(upper.indptr) + np.bincount(upper.indices, minlength=size) - on_diagonal

    return _filled(map(_mirrored, _rows(upper)), counts)


def _rows(matrix: csr_matrix) -> Iterator[Chunk]:
    """Entries of a matrix, some rows at a time."""
    for begin, end in row_blocks(matrix):
        part = slice(matrix.indptr[begin], matrix.indptr[end])
        row = np.repeat(np.arange(begin, end, dtype=np.int32), np.diff(matrix.indptr[begin : end + 1]))
        yield row, matrix.indices[part], matrix.data[part]


def looks_symmetric(matrix: csr_matrix) -> bool:
    """Whether mirror images agree, to half of the tolerance of the largest entry of their row.

    Found from A x - A^T x for two random x, which costs no copy of the matrix. With 1 <= |x_j| <= 2 a single pair of
    entries that differ by d shows as d or more, several can hardly cancel in both; rounding is some 1e-14 of the row.
    """
    largest = np.zeros(matrix.shape[0])
    for begin, end in row_blocks(matrix):
        rows = begin + np.flatnonzero(np.diff(matrix.indptr[begin : end + 1]))
        low, high = matrix.indptr[begin], matrix.indptr[end]
        if len(rows) > 0:
            largest[rows] = np.maximum.reduceat(np.abs(matrix.data[low:high]), matrix.indptr[rows] - low)
    random = np.random.default_rng(0)
    for _ in range(2):
        probe = random.uniform(1.0, 2.0, matrix.shape[0]) * random.choice([-1.0, 1.0], matrix.shape[0])
        if np.any(np.abs(matrix @ probe - matrix.T @ probe) > 0.5 * SYMMETRY_TOLERANCE * largest):
            return False
    return True


def row_blocks(matrix: csr_matrix) -> Iterator[tuple[int, int]]:
    """Ranges of rows with about a chunk of entries each."""
    begin = 0
    while begin < matrix.shape[0]:
        end = int(np.searchsorted(matrix.indptr, matrix.indptr[begin] + CHUNK, side="right")) - 1
        end = min(max(end, begin + 1), matrix.shape[0])
        yield begin, end
        begin = end


def _repeated(matrix: csr_matrix) -> np.ndarray:
    """Entries at the place of the one before; columns are sorted."""
    found = []
    for begin, end in row_blocks(matrix):
        low, high = int(matrix.indptr[begin]), int(matrix.indptr[end])
        same = matrix.indices[low + 1 : high] == matrix.indices[low : high - 1]
        starts = matrix.indptr[begin + 1 : end] - low - 1
        same[starts[(starts >= 0) & (starts < len(same))]] = False
        found.append(low + 1 + np.flatnonzero(same))
    return np.concatenate(found) if found else np.zeros(0, int)


def _rows_of(matrix: csr_matrix, entries: np.ndarray) -> np.ndarray:
    return np.searchsorted(matrix.indptr, entries, side="right") - 1
