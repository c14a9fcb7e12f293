"""Constants of a deck's elements: `*ELASTIC`, `*DENSITY` of the material that `*SOLID SECTION` names, and `*MASS`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from attrito.importers.deck import Block
from attrito.importers.deck_ids import element_ids, element_type, fields, integers, set_members
from attrito.support.errors import InputError
from attrito.support.text_files import number


def elastic_constants(blocks: list[Block], elements: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Young's modulus and Poisson's ratio of elements.

    Of constants that depend on the temperature the first count.

    Parameters
    ----------
    blocks : of the deck
    elements : ids by type

    Returns
    -------
    `[E, 2]` by type, NaN where they are not known; no type: of none of its elements
    """
    return _of_elements(blocks, elements, _of_materials(blocks, "ELASTIC", _constants), (np.nan, np.nan))


def densities(blocks: list[Block], elements: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Density of elements, `[E]` by type, as `elastic_constants`; none where `*NONSTRUCTURAL MASS` adds to it."""
    if any(block.keyword == "NONSTRUCTURAL MASS" for block in blocks):
        return {}
    found = _of_elements(blocks, elements, _of_materials(blocks, "DENSITY", _density), (np.nan,))
    return {kind: values[:, 0] for kind, values in found.items()}


def point_masses(blocks: list[Block], known: np.ndarray) -> dict[int, float] | None:
    """Mass at nodes of elements of type `MASS`, user mass by node id; None where the deck does not tell it.

    Parameters
    ----------
    blocks : of the deck
    known : ids of its nodes
    """
    try:
        of_element = _masses_of_elements(blocks)
        pairs = [pair for block in blocks for pair in _mass_elements(block).tolist()]
    except InputError:
        # Ids of parts and instances, which no mesh has
        return None
    if of_element is None or any(element not in of_element or node not in known for element, node in pairs):
        return None
    found = dict.fromkeys((node for _, node in pairs), 0.0)
    for element, node in pairs:
        found[node] += of_element[element]
    return found


def _masses_of_elements(blocks: list[Block]) -> dict[int, float] | None:
    """What `*MASS` says of elements, by id; None where it is not one number."""
    sets, found = ElementSets(blocks, lambda block: _mass_elements(block)[:, 0]), dict[int, float]()
    for block in blocks:
        if block.keyword == "MASS":
            try:
                mass = number(fields(block.data[0])[0])
            except (ValueError, IndexError):
                return None
            if not 0.0 <= mass < np.inf or block.parameters.get("TYPE", "ISOTROPIC").upper() != "ISOTROPIC":
                return None
            found |= dict.fromkeys(sets.members(block.parameters.get("ELSET", "")).tolist(), mass)
    return found


def _mass_elements(block: Block) -> np.ndarray:
    """Element and node `[E, 2]` of a block of masses at points; none of others."""
    if block.keyword != "ELEMENT" or element_type(block) != "MASS":
        return np.empty((0, 2), dtype=np.int64)
    words = [word for line in block.data for word in fields(line)]
    return integers(words[: len(words) // 2 * 2], block, "element and node ids").reshape(-1, 2)


def _of_elements(
    blocks: list[Block],
    elements: dict[str, np.ndarray],
    materials: dict[str, tuple[float, ...]],
    nothing: tuple[float, ...],
) -> dict[str, np.ndarray]:
    """Constants of elements by the materials that their sections name; the last section of an element counts."""
    of_element: dict[int, tuple[float, ...]] = {}
    sets = ElementSets(blocks)
    for block in blocks:
        if block.keyword == "SOLID SECTION":
            constants = materials.get(block.parameters.get("MATERIAL", "").upper(), nothing)
            of_element |= dict.fromkeys(sets.members(block.parameters.get("ELSET", "")).tolist(), constants)
    found = {
        kind: np.array([of_element.get(element, nothing) for element in ids.tolist()]).reshape(-1, len(nothing))
        for kind, ids in elements.items()
    }
    return {kind: constants for kind, constants in found.items() if np.isfinite(constants).any()}


def _of_materials(
    blocks: list[Block], keyword: str, read: Callable[[list[str]], tuple[float, ...] | None]
) -> dict[str, tuple[float, ...]]:
    """Constants of isotropic materials by name, in capitals."""
    found: dict[str, tuple[float, ...]] = {}
    name = ""
    for block in blocks:
        if block.keyword == "MATERIAL":
            name = block.parameters.get("NAME", "").upper()
        is_isotropic = block.parameters.get("TYPE", "ISO").upper() in ("ISO", "ISOTROPIC")
        if block.keyword == keyword:
            constants = read(block.data) if is_isotropic and block.data else None
            # The last counts, known or not.
            found[name] = constants or ()
    return {name: constants for name, constants in found.items() if constants}


def _density(lines: list[str]) -> tuple[float] | None:
    """Density, None where it depends on the temperature: which one matrices have is not known."""
    try:
        density, *others = {number(fields(line)[0]) for line in lines}
    except ValueError:
        return None
    return (density,) if not others and 0.0 < density < np.inf else None


def _constants(lines: list[str]) -> tuple[float, float] | None:
    """Young's modulus and Poisson's ratio of the first line; None where they are not those of an elastic solid.

    Parameters in angle brackets are no numbers, and a material that nothing is made of may have any: neither is a fault
    of a model whose matrices are right.
    """
    words = fields(lines[0])[:2]
    try:
        young, poisson = number(words[0]), number(words[1]) if len(words) > 1 and words[1] else 0.0
    except ValueError:
        return None
    return (young, poisson) if young > 0.0 and -1.0 < poisson < 0.5 else None


class ElementSets:
    """Sets of elements, which may name others; `own` gives the ids of the elements of a block."""

    def __init__(self, blocks: list[Block], own: Callable[[Block], np.ndarray] = element_ids):
        self._own = own
        self._elements: dict[str, list[Block]] = {}
        self._sets: dict[str, list[Block]] = {}
        self._known: dict[str, np.ndarray] = {}
        for block in blocks:
            if name := block.parameters.get("ELSET", "").upper():
                if block.keyword == "ELEMENT":
                    self._elements.setdefault(name, []).append(block)
                elif block.keyword == "ELSET":
                    self._sets.setdefault(name, []).append(block)

    def members(self, name: str) -> np.ndarray:
        """Ids; none where there is no such set."""
        name = name.upper()
        if name not in self._known:
            # A set that names itself adds nothing.
            self._known[name] = np.empty(0, dtype=np.int64)
            parts = [self._own(block) for block in self._elements.get(name, ())]
            for block in self._sets.get(name, ()):
                words = {word.upper() for line in block.data for word in fields(line)}
                inner = {word: self.members(word) for word in words & (self._sets.keys() | self._elements.keys())}
                parts.append(set_members(block, inner, "element ids or names of sets"))
            self._known[name] = np.unique(np.concatenate([self._known[name], *parts]))
        return self._known[name]
