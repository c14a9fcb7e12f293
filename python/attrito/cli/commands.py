"""What each command of `attrito` does with its options.

Modules are imported by the commands that need them, so that none waits for another's.
"""

from __future__ import annotations

import argparse
import glob
import importlib
import shlex
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from attrito.support.errors import Fault, InputError

if TYPE_CHECKING:
    from attrito.fits.design import Fit
    from attrito.job.job import Job
    from attrito.optima.design import Optimum
    from attrito.studies.design import Study


def import_matrices(options: argparse.Namespace) -> None:
    """Matrices and mesh of another program -> model.h5."""
    from attrito.importers import import_model
    from attrito.support.overwrite_check import check_files

    for job, ending in ((options.calculix, ".*"), (options.abaqus, "_*")):
        if job is not None:
            place = Path(job)
            check_files("import", "file", map(str, place.parent.glob(glob.escape(place.name) + ending)))
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


def reduce(options: argparse.Namespace) -> None:
    """The job's model -> rom.h5."""
    from mpi4py import MPI

    from attrito.runs.run import reduce_job

    reduce_job(MPI.COMM_WORLD, _job(options))


def run(options: argparse.Namespace) -> None:
    """A job -> result.h5."""
    from mpi4py import MPI

    from attrito.runs.run import run_job

    run_job(MPI.COMM_WORLD, _job(options), options.resume, options.max_seconds)


def chart(options: argparse.Namespace) -> None:
    """Error against cost of all ways to solve a job's scene -> CSV, HDF5, PNG."""
    from mpi4py import MPI

    from attrito.job.job import files_read
    from attrito.job.reading import read_job
    from attrito.support.locks import writing_alone
    from attrito.support.overwrite_check import check_spared

    picture_path = str(Path(options.output).with_suffix(".png"))
    paths = (options.job, *(options.contacts or []))
    jobs = [read_job(path, excited=not options.mode, settings=options.set) for path in paths]
    check_spared("chart", "-o", [options.output, picture_path], [file for job in jobs for file in files_read(job)])
    with writing_alone(MPI.COMM_SELF, options.output, makes_folder=False):
        _chart(options, *jobs, picture_path=picture_path)


def _chart(options: argparse.Namespace, job: Job, *others: Job, picture_path: str) -> None:
    from attrito.charts.contacts import chart_contacts
    from attrito.charts.file import Chart, table, write
    from attrito.charts.modes import chart_mode
    from attrito.charts.plot import picture
    from attrito.charts.run import chart_job
    from attrito.plots.style import save

    def say(text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    def keep(chart: Chart) -> None:
        """Write what there is: a chart that is ended can be read and drawn."""
        given = "".join(f" --set {shlex.quote(setting)}" for setting in options.set)
        write(chart, options.output, f"{Path(options.job).resolve()}{given}")

    if options.contacts is not None:
        found = chart_contacts(job, others, say)
    else:
        found = (chart_mode if options.mode else chart_job)(job, options.seconds, say, keep)
    keep(found)
    save(picture(found), picture_path)
    sys.stdout.write(table(found))


def peak(options: argparse.Namespace) -> None:
    """A resonance peak followed in the level or preload -> HDF5, table, picture."""
    from mpi4py import MPI

    from attrito.peaks.run import peak_job

    _check_output(options)
    peak_job(MPI.COMM_WORLD, _job(options), options.output)


def linear_modes(options: argparse.Namespace) -> None:
    """Modes of a linear system -> HDF5 and table."""
    from mpi4py import MPI

    from attrito.modes.linear import linear_modes_job

    linear_modes_job(MPI.COMM_WORLD, _job(options, excited=False), options.state, options.count)


def campbell(options: argparse.Namespace) -> None:
    """Tangent modes against the speed of rotation -> HDF5, picture."""
    from mpi4py import MPI

    from attrito.modes.campbell import campbell_job

    _check_output(options)
    campbell_job(MPI.COMM_WORLD, _job(options, excited=False), options.output)


def mode(options: argparse.Namespace) -> None:
    """A nonlinear mode -> HDF5, table, picture."""
    from mpi4py import MPI

    from attrito.modes.nonlinear import mode_job

    _check_output(options)
    mode_job(MPI.COMM_WORLD, _job(options, excited=False), options.output, options.resume)


def study(options: argparse.Namespace) -> None:
    """The peaks of a job for many values of its keys -> HDF5 and picture."""
    from mpi4py import MPI

    from attrito.studies.design import read_study
    from attrito.studies.run import run_study
    from attrito.support.parallel import on_root

    def read() -> Study:
        found = read_study(options.study)
        return replace(found, job=_set_in(options, found.job, found.is_excited))

    run_study(MPI.COMM_WORLD, on_root(MPI.COMM_WORLD, read))


def fit(options: argparse.Namespace) -> None:
    """Parameters of a job from measured responses and backbones -> HDF5 and picture."""
    from mpi4py import MPI

    from attrito.fits.design import read_fit
    from attrito.fits.run import run_fit
    from attrito.support.parallel import on_root

    def read() -> Fit:
        found = read_fit(options.fit)
        return replace(
            found, data=tuple(replace(one, job=_set_in(options, one.job, one.is_excited)) for one in found.data)
        )

    run_fit(MPI.COMM_WORLD, on_root(MPI.COMM_WORLD, read))


def optimise(options: argparse.Namespace) -> None:
    """Values of a job's keys at which its largest peak is least -> HDF5."""
    from mpi4py import MPI

    from attrito.optima.design import read_optimum
    from attrito.optima.run import run_optimum
    from attrito.support.parallel import on_root

    def read() -> Optimum:
        found = read_optimum(options.optimum)
        return replace(found, job=_set_in(options, found.job))

    run_optimum(MPI.COMM_WORLD, on_root(MPI.COMM_WORLD, read))


def _job(options: argparse.Namespace, excited: bool = True) -> str | Job:
    """The job file, or with `--set` the job that its values make."""
    from mpi4py import MPI

    from attrito.support.parallel import on_root

    return on_root(MPI.COMM_WORLD, lambda: _set_in(options, options.job, excited)) if options.set else options.job


def _set_in(options: argparse.Namespace, job: str, excited: bool = True) -> str | Job:
    """A job file, or with `--set` the job that its values make; on the root."""
    from attrito.job.reading import read_job

    return read_job(job, excited=excited, settings=options.set) if options.set else job


def _check_output(options: argparse.Namespace) -> None:
    """Refuse a picture that cannot be written before it is worked for."""
    from attrito.plots.style import check_picture

    if options.output is not None:
        check_picture(options.output)


def integrate(options: argparse.Namespace) -> None:
    """A job integrated in time -> group /integration of its output file."""
    from mpi4py import MPI

    from attrito.integration.run import integrate_job

    integrate_job(MPI.COMM_WORLD, _job(options))


def table(options: argparse.Namespace) -> None:
    """A result -> CSV on standard output, or into a file."""
    from attrito.cli.applies import TEXTS, check_ending
    from attrito.support.atomic_files import whole_file
    from attrito.support.overwrite_check import check_spared

    if options.output is None:
        sys.stdout.write(_table(options))
        return
    check_ending("table", options.output, TEXTS)
    check_spared("table", "-o", [options.output], [options.result])
    text = _table(options)
    try:
        with whole_file(options.output) as new:
            Path(new).write_text(text, encoding="utf-8")
    except OSError as error:
        expected = "a file that can be written"
        raise InputError(Fault(options.output, "table", error.strerror or str(error), expected)) from error
    print(options.output)


# What makes the table of a file of each format, imported by it alone: nobody who wants a table waits for pictures.
TABLE_OF = {
    "attrito peaks": "attrito.peaks.file:table",
    "attrito fit": "attrito.fits.table:table",
    "attrito optimum": "attrito.optima.table:table",
    "attrito chart": "attrito.charts.file:stored_table",
    "attrito study": "attrito.studies.table:table",
    "attrito linear modes": "attrito.modes.table:linear_table",
    "attrito mode": "attrito.modes.table:table",
    "attrito campbell diagram": "attrito.modes.table:campbell_table",
}


def _table(options: argparse.Namespace) -> str:
    """The text of a table."""
    from attrito.cli.applies import OF_TABLES, STUDY, check_table
    from attrito.results import tables
    from attrito.results.result import Result
    from attrito.support.hdf5_reading import format_of

    kinds = {
        "contacts": tables.contact_table,
        "sets": tables.set_table,
        "multipliers": tables.multiplier_table,
        "sensitivities": tables.sensitivity_table,
        "bifurcations": tables.bifurcation_table,
    }
    asked = next((name for name in kinds if getattr(options, name)), None)
    if options.columns and (asked or options.curve is not None):
        raise InputError(Fault("table", "--columns", ", ".join(options.columns), "the table of points"))
    form = format_of(options.result)
    if form in TABLE_OF and (form == STUDY or form not in OF_TABLES):
        check_table(options, form if form in OF_TABLES else None)
        return _maker(form, options.bands)(options.result)
    with Result(options.result) as result:
        # A journal has the format of what it is going to be.
        form = result.attribute("format")
        check_table(options, form)
        if options.curve is not None:
            return tables.curve_table(result, options.curve)
        if asked is not None:
            return kinds[asked](result)
        return _maker(form)(result) if form in TABLE_OF else tables.table(result, options.columns or ())


def _maker(form: str, bands: bool = False) -> Callable[..., str]:
    """What makes the table of files of a format, or a study's table of bands."""
    module, name = TABLE_OF[form].split(":")
    made: Callable[..., str] = getattr(importlib.import_module(module), "band_table" if bands else name)
    return made


def plot(options: argparse.Namespace) -> None:
    """Results -> picture of their frequency responses, of loops, or contacts."""
    from attrito.pictures import Wishes, draw
    from attrito.plots import style
    from attrito.plots.labels import distinct_names

    if options.output is not None:
        style.check_picture(options.output)
        if options.dpi and not options.output.lower().endswith(".png"):
            raise InputError(Fault("plot", "--dpi", options.dpi, "a picture ending .png"))
    look = style.Look(options.width, options.height, options.font, options.font_size, options.style)
    names = (
        "monitor",
        "quantity",
        "level",
        "xlim",
        "log",
        "references",
        "speed_hz",
        "loops",
        "map",
        "point",
        "contact",
    )
    figure, name = draw(options.results, Wishes(**{name: getattr(options, name) for name in names}), look)
    stem = "_".join(distinct_names(options.results)) if len(options.results) > 1 else None
    path = options.output or _beside(options.results[0], name, stem)
    style.save(figure, path, options.dpi or style.DPI)
    print(path)


def report(options: argparse.Namespace) -> None:
    """A result -> one HTML page, or two pages of PDF."""
    from attrito.cli.applies import check_ending
    from attrito.pictures import refuse_linear_modes
    from attrito.report.report import is_printout, write_report
    from attrito.results.chosen_points import chosen_point
    from attrito.results.result import Result
    from attrito.studies.report import write_study_report
    from attrito.studies.table import holds_study

    if options.pdf and options.output and not is_printout(options.output):
        raise InputError(Fault("report", "-o", options.output, "a name that ends in .pdf, with --pdf"))
    if options.output is not None:
        check_ending("report", options.output, (".html", ".htm", ".pdf"))
    path = options.output or _beside(options.result, "report.pdf" if options.pdf else "report.html")
    if holds_study(options.result):
        if options.point is not None:
            raise InputError(Fault(options.result, "--point", options.point, "none for a study"))
        write_study_report(options.result, path, options.beside)
        print(path)
        return
    if options.beside is not None:
        raise InputError(Fault(options.result, "--beside", options.beside, "a file of `attrito study` to stand beside"))
    with Result(options.result) as result:
        refuse_linear_modes(result)
        point = None if options.point is None else chosen_point(result, options.point, "")
        write_report(result, path, point)
    print(path)


def export(options: argparse.Namespace) -> None:
    """Motion of the whole structure at points of a result -> VTU or XDMF; or matrices of a model."""
    from mpi4py import MPI

    from attrito.cli.applies import check_export

    check_export(options)
    if options.matrices:
        _export_matrices(options)
        return

    from attrito.export.export import Options, export_point
    from attrito.model.model_file import read_model
    from attrito.results.chosen_points import chosen_points
    from attrito.results.result import Result
    from attrito.support.parallel import everywhere

    comm = MPI.COMM_WORLD
    ending = "xdmf" if str(options.output).endswith(".xdmf") else "vtu"
    how = Options(options.phases, options.format or ending, options.scale or 0.0, options.wheel)
    with everywhere(comm, lambda: Result(options.result)) as result:
        points = everywhere(comm, lambda: chosen_points(result, options.points, options.mode, options.monitor))
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


def stress(options: argparse.Namespace) -> None:
    """Stress cycles at nodes -> CSV, and VTU if asked for, by the first rank."""
    from mpi4py import MPI

    from attrito.stresses.run import Wanted, write_stresses
    from attrito.support.parallel import on_root

    wanted = Wanted(
        sets=tuple(options.set or ()),
        young=options.young,
        poisson=options.poisson,
        amplitude=options.amplitude,
        points=options.points,
        mode=options.mode,
        monitor=options.monitor,
        strain=options.strain,
        fatigue_strength=options.fatigue_strength,
        tensile_strength=options.tensile_strength,
    )
    path = options.output or _beside(options.result, "stress.csv")

    def write() -> None:
        print("\n".join(write_stresses(options.result, path, wanted, options.vtu, options.wheel, options.picture)))

    on_root(MPI.COMM_WORLD, write)


def _export_matrices(options: argparse.Namespace) -> None:
    """Matrices of a model or a reduced model, by the first rank."""
    from mpi4py import MPI

    from attrito.export.matrices import export_matrices
    from attrito.support.parallel import on_root

    def write() -> None:
        print("\n".join(export_matrices(options.result, options.matrices, options.output, options.model)))

    on_root(MPI.COMM_WORLD, write)


def info(options: argparse.Namespace) -> None:
    """What a model or a reduced model holds."""
    from attrito.results.info import describe

    print("\n".join(describe(options.file)))


def keys(options: argparse.Namespace) -> None:
    """The keys of a job file."""
    from attrito.job.reference import as_text, tables

    if options.table is not None and options.table not in tables():
        raise InputError(Fault("keys", "table", options.table, "one of " + ", ".join(tables())))
    if options.json_schema:
        from attrito.job.json_schema import as_json_schema

        print(as_json_schema(), end="")
        return
    print(as_text(options.table))


def verify(options: argparse.Namespace) -> None:
    """The paper reproduced, methods on small scenes, or largest stable steps."""
    without = "scenes" if options.what == "paper" else "harmonics"
    if getattr(options, without) is not None:
        raise InputError(Fault("verify", f"--{without}", getattr(options, without), f"none with {options.what!r}"))
    if options.what == "torture":
        from mpi4py import MPI

        from attrito_verification.scene_grid import QUICK_SCENES, verify_torture

        scenes = options.scenes or (QUICK_SCENES if options.quick else None)
        verify_torture(MPI.COMM_WORLD, options.output or "out/torture", scenes)
        return
    if options.what == "integrators":
        from mpi4py import MPI

        from attrito_verification.scene_grid.integrators import QUICK, verify_integrators

        scenes = options.scenes or (QUICK if options.quick else None)
        verify_integrators(MPI.COMM_WORLD, options.output or "out/integrators", scenes)
        return
    from attrito_verification.paper import verify_paper

    harmonics = 5 if options.harmonics is None else options.harmonics
    if harmonics < 1:
        raise InputError(Fault("verify", "--harmonics", harmonics, "at least 1"))
    verify_paper(options.output or "out/paper", harmonics, options.quick)


def _numbered(path: str, point: int) -> str:
    return str(Path(path).with_name(f"{Path(path).stem}_{point}{Path(path).suffix}"))


def _beside(result: str, name: str, stem: str | None = None) -> str:
    """A file beside a result: of `result.h5` as it is called, of any other with that one's name before it."""
    stem = stem or Path(result).name.partition(".h5")[0]
    if stem == "result":
        return str(Path(result).with_name(name))
    # `blade.mode.h5` has `blade.mode.png`.
    base, _, ending = name.rpartition(".")
    return str(Path(result).with_name(f"{stem}.{ending}" if f".{stem}".endswith(f".{base}") else f"{stem}.{name}"))
