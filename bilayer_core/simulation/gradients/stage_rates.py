"""Linear maps of a stage of a step that was made; `gradients.step_rates` has what they are for.

∂g/∂η of eigenstrains and ∂σ/∂q of viscous strains are read off the gradient itself, which is linear in η and in the
strains of the origin: one evaluation for as many of them as no unknown sees together.

A frame turns by dω about its tangent beyond what parallel transport does. The turn a of an edge since the start of the
step is counted along the way start → first guess → end, whose transport depends on where tangents are:

    da = da₀ + dω − dω₀ + Σ ½ κb·(dt₁ + dt₂),    κb = 2 t₁ × t₂/(1 + t₁·t₂) of each part of the way
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from bilayer_core.engine.gradient_differences import StrainDifferences
from bilayer_core.forces.body_drag import body_flow_of
from bilayer_core.model.model import Model
from bilayer_core.model.records.step import Configuration
from bilayer_core.simulation.gradients.body_rates import BodyRates, drag_by_origin
from bilayer_core.simulation.gradients.entries import Entries
from bilayer_core.simulation.gradients.followed import FOLLOWING, Followed
from bilayer_core.simulation.gradients.impact_rates import by_impacts, slopes_of_gaps
from bilayer_core.simulation.gradients.light_rates import slopes_of_light
from bilayer_core.simulation.gradients.mechanism_rates import resistances, slopes_of_motions
from bilayer_core.simulation.gradients.step_again import KeptStep, Lacking, StepAgain, cross_matrices
from bilayer_core.simulation.gradients.transduction_rates import TransductionRates

if TYPE_CHECKING:
    from scipy import sparse

Array = np.ndarray
STRAIN = 1e-3
"""Change of eigenstrains and of strains by which derivatives are read off."""
_COMPONENT = np.array([0, 1, 2, 0, 1, 2, 3])
_FORCE, _MOTION = np.array([1.0, 1, 1, -1, -1, -1, 1]), np.array([-1.0, -1, -1, 1, 1, 1, 1])
"""Of the unknowns of an edge, two nodes and its turn: components of its vector and turn, and signs of forces."""


def _cross(a: Array, b: Array) -> Array:
    """Return a × b, shape (n, 3), at a fifth of what numpy's costs."""
    return a[:, [1, 2, 0]] * b[:, [2, 0, 1]] - a[:, [2, 0, 1]] * b[:, [1, 2, 0]]


class Constants:
    """Matrices that rates of all steps of a model share, and which strains are apart from each other."""

    def __init__(self, model: Model, again: StepAgain):
        problem, strands = again.problem, again.problem.strands
        self.size, self.strains = again.size, again.stage.origin_strain.size
        self.whole = self.size + self.strains + again.wet
        edges = strands.edge_count
        self.in_space = problem.space.exists
        self.nodes = again.of_nodes
        self.before, self.after = self.nodes[strands.edge_node], self.nodes[strands.edge_node + 1]
        self.of_edge = np.concatenate([self.before, self.after, strands.edge_unknown[:, None]], axis=1)
        self.edge_of = np.full(self.size, -1)
        self.edge_of[strands.edge_unknown] = np.arange(edges)
        self.pairs = tuple(
            np.broadcast_to(of, (edges, 7, 7)).ravel() for of in (self.of_edge[:, :, None], self.of_edge[:, None, :])
        )
        self.spin_inertia = strands.spin_inertia if self.in_space else 0.0 * strands.spin_inertia
        self.damping = problem.damping
        self.viscous = self._viscous(again)
        self.mass, self.coupling = self._masses(again)
        damped = np.full(self.whole, float(self.damping))
        damped[again.of_bodies] = 0.0
        self.damped = damped[:, None]
        self.turn_inertia = self.spin_inertia
        of_fluid = np.zeros(self.whole)
        if problem.fluid.exists and self.in_space:
            self.turn_inertia = self.spin_inertia + problem.fluid.mass[:, 2]
            of_fluid[strands.edge_unknown] = problem.fluid.mass[:, 2]
        self.mass = (self.mass + of_fluid)[:, None]
        drag = np.concatenate([np.zeros(self.size), self.viscous, np.zeros(again.wet)])
        self.drag = (drag - damped * of_fluid)[:, None]
        self.strips = self._strips(again)
        self.apart = self._inverse() if len(self.strips.row) else None
        self.of_strains = slice(self.size, self.size + self.strains)
        gaps = again.problem.restitution
        self.of_gaps = slice(gaps.first, gaps.first + len(gaps.rate))
        self.of_fluid = slice(self.size + self.strains, self.whole)
        self.moving = slice(0, self.size + self.strains)
        first = self.size + problem.raised.first
        self.wet_strains = slice(first, first + again.wet - self.size) if again.wet else slice(0, 0)
        free, moves = np.ones((self.size, 1)), np.ones((self.size, 1))
        free[(problem.constrained.unknown[:, None] + np.arange(3)).ravel()] = 0.0
        prescribed = problem.constrained.free < 0
        moves[(problem.constrained.unknown[prescribed, None] + np.arange(3)).ravel()] = 0.0
        self.free, self.moves = free, moves  # where anything depends on unknowns, and velocities on anything
        self.colour, self.colours, self.seen = self._colours(again)
        drives = problem.drives
        rows = np.repeat(np.arange(len(drives.law_gain)), np.diff(drives.law_first))
        within = np.arange(len(rows)) - drives.law_first[rows]
        columns = drives.field_first[drives.law_field[rows]] + within
        self.followed = np.zeros((len(drives.law_gain), again.transduction.size))
        np.add.at(self.followed, (rows, columns), drives.law_weight[: len(rows)])
        self.raised_rows = problem.raised.first + 3 * problem.raised.slot[:, None] + np.arange(3)

    def _masses(self, again: StepAgain) -> tuple[Array, Entries]:
        """Return the diagonal of the masses, and what couples nodes and directors of raised edges."""
        strands, raised, problem_bodies = again.problem.strands, again.problem.raised, again.problem.bodies
        diagonal = np.zeros(self.whole)
        diagonal[self.nodes] = strands.node_mass[:, None]
        diagonal[strands.edge_unknown] = self.spin_inertia
        diagonal[again.of_bodies[:, :3]] = problem_bodies.mass[:, None]
        shape = len(raised.edge), 2, 3
        own = np.broadcast_to(self.size + raised.first + 3 * raised.slot[:, None, None] + np.arange(3), shape)
        diagonal[own[:, 0]] = raised.second_moment[:, None]
        first = strands.edge_node[raised.edge]
        node = np.stack([self.nodes[first], self.nodes[first + 1]], axis=1)
        value = np.broadcast_to(raised.first_moment.reshape(-1, 2, 1), shape).ravel()
        half = Entries(node.ravel(), own.ravel(), value, (self.whole, self.whole))
        return diagonal, half + half.T

    def masses(self, of: Array) -> Array:
        """Return 𝓜 times columns."""
        return self.mass * of + self.coupling @ of if len(self.coupling.row) else self.mass * of

    def push_fluid(self, change: Array, momentum: Array) -> None:
        """Add momenta of the fluid to what changes of nodes and strains take."""
        change[: self.size] += momentum[: self.size]
        change[self.wet_strains] += momentum[self.size :]

    def fluid_pushed(self, change: Array) -> Array:
        """Return the transpose."""
        return np.concatenate([change[: self.size], change[self.wet_strains]])

    def dissipation(self, of: Array, masses: Array) -> Array:
        """Return 𝓓 times columns, from 𝓜 times these."""
        found = self.damped * masses + self.drag * of
        return found + self.strips @ of if self.apart is not None else found

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

    def _strips(self, again: StepAgain) -> Entries:
        """Return what viscosity of strips has beside the squares of strains; see `flattening.viscous_coupling`."""
        problem, found = again.problem, [(0, 0, 0.0)][:0]
        strands, flattening, off_axis = problem.strands, problem.flattening, problem.off_axis
        bent = {int(k): slope for k, slope in zip(off_axis.joint, off_axis.slope, strict=True)}
        self.bending: dict[int, list[int]] = {}  # joints that the strain of an edge bends
        viscous = problem.viscosity.exists and flattening.exists
        for k, coupling in zip(flattening.joint, flattening.coupling, strict=True) if viscous else ():
            lag, turn = coupling * problem.viscosity.joint_time[k, 0], strands.edge_count + 3 * k + 2
            parts = [(turn - 2, 1.0)]
            for e, slope in zip((strands.joint_a[k], strands.joint_b[k]), bent.get(int(k), ()), strict=False):
                if slope != 0.0:
                    parts.append((e, slope * strands.rest_length[e]))
                    self.bending.setdefault(int(e), []).append(int(k))
            for row, weight in parts if lag != 0.0 else ():
                found += [(row, turn, lag * weight), (turn, row, lag * weight)]
        row, column, value = np.array(found, dtype=float).reshape(-1, 3).T
        whole = self.size + row.astype(np.int64), self.size + column.astype(np.int64)
        return Entries(*whole, value.copy(), (self.whole, self.whole))

    def _inverse(self) -> sparse.csr_matrix:
        """Return the inverse of what resists strains, for those that are viscous, and nothing for others."""
        from scipy import sparse
        from scipy.sparse import linalg

        strips, shape = self.strips, (self.strains, self.strains)
        where = strips.row - self.size, strips.column - self.size
        resisted = sparse.csc_matrix((strips.value, where), shape) + sparse.diags(self.viscous)
        which = np.flatnonzero(self.viscous > 0.0)
        chosen = sparse.csr_matrix((np.ones(len(which)), (which, np.arange(len(which)))), (self.strains, len(which)))
        return (chosen @ linalg.inv(resisted.tocsc()[which][:, which].tocsc()) @ chosen.T).tocsr()

    def _colours(self, again: StepAgain) -> tuple[Array, int, tuple[Array, Array]]:
        """Return colours of viscous strains, −1 of others, such that those of one colour share no unknown, how many
        there are, and each strain with each unknown that it depends on.
        """
        strands, bonds = again.problem.strands, again.problem.bonds
        edges, constrained = strands.edge_count, again.problem.constrained
        holder = {node: f for node, f in zip(constrained.node, constrained.free, strict=True) if f >= 0}
        clamped = again.problem.bodies.free_index[constrained.clamp_edge_body]

        def of(*which: int, more: Sequence[int] = ()) -> Array:
            inner = sorted({e for e in which if e < edges})
            nodes = {n for e in inner for n in (strands.edge_node[e], strands.edge_node[e] + 1)} | set(more)
            bodies = {holder[n] for n in nodes if n in holder} | {clamped[e - edges] for e in which if e >= edges}
            held = again.of_bodies[sorted(bodies - {-1})]
            parts = self.nodes[sorted(nodes - set(holder))], strands.edge_unknown[inner], held
            return np.concatenate([part.ravel() for part in parts]).astype(int)

        colour = np.full(self.strains, -1)
        viscous = np.flatnonzero(self.viscous > 0.0)
        if not len(viscous):
            return colour, 0, (viscous, viscous)
        joints = strands.joint_a, strands.joint_b
        seen = [of(e, *(joints[s][k] for k in self.bending.get(e, ()) for s in range(2))) for e in range(edges)]
        seen += [of(a, b) for a, b in zip(strands.joint_a, strands.joint_b, strict=True) for _ in range(3)]
        for k in range(len(bonds.joint)):
            seen += [of(strands.joint_a[bonds.joint[k]], strands.joint_b[bonds.joint[k]], more=bonds.node[k])] * 3
        taken: list[set[int]] = []
        for k in viscous:
            unknowns = set(seen[k].tolist())
            colour[k] = next((g for g, others in enumerate(taken) if others.isdisjoint(unknowns)), len(taken))
            if colour[k] == len(taken):
                taken.append(set())
            taken[colour[k]] |= unknowns
        which = np.repeat(viscous, [len(seen[k]) for k in viscous])
        return colour, len(taken), (which, np.concatenate([seen[k] for k in viscous]))

    def strains_of(self, row: Array, column: Array, force: Array) -> Entries:
        """Return changes of strains that resist with some forces."""
        shape = self.strains, self.size
        if self.apart is None:
            return Entries(row, column, force / self.viscous[row], shape)
        from scipy import sparse

        found = (self.apart @ sparse.csr_matrix((force, (row, column)), shape)).tocoo()
        return Entries(found.row.astype(np.int64), found.col.astype(np.int64), found.data, shape)

    # the turns of edges, by vectors along which their transport depends on the nodes, shape (n_edge, 3)

    def along(self, way: Array, place: Array) -> Array:
        """Return what motions turn edges by, shape (n_edge, n)."""
        return np.einsum("ki,kin->kn", way, place[self.after] - place[self.before])

    def along_back(self, way: Array, turns: Array) -> Array:
        """Return the transpose times columns."""
        found, by = np.zeros((self.size, turns.shape[1])), way[:, :, None] * turns[:, None, :]
        found[self.after] += by  # each node is before one edge and after one
        found[self.before] -= by
        return found

    def by_edges(self, blocks: Array) -> Entries:
        """Return a matrix of blocks of edges: forces on their vectors and their moments, by changes of these vectors
        and by turns, shape (n_edge, 4, 4).
        """
        value = blocks[:, _COMPONENT[:, None], _COMPONENT] * (_FORCE[:, None] * _MOTION)
        return Entries(*self.pairs, value.ravel(), (self.size, self.size))


class Strains:
    """∂σ/∂q at a configuration: of viscous elements as given, and of directors of raised edges."""

    def __init__(self, constants: Constants, again: StepAgain, at: Configuration, viscous: Entries | None):
        self._constants, self._viscous, k = constants, viscous, again.problem.raised.edge
        self._exist, nodes = len(k) > 0, constants.nodes
        if not self._exist:
            return
        first = again.problem.strands.edge_node[k]
        self._back, self._lifts = -at.tangent[k, :, None], at.director1[k, :, None] / at.length[k, None, None]
        self._before, self._after, self._turn = nodes[first], nodes[first + 1], again.of_edges[k]
        self._across = at.director2[k, :, None] * float(constants.in_space)

    def __matmul__(self, place: Array) -> Array:
        constants = self._constants
        found = np.zeros((constants.strains, place.shape[1])) if self._viscous is None else self._viscous @ place
        if self._exist:
            lifted = (self._lifts * (place[self._after] - place[self._before])).sum(axis=1, keepdims=True)
            found[constants.raised_rows] = self._back * lifted + self._across * place[self._turn][:, None, :]
        return found

    def pull_back(self, strains: Array) -> Array:
        """Return the transpose times columns."""
        constants = self._constants
        found = np.zeros((constants.size, strains.shape[1])) if self._viscous is None else self._viscous.T @ strains
        if self._exist:
            own = strains[constants.raised_rows]
            pulled = self._lifts * (self._back * own).sum(axis=1, keepdims=True)
            found[self._after] += pulled  # each node is before one edge and after one
            found[self._before] -= pulled
            found[self._turn] += (self._across * own).sum(axis=1)
        return found


@dataclass
class StageRates:
    """Linear maps of a stage; forces are those on all nodes, those among them that bodies hold."""

    length: float
    momentum_length: float
    strains: Strains
    by_laws: Array  # ∂g/∂η, of unknowns
    lacking: Entries | None = None  # G
    by_turn: Entries | None = None  # ∂g/∂a apart from the Hessian, shape (size, n_edge)
    by_director: Entries | None = None  # ∂g by strains at the origin, by drag
    by_gap: Entries | None = None  # likewise of unknowns, by impacts
    by_kept: Entries | None = None  # ∂g by what a step keeps for the next, of unknowns, shape (size, n_kept)
    by_origin: Entries | None = None  # ∂g/∂Ȳ by the gyroscopic force, shape (size, size)
    bodies: BodyRates | None = None
    resistance: Array | float = 0.0  # of motions of joints and guides, shape (n_strain, 1)
    momentum: tuple[Entries, Entries] | None = None  # of the fluid, by places at the end and by velocities
    way: tuple[Array, ...] = ()  # of turns, by places at the start, at the first guess and at the end
    law_by_mode: Array = field(default_factory=lambda: np.zeros((0, 0)))
    law_by_gain: Array = field(default_factory=lambda: np.zeros(0))
    transduction: TransductionRates | None = None


@dataclass
class EndRates:
    """Linear maps of the end of a step beyond its last stage, with names as in `StageRates`."""

    transduction: TransductionRates
    bodies: BodyRates | None
    way: tuple[Array, ...]  # of turns, by places at the last stage and at the end


class StageDerivatives:
    """Makes the linear maps of stages of a model, of which `again` is at the end."""

    def __init__(self, model: Model, again: StepAgain):
        self.constants = Constants(model, again)
        self._differences = StrainDifferences(
            by_law=np.zeros((len(again.laws), again.size)),
            colour=self.constants.colour,
            by_strain=np.zeros((self.constants.colours, again.size)),
        )
        self.follower = Followed(model, again)
        self._body_flow = body_flow_of(model)
        self._damped = "restitution" in model.forces
        self._resisted = "joint friction" in model.forces
        self._moving = [n for n in (*FOLLOWING, "inertia", "damping") if n in model.forces]

    def strains(self, again: StepAgain, at: Configuration) -> Strains:
        """Return ∂σ/∂q at a configuration."""
        constants = self.constants
        slopes = slopes_of_motions(again, at) if self._resisted else None
        if self._damped:
            gaps = slopes_of_gaps(again, at)
            slopes = gaps if slopes is None else gaps + slopes
        if constants.colours:
            again.differentiate_by_strains(at, self._differences, STRAIN)
            which, seen = constants.seen
            value = -again.stage.length * self._differences.by_strain[constants.colour[which], seen]
            own = constants.strains_of(which, seen, value)
            slopes = own if slopes is None else own + slopes
        return Strains(constants, again, at, slopes)

    def of(self, again: StepAgain, n: int, step: KeptStep, followed: Lacking, lit: Array) -> StageRates:
        """Return the maps of stage n of a step; what its Hessian lacks by forces that follow, and how light at its
        start depends on places, are known.
        """
        constants, stage, at = self.constants, again.stage, again.places[n + 1]
        found = StageRates(stage.length, stage.momentum_length, self.strains(again, at), self._by_laws(again, at))
        if again.of_bodies.size:
            found.bodies = BodyRates(again, at, step.method.couplings[n, :n], again.turned[:n])
            if step.method.history:
                found.bodies.keep(step.start, again.problem.bodies.second_moment, step.method, n, step.length)
        if self._resisted:
            found.resistance = resistances(again)[:, None]
        if constants.in_space:
            self._turning(again, n, found)
        if followed[0] is not None:
            self._add_followed(found, *followed[:2])
            found.by_director = followed[2]
        if self._body_flow.exists:
            drag = drag_by_origin(self._body_flow, again, at)
            found.by_origin = drag if found.by_origin is None else found.by_origin + drag
        if found.bodies:
            found.bodies.add_slides(again, at, followed[3])
        if again.wet:
            raised, velocity = again.problem.raised, (at.position - stage.origin_position) / stage.length
            turned = at.director1[raised.edge] - stage.origin_strain[constants.raised_rows]
            found.momentum = self.follower.momentum(again, at, velocity, turned / stage.length)
            again.follow(at)
        if self._damped:
            found.by_gap, found.by_kept = by_impacts(again, at)
        drives, laws = again.problem.drives, again.laws
        if len(laws):
            slope = 1.0 - (laws / drives.law_saturation) ** 2
            found.law_by_mode = (slope * drives.law_gain)[:, None] * constants.followed
            found.law_by_gain = slope * (constants.followed @ again.transduction - drives.law_reference)
        found.transduction = TransductionRates(again, n, step, lit)
        return found

    def beyond(self, again: StepAgain, n: int, step: KeptStep, lit: Array) -> EndRates:
        """Return the maps of the end of a step beyond its last stage, its point n."""
        at, bodies, way = again.places[n + 1], None, ()
        if again.of_bodies.size:
            bodies = BodyRates(again, at, step.method.couplings[n, :n], again.turned[:n])
        if self.constants.in_space:
            way = _holonomy(len(self.constants.spin_inertia), again.places[n], at)
        return EndRates(TransductionRates(again, n, step, lit), bodies, way)

    def light(self, again: StepAgain, at: Configuration) -> Array:
        """Return how what elements see of light depends on places, shape (2 n_lit, size)."""
        if not again.problem.light.exists:
            return np.zeros((0, self.constants.size))
        return slopes_of_light(again, at, self.constants.free[:, 0])

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
        by_start, by_guess = _holonomy(edges, again.places[n], again.guesses[n])
        more, by_end = _holonomy(edges, again.guesses[n], at)
        found.way = by_start, by_guess + more, by_end
        t, length, inertia = at.tangent[:edges], at.length[:edges, None], constants.spin_inertia[:, None]
        x, origin, i = at.position, stage.origin_position, strands.edge_node
        lengthened = (x[i + 1] - x[i]) - (origin[i + 1] - origin[i])
        turned = (at.total_angle - stage.origin_angle)[:, None]
        factor = inertia / (stage.length * length) ** 2
        around = _cross(t, lengthened)
        force = factor * turned * around
        along = (np.eye(3) - t[:, :, None] * t[:, None, :]) / length[:, :, None]
        scaled, crossing = (factor * turned)[:, :, None], cross_matrices(t)
        again.forces(at, self._moving)
        ahead = again.sums.edge[:edges, 3].copy()  # moments of forces that see turns since the start of the stage
        raised = again.problem.raised.edge  # whose directors turn with frames
        ahead[raised] -= np.einsum("ki,ki->k", again.sums.pull[: len(raised)], at.director2[raised])
        by_vector = scaled * (crossing - cross_matrices(lengthened) @ along)
        by_vector -= 2.0 * force[:, :, None] * (t / length)[:, None, :]
        by_vector += 0.5 * crossing * (ahead / at.length[:edges] ** 2)[:, None, None]
        spin = constants.turn_inertia / stage.momentum_length + constants.damping * constants.spin_inertia
        by_turn = np.concatenate([factor * around, (spin / stage.length)[:, None]], axis=1)
        blocks = np.zeros((edges, 4, 4))
        blocks[:, :, :3] = by_turn[:, :, None] * by_end[:, None, :]
        blocks[:, :3, :3] += by_vector
        blocks[:, :3, 3] = by_turn[:, :3]
        found.lacking = constants.by_edges(blocks)
        column = np.repeat(np.arange(edges), 7)
        value = (by_turn[:, _COMPONENT] * _FORCE).ravel()
        found.by_turn = Entries(constants.of_edge.ravel(), column, value, (constants.size, edges))
        blocks[:, 3] = 0.0
        blocks[:, :3, :3] = -scaled * crossing
        blocks[:, :3, 3] *= -1.0
        found.by_origin = constants.by_edges(blocks)

    def _add_followed(self, found: StageRates, by_place: Entries, by_origin: Entries) -> None:
        """Add what forces take from the end of the stage, and their dependence on its origin.

        They depend on turns over the stage: by the turn at its end as by that at its origin, but for the sign.
        """
        if found.way:
            constants, edge = self.constants, self.constants.edge_of[by_origin.column]
            turns = np.flatnonzero((edge >= 0) & (by_origin.value != 0.0))
            row, edge, value = by_origin.row[turns], edge[turns], -by_origin.value[turns]
            found.by_turn += Entries(row, edge, value, found.by_turn.shape)
            by_nodes = value[:, None] * found.way[2][edge]
            column = constants.of_edge[edge, :6].ravel()
            value = np.concatenate([-by_nodes, by_nodes], axis=1).ravel()
            by_place = by_place + found.lacking + Entries(np.repeat(row, 6), column, value, by_place.shape)
            by_origin = by_origin + found.by_origin
        found.lacking, found.by_origin = by_place, by_origin


def _holonomy(edges: int, first: Configuration, second: Configuration) -> tuple[Array, Array]:
    """Return by what changes of their vectors at both ends of a transport turn edges, beyond what frames turn, shapes
    (n_edge, 3).
    """
    a, b = first.tangent[:edges], second.tangent[:edges]
    half = _cross(a, b) / (1.0 + np.einsum("ki,ki->k", a, b))[:, None]  # across both tangents
    return half / first.length[:edges, None], half / second.length[:edges, None]
