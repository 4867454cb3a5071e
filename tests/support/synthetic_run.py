"""A run made by hand: four ribbons on a hub curl down round a ball on the ground, then lift it.

Nothing here is mechanics; shapes are circular arcs. Ranges, names and the order of arrays are as the simulator's.
"""

from __future__ import annotations

import numpy as np

from bilayer_core.observed.frame import BodyInfo, Description, Frame, ObstacleInfo, ShapeInfo, Strand
from bilayer_core.observed.inputs import STIMULUS, Input

ARMS = 4
NODES = 41
LENGTH = 0.058  # of an arm [m]
WIDTH, THICKNESS = 0.01, 0.001
RADIUS = 0.02  # of the ball [m]
HUB_HEIGHT = 0.047
LIFT = 0.1
TERMS = ("kinetic", "stretch", "bend", "twist", "coupling", "gravity", "barrier")

SCENE_TEXT = "schema: 1\nname: synthetic\ntitle: Four ribbons and a ball\n"


def shape(kind: str, size: float) -> ShapeInfo:
    """A shape at the origin, as large along every axis."""
    return ShapeInfo(kind, (size,) * 3, 0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))


def description() -> Description:
    """Of two-layer arms (bottom and top), a hub, a ball and the ground; the hub has one contact point."""
    strands = []
    for arm in range(ARMS):
        for layer, name in enumerate(("passive", "active")):
            index = 2 * arm + layer
            strands.append(
                Strand(
                    name=f"arm_{arm}/{name}",
                    rod=f"arm_{arm}",
                    layer=name,
                    nodes=slice(index * NODES, (index + 1) * NODES),
                    edges=slice(index * (NODES - 1), (index + 1) * (NODES - 1)),
                    width=np.full(NODES, WIDTH),
                    thickness=np.full(NODES, THICKNESS),
                    offset=np.zeros(NODES),
                    curvature=np.zeros(NODES),
                )
            )
    node_count = len(strands) * NODES + 1
    return Description(
        scene_name="synthetic",
        title="Four ribbons and a ball",
        scene_text=SCENE_TEXT,
        node_count=node_count,
        edge_count=len(strands) * (NODES - 1),
        strands=tuple(strands),
        bodies=(BodyInfo("hub", None, True, holds_rods=True), BodyInfo("ball", shape("sphere", 2 * RADIUS), False)),
        obstacles=(ObstacleInfo("ground", shape("plane", 0.0)),),
        channels=("humidity",),
        channel_ranges=((0.0, 1.0),),
        channel_units=("",),
        state_layout=(("positions", (node_count, 3)), ("velocities", (node_count, 3)), ("step", (1,))),
        settings={"model": "two_rod", "integrator": "implicit_euler", "dt": "0.001", "numpy": np.__version__},
    )


def frame(time: float, duration: float = 4.0) -> Frame:
    """The run at `time` [s]: arms close in the first half and lift in the second."""
    closing = np.clip(2 * time / duration, 0.0, 1.0)
    lift = LIFT * np.clip(2 * time / duration - 1.0, 0.0, 1.0)
    curvature = 42.0 * closing + 1e-3
    arc = np.linspace(0.0, LENGTH, NODES)
    angle = curvature * arc
    # In the plane of an arm: outwards and up, with the normal m1 on the upper side.
    outwards, up = np.sin(angle) / curvature, (np.cos(angle) - 1.0) / curvature
    half = angle[:-1] + 0.5 * curvature * np.diff(arc)
    positions, directors, strain, forces = [], [], [], []
    holding = closing == 1.0
    for arm in range(ARMS):
        turn = 0.5 * np.pi * arm
        across = np.array([np.cos(turn), np.sin(turn), 0.0])
        vertical = np.array([0.0, 0.0, 1.0])
        for layer in (-0.5, 0.5):
            normal = np.outer(np.sin(angle), across) + np.outer(np.cos(angle), vertical)
            centre = np.outer(outwards, across) + np.outer(up + HUB_HEIGHT + lift, vertical)
            positions.append(centre + layer * THICKNESS * normal)
            directors.append(np.outer(np.sin(half), across) + np.outer(np.cos(half), vertical))
            strain.append(closing * (0.025 + 0.045 * layer + 0.004 * np.cos(3 * arc / LENGTH)))
            force = np.zeros((NODES, 3))
            if holding and layer < 0:
                force[-9:] = 0.02 * (across - 0.4 * vertical)
            forces.append(force)
    hub = np.array([0.0, 0.0, HUB_HEIGHT + lift])
    ball = np.array([0.0, 0.0, RADIUS + 0.001 + lift])
    positions = np.concatenate([*positions, hub[None]])
    node_count = len(positions)
    forces = np.concatenate([*forces, np.zeros((1, 3))])
    spin = 0.6 * lift / LIFT
    touching = tuple((f"arm_{arm}", "ball") for arm in range(ARMS)) if holding else (("ball", "ground"),)
    wrenches = np.zeros((2, 6))
    wrenches[1, :3] = -forces.sum(axis=0)
    energies = {name: (index + 1) * 1e-4 * closing**2 for index, name in enumerate(TERMS)}
    return Frame(
        time=time,
        step=round(time / 1e-3),
        positions=positions,
        velocities=np.zeros_like(positions),
        directors=np.concatenate(directors),
        strain=np.concatenate([*strain, [0.0]]),
        curvature=np.concatenate([np.full(node_count - 1, -curvature), [0.0]]),
        section_curvature=np.zeros(node_count),
        contact_forces=forces,
        body_positions=np.stack([hub, ball]),
        body_quaternions=np.array([[0.0, 0.0, 0.0, 1.0], [0.0, np.sin(spin), 0.0, np.cos(spin)]]),
        body_velocities=np.zeros((2, 3)),
        body_angular_velocities=np.zeros((2, 3)),
        contact_wrenches=wrenches,
        clamp_wrenches=-wrenches[::-1],
        com=positions.mean(axis=0),
        stimulus=np.array([closing]),
        energy=energies,
        min_gap=1e-3 - 4e-4 * closing,
        iterations=60,
        residual=3e-7,
        substeps=20,
        cpu_time=0.7 * time,
        contacts=touching,
        state=np.concatenate([positions.ravel(), np.zeros(3 * node_count), [round(time / 1e-3)]]),
    )


def random_frame(generator: np.random.Generator) -> Frame:
    """A frame with random numbers in every array, for tests of encoders."""
    model = description()
    nodes, bodies = model.node_count, len(model.bodies)
    directors = generator.normal(size=(model.edge_count, 3))
    quaternions = generator.normal(size=(bodies, 4))
    forces = generator.normal(size=(nodes, 3))
    forces[generator.random(nodes) < 0.7] = 0.0
    return Frame(
        time=float(generator.uniform(0, 100)),
        step=7,
        positions=generator.normal(size=(nodes, 3)),
        velocities=generator.normal(size=(nodes, 3)),
        directors=directors / np.linalg.norm(directors, axis=1, keepdims=True),
        strain=generator.normal(scale=0.05, size=nodes),
        curvature=generator.normal(size=nodes),
        section_curvature=np.zeros(nodes),
        contact_forces=forces,
        body_positions=generator.normal(size=(bodies, 3)),
        body_quaternions=quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True),
        body_velocities=generator.normal(size=(bodies, 3)),
        body_angular_velocities=generator.normal(size=(bodies, 3)),
        contact_wrenches=generator.normal(size=(bodies, 6)),
        clamp_wrenches=generator.normal(size=(bodies, 6)),
        com=generator.normal(size=3),
        stimulus=generator.normal(size=1),
        energy={name: float(generator.normal()) for name in TERMS},
        min_gap=float("inf"),
        iterations=3,
        residual=1e-7,
        substeps=1,
        cpu_time=0.1,
        state=generator.normal(size=6 * nodes + 1),
    )


def run(recorder, times: np.ndarray, complete: bool = True, inputs: dict[int, Input] | None = None) -> None:
    """Show the run at `times` to an observer, and tell it inputs before frames, by their number."""
    recorder.start(description())
    for number, time in enumerate(times):
        if inputs and number in inputs:
            recorder.note(inputs[number])
        recorder.observe(frame(float(time), float(times[-1])))
    recorder.close(complete)


def stimulus_before(number: int, times: np.ndarray) -> dict[int, Input]:
    """A stimulus that is set before a frame, for `run`."""
    return {number: Input(number, float(times[number]), STIMULUS, "humidity", (0.25,))}
