"""The command `attrito`.

Exit codes: 0 done; 1 the numerics did not deliver (the file says where); 2 the input is at fault, or a file cannot be
written.
"""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Sequence

from attrito.arguments import parser
from attrito.faults import InputError, NumericsError, unusable_file

# Ranks share the work; threads of BLAS would fight them. To be said before numpy and the library load BLAS.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code."""
    options = parser().parse_args(arguments)
    parallel = options.command in ("run", "reduce", "peak", "study", "integrate", "export", "verify")
    try:
        options.work(options)
        sys.stdout.flush()
    except InputError as error:
        # What the library found names no file.
        place = f"{options.job}: " if "job" in options and not error.faults else ""
        return _tell(f"{place}{error}", 2, parallel)
    except NumericsError as error:
        return _tell(f"{options.job}: {error}" if "job" in options else str(error), 1, parallel)
    except BrokenPipeError:
        sys.stderr.close()
        return 0
    except KeyboardInterrupt:
        print("attrito: interrupted", file=sys.stderr)
        return 130
    except OSError as error:
        # Of this rank alone, as where its output goes to a disk that is full.
        print(f"attrito: {unusable_file(error)}", file=sys.stderr, flush=True)
        _forget_output()
        if parallel:
            _abort(2)
        return 2
    except Exception:
        if parallel:
            _abort(1)
        raise
    return 0


def _tell(message: str, code: int, parallel: bool) -> int:
    """Print a message once; every rank has raised the same one."""
    rank = 0
    if parallel:
        from mpi4py import MPI

        rank = MPI.COMM_WORLD.rank
        sys.stdout.flush()
    if rank == 0:
        print(f"attrito: {message}", file=sys.stderr, flush=True)
    return code


def _abort(code: int) -> None:
    """An error on one rank that others do not know of ends all of them."""
    from mpi4py import MPI

    if MPI.COMM_WORLD.size > 1:
        if code == 1:
            traceback.print_exc()
        MPI.COMM_WORLD.Abort(code)


def _forget_output() -> None:
    """What standard output does not take is not tried again when Python ends."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == "__main__":
    sys.exit(main())
