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
    inertia: tuple[PositiveInertia, PositiveInertia, PositiveInertia] | None = None
    """Principal moments of inertia; without them those of a solid ball, or of a hollow one if `shell` is true."""
    shell: bool = False
    velocity: tuple[Speed, Speed, Speed] = (0.0, 0.0, 0.0)
    angular_velocity: tuple[AngularSpeed, AngularSpeed, AngularSpeed] = (0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def _check(self) -> Free:
        refuse_all("Free", checks.faults_of_inertia(self))
        return self


class Guided(Part):
    """A body on a rail: it slides along an axis as the forces on it demand, and does not turn."""

    type: Literal["guided"]
    axis: Direction
    mass: PositiveMass
    speed: Speed = 0.0
    """At the start, along the axis."""


class Prescribed(Part):
    """A body that is guided: at rest, or through points with a rest at each (cubic smoothstep between them)."""

    type: Literal["prescribed"]
    times: list[NonNegativeTime] = []
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
    position: Point
    motion: Annotated[Free | Guided | Prescribed, Field(discriminator="type")]
    surface: Sphere | None = None
    contact_points: list[ContactPoint] = []
