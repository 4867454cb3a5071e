"""The pieces that a run of a model can reach, which are compiled before it starts."""

from __future__ import annotations

from bilayer_core.engine.between_ends import write_between
from bilayer_core.engine.integrate import integrate
from bilayer_core.engine.light_over_step import begin_light, end_light
from bilayer_core.engine.linear.bordered_system import (
    assemble_bodies,
    count_border,
    factor_border,
    restrict_bodies,
    solve_bordered,
)
from bilayer_core.engine.linear.closed_rods import move_joins_to_border
from bilayer_core.engine.linear.contact_columns import move_to_border, take_rod_contacts
from bilayer_core.engine.linear.planar_assembly import assemble_in_plane, gradient_in_plane, step_in_plane
from bilayer_core.engine.linear.widths import SETS
from bilayer_core.engine.observables import observe
from bilayer_core.engine.step import treat_state, write_rest_strains
from bilayer_core.forces.added_mass import fluid_momentum
from bilayer_core.forces.bend_twist import add_bending, add_bending_of_strips
from bilayer_core.forces.contact_on_bodies import add_contact_to_bodies
from bilayer_core.forces.flattening import write_sections
from bilayer_core.forces.force_register import TERMS
from bilayer_core.forces.planar import add_elasticity_in_plane, add_elasticity_of_strips_in_plane
from bilayer_core.forces.rod_contact import bound_between_rods, find_rod_contacts
from bilayer_core.kinematics.marker_lines import place_arrows, place_bars
from bilayer_core.kinematics.node_frames import frames_at_nodes
from bilayer_core.model.model import Model

PLANAR = assemble_in_plane, gradient_in_plane, step_in_plane
ELASTICITY = {
    (False, False): add_bending,
    (False, True): add_bending_of_strips,
    (True, False): add_elasticity_in_plane,
    (True, True): add_elasticity_of_strips_in_plane,
}
"""By whether a model is planar, and whether it has strips."""
FOR_FRAMES = frozenset(of.name for of in (observe, frames_at_nodes, place_bars, place_arrows))
"""Names of the pieces that write what a node publishes and a log holds."""


def needed_pieces(model: Model) -> frozenset[str]:
    """Return the names of pieces that steps of a model can call.

    Left out are forces that do not act, band solvers of other widths, and pieces for another dimension and for bodies,
    contact of rods and light that the scene lacks. A few of the others wait for conditions that a run may never meet.
    """
    layout, joined = model.solved_layout, model.free_count > 0 or model.joins.exists
    widths = {layout.half_bandwidth, layout.half_bandwidth_apart}
    meets = "rod barrier" in model.forces
    unused = (
        *(pieces for other, pieces in SETS.items() if other not in widths),
        () if meets else (find_rod_contacts, bound_between_rods, take_rod_contacts),
        () if meets or joined else (move_to_border, factor_border, solve_bordered, count_border),
        () if meets or joined else (SETS[width][-1] for width in widths),
        () if model.free_count else (assemble_bodies, restrict_bodies, add_contact_to_bodies),
        () if model.joins.exists else (move_joins_to_border,),
        () if model.light.exists else (begin_light, end_light),
        () if model.fluid.exists else (fluid_momentum,),
        () if model.plane.exists else PLANAR,
        [of for of_kind, of in ELASTICITY.items() if of_kind != (model.plane.exists, model.flattening.exists)],
    )
    left_out = {of.name for pieces in unused for of in pieces}
    waiting = [
        integrate,
        treat_state,
        write_rest_strains,
        write_between,
        *([write_sections] if model.flattening.exists else []),
    ]
    for term in TERMS:
        if set(term.names) & set(model.forces):
            pieces = (term.add, term.start, term.update_lagged, term.settle, term.end)
            waiting += [of for of in pieces if of is not None]
    found: set[str] = set()
    while waiting:
        piece = waiting.pop()
        if piece.name not in found | left_out:
            found.add(piece.name)
            waiting += piece.calls
    return frozenset(found)
