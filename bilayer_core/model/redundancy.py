"""Redundant joints, which hold what others hold already, and joints that cannot follow the motions a scene prescribes.

A joint allows velocities (V, ω) of its bodies with

    e·(V_A + ω_A × ρ_A − V_B − ω_B × ρ_B) = 0    e: three directions, on a slide or a cylinder the two across its axis
    f·(ω_A − ω_B) = 0                            f: the two across the axis of a hinge or a cylinder, all of a slide or
                                                 a weld, and a × b of a universal joint

at the start. Rows of these equations, by the motions that the bodies are free to make, which depend on those of joints
before are redundant: stiff springs share the load there as their stiffness, and no equilibrium, has it. (The hinges of
a closed chain of rigid bodies are, in space, the textbook's case: a fourth parallel hinge holds three motions that were
held.) With velocities of prescribed bodies on the right-hand side they have a solution unless joints contradict the
prescribed motion; it is asked for at the start of the first motion, to first order. Rods bend and count as no
constraint.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bilayer_core.errors import SceneError
from bilayer_core.model.bodies import guided_motions
from bilayer_core.model.findings import Finding, few
from bilayer_core.model.plane import Plane
from bilayer_core.scene.body import Body, Guided, Prescribed
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.joint import SLIDES, TURNS, Joint

Array = np.ndarray
DEPENDENT = 1e-7
"""Largest singular value of rows that count as dependent, and of what a motion may miss, as parts of 1."""


class _Constraints:
    """Rows of all joints, lengths divided by the longest rod.

    Attributes
    ----------
    rows : list of Array
        Of each joint, by the motions of all bodies, shape (·, 6 n_body).
    free : Array
        Motions that bodies are free to make, a column each, shape (6 n_body, ·).
    """

    def __init__(self, scene: SceneConfig, plane: Plane | None):
        self._motions = np.eye(6) if plane is None else plane.motions
        self._length = max(rod.path.length for rod in scene.rods)
        self._places = {body.name: index for index, body in enumerate(scene.bodies)}
        self.rows = [self._rows(scene, joint) for joint in scene.joints]
        columns = [np.zeros((6 * len(scene.bodies), 0))]
        for index, body in enumerate(scene.bodies):
            own = self._freedom(body)
            columns.append(np.zeros((6 * len(scene.bodies), own.shape[1])))
            columns[-1][6 * index : 6 * index + 6] = own
        self.free = np.hstack(columns)

    def _freedom(self, body: Body) -> Array:
        if isinstance(body.motion, Prescribed):
            return np.zeros((6, 0))
        return guided_motions(body.motion, self._motions) if isinstance(body.motion, Guided) else self._motions

    def _rows(self, scene: SceneConfig, joint: Joint) -> Array:
        turns, ways = _held_turns(joint), _across(joint.axis) if joint.type in SLIDES else np.eye(3)
        rows = np.zeros((len(ways) + len(turns), 6 * len(scene.bodies)))
        for sign, name in zip((1.0, -1.0), joint.bodies, strict=True):
            index = self._places[name]
            arm = (np.array(joint.point) - np.array(scene.bodies[index].position)) / self._length
            own = rows[:, 6 * index : 6 * index + 6]
            own[: len(ways), :3], own[: len(ways), 3:] = sign * ways, sign * np.cross(arm, ways)
            own[len(ways) :, 3:] = sign * turns
        return rows

    def rank_alone(self, number: int, joint: Joint) -> int:
        """Return how many motions a joint prevents, of two bodies that are free."""
        parts = [slice(6 * index, 6 * index + 6) for index in (self._places[name] for name in joint.bodies)]
        return _rank(np.hstack([self.rows[number][:, part] @ self._motions for part in parts]))

    def velocities(self, scene: SceneConfig) -> tuple[float, Array]:
        """Return when the first prescribed motion begins [s], infinity if none does, and in which proportion bodies
        move then, shape (6 n_body,).
        """
        begins = [_first_motion(body, self._length) for body in scene.bodies]
        start = min((begin for begin, _ in begins), default=np.inf)
        rates = [rate if begin == start else 0.0 * rate for begin, rate in begins]
        return start, np.concatenate([np.zeros(0), *rates])


def _across(axis: tuple[float, float, float]) -> Array:
    """Return two directions across an axis, shape (2, 3)."""
    first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(axis, first)])


def _held_turns(joint: Joint) -> Array:
    if joint.type in TURNS:
        return _across(joint.axis)
    if joint.type == "universal":
        return np.cross(joint.axis, joint.second_axis)[None]
    return np.zeros((0, 3)) if joint.type == "pin" else np.eye(3)


def _rank(rows: Array) -> int:
    return int(np.linalg.matrix_rank(rows, tol=DEPENDENT)) if rows.size else 0


def _first_motion(body: Body, length: float) -> tuple[float, Array]:
    """Return when a body begins to move, infinity if it never does, and its velocity and angular velocity just after,
    but for a factor that all bodies share.
    """
    motion = body.motion
    if isinstance(motion, Prescribed):
        count = len(motion.times)
        ways = np.array(motion.displacements or np.zeros((count, 3)), dtype=float).reshape(count, 3) / length
        turns = np.array(motion.rotations or np.zeros((count, 3)), dtype=float).reshape(count, 3)
        poses = np.hstack([ways, turns])
        for k in range(count - 1):
            change = poses[k + 1] - poses[k]
            if change.any():
                return motion.times[k], change / (motion.times[k + 1] - motion.times[k]) ** 2
    return np.inf, np.zeros(6)


def redundant_joints(scene: SceneConfig, plane: Plane | None) -> Iterator[Finding]:
    """Yield the joints that hold what joints before them, or guides, hold already; `plane` is that of dimension 2."""
    if not scene.joints:
        return
    constraints, owners = _Constraints(scene, plane), []
    before = np.zeros((0, constraints.free.shape[1]))
    for number, joint in enumerate(scene.joints):
        rows, alone = constraints.rows[number] @ constraints.free, constraints.rank_alone(number, joint)
        basis = _basis(before)
        left = rows - (rows @ basis) @ basis.T
        held = alone - _rank(left)
        if held > 0:
            with_whom = _partners(rows, left, before, owners) or "guides of its bodies"
            yield Finding(
                kind=f"redundant {held} of {alone} with {with_whom}",
                where=f"joints.{joint.name}",
                after=f": {held} of the {alone} motions that it prevents are prevented already, by {with_whom}: "
                "how they share a load depends on their `stiffness` alone; a type that leaves more free would do",
            )
        before = np.vstack([before, rows])
        owners += [joint.name] * len(rows)


def _basis(rows: Array) -> Array:
    """Return an orthonormal basis of the space of some rows, shape (·, rank)."""
    if not rows.size:
        return np.zeros((rows.shape[1], 0))
    _, sizes, directions = np.linalg.svd(rows, full_matrices=False)
    return directions[sizes > DEPENDENT].T


def _partners(rows: Array, left: Array, before: Array, owners: list[str]) -> str:
    """Return the joints on whose rows the rows of a joint depend, as text."""
    combinations, sizes, _ = np.linalg.svd(left)
    sizes = np.concatenate([sizes, np.zeros(len(combinations) - len(sizes))])
    dependent = combinations[:, sizes <= DEPENDENT].T @ rows
    if not before.size:
        return ""
    shares = np.abs(np.linalg.lstsq(before.T, dependent.T, rcond=DEPENDENT)[0]).max(axis=1)
    names = dict.fromkeys(name for name, share in zip(owners, shares, strict=True) if share > DEPENDENT)
    return few([f"joints.{name}" for name in names], 4) if names else ""


def require_possible_motion(scene: SceneConfig) -> None:
    """Refuse joints that contradict the motion of prescribed bodies.

    Raises
    ------
    SceneError
    """
    if not scene.joints:
        return
    constraints = _Constraints(scene, None)
    start, velocities = constraints.velocities(scene)
    if not np.isfinite(start):
        return
    asked = np.concatenate([rows @ velocities for rows in constraints.rows])
    rows = np.vstack(constraints.rows) @ constraints.free
    answer = np.linalg.lstsq(rows, -asked, rcond=DEPENDENT)[0] if rows.shape[1] else np.zeros(0)
    missed = np.abs(rows @ answer + asked)
    owners = [joint.name for joint, own in zip(scene.joints, constraints.rows, strict=True) for _ in own]
    size = np.abs(velocities).max()
    names = dict.fromkeys(name for name, error in zip(owners, missed, strict=True) if error > 1e-6 * size)
    if names:
        moving = [body.name for body in scene.bodies if isinstance(body.motion, Prescribed) and body.motion.moves]
        raise SceneError(
            f"{scene.name}: {few([f'joints.{name}' for name in names], 4)}: cannot follow the prescribed motion of "
            f"{few(moving)} from {start:g} s on, with the other bodies as they are held; allowed is a motion that "
            "joints leave free, or joints of a type that leaves it free"
        )
