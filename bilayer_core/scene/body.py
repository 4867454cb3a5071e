"""Rigid bodies of a scene."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from bilayer_core.scene import checks
from bilayer_core.scene.faults import refuse_all
from bilayer_core.scene.part import Direction, Name, Part, Point
from bilayer_core.scene.schedule import faults_of_times
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
    """Principal moments of inertia; without them those of a solid ball, or of a hollow one if `shell` is true."""
    shell: bool = False
    """Whether a ball is hollow: moment of inertia 2/3 m r² instead of 2/5 m r²."""
    velocity: tuple[Speed, Speed, Speed] = (0.0, 0.0, 0.0)
    """At the start."""
    angular_velocity: tuple[AngularSpeed, AngularSpeed, AngularSpeed] = (0.0, 0.0, 0.0)
    """At the start, about the axes of the world."""

    @model_validator(mode="after")
    def _check(self) -> Free:
        refuse_all("Free", checks.faults_of_inertia(self))
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
    """A body that is guided: at rest, or through points with a rest at each (cubic smoothstep between them)."""

    type: Literal["prescribed"]
    times: list[NonNegativeTime] = []
    """Increasing; without any the body stays where it is."""
    displacements: list[Point] = []
    """From the body's position, at each of the times; the first is zero."""

    @model_validator(mode="after")
    def _check(self) -> Prescribed:
        faults = faults_of_times(self.times, ("displacements",), self.displacements)
        if self.displacements and any(self.displacements[0]):
            found = self.displacements[0]
            faults.append((("displacements", 0), found, "must be [0, 0, 0]: `position` is where the body starts"))
        refuse_all("Prescribed", faults)
        return self


class Sphere(Part):
    """A spherical surface about the body's position."""

    shape: Literal["sphere"]
    radius: PositiveLength
    """About the mass centre."""


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
    surface: Sphere | None = None
    """What others touch; without one nothing does."""
    contact_points: list[ContactPoint] = []
    """Points by which the body itself touches surfaces."""
