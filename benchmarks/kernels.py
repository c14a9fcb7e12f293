"""What a Newton iteration is made of, beside the machine's own rates: residual and Jacobian, linearised step, contacts.

    .venv/bin/python benchmarks/kernels.py > kernels.json
    .venv/bin/python benchmarks/kernels.py --plane 10 --hexahedral 50 --harmonics 5 --modes 60

Scenes stand at the stuck system's response, at levels where a stated share of the tangents' rows is active: no solve
decides what is timed. Prints JSON: seconds, counted flops and bytes, the least time that the machine's rates leave,
which of them binds (`flops`; bytes in `cache` or from `memory`) and the share of it that the kernel reaches.

Counts, with k = 2 H + 1 coefficients, n stuck modes, m rows of B in contacts of t rows each,
and a active rows of the Jacobian in contacts that have r rows of B together:

    kernel        flops                                        bytes (8 each number)
    event line    16 I k^2 + 40 k^2                            4 I k^2, with I = 8 intervals; roots on 4 k points
    event disc    n (12 k^2 + 48 k + 600)                      n 7 k, with n = 5 k nodes of slip
    residual      6 k m n + the contacts' own                  3 m n, and the contacts' own
    step          4 r a n + 2 k t a^2 + 2 a^3 / 3              3 a^2 (receptances, product with the Jacobian, dense LU)

Of the contacts that share counts that slips.
"""

from __future__ import annotations

import argparse

import common  # isort: skip (sets the threads of BLAS before numpy is loaded)
import numpy as np
import scenes

from attrito.library.reduced_scene import ReducedScene
from attrito.library.session import Options

# Of the scenes
HARMONICS = 5
# Of a period, between events
INTERVALS = 8


def event_line(k: int) -> tuple[float, float]:
    """Flops and bytes of one contact with one tangent, by events."""
    return 16.0 * INTERVALS * k**2 + 40.0 * k**2, 32.0 * INTERVALS * k**2


def event_disc(k: int) -> tuple[float, float]:
    """Flops and bytes of one contact with two tangents that slips throughout, by events."""
    return 5.0 * k * (12.0 * k**2 + 48.0 * k + 600.0), 8.0 * 5.0 * k * 7.0 * k


def residual(k: int, rows: int, modes: int) -> tuple[float, float]:
    """Flops and bytes of the residual without the contacts."""
    return 6.0 * k * rows * modes, 24.0 * rows * modes


def step(k: int, rows_a_contact: int, active: int, modes: int) -> tuple[float, float]:
    """Flops and bytes of one linearised step; active contacts have all their rows of tangents active."""
    active_rows = active / k / max(rows_a_contact - 1, 1) * rows_a_contact
    dense = 2.0 * active**3 / 3.0
    return 4.0 * active_rows * active * modes + 2.0 * k * rows_a_contact * active**2 + dense, 24.0 * active**2


def against(machine: dict, seconds: float, counts: tuple[float, float], working_set: float) -> dict:
    """A kernel beside the machine's bounds; `working_set`, in bytes, says which memory feeds it."""
    flops, size = counts
    memory = "cache" if working_set <= common.CACHE else "memory"
    bounds = {
        "flops": flops / machine["flops_per_second"],
        memory: size / machine[f"{memory}_bytes_per_second"],
    }
    name = max(bounds, key=bounds.__getitem__)
    return {
        "seconds": seconds,
        "flops": flops,
        "bytes": size,
        "bound_by": name,
        "roofline_seconds": bounds[name],
        "share_of_roofline": bounds[name] / seconds,
    }


def slipping_motion(tangents: int, harmonics: int) -> np.ndarray:
    """A motion `[tangents + 1, 2 H + 1]` that slips most of the period, each way, with all harmonics in it."""
    motion = np.random.default_rng(harmonics).standard_normal((tangents + 1, 2 * harmonics + 1))
    motion *= 0.5 ** np.repeat(np.arange(harmonics + 1), 2)[1:]
    motion[:tangents, 1] += 3.0
    motion[-1] *= 0.1
    motion[-1, 0] = 3.0
    return motion


def contact_rows(machine: dict, harmonics: list[int]) -> list[dict]:
    """Kernels of single contacts."""
    rows = []
    for h in harmonics:
        for tangents, (name, counts) in enumerate((("event_line", event_line), ("event_disc", event_disc)), 1):
            laws = scenes.equal_laws(1, tangents, 1.0, 1.0)
            found = common.contact_kernel(laws, slipping_motion(tangents, h))
            counted = counts(2 * h + 1)
            compared = against(machine, found["seconds"], counted, counted[1])
            rows.append({"kernel": name, "harmonics": h, "moving": found["moving"], **compared})
    return rows


def scene_rows(machine: dict, name: str, scene: ReducedScene, shares: list[float]) -> list[dict]:
    """Residual with Jacobian, and linearised step, with shares of the tangents' rows active."""
    stuck = scenes.stuck_system(scene)
    frequency = 0.9 * stuck.frequencies_hz[0]
    highest = 10.0 * scenes.slip_thresholds(scene, stuck, frequency).max()
    rows = []
    with common.TimedSolver(scene, Options(harmonics=HARMONICS)) as solver:
        for share in shares:
            solver.slip_stuck_response(frequency, share, highest)
            evaluation, (seconds, iterations) = solver.evaluation(), solver.linearised_step()
            rows.append(
                {
                    "scene": name,
                    "contacts": len(scene.laws["tangents"]),
                    "modes": len(scene.mass),
                    "harmonics": HARMONICS,
                    "share": share,
                    "active_rows": evaluation["active_rows"],
                    "linear_iterations": iterations,
                    **compare(machine, scene, share, evaluation, seconds),
                }
            )
    return rows


def compare(machine: dict, scene: ReducedScene, share: float, evaluation: dict[str, float], seconds: float) -> dict:
    """Both kernels of a scene and their bounds; a contact that sticks costs nothing."""
    k, rows, modes = 2 * HARMONICS + 1, len(scene.directions), len(scene.mass)
    contacts, tangents = len(scene.laws["tangents"]), scene.laws["tangents"][0]
    whole, contact = residual(k, rows, modes), event_line(k) if tangents == 1 else event_disc(k)
    counted = share * contacts
    together = (whole[0] + counted * contact[0], whole[1] + counted * contact[1])
    active = evaluation["active_rows"]
    return {
        "evaluation": against(machine, evaluation["seconds"], together, 8.0 * rows * modes + contact[1]),
        "step": against(machine, seconds, step(k, rows // contacts, active, modes), 8.0 * active**2),
    }


def main() -> None:
    """Measure what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--plane", type=int, nargs="*", default=[10, 30, 100], help="contacts of the plane block")
    parser.add_argument("--hexahedral", type=int, nargs="*", default=[50, 100], help="contacts of the hexahedral block")
    parser.add_argument("--harmonics", type=int, nargs="+", default=[3, 5, 7, 11])
    parser.add_argument(
        "--shares", type=float, nargs="+", default=[0.0, 0.1, 0.5, 1.0], help="of tangents' rows active"
    )
    parser.add_argument("--modes", type=int, default=200)
    arguments = parser.parse_args()
    machine = common.machine()
    common.progress(f"machine: {machine}")
    rows = []
    for contacts in arguments.plane:
        common.progress(f"plane block, {contacts} contacts")
        rows += scene_rows(machine, "plane", scenes.plane_block(contacts), arguments.shares)
    for contacts in arguments.hexahedral:
        common.progress(f"hexahedral block, {contacts} contacts")
        scene = scenes.hexahedral_block(contacts, arguments.modes)
        rows += scene_rows(machine, "hexahedral", scene, arguments.shares)
    contacts = contact_rows(machine, arguments.harmonics)
    common.report({"machine": machine, "contacts": contacts, "scenes": rows})


if __name__ == "__main__":
    main()
