"""Addresses of the pieces that a problem needs: of its dimension, its half-bandwidth, and of what touches what."""

from __future__ import annotations

from ..forces import friction_limit, surface_pairs  # noqa: F401 (declare pieces that no force lists)
from ..jit.piece import PIECES
from ..model.model import Model
from ..model.records.problem import Calls
from .linear.widths import NAMES, addresses_for

IN_SPACE = {"assemble_in_space"}
IN_PLANE = {"assemble_in_plane", "gradient_in_plane", "step_in_plane"}
OF_BODIES = {"assemble_bodies", "restrict_bodies"}
OF_BORDER = {"factor_border", "count_border", "solve_bordered"}
OF_SURFACES = {"bound_at_surfaces", "list_surface_pairs", "add_contact_to_bodies", "assemble_arms"}
OF_RODS = {
    *("bound_between_rods", "find_rod_contacts", "list_near_rods", "near_pairs"),
    *("take_rod_contacts", "move_to_border"),
}
OF_JOINS = {"move_joins_to_border"}
OF_LIGHT = {"begin_light", "shine", "end_light"}
OF_FRICTION = {"limit_by_friction"}


def calls_of(model: Model) -> Calls:
    """Addresses for a model; 0 for what it does not need."""
    rods, friction = model.rod_surfaces is not None, model.scene.contact and model.scene.contact.friction
    skipped = IN_SPACE if model.plane is not None else IN_PLANE
    skipped = skipped | (OF_BODIES if model.free_count == 0 else set())
    closed = len(model.joined_node) > 0
    skipped |= OF_BORDER if model.free_count == 0 and not rods and not closed else set()
    skipped |= set() if closed else OF_JOINS
    skipped |= set() if model.has_surface_contact else OF_SURFACES
    skipped |= set() if rods else OF_RODS
    skipped |= set() if friction and friction.acts else OF_FRICTION
    skipped |= set() if len(model.lit_law) else OF_LIGHT
    pieces = {name for name in Calls.names if name not in NAMES}
    return Calls(
        **{name: 0 if name in skipped else PIECES[name].address for name in pieces},
        **addresses_for(model.solved_layout.half_bandwidth),
    )
