"""Faults of rods: sections, normals, bends, copies, and where layers begin and end."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from bilayer_core.scene.close_paths import crossings
from bilayer_core.scene.eigenstrain import Eigenstrain
from bilayer_core.scene.faults import ROUNDING, Fault, Location, one_of, repeated
from bilayer_core.scene.pattern import pair_at_one_place, stacked
from bilayer_core.scene.point_paths import PolylinePath
from bilayer_core.scene.profile import Profile, extremes, scaled, values_at

if TYPE_CHECKING:
    from bilayer_core.scene.rod import Layer, Rod

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
    part: Rod | Layer | Eigenstrain, where: Location, keys: tuple[str, ...], length: float
) -> Iterator[Fault]:
    """Yield a fault for each place of a profile that lies beyond the end of a path of given length [m]."""
    for key in keys:
        profile = getattr(part, key)
        for index, place in enumerate(profile.at if isinstance(profile, Profile) else ()):
            if place > length * (1.0 + ROUNDING):
                yield (*where, key, "at", index), place, f"must be a length [m] along the path, from 0 to {length:g}"
