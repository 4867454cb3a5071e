"""Shapes of surfaces, on bodies and as obstacles."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from bilayer_core.scene.faults import Fault, faults_of_rounding
from bilayer_core.scene.friction import Coefficients
from bilayer_core.scene.limits import MOST_POINTS
from bilayer_core.scene.part import Direction, Name, Part, Point
from bilayer_core.scene.units import Angle, NonNegativeLength, PositiveLength, whole

RotationVector = tuple[Angle, Angle, Angle]
"""Axis times angle."""


class _Grained(Part):
    """A surface on which things may slide more easily one way than another."""

    grain: Direction | None = None
    """Forward direction of friction for all that slides on it (`contact.friction.forward`, `backward`, `sideways`), in
    the frame of the body or the obstacle; none by default."""


class _Plane(_Grained):
    """A half space; rods and bodies stay on the side to which the normal points."""

    normal: Direction
    """Out of the half space, towards the robot."""


class _Sphere(_Grained):
    """A ball."""

    radius: PositiveLength
    """About its position."""


class _Box(_Grained):
    """A box."""

    size: tuple[PositiveLength, PositiveLength, PositiveLength]
    """Lengths of its edges, along its own x, y and z."""
    rounding: NonNegativeLength = 0.0
    """Radius of its edges and corners; the box keeps its size."""

    def _faults(self) -> list[Fault]:
        return faults_of_rounding(self.rounding, 0.5 * min(self.size), "half the shortest edge")


class _Cylinder(_Grained):
    """A cylinder with flat ends."""

    axis: Direction = (0.0, 0.0, 1.0)
    """In the frame of the body, or in the world."""
    radius: PositiveLength
    """About its axis."""
    length: PositiveLength
    """Along its axis, between its ends."""
    rounding: NonNegativeLength = 0.0
    """Radius of its rims; the cylinder keeps its size."""
    rim_points: Annotated[int, *whole(3, MOST_POINTS)] = 64
    """Points on each rim that feel other surfaces; rolling down a slope, 64 lose 1 to 3 % of the acceleration."""

    def _faults(self) -> list[Fault]:
        largest = min(self.radius, 0.5 * self.length)
        return faults_of_rounding(self.rounding, largest, "the radius and half the length")


class Plane(_Plane):
    """A half space through the body's position; not for free bodies."""

    shape: Literal["plane"]


class Sphere(_Sphere):
    """A sphere about the body's position."""

    shape: Literal["sphere"]


class Box(_Box):
    """A box about the body's position, its edges along the axes of the body's frame."""

    shape: Literal["box"]


class Cylinder(_Cylinder):
    """A cylinder about the body's position, its axis in the body's frame."""

    shape: Literal["cylinder"]


class _Fixed(Part):
    """A surface fixed in the world."""

    name: Name
    """Unique among rods, bodies and obstacles."""
    friction: Coefficients | None = None
    """Of its own; by default it takes those of what touches it, or of `contact.friction`."""


class PlaneObstacle(_Plane, _Fixed):
    """A fixed half space."""

    type: Literal["plane"]
    point: Point
    """Any point of the plane."""


class SphereObstacle(_Sphere, _Fixed):
    """A fixed ball."""

    type: Literal["sphere"]
    position: Point
    """Of its middle."""


class BoxObstacle(_Box, _Fixed):
    """A fixed box."""

    type: Literal["box"]
    position: Point
    """Of its middle."""
    rotation: RotationVector = (0.0, 0.0, 0.0)
    """Axis times angle: `[0, 0, 30 deg]` turns it about z."""


class CylinderObstacle(_Cylinder, _Fixed):
    """A fixed cylinder."""

    type: Literal["cylinder"]
    position: Point
    """Of its middle."""


Surface = Annotated[Plane | Sphere | Box | Cylinder, Field(discriminator="shape")]
Obstacle = Annotated[PlaneObstacle | SphereObstacle | BoxObstacle | CylinderObstacle, Field(discriminator="type")]
