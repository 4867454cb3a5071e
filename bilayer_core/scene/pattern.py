"""Patterns: several rods from one, each with a placement and with what it has of its own."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field

from bilayer_core.kinematics.rotation import rotation_matrix
from bilayer_core.scene.faults import Fault, Location, refuse
from bilayer_core.scene.limits import MOST_COPIES
from bilayer_core.scene.part import Direction, Name, Part, Point
from bilayer_core.scene.units import Angle, Number, whole

Array = np.ndarray
EXACT = 1e-15
"""Entries of a rotation below it are zero, so that quarter turns are exact."""


@dataclass(frozen=True)
class Placement:
    """An isometry of space, x ↦ Q (x − c) + c + s with Q orthogonal: where a copy of a rod is.

    Of several copies at once (`stacked`), arrays have one index more, the first.

    A reflection, det Q = −1, takes points, tangents and normals as the vectors they are; then m1 = Q m1 and, as
    m2 = t × m1, m2 = −Q m2. What is measured along m1 keeps its sign: curvature about m2, natural curvature, the order
    of layers, friction along path and normal. What is measured along m2 or about t is a pseudoscalar and changes it:
    twist, natural twist, and the direction that `friction_axis: across` calls forward (`handedness`).
    """

    matrix: Array  # Q, shape (3, 3)
    center: Array  # c [m], shape (3,)
    shift: Array  # s [m], shape (3,)

    @property
    def handedness(self) -> Array:
        """1, or −1 for a mirror image, shape ()."""
        return np.sign(np.linalg.det(self.matrix))

    def directions(self, vectors: Array) -> Array:
        """Return the directions of the rod as those of the copy, shape (..., 3)."""
        return vectors @ self.matrix.swapaxes(-1, -2)

    def points(self, points: Array) -> Array:
        """Return the points of the rod as those of the copy [m], shape (..., 3)."""
        return (points - self.center) @ self.matrix.swapaxes(-1, -2) + self.center + self.shift


def placed(matrix: Any = None, center: Any = (0.0, 0.0, 0.0), shift: Any = (0.0, 0.0, 0.0)) -> Placement:
    """Return a placement; parts that are not given are those of the rod itself."""
    return Placement(np.eye(3) if matrix is None else matrix, np.array(center, float), np.array(shift, float))


def stacked(places: Iterable[Placement]) -> Placement:
    """Return several placements as one, of which points and directions have a copy more in front: shape (n_place, n,
    3).
    """
    matrices, centers, shifts = zip(*((of.matrix, of.center, of.shift) for of in places), strict=True)
    return Placement(np.array(matrices), np.array(centers)[:, None], np.array(shifts)[:, None])


def _turned(vector: Array) -> Array:
    """Return the rotation matrix of a rotation vector [rad], shape (3, 3)."""
    rotation = rotation_matrix(vector)
    rotation[np.abs(rotation) < EXACT] = 0.0
    return rotation


def _not_zero(vector: tuple[float, float, float]) -> tuple[float, float, float]:
    if not any(vector):
        raise refuse("must not be zero: all copies would lie on each other")
    return vector


Step = Annotated[Point, AfterValidator(_not_zero)]


class Pattern(Part):
    """Properties that each copy of a rod may have of its own, one entry for each copy."""

    stimuli: dict[Name, list[Name]] = {}
    """By the name of a channel in the rod's eigenstrain laws: the channel that drives each copy instead. For a
    delay, give a copy a channel whose schedule has it."""
    gains: list[Number] | None = None
    """By which the gains of each copy's eigenstrain laws are multiplied; all 1 by default."""
    clamp_start: list[Name | None] | None = None
    """Body that holds the start of each copy, null for a free one; by default the rod's `clamp_start` holds all."""
    clamp_end: list[Name | None] | None = None
    """Body that holds the end of each copy, likewise."""

    @property
    def copies(self) -> int:
        """Rods in all."""
        return self.count

    def places(self) -> tuple[Placement, ...]:
        """Return the placement of each copy."""
        return self.keep("places", (), lambda: tuple(self._places()))

    @abstractmethod
    def _places(self) -> Iterable[Placement]:
        """Return the placement of each copy, computed anew."""

    def per_copy(self) -> Iterator[tuple[Location, list]]:
        """Yield the lists that have an entry for each copy, with their keys."""
        yield from ((("stimuli", name), channels) for name, channels in self.stimuli.items())
        for key in ("gains", "clamp_start", "clamp_end"):
            if getattr(self, key) is not None:
                yield (key,), getattr(self, key)

    def _faults(self) -> Iterator[Fault]:
        faults = list(self._faults_of_places())
        yield from faults
        for where, entries in () if faults else self.per_copy():
            if len(entries) != self.copies:
                demand = f"must have an entry for each of the {self.copies} copies"
                yield where, f"{len(entries)} entries", demand

    def _faults_of_places(self) -> Iterator[Fault]:
        return iter(())


class Rotation(Pattern):
    """Copies turned about an axis; the first is the rod itself. The default where `type` is left out."""

    type: Literal["rotation"] = "rotation"
    axis: Direction = (0.0, 0.0, 1.0)
    """About which copies are turned."""
    center: Point = (0.0, 0.0, 0.0)
    """A point of the axis."""
    count: Annotated[int, *whole(1, MOST_COPIES)]
    """Rods in all; they are called `NAME_0`, `NAME_1` and so on."""
    angle: Angle | None = None
    """Between a copy and the next; by default they are even over a full turn."""

    def _places(self) -> list[Placement]:
        step = 2.0 * np.pi if self.angle is None else self.angle
        parts = self.count if self.angle is None else 1
        axis = np.array(self.axis)
        return [placed(_turned(step * copy / parts * axis), self.center) for copy in range(self.count)]

    def _faults_of_places(self) -> Iterator[Fault]:
        if self.angle == 0.0:
            yield ("angle",), self.angle, "must not be zero: all copies would lie on each other"


class Translation(Pattern):
    """Copies in a row; the first is the rod itself."""

    type: Literal["translation"]
    step: Step
    """From a copy to the next."""
    count: Annotated[int, *whole(1, MOST_COPIES)]
    """Rods in all; they are called `NAME_0`, `NAME_1` and so on."""

    def _places(self) -> list[Placement]:
        return [placed(shift=copy * np.array(self.step)) for copy in range(self.count)]


class Grid(Pattern):
    """Copies in rows and columns, and in layers of these with three steps; the first is the rod itself."""

    type: Literal["grid"]
    steps: list[Step] = Field(min_length=2, max_length=3)
    """From a copy to the next in its row, from a row to the next, and from a layer to the next."""
    counts: list[Annotated[int, *whole(1, MOST_COPIES)]] = Field(min_length=2, max_length=3)
    """Along each step. Copies are called `NAME_0`, `NAME_1` and so on along the first row, then along the next."""

    @property
    def copies(self) -> int:
        """Rods in all."""
        return math.prod(self.counts)

    def _places(self) -> list[Placement]:
        """Return the placement of each copy, the first step running fastest."""
        steps = np.array(self.steps)
        places = product(*(range(count) for count in reversed(self.counts)))
        return [placed(shift=np.array(place[::-1], float) @ steps) for place in places]

    def _faults_of_places(self) -> Iterator[Fault]:
        if len(self.counts) != len(self.steps):
            yield ("counts",), f"{len(self.counts)} entries", f"must be as many as `steps`, {len(self.steps)}"
        elif self.copies > MOST_COPIES:
            yield ("counts",), self.counts, f"must make at most {MOST_COPIES} copies, not {self.copies}"


class Mirror(Pattern):
    """The rod, `NAME_0`, and its mirror image, `NAME_1`.

    Path and normal are mirrored as vectors, and layers keep their order along the normal. Twist, natural twist and the
    forward direction of `friction_axis: across` change their sign with respect to path × normal. A load in axes of the
    material is not mirrored: its third component is along the image's own path × normal.
    """

    type: Literal["mirror"]
    axis: Direction
    """Normal of the mirror."""
    center: Point = (0.0, 0.0, 0.0)
    """A point of the mirror."""

    @property
    def copies(self) -> int:
        """The rod and its image."""
        return 2

    def _places(self) -> list[Placement]:
        return [placed(), placed(np.eye(3) - 2.0 * np.outer(self.axis, self.axis), self.center)]


class Placed(Part):
    """Where a copy is: turned about a point, then shifted."""

    rotation: tuple[Angle, Angle, Angle] = (0.0, 0.0, 0.0)
    """Rotation vector."""
    center: Point = (0.0, 0.0, 0.0)
    """The point that the rotation leaves where it is."""
    position: Point = (0.0, 0.0, 0.0)
    """Shift."""


class Listed(Pattern):
    """Copies at given places. The rod itself is among them only if one of these is `{}`."""

    type: Literal["list"]
    placements: list[Placed] = Field(min_length=1)
    """Of each copy; they are called `NAME_0`, `NAME_1` and so on."""

    @property
    def copies(self) -> int:
        """Number of placements: rods in all."""
        return len(self.placements)

    def _places(self) -> list[Placement]:
        return [placed(_turned(np.array(of.rotation)), of.center, of.position) for of in self.placements]


def _with_type(value: Any) -> Any:
    """Return a pattern with its type; without one it is a rotation."""
    return {"type": "rotation", **value} if isinstance(value, dict) and "type" not in value else value


Patterns = Annotated[
    Rotation | Translation | Grid | Mirror | Listed, Field(discriminator="type"), BeforeValidator(_with_type)
]


NO_AXIS = np.array([0.2971, 0.3793, 0.3236])
"""A direction that patterns do not have. Its parts sum to 1: points that differ by less than a tolerance in each
coordinate do so along it."""


def pair_at_one_place(copies: Array, tolerance: float) -> tuple[int, int] | None:
    """Return two copies that lie on each other, or None if there are none.

    Those whose points agree, in either direction, agree in their middle. Where copies are in the order of their middles
    along a direction, only a few others can be between them: what is compared grows as their number, not its square.

    Parameters
    ----------
    copies : ndarray, shape (n_copy, n_point, 3)
        Points [m] at equal distances along each; an odd number.
    tolerance : float
        By which coordinates may differ [m].
    """
    along = copies[:, copies.shape[1] // 2] @ NO_AXIS
    order = np.argsort(along, kind="stable")
    reach = tolerance + EXACT * np.abs(along).max(initial=0.0)
    for places in range(1, len(copies)):
        near = np.flatnonzero(along[order[places:]] - along[order[:-places]] <= reach)
        if not len(near):
            return None
        one, other = copies[order[near]], copies[order[near + places]]
        apart = np.min([np.abs(one - way).max(axis=(1, 2)) for way in (other, other[:, ::-1])], axis=0)
        found = near[apart <= tolerance]
        if len(found):
            pairs = np.sort(np.column_stack([order[found], order[found + places]]), axis=1)
            first, second = pairs[np.lexsort(pairs.T)[0]]
            return int(first), int(second)
    return None
