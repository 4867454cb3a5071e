"""A trial configuration within a step, and how a Newton step moves it."""

from __future__ import annotations

import numpy as np

from ..jit import kernel
from ..kinematics.frames import edge_geometry, planar_frames, transport_directors
from ..kinematics.rotation import rotation_matrix
from ..model.model import Model
from ..model.state import State

Array = np.ndarray


@kernel
def take_step(step, alpha, node_unknown, edge_unknown, position, turn, position_out, angle_out, turn_out):
    """x + α δx of nodes, α δθ of edges and their turn since the start of the step."""
    for i in range(node_unknown.shape[0]):
        d = node_unknown[i]
        for c in range(3):
            position_out[i, c] = position[i, c] + alpha * step[d + c]
    for k in range(edge_unknown.shape[0]):
        angle = alpha * step[edge_unknown[k]]
        angle_out[k] = angle
        turn_out[k] = turn[k] + angle


@kernel
def second_director(tangent, director1, director2_out):
    """m2 = t × m1."""
    for k in range(tangent.shape[0]):
        director2_out[k, 0] = tangent[k, 1] * director1[k, 2] - tangent[k, 2] * director1[k, 1]
        director2_out[k, 1] = tangent[k, 2] * director1[k, 0] - tangent[k, 0] * director1[k, 2]
        director2_out[k, 2] = tangent[k, 0] * director1[k, 1] - tangent[k, 1] * director1[k, 0]


@kernel
def carry_points(body, local, position, rotation, arm_out, place_out):
    """X + R r of points r of bodies, and the arms R r [m]."""
    for k in range(body.shape[0]):
        b = body[k]
        for i in range(3):
            arm = rotation[b, i, 0] * local[k, 0] + rotation[b, i, 1] * local[k, 1] + rotation[b, i, 2] * local[k, 2]
            arm_out[k, i] = arm
            place_out[k, i] = position[b, i] + arm


@kernel
def carry_walls(body, local_tangent, local_director1, rotation, first, tangent, director1, director2):
    """t and m1 of walls, edges from `first` on, turned with their bodies, and m2 = t × m1."""
    for k in range(body.shape[0]):
        b, w = body[k], first + k
        for i in range(3):
            tangent[w, i] = director1[w, i] = 0.0
            for j in range(3):
                tangent[w, i] += rotation[b, i, j] * local_tangent[k, j]
                director1[w, i] += rotation[b, i, j] * local_director1[w, j]
        director2[w, 0] = tangent[w, 1] * director1[w, 2] - tangent[w, 2] * director1[w, 1]
        director2[w, 1] = tangent[w, 2] * director1[w, 0] - tangent[w, 0] * director1[w, 2]
        director2[w, 2] = tangent[w, 0] * director1[w, 1] - tangent[w, 1] * director1[w, 0]


@kernel
def carry_turns(body, local, rotation, turn_out):
    """R L of matrices L of bodies."""
    for k in range(body.shape[0]):
        b = body[k]
        for i in range(3):
            for j in range(3):
                total = 0.0
                for m in range(3):
                    total += rotation[b, i, m] * local[k, m, j]
                turn_out[k, i, j] = total


class Configuration:
    """Positions, frames and bodies at one point of a Newton iteration.

    Attributes
    ----------
    carrier : Array
        Positions of all carriers [m]; its first rows, `position`, are the nodes, shape (n_carrier, 3).
    length, tangent, director1, director2 : Array
        Of edges and walls [m, unit].
    turn : Array
        Angle of each edge about its tangent since the start of the step [rad], shape (n_edge,).
    joint_strain : Array
        κ₁ κ₂ ψ of joints [rad], shape (n_joint, 3); the third column is the unwrapped twist.
    body_position, body_rotation : Array
        Of free bodies, shapes (n_free, 3), (n_free, 3, 3).
    place, rotation : Array
        Of all bodies and last of the world, shapes (n_body + 1, 3), (n_body + 1, 3, 3).
    surface_place, surface_turn : Array
        Positions [m] and axes of surfaces, shapes (n_surface, 3), (n_surface, 3, 3).
    arm : Array
        From the position of its body to each attached node [m], shape (n_attached, 3).
    arrays : tuple of Array
        All of them and scratch, in the order of `march.step_groups.Place`.
    """

    def __init__(self, model: Model):
        self._model = model
        edges = model.edge_count + model.wall_count
        carriers, surfaces, bodies = model.carriers, model.surfaces, len(model.bodies.names)
        self._prescribed = np.flatnonzero(model.bodies.free_index[:bodies] < 0)
        self.carrier = np.zeros((len(carriers.weight), 3))
        self.position = self.carrier[: model.node_count]
        self._point = self.carrier[model.node_count :]
        self._point_body = carriers.body[model.node_count :]
        self._point_arm = np.zeros_like(self._point)
        self.length = np.ones(edges)
        self.tangent = np.zeros((edges, 3))
        self.director1 = np.zeros((edges, 3))
        self.director2 = np.zeros((edges, 3))
        self.turn = np.zeros(model.edge_count)
        self.joint_strain = np.zeros((len(model.joint_a), 3))
        self.body_position = np.zeros((model.free_count, 3))
        self.body_rotation = np.zeros((model.free_count, 3, 3))
        self.place = np.zeros((bodies + 1, 3))
        self.rotation = np.tile(np.eye(3), (bodies + 1, 1, 1))
        self.surface_place = np.zeros((len(surfaces.kind), 3))
        self._surface_arm = np.zeros_like(self.surface_place)
        self.surface_turn = np.zeros((len(surfaces.kind), 3, 3))
        self.arm = np.zeros((len(model.attached_node), 3))
        self._held = np.zeros_like(self.arm)
        self._angle = np.zeros(model.edge_count)
        self.arrays = (
            self.carrier,
            self.position,
            self._point,
            self.length,
            self.tangent,
            self.director1,
            self.director2,
            self.turn,
            self._angle,
            self.joint_strain,
            self.body_position,
            self.body_rotation,
            self.place,
            self.rotation,
            self.surface_place,
            self.surface_turn,
            self.arm,
            self._held,
            self._point_arm,
            self._surface_arm,
            np.zeros_like(self.position),
            np.zeros_like(self.body_position),
            np.zeros_like(self.body_position),
        )
        self._surfaces_move = bool((surfaces.body < bodies).any())
        if not self._surfaces_move:
            self.surface_place[:], self._surface_arm[:], self.surface_turn[:] = (
                surfaces.position,
                surfaces.position,
                surfaces.turn,
            )

    def take_state(self, state: State) -> None:
        """Start from a state."""
        model = self._model
        self.position[:] = state.position
        self.director1[: model.edge_count] = state.director1
        self.turn[:] = 0.0
        self.joint_strain[:, 2] = state.twist
        self.body_position[:] = state.body_position[model.bodies.body_of_free]
        self.body_rotation[:] = state.body_rotation[model.bodies.body_of_free]
        self.place_prescribed(state.body_position, state.body_rotation)
        self.place_held()
        edge_geometry(self.position, model.edge_node, self.length, self.tangent)
        second_director(self.tangent, self.director1, self.director2)

    def place_prescribed(self, position: Array, rotation: Array) -> None:
        """Take the poses of prescribed bodies from those of all, shapes (n_body, 3), (n_body, 3, 3)."""
        self.place[self._prescribed] = position[self._prescribed]
        self.rotation[self._prescribed] = rotation[self._prescribed]

    def place_held(self) -> None:
        """Put what bodies carry to where these are: nodes, clamps' directions, points, surfaces."""
        model = self._model
        if not model.bodies.names:
            return
        free = model.bodies.body_of_free
        self.place[free] = self.body_position
        self.rotation[free] = self.body_rotation
        if len(self.arm):
            held = (model.attached_body, model.attached_position, self.place, self.rotation)
            carry_points(*held, self.arm, self._held)
            self.position[model.attached_node] = self._held
            walls = (model.wall_body, model.wall_tangent, model.start_director1, self.rotation, model.edge_count)
            carry_walls(*walls, self.tangent, self.director1, self.director2)
        if len(self._point):
            points = (self._point_body, model.carriers.position, self.place, self.rotation)
            carry_points(*points, self._point_arm, self._point)
        if self._surfaces_move:
            self._place_surfaces()

    def _place_surfaces(self) -> None:
        surfaces = self._model.surfaces
        owned = (surfaces.body, surfaces.position, self.place, self.rotation)
        carry_points(*owned, self._surface_arm, self.surface_place)
        carry_turns(surfaces.body, surfaces.turn, self.rotation, self.surface_turn)

    def set_moved(self, base: Configuration, step: Array, body_step: Array, alpha: float) -> None:
        """Become `base` moved by α times a step of the unknowns, shape (size,), and of free bodies, shape (n_free,
        6).
        """
        model = self._model
        layout = model.layout
        self.place[self._prescribed] = base.place[self._prescribed]
        self.rotation[self._prescribed] = base.rotation[self._prescribed]
        take_step(
            step, alpha, layout.node, layout.edge, base.position, base.turn, self.position, self._angle, self.turn
        )
        for b in range(model.free_count):
            self.body_position[b] = base.body_position[b] + alpha * body_step[b, :3]
            self.body_rotation[b] = rotation_matrix(alpha * body_step[b, 3:]) @ base.body_rotation[b]
        self.place_held()
        self.carry_frames(base, self._angle)

    def carry_frames(self, base: Configuration, angle: Array) -> None:
        """Frames of `base`, carried to the present positions and turned by `angle` [rad]; in a plane they are those of
        the positions alone.
        """
        model, plane = self._model, self._model.plane
        if plane is not None:
            own = (self.length, self.tangent, self.director1, self.director2)
            planar_frames(self.position, model.edge_node, plane.normal, plane.side, *own)
            return
        edge_geometry(self.position, model.edge_node, self.length, self.tangent)
        transport_directors(
            model.edge_count,
            base.tangent,
            base.director1,
            base.director2,
            angle,
            self.tangent,
            self.director1,
            self.director2,
        )
