"""Fixtures that several files of tests share, and slow studies: marked `slow`, they run with `--all` alone.

Nothing is imported here that starts MPI: under pytest-xdist this file is also read by the process that hands out the
tests, whose environment the others inherit, and `mpirun` would take what they start for ranks of that process.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.figure import Figure
    from reduced import Case

# What commands get (jobs.ENVIRONMENT): threads of BLAS change the last digit, and some tests compare runs bit for bit.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

KEPT = "slow: --all runs it"


def pytest_addoption(parser: pytest.Parser) -> None:
    """`--all`."""
    parser.addoption("--all", action="store_true", help="run slow studies, too")


def pytest_configure(config: pytest.Config) -> None:
    """Make `slow` known."""
    config.addinivalue_line("markers", "slow: a study of many scenes or of size, kept for script/test --all")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Skip slow studies unless all is asked for."""
    for item in items:
        if item.get_closest_marker("slow") and not config.getoption("--all"):
            item.add_marker(pytest.mark.skip(reason=KEPT))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say in the last lines how many studies were not run."""
    kept = [report for report in terminalreporter.stats.get("skipped", []) if KEPT in str(report.longrepr)]
    if kept:
        terminalreporter.write_line(f"{len(kept)} slow studies are kept for script/test --all:")
        for name in sorted(report.nodeid for report in kept):
            terminalreporter.write_line(f"    {name}")


@pytest.fixture
def written() -> Iterator[list[Figure]]:
    """Figures that this process writes during the test, in their order."""
    from figures import written_figures

    with written_figures() as found:
        yield found


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
