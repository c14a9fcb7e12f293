"""`attrito info`: what a file that attrito writes holds, in words; of a reduced model also how good it is."""

from __future__ import annotations

import h5py
import numpy as np

from attrito.results.journal import is_journal
from attrito.results.result import CAMPBELL, LINEAR_MODES, MODE, Result
from attrito.scene.rom_file import receptance_errors
from attrito.support.errors import Fault, InputError
from attrito.support.hdf5_reading import as_text, stored

FORMATS = ("attrito model", "attrito rom")
RESULTS = ("attrito result", MODE, LINEAR_MODES)


def describe(path: str) -> list[str]:
    """Lines about a file; `InputError` where it is none of attrito's."""
    if is_journal(path):
        return _result(path)
    with stored(path, "a file that attrito writes, HDF5") as file:
        kind = as_text(file.attrs.get("format", ""))
        if kind == FORMATS[0]:
            return _model(file)
        if kind == FORMATS[1]:
            return [*_reduced_model(file), *_quality(file)]
        if kind == CAMPBELL:
            return _campbell(file)
        if kind in RESULTS:
            return _result(path)
        if kind.startswith("attrito "):
            return _datasets_of(file, kind)
    raise InputError(Fault(path, "format", kind or "missing", "a file that attrito writes"))


def _result(path: str) -> list[str]:
    with Result(path) as result:
        lines = [f"{name}: {text}" for name, text in result.summary().items() if name != "file"]
        return [as_text(result.attribute("format")), *lines]


def _datasets_of(file: h5py.File, kind: str) -> list[str]:
    """Every dataset of a file with its shape, unit and description."""
    lines = [f"{kind}, written by attrito {as_text(file.attrs.get('attrito_version', ''))}"]
    if job := as_text(file.attrs.get("job_file", "")):
        lines.append(f"job: {job}")

    def add(name: str, thing: h5py.Group | h5py.Dataset) -> None:
        if isinstance(thing, h5py.Dataset):
            shape = " x ".join(map(str, thing.shape)) or "1"
            unit, words = (as_text(thing.attrs.get(key, "")) for key in ("unit", "description"))
            lines.append(f"{name} [{shape}]" + (f" in {unit}" if unit not in ("", "1") else "") + f": {words}")

    file.visititems(add)
    return lines


def _campbell(file: h5py.File) -> list[str]:
    speeds, closed = file["speeds/speed_hz"][:], file["speeds/closed"][:].sum(axis=1)
    points = file["points"]
    families = len(np.unique(points["nodal_diameter"][:])) if "nodal_diameter" in points else 0
    of_each = f" of {families} nodal diameters" if families else ""
    lines = [f"Campbell diagram: {len(speeds)} speeds, {speeds.min():g} to {speeds.max():g} Hz"]
    lines.append(f"tangent modes{of_each}: {len(points['mode'])} in all, to {points['frequency_hz'][:].max():.5g} Hz")
    lines.append(f"contacts closed: {closed.min()} to {closed.max()} of {file['speeds/closed'].shape[1]}")
    lines.append(f"critical speeds of engine orders: {len(file['crossings/speed_hz'])}")
    return lines


def _model(file: h5py.File) -> list[str]:
    size, entries = len(file["stiffness/row_offsets"]) - 1, len(file["stiffness/values"])
    lines = [f"model of {size} dofs, {entries} entries in the stiffness"]
    lines.append("matrices: " + ", ".join(name for name in ("stiffness", "mass", "damping") if name in file))
    for kind, group in file.get("elements", {}).items():
        lines.append(f"{len(group['id'])} elements {kind}")
    for name, ids in file.get("node_sets", {}).items():
        lines.append(f"node set {name}: {len(ids)} nodes")
    return lines


def _reduced_model(file: h5py.File) -> list[str]:
    kinds = np.bincount(file["coordinates/kind"][:], minlength=3)
    reduction = file["reduction"].attrs
    lines = [
        f"reduced model of {file['vectors/full'].shape[1]} dofs: {kinds[0]} boundary dofs, {kinds[1]} fixed-interface"
        f" modes, {kinds[2]} static corrections"
    ]
    if "recovery/dof" in file:
        lines.append(f"motion of {len(file['recovery/dof'])} dofs and of the boundary's can be recovered")
    if kinds[1]:
        counted = reduction["modes_below_shift"]
        proof = f"inertia counts {counted} below {reduction['shift_hz']:.6g} Hz" if counted >= 0 else "not counted"
        low, high = file["modes/frequency_hz"][[0, -1]]
        lines.append(
            f"fixed-interface modes from {low:.6g} to {high:.6g} Hz, residual {reduction['mode_residual']:.1e}; {proof}"
        )
    lines.append(f"constraint modes: residual {reduction['constraint_residual']:.1e}")
    place = "on disk" if reduction.get("out_of_core", 0) else "in core"
    lines.append(f"factors ordered by {reduction['ordering']}, {reduction['factor_megabytes']} MB foreseen, {place}")
    seconds = sum(value for name, value in reduction.items() if name.endswith("_seconds"))
    peak = max((value for name, value in reduction.items() if name.endswith("_peak_megabytes")), default=0.0)
    lines.append(f"made in {seconds:.1f} s and {peak / 1024:.1f} GB")
    return lines


def _quality(file: h5py.File) -> list[str]:
    if "quality" not in file or len(file["quality/frequency_hz"]) == 0:
        return ["error: not examined"]
    group = file["quality"]
    lines = ["estimated errors, interface free:"]
    pairs = zip(group["frequency_hz"][:], group["frequency_error"][:], strict=True)
    lines += [
        f"  mode {i}: {frequency:.6g} Hz, too high by {error:.1e} of it"
        for i, (frequency, error) in enumerate(pairs, 1)
    ]
    names = [name.decode() for name in file["vectors/name"][:]] if "vectors/name" in file else []
    errors = receptance_errors(group["receptance"][:], group["receptance_error"][:])
    loads = [i for i, name in enumerate(names) if not name.startswith("monitor:")]
    for i, name in enumerate(names):
        if name.startswith("monitor:") and len(group["response_hz"]):
            worst = np.nanmax(errors[i, loads or [i]], initial=0.0)
            top = group["response_hz"][-1]
            lines.append(
                f"  monitor {name.removeprefix('monitor:')}: responses up to {top:.6g} Hz wrong by {worst:.1e}"
            )
    return lines
