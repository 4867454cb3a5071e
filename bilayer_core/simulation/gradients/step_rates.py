"""Derivatives of steps that were made, by columns; see `engine.step_response`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from bilayer_core.engine.step_response import (
    InputRates,
    StateRates,
    StepWork,
    begin_backward,
    begin_backward_beyond,
    begin_forward,
    end_backward,
    end_forward,
    end_forward_beyond,
    go_backward,
    go_forward,
)
from bilayer_core.engine.steps_again import Reached
from bilayer_core.model.model import Model
from bilayer_core.simulation.gradients.impact_rates import speeds_at_end
from bilayer_core.simulation.gradients.stage_rates import StageDerivatives
from bilayer_core.simulation.gradients.step_again import KeptStep, StepAgain

Array = np.ndarray


@dataclass
class Rates:
    """Derivatives of a state, or by a state, in columns.

    Attributes
    ----------
    place : ndarray
        Of unknowns, turns of edges beyond transport among them, shape (size, n).
    speed : ndarray
        Of velocities of nodes and spins, likewise.
    strain_rate : ndarray
        Shape (n_strain, n).
    reached : ndarray
        What modes have reached of stimuli, shape (n_mode, n).
    push, strain_push : ndarray
        Rates of velocities, and of rates of strains and of the fluid's momentum, that a history keeps, likewise.
    kept : ndarray
        Speeds of approach in the memory of impacts, rates of what elements see of light, and the fluid's momentum
        beyond that of velocities, shape (n_kept, n).
    """

    place: Array
    speed: Array
    strain_rate: Array
    reached: Array
    push: Array
    strain_push: Array
    kept: Array

    @classmethod
    def zeros(cls, again: StepAgain, columns: int) -> Rates:
        """Return rates of a model without any."""
        strains, modes = again.stage.origin_strain.size, again.transduction.size
        sizes = again.size, again.size, strains, modes, again.size, strains + again.wet, again.kept
        return cls(*(np.zeros((size, columns)) for size in sizes))


@dataclass
class Inputs:
    """Derivatives of what acts in a step, or by it, in columns.

    Attributes
    ----------
    first : ndarray
        Of stimuli at the start, shape (n_channel, n).
    stimulus : ndarray
        At the stages, shape (n_stage, n_channel, n).
    gain : ndarray
        Of gains of laws, shape (n_law, n).
    """

    first: Array
    stimulus: Array
    gain: Array

    @classmethod
    def zeros(cls, again: StepAgain, stages: int, columns: int) -> Inputs:
        """Return inputs that do not change."""
        channels, laws = again.inputs.first.size, again.laws.size
        return cls(np.zeros((channels, columns)), np.zeros((stages, channels, columns)), np.zeros((laws, columns)))


class StepRates:
    """Derivatives of kept steps, one after the other.

    Parameters
    ----------
    model : Model
    agains : sequence of StepAgain
        As many as a step has stages at most: each holds the factor of one of them.
    """

    def __init__(self, model: Model, agains: Sequence[StepAgain]):
        self._agains, again, stages = agains, agains[0], len(agains)
        self._of = StageDerivatives(model, agains)
        self.constants = self._of.constants
        self.residual = 0.0
        rates, acts = Rates.zeros(again, 1), Inputs.zeros(again, stages, 1)
        self._start, self._end = (
            StateRates(**{name: 0.0 * getattr(rates, name)[:, 0] for name in StateRates.names}) for _ in range(2)
        )
        size, whole = self.constants.size, self.constants.whole
        self._acts = InputRates(
            first=acts.first[:, 0],
            stimulus=acts.stimulus[:, :, 0],
            gain=acts.gain[:, 0],
            direct=np.zeros((stages, size)),
        )
        rows = {name: np.zeros((stages, whole)) for name in ("end", "end_speed", "origin", "origin_speed")}
        vectors = {name: np.zeros(whole) for name in ("first", "speed", "push", "change", "mass", "guess")}
        self._work = StepWork(
            **rows,
            **vectors,
            place=np.zeros((stages, size)),
            right=np.zeros(size),
            moved=np.zeros(size),
            before=np.zeros(len(again.of_edges)),
            reached=np.zeros(len(self.constants.record.channel)),
            strain=np.zeros(len(again.laws)),
        )

    def take(self, step: KeptStep) -> list[Reached]:
        """Go to a step; return where its stages ended."""
        self.step, self._count, reached, decided = step, step.method.couplings.shape[1], [], []
        for n, again in enumerate(self._agains[: self._count]):
            self._begin(again, n)
            again.start(n)
            if again.problem.varied_fields.exists:
                decided.append(again.problem.varied_fields.decided.copy())
            if n == 0:
                self._lit = self._of.light(again, again.places[0])
                self._of.write_start(again, step)
            place, correction = again.find(n, self._of.follower.write)
            reached.append(place)
            self.residual = max(self.residual, correction / step.length)
            self._of.write(again, n, step, self._lit)
        self.ended, again = reached[-1].position, self._agains[self._count - 1]
        if step.beyond:
            again = self._agains[self._count]
            self._begin(again, self._count)
            again.go_beyond(self._count)
            if again.problem.varied_fields.exists:
                decided.append(again.problem.varied_fields.decided.copy())
            self.ended = again.places[self._count + 1].position
            self._of.write_beyond(again, self._count, step, self._lit)
            if again.excess:
                self._released = self._of.release(again)
        elif again.kept:
            again.finish(self._count - 1)
        self._remembered = speeds_at_end(again)[1:] if len(again.speeds) else (np.zeros(0), np.zeros(0))
        self._lit_at_end = self._of.light(again, again.last) if again.kept else self._lit
        self.step = replace(step, decided=tuple(decided))
        return reached

    def _begin(self, again: StepAgain, n: int) -> None:
        """Go to the start of stage n."""
        again.begin(self.step)
        for earlier in range(n):
            again.pass_through(earlier, self._agains[earlier].places[earlier + 1])

    def _stage(self, n: int) -> tuple:
        """Return what pieces take of stage n."""
        again, of = self._agains[n], self._of.stages[n]
        at = again.problem, again.places[n + 1], again.stage, self.step.method, again.lack, again.lacks
        return *at, self.constants.record, again.maps, of.elastic, of.bodies

    def _beyond(self) -> tuple:
        """Return what pieces take of the end of the step beyond its last stage."""
        n, again, of = self._count, self._agains[self._count], self._of.stages[self._count]
        at = again.problem, again.places[n + 1], self.step.method
        return *at, self.constants.record, again.maps, of.elastic, of.bodies

    def forward(self, start: Rates, acts: Inputs, direct: Sequence[Array] | None = None) -> Rates:
        """Return how the end of the step changes.

        Parameters
        ----------
        start : Rates
            Of its start.
        acts : Inputs
        direct : sequence of ndarray, optional
            Of the gradient at the ends of stages by parameters alone, each of shape (size, n).
        """
        columns, own, work, last = start.place.shape[1], self._acts, self._work, self._count - 1
        again, method, first = self._agains[last], self.step.method, self._of.start.elastic
        points, end, freed = len(method.couplings), Rates.zeros(again, columns), again.kept - again.excess
        self._end.kept[:] = 0.0
        own.direct[:] = 0.0
        for k in range(columns):
            for part in fields(Rates):
                getattr(self._start, part.name)[:] = getattr(start, part.name)[:, k]
            own.first[:], own.gain[:] = acts.first[:, k], acts.gain[:, k]
            own.stimulus[:points] = acts.stimulus[:points, :, k]
            for n, of in enumerate(direct or ()):
                own.direct[n] = of[:, k]
            constants = self.constants.record
            fluid = first.fluid, self._start, work, again.excess > 0
            begin_forward(again.problem, method, constants, first.strains, *fluid)
            for n in range(self._count):
                go_forward(*self._stage(n), self._start, own, work, n, self.step.length)
            if self.step.beyond:
                end_forward_beyond(*self._beyond(), self._start, self._end, own, work, self._count)
            else:
                end_forward(again.problem, again.stage, method, self._end, work, last)
            for part in fields(Rates):
                getattr(end, part.name)[:, k] = getattr(self._end, part.name)
        by_kept, by_rate = self._remembered
        speeds = by_kept[:, None] * start.kept[: len(by_kept)]
        speeds += by_rate[:, None] * end.strain_rate[self.constants.of_gaps]
        of_light = (self._lit_at_end @ end.place - self._lit @ start.place) / self.step.length
        end.kept[:freed] = np.concatenate([speeds, of_light])
        if again.excess and self.step.beyond:
            by_place, by_speed, released, kept = self._released
            rest = end.kept[freed:] - by_place @ end.place - by_speed @ np.concatenate([end.speed, end.strain_rate])
            end.speed += released @ rest
            end.kept[freed:] = kept[:, None] * rest
        return end

    def backward(self, end: Rates) -> tuple[Rates, Inputs, list[Array]]:
        """Return the derivatives by the start of the step, by what acts, and by the gradients where stages ended, from
        those by the end of the step, one column.
        """
        work, acts, last = self._work, self._acts, self._count - 1
        again, method, first = self._agains[last], self.step.method, self._of.start.elastic
        for part in fields(Rates):
            getattr(self._end, part.name)[:] = getattr(end, part.name)[:, 0]
        by_kept, by_rate = self._remembered
        freed = again.kept - again.excess
        speeds, of_light = self._end.kept[: len(by_kept)], self._end.kept[len(by_kept) : freed] / self.step.length
        if again.excess and self.step.beyond:
            by_place, by_speed, released, kept = self._released
            rest = kept * self._end.kept[freed:] + (released.T @ self._end.speed[:, None])[:, 0]
            self._end.kept[freed:] = rest
            self._end.place[:] -= (by_place.T @ rest[:, None])[:, 0]
            by_rest = (by_speed.T @ rest[:, None])[:, 0]
            self._end.speed[:] -= by_rest[: len(self._end.speed)]
            self._end.strain_rate[:] -= by_rest[len(self._end.speed) :]
        self._end.strain_rate[self.constants.of_gaps] += by_rate * speeds
        self._end.place[:] += self._lit_at_end.T @ of_light
        if self.step.beyond:
            begin_backward_beyond(*self._beyond(), self._end, self._start, acts, work, self._count)
        else:
            begin_backward(again.problem, again.stage, method, self._end, self._start, acts, work, last)
        for n in reversed(range(self._count)):
            go_backward(*self._stage(n), self._end, self._start, acts, work, n, self.step.length)
        fluid = first.fluid, self._start, work, again.excess > 0
        end_backward(again.problem, self.constants.record, first.strains, *fluid)
        self._start.kept[: len(by_kept)] += by_kept * speeds
        self._start.place[:] -= self._lit.T @ of_light
        start = Rates(*(getattr(self._start, part.name)[:, None].copy() for part in fields(Rates)))
        inputs = Inputs(acts.first[:, None], acts.stimulus[: len(method.couplings), :, None], acts.gain[:, None])
        return start, inputs, [of[:, None] for of in acts.direct[: self._count]]
