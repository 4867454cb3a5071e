"""Paths of rods: curves along which they lie at the start, free of stress.

Every path has a `length`, a `turn`, and at lengths along it points, tangents and normals (`frames_at`) and the rates at
which these turn (`curvatures_at`). With the tangent t, the normal n and t×n across,

    t′ = χ n + ξ t×n,    n′ = −χ t + τ t×n,

χ is the curvature towards the normal, ξ that across and τ the twist.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import Any, Literal

import numpy as np

from bilayer_core.scene.faults import ROUNDING, Fault
from bilayer_core.scene.part import Direction, Part, Point
from bilayer_core.scene.units import NonNegativeLength, PositiveAngle, PositiveLength

Array = np.ndarray
Frames = tuple[Array, Array, Array]
"""Points [m], tangents and normals, each of shape (n, 3)."""


class Path(Part):
    """Common interface of all paths; `start` and `length` [m] are keys or properties of each."""

    @property
    @abstractmethod
    def turn(self) -> float:
        """Angle by which the tangent turns in all [rad]."""

    @abstractmethod
    def frames_at(self, normal: Array, arc: Array) -> Frames:
        """Return the frames at lengths `arc` [m] from the start, where the rod's normal is `normal`."""

    @abstractmethod
    def curvatures_at(self, normal: Array, arc: Array, over: float) -> Array:
        """Return χ, ξ, τ [1/m] there, shape (n, 3). Corners have a mean `over` a length [m] alone."""

    @property
    def is_closed(self) -> bool:
        """True if the path ends where it starts, so that a rod on it has no ends."""
        return bool(vars(self).get("closed", False))  # a field of some paths

    @property
    def sharpest(self) -> Array:
        """Lengths along it [m] of which one has the largest curvature."""
        return np.array([0.0, self.length])

    def demand_of_normal(self, normal: Array) -> str:
        """Return the fault of the rod's normal at the start, in words; empty if it has none."""
        return _demand_perpendicular(normal, self.direction, "the path")

    def key_of_radius(self, arc: float) -> str:
        """Return the key that sets the radius of curvature at a length along the path [m]."""
        return "radius"

    def describe(self) -> str:
        """Describe the shape in words; empty for a straight one."""
        return ""


def _demand_perpendicular(normal: Array, direction: tuple[float, float, float], what: str) -> str:
    cosine = abs(float(normal @ np.array(direction)))
    if cosine <= ROUNDING:
        return ""
    return f"must be perpendicular to {what}, is {math.degrees(math.asin(min(cosine, 1.0))):.3g} deg off"


def _along_normal(curvature: Array) -> Array:
    """Return the curvatures of a path in the plane of its tangent and its normal, shape (n, 3)."""
    return np.stack([curvature, 0.0 * curvature, 0.0 * curvature], axis=1)


def _side(toward: str) -> float:
    return 1.0 if toward == "normal" else -1.0


class StraightPath(Path):
    """A straight line of given length."""

    shape: Literal["straight"]
    start: Point
    """Of the interface of two layers, or of the middle of one."""
    direction: Direction
    """From the start to the end."""
    length: PositiveLength
    """Of the line."""

    @property
    def turn(self) -> float:
        """Angle by which the tangent turns in all [rad]."""
        return 0.0

    def frames_at(self, normal: Array, arc: Array) -> Frames:
        """Return the frames at lengths `arc` [m] from the start."""
        ones, tangent = np.ones((len(arc), 1)), np.array(self.direction)
        return np.array(self.start) + np.outer(arc, tangent), ones * tangent, ones * normal

    def curvatures_at(self, normal: Array, arc: Array, over: float) -> Array:
        """Return χ, ξ, τ [1/m] at lengths `arc` [m], shape (n, 3)."""
        return np.zeros((len(arc), 3))


class ArcPath(Path):
    """A part of a circle in the plane of its direction and the rod's normal."""

    shape: Literal["arc"]
    start: Point
    """Of the interface of two layers, or of the middle of one."""
    direction: Direction
    """Tangent at the start."""
    radius: PositiveLength
    """Of the circle."""
    angle: PositiveAngle
    """How far round; the length is radius times angle."""
    toward: Literal["normal", "opposite"] = "normal"
    """Side on which the centre lies: that of the rod's normal at the start, or the other."""
    closed: bool = False
    """Of a full circle, `angle: 360 deg`: the rod is a ring without ends, and its last station is the first."""

    def _faults(self) -> list[Fault]:
        """Return a fault if the arc is to be closed and its ends do not meet."""
        if not self.closed or abs(self.angle - 2.0 * math.pi) <= ROUNDING:
            return []
        gap = 2.0 * self.radius * abs(math.sin(0.5 * self.angle))
        demand = f"must be 360 deg of a closed path: its ends are {gap:.3g} m apart"
        if self.angle > 2.0 * math.pi:
            demand = "must be 360 deg of a closed path"
        return [(("angle",), self.angle, demand)]

    @property
    def length(self) -> float:
        """Length of the arc [m]."""
        return self.radius * self.angle

    @property
    def turn(self) -> float:
        """Angle by which the tangent turns in all [rad]."""
        return self.angle

    def frames_at(self, normal: Array, arc: Array) -> Frames:
        """Return the frames at lengths `arc` [m] from the start, with κ < 0 for a centre on the other side of the
        normal.

        t(s) = cos κs t₀ + sin κs n₀,  n(s) = cos κs n₀ − sin κs t₀,  x(s) = x₀ + (sin κs t₀ + (1 − cos κs) n₀)/κ
        """
        curvature, tangent = _side(self.toward) / self.radius, np.array(self.direction)
        cosine, sine = np.cos(curvature * arc), np.sin(curvature * arc)
        points = np.array(self.start) + (np.outer(sine, tangent) + np.outer(1.0 - cosine, normal)) / curvature
        return (
            points,
            np.outer(cosine, tangent) + np.outer(sine, normal),
            np.outer(cosine, normal) - np.outer(sine, tangent),
        )

    def curvatures_at(self, normal: Array, arc: Array, over: float) -> Array:
        """Return χ, ξ, τ [1/m] at lengths `arc` [m], shape (n, 3)."""
        return _along_normal(np.full(len(arc), _side(self.toward) / self.radius))

    def describe(self) -> str:
        """Describe the shape in words."""
        return f"arc of radius {1e3 * self.radius:.4g} mm over {math.degrees(self.angle):.4g}°"


class SpiralPath(Path):
    """An Archimedean spiral in the plane of its direction and the rod's normal: its radius changes evenly with the
    angle.
    """

    shape: Literal["spiral"]
    start: Point
    """Where it begins."""
    direction: Direction
    """Tangent at the start."""
    start_radius: PositiveLength
    """Distance of the start from the centre."""
    end_radius: PositiveLength
    """Distance of the end from the centre."""
    angle: PositiveAngle
    """By which it goes round its centre; may exceed a full turn."""
    toward: Literal["normal", "opposite"] = "normal"
    """Side on which the centre lies: that of the rod's normal at the start, or the other."""

    def _faults(self) -> list[Fault]:
        """Return the radii that make it no spiral."""
        if math.isclose(self.start_radius, self.end_radius, rel_tol=ROUNDING):
            return [
                (("end_radius",), self.end_radius, "must differ from `start_radius`; with equal radii it is an `arc`")
            ]
        return []

    @property
    def growth(self) -> float:
        """Change of the radius with the angle [m/rad]."""
        return (self.end_radius - self.start_radius) / self.angle

    def _length_to(self, angle: Any) -> Any:
        """Return ∫ √(r² + a²) dφ from the start to an angle [rad], with the radius r = r₀ + a φ [m]."""

        def primitive(radius):
            slant = np.hypot(radius, self.growth)
            return 0.5 * (radius * slant / self.growth + self.growth * np.log((radius + slant) / abs(self.growth)))

        return primitive(self.start_radius + self.growth * angle) - primitive(self.start_radius)

    @property
    def length(self) -> float:
        """Length of the spiral [m]."""
        return float(self._length_to(self.angle))

    def angle_at(self, arc: Array) -> Array:
        """Return the angles about the centre [rad] at lengths `arc` [m] from the start: Newton's method on the
        length.
        """
        angle = self.angle * arc / self.length
        for _ in range(20):
            slope = np.hypot(self.start_radius + self.growth * angle, self.growth)
            angle = angle - (self._length_to(angle) - arc) / slope
        return angle

    @property
    def turn(self) -> float:
        """Angle by which the tangent turns in all [rad]."""
        slope = math.atan2(self.growth, self.start_radius) - math.atan2(self.growth, self.end_radius)
        return self.angle + slope

    def frames_at(self, normal: Array, arc: Array) -> Frames:
        """Return the frames at lengths `arc` [m] from the start.

        With e₁ the direction from the centre to the start, e₂ that in which φ grows, ρ = cos φ e₁ + sin φ e₂, ρ′ =
        ∂ρ/∂φ and the centre on the side ±1 of the normal,

        x = C + r ρ,   t = (a ρ + r ρ′)/√(r² + a²),   n = ± (a ρ′ − r ρ)/√(r² + a²)
        """
        tangent, angle, side = np.array(self.direction), self.angle_at(arc), _side(self.toward)
        radius, growth = self.start_radius, self.growth
        slant = np.hypot(radius, growth)
        inward = side * normal
        e1, e2 = (growth * tangent - radius * inward) / slant, (radius * tangent + growth * inward) / slant
        own = (radius + growth * angle)[:, None]
        outward = np.outer(np.cos(angle), e1) + np.outer(np.sin(angle), e2)
        around = np.outer(np.cos(angle), e2) - np.outer(np.sin(angle), e1)
        slant = np.hypot(own, growth)
        points = np.array(self.start) - radius * e1 + own * outward
        return points, (growth * outward + own * around) / slant, side * (growth * around - own * outward) / slant

    def curvatures_at(self, normal: Array, arc: Array, over: float) -> Array:
        """Return χ, ξ, τ [1/m] at lengths `arc` [m], shape (n, 3): χ = ± (r² + 2a²)/(r² + a²)^{3/2}, r = r₀ + a φ."""
        radius, growth = self.start_radius + self.growth * self.angle_at(arc), self.growth
        return _along_normal(_side(self.toward) * (radius**2 + 2.0 * growth**2) / (radius**2 + growth**2) ** 1.5)

    def key_of_radius(self, arc: float) -> str:
        """Return the key that sets the radius of curvature at one of the ends."""
        return "start_radius" if arc == 0.0 else "end_radius"

    def describe(self) -> str:
        """Describe the shape in words."""
        radii = f"{1e3 * self.start_radius:.4g} to {1e3 * self.end_radius:.4g} mm"
        return f"spiral of radius {radii} over {math.degrees(self.angle):.4g}°"


class HelixPath(Path):
    """A helix, on which the rod lies as a ribbon wound on a cylinder: its normal points straight to the axis or away
    from it everywhere, its width lies in the surface.

    The axis passes the start at the distance `radius`, on the side of the rod's normal or the opposite one; the normal
    at the start must be perpendicular to it. The rod bends through its thickness alone, and has the helix's twist.
    """

    shape: Literal["helix"]
    start: Point
    """Of the interface of two layers, or of the middle of one."""
    axis: Direction
    """Along which it advances."""
    radius: PositiveLength
    """Distance from the axis."""
    pitch: NonNegativeLength
    """Advance along the axis in a full turn."""
    angle: PositiveAngle
    """By which it goes round its axis, such as `3 turns`; the length is angle × √(radius² + (pitch/2π)²)."""
    handedness: Literal["right", "left"] = "right"
    """`right` as a usual screw: seen along the axis it goes round clockwise as it moves away."""
    toward: Literal["normal", "opposite"] = "normal"
    """Side on which the axis lies: that of the rod's normal, or the other."""

    def _faults(self) -> list[Fault]:
        """Return a fault if the helix runs into its own start."""
        if self.pitch > 0.0 or self.angle < 2.0 * math.pi * (1.0 - ROUNDING):
            return []
        return [(("pitch",), self.pitch, "must be above 0 for a full turn or more: it would close on itself")]

    @property
    def _rise(self) -> float:
        """Advance along the axis per angle [m/rad]."""
        return self.pitch / (2.0 * math.pi)

    @property
    def _slant(self) -> float:
        """Length per angle [m/rad]."""
        return math.hypot(self.radius, self._rise)

    @property
    def length(self) -> float:
        """Length of the helix [m]."""
        return self.angle * self._slant

    @property
    def turn(self) -> float:
        """Angle by which the tangent turns in all [rad]."""
        return self.angle * self.radius / self._slant

    def frames_at(self, normal: Array, arc: Array) -> Frames:
        """Return the frames at lengths `arc` [m] from the start.

        With e₁ the direction from the axis to the start, e₂ that in which φ = s/√(r² + c²) grows, ρ = cos φ e₁ +
        sin φ e₂, ρ′ = ∂ρ/∂φ and the axis on the side ±1 of the normal,

        x = C + r ρ + c φ axis,   t = (r ρ′ + c axis)/√(r² + c²),   n = ∓ ρ
        """
        axis, side, angle = np.array(self.axis), _side(self.toward), arc / self._slant
        e1 = -side * normal
        e2 = np.cross(axis, e1) if self.handedness == "right" else np.cross(e1, axis)
        outward = np.outer(np.cos(angle), e1) + np.outer(np.sin(angle), e2)
        around = np.outer(np.cos(angle), e2) - np.outer(np.sin(angle), e1)
        points = np.array(self.start) + self.radius * (outward - e1) + np.outer(self._rise * angle, axis)
        return points, (self.radius * around + self._rise * axis) / self._slant, -side * outward

    def curvatures_at(self, normal: Array, arc: Array, over: float) -> Array:
        """Return χ, ξ, τ [1/m] at lengths `arc` [m], shape (n, 3)."""
        twist = self._rise if self.handedness == "right" else -self._rise
        rates = np.array([_side(self.toward) * self.radius, 0.0, twist]) / self._slant**2
        return np.ones((len(arc), 1)) * rates

    def demand_of_normal(self, normal: Array) -> str:
        """Return the fault of the rod's normal at the start, in words; empty if it has none."""
        return _demand_perpendicular(normal, self.axis, "the axis of the helix")

    def describe(self) -> str:
        """Describe the shape in words."""
        size = f"radius {1e3 * self.radius:.4g} mm, pitch {1e3 * self.pitch:.4g} mm"
        return f"{self.handedness}-handed helix of {size}, {self.angle / (2.0 * math.pi):.4g} turns"
