"""Energy of a planar bilayer beam whose unknowns are the nodes of its interface (paper, Appendix A, eqs. 31 and 32).

A fibre at height z over the interface has the strain ε − χ z, with ε that of the interface and χ its curvature,
positive where it bends to the normal (the paper's κ is −χ). Integrated over layers that reach from the interface to h₁
above and to h₂ below it, the energy of a rest length is

    ½ A ε² − B ε χ + ½ D χ² − N ε + M χ + const

    A = Σ EA,  B = Σ EA z̄,  D = Σ (EI + EA z̄²),  N = Σ EA η,  M = Σ EA z̄ η

with z̄ the height of a layer's middle. The paper takes for ε of a node the mean of its two edges' in every term; a
strain that alternates from edge to edge then costs nothing (an hourglass). Here A and N belong to edges, and only the
product ε χ has the mean:

    E = Σ_edges (½ A ε² − N ε) |ē| + Σ_nodes (½ D χ² + M χ − B ε̄ χ) Δl,   ε = |e|/|ē| − 1,   χ Δl = 2 tan(φ/2)

φ is the angle from one edge to the next. With n the normal of an edge, ∂φ/∂e = ∓ n/|e|, and everything is in closed
form.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Array = np.ndarray


@dataclass(frozen=True)
class Section:
    """A, B, D of a bilayer about its interface [N, N m, N m²], and its mass per length [kg/m]."""

    axial: float
    coupling: float
    bending: float
    mass: float


@dataclass(frozen=True)
class Strains:
    """Strains at one shape, with what their derivatives need."""

    length: Array  # |e| [m], shape (n_edge,)
    tangent: Array
    normal: Array
    """`tangent`, `normal`: unit, shape (n_edge, 2); the normal is the tangent turned by a quarter to the left."""
    axial: Array  # ε, shape (n_edge,)
    bend: Array  # χ Δl = 2 tan(φ/2), shape (n_bend,)


class BeamEnergy:
    """Elastic energy of nodes in a plane, its gradient and its Hessian.

    `edge_length`: |ē| [m]. `wall`: unit direction that a clamp at the first node fixes, shape (2,); the wall stands at
    the node, with a bending element of half an edge. None for a free end.
    """

    def __init__(self, section: Section, edge_length: float, node_count: int, wall: Array | None):
        self.section, self.edge_length, self.node_count = section, edge_length, node_count
        self.wall = wall
        edges = node_count - 1
        self.weight = np.full(edges - 1 + (wall is not None), edge_length)  # Δl of bending elements
        first, second = np.arange(edges - 1), np.arange(1, edges)
        if wall is not None:
            self.weight = np.concatenate([[0.5 * edge_length], self.weight[1:]])
            first, second = np.concatenate([[0], first]), np.concatenate([[0], second])
        self._before, self._after = first, second  # at the wall both are the first edge: ε̄ is its strain
        self._inner = slice(int(wall is not None), None)

    def strains(self, position: Array) -> Strains:
        """Return the strains of nodes at `position` [m], shape (n_node, 2)."""
        edge = np.diff(position, axis=0)
        length = np.linalg.norm(edge, axis=1)
        tangent = edge / length[:, None]
        before, after = self._tangents(tangent)
        cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
        bend = 2.0 * cross / (1.0 + np.einsum("ij,ij->i", before, after))
        normal = np.column_stack([-tangent[:, 1], tangent[:, 0]])
        return Strains(length, tangent, normal, length / self.edge_length - 1.0, bend)

    def _tangents(self, tangent: Array) -> tuple[Array, Array]:
        before = tangent[self._before].copy()
        if self.wall is not None:
            before[0] = self.wall
        return before, tangent[self._after]

    def mean_strain(self, axial: Array) -> Array:
        """Return ε̄ of bending elements, shape (n_bend,)."""
        return 0.5 * (axial[self._before] + axial[self._after])

    def _forces(self, at: Strains, force: Array, moment: Array) -> tuple[Array, Array]:
        """Return ∂E/∂ε of edges and ∂E/∂(χ Δl) of bending elements; N and M from eigenstrain, shapes (n_edge,)."""
        s = self.section
        chi = at.bend / self.weight
        axial = (s.axial * at.axial - force) * self.edge_length
        cross = -0.5 * s.coupling * at.bend
        np.add.at(axial, self._before, cross)
        np.add.at(axial, self._after, cross)
        return axial, s.bending * chi + self._at_bends(moment) - s.coupling * self.mean_strain(at.axial)

    def _at_bends(self, of_edges: Array) -> Array:
        return 0.5 * (of_edges[self._before] + of_edges[self._after])

    def value(self, position: Array, force: Array, moment: Array) -> float:
        """Return E [J].

        `position`: [m], shape (n_node, 2). `force`, `moment`: N [N] and M [N m] of each edge, shape (n_edge,).
        """
        s, at = self.section, self.strains(position)
        stretching = (0.5 * s.axial * at.axial - force) @ at.axial * self.edge_length
        bending = 0.5 * s.bending * at.bend**2 / self.weight
        coupling = (self._at_bends(moment) - s.coupling * self.mean_strain(at.axial)) * at.bend
        return float(stretching + bending.sum() + coupling.sum())

    def derivatives(self, position: Array, force: Array, moment: Array) -> tuple[Array, Array]:
        """Return ∂E/∂x, shape (2 n_node,), and ∂²E/∂x² as a lower band, ``band[r, j] = H[j + r, j]``, shape (6, 2
        n_node).
        """
        s, at = self.section, self.strains(position)
        axial, bending = self._forces(at, force, moment)
        axial_slope = at.tangent / self.edge_length  # ∂ε/∂e
        angle_slope = at.normal / at.length[:, None]  # ∂(angle of e)/∂e
        growth = 1.0 + 0.25 * at.bend**2  # d(2 tan(φ/2))/dφ

        edge_gradient = axial[:, None] * axial_slope
        turn = (bending * growth)[:, None]
        inner = self._inner
        np.add.at(edge_gradient, self._after, turn * angle_slope[self._after])
        np.add.at(edge_gradient, self._before[inner], -turn[inner] * angle_slope[self._before[inner]])
        gradient = np.zeros((self.node_count, 2))
        gradient[1:] += edge_gradient
        gradient[:-1] -= edge_gradient

        # of each edge by itself: A, the turning of its strain, and that of its angle under the moments at its ends
        outer_t = np.einsum("ki,kj->kij", at.tangent, at.tangent)
        outer_n = np.einsum("ki,kj->kij", at.normal, at.normal)
        mixed = np.einsum("ki,kj->kij", at.normal, at.tangent)
        own = s.axial / self.edge_length * outer_t
        own += (axial / (self.edge_length * at.length))[:, None, None] * outer_n
        couple = np.zeros(self.node_count - 1)
        np.add.at(couple, self._after, turn[:, 0])
        np.add.at(couple, self._before[inner], -turn[inner, 0])
        own -= (couple / at.length**2)[:, None, None] * (mixed + mixed.transpose(0, 2, 1))
        band = np.zeros((6, 2 * self.node_count))
        edges = np.arange(self.node_count - 1)
        self._add(band, edges, edges, own)

        # of bending elements, from the products of first derivatives by ε of both edges and by φ
        slope = [np.zeros((len(self.weight), 2)), angle_slope[self._after]]
        slope[0][inner] = -angle_slope[self._before[inner]]
        strain = [0.5 * axial_slope[self._before], 0.5 * axial_slope[self._after]]
        stiffness = s.bending / self.weight * growth**2 + bending * growth * 0.5 * at.bend
        cross = -s.coupling * growth
        place = (self._before, self._after)
        for m in range(2):
            for n in range(2):
                block = stiffness[:, None, None] * np.einsum("ki,kj->kij", slope[m], slope[n])
                block += cross[:, None, None] * np.einsum("ki,kj->kij", slope[m], strain[n])
                block += cross[:, None, None] * np.einsum("ki,kj->kij", strain[m], slope[n])
                self._add(band, place[m], place[n], block)
        return gradient.ravel(), band

    def _add(self, band: Array, first: Array, second: Array, block: Array) -> None:
        """Add blocks of edges (first, second), shape (n, 2, 2), to the nodes at the edges' ends."""
        for end, sign in ((1, 1.0), (0, -1.0)):
            for other, other_sign in ((1, 1.0), (0, -1.0)):
                for i in range(2):
                    for j in range(2):
                        row, column = 2 * (first + end) + i, 2 * (second + other) + j
                        lower = row >= column
                        entries = (row[lower] - column[lower], column[lower])
                        np.add.at(band, entries, sign * other_sign * block[lower, i, j])
