"""Scales of a picture, chosen from the whole run so that they do not change while it plays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bilayer_core.log.run.run_data import RunData
from bilayer_core.view.geometry import rotated, shape_extent

_STEPS = np.array([1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 10.0])
SMALLEST_STRAIN = 1e-4
SMALLEST_SIZE = 1e-9  # of a robot [m]
ARROW_SHARE = 0.25  # length of the arrow of the reference force, in sizes of the robot
SHOWN_SHARE = 0.005  # forces below this share of the reference force have no arrow
VIEW_DIRECTION = np.array([0.62, -0.72, 0.30])  # from what is looked at to the eye
VIEW_SLOPE = 0.44  # the part of it that is filled
VIEW_ASPECT = 1.5  # width of the view over its height
ROOM = 1.15  # times as far as rods alone ask for: bodies and arrows are beside them
VIEW_FRAMES = 200  # how many frames of a run decide on the camera


def rounded_up(value: float) -> float:
    """Return the next number 1, 1.5, 2, 3, 4, 5, 6, 7, 8 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * _STEPS[np.searchsorted(_STEPS, value / power - 1e-9)])


@dataclass(frozen=True)
class Scales:
    """How quantities become lengths and colours."""

    strain_limit: float  # Strain of the fullest colours
    metres_per_newton: float  # Length of contact arrows
    shown_force: float  # Smallest force that has an arrow [N]
    size: float  # Of the robot at the start: the longest edge of its box [m]
    cell: float  # Edge of the squares on the ground [m]
    eye: np.ndarray
    target: np.ndarray
    """`eye`, `target`: from where to where a picture looks [m], shape (3,)."""
    extent: float  # Half the diagonal of the box of all that moves [m]


def choose_scales(run: RunData) -> Scales:
    """Return the scales that suit a run."""
    size = max(float(np.ptp(run.positions[0], axis=0).max()), SMALLEST_SIZE)
    strain = max(*(float(np.abs(run.strain_of(layer)).max()) for layer in run.description.layers), SMALLEST_STRAIN)
    reference = reference_of(run.contact_forces)
    metres_per_newton = 1.0 / rounded_up(reference / (ARROW_SHARE * size))
    every = slice(None, None, max(1, len(run.shape_times) // VIEW_FRAMES))
    seen = visible_points(run, every, slice(None), metres_per_newton)
    eye, target = place_eye(seen)
    extent = 0.5 * float(np.linalg.norm(np.ptp(seen, axis=0)))
    return Scales(
        strain_limit=rounded_up(strain),
        metres_per_newton=metres_per_newton,
        shown_force=SHOWN_SHARE * reference,
        size=size,
        cell=rounded_up(max(size, 0.5 * extent) / 8),  # of what goes far, small squares would flicker
        eye=eye,
        target=target,
        extent=extent,
    )


def middles_of(run: RunData) -> np.ndarray:
    """Return the middle of the box about the rods over time [m], shape (shapes, 3)."""
    of_rods = _of_rods(run)
    return 0.5 * (of_rods.min(axis=1) + of_rods.max(axis=1)).astype(float)


def place_moving_eye(run: RunData) -> tuple[np.ndarray, np.ndarray]:
    """Return the eye and what it looks at in the first frame, of one that then moves as the middle of the robot does:
    as near as the rods are in the picture all the time.
    """
    middles = middles_of(run)
    every = slice(None, None, max(1, len(middles) // VIEW_FRAMES))
    eye, target = place_eye((_of_rods(run) - middles[:, None])[every].reshape(-1, 3))
    return middles[0] + ROOM * (eye - target), middles[0]


def _of_rods(run: RunData) -> np.ndarray:
    return np.concatenate([run.positions[:, strand.nodes] for strand in run.description.strands], axis=1)


def reference_of(forces: np.ndarray) -> float:
    """Return the size by which to scale arrows, 1 if there are no forces.

    It is not the largest one: a few frames of impact would make all other arrows invisible. `forces`: [N] or [N m],
    shape (times, places, 3).
    """
    largest = np.linalg.norm(forces, axis=2).max(axis=1, initial=0.0)
    largest = largest[largest > 0.0]
    return float(np.percentile(largest, 95)) if len(largest) else 1.0


def visible_points(
    run: RunData, shapes: slice | np.ndarray, frames: slice | np.ndarray, metres_per_newton: float
) -> np.ndarray:
    """Return the points that a picture must hold: nodes, tips of arrows, boxes about bodies and obstacles [m], shape
    (points, 3).

    `shapes` and `frames` choose among `run.shape_times` and `run.times`.
    """
    positions = run.positions[shapes].reshape(-1, 3).astype(float)
    points = [positions, positions + metres_per_newton * run.contact_forces[shapes].reshape(-1, 3)]
    for index, body in enumerate(run.description.bodies):
        corners = shape_extent(body.shape) if body.shape else np.zeros((1, 3))
        axes = [rotated(run.body_quaternions[frames, index], axis) for axis in range(3)]
        placed = run.body_positions[frames, index][:, None] + np.einsum("atj,ca->tcj", axes, corners)
        points.append(placed.reshape(-1, 3))
    points += [shape_extent(o.shape) for o in run.description.obstacles if o.shape.kind != "plane"]
    return np.concatenate(points)


def _picture_axes(back: np.ndarray) -> np.ndarray:
    """Return the unit vectors to the right, upwards and towards the eye, as rows; z is up in the picture."""
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(back, right), back])


def place_eye(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the nearest place along `VIEW_DIRECTION` from which all `points` are in the picture, and what it looks at.

    Parameters
    ----------
    points : ndarray
        [m], shape (points, 3).

    Returns
    -------
    eye, target : ndarray
        [m], shape (3,).
    """
    back = VIEW_DIRECTION / np.linalg.norm(VIEW_DIRECTION)
    axes = _picture_axes(back)
    seen = points @ axes.T
    middle = 0.5 * (seen.min(axis=0) + seen.max(axis=0))
    for _ in range(3):  # near points spread more than far ones: centre what is seen, not what is there
        offset = np.abs(seen - middle)
        needed = np.maximum(offset[:, 0] / VIEW_ASPECT, offset[:, 1]) / VIEW_SLOPE + seen[:, 2] - middle[2]
        distance = needed.max()
        slopes = (seen - middle)[:, :2] / (distance + middle[2] - seen[:, 2:])
        middle[:2] += 0.5 * distance * (slopes.min(axis=0) + slopes.max(axis=0))
    target = middle @ axes
    return target + distance * back, target
