"""The pieces that a run of a model can reach, which are compiled before it starts."""

from __future__ import annotations

from bilayer_core.engine.integrate import integrate
from bilayer_core.engine.light_over_step import begin_light, end_light
from bilayer_core.engine.linear.contact_columns import take_rod_contacts
from bilayer_core.engine.linear.widths import SETS
from bilayer_core.engine.observables import observe
from bilayer_core.engine.step import treat_state, write_rest_strains
from bilayer_core.forces.force_register import TERMS
from bilayer_core.forces.rod_contact import bound_between_rods, find_rod_contacts
from bilayer_core.kinematics.marker_lines import place_arrows, place_bars
from bilayer_core.kinematics.node_frames import frames_at_nodes
from bilayer_core.model.model import Model

FOR_FRAMES = frozenset(of.name for of in (observe, frames_at_nodes, place_bars, place_arrows))
"""Names of the pieces that write what a node publishes and a log holds."""


def needed_pieces(model: Model) -> frozenset[str]:
    """Return the names of pieces that steps of a model can call.

    Left out are forces that do not act, band solvers of other widths, and pieces for contact of rods and for light that
    the scene lacks. A few of the others wait for conditions that a run may never meet.
    """
    width = model.solved_layout.half_bandwidth
    left_out = {of.name for other, pieces in SETS.items() if other != width for of in pieces}
    if "rod barrier" not in model.forces:
        left_out |= {find_rod_contacts.name, bound_between_rods.name, take_rod_contacts.name}
    if not model.light.exists:
        left_out |= {begin_light.name, end_light.name}
    waiting = [integrate, treat_state, write_rest_strains]
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
