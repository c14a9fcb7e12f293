"""Stresses at nodes of a finite-element model from points of a result: `attrito stress`, and `attrito.stress`."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from attrito.export.export import full_field, node_harmonics
from attrito.export.wheel import wheel_of
from attrito.model.model import Model
from attrito.model.model_file import read_model
from attrito.plots.style import check_picture, save
from attrito.results.chosen_points import chosen_points
from attrito.results.result import LINEAR_MODES, MODE, Result
from attrito.stresses.cycle import cycle_of
from attrito.stresses.field import write_field
from attrito.stresses.neighbours import boundaries_of, with_neighbours
from attrito.stresses.picture import stress_picture
from attrito.stresses.recovery import EXPECTED, nodal_stress, recoverable
from attrito.stresses.stresses import Stresses
from attrito.support.atomic_files import whole_file
from attrito.support.errors import Fault, InputError
from attrito.support.overwrite_check import check_spared
from attrito.support.units import units_of

STRESS_UNIT = "user force/length^2"


@dataclass(frozen=True)
class Wanted:
    """What is to be recovered.

    Parameters
    ----------
    sets : node sets; none: all nodes of solid elements
    young, poisson : of elements whose deck gives none, user force/length^2; both or neither
    amplitude : of a linear mode, whose modal mass is 1; None: 1
    points, mode, monitor : as of `chosen_points`
    strain : columns of strains in the table
    fatigue_strength, tensile_strength : for Goodman's line, user force/length^2; both or neither
    """

    sets: tuple[str, ...] = ()
    young: float | None = None
    poisson: float | None = None
    amplitude: float | None = None
    points: Sequence[int] | None = None
    mode: int | None = None
    monitor: str | None = None
    strain: bool = False
    fatigue_strength: float | None = None
    tensile_strength: float | None = None

    def __post_init__(self) -> None:
        for pair in (("young", "poisson"), ("fatigue_strength", "tensile_strength")):
            given = [name for name in pair if getattr(self, name) is not None]
            if len(given) == 1:
                (other,) = set(pair) - set(given)
                raise InputError(Fault("stress", _option(given[0]), "given", f"{_option(other)} with it"))
        for name in ("young", "fatigue_strength", "tensile_strength"):
            value = getattr(self, name)
            if value is not None and not value > 0.0:
                raise InputError(Fault("stress", _option(name), value, "a number above 0"))
        if self.poisson is not None and not -1.0 < self.poisson < 0.5:
            raise InputError(Fault("stress", "--poisson", self.poisson, "a number above -1 and below 0.5"))


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def stress(
    result: str | os.PathLike[str] | Result,
    point: int | None = None,
    *,
    sets: Sequence[str] = (),
    young: float | None = None,
    poisson: float | None = None,
    mode: int | None = None,
    amplitude: float | None = None,
    strengths: tuple[float, float] | None = None,
) -> Stresses:
    """Stresses at nodes over a period, and the cycle between their extremes.

    Parameters
    ----------
    result : a result of `attrito.run`, `linear_modes` or `mode`, open or not, of a model with a mesh
    point : from 0; None: that of the largest amplitude
    sets : node sets; none: all nodes of solid elements
    young, poisson : elastic constants (user force/length^2, 1) of elements whose deck gives none
    mode : of linear modes the number, from 1
    amplitude : of a linear mode, whose modal mass is 1; None: 1
    strengths : under stress that alternates about zero, and in tension (user force/length^2), for Goodman's line

    Raises
    ------
    InputError : no mesh, no elastic constants, motion that was not recovered, no such set or point

    Examples
    --------
    >>> root = attrito.stress("result.h5", sets=["root"])
    >>> root.cycle.alternating_von_mises.max(), root.to_dataframe()
    """
    fatigue, tensile = strengths or (None, None)
    wanted = Wanted(
        sets=tuple(sets),
        young=young,
        poisson=poisson,
        amplitude=amplitude,
        points=None if point is None else [point],
        mode=mode,
        fatigue_strength=fatigue,
        tensile_strength=tensile,
    )
    with contextlib.nullcontext(result) if isinstance(result, Result) else Result(result) as opened:
        (chosen,) = _chosen(opened, wanted)
        return _at_point(opened, chosen, _model_of(opened, wanted), wanted)[0]


def write_stresses(
    result_file: str,
    path: str,
    wanted: Wanted,
    field_file: str | None = None,
    wheel: bool = False,
    picture_file: str | None = None,
) -> list[str]:
    """Write the table, and the field on the mesh and the picture if asked for; returns lines on what was found.

    Parameters
    ----------
    result_file : of a run or of modes
    path : of the table, CSV
    wanted : points, nodes and constants
    field_file : VTU to write; with several points their numbers are added; None: none
    wheel : all sectors in it, of a wheel
    picture_file : PNG, PDF or SVG to write, numbered likewise; None: none
    """
    if wheel and field_file is None:
        raise InputError(Fault("stress", "--wheel", "given", "--vtu with it: a table of a sector is that of the wheel"))
    for key, file, ending in (("-o", path, ".csv"), ("--vtu", field_file, ".vtu")):
        if file is not None and not file.endswith(ending):
            raise InputError(Fault("stress", key, file, f"a file {ending}"))
    if picture_file is not None:
        check_picture(picture_file)
    lines: list[str] = []
    tables: list[str] = []
    with Result(result_file) as result:
        points = _chosen(result, wanted)
        model = _model_of(result, wanted)
        files = {point: _numbered(field_file, point, len(points)) for point in points} if field_file else {}
        pictures = {point: _numbered(picture_file, point, len(points)) for point in points} if picture_file else {}
        read = [result_file, result.attribute("model_file"), result.attribute("rom_file")]
        check_spared("stress", "-o", [path], filter(None, read))
        check_spared("stress", "--vtu", list(files.values()), filter(None, read))
        check_spared("stress", "--picture", list(pictures.values()), filter(None, read))
        for point in points:
            found, motion = _at_point(result, point, model, wanted)
            tables.append(found.to_csv(header=not tables, strain=wanted.strain))
            lines += found.summary()
            if point in files:
                write_field(files[point], model, found, motion, result if wheel else None)
            if point in pictures:
                save(stress_picture(model, found), pictures[point])
    _write_text(path, "".join(tables))
    return [path, *files.values(), *pictures.values(), *(f"  {line}" for line in lines)]


def _chosen(result: Result, wanted: Wanted) -> list[int]:
    """The points that are meant."""
    if wanted.amplitude is not None and result.attribute("format") != LINEAR_MODES:
        raise InputError(Fault(result.path, "--amplitude", wanted.amplitude, "a file of `attrito linear-modes`"))
    return chosen_points(result, wanted.points, wanted.mode, wanted.monitor)


def _model_of(result: Result, wanted: Wanted) -> Model:
    """The model of a result, with constants for the elements that have none."""
    name = result.attribute("model_file")
    if not name:
        raise InputError(Fault(result.path, "model_file", "none", "a result of a model with a mesh"))
    model = read_model(name, matrices=False)
    if not model.has_mesh or not model.elements:
        raise InputError(Fault(name, "elements", "none", "a model with solid elements: attrito import with --mesh"))
    unknown = sorted(set(wanted.sets) - model.node_sets.keys())
    if unknown:
        known = ", ".join(model.node_sets) or "none"
        raise InputError(*(Fault(name, "--set", one, f"a node set of the model ({known})") for one in unknown))
    if wanted.young is None:
        return model
    given = (wanted.young, wanted.poisson)
    constants = {}
    for kind, (ids, _) in model.elements.items():
        known = model.elastic.get(kind, np.full((len(ids), 2), np.nan))
        constants[kind] = np.where(np.isnan(known).any(axis=1)[:, None], given, known)
    return replace(model, elastic=constants)


def _at_point(result: Result, point: int, model: Model, wanted: Wanted) -> tuple[Stresses, np.ndarray]:
    """Stresses at a point, and the coefficients `[nk, N, 3]` of the nodes' motion."""
    harmonics = node_harmonics(full_field(result, point, model.size, result.attribute("rom_file") or None), model)
    if wanted.amplitude is not None:
        harmonics = wanted.amplitude * harmonics
    notes = []
    whole, motion = model, harmonics
    if result.attribute("sectors"):
        keys = json.loads(result.attribute("job"))["cyclic"]
        lacking = "no axis" if keys["axis_direction"] is None else "dofs"
        if lacking == "no axis" or isinstance(keys["lower"], list) or keys.get("on_axis"):
            notes.append(f"nodes on the boundary: by elements of this sector alone, for [cyclic] names {lacking}")
        else:
            wheel = wheel_of(result, point)
            whole, motion = with_neighbours(model, harmonics, wheel, boundaries_of(keys, model, wheel))
    nodes = np.zeros(len(whole.node_ids), dtype=bool)
    own = slice(0, len(model.node_ids))
    if wanted.sets:
        ids = np.concatenate([model.node_sets[name] for name in wanted.sets])
        nodes[own] = np.isin(model.node_ids, ids)
    else:
        nodes[own] = recoverable(whole, motion)[0][own]
        _, reasons = recoverable(model, harmonics)
        notes += [
            f"left out: nodes of {count} elements for their {what}; expected {EXPECTED[what]}"
            for what, count in reasons.items()
        ]
        if not nodes.any():
            # Says what they lack.
            nodes[own] = True
    found = nodal_stress(whole, motion, nodes)
    if not len(found.node):
        named = ", ".join(wanted.sets)
        raise InputError(Fault("stress", "--set", named, "nodes of solid elements"))
    units = units_of(result.attribute("units"))
    return Stresses(
        point=point,
        frequency_hz=float(result.array("/points/frequency_hz")[point]),
        row=found.node,
        node=model.node_ids[found.node],
        coordinates=model.coordinates[found.node],
        elastic=found.elastic,
        harmonics=found.harmonics,
        cycle=cycle_of(found.harmonics),
        stress_unit=units.name(STRESS_UNIT) if units else "",
        length_unit=units.length if units else "",
        notes=tuple(notes),
        is_mode=result.attribute("format") == LINEAR_MODES,
        level=_level(result, point),
        strengths=None
        if wanted.fatigue_strength is None or wanted.tensile_strength is None
        else (wanted.fatigue_strength, wanted.tensile_strength),
    ), harmonics


def _level(result: Result, point: int) -> float | None:
    """Level of excitation of a point, where there are several."""
    if result.attribute("format") in (LINEAR_MODES, MODE) or not result.has("/points/level"):
        return None
    levels = result.array("/points/level")
    return float(levels[point]) if len(np.unique(levels)) > 1 else None


def _numbered(path: str, point: int, count: int) -> str:
    """A name of the file of each of several points."""
    return path if count == 1 else str(Path(path).with_name(f"{Path(path).stem}_{point}{Path(path).suffix}"))


def _write_text(path: str, text: str) -> None:
    try:
        with whole_file(path) as new:
            Path(new).write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(Fault(path, "file", error.strerror or str(error), "a file that can be written")) from error
