"""Models near the present one, states of theirs, and differences of what they say."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from bilayer_core.engine.evaluator import Evaluator
from bilayer_core.errors import InputError
from bilayer_core.log.run.frame_values import FrameValues
from bilayer_core.log.run.quantities import entries
from bilayer_core.model.lit_elements import light_of, part_seen
from bilayer_core.model.model import Model
from bilayer_core.model.records.step import AT_REST, Configuration
from bilayer_core.model.state import State, reached_at_rest
from bilayer_core.observed.frame import Description
from bilayer_core.scene.config import SceneConfig
from bilayer_core.simulation.capture import Capture, make_frame
from bilayer_core.simulation.gains import put_gains
from bilayer_core.simulation.observation import strand
from bilayer_core.simulation.statistics import RunStatistics
from bilayer_core.simulation.stepper import Stepper

Array = np.ndarray
LENGTH = 1e3
"""Over which inertia acts [s]: it keeps what nothing holds from drifting, and corrections take it out again."""
PLACES = (-1.0, -0.5, 0.5, 1.0)
"""Of a step h of a parameter, where models are looked at: for differences of fourth order."""
SAME_PLANE = 1e-12
"""Difference of the normals of two planes that are one."""


def slope(values: Sequence[Any], h: float) -> Any:
    """Return the derivative from values at `PLACES`."""
    return ((values[2] + values[1] * -1.0) * 8.0 + (values[3] + values[0] * -1.0) * -1.0) * (1.0 / (6.0 * h))


@dataclass(frozen=True)
class Builders:
    """Make the model of a scene, and the stepper and the first state of a model."""

    model_of: Callable[[SceneConfig], Model]
    stepper_of: Callable[[Model], Stepper]
    state_of: Callable[[Model], State]


def refuse_other_plane(model: Model, other: Model, path: str, moves: bool = True) -> None:
    """Refuse a number that turns the plane of a model of dimension 2, in which its unknowns are, and one that moves it
    unless the plane `moves` with all that is there.
    """
    if not model.plane.exists:
        return
    normal, shift = model.plane.normal, other.start_position[0] - model.start_position[0]
    away = [] if moves else [shift @ normal]
    if not np.allclose([*(other.plane.normal - normal), *away], 0.0, atol=SAME_PLANE):
        raise InputError(
            f"gradient: {path} {'turns' if moves else 'turns or moves'} the plane in which this model moves; allowed "
            "are numbers that keep it, or `solver.dimension: 3`"
        )


def known_quantities(stepper: Stepper, state: State, description: Description) -> dict[str, Any]:
    """Return entries of quantities at a state, by the names by which may be differentiated."""
    stepper.evaluate(state)
    frame = make_frame(Capture(stepper, state), RunStatistics(), 0.0)
    return {
        entry.name: entry
        for entry in entries(description, frame.energy, ())
        if not entry.name.startswith("stimulus/") and not entry.name.endswith("/frame")
    }


def carry_directors(model: Model, before: Array, state: State) -> None:
    """Carry the directors of a state from where nodes were, shape (n_node, 3), to where they are."""
    if np.array_equal(before, state.position):
        return
    first, second = (tangents_of(model.rods.edge_node, position) for position in (before, state.position))
    state.director1[:] = carried(first, second, state.director1)


def carried(first: Array, second: Array, director: Array) -> Array:
    """Return directors, carried along with tangents from the first to the second, all of shape (n_edge, 3)."""
    leaning = np.einsum("ki,ki->k", second, director) / (1.0 + np.einsum("ki,ki->k", first, second))
    return director - leaning[:, None] * (first + second)


def values_of(stepper: Stepper, state: State, wanted: Sequence[str], description: Description) -> list[Array]:
    """Return quantities at a state of the stepper's model, by their names; rods are as `description` has them."""
    stepper.evaluate(state)
    frame = make_frame(Capture(stepper, state), RunStatistics(), 0.0)
    known = {entry.name: entry for entry in entries(description, frame.energy, ())}
    in_frames = FrameValues(description)
    return [np.asarray(in_frames.of(known[name], frame), dtype=float) for name in wanted]


def described(near: Description, stepper: Stepper) -> Description:
    """Return a description with the sections of a model nearby, from which the middle lines of rods are derived."""
    return replace(near, strands=tuple(map(strand, stepper.model.strands)))


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
        self.state, self.model, self._light = state, stepper.model, light_of(stepper.model)
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
        return described(self._near, self._stepper)

    def values(self, state: State, wanted: Sequence[str]) -> list[Array]:
        """Return quantities at a state, by their names."""
        self._put_gains()
        return values_of(self._stepper, state, wanted, self._description)


def tangents_of(edge_node: Array, position: Array) -> Array:
    """Return the unit tangents of edges, shape (n_edge, 3)."""
    vector = position[edge_node + 1] - position[edge_node]
    return vector / np.linalg.norm(vector, axis=1, keepdims=True)
