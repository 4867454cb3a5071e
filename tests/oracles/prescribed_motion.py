"""Where prescribed bodies are, and how fast, by numpy: what the engine's paths are compared with."""

import numpy as np

from bilayer_core.kinematics.rotation import rotation_matrix


def angular_velocity(vector: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Angular velocity [rad/s] of exp([v]×) while its rotation vector v [rad] changes at a rate [rad/s], shape (3,).

    ω = v̇ + (1 − cos θ)/θ² v × v̇ + (θ − sin θ)/θ³ v × (v × v̇),   θ = |v|
    """
    angle2 = float(vector @ vector)
    if angle2 < 1e-8:
        a, b = 0.5 - angle2 / 24.0, 1.0 / 6.0 - angle2 / 120.0
    else:
        angle = np.sqrt(angle2)
        a, b = (1.0 - np.cos(angle)) / angle2, (1.0 - np.sin(angle) / angle) / angle2
    across = np.cross(vector, rate)
    return rate + a * across + b * np.cross(vector, across)


def keyframes_about(times, values, time):
    """Time of the keyframe before `time`, time until the next [s], value there, way to the next, shape (3,) each;
    the way is zero before the first, after the last, and without any.
    """
    if len(times) == 0 or len(values) == 0:
        return 0.0, 1.0, np.zeros(3), np.zeros(3)
    right = int(np.searchsorted(times, time, side="right"))
    if right in (0, len(times)):
        return 0.0, 1.0, values[max(right - 1, 0)], np.zeros(3)
    begin = float(times[right - 1])
    return begin, float(times[right]) - begin, values[right - 1], values[right] - values[right - 1]


def between_keyframes(times, values, time):
    """Value and rate of a schedule of vectors: cubic smoothstep between keyframes, constant outside them; (3,) each."""
    begin, duration, value, way = keyframes_about(times, values, time)
    s = (time - begin) / duration
    return value + s * s * (3.0 - 2.0 * s) * way, 6.0 * s * (1.0 - s) / duration * way


def scheduled_motion(model, index, time):
    """Position [m], shape (3,), and rotation of a prescribed body, shape (3, 3), with velocity and angular velocity
    [m/s, rad/s], shape (6,).
    """
    bodies, motion, rates = model.bodies, model.scene.bodies[index].motion, np.zeros(6)
    times, displacements, rotations = map(np.array, (motion.times, motion.displacements, motion.rotations))
    moved, rates[:3] = between_keyframes(times, displacements, time)
    position = bodies.start_position[index] + moved
    if not len(rotations):
        return position, bodies.start_rotation[index], rates
    turn, rate = between_keyframes(times, rotations, time)
    rates[3:] = angular_velocity(turn, rate)
    return position, rotation_matrix(turn) @ bodies.start_rotation[index], rates
