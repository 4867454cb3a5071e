"""How large a log of a scene will be, before it is run: frames like those of a run are written as a log.

The shape at the start is deformed as motion would deform it. A rod that lies in a plane with what acts on it stays in
it, and its coordinates across the plane stay zero, which a log hardly takes any room for; all else has digits that
cannot be compressed. Noise stands for these digits, the same each time.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bilayer_core.observed.frame import Description, Frame
from bilayer_core.record.mcap_log import SUFFIX, McapRecorder
from bilayer_core.record.private_directory import private_directory
from bilayer_core.scene.profile import extremes
from bilayer_core.simulation.simulator import Simulator

Array = np.ndarray
FRAMES_SIZE = 3e6
"""Of the frames that are written, about [bytes]: several chunks."""
FEWEST, MOST = 4, 200
"""Frames that are written."""
FLAT = 1e-9
"""How far a rod that lies in a plane may be from it, as a part of its length."""
SAMPLE_RATE = 50.0
"""Of these frames [Hz]: whatever that of the scene is, their times fit into messages."""
LARGE, SMALL = 1e-2, 1e-17
"""By how much a frame differs from another, as a part of the length of the robot; and what rounding cuts off."""
LOW = "position_low"
"""What rounding cuts off: about half of it is zero."""
VECTORS = ("position", "velocity", "acceleration", "fluid_force", LOW)
"""Parts of a state for each node."""
ACROSS = ("spin", "twist", "spin_acceleration")
"""Parts that are zero in a plane."""
OF_ELEMENTS = ("strain_rate", "strain_acceleration")
"""Parts of which half is zero in a plane."""
STILL = (
    *("fingerprint", "override", "friction", "pose_goal", "memory", "touched", "conditions", "has_history"),
    "fluid_excess",
)
"""Parts that hardly change from frame to frame."""


@dataclass(frozen=True)
class LogSize:
    """What a log is expected to take.

    Attributes
    ----------
    per_second : float
        Of simulated time [bytes].
    total : float
        For the scene's duration [bytes].
    """

    per_second: float
    total: float


def forecast(simulator: Simulator, rate: float | None = None) -> LogSize:
    """The size of a log of the scene, as `McapRecorder` writes it.

    Parameters
    ----------
    simulator : Simulator
        At its start.
    rate : float, optional
        Of frames [Hz]; by default the scene's.
    """
    scene, description = simulator.scene, simulator.description
    rate = rate or scene.output.rate
    marker_rate = min(rate, scene.output.marker_rate)
    frames = _Frames(simulator, description)
    count = int(min(MOST, max(FEWEST, FRAMES_SIZE // (16 * frames.size))))
    with private_directory() as directory:
        path = directory / f"run{SUFFIX}"
        first, small, full = (
            _written(path, description, frames, displays, n) for displays, n in ((1, 1), (1, count), (count, count))
        )
    per_frame = (small - first) / (count - 1)
    per_shape = (full - small) / (count - 1)
    per_second = rate * per_frame + marker_rate * per_shape
    return LogSize(per_second, first + per_second * scene.duration)


def _written(path: Path, description: Description, frames: _Frames, displays: int, count: int) -> int:
    """Size of a log of some frames, the first or all of which have shapes [bytes]."""
    recorder = McapRecorder(path, SAMPLE_RATE, SAMPLE_RATE if displays > 1 else 1e-6, force=True)
    recorder.start(description)
    for k in range(count):
        recorder.observe(frames.at(k, k / SAMPLE_RATE))
    recorder.close(True)
    return path.stat().st_size


class _Frames:
    """Frames that differ as those of a run do."""

    def __init__(self, simulator: Simulator, description: Description):
        self._description = description
        self._positions = simulator.positions
        self._size = float(np.ptp(self._positions, axis=0).max()) or 1.0
        self._flat = simulator.save_state()
        self._parts: dict[str, tuple[slice, tuple[int, ...]]] = {}
        begin = 0
        for name, shape in description.state_layout:
            size = int(np.prod(shape))
            self._parts[name] = slice(begin, begin + size), shape
            begin += size
        self.size = self._flat.size
        self._directors = self._part("director1")
        holding = {body.name for body in description.bodies if body.holds_rods and not body.prescribed}
        turning = any(body.name in holding and body.motion.turns for body in simulator.scene.bodies)
        self._leaves = turning and simulator.plan.dimension == 3  # what carries the rods turns, however little
        self._like = [self._first_like(simulator, k) for k in range(len(description.strands))]
        self._planes = [self._plane_of(simulator, k) for k in range(len(description.strands))]
        held = [body.prescribed for body in description.bodies]
        self._moving = ~np.array(held, bool)
        self._terms = [name for name, state in simulator.plan.terms.items() if state == "active"]

    def _part(self, name: str) -> Array:
        where, shape = self._parts[name]
        return self._flat[where].reshape(shape)

    def _plane_of(self, simulator: Simulator, number: int) -> Array | None:
        """The normal of the plane in which a strand stays, or None."""
        strand, scene = self._description.strands[number], simulator.scene
        points, normals = self._positions[strand.nodes], self._directors[strand.edges]
        if simulator.plan.dimension == 2:
            return simulator.model.plane.normal
        if self._leaves:
            return None
        across = np.cross(points[1] - points[0], normals[0])
        across /= np.linalg.norm(across)
        sizes = np.abs(across[np.abs(across) > FLAT])
        if np.ptp(sizes) > FLAT:  # neither along an axis nor half-way between two: rounding leaves the plane
            return None
        heights = np.concatenate([(points - points[0]) @ across / self._size, normals @ across])
        gravity = np.array(scene.gravity)
        rod = next((rod for rod in scene.rods if strand.rod in rod.copy_names), None)
        twists = rod is None or any(np.any(_values(layer.natural_twist)) for layer in rod.layers)
        leaves = np.abs(heights).max() > FLAT or abs(gravity @ across) > FLAT * (np.linalg.norm(gravity) or 1.0)
        return None if leaves or twists or self._meets_sideways(simulator, across) else across

    def _meets_sideways(self, simulator: Simulator, across: Array) -> bool:
        """Whether light, a flow or loads push across the plane."""
        scene = simulator.scene
        pushes = [np.array(load.force) for load in scene.loads if load.frame == "world"]
        pushes += [np.array(of.light.from_direction) for of in scene.stimuli.values() if of.light is not None]
        if scene.fluid is not None:
            pushes.append(np.array(scene.fluid.velocity))
        return any(abs(push @ across) > FLAT * (np.linalg.norm(push) or 1.0) for push in pushes)

    def _first_like(self, simulator: Simulator, number: int) -> int:
        """The first strand of which one is a copy that moves alike: of a pattern whose copies have the same laws."""
        strand = self._description.strands[number]
        rod = next((rod for rod in simulator.scene.rods if strand.rod in rod.copy_names), None)
        if rod is None or rod.pattern is None or rod.pattern.stimuli or rod.pattern.gains:
            return number
        alike = (k for k, of in enumerate(self._description.strands) if of.rod in rod.copy_names)
        return next(k for k in alike if self._description.strands[k].layer == strand.layer)

    def _vectors(self, noise: np.random.Generator, of_edges: bool = False) -> Array:
        """A random vector for each node or edge, in the planes of strands; copies that move alike have the same."""
        count = len(self._directors) if of_edges else self._description.node_count
        found = noise.normal(size=(count, 3))
        local: dict[int, Array] = {}
        strands = zip(self._description.strands, self._planes, self._like, strict=True)
        for number, (strand, normal, first) in enumerate(strands):
            rows = strand.edges if of_edges else strand.nodes
            if normal is None:
                continue
            local.setdefault(number, noise.normal(size=(rows.stop - rows.start, 2)))
            along, across = local[first if first in local else number].T
            tangent = np.cross(self._directors[strand.edges][0], normal)
            upright = np.cross(normal, tangent)
            for axis in (tangent, upright):
                axis[np.abs(axis) < FLAT] = 0.0
            found[rows] = np.outer(along, tangent) + np.outer(across, upright)
        return found

    def at(self, number: int, time: float) -> Frame:
        """A frame."""
        noise, description = np.random.default_rng(number), self._description
        bodies, nodes = len(description.bodies), description.node_count
        positions = self._positions + LARGE * self._size * self._vectors(noise)
        velocities = self._vectors(noise)
        directors = self._directors + LARGE * self._vectors(noise, of_edges=True)
        directors /= np.linalg.norm(directors, axis=1, keepdims=True)
        flat = self._state(noise, positions, velocities, directors)
        planar = description.settings.get("dimension") == "2"
        places, turns = np.zeros((bodies, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (bodies, 1))
        wrenches = self._wrenches(noise, planar)
        turning = self._moving & self._leaves
        turns[turning] = noise.normal(size=(int(turning.sum()), 4))
        places[self._moving] += noise.normal(size=(int(self._moving.sum()), 3))
        return Frame(
            time=time,
            step=7 * number,
            positions=positions,
            velocities=velocities,
            directors=directors,
            strain=noise.normal(size=nodes),
            curvature=noise.normal(size=nodes),
            contact_forces=np.zeros((nodes, 3)),
            body_positions=places,
            body_quaternions=turns,
            body_velocities=places,
            body_angular_velocities=places,
            contact_wrenches=np.zeros((bodies, 6)),
            clamp_wrenches=wrenches,
            com=noise.normal(size=3),
            stimulus=noise.normal(size=len(description.channels)),
            energy={name: float(noise.normal()) for name in self._terms},
            min_gap=float(noise.normal()),
            iterations=31 * number,
            residual=float(noise.normal()),
            substeps=9 * number,
            cpu_time=float(noise.normal()),
            state=flat,
        )

    def _wrenches(self, noise: np.random.Generator, planar: bool) -> Array:
        """Forces and moments of held rods; in a plane half of the components are zero."""
        found = np.zeros((len(self._description.bodies), 6))
        holding = [body.holds_rods for body in self._description.bodies]
        found[holding] = noise.normal(size=(sum(holding), 6))
        if planar:
            found[:, [1, 3, 5]] = 0.0
        return found

    def _state(self, noise: np.random.Generator, positions: Array, velocities: Array, directors: Array) -> Array:
        flat = self._flat.copy()
        in_plane = np.zeros(len(directors), bool)
        for strand, normal in zip(self._description.strands, self._planes, strict=True):
            in_plane[strand.edges] = normal is not None
        for name, (where, shape) in self._parts.items():
            if name in STILL or not where.stop > where.start:
                continue
            if name == "director1":
                values = directors
            elif name in VECTORS:
                known = {"position": positions, "velocity": velocities}
                values = (known[name] if name in known else self._vectors(noise))[: shape[0]]
                if name == LOW:
                    values = np.where(noise.random(shape[0])[:, None] < 0.5, 0.0, SMALL * values)
            elif name in OF_ELEMENTS:
                values = noise.normal(size=shape)
                values[: int(0.5 * shape[0] * in_plane.mean())] = 0.0
            elif name in ACROSS:
                values = noise.normal(size=shape)
                values[np.resize(in_plane, shape[0])] = 0.0  # elements are about as many as edges
            elif name.startswith("body_"):
                values = noise.normal(size=shape)
                if shape[0] == len(self._moving):
                    values[~self._moving] = flat[where].reshape(shape)[~self._moving]
            else:
                values = noise.normal(size=shape)
            flat[where] = np.ravel(values)
        return flat


def _values(profile) -> Array:
    """All numbers of a quantity that may vary along a rod."""
    return np.array(extremes(profile))
