"""Fixtures that several files of tests share.

Nothing is imported here that starts MPI: under pytest-xdist this file is also read by the process that hands out the
tests, whose environment the others inherit, and `mpirun` would take what they start for ranks of that process.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from reduced import Case


@pytest.fixture
def free(tmp_path) -> Case:
    """A block in free space."""
    from elastic import elastic_block
    from reduced import COUNTS, SIZE, make_case

    return make_case(tmp_path, *elastic_block(COUNTS, SIZE))


@pytest.fixture
def held(tmp_path) -> Case:
    """The block held at its far end."""
    from elastic import elastic_block
    from reduced import COUNTS, SIZE, make_case

    return make_case(tmp_path, *elastic_block(COUNTS, SIZE, lambda points: points[:, 0] > SIZE[0] - 1e-9))
