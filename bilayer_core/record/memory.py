"""An observer that keeps frames in memory, for notebooks and tests."""

from __future__ import annotations

from bilayer_core.integrate.frame import Description, Frame
from bilayer_core.record.run_data import RunData


class MemoryRecorder:
    """Keeps every frame that it sees: attributes `description`, `frames`; after `close` also `complete`."""

    def __init__(self, rate: float = 50.0):
        self.rate = rate
        self.description: Description | None = None
        self.frames: list[Frame] = []
        self.complete: bool | None = None

    def start(self, description: Description) -> None:
        """Forget what an earlier run left."""
        self.description = description
        self.frames = []
        self.complete = None

    def observe(self, frame: Frame) -> None:
        """Keep `frame`."""
        self.frames.append(frame)

    def close(self, complete: bool) -> None:
        """Note whether the run reached its end."""
        self.complete = complete

    def run_data(self) -> RunData:
        """The frames as arrays over time."""
        raise NotImplementedError
