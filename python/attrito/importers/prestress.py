"""What an imported stiffness holds besides that of the structure at rest: said by the user, and seen in the matrices.

CalculiX 2.20 (measured): after a static step, `*STEP, PERTURBATION` with `*FREQUENCY, SOLVER=MATRIXSTORAGE` writes a
stiffness that holds stress stiffening, and spin softening as well while a `CENTRIF` load is active in that step
(K t = -Omega^2 P M t to eight digits for translations t). `*DLOAD, OP=NEW` without data in that step leaves the
stiffening alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from scipy.sparse import csr_matrix

from attrito.model.model import HOLDINGS, SPIN_SOFTENING, STRESS_STIFFENING, Model
from attrito.model.rotation import softening_within
from attrito.support.errors import Fault, InputError

# Relative error of a speed seen in the matrices: medians over dofs near supports, and digits in the file.
SEEN = 1e-3


def check_holdings(holds: Sequence[str], spin_hz: float | None, geometric: bool) -> None:
    """Raise unless what the user says of the stiffness makes sense by itself."""
    faults = [
        Fault("import", "holds", name, "a list of " + ", ".join(HOLDINGS)) for name in holds if name not in HOLDINGS
    ]
    if SPIN_SOFTENING in holds and spin_hz is None:
        faults.append(Fault("import", "spin_hz", "missing", "the speed of the spin softening that the stiffness holds"))
    if spin_hz is not None and not holds and not geometric:
        faults.append(Fault("import", "spin_hz", spin_hz, "no speed for a stiffness that holds nothing of it"))
    if geometric and STRESS_STIFFENING in holds:
        expected = "no geometric stiffness: the stiffness is said to hold stress stiffening already"
        faults.append(Fault("import", "geometric_stiffness", "given", expected))
    if spin_hz is not None and not math.isfinite(spin_hz):
        faults.append(Fault("import", "spin_hz", spin_hz, "a finite number"))
    if faults:
        raise InputError(*faults)


def hold(model: Model, holds: Sequence[str], spin_hz: float | None, geometric: csr_matrix | None) -> list[str]:
    """Record in the model what its stiffness holds, add a geometric stiffness, and say it.

    Raises
    ------
    InputError : the matrices show spin softening that the user did not tell of, or of another speed
    """
    model.stiffness_holds = tuple(name for name in HOLDINGS if name in holds)
    model.spin_hz = spin_hz
    seen = softening_within(model) if model.has_mesh else 0.0
    notes = []
    if SPIN_SOFTENING in holds:
        if seen == 0.0:
            notes.append("the spin softening that the stiffness is said to hold cannot be seen in it")
        elif abs(seen / spin_hz - 1.0) > SEEN:
            raise InputError(Fault("import", "spin_hz", spin_hz, f"{seen:.6g}, the speed seen in the stiffness"))
    elif seen > 0.0:
        expected = f"{SPIN_SOFTENING} as well: rigid translations show that of {seen:.6g} Hz in the stiffness"
        raise InputError(Fault("import", "holds", ", ".join(holds) or "nothing", expected))
    if geometric is not None:
        model.stiffness = (model.stiffness + geometric).tocsr()
        model.stiffness_holds = tuple(name for name in HOLDINGS if name in (*holds, STRESS_STIFFENING))
    if model.stiffness_holds:
        speed = "" if spin_hz is None else f" of {spin_hz:g} Hz"
        notes.append(f"the stiffness holds {' and '.join(model.stiffness_holds)}{speed}".replace("_", " "))
    return notes
