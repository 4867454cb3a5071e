"""Joints between two bodies."""

from __future__ import annotations

from typing import Literal

from pydantic import model_validator

from bilayer_core.scene.faults import Fault, refuse_all
from bilayer_core.scene.part import Direction, Name, Part, Point
from bilayer_core.scene.units import real

PositiveRate = real("a stiffness", "N/m", "1e6 N/m", above=0.0)
PositiveTorsionRate = real("a torsional stiffness", "N*m/rad", "100 N*m/rad", above=0.0)


class Joint(Part):
    """Holds a point of one body at a point of another, and directions on a hinge or a weld, by stiff springs."""

    name: Name
    """Unique among the joints."""
    type: Literal["pin", "hinge", "weld"]
    """What stays free: all rotations, that about an axis, or none."""
    bodies: tuple[Name, Name]
    """The two; ends of rods are joined by the bodies that hold them, which need no mass."""
    point: Point
    """Where it is at the start, in the world."""
    axis: Direction | None = None
    """Of a hinge at the start, in the world."""
    stiffness: PositiveRate | None = None
    """Force by the distance of the two points; by default a hundred times that of the stiffest edge of a rod."""
    torsional_stiffness: PositiveTorsionRate | None = None
    """Moment by the angle between directions that a hinge or a weld keeps; by default likewise of the stiffest bend."""

    @model_validator(mode="after")
    def _check(self) -> Joint:
        refuse_all("Joint", faults_of_joint(self))
        return self


def faults_of_joint(joint: Joint) -> list[Fault]:
    """What does not go with its type, and bodies that are one."""
    faults: list[Fault] = []
    if joint.bodies[0] == joint.bodies[1]:
        faults.append((("bodies",), list(joint.bodies), "must be two different bodies"))
    if joint.type == "hinge" and joint.axis is None:
        faults.append((("axis",), None, "must be given for a hinge"))
    if joint.type != "hinge" and joint.axis is not None:
        faults.append((("axis",), list(joint.axis), f"must be left out: a {joint.type} has none"))
    if joint.type == "pin" and joint.torsional_stiffness is not None:
        faults.append((("torsional_stiffness",), joint.torsional_stiffness, "must be left out: a pin turns freely"))
    return faults
