"""Barrier contact of carriers with planes and with each other.

    C = K_c b(d) Δl,   force −K_c b′(d) Δl n, repulsive along the outward normal n        (paper, eq. 24; bracket's
    sign put right)

Plane: d = n·(x − p) − r. Two carriers: d = |x_i − x_j| − r_i − r_j, n = (x_i − x_j)/|x_i − x_j|. With b′, b″ at d, P
= I − n nᵀ:

    gradient  K_c Δl b′ n,      Hessian  K_c Δl (b″ n nᵀ + b′/|x_i − x_j| P)   (the second part for two carriers; it
    is negative)
"""

from __future__ import annotations

import math

from ..contact.barrier import barrier, barrier_gradient, barrier_hessian
from ..jit import kernel


@kernel
def plane_contact(
    d_hat, stiffness, weight, radius, position, plane_point, plane_normal, gradient_out, hessian_out, with_hessian
):
    """Add the barrier between every carrier and every plane.

    Parameters
    ----------
    d_hat : float
        Barrier distance [m].
    stiffness : float
        K_c [Pa].
    weight, radius : Array
        Δl [m] and radius [m] of each carrier, shape (n_carrier,).
    position : Array
        Of each carrier [m], shape (n_carrier, 3).
    plane_point, plane_normal : Array
        Shape (n_plane, 3).
    gradient_out, hessian_out : Array
        Of carriers, shapes (n_carrier, 3) and (n_carrier, 3, 3) (upper triangle); added to.
    with_hessian : bool

    Returns
    -------
    energy : float
        [J]; infinite if a carrier is behind a plane.
    min_gap : float
        [m]; infinite without planes.
    """
    energy = 0.0
    min_gap = math.inf
    for m in range(plane_normal.shape[0]):
        n0, n1, n2 = plane_normal[m, 0], plane_normal[m, 1], plane_normal[m, 2]
        height = n0 * plane_point[m, 0] + n1 * plane_point[m, 1] + n2 * plane_point[m, 2]
        for i in range(radius.shape[0]):
            d = n0 * position[i, 0] + n1 * position[i, 1] + n2 * position[i, 2] - height - radius[i]
            min_gap = min(min_gap, d)
            if d >= d_hat:
                continue
            if d <= 0.0:
                return math.inf, min_gap
            c = stiffness * weight[i]
            energy += c * barrier(d, d_hat)
            slope = c * barrier_gradient(d, d_hat)
            gradient_out[i, 0] += slope * n0
            gradient_out[i, 1] += slope * n1
            gradient_out[i, 2] += slope * n2
            if with_hessian:
                curve = c * barrier_hessian(d, d_hat)
                hessian_out[i, 0, 0] += curve * n0 * n0
                hessian_out[i, 0, 1] += curve * n0 * n1
                hessian_out[i, 0, 2] += curve * n0 * n2
                hessian_out[i, 1, 1] += curve * n1 * n1
                hessian_out[i, 1, 2] += curve * n1 * n2
                hessian_out[i, 2, 2] += curve * n2 * n2
    return energy, min_gap


@kernel
def pair_contact(
    d_hat,
    stiffness,
    weight,
    radius,
    position,
    pair_first,
    pair_second,
    gradient_out,
    hessian_out,
    pair_hessian_out,
    pair_gap_out,
    with_hessian,
):
    """Add the barrier between two carriers, weighted with the Δl of the first.

    Parameters are as for `plane_contact`, and

    pair_first, pair_second : Array
        Carriers of each pair, shape (n_pair,).
    pair_hessian_out : Array
        ∂²/∂x_first ∂x_second, shape (n_pair, 3, 3); added to.
    pair_gap_out : Array
        Written: the gap of each pair [m], shape (n_pair,).

    Returns
    -------
    energy, min_gap : float
        As for `plane_contact`.
    """
    energy = 0.0
    min_gap = math.inf
    for k in range(pair_first.shape[0]):
        i, j = pair_first[k], pair_second[k]
        n0, n1, n2 = position[i, 0] - position[j, 0], position[i, 1] - position[j, 1], position[i, 2] - position[j, 2]
        distance = math.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
        d = distance - radius[i] - radius[j]
        pair_gap_out[k] = d
        min_gap = min(min_gap, d)
        if d >= d_hat:
            continue
        if d <= 0.0:
            return math.inf, min_gap
        n0, n1, n2 = n0 / distance, n1 / distance, n2 / distance
        c = stiffness * weight[i]
        energy += c * barrier(d, d_hat)
        slope = c * barrier_gradient(d, d_hat)
        gradient_out[i, 0] += slope * n0
        gradient_out[i, 1] += slope * n1
        gradient_out[i, 2] += slope * n2
        gradient_out[j, 0] -= slope * n0
        gradient_out[j, 1] -= slope * n1
        gradient_out[j, 2] -= slope * n2
        if with_hessian:
            side = slope / distance
            curve = c * barrier_hessian(d, d_hat) - side
            h00, h01, h02 = curve * n0 * n0 + side, curve * n0 * n1, curve * n0 * n2
            h11, h12, h22 = curve * n1 * n1 + side, curve * n1 * n2, curve * n2 * n2 + side
            for e in (i, j):
                hessian_out[e, 0, 0] += h00
                hessian_out[e, 0, 1] += h01
                hessian_out[e, 0, 2] += h02
                hessian_out[e, 1, 1] += h11
                hessian_out[e, 1, 2] += h12
                hessian_out[e, 2, 2] += h22
            pair_hessian_out[k, 0, 0] -= h00
            pair_hessian_out[k, 0, 1] -= h01
            pair_hessian_out[k, 0, 2] -= h02
            pair_hessian_out[k, 1, 0] -= h01
            pair_hessian_out[k, 1, 1] -= h11
            pair_hessian_out[k, 1, 2] -= h12
            pair_hessian_out[k, 2, 0] -= h02
            pair_hessian_out[k, 2, 1] -= h12
            pair_hessian_out[k, 2, 2] -= h22
    return energy, min_gap
