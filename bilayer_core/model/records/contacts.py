"""Contact in compiled steps: points and surfaces, friction and impacts between them, rods that meet."""

from __future__ import annotations

from bilayer_core.contact.broad_phase import RodSearch
from bilayer_core.jit.record import CHANGES, Flags, FlagTable, IndexTable, Indices, Matrix, Stack, Vector, record


@record
class RodPoints:
    """Contact points with arms from nodes, the last of all contact points; see `model.rod_points`."""

    first: int  # of them among contact points
    node: Indices  # ascending, shape (n_rod_point,)
    arm: Matrix  # along m1 and m2, means of the node's edges [m], shape (n_rod_point, 2)
    longest: float  # of all arms [m]
    node_factor: float  # how much farther than nodes a point of their curve moves at most


@record
class Surfaces:
    """Contact points, surfaces, and the list of near pairs with what it was made for; see `contact.near`.

    Contact points have a radius: all nodes, then *points* of bodies (contact points of the scene; corners and rims of
    surfaces), then *centres* of balls and points of obstacles, and *rod points*, which have an arm from a node
    (`model.rod_points`). Surfaces that they can meet are those of obstacles, then bodies'; see `contact.shapes` for
    their numbers.
    """

    d_hat: float  # barrier distance [m]
    stiffness: float  # of the barrier [Pa]
    radius: Vector  # half the thickness, offset, or radius [m], shape (n_contact_point,)
    weight: Vector  # Δl of the barrier [m], 0 of a node that its rod points stand for, shape (n_contact_point,)
    section: Matrix  # half thickness, border, height of nodes, Δl of the path (0 of copies) [m], shape (n_node, 4)
    node_part: Matrix  # of the edges before and after in the directions at nodes, shape (n_node, 2)
    edge_length: Vector  # at rest [m], shape (n_edge,)
    contact_point_body: Indices  # body that takes the force, −1 for those of rods, shape (n_contact_point,)
    free_index: Indices  # indices of all bodies among the free ones; none if none is free
    moved_by: Indices  # body that moves it, −1 for those of rods that none holds, shape (n_contact_point,)
    node_free: Flags  # whether no body holds a node, shape (n_node,)
    group: Indices  # contact points of a group meet the same surfaces, shape (n_contact_point,)
    point_position: Matrix  # of points and centres in their bodies' frames [m], shape (n_point, 3)
    point_body: Indices  # their bodies, shape (n_point,)
    node_edges: IndexTable  # before and after each node, the same at an end, shape (n_node, 2)
    rod_points: RodPoints
    arm_factor: float  # how many times farther than nodes and borders of edges a contact point of a rod moves at most
    kind: Indices  # shape (n_surface,)
    size: Matrix  # half sizes of what is rounded [m], shape (n_surface, 3)
    rounding: Vector  # [m], shape (n_surface,)
    bound: Vector  # radius of a ball about the position that holds it [m], shape (n_surface,)
    body: Indices  # body that it belongs to, or the world, shape (n_surface,)
    position: Matrix  # in the body's frame [m], shape (n_surface, 3)
    rotation: Stack  # its own axes in the body's frame, shape (n_surface, 3, 3)
    can_collide: FlagTable  # whether contact points of a group can meet it, shape (n_surface, n_group)
    node_can_collide: FlagTable  # whether a station can meet it, shape (n_surface, n_node)
    edge_can_collide: FlagTable  # whether what is between two can, shape (n_surface, n_edge)
    node_between: FlagTable  # whether points beside a station meet it, shape (n_surface, n_node)
    dense: bool  # whether points between stations meet one
    divides: bool  # whether one has faces and edges, for which lists divide rods; see `contact.between_stations`
    sharpest: Vector  # least radius of what is not flat, −1 if all is [m], shape (n_surface,)
    coarsest: Vector  # distance of points along bent rods, infinite where one is straight [m], shape (n_node,)
    edge_can_cross: FlagTable  # whether it could come between the nodes of an edge, shape (n_surface, n_edge)
    near_contact_point: Indices = ("near",)
    near_surface: Indices = ("near",)
    near_gap: Vector = ("near",)
    near_force: Vector = ("near",)  # normal force of the barrier, with that of damping [N]
    near_node: Indices = ("near",)  # of contact points of rods, those of others themselves
    near_arm: Flags = ("near",)  # whether it is not the node itself
    near_mix: Matrix = ("near", 6)  # of its edges; see `contact.near`
    near_radius: Vector = ("near",)  # [m]
    near_weight: Vector = ("near",)  # Δl of the barrier [m]
    near_length: Vector = ("near",)  # of the stretch of a rod before a flat face that it stands for, 0 elsewhere [m]
    near_count: Indices = (1,)
    margin: Vector  # shape (1,)
    room: Vector  # by how much points and surfaces may near each other before the list is checked, shape (1,) [m]
    extent: Vector = ("surface",)
    listed_contact_point: Matrix = ("contact_point", 3)
    listed_director1: Matrix = ("edge", 3)
    listed_director2: Matrix = ("edge", 3)
    listed_surface_position: Matrix = ("surface", 3)
    listed_surface_rotation: Stack = ("surface", 3, 3)
    first_position: Matrix = ("node", 3)  # of nodes at the start of the step [m]
    first_surface_position: Matrix = ("surface", 3)
    first_surface_rotation: Stack = ("surface", 3, 3)


@record
class Restitution:
    """Pairs of bodies' contact points and surfaces whose impacts are damped; see `forces.restitution`."""

    damping: float  # z
    slowest: float  # approach that counts [m/s]
    first: int  # of their gaps among strains
    memory: Indices  # where their speeds of approach begin in `Problem.memory`, shape (1,)
    point: Indices
    surface: Indices
    row: IndexTable  # of a contact point and a surface, −1 without, shape (n_contact_point, n_surface)
    rate: Vector = ("impact",)  # λ [s/m]


@record
class Sliding:
    """Friction of the contacts at the start of a stage; see `forces.surface_friction`."""

    acts: bool
    threshold: float
    owner: Indices  # number of the rod, body or obstacle of each contact point, in this order, shape (n_contact_point,)
    surface_owner: Indices  # likewise of each surface
    coefficient: Stack  # of what each owns on each surface: forward, backward, sideways, shape (n_owner, n_surface, 3)
    node_axis: Indices  # which direction of each node counts as forward: 0 t, 1 m1, ±2 ± m2, shape (n_node,)
    grained: bool  # whether a surface has a grain, or the world an axis; coefficients
    along_grain: Stack  # along it, shape (n_owner, n_surface, 3)
    across_grain: Matrix  # and where it has no direction, shape (n_owner, n_surface)
    world_axis: Vector  # 0 without one, shape (3,)
    surface_grain: Matrix  # forward direction on each in its body's frame, 0 without one, shape (n_surface, 3)
    point_grain: Matrix  # likewise of contact points, shape (n_contact_point, 3)
    spreads: bool  # whether a surface has a flat face, on which contacts spread their loads where slip turns round
    mu: Matrix = ("slide", 3)  # coefficients of contacts: forward, backward, sideways
    count: Indices = (1,)
    places: Indices = (1,)  # how many of them are places of edges
    spread: FlagTable = ("surface", "node")  # by which slip has turned round in this stage
    first: Indices = ("slide",)
    node: Indices = ("slide",)  # of contacts of rods
    surface: Indices = ("slide",)
    part: Matrix = ("slide", 2)  # of an edge from the node, and across: which of the points of a node it is
    smooth: Vector = ("slide",)  # thresholds of contacts [m/s]
    load: Vector = ("slide",)
    length: Vector = ("slide",)  # of their stretches of rods [m]
    same: Flags = ("slide",)  # whether such a place was there before
    last_load: Vector = ("slide",)  # before contacts were frozen anew
    change: Vector = ("slide",)  # of normal forces then, before relaxation
    relaxation: Vector = (1,)  # with which they were, 0 at the start of a stage
    normal: Matrix = ("slide", 3)
    axis: Matrix = ("slide", 3)
    arm: Matrix = ("slide", 3)
    arm_rate: Stack = ("slide", 3, 8)  # of rods, as in `forces.rod_arms`
    lever: Matrix = ("slide", 3)
    back: Stack = ("body+world", 3, 3)
    rotation: Stack = ("body+world", 3, 3)
    origin_rotation: Stack = ("body+world", 3, 3)


@record
class Slips:
    """Slip of all lagged contacts along a Newton step; see `forces.friction_limit`."""

    path: Matrix = ("slip", "path")


@record
class RodContactList:
    """Contacts of rods; see `forces.rod_contact`."""

    count: Indices = (1,)
    point: Indices = ("contact",)
    multiplicity: Indices = ("contact",)  # +1 or −1
    inner: Flags = ("contact",)  # whether t moves with the shape, or is that of a node
    gap: Vector = ("contact",)  # d [m]
    distance: Vector = ("contact",)  # D [m]
    node: IndexTable = ("contact", 2)  # i and j
    edge: IndexTable = ("contact", 2)  # from these
    right: IndexTable = ("contact", 2)  # rails of their right borders, −1 of round rods
    weight: Matrix = ("contact", "leg")  # w_m, of right borders last
    normal: Matrix = ("contact", 3)  # n
    normal_force: Vector = ("contact",)  # λ [N]
    turn: Stack = ("contact", 6, 4)  # of friction's place, from either middle, by the vector and turn of its edge
    matrix: Stack = ("contact", 3, 3)  # M [N/m]
    tangential_stiffness: Vector = ("contact",)  # κ [N/m]
    segment_direction: Matrix = ("contact", 3)  # u
    foot_gradient: Stack = ("contact", "leg", 3)  # a_m
    cross_gradient: Stack = ("contact", "ribbon leg", 3)  # and across the width
    place: Matrix = ("contact", 2)  # t and v of the nearest place


@record
class Rails:
    """Middles between the faces of rods off their curves, and how they move; see `contact.rails`."""

    node: Indices  # of each rail: all nodes, then those of ribbons once more for their right borders, shape (n_rail,)
    arm: Matrix  # along m1 and m2 [m], shape (n_rail, 2)
    right: Indices  # rail of the right border at the first node of each edge, −1 of round ones, shape (n_edge,)
    node_edges: IndexTable  # before and after each node, the same at an end, shape (n_node, 2)
    factor: float  # how many times farther than nodes, and borders of edges by a turn, rails move at most
    block: IndexTable  # of rails that follow each other: the first, its node and edges; how many; shape (…, 5)
    by_component: Stack  # half of either arm, three times in a row, shape (2, n_rail, 3)
    place: Matrix = ("rail", 3)  # [m]
    meets: Flags = ("rail",)  # whether it has a part in a contact found last
    rate: Stack = ("rail", 3, 8)  # of these by the edges at each node, see `forces.rail_arms`
    gradient: Matrix = ("rail", 3)  # of the barrier at the contacts found last [N]
    curvature: Stack = ("edge", 4, 4)  # what its second derivative has of arms of these
    rubs: Flags = ("rail",)  # whether it has a part in a contact frozen for friction
    slip_rate: Stack = ("rail", 3, 8)  # rates frozen for friction
    drag: Matrix = ("rail", 3)  # gradient of friction [N]
    slip: Matrix = ("rail", 3)  # since the origin of a stage [m]
    node_motion: Matrix = ("node", 3)  # scratch
    motion: Matrix = ("rail", 3)  # scratch
    turn: Vector = ("edge",)  # scratch
    step: Matrix = ("rail", 3)  # mean motion in a step [m]


@record
class RodContact:
    """Rods that can meet: the search for near pairs, and contacts; see `contact.rod_list`."""

    d_hat: float
    stiffness: float
    slides: bool
    coefficient: Matrix  # between two rods, shape (n_rod, n_rod)
    rod: Indices  # number of the rod of each node
    threshold: float
    unit: float  # barrier distance and thickest layer together
    point_weight: Vector
    rails: Rails
    search: RodSearch
    last: Matrix = ("rail", 3)  # where rails were last, their mean taken off [m]
    ways: Vector  # of the list; see `contact.rod_list`, shape (4,)
    no_step: Matrix = ("rail", 3)  # zeros
    gap: Vector = (1,)  # the smallest below the barrier distance
    contacts: RodContactList  # present ones
    sliding: RodContactList  # of the start of the stage


@record
class ContactColumns:
    """Contacts of rods in the Newton matrix, and their columns in the border; see `engine.linear.contact_columns`."""

    contacts: int = CHANGES  # how many there are
    unknowns: int = CHANGES  # how many have columns
    node: IndexTable = ("contact", 2)  # of contacts of barrier and friction in one list
    unknown: IndexTable = ("contact", "sides")  # that move the two sides, −1 for none
    rate: Stack = ("contact", 3, "sides")  # ∂r of each by these
    pressed: Stack = ("contact", 3, "sides")  # M ∂r
    stiffness: Vector = ("contact",)  # κ, 0 where the nearest point is a node
    foot: Matrix = ("contact", "sides")  # |e| ∂t
    cross: Matrix = ("contact", "ribbon sides")  # likewise across the width
    strand: Indices  # of each node
    attached: Indices  # index among held nodes of each unknown, which are in the border already, or −1
    joined: Flags  # whether an unknown is in the border because a rod closes there
    mark: IndexTable = ("matrix unknown", 3)  # scratch: of contacts on either side, and how often it is chosen
    met: IndexTable = ("strand", "strand")  # scratch
    row: Indices = ("matrix unknown",)  # in the band, of each unknown that has a column, ascending
    column: Indices = ("matrix unknown",)  # of each unknown among the contact columns, −1 without one
