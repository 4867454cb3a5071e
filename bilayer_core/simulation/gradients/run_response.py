"""How the end of a run depends on numbers of its scene, with the steps that were made.

Derivatives go along with the steps (`forward`), or come back from the end (`backward`); see `gradients.step_rates`.
What a number changes by itself, where each stage ended, is a difference of models, as for equilibria: gains and stimuli
act through the laws of materials alone, and need none. Lengths of steps count as given: so derivatives are those of
what was computed.

With a number such as a thickness, layers that were alike become unlike, and their masses are off the curve. Rates of
directors, which count then, are those that the directors of the steps have.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from bilayer_core.engine.newton import SETTLED_WITHIN
from bilayer_core.engine.steps_again import Driven, Reached, drive_steps
from bilayer_core.errors import InputError, SimulationError
from bilayer_core.model.model import Model
from bilayer_core.model.records.parts import Drives
from bilayer_core.model.state import PARTS, State
from bilayer_core.observed.frame import Description
from bilayer_core.simulation.gains import put_gains
from bilayer_core.simulation.gradients.course import Course
from bilayer_core.simulation.gradients.equilibrium_response import Equilibrium
from bilayer_core.simulation.gradients.followed import FOLLOWING
from bilayer_core.simulation.gradients.nearby import (
    PLACES,
    Builders,
    carry_directors,
    described,
    known_quantities,
    refuse_other_plane,
    slope,
    values_of,
)
from bilayer_core.simulation.gradients.parameters import STEP, laws_of, numbers_of, scene_with
from bilayer_core.simulation.gradients.step_again import KeptStep, StepAgain
from bilayer_core.simulation.gradients.step_rates import Inputs, Rates, StepRates
from bilayer_core.simulation.same_model import differing
from bilayer_core.simulation.settling import SETTLE
from bilayer_core.simulation.stepper import Stepper
from bilayer_core.simulation.surroundings import Surroundings

Array = np.ndarray
DIFFERENTIATED = {
    "stretching",
    "bending",
    "twisting",
    "flattening",
    "bond",
    "viscosity",
    "inertia",
    "damping",
    "gravity",
    "loads",
    "barrier",
    "rod barrier",
    "gyroscopic",
    "body drag",
    "joints",
    "joint friction",
    *FOLLOWING,
}
"""Forces through which runs are differentiated."""
SEEDS = ("positions", "velocities")
"""By which a derivative comes back from the end of a run."""
AT_END = ("speed", "push", "strain_rate", "reached", "strain_push")
"""Rates that a number changes by itself at the end of a step."""
FORGETS = 1e6
"""Lengths of the rod by which a derivative by a number, times its size, moves it."""
BESIDE, LEAST = 1e3, 1e-9
"""Distance from the end of a step beyond which derivatives may be wrong, over what Newton's tolerance lets it be off,
and of the longest rod.
"""
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
    speed: Array
    push: Array
    strain_rate: Array
    reached: Array
    strain_push: Array
    next_rates: list[tuple[Array, Array]] | None = None


@dataclass
class Number:
    """A number by which a run is differentiated.

    Attributes
    ----------
    path : str
    value, scale : float
    gain : ndarray
        1 for laws of which it is the gain, shape (n_law,).
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
    gain: Array
    first: Array
    stimulus: Array
    around: list[Surroundings] = field(default_factory=list)
    agains: list[StepAgain] = field(default_factory=list)
    own: bool = False
    rates: list[tuple[Array, Array]] | None = None


def _inertia(second_moment: Array, rotation: Array) -> Array:
    """Return the tensor of inertia of a turned body from its second moment."""
    second = rotation @ second_moment @ rotation.T
    return np.trace(second) * np.eye(3) - second


def _modes_of(drives: Drives) -> tuple[Array, Array, Array]:
    """Return the channel and the time constants of each mode."""
    return np.repeat(drives.field_channel, np.diff(drives.field_first)), drives.mode_rising, drives.mode_falling


class RunResponse:
    """The steps of a run that are differentiated.

    Parameters
    ----------
    course : Course
    stepper : Stepper
        Of the run; nothing of it is changed.
    builders : Builders
    description : Description
        Of the run.

    Raises
    ------
    InputError
        If no step was kept, or the scene has something through which runs are not differentiated.
    """

    def __init__(
        self,
        course: Course,
        stepper: Stepper,
        builders: Builders,
        description: Description,
    ):
        self._course, self._stepper, self._description = course, stepper, description
        self._builders = builders
        self.model, self.scene = stepper.model, stepper.model.scene
        if not len(course):
            raise InputError("gradient: no step of a run was kept; call run(gradients=True) first")
        self._refuse()
        methods = stepper.engine.methods
        self._step = NEAR if "barrier" in self.model.forces or "rod barrier" in self.model.forces else STEP
        self._stages = max(len(method.couplings) for method in methods)
        self._history = len(methods) > 1 or bool(methods[0].history)
        self._size = max(rod.path.length for rod in self.scene.rods)
        agains = [self._again(self.model) for _ in range(self._stages)]
        self._rates = StepRates(self.model, agains)
        self._here = agains[0]
        self._maker = builders.stepper_of(self.model)
        self.from_start = self._begins_at_start()
        count, channels = len(course), len(self._here.inputs.first)
        ends = np.array([float(course.start.time[0]), *(end for end, _ in course.made)])
        self._driven = Driven(
            begin=ends[:-1].copy(),
            length=np.diff(ends),
            first=np.zeros((count, channels)),
            stimulus=np.zeros((count, self._stages, channels)),
        )
        self._left = 0.0

    def _refuse(self) -> None:
        """Refuse what is not differentiated, by its name."""
        model = self.model
        others = [name for name in model.forces if name not in DIFFERENTIATED]
        reasons = [f"the force {name!r}" for name in others]
        if "added mass" in model.forces and self._stepper.engine.problem.raised.exists:
            reasons.append("added mass of layers that are unlike")
        if any(
            len(method.couplings) > len(method.nodes) or method.couplings.shape[0] > method.couplings.shape[1]
            for method in self._stepper.engine.methods
        ):
            reasons.append("an integrator whose steps end beyond their last stage")
        problem = self._stepper.engine.problem
        if problem.light.exists:
            reasons.append("light")
        if problem.varied_fields.exists:
            reasons.append("diffusion that varies with what it brings")
        if reasons:
            raise InputError(f"gradient: a run is not differentiated through {', '.join(reasons)}")

    def _again(self, model: Model, surroundings: Surroundings | None = None) -> StepAgain:
        around = surroundings or Surroundings(model, self._stepper.ahead)
        stepper = self._stepper
        return StepAgain(
            model,
            self._builders.state_of(model),
            around,
            stepper.same_time,
            self._stages,
            self._history,
            SETTLED_WITHIN * stepper.steps.newton_tolerance,
        )

    def _begins_at_start(self) -> bool:
        """Return whether the run began at the start of its scene, which depends on the scene's numbers."""
        own, start = self._builders.state_of(self.model), self._course.start
        if self.scene.start == SETTLE and start.time[0] == 0.0:
            moving = start.velocity, start.spin, start.body_velocity, start.body_angular_velocity
            if any(part.any() for part in moving):
                raise InputError("gradient: a run is not differentiated through a start that settles and then moves")
            return True
        parts = ("time", "position", "velocity", "director1", "spin", "transduction", "body_position", "body_rotation")
        return all(np.array_equal(getattr(own, part), getattr(start, part)) for part in parts)

    @property
    def nodes(self) -> Array:
        """Rows of positions and velocities of nodes in `Rates`, shape (n_node, 3)."""
        return self._here.of_nodes

    @property
    def known(self) -> Collection[str]:
        """Names of quantities that may be differentiated."""
        return known_quantities(self._maker, self._course.end, self._description)

    # numbers

    def numbers(self, names: Sequence[str]) -> dict[str, list[Number]]:
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
        laws = laws_of(self.model, self._builders.model_of, [number for of in paths.values() for number in of])
        return {name: [self._number(path, value, laws.get(path)) for path, value in of] for name, of in paths.items()}

    def _number(self, path: str, value: float, laws: Array | None) -> Number:
        driven, scale = self._driven, abs(value) or min(1.0, self._size * STEP / self._step)
        found = Number(path, value, scale, np.zeros(len(self._here.laws)), 0.0 * driven.first, 0.0 * driven.stimulus)
        if laws is not None:
            found.gain[laws] = 1.0
            return found
        scenes = [scene_with(self.scene, path, value + place * self._step * found.scale) for place in PLACES]
        if all(not differing(self.scene, scene) for scene in scenes):
            models = [replace(self.model, scene=scene) for scene in scenes]
            around = [Surroundings(model, self._stepper.ahead) for model in models]
            if path.startswith("stimuli."):
                found.around = around
                first, stimulus = zip(*map(self._drive, around), strict=True)
                h = self._step * found.scale
                found.first, found.stimulus = slope(first, h), slope(stimulus, h)
                return found
            found.agains = [self._again(model, of) for model, of in zip(models, around, strict=True)]
        else:
            found.agains, found.own = [self._again(self._builders.model_of(scene)) for scene in scenes], True
            raised = [of.problem.raised.edge for of in (found.agains[0], self._here)]
            if found.agains[0].end_rates.size != self._here.end_rates.size or not np.array_equal(*raised):
                states = [self._builders.state_of(again.model) for again in found.agains]
                found.rates = [(state.strain_rate, state.strain_acceleration) for state in states]
        for again in found.agains:
            refuse_other_plane(self.model, again.model, path, moves=False)
        if any(
            again.size != self._here.size or again.model.node_count != self.model.node_count for again in found.agains
        ):
            raise InputError(f"gradient: {path} changes how many unknowns the model has")
        return found

    def _drive(self, around: Surroundings) -> tuple[Array, Array]:
        """Return the stimuli at the start of each step and at its stages under other schedules."""
        driven, done = self._driven, 0
        for ends, method, state in self._course.alike():
            last = done + len(ends)
            while done < last:
                around.cover(float(driven.begin[done]), state.override, state.pose_goal)
                acts = around.actuation, method, self._here.inputs, driven
                done = drive_steps(*acts, done, last, self._stepper.ahead, self._stepper.same_time)
        return driven.first.copy(), driven.stimulus.copy()

    def _start(self, number: Number) -> tuple[Array, ...]:
        """Return how the start of the run depends on a number: place, speed, rate of strains, what modes reached."""
        here = self._here
        place, speed = np.zeros(here.size), np.zeros(here.size)
        own = self._course.start
        if number.around and not number.first[0].any():
            return place, speed, 0.0 * own.strain_rate, 0.0 * own.transduction
        if self.from_start and self.scene.start == SETTLE:
            h, states = self._settled(number)
        elif self.from_start and not number.gain.any():
            h, states = (
                self._step * number.scale,
                [self._builders.state_of(of.model) for of in number.agains or number.around],
            )
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
        momenta = [self._momenta(of, state) for of, state in zip(number.agains, states, strict=False)]
        if momenta and len(free):
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
        return self._rates.constants.moves[:, 0] * place, speed, rates, reached

    def _settled(self, number: Number) -> tuple[float, list[State]]:
        """Return a step of a number, and the equilibria from which runs begin with it at `PLACES`."""
        rest = Equilibrium(self._stepper, self._course.start, self._builders, self._description)
        response = rest.respond(rest.parameters([number.path])[number.path][0])
        motions = [response.motion * (place * response.h) for place in PLACES]
        return response.h, [near.moved(motion) for near, motion in zip(response.nearby, motions, strict=True)]

    def _arms(self, state: State) -> Array:
        """Return the arms of nodes that bodies hold, shape (n_held, 3)."""
        held = self.model.constrained
        return np.einsum("kij,kj->ki", state.body_rotation[held.body], held.position)

    def _modes(self, model: Model) -> Array:
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

    def _momenta(self, again: StepAgain, state: State) -> Array:
        """Return the angular momenta of free bodies, shape (n_free, 3)."""
        at = again.new()
        again.take_state(state, at)
        return again.start_point(state, at).angular_momentum.copy()

    def _direct(self, number: Number, step: KeptStep, reached: Sequence[Reached]) -> Direct:
        """Return what a number changes by itself in a step, apart from stimuli and gains."""
        here, h = self._here, self._step * number.scale
        found = Direct(
            [],
            np.zeros(here.size),
            np.zeros(here.size),
            np.zeros(here.end_rates.size),
            np.zeros(here.transduction.size),
            np.zeros(here.end_rates.size + here.wet),
        )
        if number.agains:
            own = number.rates or [None] * len(number.agains)
            seen = [
                self._replayed(again, replace(step, start=self._fitted(again, step.start, rates)), reached)
                for again, rates in zip(number.agains, own, strict=True)
            ]
            *found.gradient, held, momenta, reached_by, rates, push = (
                slope(values, h) for values in zip(*seen, strict=True)
            )
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
        carry = step.method.carry
        push = (again.end_rates - again.origin_rates) / again.stage.momentum_length
        of_fluid = again.gained_momentum / (again.stage.momentum_length * (1.0 - carry))
        if self._history:
            push = (push - carry * step.start.strain_acceleration) / (1.0 - carry)
            if not step.method.history:
                push[: again.problem.raised.first if again.problem.raised.exists else None] = 0.0
        return [
            *gradients,
            again.speeds_of_held,
            again.momenta_of_bodies,
            again.transduction.copy(),
            again.end_rates.copy(),
            np.concatenate([push, of_fluid]),
        ]

    def _fitted(self, again: StepAgain, state: State, rates: tuple[Array, Array] | None) -> State:
        """Return a state that a model with another number takes: with what only such models have, prescribed bodies
        where they are then, and with them the nodes that bodies hold.
        """
        model = again.model
        fitted = self._builders.state_of(model)
        for name in PARTS:
            mine, part = getattr(fitted, name), getattr(state, name)
            if mine.shape == part.shape:
                mine[...] = part
        fitted.transduction[:] = state.transduction[self._modes(model)]
        for f, b in enumerate(again.problem.bodies.body_of_free):
            inertia = [
                _inertia(of.problem.bodies.second_moment[f], state.body_rotation[b]) for of in (self._here, again)
            ]
            if not np.array_equal(*inertia):  # the momentum is kept
                momentum = inertia[0] @ state.body_angular_velocity[b]
                fitted.body_angular_velocity[b] = np.linalg.solve(inertia[1], momentum)
        if rates is not None:
            fitted.strain_rate[:] = rates[0]
            if self._history:
                fitted.strain_acceleration[:] = rates[1]
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

    # derivatives

    @property
    def residual(self) -> float:
        """Largest distance of where a step ended from where Newton's method would have ended [m]."""
        return self._left

    def forward(self, numbers: Sequence[Number]) -> Rates:
        """Return how the last state depends on some numbers, a column each."""
        rates, count = self._rates, len(numbers)
        along = Rates.zeros(self._here, count)
        for k, number in enumerate(numbers):
            along.place[:, k], along.speed[:, k], along.strain_rate[:, k], along.reached[:, k] = self._start(number)
        self._left, self._forgets = 0.0, False
        per = np.array([self._size / number.scale for number in numbers])
        gain = np.stack([number.gain for number in numbers], axis=-1)
        for k, step in enumerate(self._course.steps(self._maker)):
            reached = rates.take(step)
            self._note(step, reached)
            direct = [self._direct(number, step, reached) for number in numbers]
            first = np.stack([number.first[k] for number in numbers], axis=-1)
            acts = Inputs(first, np.stack([number.stimulus[k] for number in numbers], axis=-1), gain)
            for number, own in zip(numbers, direct, strict=True):
                number.rates = own.next_rates
            none = np.zeros(self._here.size)
            gradients = [
                np.stack([of.gradient[n] if of.gradient else none for of in direct], axis=-1)
                for n in range(len(reached))
            ]
            along = rates.forward(along, acts, gradients)
            for part in AT_END:
                getattr(along, part)[:] += np.stack([getattr(of, part) for of in direct], axis=-1)
            self._look_at(along, step, per, FORGETS)
        return along

    def _note(self, step: KeptStep, reached: Sequence[Reached]) -> None:
        """Note how far from the end of a step it ended now, and tell the first time that this is too far."""
        left = float(np.abs(reached[-1].position - step.end.position).max())
        most = max(BESIDE * self._stepper.steps.newton_tolerance * step.length, LEAST * self._size)
        if left > most >= self._left:
            warnings.warn(
                f"gradient: the step from {step.begin:.6g} s, made again, ends {left:.2g} m beside where it ended in "
                "the run: derivatives may be wrong; choose a smaller newton_tolerance",
                RuntimeWarning,
                stacklevel=5,
            )
        self._left = max(self._left, left)

    def _look_at(self, rates: Rates, step: KeptStep, per: Array | float, most: float) -> None:
        """Tell once where a motion has forgotten its start: where rates are `most` times `per` or more."""
        grown = float((np.abs(rates.place[self._here.of_nodes]) / per).max(initial=0.0))
        if not math.isfinite(grown):
            raise SimulationError("gradient: derivatives grow beyond all numbers", step.begin)
        if grown > most and not self._forgets:
            self._forgets = True
            warnings.warn(
                f"gradient: the motion forgets its start: at {step.begin:.6g} s derivatives have grown {grown:.2g} "
                f"times, beyond {most:.2g}, where they tell nothing any more; differentiate a shorter run",
                RuntimeWarning,
                stacklevel=5,
            )

    def backward(self, seeds: Mapping[str, Array], numbers: Sequence[Number]) -> list[float]:
        """Return the derivative by each number of Σ seed · quantity at the end of the run."""
        rates, here, free = self._rates, self._here, self._rates.constants.moves
        back = Rates.zeros(here, 1)
        nodes = self.model.node_count
        for name, seed in seeds.items():
            given = np.asarray(seed, dtype=float)
            if name not in SEEDS or given.shape != (nodes, 3) or not np.isfinite(given).all():
                raise InputError(
                    f"gradient: {name} of shape {given.shape} is not allowed; allowed are "
                    f"{' and '.join(SEEDS)} of nodes, finite, shape ({nodes}, 3)"
                )
            (back.place if name == SEEDS[0] else back.speed)[here.of_nodes, 0] = given
        back.place, back.speed = free * back.place, free * back.speed
        begun = self._rates_at_starts([number for number in numbers if number.rates is not None])
        found, self._left, self._forgets = np.zeros(len(numbers)), 0.0, False
        changing = [(k, number) for k, number in enumerate(numbers) if number.agains]
        first, stimulus, gain = 0.0 * self._driven.first, 0.0 * self._driven.stimulus, np.zeros(len(here.laws))
        given, tolerance = np.abs(back.place).max(), self._stepper.steps.newton_tolerance
        for n, step in enumerate(self._course.steps(self._maker, backward=True), 1):
            reached = rates.take(step)
            self._note(step, reached)
            end = back
            back, acts, direct = rates.backward(end)
            if given > 0.0:  # what Newton's method leaves then moves the end by more than the rod's length
                self._look_at(back, step, given, self._size / (tolerance * step.length))
            for number, rates_at_starts in begun:
                number.rates = rates_at_starts.pop()
            first[-n], stimulus[-n, : len(reached)] = acts.first[:, 0], acts.stimulus[:, :, 0]
            gain += acts.gain[:, 0]
            for k, number in changing:
                own = self._direct(number, step, reached)
                found[k] += sum(g @ d[:, 0] for g, d in zip(own.gradient, direct, strict=False))
                for part in AT_END:
                    found[k] += getattr(own, part) @ getattr(end, part)[:, 0]
        for k, number in enumerate(numbers):
            found[k] += np.vdot(number.first, first) + np.vdot(number.stimulus, stimulus) + number.gain @ gain
            starts = zip(self._start(number), (back.place, back.speed, back.strain_rate, back.reached), strict=True)
            found[k] += sum(float(own @ by[:, 0]) for own, by in starts)
        return found.tolist()

    def _rates_at_starts(self, numbers: Sequence[Number]) -> list[tuple[Number, list]]:
        """Return the rates of strains that only models with some numbers have, at the start of each step."""
        begun: list[tuple[Number, list]] = [(number, []) for number in numbers]
        for step in self._course.steps(self._maker) if begun else ():
            reached = self._rates.take(step)
            for number, rates_at_starts in begun:
                rates_at_starts.append(number.rates)
                number.rates = self._direct(number, step, reached).next_rates
        return begun

    def values(self, number: Number, along: Rates, k: int, wanted: Sequence[str]) -> tuple[list[Array], list[Array]]:
        """Return the derivatives of quantities at the end of the run along column k, and the sizes of their errors."""
        moved = np.abs(along.place[self._here.of_nodes, k]).max(initial=0.0)
        turned = self._size * np.abs(along.place[self._here.of_edges, k]).max(initial=0.0)
        largest = max(float(moved), float(turned))
        h = min(self._step * number.scale, STEP * self._size / largest) if largest > 0.0 else self._step * number.scale
        rows = [self._values_at(number, along, k, place * h, wanted) for place in PLACES]
        columns = list(zip(*rows, strict=True))
        fine = [slope(values, h) for values in columns]
        rough = [(values[2] - values[1]) / h for values in columns]
        return fine, [np.abs(one - other) for one, other in zip(fine, rough, strict=True)]

    def _values_at(self, number: Number, along: Rates, k: int, way: float, wanted: Sequence[str]) -> list[Array]:
        """Return quantities at the end of the run where a number is another."""
        model = self.model
        if number.own:
            model = self._builders.model_of(scene_with(self.scene, number.path, number.value + way))
        elif not number.gain.any():
            model = replace(model, scene=scene_with(self.scene, number.path, number.value + way))
        stepper, evaluator = self._builders.stepper_of(model), self._again(model)
        state = self._fitted(evaluator, self._course.end, number.rates and number.rates[0])
        at, there = evaluator.new(), evaluator.new()
        evaluator.take_state(state, at)
        momenta = self._momenta(evaluator, state)
        evaluator.travel(at, way * along.place[:, k], there)
        evaluator.write_shape(there, state)
        for f, b in enumerate(evaluator.problem.bodies.body_of_free):
            of_body = evaluator.of_bodies[f]
            state.body_velocity[b] += way * along.speed[of_body[:3], k]
            inertia = _inertia(evaluator.problem.bodies.second_moment[f], state.body_rotation[b])
            if inertia.any():
                momentum = momenta[f] + way * along.speed[of_body[3:], k]
                state.body_angular_velocity[b] = np.linalg.solve(inertia, momentum)
        state.velocity += way * along.speed[self._here.of_nodes, k]
        state.spin += way * along.speed[self._here.of_edges, k]
        if number.rates is None:
            state.strain_rate += way * along.strain_rate[:, k]
        state.transduction += way * along.reached[self._modes(model), k]
        gains = model.drives.law_gain.copy()
        try:
            if number.gain.any():
                changed = gains.copy()
                changed[number.gain > 0.0] = number.value + way
                put_gains(model, changed)
            return values_of(stepper, state, wanted, described(self._description, stepper))
        finally:
            put_gains(model, gains)
