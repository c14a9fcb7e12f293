"""Contact laws of a scene, as arrays by key.

Where every contact is a Coulomb spring there is nothing but numbers that all contacts have. Where another law is among
them, `law` is the place of each contact's law in `names.LAWS`, `[nc]`, and `law_numbers` what it is made of, in the
order of its constructor in the library, then NaN, `[nc, most]`.
"""

from __future__ import annotations

import numpy as np


def are_coulomb(laws: dict[str, np.ndarray]) -> bool:
    """Whether every contact is a Coulomb spring: its force is proportional to N, and has events."""
    return "law" not in laws or not np.any(laws["law"])


def cone_coefficients(laws: dict[str, np.ndarray]) -> np.ndarray:
    """The mu of each contact's friction cone |T| <= mu N, `[nc]`: of bounds, margins and limits drawn.

    Raises
    ------
    ValueError : a contact's law has no cone; whoever asks must do without (`are_coulomb`)
    """
    if not are_coulomb(laws):
        raise ValueError("expected Coulomb springs: another contact law has no friction cone")
    return np.asarray(laws["friction_coefficient"], dtype=float)
