"""Sections of strips by the theory of laminated plates: layers with fibres at an angle, or of unlike Poisson's ratios.

The plate has x along the path, z along the normal and y = z × x. A point at the height z over the path has the strain
ε(z) = ε₀ − z k, with ε = (ε_x, ε_y, γ) and k = (κ_x, κ_y, 2τ), curvatures positive towards the normal and τ
right-handed about the path. A layer has the thickness h, its middle at z_l, the stiffness Q of its plane and the
eigenstrain e:

    u = ½ ∫ (ε − e)ᵀ Q (ε − e) dz,   A = Σ Q h,   B = −Σ Q h z_l,   D = Σ Q (h z_l² + h³/12)

In a strip the borders are free: no in-plane force acts across, and none along unless something pulls. Without in-plane
forces ε₀ = −A⁻¹ B k, and what is left is ½ (k − k̄)ᵀ D* (k − k̄) with D* = D − B A⁻¹ B. In a narrow strip κ_y follows as
well, which leaves k₁ κ² + 2 k₁₃ κ τ + k₃ τ² about the natural κ̄_x and τ̄,

    k₁ = D*₁₁ − D*₁₂²/D*₂₂,   k₁₃ = 2 (D*₁₆ − D*₁₂ D*₂₆/D*₂₂),   k₃ = 4 (D*₆₆ − D*₂₆²/D*₂₂)
    κ_y = κ̄_y − a₁ (κ − κ̄_x) − 2 a₃ (τ − τ̄),   a₁ = D*₁₂/D*₂₂,   a₃ = D*₂₆/D*₂₂

and in a wider one it cannot (`forces.flattening`). In that, strains along vary across the width and meet curvatures
across: ½ Ẽ ε² + b ε κ_y + ½ D′₂₂ κ_y² with Ẽ = 1/(A⁻¹)₁₁, b = Ẽ (A⁻¹ B)₁₂ and D′₂₂ = D*₂₂ + b²/Ẽ, so β = b/√(Ẽ D′₂₂).

The axis lies where a narrow strip that is bent without twist does not stretch. A pull along it may twist it yet, by
(A⁻¹B)₁₆: that is left out, and `check` says what part of the stiffness it is.

All of this is given at some places along the rod, where layers may have other thicknesses and moduli, or be missing.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from bilayer_core.model.plate_strip import StripLaw
from bilayer_core.scene.config import Material, SceneConfig
from bilayer_core.scene.profile import values_at
from bilayer_core.scene.rod import Fibres, Layer, Rod

Array = np.ndarray
NARROW = (0, 3, 5)
"""What a narrow strip is held at, of (ε_x, ε_y, γ, κ_x, κ_y, 2τ)."""
DIRECTIONS = {"isotropic": (1.0, 1.0), "along": (1.0, 0.0), "across": (0.0, 1.0)}
"""Eigenstrain along and across the path, by `Layer.swelling`."""


def is_plate(scene: SceneConfig, rod: Rod) -> bool:
    """Return whether the section of a strip takes the theory of laminated plates: it is a beam's times one matrix if
    its layers are isotropic and have one Poisson's ratio.
    """
    ratios = {scene.materials[layer.material].poisson_ratio for layer in rod.layers}
    return len(ratios) > 1 or any(layer.fibres is not None for layer in rod.layers)


def _turn(fibres: Fibres, along: Array) -> Array:
    """Return the matrices that take strains (ε_x, ε_y, γ) to those along and across fibres, shape (n_place, 3, 3)."""
    angle = values_at(fibres.angle, along)
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c * c, s * s, c * s], [s * s, c * c, -c * s], [-2 * c * s, 2 * c * s, c * c - s * s]])
    return np.moveaxis(turn, -1, 0)


def plane_stiffness(layer: Layer, material: Material, along: Array) -> Array:
    """Return Q of a layer at lengths along the path [m], for the multiple 1 of its moduli [Pa], shape (n_place, 3,
    3).
    """
    fibres = layer.fibres or Fibres(angle=0.0)
    stiff, soft = (part.stiffness * material.youngs_modulus for part in (fibres.along, fibres.across))
    ratio = material.poisson_ratio
    shear = fibres.shear * material.youngs_modulus / (2.0 * (1.0 + ratio))
    share = 1.0 - ratio**2 * soft / stiff
    own = np.array([[stiff, ratio * soft, 0.0], [ratio * soft, soft, 0.0], [0.0, 0.0, share * shear]]) / share
    turn = _turn(fibres, along)
    return turn.swapaxes(1, 2) @ own @ turn


def free_strain(layer: Layer, along: Array) -> Array:
    """Return the strain (ε_x, ε_y, γ) of a layer by itself per unit of its eigenstrain at lengths along the path [m],
    shape (n_place, 3).
    """
    if layer.fibres is None:
        return np.tile([*DIRECTIONS[layer.swelling], 0.0], (len(along), 1))
    own = np.array([layer.fibres.along.swelling, layer.fibres.across.swelling, 0.0])
    return np.linalg.solve(_turn(layer.fibres, along), own[:, None])[..., 0]


@dataclass(frozen=True)
class Natural:
    """Strain and curvatures of a free plate at places, shape (n_place,).

    Attributes
    ----------
    strain : ndarray
        Of the axis, along.
    along, across, twist : ndarray
        κ̄_x, κ̄_y and τ̄ [1/m].
    """

    strain: Array
    along: Array
    across: Array
    twist: Array


class PlateSection:
    """The section of a strip at places along it, per width; shapes (n_place,).

    Attributes
    ----------
    axis : ndarray
        Height of the axis over the path [m].
    stretch : ndarray
        Ẽ [N/m].
    bending : ndarray
        D* [N m], shape (n_place, 3, 3).
    growth : tuple of ndarray
        Ẽ, k₁, k₃ and κ̄_x over those of a beam of the layers without fibres.
    pulled : ndarray
        Coupling of a pull along the strip with twist, as a part of √(EA GJ).
    """

    def __init__(self, scene: SceneConfig, rod: Rod, along: Array, present: Array):
        """Take lengths along the path [m], shape (n_place,), and which layers are there, shape (n_layer, n_place)."""
        self._layers, self._materials = rod.layers, [scene.materials[layer.material] for layer in rod.layers]
        self._along = along
        whole = [values_at(layer.thickness, along) for layer in rod.layers]
        self._height = [0.0 * whole[0]] if len(whole) == 1 else [-0.5 * whole[0], 0.5 * whole[1]]
        self._thickness = [there * h for there, h in zip(present, whole, strict=True)]
        self._multiple = [values_at(layer.stiffness, along) for layer in rod.layers]
        self._stiffness = [
            multiple[:, None, None] * plane_stiffness(layer, material, along)
            for multiple, layer, material in zip(self._multiple, self._layers, self._materials, strict=True)
        ]
        parts = [
            (q, h[:, None, None], z[:, None, None])
            for q, h, z in zip(self._stiffness, self._thickness, self._height, strict=True)
        ]
        a = sum(q * h for q, h, _ in parts)
        b = -sum(q * h * z for q, h, z in parts)
        d = sum(q * (h * z**2 + h**3 / 12.0) for q, h, z in parts)
        self._all = np.block([[a, b], [b, d]])
        flexible = np.linalg.inv(self._all)
        narrow = np.linalg.inv(flexible[:, NARROW][:, :, NARROW])
        self.axis = -narrow[:, 0, 1] / narrow[:, 0, 0]
        self.pulled = narrow[:, 0, 2] / np.sqrt(narrow[:, 0, 0] * narrow[:, 2, 2])
        self.stretch = 1.0 / np.linalg.inv(a)[:, 0, 0]
        self._offset = self.stretch * np.linalg.solve(a, b)[:, 0, 1]
        self.bending = np.linalg.inv(flexible[:, 3:, 3:])
        self.growth = self._growth()

    def _growth(self) -> tuple[Array, Array, Array, Array]:
        """Return Ẽ, k₁, k₃ and κ̄_x over those of a beam of the layers without fibres: Σ E h, Σ E (h (z − z₀)² + h³/12),
        4 Σ G (h (z − z_G)² + h³/12), z₀ the height of the axis, and Timoshenko's curvature.
        """
        moduli = [m * of.youngs_modulus for m, of in zip(self._multiple, self._materials, strict=True)]
        own = list(zip(moduli, self._thickness, self._height, strict=True))
        shear = [
            (e / (2.0 * (1.0 + of.poisson_ratio)), h, z) for (e, h, z), of in zip(own, self._materials, strict=True)
        ]
        middle = sum(g * h * z for g, h, z in shear) / sum(g * h for g, h, _ in shear)
        bending, twisting = (
            sum(m * (h * (z - centre) ** 2 + h**3 / 12.0) for m, h, z in parts)
            for parts, centre in ((own, self.axis), (shear, middle))
        )
        along, _, twist = self.narrow
        stretching, (last, thick, high) = sum(e * h for e, h, _ in own), own[-1]
        axis = sum(e * h * z for e, h, z in own) / stretching
        beam = last * thick * (axis - high) / sum(e * (h * (z - axis) ** 2 + h**3 / 12.0) for e, h, z in own)
        curl, bent = np.ones_like(beam), beam != 0.0
        curl[bent] = self.natural(len(own) - 1).along[bent] / beam[bent]
        return self.stretch / stretching, along / bending, twist / (4.0 * twisting), curl

    @property
    def narrow(self) -> tuple[Array, Array, Array]:
        """k₁, k₁₃ and k₃ of a narrow strip [N m]."""
        d = np.moveaxis(self.bending, 0, -1)
        return (
            d[0, 0] - d[0, 1] ** 2 / d[1, 1],
            2.0 * (d[0, 2] - d[0, 1] * d[1, 2] / d[1, 1]),
            4.0 * (d[2, 2] - d[1, 2] ** 2 / d[1, 1]),
        )

    @property
    def across(self) -> tuple[Array, Array]:
        """a₁ and a₃."""
        return self.bending[:, 0, 1] / self.bending[:, 1, 1], self.bending[:, 1, 2] / self.bending[:, 1, 1]

    @property
    def plate(self) -> Array:
        """D′₂₂ [N m]."""
        return self.bending[:, 1, 1] + self._offset**2 / self.stretch

    @property
    def offset(self) -> Array:
        """β."""
        return self._offset / np.sqrt(self.stretch * self.plate)

    def bent(self, normal: bool) -> StripLaw:
        """Return the law of a strip that is bent towards its normal, or away from it, with the first section."""
        slope = 0.5 * sum(self._thickness) * np.sqrt(self.stretch / self.plate)
        across, offset = self.bending[:, 1, 1] / self.narrow[0], self.offset if normal else -self.offset
        return StripLaw(*(float(of[0]) for of in (self.across[0], across, offset, slope)))

    def natural(self, slot: int, gradient: bool = False) -> Natural:
        """Return the free plate of an eigenstrain 1 of one layer, or of one that grows by 1 through its thickness and
        is 0 on average.
        """
        pull = (self._stiffness[slot] @ free_strain(self._layers[slot], self._along)[..., None])[..., 0]
        h, z = self._thickness[slot][:, None], self._height[slot][:, None]
        return self._free(0.0 * pull, -pull * h**2 / 12.0) if gradient else self._free(pull * h, -pull * h * z)

    def bent_by(self, slot: int, along: Array, twist: Array) -> Natural:
        """Return the free plate of a layer that by itself has a curvature and a twist [1/m], shape (..., n_place)."""
        bend, turn = (
            self._free(0.0 * pull, pull * self._thickness[slot][:, None] ** 3 / 12.0)
            for pull in (self._stiffness[slot][:, :, 0], 2.0 * self._stiffness[slot][:, :, 2])
        )
        parts = ((getattr(bend, key.name), getattr(turn, key.name)) for key in fields(Natural))
        return Natural(*(along * one + twist * other for one, other in parts))

    def _free(self, force: Array, moment: Array) -> Natural:
        """Return the plate that nothing holds, of what its layers would bear if it were held, shapes (n_place, 3)."""
        found = np.linalg.solve(self._all, np.concatenate([force, moment], axis=1)[..., None])[..., 0].T
        return Natural(found[0] - self.axis * found[3], found[3], found[4], 0.5 * found[5])


def plate_section(scene: SceneConfig, rod: Rod) -> PlateSection:
    """Return the section of a strip of a scene at one place, in the middle of where it has all of its layers."""

    def made() -> PlateSection:
        spans = np.array([rod.span_of(layer) for layer in rod.layers])
        middle = 0.5 * (spans[:, 0].max() + spans[:, 1].min())
        return PlateSection(scene, rod, np.array([rod.edge_length * middle]), np.ones((len(rod.layers), 1)))

    return scene.keep("plate section", (rod,), made)
