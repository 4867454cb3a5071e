"""Frames, which cost the thread of the steps a look and two copies: what else is derived, who asks for it computes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from typing import Any

import numpy as np

from bilayer_core.forces.flattening import write_sections
from bilayer_core.model.state import State, sealed
from bilayer_core.observed.frame import Frame
from bilayer_core.simulation.observation import energies, positions_with_points, velocities_with_points
from bilayer_core.simulation.parts import Parts
from bilayer_core.simulation.statistics import RunStatistics, center_of_mass
from bilayer_core.simulation.stepper import Stepper
from bilayer_core.simulation.strip_sections import across_at_nodes


class Capture:
    """Source of the attributes of a frame: a copy of the state, and of the observations of it."""

    def __init__(self, stepper: Stepper, state: State):
        self.model, self.owners = stepper.model, stepper.contact_owners
        self.seen, self.touching = stepper.observe(state)
        if self.model.flattening.exists:
            _ = write_sections.address  # loaded by the thread of the steps, whoever asks for sections
        self.values, self.places = state.values.copy(), state.places
        self.values.flags.writeable = False  # parts of it are handed out as they are
        self.state = Parts(self.values, self.places)


_DERIVED: dict[str, Callable[[Capture], Any]] = {
    "positions": lambda of: positions_with_points(of.model, of.state),
    "velocities": lambda of: velocities_with_points(of.model, of.state),
    "directors": lambda of: of.state.director1,
    "strain": lambda of: of.seen.strain,
    "curvature": lambda of: of.seen.curvature,
    "section_curvature": lambda of: np.append(across_at_nodes(of.model, of.state), np.zeros(of.model.point_count)),
    "contact_forces": lambda of: of.seen.contact_force,
    "body_positions": lambda of: of.state.body_position,
    "body_quaternions": lambda of: of.seen.quaternion,
    "body_velocities": lambda of: of.state.body_velocity,
    "body_angular_velocities": lambda of: of.state.body_angular_velocity,
    "contact_wrenches": lambda of: of.seen.contact_wrench,
    "clamp_wrenches": lambda of: of.seen.clamp_wrench,
    "com": lambda of: center_of_mass(of.model, of.state),
    "contacts": lambda of: of.owners.names_of(of.touching),
    "energy": lambda of: energies(of.model, of.seen),
    "state": lambda of: sealed(of.values, of.places["seal"][0]),
}
"""How attributes of a `Frame` are computed."""


class CapturedFrame(Frame):
    """A `Frame` whose derived attributes are computed when first asked for, in whatever thread that is."""

    @classmethod
    def of(cls, capture: Capture, **known: Any) -> CapturedFrame:
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


def make_frame(stepper: Stepper, state: State, time: float, statistics: RunStatistics, cpu_time: float) -> Frame:
    """Return the snapshot of the last accepted configuration."""
    capture = Capture(stepper, state)
    return CapturedFrame.of(
        capture,
        time=time,
        step=int(state.step[0]),
        stimulus=stepper.stimulus.copy(),
        min_gap=float(stepper.engine.gap),
        iterations=statistics.iterations,
        residual=statistics.last_residual,
        substeps=statistics.substeps,
        cpu_time=cpu_time,
        rejected=(statistics.rejected, statistics.inaccurate, statistics.gaining),
        beyond_limits=statistics.beyond_limits,
    )
