"""The mesh of the model that a result was made with, where its file is still there."""

from __future__ import annotations

from pathlib import Path

from attrito.model.model import Model
from attrito.model.model_file import read_model
from attrito.results.result import Result
from attrito.support.errors import InputError


def mesh_of(result: Result) -> Model | None:
    """The model without its matrices; None where its file is gone, cannot be read, or has no elements."""
    name = result.attribute("model_file")
    if not name or not Path(name).is_file():
        return None
    try:
        model = read_model(name, matrices=False)
    except InputError:
        return None
    return model if model.has_mesh and model.elements else None
