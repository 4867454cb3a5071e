"""How the end of a run depends on numbers of its scene, with the steps that were made.

Derivatives go along with the steps (`forward`), or come back from the end (`backward`); see `gradients.step_rates`.
What a number changes by itself, where each stage ended, is that of `varied_numbers`. Lengths of steps count as given:
so derivatives are those of what was computed.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from bilayer_core.errors import InputError, SimulationError
from bilayer_core.observed.frame import Description
from bilayer_core.simulation.gains import put_gains
from bilayer_core.simulation.gradients.course import Course
from bilayer_core.simulation.gradients.nearby import (
    PLACES,
    Builders,
    described,
    known_quantities,
    slope,
    values_of,
)
from bilayer_core.simulation.gradients.parameters import STEP, scene_with
from bilayer_core.simulation.gradients.step_again import FOLLOWING, KeptStep
from bilayer_core.simulation.gradients.step_rates import Inputs, Rates, StepRates
from bilayer_core.simulation.gradients.varied_numbers import Number, VariedNumbers, inertia_of
from bilayer_core.simulation.stepper import Stepper

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
    "restitution",
    "gyroscopic",
    "body drag",
    "joints",
    "joint friction",
    *FOLLOWING,
}
"""Forces through which runs are differentiated."""
SEEDS = {"positions": "place", "velocities": "speed", "body_positions": "place", "body_velocities": "speed"}
"""By which a derivative comes back from the end of a run, and the part of `Rates` where it does."""
AT_END = ("place", "speed", "push", "strain_rate", "reached", "strain_push", "kept")
"""Rates that a number changes by itself at the end of a step."""
FORGETS = 1e6
"""Lengths of the rod by which a derivative by a number, times its size, moves it."""
BESIDE, LEAST = 1e3, 1e-9
"""Distance from the end of a step beyond which derivatives may be wrong, over what Newton's tolerance lets it be off,
and of the longest rod.
"""


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
        self._varied = VariedNumbers(course, stepper, builders, description)
        self._here, self._size, self.from_start = self._varied.here, self._varied.size, self._varied.from_start
        more = [self._varied.again(self.model) for _ in range(self._varied.stages - 1)]
        self._rates = StepRates(self.model, [self._here, *more])
        self._maker = builders.stepper_of(self.model)
        self._left = 0.0

    def _refuse(self) -> None:
        """Refuse what is not differentiated, by its name."""
        others = [f"the force {name!r}" for name in self.model.forces if name not in DIFFERENTIATED]
        if others:
            raise InputError(f"gradient: a run is not differentiated through {', '.join(others)}")

    @property
    def nodes(self) -> Array:
        """Rows of positions and velocities of nodes in `Rates`, shape (n_node, 3)."""
        return self._here.of_nodes

    @property
    def bodies(self) -> Array:
        """Rows of positions and velocities of free bodies there, shape (n_free, 3)."""
        return self._here.of_bodies[:, :3]

    @property
    def known(self) -> Collection[str]:
        """Names of quantities that may be differentiated."""
        return known_quantities(self._maker, self._course.end, self._description)

    def numbers(self, names: Sequence[str]) -> dict[str, list[Number]]:
        """Return numbers by the names that users give them; see `VariedNumbers.named`."""
        return self._varied.named(names)

    @property
    def residual(self) -> float:
        """Largest distance of where a step ended from where Newton's method would have ended [m]."""
        return self._left

    def forward(self, numbers: Sequence[Number]) -> Rates:
        """Return how the last state depends on some numbers, a column each."""
        rates, count = self._rates, len(numbers)
        along = Rates.zeros(self._here, count)
        for k, number in enumerate(numbers):
            start = self._varied.at_start(number)
            along.place[:, k], along.speed[:, k], along.strain_rate[:, k], along.reached[:, k] = start
        self._left, self._forgets = 0.0, False
        per = np.array([self._size / number.scale for number in numbers])
        gain = np.stack([number.gain for number in numbers], axis=-1)
        for k, step in enumerate(self._course.steps(self._maker)):
            reached, step = rates.take(step), rates.step
            self._note(step)
            direct = [self._varied.in_step(number, step, reached) for number in numbers]
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

    def _note(self, step: KeptStep) -> None:
        """Note how far from the end of a step it ended now, and tell the first time that this is too far."""
        left = float(np.abs(self._rates.ended - step.end.position).max())
        most = max(BESIDE * self._stepper.steps.newton_tolerance * step.length, LEAST * self._size)
        if left > most >= self._left:
            warnings.warn(
                f"gradient: the step from {step.begin:.6g} s, made again, ends {left:.2g} m beside where it ended in "
                "the run: derivatives may be wrong; choose a smaller newton_tolerance, or shorter steps where rods "
                "spin fast about themselves",
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
        for name, seed in seeds.items():
            self._seed(back, name, np.asarray(seed, dtype=float))
        back.place, back.speed = free * back.place, free * back.speed
        begun = self._rates_at_starts([number for number in numbers if number.rates is not None])
        found, self._left, self._forgets = np.zeros(len(numbers)), 0.0, False
        changing = [(k, number) for k, number in enumerate(numbers) if number.agains]
        driven = self._varied.driven
        first, stimulus, gain = 0.0 * driven.first, 0.0 * driven.stimulus, np.zeros(len(here.laws))
        given, tolerance = np.abs(back.place).max(), self._stepper.steps.newton_tolerance
        for n, step in enumerate(self._course.steps(self._maker, backward=True), 1):
            reached, step = rates.take(step), rates.step
            self._note(step)
            end = back
            back, acts, direct = rates.backward(end)
            if given > 0.0:  # what Newton's method leaves then moves the end by more than the rod's length
                self._look_at(back, step, given, self._size / (tolerance * step.length))
            for number, rates_at_starts in begun:
                number.rates = rates_at_starts.pop()
            first[-n], stimulus[-n, : len(acts.stimulus)] = acts.first[:, 0], acts.stimulus[:, :, 0]
            gain += acts.gain[:, 0]
            for k, number in changing:
                own = self._varied.in_step(number, step, reached)
                found[k] += sum(g @ d[:, 0] for g, d in zip(own.gradient, direct, strict=False))
                for part in AT_END:
                    found[k] += getattr(own, part) @ getattr(end, part)[:, 0]
        for k, number in enumerate(numbers):
            found[k] += np.vdot(number.first, first) + np.vdot(number.stimulus, stimulus) + number.gain @ gain
            by_start = back.place, back.speed, back.strain_rate, back.reached
            starts = zip(self._varied.at_start(number), by_start, strict=True)
            found[k] += sum(float(own @ by[:, 0]) for own, by in starts)
        return found.tolist()

    def _seed(self, back: Rates, name: str, given: Array) -> None:
        """Add what a derivative begins with at the end of a run."""
        if name == "com" and given.shape == (3,) and np.isfinite(given).all():
            self._seed_center(back, given)
            return
        nodes, bodies, free = self.model.node_count, len(self.model.bodies.names), self.model.free_bodies.body_of_free
        of_bodies = name.startswith("body_")
        fits = given.shape == (bodies if of_bodies else nodes, 3) and np.isfinite(given).all()
        if name not in SEEDS or not fits or (of_bodies and np.delete(given, free, axis=0).any()):
            raise InputError(
                f"gradient: {name} of shape {given.shape} is not allowed; allowed are com, shape (3,), positions and "
                f"velocities of nodes, shape ({nodes}, 3), body_positions and body_velocities, shape ({bodies}, 3), 0 "
                "for bodies that are not free; finite numbers"
            )
        rows = self.bodies if of_bodies else self.nodes
        getattr(back, SEEDS[name])[rows, 0] += given[free] if of_bodies else given

    def _seed_center(self, back: Rates, given: Array) -> None:
        """Add a derivative by the mass centre: by nodes, bodies and directors of edges with masses off the curve."""
        model, end = self.model, self._course.end
        raised, mass, of_bodies = model.raised, model.rods.node_mass, model.robot_mass
        given = given / (mass.sum() + of_bodies.sum())
        back.place[self.nodes, 0] += mass[:, None] * given
        back.place[self.bodies, 0] += of_bodies[model.free_bodies.body_of_free, None] * given
        pull, w, i = raised.first_moment.sum(axis=1)[:, None] * given, end.director1[raised.edge], model.rods.edge_node
        edge = end.position[i[raised.edge] + 1] - end.position[i[raised.edge]]
        length = np.linalg.norm(edge, axis=1, keepdims=True)
        along = np.sum(pull * edge, axis=1, keepdims=True) / length**2 * w
        np.add.at(back.place[:, 0], self.nodes[i[raised.edge]], along)
        np.add.at(back.place[:, 0], self.nodes[i[raised.edge] + 1], -along)
        back.place[self._here.of_edges[raised.edge], 0] += np.sum(pull * np.cross(edge / length, w), axis=1)

    def _rates_at_starts(self, numbers: Sequence[Number]) -> list[tuple[Number, list]]:
        """Return the rates of strains that only models with some numbers have, at the start of each step."""
        begun: list[tuple[Number, list]] = [(number, []) for number in numbers]
        for step in self._course.steps(self._maker) if begun else ():
            reached, step = self._rates.take(step), self._rates.step
            for number, rates_at_starts in begun:
                rates_at_starts.append(number.rates)
                number.rates = self._varied.in_step(number, step, reached).next_rates
        return begun

    def values(self, number: Number, along: Rates, k: int, wanted: Sequence[str]) -> tuple[list[Array], list[Array]]:
        """Return the derivatives of quantities at the end of the run along column k, and the sizes of their errors."""
        moved = np.abs(along.place[self._here.of_nodes, k]).max(initial=0.0)
        turned = self._size * np.abs(along.place[self._here.of_edges, k]).max(initial=0.0)
        largest = max(float(moved), float(turned))
        h = number.h
        if largest > 0.0:
            h = min(h, STEP * self._size / largest)
        rows = [self._values_at(number, along, k, place * h, wanted) for place in PLACES]
        columns = list(zip(*rows, strict=True))
        fine = [slope(values, h) for values in columns]
        rough = [(values[2] - values[1]) / h for values in columns]
        return fine, [np.abs(one - other) for one, other in zip(fine, rough, strict=True)]

    def _values_at(self, number: Number, along: Rates, k: int, way: float, wanted: Sequence[str]) -> list[Array]:
        """Return quantities at the end of the run where a number is another."""
        model = self.model
        if number.own:
            model = self._builders.model_of(scene_with(self.scene, {number.path: number.value + way}))
        elif not number.gain.any():
            model = replace(model, scene=scene_with(self.scene, {number.path: number.value + way}))
        stepper, evaluator = self._builders.stepper_of(model), self._varied.again(model)
        state = self._varied.fitted(evaluator, self._course.end, number.rates and number.rates[0])
        at, there = evaluator.new(), evaluator.new()
        evaluator.take_state(state, at)
        momenta = self._varied.momenta(evaluator, state)
        evaluator.travel(at, way * along.place[:, k], there)
        evaluator.write_shape(there, state)
        for f, b in enumerate(evaluator.problem.bodies.body_of_free):
            of_body = evaluator.of_bodies[f]
            state.body_velocity[b] += way * along.speed[of_body[:3], k]
            inertia = inertia_of(evaluator.problem.bodies.second_moment[f], state.body_rotation[b])
            if inertia.any():
                momentum = momenta[f] + way * along.speed[of_body[3:], k]
                state.body_angular_velocity[b] = np.linalg.solve(inertia, momentum)
        state.velocity += way * along.speed[self._here.of_nodes, k]
        state.spin += way * along.speed[self._here.of_edges, k]
        if number.rates is None:
            state.strain_rate += way * along.strain_rate[:, k]
        speeds = evaluator.speeds_of(state)
        speeds += way * along.kept[: len(speeds), k]
        state.transduction += way * along.reached[self._varied.modes(model), k]
        gains = model.drives.law_gain.copy()
        try:
            if number.gain.any():
                put_gains(model, gains + way * number.gain)
            return values_of(stepper, state, wanted, described(self._description, stepper))
        finally:
            put_gains(model, gains)
