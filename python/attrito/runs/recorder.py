"""Each point of a run safe on disk before the next begins, and going on after the last that is.

What a run has found is in its journal, `result.h5.partial`: the root writes, every rank hands over what it needs to
go on.
"""

from __future__ import annotations

import hashlib
import json
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from itertools import islice, repeat
from types import SimpleNamespace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from attrito.job.reading import retire
from attrito.library.points import Point
from attrito.library.reduced_scene import ReducedScene
from attrito.library.series import Series
from attrito.library.session import Solver
from attrito.results.journal import Journal, Record, is_point, read_journal, read_record
from attrito.runs.position import RunPosition
from attrito.support.errors import Fault, InputError
from attrito.support.hdf5_reading import UNREADABLE, spoilt
from attrito.support.parallel import on_root
from attrito.support.version import __version__

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

    from attrito.runs.branch_search import Search


class Follower(Protocol):
    """What visits points and remembers what it found of each."""

    def save_state(self) -> dict[str, np.ndarray]:
        """What was found of the last point."""

    def load_state(self, found: dict[str, np.ndarray]) -> None:
        """Go on after a point of which `save_state` returned this."""


class Recorder:
    """The journal of a run as all ranks see it; every method but `close` is collective.

    Parameters
    ----------
    comm, solver : what solves
    path : of the journal
    followers : what remembers something of each point

    Attributes
    ----------
    written : points that are on disk
    """

    def __init__(self, comm: Comm, solver: Solver, path: str, followers: Sequence[Follower]):
        self._comm, self._solver, self._path, self._followers = comm, solver, path, followers
        self._journal: Journal | None = None
        self.written = 0
        # Where the record of each point begins; at the root
        self._starts: list[int] = []
        self._known: set[str] = set()
        self._told: dict[str, np.ndarray] = {}
        self._new: dict[str, Series] = {}

    def begin(self, first: Record) -> None:
        """Make the journal again, with what holds for the run."""
        on_root(self._comm, lambda: self._open(0, first))

    def resume(self, job_file: str, first: Record | None, search: Search | None = None) -> RunPosition:
        """Go on after the journal's last point; a search for other branches of a level, if any, begins again.

        Parameters
        ----------
        job_file : the job, for messages
        first : what `begin` would write; what the journal holds must be the same
        search : what a level's points are to be known to
        """
        notes, place = on_root(self._comm, lambda: self._understood(job_file, first))
        self.written = len(notes)
        if not notes:
            return place
        known = []
        if search is not None and search.searches:
            known = [i for i, note in enumerate(notes) if note["place"]["level"] == place.level]
        if search is not None and known:
            search.begin_level(notes[known[0]]["point"]["level"])
        records = self._points()
        for i, note in enumerate(notes):
            record = next(records)
            if i not in known and i + 1 < len(notes):
                continue
            self._load(record)
            if search is not None and i in known:
                search.keep(SimpleNamespace(**note["point"]), note["place"]["taken"] == 1)
        return place

    def _understood(self, job_file: str, first: Record) -> tuple[list[dict], RunPosition]:
        """Notes of the points that are gone on from, and where the last of them stands."""
        try:
            notes = self._reopen(job_file, first)
            return notes, RunPosition(**notes[-1]["place"]) if notes else RunPosition()
        except (InputError, OSError):
            raise
        except UNREADABLE as error:
            raise spoilt(self._path, error, f"a journal that attrito {__version__} wrote") from error

    def _points(self) -> Iterator[Record | None]:
        """The points of the journal at the root, nothing elsewhere."""
        if self._comm.rank != 0:
            yield from repeat(None)
        yield from (read_record(self._path, start) for start in self._starts)

    def _load(self, record: Record | None) -> None:
        """Take the solver back to the point of a record, which the root has."""
        states = None
        if record is not None:
            states = [record.arrays[f"state/{rank}"] for rank in range(self._comm.size)]
        if not self._solver.load_state(self._comm.scatter(states)):
            raise InputError(Fault(self._path, "state", "of another version", f"what attrito {__version__} wrote"))

    def return_to(self, number: int) -> None:
        """Take the solver back to a point that is written, by its number, with contacts as its solution left them."""
        record = read_record(self._path, self._starts[number]) if self._comm.rank == 0 else None
        self._load(record)
        taken = None
        if record is not None:
            taken = record.arrays["/contacts/slider"], record.arrays["/contacts/force"].shape[-1]
        self._solver.take_sliders(*self._comm.bcast(taken))

    def add_found(self, follower: Follower, number: int, found: dict[str, np.ndarray]) -> None:
        """Put on disk what a follower found of a point that is written; its `load_state` understands it. Collective."""
        note = {"found_of": number, "follower": self._followers.index(follower)}
        on_root(self._comm, lambda: self._journal.append(Record(note, found)))

    def hear(self) -> None:
        """Take down the point that the solver stands at, before anything moves it."""
        self._told, self._new = {}, {}
        self._solver.report_point(self._hear if self._comm.rank == 0 else None)

    def heard(self, path: str) -> np.ndarray:
        """What was taken down of the point; at the root."""
        return self._told[path]

    def has_heard(self, path: str) -> bool:
        """Whether that was taken down of the point; at the root."""
        return path in self._told

    def add(self, path: str, what: Series, values: np.ndarray) -> None:
        """Take down besides what the solver does not report itself, or in its place; at the root."""
        self._hear(path, what, values)

    def leave_out(self, path: str) -> None:
        """Take down nothing of what the solver reports, but does not know here; at the root."""
        del self._told[path]
        self._new.pop(path, None)

    def _hear(self, path: str, what: Series, values: np.ndarray) -> None:
        self._told[path] = values
        if path not in self._known:
            self._new[path] = what

    def write(self, point: Point, place: RunPosition) -> None:
        """Put the point on disk, with what followers found of it, and all that the next starts from."""
        states = self._comm.gather(self._solver.save_state())
        on_root(self._comm, lambda: self._append(point, place, states))
        self.written = place.points

    def _append(self, point: Point, place: RunPosition, states: list[np.ndarray]) -> None:
        found = {name: values for follower in self._followers for name, values in follower.save_state().items()}
        kept = {f"state/{rank}": numbers for rank, numbers in enumerate(states)}
        main = {name: getattr(point, name) for name in ("level", "branch", "frequency_hz", "outcome")}
        sums = [_sum_of(numbers) for numbers in states]
        note = {"place": asdict(place), "point": main, "states": sums}
        self._starts.append(self._journal.append(Record(note, self._told | found | kept, self._new)))
        self._known |= set(self._new)

    def _open(self, keep: int, first: Record | None = None) -> None:
        self._journal = Journal(self._path, keep)
        if first is not None:
            self._journal.append(first)

    def _reopen(self, job_file: str, first: Record) -> list[dict]:
        """Notes of the points that are gone on from; followers have taken up these and what was found of them later."""
        found = [(record.note, is_point(record), end) for record, end in read_journal(self._path)]
        if found:
            _check(job_file, self._path, first.note, found[0][0])
        points = [place for place, (_, is_one, _) in enumerate(found) if is_one][1:]
        while points and found[points[-1]][0]["place"]["searching"]:
            del found[points.pop() :]
        if not points:
            self._open(0, first)
            return []
        for record, _ in islice(read_journal(self._path), 1, len(found)):
            self._take_up(record)
        self._starts = [found[place - 1][2] for place in points]
        self._open(found[-1][2])
        return [found[place][0] for place in points]

    def _take_up(self, record: Record) -> None:
        """Let followers know what they found; of a point, or of one that was written before."""
        if not is_point(record):
            self._followers[record.note["follower"]].load_state(record.arrays)
            return
        # The library takes a state as it is: numbers that are not its own could lead it anywhere.
        states = [record.arrays[f"state/{rank}"] for rank in range(self._comm.size)]
        if record.note["states"] != [_sum_of(numbers) for numbers in states]:
            raise ValueError("the state of the solver is not the one that was put down")
        self._known |= set(record.series)
        for follower in self._followers:
            follower.load_state(record.arrays)

    def close(self) -> None:
        """Closing twice does no harm."""
        if self._journal is not None:
            self._journal.close()


def _sum_of(numbers: np.ndarray) -> int:
    """CRC-32 of a state, with its size."""
    return zlib.crc32(numbers.tobytes(), len(numbers)) if numbers.ndim == 1 and numbers.dtype == np.float64 else -1


def digest(scene: ReducedScene, load_path: np.ndarray) -> str:
    """SHA-256 of all numbers that a run starts from."""
    total = hashlib.sha256()
    damping = scene.damping if scene.damping is not None else np.array(scene.damping_value)
    laws = [scene.laws[name] for name in sorted(scene.laws)]
    if scene.damping_ratios is not None:
        total.update(scene.damping_ratios.tobytes())
    if scene.gyroscopic is not None:
        total.update(np.ascontiguousarray(scene.gyroscopic).tobytes())
    for values in (scene.mass, scene.stiffness, damping, *laws, scene.directions, scene.static, scene.harmonic,
                   scene.monitors, load_path):  # fmt: skip
        total.update(np.ascontiguousarray(values).tobytes())
    if scene.sector is not None:
        total.update(scene.sector.digest.encode())
    return total.hexdigest()


def _check(job_file: str, path: str, now: dict, before: dict) -> None:
    """Only what would go on bit for bit may go on."""
    again = "; or a run without --resume, which begins again"
    own, earlier = (json.loads(one["attributes"]["job"]) for one in (now, before))
    retire(earlier)
    faults = [
        Fault(job_file, key, value, f"{then}, as {path} began with{again}")
        for key, value, then in _differences(own, earlier)
    ]
    names = {
        "ranks": "ranks",
        "attrito_version": "version of attrito",
        "journal": "version of the journal",
        "digest": "model and loads",
    }
    for name, what in names.items():
        old = before.get(name, before["attributes"].get(name))
        new = now.get(name, now["attributes"].get(name))
        if old != new and not (name == "digest" and faults):
            shown = (new, old) if name != "digest" else (new[:12], old[:12])
            faults.append(Fault(job_file, what, shown[0], f"{shown[1]}, as {path} began with{again}"))
    if faults:
        raise InputError(*faults)


def _differences(now: object, before: object, place: str = "") -> Iterator[tuple[str, object, object]]:
    """Keys whose values differ, with both."""
    if isinstance(now, dict) and isinstance(before, dict):
        for key in sorted({*now, *before}):
            yield from _differences(now.get(key), before.get(key), f"{place}.{key}" if place else key)
    elif now != before:
        yield place, now, before
