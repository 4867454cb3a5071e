"""How friction on surfaces changes with what its contacts freeze, and with the origin of a stage.

Normal forces λ, thresholds ε, normals n, directions a, arms, and the slip u that follows from them and from the origin
are smooth: their changes are differences. Friction has a kink where slip turns round, over which differences would
step, so what follows from these changes is exact. With the words of `forces.surface_friction`, f = u·a, d = u·s and
φ = f₁/w,

    δq = c_a (δf a + f δa) + c_s (δd s + d δs),   δψ² = 2 (c_a f δf + c_s d δd),   δw = δψ²/(2 w (μ h)²)
    δG = φ/(μ h) (δλ q + λ δq) + λ/(μ h) (∂φ/∂w δw + ∂φ/∂ε δε) q

which acts on nodes and bodies as G does; arms that change add δρ × G.
"""

from __future__ import annotations

import math

from bilayer_core.contact.friction_law import friction_over_speed, friction_slope
from bilayer_core.forces.contact_on_bodies import add_force
from bilayer_core.forces.rod_arms import add_to_edges
from bilayer_core.forces.surface_friction import contact_slip, freeze_surface_contacts, write_across
from bilayer_core.jit import kernel, record
from bilayer_core.jit.called import stack_vector
from bilayer_core.jit.record import Indices, Matrix, Stack, Vector
from bilayer_core.kinematics.rotating import product_transposed


@record
class FrozenChange:
    """Contacts, and how what they freeze changes with something."""

    count: Indices  # how many contacts there are, shape (1,)
    first: Indices  # their contact points, shape (n_slide,)
    surface: Indices
    part: Matrix  # see `Sliding`
    found: Indices  # in how many of two configurations each was
    load: Vector
    smooth: Vector
    normal: Matrix
    axis: Matrix
    slip: Matrix
    arm: Matrix  # on the body that the contact point is on, as it is turned now
    lever: Matrix  # on that of the surface, likewise
    rate: Stack  # of arms of rods


@kernel
def begin_change(sliding, p, at, stage, change):
    """Freeze contacts at a configuration, and note which there are; nothing has changed."""
    freeze_surface_contacts(sliding, p, at, stage)
    change.count[0] = sliding.count[0]
    for k in range(sliding.count[0]):
        change.first[k], change.surface[k] = sliding.first[k], sliding.surface[k]
        change.part[k, 0], change.part[k, 1] = sliding.part[k, 0], sliding.part[k, 1]
        change.found[k], change.load[k], change.smooth[k] = 0, 0.0, 0.0
        for c in range(3):
            change.normal[k, c] = change.axis[k, c] = change.slip[k, c] = 0.0
            change.arm[k, c] = change.lever[k, c] = 0.0
            for n in range(8):
                change.rate[k, c, n] = 0.0


@kernel
def add_frozen(sliding, p, frozen_at, at, stage, factor, change):
    """Freeze contacts at another configuration, and add a multiple of what they take there, with their slip at `at`."""
    freeze_surface_contacts(sliding, p, frozen_at, stage)
    for b in range(at.rotation.shape[0]):
        product_transposed(at.rotation, b, sliding.back, b, sliding.rotation, b)
    arm, lever, slip, j = stack_vector(3), stack_vector(3), stack_vector(3), 0
    arm[0] = arm[1] = arm[2] = 0.0
    for k in range(sliding.count[0]):
        n = j
        while n < change.count[0] and not _same(sliding, k, change, n):
            n += 1
        if n == change.count[0]:
            continue  # new, and so without load
        j = n + 1
        contact_slip(sliding, p.surfaces, p.strands, at, stage, k, arm, lever, slip)
        change.found[n] += 1
        change.load[n] += factor * sliding.load[k]
        change.smooth[n] += factor * sliding.smooth[k]
        for c in range(3):
            change.normal[n, c] += factor * sliding.normal[k, c]
            change.axis[n, c] += factor * sliding.axis[k, c]
            change.slip[n, c] += factor * slip[c]
            change.arm[n, c] += factor * arm[c]
            change.lever[n, c] += factor * lever[c]
            for m in range(8):
                change.rate[n, c, m] += factor * sliding.arm_rate[k, c, m]


@kernel
def _same(sliding, k, change, n):
    """Return whether contact k is contact n of a change."""
    return (
        sliding.first[k] == change.first[n]
        and sliding.surface[k] == change.surface[n]
        and sliding.part[k, 0] == change.part[n, 0]
        and sliding.part[k, 1] == change.part[n, 1]
    )


@kernel
def add_changed_friction(sliding, p, at, stage, change):
    """Freeze contacts anew where the change began, and add what it makes of their forces."""
    freeze_surface_contacts(sliding, p, at, stage)
    for b in range(at.rotation.shape[0]):
        product_transposed(at.rotation, b, sliding.back, b, sliding.rotation, b)
    surfaces, sums, axis, mu = p.surfaces, p.sums, sliding.axis, sliding.mu
    arm, lever, u, across = stack_vector(3), stack_vector(3), stack_vector(3), stack_vector(3)
    g, changed, of_across = stack_vector(3), stack_vector(3), stack_vector(3)
    q, of_q, turned = stack_vector(3), stack_vector(3), stack_vector(3)
    arm[0] = arm[1] = arm[2] = 0.0
    for k in range(sliding.count[0]):
        largest = max(mu[k, 0], mu[k, 1], mu[k, 2])
        if largest == 0.0 or change.found[k] != 2:
            continue  # what comes within reach of the barrier, or leaves it, has no load there
        load, threshold, node = sliding.load[k], sliding.smooth[k], sliding.node[k]
        contact_slip(sliding, surfaces, p.strands, at, stage, k, arm, lever, u)
        write_across(sliding, k, across)
        _across_of_change(sliding, change, k, of_across)
        forward = sideways = of_forward = of_sideways = 0.0
        for c in range(3):
            forward += u[c] * axis[k, c]
            sideways += u[c] * across[c]
            of_forward += change.slip[k, c] * axis[k, c] + u[c] * change.axis[k, c]
            of_sideways += change.slip[k, c] * across[c] + u[c] * of_across[c]
        ca, cs = (mu[k, 0] if forward >= 0.0 else mu[k, 1]) ** 2, mu[k, 2] ** 2
        scale = largest * stage.length
        speed = math.sqrt(ca * forward * forward + cs * sideways * sideways) / scale
        ratio = friction_over_speed(speed, threshold) / scale
        excess = 0.0
        if speed > 0.0:
            bend = (friction_slope(speed, threshold) - friction_over_speed(speed, threshold)) / (speed * speed)
            excess = load * bend * (ca * forward * of_forward + cs * sideways * of_sideways) / scale**3
        if speed < threshold:
            excess += load * (2.0 * speed / threshold - 2.0) / threshold**2 * change.smooth[k] / scale
        for c in range(3):
            q[c] = ca * forward * axis[k, c] + cs * sideways * across[c]
            of_q[c] = ca * (of_forward * axis[k, c] + forward * change.axis[k, c])
            of_q[c] += cs * (of_sideways * across[c] + sideways * of_across[c])
            g[c] = load * ratio * q[c]
            changed[c] = ratio * (change.load[k] * q[c] + load * of_q[c]) + excess * q[c]
            sums.contact_point[node, c] += changed[c]
        a, b = surfaces.contact_point_body[sliding.first[k]], surfaces.body[sliding.surface[k]]
        if a >= 0:
            add_force(sums.contact, a, 1.0, arm, changed)
            _cross(change.arm, k, g, turned)
            for c in range(3):
                sums.contact[a, 3 + c] += turned[c]
        else:
            add_to_edges(surfaces, node, changed, k, sliding.arm_rate, sums.edge)
            add_to_edges(surfaces, node, g, k, change.rate, sums.edge)
        add_force(sums.contact, b, -1.0, lever, changed)
        _cross(change.lever, k, g, turned)
        for c in range(3):
            sums.contact[b, 3 + c] -= turned[c]


@kernel
def _across_of_change(sliding, change, k, out):
    """Write δs = δn × a + n × δa."""
    n, a, of_n, of_a = sliding.normal, sliding.axis, change.normal, change.axis
    for c in range(3):
        d, e = (c + 1) % 3, (c + 2) % 3
        out[c] = of_n[k, d] * a[k, e] - of_n[k, e] * a[k, d] + n[k, d] * of_a[k, e] - n[k, e] * of_a[k, d]


@kernel
def _cross(a, k, b, out):
    """Write a[k] × b."""
    for c in range(3):
        d, e = (c + 1) % 3, (c + 2) % 3
        out[c] = a[k, d] * b[e] - a[k, e] * b[d]
