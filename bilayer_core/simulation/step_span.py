"""The span of a step, and the frames that lie in it: interpolated between the two states at its ends, without a solve.

**Places.** A cubic takes positions q and velocities v from one end to the other. With s from 0 to 1 over the step of
length h, and D = q₁ − q₀,

    q(s) = q₀ + s D + s (1 − s)² (h v₀ − D) − s² (1 − s) (h v₁ − D),    v(s) = q̇(s)

Its error is h⁴ q⁗/384 beside that of the step itself, which is of order h² or h³, so it keeps the order of every
integrator there is, whatever its stages were. Material directors are carried from tangent to tangent and turned about
the last one by such a cubic of the edge's turn; bodies turn by a cubic of the rotation vector from the first pose.
So frames stay orthonormal, and at both ends all is as the step left it.

**Forces**, strains, curvatures, angles and ways of joints, energies and gaps go linearly from their values at one end
to those at the other. They are never computed from interpolated places: where something rests on a barrier, a
micrometre beside the right place is the whole force. Stimuli are those of their schedules at that time.

**Gaps** stay positive. The chord from q₀ to q₁ comes no nearer to a flat surface than its ends; the cubic may, where a
velocity changes at once. So what touches at either end departs from its chord by at most half the smallest gap.
"""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np

from bilayer_core.engine.between_ends import Between, write_between
from bilayer_core.simulation.capture import Capture, instant_of
from bilayer_core.simulation.observers import STAMP_DIGITS
from bilayer_core.simulation.parts import Parts
from bilayer_core.simulation.surroundings import Surroundings

Array = np.ndarray
PART_OF_GAP = 0.5
"""By which each of two things that touch may depart from its chord towards the other."""


def smallest_between(first: float, last: float, s: float) -> float:
    """Return the gap in between; one that was too far to be measured at one end is that of the other."""
    if math.isinf(first) or math.isinf(last):
        return min(first, last)
    return (1.0 - s) * first + s * last


class StateBetween:
    """Source of the attributes of a frame within a step, computed by the thread that asks; see `Capture`.

    Parameters
    ----------
    begin, end : Capture
        The ends of the step.
    surroundings : Surroundings
    time : float
        [s].
    """

    def __init__(self, begin: Capture, end: Capture, surroundings: Surroundings, time: float):
        self._begin, self._end = begin, end
        self.model, self.owners, self.time, self.step = begin.model, begin.owners, time, begin.step
        self._length = end.time - begin.time
        self._s = (time - begin.time) / self._length
        self.stimulus = surroundings.stimulus_at(begin.state, time)
        self.min_gap = smallest_between(begin.min_gap, end.min_gap, self._s)
        self.touching = np.union1d(begin.touching, end.touching)
        self.values, self.places = begin.values, begin.places

    def _linear(self, first: Array, last: Array) -> Array:
        return (1.0 - self._s) * first + self._s * last

    @cached_property
    def seen(self) -> Parts:
        """The observables."""
        return self._moved[1]

    @cached_property
    def across(self) -> Array:
        """Mean curvature across of strips at all nodes [1/m]."""
        return self._linear(self._begin.across, self._end.across)

    @property
    def state(self) -> Parts:
        """The state as it is drawn; a restart begins at `values`, the accepted one before."""
        return self._moved[0]

    @cached_property
    def _moved(self) -> tuple[Parts, Parts]:
        """State and observables."""
        begin, end, model = self._begin, self._end, self.model
        state = Parts(self.values.copy(), self.places)
        seen = Parts(self._linear(begin.seen.flat, end.seen.flat), begin.seen.places)
        at = Between(part=self._s, length=self._length, free=PART_OF_GAP * self.min_gap)
        write_between(model.rods, model.free_bodies, begin.instant, end.instant, instant_of(state, seen), at)
        return state, seen


class StepSpan:
    """A step, from the state at its start to the present one.

    Parameters
    ----------
    begin, end : Capture
    surroundings : Surroundings
    """

    def __init__(self, begin: Capture, end: Capture, surroundings: Surroundings):
        self._begin, self._end, self._surroundings = begin, end, surroundings

    def at(self, time: float) -> Capture | StateBetween:
        """Return what a frame of a time [s] shows, the end's or what is interpolated."""
        if time >= self._end.time or time == round(self._end.time, STAMP_DIGITS):
            return self._end
        return StateBetween(self._begin, self._end, self._surroundings, time)
