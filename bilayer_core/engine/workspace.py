"""What a step computes into: sums of derivatives, points and a stage."""

from __future__ import annotations

import numpy as np

from ..model.model import Model
from ..model.records.problem import Sums
from ..model.records.step import Place, Point, Stage, Work
from .allocate import FirstDerivatives, SecondDerivatives, zeros_in_one

Array = np.ndarray


def sums_of(first: FirstDerivatives, second: SecondDerivatives, energy: Array, links: int) -> Sums:
    return Sums(
        energy=energy,
        selected=np.ones(len(energy), dtype=bool),
        first=first.flat,
        lasting=np.zeros_like(first.flat),
        **{name: getattr(first, name) for name in ("node", "edge", "pair", "body", "carrier", "contact")},
        gradient=first.unknowns,
        attached=first.attached,
        second=second.flat,
        **{name: _of_blocks(getattr(second, name)) for name in ("cross_hessian", "pair_hessian")},
        **{name: getattr(second, name) for name in ("edge_hessian", "node_hessian", "body_hessian")},
        links=np.zeros(1, dtype=np.int64),
        link_node=np.zeros(links, dtype=np.int64),
        link_body=np.zeros(links, dtype=np.int64),
        link_hessian=np.zeros((links, 3, 6)),
    )


def _of_blocks(hessians: Array) -> Array:
    """Second derivatives as kernels take them in space; those of a plane are in `Plane`."""
    return np.zeros((0, 0, 0)) if hessians.ndim == 2 else hessians


def point_of(model: Model) -> Point:
    """Arrays of a point."""
    nodes, edges, free = model.node_count, model.edge_count, model.free_count
    bodies, wet = len(model.bodies.names), model.node_count if len(model.fluid_mass) else 0
    shapes = dict(
        displacement=(nodes, 3),
        body_displacement=(bodies, 3),
        turn=(edges,),
        velocity=(nodes, 3),
        spin=(edges,),
        body_velocity=(free, 3),
        angular_momentum=(free, 3),
        fluid_momentum=(wet, 3),
    )
    vectors, parts = zeros_in_one(shapes)
    return Point(vectors=vectors, **parts, rotation=np.zeros((bodies, 3, 3)))


def stage_of(model: Model) -> Stage:
    """Arrays of a stage."""
    nodes, edges, free, bodies = model.node_count, model.edge_count, model.free_count, len(model.bodies.names)
    world = np.zeros((bodies + 1, 3, 3))
    world[-1] = np.eye(3)
    return Stage(
        lengths=np.zeros(2),
        origin_position=np.zeros((nodes, 3)),
        origin_turn=np.zeros(edges),
        origin_body_position=np.zeros((free, 3)),
        origin_place=np.zeros((bodies + 1, 3)),
        origin_rotation=world,
        origin_fluid_momentum=np.zeros((nodes if len(model.fluid_mass) else 0, 3)),
        predicted_position=np.zeros((nodes, 3)),
        predicted_turn=np.zeros(edges),
        predicted_body_position=np.zeros((free, 3)),
        predicted_body_rotation=np.zeros((free, 3, 3)),
        twist=np.zeros(len(model.joint_a)),
        rest_edge=np.zeros(edges),
        rest_joint=np.zeros_like(model.joint_rest),
        load_factor=np.zeros(len(model.scene.loads)),
        body_turn=np.zeros((free, 3)),
        way=np.zeros((nodes, 3)),
        body_way=np.zeros((free, 3)),
        body_spin=np.zeros((free, 3)),
        held_arm=np.zeros((len(model.attached_node), 3)),
        held_lag=np.zeros((len(model.attached_node), 3)),
    )


def work_of(model: Model, places: list[Place], touched: Array, stages: int) -> Work:
    """Room for steps of so many stages."""
    edges, bodies, first = model.edge_count, len(model.bodies.names), point_of(model)
    return Work(
        places=np.array([place.address for place in places], dtype=np.int64),
        stage=stage_of(model),
        first=first,
        origin=point_of(model),
        end=point_of(model),
        gained=np.zeros((stages, first.vectors.size)),
        gained_turn=np.zeros((stages, bodies, 3)),
        moved=np.zeros(1),
        turned=np.zeros(edges),
        rotation=np.zeros((bodies, 3, 3)),
        transduction=np.zeros(len(model.law_channel)),
        strain=np.zeros(len(model.law_channel)),
        touched=touched,
    )
