"""A brick of 20 nodes as gmsh writes it, text or binary, formats 2.2 and 4.1."""

from __future__ import annotations

import struct

import numpy as np

# A brick of 20 nodes in CalculiX's order: base, top, edges of the base, of the top, upright
CORNERS = np.array([[x, y, z] for z in (0, 1) for x, y in ((0, 0), (2, 0), (2, 3), (0, 3))], float)
EDGES = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
POINTS = np.vstack([CORNERS, [(CORNERS[a] + CORNERS[b]) / 2 for a, b in EDGES]])
# Tags with gaps, not in order
TAGS = np.array([100 - 3 * k for k in range(20)])
# gmsh counts edges of a brick from each corner on.
GMSH_EDGES = [(0, 1), (0, 3), (0, 4), (1, 2), (1, 5), (2, 3), (2, 6), (3, 7), (4, 5), (4, 7), (5, 6), (6, 7)]
GMSH_BRICK = [*range(8), *(8 + EDGES.index(e if e in EDGES else e[::-1]) for e in GMSH_EDGES)]
BASE = [0, 1, 2, 3, 8, 9, 10, 11]


class Writer:
    """Numbers in text or binary."""

    def __init__(self, binary: bool):
        self.binary = binary
        self.data = b""

    def put(self, form: str, *numbers: float) -> None:
        """`i`: of 4 bytes, `Q`: of 8, `d`: real."""
        if self.binary:
            self.data += struct.pack(f"<{len(numbers)}{form}", *numbers)
        else:
            self.data += (" ".join(repr(float(x)) if form == "d" else str(int(x)) for x in numbers) + "\n").encode()


def gmsh(version: str, binary: bool) -> bytes:
    """The brick, element 7 of the volume `body`, and its base, element 5 of a surface without a name."""
    head = f"$MeshFormat\n{version} {int(binary)} 8\n".encode() + (struct.pack("<i", 1) + b"\n" if binary else b"")
    head += b'$EndMeshFormat\n$PhysicalNames\n1\n3 9 "body"\n$EndPhysicalNames\n'
    nodes, elements, entities = (Writer(binary) for _ in range(3))
    brick, base = TAGS[GMSH_BRICK], TAGS[BASE]
    if version == "2.2":
        nodes.data, elements.data = b"20\n", b"2\n"
        for tag, point in zip(TAGS, POINTS, strict=True):
            if binary:
                nodes.put("i", tag)
                nodes.put("d", *point)
            else:
                nodes.data += f"{tag} {' '.join(map(repr, point.tolist()))}\n".encode()
        for number, kind, group, found in ((5, 16, 4, base), (7, 17, 9, brick)):
            elements.put("i", *((kind, 1, 2, number) if binary else (number, kind, 2)), group, 1, *found)
        return head + b"$Nodes\n" + nodes.data + b"$EndNodes\n$Elements\n" + elements.data + b"$EndElements\n"
    entities.put("Q", 0, 0, 1, 1)
    for groups in ((4,), (9,)):
        entities.put("i", 1)
        entities.put("d", 0, 0, 0, 2, 3, 1)
        entities.put("Q", len(groups))
        entities.put("i", *groups)
        entities.put("Q", 1)
        entities.put("i", 1)
    nodes.put("Q", 2, 20, TAGS.min(), TAGS.max())
    for part, parametric in ((slice(0, 12), 0), (slice(12, 20), 1)):
        nodes.put("i", 3, 1, parametric)
        nodes.put("Q", len(TAGS[part]))
        nodes.put("Q", *TAGS[part])
        # Parameters on the entity follow the coordinates.
        for point in POINTS[part]:
            nodes.put("d", *point, *([0.1, 0.2, 0.3] if parametric else []))
    elements.put("Q", 2, 2, 5, 7)
    for dimension, kind, number, found in ((2, 16, 5, base), (3, 17, 7, brick)):
        elements.put("i", dimension, 1, kind)
        elements.put("Q", 1)
        elements.put("Q", number, *found)
    parts = (("Entities", entities), ("Nodes", nodes), ("Elements", elements))
    return head + b"".join(f"${name}\n".encode() + part.data + f"\n$End{name}\n".encode() for name, part in parts)
