"""The simulator: a scene, its state, and the loop that advances it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bilayer_core.engine.energy_account import OPEN, QUESTIONED
from bilayer_core.errors import InputError
from bilayer_core.forces.force_register import memory_size
from bilayer_core.integrators.integrator_register import INTEGRATORS
from bilayer_core.model.build_model import build_model
from bilayer_core.model.findings import told
from bilayer_core.model.fingerprint import conditions_of, fingerprint_of
from bilayer_core.model.impacts import reason_of_stiffness
from bilayer_core.model.model import Model
from bilayer_core.model.plan import make_plan
from bilayer_core.model.start_barrier import start_warnings
from bilayer_core.model.state import State, initial_state, refuse_out_of_plane, turn_directors
from bilayer_core.observed.frame import Description, Frame
from bilayer_core.observed.inputs import LINEAR, RESET, Input
from bilayer_core.observed.observer import Observer
from bilayer_core.printable import html_table
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.loader import load_content, load_scene, scene_content
from bilayer_core.simulation.capture import Capture, make_frame
from bilayer_core.simulation.controls import Controls
from bilayer_core.simulation.energy_budget import EnergyLedger
from bilayer_core.simulation.equilibrium import StaticReport, solve_static
from bilayer_core.simulation.friction_changes import coefficients
from bilayer_core.simulation.gradients.derivatives import DifferentiableRun, Gradient, differentiate
from bilayer_core.simulation.gradients.equilibrium_response import Equilibrium
from bilayer_core.simulation.gradients.nearby import Builders
from bilayer_core.simulation.momentum import angular_momentum_of, momentum_of
from bilayer_core.simulation.observation import (
    describe,
    energies,
    positions_with_points,
    velocities_with_points,
)
from bilayer_core.simulation.other_values import state_with
from bilayer_core.simulation.plane_watch import PlaneWatch
from bilayer_core.simulation.poses import LEAST_TIME
from bilayer_core.simulation.progress_bar import progress_bar
from bilayer_core.simulation.run_loop import Callbacks, RunLoop, time_left
from bilayer_core.simulation.run_result import RunResult
from bilayer_core.simulation.same_model import differing
from bilayer_core.simulation.settling import SETTLE, settle, unstable_start
from bilayer_core.simulation.statistics import RunStatistics, center_of_mass
from bilayer_core.simulation.step_choice import choose_steps
from bilayer_core.simulation.stepper import Stepper, StepReport
from bilayer_core.simulation.summary import summarise
from bilayer_core.simulation.views.body import BodyView, body_views
from bilayer_core.simulation.views.clamp import ClampView, clamp_views
from bilayer_core.simulation.views.joint import JointView, joint_views
from bilayer_core.simulation.views.present import ByName, Present
from bilayer_core.simulation.views.rod import RodView, rod_views

Array = np.ndarray


class Simulator:
    """A scene in motion.

    Parameters
    ----------
    scene : SceneConfig, str, Path or mapping
        From `bilayer_core.load_scene`, or what that takes: a file, the name of a bundled scene, or content.
    model, dimension, integrator : str or int
        Override the scene's; ``"auto"`` keeps them.
    dt : float, optional
        Alone: fixed steps of this length [s], whatever the scene says; with `tolerance` the first adaptive one.
    tolerance : float, optional
        Overrides the scene's: the largest error per step, relative to the longest rod. With one, steps are adaptive.
        It is no bound on the error of a whole run, which is larger; `bilayer_core.estimate_error` tells that.
    budget : bool
        Keep the energy budget of the run (`budget`): steps cost four to thirteen times as much.

    Attributes
    ----------
    scene : SceneConfig
    plan : Plan
        Model, dimension and integrator, and the terms that are computed.
    model : Model
    steps : Steps
    dt : float
        Length of fixed steps, or of the first adaptive one [s].
    tolerance : float or None
        Of adaptive steps.
    keeps_budget : bool
    settled : StaticReport or None
        How a scene that settles first found its equilibrium, once kernels are compiled.

    Raises
    ------
    SceneError
        If the scene cannot be simulated as asked.
    PenetrationError
        If it starts with surfaces inside each other.
    """

    def __init__(
        self,
        scene: SceneConfig | str | Path | Mapping[str, Any],
        *,
        model: str = "auto",
        dimension: str | int = "auto",
        integrator: str = "auto",
        dt: float | None = None,
        tolerance: float | None = None,
        budget: bool = False,
    ) -> None:
        scene = load_scene(scene)
        self.plan = make_plan(scene, model=model, dimension=dimension, integrator=integrator)
        method = INTEGRATORS[self.plan.integrator]
        self._asked_steps = dt, tolerance
        self.steps = choose_steps(scene, method, *self._asked_steps)
        self.dt, self.tolerance = self.steps.dt, self.steps.tolerance
        self.scene = scene
        self.model = build_model(scene, self.plan.model, self.plan.dimension)
        self._keeps_history = method.history is not None
        self._fingerprint = fingerprint_of(scene, self.plan.model, self.plan.integrator if self._keeps_history else "")
        self._conditions = float(conditions_of(scene))
        self._method = method
        self._stepper = self._stepper_of(self.model)
        self.keeps_budget = budget
        self._stepper.ledger = EnergyLedger(self.model) if budget else None
        self._state = self._initial_state()
        self.settled: StaticReport | None = None
        self.plane_watch = PlaneWatch(self._in_dimension, scene.duration) if self.plan.dimension == 2 else None
        self._controls = Controls(self._stepper, self._state)
        self._unsettled = scene.start == SETTLE
        self._loop = RunLoop(self._stepper, self._state, self._controls, self.plane_watch, self._settle)
        self._present = Present(
            self._stepper, lambda: self._now, self._loop.compile, lambda: self.description, self.frame
        )
        self._note_start()

    def __repr__(self) -> str:
        dof = self.model.node_count
        return (
            f"Simulator({self.scene.name} at t = {self.time:g} s: {self.plan.model} in {self.plan.dimension}-D, "
            f"{self.plan.integrator}, {len(self.model.strands)} strands, {dof} nodes, {len(self.bodies)} bodies)"
        )

    def _repr_html_(self) -> str:
        """Return the simulator as a table for notebooks."""
        plan = f"{self.plan.model} in {self.plan.dimension}-D, {self.plan.integrator}"
        stimuli = ", ".join(f"{name} {channel.unit.strip('1')}".strip() for name, channel in self.scene.stimuli.items())
        rows = {
            "time": f"{self.time:g} of {self.scene.duration:g} s",
            "rods, nodes, bodies": f"{len(self.rods)}, {self.model.node_count}, {len(self.bodies)}",
            "solver": plan,
            "stimuli": stimuli or "none",
        }
        return html_table(f"{self.scene.name}: {self.scene.title}", rows)

    def show(self, **look: Any) -> Any:
        """Show the robot as it is now: in rerun, where `rerun-notebook` is installed, otherwise as a picture.

        Parameters
        ----------
        **look
            Of a picture: ``camera``, ``background``, ``colour``, ``size``, ``reactions``, as ``bilayer render``.

        Returns
        -------
        object
            A notebook shows it.
        """
        from bilayer_core.log.run.memory import MemoryRecorder

        recorder = MemoryRecorder()
        recorder.start(self.description)
        recorder.observe(self.frame())
        return recorder.run_data().show(**look)

    def _stepper_of(self, model: Model) -> Stepper:
        return Stepper(model, self._method, self.steps, self.scene.solver.max_newton_iterations)

    def _in_dimension(self, dimension: int) -> Stepper:
        """Return a stepper of the same scene in a dimension."""
        same = dimension == self.plan.dimension
        return self._stepper_of(self.model if same else build_model(self.scene, self.plan.model, dimension))

    def _initial_state(self) -> State:
        return self._state_of(self.model)

    def _state_of(self, model: Model) -> State:
        """Return the first state of the model, or of one with other numbers in its scene."""
        return initial_state(model, self._keeps_history, self._fingerprint, memory_size(model), self._conditions)

    def _note_start(self) -> None:
        com = center_of_mass(self.model, self._state)
        self.start_time, self.start_com, self.start_bodies = self.time, com, self._state.body_position.copy()

    @property
    def _now(self) -> State:
        """The state; a scene that settles has its first one when kernels are compiled."""
        if self._unsettled:
            self.compile()
        return self._state

    def _settle(self) -> None:
        """Go to the equilibrium with which a scene starts that settles, and begin to count there."""
        if self._unsettled:
            self.settled = settle(self._stepper, self._state, self._in_space)
            self._unsettled = False
            self._loop.start_over()
            self._note_start()

    @property
    def _in_space(self) -> Callable[[], Stepper] | None:
        """A function that makes a stepper of the same scene in dimension 3, if this is one of dimension 2."""
        return (lambda: self._in_dimension(3)) if self.plan.dimension == 2 else None

    @property
    def start_warnings(self) -> tuple[str, ...]:
        """Warnings of what the start does to the run, a line for each kind."""
        return (*told(start_warnings(self.model)), *unstable_start(self.settled))

    @property
    def reasons(self) -> dict[str, str]:
        """Why `model`, `dimension`, `integrator` and `stepping` are what they are, and `contact_stiffness` if that is
        not the scene's.
        """
        return {**self.plan.reasons, "stepping": self.steps.reason, **reason_of_stiffness(self.model)}

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return float(self._state.time[0])

    @property
    def positions(self) -> Array:
        """Positions of nodes, layer by layer, then of contact points of bodies [m], shape (nodes, 3)."""
        return positions_with_points(self.model, self._now)

    @property
    def velocities(self) -> Array:
        """Their velocities [m/s], shape (nodes, 3)."""
        return velocities_with_points(self.model, self._now)

    @property
    def contact_forces(self) -> Array:
        """Barrier and friction force on each of them [N], shape (nodes, 3)."""
        return self._present.seen().contact_force

    @property
    def com(self) -> Array:
        """Mass centre of the robot: rods, and bodies that hold them or are joined to these [m], shape (3,)."""
        return center_of_mass(self.model, self._now)

    @property
    def momentum(self) -> Array:
        """Momentum of rods and free bodies, without that of a fluid [N s], shape (3,)."""
        return momentum_of(self.model, self._now)

    @property
    def angular_momentum(self) -> Array:
        """Their angular momentum about the origin [N m s], shape (3,)."""
        return angular_momentum_of(self.model, self._now)

    @property
    def stimulus(self) -> dict[str, float]:
        """Value of each channel over the last step, in its unit."""
        self.compile()
        return dict(zip(self.scene.stimuli, self._stepper.stimulus.tolist(), strict=True))

    @property
    def friction(self) -> dict[str, float]:
        """Coefficients of friction that act, by their keys in `contact.friction`; empty where there is none."""
        return coefficients(self.model, self._state)

    @property
    def rods(self) -> ByName[RodView]:
        """Every rod by name: positions, strain, curvature, directors and contact forces of its nodes, and its layers.

        Copies of a pattern have names of their own, such as ``arm_0``.
        """
        return rod_views(self._present)

    @property
    def bodies(self) -> ByName[BodyView]:
        """Every body by name: its pose, and the force and moment of contact and of the rods that it holds."""
        return body_views(self._present)

    @property
    def clamps(self) -> ByName[ClampView]:
        """Every end of a rod that a body holds, by ``ROD.start`` or ``ROD.end``: the force and moment that it bears."""
        return clamp_views(self._present)

    @property
    def joints(self) -> ByName[JointView]:
        """Every joint between bodies by name: the force and moment that it bears, and how far it gives way."""
        return joint_views(self._present)

    @property
    def pair_forces(self) -> dict[tuple[str, str], float]:
        """Sum of the normal forces between every two rods, bodies or obstacles that can touch [N]."""
        return dict(zip(self.description.contact_pairs, self._present.seen().pair_force.tolist(), strict=True))

    @property
    def curvatures(self) -> Array:
        """Curvature χ through the thickness at every node [1/m], shape (nodes,)."""
        return self._present.seen().curvature

    def energy(self) -> dict[str, float]:
        """Return the energy of each term.

        Returns
        -------
        dict of str to float
            By the name of the term [J].
        """
        return energies(self.model, self._present.seen())

    @property
    def energy_account(self) -> Array:
        """Account of the energy that steps supplied, lost and made; slots in `engine.energy_account`."""
        return self._state.account.copy()

    @property
    def statistics(self) -> RunStatistics:
        """Figures of the run since its start."""
        return self._loop.statistics

    @property
    def termination(self) -> str:
        """How the last run ended; ``"completed"`` before any."""
        return self._loop.termination

    @property
    def cpu_time(self) -> float:
        """CPU time of the steps [s]."""
        return self._loop.cpu_time

    @property
    def wall_time(self) -> float:
        """Elapsed time of the steps [s]."""
        return self._loop.wall_time

    def budget(self) -> dict[str, Any]:
        """Return where the energy went since the start, `reset`, `load_state` or `solve_static`; see `EnergyLedger`.

        Returns
        -------
        dict
            Energies by name [J].

        Raises
        ------
        InputError
            If the simulator keeps no budget.
        """
        if self._stepper.ledger is None:
            raise InputError("budget: is not kept; make the simulator with budget=True")
        self.compile()
        return self._stepper.ledger.budget()

    @property
    def description(self) -> Description:
        """Description of the run: everything that does not change while it lasts."""
        return describe(self.model, self._state, self.plan, self.steps, self._stepper.contact_owners.pairs)

    def frame(self) -> Frame:
        """Return a snapshot.

        Returns
        -------
        Frame
            The present values.
        """
        self.compile()
        return make_frame(Capture(self._stepper, self._state), self.statistics, self.cpu_time)

    def set_stimulus(self, channel: str, value: float | None, *, over: float = 0.0, shape: str = LINEAR) -> None:
        """Set a channel from the next step on, in its unit.

        Parameters
        ----------
        channel : str
        value : float or None
            None gives it back to the scene's schedule. A value that passes the range by rounding only, such as
            1.0000000000000002, is the end of the range.
        over : float
            Simulated time in which it gets there from what it is now [s]; 0 is a jump. Steps follow a ramp without
            beginning again, also one that is replaced by another on its way: what comes often is cheaper so.
        shape : str
            ``linear``; or ``smooth``, half a wave of a cosine, which begins and ends at rest and excites less.

        Raises
        ------
        InputError
            If there is no such channel, the value is not finite or out of the channel's range, or `over` is no time, or
            given without a value, or there is no such shape; nothing is changed then.
        """
        self._controls.set_stimulus(channel, value, over=over, shape=shape)

    def set_values(self, values: Mapping[str, Any]) -> None:
        """Give numbers of the scene other values, from the next step on: the robot goes on from where it is.

        Materials, layers and sections of rods, gravity and damping may change: moduli, densities, gains, thickness,
        width, and their profiles, which may have other points. What layers are made of stays in its place and keeps its
        velocity. A model is built, as for a new simulator.

        Parameters
        ----------
        values : mapping of str to object
            By paths in the scene, as overrides of `load_scene`: ``{"materials.gel.youngs_modulus": 2e6}``,
            ``{"rods.strip.layers.active.eigenstrain.gain.value": [0.01, 0.02, 0.0]}``.

        Raises
        ------
        InputError
            If something else would change, a rod would reach into something, or somebody observes the run: a log is of
            one scene. Nothing is changed then.
        SceneError
            If the scene cannot have these values.
        """
        if self._controls.listeners or self._loop.attached:
            raise InputError("set_values: not while a log or an observer is attached; detach it first")
        scene, plan = load_content(scene_content(self.scene), values), self.plan
        plan = make_plan(scene, model=plan.model, dimension=plan.dimension, integrator=plan.integrator)
        other = build_model(scene, plan.model, plan.dimension)
        fingerprint = fingerprint_of(scene, plan.model, plan.integrator if self._keeps_history else "")
        conditions = float(conditions_of(scene))
        start = initial_state(other, self._keeps_history, fingerprint, memory_size(other), conditions)
        begin = state_with(self.model, other, self._now, start)
        self._loop.go_on(other, choose_steps(scene, self._method, *self._asked_steps), begin)
        self.scene, self.model, self.steps = scene, other, self._stepper.steps
        self.dt, self.tolerance = self.steps.dt, self.steps.tolerance
        self.plan = replace(plan, reasons=self.plan.reasons)  # with other terms
        self._fingerprint, self._conditions = fingerprint, conditions
        self._present.forget_model()

    def set_load(self, name: str, factor: float | None, *, over: float = 0.0, shape: str = LINEAR) -> None:
        """Multiply force and moment of a load by a factor from the next step on.

        Parameters
        ----------
        name : str
        factor : float or None
            None gives it back to its schedule.
        over, shape
            As in `set_stimulus`.

        Raises
        ------
        InputError
            If there is no such load, the factor is not finite, or `over` is no time, or given without a factor, or
            there is no such shape; nothing is changed then.
        """
        self._controls.set_load(name, factor, over=over, shape=shape)

    def set_friction(self, value: float | None, key: str = "coefficient") -> None:
        """Let a coefficient of friction jump to a value, from the next step on.

        Parameters
        ----------
        value : float or None
            None gives it back to the scene.
        key : str
            Of `contact.friction`: ``coefficient``, ``forward``, ``backward`` or ``sideways``. Those that the scene does
            not give, and that are not set, go with ``coefficient``.

        Raises
        ------
        InputError
            If nothing slides against friction in the scene, there is no such coefficient, or the value is not finite or
            below 0; nothing is changed then.
        """
        self._controls.set_friction(value, key)

    def set_pose(
        self,
        name: str,
        position: Sequence[float] | None = None,
        quaternion: Sequence[float] | None = None,
        *,
        over: float = LEAST_TIME,
    ) -> None:
        """Let a prescribed body go to a pose from the next step on, and rest there; see `simulation.poses`.

        It gets there in the time `over`, or in the time that its `top_speed` and `top_angular_speed` demand if that is
        longer, with a continuous velocity from where and however fast it moves now. Its schedule acts no more, until
        `reset`.

        Parameters
        ----------
        name : str
            A prescribed body with a `top_speed` or a `top_angular_speed`.
        position : sequence of float, optional
            Of its mass centre, in the world [m]; without one that of its present goal, or the present one.
        quaternion : sequence of float, optional
            Orientation x y z w, of any length above 0, likewise; reached by at most half a turn.
        over : float
            The least time until it is there [s].

        Raises
        ------
        InputError
            If there is no such body, or it may not move or turn, or not in this way; nothing is changed then.
        """
        self._controls.set_pose(name, position, quaternion, over=over)

    def listen(self, note: Callable[[Input], None]) -> Callable[[], None]:
        """Report all inputs from outside to a listener from now on.

        Parameters
        ----------
        note : callable
            Called with each `observed.inputs.Input`, before the step from which on it acts.

        Returns
        -------
        callable
            Ends the reports.
        """
        return self._controls.listen(note)

    def compile(self) -> float:
        """Compile all kernels that are not in the cache, and prepare the start.

        Others are read from the cache when the simulation first needs them, and their time is counted here as well, not
        in `cpu_time`. Whatever needs kernels calls it.

        Returns
        -------
        float
            CPU time of this for the scene [s].
        """
        return self._loop.compile()

    def step(self, until: float = math.inf) -> StepReport:
        """Advance by one step.

        Parameters
        ----------
        until : float
            Simulated time [s] at which an adaptive step ends at the latest; a fixed one is as long as ever.

        Returns
        -------
        StepReport

        Raises
        ------
        SimulationError
            If it cannot be made; the state is that of the last step, or of the last part of it.
        """
        return self._loop.step(until, whole=True)

    def advance(self, until: float = math.inf) -> StepReport:
        """Advance by one step, or by one part of a fixed one; otherwise like `step`.

        Parameters
        ----------
        until : float
            As in `step` [s].

        Returns
        -------
        StepReport
        """
        return self._loop.step(until, whole=False)

    def run(
        self,
        duration: float | None = None,
        *,
        until: float | None = None,
        stop: Callable[[], bool] | None = None,
        log: str | Path | None = None,
        overwrite: bool = False,
        observers: Sequence[Observer] = (),
        inputs: Sequence[Input] = (),
        progress: Callable[[float], None] | bool = False,
        each_step: Callable[[float], None] | None = None,
        interrupted: Callable[[], bool] | None = None,
        gradients: bool | int = False,
    ) -> RunResult:
        """Advance by a duration or to a time (default: to the end of the scene), showing frames to observers.

        Fixed steps end within half a step of it, adaptive ones exactly there. No step ends where an observer is due, so
        the run is the same bit for bit whatever watches it; frames within a step are interpolated
        (`simulation.step_span`). A run in parts has one more end of a step where the parts meet.

        Parameters
        ----------
        duration : float, optional
            Simulated time to advance by [s].
        until : float, optional
            Simulated time to advance to [s], instead.
        stop : callable, optional
            Asked after each step; true ends the run, as ``stopped``. Steps are then made one by one, which takes a
            little longer and changes none.
        log : str or Path, optional
            MCAP file to write, at the rates of the scene's `output`; for others put a
            `bilayer_core.log.file.mcap_log.McapRecorder` among the observers.
        overwrite : bool
            Replace that file if it exists.
        observers : sequence of Observer
            Each sees the first frame, the last, and those at its rate between, each of its own time; all are closed
            whatever happens. For those that look at more than one run see `attach`.
        inputs : sequence of Input
            What acts from outside (`observed.inputs`), each from its time on: adaptive steps end there, of fixed ones
            it acts from the first that begins then or later.
        progress : bool or callable
            True shows a bar, in notebooks and on terminals. A function is called every few steps with the simulated
            time [s].
        each_step : callable, optional
            Called with the simulated time [s] after each step, made one by one.
        interrupted : callable, optional
            Asked every few steps, and within long ones; true ends the run, as ``interrupted``, at the last step made.
        gradients : bool or int
            Keep the steps, made one by one, for `RunResult.gradient`: states of up to 256 MB, or of so many bytes;
            steps between them are made again.

        Returns
        -------
        RunResult

        Raises
        ------
        InputError
            If the duration or the time is none to which the run can advance, or the log cannot be begun: nothing is
            changed then.
        SimulationError
            If a step cannot be made.
        OutputError
            If a log cannot be written. Observers have then seen the last accepted frame and are closed; what goes wrong
            with that is a note to the error.
        """
        if log is not None:
            from bilayer_core.log.file.mcap_log import McapRecorder

            output = self.scene.output
            observers = [McapRecorder(log, output.rate, output.marker_rate, overwrite), *observers]
        differentiable: DifferentiableRun | None = None
        if gradients is not False:
            self.compile()
            differentiable = DifferentiableRun(self._stepper, self._state, self._builders, self.description, gradients)
            each_step = differentiable.keeping(each_step)
        bar: AbstractContextManager[Any] = nullcontext(progress)
        if progress is True:
            end = self.time + time_left(self.time, self.scene.duration, duration, until)
            bar = progress_bar(self.scene.name, self.time, end)
        with bar as shown:
            callbacks = Callbacks(stop, interrupted, shown or None, each_step)
            result = self._loop.run(self, duration, until, observers, inputs, callbacks)
        if log is None and differentiable is None:
            return result
        return replace(result, log=str(log or ""), differentiable=differentiable)

    def attach(self, observer: Observer) -> Callable[[], None]:
        """Show frames to an observer from now on, at its rate, whoever makes steps.

        It also sees the last frame of each `run`, and the first after `load_state` and `reset`. It is closed when it is
        detached.

        Parameters
        ----------
        observer : Observer

        Returns
        -------
        callable
            Detaches the observer.
        """
        return self._loop.attach(observer, self)

    def solve_static(self, tolerance: float | None = None) -> StaticReport:
        """Go to an equilibrium under the present stimuli and loads, not in time; see `simulation.equilibrium`.

        Parameters
        ----------
        tolerance : float, optional
            Displacement that counts as rest [m]; default: 1e-10 of the longest rod.

        Returns
        -------
        StaticReport
            How it went, and whether the equilibrium is stable, in all of space whatever the dimension.

        Raises
        ------
        SimulationError
            If none is found; nothing is changed then.
        """
        self.compile()
        with self._loop.timed():
            try:
                return solve_static(self._stepper, self._state, tolerance, self._in_space)
            finally:
                self._loop.take_state()

    def gradient(self, of: str | Sequence[str], to: str | Sequence[str]) -> Gradient:
        """Return derivatives of the equilibrium at which the robot is; those of runs are `RunResult.gradient`.

        Parameters
        ----------
        of : str or sequence of str
            Quantities by the names that logs have: ``"com"``, ``"rod/strip/position"``, ``"energy/bending"``,
            ``"body/wall/clamp_wrench"``.
        to : str or sequence of str
            Channels of stimuli, and paths of numbers in the scene, or of lists of numbers, as ``--set`` takes them:
            ``"materials.gel.youngs_modulus"``.

        Returns
        -------
        Gradient
            Arrays by quantity and parameter: ``found["com", "humidity"]``.

        Raises
        ------
        InputError
            If the robot is not at rest, there is no such quantity or parameter, or a parameter acts on nothing.
        SimulationError
            If the equilibrium is unstable.
        """
        return differentiate(self._equilibrium(), of, to)

    def _equilibrium(self) -> Equilibrium:
        """Return the equilibrium at which the robot is, with the factor of its Hessian, for studies; see `gradient`."""
        self.compile()
        return Equilibrium(self._stepper, self._state, self._builders, self.description)

    @property
    def _builders(self) -> Builders:
        """Makers of models, steppers and states of scenes nearby."""
        plan, method, steps, most = self.plan, self._method, self.steps, self.scene.solver.max_newton_iterations
        return Builders(
            lambda scene: build_model(scene, plan.model, plan.dimension),
            lambda model: Stepper(model, method, steps, most),
            self._state_of,
        )

    def save_state(self) -> Array:
        """Return a flat copy of the state; `load_state` continues from it bit for bit.

        Its last values are a fingerprint of the scene (`model.fingerprint`), so that no other scene takes it.

        Returns
        -------
        ndarray
            Shape (size,).
        """
        self.compile()
        return self._state.flat()

    def load_state(self, snapshot: Array) -> None:
        """Go to a saved state of the same scene, or of a similar one.

        The scenes may differ in schedules of stimuli, loads, gravity, contact, friction, damping, drag, steps,
        tolerances and output.

        Parameters
        ----------
        snapshot : ndarray
            From `save_state`, shape (size,).

        Raises
        ------
        InputError
            If it is of another scene or model, or does not fit; nothing is changed then.
        """
        loaded = self._initial_state()
        loaded.set_flat(snapshot)
        refuse_out_of_plane(self.model, loaded)
        if not self._state.set_flat(snapshot):
            turn_directors(self.model, self._state)
            if self._state.account[OPEN] == 1.0:
                self._state.account[OPEN] = QUESTIONED
        self._unsettled, self.settled = False, None
        self._begin()

    def _begin(self) -> None:
        """Begin to count at the state, and show it to observers."""
        self.compile()
        self._loop.start_over()
        self._note_start()
        self._loop.take_state()
        for attached in self._loop.attached:
            attached.start_over()

    def reset(self, scene: SceneConfig | str | Path | Mapping[str, Any] | None = None) -> None:
        """Go back to the start of the scene; what was set from outside is forgotten.

        Parameters
        ----------
        scene : SceneConfig, str, Path or mapping, optional
            Another scene with the same model (`same_model`), which is taken from now on: the run is that of a new
            simulator, bit for bit, without the time to build one. What the simulator was made with (`dt`, `tolerance`,
            `budget`) stays.

        Raises
        ------
        InputError
            If its model is another, or somebody observes the run: a log is of one scene. Nothing is changed then.
        """
        if scene is not None:
            self._take_scene(load_scene(scene))
        self._controls.note(RESET, "")
        self._state.take(self._initial_state())
        self._unsettled = self.scene.start == SETTLE
        self.compile()
        self._settle()
        self._begin()

    def same_model(self, scene: SceneConfig) -> bool:
        """Return whether `reset` takes a scene.

        Such a scene differs at most in texts, duration, output, schedules of stimuli and loads, steps and tolerances,
        and coefficients of friction that are and stay above 0.

        Parameters
        ----------
        scene : SceneConfig

        Returns
        -------
        bool
        """
        return not differing(self.scene, scene)

    def _take_scene(self, scene: SceneConfig) -> None:
        if others := differing(self.scene, scene):
            told = ", ".join(sorted(others))
            raise InputError(
                f"reset: the scene {scene.name!r} has another model than {self.scene.name!r}, by its {told}; allowed "
                "to differ are texts, duration, output, schedules of stimuli and loads, steps and tolerances, and "
                "coefficients of friction above 0; make a new Simulator"
            )
        if self._controls.listeners or self._loop.attached:
            raise InputError("reset: takes no other scene while a log or an observer is attached; detach it first")
        steps, iterations = choose_steps(scene, self._method, *self._asked_steps), scene.solver.max_newton_iterations
        self._stepper.take_scene(scene, steps, iterations)
        self.scene, self.model, self.steps = scene, self._stepper.model, steps
        self.dt, self.tolerance = steps.dt, steps.tolerance
        self._conditions = float(conditions_of(scene))
        self._state.take(self._initial_state())
        if self.plane_watch is not None:
            self.plane_watch.take_scene(scene.duration, lambda stepper: stepper.take_scene(scene, steps, iterations))

    def summary(self) -> dict[str, Any]:
        """Return figures of the run since the start, the last `reset` or `load_state`.

        Returns
        -------
        dict
            Keys as documented for ``--summary``.
        """
        return summarise(self)
