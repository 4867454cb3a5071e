"""Sizes of a model, by the names that shapes of records use (`jit.record`)."""

from __future__ import annotations

import numpy as np

from bilayer_core.model.force_list import on_nodes
from bilayer_core.model.force_slots import NAMES
from bilayer_core.model.model import Model

ROWS_OF_BLOCK = 64
"""Of a border, see `engine.linear.border`."""


def sizes_of(model: Model) -> dict[str, int]:
    """Return how many there are of everything that does not change in number."""
    layout, rods, surfaces = model.solved_layout, model.rods, model.surfaces
    bodies, scene = len(model.bodies.names), model.scene
    edges = rods.edge_count + len(model.constrained.clamp_edge_body)
    in_plane, in_fluid = model.plane.exists, model.fluid.exists
    impacts, joints, pairs = len(model.impact_pairs), len(rods.joint_a), len(model.bonds.joint)
    raised, rails = len(model.raised.edge), model.rails.exists
    ribbons = rails and len(model.rails.node) > model.node_count
    turns = 0 if layout.dimension == 2 else 3 if rails else int("rod friction" in model.forces)
    side = (4 if rails else 2) * layout.dimension + turns
    return {
        "node": model.node_count,
        "edge": rods.edge_count,
        "edge+clamp": edges,
        "joint": joints,
        "joint rest": len(model.drives.joint_rest),
        "strip joint": len(model.flattening.joint),
        "pair": pairs,
        "strain": model.strain_count + impacts + len(model.mechanisms) + 3 * model.kept_directors,
        "raised": raised,
        "impact": impacts,
        "strand": len(model.strands),
        "attached": len(model.constrained.node),
        "contact_point": len(surfaces.weight),
        "point": len(surfaces.point_position),
        "surface": len(surfaces.kind),
        "surface of node": len(surfaces.kind) * model.node_count if "friction" in model.forces else 0,
        "body": bodies,
        "body+world": bodies + 1,
        "free": model.free_count,
        "body unknown": 6 * model.free_count,
        "dimension": layout.dimension,
        "rail": len(model.rails.node) if rails else model.node_count,
        "sides": 2 * side,
        "ribbon sides": 2 * side if ribbons else 0,
        "leg": 8 if ribbons else 4,
        "ribbon leg": 8 if ribbons else 0,
        "unknown": model.layout.size,
        "matrix unknown": layout.size,
        "row": layout.size + layout.half_bandwidth,
        "block of rows": (layout.size + layout.half_bandwidth) // ROWS_OF_BLOCK + 1,
        "band": layout.half_bandwidth + 1,
        "force": len(NAMES),
        "channel": len(scene.stimuli),
        "law": len(model.drives.law_gain),
        "mode": len(model.drives.mode_rising),
        "field": len(model.drives.field_channel),
        "varied mode": int(np.diff(model.drives.field_first).max(initial=0)) if model.varied_fields.exists else 0,
        "varied field": len(model.varied_fields.tolerance) if model.varied_fields.exists else 0,
        "level": 3 if model.varied_fields.exists else 0,
        "lit": len(model.light.law),
        "load": len(scene.loads),
        "wet": model.node_count + model.kept_directors if in_fluid else 0,
        "wet half": 2 * raised if model.flow.exists else 0,
        "dragged": len(model.flow.node),
        "edge with hessian": edges if in_fluid or not in_plane else 0,  # in a plane that of the fluid alone
        "joint in space": 0 if in_plane else joints,
        "pair in space": 0 if in_plane else pairs,
        "node with hessian": model.node_count if on_nodes(model.forces) else 0,
    }
