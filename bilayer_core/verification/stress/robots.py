"""Scenes of the matrix from their parameters: small robots that bend, coil, fall, crawl, are hit, pile up and swim.

========= ==========================================================================================
beam      a strip held at one end, bent by its stimulus and its weight
coil      a straight strip that winds itself up to its natural curvature, held at one end
drop      a tilted strip that falls on the ground, and bends on it
crawler   a strip on the ground with directional friction, driven by its stimulus
ball      a ball thrown at the ground, beside a strip
bat       a ball on a schedule that hits a hanging strip
pile      strips that fall on each other and the ground
swimmer   a strip on a free body in a fluid
hub       a free body with four strips in free flight, which they turn about
box       a ball in a closed box
========= ==========================================================================================

Times, speeds and forces follow from the strip: its bending period T = 2π/ω₁, ω₁ = 3.516 √(EI/m)/L² as a cantilever.
"""

from __future__ import annotations

import math

import numpy as np

from bilayer_core.verification.stress.parameters import Parameters

DENSITY = 1200.0
USUAL_LENGTH = 0.1
"""To which gravity, speeds and the barrier distance of the parameters refer [m]."""
HIGHEST = 10.0
"""From where anything falls, at the usual length [m]."""
PERIODS = 4.0
"""Bending periods that a case goes on for."""
LOOKS = 8
"""Output times of a case, at which two runs are compared."""
NOISE_STEPS, NOISE_SEED = 400, 20260713
WALLS = (
    ("floor", 2, 1.0),
    ("roof", 2, -1.0),
    ("left", 0, 1.0),
    ("right", 0, -1.0),
    ("front", 1, 1.0),
    ("back", 1, -1.0),
)


def thickness(p: Parameters) -> float:
    """Return the thickness of the whole section where both layers are [m]."""
    return p.length / p.slenderness


def width(p: Parameters) -> float:
    """Return the width of a robot [m]."""
    return max(0.1 * p.length, thickness(p)) if p.slenderness < 10.0 else 0.1 * p.length


def layer_thicknesses(p: Parameters) -> tuple[float, float]:
    """Return the thickness of the lower and of the upper layer [m]."""
    upper = thickness(p) * p.thickness_ratio / (1.0 + p.thickness_ratio)
    return thickness(p) - upper, upper


def moduli(p: Parameters) -> tuple[float, float]:
    """Return Young's modulus of the lower and of the upper layer [Pa]."""
    return p.youngs_modulus, p.youngs_modulus * p.modulus_ratio


def bending_stiffness(p: Parameters) -> float:
    """Return D of the bonded section per width [N m]."""
    (e1, e2), (h1, h2) = moduli(p), layer_thicknesses(p)
    a1, a2 = e1 * h1, e2 * h2
    return (e1 * h1**3 + e2 * h2**3) / 12.0 + a1 * a2 / (a1 + a2) * (0.5 * thickness(p)) ** 2


def period(p: Parameters) -> float:
    """Return the period of the first bending vibration of a strip held at one end, in its fluid [s]."""
    mass = DENSITY * thickness(p)
    if p.added_mass and p.fluid_ratio > 0.0:
        mass += math.pi / 4.0 * p.fluid_ratio * DENSITY * width(p)
    return 2.0 * math.pi / 3.516 * p.length**2 * math.sqrt(mass / bending_stiffness(p))


def duration(p: Parameters) -> float:
    """Return the duration of the run [s]."""
    fastest = max(p.speed, math.sqrt(0.2 * p.length * gravity(p)) if p.robot == "ball" else 0.0)
    flight = {"ball": 1.2, "bat": 1.2, "box": 12.0}.get(p.robot, 0.0) * p.length / fastest
    if p.robot in ("drop", "pile") and p.gravity > 0.0:
        flight = 1.5 * p.speed / gravity(p)
    return float(f"{max(flight, 0.0) + (PERIODS * period(p) if p.robot not in ('ball', 'box') else 0.0):.3g}")


def gravity(p: Parameters) -> float:
    """Return the size of gravity [m/s²]."""
    return p.gravity * USUAL_LENGTH / p.length


def height(p: Parameters) -> float:
    """Return the height from which what falls has the speed at the ground [m]."""
    if p.gravity == 0.0:
        return 0.01 * p.length
    return min(p.speed**2 / (2.0 * gravity(p)), HIGHEST * p.length / USUAL_LENGTH)


def barrier(p: Parameters) -> float:
    """Return the barrier distance [m]."""
    return p.barrier * p.length / USUAL_LENGTH


def strip_mass(p: Parameters) -> float:
    """Return the mass of a strip [kg]."""
    lower, upper = layer_thicknesses(p)
    return DENSITY * width(p) * p.length * (lower + p.covered * upper)


def scene_of(p: Parameters) -> dict:
    """Return the content of the scene file of a case."""
    content = {
        "schema": 1,
        "name": f"stress_{p.robot}",
        "title": f"Stress case: {p.robot}",
        "description": p.text(),
        "duration": duration(p),
        "gravity": [0.0, 0.0, -gravity(p)],
        "materials": {"lower": _material(p, 0), "upper": _material(p, 1)},
        "stimuli": {"stimulus": {"minimum": -1.0, "maximum": 1.0, "schedule": _schedule(p)}},
        "rods": [],
        "solver": _solver(p),
        "output": {"rate": LOOKS / duration(p), "marker_rate": LOOKS / duration(p)},
    }
    if p.robot not in ("beam", "swimmer", "hub"):
        content["contact"] = _contact(p)
    if p.fluid_ratio > 0.0:
        density = p.fluid_ratio * DENSITY
        content["fluid"] = {"density": density, "drag_along": 0.1, "drag_across": 1.0, "added_mass": p.added_mass}
    BUILDERS[p.robot](p, content)
    return content


def _material(p: Parameters, layer: int) -> dict:
    # a Kelvin–Voigt time that damps the first bending vibration by 5 % of the critical damping
    time = 0.1 / (2.0 * math.pi / period(p)) if p.damped and p.integrator != "implicit_midpoint" else 0.0
    return {
        "youngs_modulus": moduli(p)[layer],
        "poisson_ratio": 0.4,
        "density": DENSITY,
        "retardation_time": float(f"{time:.3g}"),
    }


def _schedule(p: Parameters) -> dict:
    end = duration(p)
    if p.stimulus == "step":
        return {"type": "square", "low": 0.0, "high": 1.0, "period": 2.0 * end, "start": 0.1 * end}
    if p.stimulus == "square":
        return {"type": "square", "low": 0.0, "high": 1.0, "period": 0.25 * end, "rise_time": 0.0}
    if p.stimulus == "noise":
        values = np.random.default_rng(NOISE_SEED).normal(0.5, 0.05, NOISE_STEPS).clip(-1.0, 1.0)
        times = np.linspace(0.0, end, NOISE_STEPS)
        return {"type": "table", "times": times.tolist(), "values": [float(f"{v:.4g}") for v in values]}
    return {"type": "ramp", "start": 0.0, "end": 0.5 * end, "from": 0.0, "to": 1.0}


def _solver(p: Parameters) -> dict:
    chosen = {"model": p.model, "dimension": p.dimension, "integrator": p.integrator}
    return chosen | ({"tolerance": p.tolerance} if p.dt is None else {"dt": p.dt})


def _contact(p: Parameters) -> dict:
    content = {
        "barrier_distance": barrier(p),
        "stiffness": p.contact_stiffness,
        "friction": {"coefficient": p.friction, "speed_threshold": p.threshold},
    }
    if p.restitution is not None:
        content["restitution"] = p.restitution
    return content


def _strip(p: Parameters, name: str = "strip", start=(0.0, 0.0, 0.0), direction=(1.0, 0.0, 0.0), **more) -> dict:
    lower, upper = layer_thicknesses(p)
    along = np.array(direction) / np.linalg.norm(direction)
    normal = np.cross(np.cross(along, [0.0, 0.0, 1.0]), along) if abs(along[2]) < 0.9 else np.array([1.0, 0.0, 0.0])
    eigenstrain = {"stimulus": "stimulus", "gain": p.eigenstrain} if p.eigenstrain else None
    layers = [
        {"name": "low", "material": "lower", "thickness": lower},
        {"name": "high", "material": "upper", "thickness": upper},
    ]
    if eigenstrain:
        layers[0]["eigenstrain"] = eigenstrain
    if p.covered < 1.0:
        layers[1]["interval"] = [0.0, p.covered * p.length]
    if p.turns:
        for layer in layers:
            layer["natural_curvature"] = 2.0 * math.pi * p.turns / p.length
    path = {"shape": "straight", "start": [float(x) for x in start], "direction": along.tolist(), "length": p.length}
    return {
        "name": name,
        "width": width(p),
        "path": path,
        "normal": normal.tolist(),
        "stations": p.stations,
        "layers": layers,
        **more,
    }


def _held(name: str, position=(0.0, 0.0, 0.0), **motion) -> dict:
    return {"name": name, "position": list(position), "motion": {"type": "prescribed", **motion}}


def _ground() -> list[dict]:
    return [{"name": "ground", "type": "plane", "point": [0.0, 0.0, 0.0], "normal": [0.0, 0.0, 1.0]}]


def _below(p: Parameters) -> float:
    """Return the distance from a strip's path, between its layers, to its lower face, or to the upper one if that is
    farther [m].
    """
    return max(layer_thicknesses(p))


def _clear(p: Parameters) -> float:
    """Return the height of a strip whose face is three barrier distances over the ground [m]."""
    return _below(p) + 3.0 * barrier(p)


def _ball_radius(p: Parameters) -> float:
    return 0.1 * p.length


def _beam(p: Parameters, content: dict) -> None:
    content["bodies"] = [_held("wall")]
    content["rods"] = [_strip(p, clamp_start="wall")]


def _coil(p: Parameters, content: dict) -> None:
    content["gravity"] = [0.0, 0.0, 0.0]
    _beam(p, content)


def _drop(p: Parameters, content: dict) -> None:
    slope = (math.cos(0.3), 0.0, math.sin(0.3))
    content["rods"] = [_strip(p, start=(0.0, 0.0, _clear(p) + height(p)), direction=slope)]
    content["obstacles"] = _ground()


def _crawler(p: Parameters, content: dict) -> None:
    content["rods"] = [_strip(p, start=(0.0, 0.0, layer_thicknesses(p)[0] + 0.5 * barrier(p)))]
    content["obstacles"] = _ground()
    content["contact"]["friction"] |= {"forward": 0.3 * p.friction, "backward": p.friction}


def _ball(p: Parameters, content: dict) -> None:
    radius = _ball_radius(p)
    ball = _free_ball(p, (0.3 * p.length, 0.0, 1.2 * radius + 3.0 * barrier(p)), (0.3, 0.0, -1.0))
    content["bodies"] = [_held("hook", (0.0, 0.0, 5.0 * p.length)), ball]
    content["rods"] = [_strip(p, start=(0.0, 0.0, 5.0 * p.length), clamp_start="hook")]
    content["obstacles"] = _ground()


def _free_ball(p: Parameters, position, direction) -> dict:
    velocity = p.speed * np.array(direction) / np.linalg.norm(direction)
    return {
        "name": "ball",
        "position": [float(x) for x in position],
        "motion": {"type": "free", "mass": p.mass_ratio * strip_mass(p), "velocity": velocity.tolist()},
        "surface": {"shape": "sphere", "radius": _ball_radius(p)},
    }


def _bat(p: Parameters, content: dict) -> None:
    radius, way = _ball_radius(p), 0.6 * p.length
    gap = radius + _below(p) + 3.0 * barrier(p)
    time = 1.5 * way / p.speed  # the cubic smoothstep is fastest half way, by 1.5
    there = (-gap - 0.2 * p.length, 0.0, -0.7 * p.length)
    bat = _held("bat", there, times=[0.0, time], displacements=[[0.0] * 3, [way, 0.0, 0.0]])
    content["bodies"] = [_held("hook"), bat | {"surface": {"shape": "sphere", "radius": radius}}]
    content["rods"] = [_strip(p, direction=(0.0, 0.0, -1.0), clamp_start="hook")]


def _pile(p: Parameters, content: dict) -> None:
    rise = 2.0 * thickness(p) + 3.0 * barrier(p)  # rods have round surfaces about their neutral axes
    lowest = _clear(p) + height(p)
    rods = []
    for index in range(3):
        turn = 0.0 if p.dimension == 2 else 1.1 * index
        along = np.array([math.cos(turn), math.sin(turn), 0.0])
        shift = 0.05 * p.length * index * np.array([1.0, 0.0, 0.0])
        start = shift - 0.5 * p.length * along + np.array([0.0, 0.0, lowest + index * rise])
        rods.append(_strip(p, f"strip{index}", start, along))
    content["rods"] = rods
    content["obstacles"] = _ground()
    content["contact"]["rods"] = True


def _swimmer(p: Parameters, content: dict) -> None:
    content["gravity"] = [0.0, 0.0, 0.0]
    mass = p.mass_ratio * strip_mass(p)
    inertia = [0.1 * mass * p.length**2] * 3
    motion = {"type": "free", "mass": mass, "inertia": inertia}
    content["bodies"] = [{"name": "head", "position": [0.0] * 3, "motion": motion}]
    content["rods"] = [_strip(p, clamp_start="head")]


def _hub(p: Parameters, content: dict) -> None:
    mass = p.mass_ratio * strip_mass(p)
    motion = {"type": "free", "mass": mass, "inertia": [0.01 * mass * p.length**2] * 3}
    motion["angular_velocity"] = [0.0, 0.5 / period(p), 0.0]
    content["bodies"] = [{"name": "hub", "position": [0.0] * 3, "motion": motion}]
    sides = [(1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)] + ([(0.0, 1.0, 0.0), (0.0, -1.0, 0.0)] if p.dimension == 3 else [])
    content["rods"] = [_strip(p, f"arm{i}", direction=side, clamp_start="hub") for i, side in enumerate(sides)]


def _box(p: Parameters, content: dict) -> None:
    content["gravity"] = [0.0, 0.0, 0.0]
    half = p.length
    content["rods"] = [_strip(p, start=(0.0, 0.0, 5.0 * p.length), clamp_start="hook")]
    ball = _free_ball(p, (0.1 * half, 0.0, -0.2 * half), (1.0, 0.0, 0.62))
    content["bodies"] = [_held("hook", (0.0, 0.0, 5.0 * p.length)), ball]
    walls = WALLS if p.dimension == 3 else [wall for wall in WALLS if wall[1] != 1]
    content["obstacles"] = [_wall(p, half, *wall) for wall in walls]


def _wall(p: Parameters, half: float, name: str, axis: int, inward: float) -> dict:
    """Return a face of the box: a plate that ends beyond its corners."""
    deep = 0.5 * half
    position, size = [0.0] * 3, [2.0 * half + 4.0 * deep] * 3
    position[axis], size[axis] = -inward * (half + deep), 2.0 * deep
    return {"name": name, "type": "box", "position": position, "size": size}


BUILDERS = {
    "beam": _beam,
    "coil": _coil,
    "drop": _drop,
    "crawler": _crawler,
    "ball": _ball,
    "bat": _bat,
    "pile": _pile,
    "swimmer": _swimmer,
    "hub": _hub,
    "box": _box,
}
