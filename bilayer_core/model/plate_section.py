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

The curve lies where a narrow strip that is bent without twist does not stretch. A pull along it may twist it yet, by
(A⁻¹B)₁₆: that is left out, and `check` says what part of the stiffness it is.
"""

from __future__ import annotations

from dataclasses import dataclass

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


def _turn(angle: float) -> Array:
    """Return the matrix that takes strains (ε_x, ε_y, γ) to those along and across fibres at an angle."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c * c, s * s, c * s], [s * s, c * c, -c * s], [-2 * c * s, 2 * c * s, c * c - s * s]])


def _modulus(layer: Layer, material: Material) -> float:
    """Return E of a layer without its fibres [Pa]."""
    return float(values_at(layer.stiffness, np.zeros(1))[0]) * material.youngs_modulus


def plane_stiffness(layer: Layer, material: Material) -> Array:
    """Return Q of a layer [Pa], shape (3, 3)."""
    fibres = layer.fibres or Fibres(angle=0.0)
    modulus = _modulus(layer, material)
    along, across = fibres.along.stiffness * modulus, fibres.across.stiffness * modulus
    shear = fibres.shear * modulus / (2.0 * (1.0 + material.poisson_ratio))
    ratio = material.poisson_ratio
    share = 1.0 - ratio**2 * across / along
    own = np.array([[along, ratio * across, 0.0], [ratio * across, across, 0.0], [0.0, 0.0, share * shear]]) / share
    turn = _turn(fibres.angle)
    return turn.T @ own @ turn


def free_strain(layer: Layer) -> Array:
    """Return the strain (ε_x, ε_y, γ) of a layer by itself per unit of its eigenstrain."""
    if layer.fibres is None:
        return np.array([*DIRECTIONS[layer.swelling], 0.0])
    own = np.array([layer.fibres.along.swelling, layer.fibres.across.swelling, 0.0])
    return np.linalg.solve(_turn(layer.fibres.angle), own)


@dataclass(frozen=True)
class Natural:
    """Strain and curvatures of a free plate.

    Attributes
    ----------
    strain : float
        Of the curve, along.
    along, across, twist : float
        κ̄_x, κ̄_y and τ̄ [1/m].
    """

    strain: float
    along: float
    across: float
    twist: float


class PlateSection:
    """The section of a strip, per width.

    Attributes
    ----------
    axis : float
        Height of the curve over the path [m].
    stretch : float
        Ẽ [N/m].
    bending : ndarray
        D* [N m], shape (3, 3).
    growth : tuple of float
        Ẽ, k₁, k₃ and κ̄_x over those of a beam of the layers without fibres.
    pulled : float
        Coupling of a pull along the strip with twist, as a part of √(EA GJ).
    """

    def __init__(self, scene: SceneConfig, rod: Rod):
        self._layers = rod.layers
        self._stiffness = [plane_stiffness(layer, scene.materials[layer.material]) for layer in rod.layers]
        self._thickness = [float(values_at(layer.thickness, np.zeros(1))[0]) for layer in rod.layers]
        whole = self._thickness
        self._height = [0.0] if len(whole) == 1 else [-0.5 * whole[0], 0.5 * whole[1]]
        parts = list(zip(self._stiffness, self._thickness, self._height, strict=True))
        a = sum(q * h for q, h, _ in parts)
        b = -sum(q * h * z for q, h, z in parts)
        d = sum(q * (h * z**2 + h**3 / 12.0) for q, h, z in parts)
        self._all = np.block([[a, b], [b, d]])
        flexible = np.linalg.inv(self._all)
        narrow = np.linalg.inv(flexible[np.ix_(NARROW, NARROW)])
        self.axis = float(-narrow[0, 1] / narrow[0, 0])
        self.pulled = float(narrow[0, 2] / np.sqrt(narrow[0, 0] * narrow[2, 2]))
        self.stretch = float(1.0 / np.linalg.inv(a)[0, 0])
        self._offset = float(self.stretch * np.linalg.solve(a, b)[0, 1])
        self.bending = np.linalg.inv(flexible[3:, 3:])
        self.growth = self._growth(scene)

    def _growth(self, scene: SceneConfig) -> tuple[float, float, float, float]:
        """Return Ẽ, k₁, k₃ and κ̄_x over those of a beam of the layers without fibres: Σ E h, Σ E (h (z − z₀)² + h³/12),
        4 Σ G (h (z − z_G)² + h³/12), z₀ the height of the curve, and Timoshenko's curvature.
        """
        materials = [scene.materials[layer.material] for layer in self._layers]
        own = list(zip(map(_modulus, self._layers, materials), self._thickness, self._height, strict=True))
        shear = [(e / (2.0 * (1.0 + of.poisson_ratio)), h, z) for (e, h, z), of in zip(own, materials, strict=True)]
        middle = sum(g * h * z for g, h, z in shear) / sum(g * h for g, h, _ in shear)
        bending, twisting = (
            sum(m * (h * (z - centre) ** 2 + h**3 / 12.0) for m, h, z in parts)
            for parts, centre in ((own, self.axis), (shear, middle))
        )
        along, _, twist = self.narrow
        stretching, (last, thick, high) = sum(e * h for e, h, _ in own), own[-1]
        axis = sum(e * h * z for e, h, z in own) / stretching
        curvature = last * thick * (axis - high) / sum(e * (h * (z - axis) ** 2 + h**3 / 12.0) for e, h, z in own)
        curl = self.natural(len(own) - 1).along / curvature if curvature else 1.0
        return self.stretch / stretching, along / bending, twist / (4.0 * twisting), curl

    @property
    def narrow(self) -> tuple[float, float, float]:
        """k₁, k₁₃ and k₃ of a narrow strip [N m]."""
        d = self.bending
        return (
            float(d[0, 0] - d[0, 1] ** 2 / d[1, 1]),
            float(2.0 * (d[0, 2] - d[0, 1] * d[1, 2] / d[1, 1])),
            float(4.0 * (d[2, 2] - d[1, 2] ** 2 / d[1, 1])),
        )

    @property
    def across(self) -> tuple[float, float]:
        """a₁ and a₃."""
        return float(self.bending[0, 1] / self.bending[1, 1]), float(self.bending[1, 2] / self.bending[1, 1])

    @property
    def plate(self) -> float:
        """D′₂₂ [N m]."""
        return float(self.bending[1, 1] + self._offset**2 / self.stretch)

    @property
    def offset(self) -> float:
        """β."""
        return self._offset / float(np.sqrt(self.stretch * self.plate))

    def bent(self, normal: bool) -> StripLaw:
        """Return the law of a strip that is bent towards its normal, or away from it."""
        slope = 0.5 * sum(self._thickness) * float(np.sqrt(self.stretch / self.plate))
        across = float(self.bending[1, 1] / self.narrow[0])
        return StripLaw(self.across[0], across, self.offset if normal else -self.offset, slope)

    def natural(self, slot: int, gradient: bool = False) -> Natural:
        """Return the free plate of an eigenstrain 1 of one layer, or of one that grows by 1 through its thickness and
        is 0 on average.
        """
        pull = self._stiffness[slot] @ free_strain(self._layers[slot])
        h, z = self._thickness[slot], self._height[slot]
        force, moment = (0.0 * pull, -pull * h**2 / 12.0) if gradient else (pull * h, -pull * h * z)
        found = np.linalg.solve(self._all, np.concatenate([force, moment]))
        return Natural(float(found[0] - self.axis * found[3]), float(found[3]), float(found[4]), 0.5 * float(found[5]))


def plate_section(scene: SceneConfig, rod: Rod) -> PlateSection:
    """Return the section of a strip of a scene."""
    return scene.keep("plate section", (rod,), lambda: PlateSection(scene, rod))
