"""The command line of `attrito`: its commands and what each takes."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence

from attrito.cli import commands
from attrito.cli.words import Parser, example, in_groups
from attrito.library.names import REFERENCES
from attrito.results.motion_names import QUANTITIES
from attrito.support.version import __version__

MATRICES = ("matrix-market", "matlab", "dmig", "abaqus")
# Commands whose job can be given other values, and those that say what they do
TALKING = ("reduce", "run", "peak", "mode", "integrate", "study", "linear-modes", "campbell")
SETTABLE = (*TALKING, "chart", "fit", "optimise")
# Set by a shell that asks for completions
COMPLETING = "_ARGCOMPLETE"
Parsers = argparse._SubParsersAction


def parser() -> argparse.ArgumentParser:
    """Of all commands; the options of each say in `work` what is to be done with them."""
    whole = Parser(
        prog="attrito",
        usage="attrito [-h] [--version] COMMAND ...",
        description="The steady vibration of finite-element structures that rub.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    whole.add_argument("--version", action="version", version=f"attrito {__version__}")
    parsers = whole.add_subparsers(dest="command", required=True, metavar="command", prog="attrito")
    making = (_import, _reduce)
    solving = (_run, _chart, _peak, _linear_modes, _campbell, _mode, _study, _fit, _optimise, _integrate)
    looking = (_table, _plot, _report, _info, _keys, _verify, _export, _stress)
    for add in (*making, *solving, *looking):
        add(parsers)
    for name in SETTABLE:
        parsers.choices[name].add_argument(
            "--set",
            action="append",
            default=[],
            metavar="KEY=VALUE",
            help="a key of the job and its value in TOML, as contact_set[*].friction_coefficient=0.4; load.NAME=2.0 is"
            " a factor on that load (repeatable)",
        )
    for name in TALKING:
        how_much = parsers.choices[name].add_mutually_exclusive_group()
        how_much.add_argument("-q", "--quiet", action="store_true", help="say nothing but warnings and errors")
        how_much.add_argument("-v", "--verbose", action="store_true", help="a line for every point")
    for name, one in parsers.choices.items():
        one.epilog, one.formatter_class = example(name), argparse.RawDescriptionHelpFormatter
    does = {action.dest: action.help or "" for action in parsers._choices_actions}
    whole.epilog = f"{in_groups(does)}\n\nattrito COMMAND --help explains one, with an example."
    return whole


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """Options of one command; what is wrong with them ends the program with that command's usage."""
    whole = parser()
    if COMPLETING in os.environ:
        _complete(whole)
    options, unknown = whole.parse_known_args(arguments)
    if unknown:
        choices = next(action.choices for action in whole._actions if isinstance(action, argparse._SubParsersAction))
        choices[options.command].error("unrecognized arguments: " + " ".join(unknown))
    return options


def _complete(whole: argparse.ArgumentParser) -> None:
    """Completion of a shell, where argcomplete is installed."""
    try:
        import argcomplete
    except ImportError:
        return
    argcomplete.autocomplete(whole)


def _import(parsers: Parsers) -> None:
    one = parsers.add_parser("import", help="matrices and mesh of another program -> model.h5")
    one.add_argument("output", help="model file to write")
    one.add_argument("--calculix", metavar="JOB", help="CalculiX's JOB.sti, JOB.mas and JOB.dof")
    one.add_argument("--abaqus", metavar="JOB", help="Abaqus's JOB_STIF1.mtx, JOB_MASS1.mtx; or a substructure's .mtx")
    one.add_argument("--nastran", metavar="FILE", help="Nastran's punch (DMIG) or OUTPUT4 file with K..., M..., B...")
    one.add_argument("--mesh", help="nodes, elements, node sets: .inp, .cdb, .bdf, .msh of gmsh, .med, .vtu, ...")
    for name in ("stiffness", "mass", "damping"):
        what = "Matrix Market, PETSc, npz, .mat, Harwell-Boeing, .mtx of Abaqus, DMIG, OUTPUT4"
        one.add_argument(f"--{name}", metavar="FILE[:NAME]", help=f"{name} matrix: {what}")
    one.add_argument(
        "--dofs",
        metavar="FILE",
        help="what rows are: lines node.direction, ANSYS's mapping file, EXTRN or ASET cards",
    )
    one.add_argument(
        "--holds",
        metavar="NAMES",
        default="",
        help="what the stiffness holds already: stress_stiffening, spin_softening, or both with a comma",
    )
    one.add_argument("--spin-hz", type=float, help="speed of the rotation that this comes from, Hz")
    one.add_argument("--geometric-stiffness", metavar="FILE", help="stress stiffening, to be added to the stiffness")
    one.set_defaults(work=commands.import_matrices)


def _reduce(parsers: Parsers) -> None:
    one = parsers.add_parser("reduce", help="the job's model -> rom.h5 (attrito run does it too)")
    one.add_argument("job", help="job file (TOML)")
    one.set_defaults(work=commands.reduce)


def _run(parsers: Parsers) -> None:
    one = parsers.add_parser("run", help="a job -> result.h5")
    one.add_argument("job", help="job file (TOML)")
    one.add_argument("--resume", action="store_true", help="go on after the last point of a run that was cut short")
    one.add_argument(
        "--max-seconds",
        type=_seconds,
        metavar="S",
        help="stop before this wall time, after a whole point (exit code 1)",
    )
    one.set_defaults(work=commands.run)


def _chart(parsers: Parsers) -> None:
    one = parsers.add_parser("chart", help="error against cost of all ways to solve a job's scene -> CSV, HDF5, PNG")
    one.add_argument("job", help="job file (TOML)")
    one.add_argument("-o", "--output", default="chart.h5", help="data (default: chart.h5); the picture goes beside it")
    one.add_argument(
        "--seconds",
        type=float,
        default=20.0,
        help="a series ends where a run of it takes longer, the chart after 15 times as long (default: 20)",
    )
    of = one.add_mutually_exclusive_group()
    of.add_argument("--mode", action="store_true", help="of the job's nonlinear mode, by both methods, not of its peak")
    of.add_argument(
        "--contacts",
        nargs="*",
        metavar="JOB",
        help="of the kinds of points on the job's faces, and of other jobs: the same structure on other meshes, whose"
        " last one is what the peaks are compared with (without any: cut faces)",
    )
    one.set_defaults(work=commands.chart)


def _peak(parsers: Parsers) -> None:
    one = parsers.add_parser("peak", help="a resonance peak followed in the level or preload -> HDF5, table, picture")
    one.add_argument("job", help="job file (TOML) with a table [peak]")
    one.add_argument("-o", "--output", help="picture to write (default: the file of peaks, ending .png)")
    one.set_defaults(work=commands.peak)


def _linear_modes(parsers: Parsers) -> None:
    one = parsers.add_parser(
        "linear-modes", help="modes with contacts stuck, frictionless or as at rest -> HDF5, table"
    )
    one.add_argument("job", help="job file (TOML); it needs neither [sweep] nor a harmonic load nor monitors")
    one.add_argument(
        "--state",
        choices=REFERENCES,
        default="tangent",
        help="every contact stuck; closed without friction; or (default) open ones open, closed ones stuck",
    )
    one.add_argument(
        "--count",
        type=_positive,
        default=20,
        metavar="N",
        help="of modes, at most; of a wheel, of each nodal diameter (default: 20)",
    )
    one.set_defaults(work=commands.linear_modes)


def _campbell(parsers: Parsers) -> None:
    one = parsers.add_parser("campbell", help="tangent modes against the speed of rotation -> HDF5, picture")
    one.add_argument(
        "job", help="job file (TOML) with a table [campbell]; no [sweep], harmonic load or monitors needed"
    )
    one.add_argument("-o", "--output", help="picture to write (default: the file of the diagram, ending .png)")
    one.set_defaults(work=commands.campbell)


def _mode(parsers: Parsers) -> None:
    one = parsers.add_parser(
        "mode", help="a nonlinear mode: frequency and damping by amplitude -> HDF5, table, picture"
    )
    one.add_argument("job", help="job file (TOML) with a table [mode]; no [sweep], harmonic load or monitors needed")
    one.add_argument("-o", "--output", help="picture to write (default: the file of the mode, ending .png)")
    one.add_argument("--resume", action="store_true", help="go on after the last point of a run that was cut short")
    one.set_defaults(work=commands.mode)


def _study(parsers: Parsers) -> None:
    one = parsers.add_parser("study", help="the peaks of a job for many values of its keys -> HDF5 and picture")
    one.add_argument("study", help="study file (TOML)")
    one.set_defaults(work=commands.study)


def _fit(parsers: Parsers) -> None:
    one = parsers.add_parser(
        "fit", help="parameters of a job from measured responses and backbones -> HDF5 and picture"
    )
    one.add_argument("fit", help="fit file (TOML)")
    one.set_defaults(work=commands.fit)


def _optimise(parsers: Parsers) -> None:
    one = parsers.add_parser("optimise", help="values of a job's keys at which its largest peak is least -> HDF5")
    one.add_argument("optimum", help="file of what is varied (TOML)")
    one.set_defaults(work=commands.optimise)


def _integrate(parsers: Parsers) -> None:
    one = parsers.add_parser("integrate", help="a job integrated in time -> group /integration of its output file")
    one.add_argument("job", help="job file (TOML)")
    one.set_defaults(work=commands.integrate)


def _table(parsers: Parsers) -> None:
    one = parsers.add_parser("table", help="result.h5, modes, peaks, study, fit -> CSV on standard output")
    one.add_argument("result", help="result file, or one of modes, peaks or a study")
    one.add_argument("-o", "--output", metavar="FILE", help="write the table there")
    one.add_argument(
        "--columns",
        nargs="+",
        choices=[name for name in QUANTITIES if name != "amplitude"],
        help="columns more of every monitor",
    )
    kind = one.add_mutually_exclusive_group()
    kind.add_argument("--contacts", action="store_true", help="a row a point and contact")
    kind.add_argument("--sets", action="store_true", help="a row a point and contact set: totals, dissipation")
    kind.add_argument("--multipliers", action="store_true", help="a row a point and Floquet multiplier")
    kind.add_argument("--sensitivities", action="store_true", help="a row a point, quantity and parameter")
    kind.add_argument("--bifurcations", action="store_true", help="a row a turning point or crossing multiplier")
    kind.add_argument("--bands", action="store_true", help="of a study: mean, deviation, quantiles over the samples")
    kind.add_argument("--curve", type=int, metavar="N", help="N rows along the curve drawn through the points")
    one.set_defaults(work=commands.table)


def _plot(parsers: Parsers) -> None:
    one = parsers.add_parser("plot", help="results -> PNG, PDF, SVG: frequency responses, loops, contact map, modes")
    one.add_argument("results", nargs="+", metavar="result", help="result file; several are compared in one figure")
    one.add_argument("-o", "--output", help="picture to write, .png, .pdf or .svg (default: beside it, as frf.png)")
    one.add_argument("--monitor", help="monitor of the frequency response (default: the first)")
    one.add_argument(
        "--quantity",
        choices=[*QUANTITIES, "nyquist"],
        help="what of the monitor is drawn (default: amplitude, half the range over the period)",
    )
    one.add_argument("--level", type=_measured, nargs="+", metavar="LEVEL", help="levels that are drawn (default: all)")
    one.add_argument("--xlim", type=_measured, nargs=2, metavar=("LOW", "HIGH"), help="frequencies shown, Hz")
    scale = one.add_mutually_exclusive_group()
    scale.add_argument("--linear", dest="log", action="store_false", default=None, help="a linear axis from zero")
    scale.add_argument("--log", action="store_true", default=None, help="a logarithmic axis (default: if it suits)")
    one.add_argument(
        "--references",
        nargs="*",
        choices=REFERENCES,
        metavar="STATE",
        help=f"linear responses drawn behind, of {', '.join(REFERENCES)}; none with no word (default: all)",
    )
    one.add_argument(
        "--speed-hz",
        type=_speed,
        metavar="HZ",
        help="of a wheel's linear modes: speed whose engine orders are drawn (default: the job's, or a critical one)",
    )
    kind = one.add_mutually_exclusive_group()
    kind.add_argument("--loops", action="store_true", help="hysteresis loops of a point")
    kind.add_argument(
        "--map",
        nargs="?",
        const="slip",
        choices=["slip", "state", "energy", "pressure"],
        help="what the contacts of a point do, on their surface (default: slip)",
    )
    one.add_argument("--point", type=int, help="point of the loops or the map (default: the largest amplitude)")
    one.add_argument(
        "--contact", type=int, nargs="+", help="contacts of the loops (default: those that dissipate most)"
    )
    one.add_argument("--width", type=_measure, metavar="MM", help="of the figure, millimetres")
    one.add_argument("--height", type=_measure, metavar="MM", help="of the figure, millimetres")
    one.add_argument("--font", help="a font that is installed, as 'DejaVu Serif'")
    one.add_argument("--font-size", type=_measure, default=9.0, metavar="POINTS", help="default: 9")
    one.add_argument("--style", help="a style of matplotlib, as ggplot, or a file of one (.mplstyle)")
    one.add_argument("--dpi", type=_positive, help="of a .png (default: 220)")
    one.set_defaults(work=commands.plot)


def _report(parsers: Parsers) -> None:
    one = parsers.add_parser("report", help="result.h5 -> one HTML page with figures, verdicts and the job; or a PDF")
    one.add_argument("result", help="result file, or that of a study")
    one.add_argument("-o", "--output", help="page to write (default: beside it, as report.html, or report.pdf)")
    one.add_argument("--pdf", action="store_true", help="the essentials on two pages for the file, as PDF")
    one.add_argument("--point", type=int, help="point whose contacts are shown (default: the largest amplitude)")
    one.add_argument("--beside", help="of a study: another one of the same quantity, whose numbers stand beside")
    one.set_defaults(work=commands.report)


def _info(parsers: Parsers) -> None:
    one = parsers.add_parser("info", help="what a file of attrito holds, and how good a reduced model is")
    one.add_argument("file", help="model, reduced model, result, modes, peaks, study, ...")
    one.set_defaults(work=commands.info)


def _keys(parsers: Parsers) -> None:
    one = parsers.add_parser("keys", help="the keys of a job file: what each takes, its default, what it means")
    one.add_argument("table", nargs="?", help="one table, as sweep (default: all)")
    one.add_argument("--json-schema", action="store_true", help="all of them as JSON Schema, for editors of TOML")
    one.set_defaults(work=commands.keys)


def _verify(parsers: Parsers) -> None:
    one = parsers.add_parser(
        "verify", help="reproduce Zucca & Firrone 2014; try methods on thousands of scenes; step limits of integrators"
    )
    one.add_argument(
        "what",
        choices=["paper", "torture", "integrators"],
        help="the paper, methods on thousands of small scenes, or largest stable steps of integrators on some of these",
    )
    one.add_argument("-o", "--output", metavar="DIR", help="folder to write (default: out/paper, out/torture, ...)")
    one.add_argument("--harmonics", type=int, metavar="H", help="of the paper's balance (default: 5, as in the paper)")
    one.add_argument(
        "--quick", action="store_true", help="coarse curves, few scenes, and nothing that needs many harmonics"
    )
    one.add_argument(
        "--scenes", type=_positive, metavar="N", help="so many of the small scenes (default: all; integrators: 500)"
    )
    one.set_defaults(work=commands.verify)


def _export(parsers: Parsers) -> None:
    one = parsers.add_parser("export", help="motion of the whole structure -> VTU or XDMF; matrices of a model")
    one.add_argument("result", help="result file; with --matrices a model or a reduced model")
    one.add_argument(
        "-o", "--output", help="file to write (default: shape.vtu, ... beside the result); of matrices: base of names"
    )
    one.add_argument("--matrices", choices=MATRICES, help="matrices of model.h5 or rom.h5, with a table of dofs")
    one.add_argument("--model", metavar="FILE", help="with --matrices of rom.h5: its model (default: as its job says)")
    one.add_argument(
        "--points", "--point", type=_numbers, metavar="LIST", help="points, as 12,30 (default: the largest amplitude)"
    )
    one.add_argument(
        "--mode", type=_whole, metavar="N", help="of linear modes: the Nth; of a nonlinear mode: its point N"
    )
    one.add_argument("--monitor", help="monitor whose largest amplitude is meant (default: the first)")
    one.add_argument("--phases", type=_positive, metavar="N", help="instants of a period (default: coefficients, once)")
    one.add_argument("--format", choices=["vtu", "xdmf"], help="default: by the ending of -o, else vtu")
    one.add_argument(
        "--scale",
        type=_measured,
        help="draw the geometry displaced by this times the displacement (default: 0)",
    )
    one.add_argument("--wheel", action="store_true", help="all sectors of a wheel, of a job with [cyclic]")
    one.set_defaults(work=commands.export)


def _stress(parsers: Parsers) -> None:
    one = parsers.add_parser(
        "stress", help="stresses of a vibration, alternating and mean for a Goodman diagram -> CSV"
    )
    one.add_argument("result", help="result file, or one of modes")
    one.add_argument("-o", "--output", metavar="FILE", help="table to write (default: stress.csv beside the result)")
    one.add_argument("--vtu", metavar="FILE", help="the field on the mesh, for ParaView")
    one.add_argument("--wheel", action="store_true", help="with --vtu: all sectors of a wheel")
    one.add_argument(
        "--picture", metavar="FILE", help="alternating stress on the mesh, and a Goodman diagram; .png, .pdf or .svg"
    )
    one.add_argument("--set", nargs="+", metavar="NAME", help="node sets (default: all nodes of solid elements)")
    one.add_argument(
        "--points", "--point", type=_numbers, metavar="LIST", help="points, as 12,30 (default: the largest amplitude)"
    )
    one.add_argument(
        "--mode", type=_whole, metavar="N", help="of linear modes: the Nth; of a nonlinear mode: its point N"
    )
    one.add_argument("--monitor", help="monitor whose largest amplitude is meant (default: the first)")
    one.add_argument(
        "--fatigue-strength",
        type=_measured,
        metavar="S",
        help="under stress that alternates about zero, for a column goodman: stresses over strengths",
    )
    one.add_argument("--tensile-strength", type=_measured, metavar="S", help="where the alternating stress may be zero")
    one.add_argument("--strain", action="store_true", help="columns of strains, too")
    one.add_argument("--young", type=_measured, metavar="E", help="Young's modulus of elements whose deck gives none")
    one.add_argument("--poisson", type=_measured, metavar="NU", help="their Poisson's ratio")
    one.add_argument(
        "--amplitude", type=_measured, metavar="Q", help="of a linear mode, whose modal mass is 1 (default: 1)"
    )
    one.set_defaults(work=commands.stress)


def _numbers(text: str) -> list[int]:
    try:
        return list(dict.fromkeys(int(word) for word in text.split(",")))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}: expected numbers with commas between") from None


def _positive(text: str) -> int:
    if not text.isdecimal() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a number of at least 1")
    return int(text)


def _whole(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r}: expected a whole number")
    return int(text)


def _measure(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value <= 2000.0:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a number above 0, at most 2000")
    return value


def _measured(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if value in (float("inf"), float("-inf")) or value != value:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a number")
    return value


def _speed(text: str) -> float:
    try:
        speed = float(text)
    except ValueError:
        speed = 0.0
    if not 0.0 < speed < float("inf"):
        raise argparse.ArgumentTypeError(f"{text!r}: expected a speed in Hz above 0")
    return speed


def _seconds(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = 0.0
    if not 0.0 < seconds < float("inf"):
        raise argparse.ArgumentTypeError(f"{text!r}: expected a number of seconds above 0")
    return seconds
