"""The reference of attrito's Python interface out of its docstrings (numpy style), as Markdown."""

from __future__ import annotations

import inspect
import re

import attrito

# Functions first, in the order in which they are met; then what they return and raise.
ORDER = (
    "run",
    "open",
    "integrate",
    "reduce",
    "peak",
    "linear_modes",
    "campbell",
    "mode",
    "study",
    "fit",
    "optimise",
    "value_and_gradient",
    "jax_function",
    "import_model",
    "plot",
    "write_report",
    "write_study_report",
    "stress",
    "table",
    "contact_table",
    "multiplier_table",
    "bifurcation_table",
    "File",
    "Group",
    "Quantity",
    "Result",
    "Stresses",
    "Cycle",
    "Fault",
    "InputError",
    "NumericsError",
    "UnsolvedError",
    "UnsolvedWarning",
)


def as_markdown() -> str:
    """A heading, a signature and what the docstring says for each public name."""
    missing = set(attrito.__all__) - set(ORDER)
    if missing:
        raise ValueError(f"names without a place in the reference: {', '.join(sorted(missing))}")
    return "\n\n".join(_entry(name, getattr(attrito, name)) for name in ORDER)


def _entry(name: str, thing: object) -> str:
    parts = [f"### attrito.{name}"]
    if inspect.isfunction(thing) or thing.__init__ is not object.__init__ and not issubclass(thing, Exception):
        parts.append(f"```text\n{name}{_signature(thing)}\n```")
    parts.append(docstring(inspect.getdoc(thing) or ""))
    if inspect.isclass(thing):
        members = [line for key, value in vars(thing).items() if (line := _member(key, value))]
        parts += ["\n".join(members)] if members else []
    return "\n\n".join(parts)


def _signature(thing: object) -> str:
    signature = inspect.signature(thing)
    bare = [parameter.replace(annotation=parameter.empty) for parameter in signature.parameters.values()]
    return str(signature.replace(parameters=bare, return_annotation=signature.empty))


def _member(name: str, value: object) -> str:
    if name.startswith("_"):
        return ""
    called = (
        ""
        if isinstance(value, property)
        else _signature(value).replace("(self, ", "(").replace("(self)", "()")
        if (inspect.isfunction(value))
        else None
    )
    if called is None:
        return ""
    said = " ".join((inspect.getdoc(value) or "").split("\n\n")[0].split())
    return f"- `.{name}{called}`: {said}"


def docstring(text: str) -> str:
    """A numpy docstring as Markdown: sections in bold, parameters as lists, examples as code."""
    blocks = re.split(r"\n(?=[A-Z][a-z]+\n-{3,}\n)", f"\n{text}")
    parts = [_prose(blocks[0])]
    for block in blocks[1:]:
        title, _, body = block.split("\n", 2)
        if title == "Examples":
            parts.append(f"**{title}**\n\n```text\n{body.strip()}\n```")
        else:
            entries = re.split(r"\n(?=\S)", body.strip("\n"))
            lines = [_item(" ".join(entry.split())) for entry in entries if entry.strip()]
            parts.append(f"**{title}**\n\n" + "\n".join(lines))
    return "\n\n".join(part for part in parts if part)


def _prose(text: str) -> str:
    paragraphs = re.split(r"\n\s*\n", text.strip())
    return "\n\n".join(
        f"```text\n{inspect.cleandoc(paragraph)}\n```" if paragraph.startswith("    ") else paragraph
        for paragraph in paragraphs
    )


def _item(entry: str) -> str:
    name, colon, meaning = entry.partition(" : ")
    return f"- `{name}`: {meaning}" if colon else f"- {entry}"
