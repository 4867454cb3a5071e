"""Compiled adaptive steps for the stepper: what they take, and what they leave."""

from __future__ import annotations

import numpy as np

from ..model.model import Model
from ..model.records.outcome import GAP, PAIR, PLACE, STATUS
from ..model.records.status import CONVERGED
from ..model.records.step import Course, Method, StateArrays
from ..model.state import State
from .actuation import Acting
from .engine import Engine, MarchReport, Settings
from .error_norm import Yardstick
from .integrate import Adaptation, Clock, Control, adapt, clear, room_for_counts
from .loop import Loop
from .modes import STEP
from .newton_report import FAILURES, NewtonReport, NewtonStatus


def yardstick_of(model: Model) -> Yardstick:
    """What deviations of a model are measured on."""
    ends = [strand.first_node for strand in model.strands] + [model.node_count]
    shares = np.array(model.carriers.weight[: model.node_count])
    return Yardstick(
        length=float(max(rod.path.length for rod in model.scene.rods)),
        first_node=np.array(ends, dtype=np.int64),
        weight=shares / np.repeat(np.add.reduceat(shares, ends[:-1]), np.diff(ends)),
        half_width=model.half_width if model.plane is None else np.zeros(0),
        body_of_free=model.bodies.body_of_free,
        reach=model.bodies.reach,
    )


class Adapter:
    """Adaptive steps of an engine.

    Parameters
    ----------
    model : Model
    engine : Engine
    control : Control
    acting : Acting
        What acts from outside until the next corner.
    """

    def __init__(self, model: Model, engine: Engine, control: Control, acting: Acting):
        self._engine, self._control, self._acting = engine, control, acting
        self._yardstick = yardstick_of(model)
        self._counts = room_for_counts()
        self._state: State | None = None
        self._parts: Adaptation | None = None

    def adapt(
        self, state: State, method: Method, course: Course, until: float, due: float, most: int, settings: Settings
    ) -> MarchReport:
        """Make at most so many steps as long as their error allows; none passes `until` [s], and none
        begins at `due` [s] or later.
        """
        engine, counts = self._engine, self._counts
        parts = self._parts_of(state, engine.loop_of(state, method, course))
        clear(counts)
        flags = engine.keeps, settings.mode, settings.length, settings.changes, settings.counts
        done = adapt(parts, *flags, until, due, most, settings.tolerance, settings.max_iterations)
        found = engine.outcome.counts.tolist()
        status, pair, place, gap = found[STATUS], found[PAIR], found[PLACE], float(engine.outcome.figures[GAP])
        if done > 0 or status == CONVERGED or status in FAILURES:
            engine.take_over(place, gap)
        iterations, factorisations, backtracks, rejected, inaccurate = counts.numbers.tolist()
        shortest, longest, length = counts.lengths.tolist()
        residual, largest_residual = counts.residuals.tolist()
        error = 0.0
        if settings.mode == STEP and status != CONVERGED and done == 0:
            length, residual, error, iterations = counts.failure.tolist()
        how = FAILURES.get(status, NewtonStatus.CONVERGED)
        newton = NewtonReport(how, int(iterations), factorisations, residual, backtracks)
        lengths = shortest, longest, length
        return MarchReport(done, status, place, pair, newton, largest_residual, *lengths, rejected, inaccurate, error)

    def _parts_of(self, state: State, loop: Loop) -> Adaptation:
        if state is not self._state:
            self._state, self._parts = state, None
            self._clock = Clock(**{name: getattr(state, name) for name in Clock.names})
            self._kept_state = state.copy()
            self._kept = StateArrays(**{name: getattr(self._kept_state, name) for name in StateArrays.names})
        if self._parts is None or self._parts.loop is not loop:
            self._parts = Adaptation(
                loop=loop,
                clock=self._clock,
                acting=self._acting,
                control=self._control,
                yardstick=self._yardstick,
                kept=self._kept,
                kept_touched=self._engine.touched.copy(),
                counts=self._counts,
            )
        return self._parts
