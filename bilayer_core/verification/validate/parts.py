"""Small scenes as mappings, of which validation cases and tests are made."""

from __future__ import annotations

import copy

PAPER = {"model": "two_rod", "dimension": 3, "integrator": "implicit_euler", "dt": 1e-3}
"""The paper's method, by which `scene` is solved where nothing else is asked for."""
GEL = {"youngs_modulus": 1e8, "poisson_ratio": 0.5, "density": 1000.0}
GROUND = {"name": "ground", "type": "plane", "point": [0, 0, 0], "normal": [0, 0, 1]}


def layer(name="only", thickness=1e-3, material="gel", **more):
    """Return one layer."""
    return {"name": name, "material": material, "thickness": thickness, **more}


def rod(layers, length=0.1, stations=21, start=(0, 0, 0), name="rod", width=0.01, **more):
    """Return a straight beam along x, its normal along z."""
    path = {"shape": "straight", "start": list(start), "direction": [1, 0, 0], "length": length}
    return {
        "name": name,
        "width": width,
        "path": path,
        "normal": [0, 0, 1],
        "stations": stations,
        "section": "beam",
        "layers": layers,
        **more,
    }


def scene(rods, solver=None, **more):
    """Return a scene without gravity, contact, stimuli or bodies, solved by the paper's method changed by `solver`."""
    base = {
        "schema": 1,
        "name": "sample",
        "title": "A sample",
        "duration": 1.0,
        "gravity": [0, 0, 0],
        "materials": {"gel": GEL},
        "rods": rods,
        "solver": {**PAPER, **(solver or {})},
    }
    return copy.deepcopy({**base, **more})


def fixed(name="wall", position=(0, 0, 0), **more):
    """Return a body at rest that holds clamps."""
    return {"name": name, "position": list(position), "motion": {"type": "prescribed"}, **more}


def ball(position, radius=0.02, mass=2.7e-3, **motion):
    """Return a free ball."""
    return {
        "name": "ball",
        "position": list(position),
        "motion": {"type": "free", "mass": mass, **motion},
        "surface": {"shape": "sphere", "radius": radius},
    }


def contact(barrier_distance=1e-3, coefficient=None, speed_threshold=1e-4):
    """Return the contact settings of the paper, with friction if a coefficient is given."""
    friction = {"coefficient": coefficient, "speed_threshold": speed_threshold}
    return {
        "barrier_distance": barrier_distance,
        "stiffness": 1e7,
        "friction": friction if coefficient is not None else None,
    }
