"""The command `attrito`.

Exit codes: 0 done; 1 the numerics did not deliver (the file says where); 2 the input is at fault.
"""

from __future__ import annotations

import argparse
import os
import sys
import traceback
from collections.abc import Sequence

from attrito import __version__
from attrito.faults import Fault, InputError, NumericsError, unusable_file

# Ranks share the work; threads of BLAS would fight them. To be said before numpy and the library load BLAS.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code."""
    options = _parser().parse_args(arguments)
    parallel = options.command in ("run", "reduce", "peak", "study", "integrate", "export", "verify")
    try:
        options.work(options)
        sys.stdout.flush()
    except InputError as error:
        # What the library found names no file.
        place = f"{options.job}: " if "job" in options and not error.faults else ""
        return _tell(f"{place}{error}", 2, parallel)
    except NumericsError as error:
        return _tell(f"{options.job}: {error}" if "job" in options else str(error), 1, parallel)
    except BrokenPipeError:
        sys.stderr.close()
        return 0
    except KeyboardInterrupt:
        print("attrito: interrupted", file=sys.stderr)
        return 130
    except OSError as error:
        # Of this rank alone, as where its output goes to a disk that is full.
        print(f"attrito: {unusable_file(error)}", file=sys.stderr, flush=True)
        _forget_output()
        if parallel:
            _abort(2)
        return 2
    except Exception:
        if parallel:
            _abort(1)
        raise
    return 0


def _tell(message: str, code: int, parallel: bool) -> int:
    """Print a message once; every rank has raised the same one."""
    rank = 0
    if parallel:
        from mpi4py import MPI

        rank = MPI.COMM_WORLD.rank
        sys.stdout.flush()
    if rank == 0:
        print(f"attrito: {message}", file=sys.stderr, flush=True)
    return code


def _abort(code: int) -> None:
    """An error on one rank that others do not know of ends all of them."""
    from mpi4py import MPI

    if MPI.COMM_WORLD.size > 1:
        if code == 1:
            traceback.print_exc()
        MPI.COMM_WORLD.Abort(code)


def _forget_output() -> None:
    """What standard output does not take is not tried again when Python ends."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="attrito", description="The steady vibration of finite-element structures that rub."
    )
    parser.add_argument("--version", action="version", version=f"attrito {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="command")

    one = commands.add_parser("import", help="matrices and mesh of another program -> model.h5")
    one.add_argument("output", help="model file to write")
    one.add_argument("--calculix", metavar="JOB", help="CalculiX's JOB.sti, JOB.mas and JOB.dof")
    one.add_argument("--abaqus", metavar="JOB", help="Abaqus's JOB_STIF1.mtx, JOB_MASS1.mtx (and JOB_DMPV1.mtx)")
    one.add_argument("--nastran", metavar="FILE", help="Nastran's punch (DMIG) or OUTPUT4 file with K..., M..., B...")
    one.add_argument("--mesh", help="nodes, elements, node sets: .inp, ANSYS archive (.cdb), Nastran bulk data (.bdf)")
    for name in ("stiffness", "mass", "damping"):
        what = "Matrix Market, PETSc, npz, .mat, Harwell-Boeing, .mtx of Abaqus, DMIG, OUTPUT4"
        one.add_argument(f"--{name}", metavar="FILE[:NAME]", help=f"{name} matrix: {what}")
    one.add_argument(
        "--dofs", metavar="FILE", help="what each row is: lines node.direction, ANSYS's mapping file, or ASET cards"
    )
    one.add_argument(
        "--holds",
        metavar="NAMES",
        default="",
        help="what the stiffness holds already: stress_stiffening, spin_softening, or both with a comma",
    )
    one.add_argument("--spin-hz", type=float, help="speed of the rotation that this comes from, Hz")
    one.add_argument("--geometric-stiffness", metavar="FILE", help="stress stiffening, to be added to the stiffness")
    one.set_defaults(work=_import)

    one = commands.add_parser("reduce", help="the job's model -> rom.h5 (attrito run does it too)")
    one.add_argument("job", help="job file (TOML)")
    one.set_defaults(work=_reduce)

    one = commands.add_parser("run", help="a job -> result.h5")
    one.add_argument("job", help="job file (TOML)")
    one.add_argument("--resume", action="store_true", help="go on after the last point of a run that was cut short")
    one.add_argument(
        "--max-seconds",
        type=_seconds,
        metavar="S",
        help="stop before this wall time, after a whole point (exit code 1)",
    )
    one.set_defaults(work=_run)

    one = commands.add_parser("chart", help="error against cost of all ways to solve a job's scene -> CSV, HDF5, PNG")
    one.add_argument("job", help="job file (TOML)")
    one.add_argument("-o", "--output", default="chart.h5", help="data (default: chart.h5); the picture goes beside it")
    one.add_argument(
        "--seconds", type=float, default=20.0, help="a series ends where a run of it takes longer (default: 20)"
    )
    one.set_defaults(work=_chart)

    one = commands.add_parser("peak", help="a resonance peak followed in the level or preload -> HDF5, table, picture")
    one.add_argument("job", help="job file (TOML) with a table [peak]")
    one.add_argument("-o", "--output", help="picture to write (default: the file of peaks, ending .png)")
    one.set_defaults(work=_peak)

    one = commands.add_parser("study", help="the peaks of a job for many values of its keys -> HDF5 and picture")
    one.add_argument("study", help="study file (TOML)")
    one.set_defaults(work=_study)

    one = commands.add_parser("integrate", help="a job integrated in time -> group /integration of its output file")
    one.add_argument("job", help="job file (TOML)")
    one.set_defaults(work=_integrate)

    one = commands.add_parser("table", help="result.h5 -> CSV on standard output")
    one.add_argument("result", help="result file")
    kind = one.add_mutually_exclusive_group()
    kind.add_argument("--contacts", action="store_true", help="a row a point and contact")
    kind.add_argument("--multipliers", action="store_true", help="a row a point and Floquet multiplier")
    kind.add_argument("--bifurcations", action="store_true", help="a row a turning point or crossing multiplier")
    one.set_defaults(work=_table)

    one = commands.add_parser("plot", help="result.h5 -> PNG, PDF, SVG: frequency response, loops or contact map")
    one.add_argument("result", help="result file")
    one.add_argument(
        "-o",
        "--output",
        help="picture to write, .png, .pdf or .svg (default: frf.png, loops.png or contacts.png beside it)",
    )
    one.add_argument("--monitor", help="monitor of the frequency response (default: the first)")
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
    one.add_argument("--dpi", type=_positive, default=220, help="of a .png (default: 220)")
    one.set_defaults(work=_plot)

    one = commands.add_parser("report", help="result.h5 -> one HTML page with figures, verdicts and the job")
    one.add_argument("result", help="result file")
    one.add_argument("-o", "--output", help="page to write (default: report.html beside the result)")
    one.add_argument("--point", type=int, help="point whose contacts are shown (default: the largest amplitude)")
    one.set_defaults(work=_report)

    one = commands.add_parser("info", help="what a model.h5 or rom.h5 holds, and how good a reduced model is")
    one.add_argument("file", help="model or reduced model")
    one.set_defaults(work=_info)

    one = commands.add_parser("keys", help="the keys of a job file: what each takes, its default, what it means")
    one.add_argument("table", nargs="?", help="one table, as sweep (default: all)")
    one.set_defaults(work=_keys)

    one = commands.add_parser("verify", help="reproduce Zucca & Firrone 2014: figures, data, and a table of numbers")
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
    one.set_defaults(work=_verify)

    one = commands.add_parser("export", help="motion of the whole structure at points -> VTU or XDMF, animated")
    one.add_argument("result", help="result file")
    one.add_argument("-o", "--output", help="file to write (default: shape.vtu, shape.xdmf, ... beside the result)")
    one.add_argument(
        "--points", "--point", type=_numbers, metavar="LIST", help="points, as 12,30 (default: the largest amplitude)"
    )
    one.add_argument("--monitor", help="monitor whose largest amplitude is meant (default: the first)")
    one.add_argument("--phases", type=_positive, metavar="N", help="instants of a period (default: coefficients, once)")
    one.add_argument("--format", choices=["vtu", "xdmf"], default="vtu", help="default: vtu")
    one.add_argument(
        "--scale",
        type=float,
        default=0.0,
        help="draw the geometry displaced by this times the displacement (default: 0)",
    )
    one.set_defaults(work=_export)
    return parser


def _import(options: argparse.Namespace) -> None:
    from attrito.importers import import_model

    _, notes = import_model(
        options.output,
        calculix_job=options.calculix,
        abaqus_job=options.abaqus,
        nastran_file=options.nastran,
        mesh=options.mesh,
        stiffness=options.stiffness,
        mass=options.mass,
        damping=options.damping,
        dofs=options.dofs,
        holds=[name.strip() for name in options.holds.split(",") if name.strip()],
        spin_hz=options.spin_hz,
        geometric_stiffness=options.geometric_stiffness,
    )
    print("\n".join([f"{options.output}:", *(f"  {note}" for note in notes)]))


def _reduce(options: argparse.Namespace) -> None:
    from mpi4py import MPI

    from attrito.running import reduce_job

    reduce_job(MPI.COMM_WORLD, options.job)


def _run(options: argparse.Namespace) -> None:
    from mpi4py import MPI

    from attrito.running import run_job

    run_job(MPI.COMM_WORLD, options.job, options.resume, options.max_seconds)


def _chart(options: argparse.Namespace) -> None:
    from pathlib import Path

    from attrito.chart import chart_job
    from attrito.chart_file import table, write
    from attrito.chart_picture import picture
    from attrito.job import files_read, read_job
    from attrito.overwriting import check_spared
    from attrito.plots import save

    picture_path = str(Path(options.output).with_suffix(".png"))
    check_spared("chart", "-o", [options.output, picture_path], files_read(read_job(options.job)))
    found = chart_job(options.job, options.seconds, lambda text: print(text, file=sys.stderr, flush=True))
    write(found, options.output, str(Path(options.job).resolve()))
    save(picture(found), picture_path)
    sys.stdout.write(table(found))


def _peak(options: argparse.Namespace) -> None:
    from mpi4py import MPI

    from attrito.peaking import peak_job

    peak_job(MPI.COMM_WORLD, options.job, options.output)


def _study(options: argparse.Namespace) -> None:
    from mpi4py import MPI

    from attrito.studying import run_study

    run_study(MPI.COMM_WORLD, options.study)


def _integrate(options: argparse.Namespace) -> None:
    from mpi4py import MPI

    from attrito.integrating import integrate_job

    integrate_job(MPI.COMM_WORLD, options.job)


def _table(options: argparse.Namespace) -> None:
    from attrito.results import Result, bifurcation_table, contact_table, multiplier_table, table

    kinds = {"contacts": contact_table, "multipliers": multiplier_table, "bifurcations": bifurcation_table}
    kind = next((work for name, work in kinds.items() if getattr(options, name)), table)
    with Result(options.result) as result:
        sys.stdout.write(kind(result))


def _plot(options: argparse.Namespace) -> None:
    from attrito import contact_plots, plots
    from attrito.loops import contact_loops, most_dissipating
    from attrito.results import Result

    look = plots.Look(options.width, options.height, options.font, options.font_size)
    with Result(options.result) as result:
        monitor = _monitor(result, options)
        if options.loops:
            point = _point(result, options, monitor)
            chosen = options.contact or most_dissipating(result, point)
            units = [result.unit(f"/contacts/{name}") for name in ("displacement", "force")]
            figure = contact_plots.hysteresis(contact_loops(result, point, chosen), *units, look=look)
            name = "loops.png"
        elif options.map:
            point = _point(result, options, monitor)
            figure, name = contact_plots.contact_map(result, point, options.map, look), "contacts.png"
        else:
            figure, name = plots.frequency_response(result, monitor, look=look), "frf.png"
        path = options.output or _beside(options.result, name)
        plots.save(figure, path, options.dpi)
    print(path)


def _report(options: argparse.Namespace) -> None:
    from attrito.report import write_report
    from attrito.results import Result

    path = options.output or _beside(options.result, "report.html")
    with Result(options.result) as result:
        point = None if options.point is None else _point(result, options, "")
        write_report(result, path, point)
    print(path)


def _export(options: argparse.Namespace) -> None:
    from mpi4py import MPI

    from attrito.export import Options, export_point
    from attrito.model_file import read_model
    from attrito.parallel import everywhere
    from attrito.results import Result

    comm = MPI.COMM_WORLD
    how = Options(options.phases, options.format, options.scale)
    with everywhere(comm, lambda: Result(options.result)) as result:
        points = everywhere(comm, lambda: _points(result, options))
        name = result.attribute("model_file")
        if not name:
            raise InputError(Fault(options.result, "model_file", "none", "a result of a model with a mesh"))
        model = everywhere(comm, lambda: read_model(name, matrices=False))
        rom = result.attribute("rom_file") or None
        path = options.output or _beside(options.result, "shape.vtu")
        for point in points:
            place = path if len(points) == 1 else _numbered(path, point)
            written, notes = export_point(result, point, model, place, rom, how, comm)
            if comm.rank == 0:
                print("\n".join([written, *(f"  {note}" for note in notes)]))


def _info(options: argparse.Namespace) -> None:
    from attrito.info import describe

    print("\n".join(describe(options.file)))


def _keys(options: argparse.Namespace) -> None:
    from attrito.job_reference import as_text, tables

    if options.table is not None and options.table not in tables():
        raise InputError(Fault("keys", "table", options.table, "one of " + ", ".join(tables())))
    print(as_text(options.table))


def _verify(options: argparse.Namespace) -> None:
    without = "scenes" if options.what == "paper" else "harmonics"
    if getattr(options, without) is not None:
        raise InputError(Fault("verify", f"--{without}", getattr(options, without), f"none with {options.what!r}"))
    if options.what == "torture":
        from mpi4py import MPI

        from attrito.verify.torture import QUICK_SCENES, verify_torture

        scenes = options.scenes or (QUICK_SCENES if options.quick else None)
        verify_torture(MPI.COMM_WORLD, options.output or "out/torture", scenes)
        return
    if options.what == "integrators":
        from mpi4py import MPI

        from attrito.verify.torture.integrators import QUICK, verify_integrators

        scenes = options.scenes or (QUICK if options.quick else None)
        verify_integrators(MPI.COMM_WORLD, options.output or "out/integrators", scenes)
        return
    from attrito.verify import verify_paper

    harmonics = 5 if options.harmonics is None else options.harmonics
    if harmonics < 1:
        raise InputError(Fault("verify", "--harmonics", harmonics, "at least 1"))
    verify_paper(options.output or "out/paper", harmonics, options.quick)


def _monitor(result, options: argparse.Namespace) -> str:
    chosen = getattr(options, "monitor", None)
    if chosen is not None and chosen not in result.monitors:
        raise InputError(Fault(options.result, "--monitor", chosen, "one of " + ", ".join(result.monitors)))
    return chosen or result.monitors[0]


def _point(result, options: argparse.Namespace, monitor: str) -> int:
    """The chosen point, or that of the largest amplitude."""
    import numpy as np

    if options.point is not None:
        result.check_point(options.point)
        if not result.converged[options.point]:
            outcome = result.outcome[options.point]
            raise InputError(Fault(options.result, "--point", f"{options.point}, {outcome}", "a point with a solution"))
        return options.point
    amplitude = result.monitor(monitor, "amplitude")
    if not np.any(np.isfinite(amplitude)):
        raise InputError(Fault(options.result, "points", len(amplitude), "at least one converged point"))
    return int(np.nanargmax(amplitude))


def _points(result, options: argparse.Namespace) -> list[int]:
    """The chosen points, or that of the largest amplitude."""
    monitor = _monitor(result, options)
    if options.points is None:
        return [_point(result, argparse.Namespace(point=None, result=options.result), monitor)]
    return [_point(result, argparse.Namespace(point=point, result=options.result), monitor) for point in options.points]


def _numbers(text: str) -> list[int]:
    try:
        return list(dict.fromkeys(int(word) for word in text.split(",")))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}: expected numbers with commas between") from None


def _positive(text: str) -> int:
    if not text.isdecimal() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a number of at least 1")
    return int(text)


def _measure(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value <= 2000.0:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a number above 0, at most 2000")
    return value


def _seconds(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = 0.0
    if not 0.0 < seconds < float("inf"):
        raise argparse.ArgumentTypeError(f"{text!r}: expected a number of seconds above 0")
    return seconds


def _numbered(path: str, point: int) -> str:
    from pathlib import Path

    return str(Path(path).with_name(f"{Path(path).stem}_{point}{Path(path).suffix}"))


def _beside(result: str, name: str) -> str:
    from pathlib import Path

    return str(Path(result).with_name(name))


if __name__ == "__main__":
    sys.exit(main())
