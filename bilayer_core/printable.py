"""Text that others wrote, made fit for a terminal: names and messages from files, topics and the network.

A terminal obeys control characters, and marks of the direction of writing show a line in another order than it has.
Both are shown as the escapes of a Python string, such as ``\\x1b`` and ``\\u202e``.
"""

from __future__ import annotations

from collections.abc import Mapping
from html import escape

LONGEST_TEXT = 120
"""Characters of a name or value that are shown."""
LONGEST_LINE = 2_000
"""Characters of a line of a message that are shown."""
MORE = "..."
"""What stands where a text is cut off."""


def shortened(text: str, most: int = LONGEST_TEXT) -> str:
    """Return a text in one line that can be printed, cut off where it gets long.

    `most`: characters after which it is cut off.
    """
    if len(text) <= most and text.isprintable():
        return text
    printed = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text[: most + 1])
    return printed if len(printed) <= most else f"{printed[:most]}{MORE}"


def printable(text: str) -> str:
    """Return a text of several lines that can be printed: each as `shortened` makes it, at most `LONGEST_LINE` long."""
    return "\n".join(shortened(line, LONGEST_LINE) for line in text.split("\n"))


def html_table(title: str, rows: Mapping[str, object]) -> str:
    """Return a small table for notebooks: a title, and a row of each name and its value."""
    left = " style='text-align:left'"
    cells = "".join(
        f"<tr><th{left}>{escape(shortened(name))}</th><td{left}>{escape(shortened(str(value)))}</td></tr>"
        for name, value in rows.items()
    )
    return f"<table><tr><th colspan='2'{left}>{escape(shortened(title))}</th></tr>{cells}</table>"
