"""Static equilibrium: the potential's minimum without inertia, reached by steps that are no motion.

Each round minimises V(q) + ½ |q − q_k|²_M/h² from the shape q_k of the round before: an implicit Euler step of length h
that forgets all velocity (the proximal point method). Whatever h is, V falls in every round, and the rounds end only
where ∂V/∂q = 0; h grows tenfold while Newton's method succeeds, so that the last rounds are Newton's method on V alone.
What depends on velocities vanishes there: friction, mass damping, and drag but for that of a fluid which flows. About
added mass a flow has a potential (`forces.added_mass`).
Forces that turn with what they act on, moments on bodies and light are taken at q_k and agree with the shape in the
end. Where a round does not converge under such forces, Newton's method with all of their stiffness looks for
rest (`simulation.following_newton`). Whether the equilibrium is stable is asked of V, or of the modes of small motions
where forces have no potential (`simulation.growing_modes`). In space, strips that curl across begin with a small twist,
since V is not convex there and rounds make no way beside a shape that only twist makes unstable
(`simulation.strip_sections`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field

import numpy as np

from bilayer_core.engine.engine import Engine
from bilayer_core.engine.request_modes import COUNT, SETTLE
from bilayer_core.engine.step_outcome import FAILURES, IntegrationReport
from bilayer_core.errors import InputError, SimulationError
from bilayer_core.model.lit_elements import light_of, part_seen
from bilayer_core.model.model import Model
from bilayer_core.model.records.status import CROSSED, MAX_ITERATIONS
from bilayer_core.model.state import NOT_KNOWN, State, reached_at_rest
from bilayer_core.simulation.crossing_remedy import crossing
from bilayer_core.simulation.stepper import Stepper
from bilayer_core.simulation.strip_sections import FOLDS, disturb, shapes

FIRST, GROWTH, SHRINKAGE, SHORTEST = 1e-2, 10.0, 0.25, 1e-7
"""Length h of the first round [s], its factors after success and failure, and the length at which to give up [s]."""
CAREFUL_GROWTH = 1.3
"""In place of growth once a round has failed, where forces turn with what they act on. Their part of the stiffness is
not in the Hessian, so Newton converges for lengths h alone in which inertia outweighs it; rest is reached round by
round, if at all."""
LONGEST_AFTER_FAILURE = 0.6
"""Of the length of a round that failed with careful growth: Newton converges up to there, and rounds of one length come
to rest geometrically."""
RECOVERY = 1.03
"""Growth of that length with every round that succeeds, as a round may have failed far from where rest is."""
SETTLED, LONGEST = 1.0, 100.0
"""Two rounds at least so long [s], or as long as failures allow, must find the shape at rest, one after the other but
for failures, which come from rounding where nothing holds the robot; no round is longer than the second."""
CREEP, STEADY = 1e-5, 0.9
"""Part of friction's threshold below which a speed that falls no further, by less than the second from round to round,
is that of creep: friction holds what pushes so weakly, but its smoothed law has no force at rest."""
MAX_ROUNDS = 300
WORTH_KEEPING = 1e-6
"""Of the longest rod: displacement of a round without convergence that is no rounding."""
OUT_OF_SIGHT = 100.0
"""Times the longest rod: displacement at which to conclude that nothing holds the robot."""
RELATIVE_TOLERANCE = 1e-10
"""Of the scene's longest rod: displacement that a round may make and still count as rest."""


@dataclass(frozen=True)
class StaticReport:
    """How the search for an equilibrium went.

    Attributes
    ----------
    stable : bool
        Whether every small disturbance decays or stays as it is, in all of space, whatever the dimension of the model.
    unstable_directions : int
        Dimension of the space of those that grow: negative eigenvalues of the Hessian, or modes that grow.
    out_of_plane : int
        How many of these leave the plane of a model of dimension 2, which therefore cannot follow them; 0 in space.
    residual : float
        Largest displacement that Newton would still make [m].
    growth_rate, growth_frequency : float
        Of the small motion that grows fastest, where forces without a potential act (`growing_modes`): its rate [1/s],
        and the frequency with which it flutters [Hz], 0 where it diverges. Both are 0 where all is stable, and where
        forces have a potential, whose Hessian tells no rates.
    rounds, iterations, factorisations : int
        Potentials minimised, Newton corrections, and factorised Hessians.
    """

    stable: bool
    unstable_directions: int
    out_of_plane: int
    residual: float
    rounds: int
    iterations: int
    factorisations: int
    growth_rate: float = 0.0
    growth_frequency: float = 0.0
    strips: Mapping[str, str] = field(default_factory=dict)


def solve_static(
    stepper: Stepper,
    state: State,
    tolerance: float | None = None,
    in_space: Callable[[], Stepper] | None = None,
    ended: float = 0.0,
) -> StaticReport:
    """Bring a state to rest in an equilibrium under its present stimuli and loads; its time stays.

    Lagging layers are taken as settled, prescribed bodies stay where they are. From an unstable equilibrium nothing
    leads away but a disturbance: the report then says that it is unstable.

    Parameters
    ----------
    stepper : Stepper
    state : State
        Changed in place on success.
    tolerance : float, optional
        Displacement that counts as rest [m]; default: `RELATIVE_TOLERANCE` of the longest rod.
    in_space : callable, optional
        Makes the stepper of the same scene in dimension 3, for stability, where `stepper` is one of dimension 2.
    ended : float
        Length of a step that ended now [s]: where schedules jump, their values from before act; by default those from
        now on.

    Raises
    ------
    SimulationError
        If none is found; `state` is unchanged then, and the message says how close it came.
    """
    if tolerance is not None and not (math.isfinite(tolerance) and tolerance > 0.0):
        raise InputError(f"tolerance: {tolerance} is not allowed; it must be a positive number of metres")
    with ExitStack() as undo:
        undo.callback(state.take, state.copy())
        report = _Search(stepper, state, tolerance, in_space, ended).run()
        undo.pop_all()
    return report


def follows(model: Model) -> bool:
    """Return whether forces that have no potential act at rest: followers, moments, or the drag of a flow."""
    flowing = model.flow.exists and bool(np.any(model.flow.velocity))
    return model.followers.exists or model.moments.exists or flowing


def _may_touch(model: Model) -> bool:
    """Return whether anything of a scene may touch anything."""
    return not {"barrier", "rod barrier"}.isdisjoint(model.forces)


def _rods_touch(engine: Engine) -> bool:
    """Return whether rods touch each other where they were evaluated last: that is in no matrix of modes."""
    contact = engine.rod_contact
    return contact.exists and contact.contacts.count[0] > 0


class _Search:
    """Rounds of the compiled step's modes for statics, and what to make of them."""

    def __init__(
        self,
        stepper: Stepper,
        state: State,
        tolerance: float | None,
        in_space: Callable[[], Stepper] | None,
        ended: float,
    ):
        model, self.ended = stepper.model, ended
        self.stepper, self.state, self.in_space = stepper, state, in_space
        self.time = float(state.time[0])
        self.size = max(rod.path.length for rod in model.scene.rods)
        self.tolerance = RELATIVE_TOLERANCE * self.size if tolerance is None else tolerance
        for still in (
            state.velocity,
            state.spin,
            state.strain_rate,
            state.body_velocity,
            state.body_angular_velocity,
            state.has_history,
            state.account,
            state.light_rate,
        ):
            still.fill(0.0)
        state.touched.fill(NOT_KNOWN)
        self.light = light_of(model)
        self._drive(stepper)
        if not model.plane.exists:
            disturb(model, state)
        self.rounds = self.iterations = self.factorisations = 0
        self.sought = False
        self.growth_after_failure = CAREFUL_GROWTH if follows(model) else GROWTH

    def _drive(self, stepper: Stepper) -> None:
        """Write the rest strains and the loads of now, and the light on the present shape, to a stepper."""
        state, model = self.state, self.stepper.model
        if len(state.transduction):
            stimulus = self.stepper.surroundings.stimulus_at(state, self.time, self.ended)
            place = state.position, state.director1, state.body_position, state.body_rotation
            seen = part_seen(self.light, *place) if self.light.exists else 1.0
            state.transduction[:] = reached_at_rest(model.drives, stimulus, seen)
        stepper.engine.set_drive(state, self.stepper.surroundings.load_factor(self.state, self.ended))

    def run(self) -> StaticReport:
        state, engine, model = self.state, self.stepper.engine, self.stepper.model
        begin, start = state.copy(), state.copy()
        length, moved, before, settled, growth, longest = FIRST, math.inf, math.inf, 0, GROWTH, LONGEST
        while self.rounds < MAX_ROUNDS:
            if self.light.exists:
                self._drive(self.stepper)
            attempt = engine.do_once(state, SETTLE, length, self.tolerance / length)
            self.rounds += 1
            self.iterations += attempt.iterations
            self.factorisations += attempt.factorisations
            lost = not attempt.converged and attempt.status != MAX_ITERATIONS
            if lost or (not attempt.converged and engine.moved < WORTH_KEEPING * self.size):
                state.take(start)
                length *= SHRINKAGE
                if length < SHORTEST:
                    raise self._failure(self._why(attempt), moved)
                continue
            moved, before = engine.moved, moved
            if np.abs(state.position - begin.position).max() > OUT_OF_SIGHT * self.size:
                raise self._failure("nothing holds the robot, or not all of it", moved)
            start.take(state)
            if not attempt.converged:  # V has fallen all the same
                if growth == CAREFUL_GROWTH:
                    longest = min(longest, LONGEST_AFTER_FAILURE * length)
                length, settled, growth = SHRINKAGE * length, 0, self.growth_after_failure
                if growth == CAREFUL_GROWTH and self._find_rest(begin, length):
                    start.take(state)
                    length = longest
                continue
            enough, longest = min(SETTLED, longest), min(RECOVERY * longest, LONGEST)
            at_rest = length >= enough and moved <= self.tolerance
            if length < SETTLED:  # rounds come to rest geometrically: what all that follow would move
                at_rest &= moved * moved <= self.tolerance * (before - moved)
            if model.sliding.acts and length >= enough:
                at_rest |= STEADY * before <= moved <= CREEP * model.sliding.threshold * length
            settled = settled + 1 if at_rest else 0
            if settled == 2:
                return self._report(attempt.residual * length)
            length = max(enough, length) if moved <= self.tolerance else min(growth * length, longest)
        hint = ": forces that follow it have no potential; look from where a run comes to rest"
        hint = hint if follows(model) else ""
        raise self._failure(f"the shape does not come to rest{hint}", moved)

    def _find_rest(self, begin: State, length: float) -> bool:
        """Look for rest with the stiffness of forces that follow (`following_newton`), once, and where nothing may
        touch: from where rounds are, then from where they began, which may be where a run came to rest. Rounds have to
        confirm it.
        """
        if self.sought or self.light.exists or _may_touch(self.stepper.model):
            return False
        from bilayer_core.simulation.following_newton import find_rest  # brings scipy's sparse solvers

        self.sought = True
        within = None if self.in_space is None else self.stepper.model
        space = self.stepper if self.in_space is None else self.in_space()
        load_factor = self.stepper.surroundings.load_factor(self.state, self.ended)
        now = self.state.copy()
        for first, h in ((now, length), (begin, SETTLED)):
            self.state.take(first)
            steps = find_rest(space.model, self.state, load_factor, within, h, self.tolerance)
            self.iterations += steps
            self.factorisations += steps
            if steps > 0:
                return True
        self.state.take(now)
        return False

    def _why(self, attempt: IntegrationReport) -> str:
        """Return why a round failed."""
        crosses = attempt.status == CROSSED
        return crossing(self.stepper.model, attempt.pair) if crosses else FAILURES[attempt.status]

    def _report(self, residual: float) -> StaticReport:
        rate = frequency = 0.0
        unstable, out_of_plane = self._unstable(self.stepper), 0
        space = self.stepper
        if self.in_space is not None:
            space = self.in_space()
            self._drive(space)
            in_plane, unstable = unstable, self._unstable(space)
            out_of_plane = unstable - in_plane
        if follows(space.model) and not _rods_touch(space.engine):
            from bilayer_core.simulation.growing_modes import growing_modes  # brings scipy's sparse solvers

            load_factor = self.stepper.surroundings.load_factor(self.state)
            grows = growing_modes(space.model, self.state, load_factor)
            unstable, rate, frequency = grows.count, grows.rate, grows.frequency
            if unstable and self.in_space is not None:
                out_of_plane = unstable - growing_modes(space.model, self.state, load_factor, self.stepper.model).count
        strips = shapes(self.stepper.model, self.state)
        for name in (name for name, shape in strips.items() if shape == "folded"):
            raise self._failure(
                f"rods.{name} {FOLDS}; raise its stimulus in steps, with statics after each",
                0.0,
            )
        self.stepper.restart(self.state)
        counts = self.rounds, self.iterations, self.factorisations
        return StaticReport(unstable == 0, unstable, out_of_plane, residual, *counts, rate, frequency, strips)

    def _unstable(self, stepper: Stepper) -> int:
        """Return the number of negative eigenvalues of the Hessian of a model at the equilibrium."""
        counted = stepper.engine.do_once(self.state, COUNT)
        if not counted.converged:
            reason = FAILURES[counted.status]
            raise SimulationError(f"the stability of the equilibrium cannot be told: {reason}", self.time)
        return stepper.engine.unstable

    def _failure(self, reason: str, moved: float) -> SimulationError:
        near = f"the last round moved it by {moved:.3g} m, allowed {self.tolerance:.3g} m"
        counts = f"{self.rounds} rounds, {self.iterations} iterations"
        return SimulationError(f"no static equilibrium found: {reason} ({near}; {counts})", self.time)
