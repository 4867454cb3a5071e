"""Quadratic drag of a fluid on free bodies, the same in all directions.

    F = −½ ρ_f C A |v| v

at the mass centre, v its velocity relative to the fluid, A an area and C its coefficient. A is that of a scene or, of a
body with a surface, the mean area of its shadow over all directions, a quarter of the surface (Cauchy 1841): π r² for a
ball. A body that turns in its place feels nothing.

Over a stage of length h, v = u/h − U with the displacement u and the flow U, it has the convex dissipation potential

    D = h ρ_f C A |v|³/6,    ∂D/∂u = ½ ρ_f C A |v| v,    ∂²D/∂u² = ½ ρ_f C A (|v| 1 + v vᵀ/|v|)/h
"""

from __future__ import annotations

import math

import numpy as np

from bilayer_core.jit import piece, record
from bilayer_core.jit.record import Indices, Vector
from bilayer_core.model.dragged_bodies import drag_area
from bilayer_core.model.force_slots import slot_of
from bilayer_core.model.model import Model
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.step import Configuration, Stage

BODY_DRAG = slot_of("body drag")


@record
class BodyFlow:
    """Bodies that feel a fluid."""

    velocity: Vector  # U [m/s], shape (3,)
    free: Indices  # which free body, shape (n_dragged,)
    coefficient: Vector  # ½ ρ_f C A [kg/m], shape (n_dragged,)


@piece(float, BodyFlow, Problem, Configuration, Stage, bool)
def add_body_drag(flow, p, at, stage, with_hessian):
    """Add the dissipation potential of the drag of bodies and its derivatives by their positions."""
    sums, h = p.sums, stage.length
    if not sums.selected[BODY_DRAG]:
        return math.inf
    place, origin = at.body_position, stage.origin_body_position
    u = flow.velocity
    energy = lost = supplied = 0.0
    for k in range(flow.free.shape[0]):
        f, c = flow.free[k], flow.coefficient[k]
        v0 = (place[f, 0] - origin[f, 0]) / h - u[0]
        v1 = (place[f, 1] - origin[f, 1]) / h - u[1]
        v2 = (place[f, 2] - origin[f, 2]) / h - u[2]
        speed = math.sqrt(v0 * v0 + v1 * v1 + v2 * v2)
        energy += h * c * speed**3 / 3.0
        lost += c * speed**3
        supplied -= c * speed * (v0 * u[0] + v1 * u[1] + v2 * u[2])
        v = v0, v1, v2
        for i in range(3):
            sums.body[f, i] += c * speed * v[i]
            if with_hessian:
                sums.body_hessian[6 * f + i, 6 * f + i] += c * speed / h
                if speed > 0.0:
                    for j in range(3):
                        sums.body_hessian[6 * f + i, 6 * f + j] += c * v[i] * v[j] / (speed * h)
    sums.energy[BODY_DRAG], sums.lost[BODY_DRAG], sums.supplied[BODY_DRAG] = energy, lost, supplied
    return math.inf


def body_flow_of(model: Model) -> BodyFlow:
    """Return the bodies of a model that feel its fluid; absent where none does."""
    fluid, bodies = model.scene.fluid, model.scene.bodies
    dragged = [index for index, body in enumerate(bodies) if body.drag is not None]
    if fluid is None or not dragged:
        return BodyFlow.absent()
    return BodyFlow(
        velocity=np.array(fluid.velocity),
        free=model.free_bodies.free_index[np.array(dragged)],
        coefficient=np.array(
            [0.5 * fluid.density * bodies[i].drag.coefficient * drag_area(bodies[i]) for i in dragged]
        ),
    )
