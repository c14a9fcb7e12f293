"""A fault of a job: what it is called, how it gets there, and what must be told of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from jobs import toml, wedge


@dataclass(frozen=True)
class Case:
    """A fault: a sentence that names it, how it gets into a job, and the messages (or their parts) it must cause.

    `change` gets the job, may alter it in place, and may return a text to be written in its stead.
    """

    sentence: str
    change: Callable[[dict[str, Any]], str | None]
    messages: tuple[str, ...]
    base: Callable[[], dict[str, Any]] = wedge


def put(*path: str | int, **values: Any) -> Callable[[dict[str, Any]], None]:
    """Set keys of the table at a path."""

    def change(job: dict[str, Any]) -> None:
        table = job
        for part in path:
            table = table.setdefault(part, {}) if isinstance(part, str) else table[part]
        table.update(values)

    return change


def drop(*path: str | int) -> Callable[[dict[str, Any]], None]:
    """Delete the key or table at a path."""

    def change(job: dict[str, Any]) -> None:
        table = job
        for part in path[:-1]:
            table = table[part]
        del table[path[-1]]

    return change


def both(*changes: Callable[[dict[str, Any]], None]) -> Callable[[dict[str, Any]], None]:
    """One change after another."""

    def change(job: dict[str, Any]) -> None:
        for one in changes:
            one(job)

    return change


def frequencies(**values: Any) -> Callable[[dict[str, Any]], None]:
    """Another table [sweep]."""
    return lambda job: job.update(sweep=values)


def in_words(old: str, new: str) -> Callable[[dict[str, Any]], str]:
    """The job's text with one piece replaced."""

    def change(job: dict[str, Any]) -> str:
        text = toml(job)
        assert old in text
        return text.replace(old, new, 1)

    return change
