"""Checks that concern more than one value of a scene. Each returns the faults that it finds, in their places."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from bilayer_core.scene.faults import Fault, Location, one_of
from bilayer_core.scene.profile import Profile, extremes

if TYPE_CHECKING:
    from bilayer_core.scene.body import Free
    from bilayer_core.scene.config import SceneConfig, Stimulus
    from bilayer_core.scene.eigenstrain import Eigenstrain
    from bilayer_core.scene.load import Load, PointMass
    from bilayer_core.scene.rod import Layer, Rod, SpiralPath

ROUNDING = 1e-9
"""Relative difference of typed numbers that is not taken for a fault."""


def faults_of_range(stimulus: Stimulus) -> list[Fault]:
    """The range of a channel, and the values that its schedule takes."""
    low, high = stimulus.minimum, stimulus.maximum
    if high <= low:
        return [(("maximum",), high, f"must be above `minimum` ({low:g})")]
    return [
        (("schedule", *key), value, f"must lie in the range of the channel, {low:g} to {high:g} [{stimulus.unit}]")
        for key, value in stimulus.schedule.points().items()
        if not low <= value <= high
    ]


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
    faults += _repeated(names, "layers of a rod")
    ordered = f"must be two increasing lengths [m] along the path, from 0 to {rod.path.length:g}"

    def is_ordered(interval: tuple[float, float]) -> bool:
        return interval[0] < interval[1] <= rod.path.length * (1.0 + ROUNDING)

    faults += _profiles(rod, (), ("width",), rod.path.length)
    faults += _faces_of_path(rod)
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
        faults.append((("layers",), [layer.interval for layer in rod.layers], "one layer must cover the whole path"))
    return faults


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


def faults_of_inertia(motion: Free) -> list[Fault]:
    """Whether the moments of inertia can be those of a body."""
    if motion.inertia is None:
        return []
    if motion.shell:
        return [(("shell",), True, "must be left out where `inertia` is given")]
    small, middle, large = sorted(motion.inertia)
    if large > (1.0 + ROUNDING) * (small + middle):
        return [(("inertia",), motion.inertia, "must be such that none exceeds the sum of the other two")]
    return []


def faults_of_load(load: Load) -> list[Fault]:
    """Whether it acts on one thing, at one place, and what acts there."""
    if (load.rod is None) == (load.body is None):
        found = None if load.rod is None else f"{load.rod}, beside the body {load.body}"
        return [(("rod",), found, "must be given, or `body` instead of it: a load acts on one of the two")]
    faults: list[Fault] = []
    if load.rod is not None and load.position is None:
        faults.append((("position",), None, "must be given for a load on a rod: a length along its path"))
    if load.body is not None and load.position is not None:
        faults.append((("position",), load.position, "must be left out: a force on a body acts at its mass centre"))
    if load.rod is not None and any(load.moment):
        faults.append((("moment",), load.moment, "must be left out: only bodies take moments"))
    if not any(load.force) and not any(load.moment):
        faults.append((("force",), load.force, "must not be zero" + (" where `moment` is" if load.body else "")))
    return faults


def faults_of_rounding(rounding: float, largest: float, what: str) -> list[Fault]:
    """Whether a shape has room for the radius of its edges."""
    if rounding <= (1.0 + ROUNDING) * largest:
        return []
    return [(("rounding",), rounding, f"must be at most {what} ({largest:g} m)")]


def faults_of_scene(scene: SceneConfig) -> list[Fault]:
    """Names that refer to other parts, names that occur twice, and parts that need another."""
    references = list(_references(scene))
    rest_lengths = [] if references else _rest_lengths(scene)
    return [*_names(scene), *references, *rest_lengths, *_clamps(scene), *_surfaces(scene), *_points(scene)]


def _names(scene: SceneConfig) -> Iterator[Fault]:
    named = [
        *((("rods", index, "name"), copy) for index, rod in enumerate(scene.rods) for copy in rod.copies),
        *((("bodies", index, "name"), body.name) for index, body in enumerate(scene.bodies)),
        *((("obstacles", index, "name"), plane.name) for index, plane in enumerate(scene.obstacles)),
    ]
    yield from _repeated(named, "rods, bodies and obstacles")
    for key in ("masses", "loads"):
        yield from _repeated([((key, i, "name"), part.name) for i, part in enumerate(getattr(scene, key))], key)


def _repeated(named: list[tuple[Location, str]], among: str) -> Iterator[Fault]:
    seen: set[str] = set()
    for where, name in named:
        if name in seen:
            yield where, name, f"must be a name of its own among the {among}"
        seen.add(name)


def _references(scene: SceneConfig) -> Iterator[Fault]:
    for number, rod in enumerate(scene.rods):
        for index, layer in enumerate(rod.layers):
            where: Location = ("rods", number, "layers", index)
            if layer.material not in scene.materials:
                yield (*where, "material"), layer.material, one_of("materials", layer.material, scene.materials)
            for place, law in enumerate(layer.eigenstrain):
                if law.stimulus not in scene.stimuli:
                    demand = one_of("stimuli", law.stimulus, scene.stimuli)
                    yield (*where, "eigenstrain", place, "stimulus"), law.stimulus, demand


def _rest_lengths(scene: SceneConfig) -> Iterator[Fault]:
    """Whether each layer keeps a rest length |ē|(1 + η) > 0 for all that its channels allow.

    It is that of a layer by itself. The rest strain of a laminate is a mean of its layers', weighted with their
    stiffness, and so above −1 where they are.
    """
    for number, rod in enumerate(scene.rods):
        for index, layer in enumerate(rod.layers):
            acting: dict[int, tuple[int, ...]] = {}
            for place, law in enumerate(layer.eigenstrain):
                for edge in rod.driven_edges(layer, law):
                    acting[edge] = (*acting.get(edge, ()), place)
            worst, least = (), -1.0
            for places in sorted(set(acting.values())):
                strain = _least_strain(scene, [layer.eigenstrain[place] for place in places])
                if strain <= least:
                    worst, least = places, strain
            if not worst:
                continue
            place = min(worst, key=lambda k: _least_strain(scene, [layer.eigenstrain[k]]))
            law = layer.eigenstrain[place]
            channel = scene.stimuli[law.stimulus]
            others = ", with the laws that act there too," if len(worst) > 1 else ""
            demand = (
                f"must leave the layer a length: `{law.stimulus}` from {channel.minimum:g} to {channel.maximum:g} "
                f"[{channel.unit}]{others} can take its eigenstrain to {100 * least:.4g} %; allowed is above -100 %, "
                "by a smaller gain, a `saturation` below 1 or a narrower range of the channel"
            )
            yield ("rods", number, "layers", index, "eigenstrain", place, "gain"), law.gain, demand


SAMPLES = 257
"""Values of a channel at which laws that follow it in step are added up; the two ends are among them."""


def _least_strain(scene: SceneConfig, laws: list[Eigenstrain]) -> float:
    """Least sum of the eigenstrains of some laws that the ranges of their channels allow.

    Laws of one channel with the same lags have reached the same stimulus at any time. Others may be anywhere in their
    ranges independently, as lags never leave the range of what they follow.
    """
    together: dict[tuple, list[Eigenstrain]] = {}
    for law in laws:
        together.setdefault((law.stimulus, law.lags), []).append(law)
    total = 0.0
    for (name, _), group in together.items():
        channel = scene.stimuli[name]
        values = np.linspace(channel.minimum, channel.maximum, SAMPLES)
        total += float(sum(law.strain_at(values) for law in group).min())
    return total


def _clamps(scene: SceneConfig) -> Iterator[Fault]:
    names = [body.name for body in scene.bodies]
    for number, rod in enumerate(scene.rods):
        for end in ("clamp_start", "clamp_end"):
            name = getattr(rod, end)
            if name is not None and name not in names:
                yield ("rods", number, end), name, one_of("bodies", name, names)


def _surfaces(scene: SceneConfig) -> Iterator[Fault]:
    for index, body in enumerate(scene.bodies):
        if body.motion.type != "free":
            continue
        shape = body.surface.shape if body.surface is not None else None
        if shape == "plane":
            demand = "must be `sphere`, `box` or `cylinder` for a free body: a plane has no end"
            yield ("bodies", index, "surface", "shape"), shape, demand
        elif shape is None and body.motion.inertia is None:
            demand = "must be given for a free body without a surface"
            yield ("bodies", index, "motion", "inertia"), None, demand
        if body.motion.shell and shape not in ("sphere", None, "plane"):
            yield ("bodies", index, "motion", "shell"), True, "is for spheres: give `inertia` for a hollow body"
    touching = [plane.name for plane in scene.obstacles] + [
        body.name for body in scene.bodies if body.surface is not None or body.contact_points
    ]
    if touching and scene.contact is None:
        surfaces = ", ".join(touching)
        yield (
            ("contact",),
            None,
            f"must be given (barrier_distance, stiffness): there is something to touch, {surfaces}",
        )


def _points(scene: SceneConfig) -> Iterator[Fault]:
    """Point masses and loads: what they are on, and where."""
    for key, parts in (("masses", scene.masses), ("loads", scene.loads)):
        for index, part in enumerate(parts):
            if part.rod is not None:
                yield from _place_on_rod(scene, (key, index), part)
    names = [body.name for body in scene.bodies]
    for index, load in enumerate(scene.loads):
        if load.body is None:
            continue
        if load.body not in names:
            yield ("loads", index, "body"), load.body, one_of("bodies", load.body, names)
            continue
        motion = scene.bodies[names.index(load.body)].motion.type
        if motion == "prescribed":
            yield ("loads", index, "body"), load.body, "must be a free or a guided body; the path of this one is given"
        elif motion == "guided" and any(load.moment):
            yield ("loads", index, "moment"), load.moment, "must be left out: a guided body does not turn"


def _place_on_rod(scene: SceneConfig, where: Location, part: PointMass | Load) -> Iterator[Fault]:
    rods = {name: rod for rod in scene.rods for name in (rod.name, *rod.copies)}
    if part.rod not in rods:
        yield (*where, "rod"), part.rod, one_of("rods or their copies", part.rod, rods)
        return
    length = rods[part.rod].path.length
    if part.position is not None and part.position > length * (1.0 + ROUNDING):
        yield (*where, "position"), part.position, f"must be a length [m] along the path, from 0 to {length:g}"
