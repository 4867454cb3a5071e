"""What an integrator is here: a diagonally implicit Runge–Kutta method with one diagonal coefficient γ.

For ẏ = f(t, y) over a step of length h, with y a position or a momentum,

    stage i at t + cᵢ h:   yᵢ = ȳᵢ + γ h f(yᵢ),   ȳᵢ = yₙ + h Σ_{j<i} aᵢⱼ f(yⱼ),   f(yⱼ) = (yⱼ − ȳⱼ)/(γ h)
    end:                   yₙ₊₁ = yₙ + h Σ bⱼ f(yⱼ)

For q̇ = v, M v̇ = −∂V/∂q a stage is an implicit Euler step of length γ h from its *origin* (q̄, v̄):

    q = q̄ + γ h v,   M v = M v̄ − γ h ∂V/∂q   ⇔   minimise ½ |q − q̃|²_M/(γ h)² + V(q),   q̃ = q̄ + γ h v̄

so every stage is the minimum of an incremental potential, and neither Newton nor contact knows which integrator runs.
The slopes of earlier stages follow from their results; no force is evaluated for them.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Method:
    """Coefficients of an integrator.

    Attributes
    ----------
    name : str
    order : int
        Of positions and velocities, for smooth forces.
    diagonal : float
        γ.
    nodes : tuple of float
        cᵢ of each stage.
    couplings : tuple of tuple of float
        aᵢⱼ, j < i, of each stage.
    weights : tuple of float or None
        bⱼ; None if the last stage is the end of the step (stiffly accurate).
    about : str
        What it is good for, in a few words.
    """

    name: str
    order: int
    diagonal: float
    nodes: tuple[float, ...]
    couplings: tuple[tuple[float, ...], ...]
    weights: tuple[float, ...] | None
    about: str
