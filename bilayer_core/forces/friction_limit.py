"""The part of a Newton step after which friction stops it.

A contact that comes to rest, or turns round, has its friction changed by up to 2 μ λ within a slip of 2 ε_v h, mostly
far less than a step: second derivatives at its beginning do not know of that. A full step goes beyond the minimum, one
from there comes back, and halves of it end anywhere but where the contact rests. Along a straight step, however,
friction is known. With the potential φ, the step s, the contacts' D (`forces.surface_friction`) and the exact Hessian
H,

    φ′(α) ≈ φ′(0) + α (sᵀ H s − Σ D″(0)) + Σ (D′(α) − D′(0)),   sᵀ H s = −φ′(0)

grows with α, and the step ends where it is zero, at rest of one contact, mostly; from there on H knows of it. Slip of a
contact grows in proportion to α (bodies that turn do so nearly): its *slip path* is, with u·a and u·s as in
`forces.surface_friction`,

    u·a, δu·a, u·s, δu·s, μ₊², μ₋², μ_s², λ, μ h, ε_v
"""

from __future__ import annotations

import math

from bilayer_core.contact.friction_law import friction_over_speed, friction_slope
from bilayer_core.forces.rod_contact import rod_slip_along
from bilayer_core.forces.surface_friction import slip_paths
from bilayer_core.jit import kernel, piece
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.step import Configuration, Stage

PATH_SIZE = 10
"""Numbers of a contact's slip path."""
PASSED = 0.1
"""Of −φ′(0): no step ends before a smaller slope than this."""
MAX_HALVINGS = 50


@kernel
def _dissipated(count, path, fraction):
    """Return Σ D′(α) and Σ D″(α) [J]"""
    first, second = 0.0, 0.0
    for k in range(count):
        forward, side = path[k, 0] + fraction * path[k, 1], path[k, 2] + fraction * path[k, 3]
        ca, cs, normal_force, scale = path[k, 4] if forward >= 0.0 else path[k, 5], path[k, 6], path[k, 7], path[k, 8]
        threshold = path[k, 9]
        speed = math.sqrt(ca * forward * forward + cs * side * side) / scale
        work = ca * forward * path[k, 1] + cs * side * path[k, 3]
        ratio = friction_over_speed(speed, threshold)
        first += normal_force * ratio / scale * work
        second += normal_force * ratio / scale * (ca * path[k, 1] ** 2 + cs * path[k, 3] ** 2)
        if speed > 0.0:
            bend = friction_slope(speed, threshold) - ratio
            second += normal_force * bend / (speed * speed * scale**3) * work * work
    return first, second


@kernel
def friction_limit(count, path, slope, bound):
    """Return the fraction of a step, at most `bound`, after which friction stops it.

    Parameters
    ----------
    count : int
        Number of contacts.
    path : Array
        Slip paths of contacts, shape (≥ count, `PATH_SIZE`).
    slope : float
        φ′(0) ≤ 0 [J], of a step with the exact Hessian.
    bound : float
    """
    enough = PASSED * -slope
    force, curvature = _dissipated(count, path, 0.0)
    other, rest = max(-slope - curvature, 0.0), slope - force
    low, high, middle = 0.0, bound, bound
    for _ in range(MAX_HALVINGS):
        present = rest + middle * other + _dissipated(count, path, middle)[0]
        if abs(present) <= enough or (middle == bound and present <= enough):
            break
        if present > 0.0:
            high = middle
        else:
            low = middle
        middle = 0.5 * (low + high)
    return middle


@piece(float, Problem, Configuration, Stage, float, float)
def limit_by_friction(p, at, stage, slope, bound):
    """Return `friction_limit` of the present step by all contacts; the matrix that it was solved with is that
    of `at`.
    """
    slips, sliding, system, count = p.slips, p.sliding, p.system, 0
    if sliding.exists:
        count = sliding.count[0]
        slip_paths(sliding, p.surfaces, p.strands, at, stage, system, slips.path)
    if p.rod_contact.exists:
        count = rod_slip_along(p.rod_contact, p.strands, stage, at, system, count, slips.path)
    return friction_limit(count, slips.path, slope, bound) if count > 0 else bound
