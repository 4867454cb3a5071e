"""The list of contact points near surfaces, and how far a step may go before a gap is too small.

Whoever needs the list asks for it at a configuration: it is made anew only if something has moved too far since.
"""

from __future__ import annotations

from bilayer_core.contact.near import list_near, moved_since
from bilayer_core.contact.step_bound import motion_of_points, motion_of_surfaces, step_bound
from bilayer_core.jit import piece
from bilayer_core.model.records.contacts import Surfaces
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import PAIR_CAPACITY_EXCEEDED, READY
from bilayer_core.model.records.step import Configuration

MOTION_MARGIN = 4.0
"""Margin of a list, in units of the motion that demands it."""


@piece(int, Surfaces, Configuration, float)
def list_surface_pairs(surfaces, at, motion):
    """Make the list of near pairs valid at a configuration and whatever can be reached from it by `motion` [m].

    Returns a status.
    """
    margin = max(surfaces.d_hat, MOTION_MARGIN * motion)
    if surfaces.dense:  # a wide list holds very many points
        margin = min(margin, motion + MOTION_MARGIN * surfaces.d_hat)
    wide = surfaces.dense and surfaces.margin[0] > MOTION_MARGIN * (motion + MOTION_MARGIN * surfaces.d_hat)
    if not wide:
        surfaces.room[0] = surfaces.margin[0] - moved_since(surfaces, at) - motion
        if surfaces.room[0] >= 0.0:
            return READY
    count = list_near(surfaces, at, margin)
    if count > surfaces.near_contact_point.shape[0]:
        surfaces.margin[0] = -1.0
        surfaces.near_count[0] = 0
        return PAIR_CAPACITY_EXCEEDED
    surfaces.near_count[0] = count
    surfaces.margin[0], surfaces.room[0] = margin, margin - motion
    return READY


@piece(float, Problem, Configuration)
def bound_at_surfaces(p, at):
    """Return the largest fraction of the present step that keeps gaps to surfaces open; the near pair that sets it (−1:
    none) and a status are left in `Outcome`.
    """
    surfaces, outcome = p.surfaces, p.outcome
    of_points = motion_of_points(surfaces, p.bodies, p.strands, p.system, at)
    closing = of_points + motion_of_surfaces(surfaces, p.system)
    outcome.pair, outcome.status = -1, list_surface_pairs(surfaces, at, closing)
    if outcome.status != READY:
        return 0.0
    closing = of_points + motion_of_surfaces(surfaces, p.system)  # extents of surfaces are those of the list
    fraction, outcome.pair = step_bound(surfaces, p.strands, p.system, at, closing)
    return fraction
