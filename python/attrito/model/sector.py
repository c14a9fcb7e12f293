"""One of N equal sectors of a wheel: its boundaries paired by rotation, and its upper one in the next sector's axes.

Sector j + 1 is sector j turned by R, 2 pi / N about the axis by the right-hand rule. A node x of the lower boundary has
its partner of the upper one at R x, and with displacements along axes that turn with the sectors

    q_upper, along the axes of its own sector  =  R q_lower of the next sector, along the next one's

so that q = A p, A the block R at the nodes of the upper boundary and 1 elsewhere, takes the upper boundary's
displacements along the next sector's axes: p_upper of a sector is p_lower of the next.

A node on the axis is in all sectors at once. Its p are two displacements across the axis, the second a quarter turn
ahead of the first, and one along it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix, identity, kron

from attrito.model.model import Model
from attrito.model.pairs import Pairs, contact_rows, node_rows, some

# Part of the model's extent by which nodes that are one another's image may differ: decks have six digits
NEAR = 1e-5
# Part of the least distance of two nodes of a boundary, where that is less
OF_SPACING = 0.1
# Part of a unit vector that counts as none
NEGLIGIBLE = 1e-12


@dataclass(frozen=True)
class Axis:
    """The wheel's axis: a point of it `[3]` (user length), and its unit direction `[3]`."""

    point: np.ndarray
    direction: np.ndarray

    def turn(self, angle: float) -> np.ndarray:
        """R `[3, 3]`: vectors turned by an angle (rad) about the axis, by the right-hand rule."""
        a = self.direction
        across = np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])
        turned: np.ndarray = np.eye(3) + np.sin(angle) * across + (1.0 - np.cos(angle)) * across @ across
        return turned

    def turned(self, points: np.ndarray, angle: float) -> np.ndarray:
        """Points `[n, 3]` turned about the axis."""
        moved: np.ndarray = self.point + (points - self.point) @ self.turn(angle).T
        return moved

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Of points `[n, 3]` from the axis, `[n]`."""
        arm = points - self.point
        distance: np.ndarray = np.linalg.norm(arm - np.outer(arm @ self.direction, self.direction), axis=1)
        return distance


def axis_of(point: list[float], direction: list[float]) -> Axis:
    """An axis through a point along a direction of any length."""
    return Axis(np.array(point), np.array(direction) / np.linalg.norm(direction))


class PairingError(ValueError):
    """The boundaries do not meet; the text says what was expected, `value` what is there."""

    def __init__(self, value: str, expected: str):
        super().__init__(expected)
        self.value = value


def pair_boundaries(
    model: Model,
    lower: np.ndarray,
    upper: np.ndarray,
    names: tuple[str, str],
    axis: Axis,
    sectors: int,
    tolerance: float | None = None,
) -> tuple[np.ndarray, np.ndarray, float]:
    """Node ids of the lower boundary and of their partners on the upper one, `[k]` each, the nearest to their images.

    The last is how far at most a partner is from an image (user length).

    Parameters
    ----------
    lower, upper : node ids of the two sets
    names : of the sets, for messages
    axis, sectors : of the wheel
    tolerance : how far partners may be (user length); None: what rounding leaves

    Nodes on the axis have no image but themselves, and are left out, whichever set has them.

    Raises
    ------
    PairingError : nodes of both sets that are not on the axis, or without a partner
    """
    aside = nodes_on_axis(model, axis)
    lower, upper = np.setdiff1d(lower, aside), np.setdiff1d(upper, aside)
    common = np.intersect1d(lower, upper)
    if len(common):
        expected = f"a node set without nodes of {names[0]}, but for nodes on the axis"
        raise PairingError(f"{names[1]} ({some(common)})", expected)
    places = [model.coordinates[node_rows(model, ids)] for ids in (lower, upper)]
    if not len(lower) and not len(upper):
        return lower, upper, 0.0
    near = min(_near(model), OF_SPACING * _spacing(places[0]), OF_SPACING * _spacing(places[1]))
    near = near if tolerance is None else tolerance
    index = _images(places, axis, 2.0 * np.pi / sectors, near)
    if index is not None:
        apart = axis.turned(places[0], 2.0 * np.pi / sectors) - places[1][index]
        return lower, upper[index], float(np.linalg.norm(apart, axis=1).max())
    raise _unpaired(places, (lower, upper), names, axis, sectors, near)


def _near(model: Model) -> float:
    """How far from each other nodes of a model may be that are one another's image."""
    return NEAR * float(np.linalg.norm(np.ptp(model.coordinates, axis=0)))


def nodes_on_axis(model: Model, axis: Axis) -> np.ndarray:
    """Ids of the nodes on the axis, ascending."""
    return np.unique(model.node_ids[axis.distance(model.coordinates) <= _near(model)])


def _spacing(points: np.ndarray) -> float:
    """The least distance of two points; infinite of a single one."""
    from scipy.spatial import cKDTree

    return float(cKDTree(points).query(points, k=2)[0][:, 1].min()) if len(points) > 1 else np.inf


def _images(places: list[np.ndarray], axis: Axis, angle: float, near: float) -> np.ndarray | None:
    """Which point of the second cloud is the image of each of the first; None unless the clouds are one another's."""
    from scipy.spatial import cKDTree

    lower, upper = places
    if len(lower) != len(upper) or not len(lower):
        return None
    distance, index = cKDTree(upper).query(axis.turned(lower, angle))
    fits = np.all(distance <= near) and len(np.unique(index)) == len(upper)
    return np.asarray(index) if fits else None


def _unpaired(
    places: list[np.ndarray],
    ids: tuple[np.ndarray, np.ndarray],
    names: tuple[str, str],
    axis: Axis,
    sectors: int,
    near: float,
) -> PairingError:
    """What to say of boundaries that do not meet: by which angle they would, or which nodes are alone."""
    from scipy.spatial import cKDTree

    lower, upper = places
    turned = f"{names[0]}, turned by 2 pi / {sectors} about the axis"
    for angle in _angles(places, axis, near):
        if _images(places, axis, angle, near) is None:
            continue
        if angle < 0.0 and _images(places[::-1], axis, 2.0 * np.pi / sectors, near) is not None:
            expected = f"nodes of {turned}: they are those of {names[1]} turned so; exchange lower and upper"
            return PairingError(names[1], f"{expected}, or reverse axis_direction")
        count = 2.0 * np.pi / abs(angle)
        words = f"sectors = {round(count)} fits"
        if abs(count - round(count)) > NEAR * count:
            words = f"no number of sectors fits: the sector spans {np.degrees(abs(angle)):.6g} degrees"
        if angle < 0.0:
            words += ", with lower and upper exchanged"
        return PairingError(names[1], f"nodes of {turned}; {words}")
    alone = []
    for name, own, other, way in ((names[0], lower, upper, 1.0), (names[1], upper, lower, -1.0)):
        distance = cKDTree(other).query(axis.turned(own, way * 2.0 * np.pi / sectors))[0]
        nodes = ids[0 if way > 0 else 1][distance > near]
        if len(nodes):
            alone.append(f"{len(nodes)} of {len(own)} nodes of {name} are alone ({some(nodes)})")
    words = "; ".join(alone) or "nodes of one share a partner in the other"
    return PairingError(names[1], f"as many nodes as {turned}, at most {near:.3g} from them; {words}")


def _angles(places: list[np.ndarray], axis: Axis, near: float) -> list[float]:
    """Angles (rad) by which the lower point farthest from the axis might come onto points of the upper cloud."""
    lower, upper = places
    if not len(lower) or not len(upper):
        return []
    first = lower[np.argmax(axis.distance(lower))] - axis.point
    height = (upper - axis.point) @ axis.direction
    same = np.abs(axis.distance(upper) - axis.distance(first[None] + axis.point)) <= near
    same &= np.abs(height - first @ axis.direction) <= near
    out = first - (first @ axis.direction) * axis.direction
    beside = np.cross(axis.direction, out)
    arms = upper[same] - axis.point
    return [float(angle) for angle in np.unique(np.arctan2(arms @ beside, arms @ out)) if abs(angle) > NEGLIGIBLE]


def paired_dofs(
    model: Model, lower: np.ndarray, upper: np.ndarray, rotation: np.ndarray
) -> tuple[np.ndarray, np.ndarray, csr_matrix]:
    """Dofs of paired nodes, and the axes of the upper ones.

    Parameters
    ----------
    lower, upper : node ids, paired `[k]`
    rotation : R, from this sector to the next `[3, 3]`

    Returns
    -------
    dofs of both boundaries, paired, and A `[n, n]` with q = A p (head of this file)

    Raises
    ------
    PairingError : partners that are held otherwise, or held along a direction that R mixes with a free one
    """
    near = np.flatnonzero(np.isin(model.dof_node, np.concatenate([lower, upper])))
    pairs = zip(model.dof_node[near].tolist(), model.dof_direction[near].tolist(), strict=True)
    dofs = dict(zip(pairs, near.tolist(), strict=True))
    below, above = [], []
    rows, columns, values = [], [], []
    turned = np.zeros(model.size, dtype=bool)
    for first, second in zip(lower.tolist(), upper.tolist(), strict=True):
        for kind in ((1, 2, 3), (4, 5, 6)):
            own = [dofs.get((first, direction), -1) for direction in kind]
            partner = [dofs.get((second, direction), -1) for direction in kind]
            free = np.array(partner) >= 0
            if np.any((np.array(own) >= 0) != free):
                raise PairingError(
                    f"node {second}, partner of node {first}", "partners with the same dofs free, each in its own axes"
                )
            mixed = np.abs(rotation) > NEGLIGIBLE
            if np.any(mixed[np.ix_(free, ~free)]) or np.any(mixed[np.ix_(~free, free)]):
                raise PairingError(
                    f"node {second}, held in part",
                    "nodes that are free or held along all directions that the rotation to the next sector mixes",
                )
            for i in np.flatnonzero(free):
                below.append(own[i])
                above.append(partner[i])
                turned[partner[i]] = True
                for j in np.flatnonzero(free & mixed[i]):
                    rows.append(partner[i])
                    columns.append(partner[j])
                    values.append(rotation[i, j])
    others = np.flatnonzero(~turned)
    entries = np.concatenate([np.ones(len(others)), values])
    places = np.concatenate([others, rows]).astype(int), np.concatenate([others, columns]).astype(int)
    axes = coo_matrix((entries, places), shape=(model.size, model.size)).tocsr()
    return np.array(below, dtype=np.int64), np.array(above, dtype=np.int64), axes


def axis_dofs(model: Model, axis: Axis) -> tuple[np.ndarray, np.ndarray, csr_matrix]:
    """Free dofs of nodes on the axis, and their axes: along the wheel's axis and across it.

    Returns
    -------
    dofs along the axis `[a]` and in pairs across it `[c, 2]`, each a dof of the node as it is numbered, and A `[n, n]`,
    q = A p, with p along the axis and across it; the second of a pair is a quarter turn ahead of the first

    Raises
    ------
    PairingError : a node that is held along a direction neither along nor across the axis, or half across it
    """
    along, across = [], []
    axes = identity(model.size, format="lil")
    near = np.flatnonzero(np.isin(model.dof_node, nodes_on_axis(model, axis)))
    pairs = zip(model.dof_node[near].tolist(), model.dof_direction[near].tolist(), strict=True)
    dofs = dict(zip(pairs, near.tolist(), strict=True))
    for node in np.unique(model.dof_node[near]).tolist():
        for kind in ((1, 2, 3), (4, 5, 6)):
            own = np.array([dofs.get((node, direction), -1) for direction in kind])
            free = own >= 0
            if not np.any(free):
                continue
            basis = _along_and_across(axis.direction, free)
            if basis is None:
                expected = (
                    "nodes on the axis that are free or held along it, and free or held in all directions across it"
                )
                raise PairingError(f"node {node} on the axis, held in part", expected)
            own = own[free]
            axes[np.ix_(own, own)] = basis
            if free.sum() > 1:
                across.append(own[:2])
            if free.sum() != 2:
                along.append(own[-1])
    shape = np.array(across, dtype=np.int64).reshape(-1, 2)
    return np.array(along, dtype=np.int64), shape, axes.tocsr()


def _along_and_across(direction: np.ndarray, free: np.ndarray) -> np.ndarray | None:
    """Columns across the axis and along it, of the free directions of a node; None where these are neither."""
    of_axis = np.abs(direction) > NEGLIGIBLE
    if free.sum() == 1:
        return np.eye(1) if np.array_equal(free, of_axis) else None
    if free.sum() == 2 and np.any(of_axis & free):
        return None
    first = np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))])
    if free.sum() == 2:
        first = np.eye(3)[np.argmax(free)]
    first /= np.linalg.norm(first)
    columns = np.column_stack([first, np.cross(direction, first), direction])
    basis: np.ndarray = columns if free.all() else columns[free, :2]
    return basis


def beside_the_next(model: Model, name: str, axis: Axis, sectors: int) -> tuple[Model, np.ndarray]:
    """The model with a node set where the next sector has it, for contacts across, and R `[3, 3]`."""
    angle = 2.0 * np.pi / sectors
    coordinates = model.coordinates.copy()
    rows = node_rows(model, np.intersect1d(model.node_sets.get(name, []), model.node_ids))
    coordinates[rows] = axis.turned(coordinates[rows], angle)
    return replace(model, coordinates=coordinates), axis.turn(angle)


def rows_across(pairs: Pairs, model: Model, rotation: np.ndarray) -> tuple[csr_matrix, csr_matrix]:
    """Rows of B on this sector's dofs, side a, and on the next one's, side b, in the next sector's own axes.

    Returns
    -------
    csr `[nc * (tangents + 1), n]` each, in the order of `contact_rows`
    """
    own_axes = csr_matrix(kron(identity(len(model.node_ids)), rotation))
    nothing = csr_matrix(pairs.motion_a.shape)
    own = contact_rows(replace(pairs, motion_b=nothing), model)
    beyond = contact_rows(replace(pairs, motion_a=nothing, motion_b=csr_matrix(pairs.motion_b @ own_axes)), model)
    return own, beyond
