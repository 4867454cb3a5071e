"""Generalised-α (Chung and Hulbert 1993) with forces at the end of the step, that is, Wood, Bossak and Zienkiewicz's.

    (1 − α) M aₙ₊₁ + α M aₙ = −∂V/∂q(qₙ₊₁, vₙ₊₁)
    qₙ₊₁ = qₙ + h vₙ + h² ((½ − β) aₙ + β aₙ₊₁),   vₙ₊₁ = vₙ + h ((1 − δ) aₙ + δ aₙ₊₁)

of order 2 for δ = ½ − α, and with α = (ρ − 1)/(ρ + 1), β = ¼ (1 − α)² a vibration that is too fast for the step is
multiplied by ρ in each. One stage a step: with γ = β/δ for positions and γ′ = δ/(1 − α) for momenta

    q̄ = qₙ + h (1 − γ) vₙ + h² (½ − γ) aₙ,   v̄ = vₙ + h (1 − γ′) aₙ

As aₙ is the acceleration at tₙ + α h (from the first formula), positions have the local error (½ α + β − 1/6) h³ q⃛.
All forces are those at the end: a node that touches nothing there is pushed by nothing. The first step, and one at
whose start a load or an eigenstrain jumps, is made with SDIRK2.
"""

from __future__ import annotations

from bilayer_core.integrators.method import History, Method, estimate_of

RHO = 0.5
"""Of the fastest vibrations, what a step leaves."""
ALPHA = (RHO - 1.0) / (RHO + 1.0)
BETA, DELTA = 0.25 * (1.0 - ALPHA) ** 2, 0.5 - ALPHA
GAMMA, OF_MOMENTA = BETA / DELTA, DELTA / (1.0 - ALPHA)

METHOD = Method(
    name="generalised_alpha",
    order=2,
    diagonal=GAMMA,
    nodes=(1.0,),
    couplings=((),),
    weights=None,
    about="second order with one solution a step; damps what is too fast for the step over a few steps",
    momentum_diagonal=OF_MOMENTA,
    history=History(positions=(1.0 - GAMMA,), momenta=(1.0 - OF_MOMENTA,), bend=0.5 - GAMMA, carry=ALPHA),
    works=(0.5, 0.5),
    estimate=estimate_of(0.5 * ALPHA + BETA - 1.0 / 6.0),
)
