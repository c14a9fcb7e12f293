"""Which way of a chart comes next: coarse ways of all series before finer ones of any, until the time is spent."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from attrito.charts.file import Way


def in_turn(series: Sequence[Iterator[Way]], spent: Callable[[], bool]) -> Iterator[Way]:
    """The first way of each series, then the second of each, and so on.

    Parameters
    ----------
    series : ways of each, the cheapest first
    spent : whether there is no time left; every series has its first way all the same
    """
    left = list(series)
    first = True
    while left:
        for one in tuple(left):
            if spent() and not first:
                return
            way = next(one, None)
            if way is None:
                left.remove(one)
            else:
                yield way
        first = False
