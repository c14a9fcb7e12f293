"""Faults of a job that lie between its keys."""

from __future__ import annotations

from pathlib import Path

from attrito.job.accelerations import check_accelerations, moves_base
from attrito.job.coriolis import check_coriolis
from attrito.job.cyclic import check_cyclic
from attrito.job.job import Job, campbell_path, files_by_key, mode_path, model_path, peak_path, rom_path
from attrito.job.laws import check_laws
from attrito.job.schema import ARRAYS, LOAD_KEYS
from attrito.job.sensitivity import check_sensitivity
from attrito.support.errors import Fault
from attrito.support.overwrite_check import is_nameless, is_no_file, is_same_file


def cross_check(job: Job, earlier: list[Fault], excited: bool = True) -> list[Fault]:
    """Faults between keys; those of a key that is already at fault are left alone.

    Parameters
    ----------
    job, earlier : what is checked, and the faults of single keys
    excited : whether a harmonic load and a sweep are needed
    """
    at_fault = {fault.key for fault in earlier}
    # Nor do the keys of a table that is missing.
    checks = (
        _check_model,
        _check_normals,
        _check_contact_sets,
        _check_loads,
        *((_check_excitation, _check_ratios) if excited else (_check_band_of_reduction,)),
        _check_balance,
        _check_stability,
        check_laws,
        check_sensitivity,
        check_cyclic,
        check_coriolis,
        check_accelerations,
        _check_monitors,
        _check_inputs,
        _check_outputs,
    )
    found = [fault for check in checks for fault in check(job)]
    # What is missing may be what was meant by the key of its table that is at fault.
    doubtful = {key.partition(" ")[0] for key in at_fault}
    return [
        fault
        for fault in found
        if at_fault.isdisjoint((fault.key, fault.key.partition(" ")[0]))
        and not (fault.value == "missing" and fault.key.partition(" ")[0] in doubtful)
    ]


def _check_model(job: Job) -> list[Fault]:
    faults = []
    model, damping, reduction = job["model"], job["damping"], job["reduction"]
    if model["file"] is None:
        if model["mass"] is None and model["stiffness"] is None:
            faults.append(job.fault("[model] file", "missing", "a model file, or mass and stiffness"))
        else:
            faults += [
                job.fault(f"[model] {name}", "missing", f"a matrix to go with {other}")
                for name, other in (("mass", "stiffness"), ("stiffness", "mass"))
                if model[name] is None
            ]
    elif any(model[name] is not None for name in ("mass", "stiffness", "damping", "gyroscopic")):
        faults.append(job.fault("[model] file", model["file"], "no matrices beside a model file"))
    kinds = [name for name, value in damping.items() if value is not None]
    if len(kinds) > 1:
        faults.append(job.fault("[damping]", ", ".join(kinds), "only one kind of damping"))
    if "reduction" in job.given and (reduction["modes"] is None) == (reduction["max_frequency_hz"] is None):
        faults.append(job.fault("[reduction] modes", reduction["modes"], "either modes or max_frequency_hz"))
    chosen = "auto" in (reduction["modes"], job["cyclic"]["interface_modes"])
    if not chosen and reduction["error"] is not None:
        expected = 'no such key but with modes = "auto" or [cyclic] interface_modes = "auto"'
        faults.append(job.fault("[reduction] error", reduction["error"], expected))
    if not job["contact"] and not job["contact_set"]:
        faults.append(job.fault("contact", "missing", "at least one [[contact]] or [[contact_set]]"))
    return faults


def _check_normals(job: Job) -> list[Fault]:
    """A contact has a normal displacement and its stiffness, or a normal force that is constant."""
    faults = []
    for i, keys in enumerate(job["contact"]):
        place = f"contact[{i}]"
        if keys["normal"] is not None:
            if keys["normal_stiffness"] is None:
                expected = "a number above 0, the stiffness along normal"
                faults.append(job.fault(f"{place} normal_stiffness", "missing", expected))
            continue
        for name, absent in (("normal_stiffness", None), ("gap", 0.0), ("normal_next", None)):
            if keys[name] != absent:
                faults.append(job.fault(f"{place} {name}", keys[name], "no such key without normal"))
        if keys["preload"] == 0.0:
            expected = "a number above 0 without normal: the normal force, which is constant then; or normal"
            faults.append(job.fault(f"{place} preload", 0.0, expected))
    return faults


def _check_contact_sets(job: Job) -> list[Fault]:
    faults = []
    for i, keys in enumerate(job["contact_set"]):
        place, points, gap = f"contact_set[{i}]", keys["points"], keys["gap"]
        if keys["pairing"] == "node" and points is not None:
            faults.append(job.fault(f"{place} points", points, 'no such key but with pairing = "face"'))
        if keys["b"] == "ground" and points == "cut":
            faults.append(job.fault(f"{place} points", points, '"node" or "gauss": the ground has no edges to cut at'))
        if keys["b"] == "ground" and gap == "geometry":
            faults.append(job.fault(f"{place} gap", gap, "a number: the ground has no place in the mesh"))
        if keys["gap_file"] is not None and gap == "geometry":
            faults.append(job.fault(f"{place} gap", gap, "a number, to which gap_file adds"))
    return faults


def _check_loads(job: Job) -> list[Fault]:
    faults = []
    names: list[str] = []
    for i, load in enumerate(job["load"]):
        place = f"load[{i}]"
        if load["kind"] is None:
            continue
        for key, value in load.items():
            default = next(spec.default for name, spec in ARRAYS["load"].items() if name == key)
            if key not in LOAD_KEYS[load["kind"]] and value != default:
                faults.append(job.fault(f"{place} {key}", value, f"no such key on a load of kind {load['kind']}"))
        if load["kind"] == "static" and sum(load[key] is not None for key in ("dofs", "file", "gravity")) != 1:
            faults.append(job.fault(f"{place} dofs", load["dofs"], "either dofs or file or gravity"))
        if load["kind"] == "harmonic" and not load["cosine"] and not load["sine"] and not moves_base(load):
            expected = "cosine or sine terms, or a file of them, or motion of the base (base_cosine, base_sine)"
            faults.append(job.fault(f"{place} cosine", [], expected))
        if load["kind"] == "centrifugal":
            for key in ("speed_hz", "axis_point", "axis_direction"):
                if load[key] is None:
                    faults.append(job.fault(f"{place} {key}", "missing", "this key on a centrifugal load"))
            if load["axis_direction"] is not None and not any(load["axis_direction"]):
                faults.append(job.fault(f"{place} axis_direction", load["axis_direction"], "a vector that is not zero"))
        if load["name"] is None:
            load["name"] = f"{load['kind']}_{i}"
        if load["name"] in names:
            faults.append(job.fault(f"{place} name", load["name"], "a name that no other load has"))
        names.append(load["name"])
    static = {load["name"] for load in job["load"] if load["kind"] in ("static", "centrifugal")}
    for i, corner in enumerate(job["static"]["load_path"]):
        if isinstance(corner, dict):
            for name in corner.keys() - static:
                known = ", ".join(sorted(static)) or "none"
                faults.append(job.fault(f"[static] load_path[{i}]", name, f"names of static loads: {known}"))
    return faults + _check_spin(job)


def _check_spin(job: Job) -> list[Fault]:
    """A factor on a centrifugal load is one on the square of its speed; the stiffness is softened for factor 1."""
    faults = []
    path = job["static"]["load_path"]
    spinning = [(i, load) for i, load in enumerate(job["load"]) if load["kind"] == "centrifugal"]
    for place, load in spinning:
        factors = [corner.get(load["name"], 0.0) if isinstance(corner, dict) else corner for corner in path]
        for i, factor in enumerate(factors):
            if factor < 0.0:
                expected = f"at least 0 for {load['name']}, a factor on the square of its speed"
                faults.append(job.fault(f"[static] load_path[{i}]", factor, expected))
        if not load["spin_softening"]:
            continue
        if factors[-1] != 1.0:
            expected = f"1 at the end for {load['name']}: its spin softening is that of speed_hz, all along the path"
            faults.append(job.fault(f"[static] load_path[{len(path) - 1}]", factors[-1], expected))
        profile = job["integrate"]["static_profile"]
        if profile is not None and profile[-1][1] != 1.0:
            expected = f"1 at the end: the spin softening of {load['name']} is that of speed_hz, at all times"
            faults.append(job.fault("[integrate] static_profile", profile[-1], expected))
        if any(other["spin_softening"] for i, other in spinning if i < place):
            faults.append(job.fault(f"load[{place}] spin_softening", True, "one load with spin softening"))
    return faults


def _check_excitation(job: Job) -> list[Fault]:
    """A harmonic load, and where it is swept."""
    if any(load["kind"] in ("harmonic", None) for load in job["load"]):
        return _check_sweep(job)
    return [job.fault("load", "missing", "at least one [[load]] of kind harmonic"), *_check_sweep(job)]


def _check_ratios(job: Job) -> list[Fault]:
    """A response is not steady where damping feeds it; and a wheel's modes are not numbered as a sector's."""
    ratio = job["damping"]["ratio"]
    faults = []
    if ratio is not None and min(ratio if isinstance(ratio, list) else [ratio]) < 0.0:
        expected = "at least 0, but in attrito mode: motion of a mode of negative damping grows by itself"
        faults.append(job.fault("[damping] ratio", ratio, expected))
    if isinstance(ratio, list) and "cyclic" in job.given:
        faults.append(job.fault("[damping] ratio", ratio, "one number with [cyclic], but in attrito mode"))
    return faults


def _check_band_of_reduction(job: Job) -> list[Fault]:
    """Without a sweep nothing says up to which frequency the modes of a reduction matter."""
    if "sweep" in job.given:
        return _check_sweep(job)
    if job["reduction"]["modes"] != "auto":
        return []
    expected = "a number, or max_frequency_hz: without [sweep] nothing says which modes matter"
    return [job.fault("[reduction] modes", "auto", expected)]


def _check_sweep(job: Job) -> list[Fault]:
    sweep = job["sweep"]
    ends = [key for key in ("start_hz", "stop_hz") if sweep[key] is not None]
    start_file = job["continuation"]["start_file"]
    if start_file is not None and job["continuation"]["start"] is None:
        return [job.fault("[continuation] start_file", start_file, "no such key but with start")]
    if sweep["frequencies_hz"] is not None:
        faults = [job.fault(f"[sweep] {key}", sweep[key], "no such key beside frequencies_hz") for key in ends]
        for key, default in (("both_directions", False), ("max_points", 1000), ("branches", 1), ("start", None)):
            if (value := job["continuation"][key]) != default:
                faults.append(job.fault(f"[continuation] {key}", value, "no such key beside [sweep] frequencies_hz"))
        return faults
    if len(ends) < 2:
        missing = "stop_hz" if ends == ["start_hz"] else "start_hz"
        return [job.fault(f"[sweep] {missing}", "missing", "start_hz and stop_hz, or frequencies_hz")]
    if sweep["start_hz"] == sweep["stop_hz"]:
        return [job.fault("[sweep] stop_hz", sweep["stop_hz"], "a frequency other than start_hz")]
    return []


def _check_balance(job: Job) -> list[Fault]:
    faults: list[Fault] = []
    harmonics = job["balance"]["harmonics"]
    if not isinstance(harmonics, int):
        return faults
    for i, load in enumerate(job["load"]):
        if load["kind"] == "harmonic" and load["harmonic"] > harmonics:
            expected = f"a harmonic that is solved for: at most {harmonics}"
            faults.append(job.fault(f"load[{i}] harmonic", load["harmonic"], expected))
    return faults


def _check_stability(job: Job) -> list[Fault]:
    method = job["stability"]["method"]
    if method == "none":
        return []
    faults = []
    if job["balance"]["approach"] == "uncoupled":
        expected = '"none": an uncoupled balance, its mean frozen, is no motion of the structure'
        faults.append(job.fault("[stability] method", method, expected))
    if job["damping"]["loss_factor"] is not None and not job["integrate"]["equivalent_viscous"]:
        expected = "ratio, rayleigh or a matrix (it has no time-domain twin), or [integrate] equivalent_viscous = true"
        faults.append(job.fault("[damping] loss_factor", job["damping"]["loss_factor"], expected))
    return faults


def _check_monitors(job: Job) -> list[Fault]:
    names = [monitor["name"] for monitor in job["output"]["monitors"] or []]
    twice = sorted({name for name in names if names.count(name) > 1})
    return [job.fault("[output] monitors", name, "names that differ") for name in twice]


def _check_inputs(job: Job) -> list[Fault]:
    """What is read must be files; the job itself may come out of a pipe."""
    named = list(files_by_key(job).items())[1:]
    if job["continuation"]["start_file"] is not None:
        named.append(("[continuation] start_file", job.file(job["continuation"]["start_file"])))
    return [job.fault(key, name, "a file, not a pipe or a device") for key, name in named if is_no_file(name)]


def _check_outputs(job: Job) -> list[Fault]:
    """Files to be written must have a place, and not be files that are read or written otherwise."""
    if job["output"]["file"] is None:
        return []
    tables = ("output", "reduction", "mode", "campbell", "peak")
    given = [(f"[{table}] file", job[table]["file"]) for table in tables if job[table]["file"] is not None]
    nameless = [job.fault(key, name, "the name of a file") for key, name in given if is_nameless(name)]
    if nameless:
        return nameless
    written = [("[output] file", job.file(job["output"]["file"]))]
    rom = rom_path(job)
    if rom is not None:
        written.append(("[reduction] file", rom))
        model = model_path(job, rom)
        if job["model"]["file"] is None and model is not None:
            written.append(("[reduction] file", model))
    if "mode" in job.given:
        written.append(("[mode] file", mode_path(job)))
    if "campbell" in job.given:
        written.append(("[campbell] file", campbell_path(job)))
    if "peak" in job.given:
        written.append(("[peak] file", peak_path(job)))
    faults, taken = [], list(files_by_key(job).items())
    for key, path in written:
        for other, name in taken:
            if is_same_file(path, name):
                faults.append(job.fault(key, path, f"a file other than that of {other}"))
        taken.append((key, path))
        blocked = next((str(folder) for folder in Path(path).parents if folder.is_file()), None)
        if blocked is not None:
            faults.append(job.fault(key, path, f"a file in a folder ({blocked} is a file)"))
        elif Path(path).is_dir():
            faults.append(job.fault(key, path, "a file, not a folder"))
        elif Path(path).exists() and not Path(path).is_file():
            faults.append(job.fault(key, path, "a file, not a device"))
    return faults
