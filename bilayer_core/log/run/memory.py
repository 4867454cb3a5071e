"""An observer that keeps frames in memory, for notebooks and tests."""

from __future__ import annotations

import numpy as np

from bilayer_core.log.messages.encoders import SOLVER_LABELS
from bilayer_core.log.messages.events import EventDetector
from bilayer_core.log.messages.node_frames import NodeFrames
from bilayer_core.log.run.run_data import RunData
from bilayer_core.observed.frame import Description, Frame


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

    def close(self, complete: bool, termination: str = "") -> None:
        """Note whether the run reached its end."""
        self.complete = complete

    def run_data(self) -> RunData:
        """Return the frames as arrays over time."""
        if self.description is None:
            raise RuntimeError("no run has been observed yet")
        frames = self.frames
        node_frames = NodeFrames(self.description)

        def stack(name: str, dtype: type = float) -> np.ndarray:
            return np.array([getattr(frame, name) for frame in frames], dtype)

        def material_frames(frame: Frame) -> np.ndarray:
            node_frames.update(frame)
            return node_frames.quaternions.astype(np.float32)

        detector = EventDetector(self.description)
        events = [event for frame in frames for event in detector.see(frame)]

        return RunData(
            description=self.description,
            times=stack("time"),
            stimulus=stack("stimulus"),
            energy={name: np.array([frame.energy[name] for frame in frames]) for name in frames[0].energy},
            com=stack("com"),
            body_positions=stack("body_positions"),
            body_quaternions=stack("body_quaternions"),
            contact_wrenches=stack("contact_wrenches"),
            clamp_wrenches=stack("clamp_wrenches"),
            pair_forces=stack("pair_forces"),
            joint_figures=stack("joint_figures"),
            solver={name: stack(name) for name in SOLVER_LABELS},
            shape_times=stack("time"),
            positions=stack("positions", np.float32),
            contact_forces=stack("contact_forces", np.float32),
            material_frames=np.array([material_frames(frame) for frame in frames]),
            strain=stack("strain", np.float32),
            curvature=stack("curvature", np.float32),
            section_curvature=stack("section_curvature", np.float32),
            events=(*events, *detector.end(frames[-1].time)),
        )
