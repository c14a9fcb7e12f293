"""Models from other programs' files.

`import_model` reads matrices and mesh and writes model.h5; `read_matrix` reads one matrix of any kind,
`read_matrices` those of one model; `check_matrices` lists what is wrong with a set of them.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from attrito.importers.check import check_matrices
    from attrito.importers.matrix import read_matrices, read_matrix
    from attrito.importers.mesh import Mesh, read_mesh
    from attrito.importers.model import import_model

__all__ = ["Mesh", "check_matrices", "import_model", "read_matrices", "read_matrix", "read_mesh"]

# Where each name is; it is loaded when it is asked for: a job of matrices reads no mesh.
_PLACES = {
    "Mesh": "mesh",
    "check_matrices": "check",
    "import_model": "model",
    "read_matrices": "matrix",
    "read_matrix": "matrix",
    "read_mesh": "mesh",
}


def __getattr__(name: str) -> Any:
    if name not in _PLACES:
        raise AttributeError(f"module 'attrito.importers' has no attribute {name!r}")
    return getattr(importlib.import_module(f"attrito.importers.{_PLACES[name]}"), name)
