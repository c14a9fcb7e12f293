"""Gaps of contacts from a text file: a line `node, gap` for each node of side a.

Between both are blanks, a comma, a semicolon or a tab; with the last two a comma is a decimal one. Lines of names above
the numbers are left out.

What follows `#` is a comment. At Gauss points the nodes' gaps are interpolated by the face's shape functions.
"""

from __future__ import annotations

import numpy as np

from attrito.model.model import Model
from attrito.model.pairs import Pairs, node_rows, some
from attrito.support.errors import Fault, InputError
from attrito.support.text_files import number, read_lines


def _words(line: str) -> list[str]:
    """Entries between commas or blanks; between semicolons or tabs, where a comma is a decimal one."""
    for separator in ";\t":
        if separator in line:
            return [word.strip().replace(",", ".") for word in line.split(separator)]
    return line.replace(",", " ").split()


def read_gaps(path: str, model: Model, pairs: Pairs) -> np.ndarray:
    """Gaps `[nc]` of the contacts of one set, user length.

    Raises
    ------
    InputError : a file that cannot be read, lines that are no node and number, nodes twice, unknown or missing
    """
    nodes, values = [], []
    for count, line in enumerate(read_lines(path), start=1):
        words = _words(line.partition("#")[0])
        if not words or (not nodes and words[0][:1].isalpha()):
            continue  # a line of names above the numbers, too
        try:
            node, value = words
            nodes.append(np.int64(int(node)))
            values.append(number(value))
        except (ValueError, OverflowError):
            raise InputError(Fault(path, f"line {count}", line.strip(), "a node and its gap")) from None
        if not np.isfinite(values[-1]):
            raise InputError(Fault(path, f"line {count}", line.strip(), "a finite gap"))
    listed = np.array(nodes, dtype=np.int64)
    known, count = np.unique(listed, return_counts=True)
    if (count > 1).any():
        raise InputError(Fault(path, "nodes", some(known[count > 1]), "each node once"))
    in_model = np.isin(known, model.node_ids)
    if not in_model.all():
        raise InputError(Fault(path, "nodes", some(known[~in_model]), "nodes of the model"))
    gaps = np.full(len(model.node_ids), np.nan)
    gaps[node_rows(model, listed)] = values
    touched = pairs.nodes >= 0
    missing = np.unique(pairs.nodes[touched & np.isnan(gaps[pairs.nodes])])
    if len(missing):
        expected = "a gap for every node of the contacts' side a"
        raise InputError(Fault(path, "nodes", f"without {some(model.node_ids[missing])}", expected))
    return np.einsum("nk,nk->n", pairs.shape, np.where(touched, gaps[pairs.nodes], 0.0))
