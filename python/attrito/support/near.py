"""What a misspelt word may have been meant to be."""

from __future__ import annotations

from collections.abc import Iterable


def nearest(word: str, words: Iterable[str]) -> str | None:
    """The word that is most like another, if one is like it."""
    import difflib

    return next(iter(difflib.get_close_matches(word, list(words), 1, 0.7)), None)
