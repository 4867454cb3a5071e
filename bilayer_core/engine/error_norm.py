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
(The energy of contacts has an error of its own, see `engine.energy_account`.)
"""

from __future__ import annotations

import math

from bilayer_core.jit import kernel, piece
from bilayer_core.jit.called import stack_vector
from bilayer_core.jit.record import Indices, Vector, record
from bilayer_core.kinematics.rotating import rotation_vector_between
from bilayer_core.model.records.step import StateArrays


@record
class ErrorNorm:
    """Nodes, edges and bodies on which the defect of a step is measured, with weights and lengths."""

    length: float  # of the longest rod [m]
    first_node: Indices  # of each strand, last the number of nodes, shape (n_strand + 1,)
    weight: Vector  # part of its strand that each node stands for, shape (n_node,)
    half_width: Vector  # of each edge [m], shape (n_edge,); None in a plane, where edges do not turn
    body_of_free: Indices
    bounding_radius: Vector  # of bodies [m], shape (n_body,)


@piece(float, ErrorNorm, StateArrays, StateArrays, float)
def step_defect(norm, before, after, h):
    """Return D of a step over the length of the longest rod; times `Method.estimate` its local error.

    Parameters
    ----------
    norm : ErrorNorm
    before, after : StateArrays
        The ends of the step.
    h : float
        Its length [s].
    """
    first, largest = norm.first_node, 0.0
    for s in range(first.shape[0] - 1):
        square = _of_nodes(norm.weight, before, after, 0.5 * h, first[s], first[s + 1])
        square += _of_edges(norm.half_width, norm.weight, before, after, 0.5 * h, first[s], first[s + 1], s)
        largest = max(largest, square)
    largest = math.sqrt(largest)
    for f in range(norm.body_of_free.shape[0]):
        b = norm.body_of_free[f]
        largest = max(largest, _of_body(norm.bounding_radius[b], before, after, 0.5 * h, b))
    return largest / norm.length


@kernel
def fastest(norm, state):
    """Return the largest speed of a node, or of the outermost point of a free body [m/s]."""
    largest = 0.0
    for i in range(state.velocity.shape[0]):
        square = 0.0
        for k in range(3):
            square += state.velocity[i, k] ** 2
        largest = max(largest, math.sqrt(square))
    for f in range(norm.body_of_free.shape[0]):
        b = norm.body_of_free[f]
        moving = turning = 0.0
        for k in range(3):
            moving += state.body_velocity[b, k] ** 2
            turning += state.body_angular_velocity[b, k] ** 2
        largest = max(largest, math.sqrt(moving) + norm.bounding_radius[b] * math.sqrt(turning))
    return largest


@kernel
def _of_nodes(weight, before, after, half, first, last):
    """Return the mean square of D along a strand [m²]."""
    total = 0.0
    for i in range(first, last):
        square = 0.0
        for k in range(3):
            speed = before.velocity[i, k] + after.velocity[i, k]
            square += (after.position[i, k] - before.position[i, k] - half * speed) ** 2
        total += weight[i] * square
    return total


@kernel
def _of_edges(half_width, weight, before, after, half, first, last, strand):
    """Return the mean square of D along a strand for the borders of its edges, by their turn [m²]."""
    if half_width.shape[0] == 0:
        return 0.0
    total = 0.0
    d, t, u = stack_vector(3), stack_vector(3), stack_vector(3)
    for i in range(first, last - 1):
        edge = i - strand
        length = new_length = 0.0
        for k in range(3):
            t[k] = before.position[i + 1, k] - before.position[i, k]
            u[k] = after.position[i + 1, k] - after.position[i, k]
            length += t[k] ** 2
            new_length += u[k] ** 2
        along = cosine = 0.0
        for k in range(3):
            t[k] /= math.sqrt(length)
            u[k] /= math.sqrt(new_length)
            along += before.director1[edge, k] * u[k]
            cosine += t[k] * u[k]
        for k in range(3):  # the director carried to the new tangent u
            d[k] = before.director1[edge, k] - along / (1.0 + cosine) * (t[k] + u[k])
        x, y, z = after.director1[edge, 0], after.director1[edge, 1], after.director1[edge, 2]
        sine = (d[1] * z - d[2] * y) * u[0] + (d[2] * x - d[0] * z) * u[1] + (d[0] * y - d[1] * x) * u[2]
        turn = math.atan2(sine, d[0] * x + d[1] * y + d[2] * z)
        defect = half_width[edge] * (turn - half * (before.spin[edge] + after.spin[edge]))
        total += 0.5 * (weight[i] + weight[i + 1]) * defect**2
    return total


@kernel
def _of_body(bounding_radius, before, after, half, b):
    """Return D of the outermost point of a body [m]."""
    turn = rotation_vector_between(before.body_rotation, b, after.body_rotation, b)
    shifted = turned = 0.0
    for k in range(3):
        speed = before.body_velocity[b, k] + after.body_velocity[b, k]
        shifted += (after.body_position[b, k] - before.body_position[b, k] - half * speed) ** 2
        spin = before.body_angular_velocity[b, k] + after.body_angular_velocity[b, k]
        turned += (turn[k] - half * spin) ** 2
    return math.sqrt(shifted) + bounding_radius * math.sqrt(turned)
