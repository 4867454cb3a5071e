"""The arrays of a problem, with capacity for what varies in number, and those of configurations and steps."""

from __future__ import annotations

import numpy as np

from bilayer_core.engine.build_problem import (
    contact_columns_of,
    lasting_groups,
    restitution_of,
    rod_contact_of,
    slips_of,
)
from bilayer_core.engine.capacity import (
    FIRST_POINTS,
    PAIRS_PER_POINT,
    Capacity,
    columns_for,
    contacts_for,
    rod_pairs_for,
    surface_pairs_for,
)
from bilayer_core.forces.force_register import force_table, memory_size, require_computed
from bilayer_core.forces.friction_limit import PATH_SIZE
from bilayer_core.forces.mechanisms import mechanisms_record
from bilayer_core.forces.surface_friction import MOST_PLACES, PARTS
from bilayer_core.jit import shapes_of, zeros_in_one
from bilayer_core.model.friction_pairs import friction_values
from bilayer_core.model.model import Model
from bilayer_core.model.records.contacts import ContactColumns, RodContact, RodContactList, Sliding, Slips, Surfaces
from bilayer_core.model.records.parts import Plane, Space
from bilayer_core.model.records.problem import BorderedSystem, Outcome, Problem, Sums
from bilayer_core.model.records.status import BORDER_CAPACITY_EXCEEDED, PAIR_CAPACITY_EXCEEDED, ROD_CAPACITY_EXCEEDED
from bilayer_core.model.records.step import Configuration, Point, Stage, StepAccount, Work
from bilayer_core.model.rod_surfaces import NearPairs
from bilayer_core.model.set_friction import friction_law, none_given
from bilayer_core.model.sizes import sizes_of

Array = np.ndarray
FIRST = ("node", "edge", "pair", "body", "contact_point", "contact", "pull")
"""Parts of `Sums.gradients`."""
SECOND = ("edge_hessian", "cross_hessian", "pair_hessian", "node_hessian", "body_hessian", "raised_hessian")
"""Parts of `Sums.hessians`, with those of the dimension."""
IN_SPACE = ("first_hessian", "second_hessian")
IN_PLANE = ("polar_hessian", "cross_hessian", "pair_hessian", "mixed_hessian")


class Storage:
    """Owns the arrays of a model's problem.

    Attributes
    ----------
    problem : Problem
        Another object after `grow`.
    outcome : Outcome
        What pieces leave beside the number that they return.
    sizes : dict of str to int
        As in `model.sizes`.

    Raises
    ------
    ForceError
        If the scene needs a force that nothing computes.
    """

    def __init__(self, model: Model):
        require_computed(model.forces)
        self._model, self.sizes = model, sizes_of(model)
        points = len(model.rod_search.point_edge)
        near = self.sizes["contact_point"] if model.has_surface_contact and self.sizes["surface"] else 0
        columns = model.free_bodies.freedom.shape[1] + len(model.joins.first)
        first = min(points, FIRST_POINTS)
        contacts = first // 3 if self.sizes["ribbon leg"] else first  # which take as much memory
        self._capacity = Capacity(near, contacts, contacts, columns)
        self._pairs = NearPairs(model.rod_search, PAIRS_PER_POINT * first) if points else None
        self.outcome = Outcome()
        self._width, self._memory = np.zeros(1, dtype=np.int64), np.zeros(memory_size(model))
        self._sums, of_dimension = self._lasting_sums()
        self._groups = lasting_groups(model, self.sizes) | of_dimension
        self._problem: Problem | None = None
        self._friction = none_given()  # as in `State.friction`

    def _lasting_sums(self) -> tuple[dict[str, Array], dict[str, Space | Plane]]:
        """Return the parts of `Sums` that have no capacity, and the record of the dimension.

        The hessians of the dimension are among these parts.
        """
        model, sizes = self._model, self.sizes
        declared, names = (Plane, IN_PLANE) if model.plane.exists else (Space, IN_SPACE)
        own = shapes_of(declared, sizes, names)
        first, sums = zeros_in_one(shapes_of(Sums, sizes, FIRST))
        second, parts = zeros_in_one(shapes_of(Sums, sizes, SECOND) | {("own", name): own[name] for name in names})
        sums |= {name: parts[name] for name in SECOND}
        sums |= {"gradients": first, "hessians": second, "lasting": np.zeros_like(first)}
        sums["selected"] = np.ones(sizes["force"], dtype=bool)
        of_dimension = {name: parts["own", name] for name in names}
        space = Space.absent() if model.plane.exists else Space(**of_dimension)
        return sums, {"space": space, "plane": model.plane.allocated(sizes, **of_dimension)}

    @property
    def problem(self) -> Problem:
        """Its records."""
        if self._problem is None:
            self._problem = self._make()
        return self._problem

    def _make(self) -> Problem:
        model, capacity, before = self._model, self._capacity, self._problem
        surfaces, rods = model.has_surface_contact, self._pairs is not None
        places = min(PARTS * model.node_count, MOST_PLACES) if model.sliding.spreads and capacity.near else 0
        sizes = self.sizes | {
            "near": capacity.near,
            "slide": capacity.near + places,
            "link": 2 * capacity.near + places,
            "arm": 2 * capacity.near + places + 1,
            "column": capacity.columns,
            "slip": capacity.near + places + capacity.sliding,
            "path": PATH_SIZE,
        }
        border = rods or capacity.columns > 0
        same = before is not None and surfaces and len(before.surfaces.near_contact_point) == capacity.near
        records = dict(
            **self._groups,
            bordered=BorderedSystem.zeros(sizes, width=self._width) if border else BorderedSystem.absent(),
            surfaces=Surfaces.absent() if not surfaces else before.surfaces if same else self._surfaces(sizes),
            restitution=restitution_of(model, sizes),
            mechanisms=mechanisms_record(model),
            sliding=self._sliding(before, sizes) if surfaces else Sliding.absent(),
            rod_contact=self._rod_contact(before) if rods else RodContact.absent(),
            slips=slips_of(model, sizes) if surfaces or rods else Slips.absent(),
            contact_columns=ContactColumns.absent(),
            sums=Sums.zeros(sizes, **self._sums),
            memory=self._memory,
        )
        if rods:
            records["contact_columns"] = contact_columns_of(model, sizes, capacity.contacts + capacity.sliding)
        self._sums = {
            name: getattr(records["sums"], name) for name in Sums.names if not name.startswith(("link", "arm"))
        }
        return Problem(**records, outcome=self.outcome, forces=force_table(model, records))

    def _surfaces(self, sizes: dict[str, int]) -> Surfaces:
        """Return the points and surfaces, without a list of those that are near each other yet."""
        stiffness = self._model.contact_stiffness
        return self._model.surfaces.allocated(sizes, stiffness=stiffness, margin=np.full(1, -1.0), room=np.zeros(1))

    def _sliding(self, before: Problem | None, sizes: dict[str, int]) -> Sliding:
        scene, of_model = self._model.scene, self._model.sliding
        law = friction_law(scene, self._model.forces, self._friction)
        surfaces = of_model.surface_owner, of_model.surface_grain, of_model.point_grain
        sliding = of_model.allocated(sizes, **friction_values(scene, law, *surfaces))
        if before is not None:
            _take_over(before.sliding, sliding, int(before.sliding.count[0]))
        if not sliding.acts:
            sliding.count[0] = 0
        return sliding

    def _rod_contact(self, before: Problem | None) -> RodContact:
        capacity, of_stage = self._capacity, RodContactList.zeros(self.sizes | {"contact": self._capacity.sliding})
        if before is not None:
            _take_over(before.rod_contact.sliding, of_stage, int(before.rod_contact.sliding.count[0]))
        now = RodContactList.zeros(self.sizes | {"contact": capacity.contacts})
        ways = np.array([0.0, -1.0, 0.0, -np.inf]) if before is None else before.rod_contact.ways
        last = np.zeros((self.sizes["rail"], 3)) if before is None else before.rod_contact.last
        law = friction_law(self._model.scene, self._model.forces, self._friction)
        rails = self._model.rails.allocated(self.sizes) if before is None else before.rod_contact.rails
        return rod_contact_of(
            self._model, self.sizes, self._pairs.search, rails, now, of_stage, law, ways=ways, last=last
        )

    def take_scene(self, model: Model) -> None:
        """Take another scene of the same model, whose coefficients of friction may be others."""
        before, law = (friction_law(of.scene, of.forces, self._friction) for of in (self._model, model))
        self._model = model
        if law != before and self._problem is not None:
            self._problem = self._make()

    def set_friction(self, given: Array) -> None:
        """Write the coefficients of friction of a state (`State.friction`) to the records, before something is
        computed.

        Like `grow`, it leaves contacts and sums as they are.
        """
        if given.tobytes() != self._friction.tobytes():  # NaN is NaN there
            self._friction = given.copy()
            if self._problem is not None:
                self._problem = self._make()

    def grow(self, status: int) -> bool:
        """Add the capacity that a kernel lacked; return false if that is not what it lacked.

        Contacts of friction, and which forces are selected, stay.

        Raises
        ------
        CapacityError
            If there may not be so much; nothing has changed then.
        """
        capacity, before = self._capacity, self.problem
        if status == PAIR_CAPACITY_EXCEEDED:
            capacity.near = surface_pairs_for(capacity.near + 1)
        elif status == ROD_CAPACITY_EXCEEDED:
            found = int(before.rod_contact.contacts.count[0])
            if self._pairs.count > self._pairs.capacity:
                self._pairs.reserve(rod_pairs_for(self._model, self._pairs.count))
            if found > capacity.contacts:
                capacity.contacts = contacts_for(self._model, found)
            capacity.sliding = max(capacity.sliding, capacity.contacts)
        elif status == BORDER_CAPACITY_EXCEEDED:
            capacity.columns = columns_for(int(self._width[0]), before.bordered.border.shape[1])
        else:
            return False
        self._problem = self._make()
        return True


def _take_over(old: Sliding | RodContactList, new: Sliding | RodContactList, count: int) -> None:
    """Copy what is in use: `count` contacts, and what has no capacity."""
    for name in old.shapes:
        source, target = getattr(old, name), getattr(new, name)
        used = slice(None) if source.shape == target.shape else slice(count)
        target[used] = source[used]


def new_configuration(model: Model, sizes: dict[str, int]) -> Configuration:
    """Return the arrays of a configuration, of which everything that does not move is in place; `sizes` as in
    `model.sizes`.
    """
    surfaces = model.surfaces
    nodes = model.node_count
    contact_point = np.zeros((nodes + sizes["point"], 3))
    at = Configuration.zeros(
        sizes,
        contact_point=contact_point,
        position=contact_point[:nodes],
        point=contact_point[nodes:],
    )
    at.length[:], at.rotation[:] = 1.0, np.eye(3)
    if not (surfaces.body < sizes["body"]).any():
        at.surface_position[:], at.surface_arm[:] = surfaces.position, surfaces.position
        at.surface_rotation[:] = surfaces.rotation
    return at


def new_points(sizes: dict[str, int], count: int) -> list[Point]:
    """Return the arrays of so many points."""
    shapes = shapes_of(Point, sizes, [name for name in Point.shapes if name != "rotation"])
    in_one = [zeros_in_one(shapes) for _ in range(count)]
    return [Point.zeros(sizes, vectors=vectors, **parts) for vectors, parts in in_one]


def new_work(sizes: dict[str, int], configurations: list[Configuration], stages: int) -> Work:
    """Return arrays for steps of so many stages; `sizes` as in `model.sizes`."""
    first, origin, end = new_points(sizes, 3)
    stage = Stage.zeros(sizes)
    stage.origin_rotation[-1] = np.eye(3)
    return Work.zeros(
        sizes | {"stage": stages, "point vector": first.vectors.size},
        configurations=np.array([at.address for at in configurations], dtype=np.int64),
        stage=stage,
        first=first,
        origin=origin,
        end=end,
        account=StepAccount(),
    )
