"""Sections of strips: how they are curved across, what statics disturb, and names of shapes at rest.

Names are those of `forces.flattening`. The moment across that a section carries is −∂F/∂κ̄y, which leaves, in the mean
over its width,

    κ_y Δl = κ̄y Δl − a₁ (κ₁ − κ̄₁) − 2 a₃ (ψ − ψ̄) − N Λ κ₁ φ

from the curvature of a free plate, where a strip is narrow, to ψ²/κ₁ where it is wide. A swollen strip that is wide
enough has two shapes at rest, curled along or rolled up across. Where both are in one strip, it has folded: the mesh
says where they meet, since the law of a joint knows nothing of the joints beside it. So does twist that loads force on
a ribbon where it is hardly bent: the ribbon creases. In both, what two neighbouring joints bear is the same, and the
tangent between their strains is negative somewhere.
"""

from __future__ import annotations

import numpy as np

from bilayer_core.forces.flattening import Sections, write_sections
from bilayer_core.model.model import Model
from bilayer_core.model.state import State
from bilayer_core.model.strand_arrays import StrandArrays
from bilayer_core.scene.transduction import free_strain

Array = np.ndarray
DISTURBANCE = 1e-3
"""Turn of the middle of a strip about its axis [rad] from which statics begin. Flat strips that swell, and strips that
are rolled up across, may be unstable against twist alone, and nothing else leads away from them."""
ACROSS = 2.0
"""Curvature across over that along from which a section counts as rolled up across."""
JUMP = 0.2
"""Step of curvature and twist from a joint to the next, over the largest natural ones of the strip, or else over its
largest, that may be a jump."""
CONVEX = 4.0
"""x = √Λ κ₁, or √Λ ψ, natural or as it is, below which the law is convex: from 7.5 on some tangents are negative."""
FOLDS = "folds: its parts are in two shapes of rest, and where these meet depends on the mesh"
ROUNDING = 1e-9
"""Of the square of a natural twist."""
BETWEEN = np.linspace(0.0, 1.0, 17)
"""Where the law is looked at between the strains of two joints."""


def _rest(model: Model, state: State) -> Array:
    """Return `Stage.rest_joint` of a state."""
    drives, rest = model.drives, model.drives.joint_rest.copy()
    strain = free_strain(state.transduction, drives.law_gain, drives.law_reference, drives.law_saturation)
    driven = drives.driven_joint, drives.driven_joint_column
    np.add.at(rest, driven, drives.driven_joint_weight * strain[drives.driven_joint_law])
    return rest


def _natural(model: Model, rest: Array) -> tuple[Array, Array, Array]:
    """Return κ̄₁, ψ̄ and κ̄y Δl of strip joints, shape (n_strip_joint,)."""
    strips = model.flattening
    return rest[strips.joint, 0], rest[strips.joint, 2], rest[strips.first :][: len(strips.joint), 0]


def _law(model: Model, rest: Array, strips: Array, kappa: Array, psi: Array) -> Sections:
    """Return the law of some strip joints at strains κ₁ and ψ."""
    pull, tangent = np.zeros(len(kappa)), np.zeros((len(kappa), 3))
    of = Sections(rest=rest, strip=strips, kappa=kappa, psi=psi, pull=pull, tangent=tangent)
    write_sections(model.flattening, of)
    return of


def _inside(model: Model) -> Array:
    """Return which strip joints are between two edges of a rod, not beside a clamp."""
    rods, joint = model.rods, model.flattening.joint
    return (rods.joint_a[joint] < rods.edge_count) & (rods.joint_b[joint] < rods.edge_count)


def _strains(model: Model, state: State) -> tuple[Array, Array]:
    """Return κ₁ and ψ of strip joints; κ₁ of those beside a clamp is nothing."""
    rods, joint, inside = model.rods, model.flattening.joint, _inside(model)
    first, second = np.where(inside, rods.joint_a[joint], 0), np.where(inside, rods.joint_b[joint], 0)
    vector = state.position[rods.edge_node + 1] - state.position[rods.edge_node]
    tangent = vector / np.linalg.norm(vector, axis=1, keepdims=True)
    a, b = tangent[first], tangent[second]
    bend = np.einsum("ki,ki->k", b, state.director1[first]) - np.einsum("ki,ki->k", a, state.director1[second])
    return bend / (1.0 + np.einsum("ki,ki->k", a, b)), state.twist[joint]


def curvatures(model: Model, state: State) -> tuple[Array, Array]:
    """Return the curvature along and the mean curvature across of strip joints [1/m], shape (n_strip_joint,).

    Those beside a clamp have the values of the next joint.
    """
    strips, inside, (kappa, psi), rest = model.flattening, _inside(model), _strains(model, state), _rest(model, state)
    along, twist, across = _natural(model, rest)
    free = across - strips.curl * (kappa - along) - strips.skew * (psi - twist)
    curved = free - _law(model, rest, np.arange(len(kappa)), kappa, psi).pull * strips.scale**2 / strips.stiffness
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
    natural = _natural(model, _rest(model, state))[2] if model.flattening.exists else np.zeros(0)
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


def folds(model: Model, state: State) -> dict[str, str]:
    """Return `folded` for each strip whose curvature jumps, or `creased` if loads alone bend and twist it."""
    found: dict[str, str] = {}
    if not model.flattening.exists:
        return found
    rest, strains, inside = _rest(model, state), _strains(model, state), _inside(model)
    along, twist, across = natural = _natural(model, rest)
    x = model.flattening.scale * np.max([np.hypot(*strains), np.hypot(along, twist), np.abs(across)], axis=0)
    if x[inside].max(initial=0.0) < CONVEX:
        return found
    for strand in model.strands:
        own = _joints_of(model, strand)
        if _jumps(model, rest, natural, strains, own[inside[own]]):
            active = across[own].any() or _is_turned(model, twist)[own].any()
            found[strand.rod] = "folded" if active else "creased"
    return found


def _is_turned(model: Model, twist: Array) -> Array:
    """Return which strip joints have another natural twist than their borders, which fibres that swell give them."""
    return ~np.isclose(twist**2, model.flattening.start, rtol=ROUNDING, atol=0.0)


def shapes(model: Model, state: State) -> dict[str, str]:
    """Return the shape of each strip that curls across, `curled along` or `rolled across`, and of those in `folds`. One
    that fibres twist may have any other shape.
    """
    found = folds(model, state)
    if not model.flattening.exists:
        return found
    _, twist, natural = _natural(model, _rest(model, state))
    along, across = map(np.abs, curvatures(model, state))
    for strand in model.strands:
        own = _joints_of(model, strand)
        if natural[own].any() and not _is_turned(model, twist)[own].any():
            shape = "rolled across" if (across > ACROSS * along)[own].all() else "curled along"
            found.setdefault(strand.rod, shape)
    return found


def _jumps(
    model: Model, rest: Array, natural: tuple[Array, Array, Array], strains: tuple[Array, Array], own: Array
) -> bool:
    """Return whether curvature or twist jump from one to the next of these joints, which come in order: by so much,
    under like stimuli, and over strains at which the law has a negative tangent. No smooth state has that on any mesh.
    """
    joint = model.flattening.joint[own]
    length = model.voronoi_length[joint][:, None]
    strain, free = (np.stack([of[own] for of in values], axis=1) / length for values in (strains, natural))
    sizes = [np.hypot(*of.T[:2]) for of in (free, strain)]
    step, size = np.diff(strain, axis=0), next((of.max() for of in sizes if of.any()), 0.0)
    alike = np.abs(np.diff(free, axis=0)).max(axis=1, initial=0.0) <= JUMP * size
    far = np.flatnonzero((np.hypot(*step.T) > JUMP * size) & alike)
    if not len(far):
        return False
    way = step[far] * length[far]
    between = strain[far, :, None] * length[far, :, None] + way[:, :, None] * BETWEEN
    of = _law(model, rest, np.repeat(own[far], len(BETWEEN)), between[:, 0].ravel(), between[:, 1].ravel())
    k11, k13, k33 = of.tangent.T.reshape(3, len(far), len(BETWEEN))
    stiffness, (bend, twist) = model.rods.joint_stiffness[joint[far]], way.T[:, :, None]
    tangent = (stiffness[:, :1] + k11) * bend**2 + 2.0 * k13 * bend * twist + (stiffness[:, 2:] + k33) * twist**2
    return bool((tangent < 0.0).any())
