"""Rigid bodies of a scene."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from bilayer_core.scene.faults import ROUNDING, Fault
from bilayer_core.scene.friction import Coefficients
from bilayer_core.scene.mechanism import Sliding, Turning, resistance
from bilayer_core.scene.part import AngularVelocity, Direction, Name, Part, Point, Velocity
from bilayer_core.scene.schedule import faults_of_times
from bilayer_core.scene.shape import RotationVector, Surface
from bilayer_core.scene.units import (
    AngularSpeed,
    NonNegativeLength,
    NonNegativeMass,
    NonNegativeTime,
    PositiveAngularSpeed,
    PositiveArea,
    PositiveInertia,
    PositiveLength,
    PositiveNumber,
    PositiveSpeed,
    Speed,
)

LEAST_INERTIA = 1e-10
"""Of the largest principal moment: with less, rounding decides how a body rotates about that axis."""
Inertia = tuple[PositiveInertia, PositiveInertia, PositiveInertia]


class Free(Part):
    """A body that moves as the forces on it demand."""

    type: Literal["free"]
    mass: NonNegativeMass = 0.0
    """Its own, without that of the rods it holds; 0 for a junction, which moves with the inertia of what it holds."""
    inertia: Inertia | None = None
    """Principal moments of inertia; without them those of the solid surface, or of a hollow ball if `shell` is true; of
    a junction those of the half edges that it holds, about their ends."""
    shell: bool = False
    """Whether a ball is hollow: moment of inertia 2/3 m r² instead of 2/5 m r²."""
    velocity: Velocity | None = None
    """At the start. Rods and bodies that hang on the body move with it; a body without `velocity` and
    `angular_velocity` moves with what it hangs on, and otherwise rests."""
    angular_velocity: AngularVelocity | None = None
    """At the start, about the axes of the world, likewise."""

    @property
    def turns(self) -> bool:
        """True if the body can turn."""
        return True

    def describe(self) -> str:
        """Describe the body in a few words."""
        return "free body" if self.mass > 0.0 else "junction without mass"

    def _faults(self) -> list[Fault]:
        return faults_of_inertia(self)


class Guided(Part):
    """A body on a rail, a hinge or a pin: it slides along an axis or turns, as the forces on it demand, and makes no
    other motion.
    """

    type: Literal["guided"]
    axis: Direction | None = None
    """Of the rail; without one it does not slide."""
    hinge: Direction | None = None
    """About which it turns, through its position."""
    pinned: bool = False
    """Whether it turns in all directions about its position."""
    mass: NonNegativeMass = 0.0
    """Its own, without that of the rods it holds; 0 for a joint, which moves with the inertia of what it holds."""
    inertia: Inertia | None = None
    """Principal moments of inertia of one that turns; by default those of its surface, or of the half edges that it
    holds, about their ends, if its mass is 0."""
    speed: Speed = 0.0
    """At the start, along the axis."""
    angular_speed: AngularSpeed = 0.0
    """At the start, about the hinge."""
    turning: Turning | None = None
    """What resists its turn about the hinge."""
    sliding: Sliding | None = None
    """What resists its way along the rail."""

    @property
    def turns(self) -> bool:
        """True if the body can turn."""
        return self.pinned or self.hinge is not None

    def describe(self) -> str:
        """Describe the body in a few words."""
        ways = {
            f"on a rail{resistance(self.sliding)}": self.axis is not None,
            f"on a hinge{resistance(self.turning)}": self.hinge is not None,
            "on a pin": self.pinned,
        }
        return f"guided body, {' and '.join(way for way, has in ways.items() if has)}"

    def _faults(self) -> list[Fault]:
        """Return the faults of a guided motion: no way to move, settings without meaning, impossible inertia."""
        faults: list[Fault] = []
        if self.axis is None and not self.turns:
            faults.append((("axis",), None, "must be given, or `hinge`, or `pinned`: else it does not move"))
        if self.axis is None and self.speed:
            faults.append((("speed",), self.speed, "must be left out: without an axis it does not slide"))
        if self.hinge is not None and self.pinned:
            faults.append((("hinge",), self.hinge, "must be left out: a pinned body turns in all directions"))
        if self.hinge is None and self.angular_speed:
            faults.append((("angular_speed",), self.angular_speed, "must be left out: without a hinge it has no axis"))
        if self.hinge is None and self.turning is not None:
            found = self.turning.model_dump(exclude_defaults=True)
            faults.append((("turning",), found, "must be left out: without a hinge it has no axis"))
        if self.axis is None and self.sliding is not None:
            found = self.sliding.model_dump(exclude_defaults=True)
            faults.append((("sliding",), found, "must be left out: without an axis it does not slide"))
        if self.inertia is not None and not self.turns:
            faults.append((("inertia",), self.inertia, "must be left out: it does not turn"))
        return [*faults, *faults_of_inertia(self)]


class Prescribed(Part):
    """A body on a schedule: at rest, or through poses with a rest at each (cubic smoothstep between them), until a
    controller takes it over.
    """

    type: Literal["prescribed"]
    times: list[NonNegativeTime] = []
    """Increasing; without any the body stays where it is."""
    displacements: list[Point] = []
    """From the body's position, at each of the times; the first is zero."""
    rotations: list[RotationVector] = []
    """From the body's rotation at the start, about the axes of the world, at each of the times; the first is zero."""
    top_speed: PositiveSpeed | None = None
    """With which controllers may move it at most, by `set_pose` or the topic `mount_pose`; without one they may not."""
    top_angular_speed: PositiveAngularSpeed | None = None
    """With which they may turn it at most; without one they may not."""

    @property
    def controlled(self) -> bool:
        """True if controllers may move or turn the body."""
        return self.top_speed is not None or self.top_angular_speed is not None

    @property
    def turns(self) -> bool:
        """True if the body ever turns, or may turn."""
        return self.top_angular_speed is not None or any(map(any, self.rotations))

    def describe(self) -> str:
        """Describe the body in a few words."""
        return "prescribed body, which controllers may move" if self.controlled else "prescribed body"

    @property
    def moves(self) -> bool:
        """True if the body ever leaves its pose at the start, or may leave it."""
        return self.controlled or any(any(part) for part in (*self.displacements, *self.rotations))

    def _faults(self) -> list[Fault]:
        faults: list[Fault] = []
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
        return faults


class ContactPoint(Part):
    """A point of a body that feels surfaces."""

    position: Point
    """In the frame of the body."""
    length: PositiveLength
    """Weight of its barrier: the length of rod that it stands for."""
    offset: NonNegativeLength
    """From the point to the body's face."""


class BodyDrag(Part):
    """Resistance of a fluid to the motion of a body, the same in all directions."""

    coefficient: PositiveNumber
    """C in ½ × density × C × area × speed²; 0.47 is that of a ball."""
    area: PositiveArea | None = None
    """Area that the fluid presses on; by default the mean shadow of its surface, a quarter of the area of that."""


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
    friction: Coefficients | None = None
    """Of its own; by default it takes those of what touches it, or of `contact.friction`."""
    drag: BodyDrag | None = None
    """Of the fluid on a free or guided body; none by default."""


def faults_of_inertia(motion: Free | Guided) -> list[Fault]:
    """Return a fault if no body can have the moments of inertia, or if `shell` is given beside them."""
    if motion.inertia is None:
        return []
    if isinstance(motion, Free) and motion.shell:
        return [(("shell",), True, "must be left out where `inertia` is given")]
    small, middle, large = sorted(motion.inertia)
    if large > (1.0 + ROUNDING) * (small + middle):
        return [(("inertia",), motion.inertia, "must be such that none exceeds the sum of the other two")]
    if small < LEAST_INERTIA * large:
        why = f"must all be at least {LEAST_INERTIA:g} of the largest: with {small:g} nothing resists rotation"
        return [(("inertia",), motion.inertia, why)]
    return []
