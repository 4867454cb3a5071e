"""Frames that cost the stepping thread copies alone: what is derived is computed by who asks for it, in its thread."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from typing import Any, NamedTuple

import numpy as np

from ..kinematics.rotation import quaternion_from_matrix
from ..model.state import State
from ..observed.frame import Frame
from . import observation as observe
from .contact_pairs import Pairs
from .fluid_energy import energy_of_fluid
from .statistics import RunStatistics, center_of_mass
from .stepper import Stepper

Array = np.ndarray


class _End(NamedTuple):
    """Of a `Configuration`, what is looked at."""

    length: Array
    tangent: Array
    director1: Array
    arm: Array


class _Sums(NamedTuple):
    """Of `Sums`, likewise."""

    contact_point: Array
    contact: Array
    attached: Array
    edge: Array
    energy: Array


class _Between(NamedTuple):
    """Of joints or mechanisms between bodies, likewise."""

    body: Array
    gradient: Array


class _State:
    """Parts of a flat state, as views of it, each when it is asked for."""

    def __init__(self, flat: Array, places: dict[str, tuple[int, int, tuple[int, ...]]]):
        self._flat, self._places = flat, places

    def __getattr__(self, name: str) -> Array:
        try:
            begin, end, shape = self._places[name]
        except KeyError:
            raise AttributeError(name) from None
        part = self.__dict__[name] = self._flat[begin:end].reshape(shape)
        return part


class Capture:
    """Copies of what derived quantities depend on, which stands for the stepper in functions of `observation`."""

    def __init__(self, stepper: Stepper, state: State):
        self.model, self.tables = stepper.model, stepper.tables
        engine, at = stepper.engine, stepper.end
        engine.evaluate_end()
        sums = engine.sums
        self.flat = state.flat()
        self.flat.flags.writeable = False  # parts of it are handed out as they are
        self.state = _State(self.flat, self.tables.places_in(state))
        self.end = _End(at.length.copy(), at.tangent.copy(), at.director1.copy(), at.arm.copy())
        self.sums = _Sums(
            sums.contact_point[: self.model.node_count + self.model.point_count].copy(),
            sums.contact.copy(),
            sums.attached.copy(),
            sums.edge.copy(),
            sums.energy.copy(),
        )
        between = [_Between(of.body, of.gradient.copy()) for of in observe.between_bodies(stepper)]
        self.joints = between[0] if self.tables.has_joints else None
        self.mechanisms = between[-1] if self.tables.has_mechanisms else None
        self.owners = stepper.contact_owners
        self.touching = self.owners.touching(engine)
        of_fluid = len(self.model.fluid_mass) > 0
        self.fluid_energy = energy_of_fluid(self.model, at, state.velocity, state.spin) if of_fluid else None

    @property
    def engine(self) -> Capture:
        """Itself: it has what is asked of an engine, too."""
        return self

    def positions(self) -> Array:
        """As in `Frame`, like all that follow."""
        return observe.positions_with_points(self.model, self.state)

    def velocities(self) -> Array:
        return observe.velocities_with_points(self.model, self.state)

    def strain(self) -> Array:
        return observe.node_strain(self.model, self)

    def curvature(self) -> Array:
        return observe.node_curvature(self.model, self)

    def body_quaternions(self) -> Array:
        return np.array([quaternion_from_matrix(of) for of in self.state.body_rotation]).reshape(-1, 4)

    def contacts(self) -> Pairs:
        return self.owners.names_of(self.touching)

    def com(self) -> Array:
        return center_of_mass(self.model, self.state)

    def energy(self) -> dict[str, float]:
        return observe.energies(self, self.state, self.fluid_energy)


_DERIVED: dict[str, Callable[[Capture], Any]] = {
    "positions": Capture.positions,
    "velocities": Capture.velocities,
    "directors": lambda of: of.state.director1,
    "strain": Capture.strain,
    "curvature": Capture.curvature,
    "contact_forces": observe.contact_forces,
    "body_positions": lambda of: of.state.body_position,
    "body_quaternions": Capture.body_quaternions,
    "body_velocities": lambda of: of.state.body_velocity,
    "body_angular_velocities": lambda of: of.state.body_angular_velocity,
    "contact_wrenches": observe.contact_wrenches,
    "clamp_wrenches": observe.clamp_wrenches,
    "com": Capture.com,
    "contacts": Capture.contacts,
    "energy": Capture.energy,
}
"""How attributes of a `Frame` are computed."""


class CapturedFrame(Frame):
    """A `Frame` whose derived attributes are computed when first asked for, in whatever thread that is."""

    @classmethod
    def of(cls, capture: Capture, **known: Any) -> CapturedFrame:
        """A frame with those attributes that need not be computed."""
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
        """Copied and pickled with all attributes, without the model."""
        return Frame, tuple(getattr(self, part.name) for part in fields(Frame))


def make_frame(stepper: Stepper, state: State, time: float, statistics: RunStatistics, cpu_time: float) -> Frame:
    """Snapshot of the last accepted configuration."""
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
        state=capture.flat,
        rejected=(statistics.rejected, statistics.inaccurate, statistics.gaining),
    )
