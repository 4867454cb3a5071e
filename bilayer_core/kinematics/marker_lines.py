"""Lines of which markers are made: bars across the width of ribbons, and arrows."""

from __future__ import annotations

import math

from bilayer_core.jit import entry, kernel
from bilayer_core.kinematics.vector import combine, dot, row, scaled


@entry
def place_bars(
    positions,
    normals,
    widths,
    bar_row,
    offset,
    half_width,
    colours,
    first_bar,
    first_row,
    places,
    doubles_out,
    singles_out,
):
    """Write the bars of layers, each colour twice, and the mean distance of its nodes.

    Parameters
    ----------
    positions, normals, widths : ndarray
        Of nodes [m], with m1 and m2, shape (n, 3).
    bar_row, offset, half_width : ndarray
        Node of each bar, distance of its middle from there along m1, half its length [m], shape (bars,).
    colours : ndarray
        Of each bar, shape (bars, 4).
    first_bar, first_row : ndarray
        Of each layer, and one more bar behind the last, shape (layers + 1,); its first node, shape (layers,).
    places : ndarray
        Of each layer where bars and distance begin in `doubles_out`, and colours in `singles_out`, shape (layers, 3).
    """
    for layer in range(first_row.shape[0]):
        place, spacing, shown = places[layer, 0], places[layer, 1], places[layer, 2]
        begin, end = first_bar[layer], first_bar[layer + 1]
        for k in range(begin, end):
            middle = combine(1.0, row(positions, bar_row[k]), offset[k], row(normals, bar_row[k]))
            half = scaled(half_width[k], row(widths, bar_row[k]))
            _write(combine(1.0, middle, -1.0, half), doubles_out, place)
            _write(combine(1.0, middle, 1.0, half), doubles_out, place + 3)
            place += 6
            for c in range(4):
                singles_out[shown + c] = singles_out[shown + 4 + c] = colours[k, c]
            shown += 8
        total = 0.0
        for k in range(first_row[layer], first_row[layer] + end - begin - 1):
            step = combine(1.0, row(positions, k + 1), -1.0, row(positions, k))
            total += math.sqrt(dot(step, step))
        doubles_out[spacing] = total / (end - begin - 1)


@entry
def place_arrows(origins, forces, unit, decade, head, half_width, points_out):
    """Write the lines of arrows: a shaft and two barbs each; those of a zero force are all where it acts.

    Parameters
    ----------
    origins, forces : ndarray
        [m, N], shape (arrows, 3).
    unit : ndarray
        Force from which each grows [N], shape (arrows,).
    decade : float
        Length for each power of ten [m].
    head, half_width : float
        Length of the head, and half its width, as parts of an arrow.
    points_out : ndarray
        Pairs of points [m], shape (arrows, 6, 3).
    """
    for k in range(forces.shape[0]):
        x, y, z = row(forces, k)
        size = math.sqrt(x * x + y * y + z * z)
        length = decade * math.log10(1.0 + size / unit[k])
        if size > 0.0:
            x, y, z = x / size, y / size, z / size
        else:
            x, y, z = 0.0, 0.0, 1.0
        # Across the arrow: direction × z, or direction × x if it is upright.
        across = (0.0, z, -y) if abs(z) > 0.9 else (y, -x, 0.0)
        sideways = scaled(half_width * length / math.sqrt(dot(across, across)), across)
        origin, way = row(origins, k), (length * x, length * y, length * z)
        tip = combine(1.0, origin, 1.0, way)
        base = combine(1.0, tip, -head, way)
        for c in range(3):
            points_out[k, 0, c] = origin[c]
            points_out[k, 1, c] = points_out[k, 2, c] = points_out[k, 4, c] = tip[c]
            points_out[k, 3, c], points_out[k, 5, c] = base[c] + sideways[c], base[c] - sideways[c]


@kernel
def _write(vector, out, place):
    """Write three numbers from a place on."""
    out[place], out[place + 1], out[place + 2] = vector
