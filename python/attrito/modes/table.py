"""The table of a nonlinear mode."""

from __future__ import annotations

import numpy as np

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
