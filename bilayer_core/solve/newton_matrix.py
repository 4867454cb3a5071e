"""The Newton matrix: a band for rods, bordered by the unknowns of free bodies, and its factorisation.

    [ A   U ] [ δ   ]     [ g   ]
    [ Uᵀ  D ] [ δ_b ] = − [ g_b ]

A is factorised as L D Lᵀ in linear time; S = D − Uᵀ A⁻¹ U is dense and small. U and D are first restricted to the
motions that bodies are allowed. While no free body touches or holds a rod, U vanishes and is left out.
Some nodes of rods that touch leave the band for the border, too (`solve.rod_border`).

If a pivot is not positive the matrix is not convex there; what is negative in the contact of rods is left out, then
multiples of the mass matrix are added until it is, so that the step is a descent direction.
"""

from __future__ import annotations

import numpy as np

from ..jit import kernel
from ..model.model import Model
from .assembly import expand_bends, expand_edges, expand_pairs, hold_unknowns
from .band import backward_band, eliminate_band, factor_band, factor_signed, forward_band, width
from .clamps import hand_nodes_to_bodies, hand_rows_to_bodies, hand_walls_to_bodies
from .configuration import Configuration
from .dense import factor_dense, solve_dense
from .rod_border import RodBorder
from .rod_contact import RodContact

Array = np.ndarray
FIRST_SHIFT = 0.01  # of the inertial part, where the Hessian is indefinite
SHIFT_GROWTH = 10.0
LARGEST_SHIFT = 1e8


def zeros_in_one(shapes: dict[str, tuple[int, ...]]) -> tuple[Array, list[Array]]:
    """A flat array of zeros and consecutive views of it with the given shapes: one call clears them all."""
    sizes = [int(np.prod(shape)) for shape in shapes.values()]
    flat = np.zeros(sum(sizes))
    ends = np.cumsum(sizes)
    return flat, [
        flat[end - size : end].reshape(shape) for size, end, shape in zip(sizes, ends, shapes.values(), strict=True)
    ]


@kernel
def add_links(axes, links, link_node, link_body, link_hessian, node_unknown, border_out):
    """Add the blocks between nodes, whose unknowns are along `axes`, and free bodies to the border."""
    for k in range(links):
        row, column = node_unknown[link_node[k]], 6 * link_body[k]
        for m in range(axes.shape[0]):
            for c in range(3):
                along = axes[m, c]
                if along != 0.0:
                    for n in range(6):
                        border_out[row + m, column + n] += along * link_hessian[k, c, n]


class NewtonMatrix:
    """Second derivatives in edge space, filled by the forces, and the factorised matrix of the unknowns."""

    def __init__(self, model: Model, has_node_blocks: bool):
        self._model, self._layout = model, model.solved_layout
        self.rods = RodContact(model) if model.rod_surfaces is not None else None
        self.rod_border = RodBorder(model) if self.rods else None
        self._has_node_blocks = has_node_blocks
        size, b = self._layout.size, self._layout.half_bandwidth
        shapes = self._shapes() | {
            "node_hessian": (model.node_count if has_node_blocks else 0, 3, 3),
            "body_hessian": (6 * model.free_count, 6 * model.free_count),
        }
        self.second_derivatives, parts = zeros_in_one(shapes)
        for name, part in zip(shapes, parts, strict=True):
            setattr(self, name, part)
        self.links = 0  # blocks between nodes and free bodies: the node, the free body, and ∂²/∂x ∂(X, φ) of each
        self.link_node = np.zeros(0, dtype=np.int64)
        self.link_body = np.zeros(0, dtype=np.int64)
        self.link_hessian = np.zeros((0, 3, 6))
        self._band = np.zeros((size + b, b + 1))
        self._bandwidth = width(b)
        self._right = np.zeros(size + b)
        self._border = np.zeros((size + b, 6 * model.free_count))
        self._make_room(model.bodies.freedom.shape[1])
        self._corner = np.zeros_like(self.body_hessian)
        self._held_unknowns = (self._layout.attached[:, None] + np.arange(self._layout.dimension)).ravel()
        self.body_masses = np.concatenate(
            [np.repeat([m, np.trace(j)], 3) for m, j in zip(model.bodies.mass, model.bodies.second_moment, strict=True)]
            or [np.zeros(0)]
        )
        self._nothing = self._leaving = np.zeros(0, dtype=np.int64)
        self._width = 0  # columns of the border in use
        self._coupled = False
        self.shift, self.simplified = 0.0, 0

    def _shapes(self) -> dict[str, tuple[int, ...]]:
        """Names and shapes of second derivatives in edge space."""
        edges, pairs = self._model.edge_count + self._model.wall_count, len(self._model.pair_top)
        return {
            "edge_hessian": (edges, 4, 4),
            "cross_hessian": (len(self._model.joint_a), 4, 4),
            "pair_hessian": (pairs, 3, 3),
            "top_hessian": (pairs, 3, 4),
            "bottom_hessian": (pairs, 3, 4),
        }

    def _make_room(self, columns: int) -> None:
        """Have room for a border of so many columns."""
        rows = self._layout.size + self._layout.half_bandwidth
        self._wide, self._scaled = np.zeros((2, columns, rows))  # U, then L⁻¹ U, and D⁻¹ L⁻¹ U, by columns
        self._schur, self._load = np.zeros((columns, columns)), np.zeros(columns)

    def clear(self) -> None:
        """Set all second derivatives to zero."""
        self.second_derivatives.fill(0.0)
        self.links = 0

    def make_room_for_links(self, room: int) -> None:
        """Have room for so many links; those listed stay."""
        if room > len(self.link_node):
            links, extra = self.links, room
            self.link_node = np.concatenate([self.link_node[:links], np.zeros(extra, dtype=np.int64)])
            self.link_body = np.concatenate([self.link_body[:links], np.zeros(extra, dtype=np.int64)])
            self.link_hessian = np.concatenate([self.link_hessian[:links], np.zeros((extra, 3, 6))])

    def factorise(self, factor: float, at: Configuration, edge_gradient: Array, attached_gradient: Array) -> bool:
        """Assemble and factorise; false if no shift makes the matrix positive definite.

        Parameters
        ----------
        factor : float
            Of the masses in the Hessian [1/s²].
        at : Configuration
            Where the second derivatives were evaluated.
        edge_gradient, attached_gradient : Array
            First derivatives there, of edges and of attached nodes before they were handed to bodies.
        """
        self.shift, self.simplified = 0.0, 0
        while True:
            self.assemble(factor * (1.0 + self.shift), at, edge_gradient, attached_gradient)
            if self._factorise(factor):
                return True
            if self.rods and self.rods.contacts.count and self.simplified < 2:
                self.simplified += 1
                continue
            self.shift = max(FIRST_SHIFT, self.shift * SHIFT_GROWTH)
            if self.shift > LARGEST_SHIFT:
                return False

    def assemble(
        self, factor: float, at: Configuration, edge_gradient: Array, attached_gradient: Array
    ) -> tuple[Array, Array, Array]:
        """A as a band (see `solve.band`), U and D; parameters as for `factorise`. Attached nodes are rows of the
        identity.
        """
        model, layout = self._model, self._layout
        self._assemble_band(factor, at)
        if self.rods:
            self.rod_border.add_to_band([self.rods.contacts, self.rods.sliding], self.simplified, self._band)
        self._border.fill(0.0)
        self._corner[:] = self.body_hessian
        self._coupled = False
        if model.free_count:
            if self.links:
                self._coupled = True
                links = (self.links, self.link_node, self.link_body, self.link_hessian)
                add_links(model.directions, *links, layout.node, self._border)
            if (model.attached_free >= 0).any():
                self._add_clamps(at, edge_gradient, attached_gradient)
        hold_unknowns(layout.attached, layout.dimension, layout.half_bandwidth, self._band)
        return self._band, self._border[: layout.size], self._corner

    def _assemble_band(self, factor: float, at: Configuration) -> None:
        model, layout, band = self._model, self._model.layout, self._band
        band.fill(0.0)
        expand_edges(
            model.edge_node,
            layout.node,
            layout.edge,
            model.node_mass,
            model.spin_inertia,
            factor,
            self.edge_hessian,
            self.node_hessian,
            self._has_node_blocks,
            band,
        )
        joints = (model.joint_a, model.joint_b, model.edge_node, layout.node, layout.edge)
        expand_bends(model.bend_count, model.edge_count, *joints, self.cross_hessian, band)
        if len(model.pair_top):
            expand_pairs(
                model.bend_count,
                model.pair_bottom,
                model.edge_node,
                layout.node,
                self.pair_hessian,
                self.top_hessian,
                self.bottom_hessian,
                self.cross_hessian,
                band,
            )

    def _add_clamps(self, at: Configuration, edge_gradient: Array, attached_gradient: Array) -> None:
        """Rows of nodes attached to free bodies, from the band and the border, and clamps' elements: into U and D."""
        model, layout = self._model, self._layout
        self._coupled = True
        if self.rods:
            self.rod_border.add_to_bodies(at.arm, self._border, self._corner)
        hand_rows_to_bodies(model.directions, layout.attached, model.attached_free, at.arm, self._border, self._corner)
        attached = (layout.attached, model.attached_free)
        hand_nodes_to_bodies(
            model.directions,
            *attached,
            layout.attached_of_unknown,
            at.arm,
            attached_gradient,
            layout.half_bandwidth,
            layout.size,
            self._band,
            self._border,
            self._corner,
        )
        self._add_walls(at, edge_gradient)

    def _add_walls(self, at: Configuration, edge_gradient: Array) -> None:
        """What clamps' elements couple to the rotation of free bodies, into U and D."""
        model, layout = self._model, self._layout
        hand_walls_to_bodies(
            model.directions,
            model.wall_free,
            model.wall_joint,
            model.joint_a,
            model.joint_b,
            model.edge_count,
            model.edge_node,
            layout.node,
            layout.edge,
            layout.attached_of_unknown,
            layout.attached,
            model.attached_free,
            at.arm,
            at.tangent,
            edge_gradient,
            self.edge_hessian,
            self.cross_hessian,
            self._border,
            self._corner,
        )

    def _factorise(self, factor: float) -> bool:
        self._take_border(self.shift * factor)
        if factor_band(self._band, self._layout.size, self._bandwidth) >= 0:
            return False
        self._eliminate_band()
        return factor_dense(self._schur, self._width)

    def _take_border(self, shift: float) -> None:
        """Couplings and second derivatives of free bodies' freedom and of what leaves the band; `shift` times their
        masses is added for bodies.
        """
        freedom = self._model.bodies.freedom
        n = freedom.shape[1]
        self._leaving = self.rod_border.rows if self.rods else self._nothing
        self._width = n + len(self._leaving)
        if self._width > self._schur.shape[0]:
            self._make_room(2 * self._width)
        corner = self._corner + shift * np.diag(self.body_masses) if shift else self._corner
        self._schur[:n, :n] = freedom.T @ corner @ freedom
        if self._coupled:
            self._border[self._held_unknowns] = 0.0
            self._wide[:n] = (self._border @ freedom).T
        elif len(self._leaving):
            self._wide[:n] = 0.0
        if len(self._leaving):
            self._coupled = True
            self.rod_border.widen(self._band, n, self._wide.T, self._schur)

    def _eliminate_band(self) -> None:
        """D − Uᵀ A⁻¹ U in place of D, given the factorised band."""
        if not self._coupled:
            return
        size, border = self._layout.size, (self._wide, self._scaled, self._schur)
        eliminate_band(self._band, size, self._bandwidth, self._width, *border)

    def count_negative(self, factor: float, at: Configuration, edge_gradient: Array, attached_gradient: Array) -> int:
        """Number of negative eigenvalues of the matrix of the last evaluation plus `factor` times the masses [1/s²].

        Parameters as for `factorise`; in no direction is the potential concave if there is none at any factor above 0.
        """
        self.simplified = 0
        self.assemble(factor, at, edge_gradient, attached_gradient)
        self._take_border(factor)
        count = int(factor_signed(self._band, self._layout.size, self._bandwidth))
        self._eliminate_band()
        schur = self._schur[: self._width, : self._width]
        return count + int(np.count_nonzero(np.linalg.eigvalsh(schur) < 0.0))

    def newton_step(self, gradient: Array, body_gradient: Array) -> tuple[Array, Array]:
        """Minus the inverse matrix times the gradient: of rods, shape (size,), and of bodies, shape (n_free, 6)."""
        size = self._layout.size
        right, leaving = self._right, self._leaving
        np.negative(gradient, out=right[:size])
        right[size:] = 0.0
        right[leaving] = 0.0
        forward_band(self._band, size, self._bandwidth, right)
        freedom, load, width = self._model.bodies.freedom, self._load, self._width
        bodies = freedom.shape[1]
        load[:bodies] = -freedom.T @ body_gradient.ravel()
        load[bodies:width] = -gradient[leaving]
        if self._coupled:
            load[:width] -= self._scaled[:width] @ right
        solve_dense(self._schur, width, load)
        if self._coupled:
            right -= load[:width] @ self._wide[:width]
        backward_band(self._band, size, self._bandwidth, right)
        step = right[:size].copy()
        step[leaving] = load[bodies:width]
        return step, (freedom @ load[:bodies]).reshape(-1, 6)
