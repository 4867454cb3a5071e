"""Looks out of the plane of a run in two dimensions, which cannot buckle out of it.

A planar scene is its own mirror image, so small disturbances δ out of the plane follow a linear equation along the run,

    M δ̈ + C δ̇ + K(t) δ = 0

K the Hessian in space and C that of drag, damping and friction, with contacts as they are. About added mass, K has the
stiffness of the flow past moving edges (`forces.added_mass`); its gyroscopic force is left out. Frozen at a look, as
many modes grow faster than e^{rt} as K + r C + r² M has negative eigenvalues, since these rise with r. So pivots tell
the largest rate, and its integral over the looks what a disturbance has grown by.

A robot that nothing holds turns out of the plane for free. By an angle φ about an axis in it, a point at a distance s
from the axis comes to z = φ s, and z̈ = (s̈/s) z looks like growth wherever the robot expands. With forces g on nodes
and bodies at s from the mass centre that is, for the two axes, λ of V a = λ J a, V = Σ g sᵀ, and rates near √λ tell
nothing. A body feels what it holds at its own position: it does not expand, and moments on it do no work in Newton's
chart of rotations to second order. J is the moment of inertia about the axes: of nodes, of edges about their tangents,
of bodies, of masses off the curve (`forces.raised`) and of added mass.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from bilayer_core.engine.request_modes import COUNT, EVALUATE_STATE
from bilayer_core.forces.force_register import memory_size
from bilayer_core.forces.mechanisms import REMEMBERED
from bilayer_core.model.planarity import require_plane
from bilayer_core.model.state import PARTS, State, initial_state
from bilayer_core.scene.body import Guided
from bilayer_core.simulation.stepper import Stepper

Array = np.ndarray
GROWTH = math.log(100.0)
"""Logarithm of what a disturbance may grow by unnoticed."""
FIRST_LOOK, MOST_STEPS = 8, 256
"""Steps to the first look, and the most between two; until then each comes after twice as many. A look costs two steps
or three."""
PARTS_OF_RUNS = 4
"""How many times as often a look comes where runs end before the scene does, as they do under a controller."""
LONGEST_PART = 0.125
"""Of the duration of the scene, after which the next look comes however few steps have been made: where almost nothing
moves they are long."""
CLEAR_OF_TURNING = 2.0
"""Times the rate at which a free robot's turning seems to grow: modes of a larger rate are others."""
QUARTER = np.array([[0.0, 1.0], [-1.0, 0.0]])
"""Turn of row vectors in the plane by 90°."""
FASTEST = 1e9
"""Rate at which to leave off [1/s]."""


class PlaneWatch:
    """Watches a run in a plane for modes that leave it.

    Parameters
    ----------
    make : callable
        Makes a stepper of the same scene in dimension 2 or 3.
    duration : float
        Of the scene [s]: slower growth than a hundredfold in it is not looked for.

    Attributes
    ----------
    since : float or None
        When a disturbance had grown a hundredfold [s], None as long as it has not.
    """

    def __init__(self, make: Callable[[int], Stepper], duration: float):
        self._make, self._duration = make, duration
        self._space: Stepper | None = None
        self.restart(0.0)

    def take_scene(self, duration: float, take: Callable[[Stepper], None]) -> None:
        """Take another scene of the same model, which `take` gives to a stepper."""
        self._duration = duration
        if self._space is not None:
            take(self._space)
            take(self._plane)

    def take_model(self, duration: float) -> None:
        """Go on with another model, which `make` gives to steppers."""
        self._duration, self._space = duration, None

    def restart(self, time: float) -> None:
        """Begin anew at a time [s]."""
        self.since: float | None = None
        self._growth, self._unstable = 0.0, 0
        self._time, self._rate = time, 0.0
        self._done = self._since_look = 0
        self._next = FIRST_LOOK

    @property
    def started(self) -> bool:
        """True if the watch has looked at a state."""
        return self._space is not None

    @property
    def steps_left(self) -> int:
        """To the next look, at least 1."""
        return max(1, self._next - self._since_look)

    @property
    def due(self) -> float:
        """Time of the next look, unless so many steps come before [s]; the first one only comes after steps."""
        waits = self._done >= FIRST_LOOK and self.since is None
        return self._time + LONGEST_PART * self._duration if waits else math.inf

    def is_due(self, steps: int, time: float, last: bool = False) -> bool:
        """Count more steps, up to a time [s], of which the `last` of a run may be one; return whether to look now."""
        self._done += steps
        self._since_look += steps
        least = self._next
        if last:
            least = FIRST_LOOK if time >= self._duration else max(FIRST_LOOK, self._next // PARTS_OF_RUNS)
        return self.since is None and (self._since_look >= least or time >= self.due)

    def look(self, state: State, load_factor: Array) -> None:
        """Look at a state under the factors of loads that act there."""
        if self._space is None:
            self._space, self._plane = self._make(3), self._make(2)
            model = self._space.model
            self._copy = initial_state(model, memory=memory_size(model))
        for name in PARTS:
            mine, part = getattr(self._copy, name), getattr(state, name)
            if name != "memory" and mine.shape == part.shape:  # one without history or fingerprint is enough
                mine[...] = part
        turned = REMEMBERED * len(self._space.model.mechanisms)  # first of the memory of both
        self._copy.memory[:turned] = state.memory[:turned]
        for stepper, of in ((self._space, self._copy), (self._plane, state)):
            stepper.engine.set_drive(of, load_factor)
        time, rate = float(state.time[0]), self._largest_rate(state)
        self._growth += 0.5 * (rate + self._rate) * (time - self._time)
        self._unstable += rate > 0.0
        self._time, self._rate = time, rate
        first_found = rate > 0.0 and self._unstable == 1  # what one look found, the next one soon confirms or not
        self._since_look, self._next = 0, FIRST_LOOK if first_found else min(self._done, MOST_STEPS)
        if self._growth >= GROWTH and self._unstable > 1:
            self.since = time

    def _largest_rate(self, state: State) -> float:
        """Return a lower bound, to a factor of two, of the largest rate of modes that leave the plane [1/s]; 0 if none
        is fast enough.
        """
        slowest = GROWTH / self._duration
        if self._leaving(state, slowest) == 0:
            return 0.0
        rate, found = max(slowest, CLEAR_OF_TURNING * turning_rate(self._plane, state)), 0.0
        while rate < FASTEST and self._leaving(state, rate) > 0:
            found, rate = rate, 2.0 * rate
        return found

    def _leaving(self, state: State, rate: float) -> int:
        """Return how many modes that leave the plane grow faster than a rate [1/s]; 0 if that cannot be told."""
        unstable = 0
        for stepper, of, sign in ((self._space, self._copy, 1), (self._plane, state, -1)):
            if not stepper.engine.do_once(of, COUNT, 1.0 / rate).converged:
                return 0
            unstable += sign * stepper.engine.unstable
            if unstable == 0:
                return 0
        return max(unstable, 0)

    def warning(self) -> str:
        """Return the warning to the user that the robot would have buckled out of the plane."""
        plane = require_plane(self._plane.model.scene)
        return (
            f"by t = {self.since:.3g} s a disturbance that leaves {plane} would have grown a "
            "hundredfold, and the robot have buckled: run it from the start in space (`--dimension 3`), "
            "with an `imperfection`"
        )


def turning_rate(stepper: Stepper, state: State) -> float:
    """Return the rate at which turning out of its plane seems to grow [1/s] for a robot that no body holds which
    cannot turn, else 0.
    """
    model, engine = stepper.model, stepper.engine
    if np.any(model.constrained.free < 0) or any(isinstance(body.motion, Guided) for body in model.scene.bodies):
        return 0.0
    from scipy.linalg import eigh  # when it is needed: runs in space, and short ones, never do

    engine.do_once(state, EVALUATE_STATE)
    sums, axes, bodies = engine.sums, model.rods.axes, model.free_bodies
    unknowns = model.layout.node[:, None] + np.arange(3)
    force = -np.concatenate([sums.gradient[unknowns], sums.body[: len(bodies.mass), :3]]) @ axes.T
    place = np.concatenate([state.position, state.body_position[bodies.body_of_free]]) @ axes.T
    mass, first, second = moments_of_turning(stepper, state)
    inertia = second - np.outer(first, first) / mass
    virial = force.T @ (place - first / mass)
    expansion = float(eigh(0.5 * (virial + virial.T), inertia, eigvals_only=True)[-1])
    return math.sqrt(max(0.0, expansion))


def moments_of_turning(stepper: Stepper, state: State) -> tuple[float, Array, Array]:
    """Return the mass [kg], its first moment [kg m], shape (2,), and J [kg m²], shape (2, 2), of small motions out of
    the plane, z = φ·s with s from the origin along the plane's axes. The configuration is that evaluated last.
    """
    model, at = stepper.model, stepper.engine.end
    rods, raised, fluid, bodies, axes = model.rods, model.raised, model.fluid, model.free_bodies, model.rods.axes
    place, edges = state.position @ axes.T, rods.edge_count
    of_bodies = state.body_position[bodies.body_of_free] @ axes.T
    mass, moved = np.concatenate([rods.node_mass, bodies.mass]), np.concatenate([place, of_bodies])
    across = at.tangent[:edges] @ axes.T @ QUARTER  # spin of edges about their tangents at the rate φ
    spinning = rods.spin_inertia.copy()
    raises = np.zeros((edges, 2))
    total, first = mass.sum(), mass @ moved
    second = (mass[:, None] * moved).T @ moved
    if raised.exists:
        node, director = rods.edge_node[raised.edge], at.director1[raised.edge] @ axes.T
        raises[raised.edge] = raised.middle[:, None] * director
        halves = raised.first_moment
        along = halves[:, :1] * place[node] + halves[:, 1:] * place[node + 1]
        along += 0.5 * raised.second_moment[:, None] * director
        first += halves.sum(axis=1) @ director
        second += along.T @ director + director.T @ along
    if fluid.exists:
        spinning += fluid.mass[:, 2]
        for end in range(2):
            half, wet = 0.5 * fluid.mass[:, 1], place[fluid.edge_node + end] + raises
            total, first = total + half.sum(), first + half @ wet
            second += (half[:, None] * wet).T @ wet
    second += (spinning[:, None] * across).T @ across
    rotation = state.body_rotation[bodies.body_of_free]
    spread = (rotation @ bodies.second_moment @ rotation.transpose(0, 2, 1)).sum(axis=0)
    in_plane = axes @ spread @ axes.T
    second += in_plane + (np.trace(spread) - np.trace(in_plane)) * np.eye(2)
    return total, first, second
