"""The job's choices of the harmonic balance, as the solver takes them."""

from __future__ import annotations

from attrito.job.job import Job
from attrito.library.session import Options
from attrito.scene.rom_file import Rom

# Where they are chosen point by point, to begin with
FIRST_HARMONICS = 3
# Of a balance by samples, which no job asks for
SAMPLES = 256


def solver_options(job: Job, rom: Rom | None = None) -> Options:
    """The job's choices of the balance, and what its reduced model, if there is one, leaves out."""
    balance = job["balance"]
    automatic = balance["harmonics"] == "auto"
    loaded = max((load["harmonic"] for load in job["load"] if load["kind"] == "harmonic"), default=1)
    harmonics = max(FIRST_HARMONICS, loaded) if automatic else balance["harmonics"]
    return Options(
        harmonics=harmonics,
        samples=max(SAMPLES, 6 * harmonics + 2),
        max_iterations=balance["max_iterations"],
        tolerance=balance["residual_tolerance"],
        reset_slider=job["static"]["slider"] == "reset",
        uncoupled=balance["approach"] == "uncoupled",
        choose_harmonics=automatic,
        accepted_error=balance["tolerance"] or 0.0,
        mode_error=0.0 if rom is None else rom.mode_error,
        curve_tolerance=job["continuation"]["curve_tolerance"],
    )
