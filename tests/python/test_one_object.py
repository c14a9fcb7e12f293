"""What a command returns stands for its file, wherever a file of results is asked for."""

from __future__ import annotations

import pytest
from jobs import peak_of_wedge, swept, wedge

import attrito


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("one")


@pytest.fixture(scope="module")
def result(folder):
    with attrito.run(swept(wedge(), 140.0, 120.0), folder=folder, quiet=True) as made:
        yield made


def test_a_result_its_file_and_what_is_open_give_the_same(folder, result):
    with attrito.Result(result.path) as opened:
        for work in (attrito.table, attrito.contact_table, attrito.multiplier_table, attrito.bifurcation_table):
            assert work(result) == work(result.path) == work(opened) == work(result=result)
        for one in (result, result.path, opened):
            assert [line.get_label() for line in attrito.plot(one).axes[0].get_lines()]
            attrito.write_report(one, folder / "page.html")
            assert "133." in (folder / "page.html").read_text()
    assert attrito.table(result).startswith("point,branch,frequency_hz")


def test_peaks_and_modes_are_drawn_by_what_made_them(folder):
    with attrito.peak(peak_of_wedge(), folder=folder, quiet=True) as peaks:
        assert len(attrito.plot(peaks).axes) == 2
    light = wedge() | {"mode": {"start": 1e-6, "stop": 1e-4, "points": 3}}
    with attrito.mode(light, folder=folder, quiet=True) as mode:
        assert len(attrito.plot(mode).axes) == 2
