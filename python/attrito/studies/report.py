"""`attrito report` of a study: one page, or two of A4, of what its samples have in common, and how far to trust it.

Another study of the same job may stand beside it, as one whose samples are solved beside one by gradients.
"""

from __future__ import annotations

import os
from collections.abc import Iterator

import numpy as np

from attrito.plots.style import Look
from attrito.report import sections
from attrito.report.page import Page
from attrito.report.printout import Printout
from attrito.report.report import is_printout, made_by, title_of, write_page
from attrito.studies.picture import picture_of_file
from attrito.studies.statistics import ACCEPTED
from attrito.studies.summary import Bands, Summary, read_summary
from attrito.support.errors import Fault, InputError
from attrito.support.overwrite_check import check_spared

LOOK = Look(font_size=10.0)
# Values of the parameter in a table, spread over all there are
MOST_ROWS = 12
# What numbers and values of the parameter are called
NUMBERS = {"amplitude": "Amplitude", "frequency_hz": "Frequency, Hz", "damping_ratio": "Damping ratio of the contacts"}
PLACES = {"level": "level {:g}", "preload": "preload {:g}", "amplitude": "Q = {:.4g}", "frequency_hz": "{:.6g} Hz"}
WHAT = {"peaks": "resonance peak", "response": "frequency response", "modes": "nonlinear mode"}
# Of a normal distribution: between minus and plus this many deviations are 95 %
NORMAL_95 = 1.96


def write_study_report(
    path: str | os.PathLike[str], output: str | os.PathLike[str], beside: str | os.PathLike[str] | None = None
) -> None:
    """Write the page of a study, or its essentials on two pages of A4.

    Parameters
    ----------
    path : file of a study
    output : the file to write, .html, or .pdf for the two pages
    beside : file of another study of the same quantity, whose numbers stand beside

    Raises
    ------
    InputError : a file is not that of a study, or cannot be written
    """
    read = [path] if beside is None else [path, beside]
    check_spared("report", "-o", [output], read)
    summary, *others = (read_summary(str(one)) for one in read)
    other = others[0] if others else None
    if other is not None and (other.of, other.parameter, *other.bands) != (
        summary.of,
        summary.parameter,
        *summary.bands,
    ):
        expected = f"a study of = {summary.of!r} over {summary.parameter}, as {summary.path}"
        raise InputError(Fault(other.path, "of", f"{other.of} over {other.parameter}", expected))
    if is_printout(output):
        _printout(summary, other).write(output)
    else:
        write_page(study_page(summary, other), output)


def study_page(summary: Summary, other: Summary | None = None) -> Page:
    """The page; see `write_study_report`."""
    page = Page(title_of(summary.path))
    page.head(made_by("A study of vibration", summary.path, summary.attribute("attrito_version")))
    page.glance([(line, False) for line in outcome(summary)])
    page.section("How far to trust it")
    page.labelled(trust(summary))
    page.section("Samples")
    page.figures([(picture_of_file(one.path, LOOK), _caption(one)) for one in _both(summary, other)])
    page.subsection("Distribution")
    page.table(*distribution(summary, other))
    rest = "" if len(_rows(summary)) == len(summary.at) else "`attrito table --bands` has all rows. "
    page.text(f"{rest}Deviation: the standard deviation. {_units(summary)}")
    page.subsection("What is varied")
    page.table(*varied(summary))
    page.text("Rank correlation: 1 or -1 where the number rises or falls with the quantity whatever the others are.")
    sections.job(page, summary)
    sections.references(page, summary)
    return page


def _printout(summary: Summary, other: Summary | None) -> Printout:
    printout = Printout(
        title_of(summary.path), made_by("A study of vibration", summary.path, summary.attribute("attrito_version"))
    )
    for line in outcome(summary):
        printout.text(0, line)
    printout.heading(0, "How far to trust it")
    for about, line, warn in trust(summary):
        printout.text(0, f"{about}: {line}", warn)
    for one in _both(summary, other):
        printout.panel(0, one.design, lambda look, path=one.path: picture_of_file(path, look))
    for heading, (header, rows) in (
        ("Distribution", distribution(summary, other)),
        ("What is varied", varied(summary)),
    ):
        printout.heading(1, heading)
        for row in rows:
            printout.text(1, "; ".join(f"{name} {value}" for name, value in zip(header, row, strict=True) if value))
    return printout


def outcome(summary: Summary) -> list[str]:
    """What came out, a sentence a number and place."""
    design = f"from {_count(summary)}, {summary.design}"
    lines = [f"The {WHAT[summary.of]} of {summary.samples} samples, {design}."]
    for name, bands in summary.bands.items():
        for place in _leading(summary):
            low, high = bands.quantiles[0, place], bands.quantiles[-1, place]
            part = 100.0 * (summary.probabilities[-1] - summary.probabilities[0])
            spread = bands.deviation[place] / abs(bands.mean[place]) if bands.mean[place] else np.nan
            where = PLACES.get(summary.parameter, "{:g}").format(summary.at[place])
            lines.append(
                f"{NUMBERS.get(name, name)} at {where}: mean {_number(bands.mean[place])}, standard deviation"
                f" {100.0 * spread:.3g} % of it; {part:.0f} % of the samples from {_number(low)} to {_number(high)}."
            )
    return lines


def trust(summary: Summary) -> list[tuple[str, str, bool]]:
    """How far to trust it: what about, a sentence, and whether it is a warning."""
    lost = summary.outcomes["not_converged"]
    ended = ", ".join(f"{count} {name}" for name, count in summary.outcomes.most_common())
    lines = [("Solved", f"{ended}.", lost > 0)]
    if summary.is_modelled:
        lines += [("Model", line, warn) for line, warn in _model_errors(summary)]
    elif summary.design != "grid":
        lines += [("Samples", line, False) for line in _sampling_errors(summary)]
    if summary.methods and not summary.is_modelled:
        found = ", ".join(f"{count} {name}" for name, count in summary.methods.most_common())
        lines.append(("Found", f"{found} (near the sample before, from the linear peak, by a sweep).", False))
    lines += [
        ("Warnings", f"{line[:1].upper()}{line[1:]}.", True) for line in summary.attribute("warnings").splitlines()
    ]
    return lines


def _model_errors(summary: Summary) -> Iterator[tuple[str, bool]]:
    """Of each number whose model was compared with solved samples."""
    known = {name: bands.error for name, bands in summary.bands.items() if bands.error is not None}
    if not known:
        yield "How far the model is from solved samples is not in the file.", True
    for name, error in known.items():
        worst = int(np.argmax(np.nan_to_num(error, nan=np.inf)))
        beyond = not error[worst] <= ACCEPTED
        where = PLACES.get(summary.parameter, "{:g}").format(summary.at[worst])
        words = f"{NUMBERS.get(name, name)} within {100.0 * error[worst]:.2g} % of other solved samples, at {where}"
        yield f"{words}{': it does not hold there' if beyond else ''}.", beyond


def _sampling_errors(summary: Summary) -> Iterator[str]:
    """The mean's own error from the number of samples, where it is largest."""
    for name, bands in summary.bands.items():
        count = np.isfinite(bands.samples).sum(axis=0)
        with np.errstate(invalid="ignore", divide="ignore"):
            error = NORMAL_95 * bands.deviation / np.sqrt(count) / np.abs(bands.mean)
        if np.isfinite(error).any():
            bound = " at most" if summary.design == "latin hypercube" else ""
            largest = 100.0 * np.nanmax(error)
            yield f"{NUMBERS.get(name, name)}: the mean is known to{bound} {largest:.2g} % (95 %) from so many."


def distribution(summary: Summary, other: Summary | None = None) -> tuple[list[str], list[list[str]]]:
    """Header and rows: mean, deviation and quantiles by number and value of the parameter."""
    quantiles = [f"{100.0 * part:g} %" for part in summary.probabilities]
    header = ["number", summary.parameter.replace("frequency_hz", "Hz"), "design", "mean", "deviation", *quantiles]
    rows = []
    for name, bands in summary.bands.items():
        for place in _rows(summary):
            start = [NUMBERS.get(name, name), f"{summary.at[place]:.6g}"]
            own = _statistics(bands, float(summary.at[place]), summary)
            rows.append([*start, summary.design, *map(_number, own)])
            if other is None:
                continue
            beside = _statistics(other.bands[name], float(summary.at[place]), other)
            with np.errstate(invalid="ignore", divide="ignore"):
                differences = 100.0 * (own / beside - 1.0)
            rows.append([*start, other.design, *map(_number, beside)])
            rows.append([*start, "difference, %", *(f"{value:+.2g}" for value in differences)])
    return header, rows


def varied(summary: Summary) -> tuple[list[str], list[list[str]]]:
    """Header and rows: each quantity, its range, and how numbers go with it where they vary most."""
    header, rows = ["quantity", "keys", "from", "to"], []
    for name in summary.bands:
        at = PLACES.get(summary.parameter, "{:g}").format(summary.at[_widest(summary, name)])
        header.append(f"rank correlation with {NUMBERS.get(name, name).partition(',')[0].lower()}, {at}")
    keys = {vary["name"]: ", ".join(vary["keys"]) for vary in summary.study.get("vary", [])}
    for quantity, values in summary.values.items():
        columns = [bands.samples[:, _widest(summary, name)] for name, bands in summary.bands.items()]
        correlations = [f"{_rank_correlation(values, column):+.2f}" for column in columns]
        rows.append([quantity, keys.get(quantity, ""), _number(values.min()), _number(values.max()), *correlations])
    return header, rows


def _statistics(bands: Bands, at: float, summary: Summary) -> np.ndarray:
    """Mean, deviation and quantiles at a value of the parameter, between those of the file where it has others."""
    order = np.argsort(summary.at)
    rows = np.vstack([bands.mean, bands.deviation, bands.quantiles])[:, order]
    return np.array([np.interp(at, summary.at[order], row, left=np.nan, right=np.nan) for row in rows])


def _rank_correlation(one: np.ndarray, other: np.ndarray) -> float:
    """Spearman's, of samples that have both."""
    known = np.isfinite(one) & np.isfinite(other)
    ranks = [np.argsort(np.argsort(values[known])) for values in (one, other)]
    if known.sum() < 2 or any(np.ptp(values[known]) == 0.0 for values in (one, other)):
        return float("nan")
    return float(np.corrcoef(*ranks)[0, 1])


def _leading(summary: Summary) -> list[int]:
    """Places that are spoken of: of a response where its mean is largest, else the ends."""
    if summary.of == "response":
        mean = summary.bands["amplitude"].mean
        return [int(np.nanargmax(mean))] if np.isfinite(mean).any() else []
    return sorted({0, len(summary.at) - 1})


def _rows(summary: Summary) -> list[int]:
    """Places in the table."""
    spread = np.linspace(0, len(summary.at) - 1, min(MOST_ROWS, len(summary.at))).round().astype(int)
    return sorted({*spread.tolist(), *_leading(summary)})


def _widest(summary: Summary, name: str) -> int:
    """Where a number varies most beside its mean."""
    bands = summary.bands[name]
    with np.errstate(invalid="ignore", divide="ignore"):
        part = bands.deviation / np.abs(bands.mean)
    return int(np.argmax(np.nan_to_num(part, nan=-1.0, posinf=-1.0)))


def _are_alike(one: Summary, other: Summary) -> bool:
    """Whether two studies have the same numbers over the same parameter."""
    return (one.of, one.parameter, *one.bands) == (other.of, other.parameter, *other.bands)


def _both(summary: Summary, other: Summary | None) -> list[Summary]:
    return [summary] if other is None else [summary, other]


def _count(summary: Summary) -> str:
    """How many were solved, in words."""
    solved = summary.attribute("solved")
    return f"{solved} solved" if solved and int(solved) < summary.samples else "all solved"


def _caption(summary: Summary) -> str:
    return f"{title_of(summary.path)}, {summary.design}: bands of 5 to 95 and 25 to 75 %, and the median."


def _units(summary: Summary) -> str:
    """Of the amplitude."""
    named = [
        f"{NUMBERS.get(name, name)} in {bands.unit}" for name, bands in summary.bands.items() if name == "amplitude"
    ]
    return f"{'; '.join(named)}." if named else ""


def _number(value: float) -> str:
    return f"{value:.5g}" if np.isfinite(value) else "-"
