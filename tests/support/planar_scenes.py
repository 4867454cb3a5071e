"""Scenes that stay in a vertical plane, along an axis or not."""

import numpy as np
from support.sample_scenes import GEL, GROUND, ball, contact, fixed, layer, rod, scene

AHEAD = {"y = 0": (1.0, 0.0, 0.0), "oblique": (0.8, 0.6, 0.0)}
FREE = {"type": "free", "mass": 1e-3, "inertia": [2e-8, 3e-8, 4e-8]}
HUBS = {"prescribed": {"type": "prescribed"}, "free": FREE}


def in_plane(ahead, along, up):
    """A vector of the vertical plane through the origin that holds `ahead`."""
    return [along * ahead[0], along * ahead[1], up]


def turn_to(ahead):
    """Rotation about z that takes x to `ahead`."""
    return [0, 0, float(np.arctan2(ahead[1], ahead[0]))]


def everything_in_plane(ahead, hub="prescribed", stations=6):
    """Two bilayer arms of a hub over a ball on the ground in a vertical plane: every force at work.

    They are as wide as a layer is thick: a plane does not see that the border of a wide one is farther from the ball.
    """
    spacing, across = 1.1e-3, np.cross(ahead, [0, 0, 1])
    active = layer(
        "active", interval=[spacing, spacing * (stations - 2)], eigenstrain={"stimulus": "humidity", "gain": 0.06}
    )
    arm = rod(
        [layer("passive"), active],
        length=spacing * (stations - 1),
        stations=stations,
        name="arm",
        width=1e-3,
        clamp_start="hub",
        pattern={"count": 2},
    )
    arm["path"] |= {"start": in_plane(ahead, 0.002, 0.0425), "direction": list(ahead)}
    point = {"position": [0, 0, -0.0005], "length": 0.01, "offset": 0.0005}
    law = contact(coefficient=0.5, speed_threshold=1e-2) | {"restitution": 0.5}
    law["friction"] |= {"forward": 0.3, "backward": 0.6, "sideways": 0.4}
    jet = {"name": "jet", "rod": "arm", "position": spacing, "force": [1e-3, 2e-3, 0], "frame": "material"}
    return scene(
        [arm],
        gravity=in_plane(ahead, 0.3, -10.0),
        stimuli={"humidity": {"schedule": {"type": "hold", "value": 0.5}}},
        bodies=[
            fixed("hub", (0, 0, 0.0425), rotation=turn_to(ahead), contact_points=[point]) | {"motion": HUBS[hub]},
            ball((0, 0, 0.0209), shell=True) | {"drag": {"coefficient": 0.47}},
        ],
        obstacles=[GROUND],
        contact=law,
        damping={"mass": 2.0},
        materials={"gel": {**GEL, "retardation_time": 1e-3}},
        fluid={"drag_along": 0.3, "drag_across": 1.2, "velocity": in_plane(ahead, 0.1, 0.05), "added_mass": True},
        joints=[
            {
                "name": "knee",
                "type": "hinge",
                "bodies": ["hub", "ball"],
                "point": in_plane(ahead, 0.004, 0.03),
                "axis": list(across),
                "stiffness": 2.0,
                "torsional_stiffness": 1e-3,
                "turning": {
                    "spring": 1e-3,
                    "rest_angle": 0.1,
                    "damping": 1e-7,
                    "friction": 1e-6,
                    "friction_speed": 1.0,
                },
            },
            {
                "name": "strut",
                "type": "slide",
                "bodies": ["ball", "hub"],
                "point": in_plane(ahead, -0.004, 0.032),
                "axis": in_plane(ahead, 0.3, 0.9),
                "stiffness": 2.0,
                "torsional_stiffness": 1e-3,
                "sliding": {"spring": 1.0, "limits": [-1e-3, 1e-5], "limit_stiffness": 1.0, "friction": 1e-4},
            },
        ],
        masses=[{"name": "cargo", "rod": "arm", "position": 2.3 * spacing, "mass": 1e-5}],
        loads=[
            {"name": "tug", "rod": "arm_1", "position": 3.5 * spacing, "force": in_plane(ahead, 2e-3, 3e-3)},
            jet,
            {"name": "crank", "body": "ball", "force": [0, 0, 1e-3], "moment": list(3e-5 * across)},
            {"name": "rotor", "body": "ball", "moment": list(-1e-5 * across), "frame": "material"},
        ],
    )


def touching_rods(ahead, hub="prescribed"):
    """Two ribbons of a hub, one of two layers, and a third rod between them, all nearer than the barrier distance."""
    bodies = [{"name": "hub", "position": [0, 0, 0], "rotation": turn_to(ahead), "motion": HUBS[hub]}]
    arm = rod([layer(), layer("top")], 0.02, 7, name="arm", clamp_start="hub")
    between = rod([layer()], 0.02, 8, name="between")
    below = rod([layer()], 0.015, 5, name="below", clamp_start="hub")
    for part, along, up in ((arm, 0.0, 0.5e-3), (between, -4e-3, -1.9e-3), (below, 0.0, -3.7e-3)):
        part["path"] |= {"start": in_plane(ahead, along, up), "direction": list(ahead)}
    law = contact(coefficient=0.4, speed_threshold=0.1) | {"rods": True}
    return scene([arm, between, below], bodies=bodies, contact=law)


def mechanism(ahead):
    """A bilayer on a mount that moves and turns, a free body at its end, and a rod on that, in a fluid, under loads."""
    across = np.cross(ahead, [0, 0, 1])
    active = layer("active", interval=[0.01, 0.05], eigenstrain={"stimulus": "light", "gain": 0.03})
    arm = rod([layer("passive"), active], 0.06, 13, name="arm", clamp_start="mount", clamp_end="wrist")
    arm["path"] |= {"direction": list(ahead)}
    hand = rod([layer(thickness=0.8e-3)], 0.03, 9, name="hand", clamp_start="wrist")
    hand["path"] |= {"start": in_plane(ahead, 0.06, 0), "direction": [0, 0, -1]}
    hand["normal"] = list(ahead)
    motion = {"type": "prescribed", "times": [0, 0.05], "displacements": [[0, 0, 0], in_plane(ahead, 0.01, 0.02)]}
    motion["rotations"] = [[0, 0, 0], list(0.4 * across)]
    wrist = {"name": "wrist", "position": in_plane(ahead, 0.06, 0), "rotation": turn_to(ahead), "motion": FREE}
    tug = {"name": "tug", "rod": "hand", "position": 0.02, "force": in_plane(ahead, 0.02, 0.01)}
    jet = {"name": "jet", "rod": "arm", "position": 0.033, "force": [0.01, 0.02, 0], "frame": "material"}
    crank = {"name": "crank", "body": "wrist", "moment": list(2e-4 * across)}
    return scene(
        [arm, hand],
        stimuli={"light": {"schedule": {"type": "ramp", "start": 0.01, "end": 0.02, "from": 0, "to": 1}}},
        bodies=[{"name": "mount", "position": [0, 0, 0], "motion": motion}, wrist],
        masses=[{"name": "cargo", "rod": "arm", "position": 0.02, "mass": 1e-4}],
        loads=[tug, jet, crank],
        fluid={"drag_along": 0.3, "drag_across": 1.2, "velocity": in_plane(ahead, 0.1, 0.05), "added_mass": True},
        damping={"mass": 1.0},
        gravity=in_plane(ahead, 0.5, -9.81),
    )


def snap():
    """A free bilayer whose top layer grows within 10 ms."""
    active = layer("active", eigenstrain={"stimulus": "light", "gain": 0.02})
    step = {"type": "table", "times": [0, 0.005, 0.015], "values": [0, 0, 1]}
    return scene([rod([layer(), active])], stimuli={"light": {"schedule": step}})
