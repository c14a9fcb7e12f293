"""Names of what crosses to the Fortran library as a number, in the library's order."""

from __future__ import annotations

OUTCOMES = (
    "converged",
    "unstable",
    "indeterminate",
    "no_period_one_orbit",
    "not_converged",
    "above_tolerance",
)
# Of points without a solution
NO_SOLUTION = ("no_period_one_orbit", "not_converged")
# What the cascade tries, in its order; src/solve/strategies.f90 has the same names.
ATTEMPTS = (
    "newton_briefly",
    "held_mean",
    "motion_in_time",
    "held_force_steps",
    "newton",
    "stuck_response",
    "frequency_steps",
    "force_steps",
    "stiffness_steps",
)
DAMPING_KINDS = {"none": 0, "viscous": 1, "ratio": 2, "mass": 3, "loss_factor": 4}
# Of the rows for the factorisation of the interior stiffness, the default first.
ORDERINGS = ("scotch", "pord", "amf", "qamd", "amd")
# Of the fixed-interface modes, the default first.
EIGENSOLVERS = ("slepc", "block_lanczos")
