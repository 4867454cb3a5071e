"""Origins and predictions of the stages of a step, and where the step ends.

Positions and momenta advance as `integrate.method` says. What is no vector needs a word:

- A rotation advances along rotation vectors: R̄ = exp(h a f₁) … Rₙ with f = log(R R̄ᵀ)/(γ h) of each earlier stage. Over
  the stage, inertia prefers R̃ = exp(γ h ω̃) R̄ with I(R̃) ω̃ = L̄: without a moment, the angular momentum L stays what
  it was. Given the moment that acts at the end of the stage, L = L̄ + γ h × moment and ω = I(R)⁻¹ L. What ω differs by
  from the rotation's own log(R R̄ᵀ)/(γ h) is of second order.
- What a body holds has the body's velocity, v + ω × r, not that of a chord of its arc, which differs at first order. So
  its origin is where R̄ := R̃ − γ h ω × R̃ has it: (R − R̄)/(γ h) is dR/dt to second order. A prescribed body has its
  own velocity, not that of a chord either: the same with its pose at the end of the stage and its rates.
- The momentum of the fluid is no fixed multiple of a velocity. Where the end of a step lies beyond its last stage, both
  are extrapolated, and what they differ by at the end (second order in h) is kept in the state; the momentum counts.
- The angle of an edge counts from the start of the stage, where its frame was last re-based (`StepContext.start`); its
  origin lies before or behind that.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..kinematics.rotation import rotation_matrix, skew
from ..model.model import Model
from ..model.rest_strains import RestStrains
from ..model.state import State
from ..solve.configuration import Configuration
from ..solve.terms.fluid import momentum_of_fluid
from ..solve.terms.term import StepContext

Array = np.ndarray
SPIN_ITERATIONS = 50
SPIN_CHANGE = 1e-15
"""Relative change of ω̃ at which its iteration ends."""


@dataclass
class Point:
    """Positions and momenta at the start of a step, at the origin of a stage, or at the end of one.

    Attributes
    ----------
    position : Array
        Of nodes [m], shape (n_node, 3).
    body_position : Array
        Of all bodies [m], shape (n_body, 3).
    turn : Array
        Of edges about their tangents since the start of the step [rad], shape (n_edge,).
    velocity, spin, body_velocity : Array
        Of nodes [m/s], edges [rad/s] and free bodies [m/s].
    angular_momentum : Array
        Of free bodies about their mass centres [N m s], shape (n_free, 3).
    fluid_momentum : Array
        Of the fluid at nodes [N s], shape (n_node, 3) or (0, 3).
    rotation : Array
        Of all bodies, shape (n_body, 3, 3).
    """

    position: Array
    body_position: Array
    turn: Array
    velocity: Array
    spin: Array
    body_velocity: Array
    angular_momentum: Array
    fluid_momentum: Array
    rotation: Array


@dataclass(frozen=True)
class Prescribed:
    """Motion of prescribed bodies at the time of a stage.

    Attributes
    ----------
    index : Array
        Which bodies.
    position, rotation : Array
        Of all bodies [m], shapes (n_body, 3), (n_body, 3, 3).
    rates : Array
        Velocity [m/s] and angular velocity [rad/s] of all bodies, shape (n_body, 6).
    """

    index: Array
    position: Array
    rotation: Array
    rates: Array


def start_point(model: Model, state: State, start: Configuration) -> Point:
    """The start of a step."""
    free = model.bodies.body_of_free
    return Point(
        position=start.position.copy(),
        body_position=state.body_position.copy(),
        turn=np.zeros(model.edge_count),
        velocity=state.velocity.copy(),
        spin=state.spin.copy(),
        body_velocity=state.body_velocity[free],
        angular_momentum=_times(inertia_tensors(model, start.body_rotation), state.body_angular_velocity[free]),
        fluid_momentum=momentum_of_fluid(model, start, state.velocity) + state.fluid_excess,
        rotation=state.body_rotation.copy(),
    )


def predict(
    model: Model,
    origin: Point,
    start: Configuration,
    turned: Array,
    length: float,
    rest: RestStrains,
    load_factor: Array,
    momentum_length: float | None = None,
    prescribed: Prescribed | None = None,
) -> StepContext:
    """Frozen data of a stage; puts the origin of what bodies hold to where it has their velocity.

    Parameters
    ----------
    origin : Point
    start : Configuration
        From which the stage is solved: the end of the stage before, or the start of the step.
    turned : Array
        Turn of edges from the start of the step to `start` [rad], shape (n_edge,).
    length : float
        γ h [s].
    rest : RestStrains
    load_factor : Array
        Like `rest` at the time of the stage.
    momentum_length : float, optional
        γ′ h [s], if it is another.
    prescribed : Prescribed, optional
        Without it, prescribed bodies are at rest.
    """
    free = model.bodies.body_of_free
    rotation = np.empty((len(free), 3, 3))
    origin_rotation = np.concatenate([origin.rotation, np.eye(3)[None]])
    for place, b in enumerate(free):
        inertia = model.bodies.second_moment[place], origin.rotation[b], origin.angular_momentum[place]
        spin = _spin_without_moment(*inertia, length)
        rotation[place] = rotation_matrix(length * spin) @ origin.rotation[b]
        origin_rotation[b] = rotation[place] - length * skew(spin) @ rotation[place]
    for b in prescribed.index if prescribed else ():
        rates = prescribed.rates[b]
        origin.body_position[b] = prescribed.position[b] - length * rates[:3]
        origin_rotation[b] = prescribed.rotation[b] - length * skew(rates[3:]) @ prescribed.rotation[b]
    held = model.attached_body
    arms = np.einsum("kij,kj->ki", origin_rotation[held], model.attached_position)
    origin.position[model.attached_node] = origin.body_position[held] + arms
    return StepContext(
        length=length,
        start=start,
        origin_position=origin.position,
        origin_turn=origin.turn - turned,
        origin_body_position=origin.body_position[free],
        origin_body_rotation=origin_rotation[free],
        origin_place=np.concatenate([origin.body_position, np.zeros((1, 3))]),
        origin_rotation=origin_rotation,
        predicted_position=origin.position + length * origin.velocity,
        predicted_turn=origin.turn - turned + length * origin.spin,
        predicted_body_position=origin.body_position[free] + length * origin.body_velocity,
        predicted_body_rotation=rotation,
        origin_fluid_momentum=origin.fluid_momentum,
        rest=rest,
        load_factor=load_factor,
        length_of_momenta=momentum_length,
    )


def inertia_tensors(model: Model, rotation: Array) -> Array:
    """Inertia tensors of free bodies in the world's axes [kg m²], shape (n_free, 3, 3)."""
    second = model.bodies.second_moment
    tensor = np.trace(second, axis1=1, axis2=2)[:, None, None] * np.eye(3) - second
    return rotation @ tensor @ rotation.transpose(0, 2, 1)


def _times(matrices: Array, vectors: Array) -> Array:
    return np.einsum("bij,bj->bi", matrices, vectors)


def _spin_without_moment(second_moment: Array, rotation: Array, momentum: Array, length: float) -> Array:
    """ω̃ with I(exp(length ω̃) R̄) ω̃ = L̄ [rad/s], by iteration; at once for a ball."""
    if not momentum.any():
        return np.zeros(3)
    tensor = np.trace(second_moment) * np.eye(3) - second_moment
    turned, spin = rotation, np.zeros(3)
    for _ in range(SPIN_ITERATIONS):
        previous, spin = spin, np.linalg.solve(turned @ tensor @ turned.T, momentum)
        if np.abs(spin - previous).max() <= SPIN_CHANGE * np.abs(spin).max():
            break
        turned = rotation_matrix(length * spin) @ rotation
    return spin
