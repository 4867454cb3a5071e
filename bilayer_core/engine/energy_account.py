"""The energy account of a run: what each step supplied, lost, and gained from nothing.

Over an accepted step, with the kinetic energy T and the energy V of the conservative forces,

    numerical = Δ(T + V) − supplied + lost

is what no force accounts for: negative where the integrator damps, positive where it makes energy. `lost` is the work
of friction, drag, damping and viscosity, `supplied` that of loads, of a flow and of prescribed bodies: both are
h Σ bᵢ Pᵢ with the powers Pᵢ at the ends of the stages, which the last evaluation of each has left, and the integrator's
own weights b (`Method.works`). What a stimulus supplies is ∫ s·dη, s = −∂V/∂η, by the same weights: Σ bᵢ sᵢ·Δη. (So the
implicit midpoint rule makes nothing where V is quadratic, however long its steps; with the trapezoidal rule for this
work it would seem to.) Where it jumps at the start of a step, the jump counts by itself, at the shape there.

A step is not accepted that makes energy: without driving, T + V less the work of constant loads can only fall. Where
it has risen by more than `LARGEST_GAIN` of the largest energy of the run over its lowest value so far, the step is made
again, shorter, unless its own part is less than `SMALL` of that. The shortest step is taken if it makes less than that
much by itself, which is what rounding and a loose tolerance of Newton's method leave, and less than `MOST` times as
much with those before it; otherwise a run stops.

Driving ends this. Where stimuli change, what they supply has the error of its quadrature: W = −Σ bᵢ sᵢ·Δη differs from
that by trapezoids, W̃. So what steps make is summed over a while (each step forgets `FORGOTTEN` of the sum, so that runs
of any length are judged alike), W − W̃ is summed as well, with its sign, and what the first sum has beyond the size of
the second is made by no quadrature. (Sizes of W − W̃ step by step would excuse steps that make energy, where errors of
the quadrature go to and fro.) Limits are then `LARGEST_DRIVEN_GAIN` and `SMALL_DRIVEN`. Where bodies are moved, forces
jump with their acceleration, and such errors are of one sign: there no single step may make more than
`LARGEST_STEP_GAIN` of the largest energy beyond |W − W̃|. A flow, and forces that follow, may supply without end: there
nothing is asked.

Contact is where most is lost: an impact that is over within a step or two. So the energy of barriers is looked at by
itself, with that of the limits of hinges and slides. Its change beyond the work that the motion has done on them by the
powers at the stages is an error of the step beside that of positions (`engine.integrate`), over the largest energy of
the run. It is of the same order, says what of an impact's energy a step makes or loses, and nothing where contacts
rest. (An error relative to the present gap would not see a step that crosses the barrier forth and back: its gaps are
large at both ends.) Where a barrier cannot hold an impact, no step resolves it: the shortest are taken, and counted.

The account is part of the state, so that a run that is continued makes the same steps.
"""

from __future__ import annotations

from bilayer_core.engine.kinetic import kinetic_energy
from bilayer_core.engine.laws import grow, write_strains_of_laws
from bilayer_core.engine.powers import BY_FLOW, in_barriers, write_forces_of_laws
from bilayer_core.forces.added_mass import fluid_momentum, move_fluid
from bilayer_core.forces.flattening import pull_of_change, pull_of_rest
from bilayer_core.forces.inertia import second_moment_beyond
from bilayer_core.forces.raised import inertia_off_curve
from bilayer_core.jit import kernel, piece, record_at
from bilayer_core.jit.called import stack_matrix
from bilayer_core.kinematics.copying import copy
from bilayer_core.kinematics.vector import row
from bilayer_core.model.force_list import Kind, kinds
from bilayer_core.model.force_slots import NAMES, slot_of
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.step import Configuration, Stage, StageInputs, StateArrays, Work

configuration_at = record_at(Configuration)
ENERGY, IN_BARRIERS, POWER_SUPPLIED, POWER_LOST, POWER_BARRIER, POWER_DAMPING = range(6)
FREE, LOWEST, LARGEST, NUMERICAL, GRAVITY_AT_START, OPEN, MADE, UNSURE = range(6, 14)
"""Slots of `State.account`: T + V, and the part of V in barriers [J]; powers at the end of the last step, and of what
barriers take up and contact damping takes [W]; T + V less all that was supplied, and the lowest that was since driving
ended; the largest energy of the run; what steps have made or, below zero, lost; the potential of gravity at the start
[J]; 1 if all these are of the state; what steps have made lately, and by how much two quadratures of what was supplied
differ there [J].
"""
QUESTIONED = 2.0
"""In `OPEN`: of a state that someone has changed, or that is of other conditions. Its account is kept if it may be its
own."""
NONE, SOME, MUCH = range(3)
"""What a step makes of energy: nothing that counts, too much with the steps before, or by itself."""
LARGEST_GAIN = 9e-4
SMALL = 1e-3
LARGEST_DRIVEN_GAIN = 0.02
SMALL_DRIVEN = 5e-4
LARGEST_STEP_GAIN = 0.1
MOST = 2.0
FORGOTTEN = 5e-4
ROUNDING = 1e-11
"""Part of the energies that may be rounding."""
SAME = 1e-6
"""Part of the energies by which a state's may differ from those in its account."""
CONSERVATIVE = tuple(NAMES.index(name) for name, kind in kinds().items() if kind is Kind.CONSERVATIVE)
GRAVITY, INERTIA, RESTITUTION = map(slot_of, ("gravity", "inertia", "restitution"))
DAMPING_SHARE = 0.01
"""Of the change of contact damping's power over a step, times its length: what its work may be wrong by."""


@kernel
def _kinetic(p, state, at):
    """Return the kinetic energy of nodes, edges, free bodies and the fluid [J]."""
    fluid, energy = p.fluid, kinetic_energy(p, state)
    if fluid.exists:
        move_fluid(fluid, p.raised, state.velocity, state.strain_rate)
        copy(state.spin, fluid.spin)
        energy += fluid_momentum(fluid, at)
        for i in range(state.velocity.shape[0]):
            for c in range(3):
                energy += fluid.momentum[i, c] * fluid.velocity[c]
    return energy


@kernel
def _energies(p, state, at):
    """Return T + V, that in barriers, and what the largest energy of a run is measured by, with the potential of
    gravity from its value at the start [J].
    """
    kinetic = _kinetic(p, state, at)
    potential = size = rounding = 0.0
    for k in CONSERVATIVE:
        energy = p.sums.energy[k]
        potential += energy
        rounding += abs(energy)
        size += abs(energy - state.account[GRAVITY_AT_START]) if k == GRAVITY else energy
    barriers = in_barriers(p)
    measure = kinetic + size + ROUNDING / LARGEST_GAIN * rounding + p.least_energy
    return kinetic + potential, barriers, measure


@piece(int, Problem, StateArrays, Stage, Configuration)
def open_account(p, state, stage, at):
    """Begin with a state whose potential has been evaluated at `at` in a stage, unless the account is its own."""
    account = state.account
    if account[OPEN] == 1.0:
        return READY
    energy, _, scale = _energies(p, state, at)
    if account[OPEN] == QUESTIONED and abs(account[ENERGY] - energy) <= SAME * scale:
        account[OPEN] = 1.0
        return READY
    account[:] = 0.0
    account[GRAVITY_AT_START] = p.sums.energy[GRAVITY]
    account[ENERGY], account[IN_BARRIERS], account[LARGEST] = _energies(p, state, at)
    account[OPEN] = 1.0
    write_forces_of_laws(p, at, stage, state.law_force)
    return READY


@piece(int, Problem, StateArrays, StageInputs, Work, float)
def begin_step_account(p, state, inputs, work, weight):
    """Begin with a step from a state; `weight` is that of the powers there [s]."""
    work_done = work.account
    work_done.supplied, work_done.lost = weight * state.account[POWER_SUPPLIED], weight * state.account[POWER_LOST]
    work_done.taken_up = weight * state.account[POWER_BARRIER]
    work_done.driven, work_done.jumped = 0, False
    write_strains_of_laws(p.drives, state.transduction, work.start_strain)
    _supply_by_jumps(p, state, inputs, work)
    for i in range(work.mean_force.shape[0]):
        work.mean_force[i] = weight * work.start_force[i]
    return READY


@kernel
def _supply_by_jumps(p, state, inputs, work):
    """Supply what stimuli do that jump at the start of a step, in layers that follow at once: the shape stays as it is
    while η does, so that ∫ s·dη is exactly the mean of s before and after times the jump. Go on from behind it.
    """
    drives, strands, stage, done = p.drives, p.strands, work.stage, work.account
    copy(state.law_force, work.start_force)
    jumps = False
    copy(state.transduction, work.transduction)
    for f in range(drives.field_channel.shape[0]):
        stimulus, m = inputs.first[drives.field_channel[f]], drives.field_slowest[f]
        lag = drives.mode_rising[m] if stimulus > state.transduction[m] else drives.mode_falling[m]
        if lag == 0.0 and stimulus != state.transduction[m]:
            work.transduction[m] = stimulus
            jumps = True
    if not jumps:
        return
    write_strains_of_laws(drives, work.transduction, work.strain)
    for i in range(work.start_strain.shape[0]):
        work.strain[i] -= work.start_strain[i]
    done.jumped = True
    if p.moduli.exists:
        _supply_with_moduli(p, work)
        return
    if p.flattening.exists:
        pull_of_rest(p, configuration_at(work.configurations[0]), stage)
    stage.rest_edge[:], stage.rest_joint[:] = 0.0, 0.0  # scratch until a stage begins
    for k in range(drives.driven_edge.shape[0]):
        stage.rest_edge[drives.driven_edge[k]] += drives.driven_weight[k] * work.strain[drives.driven_law[k]]
    for k in range(drives.driven_joint.shape[0]):
        j, strained = drives.driven_joint[k], work.strain[drives.driven_joint_law[k]]
        stage.rest_joint[j, drives.driven_joint_column[k]] += drives.driven_joint_weight[k] * strained
    if p.flattening.exists:
        pull_of_change(p, stage.rest_joint)
    for k in range(drives.driven_edge.shape[0]):
        e = drives.driven_edge[k]
        force = strands.axial_stiffness[e] * stage.rest_edge[e] * strands.rest_length[e]
        work.start_force[drives.driven_law[k]] -= drives.driven_weight[k] * force
    for k in range(drives.driven_joint.shape[0]):
        j, column = drives.driven_joint[k], drives.driven_joint_column[k]
        strip = p.flattening.exists and p.flattening.row[j]
        moment = p.flattening.pull[j, column] if strip else strands.joint_stiffness[j, 0] * stage.rest_joint[j, 0]
        work.start_force[drives.driven_joint_law[k]] -= drives.driven_joint_weight[k] * moment
    for i in range(work.start_strain.shape[0]):
        done.supplied -= 0.5 * (state.law_force[i] + work.start_force[i]) * work.strain[i]
        work.start_strain[i] += work.strain[i]


@kernel
def _supply_with_moduli(p, work):
    """Supply the same where moduli follow stimuli: V is a polynomial of degree 3 along the way, Simpson's rule exact
    but for tilts of bonds.
    """
    at, supplied = configuration_at(work.configurations[0]), 0.0
    for k in range(3):
        if k > 0:
            for i in range(work.start_strain.shape[0]):
                work.start_strain[i] += 0.5 * work.strain[i]
            grow(p.drives, work.start_strain, work.stage.rest_edge, work.stage.rest_joint)
            write_forces_of_laws(p, at, work.stage, work.start_force)
        for i in range(work.start_strain.shape[0]):
            supplied += (4.0 if k == 1 else 1.0) / 6.0 * work.start_force[i] * work.strain[i]
    work.account.supplied -= supplied


@kernel
def _inertial(p, stage, at):
    """Return the potential of inertia at a configuration [J]; see `forces.inertia`."""
    strands, bodies, energy = p.strands, p.bodies, 0.0
    for i in range(strands.node_mass.shape[0]):
        x, y, z = row(at.departure, i)
        energy += strands.node_mass[i] * (x * x + y * y + z * z)
    for e in range(strands.spin_inertia.shape[0]):
        energy += strands.spin_inertia[e] * (at.total_angle[e] - stage.predicted_angle[e]) ** 2
    energy += 2.0 * inertia_off_curve(p.raised, at, stage)
    s, n, a = stack_matrix(3, 3), stack_matrix(3, 3), stack_matrix(3, 3)
    for f in range(bodies.mass.shape[0]):
        turned = at.body_departure_quaternion
        second_moment_beyond(bodies.second_moment, f, stage.predicted_body_rotation, turned, s, n, a)
        for i in range(3):
            energy += bodies.mass[f] * at.body_departure[f, i] ** 2
            for j in range(3):
                energy += n[i, j] * a[j, i]
    return 0.5 * energy / (stage.length * stage.momentum_length)


@kernel
def _after_last_correction(p, stage, at):
    """Return V at the minimum, `at`, less V where it was evaluated, before Newton's last correction δ [J].

    With the gradient g there, Hδ = −g: the potential falls by −(1 − α/2) α g·δ if the part α of δ was gone, and what
    inertia does not have of that, V has, or forces of friction do.
    """
    system, sums, part, slope = p.system, p.sums, p.outcome.fraction, 0.0
    for j in range(system.step.shape[0]):
        slope += sums.gradient[j] * system.step[j]
    for f in range(p.bodies.mass.shape[0]):
        for c in range(6):
            slope += sums.body[f, c] * system.body_step[f, c]
    return (1.0 - 0.5 * part) * part * slope + sums.energy[INERTIA] - _inertial(p, stage, at)


@piece(int, Problem, StateArrays, Work, float, bool, Configuration)
def close_step_account(p, state, work, h, beyond, end):
    """Take the account of a step into that of a state, which is its end, at `end`; whether it makes too much energy."""
    account, done = state.account, work.account
    p.outcome.contact_error = 0.0
    if account[OPEN] == 0.0:
        open_account(p, state, work.stage, end)
        return NONE
    if beyond:  # otherwise `add_powers` has left those of the last stage, which ends there
        write_forces_of_laws(p, end, work.stage, work.end_force)
    grows, unsure = done.jumped, 0.0
    by_powers, power = done.supplied, account[POWER_SUPPLIED]
    for i in range(work.start_strain.shape[0]):
        strained, mean = work.strain[i] - work.start_strain[i], work.mean_force[i] / h
        grows |= strained != 0.0
        done.supplied -= mean * strained
        unsure -= (mean - 0.5 * (work.start_force[i] + work.end_force[i])) * strained
    copy(work.end_force, state.law_force)
    energy, barriers, scale = _energies(p, state, end)
    missed = abs(barriers - account[IN_BARRIERS] - done.taken_up)
    if not beyond:
        energy += _after_last_correction(p, work.stage, end)
    gain = energy - account[ENERGY] - done.supplied
    account[ENERGY], account[IN_BARRIERS] = energy, barriers
    account[POWER_SUPPLIED], account[POWER_LOST] = done.supplying, done.losing
    account[POWER_BARRIER] = done.taking_up
    account[NUMERICAL] += gain + done.lost
    account[FREE] += gain
    account[LARGEST] = max(account[LARGEST], scale)
    damping = p.sums.lost[RESTITUTION] if p.restitution.exists else 0.0
    missed += DAMPING_SHARE * h * abs(damping - account[POWER_DAMPING])
    account[POWER_DAMPING] = damping
    p.outcome.contact_error = missed
    if done.driven != 0:
        account[LOWEST], account[MADE], account[UNSURE] = account[FREE], 0.0, 0.0
        if done.driven == BY_FLOW:
            return NONE
        gain -= abs(unsure + by_powers - 0.5 * h * (power + done.supplying))
        return _too_much(p, gain, gain, LARGEST_STEP_GAIN * account[LARGEST], 0.0)
    made = (1.0 - FORGOTTEN) * account[MADE] + gain
    account[MADE] = max(made, 0.0)
    account[UNSURE] = (1.0 - FORGOTTEN) * account[UNSURE] + unsure if made > 0.0 else 0.0
    if grows:
        account[LOWEST] = account[FREE]
        made -= abs(account[UNSURE])
        return _too_much(p, made, gain, LARGEST_DRIVEN_GAIN * account[LARGEST], SMALL_DRIVEN)
    account[LOWEST] = min(account[LOWEST], account[FREE])
    return _too_much(p, account[FREE] - account[LOWEST], gain, LARGEST_GAIN * account[LARGEST], SMALL)


@kernel
def _too_much(p, made, gain, allowed, small):
    """Return NONE, SOME or MUCH for a step that gains `gain` [J], and with the steps before it `made` [J]."""
    if made <= allowed or gain <= small * allowed:
        return NONE
    p.outcome.gained = made / allowed
    return SOME if gain <= allowed and made <= MOST * allowed else MUCH
