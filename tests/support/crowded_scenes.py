"""Scenes in which everything that a model, a dimension and an integrator allow acts at once."""

from support.planar_scenes import AHEAD, everything_in_plane
from support.sample_scenes import everything, layer, rod

from bilayer_core import Simulator, load_scene
from bilayer_core.integrators.integrator_register import INTEGRATORS

MODELS, DIMENSIONS = ("laminate", "two_rod"), (2, 3)
COMBINATIONS = [
    (model, dimension, integrator, stepping)
    for model in MODELS
    for dimension in DIMENSIONS
    for integrator, method in INTEGRATORS.items()
    for stepping in ("fixed", "adaptive")
    if stepping == "fixed" or method.estimate is not None
]
"""All that there are of model, dimension, integrator and stepping."""
DT, TOLERANCE = 1e-3, 1e-3
"""Length of fixed steps [s], and tolerance of adaptive ones: loose, so that some are refused."""
DURATION = 0.05
"""[s]"""
OUTPUT_RATE = 100.0
"""[1/s]"""


def crowded(dimension, viscous=True):
    """Arms of a hub that is moved, over a ball on the ground; a ring that is lit, a bar that falls on a strip, and a
    sledge on a rail.

    `viscous` asks for viscosity, and for joints and guides that dissipate.
    """
    content = everything() if dimension == 3 else everything_in_plane(AHEAD["y = 0"])
    for arm in content["rods"]:
        for grown in arm["layers"][1:]:
            grown["eigenstrain"] |= {"time_constant_rising": 2e-3, "time_constant_falling": 5e-3, "saturation": 0.05}
    lit = layer("lit", thickness=0.3e-3, eigenstrain={"stimulus": "sun", "gain": 0.05, "time_constant": 0.01})
    ring = rod([lit, layer("inner", thickness=0.3e-3)], stations=17, name="ring", width=2e-3)
    ring["path"] = {"shape": "arc", "start": [0.06, 0, 1.2e-3], "direction": [1, 0, 0], "closed": True}
    ring["path"] |= {"radius": 8e-3, "angle": "360 deg"}
    shelf = [layer("lower"), layer("upper", natural_curvature=3.0)]
    if dimension == 3:
        shelf[0]["natural_twist"] = shelf[1]["natural_twist"] = 4.0
    shelf = rod(shelf, 0.02, 7, (0.08, 0, 8e-3), "shelf", clamp_start="post", friction_axis="normal")
    shelf["imperfection"] = {"shape": "bow", "size": 2e-5}
    bar = rod([layer(thickness=0.5e-3)], 0.012, 5, (0.084, 0, 0.0105), "bar")
    content["rods"] += [ring, shelf, bar]
    content["stimuli"]["humidity"]["schedule"] = {
        "type": "square",
        "low": 0.2,
        "high": 0.8,
        "period": 0.016,
        "start": 5e-3,
    }
    content["stimuli"]["sun"] = {
        "schedule": {"type": "sine", "mean": 0.5, "amplitude": 0.5, "period": 0.04},
        "light": {"from": [0.5, 0, 1], "shadow": True},
    }
    hub = content["bodies"][0]["motion"]
    hub |= {"times": [0.01, 0.03], "displacements": [[0, 0, 0], [1e-3, 0, 5e-4]], "top_speed": 0.5}
    fall = {"velocity": [0.05, 0, -0.2]}
    content["bodies"][1]["motion"] |= fall
    rail = {"type": "guided", "mass": 1e-3, "axis": [1, 0, 0], "speed": 0.2}
    rail["sliding"] = {"spring": 5.0, "limits": [-1e-3, 2e-3], "limit_stiffness": 200.0}
    door = {"type": "guided", "mass": 1e-3, "hinge": [0, 1, 0], "inertia": [1e-7] * 3, "angular_speed": 20.0}
    door["turning"] = {"spring": 1e-4, "limits": [-0.1, 0.2], "limit_stiffness": 1e-2}
    if viscous:
        rail["sliding"] |= {"damping": 1e-2, "friction": 1e-3}
        door["turning"] |= {"damping": 1e-7, "friction": 1e-5, "friction_speed": 1.0}
    content["bodies"] += [
        {"name": "post", "position": [0.08, 0, 8e-3], "motion": {"type": "prescribed"}},
        {
            "name": "sledge",
            "position": [0.13, 0, 5.5e-3],
            "motion": rail,
            "surface": {"shape": "sphere", "radius": 5e-3},
        },
        {"name": "door", "position": [0.15, 0, 0.05], "motion": door},
    ]
    if not viscous:
        content["materials"]["gel"].pop("retardation_time")
        for joint in content["joints"]:
            for law in ("turning", "sliding"):
                for loss in ("damping", "friction", "friction_speed"):
                    joint.get(law, {}).pop(loss, None)
    content["obstacles"][0] |= {"grain": [1, 0, 0]}
    content["contact"] |= {"rods": True}
    content["loads"][0]["schedule"] = {"type": "pulse_train", "low": 0, "high": 1, "period": 0.02, "width": 7e-3}
    content["loads"][0]["schedule"] |= {"count": 5, "start": 2e-3}
    content["output"] = {"rate": OUTPUT_RATE}
    content["duration"] = DURATION
    content.pop("solver")
    return content


def crowded_simulator(model, dimension, integrator, stepping, newton_tolerance=None, **more):
    """A simulator of that scene."""
    content = crowded(dimension, viscous=integrator != "implicit_midpoint")
    if newton_tolerance is not None:
        content["solver"] = {"newton_tolerance": newton_tolerance}
    length = {"dt": DT} if stepping == "fixed" else {"tolerance": TOLERANCE}
    return Simulator(load_scene(content), model=model, dimension=dimension, integrator=integrator, **length, **more)
