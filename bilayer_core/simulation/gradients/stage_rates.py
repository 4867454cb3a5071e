"""Linear maps of a stage of a step that was made; `engine.step_response` has what they are for.

∂g/∂η of eigenstrains and ∂σ/∂q of viscous strains are read off the gradient itself, which is linear in the strains of
the origin, but not in η of strips that curl: one evaluation, or two, for as many of them as no unknown sees together.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from bilayer_core.engine.body_maps import BodyMaps
from bilayer_core.engine.gradient_differences import StrainDifferences
from bilayer_core.engine.linear.lacking_matrix import LackingMatrix
from bilayer_core.engine.stage_maps import differentiate_turns, write_last_way
from bilayer_core.engine.step_ends import HELD
from bilayer_core.engine.step_response import ElasticMaps, FluidMap, StepConstants, StrainMap, write_directors
from bilayer_core.model.model import Model
from bilayer_core.model.records.step import Configuration
from bilayer_core.simulation.gradients.entries import Entries
from bilayer_core.simulation.gradients.followed import Followed, append
from bilayer_core.simulation.gradients.impact_rates import by_impacts, slopes_of_gaps
from bilayer_core.simulation.gradients.light_rates import slopes_of_light
from bilayer_core.simulation.gradients.mechanism_rates import resistances, slopes_of_motions
from bilayer_core.simulation.gradients.step_again import KeptStep, StepAgain
from bilayer_core.simulation.gradients.transduction_rates import write_reached

if TYPE_CHECKING:
    from scipy import sparse

Array = np.ndarray
STRAIN = 1e-3
"""Change of eigenstrains and of strains by which derivatives are read off."""


def _list(room: int, entries: Entries | None = None) -> LackingMatrix:
    """Return a matrix of entries alone, with room for so many more."""
    room += 0 if entries is None else len(entries.row)
    found = LackingMatrix(
        band=np.zeros((0, 0)),
        count=np.zeros(1, dtype=np.int64),
        row=np.zeros(room, dtype=np.int64),
        column=np.zeros(room, dtype=np.int64),
        value=np.zeros(room),
    )
    if entries is not None:
        append(found, entries)
    return found


def _put(matrix: LackingMatrix, entries: Entries) -> None:
    """Make the entries of a matrix others."""
    matrix.count[0] = 0
    append(matrix, entries)


class Constants:
    """Matrices that rates of all steps of a model share, and which strains are apart from each other."""

    def __init__(self, model: Model, again: StepAgain):
        problem, strands = again.problem, again.problem.strands
        self.size, self.strains = again.size, again.stage.origin_strain.size
        self.whole = self.size + self.strains + again.wet
        self.in_space = problem.space.exists
        self.nodes, constrained = again.of_nodes, problem.constrained
        self.holder = {node: f for node, f in zip(constrained.node, constrained.free, strict=True) if f >= 0}
        self.spin_inertia = strands.spin_inertia if self.in_space else 0.0 * strands.spin_inertia
        self.damping = problem.damping
        self.viscous = self._viscous(again)
        mass, coupling = self._masses(again)
        damped = np.full(self.whole, float(self.damping))
        damped[again.of_bodies] = 0.0
        of_fluid = np.zeros(self.whole)
        if problem.fluid.exists and self.in_space:
            of_fluid[strands.edge_unknown] = problem.fluid.mass[:, 2]
        drag = np.concatenate([np.zeros(self.size), self.viscous, np.zeros(again.wet)])
        self.strips = self._strips(again)
        self.apart = self._inverse() if len(self.strips.row) else None
        free, moves = np.ones(self.size), np.ones(self.size)
        free[(problem.constrained.unknown[:, None] + np.arange(3)).ravel()] = 0.0
        prescribed = problem.constrained.free < 0
        moves[(problem.constrained.unknown[prescribed, None] + np.arange(3)).ravel()] = 0.0
        self.moves, gaps = moves[:, None], problem.restitution
        self.of_gaps = slice(gaps.first, gaps.first + len(gaps.rate))
        self.raised_rows = problem.raised.first + 3 * problem.raised.slot[:, None] + np.arange(3)
        of_strains, of_laws = self._strains_seen(again), self._laws_seen(again)
        self.colour, self.colours, self.seen = _coloured(of_strains)
        self.law_colour, self.law_colours, (law, unknown) = _coloured(of_laws)
        self.by_law = Entries(unknown, law, np.zeros(len(law)), (self.size, len(of_laws)))
        drives = problem.drives
        rows = np.repeat(np.arange(len(drives.law_gain)), np.diff(drives.law_first))
        within = np.arange(len(rows)) - drives.law_first[rows]
        columns = drives.field_first[drives.law_field[rows]] + within
        followed = np.zeros((len(drives.law_gain), again.transduction.size))
        np.add.at(followed, (rows, columns), drives.law_weight[: len(rows)])
        self.record = StepConstants(
            free=free,
            moves=moves,
            mass=mass + of_fluid,
            coupling=_list(0, coupling),
            damped=damped,
            drag=drag - damped * of_fluid,
            strips=_list(0, self.strips),
            channel=np.repeat(drives.field_channel, np.diff(drives.field_first)),
            followed=followed,
        )

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

    def _strains_seen(self, again: StepAgain) -> list[Array]:
        """Return the unknowns on which each viscous strain depends; none for others."""
        strands, bonds = again.problem.strands, again.problem.bonds
        joints = strands.joint_a, strands.joint_b
        edges = [
            [e, *(joints[s][k] for k in self.bending.get(e, ()) for s in range(2))] for e in range(strands.edge_count)
        ]
        edges += [[a, b] for a, b in zip(*joints, strict=True) for _ in range(3)]
        more: list[Sequence[int]] = [()] * len(edges)
        for joint, nodes in zip(bonds.joint, bonds.node, strict=True) if len(bonds.joint) else ():
            edges, more = edges + 3 * [[joints[0][joint], joints[1][joint]]], more + 3 * [nodes]
        seen = [np.zeros(0, dtype=int)] * self.strains
        for k in np.flatnonzero(self.viscous > 0.0):
            seen[k] = self._unknowns(again, edges[k], more[k])
        return seen

    def _laws_seen(self, again: StepAgain) -> list[Array]:
        """Return the unknowns whose gradient depends on the eigenstrain of each law: those of edges and joints that it
        drives and of the edges next to them; all for multiples of moduli.
        """
        strands, drives, flattening = again.problem.strands, again.problem.drives, again.problem.flattening
        joints = np.stack([strands.joint_a, strands.joint_b], axis=1)
        next_to: dict[int, set[int]] = {}
        for a, b in joints.tolist():
            next_to.setdefault(a, {a}).add(b)
            next_to.setdefault(b, {b}).add(a)
        of_row = np.concatenate([np.arange(len(joints)), flattening.joint])
        seen = []
        for law in range(len(drives.law_gain)):
            rows = drives.driven_joint[drives.driven_joint_law == law]
            if len(rows) and rows.max() >= len(of_row):
                seen.append(np.arange(self.size))
                continue
            driven = {*drives.driven_edge[drives.driven_law == law].tolist(), *joints[of_row[rows]].ravel().tolist()}
            near = set().union(*(next_to.get(e, {e}) for e in driven))
            seen.append(self._unknowns(again, near))
        return seen

    def _unknowns(self, again: StepAgain, edges: Iterable[int], more: Iterable[int] = ()) -> Array:
        """Return the unknowns of edges, of which the last ones are clamps, and of more nodes."""
        strands, constrained = again.problem.strands, again.problem.constrained
        inner = sorted({e for e in edges if e < strands.edge_count})
        nodes = {n for e in inner for n in (strands.edge_node[e], strands.edge_node[e] + 1)} | set(more)
        clamped = again.problem.bodies.free_index[constrained.clamp_edge_body]
        bodies = {self.holder[n] for n in nodes if n in self.holder}
        bodies |= {clamped[e - strands.edge_count] for e in edges if e >= strands.edge_count}
        held = again.of_bodies[sorted(bodies - {-1})]
        parts = self.nodes[sorted(nodes - set(self.holder))], strands.edge_unknown[inner], held
        return np.concatenate([part.ravel() for part in parts]).astype(int)

    def strains_of(self, row: Array, column: Array, force: Array) -> Entries:
        """Return changes of strains that resist with some forces."""
        shape = self.strains, self.size
        if self.apart is None:
            return Entries(row, column, force / self.viscous[row], shape)
        from scipy import sparse

        found = (self.apart @ sparse.csr_matrix((force, (row, column)), shape)).tocoo()
        return Entries(found.row.astype(np.int64), found.col.astype(np.int64), found.data, shape)


def _coloured(seen: Sequence[Array]) -> tuple[Array, int, tuple[Array, Array]]:
    """Return colours of what sees some unknowns, −1 where it sees none, such that those of one colour share no unknown,
    how many there are, and each of them with each unknown that it sees.
    """
    colour, taken = np.full(len(seen), -1), [set[int]()][:0]
    for k, own in enumerate(seen):
        if not len(own):
            continue
        unknowns = set(own.tolist())
        colour[k] = next((g for g, others in enumerate(taken) if others.isdisjoint(unknowns)), len(taken))
        if colour[k] == len(taken):
            taken.append(set())
        taken[colour[k]] |= unknowns
    which = np.repeat(np.arange(len(seen)), [len(own) for own in seen])
    return colour, len(taken), (which, np.concatenate([np.zeros(0, dtype=int), *seen]))


class StageRates:
    """Linear maps of a stage of a step, beside those of `StepAgain`."""

    def __init__(self, constants: Constants, follower: Followed, again: StepAgain, entries: int):
        problem, stages = again.problem, len(again.guesses)
        strains, laws, modes = constants.strains, len(again.laws), len(again.transduction)
        bodies, held = len(problem.bodies.mass), len(problem.constrained.node)
        wet = again.wet and (again.wet + 64) * (bodies * 6 + 64)
        self.elastic = ElasticMaps(
            strains=StrainMap(viscous=_list(entries), directors=np.zeros((len(problem.raised.edge), 3, 7))),
            fluid=FluidMap(by_place=_list(wet), by_speed=_list(wet)),
            resistance=np.zeros(strains),
            by_law=_list(0, constants.by_law),
            law_slope=np.zeros(laws),
            law_by_gain=np.zeros(laws),
            by_reached=_list(modes * modes if problem.varied_fields.exists else 0),
            by_place=_list(modes * again.size if problem.light.exists else 0),
            by_kept=_list(2 * modes if problem.light.exists else 0),
            lag=np.zeros((3, len(constants.record.channel))),
        )
        one = {name: np.zeros((bodies, 3, 3)) for name in ("before", "end", "first", "beyond")}
        one |= {f"{of}_by_{by}": np.zeros((bodies, 3, 3)) for of in ("ahead", "rate") for by in ("turn", "spin")}
        one |= {f"held_{name}": np.zeros((held, 3, 3)) for name in ("by_turn", "by_spin", "ahead")}
        one |= {name: np.zeros((stages, bodies, 3, 3)) for name in ("gain", "turned")}
        self.bodies = BodyMaps(**one, history=np.zeros((3, bodies, 3, 3)), motion=np.zeros((bodies, 6)))
        self.differences = StrainDifferences(
            by_law=self.elastic.by_law,
            law_colour=constants.law_colour,
            by_laws=np.zeros((constants.law_colours, again.size)),
            own=np.zeros(laws),
            colour=constants.colour,
            by_strain=np.zeros((constants.colours, again.size)),
        )


class StageDerivatives:
    """Makes the linear maps of stages of a model, of which `again` is at the end."""

    def __init__(self, model: Model, agains: Sequence[StepAgain]):
        again = agains[0]
        self.constants = Constants(model, again)
        self.follower = Followed(model, again)
        self._resisted, self._damped = "joint friction" in model.forces, "restitution" in model.forces
        apart = self.constants.apart
        entries = len(self.constants.seen[0]) if apart is None else apart.nnz * again.size
        entries += 12 * (len(again.problem.mechanisms.slides) + len(again.problem.restitution.rate))
        self.stages = [StageRates(self.constants, self.follower, of, entries) for of in agains]
        self.start = StageRates(self.constants, self.follower, again, entries)

    def write_start(self, again: StepAgain, step: KeptStep) -> None:
        """Write the maps of the start of a step."""
        self._write_strains(again, again.places[0], self.start)
        if again.wet:
            rates = step.start.strain_rate[self.constants.raised_rows]
            self._write_momentum(again, again.places[0], step.start.velocity, rates, self.start)

    def _write_strains(self, again: StepAgain, at: Configuration, found: StageRates) -> None:
        """Write ∂σ/∂q at a configuration."""
        constants, strains = self.constants, found.elastic.strains
        strains.viscous.count[0] = 0
        if self._resisted:
            append(strains.viscous, slopes_of_motions(again, at))
        if self._damped:
            append(strains.viscous, slopes_of_gaps(again, at))
        if constants.colours:
            again.differentiate_by_strains(at, found.differences, STRAIN)
            which, seen = constants.seen
            value = -again.stage.length * found.differences.by_strain[constants.colour[which], seen]
            append(strains.viscous, constants.strains_of(which, seen, value))
        write_directors(again.problem, at, strains)

    def _write_momentum(
        self, again: StepAgain, at: Configuration, velocity: Array, director_rate: Array, found: StageRates
    ) -> None:
        """Write how the fluid's momentum depends on a configuration and on velocities."""
        by_place, by_speed = self.follower.momentum(again, at, velocity, director_rate)
        _put(found.elastic.fluid.by_place, by_place)
        _put(found.elastic.fluid.by_speed, by_speed)

    def write(self, again: StepAgain, n: int, step: KeptStep, lit: Array) -> None:
        """Write the maps of stage n of a step; what its Hessian lacks by forces that follow, and how light at its start
        depends on places, are known.
        """
        found, stage, at = self.stages[n], again.stage, again.places[n + 1]
        self._write_strains(again, at, found)
        if len(again.laws):
            again.differentiate_by_laws(at, found.differences, STRAIN)
        again.write_body_maps(n, found.bodies)
        if self._resisted:
            found.elastic.resistance[:] = resistances(again)
        if again.wet:
            raised, velocity = again.problem.raised, (at.position - stage.origin_position) / stage.length
            turned = at.director1[raised.edge] - stage.origin_strain[self.constants.raised_rows]
            self._write_momentum(again, at, velocity, turned / stage.length, found)
            again.follow(at)
        while True:
            if self.constants.in_space:
                ways = again.places[n], again.guesses[n], at, stage
                differentiate_turns(again.problem, again.maps, *ways, again.lacks)
                again.lacks = True
            if self._damped:
                for matrix, entries in zip(
                    (again.maps.by_strain, again.maps.by_kept), by_impacts(again, at), strict=True
                ):
                    append(matrix, entries)
            if not again.overfull:
                break
            self.follower.write(again, n)
        drives, laws, elastic, followed = (
            again.problem.drives,
            again.laws,
            found.elastic,
            self.constants.record.followed,
        )
        if len(laws):
            slope = 1.0 - (laws / drives.law_saturation) ** 2
            elastic.law_slope[:] = slope * drives.law_gain
            elastic.law_by_gain[:] = slope * (followed @ again.transduction - drives.law_reference)
        write_reached(again, n, step, lit, elastic)

    def release(self, again: StepAgain) -> tuple[Entries, Entries, Entries, Array]:
        """Return how the fluid's momentum at the end of a step beyond its last stage depends on places and on
        velocities, and for the rest of it, the velocities that it adds, shape (size, wet), and 1 where it is kept.

        m w + P(q, v + w) is the momentum that the step has, P(q, v) affine in v: its derivative is that at v + w.
        """
        gained, _ = again.release()
        fluid, constants = again.problem.fluid, self.constants
        freed, kept = fluid.inertia[:, 0, 0] != HELD, np.ones(again.wet)
        inverse = np.linalg.inv(np.where(freed[:, None, None], fluid.inertia, np.eye(3))) * freed[:, None, None]
        kept[constants.nodes[freed]] = 0.0
        joined = fluid.joined[freed[fluid.joined].all(axis=1)]
        own = np.arange(len(freed))
        node, other = np.concatenate([np.stack([own, own], axis=1), joined, joined[:, ::-1]]).T
        row, column = np.repeat(constants.nodes[node], 3, axis=1), np.tile(constants.nodes[other], 3)
        shape = constants.size, again.wet
        released = Entries(row.ravel(), column.ravel(), inverse[node].ravel(), shape)
        ended = again.ended
        rates = ended.strain_rate[constants.raised_rows]
        by_place, by_speed = self.follower.momentum(again, again.last, ended.velocity + gained, rates)
        return by_place, by_speed, released, kept

    def write_beyond(self, again: StepAgain, n: int, step: KeptStep, lit: Array) -> None:
        """Write the maps of the end of a step beyond its last stage, its point n."""
        found, at = self.stages[n], again.places[n + 1]
        again.write_body_maps(n, found.bodies)
        write_last_way(again.problem, again.maps, again.places[n], at)
        write_reached(again, n, step, lit, found.elastic)

    def light(self, again: StepAgain, at: Configuration) -> Array:
        """Return how what elements see of light depends on places, shape (2 n_lit, size)."""
        if not again.problem.light.exists:
            return np.zeros((0, self.constants.size))
        return slopes_of_light(again, at)
