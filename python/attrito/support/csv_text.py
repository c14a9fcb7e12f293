"""Texts in CSV: quoted where they hold what separates, and never the beginning of a formula.

A spreadsheet runs a cell that begins with =, +, - or @ (or a tab or carriage return before it): such a text gets an
apostrophe in front, which spreadsheets take for "this is text". Numbers are not texts, and stay as they are.
"""

from __future__ import annotations

import numpy as np

FORMULA = ("=", "+", "-", "@", "\t", "\r")
SEPARATORS = (",", '"', "\n", "\r")


def cell(text: str) -> str:
    """A text, as a name or an outcome, as one cell."""
    if text.startswith(FORMULA):
        text = f"'{text}"
    if any(mark in text for mark in SEPARATORS) or text != text.strip():
        return '"' + text.replace('"', '""') + '"'
    return text


def numbers(values: np.ndarray) -> list[str]:
    """12 significant digits; NaN is empty; no minus zero."""
    return ["" if value != value else f"{value + 0.0:.12g}" for value in np.asarray(values, dtype=float).tolist()]
