"""The list of forces, from which the plan, the engine, the energy budget and the documentation take theirs.

A force has its line here and its formula in `forces/`; the part of the engine that computes it asks for its slot by
name (`model.force_slots.slot_of`). An engine refuses to be built for a scene that needs a force that no term of
`forces.force_register` computes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import Enum
from functools import cached_property

from bilayer_core.model.colliders import ContactPair, contact_pairs
from bilayer_core.model.findings import few
from bilayer_core.model.free_motions import mechanisms_of
from bilayer_core.model.friction_pairs import friction_of_rods, slides
from bilayer_core.model.rod_pairs import RodPair, rod_pairs
from bilayer_core.model.strip_choice import section_of
from bilayer_core.scene.body import Prescribed
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.load import Load


class Kind(Enum):
    """Meaning of the energy of a force, and the side of the energy budget on which its work stands."""

    CONSERVATIVE = "energy of the configuration"
    DISSIPATIVE = "potential of the velocity; its work is lost"
    INERTIAL = "distance from the motion without forces; its work is kinetic energy"
    EXTERNAL = "work of a load over the step; supplied from outside"


@dataclass(frozen=True)
class Question:
    """A scene, the model and the dimension that were chosen for it."""

    scene: SceneConfig
    model: str
    dimension: int

    @cached_property
    def pairs(self) -> tuple[ContactPair, ...]:
        """Surfaces that something can meet."""
        return contact_pairs(self.scene)

    @cached_property
    def rod_pairs(self) -> tuple[RodPair, ...]:
        """Rods that may meet each other or themselves."""
        return rod_pairs(self.scene)

    @property
    def rods_touch(self) -> bool:
        """True if the contact of any rods is computed."""
        return any(rod_pair.active for rod_pair in self.rod_pairs)

    def loads(self, frame: str) -> list[Load]:
        """Return the loads that are fixed in the frame of the world, or of the material."""
        return [load for load in self.scene.loads if load.frame == frame]


@dataclass(frozen=True)
class Force:
    """A line of the list.

    Attributes
    ----------
    name : str
    kind : Kind or None
        None for what acts through other forces and has no energy of its own.
    formula : str
        The file that derives it.
    skipped : callable
        Why a scene does not need it; None if it does.
    on_nodes : bool
        Whether it has second derivatives by positions of nodes.
    """

    name: str
    kind: Kind | None
    formula: str
    skipped: Callable[[Question], str | None]
    on_nodes: bool = False


def _unless(needed: bool, reason: str) -> str | None:
    return None if needed else reason


def _always(_: Question) -> None:
    return None


def _bond(q: Question) -> str | None:
    if q.model == "laminate":
        return "one curve carries both layers"
    return _unless(any(len(rod.layers) == 2 for rod in q.scene.rods), "no rod has two layers")


def _eigenstrain(q: Question) -> str | None:
    driven = any(layer.eigenstrain for rod in q.scene.rods for layer in rod.layers)
    return _unless(driven, "no layer follows a stimulus")


def _viscosity(q: Question) -> str | None:
    viscous = any(q.scene.materials[layer.material].retardation_time for rod in q.scene.rods for layer in rod.layers)
    return _unless(viscous, "no retardation_time of a material is above zero")


def _joints(q: Question) -> str | None:
    return _unless(bool(q.scene.joints or mechanisms_of(q.scene)), "no joints")


def _joint_friction(q: Question) -> str | None:
    resisted = any(mechanism.dissipates for mechanism in mechanisms_of(q.scene))
    return _unless(resisted, "no damping and no friction of a hinge or a slide")


def _bodies(q: Question) -> str | None:
    return _unless(any(not isinstance(body.motion, Prescribed) for body in q.scene.bodies), "no free body")


def _body_drag(q: Question) -> str | None:
    if q.scene.fluid is None:
        return "no fluid"
    return _unless(any(body.drag is not None for body in q.scene.bodies), "no body has `drag`")


def _turning_drag(q: Question) -> str | None:
    if q.scene.fluid is None:
        return "no fluid"
    if q.dimension == 2:
        return "nothing turns about its axis in a plane"
    return _unless(q.scene.fluid.drag_turning > 0.0, "ribbons turn about their axis freely: fluid.drag_turning is zero")


def _added_mass(q: Question) -> str | None:
    if q.scene.fluid is None:
        return "no fluid"
    return _unless(q.scene.fluid.added_mass is not None, "fluid.added_mass is false")


def _friction(q: Question) -> str | None:
    if not q.pairs:
        return "no surfaces that can meet"
    return _unless(slides(q.scene, q.scene.friction), "no friction coefficient above zero")


def _restitution(q: Question) -> str | None:
    if not q.pairs:
        return "no surfaces that can meet"
    if q.scene.contact.restitution is None or q.scene.contact.restitution == 1.0:
        return "contact.restitution is not below 1"
    bodies = any(body.contact_points or body.surface for body in q.scene.bodies)
    return _unless(bodies, "no body that can touch anything")


def _flattening(q: Question) -> str | None:
    strips = q.model == "laminate" and any(section_of(q.scene, rod) == "strip" for rod in q.scene.rods)
    return _unless(strips, "no rod is a strip (`section`)")


def _rod_barrier(q: Question) -> str | None:
    if q.rods_touch:
        return None
    reasons: dict[str, list[str]] = {}
    for rod_pair in q.rod_pairs:
        reasons.setdefault(rod_pair.reason, []).append(rod_pair.what)
    if len(reasons) == 1:
        return next(iter(reasons))
    return "; ".join(f"{few(pairs)}: {reason}" for reason, pairs in reasons.items())


def _rod_friction(q: Question) -> str | None:
    if not q.rods_touch:
        return _rod_barrier(q)
    coefficient = friction_of_rods(q.scene, q.scene.friction)
    return _unless(coefficient.max() > 0.0, "no friction coefficient above zero")


CONSERVATIVE, DISSIPATIVE, INERTIAL, EXTERNAL = Kind
FORCES: tuple[Force, ...] = (
    Force("stretching", CONSERVATIVE, "stretch.py", _always),
    Force("bending", CONSERVATIVE, "bend_twist.py", _always),
    Force("twisting", CONSERVATIVE, "bend_twist.py", lambda q: _unless(q.dimension == 3, "nothing twists in a plane")),
    Force("flattening", CONSERVATIVE, "flattening.py", _flattening),
    Force("bond", CONSERVATIVE, "bond.py", _bond),
    Force("joints", CONSERVATIVE, "joints.py", _joints),
    Force("joint friction", DISSIPATIVE, "mechanisms.py", _joint_friction),
    Force("eigenstrain", None, "stretch.py", _eigenstrain),
    Force("viscosity", DISSIPATIVE, "viscosity.py", _viscosity),
    Force("inertia", INERTIAL, "inertia.py", _always),
    Force("bodies", None, "inertia.py", _bodies),
    Force("damping", DISSIPATIVE, "inertia.py", lambda q: _unless(q.scene.damping.mass > 0.0, "damping.mass is zero")),
    Force("gravity", CONSERVATIVE, "inertia.py", lambda q: _unless(any(q.scene.gravity), "gravity is zero")),
    Force(
        "loads",
        EXTERNAL,
        "loads.py",
        lambda q: _unless(any(any(load.force) for load in q.loads("world")), "no force of fixed direction"),
    ),
    Force(
        "followers",
        EXTERNAL,
        "loads.py",
        lambda q: _unless(any(any(load.force) for load in q.loads("material")), "no load in a material frame"),
    ),
    Force(
        "moments",
        EXTERNAL,
        "loads.py",
        lambda q: _unless(any(any(load.moment) for load in q.scene.loads), "no moment on a body"),
    ),
    Force("drag", DISSIPATIVE, "drag.py", lambda q: _unless(q.scene.fluid is not None, "no fluid"), on_nodes=True),
    Force("body drag", DISSIPATIVE, "body_drag.py", _body_drag),
    Force("turning drag", DISSIPATIVE, "turning_drag.py", _turning_drag),
    Force("added mass", INERTIAL, "added_mass.py", _added_mass, on_nodes=True),
    Force(
        "barrier",
        CONSERVATIVE,
        "surface_barrier.py",
        lambda q: _unless(bool(q.pairs), "no surfaces that can meet"),
        on_nodes=True,
    ),
    Force("restitution", DISSIPATIVE, "restitution.py", _restitution, on_nodes=True),
    Force("friction", DISSIPATIVE, "surface_friction.py", _friction, on_nodes=True),
    Force("rod barrier", CONSERVATIVE, "rod_contact.py", _rod_barrier, on_nodes=True),
    Force("rod friction", DISSIPATIVE, "rod_contact.py", _rod_friction, on_nodes=True),
    Force(
        "gyroscopic",
        INERTIAL,
        "gyroscopic.py",
        lambda q: _unless(q.dimension == 3, "nothing turns about its axis in a plane"),
    ),
)
"""In the order in which their energies are added."""


_ON_NODES = frozenset(force.name for force in FORCES if force.on_nodes)


def planned(scene: SceneConfig, model: str, dimension: int) -> dict[str, str]:
    """Return the status of each force by name: ``"active"`` or ``"skipped: reason"``."""
    return dict(
        scene.keep(("forces", model, dimension), (FORCES,), lambda: _planned(Question(scene, model, dimension)))
    )


def _planned(question: Question) -> dict[str, str]:
    reasons = {force.name: force.skipped(question) for force in FORCES}
    return {name: "active" if reason is None else f"skipped: {reason}" for name, reason in reasons.items()}


def active_forces(scene: SceneConfig, model: str, dimension: int) -> tuple[str, ...]:
    """Return the names of the forces with an energy that a scene needs."""
    terms = planned(scene, model, dimension)
    return tuple(force.name for force in FORCES if force.kind is not None and terms[force.name] == "active")


def on_nodes(forces: Iterable[str]) -> bool:
    """Return whether any of some forces has second derivatives by positions of nodes."""
    return not _ON_NODES.isdisjoint(forces)


def kinds() -> dict[str, Kind]:
    """Return the kinds of all forces that have an energy, by name."""
    return {force.name: force.kind for force in FORCES if force.kind is not None}


def markdown_table() -> str:
    """Return the list as a table for the site's page of equations."""
    rows = ["| force | its energy is | formula |", "| --- | --- | --- |"]
    for force in FORCES:
        meaning = force.kind.value if force.kind else "none of its own: it acts through other forces"
        rows.append(f"| {force.name} | {meaning} | `bilayer_core/forces/{force.formula}` |")
    return "\n".join(rows) + "\n"
