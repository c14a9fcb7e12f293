"""The stress cycle of a period, for a Goodman diagram.

Of all pairs of instants s, t of the period the one between which stresses differ most is the cycle:

    alternating tensor  A = (sigma(s) - sigma(t)) / 2,    mean tensor  M = (sigma(s) + sigma(t)) / 2,
    alternating von Mises stress  sigma_a = vm(A) = max over s, t,    mean  sigma_m = sign(tr M) vm(M),
    vm(S) = sqrt(3/2 dev S : dev S)

These are the equivalent stresses of Manson and McKnight (NASA/TM-2005-213886, NASALIFE); sigma_a is also the
alternating equivalent stress of ASME BPVC VIII-2, 5.5.3. Under uniaxial stress they are half the range and its middle,
whatever the harmonics; where stresses rotate, sigma_a is half the largest chord of their path. The preload is in M.

Principal: of the directions n of A the one with the largest |n A n|, and n M n, the mean stress along it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from attrito.results.periodic_vectors import at_phases, longest, widest

# Places of a tensor's components xx, yy, zz, xy, yz, zx
ROWS, COLUMNS = [0, 1, 2, 0, 1, 2], [0, 1, 2, 1, 2, 0]
# Part of a stress below which its sign, or its difference from another, is rounding
ROUNDING = 1e-9


@dataclass(frozen=True)
class Cycle:
    """Cycles of n stresses, in the unit of the stress.

    Parameters
    ----------
    alternating, mean : tensors A and M, `[n, 6]`; A is of the instant of the greater hydrostatic stress less the other
    alternating_von_mises, mean_signed_von_mises : sigma_a and sigma_m, `[n]`; of a mean without hydrostatic part +
    alternating_principal, mean_principal : `[n]`, >= 0 and signed; of directions that alternate alike that of
        greater mean
    peak_von_mises : largest of the period, mean included, `[n]`
    phases : omega t of both instants, in [0, 2 pi), that of the greater hydrostatic stress first, `[n, 2]`
    """

    alternating: np.ndarray
    mean: np.ndarray
    alternating_von_mises: np.ndarray
    mean_signed_von_mises: np.ndarray
    alternating_principal: np.ndarray
    mean_principal: np.ndarray
    peak_von_mises: np.ndarray
    phases: np.ndarray


def cycle_of(harmonics: np.ndarray) -> Cycle:
    """The cycles of stresses with coefficients mean, cos 1, sin 1, ... of xx, yy, zz, xy, yz, zx, `[nk, n, 6]`."""
    equivalent = deviator(harmonics)
    distance, first, second = widest(equivalent)
    one, other = at_phases(harmonics, first), at_phases(harmonics, second)
    pressure = (one - other)[:, :3].sum(axis=1)
    turned = pressure < -ROUNDING * distance
    alternating = np.where(turned[:, None], -0.5, 0.5) * (one - other)
    mean = 0.5 * (one + other)
    mean_von_mises = von_mises(mean)
    is_compressive = mean[:, :3].sum(axis=1) < -ROUNDING * mean_von_mises
    principal = principal_of(alternating, mean)
    return Cycle(
        alternating=alternating,
        mean=mean,
        alternating_von_mises=0.5 * distance,
        mean_signed_von_mises=np.where(is_compressive, -1.0, 1.0) * mean_von_mises,
        alternating_principal=principal[0],
        mean_principal=principal[1],
        peak_von_mises=longest(equivalent)[0],
        phases=np.where(turned[:, None], np.stack([second, first], axis=1), np.stack([first, second], axis=1)),
    )


def deviator(stress: np.ndarray) -> np.ndarray:
    """Vectors `[..., 5]` whose length is the von Mises stress of tensors `[..., 6]`."""
    xx, yy, zz, *shear = np.moveaxis(stress, -1, 0)
    return np.stack([xx - 0.5 * (yy + zz), np.sqrt(0.75) * (yy - zz), *(np.sqrt(3.0) * tau for tau in shear)], axis=-1)


def von_mises(stress: np.ndarray) -> np.ndarray:
    """Von Mises stress `[...]` of tensors `[..., 6]`."""
    return np.asarray(np.linalg.norm(deviator(stress), axis=-1))


def principal_of(alternating: np.ndarray, mean: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The largest |n A n| of the principal directions n of tensors A `[n, 6]`, and n M n, `[n]` each."""
    values, directions = np.linalg.eigh(_matrices(alternating))
    along = np.einsum("nai,nab,nbi->ni", directions, _matrices(mean), directions)
    size = np.abs(values)
    largest = size.max(axis=1)
    # In pure shear two directions alternate alike.
    rivals = np.where(size >= (1.0 - ROUNDING) * largest[:, None], along, -np.inf)
    return largest, rivals.max(axis=1)


def _matrices(stress: np.ndarray) -> np.ndarray:
    """Tensors as matrices, `[n, 3, 3]`."""
    found = np.zeros((len(stress), 3, 3))
    found[:, ROWS, COLUMNS] = stress
    found[:, COLUMNS, ROWS] = stress
    return found
