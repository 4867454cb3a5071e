"""The region in which cases of the matrix are meant to be computed accurately, decided from their parameters alone.

Each limit is one of the mechanics, of the barrier, or of what a user asked for: none comes from what the solver does.
Inside, an answer must be accurate in most cases and stable in the rest; outside, a run may stop with a reason, or give
an answer of unknown error, but nothing worse.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from bilayer_core.contact.barrier import barrier as barrier_energy
from bilayer_core.verification.stress import robots
from bilayer_core.verification.stress.parameters import TOUCHING, Parameters

LARGEST_STRAIN = 0.1
"""Of eigenstrain, of axial forces, and of bending at the face of a strip: materials are linear."""
LARGEST_BEND = 0.2
"""Curvature times thickness: it is a rod."""
LARGEST_MACH = 0.02
"""Speed of an impact over that of sound along the softer layer: it strains by as much."""
MOST_PER_STEP, MOST_PER_EULER_STEP = 1.0 / 40.0, 1.0 / 400.0
"""Part of the shortest time of the motion that a fixed step may take, by methods of second and of first order."""
COARSEST_TOLERANCE = 1e-3
THICKEST_BARRIER = 0.5
"""Of the thickness of the thinner side."""
DEEPEST = 0.1
"""Part of the barrier distance down to which its energy counts (`model.impacts`)."""
FEWEST_STATIONS = 5
"""With which a strip has a shape that means anything where it touches."""
SMALLEST_THRESHOLD = 1e-6
"""Speed from which friction acts, over that of the motion: below, what sticks creeps by rounding."""


def outside(p: Parameters) -> list[str]:
    """Return why a case is outside the region; empty if it is inside."""
    return [*_of_material(p), *_of_contact(p), *_of_time(p)]


def _of_material(p: Parameters) -> Iterator[str]:
    thickness = robots.thickness(p)
    softest = min(robots.moduli(p))
    if abs(p.eigenstrain) > LARGEST_STRAIN:
        yield f"eigenstrain {p.eigenstrain:g}"
    bend = free_bend(p)
    if bend > LARGEST_BEND:
        yield f"curvature x thickness {bend:.2g}"
    if p.length / robots.width(p) < 5.0:
        yield "a plate more than a rod"
    stretch = robots.DENSITY * robots.gravity(p) * p.length / softest
    if p.robot not in ("swimmer", "coil", "box") and stretch > LARGEST_STRAIN:
        yield f"its weight strains it by {stretch:.2g}"
    if p.robot == "beam":
        moment = 0.5 * robots.gravity(p) * robots.DENSITY * thickness * p.length**2
        sag = moment / robots.bending_stiffness(p) * thickness
        if sag > LARGEST_BEND:
            yield f"curvature x thickness under its weight {sag:.2g}"
    if p.robot in ("drop", "pile", "bat"):
        mach = impact_speed(p) / math.sqrt(softest / robots.DENSITY)
        if mach > LARGEST_MACH:
            yield f"the impact is at {mach:.2g} of the speed of sound"
        # a strip of modulus E that meets something at speed u bends by κ H ~ u/c √12: the wave of bending, by energy
        if p.robot != "bat" and math.sqrt(12.0) * mach > LARGEST_BEND:
            yield "the impact bends it beyond a rod"


def free_bend(p: Parameters) -> float:
    """Return the curvature times thickness of a strip without loads: natural, and what the eigenstrain adds by
    Timoshenko.
    """
    (e1, e2), (h1, h2) = robots.moduli(p), robots.layer_thicknesses(p)
    a1, a2 = e1 * h1, e2 * h2
    moment = a1 * a2 / (a1 + a2) * 0.5 * robots.thickness(p) * abs(p.eigenstrain)
    natural = abs(2.0 * math.pi * p.turns / p.length)
    return robots.thickness(p) * (natural + moment / robots.bending_stiffness(p))


def impact_speed(p: Parameters) -> float:
    """Return the speed of the part that hits a surface or a strip [m/s]."""
    if p.robot in ("drop", "pile"):
        return math.sqrt(2.0 * robots.gravity(p) * (robots.height(p) + robots.barrier(p)))
    return p.speed


def _of_contact(p: Parameters) -> Iterator[str]:
    if p.robot not in TOUCHING and p.robot != "coil":
        return
    distance = robots.barrier(p)
    thinnest = min(robots.layer_thicknesses(p)) if p.model == "two_rod" else robots.thickness(p)
    if distance > THICKEST_BARRIER * thinnest:
        yield "barrier distance above half the thickness"
    if p.stations < FEWEST_STATIONS and p.robot not in ("ball", "box"):
        yield f"{p.stations} stations in contact"
    # per length of contact: the weight, and the energy of the impact
    weight = robots.DENSITY * robots.thickness(p) * robots.width(p)
    layers = 3.0 if p.robot == "pile" else 1.0
    if p.robot in ("ball", "box"):
        weight, layers = p.mass_ratio * robots.strip_mass(p) / (0.1 * p.length), 1.0
    load = layers * weight * robots.gravity(p)
    if p.robot not in ("coil", "box", "bat") and load > p.contact_stiffness * distance:
        yield "the barrier is too soft for the weight"
    if p.robot not in ("coil", "crawler"):
        energy = 0.5 * layers * weight * impact_speed(p) ** 2
        held = p.contact_stiffness * barrier_energy(DEEPEST * distance, distance)
        if energy > held:
            yield f"the barrier holds {held / energy:.2g} of the impact"
    if p.friction > 0.0 and p.threshold < SMALLEST_THRESHOLD * p.length / robots.period(p):
        yield "friction acts from a speed below the rounding of the motion"


def _of_time(p: Parameters) -> Iterator[str]:
    if p.dt is None:
        if p.tolerance > COARSEST_TOLERANCE:
            yield f"tolerance {p.tolerance:g}"
        return
    part = p.dt / shortest_time(p)
    if part > (MOST_PER_EULER_STEP if p.integrator == "implicit_euler" else MOST_PER_STEP):
        yield f"a step is {part:.2g} of the shortest time of the motion"


def shortest_time(p: Parameters) -> float:
    """Return the shortest time of the motion [s]: of the second bending vibration, a noisy stimulus and an impact."""
    found = [robots.period(p) / 6.27]
    if p.stimulus == "noise":
        found.append(robots.duration(p) / robots.NOISE_STEPS)
    if p.robot in TOUCHING:
        found.append(robots.barrier(p) / max(impact_speed(p), 1e-30))
    return min(found)
