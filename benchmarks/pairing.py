"""Pairing of two big faces: time and memory of node pairs and of contacts on faces.

    .venv/bin/python benchmarks/pairing.py [--cells 170 190] [--kinds C3D10 C3D20] [--points pair node gauss]

Two blocks lie on each other, bent into a quarter cylinder, with so many cells along an edge of their faces; with the
default x
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import resource
import sys
import time
from pathlib import Path

TESTS = Path(__file__).resolve().parent.parent / "tests" / "python"
sys.path.insert(0, str(TESTS))

from unlike_meshes import cylinder, unlike_joint  # noqa: E402

from attrito.model.face_sets import POINTS, pair_faces  # noqa: E402
from attrito.model.pairing import pair_sets  # noqa: E402
from attrito.model.pairs import contact_rows  # noqa: E402

TOLERANCE = 0.01


def measure(task: tuple[tuple[str, str], tuple[int, int], str]) -> dict[str, object]:
    """Contacts of one kind between blocks of element kinds and cells along an edge."""
    kinds, cells, points = task
    model = unlike_joint(kinds, cells, cylinder)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    clock, processor = time.perf_counter(), time.process_time()
    if points == "pair":
        pairs = pair_sets(model, "top", "bottom", TOLERANCE, 2, "", "")
    else:
        pairs = pair_faces(model, "top", "bottom", TOLERANCE, 2, points, "", "")
    rows = contact_rows(pairs, model)
    return {
        "points": points,
        "nodes": [len(model.node_sets[name]) for name in ("top", "bottom")],
        "contacts": len(pairs.area),
        "seconds": round(time.perf_counter() - clock, 2),
        "processor_seconds": round(time.process_time() - processor, 2),
        "nonzeros": int(rows.nnz),
        "memory_mb": (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) // 1024,
    }


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="Time and memory of pairing two big faces.")
    parser.add_argument("--cells", nargs=2, type=int, default=(170, 190), help="along an edge of each face")
    parser.add_argument("--kinds", nargs=2, default=("C3D10", "C3D20"), help="element types of the two blocks")
    parser.add_argument("--points", nargs="+", choices=("pair", *POINTS), default=("pair", "node", "gauss"))
    arguments = parser.parse_args()
    found = []
    for points in arguments.points:
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            found += pool.map(measure, [(tuple(arguments.kinds), tuple(arguments.cells), points)])
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
