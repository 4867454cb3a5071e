"""Descriptions, and what observers see of a run that needs no look at forces."""

from __future__ import annotations

from functools import cache

import numpy as np

from bilayer_core.kinematics.rotation import quaternion_from_matrix
from bilayer_core.model.force_list import Kind, kinds
from bilayer_core.model.force_slots import slot_of
from bilayer_core.model.model import Model
from bilayer_core.model.plan import Plan
from bilayer_core.model.shape_numbers import Shape, obstacle_pose, shape_of
from bilayer_core.model.state import State
from bilayer_core.model.strand_arrays import StrandArrays
from bilayer_core.observed.frame import BodyInfo, Description, ObstacleInfo, ShapeInfo, Strand
from bilayer_core.observed.system import versions
from bilayer_core.scene.loader import scene_text
from bilayer_core.simulation.joint_shapes import joint_shapes
from bilayer_core.simulation.parts import Parts
from bilayer_core.simulation.step_choice import Steps

Array = np.ndarray


def describe(
    model: Model, state: State, plan: Plan, steps: Steps, contact_pairs: tuple[tuple[str, str], ...]
) -> Description:
    """Return the description of a run for observers: everything that does not change while it lasts."""
    scene = model.scene
    bodies = model.bodies
    settings = {
        "model": plan.model,
        "dimension": str(plan.dimension),
        "integrator": plan.integrator,
        "dt": repr(steps.dt),
        "tolerance": "none" if steps.tolerance is None else repr(steps.tolerance),
        "newton_tolerance": repr(steps.newton_tolerance),
        **versions(),
    }
    return Description(
        scene_name=scene.name,
        title=scene.title,
        scene_text=scene_text(scene),
        node_count=model.node_count + model.point_count,
        edge_count=model.rods.edge_count,
        strands=tuple(map(strand, model.strands)),
        bodies=tuple(
            BodyInfo(name, _shape_info(shape) if shape else None, bool(free < 0), index in model.constrained.body)
            for index, (name, shape, free) in enumerate(
                zip(bodies.names, bodies.shapes, model.free_bodies.free_index, strict=False)
            )
        ),
        obstacles=tuple(
            ObstacleInfo(part.name, _shape_info(shape_of(part), *obstacle_pose(part))) for part in scene.obstacles
        ),
        channels=tuple(scene.stimuli),
        channel_ranges=tuple((channel.minimum, channel.maximum) for channel in scene.stimuli.values()),
        channel_units=tuple("" if channel.unit == "1" else channel.unit for channel in scene.stimuli.values()),
        state_layout=state.layout(),
        settings=settings,
        joints=joint_shapes(model),
        contact_pairs=contact_pairs,
        joint_figures=(
            *(f"joint/{joint.name}/wrench" for joint in scene.joints),
            *(
                f"{'body' if m.is_guide else 'joint'}/{m.owner}/{'travel' if m.slides else 'angle'}"
                for m in model.mechanisms
            ),
        ),
    )


def strand(s: StrandArrays) -> Strand:
    """Return the description of a strand for observers."""
    return Strand(
        s.name,
        s.rod,
        s.layer,
        slice(s.first_node, s.first_node + s.shown),
        slice(s.first_edge, s.first_edge + s.shown - 1),
        *(part[: s.shown] for part in (s.width, s.thickness, s.offset, s.curvature)),
        tuple(map(strand, s.layers)),
        s.closed,
        s.round,
        s.strip,
        s.first_station,
    )


def _shape_info(shape: Shape, position: Array | None = None, rotation: Array | None = None) -> ShapeInfo:
    """Return a shape of an owner at a pose, by default in the owner's frame."""
    place = (0.0, 0.0, 0.0) if position is None else tuple(position.tolist())
    rotation = shape.rotation if rotation is None else rotation @ shape.rotation
    rounding = 0.0 if shape.kind == "sphere" else shape.rounding
    size, quaternion = (2.0 * shape.half).tolist(), quaternion_from_matrix(rotation).tolist()
    return ShapeInfo(shape.kind, tuple(size), rounding, place, tuple(quaternion))


def positions_with_points(model: Model, state: State) -> Array:
    """Return the positions of nodes, then of contact points of bodies [m], shape (n_node + n_point, 3)."""
    if not model.point_count:
        return state.position.copy()
    body, arms = _points(model, state)
    return np.concatenate([state.position, state.body_position[body] + arms])


def velocities_with_points(model: Model, state: State) -> Array:
    """Return the velocities of nodes, then of contact points of bodies [m/s], shape (n_node + n_point, 3)."""
    if not model.point_count:
        return state.velocity.copy()
    body, arms = _points(model, state)
    points = state.body_velocity[body] + np.cross(state.body_angular_velocity[body], arms)
    return np.concatenate([state.velocity, points])


def _points(model: Model, state: State) -> tuple[Array, Array]:
    """Return the body of each point, shape (n_point,), and its arm from the body's position [m], shape (n_point, 3)."""
    body = model.surfaces.point_body[: model.point_count]
    arms = np.einsum("kij,kj->ki", state.body_rotation[body], model.surfaces.point_position[: model.point_count])
    return body, arms


def energies(model: Model, seen: Parts) -> dict[str, float]:
    """Return the kinetic energies, and that of each conservative term, of a state that was looked at [J]."""
    kinetic, of_fluid = seen.kinetic.tolist()
    found = {"kinetic": kinetic, "fluid": of_fluid} if model.fluid.exists else {"kinetic": kinetic}
    values = seen.energy.tolist()
    return found | {name: values[place] for name, place in _conservative(model.forces)}


@cache
def _conservative(forces: tuple[str, ...]) -> tuple[tuple[str, int], ...]:
    """Return those of some forces that are conservative, with their slots."""
    kind = kinds()
    return tuple((name, slot_of(name)) for name in forces if kind[name] is Kind.CONSERVATIVE)
