"""Small scenes as dictionaries, for tests to change and load."""

import copy

GEL = {"youngs_modulus": 1e8, "poisson_ratio": 0.5, "density": 1000.0}
GROUND = {"name": "ground", "type": "plane", "point": [0, 0, 0], "normal": [0, 0, 1]}


def layer(name="only", thickness=1e-3, material="gel", **more):
    """One layer."""
    return {"name": name, "material": material, "thickness": thickness, **more}


def rod(layers, length=0.1, stations=21, start=(0, 0, 0), name="rod", width=0.01, **more):
    """A straight rod along x, its normal along z."""
    path = {"shape": "straight", "start": list(start), "direction": [1, 0, 0], "length": length}
    return {
        "name": name,
        "width": width,
        "path": path,
        "normal": [0, 0, 1],
        "stations": stations,
        "layers": layers,
        **more,
    }


def scene(rods, **more):
    """A scene without gravity, contact, stimuli or bodies."""
    base = {
        "schema": 1,
        "name": "sample",
        "title": "A sample",
        "duration": 1.0,
        "gravity": [0, 0, 0],
        "materials": {"gel": GEL},
        "rods": rods,
    }
    return copy.deepcopy({**base, **more})


def fixed(name="wall", position=(0, 0, 0), **more):
    """A body at rest that holds clamps."""
    return {"name": name, "position": list(position), "motion": {"type": "prescribed"}, **more}


def ball(position, radius=0.02, mass=2.7e-3, **motion):
    """A free ball."""
    return {
        "name": "ball",
        "position": list(position),
        "motion": {"type": "free", "mass": mass, **motion},
        "surface": {"shape": "sphere", "radius": radius},
    }


def contact(barrier_distance=1e-3, coefficient=None, speed_threshold=1e-4):
    """Contact settings of the paper, with friction if a coefficient is given."""
    friction = {"coefficient": coefficient, "speed_threshold": speed_threshold}
    return {
        "barrier_distance": barrier_distance,
        "stiffness": 1e7,
        "friction": friction if coefficient is not None else None,
    }


def everything(stations=6):
    """Two bilayer arms of a hub over a ball on the ground: every force at work."""
    spacing = 1.1e-3
    active = layer(
        "active",
        interval=[spacing, spacing * (stations - 2)],
        eigenstrain={"stimulus": "humidity", "gain": 0.06},
    )
    arm = rod(
        [layer("passive"), active],
        length=spacing * (stations - 1),
        stations=stations,
        start=(0.002, 0, 0.0425),
        name="arm",
        clamp_start="hub",
        pattern={"count": 2},
    )
    point = {"position": [0, 0, -0.0005], "length": 0.01, "offset": 0.0005}
    uneven = contact(coefficient=0.5, speed_threshold=1e-2)
    loads = [
        {"name": "tug", "rod": "arm_1", "position": 3.5 * spacing, "force": [2e-3, -1e-3, 3e-3]},
        {"name": "jet", "rod": "arm", "position": spacing, "force": [1e-3, 2e-3, -1e-3], "frame": "material"},
        {"name": "crank", "body": "ball", "force": [0, 1e-3, 0], "moment": [2e-5, -1e-5, 3e-5]},
        {"name": "rotor", "body": "ball", "force": [1e-3, 0, 0], "moment": [0, 1e-5, 0], "frame": "material"},
    ]
    loads[0]["schedule"] = loads[3]["schedule"] = {"type": "sine", "mean": 1, "amplitude": 0.5, "period": 0.1}
    uneven["friction"] |= {"forward": 0.3, "backward": 0.6, "sideways": 0.4}
    return scene(
        [arm],
        gravity=[0.3, 0.2, -10.0],
        stimuli={"humidity": {"schedule": {"type": "hold", "value": 0.5}}},
        bodies=[fixed("hub", (0, 0, 0.0425), contact_points=[point]), ball((0, 0, 0.0209), shell=True)],
        obstacles=[GROUND],
        contact=uneven,
        damping={"mass": 2.0},
        fluid={"drag_along": 0.3, "drag_across": 1.2, "velocity": [0.1, -0.2, 0.05], "added_mass": True},
        masses=[{"name": "cargo", "rod": "arm", "position": 2.3 * spacing, "mass": 1e-5}],
        loads=loads,
    )
