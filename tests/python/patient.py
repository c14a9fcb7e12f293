"""The command `attrito` with a work that waits, once some of it is done, to be told to end or to be killed.

    python patient.py run job.toml

So a test that sends a signal in the midst of a work does not race it: a run waits after `WAITS` points until it is
asked to stop, a study after `WAITS` batches for ever. Both go on meanwhile, so that the signal may find them anywhere.
"""

from __future__ import annotations

import signal
import sys
import time
from pathlib import Path

from attrito.cli import main
from attrito.studies import run as studying
from attrito.support.stop_signals import Stop

WAITS = 8
PROGRAM = str(Path(__file__).resolve())


class Patient:
    """What is called once a point, and once a batch."""

    def __init__(self):
        self._asked, self._keep, self._calls = Stop.asked, studying.keep_record, 0
        Stop.asked = lambda stop: self.asked(stop)
        studying.keep_record = self.keep

    def asked(self, stop: Stop) -> str:
        """Why to stop; all ranks ask equally often."""
        reason = self._asked(stop)
        self._calls += 1
        while self._calls >= WAITS and not reason:
            time.sleep(0.01)
            reason = self._asked(stop)
        return reason

    def keep(self, *arguments: object) -> None:
        """A batch is written."""
        self._keep(*arguments)
        self._calls += 1
        if self._calls >= WAITS:
            signal.pause()


if __name__ == "__main__":
    Patient()
    sys.exit(main(sys.argv[1:]))
