"""Derivatives of an equilibrium by stimuli and by numbers of the scene.

At rest the gradient of the potential vanishes, g(q, p) = 0, so that along a parameter

    dq/dp = −H⁻¹ ∂g/∂p,    H = ∂g/∂q

with the factor that Newton's method has. ∂g/∂p is a difference of gradients of the model at p ± h and p ± h/2, which is
built anew for a number of the scene. What is held at p ± h is the departure of the shape from that at the start: where
the start moves with p, as with a rod's length, q moves along, and g is differentiated along this path.

The same differences along the whole path, p ± h with q moved by ± h dq/dp, then give what g still changes by. It is
0 up to errors of H and of the differences; H⁻¹ times it corrects dq/dp. So forces that have no potential (loads that
turn with the rod, light) count in full though H lacks them, and the last correction tells the error. Quantities are
differentiated along the same path, whatever they depend on.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from bilayer_core.engine.evaluator import Evaluator
from bilayer_core.errors import InputError, SceneError, SimulationError
from bilayer_core.log.run.frame_values import FrameValues
from bilayer_core.log.run.quantities import entries, unknown_quantity
from bilayer_core.model.lit_elements import light_of, part_seen
from bilayer_core.model.model import Model
from bilayer_core.model.records.step import AT_REST, Configuration
from bilayer_core.model.state import State, reached_at_rest
from bilayer_core.observed.frame import Description
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.loader import load_content, scene_content
from bilayer_core.scene.overrides import read_overrides
from bilayer_core.simulation.capture import Capture, make_frame
from bilayer_core.simulation.equilibrium import solve_static
from bilayer_core.simulation.gains import alike_but_gains, put_gains
from bilayer_core.simulation.observation import strand
from bilayer_core.simulation.statistics import RunStatistics
from bilayer_core.simulation.stepper import Stepper

Array = np.ndarray
NEAR_REST = 1e-6
"""Of the longest rod: displacement that Newton's method may still make at what counts as an equilibrium."""
LENGTH = 1e3
"""Over which inertia acts [s]: it keeps what nothing holds from drifting, and corrections take it out again."""
PLACES = (-1.0, -0.5, 0.5, 1.0)
"""Of the step h, where models are looked at: for differences of fourth order."""
STEP = 1e-3
"""h, of the parameter, and the largest displacement over it, of the longest rod."""
OF_GAP = 1e-2
"""That displacement, of the smallest gap: barriers are steep."""
CONVERGED, GOOD, MOST = 1e-9, 1e-4, 20
"""Of the largest part of dq/dp: the correction that ends them, and the largest last one; how many there may be."""
NOTHING = 1e-14
"""Of the longest rod, or of a quantity: change over h that is rounding."""
RATES = ("velocity", "spin", "strain_rate", "body_velocity", "body_angular_velocity", "has_history", "light_rate")
HELD = ("time", "director1", "twist", "body_rotation", "memory", "override", "pose_goal", "friction")
"""Parts of the present state that a model nearby has as well."""
_GAIN = re.compile(r".*\.eigenstrain(\.\d+)?\.gain(\.value\.\d+)?")


@dataclass(frozen=True)
class Gradient(Mapping[tuple[str, str], Array]):
    """Derivatives by quantity and parameter: ``found["com", "humidity"]``.

    Attributes
    ----------
    derivatives : dict
        By quantity and parameter, in SI units, stimuli in those of their channels. The shape is that of the quantity,
        with one axis more behind for a list of numbers.
    errors : dict
        Likewise, the size of the error: by how much the last correction changed each value.
    residual : float
        Largest displacement that Newton's method still made at the equilibrium before it was differentiated [m].
    """

    derivatives: dict[tuple[str, str], Array]
    errors: dict[tuple[str, str], Array]
    residual: float

    def __getitem__(self, key: tuple[str, str]) -> Array:
        return self.derivatives[key]

    def __iter__(self) -> Iterator[tuple[str, str]]:
        return iter(self.derivatives)

    def __len__(self) -> int:
        return len(self.derivatives)


@dataclass
class Motion:
    """A motion of the unknowns, shape (size,), and of free bodies, shape (n_free, 6)."""

    unknowns: Array
    bodies: Array

    def __add__(self, other: Motion) -> Motion:
        return Motion(self.unknowns + other.unknowns, self.bodies + other.bodies)

    def __mul__(self, by: float) -> Motion:
        return Motion(by * self.unknowns, by * self.bodies)


class Nearby:
    """A model near the present one, and a state of it.

    Parameters
    ----------
    stepper : Stepper
        For what observers see.
    evaluator : Evaluator
        Of the same model.
    state : State
        Its configuration; it reaches the stimulus.
    stimulus : ndarray
        Value of each channel, shape (n_channel,).
    gains : ndarray, optional
        Of the model's laws, shape (n_law,): they are put in place where this model is evaluated.
    description : Description
        Of a run of the model that it is near to.
    """

    def __init__(
        self,
        stepper: Stepper,
        evaluator: Evaluator,
        state: State,
        stimulus: Array,
        gains: Array | None,
        description: Description,
    ):
        self._stepper, self._evaluator, self._stimulus, self._gains = stepper, evaluator, stimulus, gains
        self._near = description
        self.state, self._light = state, light_of(stepper.model)
        self._load_factor = stepper.surroundings.load_factor(state)
        self._reach(state)

    def _reach(self, state: State) -> None:
        """Let materials have reached the stimulus, as far as light gets there."""
        if len(state.transduction):
            place = state.position, state.director1, state.body_position, state.body_rotation
            seen = part_seen(self._light, *place) if self._light.exists else 1.0
            state.transduction[:] = reached_at_rest(self._stepper.model.drives, self._stimulus, seen)

    def _put_gains(self) -> None:
        if self._gains is not None:
            put_gains(self._stepper.model, self._gains)

    def moved(self, motion: Motion) -> State:
        """Return the state after a motion."""
        evaluator, state = self._evaluator, self.state.copy()
        at = evaluator.new()
        evaluator.move(self._stand(state), motion.unknowns, motion.bodies, at)
        evaluator.write_shape(at, state)
        self._reach(state)
        return state

    def gradient(self, state: State) -> Motion:
        """Return the gradient of the potential at a state."""
        self._evaluator.evaluate(self._stand(state))
        return self._sums()

    def factorise(self) -> tuple[Motion, bool]:
        """Factorise the Hessian of the potential; return the gradient, and whether the Hessian is positive definite."""
        at = self._stand(self.state)
        self._evaluator.evaluate(at, second=True)
        found = self._sums()
        try:
            return found, self._evaluator.factorise(at)[0] == 0.0
        except ArithmeticError:
            return found, False

    def gradients_by_gains(self) -> Callable[[Array], Motion]:
        """Return a function of the gains of laws that returns the gradient of the potential at the state."""
        evaluator, model, at = self._evaluator, self._stepper.model, self._stand(self.state)

        def gradient(gains: Array) -> Motion:
            put_gains(model, gains)
            rest = evaluator.rest_strains_of(self.state.transduction)
            evaluator.set_drive(rest.edge, rest.joint, self._load_factor)
            evaluator.evaluate(at)
            return self._sums()

        return gradient

    def _sums(self) -> Motion:
        sums = self._evaluator.sums
        return Motion(sums.gradient.copy(), sums.body.copy())

    def _stand(self, state: State) -> Configuration:
        """Freeze a stage in which all rests, and return its configuration."""
        evaluator, at = self._evaluator, self._evaluator.new()
        self._put_gains()
        evaluator.take_state(state, at)
        rest = evaluator.rest_strains_of(state.transduction)
        evaluator.stand_still(state, at, LENGTH, rest.edge, rest.joint, self._load_factor)
        evaluator.stage.still[0] = AT_REST
        evaluator.start_stage(at)
        return at

    @cached_property
    def _description(self) -> Description:
        """Description with the sections of this model, from which the middle lines of rods are derived."""
        return replace(self._near, strands=tuple(map(strand, self._stepper.model.strands)))

    def values(self, state: State, wanted: Sequence[str]) -> list[Array]:
        """Return quantities at a state, by their names."""
        self._put_gains()
        self._stepper.evaluate(state)
        frame = make_frame(Capture(self._stepper, state), RunStatistics(), 0.0)
        known = {entry.name: entry for entry in entries(self._description, frame.energy, ())}
        in_frames = FrameValues(self._description)
        return [np.asarray(in_frames.of(known[name], frame), dtype=float) for name in wanted]


@dataclass(frozen=True)
class Parameter:
    """A number by which an equilibrium is differentiated.

    Attributes
    ----------
    name : str
    value : float
    scale : float
        What its steps are parts of.
    at : callable
        Returns the model nearby at a value.
    laws : ndarray
        The laws whose gain it is, if nothing is built for it.
    """

    name: str
    value: float
    scale: float
    at: Callable[[float], Nearby]
    laws: Array = field(default_factory=lambda: np.zeros(0, dtype=np.int64))


@dataclass(frozen=True)
class Response:
    """How an equilibrium moves with a parameter.

    Attributes
    ----------
    motion : Motion
        dq/dp.
    correction : Motion
        The last one.
    nearby : list of Nearby
        At `PLACES`, for the step `h`.
    moves : bool
        Whether the shape changes at all.
    """

    motion: Motion
    correction: Motion
    nearby: list[Nearby]
    h: float
    moves: bool


def _slope(values: Sequence[Any], h: float) -> Any:
    """Return the derivative from values at `PLACES`."""
    return ((values[2] + values[1] * -1.0) * 8.0 + (values[3] + values[0] * -1.0) * -1.0) * (1.0 / (6.0 * h))


class Equilibrium:
    """An equilibrium that is differentiated.

    Parameters
    ----------
    stepper : Stepper
    state : State
        Near rest; it is left as it is.
    model_of, stepper_of, state_of : callable
        Make the model of a scene, and the stepper and the first state of a model.
    description : Description
        Of a run of the stepper's model.

    Attributes
    ----------
    residual : float
        Largest displacement that Newton's method still made at `state` [m].

    Raises
    ------
    InputError
        If the state is not at rest.
    SimulationError
        If the equilibrium is unstable.
    """

    def __init__(
        self,
        stepper: Stepper,
        state: State,
        model_of: Callable[[SceneConfig], Model],
        stepper_of: Callable[[Model], Stepper],
        state_of: Callable[[Model], State],
        description: Description,
    ):
        model, self._description = stepper.model, description
        self._model_of, self._stepper_of, self._state_of, self._start = model_of, stepper_of, state_of, state_of(model)
        self.scene, self._size = model.scene, max(rod.path.length for rod in model.scene.rods)
        self._gains = model.drives.law_gain.copy()
        arrays = {name: getattr(model.drives, name) for name in model.drives.names}
        self.model = replace(model, drives=type(model.drives)(**arrays | {"law_gain": self._gains.copy()}))
        self._stepper, self._evaluator = stepper_of(self.model), Evaluator(self.model)
        self._state = state.copy()
        for part in RATES:
            getattr(self._state, part).fill(0.0)
        self._stimulus = stepper.surroundings.stimulus_at(state, float(state.time[0]))
        self._settle()

    def _settle(self) -> None:
        """Let Newton's method make its last corrections, and factorise the Hessian there."""
        self.residual = math.inf
        for last in (False, False, True):
            here = self._here(self._stimulus, self._gains)
            gradient, stable = here.factorise()
            if not stable:
                reason = "the shape is unstable: no equilibrium, call solve_static first, or one that no robot keeps to"
                raise SimulationError(f"gradient: {reason}", float(self._state.time[0]))
            correction = self._solved(gradient)
            self.residual = min(self.residual, self.displacement(correction))
            if not self.residual <= NEAR_REST * self._size:
                raise InputError(
                    f"gradient: the robot is not at rest: Newton's method would still move it by {self.residual:.3g} "
                    f"m, allowed are {NEAR_REST * self._size:.3g} m; call solve_static first"
                )
            if not last:
                self._state = here.moved(correction)
        self._farthest = min(STEP * self._size, OF_GAP * self._evaluator.gap)

    @property
    def positions(self) -> Array:
        """Positions of nodes [m], shape (n_node, 3)."""
        return self._state.position

    @property
    def gains(self) -> Array:
        """Those of laws, a copy, shape (n_law,)."""
        return self._gains.copy()

    def fits(self, model: Model) -> bool:
        """Return whether states of a model have the same unknowns."""
        return model.layout.size == self.model.layout.size and _shapes(self._state_of(model)) == _shapes(self._state)

    def write_shape(self, state: State) -> None:
        """Give a state of the same model, or of one with other numbers, the shape, the stimuli and the loads."""
        for part in ("position", "body_position", *HELD):
            getattr(state, part)[:] = getattr(self._state, part)

    def go_to(self, gains: Array) -> None:
        """Go to the equilibrium with other gains of laws, shape (n_law,).

        Raises
        ------
        SimulationError
            If there is none; nothing is changed then.
        """
        before, state = self._gains.copy(), self._state.copy()
        try:
            self._gains[:] = gains
            put_gains(self.model, gains)
            solve_static(self._stepper, self._state)
            self._settle()
        except SimulationError:
            self._gains[:], self._state = before, state
            self._settle()
            raise

    def velocities(self, parameters: Sequence[Parameter]) -> Array:
        """Return dx/dp of nodes by each parameter from one difference each: exact where forces are linear in it, as in
        gains, shape (n_node, 3, n_parameter).
        """
        here = self._here(self._stimulus, self._gains)
        gradient, columns = here.gradient(here.state), []
        places, gains = self.model.layout.node[:, None] + np.arange(3), here.gradients_by_gains()
        for parameter in parameters:
            h, shift = STEP * parameter.scale, 0.0
            if parameter.laws.size:
                changed = self._gains.copy()
                changed[parameter.laws] += h
                other = gains(changed)
            else:
                near = parameter.at(parameter.value + h)
                other, shift = near.gradient(near.state), near.state.position - self._state.position
            motion = self._solved((other + gradient * -1.0) * (1.0 / h))
            columns.append(motion.unknowns[places] + shift / h)
        put_gains(self.model, self._gains)
        return np.stack(columns, axis=-1)

    def _here(self, stimulus: Array, gains: Array) -> Nearby:
        """Return the present model with other stimuli or gains."""
        return Nearby(self._stepper, self._evaluator, self._state.copy(), stimulus, gains, self._description)

    def _with(self, change: dict[str, float]) -> Nearby:
        """Return the model with another number in its scene."""
        (path, value), *_ = change.items()
        try:
            model = self._model_of(load_content(scene_content(self.scene), change))
        except SceneError as error:
            raise SceneError(f"gradient: {path} cannot be varied about its value, to {value:.9g}: {error}") from error
        stepper = self._stepper_of(model)
        state = self._carried(model)
        if state is None:
            raise InputError(f"gradient: {path} changes how many unknowns the model has")
        stimulus = stepper.surroundings.stimulus_at(state, float(state.time[0]))
        return Nearby(stepper, Evaluator(model), state, stimulus, None, self._description)

    def _carried(self, model: Model) -> State | None:
        """Return the state of another model that departs from its start as the present one does."""
        state, here, start = self._state_of(model), self._state, self._start
        if not self.fits(model):
            return None
        turned = state.body_rotation @ start.body_rotation.swapaxes(1, 2)
        same = np.array_equal(state.body_rotation, start.body_rotation)
        for part in ("position", "body_position"):
            mine = getattr(state, part)
            mine[:] = getattr(here, part) + (mine - getattr(start, part))
        for part in HELD:
            getattr(state, part)[:] = getattr(here, part)
        if not same:
            state.body_rotation[:] = turned @ here.body_rotation
        if not np.array_equal(state.position, here.position):
            before, after = (_tangents(self.model, of) for of in (here.position, state.position))
            leaning = np.einsum("ki,ki->k", after, state.director1) / (1.0 + np.einsum("ki,ki->k", before, after))
            state.director1 -= leaning[:, None] * (before + after)
        return state

    def _solved(self, gradient: Motion) -> Motion:
        """Return minus the inverse of the Hessian times a gradient."""
        return Motion(*self._evaluator.newton_step(gradient.unknowns, gradient.bodies))

    def displacement(self, motion: Motion) -> float:
        """Return the largest displacement in a motion [m]; angles count with the longest rod as their radius."""
        places = self.model.layout.node[:, None] + np.arange(3)
        lengths = np.linalg.norm(motion.unknowns[places], axis=1).max()
        turns = [motion.unknowns[self.model.rods.edge_unknown], motion.bodies[:, 3:].ravel()]
        angle = max((np.abs(part).max(initial=0.0) for part in turns), default=0.0)
        return float(max(lengths, np.abs(motion.bodies[:, :3]).max(initial=0.0), self._size * angle))

    def parameters(self, names: Sequence[str]) -> dict[str, list[Parameter]]:
        """Return parameters by the names that users give them: one, or those of a list of numbers.

        Raises
        ------
        InputError, SceneError
            If there is no such channel or path, or it has no numbers.
        """
        found = {name: list(self._parameters_of(name)) for name in names}
        gains = [p for of in found.values() for p in of if _GAIN.fullmatch(p.name)]
        laws = self._laws_of(gains)
        return {
            name: [self._of_laws(p, laws[p.name]) if p.name in laws else p for p in of] for name, of in found.items()
        }

    def _parameters_of(self, name: str) -> Iterator[Parameter]:
        channels = list(self.scene.stimuli)
        if name in channels:
            k, channel = channels.index(name), self.scene.stimuli[name]

            def driven(value: float) -> Nearby:
                stimulus = self._stimulus.copy()
                stimulus[k] = value
                return self._here(stimulus, self._gains)

            yield Parameter(name, float(self._stimulus[k]), channel.maximum - channel.minimum, driven)
            return
        try:
            change = read_overrides({name: 0.0})[0]
            holder, place = change.find(scene_content(self.scene))
        except SceneError as error:
            told = str(error).partition(": ")[2]
            channel = f"; channels of stimuli are {', '.join(channels)}" if channels else ""
            raise SceneError(f"gradient: {name}: {told}{channel}") from error
        held = holder[place]
        of_list = isinstance(held, list) and bool(held) and all(isinstance(v, float | int) for v in held)
        for end, value in ((f".{k}", v) for k, v in enumerate(held)) if of_list else (("", held),):
            if isinstance(value, bool) or not isinstance(value, float):
                kind = "a whole number" if type(value) is int else "no number"
                raise InputError(f"gradient: {name} is {kind} in this scene, by which nothing can be differentiated")
            path = name + end
            yield Parameter(path, value, abs(value) or 1.0, lambda value, path=path: self._with({path: value}))

    def _laws_of(self, gains: list[Parameter]) -> dict[str, Array]:
        """Return which laws each gain is that of, where nothing else of the model depends on it."""
        if not gains:
            return {}
        changed = {p.name: p.value + STEP * (1.0 + k / len(gains)) * p.scale for k, p in enumerate(gains)}
        other = self._model_of(load_content(scene_content(self.scene), changed))
        if not alike_but_gains(self.model, other):
            return {}
        laws = {name: np.flatnonzero(other.drives.law_gain == value) for name, value in changed.items()}
        moved = np.flatnonzero(other.drives.law_gain != self._gains)
        told = np.sort(np.concatenate(list(laws.values())))
        return laws if np.array_equal(told, moved) and all(of.size for of in laws.values()) else {}

    def _of_laws(self, parameter: Parameter, laws: Array) -> Parameter:
        """Return a parameter that is the gain of laws, for which nothing is built."""

        def gained(value: float) -> Nearby:
            gains = self._gains.copy()
            gains[laws] = value
            return self._here(self._stimulus, gains)

        return replace(parameter, at=gained, laws=laws)

    def respond(self, parameter: Parameter) -> Response:
        """Return how the equilibrium moves with a parameter.

        Raises
        ------
        SimulationError
            If the corrections do not get small.
        """
        h = STEP * parameter.scale
        while True:
            nearby = [parameter.at(parameter.value + place * h) for place in PLACES]
            gradients = [of.gradient(of.state) for of in nearby]
            motion = self._solved(_slope(gradients, h))
            shift = max(np.abs(of.state.position - self._state.position).max() for of in nearby)
            travel = shift + h * self.displacement(motion)
            if travel <= self._farthest:
                break
            h *= max(0.5 * self._farthest / travel, 1e-3) if math.isfinite(travel) else 1e-3
            if h < NOTHING * parameter.scale:
                raise self._failure(parameter, travel)
        correction, moves = motion, travel > NOTHING * self._size
        before = math.inf
        for _ in range(MOST if moves else 0):
            shapes = [of.moved(motion * (place * h)) for of, place in zip(nearby, PLACES, strict=True)]
            correction = self._solved(_slope([of.gradient(s) for of, s in zip(nearby, shapes, strict=True)], h))
            part = self.displacement(correction) / self.displacement(motion)
            if not part < before:
                break
            motion, before = motion + correction, part
            if part <= CONVERGED:
                break
        if moves and not before <= GOOD:
            raise self._failure(parameter, before)
        return Response(motion, correction, nearby, h, moves)

    def _failure(self, parameter: Parameter, left: float) -> SimulationError:
        reason = f"{parameter.name}: corrections do not get small ({left:.3g} of the whole is left)"
        remedy = "the equilibrium is about to become unstable, or its forces depend on it in jumps"
        return SimulationError(f"gradient: {reason}; {remedy}", float(self._state.time[0]))


def _shapes(state: State) -> list[tuple[int, ...]]:
    return [getattr(state, part).shape for part in ("position", "body_position", *HELD)]


def _tangents(model: Model, position: Array) -> Array:
    """Return the unit tangents of edges, shape (n_edge, 3)."""
    vector = position[model.rods.edge_node + 1] - position[model.rods.edge_node]
    return vector / np.linalg.norm(vector, axis=1, keepdims=True)


def differentiate(here: Equilibrium, known: Collection[str], of: Sequence[str], to: Sequence[str]) -> Gradient:
    """Return the derivatives of quantities by parameters.

    Raises
    ------
    InputError
        If there is no such quantity or parameter, or a parameter acts on nothing.
    """
    for name in of:
        if name not in known:
            raise unknown_quantity(name, known)
    derivatives: dict[tuple[str, str], Array] = {}
    errors: dict[tuple[str, str], Array] = {}
    for name, parameters in here.parameters(to).items():
        columns = [_column(here, parameter, of) for parameter in parameters]
        single = len(parameters) == 1 and parameters[0].name == name
        for k, quantity in enumerate(of):
            for found, part in ((derivatives, 0), (errors, 1)):
                stacked = np.stack([column[k][part] for column in columns], axis=-1)
                found[quantity, name] = stacked[..., 0] if single else stacked
    return Gradient(derivatives, errors, here.residual)


def _column(here: Equilibrium, parameter: Parameter, wanted: Sequence[str]) -> list[tuple[Array, Array]]:
    """Return the derivative of each quantity by a parameter, and the size of its error."""
    response = here.respond(parameter)
    slopes, largest = [], []
    for motion in (response.motion, response.motion + response.correction * -1.0):
        rows = [
            nearby.values(nearby.moved(motion * (place * response.h)), wanted)
            for nearby, place in zip(response.nearby, PLACES, strict=True)
        ]
        slopes.append([_slope(row, response.h) for row in zip(*rows, strict=True)])
        largest = [max(float(np.abs(value).max(initial=0.0)) for value in row) for row in zip(*rows, strict=True)]
    moved = [response.h * np.abs(s).max(initial=0.0) for s in slopes[0]]
    if not response.moves and all(m <= NOTHING * most for m, most in zip(moved, largest, strict=True)):
        raise InputError(
            f"gradient: {parameter.name} acts on nothing here: neither the shape at rest nor "
            f"{', '.join(wanted)} depends on it; leave it out"
        )
    return [(one, np.abs(one - other)) for one, other in zip(*slopes, strict=True)]
