"""Data for observers: a description of the model that never changes, and one `Frame` per observation."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")
"""Parts of a wrench."""


def strain_at(offset: np.ndarray, strain: np.ndarray, curvature: np.ndarray, at_start: np.ndarray) -> np.ndarray:
    """Return the axial strain at a distance y = `offset` from a curve, in a section that stays plane: (1 + ε − yχ)/(1 −
    yχ₀) − 1 with the curve's strain ε, its curvature χ, and that at the start χ₀.
    """
    return (1.0 + strain - offset * curvature) / (1.0 - offset * at_start) - 1.0


@dataclass(frozen=True, repr=False)
class Strand:
    """One layer of one rod, or all of them: a chain of nodes joined by edges, in order of arc length.

    Attributes
    ----------
    name : str
        ``"<rod>/<layer>"``, unique in the model, for example ``"arm_0/active"``.
    rod, layer : str
        Names of the rod (copies of a pattern are numbered) and of the layer.
    nodes, edges : slice
        Where its nodes and edges stand in the arrays of a `Frame`; ``edges`` has one element less.
    width, thickness : ndarray
        Of the cross-section at each node [m], shape (nodes,).
    offset : ndarray
        Of the middle of the cross-section from the node, along m1 [m], shape (nodes,).
    curvature : ndarray
        χ of its nodes' curve at the start [1/m], shape (nodes,).
    layers : tuple of Strand
        The layers of a strand that stands for several, bottom first: each with those of its nodes where it is, its
        own cross-section there, and the offset of its own middle. Empty for a strand of one layer.
    closed : bool
        Whether it has no ends: its first and its last node are one, and all that they have is the same.
    round : bool
        Whether its sections are round, as wide as thick.
    strip : bool
        Whether its sections bend, see `Frame.section_curvature`.
    first_station : int or None
        That of the rod at which it begins; None in older logs.
    """

    name: str
    rod: str
    layer: str
    nodes: slice
    edges: slice
    width: np.ndarray
    thickness: np.ndarray
    offset: np.ndarray
    curvature: np.ndarray
    layers: tuple[Strand, ...] = ()
    closed: bool = False
    round: bool = False
    strip: bool = False
    first_station: int | None = 0

    def __repr__(self) -> str:
        parts = f", layers {', '.join(part.layer for part in self.layers)}" if self.layers else ""
        return f"Strand({self.name}: nodes {self.nodes.start} to {self.nodes.stop - 1}{parts})"

    def strain_of(self, strain: np.ndarray, curvature: np.ndarray) -> np.ndarray:
        """Return the axial strain in the middle of its section; see `strain_at`.

        Parameters
        ----------
        strain, curvature : ndarray
            ε and χ at its nodes [1, 1/m], shape (..., nodes).

        Returns
        -------
        ndarray
            Shape (..., nodes).
        """
        return strain_at(self.offset, strain, curvature, self.curvature)


@dataclass(frozen=True)
class ShapeInfo:
    """A shape in the frame of its owner: a body, or the world for an obstacle.

    Attributes
    ----------
    kind : str
        ``"plane"`` (the half space below z = 0), ``"sphere"``, ``"box"`` or ``"cylinder"`` (axis along z), each about
        the origin of its own frame.
    size : tuple of float
        Whole lengths along its own axes [m]; zero for a plane.
    rounding : float
        Radius of its edges [m].
    position, quaternion : tuple of float
        Of its own frame [m], and x y z w.
    """

    kind: str
    size: tuple[float, ...]
    rounding: float
    position: tuple[float, ...]
    quaternion: tuple[float, ...]


@dataclass(frozen=True)
class BodyInfo:
    """A rigid body; `shape` is None for one without a surface of its own."""

    name: str
    shape: ShapeInfo | None
    prescribed: bool
    holds_rods: bool = False


@dataclass(frozen=True)
class ObstacleInfo:
    """A fixed surface."""

    name: str
    shape: ShapeInfo


@dataclass(frozen=True)
class JointInfo:
    """How a joint, or the hinge or rail of a guided body, is drawn: a small shape on a body.

    Attributes
    ----------
    name : str
        ``"joints/<name>"``, or ``"guides/<body>"`` and ``"rails/<body>"``.
    body : int
        Which one carries the shape, −1 for the world.
    shape : ShapeInfo
        A ball where it turns in all directions or about two axes, a cylinder along its axis, or a box.
    """

    name: str
    body: int
    shape: ShapeInfo


@dataclass(frozen=True, repr=False)
class Description:
    """Names, shapes and settings, which do not change during a run.

    Attributes
    ----------
    scene_name, title : str
    scene_text : str
        YAML from which `load_scene` rebuilds the configuration, overrides included.
    node_count, edge_count : int
        Nodes of all strands, then contact points of bodies (corners and rims of their surfaces too); edges of all
        strands.
    strands : tuple of Strand
    bodies : tuple of BodyInfo
    obstacles : tuple of ObstacleInfo
    channels : tuple of str
        Stimulus channels in the scene's order.
    channel_ranges : tuple of (float, float)
        Smallest and largest value of each channel, in its unit.
    state_layout : tuple of (str, tuple of int)
        Name and shape of each part of `Frame.state`, in order.
    settings : dict
        Solver settings and versions, as flat text values.
    joints : tuple of JointInfo
    channel_units : tuple of str
        Unit of each channel, empty for none.
    contact_pairs : tuple of (str, str)
        What can touch, and `Frame.pair_forces` are of: a rod, a body or an obstacle, and another.
    joint_figures : tuple of str
        Names of `Frame.joint_figures` among quantities; those of wrenches end with ``wrench``, and have six numbers.
    """

    scene_name: str
    title: str
    scene_text: str
    node_count: int
    edge_count: int
    strands: tuple[Strand, ...]
    bodies: tuple[BodyInfo, ...]
    obstacles: tuple[ObstacleInfo, ...]
    channels: tuple[str, ...]
    channel_ranges: tuple[tuple[float, float], ...]
    state_layout: tuple[tuple[str, tuple[int, ...]], ...]
    settings: dict[str, str] = field(default_factory=dict)
    joints: tuple[JointInfo, ...] = ()
    channel_units: tuple[str, ...] = ()
    contact_pairs: tuple[tuple[str, str], ...] = ()
    joint_figures: tuple[str, ...] = ()

    def __repr__(self) -> str:
        counts = f"{len(self.strands)} strands, {self.node_count} nodes, {len(self.bodies)} bodies"
        channels = ", ".join(self.channels) or "none"
        return f"Description({self.scene_name}: {counts}, {len(self.obstacles)} obstacles; channels: {channels})"

    @property
    def joint_labels(self) -> list[str]:
        """Name of each number in `Frame.joint_figures`, such as ``joint/wrist/wrench.fx``."""
        of_wrench = [f".{part}" for part in WRENCH]
        return [
            name + part for name in self.joint_figures for part in (of_wrench if name.endswith("/wrench") else [""])
        ]

    @property
    def layers(self) -> tuple[Strand, ...]:
        """Each layer of each rod, as it is to be drawn: strands of one layer, and the layers of the others."""
        return tuple(layer for strand in self.strands for layer in strand.layers or (strand,))


@dataclass(frozen=True, repr=False)
class Frame:
    """One observation of a run. Arrays are copies that nobody writes to afterwards, some of them read-only.

    Attributes
    ----------
    time : float
        Simulated time [s]. Within a step all but `state` is interpolated, see `simulation.step_span`.
    step : int
        Number of steps done at `time`.
    positions, velocities : ndarray
        Of every node [m, m/s], shape (node_count, 3).
    directors : ndarray
        Material director m1 (through the thickness, bottom to top) of every edge, unit, shape (edge_count, 3).
    strain : ndarray
        Axial strain at every node (mean of its edges), eigenstrain included, shape (node_count,).
    curvature : ndarray
        Curvature through the thickness, χ = m1·t′, at every node [1/m], shape (node_count,).
    section_curvature : ndarray
        Mean curvature across the width at every node of strips [1/m], 0 at others, shape (node_count,).
    contact_forces : ndarray
        Barrier and friction force on every node [N], shape (node_count, 3).
    body_positions, body_quaternions : ndarray
        Mass centre [m], shape (bodies, 3), and orientation x y z w, shape (bodies, 4).
    body_velocities, body_angular_velocities : ndarray
        [m/s] and [rad/s] in the world frame, shape (bodies, 3).
    contact_wrenches : ndarray
        Contact force [N] and moment about the mass centre [N m] on every body, shape (bodies, 6).
    clamp_wrenches : ndarray
        Likewise of the rods that it holds, shape (bodies, 6).
    com : ndarray
        Mass centre of the robot: rods, and bodies that hold them or are joined to these [m], shape (3,).
    stimulus : ndarray
        Value of each channel, where a step ended that which acted over it, in its unit, shape (channels,).
    energy : dict
        Energy of each term [J].
    min_gap : float
        Smallest contact distance of the model [m]; infinity if there is no contact pair.
    iterations : int
        Newton iterations since the start of the run.
    residual : float
        Largest velocity correction left in the last step [m/s].
    substeps : int
        Parts of steps taken since the start of the run; more than steps where fixed ones were halved.
    cpu_time : float
        CPU seconds of the stepping thread up to here [s].
    state : ndarray
        Flat state for a restart, of the last step that ended at `time` or before; parts and shapes as in
        `Description.state_layout`.
    contacts : tuple of (str, str)
        Names of what touches: a rod, a body or an obstacle, and another; see `simulation.contact_pairs`.
    rejected : tuple of int
        Attempts at steps that were made again, shorter, since the start of the run; those of them whose error was too
        large; those that made energy.
    beyond_limits : tuple of str
        For each limit of the model that the run has passed since its start, what it is and what that means.
    pair_forces : ndarray
        Sum of the normal forces of each of `Description.contact_pairs` [N], shape (pairs,).
    joint_figures : ndarray
        Wrenches, angles and ways of joints [N, N m, rad, m], as `Description.joint_labels` names them.
    """

    time: float
    step: int
    positions: np.ndarray
    velocities: np.ndarray
    directors: np.ndarray
    strain: np.ndarray
    curvature: np.ndarray
    section_curvature: np.ndarray
    contact_forces: np.ndarray
    body_positions: np.ndarray
    body_quaternions: np.ndarray
    body_velocities: np.ndarray
    body_angular_velocities: np.ndarray
    contact_wrenches: np.ndarray
    clamp_wrenches: np.ndarray
    com: np.ndarray
    stimulus: np.ndarray
    energy: dict[str, float]
    min_gap: float
    iterations: int
    residual: float
    substeps: int
    cpu_time: float
    state: np.ndarray
    contacts: tuple[tuple[str, str], ...] = field(default_factory=tuple)  # which leaves no attribute of the class
    rejected: tuple[int, int, int] = (0, 0, 0)
    beyond_limits: tuple[str, ...] = ()
    pair_forces: np.ndarray = field(default_factory=lambda: np.empty(0))
    joint_figures: np.ndarray = field(default_factory=lambda: np.empty(0))

    def __repr__(self) -> str:
        counts = f"{len(self.positions)} nodes, {len(self.body_positions)} bodies"
        return f"Frame(t = {self.time:g} s, step {self.step}: {counts}, smallest gap {self.min_gap:.3g} m)"
