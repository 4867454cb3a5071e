"""Lines of which markers are made: bars across the width of ribbons, and arrows."""

from __future__ import annotations

import math

from bilayer_core.jit import kernel, piece, record
from bilayer_core.jit.record import IndexTable, Indices, Matrix, Singles, SingleTable, Stack, Vector
from bilayer_core.kinematics.vector import combine, dot, row, scaled


@record
class BarArrays:
    """Bars of the layers of a model, and the numbers of the message that shows them."""

    position: Matrix  # of nodes [m], shape (nodes, 3)
    normal: Matrix  # m1 at nodes
    width: Matrix  # m2 at nodes
    row: Indices  # node of each bar, shape (bars,)
    offset: Vector  # of a bar's middle from its node along m1 [m]
    half_width: Vector  # half the length of each bar [m]
    colour: SingleTable  # of each bar, shape (bars, 4)
    first_bar: Indices  # of each layer, and one more behind the last, shape (layers + 1,)
    first_row: Indices  # first node of each layer, shape (layers,)
    place: IndexTable  # where bars and distance begin in `doubles`, and colours in `singles`, shape (layers, 3)
    doubles: Vector  # all numbers of the message, written as float64
    singles: Singles  # and as float32


@record
class ArrowArrays:
    """Arrows of forces, and the lines that draw them."""

    origin: Matrix  # [m], shape (arrows, 3)
    force: Matrix  # [N]
    unit: Vector  # force from which each grows [N], shape (arrows,)
    decade: float  # length for each power of ten [m]
    head: float  # length of the head, as a part of an arrow
    half_width: float  # half the width of the head, as a part of an arrow
    points: Stack  # pairs of points [m], shape (arrows, 6, 3)


@piece(int, BarArrays)
def place_bars(of):
    """Write the bars of layers, each colour twice, and the mean distance of its nodes."""
    doubles, singles = of.doubles, of.singles
    for layer in range(of.first_row.shape[0]):
        place, spacing, shown = of.place[layer, 0], of.place[layer, 1], of.place[layer, 2]
        begin, end = of.first_bar[layer], of.first_bar[layer + 1]
        for k in range(begin, end):
            middle = combine(1.0, row(of.position, of.row[k]), of.offset[k], row(of.normal, of.row[k]))
            half = scaled(of.half_width[k], row(of.width, of.row[k]))
            _write(combine(1.0, middle, -1.0, half), doubles, place)
            _write(combine(1.0, middle, 1.0, half), doubles, place + 3)
            place += 6
            for c in range(4):
                singles[shown + c] = singles[shown + 4 + c] = of.colour[k, c]
            shown += 8
        total = 0.0
        for k in range(of.first_row[layer], of.first_row[layer] + end - begin - 1):
            step = combine(1.0, row(of.position, k + 1), -1.0, row(of.position, k))
            total += math.sqrt(dot(step, step))
        doubles[spacing] = total / (end - begin - 1)
    return 0


@piece(int, ArrowArrays)
def place_arrows(of):
    """Write the lines of arrows: a shaft and two barbs each; those of a zero force are all where it acts."""
    points = of.points
    for k in range(of.force.shape[0]):
        x, y, z = row(of.force, k)
        size = math.sqrt(x * x + y * y + z * z)
        length = of.decade * math.log10(1.0 + size / of.unit[k])
        if size > 0.0:
            x, y, z = x / size, y / size, z / size
        else:
            x, y, z = 0.0, 0.0, 1.0
        # Across the arrow: direction × z, or direction × x if it is upright.
        across = (0.0, z, -y) if abs(z) > 0.9 else (y, -x, 0.0)
        sideways = scaled(of.half_width * length / math.sqrt(dot(across, across)), across)
        origin, way = row(of.origin, k), (length * x, length * y, length * z)
        tip = combine(1.0, origin, 1.0, way)
        base = combine(1.0, tip, -of.head, way)
        for c in range(3):
            points[k, 0, c] = origin[c]
            points[k, 1, c] = points[k, 2, c] = points[k, 4, c] = tip[c]
            points[k, 3, c], points[k, 5, c] = base[c] + sideways[c], base[c] - sideways[c]
    return 0


@kernel
def _write(vector, out, place):
    """Write three numbers from a place on."""
    out[place], out[place + 1], out[place + 2] = vector
