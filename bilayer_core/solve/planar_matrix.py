"""The Newton matrix in a plane: two unknowns a node, none an edge, three motions of a free body.

Gradients and steps of the unknowns stay vectors in space (`Model.layout`); what is solved for is their part in the
plane.
"""

from __future__ import annotations

import numpy as np

from ..jit import kernel
from ..model.model import Model
from .clamps import arm_jacobian
from .configuration import Configuration
from .newton_matrix import NewtonMatrix
from .planar_assembly import expand_in_plane, expand_pairs_in_plane, put_in_space, take_in_plane

Array = np.ndarray


@kernel
def hand_walls_to_bodies_in_plane(
    axes,
    normal,
    wall_free,
    wall_joint,
    joint_a,
    joint_b,
    edge_count,
    edge_node,
    node_unknown,
    attached_of_unknown,
    attached_unknown,
    attached_free,
    arm,
    frame,
    polar_hessian,
    cross_hessian,
    border_out,
    body_hessian_out,
):
    """Add the second derivatives of clamps' elements with respect to the rotation of free bodies to U and D.

    The angle of a clamp's direction is that of its body about the normal.
    """
    for k in range(wall_free.shape[0]):
        f, w, x = wall_free[k], edge_count + k, wall_joint[k]
        if f < 0:
            continue
        base = 6 * f + 3
        for m in range(3):
            for n in range(3):
                body_hessian_out[base + m, base + n] += polar_hessian[w, 2] * normal[m] * normal[n]
        wall_first = joint_a[x] == w
        edge = joint_b[x] if wall_first else joint_a[x]
        by_length, by_angle = cross_hessian[x, 2 if wall_first else 1], cross_hessian[x, 3]
        for end in range(2):
            sign = 1.0 if end == 1 else -1.0
            for c in range(2):
                unknown = node_unknown[edge_node[edge] + end] + c
                value = sign * (by_length * frame[edge, c] + by_angle * frame[edge, 2 + c])
                other = attached_of_unknown[unknown]
                if other < 0:
                    for m in range(3):
                        border_out[unknown, base + m] += value * normal[m]
                elif attached_free[other] >= 0:
                    row = 6 * attached_free[other]
                    for n in range(6):
                        held = value * arm_jacobian(axes, arm, other, unknown - attached_unknown[other], n)
                        for m in range(3):
                            body_hessian_out[row + n, base + m] += held * normal[m]
                            body_hessian_out[base + m, row + n] += held * normal[m]


class PlanarMatrix(NewtonMatrix):
    """`NewtonMatrix` of a model in a plane.

    Attributes
    ----------
    frame : Array
        Of edges and walls at the last evaluation, from `forces.planar.in_plane_frames`.
    polar_gradient : Array
        N and T of edges and walls there, shape (n_edge + n_wall, 2); what they differ by from the derivatives with
        respect to edge vectors is no elasticity.
    """

    def __init__(self, model: Model, has_node_blocks: bool):
        super().__init__(model, has_node_blocks)
        edges = model.edge_count + model.wall_count
        self.frame = np.zeros((edges, 4))
        self.polar_gradient = np.zeros((edges, 2))
        self._gradient = np.zeros(self._layout.size)

    def _shapes(self) -> dict[str, tuple[int, ...]]:
        """Names and shapes of second derivatives in lengths, angles and vectors between paired edges."""
        model = self._model
        edges, pairs = model.edge_count + model.wall_count, len(model.pair_top)
        return {
            "edge_hessian": (edges if len(model.fluid_mass) else 0, 4, 4),  # of the fluid against spin: of no use here
            "polar_hessian": (edges, 3),
            "cross_hessian": (len(model.joint_a), 4),
            "pair_hessian": (pairs, 3),
            "mixed_hessian": (pairs, 4),
        }

    def _assemble_band(self, factor: float, at: Configuration) -> None:
        model, node, band = self._model, self._layout.node, self._band
        band.fill(0.0)
        expand_in_plane(
            model.directions,
            model.edge_node,
            model.plane.joint_after,
            node,
            model.node_mass,
            factor,
            at.length,
            self.frame,
            self.polar_gradient,
            self.polar_hessian,
            self.cross_hessian,
            self.node_hessian,
            band,
        )
        if len(model.pair_top):
            pairs = (model.pair_top, model.pair_bottom, model.edge_node, node, self.frame)
            second = (self.pair_hessian, self.mixed_hessian, self.cross_hessian)
            expand_pairs_in_plane(model.bend_count, *pairs, *second, band)

    def _add_walls(self, at: Configuration, edge_gradient: Array) -> None:
        model, layout = self._model, self._layout
        hand_walls_to_bodies_in_plane(
            model.directions,
            model.plane.normal,
            model.wall_free,
            model.wall_joint,
            model.joint_a,
            model.joint_b,
            model.edge_count,
            model.edge_node,
            layout.node,
            layout.attached_of_unknown,
            layout.attached,
            model.attached_free,
            at.arm,
            self.frame,
            self.polar_hessian,
            self.cross_hessian,
            self._border,
            self._corner,
        )

    def newton_step(self, gradient: Array, body_gradient: Array) -> tuple[Array, Array]:
        """As of `NewtonMatrix`, from the part of the gradient in the plane; the step is one in space."""
        model = self._model
        take_in_plane(model.directions, model.layout.node, self._layout.node, gradient, self._gradient)
        in_plane, body_step = super().newton_step(self._gradient, body_gradient)
        step = np.zeros(model.layout.size)
        put_in_space(model.directions, model.layout.node, self._layout.node, in_plane, step)
        return step, body_step
