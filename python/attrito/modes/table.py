"""The tables of nonlinear and linear modes, and of a Campbell diagram."""

from __future__ import annotations

import numpy as np

from attrito.results.derivatives import derivative_columns
from attrito.results.result import Result
from attrito.support.csv_text import cell, numbers

NUMBERS = ("amplitude", "frequency_hz", "damping_ratio", "damping_ratio_structure", "dissipated_energy")


def table(result: Result) -> str:
    """CSV, a line a point.

    `point, amplitude, frequency_hz, damping_ratio, damping_ratio_structure, dissipated_energy, converged, outcome,
    estimate, iterations`, where the structure's damping is negative `limit_cycle`, then amplitude and mean of each
    monitor. What is not known is empty.
    """
    names = ["point", *NUMBERS, "converged", "outcome", "estimate", "iterations"]
    is_fed = bool(np.any(result.array("/points/damping_ratio_structure") < 0.0))
    names += ["limit_cycle"] if is_fed else []
    monitors = [(name, quantity) for name in result.monitors for quantity in ("amplitude", "mean")]
    names += [cell(f"{name}_{quantity}") for name, quantity in monitors]
    columns = [numbers(result.array(f"/points/{name}")) for name in NUMBERS]
    columns.append(["true" if one else "false" for one in result.converged])
    columns.append([cell(one) for one in result.outcome])
    columns.append(numbers(result.array("/points/estimate")))
    columns.append([str(int(one)) for one in result.array("/points/iterations")])
    if is_fed:
        columns.append(result.named("/points/limit_cycle"))
    columns += [numbers(result.monitor(*both)) for both in monitors]
    lines = [",".join(names)]
    lines += [",".join([str(i), *row]) for i, row in enumerate(zip(*columns, strict=True))]
    return "\n".join(lines) + "\n"


def linear_table(result: Result) -> str:
    """The modes as CSV: `mode, frequency_hz, kind, damping_ratio`, then the shape at each monitor.

    Of a wheel `nodal_diameter` follows `mode`, and the shape is its parts `_cosine` and `_sine`. `frequency by NAME`,
    last, are the derivatives by `[sensitivity] to`.
    """
    is_wheel = result.has("/points/nodal_diameter")
    parts = ("cosine", "sine") if is_wheel else ("shape",)
    columns = [("mode", [str(i + 1) for i in range(result.points)])]
    if is_wheel:
        columns.append(("nodal_diameter", [str(n) for n in result.array("/points/nodal_diameter")]))
    columns.append(("frequency_hz", numbers(result.array("/points/frequency_hz"))))
    columns.append(("kind", result.named("/points/kind")))
    columns.append(("damping_ratio", numbers(result.array("/points/damping_ratio"))))
    for name in result.monitors:
        for part in parts:
            heading = f"{name}_{part}" if is_wheel else name
            columns.append((cell(heading), numbers(result.monitor(name, part))))
    columns += derivative_columns(result, {"frequency": "frequency_hz"})
    lines = [[name for name, _ in columns], *zip(*(values for _, values in columns), strict=True)]
    return "\n".join(map(",".join, lines)) + "\n"


def campbell_table(result: Result) -> str:
    """CSV, a line a mode: `speed_hz, nodal_diameter, mode, frequency_hz`; no nodal diameter but of a wheel."""
    speed, frequency = result.array("/points/speed_hz"), result.array("/points/frequency_hz")
    mode = result.array("/points/mode")
    diameter = [""] * len(speed)
    if result.has("/points/nodal_diameter"):
        diameter = [str(n) for n in result.array("/points/nodal_diameter")]
    lines = ["speed_hz,nodal_diameter,mode,frequency_hz"]
    for row in zip(speed, diameter, mode, frequency, strict=True):
        lines.append(f"{row[0]:.12g},{row[1]},{row[2]},{row[3]:.12g}")
    return "\n".join(lines) + "\n"
