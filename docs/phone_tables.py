"""Tables of many columns know their headings in every cell, so that a phone can show each row as a list (phone.css)."""

from __future__ import annotations

import html
import re
from itertools import count

# A table of fewer columns fits a phone as it is.
MANY = 3


def on_page_content(content: str, **_: object) -> str:
    """MkDocs' hook: the HTML of a page."""
    return re.sub(r"<table>.*?</table>", lambda found: labelled(found[0]), content, flags=re.DOTALL)


def labelled(table: str) -> str:
    """A table whose cells carry `data-heading` and are in one piece, where it has many columns; others as they are."""
    headings = [html.unescape(re.sub("<.*?>", "", cell)).strip() for cell in re.findall(r"<th\b.*?>(.*?)</th>", table)]
    if len(headings) < MANY:
        return table

    def row(found: re.Match[str]) -> str:
        column = count()

        def cell(found: re.Match[str]) -> str:
            inside = f"<div>{found[2]}</div>" if found[2].strip() else ""
            return f'<td data-heading="{html.escape(headings[next(column)])}"{found[1]}>{inside}</td>'

        return re.sub(r"<td\b(.*?)>(.*?)</td>", cell, found[0], flags=re.DOTALL)

    return re.sub("<tr>.*?</tr>", row, table.replace("<table>", "<table data-many>", 1), flags=re.DOTALL)
