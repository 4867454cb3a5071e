"""Which scenes are one straight planar bilayer, and the beam that they describe."""

from __future__ import annotations

import numpy as np

from bilayer_core.errors import InputError, SceneError
from bilayer_core.model.section import sections
from bilayer_core.scene.body import Prescribed
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.paths import StraightPath
from bilayer_core.scene.profile import Profile, values_at
from bilayer_core.scene.rod import Rod
from bilayer_core.scene.transduction import free_strain
from bilayer_core.verification.beam2d.beam import PlanarBeam
from bilayer_core.verification.beam2d.energy import Section

Array = np.ndarray
IN_PLANE = 1e-12  # of gravity's size: what its part across the plane may be


def beam_of(scene: SceneConfig) -> PlanarBeam:
    """Return the beam of a scene, straight and without eigenstrain.

    Raises SceneError if the scene has anything that the beam cannot represent; the message names it.
    """
    rod = _only_rod(scene)
    halves = [sections(rod, layer, scene.materials[layer.material], np.zeros(1)) for layer in rod.layers]
    height = (-0.5 * rod.layers[0].thickness, 0.5 * rod.layers[1].thickness)
    section = Section(
        axial=float(sum(half.axial_stiffness[0] for half in halves)),
        coupling=float(sum(half.axial_stiffness[0] * z for half, z in zip(halves, height, strict=True))),
        bending=float(
            sum(
                half.bending_stiffness[0][0] + half.axial_stiffness[0] * z**2
                for half, z in zip(halves, height, strict=True)
            )
        ),
        mass=float(sum(half.mass[0] for half in halves)),
    )
    axes = np.array([rod.path.direction, rod.normal])
    gravity = tuple(float(part) for part in axes @ scene.gravity)
    return PlanarBeam(
        section,
        rod.path.length,
        rod.stations,
        clamped=rod.clamp_start is not None,
        gravity=gravity,
        damping=scene.damping.mass,
    )


def set_stimuli(beam: PlanarBeam, scene: SceneConfig, values: dict[str, float]) -> None:
    """Let the layers of a scene's beam follow settled stimuli, each channel's value given in its unit.

    Raises InputError if a channel has no value, or there is no such channel.
    """
    if values.keys() != scene.stimuli.keys():
        known = ", ".join(scene.stimuli) or "none"
        raise InputError(
            f"stimuli: found values for {', '.join(values) or 'none'}; the scene {scene.name!r} has: {known}"
        )
    rod = scene.rods[0]
    beam.force[:] = beam.moment[:] = 0.0
    for layer, side in zip(rod.layers, (-0.5, 0.5), strict=True):
        strain = np.zeros(rod.stations - 1)
        for law in layer.eigenstrain:
            limit = np.array([np.inf if law.saturation is None else law.saturation])
            gain = values_at(law.gain, rod.edge_length * (np.arange(len(strain)) + 0.5))
            eigenstrain = free_strain(np.array([values[law.stimulus]]), gain, law.reference, limit)
            strain += rod.covered_parts(np.arange(len(strain)), layer, law) * eigenstrain
        stiffness = sections(rod, layer, scene.materials[layer.material], np.zeros(1)).axial_stiffness[0]
        beam.force += stiffness * strain
        beam.moment += stiffness * side * layer.thickness * strain


def _only_rod(scene: SceneConfig) -> Rod:
    rod = scene.rods[0]
    _, tangents, normals = rod.frames_at(np.zeros(1))
    gravity, normal = np.array(scene.gravity), np.cross(tangents[0], normals[0])
    held = {body.name: body for body in scene.bodies}.get(rod.clamp_start)
    layers = rod.layers
    needs = {
        "rods: must be one, without a pattern": len(scene.rods) == 1 and rod.pattern is None,
        "stimuli: must be no light": all(channel.light is None for channel in scene.stimuli.values()),
        "rods[0].path: must be straight": isinstance(rod.path, StraightPath),
        "rods[0].layers: must be two over the whole path": len(layers) == 2
        and all(layer.interval is None for layer in layers),
        "rods[0]: width, thickness and stiffness must not vary": not any(
            isinstance(value, Profile)
            for layer in layers
            for value in (rod.width_of(layer), layer.thickness, layer.stiffness)
        ),
        "rods[0].imperfection: must be none": rod.imperfection is None,
        "rods[0].layers: natural curvature and twist must be zero": not any(
            layer.natural_curvature or layer.natural_twist for layer in layers
        ),
        "materials: retardation_time must be zero": not any(
            scene.materials[layer.material].retardation_time for layer in layers
        ),
        "rods[0].clamp_end: must be free": rod.clamp_end is None,
        "rods[0].clamp_start: must be a body at rest, or none": rod.clamp_start is None
        or (isinstance(held.motion, Prescribed) and not held.motion.times),
        "gravity: must lie in the plane of path and normal": abs(gravity @ normal)
        <= IN_PLANE * np.linalg.norm(gravity),
        "contact, fluid, loads, masses: must not be there": not (
            scene.contact or scene.fluid or scene.loads or scene.masses
        ),
    }
    for demand, met in needs.items():
        if not met:
            raise SceneError(f"{scene.name}: the planar beam of Appendix A cannot be this scene: {demand}")
    return rod
