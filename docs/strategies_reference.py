"""The table of fallback strategies as the library tries them, for explanation/strategies.md."""

from __future__ import annotations

from attrito.library import loading
from attrito.library.description import describe

HEADINGS = ("strategy", "start and path of Newton's method", "where it is tried", "cost at most", "on a long series")


def as_markdown() -> str:
    """A row a strategy, in their order."""
    rows = [[f"`{name}`", *words] for name, *words in describe(loading.load()).rows["strategies"]]
    table = [HEADINGS, ["---"] * len(HEADINGS), *rows]
    return "\n" + "\n".join(f"| {' | '.join(cells)} |" for cells in table) + "\n"
