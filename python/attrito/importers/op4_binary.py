"""Binary OUTPUT4 files: each record stands between two copies of its length in bytes, of either byte order.

Integers have 4 bytes, or 8 where the code that wrote them counts so; then numbers have 8 bytes, too. The layout of the
records is explained in `nastran_op4`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import BinaryIO

import numpy as np

from attrito.importers.op4_matrix import STRING, Op4Matrix, new_matrix
from attrito.importers.source import refuse

BATCH = 1 << 22
# Bytes of a header's record: four integers and a name of two words.
_HEADERS = {24: 4, 48: 8}


def is_op4_binary(start: bytes) -> bool:
    """Whether a file begins with a record as long as a header."""
    return _layout(start) is not None


def _layout(start: bytes) -> tuple[str, int] | None:
    """Byte order and bytes of an integer."""
    for order in "<>":
        length = int(np.frombuffer(start[:4], f"{order}i4")[0]) if len(start) >= 4 else 0
        if length in _HEADERS and start[4 + length : 8 + length] == start[:4]:
            return order, _HEADERS[length]
    return None


def matrices_of_binary(path: str, key: str, wanted: set[str] | None) -> Iterator[Op4Matrix]:
    """Each matrix of the file, once it is read whole."""
    with open(path, "rb") as file:
        order, width = _layout(file.read(64))
        file.seek(0)
        while (header := _record(file, path, key, order, True)) is not None:
            if len(header) != 6 * width:
                raise refuse(path, key, f"a record of {len(header)} bytes", f"a header, of {6 * width} bytes")
            numbers = np.frombuffer(header[: 4 * width], f"{order}i{width}").tolist()
            name = header[4 * width :].decode(errors="replace")
            yield _read_columns(file, new_matrix(path, name, numbers, wanted), order, width)


def _read_columns(file: BinaryIO, matrix: Op4Matrix, order: str, width: int) -> Op4Matrix:
    batch: list[bytes] = []
    size = 0
    while True:
        record = _record(file, matrix.path, matrix.name, order, False)
        column = int(np.frombuffer(record[:width], f"{order}i{width}")[0]) if len(record) > 3 * width else -1
        if column < 1 or len(record) % width != 0:
            raise refuse(matrix.path, matrix.name, f"a record of {len(record)} bytes", "a column: number, row, words")
        last = column > matrix.columns
        if not last and matrix.entries is not None:
            batch.append(record)
            size += len(record)
        if batch and (last or size > BATCH):
            _add(matrix, batch, order, width)
            batch, size = [], 0
        if last:
            return matrix


def _add(matrix: Op4Matrix, batch: list[bytes], order: str, width: int) -> None:
    """The columns of some records."""
    raw = np.frombuffer(b"".join(batch), f"u{width}")
    number = raw.view(f"{order}i{width}")
    lengths = np.array([len(record) // width for record in batch])
    begin = np.cumsum(lengths) - lengths
    column, first = number[begin].astype(np.int64), number[begin + 1].astype(np.int64)
    # Words of a number; of 8 bytes where integers are.
    words = 2 if matrix.kind == 2 and width == 4 else 1
    kind = f"{order}f{8 if width == 8 else 4 * words}"

    def add(column: np.ndarray, row: np.ndarray, place: np.ndarray, length: np.ndarray) -> None:
        if np.any(length % words != 0):
            raise refuse(matrix.path, matrix.name, "a column of half a number", f"{words} words a number")
        within = np.arange(length.sum()) - np.repeat(np.cumsum(length) - length, length)
        values = raw[np.repeat(place, length) + within].view(kind).astype(np.float64)
        matrix.add(column, row, length // words, values)

    dense = first > 0
    if dense.any():
        add(column[dense], first[dense], begin[dense] + 3, lengths[dense] - 3)
    column, place, end = column[~dense], begin[~dense] + 3, (begin + lengths)[~dense]
    head = 2 if matrix.bigmat else 1
    # One string of every column at a time.
    while len(column) > 0:
        if np.any(place + head >= end):
            raise refuse(matrix.path, matrix.name, f"column {column[np.argmax(place + head >= end)]}", "whole strings")
        code = number[place].astype(np.int64)
        row = number[place + 1].astype(np.int64) if matrix.bigmat else code % STRING
        length = (code if matrix.bigmat else code // STRING) - 1
        place = place + head
        wrong = (length < 1) | (place + length > end)
        if wrong.any():
            value = f"column {column[np.argmax(wrong)]}"
            raise refuse(matrix.path, matrix.name, value, "strings that fit their record")
        add(column, row, place, length)
        place = place + length
        more = place < end
        column, place, end = column[more], place[more], end[more]


def _record(file: BinaryIO, path: str, key: str, order: str, may_end: bool) -> bytes | None:
    mark = file.read(4)
    if may_end and mark == b"":
        return None
    length = int(np.frombuffer(mark, f"{order}i4")[0]) if len(mark) == 4 else -1
    record = file.read(length) if length > 0 else b""
    if length <= 0 or len(record) != length or file.read(4) != mark:
        raise refuse(path, key, f"byte {file.tell()}", "whole records: the file is cut off, or no OUTPUT4 file")
    return record
