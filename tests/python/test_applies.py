"""Options that do not apply to a file, a point or an ending are refused in one line, whatever the command."""

from __future__ import annotations

import pytest
import synthetic
from edited import edited
from jobs import attrito_here

from attrito.results.chosen_points import chosen_points
from attrito.results.result import CAMPBELL, LINEAR_MODES, MODE, Result
from attrito.support.errors import InputError

FORMATS = {"run": "attrito result", "mode": MODE, "modes": LINEAR_MODES, "campbell": CAMPBELL, "peaks": "attrito peaks"}


@pytest.fixture
def files(tmp_path):
    """A small file of each format; what is refused does not come to look at more than that."""
    for name, form in FORMATS.items():
        path = synthetic.write_result(tmp_path / f"{name}.h5", [90.0, 91.0], {"tip": [3.0, 4.0]})
        with edited(path) as file:
            file.attrs["format"] = form
    return tmp_path


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("table mode.h5 --multipliers", "--multipliers = 'given': expected a file of `attrito run`"),
        ("table mode.h5 --columns phase", "--columns = 'phase': expected a file of `attrito run`"),
        ("table modes.h5 --contacts", "--contacts = 'given': expected a file of `attrito run` or `attrito mode`"),
        ("table modes.h5 --curve 50", "--curve = 50: expected a file of `attrito run`"),
        ("table modes.h5 --curve 0", "--curve = 0: expected a file of `attrito run`"),
        ("export rom.h5 --matrices dmig --mode 0", "--mode = 0: expected none with --matrices"),
        ("table campbell.h5 --sensitivities", "--sensitivities = 'given': expected a file of `attrito run`"),
        ("table peaks.h5 --sets", "--sets = 'given': expected a file of `attrito run` or `attrito mode`"),
        ("table run.h5 -o x.png", "-o = 'x.png': expected a name ending .csv, .txt, .dat, no ending"),
        ("report run.h5 -o x.jpg", "-o = 'x.jpg': expected a name ending .html, .htm, .pdf"),
        ("report run.h5 --point 999", "point = 999: expected a number from 0 to 1"),
        ("plot run.h5 -o x.jpg", "figure = '.jpg': expected a writable .png, .pdf or .svg file"),
        ("plot run.h5 -o x.pdf --dpi 50", "--dpi = 50: expected a picture ending .png"),
        ("plot run.h5 -o none/x.png", "figure = 'No such file or directory': expected a writable"),
        ("plot run.h5 --point 1", "--point = 1: expected none but for loops or a map of contacts"),
        ("plot run.h5 --loops --point 999", "point = 999: expected a number from 0 to 1"),
        ("plot run.h5 --monitor root", "--monitor = 'root': expected one of tip"),
        ("plot run.h5 --quantity nyquist --xlim 80 90", "--xlim = 'given': expected --quantity amplitude"),
        ("plot run.h5 --xlim 1 2", "--xlim = (1.0, 2.0): expected frequencies among 90 to 91 Hz"),
        ("plot run.h5 --quantity phase --linear", "--linear = 'given': expected --quantity amplitude, first_harmonic"),
        ("plot peaks.h5 --linear", "--linear = 'given': expected none for peaks"),
        ("export campbell.h5", "format = 'attrito campbell diagram': expected a result of `attrito run`, `mode`"),
        ("export modes.h5", "--mode = 'not given': expected --mode and a number from 1 to 2"),
        ("export run.h5 -o x.jpg", "-o = 'x.jpg': expected a name ending .vtu, .xdmf, no ending"),
        ("export run.h5 -o x.xdmf --format vtu", "-o = 'x.xdmf': expected a name ending .vtu, no ending"),
        ("export run.h5 --monitor tip --points 1", "--monitor = 'tip': expected none with --points or --mode"),
        ("export run.h5 --scale nan", "argument --scale: 'nan': expected a number"),
        ("export rom.h5 --matrices dmig --phases 4", "--phases = 4: expected none with --matrices"),
        ("export rom.h5 --matrices dmig --wheel", "--wheel = 'given': expected none with --matrices"),
    ],
)  # fmt: skip
def test_what_does_not_apply_is_refused(files, capfd, command, said):
    try:
        done = attrito_here(files, capfd, *command.split())
        code, written = done.returncode, done.stderr
    except SystemExit as ended:
        code, written = ended.code, capfd.readouterr().err
    assert code == 2 and said in written, written
    assert "Traceback" not in written and not [path for path in files.iterdir() if path.suffix != ".h5"]


def test_of_a_nonlinear_mode_the_last_point_with_a_solution_is_meant(tmp_path):
    expected = {("converged", "not_converged"): [0], ("converged", "converged"): [1]}
    for number, outcome in enumerate([*expected, ("not_converged", "not_converged")]):
        path = synthetic.write_result(tmp_path / f"{number}.h5", [90.0, 91.0], {"tip": [3.0, 4.0]}, outcome=outcome)
        with edited(path) as file:
            file.attrs["format"] = MODE
        with Result(path) as result:
            if outcome in expected:
                assert chosen_points(result) == expected[outcome]
            else:
                with pytest.raises(InputError, match="at least one converged point"):
                    chosen_points(result)
