"""Which row of a matrix is which dof: lists that FE codes write beside matrices that do not say.

CalculiX's `.dof`: a line `node.direction` for each row. ANSYS's mapping file of `HBMAT`: lines `row node label`. The
cards `EXTRN`, or `ASET`, `ASET1` and `USET`, of Nastran: rows go by point, then component, as OUTPUT4 writes matrices
of the a-set where points are not resequenced. Scalar points (component 0, or none) are generalised coordinates.
"""

from __future__ import annotations

from pathlib import Path
from typing import NoReturn

import numpy as np

from attrito.importers.mesh_data import is_id
from attrito.importers.nastran_cards import Card, read_cards, whole_numbers
from attrito.support.errors import Fault, InputError
from attrito.support.text_files import read_lines

LABELS = {"UX": 1, "UY": 2, "UZ": 3, "ROTX": 4, "ROTY": 5, "ROTZ": 6}
_CARDS = ("ASET", "ASET1", "USET", "EXTRN")


def names_cards(path: str | Path) -> bool:
    """Whether a file names dofs by cards of Nastran."""
    return any(line.upper().startswith(_CARDS) for line in read_lines(path))


def read_dof_file(path: str | Path) -> tuple[np.ndarray, np.ndarray]:
    """Node id `[n]` and direction `[n]` (1 to 6) of each row."""
    path = str(path)
    lines = read_lines(path, "a file that can be read")
    words = [line.split() for line in lines]
    if any(len(line) == 3 and line[2].upper() in LABELS for line in words[:50]):
        node, direction = _mapping(path, words)
    elif any(line.upper().startswith(_CARDS) for line in lines):
        node, direction = _sets(path)
    else:
        node, direction = _dotted(path, words)
    if len(node) == 0:
        raise InputError(Fault(path, "file", "empty", "a line node.direction for each equation, or a mapping file"))
    code = 8 * node + direction
    if len(np.unique(code)) < len(code):
        ids, count = np.unique(code, return_counts=True)
        twice = int(ids[count > 1][0])
        value = f"node {twice // 8} direction {twice % 8}: a dof that occurs twice"
        raise InputError(Fault(path, "file", value, "every dof once"))
    return node, direction


def _dotted(path: str, words: list[list[str]]) -> tuple[np.ndarray, np.ndarray]:
    # As text: read as a number, node 12.1 would do, but 12345678901.1 would be rounded.
    flat = [(k, word) for k, line in enumerate(words) for word in line]
    node, direction = np.empty(len(flat), np.int64), np.empty(len(flat), np.int8)
    for k, (line, word) in enumerate(flat):
        left, _, right = word.partition(".")
        if not is_id(left) or right not in ("0", "1", "2", "3", "4", "5", "6"):
            expected = "node.direction with direction 1, 2, 3 (displacement), 4, 5, 6 (rotation) or 0 (generalised)"
            raise InputError(Fault(path, f"line {line + 1}", word, expected))
        node[k], direction[k] = int(left), int(right)
    return node, direction


def _mapping(path: str, words: list[list[str]]) -> tuple[np.ndarray, np.ndarray]:
    node, direction = [], []
    for k, line in enumerate(words):
        if len(line) == 0 or (not node and not is_id(line[0])):
            continue
        if len(line) != 3 or not is_id(line[0]) or not is_id(line[1]) or line[2].upper() not in LABELS:
            expected = f"row, node and one of {', '.join(LABELS)} (no Lagrange multipliers, no other fields)"
            raise InputError(Fault(path, f"line {k + 1}", " ".join(line), expected))
        if int(line[0]) != len(node) + 1:
            raise InputError(Fault(path, f"line {k + 1}", line[0], f"row {len(node) + 1}: rows in order, from 1"))
        node.append(int(line[1]))
        direction.append(LABELS[line[2].upper()])
    return np.array(node, np.int64), np.array(direction, np.int8)


def _sets(path: str) -> tuple[np.ndarray, np.ndarray]:
    found: list[tuple[int, int]] = []
    external: list[tuple[int, int]] = []
    for card in read_cards(path):
        if card.name == "ASET1":
            found += [(node, part) for node in whole_numbers(card, 1) for part in _components(card, card.fields[0])]
        elif card.name in ("ASET", "USET", "EXTRN"):
            fields = card.fields[1:] if card.name == "USET" else card.fields
            for node, parts in zip(fields[::2], [*fields[1::2], ""], strict=False):
                if node and not is_id(node):
                    _bad(card)
                if node:
                    dofs = [(int(node), part) for part in _components(card, parts)]
                    (external if card.name == "EXTRN" else found).extend(dofs)
    # What EXTRN lists are all points of a superelement; ASET cards beside it list the same.
    found = sorted(external or found)
    table = np.array(found, np.int64).reshape(-1, 2)
    return table[:, 0], table[:, 1].astype(np.int8)


def _components(card: Card, text: str) -> list[int]:
    """Numbers of components; 0 of a scalar point."""
    if text in ("", "0"):
        return [0]
    if any(letter not in "123456" for letter in text):
        _bad(card)
    return [int(letter) for letter in text]


def _bad(card: Card) -> NoReturn:
    raise InputError(card.fault("points and components: made of 1 to 6, or 0 of a scalar point"))
