"""The model in the files `data/two_springs*`, written by hand in every format: three dofs, two of them coupled."""

from __future__ import annotations

from pathlib import Path

import numpy as np

DATA = Path(__file__).parent / "data"
STIFFNESS = np.array([[3.0, -1.0, 0.0], [-1.0, 2.5, 0.0], [0.0, 0.0, 4.0]])
MASS = np.diag([0.5, 0.25, 0.25])
NODE, DIRECTION = np.array([12, 1000, 1000]), np.array([2, 1, 3])
