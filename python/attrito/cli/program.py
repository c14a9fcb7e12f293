"""The command `attrito`.

Exit codes: 0 done, and the result is there; 1 the numerics did not deliver (the file says where); 2 the input is at
fault, or a file cannot be written; 130 interrupted.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import shutil
import sys
import time
import traceback
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from attrito.cli.arguments import parse
from attrito.cli.signal_watch import SignalWatch
from attrito.cli.standard_output import (
    escape_controls,
    forget_output,
    open_closed_descriptors,
    print_names_in_any_encoding,
    unbreakable_output,
)
from attrito.support.errors import Fault, InputError, NumericsError, unforeseen, unusable_file
from attrito.support.memory_limit import ROWS, take_buffers
from attrito.support.overwrite_check import check_files, is_nameless
from attrito.support.verbosity import QUIET, VERBOSE

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

# Ranks share the work; threads of BLAS would fight them. To be said before numpy and the library load BLAS.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Commands whose result is what they print.
PRINTED = ("table", "info", "keys")
INTERRUPTED = 130
# Options that name what is read.
READ = (
    "job",
    "study",
    "fit",
    "optimum",
    "result",
    "file",
    "mesh",
    "nastran",
    "stiffness",
    "mass",
    "damping",
    "dofs",
    "geometric_stiffness",
    "beside",
)

# Seconds that a rank with a fault waits for others that have it, too
PATIENCE = 5.0
# Tag of their messages
HERE = 4711


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code."""
    closed = open_closed_descriptors()
    print_names_in_any_encoding()
    escape_controls()
    options = parse(arguments)
    with SignalWatch():
        try:
            take_buffers(_multiply)
            output = getattr(options, "output", None)
            if output is not None and options.command != "verify" and is_nameless(output):
                raise InputError(Fault(options.command, "output", output, "the name of a file"))
            check_files(options.command, "file", _read_by(options))
            if options.command not in PRINTED:
                with unbreakable_output(), _as_talkative(options):
                    options.work(options)
                return 0
            if closed:
                raise InputError(Fault(options.command, "standard output", "closed", "a place to print the result to"))
            options.work(options)
            sys.stdout.flush()
        except (InputError, NumericsError) as error:
            return _tell(f"{_place(options, error)}{error}", 1 if isinstance(error, NumericsError) else 2)
        except BrokenPipeError:
            # Whoever reads what is printed has seen enough.
            forget_output()
        except KeyboardInterrupt:
            return _end_alone("interrupted", INTERRUPTED)
        except OSError as error:
            # Of this rank alone, as where its output goes to a disk that is full.
            return _end_alone(str(unusable_file(error)), 2)
        except Exception as error:
            fault = unforeseen(error)
            return _end_alone(f"{_place(options, fault)}{fault}", 2)
    return 0


@contextlib.contextmanager
def _as_talkative(options: argparse.Namespace) -> Iterator[None]:
    """Standard output as `--quiet` and `--verbose` ask for it."""
    if getattr(options, "verbose", False):
        os.environ[VERBOSE] = "1"
    if getattr(options, "quiet", False):
        os.environ[QUIET] = "1"
        try:
            with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere):
                yield
        finally:
            del os.environ[QUIET]
    else:
        yield


def _read_by(options: argparse.Namespace) -> list[str]:
    """Files that a command reads."""
    given = [str(value) for name, value in vars(options).items() if name in READ and value is not None]
    given += getattr(options, "results", [])
    # `FILE:NAME` is one matrix of a file of several.
    return [*given, *(value.rpartition(":")[0] for value in given if ":" in value)]


def _place(options: argparse.Namespace, error: Exception) -> str:
    """What the command was given, before messages that name no file."""
    if getattr(error, "faults", ()):
        return ""
    kinds = ("job", "study", "fit", "optimum", "result", "file", "output")
    given = next((name for name in kinds if name in options), None)
    if "results" in options:
        return f"{options.results[0]}: "
    return "" if given is None or (isinstance(error, NumericsError) and given != "job") else f"{vars(options)[given]}: "


def _multiply() -> None:
    """Two matrices, by the BLAS of numpy."""
    import numpy as np

    np.ones((ROWS, ROWS)) @ np.ones((ROWS, ROWS))


def _ranks() -> Comm | None:
    """All ranks, if there are several and the command has begun to use them; whichever command it is."""
    mpi = sys.modules.get("mpi4py.MPI")
    return None if mpi is None or not mpi.Is_initialized() or mpi.COMM_WORLD.size == 1 else mpi.COMM_WORLD


def _tell(message: str, code: int) -> int:
    """Print a message once, and end with a code; every rank has raised the same one, or this one alone."""
    ranks = _ranks()
    forget_output()
    if ranks is None or ranks.rank == 0:
        _print_error(message)
    if ranks is not None and not _all_come(ranks):
        # A library that one machine does not have is missed there alone, and the others wait for this rank.
        if ranks.rank:
            _print_error(message)
        ranks.Abort(code)
    return code


def _all_come(ranks: Comm) -> bool:
    """Whether all ranks come here within some seconds: rank 0 takes a message of each and answers."""
    others, end = range(1, ranks.size), time.monotonic() + PATIENCE
    if ranks.rank:
        ranks.isend(None, 0, HERE)
    # Not collective: that would take part in what the others wait in.
    awaited = [ranks.irecv(source=rank, tag=HERE) for rank in (others if ranks.rank == 0 else [0])]
    while awaited:
        awaited = [one for one in awaited if not one.test()[0]]
        if awaited and time.monotonic() > end:
            return False
        time.sleep(0.001)
    for sent in [ranks.isend(None, rank, HERE) for rank in others if ranks.rank == 0]:
        sent.wait()
    return True


def _end_alone(message: str, code: int) -> int:
    """End with what this rank alone has met: the others are ended with it."""
    forget_output()
    _print_error(message)
    if (ranks := _ranks()) is not None:
        ranks.Abort(code)
    return code


def _print_error(message: str) -> None:
    with contextlib.suppress(OSError, ValueError):
        if os.environ.get("ATTRITO_TRACEBACK") and sys.exc_info()[1] is not None:
            traceback.print_exc()
        coloured = sys.stderr.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"
        name = "\x1b[1;31mattrito:\x1b[0m" if coloured else "attrito:"
        if sys.stderr.isatty():
            from attrito.runs.progress import wrapped

            width = shutil.get_terminal_size().columns - len("attrito: ")
            message = "\n".join(wrapped(line, width) for line in message.splitlines())
        print(f"{name} {message}", file=sys.stderr, flush=True)
