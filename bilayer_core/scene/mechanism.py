"""Resistance to the motions that hinges, rails and joints leave free: springs, damping, friction, limits."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated

from bilayer_core.scene.faults import Fault
from bilayer_core.scene.part import Part
from bilayer_core.scene.units import Angle, Length, PositiveSpeed, real

NonNegativeStiffness = Annotated[float, *real("a stiffness", "N/m", "20 N/m", at_least=0.0)]
NonNegativeTorsion = Annotated[float, *real("a torsional stiffness", "N*m/rad", "2e-4 N*m/rad", at_least=0.0)]
PositiveStiffness = Annotated[float, *real("a stiffness", "N/m", "1e6 N/m", above=0.0)]
PositiveTorsion = Annotated[float, *real("a torsional stiffness", "N*m/rad", "10 N*m/rad", above=0.0)]
Damping = Annotated[float, *real("a damping coefficient", "N*s/m", "0.01 N*s/m", at_least=0.0)]
TorsionalDamping = Annotated[
    float, *real("a torsional damping coefficient", "N*m*s/rad", "1e-6 N*m*s/rad", at_least=0.0)
]
NonNegativeForce = Annotated[float, *real("a force", "N", "10 mN", at_least=0.0)]
NonNegativeMoment = Annotated[float, *real("a moment", "N*m", "0.1 N*mm", at_least=0.0)]
PositiveAngularSpeed = Annotated[float, *real("an angular speed", "rad/s", "0.01 rad/s", above=0.0)]


class Turning(Part):
    """Resistance to turning about an axis. Angles are 0 at the start, and go on over whole turns."""

    spring: NonNegativeTorsion = 0.0
    """Torsional stiffness of a spring about the axis."""
    rest_angle: Angle = 0.0
    """At which the spring exerts no moment; it may be several turns."""
    damping: TorsionalDamping = 0.0
    """Moment by the angular speed."""
    friction: NonNegativeMoment = 0.0
    """Moment of dry friction, whatever the joint bears."""
    friction_speed: PositiveAngularSpeed = 0.01
    """Below it dry friction fades: a hinge that it holds creeps, slower than that."""
    limits: tuple[Angle, Angle] | None = None
    """Least and greatest angle, the start between them; by default it turns on and on."""
    limit_stiffness: PositiveTorsion | None = None
    """Moment by the angle beyond a limit; by default a hundred times that of the stiffest bend of a rod."""

    def _faults(self) -> Iterator[Fault]:
        return _faults_of_limits(self, "rest_angle")

    @property
    def rest(self) -> float:
        """Rest angle of the spring [rad]."""
        return self.rest_angle


class Sliding(Part):
    """Resistance to sliding along an axis. Displacements are 0 at the start."""

    spring: NonNegativeStiffness = 0.0
    """Stiffness of a spring along the axis."""
    rest_position: Length = 0.0
    """At which the spring exerts no force."""
    damping: Damping = 0.0
    """Force by the speed."""
    friction: NonNegativeForce = 0.0
    """Force of dry friction, whatever the joint bears."""
    friction_speed: PositiveSpeed = 1e-4
    """Below it dry friction fades: a slide that it holds creeps, slower than that."""
    limits: tuple[Length, Length] | None = None
    """Least and greatest displacement, the start between them; by default it slides on and on."""
    limit_stiffness: PositiveStiffness | None = None
    """Force by the distance beyond a limit; by default a hundred times that of the stiffest edge of a rod."""

    def _faults(self) -> Iterator[Fault]:
        return _faults_of_limits(self, "rest_position")

    @property
    def rest(self) -> float:
        """Rest position of the spring [m]."""
        return self.rest_position


def resistance(*laws: Turning | Sliding | None) -> str:
    """Return the kinds of resistance that laws have, in words that continue a phrase; empty if there are none."""
    found = {
        word: None
        for law in laws
        if law is not None
        for word, has in (
            ("a spring", law.spring),
            ("damping", law.damping),
            ("friction", law.friction),
            ("limits", law.limits),
        )
        if has
    }
    words = list(found)
    if not words:
        return ""
    return " with " + " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def _faults_of_limits(law: Turning | Sliding, rest: str) -> Iterator[Fault]:
    """Yield the faults of keys that need another, and of limits that leave no room."""
    if law.spring == 0.0 and getattr(law, rest) != 0.0:
        yield (rest,), getattr(law, rest), "must be left out: there is no `spring`"
    if law.limits is None:
        if law.limit_stiffness is not None:
            yield ("limit_stiffness",), law.limit_stiffness, "must be left out: there are no `limits`"
        return
    low, high = law.limits
    if not (low < high and low <= 0.0 <= high):
        yield ("limits",), list(law.limits), "must be [least, greatest] with the start, 0, between them"
