"""SDIRK2 (Alexander 1977): two stages, order 2, L-stable and stiffly accurate, γ = 1 − 1/√2.

    stage 1 at t + γ h from (qₙ, vₙ);   stage 2 at t + h, its origin (1 − γ) h along the stage derivatives of stage 1

It starts from positions and velocities alone: a jump of a stimulus or a new contact at the beginning of a step leaves
nothing behind. A stiff vibration (a contact) is gone after one step, as with implicit Euler; a slow one is damped at
third order in h. Positions have the local error (3 γ² − 2 γ³ − 1/6) h³ q⃛.
"""

from __future__ import annotations

import math

from bilayer_core.integrators.method import Method, estimate_of

GAMMA = 1.0 - 1.0 / math.sqrt(2.0)

METHOD = Method(
    name="sdirk2",
    order=2,
    diagonal=GAMMA,
    nodes=(GAMMA, 1.0),
    couplings=((), (1.0 - GAMMA,)),
    weights=None,
    about="second order, damps only what is too fast for the step",
    estimate=estimate_of(3.0 * GAMMA**2 - 2.0 * GAMMA**3 - 1.0 / 6.0),
)
