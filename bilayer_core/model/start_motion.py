"""Velocities at the start: rods move as what holds them, and a whole robot may be set in motion.

A rigid motion has the velocity v(x) = V + Ω × (x − X) at the point x, and Ω everywhere. What a free body says of its
velocity is its rigid motion about its position. From there it goes along rods and joints to free bodies that say
nothing, and a rod has the motion of the body that holds it: nothing is strained at first. Between two bodies that move
differently, A at its start and B at its end, a rod has

    v = (1 − w) v_A(x) + w v_B(x),   w = 3 u² − 2 u³,   u the part of its length up to there,

which agrees with both and, as w′ is 0 at its ends, with the directions in which they hold it. Its edges turn about
their tangent with (1 − w) Ω_A + w Ω_B. Prescribed bodies rest at the start, guided ones move as they say.

`velocity` and `angular_velocity` of the scene are one rigid motion, about the mass centre of the robot: its rods and
the free bodies that hold them, or are joined to these, but for those that say how they move.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from bilayer_core.model.bodies import robot_bodies
from bilayer_core.model.free_motions import start_rates
from bilayer_core.model.model import Model
from bilayer_core.scene.body import Free, Guided
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.rod import Rod

Array = np.ndarray


class State(Protocol):
    """A state, as far as it moves: see `bilayer_core.model.state.State`."""

    position: Array
    director1: Array
    velocity: Array
    spin: Array
    body_position: Array
    body_velocity: Array
    body_angular_velocity: Array
    strain_rate: Array


@dataclass(frozen=True)
class RigidMotion:
    """A rigid motion: V of the point `about` [m/s], and Ω [rad/s], in the axes of the world, shapes (3,)."""

    velocity: Array
    angular_velocity: Array
    about: Array

    def at(self, points: Array) -> Array:
        """Return the velocities of points [m/s], shape (n, 3)."""
        return self.velocity + np.cross(self.angular_velocity, points - self.about)


REST = RigidMotion(np.zeros(3), np.zeros(3), np.zeros(3))


def set_in_motion(model: Model, state: State) -> None:
    """Give everything in a state the velocity with which the scene starts it, where it is in the state."""
    scene, links = model.scene, links_of(model)
    own = {index: motion for index, motion in enumerate(_own_motions(scene, state)) if motion is not None}
    robot = robot_bodies(scene, (body for held in links.values() for body in held if body is not None), own)
    whole = _whole_motion(model, state, robot)
    motions = own | dict.fromkeys(robot, whole) if whole else _spread(scene, links, own, state)
    for body, motion in motions.items():
        state.body_velocity[body] = motion.at(state.body_position[body])
        state.body_angular_velocity[body] = motion.angular_velocity
    rods = {copy.name: copy.rod for rod in scene.rods for copy in rod.copies}
    for name, held in links.items():
        start, end = (None if body is None else motions.get(body, REST) for body in held)
        first, last = start or end, end or start
        if first is None:
            first = last = _own_motion(model, state, name, rods[name]) or whole or REST
        _move_rod(model, state, name, rods[name], first, last)
    rates = start_rates(scene, state.body_velocity, state.body_angular_velocity)
    before = model.strain_count + len(model.impact_pairs)
    state.strain_rate[before : before + len(rates)] = rates


def links_of(model: Model) -> dict[str, tuple[int | None, int | None]]:
    """Return the bodies that hold start and end of each rod, by its name; None at a free end."""
    holder = dict(zip(model.constrained.node.tolist(), model.constrained.body.tolist(), strict=True))
    found: dict[str, tuple[int | None, int | None]] = {}
    for strand in model.strands:
        before = found.get(strand.rod, (None, None))
        ends = holder.get(strand.first_node), holder.get(strand.first_node + strand.node_count - 1)
        start, end = (was if now is None else now for was, now in zip(before, ends, strict=True))
        found[strand.rod] = start, end
    return found


def joined_bodies(scene: SceneConfig) -> list[tuple[int, int]]:
    """Return the two bodies of each joint."""
    places = {body.name: index for index, body in enumerate(scene.bodies)}
    return [(places[first], places[second]) for first, second in (joint.bodies for joint in scene.joints)]


def _own_motions(scene: SceneConfig, state: State) -> Iterator[RigidMotion | None]:
    """Yield what each body says of its motion, None for a free one that says nothing."""
    for body, position in zip(scene.bodies, state.body_position, strict=True):
        motion = body.motion
        if isinstance(motion, Free):
            given = motion.velocity, motion.angular_velocity
            yield _given(*given, position) if any(part is not None for part in given) else None
        elif isinstance(motion, Guided):
            slides = motion.speed * np.array(motion.axis or (0.0, 0.0, 0.0))
            turns = motion.angular_speed * np.array(motion.hinge or (0.0, 0.0, 0.0))
            yield RigidMotion(slides, turns, position)
        else:
            yield REST


def _given(velocity: tuple | None, angular_velocity: tuple | None, about: Array) -> RigidMotion:
    """Return a rigid motion about a point, of which a part that is not given is zero."""
    return RigidMotion(np.array(velocity or np.zeros(3)), np.array(angular_velocity or np.zeros(3)), about.copy())


def _whole_motion(model: Model, state: State, robot: list[int]) -> RigidMotion | None:
    """Return the motion that the scene gives the robot, about the mass centre of rods and of its bodies."""
    scene = model.scene
    if scene.velocity is None and scene.angular_velocity is None:
        return None
    masses = model.free_bodies.mass[model.free_bodies.free_index[robot]]
    nodes = np.arange(model.node_count)
    total = model.rods.node_mass.sum() + masses.sum()
    moment = _mass_moment(model, state, nodes) + masses @ state.body_position[robot]
    return _given(scene.velocity, scene.angular_velocity, moment / total)


def _own_motion(model: Model, state: State, name: str, rod: Rod) -> RigidMotion | None:
    """Return the motion that a rod which nothing holds says it has, about its mass centre."""
    if rod.velocity is None and rod.angular_velocity is None:
        return None
    nodes = np.concatenate(
        [strand.first_node + np.arange(strand.node_count) for strand in model.strands if strand.rod == name]
    )
    centre = _mass_moment(model, state, nodes) / model.rods.node_mass[nodes].sum()
    return _given(rod.velocity, rod.angular_velocity, centre)


def _mass_moment(model: Model, state: State, nodes: Array) -> Array:
    """Return Σ m x of some nodes and of the edges that begin at them [kg m], shape (3,)."""
    raised = model.raised
    of_nodes = np.isin(model.rods.edge_node[raised.edge], nodes)
    off_curve = raised.first_moment.sum(axis=1)[of_nodes] @ state.director1[raised.edge[of_nodes]]
    return model.rods.node_mass[nodes] @ state.position[nodes] + off_curve


def _spread(
    scene: SceneConfig, links: dict[str, tuple[int | None, int | None]], own: dict[int, RigidMotion], state: State
) -> dict[int, RigidMotion]:
    """Return the motions of bodies, those of free ones gone on to what rods and joints connect with them."""
    found = dict(own)
    ways = [held for held in links.values() if None not in held] + joined_bodies(scene)
    frontier = [body for body in own if isinstance(scene.bodies[body].motion, Free)]
    while frontier:
        body = frontier.pop(0)
        for pair in ways:
            for here, there in (pair, pair[::-1]):
                if here == body and there not in found:
                    found[there] = found[body]
                    frontier.append(there)
    return found


def _move_rod(model: Model, state: State, name: str, rod: Rod, first: RigidMotion, last: RigidMotion) -> None:
    """Set the velocities of a rod's nodes and the spins of its edges, between the motions at its two ends."""
    for strand in model.strands:
        if strand.rod != name:
            continue
        nodes = strand.first_node + np.arange(strand.node_count)
        edges = strand.first_edge + np.arange(strand.node_count - 1)
        u = (strand.first_station + np.arange(strand.node_count)) / (rod.stations - 1)
        w, position = u * u * (3.0 - 2.0 * u), state.position[nodes]
        of_nodes = w[:, None]
        state.velocity[nodes] = (1.0 - of_nodes) * first.at(position) + of_nodes * last.at(position)
        of_edges = 0.5 * (of_nodes[:-1] + of_nodes[1:])
        turning = (1.0 - of_edges) * first.angular_velocity + of_edges * last.angular_velocity
        along = np.diff(position, axis=0)
        state.spin[edges] = (turning * along).sum(axis=1) / np.linalg.norm(along, axis=1)
