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

Where a layer, a law or a piece of a profile ends within a half, the half consists of *cells*, of the parts f of its
length. They bend in series, under one force and one moment: with the section's matrix S of (ε, χ′), S = ((A, −B),
(−B, D)), and its load p = (N, M̄ − M), strains without stress S⁻¹ p and compliances add,

    S⁻¹ = Σ f S_cell⁻¹,   p = S Σ f S_cell⁻¹ p_cell

and so do 1/EI₂, 1/GJ and τ̄. Both halves of an edge in which a layer or a law ends are alike, from the cells of the
whole edge: they have one ε, which unlike halves would fight for. So a patch turns its strip by its length times its
curvature, at any number of stations.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from bilayer_core.model.plate_section import DIRECTIONS, Natural, PlateSection
from bilayer_core.model.section import bond, sections
from bilayer_core.model.strands import StrandShape
from bilayer_core.model.unknown_order import ReadOnlyArrays
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.eigenstrain import Eigenstrain
from bilayer_core.scene.profile import Profile, means_between
from bilayer_core.scene.rod import Layer, Rod

Array = np.ndarray
ON_AXIS = 1e-12
"""Of √(AD): a coupling B that is rounding."""


def side(rod: Rod, slot: int) -> float:
    """Return the height of a layer's middle over the path, in its thicknesses."""
    return 0.0 if len(rod.layers) == 1 else (-0.5, 0.5)[slot]


@dataclass(frozen=True)
class Cells(ReadOnlyArrays):
    """The halves of all edges of a rod, cut where a layer, a law or a piece of a profile begins or ends."""

    begin: Array  # in stations, shape (n_cell,)
    end: Array
    half: Array  # the half in which it lies, shape (n_cell,)
    blended: Array  # edges in which a layer or a law ends, whose halves are alike, shape (n_edge,)

    @property
    def edge(self) -> Array:
        """Edge of each cell, shape (n_cell,)."""
        return self.half // 2

    @property
    def middle(self) -> Array:
        """Its middle, in stations, shape (n_cell,)."""
        return 0.5 * (self.begin + self.end)

    @property
    def is_cut(self) -> bool:
        """True if not each of them is a half, or if halves are blended."""
        return len(self.half) > 2 * len(self.blended) or bool(self.blended.any())

    def means(self, values: Array) -> Array:
        """Return the means over halves of values in cells, shapes (..., n_cell) and (..., n_edge, 2)."""
        if not self.is_cut:
            return values.reshape(*values.shape[:-1], -1, 2)
        first = np.searchsorted(self.half, np.arange(2 * len(self.blended)))
        means = np.add.reduceat(2.0 * (self.end - self.begin) * values, first, axis=-1)
        means = means.reshape(*means.shape[:-1], -1, 2)
        return np.where(self.blended[:, None], means.mean(axis=-1, keepdims=True), means)


def cells_of(rod: Rod, edges: int) -> Cells:
    """Return the cells of so many edges of a rod."""
    ends = [
        station for layer in rod.layers for law in (None, *layer.eigenstrain) for station in rod.span_of(layer, law)
    ]
    varying = [rod.inner_radius, *(part for layer in rod.layers for part in (rod.width_of(layer), *_varying(layer)))]
    varying += [law.gain for layer in rod.layers for law in layer.eigenstrain]
    places = [place / rod.edge_length for profile in varying if isinstance(profile, Profile) for place in profile.at]
    grid, (ends, places) = 0.5 * np.arange(2 * edges + 1), (_on_rod(rod, part, edges) for part in (ends, places))
    blended = np.zeros(edges, dtype=bool)
    blended[np.floor(ends[np.abs(ends - np.rint(ends)) > SMALLEST]).astype(np.int64)] = True
    cuts = np.concatenate([ends, places])
    near = np.abs(grid[np.rint(2.0 * cuts).astype(np.int64)] - cuts) <= SMALLEST
    grid = np.unique(np.concatenate([grid, cuts[~near]]))
    return Cells(grid[:-1], grid[1:], np.floor(grid[:-1] + grid[1:]).astype(np.int64), blended)


def _on_rod(rod: Rod, stations: list[float], edges: int) -> Array:
    """Return the inner ones of some stations, with their copies on so many edges of a closed rod."""
    inside = np.array([station for station in stations if 0.0 < station < rod.stations - 1], dtype=float)
    if rod.closed:
        inside = np.concatenate([inside, inside + (rod.stations - 1)])
    return inside[inside < edges]


SMALLEST = 1e-6
"""Of an edge: an end as near as this to the end of a half is there."""


def _varying(layer: Layer) -> tuple[float | Profile | None, ...]:
    """Return what may vary along a layer."""
    natural = layer.natural_curvature, layer.natural_curvature_across, layer.natural_twist
    return layer.thickness, layer.stiffness, *natural, layer.fibres and layer.fibres.angle


def driven_cells(rod: Rod, cells: Cells, layer: Layer, law: Eigenstrain | None = None) -> Array:
    """Return which cells a layer covers, or a law of it drives, shape (n_cell,)."""
    (first, last), middle = rod.span_of(layer, law), rod.on_path(cells.middle)
    return (first < middle) & (middle < last)


@dataclass(frozen=True)
class LayerCells:
    """A layer in the cells of a rod, each in its middle; shapes (n_cell,), or (n_copy, n_cell) where copies of the rod
    differ. What the layer contributes is 0 where it is not.
    """

    ratio: Array  # λ
    axial: Array  # EA [N]
    stretch: Array  # EA/λ
    bend: Array  # EI₁/λ [N m²]
    across: Array  # EI₂/λ
    twist: Array  # GJ_l/λ
    natural_twist: Array  # λ τ̄_l [1/m]
    curvature: Array  # λ χ̄ − χ₀ [1/m]
    curvature_across: Array  # likewise across the width
    height: Array  # z [m]


def layer_cells(
    scene: SceneConfig, rod: Rod, slot: int, axis: float, shape: StrandShape, stretch: Array, cells: Cells
) -> LayerCells:
    """Return a layer in the cells of a rod; `stretch` is λ of edges, shape (n_copy, n_edge)."""
    layer = rod.layers[slot]
    section = sections(rod, layer, scene.materials[layer.material], cells.middle)
    begin = rod.edge_length * rod.on_path(cells.begin)
    end = begin + rod.edge_length * (cells.end - cells.begin)
    present, ratio = driven_cells(rod, cells, layer), stretch[..., cells.edge]
    bend, across = (present * stiffness / ratio for stiffness in section.bending_stiffness)
    twist = present * section.twisting_stiffness
    handedness = np.asarray(shape.handedness)[:, None]

    def beyond_path(curvature: Any, axis: int, sign: Array | float) -> Array:
        """Return what the layer's own curvature adds to that of the path."""
        if curvature is None:
            return np.zeros_like(bend)
        start = (shape.strains() - shape.imperfection)[..., axis] / shape.voronoi
        natural = sign * ratio * means_between(curvature, begin, end)
        return natural - start[..., (cells.half + 1) // 2]

    return LayerCells(
        ratio=ratio,
        axial=present * section.axial_stiffness,
        stretch=present * section.axial_stiffness / ratio,
        bend=bend,
        across=across,
        twist=twist / ratio,
        natural_twist=handedness * ratio * means_between(layer.natural_twist, begin, end),
        curvature=beyond_path(layer.natural_curvature, 0, 1.0),
        curvature_across=beyond_path(layer.natural_curvature_across, 1, handedness),
        height=side(rod, slot) * section.thickness - axis,
    )


def _bond_twist(scene: SceneConfig, rod: Rod, layers: list[LayerCells], cells: Cells) -> Array | float:
    """Return k_φ c²/λ where both layers are [N m²], λ the mean of theirs, shape (n_copy, n_cell)."""
    if len(layers) == 1:
        return 0.0

    def made() -> Array:
        bottom, top = (sections(rod, layer, scene.materials[layer.material], cells.middle) for layer in rod.layers)
        law = bond(bottom, top, scene.coupling, rod.torsion)
        return law.tilt * (0.5 * (bottom.thickness + top.thickness)) ** 2

    stiffness = scene.keep("twist of bonds", (rod,), made)
    bonded = (layers[0].axial > 0.0) & (layers[1].axial > 0.0)
    return bonded * stiffness / (0.5 * (layers[0].ratio + layers[1].ratio))


def plate_cells(scene: SceneConfig, rod: Rod, cells: Cells) -> PlateSection:
    """Return the sections of a laminated plate in the cells of a rod."""
    present = np.array([driven_cells(rod, cells, layer) for layer in rod.layers], dtype=float)
    return PlateSection(scene, rod, rod.edge_length * rod.on_path(cells.middle), present)


class WholeSection:
    """All layers together: elements of a strand without its stimuli, and what these need.

    Attributes
    ----------
    axial_stiffness, rest_strain : Array
        A* [N] and N*/A* of edges, shape (n_copy, n_edge).
    joint_stiffness, joint_rest : Array
        [N m] and κ̄₁ κ̄₂ ψ̄ [rad] at all nodes, shape (n_copy, n_node, 3).
    curl_rest : Array
        κ̄y Δl and a₁ (κ̄x Δl − κ̄₁) of strips [rad], see `driven`, shape (n_copy, n_node).
    free_rest : Array
        κ̄x Δl − κ̄₁ [rad], likewise.
    """

    def __init__(
        self,
        scene: SceneConfig,
        rod: Rod,
        layers: list[LayerCells],
        cells: Cells,
        shape: StrandShape,
        axis: float,
        plate: PlateSection | None,
    ):
        self._rod, self._layers, self._plate, self._handedness = rod, layers, plate, shape.handedness
        self._cells, self._half_length = cells, 0.5 * shape.lengths[..., None]
        growth, height = (1.0, 1.0, 1.0), 0.0
        if plate is not None:  # of its axis over the curve
            growth, height = plate.growth, plate.axis - axis
        stretch = growth[0] * sum(layer.stretch for layer in layers)
        bending = growth[1] * sum(layer.bend + layer.stretch * (layer.height - height) ** 2 for layer in layers)
        coupling = stretch * height if plate is not None else sum(layer.stretch * layer.height for layer in layers)
        bending = bending + stretch * height**2
        coupling = np.where(np.abs(coupling) <= ON_AXIS * np.sqrt(stretch * bending), 0.0, coupling)
        self._of_cells = stretch, coupling, bending
        self._of_halves = self._in_series(stretch, coupling, bending)
        stretch, coupling, bending = self._of_halves
        twist = growth[2] * (sum(layer.twist for layer in layers) + _bond_twist(scene, rod, layers, cells))
        if plate is None:
            self.curl = scene.materials[rod.layers[0].material].poisson_ratio  # ν of all layers of a strip
            held = 0.0 * sum(layer.bend for layer in layers), sum(layer.bend * layer.curvature for layer in layers)
            curled, turned = 0.0, sum(layer.twist * layer.natural_twist for layer in layers) / twist
        else:
            self.curl = self.mean_at_nodes(plate.across[0])
            natural = [
                plate.bent_by(slot, layer.curvature, np.reshape(shape.handedness, (-1, 1)) * layer.natural_twist)
                for slot, layer in enumerate(layers)
            ]
            held = tuple(map(sum, zip(*map(self._held, natural), strict=True)))
            curled = self.to_nodes(cells.means(sum(own.across for own in natural)))
            turned = np.reshape(shape.handedness, (-1, 1)) * sum(own.twist for own in natural)
        moment = self._loads(*held)

        self.axial_stiffness = np.mean(stretch - coupling**2 / bending, axis=-1)
        self.rest_strain = self._rest_strains(*moment) / self.axial_stiffness
        across = growth[0] * sum(layer.across for layer in layers)
        flexibility = [1.0 / bending, cells.means(1.0 / across), cells.means(1.0 / twist)]
        self.joint_stiffness = 1.0 / np.stack([self.to_nodes(part) for part in flexibility], axis=-1)
        self.joint_rest = shape.strains()
        bent = self.to_nodes(moment[1] / bending)
        self.joint_rest[..., 0] += bent
        self.free_rest = self._bend_freely(*moment) - bent
        self.curl_rest = curled + self.curl * self.free_rest
        edgewise = sum(layer.across * layer.curvature_across for layer in layers) / across
        self.joint_rest[..., 1] += self.to_nodes(cells.means(edgewise))
        self.joint_rest[..., 2] += self.to_nodes(cells.means(turned))

    def _in_series(self, stretch: Array, coupling: Array, bending: Array) -> tuple[Array, Array, Array]:
        """Return A, B and D of halves from those of their cells, shapes (n_copy, n_edge, 2)."""
        if not self._cells.is_cut:
            return tuple(self._cells.means(part) for part in (stretch, coupling, bending))
        size = stretch * bending - coupling**2
        flexible = [self._cells.means(part / size) for part in (bending, coupling, stretch)]
        size = flexible[0] * flexible[2] - flexible[1] ** 2
        coupled = np.where(np.abs(flexible[1]) <= ON_AXIS * np.sqrt(flexible[0] * flexible[2]), 0.0, flexible[1])
        return flexible[2] / size, coupled / size, flexible[0] / size

    def _loads(self, force: Array, moment: Array) -> tuple[Array, Array]:
        """Return p of halves from that of their cells [N, N m], shapes (n_copy, n_edge, 2)."""
        if not self._cells.is_cut:
            return self._cells.means(force), self._cells.means(moment)
        stretch, coupling, bending = self._of_cells
        size = stretch * bending - coupling**2
        strain = self._cells.means((bending * force + coupling * moment) / size)
        curvature = self._cells.means((coupling * force + stretch * moment) / size)
        stretch, coupling, bending = self._of_halves
        return stretch * strain - coupling * curvature, bending * curvature - coupling * strain

    def _rest_strains(self, force: Array, moment: Array) -> Array:
        """Return N* of edges from the p of their halves [N], shape (n_copy, n_edge)."""
        _, coupling, bending = self._of_halves
        return np.mean(force + coupling * moment / bending, axis=-1)

    def to_nodes(self, per_length: Array) -> Array:
        """Return the integrals at nodes of what halves have per length, shape (n_copy, n_node)."""
        return _at_nodes(self._half_length * per_length)

    def mean_at_nodes(self, values: Array) -> Array:
        """Return the means at nodes of values in cells, shape (n_copy, n_node)."""
        halves = self._cells.means(values)
        return self.to_nodes(halves) / self.to_nodes(np.ones_like(halves))

    def strain_coupling(self) -> Array:
        """Return b of the edges before and after each node [rad], shape (n_copy, n_node, 2)."""
        _, coupling, bending = self._of_halves
        slope = self._half_length * coupling / bending
        pairs = np.zeros((len(slope), slope.shape[1] + 1, 2))
        pairs[:, 1:, 0], pairs[:, :-1, 1] = slope[..., 1], slope[..., 0]
        return pairs

    def plates(self) -> tuple[Array, Array]:
        """Return what a strip's joints have where no force acts along it, off the neutral axis too, over A* and over K:
        A, and 1/Σ ℓ/(D − B²/A), shape (n_copy, n_node).
        """
        stretch, coupling, bending = self._of_halves
        alone = self.to_nodes(1.0 / (bending - coupling**2 / stretch)) * self.joint_stiffness[..., 0]
        return _between(stretch.mean(axis=-1)) / _between(self.axial_stiffness), 1.0 / alone

    def _bend_freely(self, force: Array, moment: Array) -> Array:
        """Return Σ ℓ (B N + A M)/(A D − B²) at nodes, the bend under what halves would bear at rest, where Σ ℓ M/D is
        that at the curve's length [rad].
        """
        stretch, coupling, bending = self._of_halves
        free = (coupling * force + stretch * moment) / (stretch * bending - coupling**2)
        return self.to_nodes(np.where(coupling == 0.0, moment / bending, free))

    def _held(self, natural: Natural) -> tuple[Array, Array]:
        """Return what cells of a plate would bear at the strains of the start [N, N m], shapes (n_copy, n_cell)."""
        stretch, coupling, bending = self._of_cells
        force = stretch * natural.strain
        return force, (bending - coupling**2 / stretch) * natural.along - coupling * natural.strain

    def driven(self, slot: int, driven: Array, by_gradient: bool = False) -> tuple[Array, Array, Array, Array, Array]:
        """Return what an eigenstrain 1 of a layer gives, by parts in cells, shape (n_cell,): rest strains N*/A* of all
        edges, shape (n_copy, n_edge), and of all nodes κ̄₁ (−Σ ℓ M/D in a beam), κ̄y Δl, κ̄x Δl − κ̄₁ and ψ̄ [rad], shape
        (n_copy, n_node). κ̄y Δl has a₁ (κ̄x Δl − κ̄₁) with it, κ̄x of a strip without force: F takes κ̄₁ for κ̄x, see
        `plates`.

        By its gradient, the eigenstrain grows by 1 through the layer and is 0 on average: alone that would bend to
        −1/h, so M = −EI₁/h.
        """
        layer = self._layers[slot]
        if self._plate is not None:
            driven, natural = driven * layer.ratio, self._plate.natural(slot, by_gradient)
            force, moment = self._held(natural)
            strain, bend, free = self._driven_by(driven * force, driven * moment)
            curl = self.to_nodes(self._cells.means(driven * natural.across)) + self.curl * (free - bend)
            twist = self.to_nodes(self._cells.means(driven * natural.twist))
            return strain, bend, curl, free - bend, np.reshape(self._handedness, (-1, 1)) * twist
        if by_gradient:
            moment = -driven * layer.ratio * layer.bend / self._rod.layers[slot].thickness
            strain, bend, free = self._driven_by(0.0 * moment, moment)
        else:
            axial = driven * layer.axial * np.ones_like(layer.ratio)
            strain, bend, free = self._driven_by(axial, -axial * layer.height)
        along, across = DIRECTIONS[self._rod.layers[slot].swelling]
        curl = across * free + self.curl * along * (free - bend)
        return along * strain, along * bend, curl, 0.0 * bend, 0.0 * bend

    def _driven_by(self, force: Array, moment: Array) -> tuple[Array, Array, Array]:
        """Return rest strains of edges, and κ̄₁ and κ̄x Δl of nodes, from what layers would bear in cells at rest [N,
        N m].
        """
        force, moment = self._loads(force, moment)
        part = self._rest_strains(force, moment) / self.axial_stiffness
        return part, self.to_nodes(moment / self._of_halves[2]), self._bend_freely(force, moment)


def _between(edges: Array) -> Array:
    """Return the means of edges before and after nodes, shape (n_copy, n_edge + 1)."""
    padded = np.concatenate([edges[:, :1], edges, edges[:, -1:]], axis=1)
    return 0.5 * (padded[:, 1:] + padded[:, :-1])


def _at_nodes(of_halves: Array) -> Array:
    """Sum the values of halves of successive edges at the nodes next to them, shape (..., n_edge + 1)."""
    of_nodes = np.zeros((*of_halves.shape[:-2], of_halves.shape[-2] + 1))
    of_nodes[..., :-1] += of_halves[..., 0]
    of_nodes[..., 1:] += of_halves[..., 1]
    return of_nodes
