"""Scales of a picture, chosen from the whole run so that they do not change while it plays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bilayer_core.record.run_data import RunData

_STEPS = np.array([1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0])
SMALLEST_STRAIN = 1e-4
ARROW_SHARE = 0.25  # length of the arrow of the reference force, in sizes of the robot
SHOWN_SHARE = 0.005  # forces below this share of the reference force have no arrow
VIEW_DIRECTION = np.array([0.62, -0.72, 0.30])  # from what is looked at to the eye
VIEW_DISTANCE = 1.18  # in diagonals of the box that is framed; fits the viewer's field of view


def rounded_up(value: float) -> float:
    """The next number 1, 1.5, 2, 3, 4, 5, 6, 8 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * _STEPS[np.searchsorted(_STEPS, value / power - 1e-9)])


@dataclass(frozen=True)
class Scales:
    """How quantities become lengths and colours.

    Attributes
    ----------
    strain_limit : float
        Strain of the fullest colours.
    metres_per_newton : float
        Length of contact arrows.
    shown_force : float
        Smallest force that has an arrow [N].
    size : float
        Of the robot at the start: the longest edge of its box [m].
    cell : float
        Edge of the squares on the ground [m].
    eye, target : ndarray
        From where to where a picture looks [m], shape (3,).
    extent : float
        Half the diagonal of all that moves [m].
    """

    strain_limit: float
    metres_per_newton: float
    shown_force: float
    size: float
    cell: float
    eye: np.ndarray
    target: np.ndarray
    extent: float


def choose_scales(run: RunData) -> Scales:
    """Scales that suit a run."""
    size = float(np.ptp(run.positions[0], axis=0).max())
    strain = max(float(np.abs(run.strain).max()), SMALLEST_STRAIN)
    # A few frames of impact would make all other arrows invisible.
    largest = np.linalg.norm(run.contact_forces, axis=2).max(axis=1)
    largest = largest[largest > 0]
    reference = float(np.percentile(largest, 95)) if len(largest) else 1.0
    lower, upper = run.positions.min(axis=(0, 1)).astype(float), run.positions.max(axis=(0, 1)).astype(float)
    for index, body in enumerate(run.description.bodies):
        lower = np.minimum(lower, run.body_positions[:, index].min(axis=0) - body.radius)
        upper = np.maximum(upper, run.body_positions[:, index].max(axis=0) + body.radius)
    target, diagonal = 0.5 * (lower + upper), float(np.linalg.norm(upper - lower))
    direction = VIEW_DIRECTION / np.linalg.norm(VIEW_DIRECTION)
    return Scales(
        strain_limit=rounded_up(strain),
        metres_per_newton=1.0 / rounded_up(reference / (ARROW_SHARE * size)),
        shown_force=SHOWN_SHARE * reference,
        size=size,
        cell=rounded_up(size / 8),
        eye=target + VIEW_DISTANCE * diagonal * direction,
        target=target,
        extent=0.5 * diagonal,
    )
