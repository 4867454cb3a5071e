"""Observed order of convergence, and the error bar that follows from it.

Three runs at h₁ > h₂ > h₃ give f₁, f₂, f₃. If f(h) = f₀ + C hᵖ, then

    (f₁ − f₂)/(f₂ − f₃) = (h₁ᵖ − h₂ᵖ)/(h₂ᵖ − h₃ᵖ),    f₃ − f₀ = (f₂ − f₃) h₃ᵖ/(h₂ᵖ − h₃ᵖ)

The error bar of a run at h is a safety factor times |f(h) − f₀|: 1.25 where an order was observed, 3 with p = 1
where none was (Roache 1998, *Verification of codes and calculations*, AIAA Journal 36, the grid convergence index).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from scipy.optimize import brentq

SAFETY_WITH_ORDER = 1.25
SAFETY_WITHOUT = 3.0
LEAST_ORDER, LARGEST_ORDER = 0.3, 4.5
"""Beyond these the three runs do not lie on a power law."""
ROUNDING = 1e-9
"""Differences below this part of the value are rounding and Newton's tolerance, not discretisation."""


@dataclass(frozen=True)
class Estimate:
    """Error estimate of the run in the middle, the one that the user asked for.

    Attributes
    ----------
    change : float
        Value of the finer run minus its own, relative to its own.
    order : float or None
        Observed, None if the runs show none.
    bar : float
        Half width of the error bar, in the unit of the values.
    """

    change: float
    order: float | None
    bar: float


def observed_order(sizes: tuple[float, float, float], values: tuple[float, float, float]) -> float | None:
    """Return p from runs at three sizes, coarse to fine; None if their values do not fall on a power law."""
    (h1, h2, h3), (f1, f2, f3) = sizes, values
    first, second = f1 - f2, f2 - f3
    noise = ROUNDING * max(abs(f2), abs(f3))
    if min(abs(first), abs(second)) <= noise or (first > 0.0) != (second > 0.0):
        return None

    def excess(p: float) -> float:
        return (h1**p - h2**p) / (h2**p - h3**p) - first / second

    if excess(LEAST_ORDER) * excess(LARGEST_ORDER) > 0.0:
        return None
    return float(brentq(excess, LEAST_ORDER, LARGEST_ORDER))


def estimate(sizes: tuple[float | None, float, float], values: tuple[float | None, float, float]) -> Estimate:
    """Judge the middle run by the coarser and the finer one.

    Parameters
    ----------
    sizes : tuple of float
        Time step or edge length, coarse to fine; None for a coarser run that could not be made.
    values : tuple of float
        Of the quantity.
    """
    (h1, h2, h3), (f1, f2, f3) = sizes, values
    order = observed_order((h1, h2, h3), (f1, f2, f3)) if h1 is not None and f1 is not None else None
    p, safety = (order, SAFETY_WITH_ORDER) if order is not None else (1.0, SAFETY_WITHOUT)
    error = (f2 - f3) * h2**p / (h2**p - h3**p)
    change = (f3 - f2) / abs(f2) if f2 else (0.0 if f3 == f2 else math.inf)
    return Estimate(change, order, safety * abs(error))
