"""Derivatives of what free bodies, and the nodes that they hold, do in a stage.

A body has six unknowns, its motion X and its turn φ, and in place of velocities v and the angular momentum L. With
R̄, L̄ of the origin, h the length of the stage, E = exp(h ω̃), J its left Jacobian there, and I the inertia at R̃ = E R̄,

    I ω̃ = L̄:   (I + h N J) dω̃ = dL̄ − N E dφ̄,   N = I [ω̃]× − [L̄]×,   dφ̃ = E dφ̄ + h J dω̃

and what is held at the arm a = R̃ r has the origin X̄ + (1 − h [ω̃]×) a. Inertia has the moment −ax(A)/(h h′), with
A = R̃ J Rᵀ, and L = L̄ − ax(A)/h at the end (`forces.inertia`, `engine.step_ends`). Origins of later stages follow by
rotation vectors, θ of earlier ones from their origins, as in `engine.stages`.

A history turns the origin by x = c h ω + d h² ω̇, with I ω = L and I ω̇ = M − ω × L at the start of the step.
"""

from __future__ import annotations

import math

from bilayer_core.jit import kernel, piece, record
from bilayer_core.jit.called import stack_matrix, stack_vector
from bilayer_core.jit.record import Matrix, Stack, Tensor
from bilayer_core.kinematics.rotating import inertia_tensor
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.step import Configuration, Method, StateArrays, Work

SMALL = 1e-3
"""Angles below which Jacobians are series [rad]."""


@record
class BodyMaps:
    """Linear maps of free bodies in a stage, 3 × 3 each."""

    ahead_by_turn: Stack  # dφ̃ by dφ̄, shape (n_free, 3, 3)
    ahead_by_spin: Stack  # and by dL̄
    rate_by_turn: Stack  # dω̃ likewise
    rate_by_spin: Stack
    before: Stack  # d ax(A) by dφ̃
    end: Stack  # and by dφ
    first: Stack  # of turns of the origin by those at the start of the step
    gain: Tensor  # and by what earlier stages turned, shape (n_stage, n_free, 3, 3)
    turned: Tensor  # which they did from their origins by these
    history: Tensor  # by φ, L and M at the start of the step, shape (3, n_free, 3, 3)
    beyond: Stack  # and by turns without a history
    held_by_turn: Stack  # origins of held nodes by dφ̃, shape (n_attached, 3, 3)
    held_by_spin: Stack  # and by dω̃
    held_ahead: Stack  # their first guesses by dφ̃
    motion: Matrix  # dφ̃ and dω̃, or derivatives by them, shape (n_free, 6)


@kernel
def _cross_matrix(x, y, z, out):
    """Write the matrix [v]×."""
    out[0, 0] = out[1, 1] = out[2, 2] = 0.0
    out[0, 1], out[0, 2], out[1, 2] = -z, y, -x
    out[1, 0], out[2, 0], out[2, 1] = z, -y, x


@kernel
def _product(a, b, factor, out):
    """Add factor times a b to another matrix."""
    for i in range(3):
        for j in range(3):
            out[i, j] += factor * (a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j])


@kernel
def _set(a, diagonal):
    """Make a matrix a multiple of that which changes nothing."""
    for i in range(3):
        for j in range(3):
            a[i, j] = diagonal if i == j else 0.0


@kernel
def _inverse(a, out):
    """Write the inverse of a regular matrix."""
    for i in range(3):
        for j in range(3):
            k, n, r, s = (i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3
            out[j, i] = a[k, r] * a[n, s] - a[k, s] * a[n, r]
    determinant = a[0, 0] * out[0, 0] + a[0, 1] * out[1, 0] + a[0, 2] * out[2, 0]
    for i in range(3):
        for j in range(3):
            out[i, j] /= determinant


@kernel
def _turn_of(x, y, z, rotation_out, jacobian_out):
    """Write exp([v]×), and by what it turns more for an increment of v."""
    square, k = x * x + y * y + z * z, stack_matrix(3, 3)
    angle = math.sqrt(square)
    _cross_matrix(x, y, z, k)
    if angle < SMALL:
        first, second = 0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0
    else:
        first, second = (1.0 - math.cos(angle)) / square, (angle - math.sin(angle)) / (square * angle)
    _set(jacobian_out, 1.0)
    for i in range(3):
        for j in range(3):
            jacobian_out[i, j] += first * k[i, j]
    _product(k, k, second, jacobian_out)
    _set(rotation_out, 1.0)
    _product(k, jacobian_out, 1.0, rotation_out)


@piece(int, Problem, StateArrays, Method, Work, int, float, Configuration, BodyMaps)
def write_body_maps(p, state, method, work, n, h, at, maps):
    """Write the maps of stage n of a step of length h, which has ended at a configuration, from the step's start."""
    bodies, stage, length = p.bodies, work.stage, work.stage.length
    turn, jacobian, crossed, inertia = stack_matrix(3, 3), stack_matrix(3, 3), stack_matrix(3, 3), stack_matrix(3, 3)
    a, b, c = stack_matrix(3, 3), stack_matrix(3, 3), stack_matrix(3, 3)
    for f in range(bodies.mass.shape[0]):
        moment, before, end = bodies.second_moment[f], stage.predicted_body_rotation[f], at.body_rotation[f]
        spin, momentum = stage.body_spin, work.origin.angular_momentum
        _turn_of(length * spin[f, 0], length * spin[f, 1], length * spin[f, 2], turn, jacobian)
        inertia_tensor(bodies.second_moment, f, stage.predicted_body_rotation, f, inertia)
        _cross_matrix(spin[f, 0], spin[f, 1], spin[f, 2], crossed)
        _cross_matrix(-momentum[f, 0], -momentum[f, 1], -momentum[f, 2], a)
        _product(inertia, crossed, 1.0, a)  # N
        for k in range(3):
            for j in range(3):
                b[k, j] = inertia[k, j]
        _product(a, jacobian, length, b)
        rate_by_turn, rate_by_spin = maps.rate_by_turn[f], maps.rate_by_spin[f]
        _set(rate_by_turn, 0.0)
        _set(rate_by_spin, 0.0)
        if inertia[0, 0] + inertia[1, 1] + inertia[2, 2] != 0.0:
            _inverse(b, rate_by_spin)
            _set(c, 0.0)
            _product(a, turn, -1.0, c)
            _product(rate_by_spin, c, 1.0, rate_by_turn)
        by_turn, by_spin = maps.ahead_by_turn[f], maps.ahead_by_spin[f]
        for k in range(3):
            for j in range(3):
                by_turn[k, j], by_spin[k, j] = turn[k, j], 0.0
        _product(jacobian, rate_by_turn, length, by_turn)
        _product(jacobian, rate_by_spin, length, by_spin)
        _set(a, 0.0)
        _set(b, 0.0)
        _product(before, moment, 1.0, a)
        for k in range(3):
            for j in range(3):
                b[k, j] = a[k, 0] * end[j, 0] + a[k, 1] * end[j, 1] + a[k, 2] * end[j, 2]
        trace = b[0, 0] + b[1, 1] + b[2, 2]
        for k in range(3):
            for j in range(3):
                diagonal = trace if k == j else 0.0
                maps.before[f, k, j], maps.end[f, k, j] = diagonal - b[k, j], b[j, k] - diagonal
        _write_chain(p, method, work, n, f, maps)
        if method.history:
            _write_history(p, state, method, n, h, f, maps)
    _write_held(p, stage, maps)
    return READY


@kernel
def _write_chain(p, method, work, n, f, maps):
    """Write by what the origin of stage n turns with the start of the step and with earlier stages."""
    b, rotation, jacobian = p.bodies.body_of_free[f], stack_matrix(3, 3), stack_matrix(3, 3)
    turn, own, inverse, scratch = stack_matrix(3, 3), stack_matrix(3, 3), stack_matrix(3, 3), stack_matrix(3, 3)
    _set(maps.first[f], 1.0)
    for j in range(n):
        v, weight = work.gained_rotation_vector, method.couplings[n, j]
        x, y, z = v[j, b, 0], v[j, b, 1], v[j, b, 2]
        _turn_of(x, y, z, rotation, jacobian)
        _inverse(jacobian, inverse)
        _turn_of(weight * x, weight * y, weight * z, turn, own)
        _turn_on(turn, maps.first[f], scratch)
        for i in range(j):
            _turn_on(turn, maps.gain[i, f], scratch)
        _set(maps.gain[j, f], 0.0)
        _product(own, inverse, weight, maps.gain[j, f])
        for i in range(3):
            for k in range(3):
                maps.turned[j, f, i, k] = rotation[i, k]


@kernel
def _turn_on(turn, a, scratch):
    """Replace a by its product with a rotation."""
    _set(scratch, 0.0)
    _product(turn, a, 1.0, scratch)
    for i in range(3):
        for k in range(3):
            a[i, k] = scratch[i, k]


@kernel
def _write_history(p, state, method, n, h, f, maps):
    """Write by what a history turns the origin of stage n."""
    b, along, bend = p.bodies.body_of_free[f], method.along[n] * h, method.bend * h * h
    inertia, inverse, jacobian = stack_matrix(3, 3), stack_matrix(3, 3), stack_matrix(3, 3)
    of_spin, of_moment, of_rate, part = stack_matrix(3, 3), stack_matrix(3, 3), stack_matrix(3, 3), stack_matrix(3, 3)
    spin, rate, own, m = state.body_angular_velocity, stack_vector(3), stack_vector(3), stack_vector(3)
    inertia_tensor(p.bodies.second_moment, f, state.body_rotation, b, inertia)
    _inverse(inertia, inverse)
    for c in range(3):
        own[c] = inertia[c, 0] * spin[b, 0] + inertia[c, 1] * spin[b, 1] + inertia[c, 2] * spin[b, 2]
    for c in range(3):
        i, j = (c + 1) % 3, (c + 2) % 3
        m[c] = state.body_moment[f, c] - (spin[b, i] * own[j] - spin[b, j] * own[i])
    for c in range(3):
        rate[c] = inverse[c, 0] * m[0] + inverse[c, 1] * m[1] + inverse[c, 2] * m[2]
    _turn_of(
        along * spin[b, 0] + bend * rate[0],
        along * spin[b, 1] + bend * rate[1],
        along * spin[b, 2] + bend * rate[2],
        maps.beyond[f],
        jacobian,
    )
    for by in range(3):  # the turn at the start, L and M
        one_turn, one_momentum, one_moment = 1.0 * (by == 0), 1.0 * (by == 1), 1.0 * (by == 2)
        _cross_matrix(one_turn * own[0], one_turn * own[1], one_turn * own[2], part)
        for c in range(3):
            part[c, c] += one_momentum
        _cross_matrix(-one_turn * spin[b, 0], -one_turn * spin[b, 1], -one_turn * spin[b, 2], of_spin)
        _product(inverse, part, 1.0, of_spin)
        k = -one_momentum
        _cross_matrix(k * spin[b, 0], k * spin[b, 1], k * spin[b, 2], of_moment)
        for c in range(3):
            of_moment[c, c] += one_moment
        _cross_matrix(own[0], own[1], own[2], part)
        _product(part, of_spin, 1.0, of_moment)
        _cross_matrix(one_turn * m[0], one_turn * m[1], one_turn * m[2], part)
        for i in range(3):
            for j in range(3):
                of_moment[i, j] += part[i, j]
        _cross_matrix(-one_turn * rate[0], -one_turn * rate[1], -one_turn * rate[2], of_rate)
        _product(inverse, of_moment, 1.0, of_rate)
        for i in range(3):
            for j in range(3):
                part[i, j] = along * of_spin[i, j] + bend * of_rate[i, j]
        _set(maps.history[by, f], 0.0)
        _product(jacobian, part, 1.0, maps.history[by, f])


@kernel
def _write_held(p, stage, maps):
    """Write where held nodes and their first guesses go with R̃ and ω̃."""
    constrained, length, arm, crossed = p.constrained, stage.length, stage.attached_arm, stack_matrix(3, 3)
    for k in range(constrained.node.shape[0]):
        f = constrained.free[k]
        if f < 0:
            continue
        ahead, by_turn, by_spin = maps.held_ahead[k], maps.held_by_turn[k], maps.held_by_spin[k]
        _cross_matrix(-arm[k, 0], -arm[k, 1], -arm[k, 2], ahead)
        _cross_matrix(stage.body_spin[f, 0], stage.body_spin[f, 1], stage.body_spin[f, 2], crossed)
        for i in range(3):
            for j in range(3):
                by_turn[i, j], by_spin[i, j] = ahead[i, j], -length * ahead[i, j]
        _product(crossed, ahead, -length, by_turn)


@kernel
def _apply(a, of, first, factor, out, to):
    """Add factor times a, to three numbers of a vector, to three of another one."""
    for i in range(3):
        out[to + i] += factor * (a[i, 0] * of[first] + a[i, 1] * of[first + 1] + a[i, 2] * of[first + 2])


@kernel
def _apply_back(a, of, first, factor, out, to):
    """Add factor times aᵀ likewise."""
    for i in range(3):
        out[to + i] += factor * (a[0, i] * of[first] + a[1, i] * of[first + 1] + a[2, i] * of[first + 2])


@kernel
def _clear_three(of, first):
    of[first] = of[first + 1] = of[first + 2] = 0.0


@kernel
def _turns(p, f):
    """Return the first of the three turns of free body f among all unknowns."""
    return p.sums.gradient.shape[0] + 6 * f + 3


@kernel
def turn_origin(p, maps, method, n, first, speed, push, ends, origins, origin):
    """Write turns of the origin of stage n, from those at the start of the step and at earlier stages, with what a
    history keeps.
    """
    own = stack_vector(3)
    for f in range(p.bodies.mass.shape[0]):
        t = _turns(p, f)
        _clear_three(own, 0)
        _apply(maps.first[f], first, t, 1.0, own, 0)
        for j in range(n):
            rest = stack_vector(3)
            for c in range(3):
                rest[c] = ends[j, t + c]
            _apply(maps.turned[j, f], origins[j], t, -1.0, rest, 0)
            _apply(maps.gain[j, f], rest, 0, 1.0, own, 0)
        if not method.history:
            for c in range(3):
                origin[t + c] = own[c]
            continue
        _clear_three(origin, t)
        _apply(maps.beyond[f], own, 0, 1.0, origin, t)
        _apply(maps.history[0, f], first, t, 1.0, origin, t)
        _apply(maps.history[1, f], speed, t, 1.0, origin, t)
        _apply(maps.history[2, f], push, t, 1.0, origin, t)


@kernel
def turn_origin_back(p, maps, method, n, first, speed, push, ends, origins, origin):
    """Take derivatives by turns of the origin of stage n."""
    by, pulled = stack_vector(3), stack_vector(3)
    for f in range(p.bodies.mass.shape[0]):
        t = _turns(p, f)
        _clear_three(by, 0)
        if method.history:
            _apply_back(maps.history[0, f], origin, t, 1.0, first, t)
            _apply_back(maps.history[1, f], origin, t, 1.0, speed, t)
            _apply_back(maps.history[2, f], origin, t, 1.0, push, t)
            _apply_back(maps.beyond[f], origin, t, 1.0, by, 0)
        else:
            for c in range(3):
                by[c] = origin[t + c]
        _clear_three(origin, t)
        _apply_back(maps.first[f], by, 0, 1.0, first, t)
        for j in range(n):
            _clear_three(pulled, 0)
            _apply_back(maps.gain[j, f], by, 0, 1.0, pulled, 0)
            for c in range(3):
                ends[j, t + c] += pulled[c]
            _apply_back(maps.turned[j, f], pulled, 0, -1.0, origins[j], t)


@kernel
def predict(p, maps, origin, speed):
    """Write turns to where inertia takes bodies, changes of ω̃, and the origin of held nodes."""
    constrained, motion = p.constrained, maps.motion
    for f in range(p.bodies.mass.shape[0]):
        t = _turns(p, f)
        motion[f] = 0.0
        _apply(maps.ahead_by_turn[f], origin, t, 1.0, motion[f], 0)
        _apply(maps.ahead_by_spin[f], speed, t, 1.0, motion[f], 0)
        _apply(maps.rate_by_turn[f], origin, t, 1.0, motion[f], 3)
        _apply(maps.rate_by_spin[f], speed, t, 1.0, motion[f], 3)
    for k in range(constrained.unknown.shape[0]):
        a, f = constrained.unknown[k], constrained.free[k]
        if f >= 0:
            x = _turns(p, f) - 3
            for c in range(3):
                origin[a + c] = origin[x + c]
            _apply(maps.held_by_turn[k], motion[f], 0, 1.0, origin, a)
            _apply(maps.held_by_spin[k], motion[f], 3, 1.0, origin, a)


@kernel
def predict_back(p, maps, origin, speed):
    """Take derivatives by what `predict` writes."""
    constrained, motion = p.constrained, maps.motion
    for k in range(constrained.unknown.shape[0]):
        a, f = constrained.unknown[k], constrained.free[k]
        if f >= 0:
            x = _turns(p, f) - 3
            for c in range(3):
                origin[x + c] += origin[a + c]
            _apply_back(maps.held_by_turn[k], origin, a, 1.0, motion[f], 0)
            _apply_back(maps.held_by_spin[k], origin, a, 1.0, motion[f], 3)
            _clear_three(origin, a)
    for f in range(p.bodies.mass.shape[0]):
        t = _turns(p, f)
        _apply_back(maps.ahead_by_turn[f], motion[f], 0, 1.0, origin, t)
        _apply_back(maps.rate_by_turn[f], motion[f], 3, 1.0, origin, t)
        _apply_back(maps.ahead_by_spin[f], motion[f], 0, 1.0, speed, t)
        _apply_back(maps.rate_by_spin[f], motion[f], 3, 1.0, speed, t)


@kernel
def guess_held(p, maps, length, origin, speed, guess):
    """Write where the first guess of held nodes goes."""
    constrained = p.constrained
    for k in range(constrained.unknown.shape[0]):
        a, f = constrained.unknown[k], constrained.free[k]
        if f >= 0:
            x = _turns(p, f) - 3
            for c in range(3):
                guess[a + c] = origin[x + c] + length * speed[x + c]
            _apply(maps.held_ahead[k], maps.motion[f], 0, 1.0, guess, a)


@kernel
def guess_held_back(p, maps, length, guess, origin, speed):
    """Take derivatives by the first guess of held nodes."""
    constrained = p.constrained
    for k in range(constrained.unknown.shape[0]):
        a, f = constrained.unknown[k], constrained.free[k]
        if f >= 0:
            x = _turns(p, f) - 3
            for c in range(3):
                origin[x + c] += guess[a + c]
                speed[x + c] += length * guess[a + c]
            _apply_back(maps.held_ahead[k], guess, a, 1.0, maps.motion[f], 0)


@kernel
def push_bodies(p, maps, factor, right):
    """Add factor times the moments that turns to where inertia takes bodies make."""
    for f in range(p.bodies.mass.shape[0]):
        _apply(maps.before[f], maps.motion[f], 0, factor, right, _turns(p, f))


@kernel
def push_bodies_back(p, maps, factor, right):
    """Take derivatives by these moments."""
    for f in range(p.bodies.mass.shape[0]):
        _apply_back(maps.before[f], right, _turns(p, f), factor, maps.motion[f], 0)


@kernel
def end_bodies(p, maps, length, end, origin_speed, end_speed):
    """Write angular momenta at the end."""
    for f in range(p.bodies.mass.shape[0]):
        t = _turns(p, f)
        for c in range(3):
            end_speed[t + c] = origin_speed[t + c]
        _apply(maps.before[f], maps.motion[f], 0, -1.0 / length, end_speed, t)
        _apply(maps.end[f], end, t, -1.0 / length, end_speed, t)


@kernel
def end_bodies_back(p, maps, length, end, origin_speed, end_speed):
    """Take derivatives by angular momenta at the end; those by `motion` begin."""
    for f in range(p.bodies.mass.shape[0]):
        t = _turns(p, f)
        maps.motion[f] = 0.0
        _apply_back(maps.before[f], end_speed, t, -1.0 / length, maps.motion[f], 0)
        _apply_back(maps.end[f], end_speed, t, -1.0 / length, end, t)
        for c in range(3):
            origin_speed[t + c] += end_speed[t + c]
        _clear_three(end_speed, t)
