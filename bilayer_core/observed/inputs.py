"""Inputs that act on a run from outside, each with the step from which it acts: enough to make the same steps again.

============ ========================================== ================================================================
kind         values                                     from
============ ========================================== ================================================================
``stimulus`` value in its unit, over [s], 1 if smooth   `Simulator.set_stimulus`
``load``     factor, over [s], 1 if smooth              `Simulator.set_load`
``pose``     position [m], quaternion, least time [s]   `Simulator.set_pose`
``friction`` coefficient                                `Simulator.set_friction`
``until``    time [s]                                   whoever makes steps: where adaptive ones must end
``reset``    none                                       `Simulator.reset`
============ ========================================== ================================================================

NaN stands for what is not given: of a stimulus or a load, its schedule acts again, of friction the scene's coefficient.
Linear ramps have no third value; logs of earlier versions have no ``over``, which is 0 then: a jump.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

Values = Sequence[float]
STIMULUS, LOAD, POSE, FRICTION, UNTIL, RESET = "stimulus", "load", "pose", "friction", "until", "reset"
SIZES = {STIMULUS: 3, LOAD: 3, POSE: 8, FRICTION: 1, UNTIL: 1, RESET: 0}
"""Number of values of each kind."""
OPTIONAL = {STIMULUS: 2, LOAD: 2}
"""How many of them may be missing, from the last on."""
LINEAR, SMOOTH = "linear", "smooth"
SHAPES = (LINEAR, SMOOTH)
"""Of ramps."""
POSITION, QUATERNION, OVER = slice(0, 3), slice(3, 7), 7
"""Values of a pose."""


class Acted(Protocol):
    """Object that inputs act on: a `Simulator`."""

    def set_stimulus(self, channel: str, value: float | None, *, over: float, shape: str) -> None: ...

    def set_load(self, name: str, factor: float | None, *, over: float, shape: str) -> None: ...

    def set_pose(self, name: str, position: Values | None, quaternion: Values | None, *, over: float) -> None: ...

    def set_friction(self, value: float | None, key: str) -> None: ...


@dataclass(frozen=True)
class Input:
    """Something that acts from a step on.

    Attributes
    ----------
    step : int
        Number of steps done before.
    time : float
        At the end of the last of them [s].
    kind : str
    name : str
        Of the channel, load, body or coefficient; empty for others.
    values : tuple of float
    """

    step: int
    time: float
    kind: str
    name: str = ""
    values: tuple[float, ...] = ()

    def apply(self, simulator: Acted) -> None:
        """Repeat the input on a simulator. Ends of steps are left to the caller that makes steps.

        Parameters
        ----------
        simulator : Simulator
        """
        match self.kind:
            case "stimulus":
                simulator.set_stimulus(self.name, _given(self.values[0]), **self._ramp)
            case "load":
                simulator.set_load(self.name, _given(self.values[0]), **self._ramp)
            case "friction":
                simulator.set_friction(_given(self.values[0]), self.name)
            case "pose":
                position, quaternion = self.values[POSITION], self.values[QUATERNION]
                simulator.set_pose(
                    self.name,
                    None if math.isnan(position[0]) else position,
                    None if math.isnan(quaternion[0]) else quaternion,
                    over=self.values[OVER],
                )

    @property
    def _ramp(self) -> dict[str, Any]:
        """By what ramp a stimulus or a load gets there."""
        over, smooth = (*self.values[1:], 0.0, 0.0)[:2]
        return {"over": over, "shape": SMOOTH if smooth else LINEAR}


def values_of_ramp(over: float, shape: str) -> tuple[float, ...]:
    """Return the values of a ramp as it was requested, after the one that it leads to."""
    return (float(over), 1.0) if shape == SMOOTH else (float(over),)


def values_of_pose(position: Values | None, quaternion: Values | None, over: float) -> tuple[float, ...]:
    """Return the values of a pose as it was requested."""
    at = (math.nan,) * 3 if position is None else tuple(map(float, position))
    turned = (math.nan,) * 4 if quaternion is None else tuple(map(float, quaternion))
    return (*at, *turned, float(over))


def _given(value: float) -> float | None:
    return None if math.isnan(value) else value
