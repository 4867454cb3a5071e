"""Saved states: one file holds all that a run needs to go on bit for bit, beside its scene."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.observed.frame import Description
from bilayer_core.record.paths import draft_of

LOG_SUFFIX = ".mcap"


def write_state(path: str | Path, state: np.ndarray, description: Description, force: bool = True) -> None:
    """Write a flat state with the layout and the scene that it belongs to, as numpy's ``.npz``.

    Parameters and errors are those of `draft_of`.
    """
    layout = json.dumps(description.state_layout)
    with draft_of(path, force) as draft, open(draft, "wb") as file:
        np.savez(file, state=state, layout=np.array(layout), scene=np.array(description.scene_text))


def read_saved_state(path: str | Path, description: Description, time: float | None = None) -> np.ndarray:
    """Flat state from a file of `write_state`, or from an MCAP log the last one, or the last at or before a time [s].

    Raises
    ------
    InputError
        If the file cannot be read, its state has other parts than those of `description`, or it has none at that time.
    """
    path = Path(path)
    if path.suffix.lower() == LOG_SUFFIX:
        from bilayer_core.record.log_reader import read_description, read_state

        saved, state = read_description(path).state_layout, read_state(path, time)[0]
    elif time is not None:
        raise InputError(f"{path}: holds one state; a time picks one of an MCAP log ({LOG_SUFFIX})")
    else:
        saved, state = _read(path)
    if saved != description.state_layout:
        raise InputError(f"{path}: holds a state {_difference(dict(saved), description)}")
    return state


def _read(path: Path) -> tuple[tuple, np.ndarray]:
    try:
        with np.load(path, allow_pickle=False) as content:
            layout = json.loads(str(content["layout"]))
            return tuple((name, tuple(shape)) for name, shape in layout), content["state"]
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
    except (KeyError, TypeError, ValueError, zipfile.BadZipFile, EOFError) as error:
        raise InputError(f"{path}: is not a saved state") from error


def _difference(saved: dict[str, tuple[int, ...]], description: Description) -> str:
    """What the state is instead, by the first part that is not the same."""
    for name, shape in description.state_layout:
        if name not in saved:
            return f"without {name!r}, of another version of this program; run its scene again"
        if saved[name] != shape:
            return f"of another scene: {name} has shape {saved[name]}, in {description.scene_name} it has {shape}"
    return "with more parts, of another version of this program; run its scene again"
