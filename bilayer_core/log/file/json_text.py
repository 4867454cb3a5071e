"""JSON that others wrote, read without filling the memory."""

from __future__ import annotations

import json
from typing import Any

from bilayer_core.errors import InputError

MOST_VALUES = 3_000_000
"""Of a text; the description of the largest scene has half as many."""
MOST_NESTED = 100_000
"""Lists and mappings of a text, each of which takes as much memory as ten values."""


def read_json(text: str, what: str) -> Any:
    """Return the value of a JSON text.

    `what`: its name for the error, with its file or key. Raises InputError if it is no JSON, nested too deeply, or
    has more than `MOST_VALUES` values or `MOST_NESTED` lists and mappings.
    """
    if text.count(",") > MOST_VALUES or text.count("[") + text.count("{") > MOST_NESTED:
        raise InputError(f"{what}: has more values than are read, {MOST_VALUES:,} in {MOST_NESTED:,} lists")
    try:
        return json.loads(text)
    except RecursionError:
        raise InputError(f"{what}: has lists inside each other, too deep to be read") from None
    except ValueError as error:
        raise InputError(f"{what}: is no JSON: {error}") from None
