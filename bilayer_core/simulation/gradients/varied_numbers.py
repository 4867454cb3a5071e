"""Changes that numbers of a scene make by themselves in a run: its start, and where each stage of its steps ended.

That is a difference of models, as for equilibria: gains and stimuli act through the laws of materials alone, and need
none. With a number such as a thickness, layers that were alike become unlike, and their masses are off the curve. Rates
of directors, which count then, are those that the directors of the steps have.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from bilayer_core.engine.newton import SETTLED_WITHIN
from bilayer_core.engine.steps_again import Driven, Reached, drive_steps
from bilayer_core.errors import InputError
from bilayer_core.model.model import Model
from bilayer_core.model.records.parts import Drives
from bilayer_core.model.start_motion import set_in_motion
from bilayer_core.model.state import PARTS, State, turn_directors
from bilayer_core.observed.frame import Description
from bilayer_core.simulation.gains import SPACING
from bilayer_core.simulation.gradients.course import Course
from bilayer_core.simulation.gradients.equilibrium_response import Equilibrium
from bilayer_core.simulation.gradients.impact_rates import speeds_at_end
from bilayer_core.simulation.gradients.light_rates import light_rates
from bilayer_core.simulation.gradients.nearby import (
    PLACES,
    Builders,
    carried,
    carry_directors,
    refuse_other_plane,
    slope,
    tangents_of,
)
from bilayer_core.simulation.gradients.parameters import STEP, numbers_of, scene_with, shares_of
from bilayer_core.simulation.gradients.step_again import KeptStep, StepAgain
from bilayer_core.simulation.same_model import differing
from bilayer_core.simulation.settling import SETTLE
from bilayer_core.simulation.stepper import Stepper
from bilayer_core.simulation.surroundings import Surroundings

Array = np.ndarray
SHIFT = 1e-4
"""Of the shortest edge: by how much a number may move nodes that bodies hold beside others, for differences."""
LOST = 1e-9
"""Part of a rate that is lost by rounding."""
NEAR = 1e-5
"""h of a number, over its size, where barriers are steep."""


@dataclass
class Direct:
    """Changes by a number alone in a step: of the gradient where stages ended, and of the end.

    Arrays are columns of `Rates`; `next_rates` are `Number.rates` at the end of the step.
    """

    gradient: list[Array]
    place: Array
    speed: Array
    push: Array
    strain_rate: Array
    reached: Array
    strain_push: Array
    kept: Array
    next_rates: list[tuple[Array, Array]] | None = None


@dataclass
class Number:
    """A number by which a run is differentiated.

    Attributes
    ----------
    path : str
    value, scale, h : float
        Itself, its size, and the step of differences.
    gain : ndarray
        How many times the gain of each law it is, where it is a gain alone, shape (n_law,).
    first, stimulus : ndarray
        Of stimuli at the start of each step and at its stages, the derivatives by it, shapes (n_step, n_channel),
        (n_step, n_stage, n_channel).
    around : list of Surroundings
        Other stimuli, with it at `PLACES`, where it changes nothing else.
    agains : list of StepAgain
        Of models with it there.
    own : bool
        Whether their models are others.
    rates : list of tuple or None
        Rates of strains of each of these models at the start of the next step, and theirs, where only they have some.
    """

    path: str
    value: float
    scale: float
    h: float
    gain: Array
    first: Array
    stimulus: Array
    around: list[Surroundings] = field(default_factory=list)
    agains: list[StepAgain] = field(default_factory=list)
    own: bool = False
    rates: list[tuple[Array, Array]] | None = None


def inertia_of(second_moment: Array, rotation: Array) -> Array:
    """Return the tensor of inertia of a turned body from its second moment."""
    second = rotation @ second_moment @ rotation.T
    return np.trace(second) * np.eye(3) - second


def _modes_of(drives: Drives) -> tuple[Array, Array, Array]:
    """Return the channel and the time constants of each mode."""
    return np.repeat(drives.field_channel, np.diff(drives.field_first)), drives.mode_rising, drives.mode_falling


class VariedNumbers:
    """Numbers by which a run is differentiated.

    Parameters
    ----------
    course : Course
    stepper : Stepper
        Of the run; nothing of it is changed.
    builders : Builders
    description : Description
        Of the run.

    Attributes
    ----------
    here : StepAgain
        Of the run's model.
    step : float
        h of a number, over its size, where it moves no held nodes far.
    size : float
        Length of the longest rod [m].
    from_start : bool
        Whether the run began at the start of its scene, which depends on the scene's numbers.
    driven : Driven
        Its steps; stimuli are those that `Number` was made with last.
    """

    def __init__(self, course: Course, stepper: Stepper, builders: Builders, description: Description):
        self._course, self._stepper, self._builders, self._description = course, stepper, builders, description
        self.model, self.scene = stepper.model, stepper.model.scene
        methods = stepper.engine.methods
        self.step = NEAR if "barrier" in self.model.forces or "rod barrier" in self.model.forces else STEP
        self.stages = max(len(method.couplings) for method in methods)
        self._history = len(methods) > 1 or bool(methods[0].history)
        self._beyond = any(len(method.couplings) > method.couplings.shape[1] for method in methods)
        self.size = max(rod.path.length for rod in self.scene.rods)
        self.here = self.again(self.model)
        self.from_start = self._begins_at_start()
        count, channels = len(course), len(self.here.inputs.first)
        ends = np.array([float(course.start.time[0]), *(end for end, _ in course.made)])
        self.driven = Driven(
            begin=ends[:-1].copy(),
            length=np.diff(ends),
            first=np.zeros((count, channels)),
            stimulus=np.zeros((count, self.stages, channels)),
        )

    def again(self, model: Model, surroundings: Surroundings | None = None) -> StepAgain:
        around = surroundings or Surroundings(model, self._stepper.ahead)
        stepper = self._stepper
        return StepAgain(
            model,
            self._builders.state_of(model),
            around,
            stepper.same_time,
            self.stages,
            self._history,
            self._beyond,
            SETTLED_WITHIN * stepper.steps.newton_tolerance,
        )

    def _begins_at_start(self) -> bool:
        """Return whether the run began at the start of its scene, which depends on the scene's numbers."""
        own, start = self._builders.state_of(self.model), self._course.start
        if self.scene.start == SETTLE and start.time[0] == 0.0:
            return True
        parts = ("time", "position", "velocity", "director1", "spin", "transduction", "body_position", "body_rotation")
        return all(np.array_equal(getattr(own, part), getattr(start, part)) for part in parts)

    def named(self, names: Sequence[str]) -> dict[str, list[Number]]:
        """Return numbers by the names that users give them: one, or those of a list.

        Raises
        ------
        InputError, SceneError
            If there is no such path, or it has no numbers.
        """
        for name in names:
            if name in self.scene.stimuli:
                path = f"stimuli.{name}.schedule"
                raise InputError(f"gradient: {name} varies in a run; name a number of its schedule, {path}. …")
        paths = {name: list(numbers_of(self.scene, name)) for name in names}
        numbers = [number for of in paths.values() for number in of]
        shares = shares_of(self.model, self._builders.model_of, numbers, SPACING)  # as given, like lengths of steps
        return {name: [self._number(path, value, shares.get(path)) for path, value in of] for name, of in paths.items()}

    def _number(self, path: str, value: float, share: Array | None, part: float = 1.0) -> Number:
        driven, scale = self.driven, abs(value) or min(1.0, self.size * STEP / self.step)
        h, gain = part * self.step * scale, np.zeros(len(self.here.laws)) if share is None else share
        found = Number(path, value, scale, h, gain, 0.0 * driven.first, 0.0 * driven.stimulus)
        if share is not None:
            return found
        scenes = [scene_with(self.scene, {path: value + place * h}) for place in PLACES]
        if all(not differing(self.scene, scene) for scene in scenes):
            models = [replace(self.model, scene=scene) for scene in scenes]
            around = [Surroundings(model, self._stepper.ahead) for model in models]
            if path.startswith("stimuli."):
                found.around = around
                first, stimulus = zip(*map(self._drive, around), strict=True)
                found.first, found.stimulus = slope(first, h), slope(stimulus, h)
                return found
            found.agains = [self.again(model, of) for model, of in zip(models, around, strict=True)]
        else:
            found.agains, found.own = [self.again(self._builders.model_of(scene)) for scene in scenes], True
            sizes = {(of.size, of.model.node_count, of.end_rates.size) for of in found.agains}
            if len(sizes) > 1 or sizes.pop()[:2] != (self.here.size, self.model.node_count):
                raise InputError(f"gradient: {path} changes how many unknowns the model has")
            raised = [of.problem.raised.edge for of in (found.agains[0], self.here)]
            if found.agains[0].end_rates.size != self.here.end_rates.size or not np.array_equal(*raised):
                rates = self._first_rates(found)
                more = np.zeros(found.agains[0].end_rates.size * self._history + found.agains[0].wet)
                if self.here.excess:
                    raise InputError(
                        f"gradient: {path} makes layers unlike, and implicit_midpoint then steps added mass in another "
                        "way; choose another integrator"
                    )
                found.rates = [(of, more) for of in rates]
        for again in found.agains:
            refuse_other_plane(self.model, again.model, path, moves=False)
        shift, most = self._shift(found), SHIFT * self.here.problem.strands.rest_length.min()
        return found if shift <= most else self._number(path, value, None, 0.5 * part * most / shift)

    def _shift(self, number: Number) -> float:
        """Return how far a number moves nodes that bodies hold, from end to end of its step, while others stay [m]."""
        held, own, places = self.model.constrained.node, number.rates or [None] * len(PLACES), []
        for k in (0, -1):
            ends = [self.fitted(number.agains[k], of, own[k]) for of in (self._course.start, self._course.end)]
            places.append([end.position[held] for end in ends])
        return float(np.abs(np.subtract(*places)).max(initial=0.0))

    def _drive(self, around: Surroundings) -> tuple[Array, Array]:
        """Return the stimuli at the start of each step and at its stages under other schedules."""
        driven, done = self.driven, 0
        for ends, method, state in self._course.alike():
            last = done + len(ends)
            while done < last:
                around.cover(float(driven.begin[done]), state.override, state.pose_goal)
                acts = around.actuation, method, self.here.inputs, driven
                done = drive_steps(*acts, done, last, self._stepper.ahead, self._stepper.same_time)
        return driven.first.copy(), driven.stimulus.copy()

    def at_start(self, number: Number) -> tuple[Array, ...]:
        """Return how the start of the run depends on a number: place, speed, rate of strains, what modes reached."""
        here = self.here
        place, speed = np.zeros(here.size), np.zeros(here.size)
        own = self._course.start
        if number.around and not number.first[0].any():
            return place, speed, 0.0 * own.strain_rate, 0.0 * own.transduction
        if self.from_start and self.scene.start == SETTLE:
            h, states = self._settled(number)
        elif self.from_start and not number.gain.any():
            h = number.h
            states = [self._builders.state_of(of.model) for of in number.agains or number.around]
        else:
            return place, speed, 0.0 * own.strain_rate, 0.0 * own.transduction

        def rate(part: str) -> Array:
            return slope([getattr(state, part) for state in states], h)

        place[here.of_nodes] = rate("position")
        director, first = own.director1, self.model.rods.edge_node
        tangent = own.position[first + 1] - own.position[first]
        tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
        if not self.model.plane.exists:
            place[here.of_edges] = np.einsum("ki,ki->k", np.cross(tangent, director), rate("director1"))
            speed[here.of_edges] = rate("spin")
        speed[here.of_nodes] = rate("velocity")
        free = here.problem.bodies.body_of_free
        place[here.of_bodies[:, :3]] = rate("body_position")[free]
        by_rotation = rate("body_rotation")[free] @ own.body_rotation[free].swapaxes(1, 2)  # [dφ]×
        place[here.of_bodies[:, 3:]] = np.stack([by_rotation[:, j, i] for i, j in ((1, 2), (2, 0), (0, 1))], axis=-1)
        speed[here.of_bodies[:, :3]] = rate("body_velocity")[free]
        held = self.model.constrained  # nodes go with bodies: how they move against them is among what acts in steps
        for node, holder, arm in zip(held.node, held.free, self._arms(own), strict=True):
            if holder >= 0:
                motion = place[here.of_bodies[holder]]
                place[here.of_nodes[node]] = motion[:3] + np.cross(motion[3:], arm)
        if len(free):
            agains = number.agains or [here] * len(states)
            momenta = [self.momenta(of, state) for of, state in zip(agains, states, strict=True)]
            speed[here.of_bodies[:, 3:]] = slope(momenta, h)
        rates = rate("strain_rate") if number.rates is None else np.zeros(here.end_rates.size)
        alike = len(states[0].transduction) == len(own.transduction)
        reached = rate("transduction") if alike else 0.0 * own.transduction
        ways, of_bodies = here.problem.bodies.freedom, place[here.of_bodies].ravel()
        lost = of_bodies - ways @ np.linalg.lstsq(ways, of_bodies, rcond=None)[0]
        if np.abs(lost).max(initial=0.0) > LOST * np.abs(place).max(initial=0.0):
            raise InputError(
                f"gradient: {number.path} moves a body where its guide or joint does not let it go; differentiate by "
                "what moves along with it"
            )
        place[here.of_nodes[held.node[held.free < 0]]] = 0.0
        return place, speed, rates, reached

    def _first_rates(self, number: Number) -> list[Array]:
        """Return the rates of strains of other models at the start of their runs."""
        if not self.from_start or self.scene.start != SETTLE:
            return [self._builders.state_of(again.model).strain_rate for again in number.agains]
        h, states = self._settled(number)
        rates = [state.strain_rate for state in states]
        return [np.mean(rates, axis=0) + place * number.h * slope(rates, h) for place in PLACES]

    def _settled(self, number: Number) -> tuple[float, list[State]]:
        """Return a step of a number, and the states from which runs begin with it at `PLACES`."""
        rest = Equilibrium(self._stepper, self._course.start, self._builders, self._description)
        response = rest.respond(rest.parameters([number.path])[number.path][0])
        if response.moves and rest.floats:
            raise InputError(
                f"gradient: a robot that floats at its start turns as it settles, and how far {number.path} turns it "
                "has no derivative; hold it, or leave out `start: settle`"
            )
        states = []
        for near, place in zip(response.nearby, PLACES, strict=True):
            states.append(near.moved(response.motion * (place * response.h)))
            set_in_motion(near.model, states[-1])
            turn_directors(near.model, states[-1])
        return response.h, states

    def _arms(self, state: State) -> Array:
        """Return the arms of nodes that bodies hold, shape (n_held, 3)."""
        held = self.model.constrained
        return np.einsum("kij,kj->ki", state.body_rotation[held.body], held.position)

    def modes(self, model: Model) -> Array:
        """Return the mode of this model for each of another, whose layers may be unlike: that with its time constants.

        Raises
        ------
        InputError
            If there is none.
        """
        own, other = ([*zip(*_modes_of(each.drives), strict=True)] for each in (self.model, model))
        if len(own) == len(other):
            return np.arange(len(own))
        if not set(other) <= set(own):
            raise InputError("gradient: a time constant that parts alike layers is not differentiated by")
        return np.array([own.index(mode) for mode in other], dtype=np.int64)

    def momenta(self, again: StepAgain, state: State) -> Array:
        """Return the angular momenta of free bodies, shape (n_free, 3)."""
        at = again.new()
        again.take_state(state, at)
        return again.start_point(state, at).angular_momentum.copy()

    def in_step(self, number: Number, step: KeptStep, reached: Sequence[Reached]) -> Direct:
        """Return what a number changes by itself in a step, apart from stimuli and gains."""
        here, h = self.here, number.h
        found = Direct(
            [],
            np.zeros(here.size),
            np.zeros(here.size),
            np.zeros(here.size),
            np.zeros(here.end_rates.size),
            np.zeros(here.transduction.size),
            np.zeros(here.end_rates.size + here.wet),
            np.zeros(here.kept),
        )
        if number.agains:
            own = number.rates or [None] * len(number.agains)
            seen = [
                self._replayed(again, replace(step, start=self.fitted(again, step.start, rates)), reached)
                for again, rates in zip(number.agains, own, strict=True)
            ]
            *found.gradient, turned, found.kept, released, held, momenta, reached_by, rates, push = (
                slope(values, h) for values in zip(*seen, strict=True)
            )
            found.speed[here.of_nodes] = released
            if not self.model.plane.exists:
                found.place[here.of_edges] = turned
            for rows, (speed, gained) in ((here.held, held), (here.of_bodies[:, 3:], momenta)):
                found.speed[rows] = speed
                if self._history:
                    found.push[rows] = gained / (1.0 - step.method.carry)
            if len(reached_by) == len(found.reached):
                found.reached = reached_by
            if number.rates is None:
                found.strain_rate, found.strain_push = rates, push
            else:
                found.next_rates = [(values[-2], values[-1]) for values in seen]
                if here.wet:
                    first, own = here.end_rates.size, number.agains[0].end_rates.size
                    found.strain_push[first : first + here.size] = push[own : own + here.size]
        return found

    def _replayed(self, again: StepAgain, step: KeptStep, reached: Sequence[Reached]) -> list[Array]:
        """Return the gradients where stages ended, with another model, and what the state takes of the end."""
        again.begin(step)
        gradients = []
        for n, place in enumerate(reached):
            again.start(n)
            again.go(n, place)
            gradients.append(again.gradient(n))
            again.finish(n)
        if step.beyond:
            again.go_beyond(len(reached))
        carry = step.method.carry
        push = (again.end_rates - again.origin_rates) / again.stage.momentum_length
        of_fluid = again.gained_momentum / again.stage.momentum_length
        if self._history:
            push = (push - carry * step.start.strain_acceleration) / (1.0 - carry)
            of_fluid = (of_fluid - carry * again.wetted(step.start.fluid_force)) / (1.0 - carry)
            if not step.method.history:
                push[: again.problem.raised.first if again.problem.raised.exists else None] = 0.0
        released, excess = again.release()
        tangent, director = again.last.tangent[: len(again.of_edges)], again.last.director1[: len(again.of_edges)]
        before = carried(tangents_of(self.model.rods.edge_node, step.end.position), tangent, step.end.director1)
        return [
            *gradients,
            np.einsum("ki,ki->k", np.cross(before, director), tangent),  # turns: nodes that bodies hold turn edges
            np.concatenate([speeds_at_end(again)[0], light_rates(again, step), excess]),
            released,
            again.speeds_of_held,
            again.momenta_of_bodies,
            again.transduction.copy(),
            again.end_rates.copy(),
            np.concatenate([push, of_fluid]),
        ]

    def fitted(self, again: StepAgain, state: State, rates: tuple[Array, Array] | None) -> State:
        """Return a state that a model with another number takes: with what only such models have, prescribed bodies
        where they are then, and with them the nodes that bodies hold.
        """
        model = again.model
        fitted = again.first.copy()
        for name in PARTS:
            mine, part = getattr(fitted, name), getattr(state, name)
            if mine.shape == part.shape:
                mine[...] = part
        fitted.transduction[:] = state.transduction[self.modes(model)]
        for f, b in enumerate(again.problem.bodies.body_of_free):
            inertia = [
                inertia_of(of.problem.bodies.second_moment[f], state.body_rotation[b]) for of in (self.here, again)
            ]
            if not np.array_equal(*inertia):  # the momentum is kept
                momentum = inertia[0] @ state.body_angular_velocity[b]
                fitted.body_angular_velocity[b] = np.linalg.solve(inertia[1], momentum)
        if rates is not None:
            fitted.strain_rate[:] = rates[0]
            if self._history:
                strains, nodes = len(rates[0]), len(state.fluid_force)
                fitted.strain_acceleration[:] = rates[1][:strains]
                fitted.fluid_force[:nodes] = state.fluid_force
                fitted.fluid_force[nodes:] = rates[1][strains + again.size :].reshape(-1, 3)
        again.begin(KeptStep(fitted, fitted, self._stepper.engine.methods[0]))
        moved, constrained = again.problem.bodies.prescribed, again.problem.constrained
        moved = moved[moved < len(fitted.body_position)]
        for name, part in (("body_position", "position"), ("body_rotation", "rotation")):
            getattr(fitted, name)[moved] = getattr(again.inputs, part)[0, moved]
        held = again.places[0]
        again.take_state(fitted, held)
        fitted.position[:] = held.position
        moving, led = again.inputs.rates[0, constrained.body], constrained.free < 0
        fitted.velocity[constrained.node[led]] = (moving[:, :3] + np.cross(moving[:, 3:], held.arm))[led]
        carry_directors(model, state.position, fitted)
        return fitted
