"""Compiled steps for the stepper: what they take, and what they leave."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np

from ..model.model import Model
from ..model.rest_strains import RestStrains
from ..model.state import State
from ..solve.configuration import Configuration
from ..solve.newton import NewtonReport, NewtonStatus
from ..solve.potential import IncrementalPotential
from .allocate import ContactColumns
from .build import lasting_groups, leaving_of, sliding_of, slips_of, surfaces_of, threads_of, wide_of
from .loop import Counted, Loop
from .modes import STEP
from .problem import Problem
from .status import CONVERGED, FAILURES, NO_ROOM, NO_ROOM_FOR_RODS, NO_ROOM_IN_BORDER, TOO_INACCURATE
from .step import count_step, take_steps
from .step_groups import Course, Method, Place, StateArrays, Tally
from .terms import NAMES, require_computed
from .workspace import sums_of, work_of

Array = np.ndarray


def _first_of(potential: IncrementalPotential) -> SimpleNamespace:
    """Its first derivatives, named as in `FirstDerivatives`."""
    out = potential.accumulators
    parts = {name: getattr(out, name) for name in ("node", "edge", "pair", "body", "carrier", "contact")}
    attached = potential.attached_gradient
    return SimpleNamespace(flat=out.all_but_carriers, unknowns=potential.gradient, attached=attached, **parts)


def _second_of(potential: IncrementalPotential) -> SimpleNamespace:
    """Its second derivatives, named as in `SecondDerivatives`."""
    matrix = potential.matrix
    names = ("edge_hessian", "cross_hessian", "pair_hessian", "node_hessian", "body_hessian")
    return SimpleNamespace(flat=matrix.second_derivatives, **{name: getattr(matrix, name) for name in names})


class Engine:
    """Compiled steps of a model, sharing arrays with a potential and three configurations.

    Attributes
    ----------
    touched : Array
        Carriers that something pushed at the end of the last step, bool, shape (n_carrier,).
    ranges : Array
        Of channels, in their units, shape (n_channel,).
    figures, nodes, most_nodes, first_contact, body_top : Array
        Extremes of the run; see `march.step_groups.Tally`.
    """

    def __init__(
        self,
        model: Model,
        potential: IncrementalPotential,
        places: list[Configuration],
        keeps_slopes: bool,
        stages: int,
    ):
        self._model, self._potential = model, potential
        self.keeps = 1 if keeps_slopes else None
        self._energy = np.zeros(len(NAMES))
        require_computed(model.forces)
        self._groups = lasting_groups(model, potential.matrix)
        self._problem: Problem | None = None
        self._rooms: tuple | None = None
        self._state: State | None = None
        self._loop: Loop | None = None
        self._counted: Counted | None = None
        self.ranges = np.array([c.maximum - c.minimum for c in model.scene.stimuli.values()], dtype=float)
        self._columns = model.bodies.freedom.shape[1]  # room in the border
        self._width = np.zeros(1, dtype=np.int64)  # of it in use
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
        records = [Place(**dict(zip(Place.fields, place.arrays, strict=True))) for place in places]
        self._work = work_of(model, records, self.touched, self._groups["off_axis"], stages)

    def start_over(self, height: float) -> None:
        """Forget the extremes of the run; the mass centre is at `height` [m]."""
        self.figures[:] = height, math.inf, 0.0, 0.0, 0.0
        self.body_top[:] = -math.inf
        self.nodes[:], self.most_nodes[:], self.first_contact[:] = 0, 0, math.nan

    def _gather(self) -> Problem:
        """The problem with the present rooms for near pairs, contacts, and nodes in the border."""
        potential, model = self._potential, self._model
        near, matrix = potential.near, potential.matrix
        rods = matrix.rods
        rooms = len(near.carrier) if near else 0, rods.room if rods else 0, self._columns
        if rooms != self._rooms:
            room = rooms[0]
            self._problem = Problem(
                **self._groups,
                wide=wide_of(model, self._columns, self._width) if rods or model.free_count else None,
                surfaces=surfaces_of(model, near) if near else None,
                sliding=sliding_of(model, room) if near else None,
                threads=threads_of(model, rods) if rods else None,
                slips=slips_of(model, room + (rods.sliding.room if rods else 0)),
                leaving=leaving_of(ContactColumns(model, rods.contacts.room + rods.sliding.room)) if rods else None,
                sums=sums_of(_first_of(potential), _second_of(potential), self._energy, 2 * room),
            )
            self._rooms, self._counted = rooms, None
        return self._problem

    def _arrays_of(self, state: State) -> StateArrays:
        if state is not self._state:
            self._state, self._counted = state, None
            self._state_arrays = StateArrays(**{name: getattr(state, name) for name in StateArrays.fields})
        return self._state_arrays

    def loop_of(self, state: State, method: Method, course: Course) -> Loop:
        """What compiled steps take, with the present rooms; the same object as long as all parts are."""
        parts = {"problem": self._gather(), "state": self._arrays_of(state), "method": method, "course": course}
        if self._loop is None or any(getattr(self._loop, name) is not part for name, part in parts.items()):
            self._loop = Loop(
                **parts, work=self._work, before=np.zeros_like(state.values), tally=self.tally, ranges=self.ranges
            )
        return self._loop

    def march(self, state: State, method: Method, course: Course, h: float, settings: Settings) -> MarchReport:
        """Make the steps of a course, each of length `h` [s], as far as they succeed; `state` is that after them."""
        loop = self.loop_of(state, method, course)
        flags = self.keeps, settings.mode, settings.changes, settings.counts
        done, status, pair, place, iterations, factorisations, backtracks, residual, worst, gap = take_steps(
            loop, *flags, h if settings.mode == STEP else settings.length, settings.tolerance, settings.max_iterations
        )
        if status == CONVERGED or status in FAILURES:
            self.take_over(gap)
        how = FAILURES.get(status, NewtonStatus.CONVERGED)
        newton = NewtonReport(how, iterations, factorisations, residual, backtracks)
        return MarchReport(done, status, place, pair, newton, worst, h, h, h)

    def take_over(self, gap: float) -> None:
        """Leave the energies of the last configuration, and the smallest gap there [m], to the potential."""
        self._potential.take_over(dict(zip(NAMES, self._energy.tolist(), strict=True)), gap)

    @property
    def moved(self) -> float:
        """Largest displacement of a material point in the last round of statics [m]."""
        return float(self._work.moved[0])

    @property
    def unstable(self) -> int:
        """How many directions were found unstable when they were last counted."""
        return int(self._groups["system"].negative[0])

    def set_drive(self, rest: RestStrains, load_factor: Array) -> None:
        """What acts on the state that is looked at next, by settings that say so."""
        stage = self._work.stage
        stage.rest_edge[:], stage.rest_joint_out[:], stage.load_factor[:] = rest.edge, rest.joint, load_factor

    def make_room(self, status: int) -> bool:
        """Have the room that a loop lacked; false if that is not what it lacked: something has jumped."""
        if status == NO_ROOM:
            self._potential.near.grow()
        elif status == NO_ROOM_FOR_RODS:
            self._potential.matrix.rods.make_room()
        elif status == NO_ROOM_IN_BORDER:
            self._columns = 2 * int(self._width[0])
        else:
            return False
        return True

    def count_in(self, state: State, gap: float) -> None:
        """Take the end of a step that no loop has made into the tally."""
        p, arrays = self._gather(), self._arrays_of(state)
        if self._counted is None:
            self._counted = Counted(surfaces=p.surfaces, strands=p.strands, sums=p.sums, state=arrays, tally=self.tally)
        count_step(self._counted, gap, float(state.time[0]))

    def count_shape(self, state: State, end: Configuration, rest_edge: Array) -> None:
        """Take the shape of a state that no loop has led to into the tally: `march.step.count_shape` without kernels.

        Parameters
        ----------
        state : State
        end : Configuration
            That of the state.
        rest_edge : Array
            Rest strains of edges there, shape (n_edge,).
        """
        model = self._model
        curvature = np.abs(end.joint_strain[: model.bend_count, 0]) / model.voronoi_length
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
        For other modes than steps, as for `step.take_step` [s].
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
