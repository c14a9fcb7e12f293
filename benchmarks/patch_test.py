"""Patch test of contact on faces: a uniform stress across meshes that do not match.

    python benchmarks/patch_test.py [--levels 3] [--picture docs/pictures/patch_test.png]

Two elastic blocks lie on each other, flat, or as two quarter shells. A uniform stress sigma has the displacement
u = eps x in both, and the contacts carry its traction, sigma n. Contacts are springs about that state,

    lambda = A (sigma n - k B u'),   K u' + B^T A k B u' = B^T A sigma n - F_a - F_b,

u' the deviation from u, F the consistent forces of the traction on the faces of a side. The bottom of the lower block
is held at u. So u' = 0, and the stress is exact, where the points of the contacts make consistent forces on both sides.
Errors are those of the stress at the integration points of both blocks, relative to sigma: the largest, and the root
of the mean square. Forces and moments of the contacts on the two sides are compared, too. JSON on standard output.
"""

from __future__ import annotations

import argparse
import json
import sys
from itertools import product
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from scipy.sparse import diags
from scipy.sparse.linalg import splu

TESTS = Path(__file__).resolve().parent.parent / "tests" / "python"
sys.path.insert(0, str(TESTS))

from solids import stiffness, stress  # noqa: E402
from unlike_meshes import cylinder, flat, rigid_motions, unlike_joint  # noqa: E402

from attrito.model.face_sets import POINTS, pair_faces  # noqa: E402
from attrito.model.face_shapes import quadrature, shapes  # noqa: E402
from attrito.model.model import Model  # noqa: E402
from attrito.model.pairs import contact_rows, node_rows  # noqa: E402
from attrito.model.surfaces import set_faces  # noqa: E402
from attrito.plots.style import BRANCH_COLOURS, STYLE  # noqa: E402

# Cells along an edge of the fine and the coarse block, side a being the fine one
FACTORS = {"1.5": (3, 2), "3": (3, 1)}
# Pressure and shear of a plane z = const.; of the shells' faces along their axis
STRESSES = {
    "pressure": -np.eye(3),
    "shear": np.array([[0.0, 0.0, 0.5], [0.0, 0.0, 1.0], [0.5, 1.0, 0.0]]),
}
LABELS = {"node": "nodes", "gauss": "Gauss points", "cut": "cut faces"}
# Errors that are rounding, and where they are drawn
ROUNDING, FLOOR = 1e-12, 1e-15
SPRING = 20.0  # contact stiffness per area; the blocks' shear modulus is 0.8, their edges 1


def patch(
    kinds: tuple[str, str],
    counts: tuple[int, int],
    shape: str,
    points: str,
    sigma: np.ndarray,
    gap: float = 0.0,
    turn: np.ndarray | None = None,
) -> dict[str, float]:
    """Errors of one patch.

    Parameters
    ----------
    kinds, counts : element types of the lower and the upper block, side a and b, and their cells along an edge
    shape, points : names in `SHAPES` and `POINTS`
    sigma, turn : the stress, `[3, 3]`, and a rotation of all

    Returns
    -------
    `largest` and `mean` of the stress, relative; `resultants`: of force and moment, the largest sum of both sides' over
    the larger of 1 and one side's
    """
    turn = np.eye(3) if turn is None else turn
    model = unlike_joint(kinds, counts, SHAPES[shape], gap, turn, counts)
    sigma = turn @ sigma @ turn.T
    pairs = pair_faces(model, "top", "bottom", gap + 0.3 / min(counts), 2, points, "", "")
    rows = contact_rows(pairs, model)
    traction = np.einsum("nrd,dc,nc->nr", pairs.frame, sigma, pairs.frame[:, 2])
    force = rows.T @ (pairs.area[:, None] * traction).ravel()
    imbalance = force - sum(consistent(model, name, sigma) for name in ("top", "bottom")).ravel()
    springs = diags(np.repeat(SPRING * pairs.area, 3))
    matrix = stiffness(model) + rows.T @ springs @ rows
    held = lowest(model.coordinates @ turn, shape)
    free = np.repeat(~held, 3)
    deviation = np.zeros(model.size)
    factors = splu(
        matrix[free][:, free].tocsc(), "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
    deviation[free] = factors.solve(imbalance[free])
    error, volume = stress(model, deviation.reshape(-1, 3))
    norms = np.linalg.norm(error, axis=(1, 2)) / np.linalg.norm(sigma)
    force = force - rows.T @ (springs @ (rows @ deviation))
    rigid, lower = rigid_motions(model), np.isin(model.dof_node, model.node_sets["top"])
    sides = [rigid[side].T @ force[side] for side in (lower, ~lower)]
    return {
        "largest": float(norms.max()),
        "mean": float(np.sqrt(volume @ norms**2 / volume.sum())),
        "resultants": float(np.abs(sides[0] + sides[1]).max() / max(1.0, np.abs(sides[0]).max())),
        "contacts": len(pairs.area),
    }


def shell(points: np.ndarray) -> np.ndarray:
    """Blocks on each other bent about the y axis into quarter shells of radius 1 to 2 and 2 to 3."""
    return cylinder(points + np.array([0.0, 0.0, 1.0]))


def lowest(points: np.ndarray, shape: str) -> np.ndarray:
    """Which nodes are on the lower block's lower face."""
    return (points[:, 2] if shape == "flat" else np.hypot(points[:, 0], points[:, 2]) - 1.0) < 1e-9


def consistent(model: Model, name: str, sigma: np.ndarray) -> np.ndarray:
    """Forces int N sigma n dA of a set's faces at all nodes, `[N, 3]`."""
    forces = np.zeros_like(model.coordinates)
    for ids in set_faces(model.elements, model.node_sets[name]):
        faces = node_rows(model, ids)
        place, weight = quadrature(faces.shape[1])
        shape, r, s = (shapes(faces.shape[1], *place.T, *derivative) for derivative in ((0, 0), (1, 0), (0, 1)))
        x = model.coordinates[faces]
        area = np.cross(np.einsum("gi,fid->fgd", r, x), np.einsum("gi,fid->fgd", s, x))
        np.add.at(forces, faces, np.einsum("g,gi,fgd,dc->fic", weight, shape, area, sigma))
    return forces


SHAPES = {"flat": flat, "cylinder": shell}


def convergence(levels: int, kinds: tuple[str, str] = ("C3D10", "C3D20")) -> list[dict[str, object]]:
    """Errors of every shape, factor and kind of points, meshes finer and finer."""
    found: list[dict[str, object]] = []
    for shape in SHAPES:
        for factor, cells in FACTORS.items():
            for name, sigma in STRESSES.items():
                for points in POINTS:
                    for level in range(1, levels + 1):
                        counts = cells[0] * level, cells[1] * level
                        errors = patch(kinds, counts, shape, points, sigma)
                        found.append(
                            {"shape": shape, "factor": factor, "stress": name, "points": points, "cells": counts}
                            | errors
                        )
                        print(json.dumps(found[-1]), file=sys.stderr)
    return found


def orders(found: list[dict[str, object]], key: str = "mean") -> list[dict[str, object]]:
    """Order of every series between its last two meshes, error ~ h^order; none where the error is rounding."""
    names = ("shape", "factor", "stress", "points")
    series: dict[tuple, list[dict[str, object]]] = {}
    for one in found:
        series.setdefault(tuple(one[name] for name in names), []).append(one)
    said = []
    for place, rows in series.items():
        (n, e), (m, f) = ((row["cells"][0], row[key]) for row in rows[-2:])
        order = float(np.log(e / f) / np.log(m / n)) if f > ROUNDING else None
        said.append(dict(zip(names, place, strict=True)) | {"order": order, "error": f})
    return said


def draw(found: list[dict[str, object]], path: Path) -> None:
    """Root mean square of the stress's error against the size of side a's faces, a panel a shape and stress."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(8.0, 6.6))
        grid = figure.subplots(2, 2, sharex=True, sharey="row")
        for axes, (shape, stress_name) in zip(grid.flat, product(SHAPES, STRESSES), strict=True):
            for points, colour in zip(POINTS, BRANCH_COLOURS, strict=False):
                for factor, line in zip(FACTORS, ("-", "--"), strict=True):
                    wanted = (shape, stress_name, points, factor)
                    rows = [
                        row for row in found if tuple(row[k] for k in ("shape", "stress", "points", "factor")) == wanted
                    ]
                    size, error = ([1 / row["cells"][0] for row in rows], [row["mean"] for row in rows])
                    label = f"{LABELS[points]}, 1 : {factor}"
                    axes.loglog(
                        size, np.maximum(error, FLOOR), line, color=colour, marker="o", markersize=3.5, label=label
                    )
            axes.set_title(f"{shape}, {stress_name}")
        cells = sorted({row["cells"][0] for row in found})
        for axes in grid[1]:
            axes.set_xticks([1 / count for count in cells], [f"1/{count}" for count in cells])
            axes.set_xticks([], minor=True)
            axes.set_xlabel("Edge of the finer faces over the block's")
        for axes in grid[:, 0]:
            axes.set_ylabel("Error of the stress (rms, relative)")
        figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="lower center", ncol=3)
        figure.subplots_adjust(left=0.09, right=0.98, top=0.95, bottom=0.17, wspace=0.08, hspace=0.16)
        figure.savefig(path, dpi=150)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="Patch test of contact on faces.")
    parser.add_argument("--levels", type=int, default=3, help="how many meshes, each an n-th of the first's size")
    parser.add_argument("--picture", type=Path, help="where to draw the errors")
    arguments = parser.parse_args()
    found = convergence(arguments.levels)
    if arguments.picture:
        draw(found, arguments.picture)
    print(json.dumps({"errors": found, "orders": orders(found) if arguments.levels > 1 else []}, indent=1))


if __name__ == "__main__":
    main()
