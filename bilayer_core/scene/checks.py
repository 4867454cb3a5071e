"""Checks that concern more than one value of a scene. Each returns the faults that it finds, in their places."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Protocol

import numpy as np

from bilayer_core.scene.diffusion_modes import strain_at, strains_at
from bilayer_core.scene.eigenstrain import Eigenstrain
from bilayer_core.scene.faults import ROUNDING, Fault, Location, one_of, repeated
from bilayer_core.scene.limits import faults_of_size
from bilayer_core.scene.load import Load, PointMass
from bilayer_core.scene.rod import Layer, Rod


class SceneConfig(Protocol):
    """A scene, as far as the checks look at it: see `bilayer_core.scene.config.SceneConfig`."""

    rods: tuple
    bodies: tuple
    obstacles: tuple
    masses: tuple
    loads: tuple
    materials: dict
    stimuli: dict
    fluid: object
    contact: Any
    friction: Any


def faults_of_scene(scene: SceneConfig) -> list[Fault]:
    """Return the names that refer to other parts, names that occur twice, and parts that need another."""
    too_large = faults_of_size(scene)
    if too_large:
        return too_large
    references = list(_references(scene))
    rest_lengths = [] if references else [*_rest_lengths(scene), *_stiffness(scene)]
    parts = _clamps(scene), _joints(scene), _surfaces(scene), _points(scene), _drags(scene), _frictions(scene)
    return [*_names(scene), *references, *rest_lengths, *(fault for faults in parts for fault in faults)]


def _names(scene: SceneConfig) -> Iterator[Fault]:
    named = [
        *((("rods", index, "name"), copy) for index, rod in enumerate(scene.rods) for copy in rod.copy_names),
        *((("bodies", index, "name"), body.name) for index, body in enumerate(scene.bodies)),
        *((("obstacles", index, "name"), plane.name) for index, plane in enumerate(scene.obstacles)),
    ]
    yield from repeated(named, "rods, bodies and obstacles")
    for key in ("joints", "masses", "loads"):
        yield from repeated([((key, i, "name"), part.name) for i, part in enumerate(getattr(scene, key))], key)


def _references(scene: SceneConfig) -> Iterator[Fault]:
    for number, rod in enumerate(scene.rods):
        for index, layer in enumerate(rod.layers):
            where: Location = ("rods", number, "layers", index)
            if layer.material not in scene.materials:
                yield (*where, "material"), layer.material, one_of("materials", layer.material, scene.materials)
            for place, law in layer.laws.items():
                if law.stimulus not in scene.stimuli:
                    demand = one_of("stimuli", law.stimulus, scene.stimuli)
                    yield (*where, *place, "stimulus"), law.stimulus, demand
                names = {variant.layers[index].laws[place].stimulus for variant in rod.variants}
                lights = [name for name in sorted(names & scene.stimuli.keys()) if scene.stimuli[name].light]
                if lights and place == ("stiffness_change",):
                    demand = f"must be a channel that all of the layer sees alike: `{lights[0]}` is a light"
                    yield (*where, *place, "stimulus"), law.stimulus, demand
                elif lights and min(law.lags) == 0.0 and rod.diffusion_of(layer, law) is None:
                    demand = f"must be a time [s] above 0, rising and falling: `{lights[0]}` is a light"
                    yield (*where, *place, "time_constant"), law.time_constant, demand
        for index, field in enumerate(rod.diffusion):
            own = {variant.diffusion[index].stimulus for variant in rod.variants}
            if field.along and any(scene.stimuli[name].light for name in own & scene.stimuli.keys()):
                demand = "must be false where the stimulus is a light with a direction: each element sees its own"
                yield ("rods", number, "diffusion", index, "along"), True, demand
        for name, channels in rod.pattern.stimuli.items() if rod.pattern else ():
            for copy, channel in enumerate(channels):
                if channel not in scene.stimuli:
                    demand = one_of("stimuli", channel, scene.stimuli)
                    yield ("rods", number, "pattern", "stimuli", name, copy), channel, demand


def _drags(scene: SceneConfig) -> Iterator[Fault]:
    """Yield a fault for each drag of a body that nothing would make use of, or that has no area."""
    for index, body in enumerate(scene.bodies):
        if body.drag is None:
            continue
        where: Location = ("bodies", index, "drag")
        if scene.fluid is None:
            yield where, body.drag.coefficient, "must be left out: there is no `fluid`"
        elif body.motion.type == "prescribed":
            yield where, body.drag.coefficient, "must be left out: the motion of the body is prescribed"
        elif body.drag.area is None and (body.surface is None or body.surface.shape == "plane"):
            yield (
                (*where, "area"),
                None,
                "must be given (an area [m^2], such as 3 cm^2): the body has no surface of a size",
            )


def _frictions(scene: SceneConfig) -> Iterator[Fault]:
    """Yield a fault for coefficients of a part's own that lack what `contact.friction` says, or a direction."""
    law = scene.friction
    grains = {"bodies": [body.surface and body.surface.grain for body in scene.bodies]}
    grains["obstacles"] = [obstacle.grain for obstacle in scene.obstacles]
    for key in ("rods", "bodies", "obstacles"):
        for index, part in enumerate(getattr(scene, key)):
            own, where = part.friction, (key, index, "friction")
            if own is None:
                continue
            if law is None:
                demand = "must be left out without `contact.friction`, which has the `speed_threshold`"
                yield where, own.coefficient, demand
            elif own.directed and law.axis is None and key in grains and grains[key][index] is None:
                given = next(name for name in ("forward", "backward", "sideways") if getattr(own, name) is not None)
                demand = "must be left out without a direction: `grain` of the surface, or `contact.friction.axis`"
                yield (*where, given), getattr(own, given), demand


def _rest_lengths(scene: SceneConfig) -> Iterator[Fault]:
    """Yield a fault for each layer that does not keep a rest length |ē|(1 + η) > 0 for all that its channels allow.

    This is that of a layer by itself. The rest strain of a laminate is a mean of its layers', weighted with their
    stiffness, and so above −1 where they are.
    """
    for number, rod in enumerate(scene.rods):
        for index in range(len(rod.layers)):
            laws = {tuple(variant.layers[index].eigenstrain): variant for variant in rod.variants}
            faults = (_rest_length(scene, variant, index) for variant in laws.values())
            worst = min((fault for fault in faults if fault), key=lambda fault: fault[0], default=None)
            if worst is not None:
                _, place, gain, demand = worst
                own = rod.pattern is not None and rod.pattern.gains is not None
                where: Location = ("pattern", "gains") if own else ("layers", index, "eigenstrain", place, "gain")
                yield ("rods", number, *where), rod.pattern.gains if own else gain, demand


def _rest_length(scene: SceneConfig, rod: Rod, index: int) -> tuple[float, int, float, str] | None:
    """Return the least eigenstrain of a layer that leaves it no length, the law to blame for it with its gain, and the
    demand.
    """
    layer = rod.layers[index]
    spans = [rod.span_of(layer, law) for law in layer.eigenstrain]
    begins = [begin for begin, end in spans if begin < end]
    acting = {tuple(k for k, (begin, end) in enumerate(spans) if begin <= at < end) for at in begins}
    worst, least = (), -1.0
    for places in sorted(acting):
        strain = _least_strain(scene, rod, layer, [layer.eigenstrain[place] for place in places])
        if strain <= least:
            worst, least = places, strain
    if not worst:
        return None
    place = min(worst, key=lambda k: _least_strain(scene, rod, layer, [layer.eigenstrain[k]]))
    law = layer.eigenstrain[place]
    channel = scene.stimuli[law.stimulus]
    others = ", with the laws that act there too," if len(worst) > 1 else ""
    demand = (
        f"must leave the layer a length: `{law.stimulus}` from {channel.minimum:g} to {channel.maximum:g} "
        f"[{channel.unit}]{others} can take its eigenstrain to {100 * least:.4g} %; allowed is above -100 %, "
        "by a smaller gain, a `saturation` below 1 or a narrower range of the channel"
    )
    return least, place, law.gain, demand


def _stiffness(scene: SceneConfig) -> Iterator[Fault]:
    """Yield a fault for each layer that loses all its stiffness for what its channels allow."""
    for number, rod in enumerate(scene.rods):
        for index in range(len(rod.layers)):
            for variant in rod.variants:
                law = variant.layers[index].stiffness_change
                if law is None:
                    continue
                channel = scene.stimuli[law.stimulus]
                ends = np.array([channel.minimum, channel.maximum])
                least = float(strain_at(variant, variant.layers[index], law, ends).min())
                if least <= -1.0:
                    demand = (
                        f"must leave the layer stiff: `{law.stimulus}` from {channel.minimum:g} to {channel.maximum:g} "
                        f"[{channel.unit}] can change its moduli by {100 * least:.4g} %; allowed is above -100 %, by a "
                        "smaller gain, a `saturation` below 1 or a narrower range of the channel"
                    )
                    yield ("rods", number, "layers", index, "stiffness_change", "gain"), law.gain, demand
                    break


SAMPLES = 257
"""Values of a channel at which laws that follow it in step are added up; the two ends are among them."""


def _least_strain(scene: SceneConfig, rod: Rod, layer: Layer, laws: list[Eigenstrain]) -> float:
    """Return the least sum of the eigenstrains of some laws of a layer that the ranges of their channels allow, along
    or across its fibres.

    Laws of one channel with the same lags have reached the same stimulus at any time. Others may be anywhere in their
    ranges independently, as lags never leave the range of what they follow.
    """
    together: dict[tuple, list[Eigenstrain]] = {}
    for law in laws:
        together.setdefault((law.stimulus, law.lags), []).append(law)
    total = np.zeros(len(layer.multiples))
    for (name, _), group in together.items():
        channel = scene.stimuli[name]
        values = np.linspace(channel.minimum, channel.maximum, SAMPLES)
        multiples = np.array(layer.multiples)[:, None, None]
        least = sum((multiples * strains_at(rod, layer, law, values)).min(axis=1) for law in group)
        total += least.min(axis=1)
    return float(total.min())


def _clamps(scene: SceneConfig) -> Iterator[Fault]:
    names = [body.name for body in scene.bodies]
    for number, rod in enumerate(scene.rods):
        for end in ("clamp_start", "clamp_end"):
            own: list[tuple[Location, str | None]] = [(("rods", number, end), getattr(rod, end))]
            of_copies = getattr(rod.pattern, end, None) or ()
            own += [(("rods", number, "pattern", end, copy), name) for copy, name in enumerate(of_copies)]
            for where, name in own:
                if name is not None and name not in names:
                    yield where, name, one_of("bodies", name, names)


def _joints(scene: SceneConfig) -> Iterator[Fault]:
    motions = {body.name: body.motion.type for body in scene.bodies}
    for number, joint in enumerate(scene.joints):
        for place, name in enumerate(joint.bodies):
            if name not in motions:
                yield ("joints", number, "bodies", place), name, one_of("bodies", name, list(motions))
        if all(motions.get(name) == "prescribed" for name in joint.bodies):
            yield ("joints", number, "bodies"), list(joint.bodies), "one must not be prescribed: neither can give way"


def _surfaces(scene: SceneConfig) -> Iterator[Fault]:
    holding = {name for rod in scene.rods for copy in rod.copies for name in (copy.rod.clamp_start, copy.rod.clamp_end)}
    for index, body in enumerate(scene.bodies):
        motion = body.motion
        if motion.type == "prescribed":
            continue
        if motion.mass == 0.0 and body.name not in holding:
            demand = "must be a mass [kg] above 0 for a body that holds no rod: nothing has stiffness or inertia there"
            yield ("bodies", index, "motion", "mass"), 0.0, demand
        if not motion.turns:
            continue
        shape = body.surface.shape if body.surface is not None else None
        if shape == "plane":
            demand = f"must be `sphere`, `box` or `cylinder` for a {motion.type} body that turns: a plane has no end"
            yield ("bodies", index, "surface", "shape"), shape, demand
        elif shape is None and motion.inertia is None and motion.mass > 0.0:
            demand = f"must be given for a {motion.type} body with a mass but without a surface"
            yield ("bodies", index, "motion", "inertia"), None, demand
        if motion.type == "free" and motion.shell and shape not in ("sphere", None, "plane"):
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
    """Yield the faults of point masses and loads: what they are on, and where."""
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
        motion = scene.bodies[names.index(load.body)].motion
        if motion.type == "prescribed":
            yield ("loads", index, "body"), load.body, "must be a free or a guided body; the path of this one is given"
        elif motion.type == "guided" and not motion.turns and any(load.moment):
            yield ("loads", index, "moment"), load.moment, "must be left out: this guided body does not turn"


def _place_on_rod(scene: SceneConfig, where: Location, part: PointMass | Load) -> Iterator[Fault]:
    rods = {name: rod for rod in scene.rods for name in (rod.name, *rod.copy_names)}
    if part.rod not in rods:
        yield (*where, "rod"), part.rod, one_of("rods or their copies", part.rod, rods)
        return
    length = rods[part.rod].path.length
    if part.position is not None and part.position > length * (1.0 + ROUNDING):
        yield (*where, "position"), part.position, f"must be a length [m] along the path, from 0 to {length:g}"
