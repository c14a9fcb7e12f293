"""Which files and matrices belong to a job of Abaqus or Nastran."""

from __future__ import annotations

import re
from pathlib import Path

from attrito.importers.abaqus_superelement import read_superelement_matrices
from attrito.importers.dof_numbers import DofNumbers
from attrito.importers.nastran_dmig import DmigFile, is_dmig
from attrito.importers.nastran_op4 import is_op4, read_op4_matrices
from attrito.importers.source import Source
from attrito.support.errors import Fault, InputError

_SUPERELEMENT = {"stiffness": "STIFFNESS", "mass": "MASS", "damping": "VISCOUSDAMPING"}
_ABAQUS = {"stiffness": "_STIF", "mass": "_MASS", "damping": "_DMPV"}
# First letter of Nastran's names: KAAX, MAAX, BAAX of EXTSEOUT; KAA, KGG, K2GG, ...; K4 is structural damping.
_NASTRAN = {"stiffness": "K", "mass": "M", "damping": "B"}
_STRUCTURAL_DAMPING = "K4"
# Names of matrices of a whole set, as those of EXTSEOUT: KAAX, MAA, BXX1
_OF_A_SET = re.compile(r"[KMB](AA|XX|GG|LL|FF|HH)X?\d*")


def abaqus_files(job: str | Path) -> dict[str, str | Path]:
    """The `.mtx` files of a job, `job_STIF1.mtx` and the like; the number is that of the step that wrote them."""
    job = Path(job)
    files: dict[str, str | Path] = {}
    for name, part in _ABAQUS.items():
        found = sorted(job.parent.glob(f"{job.name}{part}*.mtx"))
        if len(found) > 1:
            names = ", ".join(path.name for path in found)
            raise InputError(Fault("import", "abaqus", names, f"one file, or --{name} with one of them"))
        if found:
            files[name] = found[0]
        elif name != "damping":
            expected = f"the {name} that *MATRIX OUTPUT writes"
            raise InputError(Fault("import", "abaqus", f"{job}{part}1.mtx: no such file", expected))
    return files


def abaqus_matrices(job: str | Path, numbers: DofNumbers) -> tuple[dict[str, str | Path], dict[str, Source]]:
    """The files of a job, or the matrices of a substructure where the job is its file."""
    if not Path(job).is_file():
        return abaqus_files(job), {}
    found = read_superelement_matrices(job, numbers)
    missing = [name for name in ("stiffness", "mass") if name.upper() not in found]
    if missing:
        value = ", ".join(found)
        raise InputError(Fault(str(job), missing[0], value, f"*MATRIX, TYPE={missing[0].upper()}: {missing[0]}=YES"))
    return {}, {name: found[kind] for name, kind in _SUPERELEMENT.items() if kind in found}


def nastran_matrices(path: str | Path, numbers: DofNumbers) -> tuple[dict[str, Source], list[str]]:
    """Stiffness, mass and viscous damping of a file, by the first letter of their names; a note on others."""
    path = str(path)
    try:
        with Path(path).open("rb") as file:
            start = file.read(1 << 20)
    except OSError as error:
        expected = "a file that can be read"
        raise InputError(Fault(path, "file", error.strerror or str(error), expected)) from error
    if is_op4(start):
        found, names = read_op4_matrices(path, "nastran")
        left_out = {name: what for name, what in names.items() if what}
    else:
        file = DmigFile(path, numbers)
        found, left_out = file.sources, file.left_out
        if not found and not left_out:
            expected = "a file with matrices: DMIG cards or OUTPUT4"
            raise InputError(Fault(path, "file", "no matrix" if is_dmig(start) else "no DMIG", expected))
    # A code writes a matrix that it has not as one of a single row.
    for name in [name for name, source in found.items() if source.entries is not None and source.entries.count == 0]:
        left_out[name] = "empty"
        del found[name]
    chosen: dict[str, Source] = {}
    for name, letter in _NASTRAN.items():
        names = [key for key in found if key.startswith(letter) and not key.startswith(_STRUCTURAL_DAMPING)]
        # Output maps of a superelement (MUG1, MES1) may be square.
        of_sets = [key for key in names if _OF_A_SET.fullmatch(key)]
        names = of_sets if len(of_sets) == 1 else names
        if len(names) > 1 or (not names and name != "damping"):
            others = [f"{key} ({what})" for key, what in left_out.items()]
            value = ", ".join(names or [*found, *others])
            expected = f"one matrix whose name begins with {letter}, or --stiffness {path}:NAME --mass {path}:NAME"
            raise InputError(Fault(path, name, value, expected))
        if names:
            chosen[name] = found[names[0]]
    used = {source.key for source in chosen.values()}
    left_out |= {name: "square, of another name" for name in found if name not in used}
    return chosen, _left_out(left_out)


def _left_out(names: dict[str, str]) -> list[str]:
    """One line on the matrices of a file that no model has, by what they are."""
    kinds = [(what, [name for name, is_what in names.items() if is_what == what]) for what in set(names.values())]
    parts = [f"{', '.join(of_kind)} ({what})" for what, of_kind in sorted(kinds)]
    return [f"left out of the matrices: {'; '.join(parts)}"] if parts else []
