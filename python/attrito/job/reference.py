"""The keys of the job file in words, for docs/reference/job.md and `attrito keys`, out of `schema.py` alone."""

from __future__ import annotations

import json
import re
from typing import Any

from attrito.job.checks import takes
from attrito.job.key import Key
from attrito.job.key_units import unit_of
from attrito.job.schema import ARRAYS, REQUIRED_TABLES, TABLES

HEADINGS = "| key | takes | unit | default | meaning |"
# What a table is for; each table of the schema has its line.
PURPOSES = {
    "model": "Required. The matrices, from a file of `attrito import` or as they are.",
    "damping": "At most one kind; a model whose damping is a matrix takes none.",
    "reduction": "Absent: the matrices as they are. Else `modes` or `max_frequency_hz`.",
    "contact": "A contact between dofs. At least one `[[contact]]` or `[[contact_set]]`.",
    "contact_set": "Contacts between two node sets, nodes on nodes or on faces, or between one and the ground.",
    "load": "At least one of kind `harmonic`.",
    "cyclic": "The model is one of N equal sectors, under a wave travelling round the wheel"
    " ([One sector of a wheel](../how-to/cyclic.md)).",
    "static": "How the static loads are applied, and which bounds are found for points that are not unique.",
    "balance": "The harmonic balance.",
    "sweep": "Required: `start_hz` and `stop_hz`, or `frequencies_hz`.",
    "continuation": "How a sweep is followed.",
    "peak": "For `attrito peak`: a resonance peak followed in a parameter"
    " ([The peak without the sweep](../how-to/peaks.md)).",
    "mode": "For `attrito mode`: a nonlinear mode followed in its amplitude"
    " ([Nonlinear modes](../how-to/nonlinear-modes.md)).",
    "campbell": "For `attrito campbell`: tangent modes against the speed"
    " ([Campbell diagram](../how-to/modes.md#campbell-diagram)).",
    "stability": "Floquet multipliers of the points.",
    "sensitivity": "Derivatives of each point by parameters of the job ([Sensitivities](../how-to/sensitivity.md)).",
    "integrate": "For `attrito integrate`; the group `/integration` goes into the output file.",
    "output": "Required.",
}


def tables() -> dict[str, dict[str, Key]]:
    """Every table by name, in the order in which a job is read."""
    return {name: (TABLES | ARRAYS)[name] for name in PURPOSES}


def heading(name: str) -> str:
    """`[table]`, or `[[table]]` where there can be several."""
    return f"[[{name}]]" if name in ARRAYS else f"[{name}]"


def default_in_words(key: Key) -> str:
    """A key's value when absent, as TOML; empty where there is none."""
    return "required" if key.required else "" if key.default is None else toml_value(key.default)


def toml_value(value: Any) -> str:
    """A value as TOML writes it."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{name} = {toml_value(item)}" for name, item in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(toml_value, value)) + "]"
    return json.dumps(value)


def as_markdown() -> str:
    """The reference for docs/reference/job.md: a heading and a table of keys for each table."""
    parts = []
    for name, keys in tables().items():
        rows = [f"### {heading(name)}", PURPOSES[name], "", HEADINGS, "|---|---|---|---|---|"]
        for key_name, key in keys.items():
            default = default_in_words(key)
            shown = default if default in ("", "required") else f"`{default}`"
            takes_what, unit = _cell(takes(key.check)), unit_of(name, key_name)
            rows.append(f"| `{key_name}` | {takes_what} | {unit} | {shown} | {key.meaning} |")
        parts.append("\n".join(rows))
    return "\n\n".join(parts)


def as_text(name: str | None = None) -> str:
    """The reference for a terminal, of one table or of all."""
    lines: list[str] = []
    for table, keys in tables().items():
        if name not in (None, table):
            continue
        lines += [f"{heading(table)}  {plain(PURPOSES[table])}"]
        for key_name, key in keys.items():
            default = default_in_words(key)
            note = f" ({default})" if default == "required" else f" (default {default})" if default else ""
            unit = unit_of(table, key_name)
            of = f", {unit}" if unit not in ("", "1") else ""
            lines += [f"  {key_name}: {takes(key.check)}{of}{note}", f"      {plain(key.meaning)}"]
        lines.append("")
    return "\n".join(lines).rstrip()


def as_job(given: dict[str, Any]) -> str:
    """A checked job as TOML, without what is at its default; the inverse of reading it.

    Parameters
    ----------
    given : tables as `Job.tables` holds them
    """
    parts = []
    for name, keys in tables().items():
        rows: list[dict[str, Any]] = given.get(name) or [] if name in ARRAYS else [given.get(name) or {}]
        for row in rows:
            lines = [
                f"{key} = {toml_value(value)}"
                for key, value in row.items()
                if value is not None and value != keys[key].default
            ]
            # A sweep without keys is that of a job that nothing excites, which has no such table.
            if lines or (name in REQUIRED_TABLES and name != "sweep"):
                parts.append("\n".join([heading(name), *lines]))
    return "\n\n".join(parts) + "\n"


def _cell(words: str) -> str:
    words = words.replace("|", "\\|").replace("<", "&lt;")
    return words.replace("a text of printable characters", "a text")


def plain(words: str) -> str:
    """Markdown's links and marks taken out."""
    return re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", words).replace("`", "").replace("\\|", "|")
