"""From a model to the records of its problem that depend on sizes, capacity or the scene's conditions."""

from __future__ import annotations

from typing import Any

import numpy as np

from bilayer_core.contact.broad_phase import RodSearch
from bilayer_core.forces.restitution import damping_of
from bilayer_core.model.friction_pairs import friction_of_rods, slides
from bilayer_core.model.lit_elements import light_of
from bilayer_core.model.model import Model
from bilayer_core.model.records.contacts import ContactColumns, Rails, Restitution, RodContact, RodContactList, Slips
from bilayer_core.model.records.parts import PointForces
from bilayer_core.model.records.problem import Border, System
from bilayer_core.scene.friction import Friction

Array = np.ndarray
AS_BUILT = ("viscosity", "drives", "bonds", "joins", "constrained", "attachments")
"""Records of a model that have no arrays into which kernels write."""
LEAST_FALL = 0.2
"""Of the longest rod: motions of less energy than a fall of everything by so much are not watched for theirs."""
SLOWEST_APPROACH = 1.0
"""Barrier distances per second: slower approaches count as that."""
ROUNDING_STRAIN = 1e-11
"""Strain of an edge that may be rounding, at any length of edges."""


def lasting_groups(model: Model, sizes: dict[str, int]) -> dict[str, Any]:
    """Return the groups of a problem that do not change, but for that of its dimension; `sizes` as in `model.sizes`."""
    return dict(
        gravity=np.array(model.scene.gravity, dtype=float),
        damping=float(model.scene.damping.mass),
        least_energy=_least_energy(model),
        strands=model.rods,
        bodies=model.free_bodies,
        **{name: getattr(model, name) for name in AS_BUILT},
        **{
            name: getattr(model, name).allocated(sizes)
            for name in ("off_axis", "flattening", "moduli", "flow", "fluid", "varied_fields")
        },
        raised=model.raised.allocated(sizes, first=sizes["strain"] - 3 * model.kept_directors),
        light=light_of(model),
        loads=_allocated(model.loads),
        followers=_allocated(model.followers),
        moments=model.moments.allocated({"moment": len(model.moments.body)}),
        border=Border.zeros(sizes) if model.free_count else Border.absent(),
        has_contact=model.has_surface_contact or model.rod_search.exists or "joints" in model.forces,
        system=System.zeros(sizes),
    )


def _allocated(loads: PointForces) -> PointForces:
    return loads.allocated({"loaded node": len(loads.node), "loaded body": len(loads.body)})


def _least_energy(model: Model) -> float:
    """Return the energy of a small fall of everything, plus that of strains that are rounding [J]."""
    fall = LEAST_FALL * max(rod.path.length for rod in model.scene.rods)
    weight = (model.rods.node_mass.sum() + model.free_bodies.mass.sum()) * np.linalg.norm(model.scene.gravity)
    return float(fall * weight + ROUNDING_STRAIN**2 * (model.rods.axial_stiffness @ model.rods.rest_length))


def restitution_of(model: Model, sizes: dict[str, int]) -> Restitution:
    """Return the record of impacts, absent where none is damped."""
    pairs, contact = model.impact_pairs, model.scene.contact
    if not len(pairs):
        return Restitution.absent()
    row = np.full((sizes["contact_point"], sizes["surface"]), -1, dtype=np.int64)
    row[pairs[:, 0], pairs[:, 1]] = np.arange(len(pairs))
    return Restitution.zeros(
        sizes,
        damping=damping_of(contact.restitution),
        slowest=SLOWEST_APPROACH * contact.barrier_distance,
        first=model.strain_count,
        memory=np.zeros(1, dtype=np.int64),
        point=pairs[:, 0].copy(),
        surface=pairs[:, 1].copy(),
        row=row,
    )


def slips_of(model: Model, sizes: dict[str, int]) -> Slips:
    """Return the record of slips, absent if nothing slides against friction."""
    return Slips.zeros(sizes) if slides(model.scene, model.scene.friction) else Slips.absent()


def rod_contact_of(
    model: Model,
    sizes: dict[str, int],
    search: RodSearch,
    rails: Rails,
    now: RodContactList,
    old: RodContactList,
    law: Friction | None,
    **motion: Array,
) -> RodContact:
    """Return the record of contacts of rods, with those of `now` and the `old` ones of the start of a stage; `law` is
    the scene's or one with other coefficients, `motion` that of the list of near rods.
    """
    contact, coefficient = model.scene.contact, friction_of_rods(model.scene, law)
    return RodContact.zeros(
        sizes,
        d_hat=contact.barrier_distance,
        stiffness=model.contact_stiffness,
        slides=bool(coefficient.max() > 0.0),
        coefficient=coefficient,
        rod=model.sliding.owner[: model.node_count].copy(),
        threshold=law.speed_threshold if law is not None else 1.0,
        unit=contact.barrier_distance + 2.0 * float(search.edge_radius.max()),
        point_weight=model.rod_point_weight,
        rails=rails,
        search=search,
        contacts=now,
        sliding=old,
        **motion,
    )


def contact_columns_of(model: Model, sizes: dict[str, int], capacity: int) -> ContactColumns:
    """Return the columns of contacts, with capacity for so many of barrier and friction together."""
    return ContactColumns.zeros(
        sizes | {"contact": capacity},
        strand=np.repeat(np.arange(len(model.strands)), [s.node_count for s in model.strands]),
        attached=model.solved_layout.attached_of_unknown,
        joined=model.joins.column >= 0 if model.joins.exists else np.zeros(model.solved_layout.size, dtype=bool),
    )
