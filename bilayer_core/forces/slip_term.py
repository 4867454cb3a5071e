"""Where on a Newton step friction holds it up."""

from __future__ import annotations

from ..jit import kernel, piece
from ..model.records.problem import Problem
from ..model.records.step import Place, Stage
from .friction import slip_along
from .rod_contact import rod_slip_along
from .slip import held_up


@kernel
def hold_up(slips, sliding, surfaces, rods, system, stage, at, slope, bound):
    """Fraction of the present step, at most `bound`, at which friction holds it up; the matrix is that of `at`."""
    if not slips.exists:
        return bound
    count = _at_surfaces(slips, sliding, surfaces, system, stage, at)
    if rods.exists:
        count = rod_slip_along(rods, stage, at.position, system.node_step, count, slips.way)
    if count == 0:
        return bound
    return held_up(count, slips.way, slips.threshold, slope, bound)


@kernel
def _at_surfaces(slips, sliding, surfaces, system, stage, at):
    if not sliding.exists:
        return 0
    if sliding.count[0] > 0:
        slip_along(
            sliding.count[0],
            sliding.first,
            sliding.surface,
            sliding.load,
            sliding.normal,
            sliding.axis,
            sliding.arm,
            sliding.lever,
            sliding.coefficient,
            stage.lengths[0],
            at.position,
            stage.origin_position,
            surfaces.carrier_body,
            surfaces.body,
            at.place,
            stage.origin_place,
            sliding.turn,
            sliding.origin_turn,
            system.node_step,
            system.motion,
            slips.way,
        )
    return sliding.count[0]


@piece(float, Problem, Place, Stage, float, float)
def where_friction_holds(p, at, stage, slope, bound):
    """`hold_up`"""
    return hold_up(p.slips, p.sliding, p.surfaces, p.rod_contact, p.system, stage, at, slope, bound)
