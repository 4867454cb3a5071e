"""How friction on surfaces changes with what its contacts freeze, and with the origin of a stage.

Normal forces λ, thresholds ε, normals n, directions a, arms, and the slip u that follows from them and from the origin
are smooth: their changes are differences. Friction has a kink where slip turns round, over which differences would
step, so what follows from these changes is exact. With the words of `forces.surface_friction`, f = u·a, d = u·s and
φ = f₁/w,

    δq = c_a (δf a + f δa) + c_s (δd s + d δs),   δψ² = 2 (c_a f δf + c_s d δd),   δw = δψ²/(2 w (μ h)²)
    δG = φ/(μ h) (δλ q + λ δq) + λ/(μ h) (∂φ/∂w δw + ∂φ/∂ε δε) q

which acts on nodes and bodies as G does; arms that change add δρ × G. Each contact is frozen anew, by itself, where
one of its unknowns has moved: the nodes and turns of the edges at its own node, and the bodies that touch.
"""

from __future__ import annotations

import math

from bilayer_core.contact.friction_law import friction_over_speed, friction_slope
from bilayer_core.forces.contact_on_bodies import add_force
from bilayer_core.forces.surface_friction import contact_slip, write_across
from bilayer_core.jit import kernel, record
from bilayer_core.jit.called import stack_vector
from bilayer_core.jit.record import Matrix, Stack, Vector


@record
class FrozenChange:
    """How what a contact and its places freeze changes with something."""

    load: Vector  # shape (n_change,): those of one thing follow each other
    smooth: Vector
    normal: Matrix
    axis: Matrix
    slip: Matrix
    arm: Matrix  # on the body that the contact point is on, as it is turned now
    lever: Matrix  # on that of the surface, likewise
    rate: Stack  # of arms of rods


@kernel
def begin_change(change, first, places):
    """Note that nothing has changed."""
    for q in range(first, first + places + 1):
        change.load[q], change.smooth[q] = 0.0, 0.0
        for c in range(3):
            change.normal[q, c] = change.axis[q, c] = change.slip[q, c] = 0.0
            change.arm[q, c] = change.lever[q, c] = 0.0
            for n in range(8):
                change.rate[q, c, n] = 0.0


@kernel
def add_frozen(sliding, p, at, stage, slot, place, places, factor, change, first):
    """Add a multiple of what a contact and its places took where they were frozen last, with their slip at `at`, to
    changes from the first one on.
    """
    arm, lever, slip = stack_vector(3), stack_vector(3), stack_vector(3)
    arm[0] = arm[1] = arm[2] = 0.0
    for q in range(first, first + places + 1):
        k = slot if q == first else place + q - first - 1
        contact_slip(sliding, p.surfaces, p.strands, at, stage, k, arm, lever, slip)
        change.load[q] += factor * sliding.load[k]
        change.smooth[q] += factor * sliding.smooth[k]
        for c in range(3):
            change.normal[q, c] += factor * sliding.normal[k, c]
            change.axis[q, c] += factor * sliding.axis[k, c]
            change.slip[q, c] += factor * slip[c]
            change.arm[q, c] += factor * arm[c]
            change.lever[q, c] += factor * lever[c]
            for m in range(8):
                change.rate[q, c, m] += factor * sliding.arm_rate[k, c, m]


@kernel
def _add_to_arms(g, k, rate, of_arms):
    """Add gᵀ ∂y to the gradients of the edges before and after the node of a contact, shape (8,)."""
    for n in range(8):
        of_arms[n] += g[0] * rate[k, 0, n] + g[1] * rate[k, 1, n] + g[2] * rate[k, 2, n]


@kernel
def add_changed_force(sliding, p, at, stage, k, q, change, of_node, of_arms, of_bodies):
    """Add what change q makes of the force of contact k, which is frozen where it began: by its node, by the edges
    there, and by the bodies of the point and of the surface.
    """
    axis, mu = sliding.axis, sliding.mu
    largest = max(mu[k, 0], mu[k, 1], mu[k, 2])
    if largest == 0.0:
        return
    arm, lever, u, across = stack_vector(3), stack_vector(3), stack_vector(3), stack_vector(3)
    g, changed, of_across = stack_vector(3), stack_vector(3), stack_vector(3)
    q_, of_q, turned = stack_vector(3), stack_vector(3), stack_vector(3)
    arm[0] = arm[1] = arm[2] = 0.0
    load, threshold = sliding.load[k], sliding.smooth[k]
    contact_slip(sliding, p.surfaces, p.strands, at, stage, k, arm, lever, u)
    write_across(sliding, k, across)
    _across_of_change(sliding, k, change, q, of_across)
    forward = sideways = of_forward = of_sideways = 0.0
    for c in range(3):
        forward += u[c] * axis[k, c]
        sideways += u[c] * across[c]
        of_forward += change.slip[q, c] * axis[k, c] + u[c] * change.axis[q, c]
        of_sideways += change.slip[q, c] * across[c] + u[c] * of_across[c]
    ca, cs = (mu[k, 0] if forward >= 0.0 else mu[k, 1]) ** 2, mu[k, 2] ** 2
    scale = largest * stage.length
    speed = math.sqrt(ca * forward * forward + cs * sideways * sideways) / scale
    ratio = friction_over_speed(speed, threshold) / scale
    excess = 0.0
    if speed > 0.0:
        bend = (friction_slope(speed, threshold) - friction_over_speed(speed, threshold)) / (speed * speed)
        excess = load * bend * (ca * forward * of_forward + cs * sideways * of_sideways) / scale**3
    if speed < threshold:
        excess += load * (2.0 * speed / threshold - 2.0) / threshold**2 * change.smooth[q] / scale
    for c in range(3):
        q_[c] = ca * forward * axis[k, c] + cs * sideways * across[c]
        of_q[c] = ca * (of_forward * axis[k, c] + forward * change.axis[q, c])
        of_q[c] += cs * (of_sideways * across[c] + sideways * of_across[c])
        g[c] = load * ratio * q_[c]
        changed[c] = ratio * (change.load[q] * q_[c] + load * of_q[c]) + excess * q_[c]
    if p.surfaces.contact_point_body[sliding.first[k]] >= 0:
        add_force(of_bodies, 0, 1.0, arm, changed)
        _cross(change.arm, q, g, turned)
        for c in range(3):
            of_bodies[0, 3 + c] += turned[c]
    else:
        for c in range(3):
            of_node[c] += changed[c]
        _add_to_arms(changed, k, sliding.arm_rate, of_arms)
        _add_to_arms(g, q, change.rate, of_arms)
    add_force(of_bodies, 1, -1.0, lever, changed)
    _cross(change.lever, q, g, turned)
    for c in range(3):
        of_bodies[1, 3 + c] -= turned[c]


@kernel
def _across_of_change(sliding, k, change, q, out):
    """Write δs = δn × a + n × δa."""
    n, a, of_n, of_a = sliding.normal, sliding.axis, change.normal, change.axis
    for c in range(3):
        d, e = (c + 1) % 3, (c + 2) % 3
        out[c] = of_n[q, d] * a[k, e] - of_n[q, e] * a[k, d] + n[k, d] * of_a[q, e] - n[k, e] * of_a[q, d]


@kernel
def _cross(a, k, b, out):
    """Write a[k] × b."""
    for c in range(3):
        d, e = (c + 1) % 3, (c + 2) % 3
        out[c] = a[k, d] * b[e] - a[k, e] * b[d]
