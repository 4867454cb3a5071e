"""Elements on which light falls, and the edges and surfaces that hide it."""

from __future__ import annotations

from bilayer_core.jit.record import Flags, Indices, Matrix, Stack, Vector, record


@record
class Light:
    """Elements of layers on which light shines; see `contact.light`. Absent where no layer follows a light."""

    law: Indices  # the law of each element, for the mean of its layer: it has one of its own, shape (n_lit,)
    field: Indices  # that it follows, likewise
    edge: Indices  # shape (n_lit,)
    side: Vector  # ±1: its outer face is towards ± m1; 0: it has two, shape (n_lit,)
    height: Vector  # of its outer face over the strand along m1, or of its middle if it has two [m], shape (n_lit,)
    half: Vector  # half its thickness [m], shape (n_lit,)
    slenderness: Vector  # rod length over thickness: of displacement over length by free strain, shape (n_lit,)
    source: Indices  # which light, shape (n_lit,)
    direction: Matrix  # to each light, unit, shape (n_light, 3)
    casts: Flags  # whether its shadows count, shape (n_light,)
    edge_node: Indices  # of all edges, shape (n_edge,)
    half_width: Vector  # [m], likewise
    blocker: Indices  # edges that can hide it: all but copies, shape (n_blocker,)
    section: Indices  # number of the place along a rod, the same for both layers, shape (n_edge,)
    softness: Vector  # width of the edge of a shadow [m], likewise
    kind: Indices  # of surfaces, as in `Surfaces`, shape (n_shape,)
    size: Matrix
    rounding: Vector
    bound: Vector
    body: Indices
    position: Matrix
    rotation: Stack
    node_position: Matrix = ("node", 3)  # where light is looked at [m]
    director1: Matrix = ("edge", 3)
    length: Vector = ("edge",)
    tangent: Matrix = ("edge", 3)
    body_position: Matrix = ("body+world", 3)
    body_rotation: Stack = ("body+world", 3, 3)
    facing: Matrix = ("lit", 2)  # m1·l at the start of a step and at its end
    visible: Matrix = ("lit", 2)  # V likewise
    seen: Matrix = ("field", 2)  # part of its stimulus that each field sees at the start of a step and a time in it
