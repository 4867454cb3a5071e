"""Rods of a scene: paths, layers, patterns."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, SerializerFunctionWrapHandler, field_serializer, model_serializer

from bilayer_core.scene.close_paths import crossings
from bilayer_core.scene.diffusion import Diffusion
from bilayer_core.scene.eigenstrain import Eigenstrain, Following, StiffnessChange
from bilayer_core.scene.faults import ROUNDING, Fault, Location, one_of, repeated
from bilayer_core.scene.friction import Coefficients
from bilayer_core.scene.imperfection import Imperfection
from bilayer_core.scene.limits import MOST_NODES
from bilayer_core.scene.part import AngularVelocity, Direction, Name, Part, Velocity
from bilayer_core.scene.paths import ArcPath, Frames, HelixPath, SpiralPath, StraightPath
from bilayer_core.scene.pattern import Patterns, Placement, pair_at_one_place, placed, stacked
from bilayer_core.scene.point_paths import PolylinePath, SplinePath
from bilayer_core.scene.profile import Profile, extremes, scaled, values_at, varying
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

    angle: varying(Angle)
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


LARGEST_IMPERFECTION = 0.1
"""Part of the length of the path: more is another path."""


def faults_of_rod(rod: Rod) -> list[Fault]:
    """Return the faults of a rod's sections and normal, and of where its layers begin and end."""
    if faults := list(_sections(rod)):
        return faults
    demand = rod.path.demand_of_normal(np.array(rod.normal))
    faults: list[Fault] = [(("normal",), rod.normal, demand)] if demand else []
    faults += _faults_of_closed(rod) if rod.closed else ()
    names = [(("layers", index, "name"), layer.name) for index, layer in enumerate(rod.layers)]
    faults += repeated(names, "layers of a rod")
    ordered = f"must be two increasing lengths [m] along the path, from 0 to {rod.path.length:g}"

    def is_ordered(interval: tuple[float, float]) -> bool:
        return interval[0] < interval[1] <= rod.path.length * (1.0 + ROUNDING)

    faults += _profiles(rod, (), ("width",), rod.path.length)
    faults += _far_away(rod)
    sharp_bends = list(_sharp_bends(rod))
    faults += sharp_bends
    if not (demand or sharp_bends):
        faults += crossings(rod)
    if rod.imperfection is not None:
        curvature = np.hypot(*rod.curvatures_at(rod.path.sharpest)[:, :2].T).max(initial=0.0)
        largest = min(LARGEST_IMPERFECTION * rod.path.length, 0.5 / curvature if curvature else math.inf)
        if rod.imperfection.size > largest:
            demand = f"must be at most {largest:g} m: a tenth of the path's length, and half its radius"
            faults.append((("imperfection", "size"), rod.imperfection.size, demand))
    for index, layer in enumerate(rod.layers):
        faults += _bent_across(rod, index)
        faults += _profiles(layer, ("layers", index), VARYING, rod.path.length)
        if layer.fibres is not None:
            faults += _profiles(layer.fibres, ("layers", index, "fibres"), ("angle",), rod.path.length)
        for number, law in enumerate(layer.eigenstrain):
            where: Location = ("layers", index, "eigenstrain", number, "interval")
            faults += _profiles(law, where[:-1], ("gain",), rod.path.length)
            if law.interval is not None and not is_ordered(law.interval):
                faults.append((where, law.interval, ordered))
            elif not rod.driven_edges(layer, law):
                demand = "must hold a part of the layer"
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
    faults += _faults_of_diffusion(rod)
    faults += _faults_of_section(rod)
    faults += _faults_of_copies(rod) if rod.pattern is not None else ()
    for key in ("velocity", "angular_velocity"):
        if getattr(rod, key) is not None and any(variant.clamp_start or variant.clamp_end for variant in rod.variants):
            demand = "must be left out: a rod moves as the body that holds it, which may have it"
            faults.append(((key,), getattr(rod, key), demand))
    return faults


def _sections(rod: Rod) -> Iterator[Fault]:
    """Yield the faults of what a rod's sections are given by; the width and thickness of a round one are written."""
    layers = [((), rod, "width"), *((("layers", k), layer, "thickness") for k, layer in enumerate(rod.layers))]
    own = [(("layers", k, "width"), layer.width) for k, layer in enumerate(rod.layers) if layer.width is not None]
    if rod.radius is None:
        if len(own) == len(rod.layers):
            if rod.width is not None:
                yield ("width",), rod.width, "must be left out: each layer has a `width` of its own"
            del layers[0]
        for where, part, key in layers:
            if getattr(part, key) is None:
                yield (*where, key), None, "must be given (a length [m], such as 2 mm), but for a round rod (`radius`)"
        if rod.inner_radius != 0.0:
            yield ("inner_radius",), rod.inner_radius, "must be left out: the hole of a round rod, which has a `radius`"
        return
    if len(rod.layers) == 2:
        yield ("radius",), rod.radius, "must be left out: a rod of two layers has rectangular sections"
        return
    for where, width in own:
        yield where, width, "must be left out: the rod has a `radius`"
    diameter = scaled(rod.radius, 2.0)
    for where, part, key in layers:
        if getattr(part, key) not in (None, diameter):
            yield (*where, key), getattr(part, key), "must be left out: the rod has a `radius`"
    faults = [*_profiles(rod, (), ("radius", "inner_radius"), rod.path.length)]
    if not faults:
        ends = [end for end in (rod.radius, rod.inner_radius) if isinstance(end, Profile)]
        along = np.array([0.0, *(place for profile in ends for place in profile.at)])
        outer, inner = values_at(rod.radius, along), values_at(rod.inner_radius, along)
        if (inner >= outer).any():
            worst = int((inner - outer).argmax())
            demand = f"must be below `radius`, {outer[worst]:g} m there: the wall would have no thickness"
            faults.append((("inner_radius",), float(inner[worst]), demand))
    yield from faults
    vars(rod).update(width=diameter, layers=[rod.layers[0].model_copy(update={"thickness": diameter})])


LAGS = ("time_constant", "time_constant_rising", "time_constant_falling", "saturation")
"""Keys of a law that a diffusion replaces, or that need the whole profile of the field."""


def _faults_of_diffusion(rod: Rod) -> Iterator[Fault]:
    """Yield the faults of fields that do not fit the layers of a rod."""
    layers = {layer.name: layer for layer in rod.layers}
    yield from repeated([(("diffusion", i, "stimulus"), f.stimulus) for i, f in enumerate(rod.diffusion)], "diffusion")
    for index, field in enumerate(rod.diffusion):
        where: Location = ("diffusion", index)
        if rod.radius is not None:
            yield where, field.stimulus, "must be left out: a round rod has no faces through its thickness"
            continue
        unknown = [name for name in field.diffusivity if name not in layers]
        for name in unknown:
            yield (*where, "diffusivity", name), name, one_of("layers of the rod", name, layers)
        if unknown:
            continue
        for key, face in field.faces:
            outer = rod.layers[0 if key == "bottom" else -1].name
            if outer not in field.diffusivity:
                demand = f"must be left out: its layer, {outer}, has no diffusivity"
                yield (*where, key), face.sees, demand
        for name in field.diffusivity:
            if isinstance(layers[name].thickness, Profile):
                yield (*where, "diffusivity", name), field.diffusivity[name], "must be of a layer of one thickness"
            elif layers[name].interval is not None and (len(field.diffusivity) > 1 or field.along):
                demand = "must be of a layer over the whole path, where the field goes on to another layer or along it"
                yield (*where, "diffusivity", name), field.diffusivity[name], demand
        if field.along and rod.closed:
            yield (*where, "along"), True, "must be false on a closed path"
        if field.interval is not None and not field.interval[0] < field.interval[1] <= rod.path.length * (1 + ROUNDING):
            demand = f"must be two increasing lengths [m] along the path, from 0 to {rod.path.length:g}"
            yield (*where, "interval"), field.interval, demand
        followed = False
        for slot, layer in enumerate(rod.layers):
            for place, law in layer.laws.items():
                if rod.diffusion_of(layer, law) is not field:
                    continue
                followed = True
                if field.along and place == ("stiffness_change",):
                    demand = "must be of a field that is alike all along the rod, and that of `diffusion` is not"
                    yield ("layers", slot, *place, "stimulus"), law.stimulus, demand
                for key in LAGS:
                    if getattr(law, key) is not None:
                        demand = "must be left out: the layer follows the rod's `diffusion`"
                        yield ("layers", slot, *place, key), getattr(law, key), demand
        if not followed:
            demand = f"must be that of a law of a layer in `diffusivity` ({', '.join(field.diffusivity)})"
            yield (*where, "stimulus"), field.stimulus, demand


def _faults_of_section(rod: Rod) -> Iterator[Fault]:
    """Yield the faults of layers that only a strip can have."""
    for index, layer in enumerate(rod.layers):
        if layer.fibres is not None and rod.section == "beam":
            demand = "must be left out: a beam does not feel them; `section: strip` of the rod does"
            yield ("layers", index, "fibres"), layer.fibres.angle, demand
        elif layer.fibres is not None and layer.swelling != "isotropic":
            demand = "must be left out: `fibres` say in which direction the layer swells"
            yield ("layers", index, "swelling"), layer.swelling, demand
        if layer.swelling == "across" and rod.section == "beam":
            demand = "must be isotropic or along: a beam does not feel it; `section: strip` of the rod does"
            yield ("layers", index, "swelling"), layer.swelling, demand


VARYING = ("thickness", "width", "stiffness", "natural_curvature", "natural_curvature_across", "natural_twist")
"""Keys of a layer that may be profiles."""
LEAST_CLOSED = 5
"""Stations of a closed rod: four edges."""


def _faults_of_closed(rod: Rod) -> Iterator[Fault]:
    """Yield the faults of a rod without ends: settings that it cannot have."""
    if rod.stations < LEAST_CLOSED:
        yield ("stations",), rod.stations, f"must be at least {LEAST_CLOSED} on a closed path"
    for end in ("clamp_start", "clamp_end"):
        for where, holder in ((), rod), (("pattern",), rod.pattern):
            if getattr(holder, end, None) is not None:
                yield (*where, end), getattr(holder, end), "must be left out: a closed path has no ends to hold"
    parts = [((), rod, ("width", "inner_radius"))]
    parts += [(("layers", index), layer, VARYING) for index, layer in enumerate(rod.layers)]
    for where, part, keys in parts:
        for key in keys:
            first, last = values_at(getattr(part, key) or 0.0, np.array([0.0, rod.path.length]))
            if abs(first - last) > ROUNDING * max(abs(first), abs(last)):
                demand = f"must be the same where a closed path starts and ends, is {first:g} and {last:g} there"
                yield (*where, key), "a profile", demand
    for index, layer in enumerate(rod.layers):
        if layer.fibres is not None:
            first, last = values_at(layer.fibres.angle, np.array([0.0, rod.path.length]))
            if abs(math.sin(first - last)) > ROUNDING:
                demand = "must be the same direction where a closed path starts and ends, as angles 180° apart are"
                yield ("layers", index, "fibres", "angle"), "a profile", demand
        covered = rod.covered_stations(layer)
        if covered[0] < 1 and covered != (0, rod.stations - 1):
            demand = (
                f"must begin an edge, {rod.edge_length:g} m, or more after the start of a closed path: let the path "
                "start where the layer is not"
            )
            yield ("layers", index, "interval"), layer.interval, demand


FARTHEST = 1e9
"""Coordinates of a rod in edges: theirs are then known to 2e-7 of their length, and farther away soon not at all."""


def _far_away(rod: Rod) -> Iterator[Fault]:
    """Yield a fault if the differences of a rod's node coordinates are lost in their rounding."""
    points = rod.frames_at(np.array([0.0, rod.path.length]))[0]
    farthest = FARTHEST * rod.edge_length
    if np.abs(points).max() > farthest:
        where: Location = ("path", "start" if "start" in type(rod.path).model_fields else "points")
        found: Any = rod.path.start
    elif rod.pattern and np.abs(stacked(rod.pattern.places()).points(points)).max() > farthest:
        where, found = ("pattern",), rod.pattern.type
    else:
        return
    demand = f"must leave all coordinates of the rod below {farthest:g} m: beyond, its edges are lost in rounding"
    yield where, found, demand


POINTS_COMPARED = 9
"""Along two copies of a rod that may lie on each other."""


def _faults_of_copies(rod: Rod) -> Iterator[Fault]:
    """Yield the faults of a pattern: laws that the rod lacks, clamps that it has itself, copies at one place."""
    channels = dict.fromkeys(law.stimulus for layer in rod.layers for law in layer.laws.values())
    for name in rod.pattern.stimuli:
        if name not in channels:
            yield ("pattern", "stimuli", name), name, one_of("channels in the rod's laws", name, channels)
    if rod.pattern.gains is not None and not any(layer.eigenstrain for layer in rod.layers):
        yield ("pattern", "gains"), rod.pattern.gains, "must be left out: no layer has an eigenstrain"
    for end in ("clamp_start", "clamp_end"):
        if getattr(rod, end) is not None and getattr(rod.pattern, end) is not None:
            yield (end,), getattr(rod, end), f"must be left out where `pattern.{end}` has the body of each copy"
    points = rod.frames_at(np.linspace(0.0, rod.path.length, POINTS_COMPARED))[0]
    pair = pair_at_one_place(stacked(rod.pattern.places()).points(points), ROUNDING * rod.path.length)
    if pair is not None:
        first, second = (rod.copy_names[copy] for copy in pair)
        demand = f"must leave no copy where another is: {second} lies on {first}"
        yield ("pattern",), rod.pattern.type, demand


def _bent_across(rod: Rod, index: int) -> Iterator[Fault]:
    """Yield a fault where the inner border of a layer would have no length by its natural curvature."""
    bend, width = rod.layers[index].natural_curvature_across, extremes(rod.width_of(rod.layers[index]))[1]
    worst = max(map(abs, extremes(bend))) if bend is not None else 0.0
    if 0.5 * worst * width >= 1.0:
        demand = f"must be below {2.0 / width:g} 1/m: the inner border would have no length"
        yield ("layers", index, "natural_curvature_across"), worst, demand


def _sharp_bends(rod: Rod) -> Iterator[Fault]:
    """Yield a fault where the inner face or the inner border of a curved path would have no length: the path's radius
    must exceed their distance from it.
    """
    arc = rod.path.sharpest
    if rod.path.turn == 0.0 or not len(arc):
        return
    towards, across = rod.curvatures_at(arc)[:, :2].T
    share = 0.5 if len(rod.layers) == 1 else 1.0
    inner = [rod.layers[-1 if curvature > 0.0 else 0] for curvature in towards]
    distance = share * np.array([extremes(layer.thickness)[1] for layer in inner])
    half_width = np.full(len(arc), 0.5 * rod.widest)
    faces = [f"the inner face of layer {layer.name}" for layer in inner]
    borders = ["its inner border"] * len(arc)
    for curvature, away, names in ((np.abs(towards), distance, faces), (np.abs(across), half_width, borders)):
        worst = int((curvature * away).argmax())
        if curvature[worst] * away[worst] < 1.0:
            continue
        key, radius = rod.path.key_of_radius(arc[worst]), f"a radius of {1.0 / curvature[worst]:g} m"
        place = f", {arc[worst]:g} m along it" if key == "points" else ""
        demand = (
            f"must be larger: the path has {radius}{place}, and {names[worst]}, {away[worst]:g} m from it, would have "
            "no length"
        )
        if isinstance(rod.path, PolylinePath):
            demand += "; longer edges, points on a round bend or `shape: spline` bend less sharply"
        yield ("path", key), radius if key == "points" else getattr(rod.path, key), demand


def _profiles(
    part: Rod | Layer | Eigenstrain | Fibres, where: Location, keys: tuple[str, ...], length: float
) -> Iterator[Fault]:
    """Yield a fault for each place of a profile that lies beyond the end of a path of given length [m]."""
    for key in keys:
        profile = getattr(part, key)
        for index, place in enumerate(profile.at if isinstance(profile, Profile) else ()):
            if place > length * (1.0 + ROUNDING):
                yield (*where, key, "at", index), place, f"must be a length [m] along the path, from 0 to {length:g}"
