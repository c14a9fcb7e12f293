"""Which options of a command apply to which file: what does not is refused, and not left out in silence."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Mapping
from pathlib import Path

from attrito.results.result import CAMPBELL, LINEAR_MODES, MODE
from attrito.studies.table import FORMAT as STUDY
from attrito.support.errors import Fault, InputError

# Options of `attrito table` that have rows for the points of a file that is no result of a run
OF_TABLES: Mapping[str, tuple[str, ...]] = {
    MODE: ("contacts", "sets", "sensitivities"),
    LINEAR_MODES: ("sensitivities",),
    CAMPBELL: (),
    STUDY: ("bands",),
}
MADE_BY = {MODE: "`attrito mode`", LINEAR_MODES: "`attrito linear-modes`", STUDY: "`attrito study`"}
OF_RESULTS = ("contacts", "sets", "multipliers", "sensitivities", "bifurcations", "curve", "columns")
TABLE_OPTIONS = (*OF_RESULTS, "bands")
# Of `attrito export`: what matrices have nothing of
OF_MOTION = ("points", "mode", "monitor", "phases", "format", "scale", "wheel")
TEXTS = (".csv", ".txt", ".dat", "")


def check_table(options: argparse.Namespace, form: str | None) -> None:
    """Raise `InputError` where an option of `attrito table` has no rows for a file.

    Parameters
    ----------
    form : format of a file of points; None: a file without any
    """
    allowed = OF_RESULTS if form is not None and form not in OF_TABLES else OF_TABLES.get(form or "", ())
    faults = []
    for name in TABLE_OPTIONS:
        value = getattr(options, name)
        if value is None or value is False or name in allowed:
            continue
        makers = ["`attrito run`"] if name in OF_RESULTS else []
        makers += [MADE_BY[other] for other, names in OF_TABLES.items() if name in names]
        given = "given" if value is True else ", ".join(value) if isinstance(value, list) else value
        faults.append(Fault(options.result, f"--{name}", given, f"a file of {' or '.join(makers)}"))
    if faults:
        raise InputError(*faults)


def check_export(options: argparse.Namespace) -> None:
    """Raise `InputError` where options of `attrito export` exclude each other."""
    if options.matrices:
        _refuse(options, OF_MOTION, "none with --matrices")
    elif options.model:
        raise InputError(Fault("export", "--model", options.model, "--matrices with it"))
    if options.monitor is not None and (options.points is not None or options.mode is not None):
        expected = "none with --points or --mode: it chooses the point of its largest amplitude"
        raise InputError(Fault("export", "--monitor", options.monitor, expected))
    if options.output and not options.matrices:
        endings = (".vtu", ".xdmf") if options.format is None else (f".{options.format}",)
        check_ending("export", options.output, (*endings, ""))


def check_ending(command: str, path: str, endings: Iterable[str]) -> None:
    """Raise `InputError` where a file to be written is called as one of another kind; devices may have any name."""
    known = list(endings)
    if _ending(path) not in known and not (Path(path).exists() and not Path(path).is_file()):
        names = ", ".join(ending or "no ending" for ending in known)
        raise InputError(Fault(command, "-o", path, f"a name ending {names}"))


def _ending(path: str) -> str:
    return Path(path).suffix.lower()


def _refuse(options: argparse.Namespace, names: Iterable[str], expected: str) -> None:
    faults = [
        Fault("export", f"--{name}", "given" if value is True else value, expected)
        for name in names
        if (value := getattr(options, name)) is not None and value is not False
    ]
    if faults:
        raise InputError(*faults)
