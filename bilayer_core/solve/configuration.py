"""A trial configuration within a step, and how a Newton step moves it."""

from __future__ import annotations

import numpy as np

from ..jit import kernel
from ..kinematics.frames import edge_geometry, transport_directors
from ..kinematics.rotation import rotation_matrix
from ..model.model import Model
from ..model.state import State

Array = np.ndarray


@kernel
def _take_step(step, alpha, node_unknown, edge_unknown, position, turn, position_out, angle_out, turn_out):
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
def _second_director(tangent, director1, director2_out):
    """m2 = t × m1."""
    for k in range(tangent.shape[0]):
        director2_out[k, 0] = tangent[k, 1] * director1[k, 2] - tangent[k, 2] * director1[k, 1]
        director2_out[k, 1] = tangent[k, 2] * director1[k, 0] - tangent[k, 0] * director1[k, 2]
        director2_out[k, 2] = tangent[k, 0] * director1[k, 1] - tangent[k, 1] * director1[k, 0]


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
    arm : Array
        From the position of its body to each attached node [m], shape (n_attached, 3).
    """

    def __init__(self, model: Model):
        self._model = model
        edges = model.edge_count + model.wall_count
        carriers = model.carriers
        self._first_sphere = model.node_count + model.point_count
        self._balls = np.flatnonzero(carriers.free_body >= 0)
        self._held = np.flatnonzero(model.attached_free >= 0)  # attached nodes, walls and points of free bodies
        self._walls = np.flatnonzero(model.wall_free >= 0)
        self._points = np.flatnonzero(model.bodies.free_index[carriers.point_body] >= 0)
        self.carrier = np.zeros((len(carriers.weight), 3))
        self.position = self.carrier[: model.node_count]
        self.length = np.ones(edges)
        self.tangent = np.zeros((edges, 3))
        self.director1 = np.zeros((edges, 3))
        self.director2 = np.zeros((edges, 3))
        self.turn = np.zeros(model.edge_count)
        self.joint_strain = np.zeros((len(model.joint_a), 3))
        self.body_position = np.zeros((model.free_count, 3))
        self.body_rotation = np.zeros((model.free_count, 3, 3))
        self.arm = model.attached_position.copy()
        self._angle = np.zeros(model.edge_count)
        self.tangent[model.edge_count :] = model.wall_tangent
        self.director1[model.edge_count :] = model.start_director1[model.edge_count :]
        _second_director(self.tangent, self.director1, self.director2)

    def take_state(self, state: State, body_position: Array) -> None:
        """Start from a state, with prescribed bodies at `body_position` [m], shape (n_body, 3)."""
        model = self._model
        self.position[:] = state.position
        self.director1[: model.edge_count] = state.director1
        self.turn[:] = 0.0
        self.joint_strain[:, 2] = state.twist
        self.body_position[:] = state.body_position[model.bodies.body_of_free]
        self.body_rotation[:] = state.body_rotation[model.bodies.body_of_free]
        self.place_prescribed(body_position)
        self.place_held()
        edge_geometry(self.position, model.edge_node, self.length, self.tangent)
        _second_director(self.tangent, self.director1, self.director2)

    def place_prescribed(self, body_position: Array) -> None:
        """Put contact points and spheres of prescribed bodies to where the bodies are."""
        model, carriers = self._model, self._model.carriers
        self.carrier[model.node_count : self._first_sphere] = (
            body_position[carriers.point_body] + carriers.point_position
        )
        self.carrier[self._first_sphere :] = body_position[carriers.sphere_body]

    def place_held(self) -> None:
        """Put what free bodies carry to where these are: nodes, clamps' directions, contact points, spheres."""
        model, carriers = self._model, self._model.carriers
        for carrier in self._balls:
            self.carrier[carrier] = self.body_position[carriers.free_body[carrier]]
        for k in self._held:
            free = model.attached_free[k]
            self.arm[k] = self.body_rotation[free] @ model.attached_position[k]
            self.position[model.attached_node[k]] = self.body_position[free] + self.arm[k]
        for k in self._points:
            free = model.bodies.free_index[carriers.point_body[k]]
            arm = self.body_rotation[free] @ carriers.point_position[k]
            self.carrier[model.node_count + k] = self.body_position[free] + arm
        for k in self._walls:
            wall, rotation = model.edge_count + k, self.body_rotation[model.wall_free[k]]
            self.tangent[wall] = rotation @ model.wall_tangent[k]
            self.director1[wall] = rotation @ model.start_director1[wall]
            self.director2[wall] = np.cross(self.tangent[wall], self.director1[wall])

    def set_moved(self, base: Configuration, step: Array, body_step: Array, alpha: float) -> None:
        """Become `base` moved by α times a step of the unknowns, shape (size,), and of free bodies, shape (n_free,
        6).
        """
        model = self._model
        layout = model.layout
        self.carrier[model.node_count :] = base.carrier[model.node_count :]
        _take_step(
            step, alpha, layout.node, layout.edge, base.position, base.turn, self.position, self._angle, self.turn
        )
        for b in range(model.free_count):
            self.body_position[b] = base.body_position[b] + alpha * body_step[b, :3]
            self.body_rotation[b] = rotation_matrix(alpha * body_step[b, 3:]) @ base.body_rotation[b]
        self.place_held()
        self.carry_frames(base, self._angle)

    def carry_frames(self, base: Configuration, angle: Array) -> None:
        """Frames of `base`, carried to the present positions and turned by `angle` [rad]."""
        model = self._model
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
