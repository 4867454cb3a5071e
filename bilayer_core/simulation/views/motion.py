"""Motions of hinges, rails and joints along or about their axis."""

from __future__ import annotations

from dataclasses import dataclass

from bilayer_core.forces.mechanisms import REMEMBERED
from bilayer_core.simulation.views.present import Present


@dataclass(frozen=True)
class Motion:
    """Motion of a hinge, a rail or a joint along or about its axis, where something resists it.

    Attributes
    ----------
    value : float
        Angle since the start, whole turns too [rad], or way along the axis [m].
    exerted : float
        Moment about the axis [N m], or force along it [N], of spring, damping, friction and limits together, on the
        guided body or the second body of the joint.
    beyond : float
        Largest angle or way beyond a limit at the end of any step [rad, m].
    """

    value: float
    exerted: float
    beyond: float


def motion_of(present: Present, owner: str, slides: bool, guides: bool) -> Motion | None:
    wanted = owner, guides, slides
    slots = (k for k, of in enumerate(present.model.mechanisms) if (of.owner, of.is_guide, of.slides) == wanted)
    index = next(slots, None)
    if index is None:
        return None
    mechanisms = present.evaluated().engine.mechanisms
    first, gradient, axis = mechanisms.body[2 * index], -mechanisms.gradient[2 * index + 1], mechanisms.axis[index]
    if first < len(present.state.body_rotation):  # not the world
        axis = present.state.body_rotation[first] @ axis
    exerted = (gradient[:3] if slides else gradient[3:]) @ axis
    beyond = present.state.memory[mechanisms.memory[0] + REMEMBERED * index + 1]
    return Motion(float(mechanisms.value[index]), float(exerted), float(beyond))
