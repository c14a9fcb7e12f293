"""Tables of a job that ask for more than a run: peaks, modes, diagrams, stability, derivatives, motion in time."""

from __future__ import annotations

from attrito.job.checks import (
    boolean,
    choice,
    either,
    frequency,
    integer,
    listing,
    matrix,
    number,
    rising_speeds,
    start,
    text,
)
from attrito.job.key import Key

pair_of_numbers = listing(number(), 2, 2)

COMMANDS: dict[str, dict[str, Key]] = {
    "peak": {
        "parameter": Key(
            choice("level", "preload"),
            "level",
            "what the peak is followed in: a factor on all harmonic or static loads",
        ),
        "start": Key(number(0, above=True), None, "its value to begin at, where contacts stick or slip"),
        "stop": Key(number(0, above=True), None, "its value to end at"),
        "values": Key(listing(number(0, above=True)), [], "between them at which the peak is located too"),
        "level": Key(number(0, above=True), 1.0, 'with `parameter = "preload"`: factor on the harmonic loads'),
        "monitor": Key(text, None, "whose peak; absent: the first of the output"),
        "amplitude": Key(
            choice("half_range", "first_harmonic"),
            "half_range",
            "that is largest at the peak: half the range, or of one harmonic",
        ),
        "near_hz": Key(
            frequency(), None, "where the linear peak is; absent: the largest between the ends of the sweep"
        ),
        "optimum": Key(boolean, True, "locate extrema of the peak over the parameter"),
        "backbone": Key(
            boolean,
            None,
            "has no effect: `attrito mode` follows motion without excitation. Older jobs have it",
            retired="`attrito mode` follows motion without excitation",
        ),
        "look_for_higher": Key(
            boolean,
            True,
            "at start, stop and values sweep the band coarsely for a higher peak than the one followed: at start the"
            " highest is begun at, later one of the same resonance is followed from there; studies take the highest"
            " ([A higher peak](../how-to/peaks.md#a-higher-peak))",
        ),
        "max_points": Key(integer(2), 1000, "of the curve"),
        "file": Key(text, None, "of peaks; absent: that of the output, ending `.peaks.h5`"),
    },
    "mode": {
        "file": Key(text, None, "of the mode; absent: that of the output, ending `.mode.h5`"),
        "number": Key(
            integer(1),
            None,
            "of the tangent modes as `attrito linear-modes` lists them; absent: the first elastic one",
        ),
        "near_hz": Key(frequency(), None, "instead: the elastic tangent mode nearest to this frequency"),
        "method": Key(
            choice("epmc", "quasi_static"),
            "epmc",
            "extended periodic motion concept, or cycles of quasi-static loading"
            " ([Nonlinear modes](../how-to/nonlinear-modes.md))",
        ),
        "start": Key(
            number(0, above=True),
            None,
            "amplitude Q to begin at: zero to peak of phi^T M q_1, phi the tangent mode with unit modal mass;"
            " quasi-static: half the range of phi^T M q",
            required=True,
        ),
        "stop": Key(number(0, above=True), None, "amplitude Q to end at", required=True),
        "points": Key(integer(2), 20, "amplitudes, equal in ratio, at which the mode is located"),
        "steps": Key(integer(8), 64, 'load steps of a cycle, a multiple of 8, with `method = "quasi_static"`'),
    },
    "campbell": {
        "speeds_hz": Key(rising_speeds, None, "speeds of rotation", required=True),
        "modes": Key(integer(1), 10, "how many tangent modes, at most; of a wheel, of each nodal diameter"),
        "engine_orders": Key(
            listing(integer(1, 1000)),
            None,
            "that are drawn; absent: 1 to 12, and that of `[cyclic]` with its sign left out",
        ),
        "stiffness_at_rest": Key(
            matrix,
            None,
            "where the model's stiffness holds stress stiffening: the same structure's at rest, `model.h5` or a matrix;"
            " their difference grows with the square of the speed"
            " ([Campbell diagram](../how-to/modes.md#campbell-diagram))",
        ),
        "stiffness_hz": Key(
            frequency(), None, "with it: speed of the model's stiffness; absent: that of `attrito import --spin-hz`"
        ),
        "file": Key(text, None, "of the diagram; absent: that of the output, ending `.campbell.h5`"),
    },
    "stability": {
        "method": Key(
            choice("none", "monodromy", "hill", "both"),
            "none",
            "examine every point; `both` must agree. Coupled balance ([Stability](../explanation/stability.md))",
        ),
        "orbit": Key(
            choice("auto", "balance", "exact"),
            "auto",
            "whose multipliers: `balance` the balance's orbit, `exact` the event-exact one near it, `auto` the latter"
            " wherever a contact slips or opens",
        ),
    },
    "sensitivity": {
        "to": Key(
            listing(text),
            [],
            "parameters that amplitudes, means, peaks and modes are differentiated by: `contact[0].KEY`,"
            " `contact_set[0].KEY`, `[*]` for all, KEY a number of the contact's law; `load.NAME`; `damping.KEY`;"
            " `level` ([Sensitivities](../how-to/sensitivity.md))",
        ),
        "of": Key(
            listing(text),
            [],
            "quantities that are differentiated beside the monitors: `contact[0].NAME`, `contact_set[0].NAME`, `[*]`"
            " for all of these, or `NAME` of all contacts; NAME: `dissipated_energy`, `t1_mean`, `t2_mean`, `n_mean`",
        ),
    },
    "integrate": {
        "scheme": Key(
            choice("event", "central_difference", "newmark", "hht", "generalised_alpha", "exponential"),
            "event",
            '`event`: exact between events; the others in steps, also for `law = "pressure"`',
        ),
        "steps_per_period": Key(integer(2), None, "of the schemes other than `event`; absent: what suits the scheme"),
        "dissipation": Key(number(0, 1), None, "HHT's -alpha (0.1) or generalised alpha's spectral radius (0.8)"),
        "frequency_hz": Key(frequency(), None, "of the excitation"),
        "level": Key(number(0), 1.0, "factor on all harmonic loads"),
        "static_profile": Key(
            listing(pair_of_numbers, 1), None, "`[[time, factor], ...]` on the static loads; absent: constantly 1"
        ),
        "harmonic_profile": Key(listing(pair_of_numbers, 1), None, "likewise on the harmonic loads"),
        "start": Key(start, "static", "the end of the load path, rest, or a point of the output file"),
        "sliders": Key(
            listing(either(number(), pair_of_numbers), 1),
            None,
            "at the start, one a contact (a pair with two tangents); absent: 0",
        ),
        "cycles": Key(integer(1), 400, "periods at most"),
        "fewest_cycles": Key(integer(0), 0, "periods at least"),
        "periodicity_tolerance": Key(
            number(0, above=True), 1e-10, "steady: the state changes less over a period, relative to the amplitude"
        ),
        "max_period_multiple": Key(integer(1), 4, "longest period recognised, in periods of the excitation"),
        "attractors": Key(
            boolean,
            False,
            "also integrate from eight stated starts and list the motions met"
            " ([Motions that coexist](../explanation/time-integration.md#motions-that-coexist))",
        ),
        "samples": Key(integer(8), 256, "of the record, a period"),
        "history": Key(choice("period", "run"), "period", "what is recorded: the last period, or the whole run"),
        "equivalent_viscous": Key(
            boolean, False, "take a loss factor as C = eta K / omega, in integration and for stability"
        ),
    },
}
