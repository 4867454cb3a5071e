"""Solutions with a matrix whose factor is known in part: the Hessian of Newton's method, and what it lacks."""

from __future__ import annotations

import math

from bilayer_core.engine.linear.lacking_matrix import LackingMatrix, multiply
from bilayer_core.engine.linear.newton_matrix import solve
from bilayer_core.jit import kernel, piece, record
from bilayer_core.jit.record import Matrix, Vector
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.step import Configuration

ROUNDED = 1e-13
"""What may be left of a solution, of the whole."""


@record
class Lack:
    """Part of a matrix that a Hessian lacks, by motions of all nodes and forces on them, those among them that bodies
    hold, and the space of Krylov in which both are solved.
    """

    matrix: LackingMatrix
    basis: Matrix  # shape (n_round + 1, size)
    projected: Matrix  # H, shape (n_round, n_round + 1), a row for each vector
    turns: Matrix  # cosines and sines, shape (n_round, 2)
    rest: Vector  # shape (n_round + 1,)
    spread: Vector  # motions, with those of nodes that bodies hold, shape (size,)
    force: Vector  # likewise


@kernel
def spread(p, at, out):
    """Write the motions of nodes that bodies hold from those of the bodies."""
    constrained, rods = p.constrained, p.sums.gradient.shape[0]
    for k in range(constrained.unknown.shape[0]):
        a, f = constrained.unknown[k], constrained.free[k]
        out[a] = out[a + 1] = out[a + 2] = 0.0
        if f >= 0:
            b = rods + 6 * f
            for c in range(3):
                i, j = (c + 1) % 3, (c + 2) % 3
                out[a + c] = out[b + c] + out[b + 3 + i] * at.arm[k, j] - out[b + 3 + j] * at.arm[k, i]


@kernel
def gather(p, at, forces):
    """Move forces on nodes that bodies hold to the bodies."""
    constrained, rods = p.constrained, p.sums.gradient.shape[0]
    for k in range(constrained.unknown.shape[0]):
        a, f = constrained.unknown[k], constrained.free[k]
        if f >= 0:
            b = rods + 6 * f
            for c in range(3):
                i, j = (c + 1) % 3, (c + 2) % 3
                forces[b + c] += forces[a + c]
                forces[b + 3 + c] += at.arm[k, i] * forces[a + j] - at.arm[k, j] * forces[a + i]
        forces[a] = forces[a + 1] = forces[a + 2] = 0.0


@kernel
def _solve(p, out):
    """Write the inverse of the factorised Hessian times the present gradient, of free bodies last."""
    solve(p)
    rods = p.system.step.shape[0]
    for j in range(rods):
        out[j] = -p.system.step[j]
    for f in range(p.bodies.mass.shape[0]):
        for c in range(6):
            out[rods + 6 * f + c] = -p.system.body_step[f, c]


@kernel
def _dot(a, b):
    total = 0.0
    for j in range(a.shape[0]):
        total += a[j] * b[j]
    return total


@piece(int, Problem, Configuration, Lack, float, bool)
def solve_with_lack(p, at, lack, enough, back):
    """Write the inverse of the factorised Hessian of a configuration and of what it lacks together, `back` that of the
    transpose, times the present gradient, to `System.step`, by GMRES with the Hessian before it; what is left over is
    `enough` of the whole at most.
    """
    basis, projected, turns, rest = lack.basis, lack.projected, lack.turns, lack.rest
    step, body_step, size, rods = p.system.step, p.system.body_step, basis.shape[1], p.sums.gradient.shape[0]
    _solve(p, basis[0])
    whole, count = math.sqrt(_dot(basis[0], basis[0])), 0
    step[:] = 0.0
    body_step[:] = 0.0
    if whole == 0.0:
        return READY
    rest[:] = 0.0
    rest[0] = whole
    for j in range(size):
        basis[0, j] /= whole
    while count < projected.shape[0] and abs(rest[count]) > enough * whole:
        now, after, moved = basis[count], basis[count + 1], lack.spread
        for j in range(size):
            moved[j] = now[j]
        spread(p, at, moved)
        lack.force[:] = 0.0
        multiply(lack.matrix, moved, back, lack.force)
        gather(p, at, lack.force)
        for j in range(rods):
            p.sums.gradient[j] = lack.force[j]
        for j in range(rods, size):
            p.sums.body[(j - rods) // 6, (j - rods) % 6] = lack.force[j]
        _solve(p, after)
        for j in range(size):
            after[j] += now[j]
        row = projected[count]
        for m in range(count + 1):
            row[m] = _dot(after, basis[m])
            for j in range(size):
                after[j] -= row[m] * basis[m, j]
        last = math.sqrt(_dot(after, after))
        for j in range(size if last > 0.0 else 0):
            after[j] /= last
        for m in range(count):
            above, below = row[m], row[m + 1]
            row[m] = turns[m, 0] * above + turns[m, 1] * below
            row[m + 1] = turns[m, 0] * below - turns[m, 1] * above
        size_of_last = math.hypot(row[count], last)
        turns[count, 0], turns[count, 1] = row[count] / size_of_last, last / size_of_last
        row[count] = size_of_last
        rest[count + 1] = -turns[count, 1] * rest[count]
        rest[count] *= turns[count, 0]
        count += 1
    step[:] = 0.0
    body_step[:] = 0.0
    for k in range(count - 1, -1, -1):
        for m in range(k + 1, count):
            rest[k] -= projected[m, k] * rest[m]
        rest[k] /= projected[k, k]
        for j in range(rods):
            step[j] += rest[k] * basis[k, j]
        for j in range(rods, size):
            body_step[(j - rods) // 6, (j - rods) % 6] += rest[k] * basis[k, j]
    return READY
