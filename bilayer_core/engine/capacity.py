"""For how much of what varies in number the arrays of a problem have capacity, how it grows, and where that ends.

What a step finds (places where rods touch, points near surfaces) is not known before. Arrays begin small, and are made
anew where they are too short. A limit for each keeps all of them together below about two gigabytes; what needs more
is refused before memory is asked for.
"""

from __future__ import annotations

from dataclasses import dataclass

from bilayer_core.errors import BilayerError, Remedy
from bilayer_core.model.model import Model
from bilayer_core.model.rod_surfaces import MOST_PAIRS

FIRST_POINTS = 10_000
"""Points of rods at most for which there is capacity at first: of a long thin rod, which has millions, few touch."""
PAIRS_PER_POINT = 8
"""Of rods near each other: for how many there is capacity at first."""
MOST_SURFACE_PAIRS = 1_000_000
"""Points near surfaces: 0.8 kB each, with what friction and Hessians need of them."""
MOST_CONTACTS = 500_000
"""Places where rods touch: 1.1 kB each, of ribbons 2.9, with what friction and the Newton matrix need of them."""
LARGEST_BORDER = 8e8
"""Memory of the border of the Newton matrix, which has columns where rods touch [bytes]."""
ROW_MEMORY = 16
"""Of a row in each of its columns [bytes]: `BorderedSystem.border` and `scaled`."""


class CapacityError(BilayerError):
    """A step needs more of something than there may be.

    Attributes
    ----------
    remedy : Remedy
        What to change.
    """

    exit_code = 3

    def __init__(self, reason: str, remedy: Remedy):
        super().__init__(f"{reason}; remedy: {remedy}")
        self.reason, self.remedy = reason, remedy


@dataclass
class Capacity:
    """For how much of what varies in number there is capacity."""

    near: int  # pairs of contact points and surfaces
    contacts: int  # of rods
    sliding: int  # of them, at the start of a stage
    columns: int  # of the border


def surface_pairs_for(needed: int) -> int:
    """Return the capacity for more pairs of points and surfaces than `needed`.

    Raises
    ------
    CapacityError
        If so many are not computed.
    """
    return _twice(needed, MOST_SURFACE_PAIRS, "points are near surfaces", _coarser())


def rod_pairs_for(model: Model, needed: int) -> int:
    """Return the capacity for more points near other rods than `needed`; see `surface_pairs_for`."""
    return _twice(needed, MOST_PAIRS, "points of rods are near other rods", _apart(), _densest(model))


def contacts_for(model: Model, needed: int) -> int:
    """Return the capacity for more places where rods touch than `needed`; see `surface_pairs_for`."""
    return _twice(needed, MOST_CONTACTS, "points of rods touch other rods", _apart(), _densest(model))


def columns_for(needed: int, rows: int) -> int:
    """Return the capacity for more columns of the border than `needed`, each of `rows`; see `surface_pairs_for`."""
    most = max(int(LARGEST_BORDER / (ROW_MEMORY * rows)), 1)
    return _twice(needed, most, f"of {rows} unknowns belong to edges of rods that touch", _apart())


def _twice(needed: int, most: int, what: str, remedy: Remedy, why: str = "") -> int:
    """Return the capacity for twice what is needed, so that arrays are seldom made anew, and for `most` at most."""
    if needed > most:
        raise CapacityError(f"{needed} {what}, at most {most} are computed{f' ({why})' if why else ''}", remedy)
    return min(2 * needed, most)


def _densest(model: Model) -> str:
    """Return the strand with most points on an edge, as text."""
    surfaces = model.rod_search
    counts = surfaces.first_point[1:] - surfaces.first_point[:-1]
    edge = int(counts.argmax())
    strand = next(s for s in model.strands if s.first_edge <= edge < s.first_edge + s.node_count - 1)
    return f"{strand.name} has {counts[edge]} on an edge, one for each half of its thickness"


def _apart() -> Remedy:
    return Remedy(
        "make rods thicker, shorter or fewer, or set `contact.rods` to false, which lets them pass through each other",
        {"contact.rods": "false"},
    )


def _coarser() -> Remedy:
    return Remedy("use fewer stations, fewer obstacles or a smaller `contact.barrier_distance`")
