"""What friction dissipates along a straight step, from the slip paths of its contacts (`forces.friction_limit`)."""

import numpy as np


def dissipation(way, fraction, threshold):
    """Σ D [J] at a fraction of the step."""
    forward, side = way[:, 0] + fraction * way[:, 1], way[:, 2] + fraction * way[:, 3]
    coefficient = np.where(forward >= 0.0, way[:, 4], way[:, 5])
    speed = np.sqrt(coefficient * forward**2 + way[:, 6] * side**2) / way[:, 8]
    w = speed / threshold
    potential = np.where(w < 1.0, speed * w * (1.0 - w / 3.0), speed - threshold / 3.0)
    return float((way[:, 7] * way[:, 8] * potential).sum())
