"""Rods of a scene: paths, layers, patterns."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, field_serializer, model_validator

from bilayer_core.scene.eigenstrain import Eigenstrain
from bilayer_core.scene.faults import ROUNDING, Fault, Location, one_of, refuse_all, repeated
from bilayer_core.scene.imperfection import Imperfection
from bilayer_core.scene.part import Direction, Name, Part, Point
from bilayer_core.scene.pattern import Patterns, Placement, placed
from bilayer_core.scene.profile import Profile, extremes, varying
from bilayer_core.scene.units import (
    Curvature,
    NonNegativeLength,
    PositiveAngle,
    PositiveLength,
    PositiveNumber,
    Twist,
    whole,
)

Eigenstrains = Annotated[
    list[Eigenstrain],
    BeforeValidator(
        lambda laws: [] if laws is None else [laws] if isinstance(laws, dict) else laws,
        json_schema_input_type=Eigenstrain | list[Eigenstrain] | None,
    ),
]


class StraightPath(Part):
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
        """Angle between its tangents at the two ends [rad]."""
        return 0.0

    def curvature_at(self, arc: np.ndarray) -> np.ndarray:
        """Towards the normal [1/m] at lengths `arc` [m] from the start."""
        return np.zeros_like(arc)


class ArcPath(Part):
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

    @property
    def length(self) -> float:
        """Length of the arc [m]."""
        return self.radius * self.angle

    @property
    def turn(self) -> float:
        """Angle by which its tangent turns [rad]."""
        return self.angle

    @property
    def curvature(self) -> float:
        """Towards the normal [1/m]."""
        return (1.0 if self.toward == "normal" else -1.0) / self.radius

    def curvature_at(self, arc: np.ndarray) -> np.ndarray:
        """Towards the normal [1/m] at lengths `arc` [m] from the start."""
        return np.full_like(arc, self.curvature)


class SpiralPath(Part):
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

    @model_validator(mode="after")
    def _check(self) -> SpiralPath:
        refuse_all("SpiralPath", faults_of_spiral(self))
        return self

    @property
    def growth(self) -> float:
        """Change of the radius with the angle [m/rad]."""
        return (self.end_radius - self.start_radius) / self.angle

    def _length_to(self, angle: Any) -> Any:
        """∫ √(r² + a²) dφ from the start to an angle [rad], with the radius r = r₀ + a φ [m]."""

        def primitive(radius):
            slant = np.hypot(radius, self.growth)
            return 0.5 * (radius * slant / self.growth + self.growth * np.log((radius + slant) / abs(self.growth)))

        return primitive(self.start_radius + self.growth * angle) - primitive(self.start_radius)

    @property
    def length(self) -> float:
        """Length of the spiral [m]."""
        return float(self._length_to(self.angle))

    def angle_at(self, arc: np.ndarray) -> np.ndarray:
        """Angles about the centre [rad] at lengths `arc` [m] from the start: Newton's method on the length."""
        angle = self.angle * arc / self.length
        for _ in range(20):
            slope = np.hypot(self.start_radius + self.growth * angle, self.growth)
            angle = angle - (self._length_to(angle) - arc) / slope
        return angle

    @property
    def turn(self) -> float:
        """Angle by which its tangent turns [rad]."""
        slope = math.atan2(self.growth, self.start_radius) - math.atan2(self.growth, self.end_radius)
        return self.angle + slope

    def curvature_at(self, arc: np.ndarray) -> np.ndarray:
        """Towards the normal [1/m] at lengths `arc` [m] from the start: (r² + 2a²)/(r² + a²)^{3/2}, r = r₀ + a φ."""
        radius, growth = self.start_radius + self.growth * self.angle_at(arc), self.growth
        curvature = (radius**2 + 2.0 * growth**2) / (radius**2 + growth**2) ** 1.5
        return curvature if self.toward == "normal" else -curvature


class Layer(Part):
    """One layer of a rod. It covers the whole path, or the stations nearest to `interval`."""

    name: Name
    """Unique in its rod."""
    material: Name
    """One of `materials`."""
    thickness: varying(PositiveLength)
    """Through the bond."""
    interval: tuple[NonNegativeLength, PositiveLength] | None = None
    """From and to, as lengths along the path [m]."""
    eigenstrain: Eigenstrains = []
    """One law or several, which add up."""
    stiffness: varying(PositiveNumber) = 1.0
    """Multiple of the material's elastic moduli."""
    natural_curvature: varying(Curvature) | None = None
    """Of the layer by itself, through the thickness, positive where it bends to the normal; default: the path's."""
    natural_twist: varying(Twist) = 0.0
    """Of the layer by itself, about the path."""

    def driven_by(self, channels: dict[str, str], gain: float) -> Layer:
        """This layer with other channels in its laws, by those that it has, and its gains multiplied by a number."""
        laws = [
            law.model_copy(update={"stimulus": channels.get(law.stimulus, law.stimulus), "gain": gain * law.gain})
            for law in self.eigenstrain
        ]
        return self.model_copy(update={"eigenstrain": laws})

    @field_serializer("eigenstrain")
    def _as_written(self, laws: list[Eigenstrain]) -> Any:
        """A single law without its list, as scenes state it, so that overrides find its keys."""
        return laws if len(laws) > 1 else laws[0] if laws else None


class Rod(Part):
    """One or two layers along a path, or a pattern of several such rods."""

    name: Name
    """Unique among rods, bodies and obstacles."""
    width: varying(PositiveLength)
    """Of its rectangular section, across path and normal."""
    path: Annotated[StraightPath | ArcPath | SpiralPath, Field(discriminator="shape")]
    """Where the rod lies at the start, free of stress."""
    normal: Direction
    """Through the thickness, from the first layer (bottom) to the last (top); at the start of a curved path."""
    stations: whole(3)
    """Cross-sections along the path, both ends included."""
    layers: list[Layer] = Field(min_length=1, max_length=2)
    """Bottom first."""
    torsion: Literal["laminate", "layers"] = "laminate"
    """Torsional stiffness: of the bonded section, or the sum of the layers' own."""
    friction_axis: Literal["path", "normal", "across"] = "path"
    """Direction of the rod that counts as forward for friction: along its path, its normal, or path × normal."""
    imperfection: Imperfection | None = None
    """Small departure of the shape at rest from the path; none by default."""
    pattern: Patterns | None = None
    """Several rods from this one: round an axis, in a row, in a grid, mirrored or placed one by one."""
    clamp_start: Name | None = None
    """Body that holds the start, position and direction; free by default."""
    clamp_end: Name | None = None
    """Body that holds the end."""

    @property
    def edge_length(self) -> float:
        """Distance of two stations [m]."""
        return self.path.length / (self.stations - 1)

    @property
    def copy_names(self) -> list[str]:
        """Names of the rods that this one stands for: its own, or numbered ones if it has a pattern."""
        return [f"{self.name}_{index}" for index in range(self.pattern.copies)] if self.pattern else [self.name]

    @property
    def copies(self) -> list[RodCopy]:
        """The rods that this one stands for."""
        if self.pattern is None:
            return [RodCopy(self.name, self, placed())]
        places = zip(self.copy_names, self.pattern.places(), strict=True)
        return [RodCopy(name, self._copy(index), place) for index, (name, place) in enumerate(places)]

    def _copy(self, index: int) -> Rod:
        """This rod with what the pattern has for one copy, and without the pattern."""
        own: dict[str, Any] = {"pattern": None}
        for end in ("clamp_start", "clamp_end"):
            bodies = getattr(self.pattern, end)
            own |= {} if bodies is None else {end: bodies[index]}
        channels = {name: of_copies[index] for name, of_copies in self.pattern.stimuli.items()}
        gain = 1.0 if self.pattern.gains is None else self.pattern.gains[index]
        if channels or gain != 1.0:
            own["layers"] = [layer.driven_by(channels, gain) for layer in self.layers]
        return self.model_copy(update=own)

    @property
    def variants(self) -> list[Rod]:
        """The rods that this one stands for as far as their clamps and laws differ, wherever they are."""
        found: dict[Any, Rod] = {}
        for copy in self.copies:
            laws = tuple(tuple(layer.eigenstrain) for layer in copy.rod.layers)
            found.setdefault((copy.rod.clamp_start, copy.rod.clamp_end, laws), copy.rod)
        return list(found.values())

    def covered_stations(self, layer: Layer) -> tuple[int, int]:
        """First and last station of `layer`, those nearest to its interval."""
        if layer.interval is None:
            return 0, self.stations - 1
        first, last = (math.floor(length / self.edge_length + 0.5) for length in layer.interval)
        return first, last

    def driven_edges(self, layer: Layer, law: Eigenstrain) -> range:
        """Edges of the path that a law of `layer` drives: those of the layer whose middle lies in its interval, the end
        excluded, so that adjoining intervals share none.
        """
        first, last = self.covered_stations(layer)
        if law.interval is None:
            return range(first, last)
        begin, end = (math.ceil(length / self.edge_length - 0.5) for length in law.interval)
        return range(max(first, begin), min(last, end))

    @model_validator(mode="after")
    def _check(self) -> Rod:
        refuse_all("Rod", faults_of_rod(self))
        return self


@dataclass(frozen=True)
class RodCopy:
    """One of the rods that a rod of a scene stands for: its name, what it is made of, and where it is."""

    name: str
    rod: Rod
    place: Placement


LARGEST_IMPERFECTION = 0.1
"""Part of the length of the path: more is another path."""


def faults_of_spiral(path: SpiralPath) -> list[Fault]:
    """Radii that make it no spiral."""
    if math.isclose(path.start_radius, path.end_radius, rel_tol=ROUNDING):
        return [(("end_radius",), path.end_radius, "must differ from `start_radius`; with equal radii it is an `arc`")]
    return []


def faults_of_rod(rod: Rod) -> list[Fault]:
    """Its normal, and where its layers begin and end."""
    faults: list[Fault] = []
    cosine = sum(a * b for a, b in zip(rod.normal, rod.path.direction, strict=True))
    if abs(cosine) > ROUNDING:
        tilt = math.degrees(math.asin(min(abs(cosine), 1.0)))
        faults.append((("normal",), rod.normal, f"must be perpendicular to the path, is {tilt:.3g} deg off"))
    names = [(("layers", index, "name"), layer.name) for index, layer in enumerate(rod.layers)]
    faults += repeated(names, "layers of a rod")
    ordered = f"must be two increasing lengths [m] along the path, from 0 to {rod.path.length:g}"

    def is_ordered(interval: tuple[float, float]) -> bool:
        return interval[0] < interval[1] <= rod.path.length * (1.0 + ROUNDING)

    faults += _profiles(rod, (), ("width",), rod.path.length)
    faults += _faces_of_path(rod)
    if rod.imperfection is not None:
        curvature = abs(rod.path.curvature_at(np.array([0.0, rod.path.length]))).max()
        largest = min(LARGEST_IMPERFECTION * rod.path.length, 0.5 / curvature if curvature else math.inf)
        if rod.imperfection.size > largest:
            demand = f"must be at most {largest:g} m: a tenth of the path's length, and half its radius"
            faults.append((("imperfection", "size"), rod.imperfection.size, demand))
    for index, layer in enumerate(rod.layers):
        varying = ("thickness", "stiffness", "natural_curvature", "natural_twist")
        faults += _profiles(layer, ("layers", index), varying, rod.path.length)
        for number, law in enumerate(layer.eigenstrain):
            where: Location = ("layers", index, "eigenstrain", number, "interval")
            if law.interval is not None and not is_ordered(law.interval):
                faults.append((where, law.interval, ordered))
            elif not rod.driven_edges(layer, law):
                demand = f"must hold the middle of an edge of the layer; an edge is {rod.edge_length:g} m long"
                faults.append((where, law.interval, demand))
        if layer.interval is None:
            continue
        first, last = rod.covered_stations(layer)
        if not is_ordered(layer.interval):
            faults.append((("layers", index, "interval"), layer.interval, ordered))
        elif last - first < 2:
            demand = f"must span two edges or more; an edge is {rod.edge_length:g} m long"
            faults.append((("layers", index, "interval"), layer.interval, demand))
    if not faults and not any(rod.covered_stations(layer) == (0, rod.stations - 1) for layer in rod.layers):
        demand = (
            "one layer must cover the whole path; layers that each cover a part of it are two rods, joined by a body"
        )
        faults.append((("layers",), [layer.interval for layer in rod.layers], demand))
    faults += _faults_of_copies(rod) if rod.pattern is not None else ()
    return faults


def _faults_of_copies(rod: Rod) -> Iterator[Fault]:
    """What a pattern says of laws and clamps that the rod does not have, or has itself, and copies at one place."""
    laws = [law for layer in rod.layers for law in layer.eigenstrain]
    channels = dict.fromkeys(law.stimulus for law in laws)
    for name in rod.pattern.stimuli:
        if name not in channels:
            yield ("pattern", "stimuli", name), name, one_of("channels in the rod's eigenstrain laws", name, channels)
    if rod.pattern.gains is not None and not laws:
        yield ("pattern", "gains"), rod.pattern.gains, "must be left out: no layer has an eigenstrain"
    for end in ("clamp_start", "clamp_end"):
        if getattr(rod, end) is not None and getattr(rod.pattern, end) is not None:
            yield (end,), getattr(rod, end), f"must be left out where `pattern.{end}` has the body of each copy"
    straight = rod.path.shape == "straight"
    start, direction, normal = (np.array(v) for v in (rod.path.start, rod.path.direction, rod.normal))
    frames = []  # the two ends of a straight copy; the start of any other with what it and its normal lead to
    for place in rod.pattern.places():
        begin, end = place.points(np.stack([start, start + rod.path.length * direction]))
        frames.append([begin, end] if straight else [begin, end, begin + rod.path.length * place.directions(normal)])
    for second in range(1, len(frames)):
        ways = [frames[second], frames[second][::-1]] if straight else [frames[second]]
        apart = np.min([np.abs(np.array(frames[:second]) - way).max(axis=(1, 2)) for way in ways], axis=0)
        if apart.min() <= ROUNDING * rod.path.length:
            first = rod.copy_names[int(apart.argmin())]
            demand = f"must leave no copy where another is: {rod.copy_names[second]} lies on {first}"
            yield ("pattern",), rod.pattern.type, demand
            return


def _faces_of_path(rod: Rod) -> Iterator[Fault]:
    """Whether the face on the inner side of a curved path has a length: the path's radius exceeds its distance."""
    if rod.path.shape == "straight":
        return
    toward = rod.path.toward == "normal"
    inner = rod.layers[-1 if toward else 0]
    distance = extremes(inner.thickness)[1] * (0.5 if len(rod.layers) == 1 else 1.0)
    ends = abs(rod.path.curvature_at(np.array([0.0, rod.path.length])))  # that of a spiral falls with its radius
    radius = 1.0 / float(ends.max())
    if radius > distance:
        return
    key = "radius" if rod.path.shape == "arc" else ("start_radius", "end_radius")[int(ends.argmax())]
    demand = (
        f"must be larger: the path has a radius of {radius:g} m, and the inner face of layer {inner.name}, "
        f"{distance:g} m from it, would have no length"
    )
    yield ("path", key), getattr(rod.path, key), demand


def _profiles(part: Rod | Layer, where: Location, keys: tuple[str, ...], length: float) -> Iterator[Fault]:
    """Whether profiles along a path of given length [m] stay on it."""
    for key in keys:
        profile = getattr(part, key)
        for index, place in enumerate(profile.at if isinstance(profile, Profile) else ()):
            if place > length * (1.0 + ROUNDING):
                yield (*where, key, "at", index), place, f"must be a length [m] along the path, from 0 to {length:g}"
