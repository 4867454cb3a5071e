"""Integrators: diagonally implicit methods, whose stages are minima of incremental potentials.

For ẏ = f(t, y) over a step of length h, with y a position or a momentum,

    stage i at t + cᵢ h:   yᵢ = ȳᵢ + γ h f(yᵢ),   ȳᵢ = yₙ + h Σ_{j<i} aᵢⱼ f(yⱼ),   f(yⱼ) = (yⱼ − ȳⱼ)/(γ h)
    end:                   yₙ₊₁ = yₙ + h Σ bⱼ f(yⱼ)

For q̇ = v, M v̇ = −∂V/∂q a stage is an implicit Euler step of length γ h from its *origin* (q̄, v̄):

    q = q̄ + γ h v,  M v = M v̄ − γ h ∂V/∂q   ⇔   minimise ½|q − q̃|²_M/(γ h)² + V(q),   q̃ = q̄ + γ h v̄,   v = (q − q̄)/(γ h)

so every stage is the minimum of an incremental potential, and neither Newton nor contact knows which integrator runs.
The stage derivatives of earlier stages follow from their results; no force is evaluated for them.

An integrator may also begin with the derivatives fₙ at the start of the step, which the step before has left
(`History`), and may advance momenta over a length γ′ h that is not that of positions: then γ γ′ stands for γ² in the
potential.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bilayer_core.model.records.step import Method as MethodArrays


@dataclass(frozen=True)
class History:
    """How a method uses derivatives at the start of a step. Where they jump, a step of another method stands in.

    Attributes
    ----------
    positions, momenta : tuple of float
        Weights of h fₙ in the origin of each stage.
    bend : float
        Weight of h² q̈ₙ in the positions of every origin.
    carry : float
        α in (1 − α) fₙ₊₁ + α fₙ = what acts at the end; 0 if fₙ₊₁ is what acts there.
    """

    positions: tuple[float, ...]
    momenta: tuple[float, ...]
    bend: float = 0.0
    carry: float = 0.0


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
    momentum_diagonal : float or None
        γ′; None if it is γ.
    history : History or None
        None if a step starts from positions and velocities alone.
    estimate : float or None
        Local error of positions over |Δq − ½ h (vₙ + vₙ₊₁)| (`engine.error_norm`); None if that does not tell it.
    works : tuple of float or None
        Weights of the powers at the start of a step and at its stages in the work of forces; None if they are those of
        the stage derivatives.
    """

    name: str
    order: int
    diagonal: float
    nodes: tuple[float, ...]
    couplings: tuple[tuple[float, ...], ...]
    weights: tuple[float, ...] | None
    about: str
    momentum_diagonal: float | None = None
    history: History | None = None
    estimate: float | None = None
    works: tuple[float, ...] | None = None

    def __post_init__(self):
        if self.weights is not None and self.history is not None:
            raise ValueError(
                f"{self.name}: the last stage has to end the step where derivatives are kept: `weights` must be None"
            )

    @property
    def points(self) -> tuple[float, ...]:
        """cᵢ of each stage, and 1 if the end lies beyond the last one: where it has to be known what acts."""
        return self.nodes if self.weights is None else (*self.nodes, 1.0)

    def _weights_of_powers(self) -> tuple[float, ...]:
        if self.works is not None:
            return self.works
        if self.weights is not None:
            return (0.0, *self.weights)
        return (self.history.momenta[-1] if self.history else 0.0, *self.couplings[-1], self.diagonal)

    def arrays(self) -> MethodArrays:
        """Return the coefficients as the engine takes them: couplings divided by γ, with `weights` as one more row."""
        stages, history = len(self.nodes), self.history
        rows = self.couplings if self.weights is None else (*self.couplings, self.weights)
        couplings = np.zeros((len(rows), stages))
        for row, own in enumerate(rows):
            couplings[row, : len(own)] = own
        return MethodArrays(
            diagonal=self.diagonal,
            momentum_diagonal=self.momentum_diagonal or self.diagonal,
            couplings=couplings / self.diagonal,
            history=history is not None,
            along=np.array(history.positions if history else np.zeros(stages)),
            momenta=np.array(history.momenta if history else np.zeros(stages)),
            bend=history.bend if history else 0.0,
            carry=history.carry if history else 0.0,
            nodes=np.array(self.points),
            works=np.array(self._weights_of_powers()),
            estimate=np.nan if self.estimate is None else float(self.estimate),
        )


def estimate_of(error: float) -> float:
    """Return `Method.estimate` of a method of order 2 whose positions have the local error `error` × h³ q⃛."""
    return abs(error / (error - 1.0 / 12.0))
