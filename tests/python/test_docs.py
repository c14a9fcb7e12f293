"""The documentation: what comes out of the code is up to date, links lead somewhere, commands exist."""

from __future__ import annotations

import importlib.util
import re
import shlex
from pathlib import Path

import pytest

from attrito.cli import _parser
from attrito.job import read_job
from attrito.job_checks import integer, listing, number, takes, term
from attrito.job_reference import as_job, as_text, tables
from attrito.job_schema import ARRAYS, TABLES

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")])
SPEC = importlib.util.spec_from_file_location("generate", ROOT / "docs" / "generate.py")
generate = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(generate)

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


def test_what_a_key_takes_is_said_down_to_the_items_of_lists():
    assert takes(listing(number(0), 2, 2)) == "a list of 2, each a number of at least 0"
    assert takes(listing(term, 1)) == "a list of at least 1, each a pair [dof, coefficient]"
    assert takes(integer(1)) == "an integer of at least 1" and takes(integer(1, 5)) == "an integer from 1 to 5"


@pytest.mark.parametrize("path", sorted((ROOT / "input").glob("*.toml")), ids=lambda path: path.name)
def test_a_job_written_out_again_is_the_same_job(path, tmp_path):
    job = read_job(path)
    again = tmp_path / path.name
    again.write_text(as_job(job.tables))
    assert read_job(again).tables == job.tables


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
        words = shlex.split(line, comments=True) if re.match(r"\s*(mpirun|\.venv/bin/attrito|attrito) ", line) else []
        if not words:
            continue
        command = words[[Path(word).name for word in words].index("attrito") + 1 :]
        # What is in brackets is a choice; one of each is enough to parse.
        tidy = re.sub(r"\[([^|\]]*)(\|[^\]]*)?\]", r"\1", " ".join(command))
        _parser().parse_args(tidy.split())
