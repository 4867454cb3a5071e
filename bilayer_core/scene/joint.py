"""Joints between two bodies."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np

from bilayer_core.scene.faults import ROUNDING, Fault
from bilayer_core.scene.mechanism import Sliding, Turning
from bilayer_core.scene.part import Direction, Name, Part, Point
from bilayer_core.scene.units import real

PositiveRate = Annotated[float, *real("a stiffness", "N/m", "1e6 N/m", above=0.0)]
PositiveTorsionRate = Annotated[float, *real("a torsional stiffness", "N*m/rad", "100 N*m/rad", above=0.0)]
TURNS, SLIDES = ("hinge", "cylinder"), ("slide", "cylinder")
"""Types that turn about their axis, and that slide along it."""
WITH_AXIS = ("hinge", "slide", "cylinder", "universal")


class Joint(Part):
    """Holds two bodies together by stiff springs, and leaves the motions free that its type has."""

    name: Name
    """Unique among the joints."""
    type: Literal["pin", "hinge", "universal", "slide", "cylinder", "weld"]
    """What stays free: all rotations; that about an axis; those about two axes that cross; sliding along an axis;
    sliding along an axis and turning about it; nothing."""
    bodies: tuple[Name, Name]
    """The two; ends of rods are joined by the bodies that hold them, which need no mass."""
    point: Point
    """Where it is at the start, in the world; on a slide or a cylinder the point of the second body that stays on the
    axis."""
    axis: Direction | None = None
    """Of a hinge, a slide, a cylinder, or of a universal joint in the first body, at the start, in the world."""
    second_axis: Direction | None = None
    """Of a universal joint in the second body, at the start, in the world; across `axis`."""
    turning: Turning | None = None
    """What resists the turn of the second body against the first about the axis, on a hinge or a cylinder."""
    sliding: Sliding | None = None
    """What resists the way of the second body along the axis, on a slide or a cylinder."""
    stiffness: PositiveRate | None = None
    """Force by the distance of the two points; by default a hundred times that of the stiffest edge of a rod."""
    torsional_stiffness: PositiveTorsionRate | None = None
    """Moment by the angle between directions that it keeps; by default likewise of the stiffest bend."""

    def _faults(self) -> list[Fault]:
        """Return the faults of a joint: keys that do not go with its type or each other, and bodies that are one."""
        kind = f"a {self.type}" + (" joint" if self.type == "universal" else "")
        faults: list[Fault] = []
        if self.bodies[0] == self.bodies[1]:
            faults.append((("bodies",), list(self.bodies), "must be two different bodies"))
        for key, value, allowed in (
            ("axis", self.axis, self.type in WITH_AXIS),
            ("second_axis", self.second_axis, self.type == "universal"),
        ):
            if allowed and value is None:
                faults.append(((key,), None, f"must be given for {kind}"))
            if not allowed and value is not None:
                faults.append(((key,), list(value), f"must be left out: {kind} has none"))
        if self.axis is not None and self.second_axis is not None:
            if abs(np.dot(self.axis, self.second_axis)) > ROUNDING:
                faults.append((("second_axis",), list(self.second_axis), "must be perpendicular to `axis`"))
        if self.type == "pin" and self.torsional_stiffness is not None:
            faults.append((("torsional_stiffness",), self.torsional_stiffness, "must be left out: a pin turns freely"))
        if self.turning is not None and self.type not in TURNS:
            found = self.turning.model_dump(exclude_defaults=True)
            faults.append((("turning",), found, f"must be left out: {kind} has no axis about which alone it turns"))
        if self.sliding is not None and self.type not in SLIDES:
            found = self.sliding.model_dump(exclude_defaults=True)
            faults.append((("sliding",), found, f"must be left out: {kind} does not slide"))
        return faults
