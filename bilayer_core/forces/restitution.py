"""Contact damping of bodies from a coefficient of restitution, a part of the barrier (`forces.surface_barrier`).

The barrier's force f(d) = −K_c w b′(d) becomes f (1 − λ ḋ): larger while a contact closes, smaller while it opens. A
mass that comes with the speed u has, with v = −ḋ, m v dv = −f (1 + λ v) dd, so that over the closing and the opening

    m ∫ v dv/(1 + λ v) = ∫ f dd    ⇒    z − ln(1 + z) = −e z − ln(1 − e z),    z = λ u

whatever the barrier and the mass are: e belongs to one z (1: 0, 0.9: 0.1665, 0.5: 1.433, and z → 1/e for small e), and
λ = z/u with the speed u of the approach. (Hunt and Crossley 1975, with the λ that their approximation stands for.)

Over a stage gaps advance as strains do (`forces.viscosity`): from an origin d°, by ḋ = (d − d°)/(γ h). With
β = λ/(γ h) the damping is the potential

    K_c w D(d),   D′ = −β (d − d°) b′,   D = β (B − (d − d°) b),   B′ = b

and the factor 1 − β (d − d°) is kept above 1 − `MOST`: nothing pulls, and the barrier stays one.

Memory. Of each pair of a body's contact point and a surface, the speed at which they approached when they were last
beyond the barrier distance, below zero as long as they are; the largest since, while they touch; 0 before either is
known, and then nothing is damped. In a first step into the barrier what gravity adds to that speed over a stage counts.
"""

from __future__ import annotations

import math

from bilayer_core.contact.barrier import barrier
from bilayer_core.contact.gap import gap_normal
from bilayer_core.jit import kernel, piece
from bilayer_core.model.force_slots import slot_of
from bilayer_core.model.records.contacts import Restitution
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.step import Configuration, Stage

RESTITUTION = slot_of("restitution")
MOST = 0.999
"""Part of the elastic force that damping takes at most."""
SERIES_UP_TO, SERIES_TERMS = 0.3, 32
"""Of 1 − d/d̂, and how many terms that takes to the last digit: 0.3³² is 2e-17."""
LARGEST_DAMPING = 100.0
"""z of coefficients below 0.01."""


def damping_of(restitution: float) -> float:
    """Return z of a coefficient of restitution."""
    if restitution * LARGEST_DAMPING <= 1.0:
        return LARGEST_DAMPING
    if restitution >= 1.0:
        return 0.0
    from scipy.optimize import brentq  # which takes longer to import than numba

    def difference(z: float) -> float:
        return z - math.log1p(z) + restitution * z + math.log1p(-restitution * z)

    small, most = 1e-3 * (1.0 - restitution), (1.0 - 1e-13) / restitution
    return float(brentq(difference, small, most, xtol=1e-14)) if difference(most) < 0.0 else most


def with_memory(restitution: Restitution, first: int) -> Restitution:
    """Return the record with its memory beginning at slot `first` of `Problem.memory`."""
    restitution.memory[:] = first
    return restitution


@kernel
def integral_of_barrier(d, d_hat):
    """Return B(d) = ∫ b from d̂ to d [m³], with y = 1 − d/d̂: d̂³ ∫ y² ln(1 − y) dy = −d̂³ Σ y^(k+3)/(k (k + 3)), k ≥
    1.

    In closed form that is a difference of order y⁴ between terms of order y: for small y the sum keeps its digits.
    """
    y = 1.0 - d / d_hat
    if y > SERIES_UP_TO:
        closed = (y**3 - 1.0) * math.log(d / d_hat) - y * (1.0 + y * (0.5 + y / 3.0))
        return d_hat**3 / 3.0 * closed
    total = 0.0
    for k in range(SERIES_TERMS, 0, -1):
        total = total * y + 1.0 / (k * (k + 3.0))
    return -(d_hat**3) * y**4 * total


@kernel
def damping_at(p, stage, i, s, d):
    """Return the damping of contact point i on surface s at a gap d: the part of the elastic force that it takes, β
    [1/m], 0 where that part is the most, and D [m²].
    """
    restitution = p.restitution
    row = restitution.row[i, s]
    if row < 0 or restitution.rate[row] == 0.0:
        return 0.0, 0.0, 0.0
    d_hat, origin = p.surfaces.d_hat, stage.origin_strain[restitution.first + row]
    beta = restitution.rate[row] / stage.length
    part = beta * (d - origin)
    if part <= MOST:
        return part, beta, beta * (integral_of_barrier(d, d_hat) - (d - origin) * barrier(d, d_hat))
    last = origin + MOST / beta
    until = 0.0
    if last > 0.0:
        until = beta * integral_of_barrier(last, d_hat)  # and −(last − d°) β = −MOST of b, which the next has
    return MOST, 0.0, until - MOST * barrier(d, d_hat)


@kernel
def measure_gaps(p, at, strain_out):
    """Write the gaps of pairs whose impacts are damped, after the strains (`viscosity.measure_strains`)."""
    restitution = p.restitution
    if not restitution.exists:
        return
    for k in range(restitution.point.shape[0]):
        i, s = restitution.point[k], restitution.surface[k]
        x = at.contact_point
        strain_out[restitution.first + k] = gap_normal(
            p.surfaces, at, p.surfaces.radius[i], s, x[i, 0], x[i, 1], x[i, 2]
        )[0]


@piece(float, Restitution, Problem, Configuration, Stage, bool)
def add_restitution(_, p, at, stage, with_hessian):
    """Add nothing: the loop of the barrier adds it (`forces.surface_barrier`)."""
    return math.inf


@piece(int, Restitution, Problem, Configuration, Stage)
def start_restitution(restitution, p, start, stage):
    """Freeze λ of each pair [s/m]; returns a status."""
    weight = math.sqrt(p.gravity[0] ** 2 + p.gravity[1] ** 2 + p.gravity[2] ** 2) * stage.length
    for k in range(restitution.rate.shape[0]):
        speed = p.memory[restitution.memory[0] + k]
        restitution.rate[k] = 0.0
        if speed != 0.0:
            approach = speed if speed > 0.0 else weight - speed
            restitution.rate[k] = restitution.damping / max(approach, restitution.slowest)
    return READY


@piece(int, Restitution, Problem, Configuration, Stage)
def end_restitution(restitution, p, at, stage):
    """Take the speeds of approach at the end of a step into memory; returns a status."""
    for k in range(restitution.rate.shape[0]):
        i, s = restitution.point[k], restitution.surface[k]
        x, slot = at.contact_point, restitution.memory[0] + k
        gap = gap_normal(p.surfaces, at, p.surfaces.radius[i], s, x[i, 0], x[i, 1], x[i, 2])[0]
        closing = max((stage.origin_strain[restitution.first + k] - gap) / stage.length, 0.0)
        known = abs(p.memory[slot])
        p.memory[slot] = -closing if gap >= p.surfaces.d_hat else max(known, closing)
    return READY
