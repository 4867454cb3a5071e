"""Stiffness and inertia of sections: rectangles, alone and bonded in pairs (thickness h through the layer, width w,
their middles one over the other), and round ones, hollow or not.

All of them are given at some places along a path; arrays have shape (n_place,). Where a section changes along a rod,
masses, axial stiffness and bonds take that in the middle of an edge; bending, twist, contact and drag that at the node.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bilayer_core.model.torsion_section import bond_torsion, rectangle_torsion
from bilayer_core.model.unknown_order import ReadOnlyArrays
from bilayer_core.scene.config import Coupling, Material
from bilayer_core.scene.profile import values_at
from bilayer_core.scene.rod import Layer, Rod

Array = np.ndarray


@dataclass(frozen=True)
class Section(ReadOnlyArrays):
    """A layer's cross-sections.

    Attributes
    ----------
    axial_stiffness : Array
        EA = E w h [N].
    bending_stiffness : tuple of Array
        EI1 = E w h³/12 (curvature through the thickness) and EI2 = E h w³/12 (across the width) [N m²].
    shear_modulus : Array
        G [Pa].
    mass : Array
        ρ w h per length [kg/m].
    spin_inertia : Array
        ρ w h (w² + h²)/12 per length, about the tangent [kg m].
    width, thickness : Array
        [m]
    polar_stiffness : Array or None
        GJ of a round section, 2 G I [N m²].
    """

    axial_stiffness: Array
    bending_stiffness: tuple[Array, Array]
    shear_modulus: Array
    mass: Array
    spin_inertia: Array
    width: Array
    thickness: Array
    polar_stiffness: Array | None = None

    @cached_property
    def twisting_stiffness(self) -> Array:
        """GJ of the layer by itself (see `torsion_section`) [N m²]."""
        if self.polar_stiffness is not None:
            return self.polar_stiffness
        stiffness = rectangle_torsion(self.shear_modulus, self.width, self.thickness)
        stiffness.setflags(write=False)
        return stiffness


def sections(rod: Rod, layer: Layer, material: Material, stations: Array) -> Section:
    """Return the sections of a layer at stations of its rod, which may be whole numbers or lie between."""

    def made() -> Section:
        along = rod.edge_length * rod.on_path(stations)
        stiffness = values_at(layer.stiffness, along)
        if rod.radius is not None:
            return tube(material, values_at(rod.radius, along), values_at(rod.inner_radius, along), stiffness)
        return rectangle(material, values_at(rod.width_of(layer), along), values_at(layer.thickness, along), stiffness)

    return rod.keep(("sections", stations.tobytes()), (layer, material), made)


def outline(rod: Rod, stations: Array) -> tuple[Array, Array]:
    """Return the width of a rod, that of the widest layer there, and the thickness of its layers [m] at stations, which
    may be whole numbers or lie between; shapes (n_place,) and (n_layer, n_place). Thickness is 0 where a layer is not:
    at stations outside those nearest to its interval, and between two that it covers no part of.
    """
    stations = rod.on_path(stations)
    along, edges = rod.edge_length * stations, np.floor(stations)
    width, thickness = np.zeros(len(stations)), np.zeros((len(rod.layers), len(stations)))
    for own, layer in zip(thickness, rod.layers, strict=True):
        first, last = rod.covered_stations(layer)
        at_station = (first <= stations) & (stations <= last)
        there = np.where(edges == stations, at_station, rod.covered_parts(edges, layer) > 0.0)
        own[:] = values_at(layer.thickness, along) * there
        width = np.maximum(width, values_at(rod.width_of(layer), along) * there)
    return width, thickness


def rectangle(material: Material, width: Array, thickness: Array, stiffness: Array | float = 1.0) -> Section:
    """Return the sections `width` × `thickness` [m] of `material`, whose moduli are multiplied with `stiffness`."""
    e = stiffness * material.youngs_modulus
    g = e / (2.0 * (1.0 + material.poisson_ratio))
    area = width * thickness
    return Section(
        axial_stiffness=e * area,
        bending_stiffness=(e * width * thickness**3 / 12.0, e * thickness * width**3 / 12.0),
        shear_modulus=g,
        mass=material.density * area,
        spin_inertia=material.density * area * (width**2 + thickness**2) / 12.0,
        width=width,
        thickness=thickness,
    )


def tube(material: Material, radius: Array, inner: Array, stiffness: Array | float = 1.0) -> Section:
    """Return the round sections of `material` from an inner radius to a radius [m], with moduli times `stiffness`:
    A = π (R² − r²), I = π/4 (R⁴ − r⁴), J = 2 I.
    """
    e = stiffness * material.youngs_modulus
    g = e / (2.0 * (1.0 + material.poisson_ratio))
    area, second = np.pi * (radius**2 - inner**2), 0.25 * np.pi * (radius**4 - inner**4)
    return Section(
        axial_stiffness=e * area,
        bending_stiffness=(e * second, e * second),
        shear_modulus=g,
        mass=material.density * area,
        spin_inertia=material.density * 2.0 * second,
        width=2.0 * radius,
        thickness=2.0 * radius,
        polar_stiffness=2.0 * g * second,
    )


@dataclass(frozen=True)
class Bond:
    """Stiffness of the bond between two layers, as energies per unit length (see `forces.bond`).

    Attributes
    ----------
    translation : Array
        k_T [N/m²].
    bending, tilt, twist : Array
        k_b about m2, k_φ about m1, k_τ about the tangent [N].
    """

    translation: Array
    bending: Array
    tilt: Array
    twist: Array


def bond(bottom: Section, top: Section, multiples: Coupling, torsion: str) -> Bond:
    """Return the bond of two sections whose centrelines are c = (h₁ + h₂)/2 apart.

    k_T = 10 EA_r/c², k_b = 10 EA_r, k_τ = 10 min(GJ)/c² with the default multiples, EA_r = EA₁EA₂/(EA₁ + EA₂): the
    error of the penalty is below 0.04 %, and curvature gradients do not lock. For ``torsion: laminate``
    k_φ = (GJ_lam − ΣGJ)/c² (`torsion_section`): in a strip of twist τ the centrelines tilt by c τ, and ½ k_φ c² τ² is
    what the layers by themselves lack of the bonded section.
    """
    distance2 = 0.25 * (bottom.thickness + top.thickness) ** 2
    reduced = bottom.axial_stiffness * top.axial_stiffness / (bottom.axial_stiffness + top.axial_stiffness)
    tilt = np.zeros_like(distance2)
    if torsion == "laminate":
        parts = (np.array([getattr(s, key) for s in (bottom, top)]) for key in ("shear_modulus", "width", "thickness"))
        tilt = bond_torsion(*parts) / distance2
    return Bond(
        translation=multiples.translation * reduced / distance2,
        bending=multiples.bending * reduced,
        tilt=tilt,
        twist=multiples.twist * np.minimum(bottom.twisting_stiffness, top.twisting_stiffness) / distance2,
    )
