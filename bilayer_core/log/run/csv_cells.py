"""Cells of csv files that spreadsheets show, and do not execute."""

from __future__ import annotations

FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n", "＝", "＋", "－", "＠")
"""With which a cell begins that a spreadsheet may take for a formula."""


def text_cell(text: str) -> str:
    """Return text for a cell; what a spreadsheet would execute begins with an apostrophe. Not for numbers."""
    return f"'{text}" if text.startswith(FORMULA) else text
