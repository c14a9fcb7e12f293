"""Files of other public projects through attrito's readers, their entries compared with an independent reader's.

    .venv/bin/pip install pyNastran pyyeti pandas gmsh
    .venv/bin/python benchmarks/real_files.py --clones FOLDER > table.md

`real_files.toml` lists the files by repository and commit; none of them is kept here. `--clones`: where the
repositories are (`owner+name/repo` or `owner+name`, any git directory), or are cloned to. A file is read whole and
every entry is the same (to the digits of single precision, which some independent readers have for some files), or it
is refused: then the line is what the user sees. Prints the tables of docs/evidence/other-projects.md.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import independent_readers as independent
import numpy as np
from scipy.linalg import eigh
from scipy.sparse import csr_matrix

from attrito.importers import import_model, read_matrix, read_mesh
from attrito.support.errors import InputError

LIST = Path(__file__).with_name("real_files.toml")
MATRICES: dict[str, Callable[[Path], independent.Matrices]] = {
    "output4": independent.output4,
    "dmig": independent.dmig,
    "abaqus": independent.abaqus,
    "harwell-boeing": independent.harwell_boeing,
    "matrix-market": independent.matrix_market,
    "petsc": independent.petsc,
    "matlab": independent.matlab,
}
MESHES: dict[str, Callable[[Path], independent.MeshParts]] = {
    "gmsh": independent.gmsh_mesh,
    "deck": independent.deck,
    "bulk-data": independent.bulk_data,
    "archive": independent.archive,
}
SINGLE = 1.2e-7


@dataclass(frozen=True)
class Outcome:
    """What became of one file: `equal`, `read` where the other reader fails, `refused` or `DIFFERENT`, and in words."""

    kind: str
    repository: str
    path: str
    outcome: str
    words: str


def main() -> None:
    """Read all files of the list, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clones", type=Path, required=True, help="where repositories are, or are cloned to")
    parser.add_argument("--only", default="", help="files with this in kind or path")
    options = parser.parse_args()
    outcomes = []
    for group in tomllib.loads(LIST.read_text())["group"]:
        for paths in group["paths"]:
            paths = [paths] if isinstance(paths, str) else paths
            if options.only not in group["kind"] + paths[0]:
                continue
            with tempfile.TemporaryDirectory() as folder:
                files = [fetched(options.clones, group["repository"], group["commit"], path, folder) for path in paths]
                outcome, words = examined(files, group["reader"], group.get("options", {}))
            words = words.replace(f"{folder}/", "")
            outcomes.append(Outcome(group["kind"], group["repository"], ", ".join(paths), outcome, words))
            print(f"{outcome:9s} {group['kind']}: {paths[0]}: {words}", file=sys.stderr)
    print(tables(outcomes))
    if any(outcome.outcome == "DIFFERENT" for outcome in outcomes):
        raise SystemExit(1)


def fetched(clones: Path, repository: str, commit: str, path: str, folder: str) -> Path:
    """A copy of one file of a repository at a commit."""
    name = repository.replace("/", "+")
    places = [clones / name / "repo", clones / name]
    clone = next((place for place in places if place.is_dir()), None)
    if clone is None:
        clone = places[1]
        url = f"https://github.com/{repository}"
        subprocess.run(["git", "clone", "--bare", "--filter=blob:none", url, str(clone)], check=True)
    copy = Path(folder) / Path(path).name
    read = subprocess.run(["git", "-C", str(clone), "show", f"{commit}:{path}"], capture_output=True, check=True)
    copy.write_bytes(read.stdout)
    return copy


def examined(files: list[Path], reader: str, options: dict[str, str]) -> tuple[str, str]:
    """Outcome and words of one file, or of the files of one model."""
    if reader in MESHES:
        return mesh(files[0], MESHES[reader])
    if len(files) > 1:
        return model(files, MATRICES[reader], options)
    return matrices(files[0], MATRICES[reader])


def matrices(file: Path, read_other: Callable[[Path], independent.Matrices]) -> tuple[str, str]:
    """Every matrix of a file by its name: those that the other reader finds square and real must be equal."""
    try:
        others = read_other(file)
        failed = ""
    except Exception as error:  # the other reader may not know the file
        others, failed = {"": None}, type(error).__name__
    if not others:
        others, failed = {"": None}, "it finds no matrix"
    read, refused = [], []
    for name, other in others.items():
        source = f"{file}:{name}" if name else str(file)
        try:
            found = read_matrix(source, "matrix", "import")
        except InputError as error:
            refused.append(str(error))
            continue
        if failed:
            return "read", f"the other reader fails: {failed}"
        if other is None:
            return "DIFFERENT", f"{name}: read, but the other reader finds no square real matrix"
        if far := difference(found, other):
            return "DIFFERENT", f"{name}: {far}"
        read.append(f"{name or 'matrix'} {found.shape[0]} x {found.shape[0]}, {found.nnz} entries")
    if not read:
        return "refused", refused[0] if refused else "no matrix"
    more = f"; {len(refused)} refused: {refused[0]}" if refused else ""
    return "equal", (read[0] if len(read) == 1 else f"{len(read)} matrices") + more


def model(files: list[Path], read_other: Callable[[Path], independent.Matrices], options: dict) -> tuple[str, str]:
    """Stiffness and mass, or a file that holds both, imported as a model, with what else it takes."""
    given = {key: files[place] for key, place in options["files"].items()}
    output = files[0].with_name("model.h5")
    try:
        found, _ = import_model(output, **given)
    except InputError as error:
        return "refused", str(error)
    names = options.get("names", ["", ""])
    sources = [given.get("stiffness", given.get("nastran_file")), given.get("mass", given.get("nastran_file"))]
    others = [read_other(source)[name] for name, source in zip(names, sources, strict=True)]
    if options.get("compare") == "frequencies":
        # Dofs are turned to global directions, which the other reader does not do.
        if far := spectral_difference([found.stiffness, found.mass], others):
            return "DIFFERENT", far
        return "equal", f"model of {found.size} dofs, {int(np.sum(found.dof_direction == 0))} of them generalised"
    for key, other in zip(("stiffness", "mass"), others, strict=True):
        if far := difference(getattr(found, key), other):
            return "DIFFERENT", f"{key}: {far}"
    return "equal", f"model of {found.size} dofs, {found.stiffness.nnz} entries of stiffness"


def difference(found: csr_matrix, other: csr_matrix) -> str:
    """In words; "" where all entries are the same, to the digits of single precision."""
    if found.shape != other.shape:
        return f"{found.shape[0]} rows, the other reader has {other.shape[0]}"
    away = abs(found - other)
    scale = abs(other).max()
    return "" if away.max() <= SINGLE * scale else f"entries differ by {away.max() / scale:.1e} of the largest"


def spectral_difference(found: list[csr_matrix], others: list[csr_matrix]) -> str:
    """In words; "" where the eigenvalues of (M, K + s M) are the same; rows without entries are left out."""
    values = []
    shift = abs(others[0]).max() / abs(others[1]).max()
    for stiffness, mass in (found, others):
        k, m = stiffness.toarray(), mass.toarray()
        used = np.flatnonzero(abs(k).sum(axis=0) + abs(m).sum(axis=0))
        k, m = k[np.ix_(used, used)], m[np.ix_(used, used)]
        values.append(eigh(m, k + shift * m, eigvals_only=True))
    if len(values[0]) != len(values[1]):
        return f"{len(values[0])} modes, the other reader has {len(values[1])}"
    away = abs(values[0] - values[1]).max() / abs(values[1]).max()
    return "" if away < 1e-12 else f"eigenvalues differ by {away:.1e}"


def mesh(file: Path, read_other: Callable[[Path], independent.MeshParts]) -> tuple[str, str]:
    """Nodes, coordinates and the nodes of each solid, in any order."""
    try:
        found = read_mesh(file, skip=True)
    except InputError as error:
        return "refused", str(error)
    try:
        ids, points, others = read_other(file)
    except Exception as error:  # the other reader may not know the file
        return "read", f"the other reader fails: {type(error).__name__}"
    order = np.argsort(found.node_ids) if len(ids) else slice(None)
    if len(ids) and not np.array_equal(found.node_ids[order], ids):
        return "DIFFERENT", f"{len(found.node_ids)} nodes, the other reader has {len(ids)}"
    if np.abs(found.coordinates[order] - points).max() > 0.0:
        return "DIFFERENT", "coordinates"
    known = found.node_ids[order]
    by_id = np.argsort(known)
    # The other readers know elements by their number of nodes.
    solids: dict[int, list[np.ndarray]] = {}
    for _, nodes in found.elements.values():
        solids.setdefault(nodes.shape[1], []).append(nodes)
    for width, parts in solids.items():
        rows = by_id[np.searchsorted(known, np.concatenate(parts), sorter=by_id)]
        if others and not np.array_equal(in_order(rows), in_order(others.get(width, rows[:0]))):
            return "DIFFERENT", f"elements of {width} nodes"
    what = ", ".join(f"{sum(map(len, parts))} of {width} nodes" for width, parts in solids.items()) or "no solids"
    left_out = f"; left out: {'; '.join(found.skipped[:3])}" if found.skipped else ""
    return "equal", f"{len(found.node_ids)} nodes; elements: {what}{left_out}"


def in_order(rows: np.ndarray) -> np.ndarray:
    """Elements as sets of nodes, in an order of their own."""
    rows = np.sort(rows, axis=1)
    return rows[np.lexsort(rows.T[::-1])]


def tables(outcomes: list[Outcome]) -> str:
    """By kind: how many were read and refused; then what was refused, and why: one of those refused alike."""
    lines = [
        "| kind | projects | files | read, all equal | read, not compared | refused |",
        "|---|---|---|---|---|---|",
    ]
    for kind in dict.fromkeys(outcome.kind for outcome in outcomes):
        of_kind = [outcome for outcome in outcomes if outcome.kind == kind]
        projects = ", ".join(dict.fromkeys(outcome.repository for outcome in of_kind))
        counts = [sum(outcome.outcome == what for outcome in of_kind) for what in ("equal", "read", "refused")]
        lines.append(f"| {kind} | {projects} | {len(of_kind)} | {' | '.join(map(str, counts))} |")
    totals = [sum(outcome.outcome == what for outcome in outcomes) for what in ("equal", "read", "refused")]
    lines += [f"| all | | {len(outcomes)} | {' | '.join(map(str, totals))} |", ""]
    lines += ["| refused | files | what attrito says of the first |", "|---|---|---|"]
    alike: dict[tuple[str, str], list[str]] = {}
    for outcome in outcomes:
        if outcome.outcome == "refused":
            words = outcome.words.replace("\n", "; ").replace("|", "\\|")
            alike.setdefault((outcome.kind, words.partition(": expected ")[2]), []).append(words)
    lines += [f"| {kind} | {len(words)} | `{words[0]}` |" for (kind, _), words in alike.items()]
    return "\n".join(lines)


if __name__ == "__main__":
    main()
