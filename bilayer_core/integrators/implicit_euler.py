"""Implicit Euler, the paper's integrator (eq. 29): order 1, strongly dissipative.

q = qₙ + h v,   M v = M vₙ − h ∂V/∂q
local error of positions: ½ h² q̈
"""

from __future__ import annotations

from bilayer_core.integrators.method import Method

METHOD = Method(
    name="implicit_euler",
    order=1,
    diagonal=1.0,
    nodes=(1.0,),
    couplings=((),),
    weights=None,
    about="the paper's; first order, damps all vibrations",
    estimate=1.0,
)
