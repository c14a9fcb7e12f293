"""What a job finds as a function of its parameters, with exact derivatives: for optimisers, and for JAX.

    function = attrito.jax_function("job.toml", ["contact[0].friction_coefficient", "level"], "tip_amplitude")
    jax.grad(lambda values: function(values).max())(jax.numpy.array([0.4, 2.0]))

Every call runs the job; derivatives are those of `[sensitivity]` (docs/how-to/sensitivity.md).
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from attrito.api import JobSource, run
from attrito.job.job import Job
from attrito.job.reading import check_job, plain, read_job
from attrito.job.sensitivity import OF_CONTACTS
from attrito.job.varied import set_value
from attrito.results.derivatives import derivatives_of
from attrito.results.result import Result
from attrito.support.errors import Fault, InputError

if TYPE_CHECKING:
    from mpi4py.MPI import Comm


def value_and_gradient(
    job: JobSource,
    parameters: Sequence[str],
    quantity: str,
    values: Any,
    comm: Comm | None = None,
    *,
    folder: str | os.PathLike[str] = ".",
) -> tuple[np.ndarray, np.ndarray]:
    """Run a job at values of parameters: a quantity at all points, and its derivatives by them.

    The result goes to the file of the job, again with every call.

    Parameters
    ----------
    job, comm, folder : as of `run`
    parameters : as of `[sensitivity] to`, but harmonic loads; `level` where the job has one alone
    quantity : `NAME_amplitude` or `NAME_mean` of a monitor; or `dissipated_energy`, `t1_mean`, `t2_mean` or `n_mean`,
        summed over all contacts
    values : of the parameters, in their order; of `load.NAME` a factor, not 0, on what the job has

    Returns
    -------
    values `[points]`, and derivatives per unit of each parameter `[points, parameters]`, NaN where there is none

    Raises
    ------
    InputError : the job, or it at these values, is at fault, or there is no such parameter or quantity
    UnsolvedError, NumericsError : as of `run` with `strict`

    Examples
    --------
    >>> height, slopes = attrito.value_and_gradient("job.toml", ["level"], "tip_amplitude", [2.0])
    """
    return _evaluate(_asked(job, parameters, quantity, folder), quantity, values, comm)


def jax_function(
    job: JobSource,
    parameters: Sequence[str],
    quantity: str,
    comm: Comm | None = None,
    *,
    folder: str | os.PathLike[str] = ".",
) -> Callable[[Any], Any]:
    """The same as a function of JAX, which must be installed: of values `[parameters]` the quantity `[points]`.

    `jax.grad`, `jax.vjp`, `jax.jacrev` and `jax.jit` take it; `jax.jvp`, and so derivatives of second order, do not.
    Numbers have JAX's precision: `jax.config.update("jax_enable_x64", True)` makes it double. An error of a run
    reaches the caller as JAX's own, which holds its text.

    Parameters
    ----------
    job, parameters, quantity, comm, folder : as of `value_and_gradient`; the sweep has `frequencies_hz`

    Raises
    ------
    InputError : as of `value_and_gradient`, or JAX is not installed, or the number of points is not known
    """
    try:
        import jax
    except ImportError:
        raise InputError(Fault("jax_function", "jax", "absent", "JAX: pip install jax")) from None
    checked = _asked(job, parameters, quantity, folder)
    sweep = checked["sweep"]
    if sweep["frequencies_hz"] is None:
        expected = "a list of frequencies: JAX has to know the number of points"
        raise InputError(checked.fault("[sweep] frequencies_hz", "absent", expected))
    points = len(sweep["frequencies_hz"]) * len(sweep["levels"])
    number = jax.dtypes.canonicalize_dtype(float)
    shapes = [jax.ShapeDtypeStruct(shape, number) for shape in ((points,), (points, len(parameters)))]

    def host(values: Any) -> list[np.ndarray]:
        return [np.asarray(found, dtype=number) for found in _evaluate(checked, quantity, values, comm)]

    def forward(values: Any) -> Any:
        return jax.pure_callback(host, shapes, values)

    def backward(slopes: Any, cotangent: Any) -> tuple[Any]:
        return (cotangent @ slopes,)

    function = jax.custom_vjp(lambda values: forward(values)[0])
    function.defvjp(forward, backward)
    found: Callable[[Any], Any] = function
    return found


def _asked(job: JobSource, parameters: Sequence[str], quantity: str, folder: str | os.PathLike[str]) -> Job:
    """The job that asks for derivatives of a quantity by parameters, checked."""
    given = read_job(job, folder)
    asked = {"to": list(parameters), "of": [quantity] if quantity in OF_CONTACTS else []}
    checked = check_job(_tables(given) | {"sensitivity": asked}, given.path)
    monitors = [monitor["name"] for monitor in checked["output"]["monitors"]]
    known = [f"{name}_{kind}" for name in monitors for kind in ("amplitude", "mean")] + list(OF_CONTACTS)
    if quantity not in known:
        raise InputError(checked.fault("quantity", quantity, "one of " + ", ".join(known)))
    harmonic = [f"load.{keys['name']}" for keys in checked["load"] if keys["kind"] == "harmonic"]
    faults = [
        checked.fault("parameters", name, "a static load; of harmonic loads their level")
        for name in parameters
        if name in harmonic
    ]
    if "level" in parameters and len(checked["sweep"]["levels"]) > 1:
        faults.append(checked.fault("[sweep] levels", checked["sweep"]["levels"], "one, where it is a parameter"))
    if not parameters:
        faults.append(checked.fault("parameters", [], "at least one, as of [sensitivity] to"))
    if faults:
        raise InputError(*faults)
    return replace(checked, given=checked.given | {"static"})


def _tables(job: Job) -> dict[str, Any]:
    """What `check_job` takes, of the tables that the job gives."""
    found: dict[str, Any] = plain({name: table for name, table in job.tables.items() if name in job.given})
    return found


def _evaluate(job: Job, quantity: str, values: Any, comm: Comm | None) -> tuple[np.ndarray, np.ndarray]:
    """Run a job of `_asked` at values of its parameters: the quantity, and its derivatives. Collective."""
    values = np.asarray(values, dtype=float)
    with Result(_file_of(_at(job, values), comm)) as result:
        if quantity in OF_CONTACTS:
            found = result.array(f"/contacts/{quantity}").sum(axis=1)
        else:
            found = result.monitor(*quantity.rsplit("_", 1))
        names, derivatives = derivatives_of(result)
    # Of a load the result has the derivative by a factor on what the run had.
    factors = [value if name.startswith("load.") else 1.0 for name, value in zip(_names(job), values, strict=True)]
    return found, derivatives[:, names.index(quantity)] / np.array(factors)


def _names(job: Job) -> list[str]:
    names: list[str] = job["sensitivity"]["to"]
    return names


def _file_of(job: Job, comm: Comm | None) -> str:
    with run(job, comm, quiet=True, strict=True) as result:
        return result.path


def _at(job: Job, values: np.ndarray) -> Job:
    """The job at values of its parameters, checked again."""
    names = _names(job)
    if values.shape != (len(names),):
        raise InputError(job.fault("values", values.tolist(), f"{len(names)} numbers, one of each parameter"))
    tables = _tables(job)
    loads = [load["name"] for load in job["load"] if load["kind"] != "harmonic"]
    for name, value in zip(names, values.tolist(), strict=True):
        if not name.startswith("load."):
            key = re.sub(r"(?<=friction_coefficient\[)(\d+)\]", r"\1][1]", name)
            set_value(tables, "sweep.levels[0]" if name == "level" else key, value, factor=False)
            continue
        if value == 0.0:
            raise InputError(job.fault(name, value, "a factor other than 0, at which there is no derivative"))
        path = tables["static"]["load_path"]
        for place, corner in enumerate(path):
            factors = dict(corner) if isinstance(corner, dict) else dict.fromkeys(loads, corner)
            path[place] = factors | {name[5:]: value * factors.get(name[5:], 0.0)}
    return check_job(tables, job.path)
