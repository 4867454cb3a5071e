"""Saved states: one file holds all that a run needs to go on bit for bit, beside its scene."""

from __future__ import annotations

import json
import math
import tokenize
import zipfile
import zlib
from pathlib import Path

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.log.file.json_text import read_json
from bilayer_core.log.file.output_paths import draft_of
from bilayer_core.observed.frame import Description
from bilayer_core.printable import shortened

LOG_SUFFIX = ".mcap"
LARGEST_FILE = 40_000_000
"""Without the state itself [bytes]: most of it is the text of the scene, of which each character takes four."""
LARGEST_LAYOUT = 1_000_000
"""Of names and shapes of the parts of a state, and of what states of other scenes may have more [bytes]."""

DAMAGED_ZIP = zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError
"""What `zipfile` raises for damaged files, and for those of later versions or with a password."""
DAMAGED_ARRAY = KeyError, ValueError, OverflowError, MemoryError, tokenize.TokenError
"""What numpy raises for damaged files."""


def write_state(path: str | Path, state: np.ndarray, description: Description, force: bool = True) -> None:
    """Write a flat state with the layout and the scene that it belongs to, as numpy's ``.npz``.

    Parameters and errors are those of `draft_of`.
    """
    layout = json.dumps(description.state_layout)
    with draft_of(path, force) as draft, open(draft, "wb") as file:
        np.savez(file, state=state, layout=np.array(layout), scene=np.array(description.scene_text))


def read_saved_state(path: str | Path, description: Description, time: float | None = None) -> np.ndarray:
    """Return the flat state from a file of `write_state`, or from an MCAP log the last one, or the last at or before a
    time [s].

    Raises InputError if the file cannot be read, its state has other parts than those of `description`, or it has none
    at that time.
    """
    path = Path(path)
    if path.suffix.lower() == LOG_SUFFIX:
        from bilayer_core.log.run.log_reader import read_description, read_state

        saved, state = read_description(path).state_layout, read_state(path, time)[0]
    elif time is not None:
        raise InputError(f"{path}: holds one state; a time picks one of an MCAP log ({LOG_SUFFIX})")
    else:
        saved, state = _read(path, sum(math.prod(shape) for _, shape in description.state_layout))
    if saved != description.state_layout:
        raise InputError(f"{path}: holds a state {_difference(dict(saved), description)}")
    return state


def _read(path: Path, size: int) -> tuple[tuple, np.ndarray]:
    """Return the layout and values of a file, which holds at most as many values as there should be, and some."""
    try:
        if path.stat().st_size > 8 * size + LARGEST_FILE:
            raise InputError(f"{path}: has {path.stat().st_size / 1e6:.3g} MB, more than a state of this scene takes")
        with zipfile.ZipFile(path) as members:
            for name, most in (("layout", LARGEST_LAYOUT), ("state", 8 * size + LARGEST_LAYOUT)):
                _refuse_large(members.getinfo(f"{name}.npy"), most)
        with np.load(path, allow_pickle=False) as arrays:
            layout, state = read_json(_text(arrays["layout"]), f"{path}: layout"), arrays["state"]
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
    except (*DAMAGED_ARRAY, *DAMAGED_ZIP) as error:
        reason = " ".join(str(error).split())
        raise InputError(f"{path}: is not a saved state, or is damaged: {shortened(reason)}") from error
    if state.dtype != np.float64 or state.ndim != 1:
        raise InputError(f"{path}: state: found {state.dtype} of shape {state.shape}; must be float64 of one axis")
    try:
        return tuple((str(name), tuple(map(int, shape))) for name, shape in layout), state
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{path}: layout: must be a list of names and shapes") from None


def _refuse_large(member: zipfile.ZipInfo, most: int) -> None:
    """Raise ValueError if a member of a ``.npz`` declares more bytes than `most`; no more than those are unpacked."""
    if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise ValueError(f"{member.filename} is compressed in a way that numpy never uses")
    if member.file_size > most:
        raise ValueError(f"{member.filename} has more than {most} bytes, which no state of this scene has")


def _text(array: np.ndarray) -> str:
    if array.dtype.kind != "U" or array.ndim:
        raise ValueError(f"found {array.dtype} of shape {array.shape} where a text must be")
    return str(array)


def _difference(saved: dict[str, tuple[int, ...]], description: Description) -> str:
    """Say how a saved state differs from that of a run, by the first part that is not the same."""
    for name, shape in description.state_layout:
        if name not in saved:
            return f"without {name!r}, of another version of this program; run its scene again"
        if saved[name] != shape:
            return f"of another scene: {name} has shape {saved[name]}, in {description.scene_name} it has {shape}"
    return "with more parts, of another version of this program; run its scene again"
