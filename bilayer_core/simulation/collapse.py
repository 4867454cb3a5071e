"""Where a rod has collapsed: an edge that has no length left, or a joint that is folded flat.

The axial law ½ EA ε² l̄ costs no more than ½ EA l̄ at ε = −1, where an edge has no direction any more. Bending by the
mean of two frames costs nothing more at a fold by 180° if the frames have turned about the edges by as much. What is
strained by more than a linear material can hold gets there, if nothing damps it, and no step gets it out again.
"""

from __future__ import annotations

import math

import numpy as np

from bilayer_core.engine.step import LEAST_LENGTH
from bilayer_core.errors import Remedy
from bilayer_core.model.model import Model
from bilayer_core.simulation.crossing_remedy import edge_of_strand

Array = np.ndarray
SHARPEST = math.radians(175.0)
"""By which two edges may turn at a joint."""
CANTILEVER = 3.516
"""ω₁ L² √(ρA/B) of the first vibration of a cantilever; a retardation time 1/ω₁ leaves it half of critical damping, and
higher ones more than that."""
MORE = 100.0
"""Times a retardation time that was not enough."""


def collapsed(model: Model, position: Array) -> str:
    """Describe the edge or the joint that has collapsed, in words; empty if none has.

    Parameters
    ----------
    model : Model
    position : ndarray, shape (n_node, 3)
        [m].
    """
    rods = model.rods
    edges = np.diff(position[np.stack([rods.edge_node, rods.edge_node + 1], axis=1)], axis=1)[:, 0]
    length = np.linalg.norm(edges, axis=1)
    part = length / rods.rest_length
    if part.size and part.min() < LEAST_LENGTH:
        edge = int(part.argmin())
        return f"edge {edge_of_strand(model, edge)} has {100 * part[edge]:.2g} % of its length left"
    bends = np.arange(rods.bend_count)
    bends = bends[np.maximum(rods.joint_a[bends], rods.joint_b[bends]) < rods.edge_count]
    first, second = rods.joint_a[bends], rods.joint_b[bends]
    cosine = np.einsum("ij,ij->i", edges[first], edges[second]) / (length[first] * length[second])
    if cosine.size and cosine.min() < math.cos(SHARPEST):
        bend, turn = int(cosine.argmin()), math.degrees(math.acos(max(cosine.min(), -1.0)))
        return f"the joint behind edge {edge_of_strand(model, int(first[bend]))} is folded by {turn:.1f}°"
    return ""


def damp_materials(model: Model) -> Remedy:
    """Let all materials of rods damp what bends, more than they do: a rod then goes where it rests with little
    overshoot, and does not collapse unless its rest is beyond its material.
    """
    scene = model.scene
    names = sorted({layer.material for rod in scene.rods for layer in rod.layers})
    longest = max(rod.path.length for rod in scene.rods)
    edges, bends = slice(0, model.rods.edge_count), slice(0, model.rods.bend_count)
    density = model.rods.node_mass.sum() / model.rods.rest_length[edges].sum()
    stiffness = float(np.median(model.rods.joint_stiffness[bends, 0] * model.voronoi_length))
    time = longest**2 / CANTILEVER * math.sqrt(density / stiffness)
    time = max(time, *(MORE * scene.materials[name].retardation_time for name in names))
    changes = {f"materials.{name}.retardation_time": f"{time:.1g}" for name in names}
    return Remedy(f"set {' and '.join(f'`{key}`' for key in changes)} to {time:.1g} s", changes)
