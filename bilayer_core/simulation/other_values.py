"""Other values of a scene, with which its present state goes on.

The curve of a strip is where its section pulls without bending, that of one of two rods is its middle. Where other
values move a curve by s along m1, its nodes move by as much, and what the curve belongs to stays where it is:

    x' = x + s m1,   v' = v + s ṁ1,   m1 the mean of those of the edges beside a node.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.model.model import Model
from bilayer_core.model.state import PARTS, State, turn_directors, turning
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.loader import scene_content
from bilayer_core.simulation.gradients.nearby import carry_directors, tangents_of

Array = np.ndarray
FREE = ("materials", "gravity", "damping")
"""Parts of a scene that may change."""
SECTIONS = ("width", "radius", "inner_radius", "layers")
"""And those of its rods."""
ALLOWED = "allowed are materials, layers and sections of rods, gravity and damping"
ANEW = {"account", "law_force", "touched", "strain_rate", "strain_acceleration", "fluid_excess", "fluid_force"}
"""Parts of a state that follow from others, or nearly so: they may have other sizes."""


def state_with(model: Model, other: Model, state: State, start: State) -> State:
    """Return a state of a model as one of another, of which it takes one.

    Raises
    ------
    InputError
        If it has no meaning there.
    """
    before, after = (_lasting(of.scene) for of in (model, other))
    differ = [part for part, value in before.items() if value != after[part]]
    if differ:
        raise InputError(f"set_values: {', '.join(differ)} would change; {ALLOWED}; else make a new Simulator")
    if not np.array_equal(model.drives.field_channel, other.drives.field_channel):
        raise InputError(f"set_values: layers would follow other stimuli; {ALLOWED}; else make a new Simulator")
    if model.strain_count != other.strain_count:
        raise InputError("set_values: retardation_time: rods would get or lose viscosity; make a new Simulator")
    found = start.copy()
    for name in PARTS:
        mine, part = getattr(found, name), getattr(state, name)
        if mine.shape == part.shape:
            mine[...] = part
        elif name not in ANEW:
            raise InputError(f"set_values: {name} would have other sizes; {ALLOWED}; else make a new Simulator")
    found.fingerprint[:], found.conditions[:] = start.fingerprint, start.conditions
    found.has_history.fill(0.0)  # accelerations jump
    if model.kept_directors != other.kept_directors:
        lasting = state.strain_rate.size - 3 * model.kept_directors
        found.strain_rate[:lasting] = state.strain_rate[:lasting]
        turn_directors(other, found)
    _move_curves(model, other, found)
    return found


def _lasting(scene: SceneConfig) -> dict[str, Any]:
    """Return the content of a scene that may not change, by part."""
    content = scene_content(scene)
    rods = [{key: value for key, value in rod.items() if key not in SECTIONS} for rod in content["rods"]]
    return {part: value for part, value in content.items() if part not in FREE} | {"rods": rods}


def _move_curves(model: Model, other: Model, state: State) -> None:
    """Let curves lie in their sections where those of another model do."""
    normals = _mean(model, model.start_director1)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    moved = np.einsum("ik,ik->i", other.start_position - model.start_position, normals / lengths)[:, None]
    if not moved.any():
        return
    before = state.position.copy()
    normals, turned = _mean(model, state.director1), _mean(model, turning(model, state))
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    unit = normals / lengths
    state.position += moved * unit
    state.velocity += moved * (turned - np.einsum("ik,ik->i", turned, unit)[:, None] * unit) / lengths
    held = other.constrained
    arms = np.einsum("nij,nj->ni", state.body_rotation[held.body], held.position)
    state.position[held.node] = state.body_position[held.body] + arms
    carry_directors(model, before, state)
    if "viscosity" in other.forces:
        first = model.rods.edge_node
        lengthened = state.velocity[first + 1] - state.velocity[first]
        along = np.einsum("ek,ek->e", tangents_of(first, state.position), lengthened)
        state.strain_rate[: len(first)] = along / other.rods.rest_length


def _mean(model: Model, of_edges: Array) -> Array:
    """Return the mean of what the edges beside each node have, shape (n_node, 3)."""
    once = np.setdiff1d(np.arange(model.rods.edge_count), model.joined_edge[:, 1])
    first = model.rods.edge_node[once]
    total, count = np.zeros((model.node_count, 3)), np.zeros((model.node_count, 1))
    for node in (first, first + 1):
        total[node] += of_edges[once]
        count[node] += 1.0
    for pair in model.joined_node:
        total[pair], count[pair] = total[pair].sum(axis=0), count[pair].sum()
    return total / count
