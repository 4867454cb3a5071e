"""Checks of barriers against impacts: their energy down to a tenth of their distance, against that of motion.

A barrier K_c b(d) w, w the length of rod that a contact point stands for, takes up K_c w b(d̂/10) while nine tenths of
its distance close, b(d̂/10) = 0.81 ln 10 d̂². What comes with more energy along the normal turns where the gap is a tiny
part of d̂, which no step resolves. `contact.impact_speed` has the model use the stiffness that holds it.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator

import numpy as np

from bilayer_core.contact.barrier import barrier
from bilayer_core.contact.shapes import PLANE
from bilayer_core.model.findings import Finding
from bilayer_core.model.model import Model
from bilayer_core.model.state import initial_state

Array = np.ndarray
HELD = 0.1
"""Part of the barrier distance down to which its energy counts."""


def stiffness_that_holds(energy_per_length: float, distance: float) -> float:
    """Return K_c [Pa] of a barrier of a distance d̂ [m] that takes up so much [J/m] down to d̂/10, to a digit, rounded
    up.
    """
    return rounded_up(max(energy_per_length / barrier.py_func(HELD * distance, distance), sys.float_info.min))


def rounded_up(value: float) -> float:
    """Return the next number from a positive one up that has one digit."""
    digit = 10.0 ** math.floor(math.log10(value))
    return math.ceil(value / digit) * digit


def heaviest(model: Model) -> float:
    """Return the largest mass per length of contact, of free bodies and of nodes [kg/m]."""
    own = model.node_length > 0.0
    found = [float((model.rods.node_mass[own] / model.node_length[own]).max())]
    for slot, body in enumerate(model.free_bodies.body_of_free):
        weights = model.surfaces.weight[model.surfaces.contact_point_body == body]
        found += [float(model.free_bodies.mass[slot] / weights.max())] if weights.size else []
    return max(found)


def impact_warnings(model: Model) -> Iterator[Finding]:
    """Yield warnings of bodies and free rods that fly or fall towards planes with more energy than the barrier holds.

    The energies are estimated from velocities and heights at the start.
    """
    contact = model.scene.contact
    for what, mass, length, speed in _approaching(model):
        energy = 0.5 * mass / length * speed**2
        held = model.contact_stiffness * barrier.py_func(HELD * contact.barrier_distance, contact.barrier_distance)
        if energy <= held:
            continue
        stiffness = stiffness_that_holds(energy, contact.barrier_distance)
        distance = contact.barrier_distance * math.sqrt(energy / held)
        yield Finding(
            kind="impact",
            where=what,
            before="contact: ",
            after=f" meets a plane at {speed:.3g} m/s with {energy:.3g} J per metre of contact, more than the "
            f"barrier holds ({held:.3g} J/m down to a tenth of its distance): its rebound would be unresolved; "
            f"stiffness {stiffness:.0e} Pa or barrier_distance {1e3 * distance:.2g} mm holds it, and "
            f"impact_speed {speed:.3g} m/s has the model take such a stiffness",
            severity=energy / held,
        )


def stiffness_for_impacts(model: Model) -> float:
    """Return K_c [Pa] of the scene, or what its `contact.impact_speed` needs if that is more; 0 without contact."""
    contact = model.scene.contact
    if contact is None:
        return 0.0
    if contact.impact_speed is None:
        return contact.stiffness
    energy = 0.5 * heaviest(model) * contact.impact_speed**2
    return max(contact.stiffness, stiffness_that_holds(energy, contact.barrier_distance))


def reason_of_stiffness(model: Model) -> dict[str, str]:
    """Return why `contact_stiffness` is what it is, where that is not the scene's own."""
    contact = model.scene.contact
    if contact is None or model.contact_stiffness == contact.stiffness:
        return {}
    why = f"not {contact.stiffness:.3g} Pa, to hold impacts at `contact.impact_speed`, {contact.impact_speed:g} m/s"
    return {"contact_stiffness": why}


def _approaching(model: Model) -> Iterator[tuple[str, float, float, float]]:
    """Return the name, mass [kg], length of contact [m] and speed towards the nearest plane of free bodies and rods
    [m/s].
    """
    bodies, free, points, start = model.bodies, model.free_bodies, model.surfaces, initial_state(model)
    if not model.has_surface_contact:
        return
    for slot, body in enumerate(free.body_of_free):
        own = np.flatnonzero(points.contact_point_body == body)
        if own.size:
            positions = (
                bodies.start_position[body]
                + points.point_position[own - model.node_count] @ bodies.start_rotation[body].T
            )
            speed = _speed(model, positions, points.radius[own], start.body_velocity[body])
            yield f"body {bodies.names[body]!r}", float(free.mass[slot]), float(points.weight[own].max()), speed
    for strand in model.strands:
        nodes = strand.first_node + np.arange(strand.node_count)
        if not np.isin(nodes, model.constrained.node).any():
            mass, length = model.rods.node_mass[nodes].sum(), model.node_length[nodes].sum()
            velocity = model.rods.node_mass[nodes] @ start.velocity[nodes] / mass
            speed = _speed(model, model.start_position[nodes], points.radius[nodes], velocity)
            yield f"rod {strand.name!r}", float(mass), float(length), speed


def _speed(model: Model, positions: Array, radius: Array, velocity: Array) -> float:
    """Return the largest speed along a plane's normal with which points meet it [m/s]."""
    surfaces, gravity, largest = model.surfaces, np.array(model.scene.gravity), 0.0
    for s in np.flatnonzero((surfaces.kind == PLANE) & (surfaces.body == len(model.bodies.names))):
        normal = surfaces.rotation[s][:, 2]
        gap = float(((positions - surfaces.position[s]) @ normal - radius).min())
        if gap > 0.0:
            fall = 2.0 * max(-float(gravity @ normal), 0.0) * gap
            largest = max(largest, math.sqrt(max(-float(velocity @ normal), 0.0) ** 2 + fall))
    return largest
