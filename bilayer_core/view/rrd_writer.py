"""A run as a rerun recording: entities, time columns, and the layout stored in the file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rerun as rr

from bilayer_core.observed.frame import ShapeInfo
from bilayer_core.record.events import LEVEL_NAMES
from bilayer_core.record.node_frames import layer_rows
from bilayer_core.record.run_data import RunData
from bilayer_core.view import geometry
from bilayer_core.view.arrows import Arrows, contact_arrows, reaction_arrows
from bilayer_core.view.colouring import STRAIN, Colouring, choose_colouring
from bilayer_core.view.drawable import refuse_undrawable
from bilayer_core.view.layout import (
    CHANNEL_COLOURS,
    EVENTS,
    MIDDLE,
    TIMELINE,
    blueprint,
    energy_groups,
    entity_name,
    summary,
)
from bilayer_core.view.scales import Scales, choose_scales, middles_of
from bilayer_core.view.theme import (
    ARROW_COLOUR,
    BACKGROUND,
    BALL_COLOURS,
    JOINT_COLOURS,
    OBSTACLE_COLOURS,
    REACTION_COLOURS,
    SIDE_SHADE,
)

GROUND_COLOURS = ((74, 79, 88), (62, 66, 74), BACKGROUND)
CHUNK = 150  # frames in a chunk: chunks are what the viewer loads, caches and drops
LEGEND_HEIGHT = 14  # pixels of the colour bar
EVENT_COLOURS = {"flight": (255, 214, 90), "contact": (64, 224, 148), "stimulus": (255, 130, 110)}
PLAIN_COLOUR = (200, 204, 210)


def write_recording(run: RunData, rrd_path: str | Path, colour: str = STRAIN) -> None:
    """Write `run` to an ``.rrd`` file; InputError if it holds no frame, OSError if the file cannot be written.

    Parameters
    ----------
    run : RunData
    rrd_path : str or Path
    colour : str
        What the colours of rods say, from `colouring.QUANTITIES`.
    """
    refuse_undrawable(run, run.description.scene_name)
    scales, colouring = choose_scales(run), choose_colouring(run, colour)
    recording = rr.RecordingStream("bilayer_sim")
    memory = recording.memory_recording()  # rerun's own writer ends well where it has lost the end of a file
    recording.send_blueprint(blueprint(run, scales, colouring), make_active=False, make_default=True)
    _send(recording, run, scales, colouring)
    Path(rrd_path).write_bytes(memory.drain_as_bytes())
    recording.disconnect()


def _send(recording: rr.RecordingStream, run: RunData, scales: Scales, colouring: Colouring) -> None:
    """All of a run."""
    recording.send_recording_name(f"{run.description.scene_name}: {run.description.title}")
    recording.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    recording.log("summary", rr.TextDocument(summary(run, scales, colouring), media_type="text/markdown"), static=True)
    _log_legend(recording, colouring)
    log_obstacles(recording, run, scales)
    _send_strands(recording, run, colouring)
    send_bodies(recording, run, scales, "world/bodies")
    _send_middle(recording, run)
    _send_joints(recording, run)
    _send_arrows(recording, "world/contact_forces", ARROW_COLOUR, contact_arrows(run, scales), scales)
    for name, arrows in reaction_arrows(run, scales).items():
        _send_arrows(recording, f"world/{name}", REACTION_COLOURS[name], arrows, scales)
    _send_series(recording, run)
    _send_events(recording, run)


def _chunks(count: int):
    return (slice(first, min(first + CHUNK, count)) for first in range(0, count, CHUNK))


def _time(times: np.ndarray) -> list[rr.TimeColumn]:
    return [rr.TimeColumn(TIMELINE, duration=times)]


def _bytes(colours: np.ndarray) -> np.ndarray:
    """Colours from 0 to 1 as uint8."""
    return np.rint(colours * 255).astype(np.uint8)


def _log_legend(recording: rr.RecordingStream, colouring: Colouring) -> None:
    """The colour bar with its labels."""
    bar = np.tile(_bytes(colouring.colour_map[:, :3]), (LEGEND_HEIGHT, 1, 1))
    recording.log("legend", rr.Image(bar), static=True)
    steps = bar.shape[1]
    ticks = [[min(max(6.0, place * steps), steps - 6.0), LEGEND_HEIGHT + 8] for place, _ in colouring.ticks]
    texts = [text for _, text in colouring.ticks]
    labels = rr.Points2D(ticks, labels=texts, radii=0.01, colors=(200, 200, 200), show_labels=True)
    recording.log("legend/ticks", labels, static=True)


def log_obstacles(recording: rr.RecordingStream, run: RunData, scales: Scales) -> None:
    """Fixed surfaces."""
    for obstacle in run.description.obstacles:
        shape = obstacle.shape
        mesh = _plane(shape, scales) if shape.kind == "plane" else _mesh(geometry.shape_mesh(shape, OBSTACLE_COLOURS))
        recording.log(f"world/obstacles/{obstacle.name}", mesh, static=True)


def _plane(shape: ShapeInfo, scales: Scales) -> rr.Mesh3D:
    vertices, colours, triangles = geometry.plane_mesh(
        shape, scales.target, scales.size + 2 * scales.extent, scales.cell, GROUND_COLOURS
    )
    return rr.Mesh3D(vertex_positions=vertices, vertex_colors=colours, triangle_indices=triangles)


def _mesh(parts: geometry.Mesh) -> rr.Mesh3D:
    vertices, normals, colours, triangles = parts
    return rr.Mesh3D(
        vertex_positions=vertices, vertex_normals=normals, vertex_colors=colours, triangle_indices=triangles
    )


def _send_strands(recording: rr.RecordingStream, run: RunData, colouring: Colouring) -> None:
    for layer, rows in zip(run.description.layers, layer_rows(run.description), strict=True):
        path = f"world/strands/{layer.name}"
        positions, frames = run.positions[:, layer.nodes], run.material_frames[:, rows]
        nodes, values = positions.shape[1], colouring.values(run, layer)
        triangles = geometry.ribbon_triangles(nodes)
        recording.log(path, rr.Mesh3D.from_fields(triangle_indices=triangles), static=True)
        shade = np.where(np.arange(geometry.CORNERS) < geometry.WIDE_CORNERS, 1.0, SIDE_SHADE)[:, None]
        for part in _chunks(len(run.shape_times)):
            vertices = geometry.ribbon_vertices(layer, positions[part], frames[part])
            colours = _bytes(colouring.colours(values[part])[:, :, None, :3] * shade)
            sizes = [nodes * geometry.CORNERS] * len(vertices)
            recording.send_columns(
                path,
                _time(run.shape_times[part]),
                rr.Mesh3D.columns(
                    vertex_positions=vertices.reshape(-1, 3), vertex_colors=colours.reshape(-1, 3)
                ).partition(sizes),
            )


def send_bodies(recording: rr.RecordingStream, run: RunData, scales: Scales, under: str) -> None:
    """Bodies as they are; one without a surface has a pose alone."""
    for index, body in enumerate(run.description.bodies):
        path = f"{under}/{body.name}"
        if body.shape is not None:
            plane = body.shape.kind == "plane"
            shape = _plane(body.shape, scales) if plane else _mesh(geometry.shape_mesh(body.shape, BALL_COLOURS))
            recording.log(path, shape, static=True)
        for part in _chunks(len(run.times)):
            recording.send_columns(
                path,
                _time(run.times[part]),
                rr.Transform3D.columns(
                    translation=run.body_positions[part, index], quaternion=run.body_quaternions[part, index]
                ),
            )


def _send_middle(recording: rr.RecordingStream, run: RunData) -> None:
    """The middle of the rods, which the camera follows."""
    middles = middles_of(run)  # the viewer follows what it draws, and draws points of no size
    recording.log(MIDDLE, rr.Points3D.from_fields(radii=0.0), static=True)
    recording.send_columns(
        MIDDLE, _time(run.shape_times), rr.Points3D.columns(positions=middles).partition([1] * len(middles))
    )


def _send_joints(recording: rr.RecordingStream, run: RunData) -> None:
    """Joints and guides, each on the body that carries it."""
    for joint in run.description.joints:
        path = f"world/{joint.name}"
        recording.log(path, _mesh(geometry.shape_mesh(joint.shape, JOINT_COLOURS)), static=True)
        if joint.body < 0:
            continue
        for part in _chunks(len(run.times)):
            poses = run.body_positions[part, joint.body], run.body_quaternions[part, joint.body]
            moved = rr.Transform3D.columns(translation=poses[0], quaternion=poses[1])
            recording.send_columns(path, _time(run.times[part]), moved)


def _send_arrows(recording: rr.RecordingStream, path: str, colour: tuple, arrows: Arrows, scales: Scales) -> None:
    recording.log(path, rr.Arrows3D.from_fields(colors=colour, radii=0.005 * scales.size), static=True)
    shown = np.linalg.norm(arrows.forces, axis=2) > arrows.shown
    for part in _chunks(len(arrows.times)):
        which = shown[part]
        recording.send_columns(
            path,
            _time(arrows.times[part]),
            rr.Arrows3D.columns(
                origins=arrows.origins[part][which], vectors=arrows.forces[part][which] * arrows.metres_per_unit
            ).partition(which.sum(axis=1)),
        )


def _sizes(run: RunData, wrenches: np.ndarray) -> dict[str, np.ndarray]:
    """How large the forces on each body are that any acts on [N]."""
    return {
        f"on {body.name}": np.linalg.norm(wrenches[:, i, :3], axis=1)
        for i, body in enumerate(run.description.bodies)
        if wrenches[:, i].any()
    }


def _send_series(recording: rr.RecordingStream, run: RunData) -> None:
    """Curves: stimulus, forces of contact and of rods on each body, heights, energies, the solver's health."""
    groups: dict[str, dict[str, np.ndarray]] = {
        "stimulus": {name: run.stimulus[:, i] for i, name in enumerate(run.description.channels)},
        "contact_force": _sizes(run, run.contact_wrenches),
        "clamp_force": _sizes(run, run.clamp_wrenches),
        "height": {
            "robot": 1e3 * run.com[:, 2],
            **{
                body.name: 1e3 * run.body_positions[:, i, 2]
                for i, body in enumerate(run.description.bodies)
                if not body.prescribed
            },
        },
        **energy_groups(run),
        "solver": {"iterations per step": run.solver["iterations"] / np.maximum(run.solver["substeps"], 1)},
    }
    if np.isfinite(run.solver["min_gap"]).all():  # infinite where nothing can touch
        groups["solver"]["smallest gap [mm]"] = 1e3 * run.solver["min_gap"]
    for group, series in groups.items():
        for index, (name, values) in enumerate(series.items()):
            _send_curve(recording, f"plots/{group}", name, index, run.times, values)
    if run.contact_forces.any():
        # Forces that hold a body cancel in their sum; this shows how hard it is held.
        total = np.linalg.norm(run.contact_forces, axis=2).sum(axis=1)
        index = len(groups["contact_force"])
        _send_curve(recording, "plots/contact_force", "on nodes, sizes summed", index, run.shape_times, total)


def _send_events(recording: rr.RecordingStream, run: RunData) -> None:
    """What happened, as text."""
    if not run.events:
        return
    colours = [EVENT_COLOURS.get(event.name, PLAIN_COLOUR) for event in run.events]
    columns = rr.TextLog.columns(
        text=[event.text for event in run.events],
        level=[LEVEL_NAMES.get(event.level, "INFO") for event in run.events],
        color=colours,
    )
    recording.send_columns(EVENTS, _time(np.array([event.time for event in run.events])), columns)


def _send_curve(
    recording: rr.RecordingStream, group: str, name: str, index: int, times: np.ndarray, values: np.ndarray
) -> None:
    path = f"{group}/{entity_name(name)}"
    colour = CHANNEL_COLOURS[index % len(CHANNEL_COLOURS)]
    recording.log(path, rr.SeriesLines(names=name, colors=colour, widths=2), static=True)
    for part in _chunks(len(times)):
        recording.send_columns(path, _time(times[part]), rr.Scalars.columns(scalars=values[part]))
