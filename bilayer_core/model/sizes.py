"""Sizes of a model, by the names that shapes of records use (`jit.record`)."""

from __future__ import annotations

from bilayer_core.model.force_list import on_nodes
from bilayer_core.model.force_slots import NAMES
from bilayer_core.model.model import Model


def sizes_of(model: Model) -> dict[str, int]:
    """How many there are of everything that does not change in number."""
    layout, bodies, scene = model.solved_layout, len(model.bodies.names), model.scene
    edges, in_plane, in_fluid = (
        model.edge_count + model.clamp_edge_count,
        model.plane is not None,
        len(model.fluid_mass) > 0,
    )
    impacts = len(model.impact_pairs)
    points, joints, pairs = model.contact_points, len(model.joint_a), len(model.pair_joint)
    return {
        "node": model.node_count,
        "edge": model.edge_count,
        "edge+clamp": edges,
        "joint": joints,
        "pair": pairs,
        "strain": model.strain_count + impacts + len(model.mechanisms),
        "impact": impacts,
        "strand": len(model.strands),
        "attached": len(model.attached_node),
        "contact_point": len(points.weight),
        "point": len(points.position),
        "rod point": len(points.rod_point_node),
        "surface": len(model.surfaces.names),
        "body": bodies,
        "body+world": bodies + 1,
        "free": model.free_count,
        "body unknown": 6 * model.free_count,
        "dimension": layout.dimension,
        "unknown": model.layout.size,
        "matrix unknown": layout.size,
        "row": layout.size + layout.half_bandwidth,
        "band": layout.half_bandwidth + 1,
        "force": len(NAMES),
        "channel": len(scene.stimuli),
        "law": len(model.law_channel),
        "lit": len(model.lit_law),
        "load": len(scene.loads),
        "wet": model.node_count if in_fluid else 0,
        "dragged": len(model.drag_node),
        "edge with hessian": edges if in_fluid or not in_plane else 0,  # in a plane that of the fluid alone
        "joint in space": 0 if in_plane else joints,
        "pair in space": 0 if in_plane else pairs,
        "node with hessian": model.node_count if on_nodes(model.forces) else 0,
    }
