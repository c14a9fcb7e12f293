"""Changes that make a sample file faulty, and the one fault that is to be said of it."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from attrito.support.errors import InputError


def replaced(old: str, new: str) -> Callable[[str], str]:
    """A text with one piece replaced."""

    def change(text: str) -> str:
        assert old in text
        return text.replace(old, new, 1)

    return change


def cut(count: int) -> Callable[[str], str]:
    """A text without its last characters."""
    return lambda text: text[:-count]


def fault_of(call: Callable, *arguments: object, **options: object) -> str:
    """The one line of the one fault."""
    with pytest.raises(InputError) as caught:
        call(*arguments, **options)
    lines = str(caught.value).splitlines()
    assert len(lines) == 1
    return lines[0]
