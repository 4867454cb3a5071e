"""Warnings of starts inside the barrier, whose stored energy throws the robot.

At a gap d below the barrier distance d̂ a pair stores K_c b(d) w, w the length of rod that it stands for (half of that
for each of two rods, which both have points). All pairs of a *part*, rods and bodies that hold each other, of mass m
lift it in gravity g by

    H = Σ K_c b(d) w / (m g),

and without gravity throw it at √(2 Σ K_c b w / m). A part at rest on a surface stores little: there the force
3 K_c w (d̂ − d)²/d̂ of the barrier is its weight, and H = (d̂ − d)/3. So a start is told where H exceeds d̂.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from bilayer_core.contact.barrier import barrier
from bilayer_core.model.contact_points import contact_point_names
from bilayer_core.model.findings import Finding
from bilayer_core.model.model import Model
from bilayer_core.model.start_gaps import rod_gaps, surface_gaps, surface_name
from bilayer_core.model.start_motion import joined_bodies, links_of

Array = np.ndarray


def start_warnings(model: Model) -> Iterator[Finding]:
    """Yield a warning for each part of a scene that starts so far inside the barrier that it is thrown."""
    contact = model.scene.contact
    if contact is None or model.scene.start == "settle":
        return
    distance, parts = contact.barrier_distance, _Parts(model)
    pairs = [*_on_surfaces(model, parts, distance), *_on_rods(model, parts, distance)]
    gravity = math.hypot(*model.scene.gravity)
    for part, mass in enumerate(parts.mass.tolist()):
        own = [pair for pair in pairs if part in pair[:2]]
        if not own or mass == 0.0:
            continue
        energy = sum(model.contact_stiffness * weight * barrier.py_func(gap, distance) for _, _, weight, gap, _ in own)
        *_, gap, place = min(own, key=lambda pair: pair[3])
        if energy <= mass * gravity * distance:
            continue
        speed = math.sqrt(2.0 * energy / mass)
        does = f"lifts it by {energy / (mass * gravity):.3g} m" if gravity else f"throws it at {speed:.3g} m/s"
        yield Finding(
            kind="start",
            where=parts.names[part],
            before="contact: ",
            after=f" starts inside the barrier: {place}, {1e3 * gap:.3g} mm from it, where the barrier begins at "
            f"{1e3 * distance:.3g} mm; what that stores, {energy:.2g} J, {does}; let it start "
            f"{1e3 * (distance - gap):.3g} mm farther away, or settle first (`start: settle`, `--settle`)",
            severity=energy / mass,
        )


class _Parts:
    """Rods and free bodies that hold each other, as parts with numbers.

    Attributes
    ----------
    of_node, of_body : ndarray
        Part of each node, and of each body and the world, −1 for what does not move freely.
    names : list of str
    mass : ndarray
        [kg], shape (n_part,).
    """

    def __init__(self, model: Model):
        free, links = model.free_bodies, links_of(model)
        moving = free.free_index >= 0
        groups: list[set[str | int]] = [{name, *(b for b in held if b is not None)} for name, held in links.items()]
        groups += [set(pair) for pair in joined_bodies(model.scene)] + [{b} for b in free.body_of_free.tolist()]
        parts: list[set[str | int]] = []
        for group in groups:
            group = {one for one in group if isinstance(one, str) or moving[one]}
            for other in [part for part in parts if part & group]:
                parts.remove(other)
                group |= other
            parts.append(group)
        number = {one: index for index, part in enumerate(parts) for one in part}
        self.of_body = np.array([number.get(b, -1) for b in range(len(moving))])
        self.of_node = np.zeros(model.node_count, dtype=np.int64)
        for strand in model.strands:
            self.of_node[strand.first_node : strand.first_node + strand.node_count] = number[strand.rod]
        self.names = [_name(model, part) for part in parts]
        self.mass = np.bincount(self.of_node, model.rods.node_mass, len(parts))
        np.add.at(self.mass, self.of_body[free.body_of_free], free.mass)


def _name(model: Model, part: set[str | int]) -> str:
    """Return the name of a part by its first rod, or of its body if it has none."""
    rods = [strand.rod for strand in model.strands if strand.rod in part]
    return f"rod {rods[0]!r}" if rods else f"body {model.bodies.names[min(part)]!r}"


def _on_surfaces(model: Model, parts: _Parts, distance: float) -> Iterator[tuple[int, int, float, float, str]]:
    """Yield parts, weight [m], gap [m] and description of each point within a distance [m] of a surface."""
    surfaces, names = model.surfaces, contact_point_names(model)
    arms = surfaces.rod_points.node if surfaces.rod_points.exists else np.zeros(0, dtype=np.int64)
    of_point = np.concatenate([parts.of_node, parts.of_body[surfaces.point_body], parts.of_node[arms]])
    for found in surface_gaps(model, distance):
        s = found.surface
        of_surface, name = int(parts.of_body[surfaces.body[s]]), surface_name(model, model.surface_names[s])
        numbers = found.point.tolist(), found.weight.tolist(), found.gap.tolist()
        for point, weight, gap in zip(*numbers, strict=True):
            if of_point[point] != of_surface and weight > 0.0:
                yield int(of_point[point]), of_surface, weight, gap, f"{names[point]} is near {name}"


def _on_rods(model: Model, parts: _Parts, distance: float) -> Iterator[tuple[int, int, float, float, str]]:
    """Yield the same of points of rods near other rods, each with the nearest place of a part."""
    found = rod_gaps(model, distance)
    nearest: dict[tuple[int, int], int] = {}
    first, second = (parts.of_node[model.rods.edge_node[edge]] for edge in (found.own, found.edge))
    for pair in np.argsort(-found.gap).tolist():
        nearest[int(found.point[pair]), int(second[pair])] = pair
    for pair in nearest.values():
        place, other = found.names(model, pair)
        weight = 0.5 * float(model.rod_point_weight[found.point[pair]])
        yield int(first[pair]), int(second[pair]), weight, float(found.gap[pair]), f"{place} is near {other}"
