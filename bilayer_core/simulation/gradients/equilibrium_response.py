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
from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bilayer_core.engine.evaluator import Evaluator
from bilayer_core.errors import InputError, SceneError, SimulationError
from bilayer_core.model.model import Model
from bilayer_core.model.state import State
from bilayer_core.observed.frame import Description
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.loader import load_content, scene_content
from bilayer_core.simulation.equilibrium import solve_static
from bilayer_core.simulation.gains import put_gains
from bilayer_core.simulation.gradients.nearby import (
    LENGTH,
    PLACES,
    Builders,
    Motion,
    Nearby,
    carry_directors,
    known_quantities,
    refuse_other_plane,
    slope,
)
from bilayer_core.simulation.gradients.parameters import (
    SMALL,
    STEP,
    Parameter,
    numbers_of,
    scale_of,
    scene_with,
    shares_of,
)
from bilayer_core.simulation.gradients.value_places import ByPlace, groups_of
from bilayer_core.simulation.stepper import Stepper

Array = np.ndarray
NEAR_REST = 1e-6
"""Of the longest rod: displacement that Newton's method may still make at what counts as an equilibrium."""
OF_GAP = 1e-2
"""Largest displacement over a step of a parameter, of the smallest gap: barriers are steep."""
CONVERGED, GOOD, MOST = 1e-9, 1e-4, 20
"""Of the largest part of dq/dp: the correction that ends them, and the largest last one; how many there may be."""
FREELY = 1e-6
"""Part of the motion of a free rod under a couple from which on nothing holds a robot: all its turns below 1 rad/s."""
NOTHING = 1e-14
"""Of the longest rod, or of a quantity: change over h that is rounding."""
RATES = ("velocity", "spin", "strain_rate", "body_velocity", "body_angular_velocity", "has_history", "light_rate")
HELD = ("time", "director1", "twist", "body_rotation", "memory", "override", "pose_goal", "friction")
"""Parts of the present state that a model nearby has as well."""


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


class Equilibrium:
    """An equilibrium that is differentiated.

    Parameters
    ----------
    stepper : Stepper
    state : State
        Near rest; it is left as it is.
    builders : Builders
    description : Description
        Of a run of the stepper's model.

    Attributes
    ----------
    residual : float
        Largest displacement that Newton's method still made at `state` [m].
    scene : SceneConfig
        With the present gains.

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
        builders: Builders,
        description: Description,
    ):
        model, self._description, self._builders = stepper.model, description, builders
        self._start = builders.state_of(model)
        self._scene, self._size = model.scene, max(rod.path.length for rod in model.scene.rods)
        self._gains, self._changes = model.drives.law_gain.copy(), dict[str, float]()
        arrays = {name: getattr(model.drives, name) for name in model.drives.names}
        self.model = replace(model, drives=type(model.drives)(**arrays | {"law_gain": self._gains.copy()}))
        self._stepper, self._evaluator = builders.stepper_of(self.model), Evaluator(self.model)
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
    def known(self) -> Collection[str]:
        """Names of quantities that may be differentiated."""
        return known_quantities(self._stepper, self._state, self._description)

    @property
    def floats(self) -> bool:
        """True if nothing keeps the robot from turning."""
        mass, position = self.model.rods.node_mass[:, None], self._state.position
        arm = position - (mass * position).sum(axis=0) / mass.sum()
        places, here = self.model.layout.node[:, None] + np.arange(3), self._here(self._stimulus, self._gains)
        for axis in [self.model.plane.normal] if self.model.plane.exists else np.eye(3):
            push = here.gradient(here.state) * 0.0
            push.unknowns[places] = mass * np.cross(axis, arm)
            if self.displacement(self._solved(push)) < FREELY * LENGTH**2 * np.abs(arm).max():
                return False
        return True

    @property
    def positions(self) -> Array:
        """Positions of nodes [m], shape (n_node, 3)."""
        return self._state.position

    @property
    def rotations(self) -> Array:
        """Rotations of bodies, shape (n_body, 3, 3)."""
        return self._state.body_rotation

    @property
    def scene(self) -> SceneConfig:
        if self._changes:
            self._scene, self._changes = load_content(scene_content(self._scene), self._changes), {}
        return self._scene

    def fits(self, model: Model) -> bool:
        """Return whether states of a model have the same unknowns."""
        return self._fits(model, self._builders.state_of(model))

    def _fits(self, model: Model, state: State) -> bool:
        return model.layout.size == self.model.layout.size and _shapes(state) == _shapes(self._state)

    def write_shape(self, state: State) -> None:
        """Give a state of the same model, or of one with other numbers, the shape, the stimuli and the loads."""
        for part in ("position", "body_position", *HELD):
            getattr(state, part)[:] = getattr(self._state, part)

    def go_to(self, gains: Sequence[Parameter], values: Sequence[float]) -> None:
        """Go to the equilibrium with other values of parameters, all of which are gains of laws.

        Raises
        ------
        SimulationError
            If there is none; nothing is changed then.
        """
        before = self.kept()
        try:
            for parameter, value in zip(gains, values, strict=True):
                self._gains[:] = np.where(parameter.share != 0.0, value * parameter.share, self._gains)
            self._changes = self._changes | {of.name: value for of, value in zip(gains, values, strict=True)}
            put_gains(self.model, self._gains)
            solve_static(self._stepper, self._state)
            self._settle()
        except SimulationError:
            self.return_to(before)
            raise

    def kept(self) -> tuple[Any, ...]:
        """Return gains, scene and shape for `return_to`."""
        return self._gains.copy(), self._scene, self._changes, self._state.copy()

    def return_to(self, kept: tuple[Any, ...]) -> None:
        """Go back to gains and the equilibrium that was found with them."""
        self._gains[:], self._scene, self._changes, self._state = *kept[:3], kept[3].copy()
        self._settle()

    def velocities(self, parameters: Sequence[Parameter]) -> tuple[Array, Array]:
        """Return dx/dp of nodes and dφ/dp of bodies by each parameter from one difference each: exact where forces are
        linear in it, as in gains, else to 1e-5; shapes (n_node, 3, n_parameter) and (n_body, 3, n_parameter).
        """
        here, found = self._here(self._stimulus, self._gains), np.zeros((*self.positions.shape, len(parameters)))
        turns, free = np.zeros((len(self.rotations), 3, len(parameters))), self._evaluator.problem.bodies.body_of_free
        gradient, places = here.gradient(here.state), self.model.layout.node[:, None] + np.arange(3)
        gains = here.gradients_by_gains()

        def note(k: int, h: float, change: Motion, shift: Array | float = 0.0) -> None:
            motion = self._solved(change * (1.0 / h))
            found[..., k], turns[free, :, k] = motion.unknowns[places] + shift / h, motion.bodies[:, 3:]

        for k, parameter in enumerate(parameters):
            if parameter.share.size:
                h = STEP * parameter.scale
                note(k, h, gains(self._gains + h * parameter.share) + gradient * -1.0)
        put_gains(self.model, self._gains)
        others = [parameter for parameter in parameters if not parameter.share.size]
        numbers = [k for k, parameter in enumerate(parameters) if not parameter.share.size]
        for k, of in zip(numbers, self._differences(others, gradient), strict=True):
            note(k, SMALL * parameters[k].scale, *of)
        put_gains(self.model, self._gains)
        return found, turns

    def _differences(self, parameters: Sequence[Parameter], gradient: Motion) -> list[tuple[Motion, Array]]:
        """Return how the gradient and the positions differ in models with each of some parameters changed a little,
        several at once where places tell them apart.
        """

        def change(near: Nearby) -> tuple[Motion, Array]:
            return near.gradient(near.state) + gradient * -1.0, near.state.position - self._state.position

        def changes_in(scene: SceneConfig) -> list[Array]:
            motion, shift = change(self._in(scene, "a profile"))
            return [motion.unknowns, motion.bodies, shift]

        by_place, found = ByPlace(self.model, self.scene, changes_in), {}
        values = [parameter.value + SMALL * parameter.scale for parameter in parameters]
        for group in groups_of(self.scene, self.model, parameters):
            told = None
            if len(group) > 1:
                with suppress(InputError, SceneError):  # told by the value that is to blame, alone
                    scene = scene_with(self.scene, {parameters[k].name: values[k] for k in group})
                    told = by_place.told(scene, list(group.values()))
            if told is None:
                found |= {k: change(parameters[k].at(values[k])) for k in group}
            else:
                found |= {k: (Motion(*of[:2]), of[2]) for k, of in zip(group, told, strict=True)}
        return [found[k] for k in range(len(parameters))]

    def _here(self, stimulus: Array, gains: Array) -> Nearby:
        """Return the present model with other stimuli or gains."""
        return Nearby(self._stepper, self._evaluator, self._state.copy(), stimulus, gains, self._description)

    def _in(self, scene: SceneConfig, path: str) -> Nearby:
        """Return the model of the scene in which a path has another number."""
        model = self._builders.model_of(scene)
        refuse_other_plane(self.model, model, path)
        stepper = self._builders.stepper_of(model)
        state = self._carried(model)
        if state is None:
            raise InputError(f"gradient: {path} changes how many unknowns the model has")
        stimulus = stepper.surroundings.stimulus_at(state, float(state.time[0]))
        return Nearby(stepper, Evaluator(model), state, stimulus, None, self._description)

    def _carried(self, model: Model) -> State | None:
        """Return the state of another model that departs from its start as the present one does."""
        state, here, start = self._builders.state_of(model), self._state, self._start
        if not self._fits(model, state):
            return None
        turned = state.body_rotation @ start.body_rotation.swapaxes(1, 2)
        same = np.array_equal(state.body_rotation, start.body_rotation)
        for part in ("position", "body_position"):
            mine = getattr(state, part)
            mine[:] = getattr(here, part) + (mine - getattr(start, part))
        for part in HELD:
            getattr(state, part)[:] = getattr(here, part)
        for part in RATES:
            getattr(state, part).fill(0.0)
        if not same:
            state.body_rotation[:] = turned @ here.body_rotation
        carry_directors(model, here.position, state)
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
        numbers = [(p.name, p.value) for of in found.values() for p in of]
        shares = shares_of(replace(self.model, scene=self.scene), self._builders.model_of, numbers)
        return {
            name: [self._of_laws(p, shares[p.name]) if p.name in shares else p for p in of]
            for name, of in found.items()
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
        for path, value in numbers_of(self.scene, name):
            yield Parameter(
                path,
                value,
                scale_of(value),
                lambda value, path=path: self._in(scene_with(self.scene, {path: value}), path),
            )

    def _of_laws(self, parameter: Parameter, share: Array) -> Parameter:
        """Return a parameter that is the gain of laws, for which nothing is built."""

        def gained(value: float) -> Nearby:
            return self._here(self._stimulus, np.where(share != 0.0, value * share, self._gains))

        return replace(parameter, at=gained, share=share)

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
            motion = self._solved(slope(gradients, h))
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
            correction = self._solved(slope([of.gradient(s) for of, s in zip(nearby, shapes, strict=True)], h))
            part = h * self.displacement(correction) / travel
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
