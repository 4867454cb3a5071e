"""The energy budget of a run: where the work of stimuli, loads and prescribed bodies goes.

Between two accepted configurations, a step h apart, with g the gradient of one term and Δq the displacement, both in
edge space (`motion`), and η the eigenstrain:

    work of a conservative force   W = −∫ g·dq, straight from qₙ to qₙ₊₁      by Simpson's rule: −ΔE to fourth order
    work of a barrier              the same, on halves where it must be
    work of a dissipative force    W = ½ h (Pₙ + Pₙ₊₁),  P = −g·v             second order, and never above zero
    work of the stimulus           W = ∫ s·dη, along the same way,  s = ∂E/∂η of each law (`engine.powers`)
    work of prescribed bodies      what moves held nodes and surfaces against all these forces, and their kinetic energy

Energies E and the kinetic energy T come from states alone, works from gradients alone, so that two sums measure
something:

    numerical  = Σ W of all forces and of prescribed bodies − ΔT
    residual   = supplied − ΔT − ΔE − lost                     supplied: stimulus, prescribed bodies, loads
                                                               lost: to dissipative forces, and numerical

*Numerical* is what the theorem of work and kinetic energy lacks: the dissipation of the integrator, and its errors in
forces (a lagged friction), at the integrator's order; implicit Euler takes h ∫ v̇·M v̇ dt. Under an integrator of
second order the error of the quadrature is in it with as much. The *residual* is the failure of works to be the
differences of energies: the error of the quadrature, of second order, and any error of a gradient.

A barrier is so steep that an impact happens within a step: at its two ends little or nothing may be left of it. All
else is taken at the accepted ends of steps with the velocities there; stages of an integrator are not looked at. The
powers of friction and drag are taken rather than force times displacement because each is of one sign however sharply
the force depends on the velocity. Friction has the normal forces of either end there, where a step of the integrator
has those of its start. What jumps between two steps (a load, a stimulus) is taken as a change over the second: an error
of first order in the step in which it happens.

Energies, momenta of the fluid, rest strains and forces of laws are those of the engine. Its own account of each step
(`engine.energy_account`) takes works by the integrator's weights, which costs nothing and leaves no residual by which
to find a wrong gradient. These works are not good enough here: for a clamped, driven bilayer at steps of 0.25 ms they
are wrong by 1e-3 of the largest row under implicit Euler and by 2.5e-5 to 5e-5 under other integrators, where the
residual of the budget is 5e-11. `tests/physics/test_energy_account.py` compares the two.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from bilayer_core.engine.evaluator import Evaluator
from bilayer_core.engine.request_modes import EVALUATION_TIME
from bilayer_core.forces.added_mass import fluid_momentum
from bilayer_core.kinematics.rotation import rotation_matrix
from bilayer_core.model.force_list import Kind, kinds
from bilayer_core.model.model import Model
from bilayer_core.model.records.step import Configuration
from bilayer_core.model.state import State, director_rates
from bilayer_core.model.stimulated_strains import RestStrains
from bilayer_core.simulation.edge_space import EdgeVector, displacement, gradient_of, of_prescribed, velocity
from bilayer_core.simulation.momentum import momentum_off_curve
from bilayer_core.simulation.quadrature import simpson

Array = np.ndarray
BARRIERS = ("barrier", "rod barrier")
BARRIER_ERROR = 1e-4
"""Of the work of a barrier over a step, as a part of its energy."""
BARRIER_HALVINGS = 10


@dataclass(frozen=True)
class _Fluid:
    """Inertia of the fluid: its kinetic energy in the world, over that of the undisturbed flow [J], and its forces."""

    energy: float
    momentum: Array  # P at nodes [N s], shape (n_node, 3)
    shape_gradient: Array  # ∂T/∂(e, θ) of edges, shape (n_edge, 4)


@dataclass(frozen=True)
class _Instant:
    """A state with its energies [J], forces and powers [W].

    `power` has for every dissipative term that of all forces, and that of those on what prescribed bodies impose.
    """

    at: Configuration
    kinetic: float
    imposed_kinetic: float
    fluid: _Fluid | None
    velocity: Array  # of nodes [m/s], shape (n_node, 3)
    carried: Array  # momentum of nodes that masses off the curve add [N s], shape (n_node, 3)
    rest: RestStrains
    load_factor: Array
    friction: Array
    law_force: Array  # −∂E/∂η of laws [J], shape (n_law,)
    energy: dict[str, float]
    gradient: dict[str, EdgeVector]
    power: dict[str, tuple[float, float]]


class EnergyLedger:
    """Sums works since `begin`, from `record` after every accepted step or part of one."""

    def __init__(self, model: Model):
        self._kinds: dict[str, Kind] = {}
        self._take(model)
        self._first: _Instant | None = None

    def _take(self, model: Model) -> None:
        self._model = model
        self._evaluator = Evaluator(model)  # with arrays of its own: those of the run stay as they are
        self._imposed_mass = np.zeros(model.node_count)
        imposed = model.constrained.node[model.constrained.free < 0]
        self._imposed_mass[imposed] = model.rods.node_mass[imposed]
        self._kinds |= {name: kinds()[name] for name in model.forces}
        self._watched = [name for name in model.forces if self._kinds[name] is not Kind.INERTIAL]

    def begin(self, state: State, load_factor: Array) -> None:
        """Start from zero at a state, with the factors of loads there."""
        self._first = self._last = self._evaluate_state(state, load_factor)
        self._work: dict[str, float] = defaultdict(float)  # of each force [J]
        self._imposed: dict[str, float] = defaultdict(float)  # of it on what prescribed bodies impose [J]
        self._stimulus = 0.0
        self._jumped: dict[str, float] = defaultdict(float)  # energies, where the model was replaced [J]

    def begin_step(self, state: State, load_factor: Array) -> None:
        """Take the factors of loads, and the coefficients of friction, with which a step begins, where they have jumped
        since the last one ended.
        """
        same = np.array_equal(state.friction, self._last.friction, equal_nan=True)
        if not (same and np.array_equal(load_factor, self._last.load_factor)):
            self._last = self._evaluate_state(state, load_factor)

    def take_model(self, model: Model, before: State, state: State, load_factor: Array) -> None:
        """Go on from a state `before` in another model, as `state`; what that changes of energies is supplied."""
        self.begin_step(before, load_factor)
        last = self._last
        self._take(model)
        self._last = self._evaluate_state(state, load_factor)
        for name, kind in self._kinds.items():
            if kind is Kind.CONSERVATIVE:
                self._jumped["stored"] += self._last.energy.get(name, 0.0) - last.energy.get(name, 0.0)
        self._jumped["kinetic"] += self._last.kinetic - last.kinetic
        self._jumped["imposed"] += self._last.imposed_kinetic - last.imposed_kinetic
        if last.fluid is not None:
            self._jumped["fluid"] += self._last.fluid.energy - last.fluid.energy

    def record(self, state: State, load_factor: Array, h: float) -> None:
        """Add the works of a step of length `h` [s] that has just been accepted."""
        before, after = self._last, self._evaluate_state(state, load_factor)
        moved = displacement(self._model, before.at, after.at)
        imposed = of_prescribed(self._model, moved)
        way = _Way(self._model, self._evaluator, before, state, moved)
        halfway = before.rest.halfway_to(after.rest)
        middle = self._evaluate_at(way.at(0.5), way.state, halfway, 0.5 * (before.load_factor + load_factor))
        for name, gradient in after.gradient.items():
            three = before.gradient[name], middle.gradient[name], gradient
            rates = [np.array([motion.work(each) for motion in (moved, imposed)]) for each in three]
            if name in BARRIERS and max(before.energy[name], after.energy[name]) > 0.0:
                works = self._work_of_barrier(name, way, rates, (moved, imposed), before, after)
            else:
                works = (rates[0] + 4.0 * rates[1] + rates[2]) / 6.0
            for sums, work in zip((self._work, self._imposed), works, strict=True):
                sums[name] += work
        for name, power in after.power.items():
            for sums, start, end in zip((self._work, self._imposed), before.power[name], power, strict=True):
                sums[name] += 0.5 * h * (start + end)
        if after.fluid is not None:
            self._imposed["fluid"] += self._work_of_fluid(before, after, imposed)
        pushed = (after.carried - before.carried) * (before.velocity + after.velocity)
        self._imposed["masses off the curve"] -= 0.5 * float(pushed[self._imposed_mass > 0.0].sum())
        resistance = before.law_force + 4.0 * middle.law_force + after.law_force
        self._stimulus -= float(resistance @ (after.rest.law - before.rest.law)) / 6.0
        self._last = after

    def budget(self) -> dict:
        """Return the rows since `begin` [J].

        Returns
        -------
        dict
            `supplied`, `stored` and `lost`, each a dictionary of rows; `work` of each force; `residual`, and
            `relative_residual` to the largest row.
        """
        first, last, work = self._first, self._last, self._work
        of_kind = {kind: [name for name, own in self._kinds.items() if own is kind] for kind in Kind}
        jumped = self._jumped
        imposed_kinetic = last.imposed_kinetic - first.imposed_kinetic - jumped["imposed"]
        prescribed = imposed_kinetic - sum(self._imposed.values())
        kinetic = last.kinetic - first.kinetic
        supplied = {"stimulus": self._stimulus, "prescribed motion": prescribed}
        supplied |= {name: work[name] for name in of_kind[Kind.EXTERNAL]}
        if any(jumped.values()):
            supplied["other values"] = jumped["stored"] + jumped["kinetic"] + jumped["fluid"]
        stored = {"kinetic": kinetic}
        if last.fluid is not None:
            stored["fluid"] = last.fluid.energy - first.fluid.energy
        now, then = last.energy, first.energy
        stored |= {name: now.get(name, 0.0) - then.get(name, 0.0) for name in of_kind[Kind.CONSERVATIVE]}
        lost = {name: -work[name] for name in of_kind[Kind.DISSIPATIVE]}
        moving = kinetic + stored.get("fluid", 0.0) - jumped["kinetic"] - jumped["fluid"]
        lost["numerical"] = sum(work.values()) + prescribed - moving
        residual = sum(supplied.values()) - sum(stored.values()) - sum(lost.values())
        largest = max(abs(value) for rows in (supplied, stored, lost) for value in rows.values())
        return {
            "supplied": supplied,
            "stored": stored,
            "lost": lost,
            "work": {name: work[name] for name, kind in self._kinds.items() if kind is not Kind.INERTIAL},
            "residual": residual,
            "relative_residual": float(residual) / float(largest) if largest > 0.0 else 0.0,
        }

    def _work_of_barrier(
        self,
        name: str,
        way: _Way,
        rates: list[Array],
        motions: tuple[EdgeVector, EdgeVector],
        before: _Instant,
        after: _Instant,
    ) -> Array:
        """Return the work [J] of a barrier over each of the motions; `rates` are those at the start, in the middle, at
        the end.
        """

        def rate(part: float) -> Array:
            _, gradient = self._force(name, way.at(part))
            return np.array([motion.work(gradient) for motion in motions])

        energy = max(before.energy[name], after.energy[name])
        return simpson(rate, (0.0, 1.0), tuple(rates), BARRIER_ERROR * energy, BARRIER_HALVINGS)

    def _work_of_fluid(self, before: _Instant, after: _Instant, imposed: EdgeVector) -> float:
        """Return the work [J] of the fluid's inertia, dP/dt − ∂T/∂q, on what prescribed bodies impose."""
        held = self._imposed_mass > 0.0
        pushed = after.fluid.momentum[held] - before.fluid.momentum[held]
        turned = 0.5 * (before.fluid.shape_gradient + after.fluid.shape_gradient)
        work = float(np.vdot(turned, imposed.edge[: self._model.rods.edge_count]))
        return work - 0.5 * float(np.vdot(pushed, before.velocity[held] + after.velocity[held]))

    def _force(self, name: str, at: Configuration) -> tuple[float, EdgeVector]:
        """Return the energy [J] and derivatives of one force at a configuration."""
        energy = self._evaluator.forces(at, (name,))[name]
        return energy, gradient_of(self._evaluator.sums, self._model)

    def _evaluate_fluid(self, at: Configuration, state: State) -> _Fluid | None:
        fluid = self._evaluator.problem.fluid
        if not fluid.exists:
            return None
        fluid.node_velocity[:], fluid.spin[:] = state.velocity, state.spin
        fluid.director_rate[:] = director_rates(self._model, state)
        relative = fluid_momentum(fluid, at)
        momentum = fluid.momentum[: self._model.node_count].copy()
        carried = float(momentum.sum(axis=0) @ fluid.velocity)
        return _Fluid(relative + carried, momentum, fluid.shape_gradient.copy())

    def _evaluate_state(self, state: State, load_factor: Array) -> _Instant:
        at = self._evaluator.new()
        self._evaluator.take_state(state, at)
        return self._evaluate_at(at, state, self._evaluator.rest_strains_of(state.transduction), load_factor)

    def _evaluate_at(self, at: Configuration, state: State, rest: RestStrains, load_factor: Array) -> _Instant:
        model, evaluator = self._model, self._evaluator
        moving = velocity(model, at, state)
        imposed = of_prescribed(model, moving)
        evaluator.stand_still(state, at, EVALUATION_TIME, rest.edge, rest.joint, load_factor)
        evaluator.start_stage(at)
        energy, gradient, power = {}, {}, {}
        for name in self._watched:
            value, found = self._force(name, at)
            if self._kinds[name] is Kind.DISSIPATIVE:
                power[name] = (moving.work(found), imposed.work(found))
            else:
                energy[name], gradient[name] = value, found
        return _Instant(
            at=at,
            kinetic=evaluator.kinetic_energy(state),
            fluid=self._evaluate_fluid(at, state),
            velocity=state.velocity.copy(),
            carried=momentum_off_curve(model, state),
            imposed_kinetic=0.5 * float(self._imposed_mass @ np.square(state.velocity).sum(axis=1)),
            rest=rest,
            load_factor=load_factor.copy(),
            friction=state.friction.copy(),
            law_force=evaluator.forces_of_laws(at),
            energy=energy,
            gradient=gradient,
            power=power,
        )


class _Way:
    """The straight way from an instant to a state: positions along lines, turns at constant rates."""

    def __init__(self, model: Model, evaluator: Evaluator, begin: _Instant, end: State, moved: EdgeVector):
        self._model, self._evaluator, self._begin, self._moved = model, evaluator, begin.at, moved
        self.state = end.copy()

    def at(self, part: float) -> Configuration:
        """Return the configuration after a part of the way; move `state` along, except for its velocities."""
        begin, moved, state, evaluator = self._begin, self._moved, self.state, self._evaluator
        state.position[:] = begin.position + part * moved.node
        state.twist[:] = begin.joint_strain[:, 2]
        state.body_position[:] = begin.pose_position[:-1] + part * moved.contact[:-1, :3]
        for b, turn in enumerate(moved.contact[:-1, 3:]):
            state.body_rotation[b] = rotation_matrix(part * turn) @ begin.rotation[b]
        at = evaluator.new()
        evaluator.take_state(state, at)
        evaluator.transport_frames(begin, part * moved.edge[: self._model.rods.edge_count, 3], at)
        return at
