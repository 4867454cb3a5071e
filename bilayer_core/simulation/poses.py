"""How a body goes to a pose that a controller asks for.

From its present position x₀ and velocity v₀ to rest at x₁, after a time T, along the cubic

    x(s) = x₀ + (3 s² − 2 s³) (x₁ − x₀) + T s (1 − s)² v₀,   s = t/T

and likewise with exp([θ(s)]×) R₀, θ from 0 at the rate ω₀ to the rotation vector of R₁ R₀ᵀ (less than half a turn).
Goals that follow each other so give a continuous velocity, and one that moves steadily is followed with a lag of ⅔ T.
T is the least time that is asked for, or as much longer as the limits of speed demand. |dθ/dt| is no less than the
angular velocity: the map from one to the other shortens.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.kinematics.rotation import matrix_from_quaternion, quaternion_from_matrix, rotation_matrix
from bilayer_core.model.model import Model
from bilayer_core.model.state import OUT_OF_PLANE, POSE_GOAL, State
from bilayer_core.scene.body import Prescribed
from bilayer_core.scene.spans import ROUNDING

Array = np.ndarray
BEGIN, DURATION = 0, 1
POSITION, VELOCITY, MOVE = slice(2, 5), slice(5, 8), slice(8, 11)
ROTATION, SPIN, ROTATION_VECTOR = slice(11, 20), slice(20, 23), slice(23, 26)
"""Parts of a goal: when it begins and how long it takes [s], x₀, v₀, x₁ − x₀, R₀ row by row, ω₀, θ₁."""
INSTANTS = np.linspace(0.0, 1.0, 65)
"""Of a path at which its speed is looked at: it is a quadratic, off by 1e-4 of its largest value between them."""
LEAST_TIME = 0.1
"""Without any other [s]."""
SAME = 1e-12
"""Two poses that differ by less are one [m, rad]."""


def goal_of(
    time: float,
    over: float,
    pose: tuple[Array, Array],
    rates: tuple[Array, Array],
    target: tuple[Array, Array],
    limits: tuple[float, float],
) -> Array:
    """Return a goal as in `State.pose_goal`.

    Parameters
    ----------
    time, over : float
        When it begins, and how long it takes at least [s].
    pose, target : tuple of Array
        Position [m] and rotation matrix now, and to be reached.
    rates : tuple of Array
        Velocity [m/s] and angular velocity [rad/s] now.
    limits : tuple of float
        Top speed [m/s] and angular speed [rad/s]; what must not move at all is at its target.
    """
    moves = target[0] - pose[0], rotation_vector_between(pose[1], target[1])
    goal = np.zeros(POSE_GOAL)
    duration = over
    for move, rate, limit in zip(moves, rates, limits, strict=True):
        duration = max(duration, _least_duration(move, rate, limit, over))
    goal[BEGIN], goal[DURATION] = time, duration
    goal[POSITION], goal[VELOCITY], goal[MOVE] = pose[0], rates[0], moves[0]
    goal[ROTATION], goal[SPIN], goal[ROTATION_VECTOR] = pose[1].ravel(), rates[1], moves[1]
    return goal


def new_goal(
    model: Model,
    state: State,
    name: str,
    position: Sequence[float] | None,
    quaternion: Sequence[float] | None,
    over: float,
) -> tuple[int, Array] | None:
    """Return the index of a body among the controlled ones and its new goal, None if it has that already.

    Raises
    ------
    InputError
        See `Simulator.set_pose`.
    """
    index, k, motion = _controlled_body(model, name)
    if position is None and quaternion is None:
        raise InputError(f"pose of body {name!r}: needs a position, a quaternion, or both")
    if not (math.isfinite(over) and over > 0.0):
        raise InputError(f"pose of body {name!r}: a time of {over} s is not allowed; it must be above 0")
    now = state.body_position[index], state.body_rotation[index]
    aim_position, aim_rotation = _aim(state.pose_goal[k], now)
    target_position, target_rotation = aim_position, aim_rotation
    if position is not None:
        target_position = _numbers(name, "position", position, 3)
    if quaternion is not None:
        parts = _numbers(name, "quaternion", quaternion, 4)
        if not np.any(parts):
            raise InputError(f"pose of body {name!r}: quaternion [0, 0, 0, 0] is none; its length must be above 0")
        target_rotation = matrix_from_quaternion(parts)
    change = target_position - aim_position
    turn = rotation_vector_between(aim_rotation, target_rotation)
    for key, of, verb in (("top_speed", change, "moved"), ("top_angular_speed", turn, "turned")):
        if getattr(motion, key) is None and np.abs(of).max() > ROUNDING:
            allow = f"give `bodies.{name}.motion.{key}` to allow it"
            raise InputError(f"pose of body {name!r}: it must not be {verb} from outside; {allow}")
    _refuse_out_of_plane(model, index, name, target_position, target_rotation)
    present = state.pose_goal[k]
    if present[DURATION] > 0.0 and np.abs(change).max() <= SAME and np.abs(turn).max() <= SAME:
        return None
    limits = motion.top_speed or 0.0, motion.top_angular_speed or 0.0
    rates = state.body_velocity[index], state.body_angular_velocity[index]
    return k, goal_of(float(state.time[0]), over, now, rates, (target_position, target_rotation), limits)


def _controlled_body(model: Model, name: str) -> tuple[int, int, Prescribed]:
    """Return the index of a body, its index among the controlled ones, and its motion."""
    bodies, scene = model.bodies, model.scene
    if name not in bodies.names:
        known = ", ".join(bodies.names) or "none"
        raise InputError(f"pose of body {name!r}: no such body; the scene {scene.name!r} has: {known}")
    index = bodies.names.index(name)
    motion = scene.bodies[index].motion
    if not isinstance(motion, Prescribed):
        raise InputError(f"pose of body {name!r}: it is a {motion.describe()}; only prescribed bodies have set poses")
    if not motion.controlled:
        raise InputError(
            f"pose of body {name!r}: nothing may move it from outside; give `bodies.{name}.motion.top_speed` "
            "or `.top_angular_speed` to allow it"
        )
    return index, bodies.controlled.tolist().index(index), motion


def _aim(goal: Array, now: tuple[Array, Array]) -> tuple[Array, Array]:
    """Return where a body is going, or is if it has no goal: position and rotation matrix."""
    if goal[DURATION] == 0.0:
        return now
    return goal[POSITION] + goal[MOVE], rotation_matrix(goal[ROTATION_VECTOR]) @ goal[ROTATION].reshape(3, 3)


def _numbers(name: str, key: str, values: Sequence[float], count: int) -> Array:
    numbers = np.asarray(values, dtype=float)
    if numbers.shape != (count,) or not np.all(np.isfinite(numbers)):
        text = f"{key} {list(values)} is not allowed; it must be {count} finite numbers"
        raise InputError(f"pose of body {name!r}: {text}")
    return numbers


def _refuse_out_of_plane(model: Model, index: int, name: str, position: Array, rotation: Array) -> None:
    """Raise InputError if a pose is none of a model of dimension 2."""
    if not model.plane.exists:
        return
    normal, start = model.plane.normal, model.bodies
    away = abs(float((position - start.start_position[index]) @ normal))
    tilt = float(np.linalg.norm(rotation @ start.start_rotation[index].T @ normal - normal))
    if max(away, tilt) > OUT_OF_PLANE:
        raise InputError(
            f"pose of body {name!r}: it leaves the plane of the scene (by {away:.3g} m and {tilt:.3g} rad); "
            "allowed with dimension 3"
        )


def rotation_vector_between(first: Array, last: Array) -> Array:
    """Return the rotation vector of last firstᵀ [rad], by half a turn at most, shape (3,)."""
    quaternion = quaternion_from_matrix(last @ first.T)
    sine = float(np.linalg.norm(quaternion[:3]))
    if sine == 0.0:
        return np.zeros(3)
    return 2.0 * math.atan2(sine, quaternion[3]) / sine * quaternion[:3]


def _least_duration(move: Array, rate: Array, limit: float, over: float) -> float:
    """Return the shortest duration [s] from `over` up for which the speed stays within a limit or its initial value."""
    allowed = (1.0 + ROUNDING) * max(limit, float(np.linalg.norm(rate)))

    def too_fast(duration: float) -> bool:
        s = INSTANTS[:, None]
        speed = 6.0 * s * (1.0 - s) * move / duration + (1.0 - s) * (1.0 - 3.0 * s) * rate
        return float(np.linalg.norm(speed, axis=1).max()) > allowed

    if not too_fast(over):
        return over
    short = long = over
    while too_fast(long):
        short, long = long, 2.0 * long
    while long - short > 1e-6 * long:
        middle = 0.5 * (short + long)
        short, long = (middle, long) if too_fast(middle) else (short, middle)
    return long
