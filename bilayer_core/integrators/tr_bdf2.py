"""TR-BDF2 (Bank et al. 1985): trapezoidal rule to t + 2γ h, then BDF2 to the end; order 2, L-stable, γ = 1 − 1/√2.

    y₁ = yₙ + γ h (fₙ + f₁),   yₙ₊₁ = yₙ + h (w fₙ + w f₁ + γ fₙ₊₁),   w = √2/4     (Hosea and Shampine 1996)

For linear problems with constant coefficients it is SDIRK2: both have the only stability function of this form that is
L-stable and of order 2. Its first stage is of order 2 as well, which keeps the order where a stiff system is driven.
fₙ is left by the step before. Positions have the local error (2 γ² w + ½ γ − 1/6) h³ q⃛. The first step, and one at
whose start a load or an eigenstrain jumps, is made with SDIRK2.
"""

from __future__ import annotations

import math

from bilayer_core.integrators.method import History, Method, estimate_of

GAMMA = 1.0 - 1.0 / math.sqrt(2.0)
W = math.sqrt(2.0) / 4.0

METHOD = Method(
    name="tr_bdf2",
    order=2,
    diagonal=GAMMA,
    nodes=(2.0 * GAMMA, 1.0),
    couplings=((), (W,)),
    weights=None,
    about="second order as sdirk2, better where stiff parts are driven; remembers forces from step to step",
    history=History(positions=(GAMMA, W), momenta=(GAMMA, W)),
    estimate=estimate_of(W * 2.0 * GAMMA**2 + 0.5 * GAMMA - 1.0 / 6.0),
)
