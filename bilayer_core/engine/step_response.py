"""Derivatives of a step that was made: forward along a motion of its start, and backward from its end.

With Y the positions of nodes, the turns of edges since the start of the step and the strains that have rates, V their
rates, and an origin (Ȳ, V̄), a stage of length L (momenta: L′) ends where

    g = P ᵀ[𝓜 (Y − Ȳ − L V̄)/(L L′) + 𝓓 (Y − Ȳ)/L] + elasticity, weight, contact = 0,    V = (Y − Ȳ)/L,    P = ∂Y/∂q

with the masses 𝓜, those of raised edges among strains, and the damping 𝓓, viscosity among it. H = ∂g/∂q is that of
Newton's method, and G what it lacks. So along a motion of the origin

    (H + G) dq = −dg,    dY = P dq,    dV = (dY − dȲ)/L

and backward with the transpose of each line. All vectors have unknowns first, then strains, then the fluid's momentum
in the places of unknowns and of kept directors.
"""

from __future__ import annotations

from bilayer_core.engine.body_maps import (
    BodyMaps,
    end_bodies,
    end_bodies_back,
    guess_held,
    guess_held_back,
    predict,
    predict_back,
    push_bodies,
    push_bodies_back,
    turn_origin,
    turn_origin_back,
)
from bilayer_core.engine.linear.krylov_solution import ROUNDED, Lack, gather, solve_with_lack, spread
from bilayer_core.engine.linear.lacking_matrix import LackingMatrix, multiply, unknown_of_edge
from bilayer_core.engine.linear.newton_matrix import solve
from bilayer_core.engine.stage_maps import StageMaps
from bilayer_core.jit import kernel, piece, record
from bilayer_core.jit.record import Indices, Matrix, Stack, Vector
from bilayer_core.kinematics.vector import row
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.step import Configuration, Method, Stage


@record
class StepConstants:
    """Constants that rates of all steps of a model share."""

    free: Vector  # 1 where anything depends on unknowns, shape (size,)
    moves: Vector  # 1 where velocities depend on anything
    mass: Vector  # diagonal of the masses, shape (n_whole,)
    coupling: LackingMatrix  # of nodes and directors of raised edges
    damped: Vector  # damping of masses, shape (n_whole,)
    drag: Vector  # and what else resists, strains by viscosity
    strips: LackingMatrix  # and what couples strains of strips
    channel: Indices  # of modes, shape (n_mode,)
    followed: Matrix  # what laws follow of modes, shape (n_law, n_mode)


@record
class StrainMap:
    """Derivatives of strains by motions of all nodes and turns."""

    viscous: LackingMatrix
    directors: Stack  # of raised edges, by their unknowns, shape (n_raised, 3, 7)


@record
class FluidMap:
    """Derivatives of the fluid's momentum."""

    by_place: LackingMatrix
    by_speed: LackingMatrix  # of unknowns and strains


@record
class ElasticMaps:
    """Other derivatives of a stage: of strains, of what resists them, of eigenstrains and of the fluid's momentum."""

    strains: StrainMap
    fluid: FluidMap
    resistance: Vector  # of motions of joints and guides, shape (n_strain,)
    by_law: LackingMatrix  # of the gradient by eigenstrains
    law_slope: Vector  # of eigenstrains by what laws follow, with gains
    law_by_gain: Vector
    by_reached: LackingMatrix  # of what modes reach, by what others had reached
    by_place: LackingMatrix  # and by places at the start of the step
    by_kept: LackingMatrix  # and by what was kept
    lag: Matrix  # of what modes reach, by that at the start, by the first stimulus and that of the stage (3, n_mode)


@record
class StateRates:
    """Derivatives of a state, or by a state."""

    place: Vector  # of unknowns, turns of edges beyond transport among them, shape (size,)
    speed: Vector  # of velocities, spins and angular momenta
    strain_rate: Vector
    reached: Vector  # what modes have reached of stimuli
    push: Vector  # rates of velocities that a history keeps
    strain_push: Vector  # of rates of strains, and of the fluid's momentum
    kept: Vector  # speeds of approach, rates of what elements see of light, `State.fluid_excess` in places of `wet`


@record
class InputRates:
    """Derivatives of what acts in a step, or by it."""

    first: Vector  # of stimuli at the start, shape (n_channel,)
    stimulus: Matrix  # at the stages, shape (n_stage, n_channel)
    gain: Vector  # of gains of laws
    direct: Matrix  # of gradients where stages ended, shape (n_stage, size)


@record
class StepWork:
    """Scratch: rows of stages, or vectors."""

    end: Matrix  # shape (n_stage, n_whole)
    end_speed: Matrix
    origin: Matrix
    origin_speed: Matrix
    place: Matrix  # of unknowns where stages ended, shape (n_stage, size)
    first: Vector  # at the start of the step, shape (n_whole,)
    speed: Vector
    push: Vector
    change: Vector
    mass: Vector
    right: Vector  # shape (size,)
    moved: Vector
    guess: Vector
    before: Vector  # turns of edges where a stage began, beyond those of frames, shape (n_edge,)
    reached: Vector
    strain: Vector  # of laws


@kernel
def _add_strains(p, map_, of, out, first):
    """Add the strains that motions make."""
    raised = p.raised
    for k in range(map_.viscous.count[0]):
        out[first + map_.viscous.row[k]] += map_.viscous.value[k] * of[map_.viscous.column[k]]
    for r in range(raised.edge.shape[0]):
        for n in range(7):
            moved = of[unknown_of_edge(p.strands, raised.edge[r], n)]
            for c in range(3):
                out[first + raised.first + 3 * raised.slot[r] + c] += map_.directors[r, c, n] * moved


@kernel
def _add_strains_back(p, map_, of, first, out):
    """Add the transpose."""
    raised = p.raised
    for k in range(map_.viscous.count[0]):
        out[map_.viscous.column[k]] += map_.viscous.value[k] * of[first + map_.viscous.row[k]]
    for r in range(raised.edge.shape[0]):
        for n in range(7):
            total = 0.0
            for c in range(3):
                total += map_.directors[r, c, n] * of[first + raised.first + 3 * raised.slot[r] + c]
            out[unknown_of_edge(p.strands, raised.edge[r], n)] += total


@kernel
def _write_masses(c, of, out):
    """Write 𝓜 times a vector."""
    for j in range(of.shape[0]):
        out[j] = c.mass[j] * of[j]
    multiply(c.coupling, of, False, out)


@kernel
def _add_dissipation(c, of, masses, factor, out):
    """Add factor × 𝓓 times a vector, from 𝓜 times it."""
    for j in range(of.shape[0]):
        out[j] += factor * (c.damped[j] * masses[j] + c.drag[j] * of[j])
    for k in range(c.strips.count[0]):
        out[c.strips.row[k]] += factor * c.strips.value[k] * of[c.strips.column[k]]


@kernel
def _along(strands, way, e, of):
    """Return what motions turn an edge by."""
    total = 0.0
    for n in range(6):
        part = way[e, n % 3] * of[unknown_of_edge(strands, e, n)]
        total += part if n >= 3 else -part
    return total


@kernel
def _along_back(strands, way, e, turn, out):
    """Add the transpose."""
    for n in range(6):
        part = way[e, n % 3] * turn
        out[unknown_of_edge(strands, e, n)] += part if n >= 3 else -part


@kernel
def _solve(p, at, lack, lacks, back, right, out):
    """Write minus the inverse of the Hessian and what it lacks times a vector."""
    sums, system, rods = p.sums, p.system, p.sums.gradient.shape[0]
    for j in range(rods):
        sums.gradient[j] = right[j]
    for j in range(rods, right.shape[0]):
        sums.body[(j - rods) // 6, (j - rods) % 6] = right[j]
    sign = 1.0
    if lacks:
        solve_with_lack(p, at, lack, ROUNDED, back)
        sign = -1.0
    else:
        solve(p)
    for j in range(rods):
        out[j] = sign * system.step[j]
    for j in range(rods, right.shape[0]):
        out[j] = sign * system.body_step[(j - rods) // 6, (j - rods) % 6]


@kernel
def _forgotten(p, method, j, strains):
    """Return whether a method without a history forgets the rate of a strain, or of the fluid's momentum."""
    kept = method.history or j >= strains
    return not kept and not (p.raised.exists and j >= p.raised.first)


@kernel
def _add_reached(elastic, start, out):
    """Add what modes reach by other modes, by places and by what was kept."""
    multiply(elastic.by_reached, start.reached, False, out)
    multiply(elastic.by_place, start.place, False, out)
    multiply(elastic.by_kept, start.kept, False, out)


@kernel
def _add_reached_back(elastic, of, start):
    """Add the transpose."""
    multiply(elastic.by_reached, of, True, start.reached)
    multiply(elastic.by_place, of, True, start.place)
    multiply(elastic.by_kept, of, True, start.kept)


@kernel
def _wet_place(p, size, j):
    """Return where the fluid's momentum j acts, among unknowns and strains."""
    return j if j < size else j + p.raised.first


@piece(int, Problem, Method, StepConstants, StrainMap, FluidMap, StateRates, StepWork, bool)
def begin_forward(p, method, c, strains, fluid, start, w, excess):
    """Take the motion of the start of a step; `excess` tells whether the fluid's momentum has its own in `kept`."""
    size, count, whole = start.place.shape[0], start.strain_rate.shape[0], w.first.shape[0]
    w.first[:] = 0.0
    w.speed[:] = 0.0
    w.push[:] = 0.0
    for j in range(size):
        w.first[j], w.speed[j], w.push[j] = c.free[j] * start.place[j], c.moves[j] * start.speed[j], start.push[j]
    _add_strains(p, strains, start.place, w.first, size)
    for e in range(p.strands.edge_unknown.shape[0]):
        w.first[p.strands.edge_unknown[e]] = 0.0
    for j in range(count):
        w.speed[size + j] = start.strain_rate[j]
    for j in range(whole - size):
        w.push[size + j] = start.strain_push[j]
    if whole > size + count:
        wet = w.speed[size + count :]
        multiply(fluid.by_place, start.place, False, wet)
        multiply(fluid.by_speed, w.speed, False, wet)
        for j in range(wet.shape[0] if excess else 0):
            wet[j] += start.kept[start.kept.shape[0] - wet.shape[0] + j]
    return READY


@piece(
    int, Problem, Configuration, Stage, Method, Lack, bool, StepConstants, StageMaps, ElasticMaps, BodyMaps,
    StateRates, InputRates, StepWork, int, float,
)  # fmt: skip
def go_forward(p, at, stage, method, lack, lacks, c, maps, elastic, bodies, start, acts, w, n, h):
    """Go from the start of a step of length h, and the ends of earlier stages, to the end of stage n."""
    strands, length, momentum_length = p.strands, stage.length, stage.momentum_length
    size, strains, whole = start.place.shape[0], start.strain_rate.shape[0], w.first.shape[0]
    edges, in_space = strands.edge_unknown.shape[0], p.space.exists
    origin, origin_speed, end, end_speed = w.origin[n], w.origin_speed[n], w.end[n], w.end_speed[n]
    change, right, moved, before = w.change, w.right, w.moved, w.before
    for j in range(whole):
        origin[j], origin_speed[j] = w.first[j], w.speed[j]
        if method.history:
            origin[j] += method.along[n] * h * w.speed[j] + method.bend * h * h * w.push[j]
            origin_speed[j] += method.momenta[n] * h * w.push[j]
        for i in range(n):
            origin[j] += method.couplings[n, i] * (w.end[i, j] - w.origin[i, j])
            origin_speed[j] += method.couplings[n, i] * (w.end_speed[i, j] - w.origin_speed[i, j])
    turn_origin(p, bodies, method, n, w.first, w.speed, w.push, w.end, w.origin, origin)
    predict(p, bodies, origin, origin_speed)
    for m in range(c.channel.shape[0]):
        k = c.channel[m]
        w.reached[m] = elastic.lag[0, m] * start.reached[m]
        w.reached[m] += elastic.lag[1, m] * acts.first[k] + elastic.lag[2, m] * acts.stimulus[n, k]
    _add_reached(elastic, start, w.reached)
    for j in range(whole):
        w.guess[j] = origin[j] + length * origin_speed[j]
    _write_masses(c, w.guess, change)
    _write_masses(c, origin, w.mass)
    for j in range(whole):
        change[j] = -change[j] / (length * momentum_length)
    _add_dissipation(c, origin, w.mass, -1.0 / length, change)
    for j in range(strains):
        change[size + j] -= elastic.resistance[j] * origin[size + j] / length
    for j in range(whole - size - strains):
        change[_wet_place(p, size, j)] -= origin_speed[size + strains + j] / momentum_length
    for j in range(size):
        right[j] = change[j]
    _add_strains_back(p, elastic.strains, change, size, right)
    before[:] = 0.0
    if in_space:
        for j in range(size):
            w.guess[j] *= c.free[j]
        guess_held(p, bodies, length, origin, origin_speed, w.guess)
        for e in range(edges):
            k = strands.edge_unknown[e]
            if n == 0:
                before[e] = -start.place[k] + _along(strands, maps.way[0], e, start.place)
            else:
                before[e] = w.end[n - 1, k] - w.place[n - 1, k] + _along(strands, maps.way[0], e, w.place[n - 1])
            before[e] += _along(strands, maps.way[1], e, w.guess)
            right[k] += maps.by_turn[e] * before[e]
    for e in range(edges):  # turns beyond those at the origin
        origin[strands.edge_unknown[e]] -= before[e]
    multiply(maps.by_origin, origin, False, right)
    for e in range(edges):
        origin[strands.edge_unknown[e]] += before[e]
    for r in range(maps.by_director.shape[0]):
        first = size + p.raised.first + 3 * p.raised.slot[r]
        for k in range(7):
            for d in range(3):
                right[unknown_of_edge(strands, p.raised.edge[r], k)] += maps.by_director[r, k, d] * origin[first + d]
    multiply(maps.by_strain, origin[size:], False, right)
    multiply(maps.by_kept, start.kept, False, right)
    for k in range(maps.slides.count[0]):
        j = maps.slides.column[k]
        right[maps.slides.row[k]] += maps.slides.value[k] * bodies.motion[j // 6, j % 6]
    gather(p, at, right)
    push_bodies(p, bodies, -1.0 / (length * momentum_length), right)
    for i in range(w.strain.shape[0]):
        w.strain[i] = elastic.law_by_gain[i] * acts.gain[i]
        for m in range(c.channel.shape[0]):
            w.strain[i] += elastic.law_slope[i] * c.followed[i, m] * w.reached[m]
    multiply(elastic.by_law, w.strain, False, right)
    for j in range(size):
        right[j] = c.free[j] * (right[j] + acts.direct[n, j])
    _solve(p, at, lack, lacks, False, right, moved)
    spread(p, at, moved)
    end[:] = 0.0
    for j in range(size):
        end[j] = w.place[n, j] = moved[j]
    _add_strains(p, elastic.strains, moved, end, size)
    if in_space:
        for e in range(edges):
            end[strands.edge_unknown[e]] += before[e] + _along(strands, maps.way[2], e, moved)
    for j in range(whole):
        end_speed[j] = (end[j] - origin[j]) / length
    end_bodies(p, bodies, length, end, origin_speed, end_speed)
    if whole > size + strains:
        wet = end_speed[size + strains :]
        wet[:] = 0.0
        multiply(elastic.fluid.by_place, moved, False, wet)
        multiply(elastic.fluid.by_speed, end_speed, False, wet)
    return READY


@piece(int, Problem, Stage, Method, StateRates, StepWork, int)
def end_forward(p, stage, method, end, w, n):
    """Write the motion of the end of a step from that of its last stage, n."""
    size, strains = end.place.shape[0], end.strain_rate.shape[0]
    for j in range(w.first.shape[0]):
        push = (w.end_speed[n, j] - w.origin_speed[n, j]) / stage.momentum_length
        push = (push - method.carry * w.push[j]) / (1.0 - method.carry)
        if j < size:
            end.place[j], end.speed[j], end.push[j] = w.place[n, j], w.end_speed[n, j], push
        else:
            end.strain_push[j - size] = 0.0 if _forgotten(p, method, j - size, strains) else push
            if j < size + strains:
                end.strain_rate[j - size] = w.end_speed[n, j]
    for m in range(end.reached.shape[0]):
        end.reached[m] = w.reached[m]
    return READY


@piece(int, Problem, Configuration, Method, StepConstants, StageMaps, ElasticMaps, BodyMaps, StateRates, StateRates,
       InputRates, StepWork, int)  # fmt: skip
def end_forward_beyond(p, at, method, c, maps, elastic, bodies, start, end, acts, w, n):
    """Write the motion of the end of a step beyond its last stage, its point n, at a configuration, and in place of
    what the fluid has in `kept` its momentum.
    """
    strands, size, strains = p.strands, end.place.shape[0], end.strain_rate.shape[0]
    place, speed, last = w.change, w.mass, n - 1
    for j in range(w.first.shape[0]):
        place[j], speed[j] = w.first[j], w.speed[j]
        for i in range(n):
            place[j] += method.couplings[n, i] * (w.end[i, j] - w.origin[i, j])
            speed[j] += method.couplings[n, i] * (w.end_speed[i, j] - w.origin_speed[i, j])
    turn_origin(p, bodies, method, n, w.first, w.speed, w.push, w.end, w.origin, place)
    spread(p, at, place)
    for e in range(strands.edge_unknown.shape[0] if p.space.exists else 0):
        k = strands.edge_unknown[e]
        place[k] -= w.end[last, k] - w.place[last, k] + _along(strands, maps.way[0], e, w.place[last])
        place[k] -= _along(strands, maps.way[1], e, place)
    for j in range(size):
        end.place[j], end.speed[j], end.push[j] = place[j], speed[j], 0.0
    for j in range(strains):
        end.strain_rate[j] = speed[size + j]
    for j in range(w.first.shape[0] - size - strains):
        end.kept[end.kept.shape[0] + size + strains - w.first.shape[0] + j] = speed[size + strains + j]
    end.strain_push[:] = 0.0
    for m in range(c.channel.shape[0]):
        k = c.channel[m]
        end.reached[m] = elastic.lag[0, m] * start.reached[m]
        end.reached[m] += elastic.lag[1, m] * acts.first[k] + elastic.lag[2, m] * acts.stimulus[n, k]
    _add_reached(elastic, start, end.reached)
    return READY


@kernel
def _begin_backward(start, acts, w):
    """Clear what derivatives are added to."""
    for part in (w.first, w.speed, w.push, start.place, start.speed, start.strain_rate, start.reached, start.kept):
        part[:] = 0.0
    for part in (w.end, w.end_speed, w.origin, w.origin_speed, w.place):
        part[:] = 0.0
    acts.first[:] = 0.0
    acts.gain[:] = 0.0
    acts.stimulus[:] = 0.0


@piece(int, Problem, Configuration, Method, StepConstants, StageMaps, ElasticMaps, BodyMaps, StateRates, StateRates,
       InputRates, StepWork, int)  # fmt: skip
def begin_backward_beyond(p, at, method, c, maps, elastic, bodies, end, start, acts, w, n):
    """Take the derivatives by the end of a step beyond its last stage, its point n, at a configuration."""
    strands, size, strains = p.strands, end.place.shape[0], end.strain_rate.shape[0]
    place, speed, last = w.change, w.mass, n - 1
    _begin_backward(start, acts, w)
    place[:] = 0.0
    speed[:] = 0.0
    for j in range(size):
        place[j], speed[j] = end.place[j], end.speed[j]
    for j in range(strains):
        speed[size + j] = end.strain_rate[j]
    for j in range(w.first.shape[0] - size - strains):
        speed[size + strains + j] = end.kept[end.kept.shape[0] + size + strains - w.first.shape[0] + j]
    for e in range(strands.edge_unknown.shape[0] if p.space.exists else 0):
        k = strands.edge_unknown[e]
        w.before[e] = place[k]
        _along_back(strands, maps.way[0], e, -place[k], w.place[last])
        w.place[last, k] += place[k]
        w.end[last, k] -= place[k]
    for e in range(strands.edge_unknown.shape[0] if p.space.exists else 0):
        _along_back(strands, maps.way[1], e, -w.before[e], place)
    gather(p, at, place)
    turn_origin_back(p, bodies, method, n, w.first, w.speed, w.push, w.end, w.origin, place)
    _to_stages_before(method, w, n, place, speed)
    for m in range(c.channel.shape[0]):
        k = c.channel[m]
        start.reached[m] += elastic.lag[0, m] * end.reached[m]
        acts.first[k] += elastic.lag[1, m] * end.reached[m]
        acts.stimulus[n, k] += elastic.lag[2, m] * end.reached[m]
    _add_reached_back(elastic, end.reached, start)
    return READY


@piece(int, Problem, Stage, Method, StateRates, StateRates, InputRates, StepWork, int)
def begin_backward(p, stage, method, end, start, acts, w, n):
    """Take the derivatives by the end of a step, whose last stage is n."""
    size, strains = end.place.shape[0], end.strain_rate.shape[0]
    _begin_backward(start, acts, w)
    for j in range(w.first.shape[0]):
        push = end.push[j] if j < size else end.strain_push[j - size]
        push /= 1.0 - method.carry
        if j >= size and _forgotten(p, method, j - size, strains):
            push = 0.0
        w.push[j] = -method.carry * push
        w.end_speed[n, j] = push / stage.momentum_length
        w.origin_speed[n, j] = -push / stage.momentum_length
        if j < size:
            w.place[n, j] = end.place[j]
            w.end_speed[n, j] += end.speed[j]
        elif j < size + strains:
            w.end_speed[n, j] += end.strain_rate[j - size]
    return READY


@piece(
    int, Problem, Configuration, Stage, Method, Lack, bool, StepConstants, StageMaps, ElasticMaps, BodyMaps,
    StateRates, StateRates, InputRates, StepWork, int, float,
)  # fmt: skip
def go_backward(p, at, stage, method, lack, lacks, c, maps, elastic, bodies, end_, start, acts, w, n, h):
    """Go from the end of stage n of a step of length h to its start, and to the ends of earlier stages."""
    strands, length, momentum_length = p.strands, stage.length, stage.momentum_length
    size, strains, whole = start.place.shape[0], start.strain_rate.shape[0], w.first.shape[0]
    edges, in_space = strands.edge_unknown.shape[0], p.space.exists
    origin, origin_speed, end, end_speed = w.origin[n], w.origin_speed[n], w.end[n], w.end_speed[n]
    change, moved, before, right = w.change, w.moved, w.before, acts.direct[n]
    if whole > size + strains:
        wet = w.mass[: whole - size - strains]
        for j in range(wet.shape[0]):
            wet[j] = end_speed[size + strains + j]
            end_speed[size + strains + j] = 0.0
        multiply(elastic.fluid.by_speed, wet, True, end_speed)
        multiply(elastic.fluid.by_place, wet, True, w.place[n])
    end_bodies_back(p, bodies, length, end, origin_speed, end_speed)
    for j in range(whole):
        end[j] += end_speed[j] / length
        origin[j] -= end_speed[j] / length
    for j in range(size):
        moved[j] = w.place[n, j] + end[j]
    _add_strains_back(p, elastic.strains, end, size, moved)
    before[:] = 0.0
    if in_space:
        for e in range(edges):
            before[e] = end[strands.edge_unknown[e]]
            _along_back(strands, maps.way[2], e, before[e], moved)
    gather(p, at, moved)
    _solve(p, at, lack, lacks, True, moved, right)
    for j in range(size):
        moved[j] = right[j]
    spread(p, at, moved)
    change[:] = 0.0
    for j in range(size):
        change[j] = moved[j]
    _add_strains(p, elastic.strains, moved, change, size)
    for j in range(whole - size - strains):
        origin_speed[size + strains + j] -= change[_wet_place(p, size, j)] / momentum_length
    push_bodies_back(p, bodies, -1.0 / (length * momentum_length), right)
    for k in range(maps.slides.count[0]):
        j = maps.slides.column[k]
        bodies.motion[j // 6, j % 6] += maps.slides.value[k] * moved[maps.slides.row[k]]
    _write_masses(c, change, w.mass)
    _add_dissipation(c, change, w.mass, -1.0 / length, origin)
    for j in range(whole):
        of_mass = w.mass[j] / (length * momentum_length)
        origin[j] -= of_mass
        origin_speed[j] -= length * of_mass
    for j in range(strains):
        origin[size + j] -= elastic.resistance[j] * change[size + j] / length
    last = n + 1 == method.couplings.shape[0]
    for m in range(c.channel.shape[0]):
        w.reached[m] = end_.reached[m] if last else 0.0
    w.strain[:] = 0.0
    multiply(elastic.by_law, right, True, w.strain)
    for i in range(w.strain.shape[0]):
        acts.gain[i] += elastic.law_by_gain[i] * w.strain[i]
        for m in range(c.channel.shape[0]):
            w.reached[m] += elastic.law_slope[i] * c.followed[i, m] * w.strain[i]
    for m in range(c.channel.shape[0]):
        k = c.channel[m]
        start.reached[m] += elastic.lag[0, m] * w.reached[m]
        acts.first[k] += elastic.lag[1, m] * w.reached[m]
        acts.stimulus[n, k] += elastic.lag[2, m] * w.reached[m]
    _add_reached_back(elastic, w.reached, start)
    multiply(maps.by_strain, moved, True, origin[size:])
    multiply(maps.by_kept, moved, True, start.kept)
    pulled = w.guess
    for j in range(size):
        pulled[j] = 0.0
    multiply(maps.by_origin, moved, True, pulled)
    for j in range(size):
        origin[j] += pulled[j]
    for r in range(maps.by_director.shape[0]):
        first = size + p.raised.first + 3 * p.raised.slot[r]
        for k in range(7):
            for d in range(3):
                origin[first + d] += maps.by_director[r, k, d] * moved[unknown_of_edge(strands, p.raised.edge[r], k)]
    if in_space:
        for e in range(edges):
            k = strands.edge_unknown[e]
            before[e] += maps.by_turn[e] * moved[k] - pulled[k]
        _turns_back(p, c, maps, bodies, length, before, start, w, n)
    predict_back(p, bodies, origin, origin_speed)
    turn_origin_back(p, bodies, method, n, w.first, w.speed, w.push, w.end, w.origin, origin)
    for j in range(whole if method.history else 0):
        w.speed[j] += method.along[n] * h * origin[j]
        w.push[j] += method.bend * h * h * origin[j] + method.momenta[n] * h * origin_speed[j]
    _to_stages_before(method, w, n, origin, origin_speed)
    return READY


@kernel
def _to_stages_before(method, w, n, place, speed):
    """Give derivatives by the origin of stage n, or by the end of the step, to the start and the stages before."""
    for j in range(w.first.shape[0]):
        w.first[j] += place[j]
        w.speed[j] += speed[j]
        for i in range(n):
            coupling = method.couplings[n, i]
            w.end[i, j] += coupling * place[j]
            w.origin[i, j] -= coupling * place[j]
            w.end_speed[i, j] += coupling * speed[j]
            w.origin_speed[i, j] -= coupling * speed[j]


@kernel
def _turns_back(p, c, maps, bodies, length, before, start, w, n):
    """Take derivatives by turns of edges where stage n began, beyond those of frames."""
    strands, guess, origin, origin_speed = p.strands, w.guess, w.origin[n], w.origin_speed[n]
    size = start.place.shape[0]
    for j in range(size):
        guess[j] = 0.0
    for e in range(before.shape[0]):
        _along_back(strands, maps.way[1], e, before[e], guess)
    guess_held_back(p, bodies, length, guess, origin, origin_speed)
    for j in range(size):
        origin[j] += c.free[j] * guess[j]
        origin_speed[j] += length * c.free[j] * guess[j]
    for e in range(before.shape[0]):
        k = strands.edge_unknown[e]
        if n > 0:
            _along_back(strands, maps.way[0], e, before[e], w.place[n - 1])
            w.place[n - 1, k] -= before[e]
            w.end[n - 1, k] += before[e]
        else:
            _along_back(strands, maps.way[0], e, before[e], start.place)
            start.place[k] -= before[e]


@piece(int, Problem, StepConstants, StrainMap, FluidMap, StateRates, StepWork, bool)
def end_backward(p, c, strains, fluid, start, w, excess):
    """Write the derivatives by the start of a step."""
    size, count, whole = start.place.shape[0], start.strain_rate.shape[0], w.first.shape[0]
    for e in range(p.strands.edge_unknown.shape[0]):
        w.first[p.strands.edge_unknown[e]] = 0.0
    for j in range(size):
        start.place[j] += c.free[j] * w.first[j]
    _add_strains_back(p, strains, w.first, size, start.place)
    if whole > size + count:
        wet = w.speed[size + count :]
        multiply(fluid.by_place, wet, True, start.place)
        multiply(fluid.by_speed, wet, True, w.speed)
        for j in range(wet.shape[0] if excess else 0):
            start.kept[start.kept.shape[0] - wet.shape[0] + j] += wet[j]
    for j in range(size):
        start.speed[j], start.push[j] = c.moves[j] * w.speed[j], w.push[j]
    for j in range(whole - size):
        start.strain_push[j] = w.push[size + j]
        if j < count:
            start.strain_rate[j] = w.speed[size + j]
    return READY


@piece(int, Problem, Configuration, StrainMap)
def write_directors(p, at, strains):
    """Write by what directors of raised edges move."""
    raised = p.raised
    for r in range(raised.edge.shape[0]):
        k = raised.edge[r]
        t, m1 = row(at.tangent, k), row(at.director1, k)
        for c in range(3):
            for n in range(3):
                part = t[c] * m1[n] / at.length[k]
                strains.directors[r, c, n], strains.directors[r, c, 3 + n] = part, -part
            strains.directors[r, c, 6] = at.director2[k, c] if p.space.exists else 0.0
    return READY
