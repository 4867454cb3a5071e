"""When stimuli, loads and prescribed bodies have corners and jumps: adaptive steps end there."""

from __future__ import annotations

import math

import numpy as np

from ..scene.body import Prescribed
from ..scene.config import SceneConfig


class Breakpoints:
    """Those of a scene."""

    def __init__(self, scene: SceneConfig):
        self._channels = [channel.schedule for channel in scene.stimuli.values()]
        paths = [body.motion for body in scene.bodies if isinstance(body.motion, Prescribed)]
        self._others = [*scene.loads, *paths]

    def after(self, time: float, override: np.ndarray) -> float:
        """The first after `time` [s], infinity if there is none.

        Parameters
        ----------
        time : float
        override : ndarray
            Values of channels set from outside, NaN where the schedule acts (`State.override`).
        """
        acting = [schedule for schedule, value in zip(self._channels, override, strict=True) if math.isnan(value)]
        return min((part.breakpoint_after(time) for part in (*acting, *self._others)), default=math.inf)
