"""Everything that stays from step to step: the groups of a model, and what derivatives and the Newton matrix need."""

from __future__ import annotations

from ...jit.record import Address, Flags, Indices, Matrix, Stack, Vector, record
from .parts import (
    Attachments,
    Bodies,
    Bonds,
    Constrained,
    ContactColumns,
    Drives,
    Flow,
    Fluid,
    Moments,
    OffAxis,
    Plane,
    PointForces,
    RodContact,
    Sliding,
    Slips,
    Space,
    Strands,
    Surfaces,
)


@record
class Sums:
    """First and second derivatives to which forces add; see `allocate`."""

    lasting: Vector  # the part of `first` that stays as it is when other parts follow the configuration
    energy: Vector  # of each force, in the order of `model.force_places` [J]
    selected: Flags  # whether a force is computed, bool, in that order; in steps all are
    first: Vector  # node, edge, pair and body in one piece, for clearing
    node: Matrix
    edge: Matrix
    pair: Matrix
    body: Matrix
    carrier: Matrix
    contact: Matrix
    gradient: Vector
    attached: Matrix
    second: Vector  # all second derivatives but links in one piece
    edge_hessian: Stack
    cross_hessian: Stack
    pair_hessian: Stack
    node_hessian: Stack
    body_hessian: Matrix
    links: Indices  # number of links, shape (1,)
    link_node: Indices
    link_body: Indices
    link_hessian: Stack


@record
class System:
    """The Newton matrix, its factors, and steps; see `matrix`."""

    band: Matrix
    right: Vector
    step: Vector
    body_step: Matrix
    node_step: Matrix
    motion: Matrix
    negative: Indices  # number of negative eigenvalues, where they were counted, shape (1,)


@record
class Border:
    """Rows and columns of free bodies in the Newton matrix."""

    border: Matrix
    corner: Matrix


@record
class BorderedSystem:
    """The border as it is eliminated: of bodies their freedom, then the columns of contacts of rods.

    Rooms for columns are larger than what is in use; see `matrix`.
    """

    border: Matrix  # U by columns, then L⁻¹ U, shape (room, size + half-bandwidth)
    scaled: Matrix  # D⁻¹ L⁻¹ U likewise
    schur: Matrix
    load: Vector
    width: Indices  # columns in use, shape (1,)
    coupled: Indices  # whether the border is not zero, shape (1,)


@record
class ForceTable:
    """Forces that act, a row each: the address of its own record, and those of its pieces, 0 where it has none.

    The first `lasting` of them stay as they are while others follow the configuration; see `forces.register`.
    """

    own: Indices
    add: Indices
    start: Indices
    follow: Indices
    lasting: int


@record
class Calls:
    """Addresses of the pieces of the engine; see `engine.dispatch`."""

    take_state: Address
    move: Address
    place_carried: Address
    place_frames: Address
    list_surface_pairs: Address
    bound_at_surfaces: Address
    add_contact_to_bodies: Address
    bound_between_rods: Address
    find_rod_contacts: Address
    list_near_rods: Address
    near_pairs: Address
    where_friction_holds: Address
    first_guess_of: Address
    start_stage: Address
    follow: Address
    add_forces: Address
    expand_to_unknowns: Address
    assemble: Address
    factorise: Address
    solve: Address
    bound: Address
    assemble_in_space: Address
    assemble_in_plane: Address
    take_rod_contacts: Address
    assemble_bodies: Address
    restrict_bodies: Address
    move_to_border: Address
    solve_bordered: Address
    gradient_in_plane: Address
    step_in_plane: Address
    factor_border: Address
    count_border: Address
    minimise_potential: Address
    start_step_point: Address
    place_origin: Address
    move_along: Address
    drive_stage: Address
    predict_stage: Address
    predict_end: Address
    stand_still_stage: Address
    end_stage: Address
    write_end: Address
    write_shape: Address
    distance: Address
    keep_slopes: Address
    make_step: Address
    jumps_at: Address
    corner_after: Address
    drive_step: Address
    step_defect: Address
    count_shape: Address
    count_end: Address
    factor_band: int  # those of the scene's half-bandwidth
    count_band: int
    forward_band: int
    backward_band: int
    eliminate_band: int


@record
class Outcome:
    """What a piece found beside the number that it returns; places in `model.records.outcome`."""

    counts: Indices
    figures: Vector


@record
class Problem:
    """Everything that stays from step to step."""

    gravity: Vector
    damping: float
    strands: Strands
    drives: Drives
    space: Space
    plane: Plane
    off_axis: OffAxis
    bonds: Bonds
    bodies: Bodies
    border: Border
    bordered: BorderedSystem
    constrained: Constrained
    attachments: Attachments
    surfaces: Surfaces
    sliding: Sliding
    rod_contact: RodContact
    slips: Slips
    contact_columns: ContactColumns
    meets: bool  # whether anything can touch anything
    flow: Flow
    fluid: Fluid
    loads: PointForces
    followers: PointForces
    moments: Moments
    sums: Sums
    system: System
    forces: ForceTable
    calls: Calls
    outcome: Outcome
