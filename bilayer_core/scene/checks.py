"""Checks that concern more than one value of a scene. Each returns the faults that it finds, in their places."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from bilayer_core.scene.faults import Fault, Location, one_of

if TYPE_CHECKING:
    from bilayer_core.scene.body import Free
    from bilayer_core.scene.config import SceneConfig, Stimulus
    from bilayer_core.scene.rod import Rod

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

    for index, layer in enumerate(rod.layers):
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


def faults_of_scene(scene: SceneConfig) -> list[Fault]:
    """Names that refer to other parts, names that occur twice, and parts that need another."""
    return [*_names(scene), *_references(scene), *_clamps(scene), *_surfaces(scene)]


def _names(scene: SceneConfig) -> Iterator[Fault]:
    named = [
        *((("rods", index, "name"), copy) for index, rod in enumerate(scene.rods) for copy in rod.copies),
        *((("bodies", index, "name"), body.name) for index, body in enumerate(scene.bodies)),
        *((("obstacles", index, "name"), plane.name) for index, plane in enumerate(scene.obstacles)),
    ]
    yield from _repeated(named, "rods, bodies and obstacles")


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


def _clamps(scene: SceneConfig) -> Iterator[Fault]:
    names = [body.name for body in scene.bodies]
    for number, rod in enumerate(scene.rods):
        for end in ("clamp_start", "clamp_end"):
            name = getattr(rod, end)
            if name is not None and name not in names:
                yield ("rods", number, end), name, one_of("bodies", name, names)


def _surfaces(scene: SceneConfig) -> Iterator[Fault]:
    for index, body in enumerate(scene.bodies):
        if body.motion.type == "free" and body.surface is None and body.motion.inertia is None:
            yield ("bodies", index, "motion", "inertia"), None, "must be given for a free body that is no sphere"
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
