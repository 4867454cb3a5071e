"""The local error of a step, from the states at its ends alone.

A step of length h takes positions by Δq and velocities from vₙ to vₙ₊₁. What it differs by from the trapezoidal rule,

    D = Δq − ½ h (vₙ + vₙ₊₁)

is known whatever the stages of the integrator are, and holds its local error:

- *Order 1.* Implicit Euler has Δq = h vₙ₊₁, so D = ½ h (vₙ₊₁ − vₙ) = ½ h² q̈ + O(h³), its local error, apart from sign.
- *Order 2.* If a method gives Δq = h vₙ + ½ h² q̈ + (1/6 + e) h³ q⃛ + O(h⁴), and velocities to O(h³), then
  D = (1/6 + e − ¼) h³ q⃛ = (e − 1/12) h³ q⃛, and its local error is e h³ q⃛ = D e/(e − 1/12). As q̇ = v is linear, e
  is one number: Σ bᵢ aᵢⱼ cⱼ − 1/6 for a Runge–Kutta method.

So each method declares one factor, `Method.estimate`. Implicit midpoint cannot: its Δq is the trapezoidal rule, D = 0.
A vibration that is too fast for the step, such as that of a barrier, shows in D with h times its speed: it counts until
an L-stable method has damped it, and an impact at speed u is followed by steps of about tolerance × length/u, however
stiff the surface. What rests on a barrier has no speed and costs nothing.

The error of a strand is the root mean square along it, with that of its edges' borders by their turn, so that it does
not depend on the mesh and one node that trembles on a surface weighs little; that of a free body is the displacement of
its outermost point. The largest of all, over the length of the longest rod, is the error of the step.
"""

from __future__ import annotations

import math

import numpy as np

from ..jit import kernel
from ..kinematics.rotation import rotation_vector
from ..kinematics.stack import stack_vector
from ..model.model import Model
from ..model.state import State

Array = np.ndarray


@kernel
def largest_deviation(
    first_node,
    weight,
    half_width,
    position,
    new_position,
    velocity,
    new_velocity,
    director,
    new_director,
    spin,
    new_spin,
    h,
):
    """Largest root mean square of D along a strand [m].

    Parameters
    ----------
    first_node : ndarray
        First node of each strand, last the number of nodes, shape (n_strand + 1,).
    weight : ndarray
        Part of its strand that each node stands for, shape (n_node,).
    half_width : ndarray
        Of each edge [m], shape (n_edge,).
    position, velocity, director, spin : ndarray
        At the start of the step, as in `State`; those that begin with `new` at its end.
    h : float
        Length of the step [s].
    """
    largest, half = 0.0, 0.5 * h
    d, t, u = stack_vector(3), stack_vector(3), stack_vector(3)
    for s in range(first_node.shape[0] - 1):
        total = 0.0
        for i in range(first_node[s], first_node[s + 1]):
            for k in range(3):
                d[k] = new_position[i, k] - position[i, k] - half * (velocity[i, k] + new_velocity[i, k])
            total += weight[i] * (d[0] ** 2 + d[1] ** 2 + d[2] ** 2)
        for i in range(first_node[s], first_node[s + 1] - 1):
            edge = i - s
            length = new_length = 0.0
            for k in range(3):
                t[k] = position[i + 1, k] - position[i, k]
                u[k] = new_position[i + 1, k] - new_position[i, k]
                length += t[k] ** 2
                new_length += u[k] ** 2
            along = cosine = 0.0
            for k in range(3):
                t[k] /= math.sqrt(length)
                u[k] /= math.sqrt(new_length)
                along += director[edge, k] * u[k]
                cosine += t[k] * u[k]
            for k in range(3):  # the director carried to the new tangent u
                d[k] = director[edge, k] - along / (1.0 + cosine) * (t[k] + u[k])
            x, y, z = new_director[edge, 0], new_director[edge, 1], new_director[edge, 2]
            sine = (d[1] * z - d[2] * y) * u[0] + (d[2] * x - d[0] * z) * u[1] + (d[0] * y - d[1] * x) * u[2]
            turn = math.atan2(sine, d[0] * x + d[1] * y + d[2] * z)
            deviation = half_width[edge] * (turn - half * (spin[edge] + new_spin[edge]))
            total += 0.5 * (weight[i] + weight[i + 1]) * deviation**2
        largest = max(largest, total)
    return math.sqrt(largest)


class ErrorEstimate:
    """The estimate for one model."""

    def __init__(self, model: Model):
        self._model = model
        ends = [strand.first_node for strand in model.strands] + [model.node_count]
        self._first_node = np.array(ends, dtype=np.int64)
        shares = np.array(model.carriers.weight[: model.node_count])
        self._weight = shares / np.repeat(np.add.reduceat(shares, ends[:-1]), np.diff(ends))
        self._length = max(rod.path.length for rod in model.scene.rods)

    def deviation(self, before: State, after: State, h: float) -> float:
        """D of a step of length `h` [s] over the length of the longest rod; times `Method.estimate` its local error."""
        model = self._model
        largest = largest_deviation(
            self._first_node,
            self._weight,
            model.half_width,
            before.position,
            after.position,
            before.velocity,
            after.velocity,
            before.director1,
            after.director1,
            before.spin,
            after.spin,
            h,
        )
        for b in model.bodies.body_of_free:
            speed = before.body_velocity[b] + after.body_velocity[b]
            shift = after.body_position[b] - before.body_position[b] - 0.5 * h * speed
            spin = before.body_angular_velocity[b] + after.body_angular_velocity[b]
            turn = rotation_vector(after.body_rotation[b] @ before.body_rotation[b].T) - 0.5 * h * spin
            reach = model.bodies.reach[b]
            largest = max(largest, math.sqrt(shift @ shift) + reach * math.sqrt(turn @ turn))
        return largest / self._length
