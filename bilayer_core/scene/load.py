"""Point masses on rods, and forces and moments that act from outside."""

from __future__ import annotations

from typing import Literal

from bilayer_core.scene.faults import Fault
from bilayer_core.scene.part import Name, Part
from bilayer_core.scene.schedule import Hold, Schedule
from bilayer_core.scene.spans import Spans
from bilayer_core.scene.units import Force, Moment, NonNegativeLength, PositiveMass

ALWAYS = Hold(type="hold", value=1.0)


class PointMass(Part):
    """A mass fixed to the path of a rod; it has weight and inertia, and no size."""

    name: Name
    """Unique among the masses."""
    rod: Name
    """A copy such as `arm_0`, or all copies of a pattern: each has the mass."""
    position: NonNegativeLength
    """Along the path."""
    mass: PositiveMass
    """Of each."""


class Load(Part):
    """A force on a rod or on a body, or a moment on a body."""

    name: Name
    """Unique among the loads."""
    rod: Name | None = None
    """A copy such as `arm_0`, or all copies of a pattern: each has the force."""
    position: NonNegativeLength | None = None
    """Along the path of the rod."""
    body: Name | None = None
    """Instead of a rod; the force acts at its mass centre."""
    force: tuple[Force, Force, Force] = (0.0, 0.0, 0.0)
    """Multiplied with the schedule's value."""
    moment: tuple[Moment, Moment, Moment] = (0.0, 0.0, 0.0)
    """Of bodies only; multiplied with the schedule's value."""
    frame: Literal["world", "material"] = "world"
    """Axes of the components: the world's, or those of what it acts on, with which the load turns: the axes of a body,
    or path, normal and path × normal of a rod."""
    schedule: Schedule | None = None
    """Factor over time; without it 1."""

    def _faults(self) -> list[Fault]:
        """Return the faults of a load that does not act on one thing, at one place, with what is allowed there."""
        if (self.rod is None) == (self.body is None):
            found = None if self.rod is None else f"{self.rod}, beside the body {self.body}"
            return [(("rod",), found, "must be given, or `body` instead of it: a load acts on one of the two")]
        faults: list[Fault] = []
        if self.rod is not None and self.position is None:
            faults.append((("position",), None, "must be given for a load on a rod: a length along its path"))
        if self.body is not None and self.position is not None:
            faults.append((("position",), self.position, "must be left out: a force on a body acts at its mass centre"))
        if self.rod is not None and any(self.moment):
            faults.append((("moment",), self.moment, "must be left out: only bodies take moments"))
        if not any(self.force) and not any(self.moment):
            faults.append((("force",), self.force, "must not be zero" + (" where `moment` is" if self.body else "")))
        return faults

    @property
    def factor(self) -> Spans:
        """Factor of force and moment over time."""
        return ALWAYS if self.schedule is None else self.schedule
