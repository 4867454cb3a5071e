"""How forces that follow the configuration change the derivatives of a stage: friction, drag, loads that turn.

In Newton's method they hold fixed what they took from the configuration, and the Hessian knows nothing of that. A stage
ends where what they took is that of the end. So its matrix lacks ∂g/∂z ∂z/∂q, with z what they take, and its gradient
depends on the origin of the stage by velocities. Drag and friction on surfaces are differentiated element by element
(`engine.stage_maps`, `engine.friction_differences`). Of other forces both are differences of the gradient: unknowns
that no row sees together change at once, and those of rods that touch one by one.
"""

from __future__ import annotations

import math

import numpy as np

from bilayer_core.engine.friction_differences import differentiate_friction
from bilayer_core.engine.gradient_differences import Differences, differentiate_followed, differentiate_momentum
from bilayer_core.engine.linear.lacking_matrix import LackingMatrix
from bilayer_core.engine.stage_maps import clear_maps, differentiate_drag, differentiate_other_drag
from bilayer_core.forces.body_drag import body_flow_of
from bilayer_core.forces.friction_change import FrozenChange
from bilayer_core.forces.turning_drag import turning_flow_of
from bilayer_core.model.force_slots import NAMES
from bilayer_core.model.model import Model
from bilayer_core.model.records.step import Configuration
from bilayer_core.simulation.gradients.entries import Entries
from bilayer_core.simulation.gradients.step_again import PRESSING, StepAgain

Array = np.ndarray
BY_DIFFERENCES = ("added mass", "followers", "moments", "rod friction")
REACH = 2
"""Nodes along a strand over which such a force at one depends on another."""
FINE = 1e-5
"""Of the slip within which friction rests, of the smallest gap, and of a tenth of an edge: steps of differences."""
SLIP = 1e-3
"""Likewise, where contacts are spread, which has kinks."""
SEEN = 14
"""Unknowns that a contact of a rod sees, at most: those of four nodes and two turns."""
ORIGIN = ("origin_position", "origin_angle", "origin_strain")
"""Parts of a stage that are moved."""


def _rounded(h: float) -> float:
    """Return a step, at most h, which positions take without rounding."""
    return 2.0 ** math.floor(math.log2(h))


def _room_for(places: int) -> FrozenChange:
    """Return changes of a contact, or of its places."""
    shapes = {"rate": (3, 8)} | {name: (3,) for name in ("normal", "axis", "slip", "arm", "lever")}
    return FrozenChange(
        **{name: np.zeros((places, *shapes.get(name, ()))) for name in ("load", "smooth", *shapes)},
    )


def append(matrix: LackingMatrix, entries: Entries) -> None:
    """Add entries beside the band of a matrix, as far as there is room."""
    first, last = int(matrix.count[0]), int(matrix.count[0]) + len(entries.row)
    if last <= len(matrix.row):
        for name in ("row", "column", "value"):
            getattr(matrix, name)[first:last] = getattr(entries, name)
    matrix.count[0] = last


class Followed:
    """Derivatives of the forces of a model that follow the configuration."""

    def __init__(self, model: Model, again: StepAgain):
        problem, moments = again.problem, again.problem.moments
        turning = moments.exists and moments.dead < len(moments.body)
        self._ways, self._change = np.ascontiguousarray(problem.strands.axes), FrozenChange.absent()
        self._flows = turning_flow_of(model), body_flow_of(model)
        self._drag = problem.flow.exists and "drag" in model.forces
        self._forces = [name for name in BY_DIFFERENCES if name in model.forces and (turning or name != "moments")]
        self._otherwise = not set(self._forces) <= {"rod friction"}
        strands, nodes = problem.strands, len(again.of_nodes)
        self._shortest = float(strands.rest_length.min())
        self._turns = problem.space.exists
        if not self._forces:
            return
        pressing = [name for name in PRESSING if name in model.forces]
        self._pressing, self._following = (
            np.array([name in chosen for name in NAMES]) for chosen in (pressing, self._forces)
        )
        self._reach = REACH
        self._count = 2 * self._reach + 1
        self._first = strands.edge_node[: len(again.of_edges)]
        self._colours, self._edge_colours = np.arange(nodes) % self._count, self._first % self._count
        self._shape, self._plain = (again.size, again.size), None
        strand = np.zeros(nodes, dtype=int)
        strand[1:] = np.cumsum(~np.isin(np.arange(nodes - 1), self._first))
        station = [(again.of_nodes[i], again.of_edges[self._first == i]) for i in range(nodes)]
        entries: list[tuple[int, int, int]] = []  # row of differences, row and column of the matrix
        for i in range(nodes):
            near = [
                j for j in range(max(i - self._reach, 0), min(i + self._reach + 1, nodes)) if strand[j] == strand[i]
            ]
            seen, colour = np.concatenate([part for j in near for part in station[j]]), i % self._count
            for c in range(3):
                entries += [(3 * colour + c, row, again.of_nodes[i, c]) for row in seen]
            for unknown in station[i][1] if self._turns else ():
                entries += [(3 * self._count + colour, row, unknown) for row in seen]
        raised, of_directors = again.problem.raised, [(0, 0, 0)][:0]
        self._raised = len(raised.edge) > 0 and "added mass" in model.forces
        for edge, slot in zip(raised.edge, raised.slot, strict=True) if self._raised else ():
            i = self._first[edge]
            near = [
                j for j in range(max(i - self._reach, 0), min(i + self._reach + 2, nodes)) if strand[j] == strand[i]
            ]
            for row in np.concatenate([part for j in near for part in station[j]]):
                of_directors += [(3 * (i % self._count) + c, row, raised.first + 3 * slot + c) for c in range(3)]
        self._of_directors = [of.copy() for of in np.array(of_directors, dtype=np.int64).reshape(-1, 3).T]
        self._from, self._row, self._column = (of.copy() for of in np.array(entries, dtype=np.int64).T)

    def write(self, again: StepAgain, n: int) -> None:
        """Write ∂g/∂z ∂z/∂q where stage n ended, and ∂g by the origin of the stage: forces on all nodes."""
        while True:
            clear_maps(again.maps)
            again.lacks = self._write(again, n)
            if not again.overfull:
                return

    def _write(self, again: StepAgain, n: int) -> bool:
        """Write them as far as there is room; return whether there is something that the Hessian lacks."""
        problem, stage, at, maps = again.problem, again.stage, again.places[n + 1], again.maps
        sliding = problem.sliding.exists and problem.sliding.count[0] > 0
        rubbing = problem.rod_contact.exists and problem.rod_contact.sliding.count[0] > 0
        if self._drag:
            differentiate_drag(problem, problem.flow, maps, at, stage)
        if any(flow.exists for flow in self._flows):
            differentiate_other_drag(problem, *self._flows, maps, at, stage)
        if problem.moments.exists:
            self._add_moments(again, at)
        if sliding:
            if len(self._change.load) < SEEN * (len(problem.sliding.load) + 1):
                self._change = _room_for(SEEN * (len(problem.sliding.load) + 1))
            far = min(0.1 * FINE * self._shortest, FINE * again.gap)
            steps = _rounded(far), _rounded(min(far, SLIP * problem.sliding.threshold * stage.length))
            matrices = self._change, maps.lacking, maps.by_origin, maps.slides
            differentiate_friction(problem, at, again.spare, stage, *steps, *matrices)
        if rubbing or self._otherwise:
            found = self._by_differences(again, at, rubbing)
            for matrix, entries in zip((maps.lacking, maps.by_origin, maps.by_strain), found, strict=True):
                append(matrix, entries)
        return self._drag or sliding or rubbing or self._otherwise

    @staticmethod
    def _add_moments(again: StepAgain, at: Configuration) -> None:
        """Add what moments on bodies are by turns of R̃ (`forces.loads`): those of −½ [M]× [e]× R̃ Rᵀ."""
        moments, rows = again.problem.moments, again.of_bodies
        for f, m in zip(moments.body, moments.present, strict=True):
            turn = again.stage.predicted_body_rotation[f] @ at.body_rotation[f].T
            for c in range(3):
                change = -0.5 * (np.outer(np.eye(3)[c], m) - m[c] * np.eye(3)) @ turn
                value = (change - change.T)[[2, 0, 1], [1, 2, 0]]
                shape = again.size, 6 * len(rows)
                append(again.maps.slides, Entries(rows[f, 3:], np.full(3, 6 * f + c), value, shape))

    def _by_differences(self, again: StepAgain, at: Configuration, rubbing: bool) -> tuple[Entries, ...]:
        """Return them for forces without elements of their own, and by strains at the origin, by differences."""
        problem, stage = again.problem, again.stage
        h, alone = 0.1 * FINE * self._shortest, np.zeros(0, dtype=np.int64)
        if rubbing:
            h = min(h, FINE * problem.rod_contact.threshold * stage.length, FINE * again.gap)
            alone = self._near(problem.rod_contact.sliding.node[: problem.rod_contact.sliding.count[0]].ravel())
        colour, edge_colour = self._colours.copy(), self._edge_colours.copy()
        colour[alone] = self._count + np.arange(len(alone))
        edges = np.flatnonzero(np.isin(self._first, alone))
        edge_colour[edges] = self._count + np.arange(len(edges))
        if len(alone):
            found = self._differences(again, colour, edge_colour)
        else:
            found = self._plain = self._plain or self._differences(again, colour, edge_colour)
        colours = self._count + len(alone)
        kept = [getattr(stage, name) for name in ORIGIN]
        before = [part.copy() for part in kept]
        differentiate_followed(problem, found, at, again.spare, stage, _rounded(h))
        for part, values in zip(kept, before, strict=True):
            part[...] = values
        apart = again.of_nodes[alone].ravel(), again.of_edges[edges]
        rods = len(found.by_origin)
        by_place = self._entries(found.by_place[:rods], colours, apart)
        by_place = by_place.beside(found.by_place[rods:], again.of_bodies.ravel())
        by_strain = self._by_director(again, found.by_director, edges)
        return by_place, self._entries(found.by_origin, colours, apart), by_strain

    def _by_director(self, again: StepAgain, rows: Array, edges: Array) -> Entries:
        """Return differences by directors of raised edges as a matrix; some edges changed apart from others."""
        raised, size = again.problem.raised, again.size
        if not self._raised:
            nothing = np.zeros(0, dtype=np.int64)
            return Entries(nothing, nothing, np.zeros(0), (size, again.stage.origin_strain.size))
        place, row, column = self._of_directors
        alone = np.flatnonzero(np.isin(raised.edge, edges))
        value = rows[place, row]
        of_alone = (raised.first + 3 * raised.slot[alone, None] + np.arange(3)).ravel()
        value[np.isin(column, of_alone)] = 0.0
        own = 3 * (self._count + np.searchsorted(edges, raised.edge[alone]))[:, None] + np.arange(3)
        found = Entries(row, column, value, (size, again.stage.origin_strain.size))
        return found.beside(rows[own.ravel()], of_alone)

    def _differences(
        self, again: StepAgain, colour: Array, edge_colour: Array, width: int | None = None
    ) -> Differences:
        """Return arrays for differences by unknowns of these colours."""
        colours = max(self._count, int(colour.max()) + 1)
        rows = colours * len(self._ways) + (max(self._count, int(edge_colour.max()) + 1) if self._turns else 0)
        bodies = again.of_bodies.size
        return Differences(
            colours=colours,
            ways=self._ways,
            node_colour=colour,
            edge_colour=edge_colour,
            by_place=np.zeros((rows + bodies, width or again.size)),
            by_origin=np.zeros((rows, again.size)),
            by_director=np.zeros((3 * (int(edge_colour.max()) + 1) if self._raised else 0, again.size)),
            pressing=self._pressing,
            following=self._following,
        )

    def _near(self, nodes: Array) -> Array:
        """Return nodes that see some, or the next ones after them."""
        near = nodes[:, None] + np.arange(-self._reach, self._reach + 2)
        return np.intersect1d(near, np.append(self._first, self._first + 1))

    def _entries(self, rows: Array, colours: int, apart: tuple[Array, Array]) -> Entries:
        """Return differences as a matrix, with columns of nodes and of edges that changed apart from others."""
        columns, of_nodes, of_edges = self._columns(rows, colours)
        value = columns[self._from, self._row]
        if not len(apart[0]):
            return self._filled(value)
        value[np.isin(self._column, np.concatenate(apart))] = 0.0
        found = self._filled(value)
        return found.beside(of_nodes[3 * self._count :], apart[0]).beside(of_edges[self._count :], apart[1])

    def _columns(self, rows: Array, colours: int) -> tuple[Array, Array, Array]:
        """Return differences by the colours of nodes along axes and by those of edges: of unknowns that change
        together, and of all nodes, and of all edges.
        """
        size, ways = rows.shape[1], self._ways
        of_nodes = rows[: colours * len(ways)].reshape(colours, len(ways), size)
        of_nodes = (ways.T @ of_nodes).reshape(3 * colours, size)
        of_edges = rows[colours * len(ways) :]
        return np.concatenate([of_nodes[: 3 * self._count], of_edges[: self._count]]), of_nodes, of_edges

    def _filled(self, value: Array) -> Entries:
        """Return the matrix with entries that are not 0."""
        kept = np.flatnonzero(value)
        return Entries(self._row[kept], self._column[kept], value[kept], self._shape)

    def momentum(
        self, again: StepAgain, at: Configuration, velocity: Array, director_rate: Array
    ) -> tuple[Entries, Entries]:
        """Return how the fluid's momentum depends on a configuration, and on velocities and rates of strains, shapes
        (wet, size), (wet, size + n_strain).
        """
        fluid, raised, size, nodes = again.problem.fluid, again.problem.raised, again.size, again.of_nodes
        fluid.node_velocity[:], fluid.director_rate[:] = velocity, director_rate
        found = self._differences(again, self._colours, self._edge_colours, again.wet)
        differentiate_momentum(again.problem, found, at, again.spare, again.stage, 0.1 * FINE * self._shortest)
        first, second = (of[: len(fluid.mass), :, None] for of in (at.director1, at.director2))
        halves = 0.5 * fluid.mass[:, 0, None, None] * first * first.swapaxes(1, 2)
        halves += 0.5 * fluid.mass[:, 1, None, None] * second * second.swapaxes(1, 2)
        off, count = np.flatnonzero(fluid.raised >= 0), again.stage.origin_strain.size
        own = size + 3 * raised.slot[fluid.raised[off], None] + np.arange(3)
        middle = fluid.middle[fluid.raised[off], None, None]
        turning, lifted = own + raised.first, middle * halves[off]
        parts = [(own, turning, 2.0 * middle * lifted)]
        for end in range(2):
            node = nodes[fluid.edge_node + end]
            parts += [(node, node, halves), (own, node[off], lifted), (node[off], turning, lifted)]
        row = np.concatenate([np.repeat(of, 3, axis=1).ravel() for of, _, _ in parts])
        column = np.concatenate([np.tile(of, 3).ravel() for _, of, _ in parts])
        value = np.concatenate([of.ravel() for _, _, of in parts])
        rods, bodies = len(found.by_origin), again.of_bodies.ravel()
        columns = self._columns(found.by_place[:rods], self._count)[0]
        places = np.concatenate([(self._from, self._row, self._column), self._of_kept(again)], axis=1)
        by_place = Entries(places[1], places[2], columns[places[0], places[1]], (again.wet, size))
        by_place = by_place.beside(found.by_place[rods:], bodies)
        return by_place, Entries(row, column, value, (again.wet, size + count))

    def _of_kept(self, again: StepAgain) -> Array:
        """Return rows of differences, rows and columns of what momenta of kept directors depend on, shape (3, n)."""
        raised, found = again.problem.raised, [(0, 0, 0)][:0]
        for edge, slot in zip(raised.edge, raised.slot, strict=True):
            i = self._first[edge]
            for row in again.size + 3 * slot + np.arange(3):
                found += [(3 * (j % self._count) + c, row, again.of_nodes[j, c]) for j in (i, i + 1) for c in range(3)]
                if self._turns:
                    found.append((3 * self._count + i % self._count, row, again.of_edges[edge]))
        return np.array(found, dtype=np.int64).reshape(-1, 3).T
