"""Mesh and physical groups of gmsh's files (.msh), formats 2.2 and 4.1, text or binary.

Nodes have gmsh's tags as ids. Tetrahedra and bricks with 4, 8, 10 or 20 nodes are read; elements of lower dimension
serve physical groups, each of which is a node set: of its name, or `surface_3` and the like where it has none.
meshio would not do: it forgets the tags, and its version in Debian 12 fails where only some entities are in groups.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np

from attrito.importers.mesh_data import Mesh, check_nodes, new_mesh
from attrito.importers.source import refuse

HEADER = b"$MeshFormat"
# Nodes of gmsh's types of elements
_NODES = {1: 2, 2: 3, 3: 4, 4: 4, 5: 8, 6: 6, 7: 5, 8: 3, 9: 6, 10: 9, 11: 10, 12: 27, 13: 18, 14: 14, 15: 1, 16: 8,
          17: 20, 18: 15, 19: 13, 20: 9, 21: 10, 22: 12, 23: 15, 24: 15, 25: 21, 26: 4, 27: 5, 28: 6, 29: 20, 30: 35,
          31: 56, 36: 16, 37: 25, 38: 36, 92: 64, 93: 125}  # fmt: skip
_SOLIDS = {4: "C3D4", 5: "C3D8", 11: "C3D10", 17: "C3D20"}
# Solids without a reader
_OTHERS = {6, 7, 12, 13, 14, 18, 19, 29, 30, 31, 92, 93}
# CalculiX's order of gmsh's nodes: edges of the base, of the top, upright
_ORDER = {
    "C3D10": [*range(8), 9, 8],
    "C3D20": [*range(8), 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15],
}
_DIMENSIONS = ("point", "curve", "surface", "volume")
_LARGEST = 2.0**53


class _Section:
    """Numbers of a section, one after another, in text or binary."""

    def __init__(self, path: str, name: str, data: bytes, binary: bool, size: int):
        self.path, self.name, self.binary = path, name, binary
        self.data, self.place = data, 0
        self.whole = np.dtype(f"u{size}")
        if not binary:
            try:
                self.numbers = np.array(data.split(), float)
            except ValueError as error:
                raise self.fault(str(error)) from None

    def fault(self, value: object, expected: str = "a whole file of format 2.2 or 4.1") -> Exception:
        """What is wrong with the section."""
        return refuse(self.path, f"${self.name}", value, expected)

    def doubles(self, count: int) -> np.ndarray:
        """Real numbers."""
        return self._take(count, np.dtype("f8"))

    def integers(self, count: int) -> np.ndarray:
        """Whole numbers of 4 bytes."""
        return self._take(count, np.dtype("i4")).astype(np.int64)

    def sizes(self, count: int) -> np.ndarray:
        """Whole numbers of as many bytes as the file says."""
        found = self._take(count, self.whole)
        if np.any(found > _LARGEST):
            raise self.fault(int(found.max()))
        return found.astype(np.int64)

    def line(self) -> int:
        """The number on a line of its own that comes before binary data."""
        if not self.binary:
            return int(self.sizes(1)[0])
        text, _, rest = self.data[self.place :].partition(b"\n")
        if not text.strip().isdigit():
            raise self.fault(text[:40].decode(errors="replace"))
        self.place = len(self.data) - len(rest)
        return int(text)

    def _take(self, count: int, kind: np.dtype) -> np.ndarray:
        width = kind.itemsize if self.binary else 1
        end = self.place + int(count) * width
        if count < 0 or end > (len(self.data) if self.binary else len(self.numbers)):
            raise self.fault(f"ends before {count} more numbers")
        begin, self.place = self.place, end
        if self.binary:
            return np.frombuffer(self.data, kind, count, begin)
        found = self.numbers[begin:end]
        if kind.kind != "f" and not np.all((found == np.floor(found)) & (np.abs(found) <= _LARGEST)):
            raise self.fault(found[found != np.floor(found)][:1].tolist(), "whole numbers")
        return found


# Dimension, entity or group, type, ids and nodes of some elements
_Elements = tuple[int, tuple[int, ...], int, np.ndarray, np.ndarray]


def read_gmsh_mesh(path: str | Path) -> Mesh:
    """Read the mesh; wedges, pyramids and solids of higher order are left out, and listed in `Mesh.skipped`."""
    name = str(path)
    sections, version = _sections(name, Path(path).read_bytes())
    for needed in ("Nodes", "Elements"):
        if needed not in sections:
            raise refuse(name, f"${needed}", "missing", "a mesh with nodes and elements")
    if version == 2:
        nodes, elements = _nodes_2(sections["Nodes"]), _elements_2(sections["Elements"])
    else:
        groups = _entities(sections["Entities"]) if "Entities" in sections else {}
        nodes, elements = _nodes_4(sections["Nodes"]), _elements_4(sections["Elements"], groups)
    mesh = new_mesh(name, *nodes)
    _add_solids(mesh, elements)
    names = _names(sections["PhysicalNames"]) if "PhysicalNames" in sections else {}
    _add_sets(mesh, elements, names)
    mesh.files = [Path(path)]
    check_nodes(name, mesh)
    return mesh


def _sections(path: str, data: bytes) -> tuple[dict[str, _Section], int]:
    """Sections by name, and the first number of the format's version."""
    head = data.partition(HEADER)[2].partition(b"\n")[2].split(b"\n")[0].split()
    version = head[0].decode(errors="replace") if head else "none"
    if len(head) != 3 or version not in ("2", "2.1", "2.2", "4.1") or head[1] not in b"01" or head[2] not in b"48":
        value = " ".join(word.decode(errors="replace") for word in head)
        raise refuse(path, "$MeshFormat", value, "format 2.2 or 4.1: save it again with gmsh")
    binary, size = head[1] == b"1", int(head[2])
    if binary and np.frombuffer(data.partition(HEADER)[2].partition(head[2] + b"\n")[2][:4].ljust(4), "<i4")[0] != 1:
        raise refuse(path, "$MeshFormat", "the last byte first", "binary data with the first byte first, or text")
    found: dict[str, _Section] = {}
    place = data.find(b"$EndMeshFormat")
    while (begin := data.find(b"\n$", place)) >= 0:
        end = data.find(b"\n", begin + 1)
        name = data[begin + 2 : end].strip().decode(errors="replace")
        stop = data.find(f"$End{name}".encode(), end)
        if end < 0 or stop < 0:
            raise refuse(path, f"${name}", "no end", f"$End{name}: the file is cut off")
        if name in ("Nodes", "Elements", "Entities") and name not in found:
            found[name] = _Section(path, name, data[end + 1 : stop], binary, size)
        elif name == "PhysicalNames":
            found[name] = _Section(path, name, data[end + 1 : stop], True, size)
        place = stop + 1
    return found, int(version[0])


def _names(section: _Section) -> dict[tuple[int, int], str]:
    """Name of each physical group by dimension and number."""
    names = {}
    for line in section.data.decode(errors="replace").splitlines()[1:]:
        words = line.strip().split(maxsplit=2)
        if len(words) == 3 and words[0] in ("0", "1", "2", "3") and words[1].lstrip("-").isdigit():
            names[int(words[0]), int(words[1])] = words[2].strip('"').replace("/", "_")
        elif words:
            raise section.fault(line.strip(), "dimension, number and name of a group")
    return names


def _nodes_2(section: _Section) -> tuple[np.ndarray, np.ndarray]:
    count = section.line()
    if section.binary:
        kind = np.dtype([("tag", "<i4"), ("place", "<f8", 3)])
        if len(section.data) - section.place < count * kind.itemsize:
            raise section.fault(f"ends before {count} nodes")
        table = np.frombuffer(section.data, kind, count, section.place)
        return table["tag"].astype(np.int64), table["place"].copy()
    table = section.doubles(4 * count).reshape(-1, 4)
    if not np.array_equal(table[:, 0], np.floor(table[:, 0])):
        raise section.fault(table[0].tolist(), "tag and coordinates of each node")
    return table[:, 0].astype(np.int64), table[:, 1:]


def _elements_2(section: _Section) -> list[_Elements]:
    """In text each element says its type and how many tags it has; in binary runs of elements do."""
    left, found = section.line(), []
    rows: dict[tuple[int, int, int], list[np.ndarray]] = {}
    while left > 0:
        if section.binary:
            kind, count, tags = section.integers(3)
            head = 1
        else:
            number, kind, tags = section.integers(3)
            count, head = 1, 0
        if kind not in _NODES or tags < 0 or count < 1:
            raise section.fault(f"an element of type {kind} with {tags} tags", "elements that gmsh writes")
        table = section.integers(count * (head + tags + _NODES[kind])).reshape(count, -1)
        if not head:
            table = np.insert(table, 0, number, axis=1)
        group = table[:, 1] if tags else np.zeros(count, np.int64)
        for value in np.unique(group):
            rows.setdefault((int(kind), int(value), int(tags)), []).append(table[group == value])
        left -= int(count)
    for (kind, group, tags), tables in rows.items():
        table = np.concatenate(tables)
        found.append((_dimension(kind), (group,) if group else (), kind, table[:, 0], table[:, 1 + tags :]))
    return found


def _nodes_4(section: _Section) -> tuple[np.ndarray, np.ndarray]:
    blocks = int(section.sizes(4)[0])
    tags, points = [np.zeros(0, np.int64)], [np.zeros((0, 3))]
    for _ in range(blocks):
        dimension, _, parametric = section.integers(3).tolist()
        count = int(section.sizes(1)[0])
        # Parameters on their entity follow the coordinates.
        width = 3 + (dimension if parametric else 0)
        tags.append(section.sizes(count))
        points.append(section.doubles(width * count).reshape(-1, width)[:, :3])
    return np.concatenate(tags), np.concatenate(points)


def _entities(section: _Section) -> dict[tuple[int, int], tuple[int, ...]]:
    """Physical groups of the entities by dimension and number."""
    groups = {}
    for dimension, count in enumerate(section.sizes(4).tolist()):
        for _ in range(count):
            number = int(section.integers(1)[0])
            section.doubles(3 if dimension == 0 else 6)
            groups[dimension, number] = tuple(abs(section.integers(int(section.sizes(1)[0]))).tolist())
            if dimension:
                section.integers(int(section.sizes(1)[0]))
    return groups


def _elements_4(section: _Section, groups: dict[tuple[int, int], tuple[int, ...]]) -> list[_Elements]:
    found = []
    for _ in range(int(section.sizes(4)[0])):
        dimension, entity, kind = section.integers(3).tolist()
        count = int(section.sizes(1)[0])
        if kind not in _NODES:
            raise section.fault(f"elements of type {kind}", "elements that gmsh writes")
        table = section.sizes(count * (1 + _NODES[kind])).reshape(count, -1)
        found.append((dimension, groups.get((dimension, entity), ()), kind, table[:, 0], table[:, 1:]))
    return found


def _dimension(kind: int) -> int:
    if kind in _SOLIDS or kind in _OTHERS:
        return 3
    return 0 if kind == 15 else 1 if kind in (1, 8, 26, 27, 28) else 2


def _add_solids(mesh: Mesh, elements: list[_Elements]) -> None:
    others: Counter[int] = Counter()
    parts: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
    for _, _, kind, ids, nodes in elements:
        if kind in _SOLIDS:
            parts.setdefault(_SOLIDS[kind], []).append((ids, nodes))
        elif kind in _OTHERS:
            others[_NODES[kind]] += len(ids)
    for name, found in parts.items():
        ids, nodes = (np.concatenate(part) for part in zip(*found, strict=True))
        mesh.elements[name] = (ids, nodes[:, _ORDER.get(name, slice(None))])
    mesh.skipped = [f"{count} solids with {nodes} nodes" for nodes, count in sorted(others.items())]


def _add_sets(mesh: Mesh, elements: list[_Elements], names: dict[tuple[int, int], str]) -> None:
    sets: dict[tuple[int, int], list[np.ndarray]] = {}
    for dimension, groups, _, _, nodes in elements:
        for group in groups:
            sets.setdefault((dimension, group), []).append(nodes.ravel())
    for (dimension, group), parts in sets.items():
        name = names.get((dimension, group), f"{_DIMENSIONS[dimension]}_{group}")
        nodes = np.unique(np.concatenate(parts))
        mesh.node_sets[name] = np.union1d(mesh.node_sets.get(name, nodes), nodes)
