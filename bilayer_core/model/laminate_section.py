"""One curve for both layers of a rod, bonded exactly (the paper's Appendix A, in space).

Energy of a section. The curve lies at a constant height over the path. A layer whose middle lies z over the curve is
λ = 1 − z χ₀ times as long, χ₀ the curve's curvature at the start; a fibre there has the strain (ε − z χ′)/λ with
χ′ = χ − χ₀ and the curve's strain ε. Per rest length of the curve,

    Σ ½ (EA/λ) (ε − z χ′ − λη)² + ½ (EI₁/λ) (χ − λχ̄)² = ½ A ε² − B ε χ′ + ½ D χ′² − N ε + (M − M̄) χ′ + const

    A = Σ EA/λ,   B = Σ z EA/λ,   D = Σ (EI₁ + z² EA)/λ,   N = Σ EA η,   M = Σ z EA η,   M̄ = Σ EI₁ (χ̄ − χ₀/λ)

and ½ Σ(EI₂/λ) ξ² + ½ GJ (τ − τ̄)² with GJ = Σ GJ_l/λ + k_φ c²/λ (`section.bond`: what a bond that does not shear adds,
with the mean λ) and GJ τ̄ = Σ GJ_l τ̄_l. Reported energies leave the constant out: no shape can release it.

Elements. An edge has one strain ε; each of its halves has a section and a curvature of its own. What a joint sees is
the angle κ₁ of the two halves (one, at a clamp) that meet there, the sum of their ℓ χ. Minimised over how they share
it,

    E = Σ_edges (½ A* ε² − N* ε) |ē| + Σ_joints ½ K (κ₁ − κ̄₁ − Σ_halves b ε)²
    A* = A − B²/D,   N* = N − B (M − M̄)/D   (means of the halves)
    1/K = Σ_halves ℓ/D,   b = ℓ B/D,   κ̄₁ = κ₁(start) + Σ_halves ℓ (M̄ − M)/D

so that a half at a free end, which no joint sees, bends freely, as it should, and sections that differ on either side
of a joint bend as in series. A* > 0 and K > 0: both sums are of squares. An edge has the rest strain N*/A*. Under its
own stimuli a uniform strip is exact at every node, wherever the curve lies.

On the neutral axis B = 0, and the curve is an ordinary rod. It lies on that of the section which covers most of the
rod; where a layer begins or ends the axis is elsewhere, and `forces.bend_twist` has the part with b. Mass, loads and
fluid act where they are, off the curve (`forces.raised`).

Across the width and in twist 1/K = Σ ℓ/EI₂ and Σ ℓ/GJ likewise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bilayer_core.model.section import bond, sections
from bilayer_core.model.strands import StrandShape
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.profile import values_at
from bilayer_core.scene.rod import Rod

Array = np.ndarray
ON_AXIS = 1e-12
"""Of √(AD): a coupling B that is rounding."""


def side(rod: Rod, slot: int) -> float:
    """Height of a layer's middle over the path, in its thicknesses."""
    return 0.0 if len(rod.layers) == 1 else (-0.5, 0.5)[slot]


@dataclass(frozen=True)
class LayerHalves:
    """A layer in the halves of all edges of a rod, each in the middle of its half; shapes (n_edge, 2), or (n_copy,
    n_edge, 2) where copies of the rod differ. What the layer contributes is 0 where it is not.
    """

    ratio: Array  # λ, of both halves, shape (n_copy, n_edge, 1)
    axial: Array  # EA [N]
    stretch: Array  # EA/λ
    bend: Array  # EI₁/λ [N m²]
    across: Array  # EI₂/λ
    twist: Array  # GJ_l/λ
    twist_moment: Array  # GJ_l τ̄_l [N m]
    natural_moment: Array  # M̄ [N m]
    height: Array  # z [m]


def layer_halves(
    scene: SceneConfig, rod: Rod, slot: int, axis: float, shape: StrandShape, stretch: Array, present: Array
) -> LayerHalves:
    """Return a layer in the halves of edges; `stretch` is λ, shape (n_copy, n_edge)."""
    layer = rod.layers[slot]
    stations = _of_halves(len(present))
    section = sections(rod, layer, scene.materials[layer.material], stations)
    along = rod.edge_length * rod.on_path(stations)

    def halves(values: Array) -> Array:
        return present[:, None] * values.reshape(-1, 2)

    ratio = stretch[..., None]
    bend, across = (halves(stiffness) / ratio for stiffness in section.bending_stiffness)
    twist = halves(section.twisting_stiffness)
    moment = np.zeros_like(bend)
    if layer.natural_curvature is not None:
        start = (shape.strains() - shape.imperfection)[..., 0] / shape.voronoi
        natural = ratio * values_at(layer.natural_curvature, along).reshape(-1, 2)
        moment = bend * (natural - np.stack([start[..., :-1], start[..., 1:]], axis=-1))
    return LayerHalves(
        ratio=ratio,
        axial=halves(section.axial_stiffness),
        stretch=halves(section.axial_stiffness) / ratio,
        bend=bend,
        across=across,
        twist=twist / ratio,
        twist_moment=np.asarray(shape.handedness)[:, None, None]
        * twist
        * values_at(layer.natural_twist, along).reshape(-1, 2),
        natural_moment=moment,
        height=side(rod, slot) * section.thickness.reshape(-1, 2) - axis,
    )


def _of_halves(edges: int) -> Array:
    """Stations in the middle of the halves of so many edges, shape (2 n_edge,)."""
    return (np.arange(edges)[:, None] + [0.25, 0.75]).ravel()


def _bond_twist(scene: SceneConfig, rod: Rod, halves: list[LayerHalves]) -> Array | float:
    """k_φ c²/λ where both layers are [N m²], λ the mean of theirs, shape (n_copy, n_edge, 2)."""
    if len(halves) == 1:
        return 0.0
    stations = _of_halves(len(halves[0].axial))

    def made() -> Array:
        bottom, top = (sections(rod, layer, scene.materials[layer.material], stations) for layer in rod.layers)
        law = bond(bottom, top, scene.coupling, rod.torsion)
        return (law.tilt * (0.5 * (bottom.thickness + top.thickness)) ** 2).reshape(-1, 2)

    stiffness = scene.keep("twist of bonds", (rod,), made)
    bonded = (halves[0].axial > 0.0) & (halves[1].axial > 0.0)
    return bonded * stiffness / (0.5 * (halves[0].ratio + halves[1].ratio))


class WholeSection:
    """All layers together: elements of a strand without its stimuli, and what these need.

    Attributes
    ----------
    bending, coupling : Array
        D [N m²] and B [N m] of halves, shape (n_copy, n_edge, 2).
    axial_stiffness, rest_strain : Array
        A* [N] and N*/A* of edges, shape (n_copy, n_edge).
    joint_stiffness, joint_rest : Array
        [N m] and κ̄₁ κ̄₂ ψ̄ [rad] at all nodes, shape (n_copy, n_node, 3).
    """

    def __init__(self, scene: SceneConfig, rod: Rod, halves: list[LayerHalves], shape: StrandShape):
        stretch = sum(half.stretch for half in halves)
        coupling = sum(half.stretch * half.height for half in halves)
        self.bending = sum(half.bend + half.stretch * half.height**2 for half in halves)
        self.coupling = np.where(np.abs(coupling) <= ON_AXIS * np.sqrt(stretch * self.bending), 0.0, coupling)
        self._half_length = 0.5 * shape.lengths[..., None]
        moment = sum(half.natural_moment for half in halves)
        twist = sum(half.twist for half in halves) + _bond_twist(scene, rod, halves)

        self.axial_stiffness = np.mean(stretch - self.coupling**2 / self.bending, axis=-1)
        self.rest_strain = np.mean(self.coupling * moment / self.bending, axis=-1) / self.axial_stiffness
        across = sum(half.across for half in halves)
        flexibility = [self.to_nodes(1.0 / stiffness) for stiffness in (self.bending, across, twist)]
        self.joint_stiffness = 1.0 / np.stack(flexibility, axis=-1)
        self.joint_rest = shape.strains()
        self.joint_rest[..., 0] += self.to_nodes(moment / self.bending)
        self.joint_rest[..., 2] += self.to_nodes(sum(half.twist_moment for half in halves) / twist)

    def to_nodes(self, per_length: Array) -> Array:
        """Integrals at nodes of what halves have per length, shape (n_copy, n_node)."""
        return _at_nodes(self._half_length * per_length)

    def strain_coupling(self) -> Array:
        """b of the edges before and after each node [rad], shape (n_copy, n_node, 2)."""
        slope = self._half_length * self.coupling / self.bending
        pairs = np.zeros((len(slope), slope.shape[1] + 1, 2))
        pairs[:, 1:, 0], pairs[:, :-1, 1] = slope[..., 1], slope[..., 0]
        return pairs

    def driven(self, half: LayerHalves, edges: Array) -> tuple[Array, Array, Array]:
        """Per eigenstrain of a layer on some edges: their rest strains, N*/A*, shape (n_copy, n_driven), the nodes at
        their ends, shape (n_end,), and κ̄₁ of these nodes, −Σ ℓ M/D [rad], shape (n_copy, n_end).
        """
        axial, height = half.axial[edges], half.height[edges]
        bending, coupling = self.bending[:, edges], self.coupling[:, edges]
        part = np.mean(axial * (1.0 - coupling * height / bending), axis=-1) / self.axial_stiffness[:, edges]
        of_halves = -self._half_length[:, edges] * (axial * height / bending)
        if len(edges) and edges[-1] - edges[0] == len(edges) - 1 and np.all(edges[1:] - edges[:-1] == 1):
            return part, np.arange(edges[0], edges[-1] + 2), _at_nodes(of_halves)  # as they mostly are
        nodes, slot = np.unique(np.stack([edges, edges + 1], axis=1), return_inverse=True)
        sums = [np.bincount(slot.ravel(), weights=own.ravel(), minlength=len(nodes)) for own in of_halves]
        return part, nodes, np.array(sums)


def _at_nodes(of_halves: Array) -> Array:
    """Sum the values of halves of successive edges at the nodes next to them, shape (n_copy, n_edge + 1)."""
    of_nodes = np.zeros((len(of_halves), of_halves.shape[1] + 1))
    of_nodes[:, :-1] += of_halves[..., 0]
    of_nodes[:, 1:] += of_halves[..., 1]
    return of_nodes
