"""attrito: the steady vibration of finite-element structures that rub.

    import attrito

    result = attrito.run("job.toml")                      # or a dictionary; under mpirun on all ranks
    result.monitors["tip"].amplitude                      # an array that knows its unit
    with attrito.open("result.h5") as result: ...

docs/reference/python.md describes each.
"""

from __future__ import annotations

import importlib
import os
from typing import TYPE_CHECKING, Any

from attrito.support.version import __version__ as __version__

if TYPE_CHECKING:
    from attrito.api import (
        UnsolvedWarning,
        campbell,
        fit,
        integrate,
        linear_modes,
        mode,
        open,
        optimise,
        peak,
        reduce,
        run,
        study,
    )
    from attrito.differentiable import jax_function, value_and_gradient
    from attrito.importers import import_model
    from attrito.pictures import plot
    from attrito.report.report import write_report
    from attrito.results.quantities import File, Group, Quantity
    from attrito.results.result import Result
    from attrito.results.tables import bifurcation_table, contact_table, multiplier_table, table
    from attrito.stresses.cycle import Cycle
    from attrito.stresses.run import stress
    from attrito.stresses.stresses import Stresses
    from attrito.studies.report import write_study_report
    from attrito.support.errors import Fault, InputError, NumericsError, UnsolvedError

# HDF5 locks every file that it opens, and reads none where a file system has no locks. What attrito writes has locks of
# its own (`support/locks.py`). HDF5 looks at this when it is loaded.
os.environ.setdefault("HDF5_USE_FILE_LOCKING", "FALSE")

# Where each name is; it is loaded when it is asked for, so that a command loads only what it needs.
_PLACES = {
    "run": "api",
    "integrate": "api",
    "reduce": "api",
    "peak": "api",
    "linear_modes": "api",
    "campbell": "api",
    "mode": "api",
    "study": "api",
    "fit": "api",
    "optimise": "api",
    "open": "api",
    "value_and_gradient": "differentiable",
    "jax_function": "differentiable",
    "import_model": "importers",
    "plot": "pictures",
    "write_report": "report.report",
    "write_study_report": "studies.report",
    "stress": "stresses.run",
    "Cycle": "stresses.cycle",
    "Stresses": "stresses.stresses",
    "File": "results.quantities",
    "Group": "results.quantities",
    "Quantity": "results.quantities",
    "Result": "results.result",
    "table": "results.tables",
    "contact_table": "results.tables",
    "bifurcation_table": "results.tables",
    "multiplier_table": "results.tables",
    "Fault": "support.errors",
    "InputError": "support.errors",
    "NumericsError": "support.errors",
    "UnsolvedError": "support.errors",
    "UnsolvedWarning": "api",
}
__all__ = [
    "Cycle",
    "Fault",
    "File",
    "Group",
    "InputError",
    "NumericsError",
    "Quantity",
    "Result",
    "Stresses",
    "UnsolvedError",
    "UnsolvedWarning",
    "bifurcation_table",
    "campbell",
    "contact_table",
    "import_model",
    "integrate",
    "jax_function",
    "linear_modes",
    "mode",
    "multiplier_table",
    "open",
    "peak",
    "plot",
    "reduce",
    "run",
    "stress",
    "study",
    "fit",
    "optimise",
    "table",
    "value_and_gradient",
    "write_report",
    "write_study_report",
]


def __getattr__(name: str) -> Any:
    if name not in _PLACES:
        raise AttributeError(f"module 'attrito' has no attribute {name!r}")
    return getattr(importlib.import_module(f"attrito.{_PLACES[name]}"), name)


def __dir__() -> list[str]:
    return [*globals(), *__all__]
