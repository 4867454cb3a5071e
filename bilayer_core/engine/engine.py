"""Compiled steps for the stepper: what they take, and what they leave."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..model.carriers import carrier_names
from ..model.force_list import Kind, kinds
from ..model.force_places import NAMES
from ..model.model import Model
from ..model.records.outcome import (
    BACKTRACKS,
    FACTORISATIONS,
    GAP,
    ITERATIONS,
    LARGEST_RESIDUAL,
    PAIR,
    PLACE,
    RESIDUAL,
    STATUS,
)
from ..model.records.status import CONVERGED, TOO_INACCURATE
from ..model.records.step import Course, Method, Place, StateArrays, Tally
from ..model.rest_strains import RestStrains
from ..model.state import State
from .allocate import configuration
from .loop import Counted, Loop
from .modes import STEP
from .newton_report import FAILURES, NewtonReport, NewtonStatus
from .step import count_step, take_steps
from .storage import Storage
from .workspace import work_of

Array = np.ndarray


class Engine:
    """Compiled steps of a model, and the arrays that they compute into.

    Attributes
    ----------
    places : list of Place
        Configurations that steps use.
    end : Place
        That of them which was evaluated last.
    first : FirstDerivatives
        There.
    gap : float
        The smallest to a surface or another rod there [m], infinite without contact; between rods those below the
        barrier distance count.
    touched : Array
        Carriers that something pushed at the end of the last step, bool, shape (n_carrier,).
    ranges : Array
        Of channels, in their units, shape (n_channel,).
    figures, nodes, most_nodes, first_contact, body_top : Array
        Extremes of the run; see `model.records.step.Tally`.
    """

    def __init__(self, model: Model, keeps_slopes: bool, stages: int):
        self._model, self._storage = model, Storage(model)
        self.first, self.gap, self.outcome = self._storage.first, math.inf, self._storage.outcome
        self.keeps = keeps_slopes
        self.places = [configuration(model) for _ in range(3)]
        self.end = self.places[1]
        self._state: State | None = None
        self._loop: Loop | None = None
        self._counted: Counted | None = None
        self.ranges = np.array([c.maximum - c.minimum for c in model.scene.stimuli.values()], dtype=float)
        self.figures = np.zeros(5)
        self.body_top = np.zeros(len(model.bodies.names))
        self.nodes, self.most_nodes = np.zeros((2, len(model.surfaces.names)), dtype=np.int64)
        self.first_contact = np.zeros(len(model.surfaces.names))
        self.tally = Tally(
            mass_moment=model.mass_moment,
            mass=float(model.node_mass.sum()),
            voronoi_length=model.voronoi_length,
            figures=self.figures,
            body_top=self.body_top,
            nodes=self.nodes,
            most_nodes=self.most_nodes,
            first_contact=self.first_contact,
        )
        self.start_over(-math.inf)
        self.touched = np.zeros(len(model.carriers.weight), dtype=bool)
        self._work = work_of(model, self.places, self.touched, stages)

    def start_over(self, height: float) -> None:
        """Forget the extremes of the run; the mass centre is at `height` [m]."""
        self.figures[:] = height, math.inf, 0.0, 0.0, 0.0
        self.body_top[:] = -math.inf
        self.nodes[:], self.most_nodes[:], self.first_contact[:] = 0, 0, math.nan

    def _arrays_of(self, state: State) -> StateArrays:
        if state is not self._state:
            self._state, self._counted = state, None
            self._state_arrays = StateArrays(**{name: getattr(state, name) for name in StateArrays.names})
        return self._state_arrays

    def loop_of(self, state: State, method: Method, course: Course) -> Loop:
        """What compiled steps take, with the present rooms; the same object as long as all parts are."""
        parts = {"problem": self._storage.problem, "state": self._arrays_of(state), "method": method, "course": course}
        if self._loop is None or any(getattr(self._loop, name) is not part for name, part in parts.items()):
            self._loop = Loop(
                **parts, work=self._work, before=np.zeros_like(state.values), tally=self.tally, ranges=self.ranges
            )
        return self._loop

    def march(self, state: State, method: Method, course: Course, h: float, settings: Settings) -> MarchReport:
        """Make the steps of a course, each of length `h` [s], as far as they succeed; `state` is that after them."""
        loop = self.loop_of(state, method, course)
        flags = self.keeps, settings.mode, settings.changes, settings.counts
        done = take_steps(
            loop, *flags, h if settings.mode == STEP else settings.length, settings.tolerance, settings.max_iterations
        )
        counts, figures = self.outcome.counts.tolist(), self.outcome.figures.tolist()
        status, pair, place, gap = counts[STATUS], counts[PAIR], counts[PLACE], figures[GAP]
        if done > 0 or status == CONVERGED or status in FAILURES:
            self.take_over(place, gap)
        how = FAILURES.get(status, NewtonStatus.CONVERGED)
        work = counts[ITERATIONS], counts[FACTORISATIONS], figures[RESIDUAL], counts[BACKTRACKS]
        newton = NewtonReport(how, *work)
        return MarchReport(done, status, place, pair, newton, figures[LARGEST_RESIDUAL], h, h, h)

    def take_over(self, place: int, gap: float) -> None:
        """Note which configuration was evaluated last, and the smallest gap there [m]."""
        self.end, self.gap = self.places[place], gap

    @property
    def energies(self) -> dict[str, float]:
        """Of the conservative forces at the configuration evaluated last [J]; what others lose or supply is no
        energy.
        """
        kind, values = kinds(), dict(zip(NAMES, self._storage.energy.tolist(), strict=True))
        return {name: values[name] for name in self._model.forces if kind[name] is Kind.CONSERVATIVE}

    @property
    def touching(self) -> Array:
        """Which carriers something pushed at the last evaluation, shape (n_carrier,)."""
        return np.any(self.first.carrier != 0.0, axis=1)

    def who_blocks(self, pair: int) -> str:
        """What a message says of the near pair that blocks prescribed motion."""
        if pair < 0:
            return "a rod would reach another"
        near = self._storage.near
        surface = self._model.surfaces.names[near.surface[pair]]
        return f"{carrier_names(self._model)[near.carrier[pair]]} would reach the surface of {surface}"

    @property
    def moved(self) -> float:
        """Largest displacement of a material point in the last round of statics [m]."""
        return float(self._work.moved[0])

    @property
    def unstable(self) -> int:
        """How many directions were found unstable when they were last counted."""
        return int(self._storage.problem.system.negative[0])

    def set_drive(self, rest: RestStrains, load_factor: Array) -> None:
        """What acts on the state that is looked at next, by settings that say so."""
        stage = self._work.stage
        stage.rest_edge[:], stage.rest_joint[:], stage.load_factor[:] = rest.edge, rest.joint, load_factor

    def make_room(self, status: int) -> bool:
        """Have the room that a loop lacked; false if that is not what it lacked: something has jumped."""
        return self._storage.grow(status)

    def count_in(self, state: State, gap: float) -> None:
        """Take the end of a step that no loop has made into the tally."""
        p, arrays = self._storage.problem, self._arrays_of(state)
        if self._counted is None or self._counted.sums is not p.sums:
            self._counted = Counted(surfaces=p.surfaces, strands=p.strands, sums=p.sums, state=arrays, tally=self.tally)
        count_step(self._counted, gap, float(state.time[0]))

    def count_shape(self, state: State, end: Place, rest_edge: Array) -> None:
        """Take the shape of a state that no loop has led to into the tally: `engine.step.count_end` without kernels.

        Parameters
        ----------
        state : State
        end : Place
            That of the state.
        rest_edge : Array
            Rest strains of edges there, shape (n_edge,).
        """
        model = self._model
        a, b = model.joint_a[: model.bend_count], model.joint_b[: model.bend_count]
        tangents, directors = end.tangent, end.director1
        bend = np.einsum("ki,ki->k", tangents[b], directors[a]) - np.einsum("ki,ki->k", tangents[a], directors[b])
        bend /= 1.0 + np.einsum("ki,ki->k", tangents[a], tangents[b])
        curvature = np.abs(bend) / model.voronoi_length
        strain = np.abs(end.length[: model.edge_count] / model.rest_length - 1.0 - rest_edge)
        self.figures[3:] = np.maximum(self.figures[3:], [curvature.max(initial=0.0), strain.max(initial=0.0)])
        np.maximum(self.body_top, state.body_position[: len(self.body_top), 2], out=self.body_top)


@dataclass(frozen=True)
class Settings:
    """How a loop goes about its steps.

    Attributes
    ----------
    tolerance : float
        Of Newton [m/s].
    max_iterations : int
    mode : int
        From `modes`.
    length : float
        For other modes than steps, as for `step.make_step` [s].
    changes : bool
        Whether a jump ends the loop, because another integrator has to step in.
    counts : bool
        Whether steps are taken into the tally.
    """

    tolerance: float
    max_iterations: int
    mode: int
    length: float
    changes: bool
    counts: bool


@dataclass(frozen=True)
class MarchReport:
    """How a loop ended.

    Attributes
    ----------
    done : int
        Number of steps made.
    status : int
        Why it ended, in the loop's own numbers.
    place : int
        Which configuration is the last.
    pair : int
        Blocking pair, −1 if none.
    newton : NewtonReport
        Iterations of all attempts; the rest is that of the last one.
    largest_residual : float
        Of the steps made [m/s].
    shortest, longest : float
        Lengths of the steps made [s].
    length : float
        That of the last step, or of the attempt that failed [s].
    rejected, inaccurate : int
        Attempts that were made again, shorter, and those of them whose error was too large.
    error : float
        That of the attempt that failed, in tolerances.
    """

    done: int
    status: int
    place: int
    pair: int
    newton: NewtonReport
    largest_residual: float
    shortest: float
    longest: float
    length: float
    rejected: int = 0
    inaccurate: int = 0
    error: float = 0.0

    def followed_by(self, more: MarchReport) -> MarchReport:
        """Both together; it ends as `more` does."""
        newton = replace(
            more.newton,
            iterations=self.newton.iterations + more.newton.iterations,
            factorisations=self.newton.factorisations + more.newton.factorisations,
            backtracks=self.newton.backtracks + more.newton.backtracks,
        )
        return replace(
            more,
            done=self.done + more.done,
            newton=newton,
            largest_residual=max(self.largest_residual, more.largest_residual),
            shortest=min(self.shortest, more.shortest),
            longest=max(self.longest, more.longest),
            rejected=self.rejected + more.rejected,
            inaccurate=self.inaccurate + more.inaccurate,
        )

    @property
    def failed(self) -> bool:
        """Whether the step after those made failed; otherwise, if it was not made, it is not one for the loop."""
        return self.status in FAILURES or self.status == TOO_INACCURATE

    @property
    def finished(self) -> bool:
        """Whether all steps were made."""
        return self.status == CONVERGED
