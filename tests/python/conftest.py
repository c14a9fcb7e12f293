"""Fixtures that several files of tests share."""

from __future__ import annotations

import pytest
from elastic import elastic_block
from reduced import COUNTS, SIZE, Case, make_case


@pytest.fixture
def free(tmp_path) -> Case:
    """A block in free space."""
    return make_case(tmp_path, *elastic_block(COUNTS, SIZE))


@pytest.fixture
def held(tmp_path) -> Case:
    """The block held at its far end."""
    return make_case(tmp_path, *elastic_block(COUNTS, SIZE, lambda points: points[:, 0] > SIZE[0] - 1e-9))
