"""Derivatives of a step that was made: forward along motions of its start, and backward from its end.

With Y the positions of nodes, the turns of edges since the start of the step and the strains that have rates, V their
rates, and an origin (Ȳ, V̄), a stage of length L (momenta: L′) ends where

    g = P ᵀ[𝓜 (Y − Ȳ − L V̄)/(L L′) + 𝓓 (Y − Ȳ)/L] + elasticity, weight, contact = 0,    V = (Y − Ȳ)/L,    P = ∂Y/∂q

with the masses 𝓜, those of raised edges among strains, and the damping 𝓓, viscosity among it. H = ∂g/∂q is that of
Newton's method, and G what it lacks by the gyroscopic force. So along a motion of the origin

    (H + G) dq = −dg,    dY = P dq,    dV = (dY − dȲ)/L

and backward with the transpose of each line. ∂g/∂η of eigenstrains and ∂σ/∂q of viscous strains are read off the
gradient itself, which is linear in η and in the strains of the origin: one evaluation for as many of them as no
unknown sees together.

A frame turns by dω about its tangent beyond what parallel transport does. The turn a of an edge since the start of the
step is counted along the way start → first guess → end, whose transport depends on where tangents are:

    da = da₀ + dω − dω₀ + Σ ½ κb·(dt₁ + dt₂),    κb = 2 t₁ × t₂/(1 + t₁·t₂) of each part of the way
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy import sparse
from scipy.sparse import linalg

from bilayer_core.engine.steps_again import Differences
from bilayer_core.forces.body_drag import body_flow_of
from bilayer_core.forces.friction_change import FrozenChange
from bilayer_core.model.model import Model
from bilayer_core.model.records.step import Configuration
from bilayer_core.scene.transduction import lagged
from bilayer_core.simulation.gradients.body_rates import BodyRates, drag_by_origin
from bilayer_core.simulation.gradients.entries import Entries
from bilayer_core.simulation.gradients.followed import FOLLOWING, Followed
from bilayer_core.simulation.gradients.mechanism_rates import resistances, slopes_of_motions
from bilayer_core.simulation.gradients.step_again import KeptStep, Lacking, Reached, StepAgain

Array = np.ndarray
STRAIN = 1e-3
"""Change of eigenstrains and of strains by which derivatives are read off."""


@dataclass
class Rates:
    """Derivatives of a state, or by a state, in columns.

    Attributes
    ----------
    place : ndarray
        Of unknowns, turns of edges beyond transport among them, shape (size, n).
    speed : ndarray
        Of velocities of nodes and spins, likewise.
    strain_rate : ndarray
        Shape (n_strain, n).
    reached : ndarray
        What modes have reached of stimuli, shape (n_mode, n).
    push, strain_push : ndarray
        Rates of velocities, and of rates of strains and of the fluid's momentum, that a history keeps, likewise.
    """

    place: Array
    speed: Array
    strain_rate: Array
    reached: Array
    push: Array
    strain_push: Array

    @classmethod
    def zeros(cls, again: StepAgain, columns: int) -> Rates:
        """Return rates of a model without any."""
        strains, modes = again.stage.origin_strain.size, again.transduction.size
        sizes = again.size, again.size, strains, modes, again.size, strains + again.wet
        return cls(*(np.zeros((size, columns)) for size in sizes))


@dataclass
class Inputs:
    """Derivatives of what acts in a step, or by it, in columns.

    Attributes
    ----------
    first : ndarray
        Of stimuli at the start, shape (n_channel, n).
    stimulus : ndarray
        At the stages, shape (n_stage, n_channel, n).
    gain : ndarray
        Of gains of laws, shape (n_law, n).
    """

    first: Array
    stimulus: Array
    gain: Array

    @classmethod
    def zeros(cls, again: StepAgain, stages: int, columns: int) -> Inputs:
        """Return inputs that do not change."""
        channels, laws = again.inputs.first.size, again.laws.size
        return cls(np.zeros((channels, columns)), np.zeros((stages, channels, columns)), np.zeros((laws, columns)))


def _triple(of: Array) -> Array:
    """Return the matrices [v]× of vectors, shape (n, 3, 3)."""
    out = np.zeros((len(of), 3, 3))
    out[:, 0, 1], out[:, 0, 2], out[:, 1, 2] = -of[:, 2], of[:, 1], -of[:, 0]
    return out - out.swapaxes(1, 2)


class Constants:
    """Matrices that rates of all steps of a model share, and which strains are apart from each other."""

    def __init__(self, model: Model, again: StepAgain):
        problem, strands = again.problem, again.problem.strands
        self.size, self.strains = again.size, again.stage.origin_strain.size
        edges = strands.edge_count
        self.in_space = problem.space.exists
        self.nodes = again.of_nodes
        ends = strands.edge_node[:, None] + np.array([0, 1])
        unknowns = self.nodes[ends]  # (edge, end, 3)
        rows = np.arange(3 * edges).reshape(edges, 1, 3).repeat(2, axis=1)
        signs = np.broadcast_to(np.array([-1.0, 1.0])[None, :, None], rows.shape)
        shape = (3 * edges, self.size)
        self.vectors = sparse.csr_matrix((signs.ravel(), (rows.ravel(), unknowns.ravel())), shape=shape)
        self.turns = sparse.csr_matrix(
            (np.ones(edges), (np.arange(edges), strands.edge_unknown)), shape=(edges, self.size)
        )
        self.spin_inertia = strands.spin_inertia if self.in_space else 0.0 * strands.spin_inertia
        self.damping = problem.damping
        self.masses = self._masses(again)
        self.viscous = self._viscous(again)
        resisted = sparse.diags(self.viscous) + self._coupling(again)
        others = (sparse.csr_matrix((of, of)) for of in (self.size, again.wet))
        drag = sparse.block_diag([next(others), resisted, next(others)])
        self.apart = self._inverse(resisted.tocsc())
        damped = np.ones(self.masses.shape[0])
        damped[again.of_bodies] = 0.0
        self.dissipation = (self.damping * sparse.diags(damped) @ self.masses + drag).tocsr()
        self.turn_inertia = self.spin_inertia
        if problem.fluid.exists and self.in_space:
            self.turn_inertia = self.spin_inertia + problem.fluid.mass[:, 2]
            of_fluid = np.zeros(self.masses.shape[0])
            of_fluid[strands.edge_unknown] = problem.fluid.mass[:, 2]
            self.masses = (self.masses + sparse.diags(of_fluid)).tocsr()
        self.of_strains = slice(self.size, self.size + self.strains)
        self.of_fluid = slice(self.size + self.strains, self.size + self.strains + again.wet)
        free = np.ones(self.size)
        free[(problem.constrained.unknown[:, None] + np.arange(3)).ravel()] = 0.0
        self.free, self.freed = sparse.diags(free), free
        moves = np.ones(self.size)  # where velocities depend on anything
        prescribed = problem.constrained.free < 0
        moves[(problem.constrained.unknown[prescribed, None] + np.arange(3)).ravel()] = 0.0
        self.moves = sparse.diags(moves)
        self.groups = self._groups(again)
        drives = problem.drives
        rows = np.repeat(np.arange(len(drives.law_gain)), np.diff(drives.law_first))
        within = np.arange(len(rows)) - drives.law_first[rows]
        columns = drives.field_first[drives.law_field[rows]] + within
        shape = (len(drives.law_gain), again.transduction.size)
        self.followed = sparse.csr_matrix((drives.law_weight[: len(rows)], (rows, columns)), shape=shape).toarray()
        counts = np.diff(drives.field_first)
        self.channel = np.repeat(drives.field_channel, counts)
        self.raised_rows = problem.raised.first + 3 * problem.raised.slot[:, None] + np.arange(3)

    def _masses(self, again: StepAgain) -> sparse.csr_matrix:
        strands, raised, problem_bodies = again.problem.strands, again.problem.raised, again.problem.bodies
        whole = sparse.lil_matrix((self.size + self.strains + again.wet,) * 2)
        diagonal = np.zeros(self.size + self.strains + again.wet)
        diagonal[self.nodes] = strands.node_mass[:, None]
        diagonal[strands.edge_unknown] = self.spin_inertia
        diagonal[again.of_bodies[:, :3]] = problem_bodies.mass[:, None]
        whole.setdiag(diagonal)
        for r, k in enumerate(raised.edge):
            i = strands.edge_node[k]
            for c in range(3):
                own = self.size + raised.first + 3 * raised.slot[r] + c
                for end in range(2):
                    node = self.nodes[i + end, c]
                    whole[node, own] = whole[own, node] = raised.first_moment[r, end]
                whole[own, own] = raised.second_moment[r]
        return whole.tocsr()

    def _viscous(self, again: StepAgain) -> Array:
        """Return the stiffness of each strain times its retardation time."""
        problem, found = again.problem, np.zeros(self.strains)
        strands, viscosity, bonds = problem.strands, problem.viscosity, problem.bonds
        if viscosity.exists:
            parts = [
                strands.axial_stiffness * strands.rest_length * viscosity.edge_time,
                (strands.joint_stiffness * viscosity.joint_time).ravel(),
                bonds.stiffness.ravel() * viscosity.pair_time.ravel() if len(bonds.joint) else np.zeros(0),
            ]
            elements = np.concatenate(parts)
            found[: len(elements)] = elements
        return found

    def _coupling(self, again: StepAgain) -> sparse.csr_matrix:
        """Return what viscosity of strips has beside the squares of strains; see `flattening.viscous_coupling`."""
        problem, found = again.problem, sparse.lil_matrix((self.strains, self.strains))
        strands, flattening, off_axis = problem.strands, problem.flattening, problem.off_axis
        bent = {int(k): slope for k, slope in zip(off_axis.joint, off_axis.slope, strict=True)}
        self.bending: dict[int, list[int]] = {}  # joints that the strain of an edge bends
        if not (problem.viscosity.exists and flattening.exists):
            return found.tocsr()
        for k, coupling in zip(flattening.joint, flattening.coupling, strict=True):
            lag, turn = coupling * problem.viscosity.joint_time[k, 0], strands.edge_count + 3 * k + 2
            parts = [(turn - 2, 1.0)]
            for e, slope in zip((strands.joint_a[k], strands.joint_b[k]), bent.get(int(k), ()), strict=False):
                if slope != 0.0:
                    parts.append((e, slope * strands.rest_length[e]))
                    self.bending.setdefault(int(e), []).append(int(k))
            for row, weight in parts if lag != 0.0 else ():
                found[row, turn] += lag * weight
                found[turn, row] += lag * weight
        return found.tocsr()

    def _inverse(self, resisted: sparse.csc_matrix) -> sparse.csr_matrix:
        """Return the inverse for strains that are viscous, and nothing for others."""
        which = np.flatnonzero(self.viscous > 0.0)
        chosen = sparse.csr_matrix((np.ones(len(which)), (which, np.arange(len(which)))), (self.strains, len(which)))
        if not len(which):
            return sparse.csr_matrix((self.strains, self.strains))
        return (chosen @ linalg.inv(resisted[which][:, which].tocsc()) @ chosen.T).tocsr()

    def _groups(self, again: StepAgain) -> list[list[tuple[int, Array]]]:
        """Return groups of viscous strains that share no unknown, each with the unknowns that it depends on."""
        strands, bonds = again.problem.strands, again.problem.bonds
        edges, constrained = strands.edge_count, again.problem.constrained
        holder = {node: f for node, f in zip(constrained.node, constrained.free, strict=True) if f >= 0}
        clamped = again.problem.bodies.free_index[constrained.clamp_edge_body]

        def of(*which: int, more: Sequence[int] = ()) -> Array:
            inner = sorted({e for e in which if e < edges})
            nodes = {n for e in inner for n in (strands.edge_node[e], strands.edge_node[e] + 1)} | set(more)
            bodies = {holder[n] for n in nodes if n in holder} | {clamped[e - edges] for e in which if e >= edges}
            bodies = sorted(bodies - {-1})
            parts = self.nodes[sorted(nodes - set(holder))], strands.edge_unknown[inner], again.of_bodies[bodies]
            return np.concatenate([part.ravel() for part in parts]).astype(int)

        joints = strands.joint_a, strands.joint_b
        seen = [of(e, *(joints[s][k] for k in self.bending.get(e, ()) for s in range(2))) for e in range(edges)]
        seen += [of(a, b) for a, b in zip(strands.joint_a, strands.joint_b, strict=True) for _ in range(3)]
        for k in range(len(bonds.joint)):
            seen += [of(strands.joint_a[bonds.joint[k]], strands.joint_b[bonds.joint[k]], more=bonds.node[k])] * 3
        groups: list[list[tuple[int, Array]]] = []
        taken: list[set[int]] = []
        for k in np.flatnonzero(self.viscous > 0.0):
            own = set(seen[k].tolist())
            place = next((g for g, others in enumerate(taken) if others.isdisjoint(own)), len(groups))
            if place == len(groups):
                groups.append([])
                taken.append(set())
            groups[place].append((int(k), seen[k]))
            taken[place] |= own
        return groups

    def tangents(self, at: Configuration) -> sparse.csr_matrix:
        """Return ∂t/∂x of edges, shape (3 n_edge, size)."""
        edges = len(self.spin_inertia)
        t = at.tangent[:edges]
        blocks = (np.eye(3) - t[:, :, None] * t[:, None, :]) / at.length[:edges, None, None]
        return _block_diagonal(blocks) @ self.vectors


class Strains:
    """∂σ/∂q at a configuration: of viscous elements as given, and of directors of raised edges."""

    def __init__(self, constants: Constants, again: StepAgain, at: Configuration, viscous: sparse.csr_matrix | None):
        self._constants, self._viscous, k = constants, viscous, again.problem.raised.edge
        self._exist, nodes = len(k) > 0, constants.nodes
        if not self._exist:
            return
        t, m1, first = at.tangent[k], at.director1[k], again.problem.strands.edge_node[k]
        self._along = -t[:, :, None] * m1[:, None, :] / at.length[k, None, None]
        self._before, self._after, self._turn = nodes[first], nodes[first + 1], again.of_edges[k]
        self._across = at.director2[k][:, :, None] * float(constants.in_space)

    def __matmul__(self, place: Array) -> Array:
        constants = self._constants
        found = np.zeros((constants.strains, place.shape[1])) if self._viscous is None else self._viscous @ place
        if self._exist:
            moved = self._along @ (place[self._after] - place[self._before])
            found[constants.raised_rows] = moved + self._across * place[self._turn][:, None, :]
        return found

    def pull_back(self, strains: Array) -> Array:
        """Return the transpose times columns."""
        constants = self._constants
        found = np.zeros((constants.size, strains.shape[1])) if self._viscous is None else self._viscous.T @ strains
        if self._exist:
            own = strains[constants.raised_rows]
            pulled = self._along.swapaxes(1, 2) @ own  # each node is before one edge and after one
            found[self._after] += pulled
            found[self._before] -= pulled
            found[self._turn] += (self._across * own).sum(axis=1)
        return found


def _block_diagonal(blocks: Array) -> sparse.csr_matrix:
    """Return a matrix of 3 × 3 blocks, shape (n, 3, 3)."""
    n = len(blocks)
    return sparse.bsr_matrix((blocks, np.arange(n), np.arange(n + 1)), shape=(3 * n, 3 * n)).tocsr()


def _holonomy(constants: Constants, first: Configuration, second: Configuration) -> tuple:
    """Return ∂a/∂x of both ends of a transport, beyond what frames turn, shapes (n_edge, size)."""
    edges = len(constants.spin_inertia)
    a, b = first.tangent[:edges], second.tangent[:edges]
    half = np.cross(a, b) / (1.0 + np.einsum("ki,ki->k", a, b))[:, None]
    rows = sparse.csr_matrix((half.ravel(), np.arange(3 * edges), np.arange(0, 3 * edges + 1, 3)))
    return rows @ constants.tangents(first), rows @ constants.tangents(second)


@dataclass
class StageRates:
    """Linear maps of a stage; see the module."""

    length: float
    momentum_length: float
    strains: Strains
    by_laws: Array  # ∂g/∂η
    lacking: Entries | None = None  # G
    by_turn: sparse.csr_matrix | None = None  # ∂g/∂a apart from the Hessian, shape (size, n_edge)
    by_director: Entries | None = None  # ∂g by strains at the origin, by drag
    by_origin: Entries | None = None  # ∂g/∂Ȳ by the gyroscopic force, shape (size, size)
    bodies: BodyRates | None = None
    resistance: Array | float = 0.0  # of motions of joints and guides, shape (n_strain, 1)
    momentum: tuple[Entries, Entries] | None = None  # of the fluid, by places at the end and by velocities
    way: tuple = ()  # of turns, by places at the start, at the first guess and at the end
    law_by_mode: Array = field(default_factory=lambda: np.zeros((0, 0)))
    law_by_gain: Array = field(default_factory=lambda: np.zeros(0))
    lag: Array = field(default_factory=lambda: np.zeros((3, 0)))  # ∂T/∂(T at the start, first, stimulus)


class StepRates:
    """Derivatives of kept steps, one after the other.

    Parameters
    ----------
    model : Model
    agains : sequence of StepAgain
        As many as a step has stages at most: each holds the factor of one of them.
    """

    def __init__(self, model: Model, agains: Sequence[StepAgain]):
        self._agains = agains
        self.constants = Constants(model, agains[0])
        self.residual = 0.0
        none = np.zeros((0, 0))
        empty = {name: np.zeros(0, dtype=np.int64) for name in ("node_colour", "edge_colour")}
        self._differences = Differences(
            colours=0,
            ways=none,
            by_place=none,
            by_origin=none,
            by_pose=none,
            by_director=none,
            by_law=np.zeros((len(agains[0].laws), agains[0].size)),
            pressing=np.zeros(0, dtype=bool),
            following=np.zeros(0, dtype=bool),
            friction=FrozenChange.absent(),
            **empty,
        )
        self._follower = Followed(model, agains[0])
        self._moving = [n for n in (*FOLLOWING, "inertia", "damping") if n in model.forces]
        self._body_flow = body_flow_of(model)
        self._resisted = "joint friction" in model.forces
        self._moduli = agains[0].problem.moduli.exists or agains[0].problem.flattening.exists

    def take(self, step: KeptStep) -> list[Reached]:
        """Go to a step; return where its stages ended."""
        self.step, self._stages, reached = step, [], []
        stages = len(step.method.couplings)
        for n, again in enumerate(self._agains[:stages]):
            again.begin(step)
            for earlier in range(n):
                again.start(earlier)
                again.go(earlier, reached[earlier])
                again.finish(earlier)
            again.start(n)
            if n == 0:
                self._start_strains = self._strains(again, again.places[0])
                if again.wet:
                    self._start_momentum = self._follower.momentum(again, again.places[0], step.start.velocity)
            place, correction, followed = again.find(n, self._follower.matrices)
            reached.append(place)
            self.residual = max(self.residual, correction / step.length)
            self._stages.append(self._rates(again, n, followed))
        return reached

    def _strains(self, again: StepAgain, at: Configuration) -> Strains:
        """Return ∂σ/∂q at a configuration, with the gradient there evaluated where strains are viscous."""
        constants, stage = self.constants, again.stage
        if not (constants.groups or self._resisted):
            return Strains(constants, again, at, None)
        data, rows, columns = [np.zeros(0)], [np.zeros(0, dtype=int)], [np.zeros(0, dtype=int)]
        again.evaluate(at)
        before, origin = again.whole_gradient(), stage.origin_strain.copy()
        for group in constants.groups:
            for k, _ in group:
                stage.origin_strain[k] -= STRAIN
            again.evaluate(at)
            change = again.whole_gradient() - before
            stage.origin_strain[:] = origin
            for k, seen in group:
                data.append(change[seen] * (stage.length / STRAIN))
                rows.append(np.full(len(seen), k))
                columns.append(seen)
        again.evaluate(at)
        where = np.concatenate(rows), np.concatenate(columns)
        shape = (constants.strains, constants.size)
        slopes = constants.apart @ sparse.csr_matrix((np.concatenate(data), where), shape=shape)
        if self._resisted:
            slopes = slopes + slopes_of_motions(again, at).matrix()
        return Strains(constants, again, at, slopes)

    def _rates(self, again: StepAgain, n: int, followed: Lacking) -> StageRates:
        constants, stage, at = self.constants, again.stage, again.places[n + 1]
        found = StageRates(stage.length, stage.momentum_length, self._strains(again, at), self._by_laws(again, at))
        if again.of_bodies.size:
            found.bodies = BodyRates(again, at, self.step.method.couplings[n, :n], again.turned[:n])
            if self.step.method.history:
                second = again.problem.bodies.second_moment
                found.bodies.keep(self.step.start, second, self.step.method, n, self.step.length)
        if self._resisted:
            found.resistance = resistances(again)[:, None]
        if constants.in_space:
            self._turning(again, n, found)
            if found.bodies:
                self._hold(found)
        if followed[0] is not None:
            self._add_followed(found, *followed[:2])
            found.by_director = followed[2]
        if self._body_flow.exists:
            drag = drag_by_origin(self._body_flow, again, at)
            found.by_origin = drag if found.by_origin is None else found.by_origin + drag
        if found.bodies:
            found.bodies.add_slides(again, at, followed[3])
        if again.wet:
            velocity = (at.position - stage.origin_position) / stage.length
            found.momentum = self._follower.momentum(again, at, velocity)
            again.follow(at)
        if found.lacking is not None:
            found.lacking = found.lacking.masked(constants.freed)
        drives, laws = again.problem.drives, again.laws
        if len(laws):
            slope = 1.0 - (laws / drives.law_saturation) ** 2
            found.law_by_mode = (slope * drives.law_gain)[:, None] * constants.followed
            found.law_by_gain = slope * (constants.followed @ again.transduction - drives.law_reference)
        found.lag = self._lag(again, n)
        return found

    def _by_laws(self, again: StepAgain, at: Configuration) -> Array:
        """Return ∂g/∂η, shape (size, n_law)."""
        if not len(again.laws):
            return np.zeros((self.constants.size, 0))
        again.differentiate_by_laws(at, self._differences, STRAIN)
        return self._differences.by_law.T.copy()

    def _turning(self, again: StepAgain, n: int, found: StageRates) -> None:
        """Add what the turns of edges, and their gyroscopic force, ask for."""
        constants, stage, at, strands = self.constants, again.stage, again.places[n + 1], again.problem.strands
        edges = len(constants.spin_inertia)
        by_start, by_guess = _holonomy(constants, again.places[n], again.guesses[n])
        more, by_end = _holonomy(constants, again.guesses[n], at)
        found.way = by_start, by_guess + more, by_end
        t, length, inertia = at.tangent[:edges], at.length[:edges, None], constants.spin_inertia[:, None]
        x, origin, i = at.position, stage.origin_position, strands.edge_node
        lengthened = (x[i + 1] - x[i]) - (origin[i + 1] - origin[i])
        turned = (at.total_angle - stage.origin_angle)[:, None]
        factor = inertia / (stage.length * length) ** 2
        around = np.cross(t, lengthened)
        force = factor * turned * around
        along = (np.eye(3) - t[:, :, None] * t[:, None, :]) / length[:, :, None]
        scaled = (factor * turned)[:, :, None]
        by_vector = scaled * (_triple(t) - _triple(lengthened) @ along)
        by_vector -= 2.0 * force[:, :, None] * (t / length)[:, None, :]
        pull = -constants.vectors.T
        columns = np.repeat(np.arange(edges), 3)
        of_turn = sparse.csr_matrix(((factor * around).ravel(), (np.arange(3 * edges), columns)))
        by_turn = pull @ of_turn
        spin = constants.turn_inertia / stage.momentum_length + constants.damping * constants.spin_inertia
        spin = spin / stage.length
        both = by_turn + constants.turns.T @ sparse.diags(spin)
        again.forces(at, self._moving)
        ahead = again.sums.edge[:edges, 3]  # moments of forces that see turns since the start of the stage
        by_vector += 0.5 * _triple(t) * (ahead / at.length[:edges] ** 2)[:, None, None]
        found.lacking = Entries.of(
            both @ by_end + by_turn @ constants.turns + pull @ _block_diagonal(by_vector) @ constants.vectors
        )
        found.by_turn = both.tocsr()
        found.by_origin = Entries.of(
            -by_turn @ constants.turns - pull @ _block_diagonal(scaled * _triple(t)) @ constants.vectors
        )

    def _hold(self, found: StageRates) -> None:
        """Let bodies take what acts on the nodes that they hold."""
        spread = found.bodies.matrix()
        found.lacking = Entries.of(spread.T @ found.lacking.matrix() @ spread)
        found.by_turn = (spread.T @ found.by_turn).tocsr()
        found.by_origin = Entries.of((spread.T @ found.by_origin.matrix()).tocsr())

    def _add_followed(self, found: StageRates, by_place: Entries, by_origin: Entries) -> None:
        """Add what forces take from the end of the stage, and their dependence on its origin.

        They depend on turns over the stage: by the turn at its end as by that at its origin, but for the sign.
        """
        if found.way:
            of_origin = by_origin.matrix()
            by_turn = -of_origin[:, self._agains[0].of_edges]
            found.by_turn = found.by_turn + by_turn
            way = found.way[2] @ found.bodies.matrix() if found.bodies else found.way[2]
            by_place = Entries.of(by_place.matrix() + by_turn @ way + found.lacking.matrix())
            by_origin = Entries.of(of_origin + found.by_origin.matrix())
        found.lacking, found.by_origin = by_place, by_origin

    def _lag(self, again: StepAgain, n: int) -> Array:
        """Return what each mode takes of what it had reached, of the first stimulus and of that of the stage."""
        drives, inputs, state = again.problem.drives, again.inputs, self.step.start
        found = np.zeros((3, len(self.constants.channel)))
        for m, channel in enumerate(self.constants.channel):
            own = state.transduction[m], inputs.first[channel], inputs.stimulus[n, channel]
            lags = float(drives.mode_rising[m]), float(drives.mode_falling[m])
            lag = lags[0] if own[2] > own[0] else lags[1]  # on either side of it
            for k in range(3):
                unit = [float(j == k) for j in range(3)]
                found[k, m] = lagged(*unit, lag, lag, float(inputs.elapsed[n]))
        return found

    @property
    def _forgotten(self) -> slice:
        """Rows of rates of rates of strains that a step leaves without which the method has no history."""
        size, raised = self.constants.size, self._agains[0].problem.raised
        if self.step.method.history:
            return slice(0, 0)
        return slice(size, size + (raised.first if raised.exists else self.constants.strains))

    # forward

    def forward(self, start: Rates, acts: Inputs, direct: Sequence[Array] | None = None) -> Rates:
        """Return how the end of the step changes.

        Parameters
        ----------
        start : Rates
            Of its start.
        acts : Inputs
        direct : sequence of ndarray, optional
            Of the gradient at the ends of stages by parameters alone, each of shape (size, n).
        """
        constants, method, h = self.constants, self.step.method, self.step.length
        size, edges = constants.size, self._agains[0].of_edges
        none, fluid = (
            np.zeros((constants.masses.shape[0] - constants.of_fluid.start, start.place.shape[1])),
            constants.of_fluid,
        )
        first = np.concatenate([constants.free @ start.place, self._start_strains @ start.place, none])
        first[edges] = 0.0
        speed = np.concatenate([constants.moves @ start.speed, start.strain_rate, none])
        if len(none):
            by_place, by_speed = self._start_momentum
            speed[fluid] = by_place @ start.place + by_speed @ speed[:size]
        push = np.concatenate([start.push, start.strain_push])
        place, turn = start.place, np.zeros((len(edges), start.place.shape[1]))
        gained: list[tuple[Array, Array]] = []
        turned: list[tuple[Array, Array]] = []
        for n, stage in enumerate(self._stages):
            origin, origin_speed = first.copy(), speed.copy()
            for coupling, (of_place, of_speed) in zip(method.couplings[n], gained, strict=False):
                origin += coupling * of_place
                origin_speed += coupling * of_speed
            if method.history:
                origin += method.along[n] * h * speed + method.bend * h * h * push
                origin_speed += method.momenta[n] * h * push
            if bodies := stage.bodies:
                bodies.turn_origin(first, origin, turned)
                if method.history:
                    bodies.turn_by_history(first, speed, push, origin)
                ahead = bodies.predict(origin, origin_speed)
            reached = stage.lag[0][:, None] * start.reached
            if len(constants.channel):
                reached += stage.lag[1][:, None] * acts.first[constants.channel]
                reached += stage.lag[2][:, None] * acts.stimulus[n, constants.channel]
            change = -constants.masses @ (origin + stage.length * origin_speed)
            change = change / (stage.length * stage.momentum_length) - constants.dissipation @ origin / stage.length
            change[constants.of_strains] -= stage.resistance * origin[constants.of_strains] / stage.length
            right = change[:size] + stage.strains.pull_back(change[constants.of_strains])
            if stage.momentum:
                right -= origin_speed[fluid] / stage.momentum_length
            if bodies:
                right = bodies.gather(right)
                bodies.push(ahead, right)
            if len(stage.law_by_gain):
                laws = stage.law_by_mode @ reached + stage.law_by_gain[:, None] * acts.gain
                right += stage.by_laws @ laws
            if direct is not None:
                right += direct[n]
            before = np.zeros_like(turn)
            if stage.way:
                guess = constants.free @ (origin[:size] + stage.length * origin_speed[:size])
                if bodies:
                    bodies.guess(origin, origin_speed, ahead, guess)
                before = turn - place[edges] + stage.way[0] @ place + stage.way[1] @ guess
                right += stage.by_turn @ before
            if stage.by_origin is not None:
                right += stage.by_origin @ origin[:size]
            if stage.by_director is not None:
                right += stage.by_director @ origin[constants.of_strains]
            moved = -self._agains[n].solved(constants.free @ right, stage.lacking)
            if bodies:
                moved = bodies.spread(moved)
            end = np.concatenate([moved, stage.strains @ moved, none])
            if stage.way:
                end[edges] = before + moved[edges] + stage.way[2] @ moved
            end_speed = (end - origin) / stage.length
            if bodies:
                bodies.end(end, origin_speed, ahead, end_speed)
                turned.append((end, origin))
            if stage.momentum:
                end_speed[fluid] = stage.momentum[0] @ moved + stage.momentum[1] @ end_speed[:size]
            gained.append((end - origin, end_speed - origin_speed))
            place, turn = moved, end[edges]
        kept = (end_speed - origin_speed) / stage.momentum_length
        kept = (kept - method.carry * push) / (1.0 - method.carry)
        kept[self._forgotten] = 0.0
        return Rates(place, end_speed[:size], end_speed[constants.of_strains], reached, kept[:size], kept[size:])

    # backward

    def backward(self, end: Rates) -> tuple[Rates, Inputs, list[Array]]:
        """Return the derivatives by the start of the step, by what acts, and by the gradients where stages ended, from
        those by the end of the step.
        """
        constants, method, h = self.constants, self.step.method, self.step.length
        size, edges, columns = constants.size, self._agains[0].of_edges, end.place.shape[1]
        start = Rates.zeros(self._agains[0], columns)
        acts = Inputs.zeros(self._agains[0], len(self._stages), columns)
        push, fluid = np.zeros((constants.masses.shape[0], columns)), constants.of_fluid
        first, speed = np.zeros_like(push), np.zeros_like(push)
        count = len(self._stages)
        ends = [np.zeros_like(push) for _ in range(count)]
        end_speeds = [np.zeros_like(push) for _ in range(count)]
        origins = [np.zeros_like(push) for _ in range(count)]
        origin_speeds = [np.zeros_like(push) for _ in range(count)]
        places = [np.zeros((size, columns)) for _ in range(count)]
        direct: list[Array] = [np.zeros((size, columns))] * count
        places[-1] += end.place
        kept = np.concatenate([end.push, end.strain_push]) / (1.0 - method.carry)
        kept[self._forgotten] = 0.0
        push -= method.carry * kept
        end_speeds[-1] += kept / self._stages[-1].momentum_length
        end_speeds[-1][:size] += end.speed
        end_speeds[-1][constants.of_strains] += end.strain_rate
        origin_speeds[-1] -= kept / self._stages[-1].momentum_length
        for n in reversed(range(count)):
            stage = self._stages[n]
            of_momentum = end_speeds[n][fluid].copy()
            end_speeds[n][fluid] = 0.0
            if stage.momentum:
                end_speeds[n][:size] += stage.momentum[1].T @ of_momentum
                places[n] += stage.momentum[0].T @ of_momentum
            if bodies := stage.bodies:
                ahead = bodies.end_back(ends[n], origin_speeds[n], end_speeds[n])
            ends[n] += end_speeds[n] / stage.length
            origins[n] -= end_speeds[n] / stage.length
            moved = places[n] + ends[n][:size] + stage.strains.pull_back(ends[n][constants.of_strains])
            before = np.zeros((len(edges), columns))
            if stage.way:
                moved += stage.way[2].T @ ends[n][edges]
                before += ends[n][edges]
            transposed = None if stage.lacking is None else stage.lacking.T
            moved = bodies.gather(moved) if bodies else constants.free @ moved
            right = direct[n] = -self._agains[n].solved(moved, transposed)
            spread = bodies.spread(right) if bodies else right
            change = np.concatenate([spread, stage.strains @ spread, np.zeros_like(of_momentum)])
            if bodies:
                ahead += bodies.push_back(right)
            if stage.momentum:
                origin_speeds[n][fluid] -= spread / stage.momentum_length
            of_mass = constants.masses @ change / (stage.length * stage.momentum_length)
            origins[n] -= of_mass + constants.dissipation @ change / stage.length
            origins[n][constants.of_strains] -= stage.resistance * change[constants.of_strains] / stage.length
            origin_speeds[n] -= stage.length * of_mass
            reached = end.reached if n + 1 == count else np.zeros_like(end.reached)
            if len(stage.law_by_gain):
                laws = stage.by_laws.T @ right
                reached = reached + stage.law_by_mode.T @ laws
                acts.gain += stage.law_by_gain[:, None] * laws
            start.reached += stage.lag[0][:, None] * reached
            if len(constants.channel):
                np.add.at(acts.first, constants.channel, stage.lag[1][:, None] * reached)
                np.add.at(acts.stimulus[n], constants.channel, stage.lag[2][:, None] * reached)
            if stage.by_origin is not None:
                origins[n][:size] += stage.by_origin.T @ right
            if stage.by_director is not None:
                origins[n][constants.of_strains] += stage.by_director.T @ right
            if stage.way:
                before += stage.by_turn.T @ right
                guess = stage.way[1].T @ before
                if bodies:
                    bodies.guess_back(guess, origins[n], origin_speeds[n], ahead)
                guess = constants.free @ guess
                origins[n][:size] += guess
                origin_speeds[n][:size] += stage.length * guess
                of_start = stage.way[0].T @ before
                of_start[edges] -= before
                if n:
                    places[n - 1] += of_start
                    ends[n - 1][edges] += before
                else:
                    start.place += of_start
            if bodies:
                bodies.predict_back(origins[n], origin_speeds[n], ahead)
                if method.history:
                    bodies.turn_by_history_back(first, speed, push, origins[n])
                bodies.turn_origin_back(first, origins[n], ends, origins)
            if method.history:
                speed += method.along[n] * h * origins[n]
                push += method.bend * h * h * origins[n] + method.momenta[n] * h * origin_speeds[n]
            first += origins[n]
            speed += origin_speeds[n]
            for j in range(n):
                coupling = method.couplings[n, j]
                ends[j] += coupling * origins[n]
                origins[j] -= coupling * origins[n]
                end_speeds[j] += coupling * origin_speeds[n]
                origin_speeds[j] -= coupling * origin_speeds[n]
        first[edges] = 0.0
        start.place += constants.free @ first[:size] + self._start_strains.pull_back(first[constants.of_strains])
        if fluid.stop > fluid.start:
            by_place, by_speed = self._start_momentum
            start.place += by_place.T @ speed[fluid]
            speed[:size] += by_speed.T @ speed[fluid]
        start.speed += constants.moves @ speed[:size]
        start.strain_rate += speed[constants.of_strains]
        start.push, start.strain_push = push[:size], push[size:]
        return start, acts, direct
