"""Motions that hinges, rails and joints leave free and that have a spring, damping, friction or limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bilayer_core.scene.body import Guided
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.joint import Joint
from bilayer_core.scene.mechanism import Sliding, Turning

WORLD = ""
"""Name of the first body where a guide is fixed in the world."""


@dataclass(frozen=True)
class Mechanism:
    """The turn, or the way, of a second body against a first one about, or along, an axis of the first.

    Attributes
    ----------
    owner : str
        Name of the joint, or of the guided body.
    first, second : str
        Names of the bodies; the first is `WORLD` for a guide.
    point, axis : tuple of float
        At the start, in the world [m], unit.
    law : Turning or Sliding
    """

    owner: str
    first: str
    second: str
    point: tuple[float, float, float]
    axis: tuple[float, float, float]
    law: Turning | Sliding

    @property
    def slides(self) -> bool:
        """True if the motion is a way [m] instead of an angle [rad]."""
        return isinstance(self.law, Sliding)

    @property
    def is_guide(self) -> bool:
        """True if it is the hinge or the rail of a guided body."""
        return self.first == WORLD

    @property
    def dissipates(self) -> bool:
        """True if it has damping or friction."""
        return self.law.damping > 0.0 or self.law.friction > 0.0


def mechanisms_of(scene: SceneConfig) -> tuple[Mechanism, ...]:
    """Return the mechanisms of joints, then those of guided bodies; of each first its turn."""
    found = []
    for joint in scene.joints:
        found += [Mechanism(joint.name, *joint.bodies, joint.point, joint.axis, law) for law in _laws(joint)]
    for body in scene.bodies:
        motion = body.motion
        if isinstance(motion, Guided):
            for law in _laws(motion):
                axis = motion.axis if isinstance(law, Sliding) else motion.hinge
                found.append(Mechanism(body.name, WORLD, body.name, body.position, axis, law))
    return tuple(found)


def _laws(part: Joint | Guided) -> list[Turning | Sliding]:
    return [law for law in (part.turning, part.sliding) if law is not None]


def start_rates(scene: SceneConfig, velocity: np.ndarray, angular_velocity: np.ndarray) -> np.ndarray:
    """Return the rates at the start of all mechanisms [rad/s, m/s], shape (n_mechanism,).

    Parameters
    ----------
    scene : SceneConfig
    velocity, angular_velocity : ndarray
        Of bodies [m/s, rad/s], shape (n_body, 3).
    """
    places = {body.name: index for index, body in enumerate(scene.bodies)}
    rates = []
    for mechanism in mechanisms_of(scene):
        rate = np.zeros(3)
        for sign, name in ((-1.0, mechanism.first), (1.0, mechanism.second)):
            if name != WORLD:
                b = places[name]
                arm = np.array(mechanism.point) - np.array(scene.bodies[b].position)
                moved = velocity[b] + np.cross(angular_velocity[b], arm)
                rate += sign * (moved if mechanism.slides else angular_velocity[b])
        rates.append(rate @ np.array(mechanism.axis))
    return np.array(rates, dtype=float)
