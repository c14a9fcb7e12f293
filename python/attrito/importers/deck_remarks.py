"""What a deck says that has no effect here, though it may have one on its matrices or its loads."""

from __future__ import annotations

from attrito.importers.deck import Block
from attrito.importers.deck_ids import fields
from attrito.support.text_files import number

# Keywords that change neither nodes, elements and sets nor which dofs the matrices have: the file itself, materials,
# sections, loads and temperatures, steps, output
_WITHOUT_EFFECT = """
    AMPLITUDE, ASSEMBLY, BASE MOTION, BEAM GENERAL SECTION, BEAM SECTION, BOUNDARY, BUCKLE, CFLUX, CLOAD,
    COMPLEX FREQUENCY, CONDUCTIVITY, CONTACT FILE, CONTACT OUTPUT, CONTACT PRINT, CONTROLS,
    COUPLED TEMPERATURE-DISPLACEMENT, CREEP, CYCLIC HARDENING, DAMPING, DASHPOT, DENSITY, DEPVAR, DFLUX,
    DISTRIBUTING, DISTRIBUTION, DISTRIBUTION TABLE, DLOAD, DSLOAD, DYNAMIC, EL FILE, EL PRINT, ELASTIC,
    ELEMENT OUTPUT, ELSET, END ASSEMBLY, END INSTANCE, END PART, END STEP, ENERGY PRINT, EXPANSION,
    FILE FORMAT, FILM, FILTER, FREQUENCY, FRICTION, GREEN, HEADING, HEAT TRANSFER, HOURGLASS STIFFNESS,
    HYPERELASTIC, HYPERFOAM, INCLUDE, INITIAL CONDITIONS, INSTANCE, KINEMATIC, MASS, MATERIAL, MATRIX GENERATE,
    MATRIX OUTPUT, MEMBRANE SECTION, MODAL DAMPING, MODAL DYNAMIC, MONITOR, NODE FILE, NODE OUTPUT, NODE PRINT,
    ORIENTATION, OUTPUT, PART, PHYSICAL CONSTANTS, PLASTIC, PREPRINT, PRINT, RADIATE, RATE DEPENDENT, RESTART,
    ROTARY INERTIA, SECTION CONTROLS, SECTION PRINT, SELECT CYCLIC SYMMETRY MODES, SFILM, SHELL SECTION,
    SOLID SECTION, SOLUTION TECHNIQUE, SPECIFIC HEAT, SPRING, SRADIATE, STATIC, STEADY STATE DYNAMICS, STEP,
    SUBSTRUCTURE GENERATE, SURFACE, SURFACE BEHAVIOR, SURFACE INTERACTION, SYSTEM, TEMPERATURE, TIME POINTS,
    UNCOUPLED TEMPERATURE-DISPLACEMENT, USER MATERIAL, VALUES AT INFINITY, VISCO
"""


def remarks(blocks: list[Block], read: set[str]) -> list[str]:
    """Keywords that are neither read nor known to have no effect; supports that move; axes of loads.

    Parameters
    ----------
    blocks : of the deck
    read : keywords that are read, or spoken of elsewhere
    """
    harmless = {" ".join(word.split()) for word in _WITHOUT_EFFECT.split(",")}
    found: dict[str, str] = {}
    for block in blocks:
        if block.keyword not in {*harmless, *read, "TRANSFORM"}:
            found.setdefault(block.keyword, f"*{block.keyword}, line {block.line}")
    said = []
    if found:
        named = "; ".join(found.values())
        said.append(f"not read: {named}; what they change of nodes, elements, supports or contact is not known here")
    moved = [block for block in blocks if block.keyword == "BOUNDARY" and any(map(_moves, map(fields, block.data)))]
    if moved:
        named = "; ".join(f"*BOUNDARY, line {block.line}" for block in moved)
        said.append(f"supports that move ({named}) are held at zero: what their motion loads is in no matrix")
    turned = [f"*TRANSFORM, line {block.line}" for block in blocks if block.keyword == "TRANSFORM"]
    if turned:
        said.append(f"forces of a load's file at nodes with axes of their own go along these ({'; '.join(turned)})")
    return said


def _moves(words: list[str]) -> bool:
    """Whether a line `node or set, first, last direction, value` of `*BOUNDARY` moves one of directions 1 to 6."""
    try:
        if len(words) > 1 and words[1].isdecimal() and int(words[1]) > 6:
            return False
        return len(words) > 3 and number(words[3] or "0") != 0.0
    except ValueError:
        return True
