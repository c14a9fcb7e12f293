"""Names of what crosses to the Fortran library as a number, in its order; a test holds both sides together."""

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
# Fallback strategies where Newton's method fails, in their order
STRATEGIES = (
    "newton_early_stop",
    "mean_regularisation",
    "time_integration",
    "period_march",
    "newton",
    "stuck_response",
    "frequency_homotopy",
    "level_homotopy",
    "stiffness_homotopy",
)
# Contact laws
LAWS = ("coulomb", "pressure", "iwan")
# Of a contact over the period
STATES = ("stuck", "shaken_down", "slipping", "open")
# Of a contact at an instant
REGIMES = ("stick", "slip", "open")
DAMPING_KINDS = {"none": 0, "viscous": 1, "ratio": 2, "mass": 3, "loss_factor": 4}

# Of stability: the engines, by the number that the library adds up; whose orbit; what an examination says; multipliers
ENGINES = {"monodromy": 1, "hill": 2}
ORBITS = {"balance": 0, "exact": 1, "auto": 2}
VERDICTS = ("unstable", "stable", "indeterminate")
MULTIPLIER_KINDS = ("floquet", "slip", "stuck")
BIFURCATION_KINDS = ("fold", "contact_fold", "flip", "neimark_sacker", "branch_point", "contact_crossing")
# Ways to look for a point of another branch
STARTS = ("cold", "in_motion", "from_preload")

# Linear systems to compare with: every contact stuck; closed without friction; as at rest, closed ones stuck
REFERENCES = ("stuck", "frictionless", "tangent")

# Of peaks: whose amplitude, and in what they are followed
AMPLITUDES = ("half_range", "first_harmonic")
PARAMETERS = ("level", "preload")
# Why a curve of peaks ends
ENDINGS = ("none", "not_found", "leaves_band", "no_periodic_motion")

# What is differentiated: of monitors, but for work and mean forces, which are of contacts
QUANTITIES = ("amplitude", "mean", "dissipated_energy", "t1_mean", "t2_mean", "n_mean", "first_cosine", "first_sine")

# Of integration in time, and why its motion has not converged
SCHEMES = ("event", "central_difference", "newmark", "hht", "generalised_alpha", "exponential")
REASONS = ("none", "settling", "step", "diverged")

# Of the reduction; orderings of the rows for the factorisation of the interior stiffness and eigensolvers for the
# fixed-interface modes cross by their names, the default first.
REDUCTION_STEPS = (
    "read",
    "count",
    "factor",
    "constraint",
    "modes",
    "correction",
    "indicator",
    "inertia",
    "project",
    "write",
)
ORDERINGS = ("scotch", "pord", "amf", "qamd", "amd")
EIGENSOLVERS = ("slepc", "block_lanczos")

# Each that crosses as a number, by the name that the library gives it.
ENUMERATIONS: dict[str, tuple[str, ...] | dict[str, int]] = {
    "outcomes": OUTCOMES,
    "strategies": STRATEGIES,
    "states": STATES,
    "laws": LAWS,
    "regimes": REGIMES,
    "damping_kinds": DAMPING_KINDS,
    "engines": ENGINES,
    "orbits": ORBITS,
    "verdicts": VERDICTS,
    "multiplier_kinds": MULTIPLIER_KINDS,
    "bifurcation_kinds": BIFURCATION_KINDS,
    "starts": STARTS,
    "references": REFERENCES,
    "amplitudes": AMPLITUDES,
    "parameters": PARAMETERS,
    "endings": ENDINGS,
    "quantities": QUANTITIES,
    "schemes": SCHEMES,
    "reasons": REASONS,
    "reduction_steps": REDUCTION_STEPS,
}
