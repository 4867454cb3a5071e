"""How large a log of a scene will be, before it is run: the sizes of its messages, times what is left of them packed.

What a run computes has digits that cannot be compressed. But a rod that bends in a plane along an axis of the world, or
half-way between two, has coordinates and moments that stay exactly zero, and they take hardly any room.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bilayer_core.log.messages.encoders import FrameEncoder
from bilayer_core.log.messages.topics import Rate
from bilayer_core.observed.frame import Strand
from bilayer_core.scene.profile import extremes
from bilayer_core.simulation.simulator import Simulator

PACKED_IN_PLANE, PACKED_IN_SPACE = 0.45, 0.77
"""Size of a chunk over that of the records in it: 0.40 to 0.50 and 0.69 to 0.81 in logs of the bundled scenes."""
HEAD = 45_000
"""What no frame adds to: types, topics, scene and description; 33 to 126 kB in these logs [bytes]."""
RECORD = 47
"""What a message takes beside its content: the head of its record, and an entry of an index [bytes]."""
ROUNDING = 1e-9
"""Of a strand's length: how far it may be from its plane."""


@dataclass(frozen=True)
class LogSize:
    """Expected size of a log with a state in every frame, the most there can be."""

    per_second: float  # Of simulated time [bytes]
    total: float  # For the scene's duration [bytes]


def forecast(simulator: Simulator) -> LogSize:
    """Return the expected size of a log of the scene, as `McapRecorder` writes it.

    Contact forces and events are left out: nobody knows how many there will be. Frames within one step share a state.
    `simulator`: at its start.
    """
    scene, strands = simulator.scene, simulator.description.strands
    encoder = FrameEncoder(simulator.description)
    rates = {Rate.OUTPUT: scene.output.rate, Rate.DISPLAY: min(scene.output.rate, scene.output.marker_rate)}
    unpacked = sum(rates[topic.rate] * (encoder.least_size(topic.name) + RECORD) for topic in encoder.topics)
    flat = np.mean([_stays_in_plane(simulator, strand) for strand in strands])
    per_second = unpacked * (PACKED_IN_SPACE + flat * (PACKED_IN_PLANE - PACKED_IN_SPACE))
    return LogSize(per_second, HEAD + per_second * scene.duration)


def _stays_in_plane(simulator: Simulator, strand: Strand) -> bool:
    """Return whether coordinates of a strand, or their sums or differences, stay exactly zero."""
    if simulator.plan.dimension == 2:
        return True
    scene, model = simulator.scene, simulator.model
    holding = {body.name for body in simulator.description.bodies if body.holds_rods}
    if any(body.name in holding and body.motion.turns for body in scene.bodies):
        return False
    rod = next(rod for rod in scene.rods if strand.rod in rod.copy_names)
    if any(
        extremes(part) != (0.0, 0.0)
        for layer in rod.layers
        for part in (layer.natural_twist, layer.natural_curvature_across or 0.0)
    ):
        return False
    places, normals = model.start_position[strand.nodes], model.start_director1[strand.edges]
    places = (places - places[0]) / np.linalg.norm(np.ptp(places, axis=0))
    across = np.cross(places[1], normals[0])
    across /= np.linalg.norm(across)
    sizes = np.abs(across[np.abs(across) > ROUNDING])
    heights = np.concatenate([places @ across, normals @ across, [np.array(scene.gravity) @ across]])
    return bool(np.ptp(sizes) < ROUNDING and np.abs(heights).max() < ROUNDING)
