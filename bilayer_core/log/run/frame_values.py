"""Values of quantities in single frames."""

from __future__ import annotations

import numpy as np

from bilayer_core.log.messages.node_frames import NodeFrames
from bilayer_core.log.run.quantities import Entry
from bilayer_core.observed.frame import Description, Frame

Array = np.ndarray


class FrameValues:
    """Finds the values of quantities in frames of a run. `description`: of the run."""

    def __init__(self, description: Description) -> None:
        self._node_frames = NodeFrames(description)
        self._frame: Frame | None = None
        self._joined: dict[str, Array] = {}

    def of(self, entry: Entry, frame: Frame) -> Array:
        """Return a copy of a quantity."""
        return entry.derived(self.picked(entry, frame)[None])[0]

    def picked(self, entry: Entry, frame: Frame, precision: type = float) -> Array:
        """Return a copy of the numbers in a frame from which a quantity is derived; most are the quantity.

        `precision`: of the copy.
        """
        if entry.attribute == "energy":
            return np.array(frame.energy[str(entry.index)])
        if entry.attribute == "solver":
            return np.array(float(getattr(frame, str(entry.index))))
        return np.array(self._held(entry.attribute, frame)[tuple(entry.index)], dtype=precision)

    def _held(self, attribute: str, frame: Frame) -> Array:
        if attribute not in ("material_frames", "nodes", "points"):
            found: Array = getattr(frame, attribute)
            return found
        if frame is not self._frame:
            self._frame, self._joined = frame, {}
        if attribute not in self._joined:
            self._joined[attribute] = self._join(attribute, frame)
        return self._joined[attribute]

    def _join(self, attribute: str, frame: Frame) -> Array:
        if attribute == "points":
            return joined(frame.positions, frame.strain[:, None], frame.curvature[:, None], frame.contact_forces)
        self._node_frames.update(frame)
        quaternions: Array = self._node_frames.quaternions
        return quaternions if attribute == "material_frames" else joined(self._node_frames.positions, quaternions)


def joined(*parts: Array) -> Array:
    """Return arrays side by side along their last axis."""
    return np.concatenate(parts, axis=-1)
