"""What a run says: lines that read well in a file, one that writes over itself on a terminal."""

from __future__ import annotations

import os
import pty
import subprocess
import sys
from types import SimpleNamespace

import pytest
from jobs import ENVIRONMENT, wedge, write_job

from attrito.runs import progress as module
from attrito.runs.progress import Progress

ALONE = SimpleNamespace(rank=0, size=1)


def point(frequency: float, level: float = 1.0, outcome: str = "converged") -> SimpleNamespace:
    """A point as `Progress` sees it."""
    return SimpleNamespace(
        frequency_hz=frequency, level=level, branch=0, iterations=2, outcome=outcome, states=(1, 0, 0, 0),
        amplitude=[1.0],
    )  # fmt: skip


@pytest.fixture
def clock(monkeypatch) -> SimpleNamespace:
    """The time that `Progress` sees."""
    now = SimpleNamespace(time=0.0)
    monkeypatch.setattr(module.time, "monotonic", lambda: now.time)
    return now


def frequencies(text: str) -> list[float]:
    """Of the points that have a line."""
    return [float(line.split()[1]) for line in text.splitlines() if " Hz  level " in line]


def test_in_a_file_points_have_a_line_now_and_then(clock, capsys):
    said = Progress(ALONE)
    for i in range(100):
        clock.time = 0.1 * i
        said.point(point(100.0 + i), "tip", i + 1)
    said.say("that was all")
    # Every 2 s, and the last.
    assert frequencies(capsys.readouterr().out) == [100.0, 120.0, 140.0, 160.0, 180.0, 199.0]


def test_the_first_and_last_point_of_a_level_and_of_an_outcome_have_a_line(clock, capsys):
    said = Progress(ALONE)
    points = [point(1.0), point(2.0), point(3.0), point(4.0, outcome="not_converged"), point(5.0), point(6.0),
              point(7.0, level=2.0), point(8.0, level=2.0)]  # fmt: skip
    for i, one in enumerate(points):
        said.point(one, "tip", i + 1)
    assert frequencies(capsys.readouterr().out) == [1.0, 3.0, 4.0, 5.0, 6.0, 7.0]
    said.say("that was all")
    assert frequencies(capsys.readouterr().out) == [8.0]


def on_a_terminal(folder, *command: str) -> str:
    """All that a command writes where its output is a terminal."""
    ours, theirs = pty.openpty()
    try:
        started = subprocess.Popen(command, cwd=folder, env=os.environ | ENVIRONMENT, stdout=theirs, stderr=theirs)
    finally:
        os.close(theirs)
    text = b""
    with os.fdopen(ours, "rb", buffering=0) as terminal:
        while True:
            try:
                piece = terminal.read(65536)
            except OSError:  # what Linux says where the other end has closed
                break
            if not piece:
                break
            text += piece
    assert started.wait(60) == 0, text
    # The terminal itself ends lines so.
    return text.decode().replace("\r\n", "\n")


def test_on_a_terminal_a_point_writes_over_the_one_before_but_not_under_mpirun(tmp_path):
    job = wedge(force=1.0)
    job["sweep"] = {"start_hz": 136.0, "stop_hz": 134.0}
    command = [sys.executable, "-m", "attrito.cli", "run", write_job(tmp_path, job)]
    assert "\r" in on_a_terminal(tmp_path, *command)
    text = on_a_terminal(tmp_path, "mpirun", "-n", "2", *command)
    assert "\r" not in text and "\x1b" not in text
    assert len(frequencies(text)) >= 2
