"""Mesh and node sets of a CalculiX or Abaqus deck (.inp).

meshio reads nodes and connectivity, but forgets node and element ids, keeps only the last of several `*NODE` blocks,
drops sets named inside sets and `NSET=` on `*NODE`, and knows types in capitals only. So the deck is first reduced to
what meshio reads right, and ids and sets are read here.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from attrito.importers.deck import Block, read_blocks
from attrito.importers.deck_axes import axes_of_nodes
from attrito.importers.deck_elastic import ElementSets, densities, elastic_constants, point_masses
from attrito.importers.deck_ids import (
    ELEMENT_TYPES,
    NODES_PER_FAMILY,
    element_ids,
    element_type,
    fields,
    integers,
    set_members,
)
from attrito.importers.deck_remarks import remarks
from attrito.importers.mesh_data import Mesh, check_coordinates, is_id
from attrito.model.surfaces import element_family
from attrito.support.errors import Fault, InputError

if TYPE_CHECKING:
    import meshio

# Directions that supports hold by name
_SUPPORTS = {
    "ENCASTRE": (1, 2, 3, 4, 5, 6),
    "PINNED": (1, 2, 3),
    "XSYMM": (1, 5, 6),
    "YSYMM": (2, 4, 6),
    "ZSYMM": (3, 4, 5),
    "XASYMM": (2, 3, 4),
    "YASYMM": (1, 3, 5),
    "ZASYMM": (1, 2, 6),
}
# Types that have nodes of solids, and in CalculiX add none
AT_NODES = ("MASS", "SPRING", "DASHPOT", "GAP", "DCOUP3D")
# What makes nodes, elements and sets, or moves them, in ways that are not read
_NOT_READ = {
    "SYSTEM": "coordinates along the global axes",
    **dict.fromkeys(("NGEN", "NFILL", "NCOPY", "NMAP"), "every node under *NODE"),
    **dict.fromkeys(("ELGEN", "ELCOPY"), "every element under *ELEMENT"),
}
# Parameters of what is read; of a set, INTERNAL, UNSORTED and INSTANCE change nothing for one part.
_PARAMETERS = {
    "NODE": ("NSET", "SYSTEM", "INPUT"),
    "ELEMENT": ("TYPE", "ELSET", "INPUT"),
    "NSET": ("NSET", "ELSET", "GENERATE", "INPUT", "INTERNAL", "UNSORTED", "INSTANCE"),
}
# What removes dofs from CalculiX's matrices without holding them at zero.
CONSTRAINTS = (
    "EQUATION", "MPC", "TIE", "RIGID BODY", "COUPLING", "DISTRIBUTING COUPLING", "KINEMATIC COUPLING",
    "CYCLIC SYMMETRY MODEL", "PRE-TENSION SECTION", "EMBEDDED ELEMENT", "SHELL TO SOLID COUPLING",
)  # fmt: skip


def read_deck_mesh(path: str | Path, skip: bool = False) -> Mesh:
    """Read nodes, solid elements (C3D4, C3D8, C3D10, C3D20) and node sets of a deck.

    Parameters
    ----------
    path : the deck
    skip : the matrices are not CalculiX's. Elements of all other types are left out, and listed in `Mesh.skipped`,
        instead of raising a fault where CalculiX makes nodes for them; `*TRANSFORM` raises one, for CalculiX alone
        keeps dofs along x, y, z at such nodes
    """
    path = Path(path)
    blocks = list(read_blocks(path))
    _refuse_assembly(blocks)
    faults = [fault for block in blocks for fault in _not_read(block)]
    if faults:
        raise InputError(*faults)
    transforms = [block for block in blocks if block.keyword == "TRANSFORM"]
    if transforms and skip:
        raise InputError(
            transforms[0].fault(transforms[0].parameters.get("NSET", ""), "dofs along x, y, z at every node")
        )
    # Of output, GLOBAL says the axes of what is printed.
    steps = [block for block in blocks if transforms and block.keyword == "FREQUENCY"]
    own = [block for block in steps if block.parameters.get("GLOBAL", "").upper().startswith("N")]
    if own:
        raise InputError(own[0].fault("GLOBAL=NO", "dofs along x, y, z at nodes of *TRANSFORM, too: GLOBAL=YES"))
    node_blocks = [block for block in blocks if block.keyword == "NODE"]
    element_blocks = [block for block in blocks if block.keyword == "ELEMENT" and block.data]
    if not node_blocks or not element_blocks:
        missing = "*ELEMENT" if node_blocks else "*NODE"
        raise InputError(Fault(str(path), missing, "missing", "a mesh with *NODE and *ELEMENT"))
    others = [block for block in element_blocks if element_type(block) not in ELEMENT_TYPES]
    expanded = [block for block in others if not element_type(block).startswith(AT_NODES)]
    if expanded and not skip:
        raise InputError(*map(_type_fault, expanded))
    element_blocks = [block for block in element_blocks if block not in others]

    nodes = [_place(block, index) for block in node_blocks for index in range(len(block.data))]
    node_ids = integers([words[0] for words in nodes], node_blocks[0], "node ids")
    if len(np.unique(node_ids)) < len(node_ids):
        ids, count = np.unique(node_ids, return_counts=True)
        raise InputError(node_blocks[0].fault(f"node {ids[count > 1][0]} twice", "every node id once"))
    read = _read_with_meshio(nodes, element_blocks, path)
    mesh = Mesh(node_ids, np.asarray(read.points, dtype=np.float64))
    check_coordinates(str(path), node_ids, mesh.coordinates)
    for block, cells in zip(element_blocks, read.cells, strict=True):
        _add_elements(mesh, block, node_ids[cells.data])
    ids = {kind: own for kind, (own, _) in mesh.elements.items()}
    mesh.elastic, mesh.density = elastic_constants(blocks, ids), densities(blocks, ids)
    mesh.point_mass = point_masses(blocks, node_ids)
    mesh.skipped = [f"elements of type {element_type(block)}, line {block.line}" for block in others]
    mesh.remarks = remarks(blocks, {*_NOT_READ, *_PARAMETERS, *CONSTRAINTS})
    mesh.node_sets = _node_sets(blocks, node_ids, mesh)
    mesh.constraints = [f"*{block.keyword}, line {block.line}" for block in blocks if block.keyword in CONSTRAINTS]
    if any(block.keyword == "BOUNDARY" for block in blocks):
        # A support along axes of its own is an equation between dofs along x, y, z.
        mesh.constraints += [f"*BOUNDARY at nodes of *TRANSFORM, line {block.line}" for block in transforms]
    mesh.load_axes = axes_of_nodes(blocks, mesh.node_sets, node_ids, mesh.coordinates)
    mesh.held = _held(blocks, mesh.node_sets)
    mesh.angles = _named(blocks, "RIGID BODY", "ROT NODE", mesh.node_sets)
    mesh.elongations = _named(blocks, "PRE-TENSION SECTION", "NODE", mesh.node_sets)
    files = (file for block in blocks for file in (block.file, block.data_file) if file)
    mesh.files = list(dict.fromkeys([path, *files]))
    return mesh


def _not_read(block: Block) -> list[Fault]:
    """What a block says of nodes, elements and sets that is not read."""
    # *SYSTEM without data goes back to the global axes.
    if block.keyword in _NOT_READ and (block.data or block.keyword != "SYSTEM"):
        return [block.fault("a keyword that is not read", _NOT_READ[block.keyword])]
    known = _PARAMETERS.get(block.keyword)
    faults = [
        block.fault(f"{name}={value}", f"no parameters but {', '.join(known)}")
        for name, value in block.parameters.items()
        if known and name not in known and name
    ]
    if block.keyword == "NODE" and block.parameters.get("SYSTEM", "R").upper() != "R":
        faults.append(block.fault(f"SYSTEM={block.parameters['SYSTEM']}", "coordinates x, y, z"))
    return faults


def _place(block: Block, index: int) -> list[str]:
    """Id and coordinates of a line of `*NODE`; those left out are zero, as in CalculiX."""
    words = fields(block.data[index])
    if len(words) > 4:
        # Commas for decimal points would pass for the normal that nodes of Abaqus's shells have: that is a unit vector.
        normal = block.numbers(index, words[4:])
        if len(words) != 7 or not (abs(np.linalg.norm(normal) - 1.0) < 1e-3 or not np.any(normal)):
            raise InputError(block.fault_at(index, block.data[index], "id, x, y, z, and a unit normal or nothing"))
    return [words[0], *map(repr, block.numbers(index, [*words[1:], "", "", ""][:3]))]


def _named(blocks: list[Block], keyword: str, parameter: str, node_sets: dict[str, np.ndarray]) -> np.ndarray:
    """Nodes that blocks of a keyword name by a parameter, or a node set of it."""
    sets = {name.upper(): ids for name, ids in node_sets.items()}
    found = [np.empty(0, np.int64)]
    for block in blocks:
        if block.keyword == keyword and (name := block.parameters.get(parameter)) is not None:
            found.append(
                sets[name.upper()] if name.upper() in sets else integers([name], block, "a node, or a node set")
            )
    return np.concatenate(found)


def _held(blocks: list[Block], node_sets: dict[str, np.ndarray]) -> np.ndarray:
    """Nodes and directions `[k, 2]` of `*BOUNDARY`: lines `node or set, first direction, last direction` or a name."""
    sets = {name.upper(): ids for name, ids in node_sets.items()}
    held = [np.empty((0, 2), np.int64)]
    for block in blocks:
        for words in map(fields, block.data if block.keyword == "BOUNDARY" else ()):
            # Beyond 6 are temperatures and the like: two digits of any number decide.
            given = [int(word.lstrip("0")[:2] or 0) for word in words[1:3] if word.isdecimal()]
            directions = range(given[0], min(given[-1], 6) + 1) if given else _SUPPORTS.get(words[-1].upper(), ())
            nodes = sets.get(words[0].upper(), [int(words[0])] if is_id(words[0]) else [])
            held += [np.column_stack([nodes, np.full(len(nodes), k)]) for k in directions]
    return np.unique(np.concatenate(held), axis=0)


def _refuse_assembly(blocks: list[Block]) -> None:
    """One part in one place has the node ids that matrices have; several are renumbered, or moved."""
    instances = [block for block in blocks if block.keyword == "INSTANCE"]
    parts = [block for block in blocks if block.keyword == "PART"]
    for block in [*instances[1:], *parts[1:], *(block for block in instances[:1] if block.data)]:
        expected = "a deck of one part that stays where it is, or without parts (in Abaqus/CAE: noPartsInputFile=ON)"
        raise InputError(block.fault(block.parameters.get("NAME", ""), expected))


def _read_with_meshio(nodes: list[list[str]], element_blocks: list[Block], path: Path) -> meshio.Mesh:
    # Only where a mesh is read: loading it takes as long as a small job.
    import meshio

    lines = ["*NODE"]
    lines += [",".join(words) for words in nodes]
    for block in element_blocks:
        family = element_family(element_type(block))
        count, width = sum(len(fields(line)) for line in block.data), NODES_PER_FAMILY[family] + 1
        if count % width:
            expected = f"lines with an id and {width - 1} nodes for each element {element_type(block)}"
            raise InputError(block.fault_at(0, f"{count} numbers", expected))
        lines.append(f"*ELEMENT, TYPE={family}")
        lines += block.data
    with tempfile.TemporaryDirectory() as folder:
        reduced = Path(folder) / "mesh.inp"
        reduced.write_text("\n".join(lines) + "\n")
        try:
            # meshio.read would end the program on a file it cannot read.
            return meshio.abaqus.read(reduced)
        except KeyError as error:
            raise InputError(Fault(str(path), "*ELEMENT", f"node {error}", "nodes that *NODE defines")) from error
        except (meshio.ReadError, ValueError) as error:
            raise InputError(Fault(str(path), "file", str(error), "a mesh that meshio can read")) from error


def _type_fault(block: Block) -> Fault:
    # gmsh writes the surfaces that carry node sets as elements, too; CalculiX would count them as shells.
    expected = f"an element of type {', '.join(ELEMENT_TYPES)} (elements that only mark surfaces or edges: delete them)"
    return block.fault(f"TYPE={element_type(block)}", expected)


def _add_elements(mesh: Mesh, block: Block, connectivity: np.ndarray) -> None:
    kind = ELEMENT_TYPES[element_type(block)]
    ids = element_ids(block)
    if kind in mesh.elements:
        before = mesh.elements[kind]
        ids, connectivity = np.concatenate([before[0], ids]), np.concatenate([before[1], connectivity])
    mesh.elements[kind] = (ids, connectivity)


def _node_sets(blocks: list[Block], node_ids: np.ndarray, mesh: Mesh) -> dict[str, np.ndarray]:
    """Node sets, those of `*NODE, NSET=` included; a name that occurs again adds to its set."""
    elements = ElementSets(blocks)
    members: dict[str, np.ndarray] = {}
    names: dict[str, str] = {}  # CalculiX does not tell capitals apart; the first spelling is kept
    for block in blocks:
        if block.keyword not in ("NODE", "NSET") or "NSET" not in block.parameters:
            continue
        name = block.parameters["NSET"]
        if not name or "/" in name:
            raise InputError(block.fault(f"NSET={name}", "a name without /"))
        name = names.setdefault(name.upper(), name)
        if block.keyword == "NODE":
            ids = integers([fields(line)[0] for line in block.data], block, "node ids")
        elif "ELSET" in block.parameters:
            ids = _nodes_of(elements.members(block.parameters["ELSET"]), mesh)
        else:
            ids = set_members(block, {key: members[names[key]] for key in names if names[key] in members})
            if "GENERATE" in block.parameters:
                # A range runs over the nodes that there are, as in CalculiX.
                ids = ids[np.isin(ids, node_ids)]
        members[name] = np.union1d(members.get(name, ids), ids)
        unknown = np.setdiff1d(members[name], node_ids)
        if len(unknown) > 0:
            raise InputError(block.fault(f"node {unknown[0]} in set {name}", "nodes that *NODE defines"))
        if len(members[name]) == 0:
            raise InputError(block.fault(f"NSET={name}", "a set with nodes"))
    return members


def _nodes_of(elements: np.ndarray, mesh: Mesh) -> np.ndarray:
    """Ids of the nodes of solid elements, by the ids of these."""
    nodes = [np.ravel(connectivity[np.isin(ids, elements)]) for ids, connectivity in mesh.elements.values()]
    return np.unique(np.concatenate(nodes)).astype(np.int64)
