"""Sections of strips: how they are curved across, what statics disturb, and names of shapes at rest.

Names are those of `forces.flattening`. The moment across that a section carries is −∂F/∂κ̄y, which leaves, in the mean
over its width,

    κ_y Δl = κ̄y Δl − a₁ (κ₁ − κ̄₁) − 2 a₃ (ψ − ψ̄) − N Λ κ₁ φ

from the curvature of a free plate, where a strip is narrow, to ψ²/κ₁ where it is wide. A swollen strip that is wide
enough has two shapes at rest, curled along or rolled up across. Where both are in one strip, it has folded: how far
the one reaches depends on the mesh, since the law of a joint knows nothing of the joints beside it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bilayer_core.forces.flattening import Flatness, write_flatness
from bilayer_core.model.model import Model
from bilayer_core.model.plate_strip import folds
from bilayer_core.model.state import State
from bilayer_core.model.strand_arrays import StrandArrays
from bilayer_core.scene.transduction import free_strain

Array = np.ndarray
DISTURBANCE = 1e-3
"""Turn of the middle of a strip about its axis [rad] from which statics begin. Flat strips that swell, and strips that
are rolled up across, may be unstable against twist alone, and nothing else leads away from them."""
ACROSS = 2.0
"""Curvature across over that along from which a section counts as rolled up across."""
JUMP = 0.5
"""Step of the curvature from a joint to the next, over the natural curvature and twist, from which on a strip that
fibres twist has folded: one of its two shapes at rest is on either side."""


def _natural(model: Model, state: State) -> tuple[Array, Array, Array]:
    """Return κ̄₁, ψ̄ and κ̄y Δl of strip joints, shape (n_strip_joint,)."""
    drives, strips, rest = model.drives, model.flattening, model.drives.joint_rest.copy()
    strain = free_strain(state.transduction, drives.law_gain, drives.law_reference, drives.law_saturation)
    driven = drives.driven_joint, drives.driven_joint_column
    np.add.at(rest, driven, drives.driven_joint_weight * strain[drives.driven_joint_law])
    return rest[strips.joint, 0], rest[strips.joint, 2], rest[strips.first :][: len(strips.joint), 0]


def curvatures(model: Model, state: State) -> tuple[Array, Array]:
    """Return the curvature along and the mean curvature across of strip joints [1/m], shape (n_strip_joint,).

    Those beside a clamp have the values of the next joint.
    """
    rods, strips = model.rods, model.flattening
    first, second = rods.joint_a[strips.joint], rods.joint_b[strips.joint]
    inside = (first < rods.edge_count) & (second < rods.edge_count)
    first, second = np.where(inside, first, 0), np.where(inside, second, 0)
    vector = state.position[rods.edge_node + 1] - state.position[rods.edge_node]
    tangent = vector / np.linalg.norm(vector, axis=1, keepdims=True)
    a, b = tangent[first], tangent[second]
    bend = np.einsum("ki,ki->k", b, state.director1[first]) - np.einsum("ki,ki->k", a, state.director1[second])
    kappa, psi = bend / (1.0 + np.einsum("ki,ki->k", a, b)), state.twist[strips.joint]
    along, twist, across = _natural(model, state)
    free = across - strips.curl * (kappa - along) - strips.skew * (psi - twist)
    flattened, phi = kappa * free - psi**2 + strips.start, Flatness(x=strips.scale * kappa, value=np.zeros(len(kappa)))
    write_flatness(strips, phi)
    curved = free - flattened * strips.scale * phi.x * phi.value
    length = model.voronoi_length[strips.joint]
    place = np.arange(len(kappa))
    nearest = np.abs(place[:, None] - place[inside]).argmin(axis=1) if inside.any() else place
    return (kappa / length)[inside][nearest], (curved / length)[inside][nearest]


def across_at_nodes(model: Model, state: State) -> Array:
    """Return the mean curvature across of strips at all nodes [1/m], 0 at those of beams, shape (n_node,)."""
    found = np.zeros(model.node_count)
    if not model.flattening.exists:
        return found
    across, rods, joint = curvatures(model, state)[1], model.rods, model.flattening.joint
    inner = np.maximum(np.where(rods.joint_a < rods.edge_count, rods.joint_a, -1), rods.joint_b)[joint]
    inner = np.where(inner < rods.edge_count, inner, np.minimum(rods.joint_a, rods.joint_b)[joint])
    for strand in model.strands:
        own = _joints_of(model, strand)
        if len(own):
            nodes = np.arange(strand.first_node, strand.first_node + strand.node_count)
            places = rods.edge_node[inner[own]]
            found[nodes] = across[own][np.abs(nodes[:, None] - places).argmin(axis=1)]
    return found


def _joints_of(model: Model, strand: StrandArrays) -> Array:
    """Return which strip joints belong to a strand."""
    edges, strips = model.rods, model.flattening
    edge = np.minimum(edges.joint_a[strips.joint], edges.joint_b[strips.joint])
    return np.flatnonzero((edge >= strand.first_edge) & (edge < strand.first_edge + strand.node_count - 1))


def disturb(model: Model, state: State) -> None:
    """Turn the edges of strips that curl across about their tangents, most between the ends, by `DISTURBANCE`."""
    natural = _natural(model, state)[2] if model.flattening.exists else np.zeros(0)
    for strand in model.strands:
        if not natural.any() or not natural[_joints_of(model, strand)].any():
            continue
        edges = np.arange(strand.first_edge, strand.first_edge + strand.node_count - 1)
        place = np.linspace(0.0, 1.0, len(edges))
        angle = DISTURBANCE * 6.75 * (place**2 * (1.0 - place))[:, None]
        director = state.director1[edges]
        vector = state.position[model.rods.edge_node[edges] + 1] - state.position[model.rods.edge_node[edges]]
        tangent = vector / np.linalg.norm(vector, axis=1, keepdims=True)
        state.director1[edges] = np.cos(angle) * director + np.sin(angle) * np.cross(tangent, director)


def shapes(model: Model, state: State) -> dict[str, str]:
    """Return the shape of each strip that curls across: `curled along`, `rolled across` or `folded`; of one that fibres
    twist, which may have any shape between these, only that it is folded.
    """
    found: dict[str, str] = {}
    if not model.flattening.exists:
        return found
    bend, across = curvatures(model, state)
    along, across = np.abs(bend), np.abs(across)
    strips, (free, twist, natural) = model.flattening, _natural(model, state)
    natural, twisted = np.abs(natural), twist**2 != strips.start
    size = np.hypot(free, twist) / model.voronoi_length[strips.joint]
    ratio = strips.scale / np.sqrt(3.0 * (1.0 - strips.curl**2)) * natural  # w²κ̄y/H
    for strand in model.strands:
        own = _joints_of(model, strand)
        if len(own) and twisted[own].any():
            if (np.abs(np.diff(bend[own])) > JUMP * size[own[1:]]).any():
                found[strand.rod] = "folded"
            continue
        if not len(own) or not natural[own].any():
            continue
        rolled = across[own] > ACROSS * along[own]
        worst = own[ratio[own].argmax()]
        if rolled.all():
            found[strand.rod] = "rolled across"
        elif rolled.any() and folds(float(ratio[worst]), float(strips.curl[worst])):
            found[strand.rod] = "folded"
        else:
            found[strand.rod] = "curled along"
    return found


def folded(model: Model, state: State) -> Iterator[str]:
    """Yield a warning for each strip that has folded."""
    for name, shape in shapes(model, state).items():
        if shape == "folded":
            yield (
                f"rods.{name} has folded: its parts are in two shapes of rest, and where these meet depends on the "
                "mesh; a slower stimulus, or a strip that is less wide, does not fold"
            )
