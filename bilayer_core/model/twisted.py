"""Where the validity of the models ends in twist, each with an estimate of the error.

One curve for two layers. Natural twist winds a rod up to a helix, or its path is one. `laminate` is linear in the
strains of its layers; what it leaves out is of the order of (z τ)² beside stretching and of z τ beside curvature and
twist, z the distance of a layer from the curve: their centrelines are helices themselves, longer and tilted (ψ),

    a = 1 + ε − z χ,  b = z τ,  r = √(a² + b²),  ψ = atan2(b, a),  χ_l = χ cos ψ − τ sin ψ,  τ_l = τ cos ψ + χ sin ψ
    E = Σ ½ EA (r − r₀ − η)² + ½ EI₁ (χ_l − χ̄_l)² + ½ GJ (τ_l − τ̄_l)² + ½ k_φ (ψ_top − ψ_bottom − ψ₀)²    per length

where r₀, ψ₀ and, unless a layer has natural ones, χ̄_l, τ̄_l are those of the path with its curvature and twist (that
across the width is not looked at). On the neutral axis the linear part of E has the stiffnesses A, D and GJ
alone; from its minimum x₀ = (ε, χ, τ) one step x₁ = x₀ − (∂E/∂x)/(A, D, GJ) leads to that of E but for terms of second
order. Radius |χ|/(χ² + τ²) and pitch 2π |τ|/(χ² + τ²) at x₀ and x₁ give the error: 11.1 % of the radius for natural
(15, 150) 1/m on a straight layer, 1 + 1 mm, 10 mm wide, where least energy has 11.05 % (`verification.validate.helix`).

Clamped ends. The model lets a section warp everywhere. At a clamp it cannot; the twist grows from zero over a length
(Wagner 1929, Vlasov 1940; GJ τ − EC_w τ″ = torque)

    ℓ = √(EC_w/GJ),   EC_w = w² D′/12 · [(w² − H²)/(w² + H²)]²

D′ the bending stiffness with E/(1 − ν²), since the clamp holds the section's shape too, and the bracket an ellipse's
warping over that of a thin strip. A rod of length L with n clamped ends turns less by the part (n ℓ/L) tanh(L/(n ℓ)).
Against elasticity in space ℓ is 1 to 13 % too long for w ≥ 5 H, up to 30 % for thicker strips or unlike layers
(`tests/physics/test_twisted.py`). Two rods hold a part of it back by themselves, because their centrelines
bend across the width: there EC_w = Σ EI₂ z², four fifths of the length for equal layers of ν = 0.5.

Wide strips. Twist stretches fibres by ½ y² (τ² − τ̄²), y across the width: about its mean, which length relieves, that
stores Σ EA (w⁴/1440) (τ² − τ̄²)², and the torque changes by the part Σ EA w⁴ (τ² − τ̄²)/(360 GJ). No rod has it.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np

from bilayer_core.model.edge_figures import edge_figures
from bilayer_core.model.findings import Figure
from bilayer_core.model.section import bond, outline, sections
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.profile import extremes, values_at
from bilayer_core.scene.rod import Rod

Array = np.ndarray
HELIX = 0.01
"""Of radius or pitch: the error from which on one curve is not for two layers."""
VISIBLE = 1e-4
"""Of the rod's length: an end is no further off than adaptive steps may be by default, and the error does not count."""
HELD_BACK = 0.02
"""Of a rod's twist, by clamps."""
STRETCH = 0.05
"""Of the torque, by the stretch of borders."""


def twist_figures(scene: SceneConfig, model: str, dimension: int) -> Iterator[Figure]:
    """Yield the figures of rods that twist, as they are computed."""
    variants = [variant for scene_rod in scene.rods for variant in scene_rod.variants]
    for rod in variants if dimension == 3 else ():
        natural, wound = _naturally_twisted(rod), _on_twisted_path(rod)
        if not (natural or wound or _twisted_by_bodies(scene, rod)):
            continue
        twisted = TwistedRod(scene, rod)
        if rod.clamp_start or rod.clamp_end:
            yield _of_clamps(rod, twisted.held_back(two_rods=model == "two_rod"))
        if natural:
            yield _of_borders(rod, twisted.stretch())
        if (natural or wound) and model == "laminate" and len(rod.layers) == 2:
            yield _of_helix(rod, *twisted.helix_errors())


def helix_error(scene: SceneConfig, rod: Rod) -> float:
    """Return the part by which `laminate` misses radius or pitch of a rod that natural twist or its path winds up."""
    return max(TwistedRod(scene, rod).helix_errors()) if _naturally_twisted(rod) or _on_twisted_path(rod) else 0.0


def _naturally_twisted(rod: Rod) -> bool:
    return any(extremes(layer.natural_twist) != (0.0, 0.0) for layer in rod.layers)


def _on_twisted_path(rod: Rod) -> bool:
    return bool(rod.curvatures_at(_middles(rod))[:, 2].any())


def _middles(rod: Rod) -> Array:
    """Return the middles of edges as lengths along the path [m], shape (n_edge,)."""
    return rod.edge_length * (np.arange(rod.stations - 1) + 0.5)


def _twisted_by_bodies(scene: SceneConfig, rod: Rod) -> bool:
    """Return whether the rod is held by two bodies that may turn against each other."""
    held = [body.motion for body in scene.bodies if body.name in (rod.clamp_start, rod.clamp_end)]
    return len(held) == 2 and any(motion.turns for motion in held)


def _of_clamps(rod: Rod, part: float) -> Figure:
    return Figure(
        f"rods.{rod.name}",
        "clamped ends hold back about",
        f"{100 * part:.2g} % of its twist",
        f"at most {100 * HELD_BACK:g} %",
        part / HELD_BACK,
        "there a section cannot warp, in the model it can, so what is computed twists by that much more"
        if part > HELD_BACK
        else "",
    )


def _of_borders(rod: Rod, part: float) -> Figure:
    return Figure(
        f"rods.{rod.name}",
        "natural twist stretches its borders, which changes its torque by up to",
        f"{100 * part:.2g} %",
        f"at most {100 * STRETCH:g} %",
        part / STRETCH,
        "it is too wide to twist as a rod, and a real strip winds up differently" if part > STRETCH else "",
    )


def _of_helix(rod: Rod, radius: float, pitch: float) -> Figure:
    return Figure(
        f"rods.{rod.name}",
        "as one curve, the helix to which it winds is off by",
        f"{100 * radius:.2g} % in radius, {100 * pitch:.2g} % in pitch",
        f"at most {100 * HELIX:g} %",
        max(radius, pitch) / HELIX,
        "one curve is linear in the strains of its layers; `--model two_rod` is not"
        if max(radius, pitch) > HELIX
        else "",
    )


class TwistedRod:
    """Stiffness and natural shape of a rod's layers at the middle of its edges; arrays have shape (n_layer, n_edge), or
    (n_edge,) for the whole section.
    """

    def __init__(self, scene: SceneConfig, rod: Rod):
        stations = np.arange(rod.stations - 1) + 0.5
        along = _middles(rod)
        materials = [scene.materials[layer.material] for layer in rod.layers]
        own = [sections(rod, layer, material, stations) for layer, material in zip(rod.layers, materials, strict=True)]
        self._width, thickness = outline(rod, stations)
        present = thickness > 0.0
        self._height = thickness.sum(axis=0)
        self._axial = present * [section.axial_stiffness for section in own]
        self._bend, self._across = (present * [section.bending_stiffness[axis] for section in own] for axis in (0, 1))
        self._twist = present * [section.twisting_stiffness for section in own]
        self._plane_strain = np.array([[1.0 / (1.0 - material.poisson_ratio**2)] for material in materials])
        middle = thickness * (0.0 if len(own) == 1 else np.array([[-0.5], [0.5]]))
        self._middle = middle
        self._tilt = np.zeros(len(stations))
        if len(own) == 2:
            self._tilt = present.all(axis=0) * bond(*own, scene.coupling, rod.torsion).tilt
        self._tilt_arm = middle[-1] - middle[0]
        self._path, _, self._path_twist = rod.curvatures_at(along).T
        self._natural_curvature = np.array(
            [
                self._path if layer.natural_curvature is None else values_at(layer.natural_curvature, along)
                for layer in rod.layers
            ]
        )
        self._bent = np.array([[layer.natural_curvature is not None] for layer in rod.layers])
        self._natural_twist = np.array([values_at(layer.natural_twist, along) for layer in rod.layers])
        self._length, self._clamps = rod.path.length, (bool(rod.clamp_start), bool(rod.clamp_end))
        self._eigenstrain = edge_figures(scene, rod).eigenstrain_range
        self._height_over_axis = self._over_axis(self._axial)
        self._whole_twist = self._twist.sum(axis=0) + self._tilt * self._tilt_arm**2

    def _over_axis(self, axial: Array) -> Array:
        """Return the heights of layers over the neutral axis [m]."""
        return self._middle - (axial * self._middle).sum(axis=0) / axial.sum(axis=0)

    def held_back(self, two_rods: bool) -> float:
        """Return the part of the twist that clamps hold back and the model does not."""
        axial, bend = self._plane_strain * self._axial, self._plane_strain * self._bend
        bending = (bend + axial * self._over_axis(axial) ** 2).sum(axis=0)
        squares = self._width**2, self._height**2
        shape = abs(squares[0] - squares[1]) / (squares[0] + squares[1])
        length = np.sqrt(self._width**2 * bending / 12.0 / self._whole_twist) * shape
        if two_rods:
            own = np.sqrt((self._across * self._height_over_axis**2).sum(axis=0) / self._whole_twist)
            length = np.maximum(length - own, 0.0)
        whole = sum(length[end] for end, clamped in zip((0, -1), self._clamps, strict=True) if clamped)
        return float(whole / self._length * np.tanh(self._length / max(whole, 1e-300)))

    def stretch(self) -> float:
        """Return the largest part by which the stretch of borders changes the torque."""
        natural = self._path_twist + self._natural_twist
        squares = (self._axial * (self._linear(0.0)[2] ** 2 - natural**2)).sum(axis=0)
        return float(np.abs(squares * self._width**4 / (360.0 * self._whole_twist)).max())

    def _stiffness(self) -> Array:
        """Return A, D, GJ on the neutral axis, shape (3, n_edge)."""
        bending = self._bend + self._axial * self._height_over_axis**2
        return np.array([self._axial.sum(axis=0), bending.sum(axis=0), self._whole_twist])

    def _linear(self, eigenstrain: Array | float) -> Array:
        """Return ε, χ, τ of `laminate`, shape (3, n_edge)."""
        force = self._axial * eigenstrain
        moment = self._bend * (self._natural_curvature - self._path) - force * self._height_over_axis
        loads = np.array([force.sum(axis=0), moment.sum(axis=0), (self._twist * self._natural_twist).sum(axis=0)])
        return loads / self._stiffness() + np.array([0.0 * self._path, self._path, self._path_twist])

    def _of_layers(self, at: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Return r, ψ, χ_l, τ_l of layers and cos ψ for ε, χ, τ of the curve, shapes (n_layer, n_edge)."""
        (strain, chi, tau), z = at, self._height_over_axis
        a, b = 1.0 + strain - z * chi, z * tau
        r = np.hypot(a, b)
        cosine, sine = a / r, b / r
        return r, np.arctan2(b, a), chi * cosine - tau * sine, tau * cosine + chi * sine, cosine

    def _gradient(self, at: Array, eigenstrain: Array | float) -> Array:
        """Return ∂E/∂(ε, χ, τ), shape (3, n_edge)."""
        z = self._height_over_axis
        r, tilt, own_chi, own_tau, cosine = self._of_layers(at)
        sine = z * at[2] / r
        start = np.array([0.0 * self._path, self._path, self._path_twist])
        r0, tilt0, chi0, tau0, _ = self._of_layers(start)
        force = self._axial * (r - r0 - eigenstrain)
        moment = self._bend * (own_chi - np.where(self._bent, self._natural_curvature, chi0))
        torque = self._twist * (own_tau - tau0 - self._natural_twist)
        along_tilt = own_chi * torque - own_tau * moment
        bond_moment = self._tilt * (tilt[-1] - tilt[0] - (tilt0[-1] - tilt0[0]))
        along_tilt[-1] += bond_moment
        along_tilt[0] -= bond_moment
        along_a, along_b = force * cosine - along_tilt * sine / r, force * sine + along_tilt * cosine / r
        return np.array(
            [
                along_a.sum(axis=0),
                (moment * cosine + torque * sine - z * along_a).sum(axis=0),
                (torque * cosine - moment * sine + z * along_b).sum(axis=0),
            ]
        )

    def helix_errors(self) -> tuple[float, float]:
        """Return the largest relative errors of radius and pitch of `laminate`, without stimuli and at all their
        extremes.
        """
        if len(self._axial) == 1:
            return 0.0, 0.0
        errors = np.zeros(2)
        for state in [None, *product((0, 1), repeat=2)]:
            eigenstrain = 0.0 if state is None else self._eigenstrain[state, (0, 1)]
            linear = self._linear(eigenstrain)
            change = -self._gradient(linear, eigenstrain) / self._stiffness()
            seen = 0.5 * self._length * np.hypot(change[1], change[2]) > VISIBLE
            (one, two) = (_helix(at) for at in (linear, linear + change))
            relative = np.abs(one - two) / np.maximum(two, np.finfo(float).tiny)
            errors = np.maximum(errors, np.max(seen * relative, axis=1))
        return float(errors[0]), float(errors[1])


def _helix(at: Array) -> Array:
    """Return the radius and pitch/2π [m] of a curve of ε, χ, τ, shape (2, n_edge)."""
    strain, chi, tau = at
    return (1.0 + strain) * np.abs([chi, tau]) / np.maximum(chi**2 + tau**2, np.finfo(float).tiny)
