"""Friction: of the scene, and of single rods, bodies and obstacles."""

from __future__ import annotations

from typing import Literal

from bilayer_core.scene.part import Direction, Part
from bilayer_core.scene.units import NonNegativeNumber, PositiveSpeed


class Coefficients(Part):
    """Coefficients of Coulomb friction.

    Where two touch that both have coefficients of their own, `contact.friction.combine` says which holds. If only one
    has, its own hold, and if neither, those of `contact.friction`. Forward, backward and sideways are along and across
    the axis of a part: of a rod its `friction_axis`, of a surface its `grain`.
    """

    coefficient: NonNegativeNumber
    """μ the same every way, and where the next keys do not say otherwise."""
    forward: NonNegativeNumber | None = None
    """Against sliding along + of the axis; like the next two, `coefficient` by default."""
    backward: NonNegativeNumber | None = None
    """Against sliding along − of the axis."""
    sideways: NonNegativeNumber | None = None
    """Against sliding across the axis."""

    @property
    def each_way(self) -> tuple[float, float, float]:
        """Coefficients forward, backward and sideways."""
        given = (self.forward, self.backward, self.sideways)
        return tuple(self.coefficient if value is None else value for value in given)

    @property
    def directed(self) -> bool:
        """True if coefficients for directions are given."""
        return not self.forward is self.backward is self.sideways is None

    @property
    def acts(self) -> bool:
        """True if there is any friction."""
        return self.coefficient > 0.0 or max(self.each_way) > 0.0


class Friction(Coefficients):
    """Coulomb friction, smoothed below a speed.

    Coefficients hold where neither of two that touch has its own (`friction` of rods, bodies and obstacles). Rods may
    slide more easily one way than the other along their axis (`Rod.friction_axis`), and sideways; bodies feel
    `coefficient`. Where `axis` or the `grain` of a surface is given, that is the axis of all that slides, bodies too.
    """

    speed_threshold: PositiveSpeed
    """Sliding speed ε_v from which the full friction acts; what sticks creeps more slowly than that."""
    axis: Direction | None = None
    """A direction in the world that is forward for rods and bodies alike, whatever way they lie; by default that of
    each rod, and none for bodies. The `grain` of a surface goes before it."""
    combine: Literal["minimum", "geometric", "mean", "maximum"] = "minimum"
    """Which coefficient holds between two that both have their own: the smaller one, √(μ₁ μ₂), the mean, or the larger
    one. `forward`, `backward` and `sideways` count as own ones of rods and of surfaces with a grain."""
