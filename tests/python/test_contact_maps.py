"""Maps of contacts as faces: the cells cover the surface once, hold their contacts, and carry their values."""

from __future__ import annotations

import matplotlib
import numpy as np
import pytest
import synthetic
from edited import edited
from jobs import write_blocks
from matplotlib.collections import PathCollection, PolyCollection
from matplotlib.path import Path
from unlike_meshes import unlike_joint

from attrito.model.closest_points import Faces
from attrito.model.contact_cells import contact_cells, cut, polygon_area
from attrito.model.face_sets import pair_faces
from attrito.model.pairing import pair_sets
from attrito.model.pairs import node_rows
from attrito.model.surfaces import set_faces
from attrito.plots.contact_maps import STATE_LOOKS, contact_map
from attrito.plots.contact_surfaces import surfaces
from attrito.results.mesh import mesh_of
from attrito.results.result import Result

# Sums of some hundred products of numbers of order one
ROUNDING = 1e-12


def sheared(points):
    """Parallelograms of rectangles: facets whose quarters still have equal areas."""
    return points @ np.array([[1.0, 0.3, 0.0], [0.4, 1.0, 0.0], [0.0, 0.0, 1.0]])


def cells_of(model, pairs, name="top"):
    blocks = [node_rows(model, block) for block in set_faces(model.elements, model.node_sets[name])]
    return contact_cells(
        Faces(model.coordinates, blocks), pairs.position, pairs.frame[:, 2], node_rows(model, pairs.node_a)
    )


def areas_of_contacts(cells, count):
    areas = np.zeros(count)
    np.add.at(areas, cells.contact, polygon_area(cells.outlines))
    return areas


def is_inside(outline, place):
    # Corners of the surface are nodes, and stand on their cell's edge.
    own = Path(outline[:, :2])
    return own.contains_point(place[:2], radius=1e-9) or own.contains_point(place[:2], radius=-1e-9)


@pytest.mark.parametrize("kind", ["C3D4", "C3D8", "C3D10", "C3D20"])
def test_cells_of_nodes_have_their_tributary_areas_and_hold_them(kind):
    model = synthetic.joint(kind, (3, 2, 1), shape=sheared)
    pairs = pair_sets(model, "top", "bottom", 1e-6, 2, "job.toml", "contact_set[0]")
    cells = cells_of(model, pairs)
    assert len(cells.outlines) == len(pairs.area)
    assert areas_of_contacts(cells, len(pairs.area)) == pytest.approx(pairs.area, rel=ROUNDING)
    for outline, contact in zip(cells.outlines, cells.contact, strict=True):
        assert is_inside(outline, pairs.position[contact])


def test_a_node_without_a_partner_keeps_a_cell_that_is_no_contact_s():
    model = synthetic.joint("C3D8", (2, 2, 1))
    lost = model.node_sets["bottom"][0]
    model.node_sets["bottom"] = model.node_sets["bottom"][1:]
    assert lost not in model.node_sets["bottom"]
    pairs = pair_sets(model, "top", "bottom", 1e-6, 2, "job.toml", "contact_set[0]")
    cells = cells_of(model, pairs)
    bare = polygon_area([outline for outline, own in zip(cells.outlines, cells.contact, strict=True) if own < 0])
    # A corner of four squares of a half by a half.
    assert bare == pytest.approx([1 / 16], rel=ROUNDING)
    assert polygon_area(cells.outlines).sum() == pytest.approx(1.0, rel=ROUNDING)


GAUSS, CUT = "gauss", "cut"


@pytest.mark.parametrize(
    ("kinds", "points"),
    [
        (("C3D8", "C3D8"), GAUSS),
        (("C3D20", "C3D8"), GAUSS),
        (("C3D10", "C3D8"), GAUSS),
        (("C3D8", "C3D4"), CUT),
        (("C3D20", "C3D10"), CUT),
    ],
)
def test_cells_of_points_within_faces_share_them_out_and_hold_their_points(kinds, points):
    model = unlike_joint(kinds, (2, 3))
    pairs = pair_faces(model, "top", "bottom", 0.1, 2, points, "job.toml", "contact_set[0]")
    cells = cells_of(model, pairs)
    assert sorted(cells.contact) == list(range(len(pairs.area)))
    assert polygon_area(cells.outlines).sum() == pytest.approx(1.0, rel=ROUNDING)
    for outline, contact in zip(cells.outlines, cells.contact, strict=True):
        assert is_inside(outline, pairs.position[contact])
    if points == "gauss" and kinds[0] != "C3D10":
        # 2 x 2 points of a square have a quarter each.
        assert areas_of_contacts(cells, len(pairs.area)) == pytest.approx(pairs.area, rel=ROUNDING)


def test_a_square_is_cut_half_way_between_two_points():
    square = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, 1.0], [0.0, 1.0, 1.0]])
    left = cut(square, np.array([0.25, 0.5, 1.0]), np.array([0.75, 0.5, 1.0]))
    assert polygon_area([left]) == pytest.approx([0.5], rel=ROUNDING) and left[:, 0].max() == pytest.approx(0.5)


def test_contacts_that_are_not_on_the_surface_have_no_cells():
    model = synthetic.joint("C3D8", (2, 2, 1))
    pairs = pair_sets(model, "top", "bottom", 1e-6, 2, "job.toml", "contact_set[0]")
    pairs.position[:, 2] += 0.01
    assert cells_of(model, pairs) is None


@pytest.fixture
def joined(tmp_path):
    """A result of contacts between the nodes of two blocks, with its model beside it."""
    model = write_blocks(tmp_path / "model.h5")
    pairs = pair_sets(model, "top", "bottom", 1e-6, 2, "job.toml", "contact_set[0]")
    count = len(pairs.area)
    parameters = {
        "set": np.full(count, b"top - bottom"), "position": pairs.position, "frame": pairs.frame,
        "area": pairs.area, "node_a": pairs.node_a, "node_b": pairs.node_b,
    }  # fmt: skip
    path = synthetic.write_result(
        tmp_path / "r.h5", [1.0], {}, contacts=synthetic.contact_data(1, count, 2), parameters=parameters
    )
    with edited(path) as file:
        file.attrs["model_file"] = str(tmp_path / "model.h5")
        for name, unit in (("dissipated_energy", "mJ"), ("parameters/area", "mm^2")):
            file[f"contacts/{name}"].attrs["unit"] = unit
    return path


def test_a_map_colours_the_faces_of_every_contact_by_its_own_value(joined):
    with Result(joined) as result:
        figure = contact_map(result, 0, "energy")
        (surface,) = surfaces(result, mesh_of(result))
        density = result.array("/contacts/dissipated_energy")[0] / result.array("/contacts/parameters/area")
        opened = result.array("/contacts/open")[0]
    axes, bar = figure.axes
    assert "mJ/mm\u00b2" in bar.get_ylabel().replace("\n", " ")
    drawn = {}
    for collection in axes.collections:
        assert isinstance(collection, PolyCollection)
        paths = collection.get_paths()
        for path, colour in zip(paths, np.resize(collection.get_facecolor(), (len(paths), 4)), strict=True):
            drawn[path.vertices[:-1].round(9).tobytes()] = colour
    assert len(drawn) == len(surface.cells)
    colours = matplotlib.colormaps["magma_r"](density / density.max())
    for outline, owner in zip(surface.cells, surface.owner, strict=True):
        wanted = (1.0, 1.0, 1.0, 1.0) if opened[owner] >= 1 else colours[owner]
        assert drawn[outline.round(9).tobytes()] == pytest.approx(wanted)


def test_a_map_of_states_has_the_area_of_each_state(joined):
    with Result(joined) as result:
        (axes,) = contact_map(result, 0, "state").axes
        state, area = result.array("/contacts/state")[0], result.array("/contacts/parameters/area")
        names = result.names("/contacts/state")
    for name in STATE_LOOKS:
        (own,) = [one for one in axes.collections if one.get_label() == name.replace("_", " ")]
        corners = [path.vertices[:-1] for path in own.get_paths()]
        drawn = polygon_area([np.column_stack([one, np.zeros(len(one))]) for one in corners])
        assert drawn.sum() == pytest.approx(area[state == names.index(name)].sum(), rel=ROUNDING)


def test_without_its_mesh_or_with_another_contacts_are_dots(joined):
    with edited(joined) as file:
        file["contacts/parameters/position"][:] += [0.0, 0.0, 1.0]
    with Result(joined) as result:
        axes = contact_map(result, 0, "state").axes[0]
    assert any(isinstance(one, PathCollection) for one in axes.collections)
    assert not any(isinstance(one, PolyCollection) for one in axes.collections)
