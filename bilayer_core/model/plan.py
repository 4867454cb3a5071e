"""Plan of the computation for a scene: what is computed and what is skipped, each with its reason."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from bilayer_core.errors import SceneError
from bilayer_core.model.colliders import ContactPair, contact_pairs, meets_with_borders
from bilayer_core.model.dragged_bodies import dry_bodies
from bilayer_core.model.findings import Figure, few, told
from bilayer_core.model.force_list import planned
from bilayer_core.model.free_motions import mechanisms_of
from bilayer_core.model.imperfect_shapes import advice
from bilayer_core.model.implausible_numbers import implausible_numbers
from bilayer_core.model.laminate import uneven_faces
from bilayer_core.model.planarity import find_plane, require_plane
from bilayer_core.model.redundancy import redundant_joints, require_possible_motion
from bilayer_core.model.rod_pairs import RodPair, passing_warnings, rod_pairs
from bilayer_core.model.rods import snapped_layers
from bilayer_core.model.strip_choice import refusal, section_of
from bilayer_core.model.twisted import HELIX, helix_error, twist_figures
from bilayer_core.model.validity import validity_warnings
from bilayer_core.scene.config import Coupling, SceneConfig
from bilayer_core.scene.rod import Rod

MODELS = ("two_rod", "laminate")
DIMENSIONS = (3, 2)
INTEGRATORS = ("implicit_euler", "sdirk2", "tr_bdf2", "generalised_alpha", "implicit_midpoint")
RECOMMENDED = "sdirk2", "second order, L-stable; least CPU time to an error of 1 % in `bilayer bench --quick`"
"""The integrator that `auto` takes, and why."""
WITH_VISCOSITY = "tr_bdf2", "second order where viscosity makes motions stiff, too: its stages are of order 2"
"""The same for scenes with viscosity."""
WITH_JOINTS = "tr_bdf2", "second order where stiff joints guide bodies that turn, too: its stages are of order 2"
"""The same for scenes with joints between bodies."""

FEW_PAIRS = 4
"""Contact pairs of one kind that are told one by one."""


@dataclass(frozen=True)
class Plan:
    """How a scene is simulated.

    Attributes
    ----------
    model, integrator : str
    dimension : int
    reasons : dict
        Why each of these three was chosen.
    terms : dict
        Name of each force: ``"active"`` or ``"skipped: reason"``.
    contact_pairs : tuple of str
        Which surfaces can meet.
    warnings : tuple of str
        Where the validity of the model ends, a line for each kind.
    """

    model: str
    dimension: int
    integrator: str
    reasons: dict[str, str]
    terms: dict[str, str]
    contact_pairs: tuple[str, ...] = ()
    warnings: tuple[str, ...] = field(default=())


def make_plan(scene: SceneConfig, *, model="auto", dimension="auto", integrator="auto") -> Plan:
    """Choose model, dimension and integrator, and the terms that a scene needs.

    Arguments other than ``"auto"`` override the scene's own.

    Raises
    ------
    SceneError
        If a choice does not exist, or the model cannot be the scene.
    """
    solver, reasons = scene.solver, {}
    chosen_model, reasons["model"] = _choose("model", model, solver.model, MODELS) or simplest_model(scene)
    if chosen_model == "laminate":
        _refuse_laminate(scene)
    for rod in scene.rods:
        if section_of(scene, rod, chosen_model) == "strip":
            _refuse_strip(scene, rod, chosen_model)
    asked = _choose("dimension", dimension, solver.dimension, DIMENSIONS)
    if asked is not None and asked[0] == 2:
        asked = 2, f"{asked[1]}: all stays in {require_plane(scene)}"
    chosen_dimension, reasons["dimension"] = asked or best_dimension(scene)
    chosen_integrator, reasons["integrator"] = _choose(
        "integrator", integrator, solver.integrator, INTEGRATORS
    ) or _recommended(scene)
    if _is_viscous(scene) and chosen_integrator == "implicit_midpoint":
        raise SceneError(
            "integrator: implicit_midpoint does not follow viscosity (retardation_time of a material): the rates of "
            f"strains at its ends are of first order; allowed: {', '.join(INTEGRATORS[:-1])}"
        )
    for mechanism in mechanisms_of(scene):
        if mechanism.dissipates and chosen_integrator == "implicit_midpoint":
            raise SceneError(
                f"integrator: implicit_midpoint does not follow damping and friction of {mechanism.owner}: rates at "
                f"its ends are of first order; allowed: {', '.join(INTEGRATORS[:-1])}"
            )
    require_possible_motion(scene)
    return Plan(
        chosen_model,
        chosen_dimension,
        chosen_integrator,
        reasons,
        planned(scene, chosen_model, chosen_dimension),
        _contact_pairs(scene, chosen_dimension),
        told(
            [
                *implausible_numbers(scene),
                *validity_warnings(scene, chosen_model),
                *passing_warnings(scene),
                *_warnings_of(scene, chosen_model, chosen_dimension),
                *advice(scene),
                *dry_bodies(scene),
            ]
        ),
    )


def _warnings_of(scene: SceneConfig, model: str, dimension: int) -> Iterator[Figure]:
    """Yield the warnings that depend on the model."""
    yield from (figure for figure in twist_figures(scene, model, dimension) if figure.outside)
    yield from redundant_joints(scene, require_plane(scene) if dimension == 2 else None)
    if model == "two_rod":
        yield from snapped_layers(scene)
    if model == "laminate":
        in_contact = {rod for pair in rod_pairs(scene) if pair.active for rod in (pair.first, pair.second)}
        yield from (figure for rod in sorted(in_contact) for figure in uneven_faces(scene.rods[rod], scene))


def simplest_model(scene: SceneConfig) -> tuple[str, str]:
    """Return the model with the fewest unknowns that computes all that a scene requires, and the reason."""
    if scene.coupling != Coupling():
        return "two_rod", "`coupling` is set: only the two-rod model has a bond that gives"
    for rod in scene.rods:
        if rod.section == "strip" or rod.feels_across:
            return "laminate", f"rods.{rod.name}: its section bends (`section: strip`), which two rods cannot"
    for rod in scene.rods:
        if len(_retardation_times(rod, scene)) > 1:
            return "two_rod", f"rods.{rod.name}: layers with different retardation times, of which a curve has one"
        if _moves_its_axis(rod):
            return "two_rod", f"rods.{rod.name}: layers whose moduli change unlike each other, which moves their axis"
        error = helix_error(scene, rod)
        if error > HELIX and section_of(scene, rod) == "beam":
            return "two_rod", (
                f"rods.{rod.name}: it winds to a helix, which one curve would miss by {100 * error:.2g} %"
            )
    for rod in scene.rods:
        if section_of(scene, rod) == "strip":
            return "laminate", f"rods.{rod.name}: its section bends (`section: {rod.section}`), which two rods cannot"
    return "laminate", "one curve carries both layers: half the unknowns, no stiff bond"


def _retardation_times(rod: Rod, scene: SceneConfig) -> set[float]:
    return {scene.materials[layer.material].retardation_time for layer in rod.layers}


def _moves_its_axis(rod: Rod) -> bool:
    """Return whether moduli of the layers of a rod change, and not alike."""
    if len(rod.layers) == 1:
        return False
    changes = [[layer.stiffness_change for layer in variant.layers] for variant in rod.variants]
    diffuses = any(law and rod.diffusion_of(layer, law) for layer, law in zip(rod.layers, changes[0], strict=True))
    return diffuses or any(first != second for first, second in changes)


def _refuse_laminate(scene: SceneConfig) -> None:
    for rod in scene.rods:
        if _moves_its_axis(rod):
            raise SceneError(
                f"model: laminate has its curve on one neutral axis, which moves where the moduli of one layer of "
                f"rods.{rod.name} change (`stiffness_change`); allowed: two_rod, or the same change in all layers"
            )
        if len(times := _retardation_times(rod, scene)) > 1:
            raise SceneError(
                f"model: laminate has one retardation time along a rod, the layers of rods.{rod.name} have "
                f"{' and '.join(f'{time:g} s' for time in sorted(times))}; allowed: two_rod, or equal times"
            )


def _refuse_strip(scene: SceneConfig, rod: Rod, model: str) -> None:
    if model == "two_rod":
        raise SceneError(
            f"model: two_rod has layers that keep their section, and the bond of rods.{rod.name} (`section: strip`) "
            "has no part across the width; allowed: laminate"
        )
    if why := refusal(scene, rod):
        raise SceneError(f"rods.{rod.name}.section: strip {why}; allowed: beam")


def _is_viscous(scene: SceneConfig) -> bool:
    return any(time for rod in scene.rods for time in _retardation_times(rod, scene))


def _recommended(scene: SceneConfig) -> tuple[str, str]:
    if scene.joints:
        return WITH_JOINTS
    return WITH_VISCOSITY if _is_viscous(scene) else RECOMMENDED


def best_dimension(scene: SceneConfig) -> tuple[int, str]:
    """Return 2 where the scene stays in a plane, otherwise 3, and why."""
    plane, reason = find_plane(scene)
    return (3 if plane is None else 2), reason


def _choose(key: str, asked, of_scene, allowed: tuple) -> tuple | None:
    """Return the choice of the caller, or else of the scene, and which of them made it; None if both leave it open."""
    value, origin = (asked, "asked for") if asked != "auto" else (of_scene, f"set by `solver.{key}`")
    if value == "auto":
        return None
    if str(value) not in map(str, allowed):
        raise SceneError(f"{key}: {value} does not exist; allowed: auto, {', '.join(map(str, allowed))}")
    return next(candidate for candidate in allowed if str(candidate) == str(value)), origin


def _contact_pairs(scene: SceneConfig, dimension: int) -> tuple[str, ...]:
    """Return which surfaces can meet and how; many of one kind on one line."""
    pairs = [
        *contact_pairs(scene, dimension),
        *(ContactPair(pair.what, _how_rods_meet(scene, pair, dimension)) for pair in rod_pairs(scene) if pair.active),
    ]
    kinds: dict[str, list[str]] = {}
    for pair in pairs:
        kinds.setdefault(pair.how, []).append(pair.what)
    return tuple(
        str(ContactPair(what, how))
        for how, of_kind in kinds.items()
        for what in (of_kind if len(of_kind) <= FEW_PAIRS else [few(of_kind)])
    )


def _how_rods_meet(scene: SceneConfig, pair: RodPair, dimension: int) -> str:
    first, second = (meets_with_borders(scene.rods[index]) for index in (pair.first, pair.second))
    if dimension == 2 or not (first or second):
        return "as round as they are thick"
    return "as flat ribbons with borders" if first and second else "a flat ribbon with borders, and one that is round"
