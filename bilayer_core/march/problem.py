"""Everything that stays from step to step: the groups of a model, and what derivatives and the Newton matrix need."""

from __future__ import annotations

import numpy as np

from .group import group
from .model_groups import (
    Bodies,
    Bonds,
    Drives,
    Flow,
    Fluid,
    Grips,
    Held,
    Leaving,
    Moments,
    OffAxis,
    Plane,
    PointForces,
    Sliding,
    Slips,
    Space,
    Strands,
    Surfaces,
    Threads,
)

Array = np.ndarray


@group
class Sums:
    """First and second derivatives to which forces add; see `allocate`."""

    lasting: Array  # the part of `first` that stays as it is when other parts follow the configuration
    energy: Array  # of each force, in the order of `march.terms` [J]
    selected: Array  # whether a force is computed, bool, in that order; in steps all are
    first: Array  # node, edge, pair and body in one piece, for clearing
    node: Array
    edge: Array
    pair: Array
    body: Array
    carrier: Array
    contact: Array
    gradient: Array
    attached: Array
    second: Array  # all second derivatives but links in one piece
    edge_hessian: Array
    cross_hessian: Array
    pair_hessian: Array
    node_hessian: Array
    body_hessian: Array
    links: Array  # number of links, shape (1,)
    link_node: Array
    link_body: Array
    link_hessian: Array


@group
class System:
    """The Newton matrix, its factors, and steps; see `matrix`."""

    band: Array
    right: Array
    step: Array
    body_step: Array
    node_step: Array
    motion: Array
    negative: Array  # number of negative eigenvalues, where they were counted, shape (1,)


@group
class Border:
    """Rows and columns of free bodies in the Newton matrix."""

    border: Array
    corner: Array


@group
class Wide:
    """The border as it is eliminated: of bodies their freedom, then nodes that left the band.

    Rooms for columns are larger than what is in use; see `matrix`.
    """

    border: Array  # U by columns, then L⁻¹ U, shape (room, size + half-bandwidth)
    scaled: Array  # D⁻¹ L⁻¹ U likewise
    schur: Array
    load: Array
    width: Array  # columns in use, shape (1,)
    coupled: Array  # whether the border is not zero, shape (1,)


@group
class Problem:
    """Everything that stays from step to step."""

    gravity: Array
    damping: float
    strands: Strands
    drives: Drives
    space: Space | None
    plane: Plane | None
    off_axis: OffAxis | None
    bonds: Bonds | None
    bodies: Bodies
    border: Border | None
    wide: Wide | None
    held: Held
    grips: Grips | None
    surfaces: Surfaces | None
    sliding: Sliding | None
    threads: Threads | None
    slips: Slips | None
    leaving: Leaving | None
    meets: int | None  # None if nothing touches anything
    flow: Flow | None
    fluid: Fluid | None
    loads: PointForces | None
    followers: PointForces | None
    moments: Moments | None
    sums: Sums
    system: System
