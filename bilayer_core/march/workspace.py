"""Room for what a step computes: sums of derivatives, which it shares with `solve.potential`, points and a stage."""

from __future__ import annotations

import numpy as np

from ..model.model import Model
from ..solve.configuration import Configuration
from ..solve.potential import IncrementalPotential
from .build import read_only
from .model_groups import OffAxis
from .problem import Sums
from .step_groups import Place, Point, Stage, Work

Array = np.ndarray


def sums_of(model: Model, potential: IncrementalPotential, energy: Array, links: int) -> Sums:
    out, matrix = potential.accumulators, potential.matrix
    second = ("edge_hessian", "cross_hessian", "pair_hessian")
    return Sums(
        energy=energy,
        first=out.all_but_carriers,
        lasting=np.zeros_like(out.all_but_carriers),
        **{name: getattr(out, name) for name in ("node", "edge", "pair", "body", "carrier", "contact")},
        gradient=potential.gradient,
        attached=potential.attached_gradient,
        second=matrix.second_derivatives,
        **{name: getattr(matrix, name) for name in (*second, "node_hessian", "body_hessian")},
        links=np.zeros(1, dtype=np.int64),
        link_node=np.zeros(links, dtype=np.int64),
        link_body=np.zeros(links, dtype=np.int64),
        link_hessian=np.zeros((links, 3, 6)),
    )


def _point(model: Model) -> Point:
    nodes, edges, free = model.node_count, model.edge_count, model.free_count
    bodies, wet = len(model.bodies.names), model.node_count if len(model.fluid_mass) else 0
    return Point(
        position=np.zeros((nodes, 3)),
        body_position=np.zeros((bodies, 3)),
        turn=np.zeros(edges),
        velocity=np.zeros((nodes, 3)),
        spin=np.zeros(edges),
        body_velocity=np.zeros((free, 3)),
        angular_momentum=np.zeros((free, 3)),
        fluid_momentum=np.zeros((wet, 3)),
        rotation=np.zeros((bodies, 3, 3)),
    )


def work_of(model: Model, places: list[Configuration], touched: Array, off_axis: OffAxis | None) -> Work:
    nodes, edges, free, bodies = model.node_count, model.edge_count, model.free_count, len(model.bodies.names)
    world = np.zeros((bodies + 1, 3, 3))
    world[-1] = np.eye(3)
    rest_joint = np.zeros_like(model.joint_rest)
    read_only_rest = read_only(rest_joint)
    return Work(
        places=tuple(Place(**dict(zip(Place.fields, place.arrays, strict=True))) for place in places),
        stage=Stage(
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
            rest_joint_out=rest_joint,
            rest_joint=read_only_rest,
            natural=read_only_rest if off_axis is None else off_axis.rest,
            load_factor=np.zeros(len(model.scene.loads)),
            body_turn=np.zeros((free, 3)),
        ),
        first=_point(model),
        origins=(_point(model), _point(model)),
        ends=(_point(model), _point(model)),
        turned=np.zeros(edges),
        rotation=np.zeros((bodies, 3, 3)),
        transduction=np.zeros(len(model.law_channel)),
        strain=np.zeros(len(model.law_channel)),
        touched=touched,
    )
