"""Which elements of layers a light shines on, and what hides it: the arrays of `model.records.light.Light`."""

from __future__ import annotations

import numpy as np

from bilayer_core.contact.light import brightness, look_at_light
from bilayer_core.jit import UNALLOCATED, piece
from bilayer_core.model.contact_points import owned_shapes
from bilayer_core.model.model import Model, PlacedBodies
from bilayer_core.model.records.light import Light
from bilayer_core.model.records.parts import Drives, Strands
from bilayer_core.model.section import outline
from bilayer_core.model.shape_numbers import NUMBER
from bilayer_core.model.sizes import sizes_of
from bilayer_core.model.strands import Collected
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.diffusion_modes import responses
from bilayer_core.scene.eigenstrain import Eigenstrain
from bilayer_core.scene.profile import values_at
from bilayer_core.scene.rod import Layer, Rod

Array = np.ndarray


def is_light(scene: SceneConfig, law: Eigenstrain) -> bool:
    """Return whether a law follows a light."""
    return scene.stimuli[law.stimulus].light is not None


def add_lit_elements(
    found: Collected,
    scene: SceneConfig,
    rod: Rod,
    layer: Layer,
    law: Eigenstrain,
    edges: Array,
    first_edge: int,
    axis: Array,
) -> Array:
    """Add what a light reaches of a layer, and laws for it, one an edge that the law drives: their numbers for the mean
    of the layer and for its gradient (−1 without), shape (n_driven, 2).

    Parameters
    ----------
    edges : Array
        Edges of the path that the law drives, shape (n_driven,).
    first_edge : int
        Of the strand, as if that began with the path.
    axis : Array
        Height of the strand over the path in the middle of each edge of the path [m].
    """
    (response,) = responses(rod, layer, law)
    gains = values_at(law.gain, rod.edge_length * (edges + 0.5)).tolist()
    laws = [law.model_copy(update={"gain": gain}) for gain in gains]
    numbers = np.array([found.law(scene, own, response, alone=True) for own in laws])
    slot = rod.layers.index(layer)
    _, thickness = outline(rod, edges + 0.5)
    own, alone = thickness[slot], thickness.sum(axis=0) == thickness[slot]
    outward = np.array([-1.0, 1.0])[slot] if len(rod.layers) == 2 else 1.0
    middle = 0.5 * outward * own if len(rod.layers) == 2 else 0.0 * own
    found.add(
        lit_law=numbers[:, 0],
        lit_edge=first_edge + edges,
        lit_side=np.where(alone, 0.0, outward),
        lit_height=middle + np.where(alone, 0.0, 0.5 * outward * own) - axis[edges],
        lit_half=0.5 * own,
        lit_slenderness=rod.path.length / thickness.sum(axis=0),
    )
    return numbers


def build_light(scene: SceneConfig, found: Collected, bodies: PlacedBodies, rods: Strands, drives: Drives) -> Light:
    """Return the elements that lights shine on, and directions to the lights at the start; absent if no layer
    follows a light.
    """
    law = found.column("lit_law", np.int64)
    if not len(law):
        return Light.absent()
    names = list(scene.stimuli)
    lights = [name for name in names if scene.stimuli[name].light is not None]
    number = {names.index(name): k for k, name in enumerate(lights)}
    casts = np.array([scene.stimuli[name].light.shadow for name in lights])
    shapes = owned_shapes(scene, bodies) if casts.any() else []
    return Light.zeros(
        UNALLOCATED,
        law=law,
        field=drives.law_field[law],
        edge=found.column("lit_edge", np.int64),
        **{name: found.column(f"lit_{name}") for name in ("side", "height", "half", "slenderness")},
        source=np.array([number[channel] for channel in drives.field_channel[drives.law_field[law]]], dtype=np.int64),
        direction=np.array([scene.stimuli[name].light.from_direction for name in lights]),
        casts=casts,
        edge_node=rods.edge_node,
        half_width=rods.half_width,
        blocker=np.concatenate([s.first_edge + np.arange(s.shown - 1) for s in found.strands]),
        section=_sections(found),
        softness=rods.rest_length,
        kind=np.array([NUMBER[s.shape.kind] for s in shapes], dtype=np.int64),
        size=np.array([s.shape.core for s in shapes]).reshape(-1, 3),
        rounding=np.array([s.shape.rounding for s in shapes], dtype=float),
        bound=np.array([s.shape.bound for s in shapes], dtype=float),
        body=np.array([s.body for s in shapes], dtype=np.int64),
        position=np.array([s.position for s in shapes]).reshape(-1, 3),
        rotation=np.array([s.rotation @ s.shape.rotation for s in shapes]).reshape(-1, 3, 3),
    )


def _sections(found: Collected) -> Array:
    """Return a number for each place along a rod, the same for the edges of both layers there, shape (n_edge,)."""
    numbers: dict[tuple[str, int], int] = {}
    section = np.zeros(found.edge_count, dtype=np.int64)
    for strand in found.strands:
        for k in range(strand.node_count - 1):
            place = strand.rod, strand.first_station + k % (strand.shown - 1)
            section[strand.first_edge + k] = numbers.setdefault(place, len(numbers))
    return section


def light_of(model: Model) -> Light:
    """Return the light of a model with arrays of its own, in which nothing is hidden; absent as in the model."""
    light = model.light.allocated(sizes_of(model))
    if light.exists:
        light.body_rotation[-1], light.seen[:] = np.eye(3), 1.0
    return light


@piece(int, Light, int)
def shine(light, end):
    """Return `look_at_light`, for steps and for states at rest."""
    look_at_light(light, end)
    return 0


def part_seen(light: Light, position: Array, director1: Array, body_position: Array, body_rotation: Array) -> Array:
    """Return the part of its stimulus that each field sees of a robot at some positions and frames: 1 where that is no
    light, shape (n_field,).
    """
    light.node_position[:], light.director1[:] = position, director1
    light.body_position[:-1], light.body_rotation[:-1] = body_position, body_rotation
    shine(light, 0)
    seen = np.ones(len(light.seen))
    elements = zip(light.side, light.facing[:, 0], light.visible[:, 0], strict=True)
    seen[light.field] = [brightness.py_func(*map(float, element)) for element in elements]
    return seen
