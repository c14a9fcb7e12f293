"""What a job may hold, in JSON Schema (draft 7), for editors that complete and check TOML.

A job whose first line is `#:schema https or path of job.schema.json` is checked by Taplo, and by editors that use it.
"""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

from attrito.job.checks import schema_of
from attrito.job.key import Key
from attrito.job.reference import PURPOSES, plain, tables
from attrito.job.schema import ARRAYS


def as_json_schema() -> str:
    """The schema of a job as text."""
    properties = {}
    for name, keys in tables().items():
        # A mode needs no monitors, and whether a job is one of a mode the schema does not know.
        one = _table(keys | {"monitors": replace(keys["monitors"], required=False)} if name == "output" else keys)
        if name == "output":
            one["properties"]["monitors"] |= {"minItems": 0}
        described = {"description": plain(PURPOSES[name])}
        properties[name] = {"type": "array", "items": one} | described if name in ARRAYS else one | described
    whole = {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "A job of attrito",
        "type": "object",
        "properties": properties,
        "required": ["model", "output"],
        "additionalProperties": False,
    }
    return json.dumps(whole, indent=1) + "\n"


def _table(keys: dict[str, Key]) -> dict[str, Any]:
    """A table whose keys are given; one that has no effect any more is taken, since older jobs have it."""
    properties = {name: schema_of(key.check) | {"description": plain(key.meaning)} for name, key in keys.items()}
    required = [name for name, key in keys.items() if key.required]
    return {"type": "object", "properties": properties, "required": required, "additionalProperties": False}
