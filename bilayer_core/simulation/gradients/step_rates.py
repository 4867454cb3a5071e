"""Derivatives of a step that was made: forward along motions of its start, and backward from its end.

With Y the positions of nodes, the turns of edges since the start of the step and the strains that have rates, V their
rates, and an origin (Ȳ, V̄), a stage of length L (momenta: L′) ends where

    g = P ᵀ[𝓜 (Y − Ȳ − L V̄)/(L L′) + 𝓓 (Y − Ȳ)/L] + elasticity, weight, contact = 0,    V = (Y − Ȳ)/L,    P = ∂Y/∂q

with the masses 𝓜, those of raised edges among strains, and the damping 𝓓, viscosity among it. H = ∂g/∂q is that of
Newton's method, and G what it lacks by the gyroscopic force. So along a motion of the origin

    (H + G) dq = −dg,    dY = P dq,    dV = (dY − dȲ)/L

and backward with the transpose of each line. The maps of a stage are those of `gradients.stage_rates`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bilayer_core.engine.steps_again import Reached
from bilayer_core.model.model import Model
from bilayer_core.simulation.gradients.impact_rates import speeds_at_end
from bilayer_core.simulation.gradients.stage_rates import EndRates, StageDerivatives
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
        Speeds of approach in the memory of impacts, and rates of what elements see of light, shape (n_kept, n).
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
        self._agains = agains
        self._of = StageDerivatives(model, agains[0])
        self._end: EndRates | None = None
        self.constants = self._of.constants
        self.residual = 0.0

    def take(self, step: KeptStep) -> list[Reached]:
        """Go to a step; return where its stages ended."""
        self.step, self._stages, reached, decided = step, [], [], []
        stages = step.method.couplings.shape[1]
        for n, again in enumerate(self._agains[:stages]):
            again.begin(step)
            for earlier in range(n):
                again.start(earlier)
                again.go(earlier, reached[earlier])
                again.finish(earlier)
            again.start(n)
            if again.problem.varied_fields.exists:
                decided.append(again.problem.varied_fields.decided.copy())
            if n == 0:
                self._lit = self._of.light(again, again.places[0])
                self._start_strains = self._of.strains(again, again.places[0])
                if again.wet:
                    rates = step.start.strain_rate[self.constants.raised_rows]
                    moving = step.start.velocity, rates
                    self._start_momentum = self._of.follower.momentum(again, again.places[0], *moving)
            place, correction, followed = again.find(n, self._of.follower.matrices)
            reached.append(place)
            self.residual = max(self.residual, correction / step.length)
            self._stages.append(self._of.of(again, n, step, followed, self._lit))
        self.ended, self._end = reached[-1].position, None
        again = self._agains[stages] if step.beyond else self._agains[stages - 1]
        if step.beyond:
            again.begin(step)
            for n, place in enumerate(reached):
                again.start(n)
                again.go(n, place)
                again.finish(n)
            again.go_beyond(stages)
            if again.problem.varied_fields.exists:
                decided.append(again.problem.varied_fields.decided.copy())
            self.ended = again.places[stages + 1].position
            self._end = self._of.beyond(again, stages, step, self._lit)
        elif again.kept:
            again.finish(stages - 1)
        _, *self._remembered = speeds_at_end(again)
        self._lit_at_end = self._of.light(again, again.last)
        self.step = replace(step, decided=tuple(decided))
        return reached

    @property
    def _forgotten(self) -> slice:
        """Rows of rates of rates of strains that a step leaves without which the method has no history."""
        size, raised = self.constants.size, self._agains[0].problem.raised
        if self.step.method.history:
            return slice(0, 0)
        return slice(size, size + (raised.first if raised.exists else self.constants.strains))

    # forward

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
        constants, method, h = self.constants, self.step.method, self.step.length
        size, edges = constants.size, self._agains[0].of_edges
        fluid = constants.of_fluid
        none = np.zeros((constants.whole - fluid.start, start.place.shape[1]))
        first = np.concatenate([constants.free * start.place, self._start_strains @ start.place, none])
        first[edges] = 0.0
        speed = np.concatenate([constants.moves * start.speed, start.strain_rate, none])
        if len(none):
            by_place, by_speed = self._start_momentum
            speed[fluid] = by_place @ start.place + by_speed @ speed[constants.moving]
        push = np.concatenate([start.push, start.strain_push])
        place, turn = start.place, np.zeros((len(edges), start.place.shape[1]))
        gained: list[tuple[Array, Array]] = []
        turned: list[tuple[Array, Array]] = []
        for n, stage in enumerate(self._stages):
            origin, origin_speed = first.copy(), speed.copy()
            for coupling, (of_place, of_speed) in zip(method.couplings[n], gained, strict=False):
                origin += coupling * of_place
                origin_speed += coupling * of_speed
            if method.history:
                origin += method.along[n] * h * speed + method.bend * h * h * push
                origin_speed += method.momenta[n] * h * push
            if bodies := stage.bodies:
                bodies.turn_origin(first, origin, turned)
                if method.history:
                    bodies.turn_by_history(first, speed, push, origin)
                ahead = bodies.predict(origin, origin_speed)
            reached = stage.transduction.forward(start, acts)
            of_mass = constants.masses(origin)
            change = -(of_mass + stage.length * constants.masses(origin_speed)) / stage.momentum_length
            change = (change - constants.dissipation(origin, of_mass)) / stage.length
            change[constants.of_strains] -= stage.resistance * origin[constants.of_strains] / stage.length
            if stage.momentum:
                constants.push_fluid(change, -origin_speed[fluid] / stage.momentum_length)
            right = change[:size] + stage.strains.pull_back(change[constants.of_strains])
            before = np.zeros_like(turn)
            if stage.way:
                guess = constants.free * (origin[:size] + stage.length * origin_speed[:size])
                if bodies:
                    bodies.guess(origin, origin_speed, ahead, guess)
                before = turn - place[edges] + constants.along(stage.way[0], place)
                before += constants.along(stage.way[1], guess)
                right += stage.by_turn @ before
            if stage.by_origin is not None:
                right += stage.by_origin @ origin[:size]
            if stage.by_director is not None:
                right += stage.by_director @ origin[constants.of_strains]
            if bodies:
                right = bodies.gather(right)
                bodies.push(ahead, right)
            if len(stage.law_by_gain):
                laws = stage.law_by_mode @ reached + stage.law_by_gain[:, None] * acts.gain
                right += stage.by_laws @ laws
            if stage.by_gap is not None:
                right += stage.by_gap @ origin[constants.of_strains] + stage.by_kept @ start.kept
            if direct is not None:
                right += direct[n]
            moved = -self._agains[n].solved(n, constants.free * right, stage.lacking)
            if bodies:
                moved = bodies.spread(moved)
            end = np.concatenate([moved, stage.strains @ moved, none])
            if stage.way:
                end[edges] = before + moved[edges] + constants.along(stage.way[2], moved)
            end_speed = (end - origin) / stage.length
            if bodies:
                bodies.end(end, origin_speed, ahead, end_speed)
                turned.append((end, origin))
            if stage.momentum:
                end_speed[fluid] = stage.momentum[0] @ moved + stage.momentum[1] @ end_speed[constants.moving]
            gained.append((end - origin, end_speed - origin_speed))
            place, turn = moved, end[edges]
        if self._end:
            found = self._beyond(self._end, (first, speed), (place, turn), gained, turned)
            found.reached = self._end.transduction.forward(start, acts)
            found.kept = self._remember(start, found.strain_rate, found.place)
            return found
        kept = (end_speed - origin_speed) / stage.momentum_length
        kept = (kept - method.carry * push) / (1.0 - method.carry)
        kept[self._forgotten] = 0.0
        speeds = end_speed[:size], end_speed[constants.of_strains]
        return Rates(place, *speeds, reached, kept[:size], kept[size:], self._remember(start, speeds[1], place))

    def _remember(self, start: Rates, strain_rate: Array, place: Array) -> Array:
        """Return rates of what is kept for the next step."""
        by_kept, by_rate = self._remembered
        speeds = by_kept[:, None] * start.kept[: len(by_kept)]
        speeds += by_rate[:, None] * strain_rate[self.constants.of_gaps]
        return np.concatenate([speeds, (self._lit_at_end @ place - self._lit @ start.place) / self.step.length])

    def _beyond(
        self,
        end: EndRates,
        start: Sequence[Array],
        last: tuple[Array, Array],
        gained: Sequence[tuple[Array, Array]],
        turned: Sequence[tuple[Array, Array]],
    ) -> Rates:
        """Return how the end of a step changes beyond its last stage: `start` has rates of its start, and `last` those
        of places and turns at the last stage.
        """
        constants, edges, couplings = self.constants, self._agains[0].of_edges, self.step.method.couplings[-1]
        place, end_speed = start[0].copy(), start[1].copy()
        for coupling, (of_place, of_speed) in zip(couplings, gained, strict=True):
            place += coupling * of_place
            end_speed += coupling * of_speed
        if end.bodies:
            end.bodies.turn_origin(start[0], place, turned)
        angle, place = place[edges], place[: constants.size]
        place = end.bodies.spread(place) if end.bodies else constants.free * place
        if end.way:
            before = last[1] - last[0][edges] + constants.along(end.way[0], last[0])
            place[edges] = angle - before - constants.along(end.way[1], place)
        found = Rates.zeros(self._agains[0], place.shape[1])
        found.place, found.speed = place, end_speed[: constants.size]
        found.strain_rate = end_speed[constants.of_strains]
        return found

    # backward

    def backward(self, end: Rates) -> tuple[Rates, Inputs, list[Array]]:
        """Return the derivatives by the start of the step, by what acts, and by the gradients where stages ended, from
        those by the end of the step.
        """
        constants, method, h = self.constants, self.step.method, self.step.length
        size, edges, columns = constants.size, self._agains[0].of_edges, end.place.shape[1]
        start = Rates.zeros(self._agains[0], columns)
        acts = Inputs.zeros(self._agains[0], len(method.couplings), columns)
        push, fluid = np.zeros((constants.whole, columns)), constants.of_fluid
        first, speed = np.zeros_like(push), np.zeros_like(push)
        count = len(self._stages)
        ends = [np.zeros_like(push) for _ in range(count)]
        end_speeds = [np.zeros_like(push) for _ in range(count)]
        origins = [np.zeros_like(push) for _ in range(count)]
        origin_speeds = [np.zeros_like(push) for _ in range(count)]
        places = [np.zeros((size, columns)) for _ in range(count)]
        direct: list[Array] = [np.zeros((size, columns))] * count
        by_kept, by_rate = self._remembered
        speeds, of_light = end.kept[: len(by_kept)], end.kept[len(by_kept) :] / h
        start.kept[: len(by_kept)] += by_kept[:, None] * speeds
        start.place -= self._lit.T @ of_light
        end = replace(end, strain_rate=end.strain_rate.copy(), place=end.place + self._lit_at_end.T @ of_light)
        end.strain_rate[constants.of_gaps] += by_rate[:, None] * speeds
        if beyond := self._end:
            beyond.transduction.backward(end.reached, start, acts)
            self._beyond_back(beyond, end, (first, speed, places[-1]), (ends, end_speeds, origins, origin_speeds))
        else:
            places[-1] += end.place
            kept = np.concatenate([end.push, end.strain_push]) / (1.0 - method.carry)
            kept[self._forgotten] = 0.0
            push -= method.carry * kept
            end_speeds[-1] += kept / self._stages[-1].momentum_length
            end_speeds[-1][:size] += end.speed
            end_speeds[-1][constants.of_strains] += end.strain_rate
            origin_speeds[-1] -= kept / self._stages[-1].momentum_length
        for n in reversed(range(count)):
            stage = self._stages[n]
            of_momentum = end_speeds[n][fluid].copy()
            end_speeds[n][fluid] = 0.0
            if stage.momentum:
                end_speeds[n][constants.moving] += stage.momentum[1].T @ of_momentum
                places[n] += stage.momentum[0].T @ of_momentum
            if bodies := stage.bodies:
                ahead = bodies.end_back(ends[n], origin_speeds[n], end_speeds[n])
            ends[n] += end_speeds[n] / stage.length
            origins[n] -= end_speeds[n] / stage.length
            moved = places[n] + ends[n][:size] + stage.strains.pull_back(ends[n][constants.of_strains])
            before = np.zeros((len(edges), columns))
            if stage.way:
                moved += constants.along_back(stage.way[2], ends[n][edges])
                before += ends[n][edges]
            transposed = None if stage.lacking is None else stage.lacking.T
            moved = bodies.gather(moved) if bodies else constants.free * moved
            right = direct[n] = -self._agains[n].solved(n, moved, transposed)
            spread = bodies.spread(right) if bodies else right
            change = np.concatenate([spread, stage.strains @ spread, np.zeros_like(of_momentum)])
            if bodies:
                ahead += bodies.push_back(right)
            if stage.momentum:
                origin_speeds[n][fluid] -= constants.fluid_pushed(change) / stage.momentum_length
            of_mass = constants.masses(change)
            drag = constants.dissipation(change, of_mass) / stage.length
            of_mass = of_mass / (stage.length * stage.momentum_length)
            origins[n] -= of_mass + drag
            origins[n][constants.of_strains] -= stage.resistance * change[constants.of_strains] / stage.length
            origin_speeds[n] -= stage.length * of_mass
            reached = np.zeros_like(end.reached) if n + 1 < count or beyond else end.reached
            if len(stage.law_by_gain):
                laws = stage.by_laws.T @ right
                reached = reached + stage.law_by_mode.T @ laws
                acts.gain += stage.law_by_gain[:, None] * laws
            stage.transduction.backward(reached, start, acts)
            if stage.by_gap is not None:
                origins[n][constants.of_strains] += stage.by_gap.T @ right
                start.kept += stage.by_kept.T @ right
            if stage.by_origin is not None:
                origins[n][:size] += stage.by_origin.T @ spread
            if stage.by_director is not None:
                origins[n][constants.of_strains] += stage.by_director.T @ spread
            if stage.way:
                before += stage.by_turn.T @ spread
                guess = constants.along_back(stage.way[1], before)
                if bodies:
                    bodies.guess_back(guess, origins[n], origin_speeds[n], ahead)
                guess = constants.free * guess
                origins[n][:size] += guess
                origin_speeds[n][:size] += stage.length * guess
                of_start = constants.along_back(stage.way[0], before)
                of_start[edges] -= before
                if n:
                    places[n - 1] += of_start
                    ends[n - 1][edges] += before
                else:
                    start.place += of_start
            if bodies:
                bodies.predict_back(origins[n], origin_speeds[n], ahead)
                if method.history:
                    bodies.turn_by_history_back(first, speed, push, origins[n])
                bodies.turn_origin_back(first, origins[n], ends, origins)
            if method.history:
                speed += method.along[n] * h * origins[n]
                push += method.bend * h * h * origins[n] + method.momenta[n] * h * origin_speeds[n]
            first += origins[n]
            speed += origin_speeds[n]
            for j in range(n):
                coupling = method.couplings[n, j]
                ends[j] += coupling * origins[n]
                origins[j] -= coupling * origins[n]
                end_speeds[j] += coupling * origin_speeds[n]
                origin_speeds[j] -= coupling * origin_speeds[n]
        first[edges] = 0.0
        start.place += constants.free * first[:size] + self._start_strains.pull_back(first[constants.of_strains])
        if fluid.stop > fluid.start:
            by_place, by_speed = self._start_momentum
            start.place += by_place.T @ speed[fluid]
            speed[constants.moving] += by_speed.T @ speed[fluid]
        start.speed += constants.moves * speed[:size]
        start.strain_rate += speed[constants.of_strains]
        start.push, start.strain_push = push[:size], push[size:]
        return start, acts, direct

    def _beyond_back(self, beyond: EndRates, end: Rates, start: Sequence[Array], stages: Sequence[list[Array]]) -> None:
        """Take derivatives by the end of a step beyond its last stage: `start` has those by its start and by places at
        the last stage, `stages` those by ends and origins of all stages.
        """
        constants, edges = self.constants, self._agains[0].of_edges
        first, speed, last = start
        ends, end_speeds, origins, origin_speeds = stages
        by_place, by_speed = np.zeros_like(first), np.zeros_like(speed)
        by_speed[: constants.size], by_speed[constants.of_strains] = end.speed, end.strain_rate
        place = end.place.copy()
        if beyond.way:
            turns = place[edges]
            place -= constants.along_back(beyond.way[1], turns)
            last -= constants.along_back(beyond.way[0], turns)
            last[edges] += turns
            ends[-1][edges] -= turns
        by_place[: constants.size] = beyond.bodies.gather(place) if beyond.bodies else constants.free * place
        if beyond.bodies:
            beyond.bodies.turn_origin_back(first, by_place, ends, origins)
        first += by_place
        speed += by_speed
        for j, coupling in enumerate(self.step.method.couplings[-1]):
            ends[j] += coupling * by_place
            origins[j] -= coupling * by_place
            end_speeds[j] += coupling * by_speed
            origin_speeds[j] -= coupling * by_speed
