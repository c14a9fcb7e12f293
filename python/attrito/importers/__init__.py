"""Models from other programs' files.

`import_model` reads matrices and mesh and writes model.h5; `read_matrix` reads one matrix of any kind,
`read_matrices` those of one model; `check_matrices` lists what is wrong with a set of them.
"""

from attrito.importers.check import check_matrices
from attrito.importers.matrix import read_matrices, read_matrix
from attrito.importers.mesh import Mesh, read_mesh
from attrito.importers.model import import_model

__all__ = ["Mesh", "check_matrices", "import_model", "read_matrices", "read_matrix", "read_mesh"]
