"""Plates: the curvature and stiffness of strips so wide that their section bends, which that of a beam does not.

In a strip of width w, thickness H and Poisson's ratio ν, curved by κ, the section bends to u(y): D u⁗ + E H κ² u = 0,
with free borders. For uniform material the energy per length has the closed form (τ = 0; κ̄ of a plate that swells
alike in all directions, D = E H³/12(1 − ν²))

    U/w = ½ D [(κ − κ̄)² + κ̄² − 2ν (κ − κ̄) κ̄ − c² g(ψ)],    c = κ̄ − ν (κ − κ̄)
    g = 2 (cosh ψ − cos ψ)/[ψ (sinh ψ + sin ψ)],    ψ = w (3(1 − ν²))^¼ √(|κ|/H)

which was checked against the section solved numerically and against elasticity in space. g → 1, a narrow strip, is the
beam of the models here: stiffness E w H³/12, and at rest κ = κ̄. g → 0 is a plate: D w, and κ = (1 + ν) κ̄. In between
both depend on w²κ̄/H alone. A strip that is curved at rest without swelling has U/w = ½ D (1 − ν² g) (κ − κ̄)², and so at
rest the stiffness EI (1 − ν² g)/(1 − ν²).

A swollen strip that is wide enough has stretches of negative ∂²U/∂κ²: held straighter, it folds in one joint, as a tape
spring does. The figures hold one width away from clamps.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

Array = np.ndarray
SMALL = 0.05
"""ψ below which g is its series: 1 − ψ⁴/180."""
LARGE = 30.0
"""ψ above which g is 2/ψ to the last digit."""
RATIOS = np.geomspace(0.05, 1e4, 400)
"""w²κ̄/H between which curvatures are interpolated."""
STEP = 1e-4
"""Of ratios, for a difference."""
CURVATURES = np.linspace(0.01, 1.6, 1600)
"""Of κ/κ̄, where tangents are looked at."""
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
SECTIONS = 32
"""Golden sections, which leave 1e-7 of κ̄."""
TERMS = 12
"""Of the series of φ, by powers of x²: exact to rounding up to |x| = 32."""


def _factor(ratio: Array, poisson: float) -> Array:
    """Return g of strips by their w²κ/H."""
    psi = (3.0 * (1.0 - poisson**2)) ** 0.25 * np.sqrt(np.asarray(ratio, float))
    middle = np.clip(psi, SMALL, LARGE)
    g = 2.0 * (np.cosh(middle) - np.cos(middle)) / (middle * (np.sinh(middle) + np.sin(middle)))
    return np.where(psi < SMALL, 1.0 - psi**4 / 180.0, np.where(psi > LARGE, 2.0 / np.maximum(psi, LARGE), g))


def swollen_energy(curvature: Array, ratio: float | Array, poisson: float) -> Array:
    """Return U/(½ w D κ̄²) of a strip that swells alike in all directions.

    Parameters
    ----------
    curvature : ndarray
        κ/κ̄, above 0.
    ratio : float or ndarray
        w²κ̄/H.
    poisson : float
        ν.
    """
    g = _factor(ratio * curvature, poisson)
    change = curvature - 1.0
    return change**2 + 1.0 - 2.0 * poisson * change - (1.0 - poisson * change) ** 2 * g


@lru_cache(maxsize=32)
def _rests(poisson: float) -> Array:
    """Return κ/κ̄ at rest for each of `RATIOS`."""
    low, high = np.full(RATIOS.size, 0.5), np.full(RATIOS.size, 1.05 + max(poisson, 0.0))
    for _ in range(SECTIONS):  # of the least energy by golden sections
        first, second = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        left = swollen_energy(first, RATIOS, poisson) < swollen_energy(second, RATIOS, poisson)
        low, high = np.where(left, low, first), np.where(left, second, high)
    return 0.5 * (low + high)


def swollen_curvature(ratio: Array, poisson: float) -> Array:
    """Return κ/κ̄ at rest of strips that swell alike in all directions, by their w²κ̄/H."""
    return np.interp(np.log(np.maximum(ratio, RATIOS[0])), np.log(RATIOS), _rests(poisson))


def swollen_curvature_across(ratio: Array, poisson: float) -> Array:
    """Return the mean curvature across over κ̄, in the state of `swollen_curvature`: (1 − ν (κ/κ̄ − 1)) g."""
    along = swollen_curvature(ratio, poisson)
    return (1.0 - poisson * (along - 1.0)) * _factor(ratio * along, poisson)


def curved_stiffness(ratio: Array, poisson: float) -> Array:
    """Return the bending stiffness at rest, over EI, of strips that are curved without swelling, by their w²κ/H."""
    return (1.0 - poisson**2 * _factor(ratio, poisson)) / (1.0 - poisson**2)


def bent_stiffness(ratio: Array, poisson: float) -> Array:
    """Return the moment over EI κ of flat strips that are bent to w²κ/H: with the energy EI κ² g/2, in which g is
    `curved_stiffness`, d(r² g)/d(r²).
    """
    ends = np.multiply.outer([1.0 - STEP, 1.0 + STEP], ratio)
    energy = ends**2 * curved_stiffness(ends, poisson)
    return (energy[1] - energy[0]) / (ends[1] ** 2 - ends[0] ** 2)


@lru_cache(maxsize=256)
def folds(ratio: float, poisson: float) -> bool:
    """Return whether a swollen strip, held straighter than it rests, has a negative tangent somewhere."""
    energy = swollen_energy(CURVATURES, ratio, poisson)
    return bool((np.diff(energy, 2) < 0.0).any())


def flattening_series(offset: Array) -> Array:
    """Return the coefficients of φ(x; β) = (N₀ + x N₁)/(D₀ + x D₁), polynomials of x²; see `forces.flattening`.

    Parameters
    ----------
    offset : ndarray
        β, shape (n,).

    Returns
    -------
    ndarray
        Of N₀, D₀, N₁ and D₁, the highest power first, shape (n, 4, TERMS).
    """
    power, offset = np.arange(2 * TERMS + 3), np.asarray(offset, float)[:, None]
    up, down = (1.0 + offset) ** power, (offset - 1.0) ** power
    factorial = np.array([float(math.factorial(2 * k + 1)) for k in power])
    below = (up + down)[:, :-1] / factorial[:-1]
    above = below - 2.0 * (up - down)[:, 1:] / (factorial[:-1] * (2.0 * power[1:]))
    columns = above[:, 2::2], below[:, :-2:2], above[:, 3::2], below[:, 1:-2:2]
    return np.stack([column[:, TERMS - 1 :: -1] for column in columns], axis=1)
