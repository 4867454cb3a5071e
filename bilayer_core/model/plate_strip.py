"""Plates: the curvature and stiffness of strips so wide that their section bends, which that of a beam does not.

A strip that swells alike in all directions to the curvature κ̄, where it is narrow, has the energy (`forces.flattening`
without twist)

    U/(½ k₁ κ̄²) = (κ/κ̄ − 1)² + (D*₂₂/k₁) (1 − a₁ (κ/κ̄ − 1))² (1 − g(x; β)),   x = ½ w² κ √(Ẽ/D₂₂)

For layers with one Poisson's ratio a₁ = ν, D*₂₂/k₁ = 1/(1 − ν²), β = 0 and, of one modulus, x = w²κ/H √(3(1 − ν²)):
that was checked against the section solved numerically and against elasticity in space. g → 1, a narrow strip, is the
beam of the models here: stiffness k₁, and at rest κ = κ̄. g → 0 is a plate: then κ = (1 + ν) κ̄. A strip that is curved
at rest without swelling has the stiffness k₁ + D*₂₂ a₁² (1 − g) there.

A swollen strip that is wide enough has stretches of negative ∂²U/∂κ²: held straighter, it folds in one joint, as a tape
spring does. The figures hold one width away from clamps.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

Array = np.ndarray
SMALL = 2.5e-3
"""x below which g is its series: 1 − x²/180."""
LARGE = 900.0
"""(1 + β) x above which g is 2 √((1 + β)/x) to the last digit."""
RATIOS = np.geomspace(0.05, 1e4, 400)
"""w²κ̄/H between which curvatures are interpolated."""
STEP = 1e-4
"""Of ratios, for a difference."""
CURVATURES = np.linspace(0.01, 1.6, 1600)
"""Of κ/κ̄, where tangents are looked at."""
BROADEST = 100.0
"""w²κ/H up to which strips are asked whether they fold or are stiffer than beams."""
BISECTIONS = 20
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
SECTIONS = 32
"""Golden sections, which leave 1e-7 of κ̄."""
TERMS = 12
"""Of the series of φ, by powers of x²: exact to rounding up to |x| = 32."""


@dataclass(frozen=True)
class StripLaw:
    """The law of a strip that is bent.

    Attributes
    ----------
    curl : float
        a₁.
    plate : float
        D*₂₂/k₁.
    offset : float
        β, for a curvature towards the normal; else −β.
    slope : float
        x over w²κ/H.
    """

    curl: float
    plate: float
    offset: float
    slope: float

    def _factor(self, ratio: Array) -> Array:
        """Return g of strips by their w²κ/H."""
        x, most = self.slope * np.asarray(ratio, float), LARGE / (1.0 + self.offset)
        middle = np.clip(x, SMALL, most)
        p, q = np.sqrt((1.0 + self.offset) * middle), np.sqrt((1.0 - self.offset) * middle)
        g = 2.0 * (np.cosh(p) - np.cos(q)) / (middle * (np.sinh(p) / p + np.sin(q) / q))
        wide = 2.0 * np.sqrt((1.0 + self.offset) / np.maximum(x, most))
        return np.where(x < SMALL, 1.0 - x**2 / 180.0, np.where(x > most, wide, g))

    def energy(self, curvature: Array, ratio: float | Array) -> Array:
        """Return U/(½ k₁ κ̄²) at a κ/κ̄ above 0 of strips that swell alike in all directions, by their w²κ̄/H."""
        change = curvature - 1.0
        return change**2 + self.plate * (1.0 - self.curl * change) ** 2 * (1.0 - self._factor(ratio * curvature))

    def curvature(self, ratio: Array) -> Array:
        """Return κ/κ̄ at rest of strips that swell alike in all directions, by their w²κ̄/H."""
        return np.interp(np.log(np.maximum(ratio, RATIOS[0])), np.log(RATIOS), _rests(self))

    def curvature_across(self, ratio: Array) -> Array:
        """Return the mean curvature across over κ̄, in the state of `curvature`: (1 − a₁ (κ/κ̄ − 1)) g."""
        along = self.curvature(ratio)
        return (1.0 - self.curl * (along - 1.0)) * self._factor(ratio * along)

    def stiffness(self, ratio: Array) -> Array:
        """Return the bending stiffness at rest, over k₁, of strips that are curved without swelling, by their w²κ/H."""
        return 1.0 + self.plate * self.curl**2 * (1.0 - self._factor(ratio))

    def bent_stiffness(self, ratio: Array) -> Array:
        """Return the moment over k₁ κ of flat strips that are bent to w²κ/H: with the energy k₁ κ² s/2, in which s is
        `stiffness`, d(r² s)/d(r²).
        """
        ends = np.multiply.outer([1.0 - STEP, 1.0 + STEP], ratio)
        energy = ends**2 * self.stiffness(ends)
        return (energy[1] - energy[0]) / (ends[1] ** 2 - ends[0] ** 2)

    def folds(self, ratio: float) -> bool:
        """Return whether a swollen strip, held straighter than it rests, has a negative tangent somewhere."""
        return bool((np.diff(self.energy(CURVATURES, ratio), 2) < 0.0).any())


@lru_cache(maxsize=32)
def _rests(law: StripLaw) -> Array:
    """Return κ/κ̄ at rest for each of `RATIOS`."""
    wide = law.plate * law.curl / (1.0 + law.plate * law.curl**2)
    low, high = np.full(RATIOS.size, 0.5), np.full(RATIOS.size, 1.05 + max(wide, 0.0))
    for _ in range(SECTIONS):  # of the least energy by golden sections
        first, second = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        left = law.energy(first, RATIOS) < law.energy(second, RATIOS)
        low, high = np.where(left, low, first), np.where(left, second, high)
    return 0.5 * (low + high)


@lru_cache(maxsize=32)
def folding_ratio(law: StripLaw) -> float:
    """Return w²κ̄/H from which on strips that swell alike in all directions have negative tangents; infinite if none
    has.
    """
    return _least_ratio(law.folds)


@lru_cache(maxsize=32)
def stiff_ratio(law: StripLaw, part: float) -> float:
    """Return w²κ/H from which on a strip that loads bend is stiffer than a beam by a part; infinite if none is."""
    return _least_ratio(lambda ratio: float(law.bent_stiffness(ratio)) > 1.0 + part)


def _least_ratio(is_beyond: Callable[[float], bool]) -> float:
    low, high = 0.0, BROADEST
    if not is_beyond(high):
        return math.inf
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if is_beyond(middle) else (middle, high)
    return high


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
