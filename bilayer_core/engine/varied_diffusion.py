"""Diffusion with a diffusivity that depends on the field: steps in the coordinates of its modes.

With w = a − u = Σ q_m v_m(z), q_m = γ_m (y_m − u), the equation of `scene.diffusion_modes` is, for faces that see the
stimulus u and without sources,

    q′ = −γ u′ − K(a) q,    K_mn(a) = ∫ S D(a) v_m′ v_n′ dz + Σ h S v_m v_n at faces with exchange

The integral is a sum over Gauss points. Steps of h with K₀ = K(a₀), held where all of them begin,

    (1 + h K₀) (q₁ − q₀) = h q′(q₀),

damp fast modes while K is below 2 K₀. Their error is a series in h, so steps of h and h/2 are extrapolated (Aitken and
Neville), to third order with h/3 where that is not enough; the last two values tell the error, by which h is chosen.
Steps of a mechanism are short beside diffusion, so that two are mostly enough. The same values give the same steps, so
runs that are continued or replayed stay the same bit for bit. States keep y, as for any field.
"""

from __future__ import annotations

import math

from bilayer_core.jit import kernel
from bilayer_core.kinematics.copying import copy

LEVELS = 3
SAFETY, LEAST_FACTOR, LARGEST_FACTOR = 0.8, 0.2, 4.0
SHORTEST = 1e-9
"""Of the time to go: a step of the field that is taken whatever its error."""


@kernel
def _diffusivity(varied, g, a):
    """Return the diffusivity at a point for a value of the field: linear along its curve, constant beyond [m²/s]."""
    first, last = varied.curve_first[varied.curve[g]], varied.curve_first[varied.curve[g] + 1] - 1
    if a <= varied.curve_at[first]:
        return varied.curve_value[first]
    k = first
    while k < last and varied.curve_at[k + 1] < a:
        k += 1
    if k == last:
        return varied.curve_value[last]
    part = (a - varied.curve_at[k]) / (varied.curve_at[k + 1] - varied.curve_at[k])
    return varied.curve_value[k] + part * (varied.curve_value[k + 1] - varied.curve_value[k])


@kernel
def _hold(varied, own, size, u, q):
    """Write K(a) to the upper triangle of `matrix`, its diagonal to the last row of `level`, which is made last."""
    matrix, diagonal, entry, square = varied.matrix, varied.level[LEVELS - 1], varied.entry[own], varied.square[own]
    for i in range(size):
        diagonal[i] = varied.exchange[square + i * size + i]
        for j in range(i + 1, size):
            matrix[i, j] = varied.exchange[square + i * size + j]
    for g in range(varied.point[own], varied.point[own + 1]):
        at = entry + (g - varied.point[own]) * size
        a = u
        for i in range(size):
            a += varied.value[at + i] * q[i]
        stiff = varied.weight[g] * _diffusivity(varied, g, a)
        for i in range(size):
            part = stiff * varied.slope[at + i]
            diagonal[i] += part * varied.slope[at + i]
            for j in range(i + 1, size):
                matrix[i, j] += part * varied.slope[at + j]


@kernel
def _factorise(varied, size, h):
    """Write Cholesky's factor of 1 + h K, with K as it is held, to the lower triangle of `matrix`."""
    matrix, diagonal = varied.matrix, varied.level[LEVELS - 1]
    for i in range(size):
        for j in range(i):
            matrix[i, j] = h * matrix[j, i]
        matrix[i, i] = 1.0 + h * diagonal[i]
    for j in range(size):
        for k in range(j):
            matrix[j, j] -= matrix[j, k] * matrix[j, k]
        matrix[j, j] = math.sqrt(matrix[j, j])
        for i in range(j + 1, size):
            for k in range(j):
                matrix[i, j] -= matrix[i, k] * matrix[j, k]
            matrix[i, j] /= matrix[j, j]


@kernel
def _change(varied, own, size, u, push, q, begin, change_out):
    """Write q′ = −γ u′ − K(a) q from `begin` on."""
    entry, square = varied.entry[own], varied.square[own]
    for i in range(size):
        flow = push * varied.amplitude[begin + i]
        for j in range(size):
            flow += varied.exchange[square + i * size + j] * q[j]
        change_out[begin + i] = -flow
    for g in range(varied.point[own], varied.point[own + 1]):
        at = entry + (g - varied.point[own]) * size
        a, slope = u, 0.0
        for i in range(size):
            a += varied.value[at + i] * q[i]
            slope += varied.slope[at + i] * q[i]
        flux = varied.weight[g] * _diffusivity(varied, g, a) * slope
        for i in range(size):
            change_out[begin + i] -= flux * varied.slope[at + i]


@kernel
def _step(varied, size, h, q, begin, change):
    """Add (1 + h K)⁻¹ h q′ to q, by the factor at hand; `change` is q′ from `begin` on, and scratch then."""
    matrix = varied.matrix
    for i in range(size):
        part = h * change[begin + i]
        for k in range(i):
            part -= matrix[i, k] * change[begin + k]
        change[begin + i] = part / matrix[i, i]
    for n in range(size):
        i = size - 1 - n
        part = change[begin + i]
        for k in range(i + 1, size):
            part -= matrix[k, i] * change[begin + k]
        change[begin + i] = part / matrix[i, i]
        q[i] += change[begin + i]


@kernel
def _extrapolate(varied, own, size, u, push, h, begin, scratch):
    """Write q after a step of length h [s] to `moved`; its error, the root mean square over the thickness, in parts of
    what is allowed, and its order. `scratch` is written from `begin` on, where the field's modes are.
    """
    level, q = varied.level, varied.moved
    whole = 0.0
    for i in range(size):
        whole += varied.amplitude[begin + i] ** 2
    _hold(varied, own, size, u, varied.present)
    for n in range(LEVELS):
        copy(varied.present, q)
        part, square = h / (n + 1), 0.0
        _factorise(varied, size, part)
        for k in range(n + 1):
            _change(varied, own, size, u + push * (k * part), push, q, begin, scratch)
            _step(varied, size, part, q, begin, scratch)
        for i in range(size):
            better = q[i]  # level[k, i] is that of n parts, extrapolated k times
            for k in range(n):
                before = level[k, i]
                level[k, i] = better
                better += (better - before) / ((n + 1) / (n - k) - 1.0)
            level[n, i] = q[i] = better
            if n > 0:
                square += (better - level[n - 1, i]) ** 2
        error = math.sqrt(square / whole) / varied.tolerance[own]
        if n == LEVELS - 1 or (n > 0 and error <= 1.0):
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
        varied.present[i] = varied.amplitude[begin + i] * (reached[begin + i] - first)
    while time < dt:
        h = min(h, dt - time)
        error, order = _extrapolate(varied, own, size, first + push * time, push, h, begin, reached_out)
        factor = LARGEST_FACTOR if error == 0.0 else SAFETY * error ** (-1.0 / order)
        if error <= 1.0 or h <= SHORTEST * dt:
            time = dt if h == dt - time else time + h
            copy(varied.moved, varied.present)
        h *= min(max(factor, LEAST_FACTOR), LARGEST_FACTOR)
    for i in range(size):
        reached_out[begin + i] = last + varied.present[i] / varied.amplitude[begin + i]
