"""Runs that are cut short: what is on disk, and that going on from it leads where the run would have come to."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import h5py
import numpy as np
import pytest
from jobs import ENVIRONMENT, TIMEOUT, Job, attrito, attrito_here, chain, swept, table, wait_for, wedge, write_job
from mpi4py import MPI
from patient import PROGRAM
from restarts import differences, run_in_pieces, run_to_the_end

from attrito.library.series import Series
from attrito.results import result_file
from attrito.results.journal import MAGIC, Journal, Record, is_journal, read_journal
from attrito.support.errors import InputError
from attrito.support.stop_signals import Stop

HERE = Path(__file__).parent


def rubbing(tangents: int) -> Job:
    """Three contacts that stick, slip and shake down within a few points."""
    job = chain(tangents=tangents)
    job["sweep"] = {"start_hz": 82.0, "stop_hz": 80.0}
    job["continuation"] = {"max_points": 9}
    job["load"][1]["cosine"] = [[0, 30.0]]
    return job


def of_two_levels() -> Job:
    """Two sweeps there and back of the wedge, one with every contact stuck; with stability and bounds."""
    job = wedge(force=1.0)
    job["balance"] = {"harmonics": 3}
    job["sweep"] = {"start_hz": 136.0, "stop_hz": 134.5, "levels": [0.5, 5.0]}
    job["continuation"] = {"both_directions": True}
    job["stability"] = {"method": "monodromy"}
    return job


def of_listed_frequencies() -> Job:
    """Three frequencies of the uncoupled wedge, the middle one not to be solved."""
    job = wedge()
    job["balance"] |= {"approach": "uncoupled", "max_iterations": 2}
    job["sweep"] = {"frequencies_hz": [128.0, 132.0, 136.0]}
    return job


@pytest.mark.parametrize(
    "job",
    [rubbing(1), rubbing(2), of_two_levels(), of_listed_frequencies()],
    ids=["one tangent", "two tangents", "levels and directions, stability", "listed, uncoupled"],
)
def test_a_run_resumed_after_every_point_gives_the_same_file_bit_for_bit(tmp_path, job):
    path = tmp_path / write_job(tmp_path, job)
    result = tmp_path / "result.h5"
    complaint = run_to_the_end(path)
    whole = result.rename(tmp_path / "whole.h5")
    runs, same = run_in_pieces(path)
    assert runs > 2
    assert complaint == same
    assert differences(result, whole) == []


def test_two_ranks_resumed_after_every_point_give_the_same_file_bit_for_bit(tmp_path):
    # Contacts move from rank to rank as they begin to slip.
    job = chain(contacts=5)
    job["sweep"] = {"start_hz": 82.0, "stop_hz": 80.0}
    job["continuation"] = {"max_points": 12}
    write_job(tmp_path, job)
    done = subprocess.run(
        ["mpirun", "-n", "2", sys.executable, str(HERE / "restarts.py"), "job.toml", "result.h5"],
        cwd=tmp_path, env=os.environ | ENVIRONMENT, capture_output=True, text=True, timeout=TIMEOUT, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert differences(tmp_path / "result.h5", tmp_path / "result.whole") == []


@pytest.fixture(scope="module")
def cut(tmp_path_factory) -> Path:
    """A folder with the journal of a run that was stopped in its midst."""
    folder = tmp_path_factory.mktemp("cut")
    done = attrito(folder, "run", write_job(folder, rubbing(1)), "--max-seconds", "1e-9")
    assert done.returncode == 1
    assert "stopped by --max-seconds 1e-09; the 1 points solved so far are in result.h5.partial" in done.stderr
    assert "go on with attrito run --resume job.toml" in done.stderr
    return folder


def copy_of(cut: Path, folder: Path) -> Path:
    """The stopped run in a folder of its own; returns its journal."""
    for name in ("job.toml", "result.h5.partial"):
        (folder / name).write_bytes((cut / name).read_bytes())
    return folder / "result.h5.partial"


def test_the_journal_of_a_stopped_run_reads_as_a_result(cut):
    rows = table(cut, result="result.h5.partial")
    assert [row["outcome"] for row in rows] == ["converged"]


def test_a_run_begun_with_a_key_that_has_lost_its_effect_goes_on(cut, tmp_path):
    path = copy_of(cut, tmp_path)
    records = [record for record, _ in read_journal(str(path))]
    attributes = records[0].note["attributes"]
    job = json.loads(attributes["job"])
    assert "contacts" not in job["balance"]
    job["balance"]["contacts"] = "all"
    attributes["job"] = json.dumps(job)
    journal = Journal(str(path))
    for record in records:
        journal.append(record)
    journal.close()
    done = attrito(tmp_path, "run", "--resume", "job.toml")
    assert "going on after 1 points" in done.stdout and len(table(tmp_path)) > 1, done.stderr


def test_a_journal_that_others_would_not_go_on_from_bit_for_bit_is_refused(cut, tmp_path, capfd):
    path = copy_of(cut, tmp_path)
    records = [record for record, _ in read_journal(str(path))]
    assert records[0].note.pop("journal") > 1
    journal = Journal(str(path))
    for record in records:
        journal.append(record)
    journal.close()
    before = path.read_bytes()
    done = attrito_here(tmp_path, capfd, "run", "--resume", "job.toml")
    assert done.returncode == 2
    assert "job.toml: version of the journal = " in done.stderr
    assert path.read_bytes() == before


def test_a_journal_cut_anywhere_keeps_every_whole_point(tmp_path):
    # Every length that a kill could leave, of a journal of three records.
    path = str(tmp_path / "journal")
    journal = Journal(path)
    for number in range(3):
        journal.append(Record({"number": number}, {"x": np.arange(number + 1.0)}, {"x": Series("real64", "some", "1")}))
    journal.close()
    whole = Path(path).read_bytes()
    ends = [end for _, end in read_journal(path)]
    assert ends[-1] == len(whole)
    for length in range(1, len(whole) + 1):
        Path(path).write_bytes(whole[:length])
        records = [record for record, _ in read_journal(path)]
        assert [record.note["number"] for record in records] == list(range(sum(end <= length for end in ends)))
    # And what a disk may have made of its end.
    for place in range(ends[1], len(whole)):
        Path(path).write_bytes(whole[:place] + bytes([whole[place] ^ 0x40]) + whole[place + 1 :])
        assert len(list(read_journal(path))) == 2


def test_a_journal_that_grows_while_it_is_read_reads_as_what_it_was_at_first(tmp_path, monkeypatch):
    path = str(tmp_path / "result.h5.partial")
    journal = Journal(path)
    job = json.dumps({"output": {"monitors": []}})
    journal.append(Record({"attributes": {"format": "attrito result", "job": job}}))

    def append(*frequencies: float) -> None:
        for i, hz in enumerate(frequencies):
            series = {"points/frequency_hz": Series("real64", "some", "Hz")} if hz == 1.0 else {}
            journal.append(Record({"number": i}, {"points/frequency_hz": np.array(hz)}, series))

    def survey_and_go_on(of: str) -> object:
        found = survey(of)
        append(3.0)
        return found

    survey = result_file._survey
    monkeypatch.setattr(result_file, "_survey", survey_and_go_on)
    append(1.0, 2.0)
    with h5py.File(tmp_path / "result.h5", "w") as file:
        result_file.fill_result(file, path)
        assert file["points/frequency_hz"][:].tolist() == [1.0, 2.0]
    journal.close()


def test_a_record_of_absurd_size_is_none(tmp_path):
    path = tmp_path / "journal"
    path.write_bytes(MAGIC + b"REC\n" + b"\xff" * 16 + b"{}")
    assert list(read_journal(str(path))) == []


def test_going_on_drops_what_was_cut_short(tmp_path):
    attrito(tmp_path, "run", write_job(tmp_path, rubbing(1)))
    whole = (tmp_path / "result.h5").rename(tmp_path / "whole.h5")
    attrito(tmp_path, "run", "job.toml", "--max-seconds", "1e-9")
    journal = tmp_path / "result.h5.partial"
    with journal.open("ab") as file:
        file.write(b"REC\n half a rec")
    done = attrito(tmp_path, "run", "--resume", "job.toml")
    assert done.returncode == 1, done.stderr
    assert "going on after 1 points of result.h5.partial" in done.stdout
    assert not journal.exists()
    assert differences(tmp_path / "result.h5", whole) == []


def test_resume_with_nothing_to_go_on_from_begins(tmp_path, capfd):
    done = attrito_here(tmp_path, capfd, "run", "--resume", write_job(tmp_path, wedge()))
    assert done.returncode == 0
    assert "nothing to go on from (result.h5.partial is absent): beginning" in done.stdout


@pytest.mark.parametrize("length", [1, 7, len(MAGIC), len(MAGIC) + 9])
def test_a_journal_cut_before_its_first_record_is_begun_again(cut, tmp_path, capfd, length):
    journal = copy_of(cut, tmp_path)
    journal.write_bytes(journal.read_bytes()[:length])
    read = attrito_here(tmp_path, capfd, "table", "result.h5.partial")
    assert read.returncode == 2
    assert "'empty': expected what an `attrito run` left that had begun to solve" in read.stderr
    done = attrito_here(tmp_path, capfd, "run", "--resume", "job.toml")
    assert "going on after 0 points of result.h5.partial" in done.stdout
    assert "max_points was reached" in done.stderr
    assert [row["outcome"] for row in table(tmp_path)] == ["converged"] * 9
    assert not journal.exists()


def test_another_job_is_not_gone_on_with(cut, tmp_path, capfd):
    copy_of(cut, tmp_path)
    job = rubbing(1)
    job["sweep"]["stop_hz"] = 78.0
    job["balance"]["max_iterations"] = 20
    done = attrito_here(tmp_path, capfd, "run", "--resume", write_job(tmp_path, job))
    assert done.returncode == 2
    lines = done.stderr.splitlines()
    assert "job.toml: balance.max_iterations = 20: expected 30, as result.h5.partial began with" in lines[0]
    assert "job.toml: sweep.stop_hz = 78.0: expected 80.0, as result.h5.partial began with" in lines[1]
    assert lines[2:] == ["2 faults"]


def test_another_model_or_number_of_ranks_is_not_gone_on_with(cut, tmp_path):
    journal = copy_of(cut, tmp_path)
    before = journal.read_bytes()
    done = attrito(tmp_path, "run", "--resume", "job.toml", ranks=2)
    assert done.returncode == 2
    assert "job.toml: ranks = 2: expected 1, as result.h5.partial began with" in done.stderr
    assert journal.read_bytes() == before


def test_a_run_that_begins_anew_keeps_the_journal_it_finds_until_it_is_done(cut, tmp_path, capfd):
    journal = copy_of(cut, tmp_path)
    before = journal.read_bytes()
    attrito_here(tmp_path, capfd, "run", "job.toml", "--max-seconds", "1e-9")
    assert (tmp_path / "result.h5.partial.old").read_bytes() == before
    attrito_here(tmp_path, capfd, "run", "job.toml")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["job.toml", "result.h5"]


@pytest.mark.parametrize("points", [True, False], ids=["some points", "no point"])
@pytest.mark.parametrize("resume", [["--resume"], []], ids=["resume", "again"])
def test_a_journal_in_use_is_left_alone(cut, tmp_path, capfd, points, resume):
    journal = copy_of(cut, tmp_path)
    if not points:
        begun = next(read_journal(str(journal)))[1]
        journal.write_bytes(journal.read_bytes()[:begun])
    before = journal.read_bytes()
    held = Journal(str(journal), len(before))
    done = attrito_here(tmp_path, capfd, "run", *resume, "job.toml")
    held.close()
    assert done.returncode == 2
    assert "result.h5.partial: file = 'in use': expected that no other run writes it" in done.stderr
    assert journal.read_bytes() == before


def test_a_run_that_is_not_on_the_main_thread_goes_without_signals():
    def enter() -> str:
        with Stop(MPI.COMM_SELF, max_seconds=1e6) as stop:
            return stop.asked()

    before = signal.getsignal(signal.SIGTERM)
    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(enter).result() == ""
    assert signal.getsignal(signal.SIGTERM) is before


# mpirun passes SIGUSR1 and SIGUSR2 on; at SIGTERM it kills, which is what the journal is for.
@pytest.mark.parametrize(("number", "ranks"), [(signal.SIGTERM, None), (signal.SIGUSR1, None), (signal.SIGUSR1, 2)])
def test_a_signal_ends_a_run_after_a_whole_point(tmp_path, number, ranks):
    command = [sys.executable, PROGRAM, "run", write_job(tmp_path, rubbing(1))]
    started = subprocess.Popen(
        command if ranks is None else ["mpirun", "-n", str(ranks), *command],
        cwd=tmp_path, env=os.environ | ENVIRONMENT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    journal = tmp_path / "result.h5.partial"
    wait_for(lambda: journal.is_file() and len(list(read_journal(str(journal)))) > 3, started)
    started.send_signal(number)
    out, error = started.communicate(timeout=TIMEOUT)
    assert started.returncode == 1, out + error
    solved = len(list(read_journal(str(journal)))) - 1
    assert f"stopped by {number.name}; the {solved} points solved so far are in result.h5.partial" in error
    assert is_journal(journal)
    assert "\r" not in out


def test_what_is_no_journal_is_told(tmp_path):
    path = tmp_path / "other"
    path.write_bytes(b"other")
    with pytest.raises(InputError, match="expected what an unfinished `attrito run` left"):
        list(read_journal(str(path)))


def test_the_last_lines_tell_peak_time_memory_and_file(tmp_path, capfd):
    done = attrito_here(tmp_path, capfd, "run", write_job(tmp_path, wedge()))
    heading, row, _, points, result = done.stdout.splitlines()[-5:]
    assert heading.split() == ["largest", "error"]
    assert re.fullmatch(r"x   5.8\de-05 at 132 Hz +0\.\d+ %", row)
    assert points.startswith("1 point, all solved, in ")
    assert re.search(r"\d iterations of Newton's method, \d+ MB$", points)
    assert result == "Result: result.h5. Next: attrito report result.h5"


def test_a_run_ends_with_its_peaks_or_with_the_band_to_try(tmp_path, capfd):
    job = swept(wedge(), 140.0, 100.0)
    job["sweep"]["levels"] = [1.0, 0.2]
    lines = attrito_here(tmp_path, capfd, "run", write_job(tmp_path, job)).stdout.splitlines()
    place = next(i for i, line in enumerate(lines) if line.split() == ["largest", "below", "stuck", "error"])
    slips, sticks = lines[place + 1 : place + 3]
    # The peak of the paper's wedge, 13.9 % below that of stuck contacts; at a fifth of the force none slips.
    assert re.search(r"5\.8\de-05 at 133\.1\d Hz +14 % +0\.\d+ % +level 1$", slips)
    assert re.search(r"at 132\.4\d Hz +\S+ % +\S+ % +level 0\.2$", sticks)
    assert lines[place + 5].startswith('"below stuck": than the linear peak with all contacts stuck')
    job = swept(wedge(), 60.0, 90.0)
    lines = attrito_here(tmp_path, capfd, "run", write_job(tmp_path, job)).stdout.splitlines()
    linear = "The nearest linear peaks are at 116.3 Hz (frictionless) and 132.7 Hz (stuck). Sweep from 99 to 150 Hz."
    assert linear in lines
