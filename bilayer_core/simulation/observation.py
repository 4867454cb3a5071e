"""Frames and descriptions: what observers see of a run."""

from __future__ import annotations

import platform
from functools import cache

import numpy as np

from ..kinematics.rotation import quaternion_from_matrix
from ..model.model import Model
from ..model.shapes import Shape, obstacle_pose, shape_of
from ..model.state import State
from ..model.strand_arrays import StrandArrays
from .fluid_energy import energy_of_fluid
from .frame import BodyInfo, Description, Frame, ObstacleInfo, ShapeInfo, Strand
from .joint_shapes import joint_shapes
from .kinetic_energy import kinetic_energy
from .statistics import RunStatistics, center_of_mass
from .stepper import Stepper

Array = np.ndarray


def versions() -> dict[str, str]:
    """Versions of this package and of what its results depend on."""
    import numba
    import scipy

    from bilayer_core import __version__

    return {
        "bilayer_sim_ros": __version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "numba": numba.__version__,
    }


def machine() -> dict[str, str]:
    """What results depend on to the last bit, beside versions."""
    return {"system": platform.system(), "machine": platform.machine(), "processor": _processor()}


@cache
def _processor() -> str:
    """Name of the processor's model, as far as the system tells it."""
    from llvmlite import binding

    return str(binding.get_host_cpu_name())


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
    body, arms = _points(model, state)
    return np.concatenate([state.position, state.body_position[body] + arms])


def velocities_with_points(model: Model, state: State) -> Array:
    """Their velocities [m/s], shape (n_node + n_point, 3)."""
    body, arms = _points(model, state)
    points = state.body_velocity[body] + np.cross(state.body_angular_velocity[body], arms)
    return np.concatenate([state.velocity, points])


def _points(model: Model, state: State) -> tuple[Array, Array]:
    """Body of each point, shape (n_point,), and its arm from the body's position [m], shape (n_point, 3)."""
    body = model.contact_points.body[model.node_count : model.node_count + model.point_count]
    arms = np.einsum("kij,kj->ki", state.body_rotation[body], model.contact_points.position[: model.point_count])
    return body, arms


def contact_forces(stepper: Stepper) -> Array:
    """Barrier and friction force on nodes and contact points [N], shape (n_node + n_point, 3)."""
    model = stepper.model
    return -stepper.engine.sums.contact_point[: model.node_count + model.point_count]


def contact_wrenches(stepper: Stepper) -> Array:
    """Contact force [N] and moment about its position [N m] on every body, shape (n_body, 6)."""
    wrenches = -stepper.engine.sums.contact
    for joints in (stepper.engine.joints, stepper.engine.mechanisms):
        if joints.exists:  # they are in these sums too
            np.add.at(wrenches, joints.body, joints.gradient)
    return wrenches[:-1]


def clamp_wrenches(stepper: Stepper) -> Array:
    """Force [N] and moment about its position [N m] that the rods which a body holds exert on it, shape (n_body, 6).

    They are −∂Φ/∂X and −∂Φ/∂φ of the potential Φ of the step through the nodes x = X + ρ and the fixed directions t
    that bodies hold (`engine.linear.attachments`): with the gradients g of a node and (g, g_θ) of a clamp edge

        F = −Σ g,    M = −Σ ρ × g − Σ (t × g + g_θ t)

    Φ has all that acts on what is held: elasticity, weight and inertia of half an edge, contact, drag, damping.
    """
    return sum_of_clamps(stepper.model, each_clamp(stepper))


def each_clamp(stepper: Stepper) -> Array:
    """The part of each held node with its direction in `clamp_wrenches`, shape (n_attached, 6)."""
    model, sums, at = stepper.model, stepper.engine.sums, stepper.end
    force, edges = -sums.attached, slice(model.edge_count, None)
    tangent, of_edge = at.tangent[edges], -sums.edge[edges]
    moment = np.cross(at.arm, force) + np.cross(tangent, of_edge[:, :3]) + of_edge[:, 3:] * tangent
    return np.hstack([force, moment])


def sum_of_clamps(model: Model, wrenches: Array) -> Array:
    """Of each body, shape (n_body, 6)."""
    total = np.zeros((len(model.bodies.names), 6))
    np.add.at(total, model.attached_body, wrenches)
    return total


def node_strain(model: Model, stepper: Stepper) -> Array:
    """Axial strain of nodes, the mean of their edges' (eigenstrain included); 0 at contact points, shape (n_node +
    n_point,).
    """
    strain = np.zeros(model.node_count + model.point_count)
    edge = stepper.end.length[: model.edge_count] / model.rest_length - 1.0
    for s in model.strands:
        own = edge[s.first_edge : s.first_edge + s.node_count - 1]
        nodes = strain[s.first_node : s.first_node + s.node_count]
        nodes[0], nodes[-1] = own[0], own[-1]
        nodes[1:-1] = 0.5 * (own[:-1] + own[1:])
    _copy_closed(model, strain)
    return strain


def node_curvature(model: Model, stepper: Stepper) -> Array:
    """Curvature χ at nodes [1/m]; a free end has no bending element and takes its neighbour's, shape (n_node +
    n_point,).
    """
    curvature = np.zeros(model.node_count + model.point_count)
    bends, at = slice(model.bend_count), stepper.end
    a, b = model.joint_a[bends], model.joint_b[bends]
    tangents, directors = at.tangent, at.director1  # of the end; strains were last evaluated before Newton's last step
    bend = np.einsum("ki,ki->k", tangents[b], directors[a]) - np.einsum("ki,ki->k", tangents[a], directors[b])
    bend /= 1.0 + np.einsum("ki,ki->k", tangents[a], tangents[b])  # κ₁ of `forces.bend_twist`
    curvature[model.joint_node[bends]] = bend / model.voronoi_length
    for s in model.strands:
        first, last = s.first_node, s.first_node + s.node_count - 1
        for end, neighbour in ((first, first + 1), (last, last - 1)):
            if end not in model.attached_node:
                curvature[end] = curvature[neighbour]
    _copy_closed(model, curvature)
    return curvature


def _copy_closed(model: Model, of_nodes: Array) -> None:
    """Give the first and the last node of closed strands in memory what those have that they stand for."""
    for s in model.strands:
        if s.closed:
            own = of_nodes[s.first_node : s.first_node + s.node_count]
            own[0], own[-1] = own[-2], own[1]


def energies(stepper: Stepper, state: State) -> dict[str, float]:
    """Kinetic energies, and that of each conservative term, of the last accepted configuration [J]."""
    model = stepper.model
    kinetic = {"kinetic": kinetic_energy(model, state)}
    if len(model.fluid_mass):
        kinetic["fluid"] = energy_of_fluid(model, stepper.end, state.velocity, state.spin)
    return {**kinetic, **stepper.engine.energies}


def make_frame(stepper: Stepper, state: State, time: float, statistics: RunStatistics, cpu_time: float) -> Frame:
    """Snapshot of the last accepted configuration."""
    model = stepper.model
    stepper.engine.evaluate_end()
    return Frame(
        time=time,
        step=int(state.step[0]),
        positions=positions_with_points(model, state),
        velocities=velocities_with_points(model, state),
        directors=state.director1.copy(),
        strain=node_strain(model, stepper),
        curvature=node_curvature(model, stepper),
        contact_forces=contact_forces(stepper),
        body_positions=state.body_position.copy(),
        body_quaternions=np.array([quaternion_from_matrix(r) for r in state.body_rotation]).reshape(-1, 4),
        body_velocities=state.body_velocity.copy(),
        body_angular_velocities=state.body_angular_velocity.copy(),
        contact_wrenches=contact_wrenches(stepper),
        clamp_wrenches=clamp_wrenches(stepper),
        com=center_of_mass(model, state),
        stimulus=stepper.stimulus.copy(),
        energy=energies(stepper, state),
        min_gap=float(stepper.engine.gap),
        iterations=statistics.iterations,
        residual=statistics.last_residual,
        substeps=statistics.substeps,
        cpu_time=cpu_time,
        state=state.flat(),
    )
