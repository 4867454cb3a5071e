"""From a model to the arrays of compiled loops, and from their results back to the stepper's objects."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..model.layout import columns
from ..model.model import Model, PointLoads
from ..model.state import State
from ..solve.band import width
from ..solve.configuration import Configuration
from ..solve.neighbours import Neighbours
from ..solve.newton import NewtonReport, NewtonStatus
from ..solve.newton_matrix import NewtonMatrix
from ..solve.planar_matrix import PlanarMatrix
from ..solve.potential import IncrementalPotential
from ..solve.rod_contact import LARGEST_MARGIN, RodContact
from .arrays import (
    Bodies,
    Bonds,
    Border,
    Course,
    Drives,
    Flow,
    Fluid,
    Grips,
    Held,
    Method,
    Moments,
    OffAxis,
    Place,
    Plane,
    Point,
    PointForces,
    Problem,
    Sliding,
    Space,
    Stage,
    StateArrays,
    Strands,
    Sums,
    Surfaces,
    System,
    Tally,
    Threads,
    Work,
)
from .newton import BLOCKED, CONVERGED, INDEFINITE, LINE_SEARCH, MAX_ITERATIONS, NOT_FINITE
from .potential import NO_ROOM, RODS_FAR, TERMS
from .step import count_step, take_steps

Array = np.ndarray
FAILURES = {
    MAX_ITERATIONS: NewtonStatus.MAX_ITERATIONS,
    LINE_SEARCH: NewtonStatus.LINE_SEARCH,
    INDEFINITE: NewtonStatus.INDEFINITE,
    NOT_FINITE: NewtonStatus.NOT_FINITE,
    BLOCKED: NewtonStatus.BLOCKED,
}


class Engine:
    """Compiled steps of a model, sharing arrays with a potential and three configurations.

    Attributes
    ----------
    touched : Array
        Carriers that something pushed at the end of the last step, bool, shape (n_carrier,).
    figures, nodes, most_nodes, first_contact : Array
        Extremes of the run; see `march.arrays.Tally`.
    """

    def __init__(self, model: Model, potential: IncrementalPotential, places: list[Configuration], keeps_slopes: bool):
        self._model, self._potential, self._keeps = model, potential, keeps_slopes
        self._energy = np.zeros(len(TERMS))
        self._groups = _lasting_groups(model, potential)
        self._problem: Problem | None = None
        self._lists: tuple | None = None
        self._state: State | None = None
        self._ranges = np.array([c.maximum - c.minimum for c in model.scene.stimuli.values()], dtype=float)
        self._wanted, self._wanted_move = np.zeros((model.node_count, 3)), np.zeros(1)
        self.figures = np.zeros(3)
        self.nodes, self.most_nodes = np.zeros((2, len(model.surfaces.names)), dtype=np.int64)
        self.first_contact = np.zeros(len(model.surfaces.names))
        self.tally = Tally.of(
            mass_moment=model.mass_moment,
            mass=float(model.node_mass.sum()),
            figures=self.figures,
            nodes=self.nodes,
            most_nodes=self.most_nodes,
            first_contact=self.first_contact,
        )
        self.start_over(-math.inf)
        self.touched = np.zeros(len(model.carriers.weight), dtype=bool)
        self._work = _work(model, places, self.touched)

    def start_over(self, height: float) -> None:
        """Forget the extremes of the run; the mass centre is at `height` [m]."""
        self.figures[:] = height, math.inf, 0.0
        self.nodes[:], self.most_nodes[:], self.first_contact[:] = 0, 0, math.nan

    def _gather(self) -> Problem:
        """The problem with the present lists of near pairs."""
        near, rods = self._potential.near, self._potential.matrix.rods
        lists = near.carrier if near else None, rods.listed if rods else None
        if self._lists is None or any(a is not b for a, b in zip(lists, self._lists, strict=True)):
            room = len(near.carrier) if near else 0
            self._problem = Problem.of(
                **self._groups,
                surfaces=_surfaces(self._model, near) if near else None,
                sliding=_sliding(self._model, room) if near else None,
                threads=_threads(self._model, rods, self._wanted, self._wanted_move) if rods else None,
                sums=_sums(self._model, self._potential, self._energy, 2 * room),
            )
            self._lists = lists
        return self._problem

    def _arrays_of(self, state: State) -> StateArrays:
        if state is not self._state:
            self._state = state
            self._state_arrays = StateArrays.of(**{name: getattr(state, name) for name in StateArrays.fields})
        return self._state_arrays

    def march(self, state: State, method: Method, course: Course, h: float, settings: Settings) -> MarchReport:
        """Make the steps of a course, each of length `h` [s], as far as they succeed; `state` is that after them."""
        arrays = self._arrays_of(state)
        ways = settings.changes, course, self._ranges, self._work, settings.counts, self.tally
        done, status, pair, place, iterations, factorisations, backtracks, residual, worst, gap = take_steps(
            self._gather(), arrays, method, self._keeps, *ways, h, settings.tolerance, settings.max_iterations
        )
        if status == CONVERGED or status in FAILURES:
            self._potential.take_over(dict(zip(TERMS, self._energy.tolist(), strict=True)), gap)
        return MarchReport(
            done,
            FAILURES.get(status),
            status,
            place,
            pair,
            NewtonReport(
                FAILURES.get(status, NewtonStatus.CONVERGED), iterations, factorisations, residual, backtracks
            ),
            worst,
        )

    def make_room(self, status: int, times: int) -> bool:
        """Do what a loop asked for, the n-th of `times`, before it can go on; false if it cannot: rods touch, or
        something has jumped.
        """
        if status == NO_ROOM:
            self._potential.near.grow()
        elif status == RODS_FAR:
            self._potential.matrix.rods.list_about(self._wanted, 2.0**times * float(self._wanted_move[0]))
        else:
            return False
        return True

    def count_in(self, state: State, gap: float) -> None:
        """Take the end of a step that no loop has made into the tally."""
        p = self._gather()
        count_step(p, self._arrays_of(state), gap, float(state.time[0]), self.tally)


@dataclass(frozen=True)
class Settings:
    """How a loop goes about its steps.

    Attributes
    ----------
    tolerance : float
        Of Newton [m/s].
    max_iterations : int
    changes : bool
        Whether a jump ends the loop, because another integrator has to step in.
    counts : bool
        Whether steps are taken into the tally.
    """

    tolerance: float
    max_iterations: int
    changes: bool
    counts: bool


@dataclass(frozen=True)
class MarchReport:
    """How a loop ended.

    Attributes
    ----------
    done : int
        Number of steps made.
    failure : NewtonStatus or None
        Why the next one failed.
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
    """

    done: int
    failure: NewtonStatus | None
    status: int
    place: int
    pair: int
    newton: NewtonReport
    largest_residual: float

    @property
    def finished(self) -> bool:
        """Whether all steps were made."""
        return self.status == CONVERGED


def _lasting_groups(model: Model, potential: IncrementalPotential) -> dict[str, Any]:
    """The groups of a problem that stay as they are."""
    layout, matrix, scene = model.solved_layout, potential.matrix, model.scene
    bodies, free, plane = model.bodies, len(model.bodies.mass), model.plane
    b, n = layout.half_bandwidth, bodies.freedom.shape[1]
    return dict(
        gravity=np.array(scene.gravity, dtype=float),
        damping=float(scene.damping.mass),
        strands=Strands.of(
            size=layout.size,
            dimension=layout.dimension,
            edge_count=model.edge_count,
            first_bend=0,
            bend_count=model.bend_count,
            bandwidth=width(b),
            axes=model.directions,
            row=layout.node,
            node_unknown=model.layout.node,
            edge_unknown=model.layout.edge,
            **{name: getattr(model, name) for name in Strands.fields[10:]},
        ),
        drives=Drives.of(**{name: getattr(model, name) for name in Drives.fields}),
        space=_space(model, matrix) if plane is None else None,
        plane=_plane(model, matrix) if plane is not None else None,
        off_axis=None if len(model.pair_top) else _off_axis(model),
        bonds=(
            Bonds.of(top=model.pair_top, bottom=model.pair_bottom, stiffness=model.pair_stiffness, rest=model.pair_rest)
            if len(model.pair_top)
            else None
        ),
        bodies=Bodies.of(
            free_index=bodies.free_index,
            body_of_free=bodies.body_of_free,
            prescribed=np.flatnonzero(bodies.free_index[:-1] < 0),
            mass=bodies.mass,
            second_moment=bodies.second_moment,
            inertia=matrix.body_masses,
            freedom=bodies.freedom,
            reach=bodies.reach,
            turns=np.array(
                [f >= 0 or len(r) > 0 for f, r in zip(bodies.free_index, bodies.rotations, strict=False)], dtype=bool
            ),
        ),
        border=_border(layout.size + b, free, n) if free else None,
        held=_held(model),
        grips=_grips(model) if free else None,
        flow=_flow(model) if scene.fluid is not None else None,
        fluid=_fluid(model) if scene.fluid is not None else None,
        loads=_forces(model, model.dead_loads) if scene.loads else None,
        followers=_forces(model, model.follower_loads) if scene.loads else None,
        moments=_moments(model) if scene.loads else None,
        system=System.of(
            band=np.zeros((layout.size + b, b + 1)),
            right=np.zeros(layout.size + b),
            step=np.zeros(model.layout.size),
            body_step=np.zeros((free, 6)),
            node_step=np.zeros((model.node_count, 3)),
            motion=np.zeros((len(bodies.names) + 1, 6)),
        ),
    )


def _space(model: Model, matrix: NewtonMatrix) -> Space:
    return Space.of(
        edge_unknown=model.layout.edge,
        top_hessian=matrix.top_hessian,
        bottom_hessian=matrix.bottom_hessian,
        bond_hessian=matrix.cross_hessian[model.bend_count :],
    )


def _plane(model: Model, matrix: PlanarMatrix) -> Plane:
    names = ("frame", "polar_gradient", "polar_hessian", "mixed_hessian")
    return Plane.of(
        normal=model.plane.normal,
        side=model.plane.side,
        joint_after=model.plane.joint_after,
        **{name: getattr(matrix, name) for name in names},
        gradient=np.zeros(model.solved_layout.size),
    )


def _off_axis(model: Model) -> OffAxis:
    rest = np.zeros_like(model.joint_rest)
    return OffAxis.of(joint=model.coupled_joint, coupling=model.strain_coupling, rest_out=rest, rest=_read_only(rest))


def _read_only(array: Array) -> Array:
    """A view of the type that arrays of models have: kernels are compiled for one type only."""
    view = array.view()
    view.flags.writeable = False
    return view


def _sums(model: Model, potential: IncrementalPotential, energy: Array, links: int) -> Sums:
    out, matrix = potential.accumulators, potential.matrix
    second = ("edge_hessian", "cross_hessian", "pair_hessian")
    return Sums.of(
        energy=energy,
        first=out.all_but_carriers,
        **{name: getattr(out, name) for name in ("node", "edge", "pair", "body", "carrier", "contact")},
        gradient=potential.gradient,
        attached=potential.attached_gradient,
        second=matrix.second_derivatives,
        **{name: getattr(matrix, name) for name in (*second, "node_hessian", "body_hessian")},
        links=np.zeros(1, dtype=np.int64),
        link_node=np.zeros(links, dtype=np.int64),
        link_body=np.zeros(links, dtype=np.int64),
        link_hessian=np.zeros((links, 3, 6)),
    )


def _border(rows: int, free: int, freedom: int) -> Border:
    return Border.of(
        border=np.zeros((rows, 6 * free)),
        wide=np.zeros((rows, freedom)),
        wide_solution=np.zeros((rows, freedom)),
        corner=np.zeros((6 * free, 6 * free)),
        schur=np.zeros((freedom, freedom)),
        load=np.zeros(freedom),
        coupled=np.zeros(1, dtype=np.int64),
    )


def _grips(model: Model) -> Grips:
    return Grips.of(
        holding=int((model.attached_free >= 0).sum()),
        unknown=model.solved_layout.attached,
        free=model.attached_free,
        of_unknown=model.solved_layout.attached_of_unknown,
        wall_free=model.wall_free,
        wall_joint=model.wall_joint,
    )


def _held(model: Model) -> Held:
    return Held.of(
        node=model.attached_node,
        unknown=model.layout.attached,
        row=model.solved_layout.attached,
        body=model.attached_body,
        free=model.attached_free,
        position=model.attached_position,
        wall_body=model.wall_body,
        wall_free=model.wall_free,
        wall_tangent=model.wall_tangent,
        wall_director1=model.start_director1,
    )


def _surfaces(model: Model, near: Neighbours) -> Surfaces:
    carriers, surfaces, contact = model.carriers, model.surfaces, model.scene.contact
    return Surfaces.of(
        d_hat=contact.barrier_distance,
        stiffness=contact.stiffness,
        radius=carriers.radius,
        weight=carriers.weight,
        carrier_body=carriers.body,
        follows=carriers.follows,
        node_free=near.node_free,
        group=carriers.group,
        point_position=carriers.position,
        point_body=carriers.body[model.node_count :],
        kind=surfaces.kind,
        size=surfaces.size,
        rounding=surfaces.rounding,
        bound=surfaces.bound,
        body=surfaces.body,
        position=surfaces.position,
        turn=surfaces.turn,
        meets=surfaces.meets,
        near_carrier=near.carrier,
        near_surface=near.surface,
        near_gap=near.gap,
        near_count=near.counted,
        margin=near.margin,
        extent=near.extent,
        listed_carrier=near.listed_carrier,
        listed_place=near.listed_place,
        listed_turn=near.listed_turn,
    )


def _sliding(model: Model, room: int) -> Sliding:
    carriers, bodies, law = model.carriers, len(model.bodies.names) + 1, model.scene.contact.friction
    return Sliding.of(
        acts=law is not None and law.acts,
        threshold=law.speed_threshold if law is not None else 0.0,
        coefficient=carriers.friction,
        node_edges=carriers.node_edges,
        node_axis=carriers.node_axis,
        count=np.zeros(1, dtype=np.int64),
        first=np.zeros(room, dtype=np.int64),
        surface=np.zeros(room, dtype=np.int64),
        load=np.zeros(room),
        **{name: np.zeros((room, 3)) for name in ("normal", "axis", "arm", "lever")},
        **{name: np.zeros((bodies, 3, 3)) for name in ("back", "turn", "origin_turn")},
    )


def _threads(model: Model, rods: RodContact, wanted: Array, wanted_move: Array) -> Threads:
    pairs, surfaces, contacts = rods.pairs, model.rod_surfaces, rods.none
    return Threads.of(
        d_hat=model.scene.contact.barrier_distance,
        edge_radius=surfaces.edge_radius,
        point_edge=surfaces.point_edge,
        point_fraction=surfaces.point_fraction,
        pair_count=pairs.count,
        pair_point=pairs.point,
        pair_edge=pairs.edge,
        pair_before=pairs.before,
        pair_after=pairs.after,
        base=rods.base,
        margin=rods.margin,
        near_point=np.empty_like(pairs.point),
        near_edge=np.empty_like(pairs.edge),
        near_before=np.empty_like(pairs.before),
        near_after=np.empty_like(pairs.after),
        near_count=np.zeros(1, dtype=np.int64),
        near_base=np.zeros((model.node_count, 3)),
        near_margin=np.full(1, -1.0),
        least_margin=0.5 * rods.unit,
        largest_margin=LARGEST_MARGIN * rods.unit,
        no_step=np.zeros((model.node_count, 3)),
        wanted=wanted,
        wanted_move=wanted_move,
        point=contacts.point,
        edge=contacts.edge,
        fraction=contacts.fraction,
        inner=contacts.inner,
        times=contacts.times,
        gap=contacts.gap,
    )


def _flow(model: Model) -> Flow:
    before, after = columns(model.drag_edge)
    return Flow.of(
        velocity=np.array(model.scene.fluid.velocity),
        node=model.drag_node,
        edge_before=before,
        edge_after=after,
        coefficient=model.drag_coefficient,
        direction=np.zeros((len(model.drag_node), 3, 3)),
    )


def _fluid(model: Model) -> Fluid:
    edges, wet = model.edge_count + model.wall_count, model.node_count if len(model.fluid_mass) else 0
    return Fluid.of(
        velocity=np.array(model.scene.fluid.velocity),
        mass=model.fluid_mass,
        direction1=np.zeros((edges, 3)),
        direction2=np.zeros((edges, 3)),
        shape_gradient=np.zeros((model.edge_count, 4)),
        momentum=np.zeros((wet, 3)),
        node_velocity=np.zeros((wet, 3)),
        still=np.zeros(model.edge_count),
    )


def _forces(model: Model, loads: PointLoads) -> PointForces:
    before, after = columns(model.carriers.node_edges[loads.nodes.target])
    return PointForces.of(
        node=loads.nodes.target,
        node_load=loads.nodes.load,
        node_vector=loads.nodes.vector,
        body=loads.bodies.target,
        body_load=loads.bodies.load,
        body_vector=loads.bodies.vector,
        on_nodes=np.zeros((len(loads.nodes.target), 3)),
        on_bodies=np.zeros((len(loads.bodies.target), 3)),
        edge_before=before,
        edge_after=after,
        direction=np.zeros((len(loads.nodes.target), 3, 3)),
    )


def _moments(model: Model) -> Moments:
    dead, following = model.dead_loads.moments, model.follower_loads.moments
    body = np.concatenate([dead.target, following.target])
    return Moments.of(
        dead=len(dead.target),
        body=body,
        load=np.concatenate([dead.load, following.load]),
        vector=np.concatenate([dead.vector, following.vector]),
        present=np.zeros((len(body), 3)),
    )


def _point(model: Model) -> Point:
    nodes, edges, free = model.node_count, model.edge_count, model.free_count
    bodies, wet = len(model.bodies.names), model.node_count if len(model.fluid_mass) else 0
    return Point.of(
        position=np.zeros((nodes, 3)),
        body_position=np.zeros((bodies, 3)),
        turn=np.zeros(edges),
        velocity=np.zeros((nodes, 3)),
        spin=np.zeros(edges),
        body_velocity=np.zeros((free, 3)),
        angular_momentum=np.zeros((free, 3)),
        fluid_momentum=np.zeros((wet, 3)),
        rotation=np.zeros((bodies, 3, 3)),
    )


def _work(model: Model, places: list[Configuration], touched: Array) -> Work:
    nodes, edges, free, bodies = model.node_count, model.edge_count, model.free_count, len(model.bodies.names)
    world = np.zeros((bodies + 1, 3, 3))
    world[-1] = np.eye(3)
    rest_joint = np.zeros_like(model.joint_rest)
    return Work.of(
        places=tuple(Place.of(**dict(zip(Place.fields, place.arrays, strict=True))) for place in places),
        stage=Stage.of(
            lengths=np.zeros(2),
            origin_position=np.zeros((nodes, 3)),
            origin_turn=np.zeros(edges),
            origin_body_position=np.zeros((free, 3)),
            origin_place=np.zeros((bodies + 1, 3)),
            origin_rotation=world,
            origin_fluid_momentum=np.zeros((nodes if len(model.fluid_mass) else 0, 3)),
            predicted_position=np.zeros((nodes, 3)),
            predicted_turn=np.zeros(edges),
            predicted_body_position=np.zeros((free, 3)),
            predicted_body_rotation=np.zeros((free, 3, 3)),
            twist=np.zeros(len(model.joint_a)),
            rest_edge=np.zeros(edges),
            rest_joint_out=rest_joint,
            rest_joint=_read_only(rest_joint),
            load_factor=np.zeros(len(model.scene.loads)),
            body_turn=np.zeros((free, 3)),
        ),
        first=_point(model),
        origins=(_point(model), _point(model)),
        ends=(_point(model), _point(model)),
        turned=np.zeros(edges),
        rotation=np.zeros((bodies, 3, 3)),
        transduction=np.zeros(len(model.law_channel)),
        strain=np.zeros(len(model.law_channel)),
        touched=touched,
    )
