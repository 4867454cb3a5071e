"""Names from files of others as names of files: they stay in the directory that they are given."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from urllib.parse import quote

LONGEST = 200
"""Of a name with its directories [bytes]; file systems allow 255 for each part, endings included."""
_DEVICES = {"con", "prn", "aux", "nul", *(f"{name}{k}" for name in ("com", "lpt") for k in range(10))}
"""Of Windows, in every directory."""


def file_names(names: Iterable[str], taken: Iterable[str] = ()) -> dict[str, str]:
    """Return a relative path for each name, without an ending, with ``/`` between directories.

    Names that scenes allow keep their letters. Of others each byte that is not a letter, a digit, ``_`` or ``-``
    becomes ``%`` and two digits, so no part is ``..`` or empty. Long names are cut, and names that some file systems
    take for the same get an ending of their own. `names`: such as ``rod/strip/position``. `taken`: paths that are not
    to be used.
    """
    used, found = set(taken), {}
    for name in names:
        quoted = quote(name, safe="/", errors="surrogatepass").replace(".", "%2E").replace("~", "%7E")
        path = "/".join(map(_safe_part, quoted.split("/")))
        mark = f"~{hashlib.sha256(quoted.encode()).hexdigest()[:32]}"
        if len(path) > LONGEST:
            path = path[:LONGEST] + mark
        elif path.lower() in used:
            path += mark
        used.add(path.lower())
        found[name] = path
    return found


def _safe_part(part: str) -> str:
    """Return a part of a path that is neither empty nor the name of a device."""
    if not part:
        return "%"
    return f"%{ord(part[0]):02X}{part[1:]}" if part.lower() in _DEVICES else part
