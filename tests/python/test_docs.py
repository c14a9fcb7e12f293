"""The documentation: what comes out of the code is up to date, links lead somewhere, commands exist."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import build_pages
import generate
import h5py
import numpy as np
import pytest
from figures import LEAST_PIXELS, pixels
from jobs import ENVIRONMENT, TIMEOUT, attrito_here
from mkdocs.exceptions import Abort

from attrito.cli.arguments import parser
from attrito.fits.design import read_fit
from attrito.job.checks import integer, listing, number, takes, term
from attrito.job.key_units import UNITS, unit_of
from attrito.job.reading import read_job
from attrito.job.reference import as_job, as_text, tables
from attrito.job.schema import ARRAYS, TABLES
from attrito.library import loading
from attrito.library.description import describe
from attrito.library.names import STRATEGIES
from attrito.optima.design import read_optimum
from attrito.plots.response import level_map
from attrito.studies.design import read_study

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")])

# Figures of speech, where a plain word says it: report, list, follow, drift, move
FIGURATIVE = re.compile(r"\b(told|tells|anew|walk(s|ed)?|heeds?|wander(s|ed)?|astray|foothold|nudged)\b", re.IGNORECASE)

COMMAND = re.compile(r"\s*(mpirun .*attrito|\.venv/bin/attrito|attrito) ")

names = pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub makes them."""
    text = re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL)
    headings = re.findall(r"^#+ (.*)$", text, flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in headings}


@pytest.mark.parametrize("name", generate.MADE)
def test_a_page_says_what_the_code_says(name):
    assert (ROOT / "docs" / name).read_text() == generate.page(name), "run script/reference"


def test_every_key_of_the_job_has_a_meaning_and_every_table_a_purpose():
    assert set(tables()) == set(TABLES | ARRAYS)
    assert [key for keys in tables().values() for key, spec in keys.items() if not spec.meaning] == []
    printed = as_text()
    assert all(f"\n  {key}: " in printed for keys in tables().values() for key in keys)


def test_every_key_that_takes_a_number_with_a_point_has_a_unit_and_every_unit_is_of_a_key():
    # A dof is "a number from 0".
    numbers = r"\ba number(?! from 0)|numbers|pair \[dof"
    lacking = [
        f"{table}.{key}"
        for table, keys in tables().items()
        for key, spec in keys.items()
        if re.search(numbers, takes(spec.check)) and not unit_of(table, key)
    ]
    assert lacking == []
    assert [(table, key) for table, keys in UNITS.items() for key in keys if key not in tables()[table]] == []


def test_what_a_key_takes_is_said_down_to_the_items_of_lists():
    assert takes(listing(number(0), 2, 2)) == "a list of 2, each a number of at least 0"
    assert takes(listing(term, 1)) == "a list of at least 1, each a pair [dof, coefficient]"
    assert takes(integer(1)) == "an integer of at least 1" and takes(integer(1, 5)) == "an integer from 1 to 5"


INPUTS = sorted((ROOT / "input").glob("*.toml"))
STUDIES = [path for path in INPUTS if "vary" in tomllib.loads(path.read_text())]
FITS = [path for path in INPUTS if "data" in tomllib.loads(path.read_text())]
OPTIMA = [path for path in INPUTS if "parameter" in tomllib.loads(path.read_text()) and path not in FITS]
JOBS = [path for path in INPUTS if path not in (*STUDIES, *FITS, *OPTIMA)]


@pytest.mark.parametrize("path", JOBS, ids=lambda path: path.name)
def test_a_job_written_out_again_is_the_same_job(path, tmp_path):
    # A job of a nonlinear mode alone has nothing that excites.
    excited = "sweep" in tomllib.loads(path.read_text())
    job = read_job(path, excited=excited)
    again = tmp_path / path.name
    again.write_text(as_job(job.tables))
    assert read_job(again, excited=excited).tables == job.tables


@pytest.mark.parametrize("path", STUDIES, ids=lambda path: path.name)
def test_a_study_suits_its_job(path):
    study = read_study(path)
    study.check(read_job(study.job))


@pytest.mark.parametrize("path", FITS, ids=lambda path: path.name)
def test_a_fit_suits_its_jobs(path):
    fit = read_fit(path)
    fit.check([read_job(one.job, excited=one.is_excited) for one in fit.data])


@pytest.mark.parametrize("path", OPTIMA, ids=lambda path: path.name)
def test_an_optimum_suits_its_job(path):
    optimum = read_optimum(path)
    optimum.check(read_job(optimum.job))


@pytest.mark.parametrize("path", INPUTS, ids=lambda path: path.name)
def test_every_input_has_a_page_that_tells_of_it(path):
    jobs = (ROOT / "docs" / "tutorials" / "index.md").read_text()
    row = next((line for line in jobs.splitlines() if line.startswith(f"| `{path.name}`")), "")
    pages = r"[a-z-]+|\.\./(how-to|evidence|explanation)/[a-z-]+"
    assert re.search(rf"\]\(({pages})\.md(#[a-z-]+)?\)", row), path.name


def test_pages_build_with_equations_contents_and_a_search_that_finds_their_words(tmp_path):
    build_pages.build(tmp_path / "site", tmp_path / "source")
    home = (tmp_path / "site" / "index.html").read_text()
    theory = (tmp_path / "site" / "docs" / "explanation" / "theory.html").read_text()
    assert '<p role="img"' in theory and "$$" not in theory
    # On a phone a row of many columns is a list, whose lines have the headings of the columns.
    assert '<td data-heading="default">' in (tmp_path / "site" / "docs" / "reference" / "job.html").read_text()
    # The index of the search is a script, so that it works without a server.
    index = (tmp_path / "site" / "search" / "search_index.js").read_text()
    for page in PAGES:
        place = page.relative_to(ROOT)
        name = "index.html" if place.name == "README.md" else place.with_suffix(".html").as_posix()
        title = re.search(r"^# (.*)$", page.read_text(), flags=re.MULTILINE)[1]
        assert "<h1 id" in (tmp_path / "site" / name).read_text(), title
        assert json.dumps(name) in index or place.name == "README.md", title
    assert "shaken down" in index
    # Its worker, too, is there: nothing of a page is loaded from a network.
    assert (tmp_path / "site" / "docs" / "iframe-worker.js").is_file() and "iframe-worker.js" in home
    loaded = r'<(?:script|img|iframe)[^>]* src="https?:[^"]*"|<link[^>]* rel="stylesheet"[^>]* href="https?:[^"]*"'
    pages = {page: page.read_text() for page in (tmp_path / "site").rglob("*.html")}
    assert [found for text in pages.values() for found in re.findall(loaded, text)] == []
    # Every link of a page of the site leads to a file of the site.
    dead = [
        f"{page.name}: {link}"
        for page, text in pages.items()
        for link in re.findall(r'<a [^>]*href="([^":#?]+)["#?]', text)
        if page.name != "404.html" and not (page.parent / link).exists()
    ]
    assert dead == []


@pytest.mark.parametrize("link", ["nowhere.md", "reference/job.md#nowhere"])
def test_a_link_that_leads_nowhere_is_an_error(tmp_path, link):
    shutil.copytree(ROOT / "docs", tmp_path / "source" / "docs")
    with (tmp_path / "source" / "docs" / "gallery.md").open("a") as page:
        page.write(f"\n[see]({link})\n")
    with pytest.raises(Abort):
        build_pages.build(tmp_path / "site", tmp_path / "source")


@names
def test_links_of_a_page_lead_to_files_and_headings_that_are_there(page):
    text = re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if re.match(r"[a-z]+:", target):
            continue
        name, _, anchor = target.partition("#")
        place = (page.parent / name).resolve() if name else page
        assert place.exists(), target
        assert not anchor or anchor in anchors(place), target


@names
def test_commands_of_a_page_are_commands_of_the_program(page):
    blocks = re.findall(r"```[a-z]*\n(.*?)```", page.read_text(), flags=re.DOTALL)
    lines = [line for block in blocks for line in block.replace("\\\n", " ").splitlines()]
    for line in lines:
        words = shlex.split(line.split(" | head")[0], comments=True) if COMMAND.match(line) else []
        if not words:
            continue
        command = words[[Path(word).name for word in words].index("attrito") + 1 :]
        # What is in brackets is a choice; one of each is enough to parse.
        tidy = re.sub(r"\[([^|\]]*)(\|[^\]]*)?\]", r"\1", " ".join(command))
        parser().parse_args(tidy.split())


def test_every_page_is_in_the_index():
    index = (ROOT / "docs" / "index.md").read_text()
    pages = {str(page.relative_to(ROOT / "docs")) for page in (ROOT / "docs").rglob("*.md")} - {"index.md"}
    assert sorted(page for page in pages if f"]({page})" not in index) == []


def test_addresses_of_earlier_releases_lead_to_where_their_pages_are(tmp_path):
    build_pages.redirect(tmp_path)
    assert 'url=explanation/condensation.html"' in (tmp_path / "docs" / "method.html").read_text()
    assert [new for new in build_pages.MOVED.values() if not (ROOT / "docs" / f"{new}.md").is_file()] == []


def test_messages_that_are_explained_are_messages_of_the_program():
    sources = [*(ROOT / "python").rglob("*.py"), *(ROOT / "src").rglob("*.?90")]
    # Texts that go on in the next line of the source are one.
    said = re.sub(r"[\"']\s*\n\s*(f?[\"']|//\s*&?\s*)", "", "\n".join(source.read_text() for source in sources))
    rows = re.findall(
        r"^\| (`.*?`)[^|`]* \|", (ROOT / "docs" / "reference" / "messages.md").read_text(), flags=re.MULTILINE
    )
    assert len(rows) > 15
    columns = ("unique", "stable")
    unknown = [row for row in rows if row.strip("`") not in said and row.strip("`") not in columns]
    assert unknown == []


@pytest.mark.parametrize("script", sorted((ROOT / "input" / "python").glob("*.py")), ids=lambda path: path.name)
def test_a_script_runs_and_says_something(script, tmp_path, capfd):
    arguments = []
    if script.stem == "read_a_result":
        (tmp_path / "wedge.toml").write_text(
            (ROOT / "input" / "wedge.toml").read_text().replace("../out/wedge/wedge.h5", "wedge.h5")
        )
        assert attrito_here(tmp_path, capfd, "run", "wedge.toml").returncode == 0
        arguments = ["wedge.h5"]
    done = subprocess.run(
        [sys.executable, str(script), *arguments],
        cwd=tmp_path,
        env=os.environ | ENVIRONMENT,
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() and "Warning" not in done.stderr


def commands_of(name: str, tmp_path: Path, begin: str = "") -> tuple[str, str]:
    """The commands of a tutorial from a heading on, run in a copy of `input/`: its text, and what they print."""
    text = (ROOT / "docs" / "tutorials" / name).read_text()
    text = text[text.index(begin) :]
    blocks = re.findall(r"```\n(.*?)```", text, flags=re.DOTALL)
    commands = "\n".join(block for block in blocks if re.match(r"mkdir|attrito", block))
    shutil.copytree(ROOT / "input", tmp_path / "input")
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "attrito").write_text(f'#!/bin/sh\nexec "{sys.executable}" -m attrito.cli "$@"\n')
    (tmp_path / "bin" / "attrito").chmod(0o755)
    path = f"{tmp_path / 'bin'}:{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "-e", "-c", commands],
        cwd=tmp_path,
        env=os.environ | ENVIRONMENT | {"PATH": path},
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
    )
    assert done.returncode == 0, done.stderr
    return text, done.stdout


def states(text: str, pattern: str, values: list[float]) -> None:
    """A sentence of a page has these values, to 1 % or to the last digit that it gives: the groups of the pattern."""
    found = re.search(pattern, text)
    assert found, pattern
    for stated, value in zip(found.groups(), values, strict=True):
        digits, _, exponent = stated.partition("e")
        last = 10.0 ** (int(exponent or 0) - len(digits.partition(".")[2]))
        assert float(stated) == pytest.approx(value, rel=0.01, abs=0.5 * last), pattern


def peak_of(file: Path, monitor: str, level: float = 1.0) -> tuple[float, float, float, int]:
    """The largest amplitude at a level, its frequency, the part by which it is below the stuck peak, its point."""
    with h5py.File(file) as result:
        amplitude = result[f"monitors/{monitor}/amplitude"][:]
        at = int(np.argmax(np.where(result["points/level"][:] == level, amplitude, 0.0)))
        linear = result[f"linear/stuck/{monitor}"][:].max() * level
        return amplitude[at], result["points/frequency_hz"][at], 1.0 - amplitude[at] / linear, at


def test_the_wedge_gives_the_numbers_that_its_tutorial_states(tmp_path):
    text, printed = commands_of("wedge.md", tmp_path)
    assert (
        "stuck 132.7, 264.8, frictionless 116.3, 258" in printed
        and "stuck 132.7, 264.8, frictionless 116.3, 258" in text
    )
    file = tmp_path / "out" / "wedge" / "wedge.h5"
    top, hertz, below, at = peak_of(file, "x")
    states(text, r"x   (\S+) m at (\S+) Hz", [top, hertz])
    states(text, r"peak would be (\S+) m; friction takes (\d+) %", [top / (1 - below), 100 * below])
    with h5py.File(file) as result:
        states(text, r"(\d+) points, all solved", [len(result["points/level"])])
        contact = {
            name: result[f"contacts/{name}"][:, 0] for name in ("n_mean", "t1_low", "t1_high", "unique", "state")
        }
        names = [name.decode() for name in result["contacts/state"].attrs["names"]]
        frequency = result["points/frequency_hz"][:]
    for point, place in ((0, "140"), (at, "133.11"), (-1, "100")):
        row = next(line for line in text.splitlines() if line.startswith(f"| {place} |")).split(" | ")
        assert row[1] == names[contact["state"][point]] and (row[4] == "true |") == (contact["unique"][point] == 1)
        bounds = [float(bound) for bound in row[3].split(" to ")]
        assert [float(row[2]), bounds[0], bounds[-1]] == pytest.approx(
            [contact[name][point] for name in ("n_mean", "t1_low", "t1_high")], rel=0.01
        )
    slips = frequency[contact["state"] == names.index("slipping")]
    states(text, r"Between (\d+) and (\d+) Hz", [slips.max(), slips.min()])
    states(text, r"(\S+) N apart at 100 Hz", [contact["t1_high"][-1] - contact["t1_low"][-1]])
    frozen = peak_of(tmp_path / "out" / "wedge" / "uncoupled.h5", "x")
    states(text, r"its peak is (\S+) m, 14 % too high", [frozen[0]])
    assert round(100 * (frozen[0] / top - 1)) == 14
    with h5py.File(tmp_path / "out" / "wedge" / "uncoupled.h5") as result:
        states(text, r"is then (\S+) N at every point", [result["contacts/n_mean"][:, 0].mean()])
        assert np.ptp(result["contacts/n_mean"][:, 0]) < 1e-6
    assert peak_of(tmp_path / "out" / "wedge" / "levels.h5", "x", 0.5)[2] == pytest.approx(0.0, abs=1e-3)
    _, hertz, below, _ = peak_of(tmp_path / "out" / "wedge" / "levels.h5", "x", 2.0)
    states(
        text, r"takes (\d+) % of the linear peak, and the frequency of the peak falls to (\d+) Hz", [100 * below, hertz]
    )


def test_the_first_run_s_own_model_gives_the_numbers_that_it_states(tmp_path):
    text, printed = commands_of("first-run.md", tmp_path, "## 2.")
    blocks = re.findall(r"```\n(.*?)```", text, flags=re.DOTALL)
    told = next(block for block in blocks if block.startswith("out/strip/model.h5:"))
    assert [line for line in told.splitlines() if line not in printed] == []
    assert "stuck 759.8," in printed and "frictionless 464.7," in printed
    assert "759.8 Hz with all contacts stuck and 464.7 Hz without friction" in text
    assert "stuck 1111," in printed and "Sweep from 390 to 1300 Hz." in printed
    assert "the stuck frequency is 1111 Hz" in text and "proposes a band: 390 to 1300 Hz" in text
    for level in (0.1, 1.0):
        top, hertz, below, _ = peak_of(tmp_path / "out" / "strip" / "result.h5", "tip", level)
        row = rf"tip   (\S+) mm at (\S+) Hz +(\d+) % .*level {level:g}\n"
        states(text, row, [top, hertz, 100 * below])
        # What the run prints has the same form as what the page shows.
        states(printed, row, [top, hertz, 100 * below])
    stress = re.search(r"largest alternating von Mises stress (\S+)", printed)[1]
    states(text, r"largest alternating stress there is (\S+) MPa", [float(stress)])
    # A curve a level
    for place in (0.0, 1.0):
        assert pixels(tmp_path / "out" / "strip" / "frf.png", level_map()(place)) > LEAST_PIXELS
    assert "Every point has a solution" in (tmp_path / "out" / "strip" / "report.html").read_text()


def test_names_in_the_glossary_exist_in_the_code_and_its_files():
    sources = [*(ROOT / "src").rglob("*.?90"), ROOT / "docs/reference/job.md", ROOT / "docs/reference/files.md"]
    words = set(re.findall(r"\w+", " ".join(source.read_text() for source in sources)))
    words |= {source.stem for source in sources}
    rows = [
        line.split(" | ")
        for line in (ROOT / "docs/reference/glossary.md").read_text().splitlines()
        if line.startswith("| ")
    ]
    named = [name for row in rows if len(row) > 2 for name in re.findall(r"`([^`]+)`", row[-1])]
    assert len(named) > 40
    for name in named:
        if name.startswith("src/"):
            assert list(ROOT.glob(name.rstrip("/"))), name
        else:
            assert set(re.findall(r"\w+", name)) <= words, name


def test_pages_and_sources_are_in_plain_words():
    sources = [path for folder, kind in (("src", "*.?90"), ("python", "*.py")) for path in (ROOT / folder).rglob(kind)]
    found = [
        f"{path.relative_to(ROOT)}: {match.group()}"
        for path in (*PAGES, *sources)
        for match in FIGURATIVE.finditer(path.read_text())
    ]
    assert not found


def test_the_table_of_fallback_strategies_has_all_of_them_in_their_order_and_whole_words():
    rows = describe(loading.load()).rows["strategies"]
    assert tuple(row[0] for row in rows) == STRATEGIES
    room = int(re.search(r"character\((\d+)\) :: path", (ROOT / "src/solve/strategy_table.f90").read_text())[1])
    for name, *words in rows:
        assert len(words) == 4 and all(0 < len(cell) < room for cell in words), name
        assert f"| `{name}` | {' | '.join(words)} |" in (ROOT / "docs/explanation/strategies.md").read_text()


def ran(code: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run Python as a reader would who copies it out of a page."""
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=folder,
        env=os.environ | ENVIRONMENT,
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
    )
    assert done.returncode == 0, done.stderr
    return done


def test_the_first_screens_fit_and_their_python_runs(tmp_path):
    text = (ROOT / "README.md").read_text()
    assert len(text.splitlines()) <= 80 and max(map(len, text.splitlines())) <= 100
    [code] = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    done = ran(code, tmp_path)
    assert done.stdout.splitlines()[-1] in text and "Warning" not in done.stderr
    # A curve a level
    for place in (0.0, 0.5, 1.0):
        assert pixels(tmp_path / "jenkins.png", level_map()(place)) > LEAST_PIXELS


def test_the_plain_residual_of_the_explanation_agrees_with_attrito(tmp_path):
    text = (ROOT / "docs" / "explanation" / "harmonic-balance.md").read_text()
    code = "\n".join(re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL))
    done = ran(code, tmp_path)
    printed = [line for line in done.stdout.splitlines() if line.startswith("amplitude of x")]
    assert len(printed) == 2 and printed[0] == printed[1] and text.count(f"# {printed[0]}") == 2


def test_numbers_of_the_readme_s_reasons_are_in_the_pages_that_they_link():
    text = (ROOT / "README.md").read_text()
    reasons = re.findall(r"^- (\*\*.*?)(?=^- |^#)", text, flags=re.DOTALL | re.MULTILINE)
    assert len(reasons) == 4
    for reason in reasons:
        page = (ROOT / re.search(r"\]\(([^)#]+)", reason)[1]).read_text()
        numbers = re.findall(r"\d{2,}(?:\.\d+)?", reason)
        assert numbers and [number for number in numbers if not re.search(rf"\b{number}\b", page)] == []


def test_the_version_has_a_heading_in_the_changelog_and_is_the_one_to_cite():
    version = tomllib.loads((ROOT / "python" / "pyproject.toml").read_text())["project"]["version"]
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text()
    headings = re.findall(r"^## (.*)$", (ROOT / "CHANGELOG.md").read_text(), flags=re.MULTILINE)
    assert headings[:2] == ["Unreleased", version]


def test_a_release_has_at_most_forty_lines_of_at_most_120_columns():
    releases = re.split(r"^## ", (ROOT / "CHANGELOG.md").read_text(), flags=re.MULTILINE)[1:]
    assert max(len(release.strip().splitlines()) for release in releases) <= 40
    assert max(len(line) for release in releases for line in release.splitlines()) <= 120
