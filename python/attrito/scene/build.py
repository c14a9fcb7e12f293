"""From job and model to what is solved: contacts as rows on dofs, loads and monitors as vectors, all on the full model.

Everything here is done by rank 0 alone.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix, vstack

from attrito.importers.check import check_matrices
from attrito.job.cyclic import is_cyclic, nodal_diameter_in_words
from attrito.job.job import Job
from attrito.job.laws import LAW_KEYS, RULES
from attrito.library.names import LAWS
from attrito.model.model import Model
from attrito.model.model_file import read_model
from attrito.scene.coriolis import take_coriolis
from attrito.scene.dofs import DofResolver
from attrito.scene.loads import build_loads, check_base_holds, soften, spin_faults
from attrito.scene.scene import Contacts, Scene
from attrito.scene.sector import build_sector, check_mass_of_sector, wheel_axis
from attrito.support.errors import InputError
from attrito.support.timing import peak_megabytes

# What to expect of a mass that some dofs lack
STATIC_BY_REDUCTION = "mass at every dof, or [reduction], in which dofs without mass follow the others statically"
# Of forces, smaller ones have squares that are 0.
SMALLEST_LOAD = 1e-140


def build_scene(job: Job) -> Scene:
    """Read the model and place the job's contacts, loads and monitors on it; all faults of a kind together."""
    model = load_model(job)
    places = DofResolver(job, model)
    sector = build_sector(job, model, places)
    if places.faults:
        # Contacts across would be looked for in the wrong place.
        raise InputError(*places.faults)
    contacts = _contacts(job, model, places)
    static, harmonic = build_loads(job, model, places)
    contacts.notes.extend(places.notes)
    check_base_holds(job, model, contacts, places)
    monitors = {
        monitor["name"]: places.vector(monitor["dofs"], f"[output] monitors[{i}]")
        for i, monitor in enumerate(job["output"]["monitors"])
    }
    if sector is not None:
        check_mass_of_sector(job, model, sector, places, STATIC_BY_REDUCTION)
        wave = nodal_diameter_in_words(sector.sectors, sector.engine_order)
        paired = f"{len(sector.lower)} dofs of its boundaries paired"
        if job["cyclic"]["tolerance"] is not None:
            paired += f", nodes at most {sector.apart:.3g} from their partners' images"
        if len(sector.along) + len(sector.across):
            paired += f", {len(sector.along)} along the axis and {sector.across.size} across it in all sectors at once"
        contacts.notes.insert(
            0, f"one of {sector.sectors} sectors, engine order {sector.engine_order}: {wave}; {paired}"
        )
    boundary = places.boundary(contacts, sector)
    recovered = places.recovered(monitors)
    places.faults += spin_faults(job, model)
    if places.faults:
        raise InputError(*places.faults)
    spin = take_coriolis(job, model, places)
    if places.faults:
        raise InputError(*places.faults)
    softened = soften(job, model)
    check_finite(job, contacts, static, harmonic, monitors)
    path = load_path_of(job, list(static))
    return Scene(model, contacts, static, harmonic, monitors, path, boundary, recovered, sector, softened, spin)


def check_finite(
    job: Job, contacts: Contacts, static: dict[str, np.ndarray], harmonic: np.ndarray, monitors: dict[str, np.ndarray]
) -> None:
    """Raise where numbers of the job, each of them finite, make sums, products or squares that are not, or vanish."""
    faults = []
    explicit = len(job["contact"])
    row_contact = np.repeat(np.arange(contacts.count), contacts.laws["tangents"] + 1)
    wrong = np.zeros(contacts.rows.shape[0], dtype=bool)
    for rows in (contacts.rows, contacts.next_rows):
        if rows is not None:
            wrong[np.repeat(np.arange(rows.shape[0]), np.diff(rows.indptr))[~np.isfinite(rows.data)]] = True
    spoilt = {"coefficients": row_contact[wrong]}
    spoilt |= {name: np.flatnonzero(~np.isfinite(contacts.laws[name])) for name in LAW_KEYS}
    for name, where in spoilt.items():
        for table in np.unique(contacts.tables[where]):
            place = f"contact[{table}]" if table < explicit else f"contact_set[{table - explicit}]"
            faults.append(job.fault(f"{place} {name}", "beyond what numbers hold", "smaller numbers"))
    kinds = {f"load {name}": vector for name, vector in static.items()} | {"harmonic loads": harmonic}
    for name, vector in kinds.items():
        largest = np.max(abs(vector), initial=0.0)
        if np.isfinite(largest) and largest and not SMALLEST_LOAD < largest < 1.0 / SMALLEST_LOAD:
            expected = (
                f"from {SMALLEST_LOAD:g} to {1.0 / SMALLEST_LOAD:g}, or 0: squares must be numbers, so take other units"
            )
            faults.append(job.fault(name, f"at most {largest:g}", expected))
    kinds |= {f"[output] monitors {name}": vector for name, vector in monitors.items()}
    for name, vector in kinds.items():
        if not np.all(np.isfinite(vector)):
            faults.append(job.fault(name, "beyond what numbers hold", "smaller numbers"))
    if faults:
        raise InputError(*faults)


def with_numbers_of(job: Job, scene: Scene) -> Scene:
    """The scene of a job that differs from a scene's own in its contacts' laws, load path and engine order alone.

    Nothing is read.
    """
    contacts = replace(scene.contacts, laws=laws_of(job, scene.contacts))
    check_finite(job, contacts, scene.static, scene.harmonic, scene.monitors)
    sector = scene.sector
    if sector is not None:
        sector = replace(sector, engine_order=job["cyclic"]["engine_order"])
    return replace(scene, contacts=contacts, load_path=load_path_of(job, list(scene.static)), sector=sector)


def load_path_of(job: Job, names: list[str]) -> np.ndarray:
    """Factors on the static loads of these names at the corners of the load path, `[corners, loads]`."""
    path = [
        [corner.get(name, 0.0) if isinstance(corner, dict) else corner for name in names]
        for corner in job["static"]["load_path"]
    ]
    return np.array(path, dtype=float).reshape(len(path), len(names))


def load_model(job: Job) -> Model:
    """The job's model, its matrices checked."""
    keys = job["model"]
    if keys["file"] is not None:
        path = job.file(keys["file"])
        model = read_model(path)
        where: Any = path
    else:
        sources, where = {}, {}
        for name in ("stiffness", "mass", "damping", "gyroscopic"):
            source = keys[name]
            where[name] = job.file(source) if isinstance(source, str) else f"{job.path}: [model]"
            if source is not None:
                sources[name] = job.file(source) if isinstance(source, str) else source
        # What reads, and what pairs below, is loaded by jobs that ask for it.
        from attrito.importers import read_matrices

        parts = read_matrices(sources, "[model] {}", job.path)
        model = Model(parts.matrices["stiffness"], parts.matrices["mass"], parts.matrices.get("damping"))
        model.dof_node, model.dof_direction = parts.node, parts.direction
        model.gyroscopic = parts.matrices.get("gyroscopic")
    # Of a sector's boundaries one may carry the mass of both.
    without_mass = "" if "reduction" in job.given or is_cyclic(job) else STATIC_BY_REDUCTION
    faults = check_matrices(model.stiffness, model.mass, model.damping, where, without_mass=without_mass)
    if model.damping is not None:
        faults += [
            job.fault(f"[damping] {kind}", job["damping"][kind], "no such key beside the model's own damping matrix")
            for kind in ("ratio", "loss_factor")
            if job["damping"][kind] is not None
        ]
    if faults:
        raise InputError(*faults)
    return model


def _contacts(job: Job, model: Model, places: DofResolver) -> Contacts:
    blocks: list[_Block] = []
    for i, contact in enumerate(job["contact"]):
        key = f"contact[{i}]"
        named = [*(("tangents", terms) for terms in contact["tangents"]), ("normal", contact["normal"] or [])]
        beyond = [*(contact["tangents_next"] or [[]] * (len(named) - 1)), contact["normal_next"] or []]
        rows, next_rows = [], []
        for (name, terms), more in zip(named, beyond, strict=True):
            earlier = len(places.faults)
            rows.append(places.vector(terms, f"{key} {name}"))
            next_rows.append(places.vector(more, f"{key} {name}_next"))
            if terms and not rows[-1].any() and not next_rows[-1].any() and len(places.faults) == earlier:
                places.add(f"{key} {name}", [list(term) for term in terms], "a coefficient that is not zero")
        blocks.append(_explicit(rows, next_rows))
    for i, contact_set in enumerate(job["contact_set"]):
        try:
            blocks.append(_paired(job, model, contact_set, f"contact_set[{i}]"))
        except InputError as error:
            places.faults += error.faults
    if not blocks:
        raise InputError(*places.faults)
    where = {name: np.concatenate([block.places[name] for block in blocks]) for name in blocks[0].places}
    tables = np.repeat(np.arange(len(blocks)), [block.count for block in blocks])
    laws = {"tangents": np.concatenate([block.tangents for block in blocks])}
    notes = [note for block in blocks for note in block.notes]
    gaps = np.concatenate([block.gaps for block in blocks])
    rows = csr_matrix(vstack([block.rows for block in blocks]))
    next_rows = csr_matrix(vstack([block.next_rows for block in blocks])) if is_cyclic(job) else None
    found = Contacts(laws, rows, where, tables, gaps, notes, next_rows)
    return replace(found, laws=laws_of(job, found))


def laws_of(job: Job, contacts: Contacts) -> dict[str, np.ndarray]:
    """Laws that a job gives to contacts whose places are known."""
    given = [*job["contact"], *job["contact_set"]]
    laws = {"tangents": contacts.laws["tangents"]}
    for name in LAW_KEYS:
        values = [np.nan if keys[name] is None else _one_number(keys[name]) for keys in given]
        laws[name] = np.array(values, dtype=float)[contacts.tables]
    # Of a contact without a normal displacement any will do: that is kt.
    without = np.isnan(laws["normal_stiffness"])
    laws["normal_stiffness"][without] = laws["tangential_stiffness"][without]
    by_geometry = np.array([keys["gap"] == "geometry" for keys in given])[contacts.tables]
    laws["gap"] = np.where(by_geometry, contacts.places["clearance"], laws["gap"]) + contacts.gaps
    by_area = np.array([keys.get("stiffness_per") == "area" for keys in given])[contacts.tables]
    for name in ("tangential_stiffness", "normal_stiffness", "preload"):
        laws[name][by_area] *= contacts.places["area"][by_area]
    kinds = np.array([LAWS.index(keys["law"]) for keys in given], dtype=np.int32)[contacts.tables]
    if not np.any(kinds):
        return laws
    numbers = [
        RULES[given[table]["law"]].numbers(given[table], area)
        for table, area in zip(contacts.tables, contacts.places["area"], strict=True)
    ]
    padded = np.full((len(numbers), max(map(len, numbers))), np.nan)
    for row, own in zip(padded, numbers, strict=True):
        row[: len(own)] = own
    return laws | {"law": kinds, "law_numbers": padded}


def _one_number(value: Any) -> float:
    """A number; of a table by pressure the friction coefficient at the least; 0 for what the geometry decides."""
    return 0.0 if isinstance(value, str) else value[0][1] if isinstance(value, list) else value


@dataclass
class _Block:
    """Contacts of one table of the job; `gaps` are those of a file, `next_rows` on the next sector."""

    tangents: np.ndarray
    rows: csr_matrix
    next_rows: csr_matrix
    places: dict[str, np.ndarray]
    gaps: np.ndarray
    notes: list[str] = field(default_factory=list)

    @property
    def count(self) -> int:
        return len(self.tangents)


def _explicit(rows: list[np.ndarray], next_rows: list[np.ndarray]) -> _Block:
    where: dict[str, np.ndarray] = {"set": np.array(["explicit"], dtype=object)}
    where |= {name: np.array([-1], dtype=np.int64) for name in ("node_a", "node_b")}
    where |= {"area": np.full(1, np.nan), "position": np.full((1, 3), np.nan), "frame": np.full((1, 3, 3), np.nan)}
    where["clearance"] = np.full(1, np.nan)
    tangents = np.array([len(rows) - 1], dtype=np.int32)
    return _Block(tangents, csr_matrix(np.array(rows)), csr_matrix(np.array(next_rows)), where, np.zeros(1))


def _paired(job: Job, model: Model, keys: dict[str, Any], place: str) -> _Block:
    if not model.has_mesh:
        raise InputError(job.fault(f"{place} a", keys["a"], "a model with a mesh: node sets need one"))
    begun = time.perf_counter()
    meeting, rotation = model, None
    if keys["across"]:
        from attrito.model.sector import beside_the_next

        meeting, rotation = beside_the_next(model, keys["b"], wheel_axis(job), job["cyclic"]["sectors"])
    sets = meeting, keys["a"], keys["b"], keys["tolerance"], keys["tangents"]
    if keys["pairing"] == "node":
        from attrito.model.pairing import pair_sets

        pairs = pair_sets(*sets, job.path, place)
    else:
        from attrito.model.face_sets import pair_faces

        pairs = pair_faces(*sets, keys["points"] or "node", job.path, place)
    gaps = np.zeros(len(pairs.area))
    if keys["gap_file"] is not None:
        from attrito.scene.gap_file import read_gaps

        gaps = read_gaps(job.file(keys["gap_file"]), model, pairs)
    count = len(pairs.node_a)
    where = {
        "set": np.full(count, f"{keys['a']} - {keys['b']}", dtype=object),
        "node_a": pairs.node_a,
        "node_b": pairs.node_b,
        "area": pairs.area,
        "position": pairs.position,
        "frame": pairs.frame,
        "clearance": pairs.clearance,
    }
    tangents = np.full(count, keys["tangents"], dtype=np.int32)
    if rotation is None:
        from attrito.model.pairs import contact_rows

        rows = contact_rows(pairs, model)
        next_rows = csr_matrix(rows.shape)
    else:
        from attrito.model.sector import rows_across

        rows, next_rows = rows_across(pairs, model, rotation)
    notes = [*pairs.notes, _cost_of_pairing(rows, count, time.perf_counter() - begun)]
    return _Block(tangents, rows, next_rows, where, gaps, [f"{place}: {note}" for note in notes])


def _cost_of_pairing(rows: csr_matrix, count: int, seconds: float) -> str:
    """Wall time and memory of the pairing of a contact set: arrays of its rows, and the most the process has held."""
    held = sum(part.nbytes for part in (rows.data, rows.indices, rows.indptr)) / 1e6
    most = peak_megabytes()
    memory = f"their rows take {held:.2f} MB, memory so far at most {most:.0f} MB"
    return f"{count} contacts paired in {seconds:.2f} s; {memory}"
