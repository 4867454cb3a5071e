"""Descriptions, and what is derived of the last evaluation: what observers see of a run."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from ..kinematics.rotation import quaternion_from_matrix
from ..model.model import Model
from ..model.shapes import Shape, obstacle_pose, shape_of
from ..model.state import State
from ..model.strand_arrays import StrandArrays
from ..observed.frame import BodyInfo, Description, ObstacleInfo, ShapeInfo, Strand
from .fluid_energy import energy_of_fluid
from .frame_tables import FrameTables
from .joint_shapes import joint_shapes
from .kinetic_energy import kinetic_energy

Array = np.ndarray


def describe(model: Model, state: State, settings: dict[str, str], scene_text: str) -> Description:
    """The unchanging part of what observers see."""
    scene = model.scene
    bodies = model.bodies
    return Description(
        scene_name=scene.name,
        title=scene.title,
        scene_text=scene_text,
        node_count=model.node_count + model.point_count,
        edge_count=model.edge_count,
        strands=tuple(map(strand, model.strands)),
        bodies=tuple(
            BodyInfo(name, _shape_info(shape) if shape else None, bool(free < 0), index in model.attached_body)
            for index, (name, shape, free) in enumerate(
                zip(bodies.names, bodies.shapes, bodies.free_index, strict=False)
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
    )


def strand(s: StrandArrays) -> Strand:
    """What is told of a strand."""
    return Strand(
        s.name,
        s.rod,
        s.layer,
        slice(s.first_node, s.first_node + s.shown),
        slice(s.first_edge, s.first_edge + s.shown - 1),
        *(part[: s.shown] for part in (s.width, s.thickness, s.offset, s.curvature)),
        tuple(map(strand, s.layers)),
        s.closed,
    )


def _shape_info(shape: Shape, position: Array | None = None, rotation: Array | None = None) -> ShapeInfo:
    """A shape of an owner at a pose, by default that of the owner's frame."""
    place = (0.0, 0.0, 0.0) if position is None else tuple(position.tolist())
    rotation = shape.rotation if rotation is None else rotation @ shape.rotation
    rounding = 0.0 if shape.kind == "sphere" else shape.rounding
    size, quaternion = (2.0 * shape.half).tolist(), quaternion_from_matrix(rotation).tolist()
    return ShapeInfo(shape.kind, tuple(size), rounding, place, tuple(quaternion))


def positions_with_points(model: Model, state: State) -> Array:
    """Positions of nodes, then of contact points of bodies [m], shape (n_node + n_point, 3)."""
    if not model.point_count:
        return state.position.copy()
    body, arms = _points(model, state)
    return np.concatenate([state.position, state.body_position[body] + arms])


def velocities_with_points(model: Model, state: State) -> Array:
    """Their velocities [m/s], shape (n_node + n_point, 3)."""
    if not model.point_count:
        return state.velocity.copy()
    body, arms = _points(model, state)
    points = state.body_velocity[body] + np.cross(state.body_angular_velocity[body], arms)
    return np.concatenate([state.velocity, points])


def _points(model: Model, state: State) -> tuple[Array, Array]:
    """Body of each point, shape (n_point,), and its arm from the body's position [m], shape (n_point, 3)."""
    body = model.contact_points.body[model.node_count : model.node_count + model.point_count]
    arms = np.einsum("kij,kj->ki", state.body_rotation[body], model.contact_points.position[: model.point_count])
    return body, arms


class Sources(Protocol):
    """Where the functions below find the last evaluation: a stepper, or copies of what it left (`capture`)."""

    @property
    def model(self) -> Model: ...

    @property
    def tables(self) -> FrameTables: ...

    @property
    def end(self) -> Any:
        """The configuration."""

    @property
    def engine(self) -> Any:
        """What forces left there: `sums`, `joints` and `mechanisms`."""


def contact_forces(of: Sources) -> Array:
    """Barrier and friction force on nodes and contact points [N], shape (n_node + n_point, 3)."""
    return -of.engine.sums.contact_point[: of.model.node_count + of.model.point_count]


def between_bodies(of: Sources) -> list[Any]:
    """Joints and mechanisms, as far as there are any: what exerts forces on bodies beside contact."""
    engine, tables = of.engine, of.tables
    joints = [engine.joints] if tables.has_joints else []
    return [*joints, engine.mechanisms] if tables.has_mechanisms else joints


def contact_wrenches(of: Sources) -> Array:
    """Contact force [N] and moment about its position [N m] on every body, shape (n_body, 6)."""
    wrenches = -of.engine.sums.contact
    for own in between_bodies(of):  # they are in these sums too
        np.add.at(wrenches, own.body, own.gradient)
    return wrenches[:-1]


def clamp_wrenches(of: Sources) -> Array:
    """Force [N] and moment about its position [N m] that the rods which a body holds exert on it, shape (n_body, 6).

    They are −∂Φ/∂X and −∂Φ/∂φ of the potential Φ of the step through the nodes x = X + ρ and the fixed directions t
    that bodies hold (`engine.linear.attachments`): with the gradients g of a node and (g, g_θ) of a clamp edge

        F = −Σ g,    M = −Σ ρ × g − Σ (t × g + g_θ t)

    Φ has all that acts on what is held: elasticity, weight and inertia of half an edge, contact, drag, damping.
    """
    return sum_of_clamps(of.model, each_clamp(of))


def each_clamp(of: Sources) -> Array:
    """The part of each held node with its direction in `clamp_wrenches`, shape (n_attached, 6)."""
    sums, at = of.engine.sums, of.end
    force, edges = -sums.attached, slice(of.model.edge_count, None)
    tangent, of_edge = at.tangent[edges], -sums.edge[edges]
    wrench = np.empty((len(force), 6))
    wrench[:, :3] = force
    wrench[:, 3:] = _cross(at.arm, force) + _cross(tangent, of_edge[:, :3]) + of_edge[:, 3:] * tangent
    return wrench


def _cross(a: Array, b: Array) -> Array:
    """Products a × b of rows, shape (n, 3); for few of them in a third of the time of numpy's."""
    (x, y, z), (u, v, w) = a.T, b.T
    product = np.empty(a.shape)
    product[:, 0], product[:, 1], product[:, 2] = y * w - z * v, z * u - x * w, x * v - y * u
    return product


def sum_of_clamps(model: Model, wrenches: Array) -> Array:
    """Of each body, shape (n_body, 6)."""
    total = np.zeros((len(model.bodies.names), 6))
    np.add.at(total, model.attached_body, wrenches)
    return total


def node_strain(model: Model, of: Sources) -> Array:
    """Axial strain of nodes, the mean of their edges' (eigenstrain included); 0 at contact points, shape (n_node +
    n_point,).
    """
    tables, strain = of.tables, np.zeros(model.node_count + model.point_count)
    edge = of.end.length[: model.edge_count] / model.rest_length - 1.0
    strain[tables.nodes] = 0.5 * (edge[tables.before] + edge[tables.after])
    strain[tables.shut] = strain[tables.twin]
    return strain


def node_curvature(model: Model, of: Sources) -> Array:
    """Curvature χ at nodes [1/m]; a free end has no bending element and takes its neighbour's, shape (n_node +
    n_point,).
    """
    tables, curvature = of.tables, np.zeros(model.node_count + model.point_count)
    at = of.end  # strains were last evaluated before Newton's last step
    a, b = tables.joint_a, tables.joint_b
    tangent_a, tangent_b = at.tangent.take(a, axis=0), at.tangent.take(b, axis=0)
    bend = np.einsum("ki,ki->k", tangent_b, at.director1.take(a, axis=0))
    bend -= np.einsum("ki,ki->k", tangent_a, at.director1.take(b, axis=0))
    bend /= 1.0 + np.einsum("ki,ki->k", tangent_a, tangent_b)  # κ₁ of `forces.bend_twist`
    curvature[tables.joint_node] = bend / model.voronoi_length
    curvature[tables.end] = curvature[tables.neighbour]
    curvature[tables.shut] = curvature[tables.twin]
    return curvature


def energies(of: Sources, state: State, of_fluid: float | None = None) -> dict[str, float]:
    """Kinetic energies, and that of each conservative term, of the last accepted configuration [J]; that of the fluid
    is computed from it, unless it is given.
    """
    model, found = of.model, {"kinetic": kinetic_energy(of.model, state)}
    if len(model.fluid_mass):
        at_hand = of_fluid is not None
        found["fluid"] = of_fluid if at_hand else energy_of_fluid(model, of.end, state.velocity, state.spin)
    values = of.engine.sums.energy.tolist()
    return found | {name: values[place] for name, place in of.tables.energies}
