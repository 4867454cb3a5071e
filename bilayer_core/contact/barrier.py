"""The log barrier b(d) = −(d − d̂)² log(d/d̂) for 0 < d < d̂, zero beyond (Li et al. 2020, eq. 6).

All take the gap d [m] and the barrier distance d̂ [m]; b is in m², so K_c b Δl with K_c in Pa is an energy.
"""

from __future__ import annotations

import math

from bilayer_core.jit import kernel


@kernel
def barrier(d, d_hat):
    """Return b(d) [m²]; callers test 0 < d < d̂."""
    return -(d - d_hat) * (d - d_hat) * math.log(d / d_hat)


@kernel
def barrier_gradient(d, d_hat):
    """Return b′(d) = −2 (d − d̂) log(d/d̂) − (d − d̂)²/d ≤ 0 [m]: K_c Δl b′ is minus the contact force."""
    s = d - d_hat
    return -2.0 * s * math.log(d / d_hat) - s * s / d


@kernel
def barrier_hessian(d, d_hat):
    """Return b″(d) = −2 log(d/d̂) − 4 (d − d̂)/d + (d − d̂)²/d² ≥ 0."""
    s = (d - d_hat) / d
    return -2.0 * math.log(d / d_hat) - 4.0 * s + s * s
