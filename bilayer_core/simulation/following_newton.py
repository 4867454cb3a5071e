"""Newton's method for an equilibrium under forces without a potential, with all of their stiffness.

Rounds of statics hold the directions of drag and of loads that follow, so the Hessian lacks their stiffness L
(`simulation.linearised`), and where L outweighs it no round of a useful length converges. Nor does descent help: a tail
in a flow about added mass rests by its damping, C + G, where K + L alone would drive it away. So the steps here are
those of the motion itself, by implicit Euler made linear at rest: with the gradient g of all forces at rest,

    (M/h² + (C + G)/h + K + L) δ = −g(q) + M v/h,    v ← δ/h

A step counts as good if another correction with the same matrix, of what remains of the step's equation, would be short
beside δ; else it is made again. The length of that correction sets the next h. Long steps damp all that swings, and the
last are those of Newton's method on g alone (as in pseudo-transient continuation, Kelley and Keyes 1998).
"""

from __future__ import annotations

import math

import numpy as np
from scipy.sparse.linalg import splu

from bilayer_core.model.model import Model
from bilayer_core.model.state import State
from bilayer_core.simulation.linearised import Linearised

Array = np.ndarray
WANTED, GOOD = 0.1, 0.5
"""Length of the second correction, of the first: `WANTED` sets the next h, and at most `GOOD` is good."""
LEAST_FACTOR, LARGEST_FACTOR = 0.2, 10.0
"""Bounds of the factor from one h to the next."""
SHORTEST, LONGEST = 1e-6, 100.0
"""Bounds of h [s]."""
MOST = 120
"""Steps, with those that are made again."""
ROUNDING = 1e-12
"""Of the first correction: what the second may be by rounding."""
FINE = 1e-10
"""Differences, of the longest rod or of one radian: drag ∝ |v| v has a kink where v vanishes, as along tails."""
FARTHEST = 0.2
"""Of the longest rod: displacement in a step."""


def find_rest(
    model: Model, state: State, load_factor: Array, within: Model | None, length: float, tolerance: float
) -> int:
    """Bring a state to rest; return the number of steps, 0 if none was found and the state is as it was.

    Parameters
    ----------
    model : Model
        In space, without contact.
    state : State
    load_factor : ndarray
        Of loads, shape (n_load,).
    within : Model, optional
        Of the same scene in a plane that is not to be left.
    length : float
        First h [s].
    tolerance : float
        Displacement that counts as rest [m].
    """
    system = Linearised(model, state, load_factor, within, FINE)
    farthest = FARTHEST * max(rod.path.length for rod in model.scene.rods)
    gradient, matrices = system.gradient(), None
    velocity = np.zeros(len(gradient))
    for step in range(1, MOST + 1):
        if matrices is None:
            matrices = system.stiffness, system.damping, system.mass
        stiffness, damping, mass = matrices
        inertia, push = mass / length**2 + damping / length, mass @ velocity / length
        solver = splu((stiffness + inertia).tocsc())
        correction = solver.solve(push - gradient)
        moved = system.displacement(correction)
        if not math.isfinite(moved):
            return 0
        if length == LONGEST and moved <= tolerance:  # what velocity does there is less still
            system.move(correction)
            system.write_shape(state)
            return step
        part = math.inf  # of the correction, that the next would have
        if moved <= farthest:
            system.move(correction)
            new = system.gradient()
            part = system.displacement(solver.solve(new + inertia @ correction - push)) / moved
            if part <= GOOD:
                gradient, velocity, matrices = new, correction / length, None
            else:
                system.go_back()
        length *= min(LARGEST_FACTOR, max(LEAST_FACTOR, math.sqrt(WANTED / max(part, ROUNDING))))
        if length < SHORTEST:
            return 0
        length = min(length, LONGEST)
    return 0
