"""Malformed input never crashes, hangs or fills the memory; it is told in one message. More of it: `fuzz.py`."""

from __future__ import annotations

import pytest
from fuzz import SECONDS, Case, run_cases, told_well


@pytest.fixture(scope="module")
def cases() -> list[Case]:
    return run_cases(range(40), seed=3)


def test_malformed_input_ends_with_a_message_or_a_result(cases):
    assert [(case.number, case.name, case.breaks, case.message) for case in cases if case.breaks] == []


def test_most_malformed_input_is_refused_and_quickly(cases):
    refused = [case for case in cases if case.code == 2]
    assert len(refused) > len(cases) / 2
    assert max(case.seconds for case in refused) < SECONDS


def test_a_message_names_place_and_remedy():
    assert told_well("attrito: job.toml: [sweep] start_hz = -1: expected at least 0\n")
    assert not told_well("Traceback (most recent call last)\n")
    assert not told_well("attrito: job.toml: [a] b = 1: expected 2\nsomething else\n")
