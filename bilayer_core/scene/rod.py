"""Rods of a scene: paths, layers, patterns."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, SerializerFunctionWrapHandler, field_serializer, model_serializer

from bilayer_core.scene.diffusion import Diffusion
from bilayer_core.scene.eigenstrain import Eigenstrain, Following, StiffnessChange
from bilayer_core.scene.faults import ROUNDING, Fault, Location
from bilayer_core.scene.friction import Coefficients
from bilayer_core.scene.imperfection import Imperfection
from bilayer_core.scene.limits import MOST_NODES
from bilayer_core.scene.part import AngularVelocity, Direction, Name, Part, Velocity
from bilayer_core.scene.paths import ArcPath, Frames, HelixPath, SpiralPath, StraightPath
from bilayer_core.scene.pattern import Patterns, Placement, placed
from bilayer_core.scene.point_paths import PolylinePath, SplinePath
from bilayer_core.scene.profile import Profile, extremes, scaled, varying
from bilayer_core.scene.rod_faults import faults_of_rod
from bilayer_core.scene.units import (
    Angle,
    Curvature,
    NonNegativeLength,
    Number,
    PositiveLength,
    PositiveNumber,
    Twist,
    whole,
)

Eigenstrains = Annotated[
    list[Eigenstrain],
    BeforeValidator(
        lambda laws: [] if laws is None else [laws] if isinstance(laws, dict | Part) else laws,
        json_schema_input_type=Eigenstrain | list[Eigenstrain] | None,
    ),
]
Diffusions = Annotated[
    list[Diffusion],
    BeforeValidator(
        lambda fields: [] if fields is None else [fields] if isinstance(fields, dict | Part) else fields,
        json_schema_input_type=Diffusion | list[Diffusion] | None,
    ),
]


class FibreDirection(Part):
    """A layer with fibres in one direction of its plane."""

    swelling: Number = 1.0
    """Multiple of the layer's eigenstrain."""
    stiffness: PositiveNumber = 1.0
    """Multiple of Young's modulus of the layer."""


class Fibres(Part):
    """Aligned fibres in a layer: it swells and is stiff along them as not across them."""

    angle: Angle
    """From the path to the fibres, counter-clockwise as seen from where the rod's normal points. The mirror images of a
    pattern have the opposite one.
    """
    along: FibreDirection = FibreDirection()
    """Along the fibres."""
    across: FibreDirection = FibreDirection()
    """Across them, in the plane of the layer."""
    shear: PositiveNumber = 1.0
    """Multiple of the layer's shear modulus, for shear between the two directions. The material's `poisson_ratio` is
    that of a pull along the fibres.
    """


class Layer(Part):
    """One layer of a rod. It covers the whole path, or `interval`; two rods have it from station to station."""

    name: Name
    """Unique in its rod."""
    material: Name
    """One of `materials`."""
    thickness: varying(PositiveLength) | None = None
    """Through the bond. Must be given, but for a round rod (`radius`)."""
    width: varying(PositiveLength) | None = None
    """Of this layer, in the middle of the rod's; that of the rod by default."""
    interval: tuple[NonNegativeLength, PositiveLength] | None = None
    """From and to, as lengths along the path [m]."""
    eigenstrain: Eigenstrains = []
    """One law or several, which add up."""
    stiffness: varying(PositiveNumber) = 1.0
    """Multiple of the material's elastic moduli."""
    stiffness_change: StiffnessChange | None = None
    """With a stimulus, as of a shape-memory alloy or a gel; none by default."""
    natural_curvature: varying(Curvature) | None = None
    """Of the layer by itself, through the thickness, positive where it bends to the normal; default: the path's."""
    natural_curvature_across: varying(Curvature) | None = None
    """Of the layer by itself, across the width, positive where it bends to path × normal; default: the path's."""
    swelling: Literal["isotropic", "along", "across"] = "isotropic"
    """Direction in the layer's plane in which its eigenstrain acts: all, or one along or across the path, as that of
    aligned fibres. A rod with `section: strip` curls across as well.
    """
    fibres: Fibres | None = None
    """Fibres at an angle to the path, in a rod with `section: strip`: what swells then bends and twists it."""
    natural_twist: varying(Twist) = 0.0
    """Of the layer by itself, about the path, beside the twist of the path; that of all layers of a strip."""

    def driven_by(self, channels: dict[str, str], gain: float) -> Layer:
        """Return this layer with other channels in its laws and with its gains multiplied by `gain`.

        `channels` maps the present channels to the new ones.
        """
        laws = [
            law.model_copy(
                update={"stimulus": channels.get(law.stimulus, law.stimulus), "gain": scaled(law.gain, gain)}
            )
            for law in self.eigenstrain
        ]
        change = self.stiffness_change
        if change is not None:
            change = change.model_copy(update={"stimulus": channels.get(change.stimulus, change.stimulus)})
        return self.model_copy(update={"eigenstrain": laws, "stiffness_change": change})

    @property
    def multiples(self) -> tuple[float, ...]:
        """Multiples of its eigenstrain along and across its fibres, or in all directions."""
        return (1.0,) if self.fibres is None else (self.fibres.along.swelling, self.fibres.across.swelling)

    @property
    def laws(self) -> dict[Location, Following]:
        """All that follows a stimulus, by its place in the layer."""
        laws: dict[Location, Following] = {("eigenstrain", k): law for k, law in enumerate(self.eigenstrain)}
        return laws if self.stiffness_change is None else laws | {("stiffness_change",): self.stiffness_change}

    @field_serializer("eigenstrain")
    def _as_written(self, laws: list[Eigenstrain]) -> Any:
        """Return a single law without its list, as scenes state it, so that overrides find its keys."""
        return laws if len(laws) > 1 else laws[0] if laws else None


class Rod(Part):
    """One or two layers along a path, or a pattern of several such rods."""

    name: Name
    """Unique among rods, bodies and obstacles."""
    width: varying(PositiveLength) | None = None
    """Of its rectangular section, across path and normal. Must be given, but for a round rod, and where each layer has
    one.
    """
    radius: varying(PositiveLength) | None = None
    """Of a round rod of one layer, in place of width and thickness."""
    inner_radius: varying(NonNegativeLength) = 0.0
    """Of the hole in a round rod."""
    path: Annotated[
        StraightPath | ArcPath | SpiralPath | HelixPath | PolylinePath | SplinePath, Field(discriminator="shape")
    ]
    """Where the rod lies at the start, free of stress."""
    normal: Direction
    """Through the thickness, from the first layer (bottom) to the last (top); at the start of a curved path. Of a
    path through points only its part across the path counts.
    """
    stations: Annotated[int, *whole(3, MOST_NODES)]
    """Cross-sections along the path, both ends included; the last one of a closed path is the first again."""
    layers: list[Layer] = Field(min_length=1, max_length=2)
    """Bottom first."""
    diffusion: Diffusions = []
    """Of moisture or heat through the layers; one field or several. Layers without one follow with their lags."""
    section: Literal["auto", "beam", "strip"] = "auto"
    """`beam`: the section keeps its shape, right for w²κ/H below about 1; `strip`: it curls across the width, of any
    width; `auto`: `strip` with fibres and what swells across, and where curvature or stiffness would differ by more
    than 1 %, if a strip can be computed.
    """
    torsion: Literal["laminate", "layers"] = "laminate"
    """Torsional stiffness: of the bonded section, or the sum of the layers' own."""
    friction_axis: Literal["path", "normal", "across"] = "path"
    """Direction of the rod that counts as forward for friction: along its path, its normal, or path × normal."""
    friction: Coefficients | None = None
    """Of its own; by default it takes those of what touches it, or of `contact.friction`."""
    imperfection: Imperfection | None = None
    """Small departure of the shape at rest from the path; none by default."""
    pattern: Patterns | None = None
    """Several rods from this one: round an axis, in a row, in a grid, mirrored or placed one by one."""
    clamp_start: Name | None = None
    """Body that holds the start, position and direction; free by default."""
    clamp_end: Name | None = None
    """Body that holds the end."""
    velocity: Velocity | None = None
    """At the start, of a rod that nothing holds; others move as what holds them, or as the scene says."""
    angular_velocity: AngularVelocity | None = None
    """Likewise, about the rod's mass centre."""

    def width_of(self, layer: Layer) -> float | Profile:
        """Return the width of a layer [m]."""
        return self.width if layer.width is None else layer.width

    @property
    def widest(self) -> float:
        """Largest width of its layers [m]."""
        return max(extremes(self.width_of(layer))[1] for layer in self.layers)

    @property
    def feels_across(self) -> bool:
        """True if layers have fibres or swell across the path, which a beam does not feel."""
        return any(layer.fibres is not None or layer.swelling == "across" for layer in self.layers)

    @property
    def edge_length(self) -> float:
        """Distance of two stations [m]."""
        return self.path.length / (self.stations - 1)

    @property
    def closed(self) -> bool:
        """True if the rod has no ends."""
        return self.path.is_closed

    def on_path(self, stations: np.ndarray) -> np.ndarray:
        """Return the stations, whole or not; on a closed path those beyond the last one as they are on the
        first round.
        """
        last = self.stations - 1
        return np.where(stations > last, stations - last, stations) if self.closed else stations

    def frames_at(self, arc: np.ndarray) -> Frames:
        """Return the points [m], tangents and normals of the path at lengths `arc` [m] along it, shapes (n, 3)."""
        return self.path.frames_at(np.array(self.normal), arc)

    def curvatures_at(self, arc: np.ndarray) -> np.ndarray:
        """Return the curvature towards the normal and across, and twist of the path [1/m] there, shape (n, 3)."""
        return self.path.curvatures_at(np.array(self.normal), arc, self.edge_length)

    @property
    def copy_names(self) -> list[str]:
        """Names of the rods that this one stands for: its own, or numbered ones if it has a pattern."""
        return [f"{self.name}_{index}" for index in range(self.pattern.copies)] if self.pattern else [self.name]

    @property
    def copies(self) -> tuple[RodCopy, ...]:
        """The rods that this one stands for; those that differ in nothing but their places are one object."""
        return self.keep("copies", (), self._copies)

    def _copies(self) -> tuple[RodCopy, ...]:
        if self.pattern is None:
            return (RodCopy(self.name, self, placed()),)
        places = zip(self.copy_names, self.pattern.places(), strict=True)
        return tuple(RodCopy(name, self._copy(index), place) for index, (name, place) in enumerate(places))

    def _copy(self, index: int) -> Rod:
        """Return this rod with the pattern's values for one copy, and without the pattern."""
        own: dict[str, Any] = {"pattern": None}
        for end in ("clamp_start", "clamp_end"):
            bodies = getattr(self.pattern, end)
            own |= {} if bodies is None else {end: bodies[index]}
        channels = {name: of_copies[index] for name, of_copies in self.pattern.stimuli.items()}
        gain = 1.0 if self.pattern.gains is None else self.pattern.gains[index]

        def made() -> Rod:
            if channels or gain != 1.0:
                own["layers"] = [layer.driven_by(channels, gain) for layer in self.layers]
                own["diffusion"] = [
                    field.model_copy(update={"stimulus": channels.get(field.stimulus, field.stimulus)})
                    for field in self.diffusion
                ]
            return self.model_copy(update=own)

        alike = own.get("clamp_start"), own.get("clamp_end"), tuple(channels.values()), gain
        return self.keep(("copy", *alike), (), made)

    @property
    def variants(self) -> tuple[Rod, ...]:
        """The rods that this one stands for as far as their clamps and laws differ, wherever they are."""
        return self.keep("variants", (), self._variants)

    def _variants(self) -> tuple[Rod, ...]:
        found: dict[Any, Rod] = {}
        for rod in {id(copy.rod): copy.rod for copy in self.copies}.values():
            laws = tuple(tuple(layer.laws.values()) for layer in rod.layers)
            found.setdefault((rod.clamp_start, rod.clamp_end, laws), rod)
        return tuple(found.values())

    def diffusion_of(self, layer: Layer, law: Following) -> Diffusion | None:
        """Return the field that a law of a layer follows; None if it follows its stimulus with a lag."""
        fields = (f for f in self.diffusion if f.stimulus == law.stimulus and layer.name in f.diffusivity)
        return next(fields, None)

    @field_serializer("diffusion")
    def _fields_as_written(self, fields: list[Diffusion]) -> Any:
        """Return a single field without its list, as scenes state it."""
        return fields if len(fields) > 1 else fields[0] if fields else None

    def covered_stations(self, layer: Layer) -> tuple[int, int]:
        """Return the first and last station of `layer`, those nearest to its interval."""
        if layer.interval is None:
            return 0, self.stations - 1
        first, last = (math.floor(length / self.edge_length + 0.5) for length in layer.interval)
        return first, last

    def span_of(self, layer: Layer, law: Eigenstrain | None = None) -> tuple[float, float]:
        """Return where `layer`, or a law of it, begins and ends, in stations, of which it may end between two."""
        first, last = 0.0, float(self.stations - 1)
        for interval in (layer.interval, None if law is None else law.interval):
            if interval is not None:
                begin, end = (_near_whole(length / self.edge_length) for length in interval)
                first, last = max(first, begin), min(last, end)
        return first, last

    def covered_parts(self, edges: np.ndarray, layer: Layer, law: Eigenstrain | None = None) -> np.ndarray:
        """Return the part of each edge of the path that `layer` covers, or that a law of it drives, 0 … 1, shape
        (n_edge,).
        """
        first, last = self.span_of(layer, law)
        return np.clip(np.minimum(edges + 1.0, last) - np.maximum(edges, first), 0.0, 1.0)

    def driven_edges(self, layer: Layer, law: Eigenstrain) -> range:
        """Return the edges of the path that a law of `layer` drives, all or in part."""
        first, last = self.span_of(layer, law)
        return range(math.floor(first), math.ceil(last)) if first < last else range(0)

    @model_serializer(mode="wrap")
    def _as_written(self, write: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Return a round rod without the width and thickness that its radius gives it, so that overrides may change
        that.
        """
        content = write(self)
        if self.radius is not None:
            content["width"] = content["layers"][0]["thickness"] = None
        return content

    def _faults(self) -> list[Fault]:
        return faults_of_rod(self)


def _near_whole(station: float) -> float:
    """Return a station, or the whole number from which rounding keeps it."""
    return float(round(station)) if abs(station - round(station)) <= ROUNDING * max(1.0, abs(station)) else station


@dataclass(frozen=True)
class RodCopy:
    """One of the rods that a rod of a scene stands for: its name, what it is made of, and where it is."""

    name: str
    rod: Rod
    place: Placement
