"""The sections of a report, each a function of the page and what is shown on it."""

from __future__ import annotations

import json
import platform
from collections import Counter
from typing import Protocol

import h5py
import matplotlib
import numpy as np

from attrito.job.cyclic import nodal_diameter, nodal_diameter_in_words
from attrito.job.reference import as_job
from attrito.library.names import REFERENCES
from attrito.plots.contact_maps import contact_map
from attrito.plots.contacts import hysteresis
from attrito.plots.response import Drawing, frequency_response
from attrito.report import figures as report_figures
from attrito.report import period
from attrito.report.page import Page
from attrito.report.view import View
from attrito.results.loops import contact_loops, most_dissipating
from attrito.runs.linear_references import in_words
from attrito.support.version import __version__

# Levels whose peaks are shown on the interface, contacts whose loops are shown, failures and reasons that are listed.
MOST_MAPS, MOST_LOOPS, MOST_FAILURES, MOST_REASONS = 4, 6, 20, 8
# A line of the job beyond this (matrices given inline) is cut.
LONGEST_LINE = 600


def responses(page: Page, view: View) -> None:
    """Frequency responses of all monitors, and a table of their peaks."""
    page.section("Frequency response")
    look = report_figures.LOOK
    drawn = []
    for name in view.monitors:
        drawn.append((frequency_response(view.result, name, look=look), _response(view, name)))
        if view.result.has(f"/monitors/{name}/harmonics"):
            words = f"{name}: phase of the first harmonic, 0 where it moves as a load of cosines does."
            drawn.append((frequency_response(view.result, name, look=look, drawing=Drawing("phase")), words))
    page.figures(drawn)
    rows = []
    for name in view.monitors:
        peaks = [view.peak(name, view.level == level) for level in view.peaks]
        rows += [_peak(view, name, point) for point in peaks if point is not None]
    page.subsection("Peaks")
    header = ["monitor", "level", "at Hz", "amplitude", "per level", "of the stuck peak", "from", "to"]
    page.table([*header, "estimated error", "stable", "unique"], rows)
    units = {view.result.unit(f"/monitors/{name}/amplitude") for name in view.monitors}
    page.text(
        f"Amplitudes: half the range over the period ({'; '.join(sorted(units))}). From, to: the interval of solutions"
        " where a point is not unique. Estimated error: part of the amplitude."
    )


def _response(view: View, name: str) -> str:
    words = f"{name}: half the range over the period."
    if len(view.peaks) > 1:
        words += " Divided by the level: a linear structure would give one curve."
    if (view.result.array("/points/estimate") > 0).any():
        words += " Bars, where they are long enough to be seen: estimated error."
    if (view.result.array("/points/stable") == 0).any():
        words += " Dashed: unstable."
    loose = view.result.array("/points/unique") == 0
    if (loose & np.isfinite(view.result.monitor(name, "low"))).any():
        words += " Shaded: all that the solutions of a point that is not unique reach."
    return words


def _peak(view: View, name: str, point: int) -> list[str]:
    amplitude, low, high = (view.result.monitor(name, quantity)[point] for quantity in ("amplitude", "low", "high"))
    level = view.level[point]
    linear = view.result.linear("stuck", name)
    stuck = np.max(linear[1], initial=0.0) if linear is not None else 0.0
    part = f"{amplitude / level / stuck:.3f}" if stuck > 0 else "-"
    stable, unique = (_verdict(view.result.array(f"/points/{key}")[point]) for key in ("stable", "unique"))
    estimate = _number(view.result.array("/points/estimate")[point], ".1e")
    if unique != "no":
        low = high = np.nan
    # Where a sweep ends nothing peaks; the largest amplitude says little there.
    swept = view.frequency[view.sweep(point)]
    end = " (the end)" if len(swept) > 1 and view.frequency[point] in (swept.min(), swept.max()) else ""
    numbers = [f"{view.frequency[point]:.6g}{end}", f"{amplitude:.5g}", f"{amplitude / level:.5g}"]
    return [name, f"{level:.4g}", *numbers, part, _number(low, ".5g"), _number(high, ".5g"), estimate, stable, unique]


def contacts(page: Page, view: View) -> None:
    """What the contacts do: over the sweep, and at peaks on their surface."""
    page.section("Contacts")
    if view.point is None or not view.result.contacts:
        page.text("No contact of a point that was solved.")
        return
    own, level = view.sweep(), f"level {view.level[view.point]:.4g}"
    words = f"Over the sweep of {level}: shares of the time of all contacts."
    drawn = [(report_figures.contact_shares(view.result, own), words)]
    drawn.append((report_figures.dissipation(view.result, own), f"Over the sweep of {level}: what contacts dissipate."))
    page.figures(drawn)
    if not view.surfaces:
        page.text("These contacts have no place in space, so there is no map of them.")
        return
    peaks = [point for point in view.peaks.values() if point is not None]
    if len(peaks) > MOST_MAPS:
        peaks = [peaks[index] for index in np.linspace(0, len(peaks) - 1, MOST_MAPS).round().astype(int)]
    captions = {
        "state": "What each contact does over the period.",
        "energy": "What each contact dissipates. Hatched: parts for some of the period; dotted: never touches.",
    }
    for point in dict.fromkeys([*peaks, view.point]):
        page.subsection(f"At {view.place(point)}")
        page.figures(
            [(contact_map(view.result, point, kind, report_figures.LOOK, titled=False, panels=view.surfaces), words)
             for kind, words in captions.items()]
        )  # fmt: skip
    words = "Each surface is seen along the normal of the plane nearest to its contacts, lengths from their middle."
    meshed = all(surface.cells for surface in view.surfaces)
    words += " Each contact has the part of the mesh's faces that is nearest to it." if meshed else ""
    page.text(words)


def loops(page: Page, view: View) -> None:
    """Hysteresis loops of the busiest contacts."""
    page.section("Hysteresis")
    if view.point is None or not view.result.contacts:
        page.text("No contact of a point that was solved.")
        return
    result, busiest = view.result, most_dissipating(view.result, view.point, MOST_LOOPS)
    page.text(
        f"The contacts that dissipate most, the busiest first, at {view.place(view.point)}. Thin lines: the limits of"
        " friction, + and - mu N; where N varies they are loops, and the force runs along them while the contact slips."
        " Contacts with two tangents are seen along their largest motion."
    )
    units = [result.unit(f"/contacts/{name}") for name in ("displacement", "force")]
    drawn, found = [], contact_loops(result, view.point, busiest)
    for contact, loop in zip(busiest, found, strict=True):
        energy, slip, opened = (
            result.dataset(f"/contacts/{name}")[view.point, contact] for name in ("dissipated_energy", "slip", "open")
        )
        words = (
            f"Contact {contact}: {energy:.3g} a period ({result.unit('/contacts/dissipated_energy')});"
            f" slips {100 * slip:.0f} % of it, is open {100 * opened:.0f} %."
        )
        look = report_figures.SMALL if len(busiest) > 1 else report_figures.LOOK
        drawn.append((hysteresis([loop], *units, look=look, legend=False), words))
    if len(busiest) == 1:
        forces = period.contact_forces(found[0], units[1])
        page.figures([*drawn, (forces, f"Forces of contact {busiest[0]} over the period.")])
    else:
        page.figures(drawn, small=True)


def harmonics(page: Page, view: View) -> None:
    """Amplitudes of the harmonics over the sweep, and in numbers at the point that is shown."""
    page.section("Harmonic content")
    if view.point is None:
        page.text("No point was solved.")
        return
    level, place = f"level {view.level[view.point]:.4g}", view.place(view.point)
    drawn = []
    for name in view.monitors:
        swept = report_figures.harmonics(view.result, name, view.sweep())
        drawn.append((swept, f"{name}, {level}: amplitude of each harmonic."))
        words = f"{name} over a period about its mean, at {place}; below its harmonics."
        drawn.append((period.content(view.result, name, view.point), words))
    page.figures(drawn)
    units = {view.result.unit(f"/monitors/{name}/harmonics") for name in view.monitors}
    page.text(f"At {view.place(view.point)} ({'; '.join(sorted(units))}):")
    rows, count = [], 0
    for name in view.monitors:
        coefficients = view.result.monitor(name, "harmonics")[view.point]
        parts = np.hypot(coefficients[1::2], coefficients[2::2])
        count = len(parts)
        rows.append([name, f"{coefficients[0]:.4g}", *(f"{part:.3g}" for part in parts)])
    page.table(["monitor", "mean", *(str(harmonic) for harmonic in range(1, count + 1))], rows)


def uniqueness(page: Page, view: View) -> None:
    """How many points are one of a family, and how far the widest interval of a force reaches."""
    page.section("Uniqueness")
    unique = view.result.array("/points/unique")
    page.text(
        "A contact that sticks all along a period keeps the mean force it came with, so a point with such contacts is"
        " one of a family of solutions; which one is shown follows the load path."
    )
    page.text(f"{(unique == 1).sum()} points are unique, {(unique == 0).sum()} are not, {(unique < 0).sum()} are open.")
    if view.result.has("/points/bounds"):
        names = view.result.names("/points/bounds")
        kinds = Counter(names[index] for index in view.result.array("/points/bounds") if 0 <= index < len(names))
        page.text(
            f"Intervals: {kinds['exact']} points exact, {kinds['sampled']} sampled (attained; the true ones may be"
            f" wider), {kinds['not_examined']} not examined or not to their end, {kinds['none']} not known."
        )
        if kinds["not_examined"]:
            page.text(
                'By default intervals may take a tenth of the work of the points. [static] bounds = "sampled" examines'
                ' all points at any cost, "none" spends no time on them.'
            )
    widths = view.amplitude_widths()
    if np.isfinite(widths).any() and np.nanmax(widths) > 0:
        most = int(np.nanargmax(widths))
        page.text(
            f"What that changes of the amplitude: most at {view.place(most)}, by {100 * widths[most]:.2g} % between the"
            f" members visited there; nothing where all contacts stick."
        )
    widest = view.widest_force()
    if widest is None:
        page.text("No interval of a contact force in this result has a width that is known.")
        return
    point, contact, width = widest
    swept = report_figures.interval_over_sweep(view.result, view.sweep(point), contact)
    unit = view.result.unit("/contacts/t1_mean")
    words = f"Mean forces of contact {contact}, whose T is {width:.4g} wide at {view.frequency[point]:.6g} Hz ({unit})."
    figures = [(swept, words)]
    if view.result.contacts > 1:
        words = f"All contacts at {view.place(point)}: bar, the interval; dot, the solution shown."
        figures.append((report_figures.contact_intervals(view.result, point), words))
    page.figures(figures)


def stability(page: Page, view: View) -> None:
    """Floquet multipliers, and why points have no verdict."""
    page.section("Stability")
    result = view.result
    if result.has("/multipliers/point") and len(result.array("/multipliers/point")):
        words = (
            "Floquet multipliers of all points. floquet: those that decide; slip: zeros of sliders that a period"
            " forgets; stuck: neutral ones of sliders that stay."
        )
        figures = [(report_figures.multipliers(result), words)]
        if result.has("/stability/largest_multiplier"):
            figures.append((report_figures.largest_multiplier(result), "Largest modulus of those that decide."))
        page.figures(figures)
    else:
        page.text("No multipliers in this result: [stability] method of the job asks for them.")
    _bifurcations(page, view)
    if result.has("/stability/reason"):
        reasons = Counter(text.decode(errors="replace") for text in result.array("/stability/reason") if text)
        if reasons:
            page.table(["reason", "points"], reasons.most_common(MOST_REASONS))


def _bifurcations(page: Page, view: View) -> None:
    result = view.result
    if not result.has("/bifurcations/kind") or not len(result.array("/bifurcations/kind")):
        return
    names = result.names("/bifurcations/kind")
    columns = {
        name: result.array(f"/bifurcations/{name}")
        for name in ("frequency_hz", "uncertain_hz", "level", "real", "imag")
    }
    rows = []
    for index, kind in enumerate(result.array("/bifurcations/kind")):
        one = {name: values[index] for name, values in columns.items()}
        crossing = f"{one['real']:.4f} {one['imag']:+.4f}i" if np.isfinite(one["real"]) else "-"
        place = [f"{one['frequency_hz']:.7g}", f"{one['uncertain_hz']:.1e}", f"{one['level']:.4g}"]
        rows.append([names[kind].replace("_", " "), *place, crossing])
    page.subsection("Turning points and bifurcations")
    page.table(["kind", "at Hz", "uncertain by", "level", "multiplier that crosses"], rows)


def convergence(page: Page, view: View) -> None:
    """Iterations, residuals, estimates; points without a solution."""
    page.section("Convergence")
    if view.result.points == 0:
        page.text("No point.")
        return
    iterations, residual = view.result.array("/points/iterations"), view.result.array("/points/residual")[view.solved]
    known = residual[np.isfinite(residual)]
    words = (
        f"Points in the order in which they were solved: {iterations.sum()} iterations, {np.median(iterations):.3g}"
        f" a point (median), at most {iterations.max()}"
    )
    words += f"; relative residuals of solutions at most {known.max():.1e}." if len(known) else "."
    if (iterations[view.solved] == 0).any():
        words += " Points without a line took none: where every contact sticks the response is linear."
    page.text(words)
    page.figures(
        [
            (report_figures.iterations(view.result), "Iterations of each point."),
            (report_figures.errors(view.result), "Residuals, and estimated errors where they are known."),
        ]
    )
    missing = np.flatnonzero(~view.solved)
    if len(missing):
        first = f" (the first {MOST_FAILURES})" if len(missing) > MOST_FAILURES else ""
        page.text(f"Points without a solution{first}:", warn=True)
        outcome = view.result.outcome
        rows = [
            [point, f"{view.frequency[point]:.6g}", f"{view.level[point]:.4g}", outcome[point], iterations[point]]
            for point in missing[:MOST_FAILURES].tolist()
        ]
        page.table(["point", "at Hz", "level", "outcome", "iterations"], rows)


def run(page: Page, view: View) -> None:
    """Sizes, files, and what the run says of itself."""
    page.section("Run")
    result = view.result
    pairs = [("points", result.points), ("contacts", result.contacts), ("monitors", ", ".join(view.monitors))]
    if result.has("/points/coordinates"):
        shape = result.dataset("/points/coordinates").shape
        pairs += [("coordinates", shape[1]), ("harmonics", (shape[2] - 1) // 2)]
    if result.attribute("sectors"):
        wheel = int(result.attribute("sectors")), int(result.attribute("engine_order"))
        words = nodal_diameter_in_words(*wheel)
        pairs.append(("wheel", f"one of {wheel[0]} sectors, engine order {wheel[1]}: {words}"))
        highest = dict(pairs).get("harmonics", 1)
        numbers = ", ".join(str(nodal_diameter(*wheel, h)) for h in range(1, highest + 1))
        pairs.append((f"nodal diameters of harmonics 1 to {highest}, modulo {wheel[0]}", numbers))
    for kind in REFERENCES:
        if result.has(f"/linear/{kind}/natural_hz"):
            rigid = int(result.attributes(f"/linear/{kind}").get("rigid_body_modes", 0))
            words = in_words(result.array(f"/linear/{kind}/natural_hz"), rigid, 5, 5)
            pairs.append((f"natural frequencies in Hz, {kind}", words))
    for key in ("job_file", "model_file", "rom_file", "rom_fingerprint"):
        pairs.append((key.replace("_", " "), result.attribute(key)))
    pairs += [(name.replace("_", " "), value) for name, value in result.attributes("/run").items()]
    page.pairs([(name, value) for name, value in pairs if value != ""])


class Attributed(Protocol):
    """A file with texts at its root."""

    def attribute(self, name: str) -> str:
        """One of them; empty where there is none."""


def job(page: Page, result: Attributed) -> None:
    """The job as it was resolved."""
    page.section("Job")
    try:
        text = as_job(json.loads(result.attribute("job")))
    except (ValueError, TypeError, AttributeError, KeyError):
        page.text("The job in this result cannot be read.", warn=True)
        return
    page.text("As resolved; keys at their defaults are left out.")
    lines = text.splitlines()
    cut = [
        line if len(line) <= LONGEST_LINE else f"{line[:LONGEST_LINE]} ...  # of {len(line)} letters" for line in lines
    ]
    page.code("\n".join(cut))


def references(page: Page, result: Attributed) -> None:
    """What wrote the result and the page, and whose methods they use."""
    page.section("Versions and references")
    made = f"attrito {__version__}, Python {platform.python_version()}, numpy {np.__version__}, h5py {h5py.__version__}"
    written = f"attrito {result.attribute('attrito_version')}"
    page.pairs([("result written by", written), ("page made by", f"{made}, matplotlib {matplotlib.__version__}")])
    for reference in filter(None, result.attribute("references").split("; ")):
        page.text(reference)


def _number(value: float, form: str) -> str:
    return format(value, form) if np.isfinite(value) else "-"


def _verdict(value: int) -> str:
    return {1: "yes", 0: "no"}.get(int(value), "-")
