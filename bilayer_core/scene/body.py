"""Rigid bodies of a scene."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from bilayer_core.scene.faults import ROUNDING, Fault, refuse_all
from bilayer_core.scene.part import Direction, Name, Part, Point
from bilayer_core.scene.schedule import faults_of_times, first_after
from bilayer_core.scene.shape import RotationVector, Surface
from bilayer_core.scene.units import (
    AngularSpeed,
    NonNegativeLength,
    NonNegativeTime,
    PositiveInertia,
    PositiveLength,
    PositiveMass,
    Speed,
)


class Free(Part):
    """A body that moves as the forces on it demand."""

    type: Literal["free"]
    mass: PositiveMass
    """Its own, without that of the rods it holds."""
    inertia: tuple[PositiveInertia, PositiveInertia, PositiveInertia] | None = None
    """Principal moments of inertia; without them those of the solid surface, or of a hollow ball if `shell` is true."""
    shell: bool = False
    """Whether a ball is hollow: moment of inertia 2/3 m r² instead of 2/5 m r²."""
    velocity: tuple[Speed, Speed, Speed] = (0.0, 0.0, 0.0)
    """At the start."""
    angular_velocity: tuple[AngularSpeed, AngularSpeed, AngularSpeed] = (0.0, 0.0, 0.0)
    """At the start, about the axes of the world."""

    @model_validator(mode="after")
    def _check(self) -> Free:
        refuse_all("Free", faults_of_inertia(self))
        return self


class Guided(Part):
    """A body on a rail: it slides along an axis as the forces on it demand, and does not turn."""

    type: Literal["guided"]
    axis: Direction
    """Of the rail."""
    mass: PositiveMass
    """Its own, without that of the rods it holds."""
    speed: Speed = 0.0
    """At the start, along the axis."""


class Prescribed(Part):
    """A body on a schedule: at rest, or through poses with a rest at each (cubic smoothstep between them)."""

    type: Literal["prescribed"]
    times: list[NonNegativeTime] = []
    """Increasing; without any the body stays where it is."""
    displacements: list[Point] = []
    """From the body's position, at each of the times; the first is zero."""
    rotations: list[RotationVector] = []
    """From the body's rotation at the start, about the axes of the world, at each of the times; the first is zero."""

    def breakpoint_after(self, t: float) -> float:
        """First of the times after `t` [s], infinity if there is none: there the acceleration jumps."""
        return first_after(t, self.times)

    @property
    def moves(self) -> bool:
        """Whether it is ever elsewhere than at the start."""
        return any(any(part) for part in (*self.displacements, *self.rotations))

    @model_validator(mode="after")
    def _check(self) -> Prescribed:
        faults = []
        if self.displacements or not self.rotations:
            faults += faults_of_times(self.times, ("displacements",), self.displacements)
        if self.rotations:
            faults += [f for f in faults_of_times(self.times, ("rotations",), self.rotations) if f not in faults]
        for key, start, values in (
            ("displacements", "position", self.displacements),
            ("rotations", "rotation", self.rotations),
        ):
            if values and any(values[0]):
                faults.append(((key, 0), values[0], f"must be [0, 0, 0]: `{start}` is where the body starts"))
        refuse_all("Prescribed", faults)
        return self


class ContactPoint(Part):
    """A point of a body that feels surfaces."""

    position: Point
    """In the frame of the body."""
    length: PositiveLength
    """Weight of its barrier: the length of rod that it stands for."""
    offset: NonNegativeLength
    """From the point to the body's face."""


class Body(Part):
    """A rigid body."""

    name: Name
    """By which rods are clamped to it; part of the names of its topics."""
    position: Point
    """Of the mass centre at the start."""
    motion: Annotated[Free | Guided | Prescribed, Field(discriminator="type")]
    """What moves it."""
    rotation: RotationVector = (0.0, 0.0, 0.0)
    """Of its frame at the start, axis times angle: `[0, 0, 30 deg]` turns it about z."""
    surface: Surface | None = None
    """What others touch; without one nothing does."""
    contact_points: list[ContactPoint] = []
    """Points by which the body itself touches surfaces."""


def faults_of_inertia(motion: Free) -> list[Fault]:
    """Whether the moments of inertia can be those of a body."""
    if motion.inertia is None:
        return []
    if motion.shell:
        return [(("shell",), True, "must be left out where `inertia` is given")]
    small, middle, large = sorted(motion.inertia)
    if large > (1.0 + ROUNDING) * (small + middle):
        return [(("inertia",), motion.inertia, "must be such that none exceeds the sum of the other two")]
    return []
