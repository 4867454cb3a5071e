"""Implicit midpoint: one stage at t + h/2, order 2, symplectic: no numerical damping at all.

    stage: implicit Euler of length h/2;   end: yₙ₊₁ = 2 y − yₙ

It keeps linear and angular momentum, and the energy of a vibration up to bounded oscillation. The end lies beyond the
stage: where that would cross a surface the step is refused and halved. Nothing damps a contact either: what comes to
rest on a surface goes on trembling there. Its steps are fixed: lengths that vary would spoil what it keeps. For motion
without contact, and for holding other methods against.
"""

from __future__ import annotations

from bilayer_core.integrators.method import Method

METHOD = Method(
    name="implicit_midpoint",
    order=2,
    diagonal=0.5,
    nodes=(0.5,),
    couplings=((),),
    weights=(1.0,),
    about="second order, no damping at all: for motion without contact",
)
