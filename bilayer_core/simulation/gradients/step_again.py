"""Steps that were made, once more: the same pieces, to configurations that are known.

A kept step has the states at both ends. Of a method without a history that begins with derivatives, positions of all
its stages follow from these; Newton's method then makes corrections that the rounding of positions asks for.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from bilayer_core.engine.body_maps import BodyMaps, write_body_maps
from bilayer_core.engine.configuration import move
from bilayer_core.engine.evaluator import Evaluator
from bilayer_core.engine.gradient_differences import StrainDifferences, differentiate_by_laws, differentiate_by_strains
from bilayer_core.engine.linear.krylov_solution import Lack
from bilayer_core.engine.linear.lacking_matrix import LackingMatrix
from bilayer_core.engine.stage_maps import StageMaps
from bilayer_core.engine.step import move_beyond
from bilayer_core.engine.step_ends import HELD, end_stage, write_end
from bilayer_core.engine.step_response import ElasticMaps
from bilayer_core.engine.steps_again import (
    Reached,
    begin_stage,
    begin_step,
    correct,
    expect_end,
    factorise_end,
    follow,
    go_to,
    pass_stage,
    write_lags,
)
from bilayer_core.errors import SimulationError
from bilayer_core.model.force_slots import NAMES
from bilayer_core.model.model import Model
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.step import Configuration, Method, StateArrays
from bilayer_core.model.state import State
from bilayer_core.simulation.surroundings import Surroundings

Array = np.ndarray
ROUNDS = 80
"""Of solutions with what a Hessian lacks, at most."""
ELASTIC = ("stretching", "bending", "twisting", "flattening", "bond", "viscosity")
"""Forces that see eigenstrains."""
FOLLOWING = ("drag", "turning drag", "added mass", "followers", "moments", "friction", "rod friction")
"""Forces that take something from the configuration."""
PRESSING = ("barrier", "rod barrier", "restitution")
"""Forces on which friction depends."""
MOST = 12
"""Corrections of a stage."""
ENOUGH = 1e-13
"""Of the longest rod: a last correction, where the tolerance of the run is less."""


@dataclass(frozen=True)
class KeptStep:
    """A step that was made.

    Attributes
    ----------
    start, end : State
        Before and after; what is set from outside is as it acted.
    method : Method
    spread : ndarray
        Contacts that friction spread in its stages; see `Engine.spread`.
    decided : tuple of ndarray
        Decisions of varied diffusion at its points, if there is any; see `engine.varied_diffusion`.
    """

    start: State
    end: State
    method: Method
    spread: Array = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    decided: tuple[Array, ...] = ()

    @property
    def begin(self) -> float:
        """Time at its start [s]."""
        return float(self.start.time[0])

    @property
    def length(self) -> float:
        """Duration [s]."""
        return float(self.end.time[0]) - self.begin

    @property
    def beyond(self) -> bool:
        """True if it ends beyond its last stage."""
        points, stages = self.method.couplings.shape
        return points > stages


class StepAgain(Evaluator):
    """Makes kept steps again.

    Parameters
    ----------
    model : Model
    state : State
        Of it, with all that the states of steps have.
    surroundings : Surroundings
        What acts on it.
    same : float
        Two times that differ by no more are one [s].
    stages : int
        Of a step, at most, its end counted where that is beyond the last one.
    history : bool
        Whether the integrator keeps stage derivatives.
    beyond : bool
        Whether steps may end beyond their last stage.
    tolerance : float
        Of Newton's method [m/s].

    Attributes
    ----------
    first : State
        That it was made with.
    places : list of Configuration
        The start of the step, then the end of each stage, and of a step that ends beyond its last one.
    guesses : list of Configuration
        Where Newton's method began in each stage.
    reached : Reached
        Where the stage ended that was found last.
    ended, last : Point, Configuration
        The end of the last stage, or of the step where that is beyond it.
    size, wet, excess : int
        Of unknowns, and of the fluid's momentum: in their places, then of kept directors; of its part that is kept.
    """

    def __init__(
        self,
        model: Model,
        state: State,
        surroundings: Surroundings,
        same: float,
        stages: int,
        history: bool,
        beyond: bool,
        tolerance: float,
    ):
        super().__init__(model, stages, history)
        self.first, self._state, self._end = state, state.copy(), state.copy()
        self._arrays, self._end_arrays = (
            StateArrays(**{name: getattr(of, name) for name in StateArrays.names}) for of in (self._state, self._end)
        )
        self.surroundings, self._same = surroundings, same
        self.places: list[Configuration] = [self.new() for _ in range(stages + 1)]
        self.guesses: list[Configuration] = [self.new() for _ in range(stages)]
        self.spare = self.new()
        bodies = len(self.problem.bodies.mass)
        self.reached = Reached(
            position=np.zeros((model.node_count, 3)),
            turn=np.zeros(len(self.problem.strands.edge_unknown)),
            body_position=np.zeros((bodies, 3)),
            body_rotation=np.zeros((bodies, 3, 3)),
        )
        self._size = max(rod.path.length for rod in model.scene.rods)
        self._tolerance = tolerance
        self._settles = not {"friction", "rod friction"}.isdisjoint(model.forces)
        self.ended, self.last = self._work.end, self.places[0]
        self._elastic, self._pressing = (
            np.array([name in chosen and name in model.forces for name in NAMES]) for chosen in (ELASTIC, PRESSING)
        )
        layout = self.problem.strands
        self.of_nodes = layout.node_unknown[:, None] + np.arange(3)
        self.of_edges = layout.edge_unknown
        self._rods = len(self.sums.gradient)
        self.size = self._rods + 6 * bodies
        self.of_bodies = self._rods + np.arange(6 * bodies).reshape(bodies, 6)
        fluid = self.problem.fluid
        self.wet = self.size + 3 * (len(fluid.momentum) - model.node_count) if fluid.exists else 0
        self.excess = self.wet if beyond else 0
        self._room = 0
        self.lacks = False
        self.grow_maps(256)

    def grow_maps(self, room: int) -> None:
        """Make maps with room for so many entries beside bands; they are zero."""
        problem = self.problem
        reach, edges = _reach(self), len(self.of_edges)

        def matrix(width: int) -> LackingMatrix:
            return LackingMatrix(
                band=np.zeros((self._rods if width else 0, width)),
                count=np.zeros(1, dtype=np.int64),
                row=np.zeros(room, dtype=np.int64),
                column=np.zeros(room, dtype=np.int64),
                value=np.zeros(room),
            )

        edge_of = np.full(self.size, -1)
        edge_of[self.of_edges] = np.arange(edges)
        moving = [n for n in (*FOLLOWING, "inertia", "damping") if n in self.model.forces]
        self._room, self.maps = (
            room,
            StageMaps(
                lacking=matrix(2 * reach + 1),
                by_origin=matrix(2 * reach + 1),
                by_turn=np.zeros(edges),
                slides=matrix(0),
                by_strain=matrix(0),
                by_kept=matrix(0),
                by_director=np.zeros((len(problem.raised.edge), 7, 3)),
                way=np.zeros((3, edges, 3)),
                edge_of=edge_of,
                moving=np.array([name in moving for name in NAMES]),
            ),
        )
        self.lack = Lack(
            matrix=self.maps.lacking,
            basis=np.zeros((ROUNDS + 1, self.size)),
            projected=np.zeros((ROUNDS, ROUNDS + 1)),
            turns=np.zeros((ROUNDS, 2)),
            rest=np.zeros(ROUNDS + 1),
            spread=np.zeros(self.size),
            force=np.zeros(self.size),
        )

    @property
    def overfull(self) -> bool:
        """True if there was too little room for entries of maps; now there is more, and maps are zero."""
        maps = self.maps
        lists = maps.lacking, maps.by_origin, maps.slides, maps.by_strain, maps.by_kept
        most = max(int(of.count[0]) for of in lists)
        if most > self._room:
            self.grow_maps(2 * most)
            return True
        return False

    def begin(self, step: KeptStep) -> None:
        """Take the start of a step, with what acts during it."""
        self._step, surroundings = step, self.surroundings
        self._take(step.start)
        surroundings.cover(step.begin, step.start.override, step.start.pose_goal)
        acts = surroundings.actuation, self._inputs, self._work
        when = step.begin, step.length, self._same
        begin_step(self.problem, self._arrays, step.method, *acts, *when, self.places[0])

    @property
    def inputs(self):
        """Inputs at the points of the step."""
        return self._inputs

    @property
    def transduction(self) -> Array:
        """Stimuli that modes have reached at the stage, shape (n_mode,)."""
        return self._work.transduction

    @property
    def laws(self) -> Array:
        """Eigenstrain of laws at the stage, shape (n_law,)."""
        return self._work.strain

    @property
    def end_rates(self) -> Array:
        """Rates of strains at the end of the stage, shape (n_strain,)."""
        return self.ended.strain_rate

    @property
    def kept(self) -> int:
        """How much a step keeps for the next: speeds of approach, rates of what elements see of light, and the fluid's
        momentum beyond that of velocities.
        """
        return len(self.problem.restitution.rate) + 2 * len(self.problem.light.law) + self.excess

    @property
    def speeds(self) -> Array:
        """Speeds of approach that are in memory during the step, shape (n_pair,)."""
        return self.speeds_of(self._state)

    def speeds_of(self, state: State) -> Array:
        """Return the speeds of approach in the memory of a state, shape (n_pair,)."""
        restitution = self.problem.restitution
        first = restitution.memory[0] if restitution.exists else 0
        return state.memory[first : first + len(restitution.rate)]

    @property
    def held(self) -> Array:
        """Rows of unknowns of nodes that free bodies hold, shape (n_held, 3)."""
        constrained = self.problem.constrained
        return self.of_nodes[constrained.node[constrained.free >= 0]]

    @property
    def speeds_of_held(self) -> Array:
        """Velocities of these at the end of the stage, and what they gain by its length, shape (2, n_held, 3)."""
        constrained, velocity = self.problem.constrained, self.ended.velocity
        gained = (velocity - self.point.velocity) / self.stage.momentum_length
        return np.stack([velocity, gained])[:, constrained.node[constrained.free >= 0]]

    @property
    def momenta_of_bodies(self) -> Array:
        """Angular momenta of free bodies at the end of the stage, and what they gain by its length, shape (2, n_free,
        3).
        """
        end, origin = self.ended.angular_momentum, self.point.angular_momentum
        return np.stack([end, (end - origin) / self.stage.momentum_length])

    @property
    def gained_momentum(self) -> Array:
        """Gain of the fluid's momentum over the stage, shape (wet,)."""
        return self.wetted(self.ended.fluid_momentum - self.point.fluid_momentum)

    def wetted(self, rows: Array) -> Array:
        """Return what the fluid has about nodes and kept directors, shape (n, 3), in the places of its momenta."""
        found, nodes = np.zeros(self.wet), len(self.of_nodes)
        if self.wet:
            found[self.of_nodes], found[self.size :] = rows[:nodes], rows[nodes:].ravel()
        return found

    @property
    def origin_rates(self) -> Array:
        """Rates of strains at its origin, likewise."""
        return self.point.strain_rate

    def decide(self, n: int) -> None:
        """Let fields make the steps that were decided at point n, if they are known."""
        varied, decided = self.problem.varied_fields, self._step.decided
        if varied.exists:
            varied.follows[0] = len(decided) > 0
            if decided:
                varied.decided[:] = decided[n]

    def start(self, n: int) -> None:
        """Start stage n, up to the first guess."""
        self.decide(n)
        step, places, origin = self._step, (self.places[n], self.guesses[n]), self.point
        before = origin.vectors.copy(), origin.rotation.copy()
        while True:
            stage = self.problem, self._arrays, step.method, self._inputs, self._work
            status = begin_stage(*stage, n, step.length, *places)
            if status == READY:
                return
            self._grow(status)
            origin.vectors[:], origin.rotation[:] = before

    def go(self, n: int, reached: Reached) -> None:
        """Go from the first guess of stage n to where it ended."""
        go_to(self.problem, self.stage, self.guesses[n], reached, self.places[n + 1])
        if self._work.spread.size:
            self._work.spread[:] = False
            self._work.spread.ravel()[self._step.spread] = True
            self.problem.sliding.spread.ravel()[:] = self._work.spread[n]
        self.follow(self.places[n + 1])

    def travel(self, base: Configuration, travel: Array, at: Configuration) -> None:
        """Make a configuration `base`, moved by a step of all unknowns, shape (size,)."""
        self.move(base, travel[: self._rods], travel[self._rods :].reshape(-1, 6), at)

    def follow(self, at: Configuration) -> None:
        """Let forces take from a configuration what they hold fixed."""
        if self._settles:
            self.sums.selected[:] = self._pressing
            follow(self.problem, at, self.stage)
        else:
            self.update_lagged(at)

    def pass_through(self, n: int, end: Configuration) -> None:
        """Go through stage n, of which only the end counts."""
        step = self._step
        self.decide(n)
        pass_stage(self.problem, self._arrays, step.method, self._inputs, self._work, n, step.length, self.places[n])
        self.places[n + 1] = end
        self.finish(n)

    def finish(self, n: int) -> None:
        """Take the end of stage n."""
        at, work = self.places[n + 1], self._work
        end_stage(self.problem, self._arrays, work, self._inputs, n, at)
        work.start_angle[:] = work.end.angle
        at.total_angle[:] = 0.0
        self.ended, self.last = work.end, at

    def go_beyond(self, n: int) -> None:
        """Go from the end of the last stage to that of the step, its point n."""
        self.decide(n)
        step, places = self._step, (self.places[n], self.places[n + 1])
        status = move_beyond(self.problem, self._arrays, step.method, self._inputs, self._work, n, *places)
        if status != READY:
            raise SimulationError("gradient: a step that was made is not possible once more", step.begin)
        self.ended, self.last = self.point, places[1]

    def release(self) -> tuple[Array, Array]:
        """Return the velocities that the fluid's momentum adds at the end of a step, shape (n_node, 3), 0 of nodes
        that keep theirs, and the momentum that is kept, shape (excess,); see `engine.step_ends`.
        """
        if not self.excess or not self._step.beyond:
            return np.zeros_like(self.ended.velocity), np.zeros(self.excess)
        n = len(self._step.method.couplings) - 1
        write_end(self.problem, self._end_arrays, self.ended, self.last, self._inputs, n)
        freed = self.problem.fluid.inertia[:, 0, 0] != HELD
        return freed[:, None] * (self._end.velocity - self.ended.velocity), self.wetted(self._end.fluid_excess)

    def gradient(self, n: int) -> Array:
        """Return the gradient of the potential where stage n ended, shape (size,)."""
        self.evaluate(self.places[n + 1])
        return self.whole_gradient()

    def whole_gradient(self) -> Array:
        """Return the gradient of the last evaluation, shape (size,)."""
        return np.concatenate([self.sums.gradient, self.sums.body.ravel()])

    def find(self, n: int, write_maps: Callable[[StepAgain, int], None]) -> tuple[Reached, float]:
        """Go to where stage n ended, factorise the Hessian there, and write what it lacks; return where, and the last
        correction [m].
        """
        work, step, reached = self._work, self._step, self.reached
        self._end.take(step.end)
        between = self._arrays, self._end_arrays, step.method, work, n, step.length
        expect_end(self.problem, *between, self.places[0], self.guesses[n], reached)
        self.go(n, reached)
        self.lacks = written = False
        for k in range(MOST):
            at = self.places[n + 1]
            self._factorise_end(at)
            if k and self._settles:
                gradient = self.sums.gradient.copy(), self.sums.body.copy()
                write_maps(self, n)
                written = True
                self.sums.gradient[:], self.sums.body[:] = gradient
            moved = correct(self.problem, at, self.lack, self.lacks, self._size)
            if not moved > max(ENOUGH * self._size, self._tolerance * self.stage.length):
                break
            move(self.problem, at, 1.0, self.stage, self.spare)
            self._reach(n, self.spare)
            self.go(n, reached)  # in one way from the guess: turns depend on ways
        if not written:
            write_maps(self, n)
        self._reach(n, self.places[n + 1])
        return reached, moved

    def _reach(self, n: int, at: Configuration) -> None:
        """Write where stage n ends at a configuration."""
        reached = self.reached
        reached.position[:], reached.turn[:] = at.position, at.total_angle - self.guesses[n].total_angle
        reached.body_position[:], reached.body_rotation[:] = at.body_position, at.body_rotation

    def _factorise_end(self, at: Configuration) -> None:
        """Factorise the Hessian at a configuration, and leave the gradient there."""
        while (status := factorise_end(self.problem, at, self.stage)) != READY:
            self._grow(status)
        outcome = self._storage.outcome
        self.gap = outcome.gap
        if outcome.shift or outcome.simplified:
            raise SimulationError("gradient: a step ends where the shape is unstable", self._step.begin)

    def write_body_maps(self, n: int, maps: BodyMaps) -> None:
        """Write the maps of free bodies in stage n."""
        step = self._step
        write_body_maps(self.problem, self._arrays, step.method, self._work, n, step.length, self.places[n + 1], maps)

    def write_lags(self, n: int, elastic: ElasticMaps) -> None:
        """Write by what modes reach at point n what they had reached, and stimuli there and at the start."""
        write_lags(self.problem, self._arrays, self._inputs, elastic, n)

    def differentiate_by_laws(self, at: Configuration, differences: StrainDifferences, change: float) -> None:
        """Write how the gradient at a configuration depends on the eigenstrain of each law; see `StrainDifferences`."""
        self.sums.selected[:] = self._elastic
        differentiate_by_laws(self.problem, self._work, differences, at, change)

    def differentiate_by_strains(self, at: Configuration, differences: StrainDifferences, change: float) -> None:
        """Write how the gradient at a configuration depends on strains at the origin; see `StrainDifferences`."""
        self.sums.selected[:] = self._elastic
        differentiate_by_strains(self.problem, differences, at, self.stage, change)


def _reach(again: StepAgain) -> int:
    """Return how far apart unknowns of two edges that follow each other are, but for those where a rod closes."""
    strands = again.problem.strands
    seen = np.concatenate([again.of_nodes[strands.edge_node], again.of_nodes[strands.edge_node + 1]], axis=1)
    seen = np.concatenate([seen, again.of_edges[:, None]], axis=1)
    before, after = strands.joint_a[: strands.bend_count], strands.joint_b[: strands.bend_count]
    inner = np.maximum(before, after) < len(seen)
    both = np.concatenate([seen[before[inner]], seen[after[inner]]], axis=1)
    apart = (both if len(both) else seen).max(axis=1) - (both if len(both) else seen).min(axis=1)
    return int(np.median(apart))
