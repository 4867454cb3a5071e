"""Everything that stays from step to step: the groups of a model, and what derivatives and the Newton matrix need."""

from __future__ import annotations

from bilayer_core.jit.record import CHANGES, Flags, FlagTable, Indices, Matrix, Stack, Vector, record
from bilayer_core.model.records.contacts import ContactColumns, Restitution, RodContact, Sliding, Slips, Surfaces
from bilayer_core.model.records.light import Light
from bilayer_core.model.records.parts import (
    Attachments,
    Bodies,
    Bonds,
    Constrained,
    Drives,
    Flattening,
    Flow,
    Fluid,
    Joins,
    Mechanisms,
    Moduli,
    Moments,
    OffAxis,
    Plane,
    PointForces,
    Raised,
    Space,
    Strands,
    Viscosity,
)
from bilayer_core.model.records.varied_fields import VariedFields


@record
class Sums:
    """First and second derivatives to which forces add, and what becomes of them for the unknowns."""

    energy: Vector = ("force",)  # of each, in the order of `model.force_slots` [J]
    supplied: Vector = ("force",)  # power of each that supplies energy [W]
    lost: Vector = ("force",)  # and of each that takes some
    selected: Flags = ("force",)  # whether a force is computed, in that order; in steps all are
    gradients: Vector  # node, edge, pair, body, contact_point, contact and pull in one piece, for clearing
    lasting: Vector  # the part of it that stays as it is when other parts follow the configuration
    node: Matrix = ("node", 3)  # ∂/∂x of nodes [N]
    edge: Matrix = ("edge+clamp", 4)  # ∂/∂(e, θ) of edges and clamp edges
    pair: Matrix = ("pair", 3)  # ∂/∂p of vectors between layers
    body: Matrix = ("free", 6)  # ∂/∂(X, φ) of free bodies
    contact_point: Matrix = ("contact_point", 3)  # ∂/∂x of contact points by contact alone [N]; nodes take theirs
    contact: Matrix = ("body+world", 6)  # ∂/∂(X, φ) of all bodies by contact and joints alone; free ones take theirs
    pull: Matrix = ("raised", 3)  # ∂/∂m1 of raised edges, as of a vector; edges take theirs [J]
    gradient: Vector = ("unknown",)  # of the unknowns, zero where nodes are held
    attached: Matrix = ("attached", 3)  # of held nodes before that
    hessians: Vector  # all second derivatives but those of arms and links in one piece
    edge_hessian: Stack = ("edge with hessian", 4, 4)
    cross_hessian: Stack = ("joint in space", 4, 4)
    pair_hessian: Stack = ("pair in space", 3, 3)
    node_hessian: Stack = ("node with hessian", 3, 3)
    body_hessian: Matrix = ("body unknown", "body unknown")
    raised_hessian: Stack = ("wet half", 3, 3)  # ∂²/∂y² of the halves of raised edges by drag and added mass [N/m]
    arms: Indices = (1,)  # number of contacts with an arm from a node; see `forces.rod_arms`
    stencil: Indices = (11,)  # scratch
    arm_node: Indices = ("arm",)
    arm_rate: Stack = ("arm", 3, 8)
    arm_matrix: Stack = ("arm", 3, 3)
    arm_curved: Flags = ("arm",)
    arm_curvature: Stack = ("arm", 8, 4)
    links: Indices = (1,)  # number of links
    link_node: Indices = ("link",)
    link_arm: Indices = ("link",)  # among contacts with an arm, −1 without one
    link_body: Indices = ("link",)
    link_hessian: Stack = ("link", 3, 6)


@record
class System:
    """The Newton matrix, its factors, and steps; see `engine.linear.newton_matrix`."""

    band: Matrix = ("row", "band")
    half_bandwidth: Indices = (1,)  # of the factors: less than the band has room for while no rods touch
    right: Vector = ("row",)
    step: Vector = ("unknown",)
    body_step: Matrix = ("free", 6)
    node_step: Matrix = ("node", 3)
    angle_step: Vector = ("edge",)
    motion: Matrix = ("body+world", 6)
    negative: Indices = (1,)  # number of negative eigenvalues, where they were counted


@record
class Border:
    """Rows and columns of free bodies in the Newton matrix."""

    border: Matrix = ("row", "body unknown")
    noted: Flags = ("row",)  # which rows of it may have values
    corner: Matrix = ("body unknown", "body unknown")


@record
class BorderedSystem:
    """The border as it is eliminated: of bodies their freedom, then where closed rods close, then the columns of
    contacts of rods.

    There is capacity for more columns than are in use.
    """

    border: Matrix = ("column", "row")  # U by columns, then L⁻¹ U
    scaled: Matrix = ("column", "row")  # D⁻¹ L⁻¹ U likewise
    schur: Matrix = ("column", "column")
    begins: Indices = ("column",)  # of rows of its factor: column of the first value that is not zero
    load: Vector = ("column",)
    present: Indices = ("column",)  # scratch: columns with values in a block of rows
    filled: FlagTable = ("column", "block of rows")  # whether a column has values there, see `engine.linear.border`
    width: Indices  # columns in use, shape (1,)
    coupled: Indices = (1,)  # whether the border is not zero


@record
class ForceTable:
    """Forces that act, a row each: the address of its own record, and those of its pieces, 0 where it has none.

    The first `lasting` of them stay as they are while others are made anew; see `forces.force_register`.
    """

    own: Indices
    add: Indices
    start: Indices
    update_lagged: Indices
    settle: Indices
    end: Indices
    lasting: int


@record
class Outcome:
    """Results of a piece beside the number that it returns."""

    status: int = CHANGES  # how it ended, from `model.records.status`
    passes: int = (
        CHANGES  # through the loop of Newton's method that may still be made before the next attempt at a step
    )
    patience: int = CHANGES  # how many more end an attempt
    pair: int = CHANGES  # near pair that blocks motion, −1 without one
    configuration: int = CHANGES  # the last one
    swapped: bool = CHANGES  # whether the scratch is the minimum
    iterations: int = CHANGES
    factorisations: int = CHANGES
    settlings: int = CHANGES
    regularised: int = CHANGES  # matrices
    gains: int = CHANGES  # what the step makes of energy; see `engine.energy_account`
    gained: float = CHANGES  # and steps together, over what they may
    residual: float = CHANGES  # speed of Newton's last correction [m/s]
    gap: float = CHANGES  # the smallest [m]
    shift: float = CHANGES  # multiple of the masses that was added
    simplified: int = CHANGES  # how far contacts of rods were
    fraction: float = CHANGES  # of a step that keeps gaps open
    friction_fraction: float = CHANGES  # at which friction holds it up
    energy: float = CHANGES  # [J]
    contact_error: float = CHANGES  # of the energy of contacts [J]
    light_error: float = CHANGES  # as a part of the longest rod


@record
class Problem:
    """Everything that stays from step to step."""

    gravity: Vector
    damping: float
    least_energy: float  # what energies of a run are measured by at least [J]
    strands: Strands
    viscosity: Viscosity
    drives: Drives
    varied_fields: VariedFields
    light: Light
    space: Space
    plane: Plane
    off_axis: OffAxis
    flattening: Flattening
    moduli: Moduli
    bonds: Bonds
    raised: Raised
    bodies: Bodies
    border: Border
    bordered: BorderedSystem
    constrained: Constrained
    attachments: Attachments
    joins: Joins
    surfaces: Surfaces
    restitution: Restitution
    mechanisms: Mechanisms
    sliding: Sliding
    rod_contact: RodContact
    slips: Slips
    contact_columns: ContactColumns
    has_contact: bool  # whether anything can touch anything
    flow: Flow
    fluid: Fluid
    loads: PointForces
    followers: PointForces
    moments: Moments
    sums: Sums
    memory: Vector  # what forces carry from step to step; see `forces.force_register`
    system: System
    forces: ForceTable
    outcome: Outcome
