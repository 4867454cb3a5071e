"""Frames, which cost the thread of the steps a look and two copies: what else is derived, who asks for it computes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from functools import cached_property
from typing import Any

import numpy as np

from bilayer_core.engine.between_ends import Instant, write_between
from bilayer_core.forces.flattening import write_sections
from bilayer_core.model.state import State, sealed
from bilayer_core.observed.frame import Frame
from bilayer_core.simulation.observation import energies, positions_with_points, velocities_with_points
from bilayer_core.simulation.parts import Parts
from bilayer_core.simulation.statistics import RunStatistics, center_of_mass
from bilayer_core.simulation.stepper import Stepper
from bilayer_core.simulation.strip_sections import across_at_nodes


class Capture:
    """Source of the attributes of a frame: a copy of the present state, and of the observations of it."""

    def __init__(self, stepper: Stepper, state: State):
        self.model, self.owners = stepper.model, stepper.contact_owners
        self.time, self.step = float(state.time[0]), int(state.step[0])
        self.stimulus, self.min_gap = stepper.stimulus.copy(), float(stepper.engine.gap)
        self.seen, self.touching = stepper.observe(state)
        for piece in (write_between, *([write_sections] if self.model.flattening.exists else [])):
            _ = piece.address  # loaded by the thread of the steps, whoever asks
        self.values, self.places = state.values.copy(), state.places
        self.values.flags.writeable = False  # parts of it are handed out as they are
        self.state = Parts(self.values, self.places)

    @cached_property
    def instant(self) -> Instant:
        """An end of frames within a step."""
        return instant_of(self.state, self.seen)

    @cached_property
    def across(self) -> np.ndarray:
        """Mean curvature across of strips at all nodes [1/m]."""
        return across_at_nodes(self.model, self.state)


def instant_of(state: Parts, seen: Parts) -> Instant:
    """Return what a state and observations of it have of an instant, as views."""
    forces = {name: getattr(seen, name) for name in ("contact_force", "contact_wrench", "quaternion")}
    return Instant(**{name: getattr(state, name) for name in Instant.names if name not in forces}, **forces)


_DERIVED: dict[str, Callable[[Any], Any]] = {
    "positions": lambda of: positions_with_points(of.model, of.state),
    "velocities": lambda of: velocities_with_points(of.model, of.state),
    "directors": lambda of: of.state.director1,
    "strain": lambda of: of.seen.strain,
    "curvature": lambda of: of.seen.curvature,
    "section_curvature": lambda of: np.append(of.across, np.zeros(of.model.point_count)),
    "contact_forces": lambda of: of.seen.contact_force,
    "body_positions": lambda of: of.state.body_position,
    "body_quaternions": lambda of: of.seen.quaternion,
    "body_velocities": lambda of: of.state.body_velocity,
    "body_angular_velocities": lambda of: of.state.body_angular_velocity,
    "contact_wrenches": lambda of: of.seen.contact_wrench,
    "clamp_wrenches": lambda of: of.seen.clamp_wrench,
    "pair_forces": lambda of: of.seen.pair_force,
    "joint_figures": lambda of: np.concatenate([of.seen.joint_wrench.ravel(), of.seen.motion]),
    "com": lambda of: center_of_mass(of.model, of.state),
    "contacts": lambda of: of.owners.names_of(of.touching),
    "energy": lambda of: energies(of.model, of.seen),
    "state": lambda of: sealed(of.values, of.places["seal"][0]),
}
"""How attributes of a `Frame` are computed."""


class CapturedFrame(Frame):
    """A `Frame` whose derived attributes are computed when first asked for, in whatever thread that is."""

    @classmethod
    def of(cls, capture: Any, **known: Any) -> CapturedFrame:
        """Return a frame with those attributes that need not be computed."""
        frame = object.__new__(cls)
        frame.__dict__.update(known, _capture=capture)
        return frame

    def __getattr__(self, name: str) -> Any:
        derive = _DERIVED.get(name)
        if derive is None:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        value = self.__dict__[name] = derive(self.__dict__["_capture"])
        return value

    def __reduce__(self) -> tuple:
        """Copy and pickle the frame with all attributes, without the model."""
        return Frame, tuple(getattr(self, part.name) for part in fields(Frame))


def make_frame(capture: Any, statistics: RunStatistics, cpu_time: float) -> Frame:
    """Return the frame of a `Capture`, or of something like it."""
    return CapturedFrame.of(
        capture,
        time=capture.time,
        step=capture.step,
        stimulus=capture.stimulus,
        min_gap=capture.min_gap,
        iterations=statistics.iterations,
        residual=statistics.last_residual,
        substeps=statistics.substeps,
        cpu_time=cpu_time,
        rejected=(statistics.rejected, statistics.inaccurate, statistics.gaining),
        beyond_limits=statistics.beyond_limits,
    )
