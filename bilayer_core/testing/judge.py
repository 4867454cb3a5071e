"""Demands on every accepted step of every case, and on a run as a whole.

========================= =====================================================================================
finite                    positions and velocities are numbers
gap                       the smallest gap is open, nothing passed through anything, and nothing that touches is
                          farther apart than the barrier acts (`testing.gaps`)
energy without driving    T + V can only fall: it rises by no more than `MOST_GAIN` of the largest energy
energy with driving       T + V less supplied work can only fall, but for the quadrature of that work: it rises by no
                          more than `MOST_MADE` of the largest energy of the run
momentum                  where nothing but gravity acts, it changes as gravity has it, to what Newton's method leaves:
                          its tolerance in a step, √n of it in n steps
budget                    inside the region the budget closes to `LARGEST_RESIDUAL` of its largest row
effort                    no more than `MOST_ITERATIONS` Newton iterations an attempt, `MOST_REJECTED` attempts a step
========================= =====================================================================================
"""

from __future__ import annotations

import math

import numpy as np

from bilayer_core.engine.energy_account import FREE, LARGEST, LOWEST
from bilayer_core.errors import BilayerError
from bilayer_core.observed.frame import Frame
from bilayer_core.scene.body import Guided
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.testing.gaps import GapCheck

MOST_GAIN = 2e-3
"""The engine stops at 1e-3; rounding and Newton's tolerance are beside it."""
MOST_MADE = 0.1
"""What a summary calls large (`simulation.summary.LARGE_NUMERICAL`)."""
LARGEST_RESIDUAL = 0.02
MOST_ITERATIONS = 200
MOST_REJECTED = 30
"""On average over a run."""
ROUNDING = 1e-9
"""Of the fastest speed, in that of the mass centre."""


class Verdict(BilayerError):
    """A case failed: what was wrong, and when."""

    def __init__(self, reason: str, time: float):
        super().__init__(f"{reason} at t = {time:.6g} s")
        self.reason, self.time = reason, time

    def __reduce__(self) -> tuple:
        """Reduce the error to what makes it again in another process."""
        return type(self), (self.reason, self.time)


class Judge:
    """Looks at a simulator after every accepted step, or after every so many.

    Parameters
    ----------
    simulator : Simulator
    every : int
        From look to look, for very long runs.

    Attributes
    ----------
    steps : int
        Accepted, as far as it was told.
    min_gap : float
        The smallest seen [m].
    energy_gain, numerical : float
        Over the largest energy: the most that T + V less supplied work rose, without driving and in all.
    momentum : float
        The most that it was wrong by, over what Newton's tolerance allows.
    """

    def __init__(self, simulator: Simulator, every: int = 1):
        self._simulator, self._gaps = simulator, GapCheck(simulator.model)
        self._every = every
        self.steps, self.min_gap = 0, math.inf
        self.energy_gain = self.numerical = self.momentum = self._made = 0.0
        self._lowest = float(simulator.energy_account[FREE])
        self._momentum = _Momentum(simulator) if _flies(simulator) else None

    def look(self, time: float) -> None:
        """Look at what a step ended with. Raises Verdict if it is not as it must be."""
        self.steps += 1
        if self.steps % self._every:
            return
        frame = self._simulator.frame()
        if not (np.isfinite(frame.positions).all() and np.isfinite(frame.velocities).all()):
            raise Verdict("a position or a velocity is not finite", time)
        self._look_at_gaps(frame)
        self._look_at_energy(time)
        if self._momentum is not None:
            self.momentum = max(self.momentum, self._momentum.off(frame))
            if self.momentum > 1.0:
                raise Verdict(f"momentum is wrong by {self.momentum:.3g} of what Newton's tolerance allows", time)

    def _look_at_gaps(self, frame: Frame) -> None:
        if not self._gaps.checks_anything:
            return
        moment = self._gaps.moment(frame)
        self.min_gap = min(self.min_gap, self._gaps.smallest(moment))
        if not self.min_gap > -self._gaps.unsure:
            own = f"the engine's own {frame.min_gap:.3g} m"
            raise Verdict(f"the smallest gap is {self.min_gap:.3g} m, {own}", frame.time)
        for found in (self._gaps.crossed(moment), self._gaps.floating(moment, frame.contacts)):
            if found:
                raise Verdict(found, frame.time)

    def _look_at_energy(self, time: float) -> None:
        account = self._simulator.energy_account
        largest = float(account[LARGEST])
        if largest <= 0.0:
            return
        self.energy_gain = max(self.energy_gain, float(account[FREE] - account[LOWEST]) / largest)
        self._lowest = min(self._lowest, float(account[FREE]))
        self._made = max(self._made, float(account[FREE]) - self._lowest)
        self.numerical = self._made / largest
        if self.energy_gain > MOST_GAIN:
            raise Verdict(f"energy rose by {self.energy_gain:.3g} of the largest without driving", time)

    def end(self, inside: bool) -> dict[str, float]:
        """Look at the run as a whole; the figures of it.

        `inside`: whether it is in the region of validity. Raises Verdict if the effort was not bounded, or the budget
        does not close.
        """
        statistics, time = self._simulator.statistics, self._simulator.time
        if self.numerical > MOST_MADE:
            raise Verdict(f"steps made {self.numerical:.3g} of the largest energy of the run", time)
        parts = max(statistics.substeps, 1)
        attempts = parts + statistics.rejected
        if statistics.iterations > MOST_ITERATIONS * attempts:
            raise Verdict(f"{statistics.iterations / attempts:.0f} Newton iterations an attempt", time)
        if statistics.rejected > MOST_REJECTED * parts:
            raise Verdict(f"{statistics.rejected / parts:.0f} rejected attempts a step", time)
        if not self._simulator.keeps_budget:
            return {}
        residual = float(self._simulator.budget()["relative_residual"])
        if inside and abs(residual) > LARGEST_RESIDUAL:
            raise Verdict(f"the energy budget has a residual of {residual:.3g} of its largest row", time)
        return {"budget_residual": residual}


class _Momentum:
    """The momentum of a robot on which nothing but gravity acts."""

    def __init__(self, simulator: Simulator):
        self._simulator, frame = simulator, simulator.frame()
        self._time, self._velocity = frame.time, self._mean()

    def _mean(self) -> np.ndarray:
        """Return the velocity of the mass centre [m/s], shape (3,)."""
        model = self._simulator.model
        return self._simulator.momentum / (model.rods.node_mass.sum() + model.free_bodies.mass.sum())

    def off(self, frame: Frame) -> float:
        """Return by how much the velocity of the mass centre is not what it must be, over what is allowed."""
        gained = np.array(self._simulator.scene.gravity) * (frame.time - self._time)
        off = float(np.linalg.norm(self._mean() - self._velocity - gained))
        fastest = float(np.linalg.norm(frame.velocities, axis=1).max())
        steps = max(self._simulator.statistics.substeps, 1)
        return off / (math.sqrt(steps) * self._simulator.steps.newton_tolerance + ROUNDING * fastest)


def _flies(simulator: Simulator) -> bool:
    """Return whether nothing but gravity acts from outside on the robot."""
    scene, model = simulator.scene, simulator.model
    alone = scene.contact is None and scene.fluid is None and not scene.loads and scene.damping.mass == 0.0
    guided = any(isinstance(body.motion, Guided) for body in scene.bodies)
    return bool(alone and not guided and (model.constrained.free >= 0).all())
