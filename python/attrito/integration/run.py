"""`attrito integrate`: a job integrated in time until steady, its orbit and history in an HDF5 file.

The group `/integration` goes into the job's output file. If that file is a result of `attrito run`, the rest of it
stays as it is; otherwise it is made, with root attribute format = "attrito integration".

Of a sector under a travelling wave the whole wheel is integrated: nothing keeps its motion a wave.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import h5py
import numpy as np

from attrito.integration.attractors import Attractor, State, find_attractors, summary_of, write_attractors
from attrito.job.job import Job
from attrito.job.laws import RULES, laws_in_parallel, laws_not_proportional
from attrito.job.reading import read_job
from attrito.library import loading
from attrito.library.integrator import Integrator, Orbit, Run
from attrito.library.reduced_scene import ReducedScene
from attrito.results.stored_point import read_point
from attrito.scene import cautions
from attrito.scene.build import build_scene
from attrito.scene.reduced_model import make_rom, reduced_scene
from attrito.scene.scene import Scene
from attrito.scene.wheel import wave_in_wheel, whole_wheel
from attrito.support.atomic_files import whole_hdf5
from attrito.support.errors import InputError, UnsolvedError
from attrito.support.file_sums import check_sums
from attrito.support.hdf5_reading import UNREADABLE, check_datasets
from attrito.support.hdf5_writing import described
from attrito.support.locks import writing_alone
from attrito.support.parallel import on_root, on_root_only
from attrito.support.version import __version__

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

REFERENCES = (
    "Zucca & Firrone 2014, doi:10.1016/j.jsv.2013.09.032; Lane & Riesenfeld 1981, doi:10.1007/BF01934076; "
    "Hilber, Hughes & Taylor 1977, doi:10.1002/eqe.4290050306; Chung & Hulbert 1993, doi:10.1115/1.2900803"
)
# Contacts that the summary has a line for
MOST_CONTACTS = 10
FORMATS = ("attrito result", "attrito integration")


def integrate_job(comm: Comm, path: str | Job, say: Callable[[str], None] = print) -> str:
    """Integrate a job; returns the file's path. Raises `UnsolvedError` at the end if it did not become steady."""
    job = on_root(comm, lambda: read_job(path))
    on_root(comm, lambda: _check(job))
    scene = on_root_only(comm, lambda: build_scene(job))
    file = job.file(job["output"]["file"])
    with writing_alone(comm, file):
        outcome, reason = _integrate(comm, job, scene, file, say)
    if outcome == "not_converged":
        raise UnsolvedError(file, f"the integration did not become steady ({reason}); see /integration")
    return file


def _integrate(comm: Comm, job: Job, scene: Scene | None, file: str, say: Callable[[str], None]) -> tuple[str, str]:
    """Integrate and write; outcome and reason."""
    warnings: list[str] = []

    def warn(found: list[str]) -> None:
        warnings.extend(found)
        for line in found:
            say(f"warning: {line}")

    on_root(comm, lambda: warn(cautions.of_scene(job, scene)))
    rom, _ = make_rom(comm, job, scene, say)
    loading.start(comm)

    def work() -> tuple[str, str]:
        own = reduced_scene(job, scene, rom)
        reduced = damped(job, whole_wheel(own))
        choices = run_of(job, reduced)
        with Integrator(reduced) as session:
            place(session, job, scene, own)
            warn(cautions.of_damping(reduced))
            if job["integrate"]["start"] == "static":
                touching = session.touching()
                warn(cautions.of_static_solution((touching, 0, 0, session.contacts - touching)))
            orbit = session.run(choices)
            met = attractors_of(session, job, scene, own, choices)
        write(file, job, reduced, choices, orbit, met, warnings)
        for line in [*summary(file, reduced, choices, orbit), *summary_of(reduced.monitor_names, met)]:
            say(line)
        return orbit.outcome, orbit.reason

    return on_root(comm, work)


def _check(job: Job) -> None:
    keys = job["integrate"]
    faults = []
    if keys["frequency_hz"] is None:
        faults.append(job.fault("[integrate] frequency_hz", "missing", "a frequency to integrate at"))
    one = " or ".join(f'"{name}"' for name, rules in RULES.items() if rules.one_element)
    for key, law in laws_in_parallel(job).items():
        faults.append(job.fault(key, law, f"{one} (integration in time takes one slider a contact)"))
    for key, law in laws_not_proportional(job).items() if keys["scheme"] == "event" else ():
        expected = '"coulomb" (another law has no events), or [integrate] scheme = "exponential" or another with steps'
        faults.append(job.fault(key, law, expected))
    if job["damping"]["loss_factor"] is not None and not keys["equivalent_viscous"]:
        expected = "ratio, rayleigh or a matrix (it has no time-domain twin), or [integrate] equivalent_viscous = true"
        faults.append(job.fault("[damping] loss_factor", job["damping"]["loss_factor"], expected))
    for name in ("static_profile", "harmonic_profile"):
        times = [knot[0] for knot in keys[name] or []]
        if any(after <= before for before, after in zip(times, times[1:], strict=False)):
            faults.append(job.fault(f"[integrate] {name}", times, "times that rise"))
    if faults:
        raise InputError(*faults)


def damped(job: Job, scene: ReducedScene) -> ReducedScene:
    """The scene with a loss factor turned into the viscous damping equal to it at the excitation, C = eta K / omega."""
    if scene.damping_kind != "loss_factor":
        return scene
    omega = 2.0 * np.pi * job["integrate"]["frequency_hz"]
    viscous = np.ascontiguousarray(scene.damping_value / omega * scene.stiffness)
    return dataclasses.replace(scene, damping_kind="viscous", damping_value=0.0, damping=viscous)


def run_of(job: Job, scene: ReducedScene) -> Run:
    """The choices of the job."""
    keys = job["integrate"]
    profiles = [None if keys[name] is None else np.array(keys[name]) for name in ("static_profile", "harmonic_profile")]
    return Run(
        keys["frequency_hz"],
        keys["level"],
        keys["scheme"],
        keys["steps_per_period"],
        keys["dissipation"],
        *profiles,
        keys["cycles"],
        keys["fewest_cycles"],
        keys["periodicity_tolerance"],
        keys["max_period_multiple"],
        keys["samples"],
        keys["history"] == "run",
    )


def place(session: Integrator, job: Job, scene: Scene, reduced: ReducedScene) -> None:
    """Put the session, of a sector's whole wheel, where the job starts."""
    keys = job["integrate"]
    path = scene.load_path
    sliders = np.zeros((session.contacts, 2))
    if keys["sliders"] is not None:
        if len(keys["sliders"]) != session.contacts:
            expected = f"{session.contacts} sliders, one a contact"
            raise InputError(job.fault("[integrate] sliders", len(keys["sliders"]), expected))
        for i, given in enumerate(keys["sliders"]):
            sliders[i, : np.size(given)] = given
    if keys["start"] == "static":
        profile = keys["static_profile"]
        followed = path if profile is None or profile[0][1] == 1.0 else _end_at(path, profile)
        session.start_static(followed, job["static"]["steps"], sliders, path[-1])
    elif keys["start"] == "rest":
        session.start(np.zeros(session.size), np.zeros(session.size), sliders, path[-1])
    else:
        displacement, velocity, stored = _point(job, reduced)
        session.start(displacement, velocity, stored if keys["sliders"] is None else sliders, path[-1])


def attractors_of(session: Integrator, job: Job, scene: Scene, reduced: ReducedScene, choices: Run) -> list[Attractor]:
    """Motions that the eight starts come to, if the job asks for them; a point to start from is one of the starts."""
    keys = job["integrate"]
    if not keys["attractors"]:
        return []
    point, amplitude = None, 0.0
    if keys["start"].startswith("point:"):
        point = State(*_point(job, reduced))
        amplitude = float(np.abs(point.displacement).max())
    return find_attractors(session, choices, scene.load_path, point, amplitude)


def _end_at(path: np.ndarray, profile: list) -> np.ndarray:
    """A load path whose end is scaled to where the profile starts; nothing is loaded if that is zero."""
    if profile[0][1] == 0.0:
        return np.zeros((1, path.shape[1]))
    return np.vstack([path, profile[0][1] * path[-1:]])


def _point(job: Job, scene: ReducedScene) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """State at the start of the period of a point of the job's result: displacement, velocity, sliders.

    Of a sector: of its wheel. Sliders of all sectors are those at the start of the sector's own period, which those of
    contacts that stick keep, and those of the others forget.
    """
    path = job.file(job["output"]["file"])
    point = read_point(job, "[integrate] start", job["integrate"]["start"], path, scene)
    motion, slider, omega = point.coordinates, point.slider, 2.0 * np.pi * point.frequency_hz
    if scene.sector is not None:
        motion, slider = wave_in_wheel(motion, scene.sector), np.tile(slider, (scene.sector.sectors, 1))
    harmonics = np.arange(1, (motion.shape[1] - 1) // 2 + 1)
    return motion[:, 0] + motion[:, 1::2].sum(axis=1), omega * motion[:, 2::2] @ harmonics, slider


def summary(file: str, scene: ReducedScene, choices: Run, orbit: Orbit) -> list[str]:
    """What the command says."""
    how = (
        choices.scheme
        if choices.scheme == "event"
        else f"{choices.scheme}, {choices.steps_per_period or 'default'} steps"
    )
    lines = [
        f"{choices.frequency_hz:g} Hz, {how}: {orbit.outcome} after {orbit.cycles} cycles"
        f" ({orbit.seconds * 1e3:.3g} ms), period {orbit.period or 'none'}, defect {orbit.defect:.1e},"
        f" {orbit.events / max(1, orbit.period):g} events a period"
    ]
    lines += [
        f"  {name}: amplitude {amplitude:.9g}, mean {mean:.9g}"
        for name, amplitude, mean in zip(scene.monitor_names, orbit.amplitude, orbit.mean, strict=True)
    ]
    row, count = 0, len(scene.laws["tangents"])
    for i, tangents in enumerate(scene.laws["tangents"][:MOST_CONTACTS]):
        mean = ", ".join(f"{force:.9g}" for force in orbit.force_mean[row : row + tangents])
        lines.append(
            f"  contact {i}: mean T {mean}, mean N {orbit.force_mean[row + tangents]:.9g};"
            f" stick {orbit.stick[i]:.3f}, slip {orbit.slip[i]:.3f}, open {orbit.open[i]:.3f}"
        )
        row += tangents + 1
    if count > MOST_CONTACTS:
        lines.append(f"  ... and {count - MOST_CONTACTS} more contacts, in the file")
    if orbit.chatter:
        lines.append(f"  {orbit.chatter} instant(s) of chattering were cut short")
    return [*lines, file]


def write(
    path: str, job: Job, scene: ReducedScene, choices: Run, orbit: Orbit, met: list[Attractor], warnings: list[str]
) -> None:
    """Write the group /integration, replacing one that is there."""
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    with whole_hdf5(path, start=path if _is_ours(path) else None) as file:
        if "format" not in file.attrs:
            file.attrs["format"] = FORMATS[1]
            file.attrs["format_version"] = 1
            file.attrs["attrito_version"] = __version__
            file.attrs["description"] = (
                "Time integration of a structure with friction contacts; see docs/reference/files.md of attrito"
            )
            file.attrs["references"] = REFERENCES
            file.attrs.update(job.attributes)
            file.attrs["job_file"] = str(Path(job.path).resolve())
        if "integration" in file:
            del file["integration"]
        group = file.create_group("integration")
        group.attrs["job"] = json.dumps(job.tables)
        group.attrs["version"] = __version__
        group.attrs["outcome"], group.attrs["reason"] = orbit.outcome, orbit.reason
        group.attrs["scheme"] = choices.scheme
        group.attrs["warnings"] = "\n".join(warnings)
        for name, (values, description, unit) in _datasets(scene, choices, orbit).items():
            described(group, name, description, unit, data=values)
        group["contacts/history/regime"].attrs["names"] = "stick,slip,open"
        write_attractors(file, scene.monitor_names, met)


def _is_ours(path: str) -> bool:
    try:
        with h5py.File(path) as file:
            if file.attrs.get("format") not in FORMATS:
                return False
            check_datasets(file, path)
            check_sums(file, path)
            return True
    except UNREADABLE:
        return False


def _datasets(scene: ReducedScene, choices: Run, orbit: Orbit) -> dict[str, tuple[object, str, str]]:
    """Every dataset: values, description, unit."""
    length, force, energy = "user length", "user force", "user force*length"
    data: dict[str, tuple[object, str, str]] = {
        "frequency_hz": (choices.frequency_hz, "frequency of the excitation", "Hz"),
        "period": (orbit.period, "period in periods of the excitation, 0: none recognised", "1"),
        "cycles": (orbit.cycles, "cycles until steady", "1"),
        "defect": (orbit.defect, "change of the state over the period, relative to the motion's half range", "1"),
        "contraction": (orbit.contraction, "ratio of the last two defects", "1"),
        "events": (orbit.events, "events in the period", "1"),
        "chatter": (orbit.chatter, "instants at which events were cut short", "1"),
        "seconds": (orbit.seconds, "time taken", "s"),
        "work": (orbit.work, "work of the loads per period of the excitation", energy),
        "damping_energy": (orbit.damping_energy, "energy dissipated by damping per period of the excitation", energy),
        "history/time": (orbit.time, "time of the samples", "s"),
    }
    for i, name in enumerate(scene.monitor_names):
        for quantity in ("amplitude", "mean", "low", "high"):
            what = {"amplitude": "half the range", "mean": "mean", "low": "lowest value", "high": "highest value"}[
                quantity
            ]
            data[f"monitors/{name}/{quantity}"] = (getattr(orbit, quantity)[i], f"{what} over the period", length)
        data[f"monitors/{name}/history"] = (orbit.monitors[:, i], "samples", length)
    tangents = np.asarray(scene.laws["tangents"])
    first = np.concatenate([[0], np.cumsum(tangents + 1)[:-1]])
    normal = first + tangents
    data["contacts/n_mean"] = (orbit.force_mean[normal], "mean normal force", force)
    data["contacts/n_min"] = (orbit.normal_min, "smallest normal force", force)
    data["contacts/dissipated_energy"] = (
        orbit.friction_energy,
        "energy dissipated per period of the excitation",
        energy,
    )
    for name in ("stick", "slip", "open"):
        data[f"contacts/{name}"] = (getattr(orbit, name), f"fraction of the period in {name}", "1")
    data["contacts/history/v"] = (orbit.displacement[:, normal], "normal displacement, closing positive", length)
    data["contacts/history/n"] = (orbit.force[:, normal], "normal force", force)
    data["contacts/history/regime"] = (orbit.regime, "index into the attribute names", "1")
    for tangent in range(1, int(tangents.max(initial=1)) + 1):
        has = tangents >= tangent
        row = np.where(has, first + tangent - 1, 0)
        data[f"contacts/t{tangent}_mean"] = (
            np.where(has, orbit.force_mean[row], np.nan),
            "mean tangential force",
            force,
        )
        stiffness = np.asarray(scene.laws["tangential_stiffness"])
        u, t = (np.where(has, samples[:, row], np.nan) for samples in (orbit.displacement, orbit.force))
        data[f"contacts/history/u{tangent}"] = (u, "tangential displacement", length)
        data[f"contacts/history/t{tangent}"] = (t, "tangential force", force)
        data[f"contacts/history/w{tangent}"] = (u - t / stiffness, "slider", length)
    return data
