"""The summary of a run: a plain dictionary, the content of ``--summary``."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from bilayer_core.engine.energy_account import LARGEST, NUMERICAL
from bilayer_core.model.bent_plates import bent_plate
from bilayer_core.model.findings import told
from bilayer_core.model.impacts import heaviest, stiffness_that_holds
from bilayer_core.model.model import Model
from bilayer_core.model.strip_choice import plates
from bilayer_core.model.undamped_friction import unseen_vibrations
from bilayer_core.model.validity import LARGE_STRAIN, THICK_CURVATURE
from bilayer_core.observed.system import versions
from bilayer_core.simulation.plane_watch import PlaneWatch
from bilayer_core.simulation.run_result import Termination
from bilayer_core.simulation.statistics import RunStatistics
from bilayer_core.simulation.views.body import BodyView
from bilayer_core.simulation.views.joint import JointView

UNITS = {
    **dict.fromkeys(("com_start", "com_end", "com_max_height", "tip_positions", "min_gap", "start", "end"), "m"),
    **dict.fromkeys(("lift", "lift_end", "distance", "displacement"), "m"),
    **dict.fromkeys(("first_contact", "simulated", "cpu_time", "wall_time"), "s"),
    **dict.fromkeys(("energy", "largest_energy", "energy_through", "numerical_energy", "budget"), "J"),
    **dict.fromkeys(("max_curvature", "mean_curvature"), "1/m"),
    **dict.fromkeys(("max_contact_force", "pair_forces"), "N"),
    "angle": "rad",
}
"""By the key of a summary that stands before figures in that unit, or is one."""
LARGE_NUMERICAL = 0.1
"""Part of the energy that went through a run that its steps may make or lose without a warning."""


def summarise(simulator: Any) -> dict:
    """Return the figures of a run since its start; lengths in m, times in s, forces in N, energies in J, curvatures in
    1/m.

    Of the run, over the start and the ends of all accepted steps: ``max_curvature`` (through the thickness),
    ``max_strain`` (of an edge, without its eigenstrain), ``max_fibre_strain`` (of the outermost fibres beyond the shape
    at rest), ``max_curvature_by_thickness``, ``com_max_height``, ``min_gap``, ``max_contact_force``, and of
    bodies ``lift``, the greatest height over that at the start, ``first_contact`` and ``most_contact_nodes``. Of the
    end: ``com_end``, ``displacement`` of the mass centre, ``pair_forces`` (normal forces of what touches),
    ``mean_curvature``, ``tip_positions``, ``energy``, and of bodies ``end``, ``lift_end`` and
    ``contact_nodes``. ``largest_energy`` is that of motion, elasticity and contact together, with the potential of
    gravity from its value at the start, ``energy_through`` the energy that went through: that or, if it is more, what
    was supplied or lost in all steps. ``numerical_energy`` is what steps have made or, below zero, lost beyond all
    forces (`engine.energy_account`). ``warnings`` tell where the run left the range in which the model is meant to
    be used, or where the robot would have left the plane of a model of dimension 2. ``unseen`` tells which errors no
    figure of the run shows.
    """
    model, statistics, plan = simulator.model, simulator.statistics, simulator.plan
    positions = simulator.positions
    curvature = np.abs(simulator.curvatures[: model.node_count])
    simulated = simulator.time - simulator.start_time
    cpu = simulator.cpu_time
    min_gap = statistics.min_gap
    numerical, through = numerical_energy(simulator)
    largest = float(simulator.energy_account[LARGEST])
    return {
        "scene": simulator.scene.name,
        "model": plan.model,
        "dimension": plan.dimension,
        "integrator": plan.integrator,
        "stepping": str(simulator.steps),
        "reasons": simulator.reasons,
        "nodes": len(positions) - len(model.joined_node),
        "dof": model.unknowns,
        "dt": simulator.dt,
        "tolerance": simulator.tolerance,
        "duration": simulator.scene.duration,
        "simulated": simulated,
        "steps": statistics.steps,
        "substeps": statistics.substeps,
        "rejected_steps": statistics.rejected,
        "inaccurate_steps": statistics.inaccurate,
        "gaining_steps": statistics.gaining,
        "unresolved_steps": statistics.unresolved,
        "step_length": {
            "shortest": statistics.shortest if statistics.steps else None,
            "longest": statistics.longest if statistics.steps else None,
            "mean": simulated / statistics.steps if statistics.steps else None,
        },
        "newton_iterations": statistics.iterations,
        "factorisations": statistics.factorisations,
        "regularised_hessians": statistics.regularised,
        "friction_updates": statistics.settlings,
        "cpu_time": cpu,
        "wall_time": simulator.wall_time,
        "compile_time": simulator.compile(),
        "real_time_factor": simulated / cpu if cpu > 0.0 else None,
        "converged": simulator.termination != Termination.FAILED.value,  # no other step is accepted
        "largest_residual": statistics.largest_residual,
        "termination": simulator.termination,
        "terms": plan.terms,
        "com_start": simulator.start_com.tolist(),
        "com_end": simulator.com.tolist(),
        "displacement": (simulator.com - simulator.start_com).tolist(),
        "com_max_height": statistics.com_max_height,
        "max_curvature": statistics.max_curvature,
        "mean_curvature": float(np.average(curvature, weights=model.node_length)),
        "tip_positions": {name: rod.middle_line[-1].tolist() for name, rod in simulator.rods.items()},
        "max_strain": statistics.max_strain,
        "max_fibre_strain": statistics.max_fibre_strain,
        "max_curvature_by_thickness": statistics.max_curvature_by_thickness,
        "contact_stiffness": model.contact_stiffness or None,
        "min_gap": min_gap if np.isfinite(min_gap) else None,
        "max_contact_force": statistics.max_contact_force,
        "pair_forces": {" on ".join(pair): force for pair, force in simulator.pair_forces.items() if force > 0.0},
        "energy": simulator.energy(),
        "largest_energy": largest,
        "energy_through": through,
        "numerical_energy": numerical,
        **({"budget": simulator.budget()} if simulator.keeps_budget else {}),
        "bodies": _bodies(simulator),
        "joints": {
            name: {"distance": at.distance, "angle": at.angle, **_motions(at)} for name, at in simulator.joints.items()
        },
        "warnings": [
            *simulator.start_warnings,
            *told(figure for figure in plates(simulator.scene, simulator.plan.model) if figure.outside),
            *_warnings(statistics, numerical, through, simulator.plane_watch),
            *([bent_plate(model, plan.model, *statistics.bent_plate)] if statistics.bent_plate[0] > 1.0 else []),
            *_of_contact(model, statistics.unresolved, largest),
            *_of_creases(simulator),
        ],
        "unseen": list(unseen_vibrations(simulator.scene)) if statistics.max_contact_force > 0.0 else [],
        "versions": versions(),
    }


def _of_creases(simulator: Any) -> Iterator[str]:
    for name, time in simulator.statistics.creased.items():
        yield (
            f"rods.{name} is creased from t = {time:.3g} s on: where loads twist it and hardly bend it, its curvature "
            "jumps from a joint to the next, at a place that depends on the mesh; compare several meshes"
        )


def numerical_energy(simulator: Any) -> tuple[float, float]:
    """Return the energy that steps made (below zero: lost) beyond all forces, and what went through the run [J]: its
    largest energy, or what was supplied or lost if that is more.
    """
    account, statistics = simulator.energy_account, simulator.statistics
    through = max(float(account[LARGEST]), statistics.put_in, statistics.taken_out)
    return float(account[NUMERICAL]) - statistics.numerical_before, through


def _warnings(
    statistics: RunStatistics, numerical: float, through: float, plane_watch: PlaneWatch | None
) -> Iterator[str]:
    fibre, bend = statistics.max_fibre_strain, statistics.max_curvature_by_thickness
    if fibre > LARGE_STRAIN:
        yield (
            f"largest strain of a fibre {100 * fibre:.3g} % (at most {100 * LARGE_STRAIN:g} %), of an edge "
            f"{100 * statistics.max_strain:.3g} %: the law of the material is linear"
        )
    if bend > THICK_CURVATURE:
        yield f"largest curvature × thickness {bend:.3g} (at most {THICK_CURVATURE:g}): it is no thin rod"
    if abs(numerical) > LARGE_NUMERICAL * through:
        yield (
            f"numerical energy {100 * numerical / through:+.3g} % of the energy that went through (at most "
            f"{100 * LARGE_NUMERICAL:g} %): what vibrates or meets is too fast for the steps; a smaller tolerance or "
            "dt resolves it, `retardation_time` of a material damps it"
        )
    if plane_watch is not None and plane_watch.since is not None:
        yield plane_watch.warning()


def _of_contact(model: Model, unresolved: int, energy: float) -> Iterator[str]:
    if not unresolved:
        return
    contact, square = model.scene.contact, 2.0 * energy / (model.rods.node_mass.sum() + model.free_bodies.mass.sum())
    needed = stiffness_that_holds(0.5 * heaviest(model) * square, contact.barrier_distance)
    remedy = "a larger `contact.barrier_distance`"
    if needed > model.contact_stiffness:
        remedy = f"`contact.stiffness` {needed:.0e} Pa, or {remedy},"
    yield f"{unresolved} steps, as short as allowed, did not resolve an impact on the barrier: {remedy} holds it"


def _motions(view: JointView | BodyView) -> dict[str, float]:
    """Return the angle about an axis [rad], the way along it [m], and the most that each was beyond a limit."""
    found = {}
    for key, motion in (("turning", view.turning), ("sliding", view.sliding)):
        if motion is not None:
            found[key] = motion.value
            if motion.beyond > 0.0:
                found[f"{key}_beyond_limit"] = motion.beyond
    return found


def _bodies(simulator: Any) -> dict:
    """Return where each body began and is, and how nodes touched it."""
    found = {}
    for index, name in enumerate(simulator.model.bodies.names):
        start, end = simulator.start_bodies[index], simulator.bodies[name].position
        contact = simulator.statistics.bodies.get(name)
        found[name] = {
            "start": start.tolist(),
            "end": end.tolist(),
            "lift": simulator.statistics.body_tops[name] - float(start[2]),
            "lift_end": float(end[2] - start[2]),
            "first_contact": contact.first_contact if contact else None,
            **_motions(simulator.bodies[name]),
            "contact_nodes": contact.nodes if contact else 0,
            "most_contact_nodes": contact.most_nodes if contact else 0,
        }
    return found
