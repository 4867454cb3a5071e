"""Derivatives of impacts with a restitution: by gaps at the origin of a stage, and by speeds of approach in memory.

A gap is a strain with a rate of its own. With f the barrier's force, the damped one is f (1 − λ (d − d°)/(γ h)), and
friction follows it: so ∂g/∂d° is a difference, of the few pairs that touch, and ∂g/∂λ = −∂g/∂d° (d − d°)/λ.
"""

from __future__ import annotations

import numpy as np

from bilayer_core.engine.gradient_differences import Gaps, write_gaps
from bilayer_core.forces.restitution import MOST
from bilayer_core.model.records.step import Configuration
from bilayer_core.simulation.gradients.entries import Entries
from bilayer_core.simulation.gradients.step_again import StepAgain

Array = np.ndarray
CHANGE = 1e-3
"""Of gaps, over the barrier distance, for differences: damping is linear in them."""


def _gaps(again: StepAgain, at: Configuration) -> Gaps:
    """Return the gaps of all pairs at a configuration."""
    count = len(again.problem.restitution.rate)
    found = Gaps(gap=np.zeros(count), normal=np.zeros((count, 3)))
    write_gaps(again.problem, at, found)
    return found


def slopes_of_gaps(again: StepAgain, at: Configuration) -> Entries:
    """Return ∂d/∂(X, φ) of all pairs in their rows among strains, shape (n_strain, size)."""
    restitution, surfaces, bodies = again.problem.restitution, again.problem.surfaces, again.problem.bodies
    normal, which = _gaps(again, at).normal, np.arange(len(restitution.rate))
    x, parts = at.contact_point[restitution.point], []
    of_both = surfaces.contact_point_body[restitution.point], surfaces.body[restitution.surface]
    for sign, body in zip((1.0, -1.0), of_both, strict=True):
        free = bodies.free_index[body]
        moves = np.flatnonzero(free >= 0)
        n = sign * normal[moves]
        turns = np.cross(x[moves] - at.pose_position[body[moves]], n)
        row = np.repeat(restitution.first + which[moves], 6)
        parts.append((row, again.of_bodies[free[moves]].ravel(), np.concatenate([n, turns], axis=1).ravel()))
    row, column, value = (np.concatenate(of) for of in zip(*parts, strict=True))
    return Entries(row, column, value, (again.stage.origin_strain.size, again.size))


def by_impacts(again: StepAgain, at: Configuration) -> tuple[Entries, Entries]:
    """Return ∂g by strains at the origin of a stage that ends at a configuration, and by speeds in memory, shapes
    (size, n_strain), (size, n_kept).
    """
    restitution, stage, size, memory = again.problem.restitution, again.stage, again.size, again.speeds
    gap, origin = _gaps(again, at).gap, stage.origin_strain
    rows, by_origin, by_memory = [], np.zeros((0, size)), np.zeros((0, size))
    forces = [name for name in ("barrier", "restitution", "friction") if name in again.model.forces]
    change = CHANGE * again.problem.surfaces.d_hat
    for k in np.flatnonzero((gap < again.problem.surfaces.d_hat) & (restitution.rate > 0.0)):
        row, rate = restitution.first + k, restitution.rate[k]
        open_by = gap[k] - origin[row]
        if rate / stage.length * open_by > MOST:
            continue
        sides = []
        for way in (1.0, -2.0):
            origin[row] += way * change
            again.follow(at)
            again.evaluate(at, forces)
            sides.append(again.whole_gradient())
        origin[row] += change
        slope = (sides[0] - sides[1]) / (2.0 * change)
        approach = restitution.damping / rate
        of_rate = -rate / approach * np.sign(memory[k]) if approach > restitution.slowest else 0.0
        rows.append(k)
        by_origin = np.vstack([by_origin, slope])
        by_memory = np.vstack([by_memory, -slope * open_by / rate * of_rate])
    again.follow(at)
    chosen = np.array(rows, dtype=np.int64)
    nothing = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0)
    of_strains = Entries(*nothing, (size, origin.size)).beside(by_origin, restitution.first + chosen)
    return of_strains, Entries(*nothing, (size, again.kept)).beside(by_memory, chosen)


def speeds_at_end(again: StepAgain) -> tuple[Array, Array, Array]:
    """Return the speeds of approach that a step leaves in memory, and how they depend on those before and on the rates
    of gaps, shape (3, n_pair).
    """
    restitution, memory = again.problem.restitution, again.speeds
    gap = _gaps(again, again.last).gap
    rate = again.end_rates[restitution.first : restitution.first + len(gap)]
    closing, known, apart = np.maximum(-rate, 0.0), np.abs(memory), gap >= again.problem.surfaces.d_hat
    grows = closing > known
    return (
        np.where(apart, -closing, np.maximum(known, closing)),
        np.where(apart | grows, 0.0, np.sign(memory)),
        np.where(closing > 0.0, np.where(apart, 1.0, np.where(grows, -1.0, 0.0)), 0.0),
    )
