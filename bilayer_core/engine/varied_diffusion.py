"""Diffusion with a diffusivity that depends on the field: steps in the coordinates of its modes.

With w = a − u = Σ q_m v_m(z), q_m = γ_m (y_m − u), the equation of `scene.diffusion_modes` is, for faces that see the
stimulus u and without sources,

    q′ = −γ u′ − λ q + ∫ S (D₀ − D(a)) v′ ∂a/∂z dz

Modes are those of the largest diffusivity D₀ of each layer, of rate λ. The integral, a sum over Gauss points of layers
in which D varies, is what they lack. Steps of h take λ exactly and hold the rest,

    q₁ = q₀ + (1 − exp(−λ h))/λ q′(q₀)

so that fast modes are damped whatever h is, since 0 < D ≤ D₀, and nothing is factorised. Their error is a series in h,
so steps of h and h/2 are extrapolated (Aitken and Neville), to third order with h/3 where that is not enough; the last
two values tell the error, by which h is chosen. Steps of a mechanism are short beside diffusion, so that two are mostly
enough. The same values give the same steps, so runs that are continued or replayed stay the same bit for bit. States
keep y, as for any field.
"""

from __future__ import annotations

import math

from bilayer_core.jit import kernel, piece, record
from bilayer_core.jit.record import Matrix, Vector
from bilayer_core.kinematics.copying import copy
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.varied_fields import DECISIONS

LEVELS = 3
SAFETY, LEAST_FACTOR, LARGEST_FACTOR = 0.8, 0.2, 4.0
SHORTEST = 1e-9
"""Of the time to go: a step of the field that is taken whatever its error."""


@kernel
def _lack(varied, g, a):
    """Return D₀ − D at a point for a value of the field: linear along its curve, constant beyond [m²/s]."""
    first, last = varied.curve_first[varied.curve[g]], varied.curve_first[varied.curve[g] + 1] - 1
    if a <= varied.curve_at[first]:
        return varied.curve_lack[first]
    k = first
    while k < last and varied.curve_at[k + 1] < a:
        k += 1
    if k == last:
        return varied.curve_lack[last]
    part = (a - varied.curve_at[k]) / (varied.curve_at[k + 1] - varied.curve_at[k])
    return varied.curve_lack[k] + part * (varied.curve_lack[k + 1] - varied.curve_lack[k])


@kernel
def _change(varied, own, size, u, push, q):
    """Write q′ to `change`."""
    change = varied.change
    for i in range(size):
        change[i] = -push * varied.amplitude[own, i] - varied.rate[own, i] * q[i]
    for g in range(varied.point[own], varied.point[own + 1]):
        a, slope = u, 0.0
        for i in range(size):
            a += varied.value[g, i] * q[i]
            slope += varied.slope[g, i] * q[i]
        flux = varied.weight[g] * _lack(varied, g, a) * slope
        for i in range(size):
            change[i] += flux * varied.slope[g, i]


@kernel
def _extrapolate(varied, own, size, u, push, h, asked):
    """Write q after a step of length h [s] to `moved`, of the order that is asked for, or with 0 of one that is enough;
    return its error, in parts of what is allowed, and its order.
    """
    level, q, change, span = varied.level, varied.moved, varied.change, varied.span
    for n in range(LEVELS):
        copy(varied.present, q)
        part, square = h / (n + 1), 0.0
        for i in range(size):
            span[i] = -math.expm1(-varied.rate[own, i] * part) / varied.rate[own, i]
        for k in range(n + 1):
            _change(varied, own, size, u + push * (k * part), push, q)
            for i in range(size):
                q[i] += span[i] * change[i]
        for i in range(size):
            better = q[i]  # level[k, i] is that of n parts, extrapolated k times
            for k in range(n):
                before = level[k, i]
                level[k, i] = better
                better += (better - before) / ((n + 1) / (n - k) - 1.0)
            level[n, i] = q[i] = better
            if n > 0:
                square += (better - level[n - 1, i]) ** 2
        error = math.sqrt(square) / varied.tolerance[own]
        if n + 1 == asked or n == LEVELS - 1 or (n > 0 and error <= 1.0 and asked == 0):
            return error, n + 1
    return math.inf, LEVELS


@kernel
def diffuse(varied, drives, f, reached, first, last, dt, reached_out):
    """Advance a field by a time while its stimulus goes linearly from `first` to `last`.

    Parameters
    ----------
    varied : VariedFields
    drives : Drives
    f : int
        The field, one of `varied`.
    reached, reached_out : Vector
        y of all modes at the start and, of this field, at the end [unit of the stimulus].
    first, last : float
        The stimulus, after a jump at the start.
    dt : float
        [s]
    """
    own, begin = varied.number[f], drives.field_first[f]
    size, push, time, h = drives.field_first[f + 1] - begin, (last - first) / dt, 0.0, dt
    for i in range(size):
        varied.present[i] = varied.amplitude[own, i] * (reached[begin + i] - first)
    decided, follows, count = varied.decided, varied.follows[0], 0
    while time < dt:
        asked = decided[own, count] if follows and count < DECISIONS else 0
        ends = asked // 2 % 2 == 1 if asked > 0 else not h < dt - time
        if ends:
            h = dt - time
        error, order = _extrapolate(varied, own, size, first + push * time, push, h, asked // 4)
        factor = LARGEST_FACTOR if error == 0.0 else SAFETY * error ** (-1.0 / order)
        taken = asked % 2 == 1 if asked > 0 else error <= 1.0 or h <= SHORTEST * dt
        if not follows and count < DECISIONS:
            decided[own, count] = 4 * order + 2 * ends + taken
        count += 1
        if taken:
            time = dt if ends else time + h
            copy(varied.moved, varied.present)
        h *= min(max(factor, LEAST_FACTOR), LARGEST_FACTOR)
    for i in range(size):
        reached_out[begin + i] = last + varied.present[i] / varied.amplitude[own, i]


@record
class FieldDifferences:
    """How a field at the end of a time depends on its modes at the start, and on the stimulus there and at the end."""

    start: Vector  # of modes of all fields
    end: Vector
    stimulus: Vector  # first and last
    slope: Matrix  # shape (n_mode, n_mode + 2)


@piece(int, Problem, FieldDifferences, int, float, float)
def differentiate_field(p, differences, f, dt, change):
    """Write how a field depends on what it comes from, by a change of each either way; its steps are decided alike."""
    varied, start, end, stimulus = p.varied_fields, differences.start, differences.end, differences.stimulus
    slope, begin, before = differences.slope, p.drives.field_first[f], varied.follows[0]
    size = slope.shape[0]
    diffuse(varied, p.drives, f, start, stimulus[0], stimulus[1], dt, end)
    varied.follows[0] = True
    for j in range(size + 2):
        inputs, place = (start, begin + j) if j < size else (stimulus, j - size)
        own = inputs[place]
        for side in range(-1, 2, 2):
            inputs[place] = own + side * change
            diffuse(varied, p.drives, f, start, stimulus[0], stimulus[1], dt, end)
            for i in range(size):
                gained = side * end[begin + i] / (2.0 * change)
                slope[i, j] = gained if side < 0 else slope[i, j] + gained
        inputs[place] = own
    varied.follows[0] = before
    return READY
