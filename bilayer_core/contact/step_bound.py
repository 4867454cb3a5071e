"""The largest fraction of a step over which every gap keeps a tenth of its present size.

Carriers move along straight lines within an iterate, so the bound is exact: a node cannot jump over a surface however
long the step
(continuous collision detection; Li et al. 2020, sec. 5).
"""

from __future__ import annotations

import math

from ..jit import kernel

KEPT_FRACTION = 0.1  # of each gap


@kernel
def step_bound(position, step, radius, plane_point, plane_normal, pair_first, pair_second):
    """Largest α ≤ 1 such that all gaps keep `KEPT_FRACTION` of themselves along x + β step, 0 ≤ β ≤ α.

    Parameters
    ----------
    position, step : Array
        Of every carrier [m], shape (n_carrier, 3).
    radius : Array
        Of every carrier [m], shape (n_carrier,).
    plane_point, plane_normal : Array
        Shape (n_plane, 3).
    pair_first, pair_second : Array
        Carriers that can meet, shape (n_pair,).

    Returns
    -------
    alpha : float
    blocking : int
        Carrier that sets the bound, −1 if none.
    """
    alpha = 1.0
    blocking = -1
    for m in range(plane_normal.shape[0]):
        for i in range(radius.shape[0]):
            gap = -radius[i]
            rate = 0.0
            for j in range(3):
                gap += plane_normal[m, j] * (position[i, j] - plane_point[m, j])
                rate += plane_normal[m, j] * step[i, j]
            if gap + alpha * rate < KEPT_FRACTION * gap:
                alpha = (KEPT_FRACTION - 1.0) * gap / rate
                blocking = i
    for k in range(pair_first.shape[0]):
        i, j = pair_first[k], pair_second[k]
        x0, x1, x2 = position[i, 0] - position[j, 0], position[i, 1] - position[j, 1], position[i, 2] - position[j, 2]
        s0, s1, s2 = step[i, 0] - step[j, 0], step[i, 1] - step[j, 1], step[i, 2] - step[j, 2]
        xs = x0 * s0 + x1 * s1 + x2 * s2
        if xs >= 0.0:
            continue
        distance = math.sqrt(x0 * x0 + x1 * x1 + x2 * x2)
        reach = radius[i] + radius[j]
        kept = reach + KEPT_FRACTION * (distance - reach)
        # first root of |x + β s|² = kept²
        ss = s0 * s0 + s1 * s1 + s2 * s2
        c = (distance - kept) * (distance + kept)
        discriminant = xs * xs - ss * c
        if discriminant > 0.0:
            root = c / (-xs + math.sqrt(discriminant))
            if root < alpha:
                alpha = root
                blocking = i
    return alpha, blocking
