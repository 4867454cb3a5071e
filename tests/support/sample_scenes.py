"""Small scenes as dictionaries, for tests to change and load."""

from bilayer_core.verification.validate.parts import GEL, GROUND, PAPER, ball, contact, fixed, layer, rod, scene

__all__ = ["GEL", "GROUND", "PAPER", "ball", "contact", "everything", "fixed", "layer", "rod", "scene"]


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
    uneven["restitution"] = 0.5
    dragged = {"drag": {"coefficient": 0.47}}
    uneven["friction"] |= {"forward": 0.3, "backward": 0.6, "sideways": 0.4}
    return scene(
        [arm],
        gravity=[0.3, 0.2, -10.0],
        stimuli={"humidity": {"schedule": {"type": "hold", "value": 0.5}}},
        bodies=[fixed("hub", (0, 0, 0.0425), contact_points=[point]), ball((0, 0, 0.0207), shell=True) | dragged],
        obstacles=[GROUND],
        contact=uneven,
        damping={"mass": 2.0},
        materials={"gel": {**GEL, "retardation_time": 1e-3}},
        fluid={"drag_along": 0.3, "drag_across": 1.2, "velocity": [0.1, -0.2, 0.05], "added_mass": True}
        | {"drag_turning": 2.0},
        joints=[
            {
                "name": "knee",
                "type": "weld",
                "bodies": ["hub", "ball"],
                "point": [0.004, 0.003, 0.03],
                "stiffness": 2.0,
                "torsional_stiffness": 1e-3,
            },
            {
                "name": "strut",
                "type": "cylinder",
                "bodies": ["ball", "hub"],
                "point": [-0.004, 0.002, 0.032],
                "axis": [0.2, -0.3, 0.9],
                "stiffness": 2.0,
                "torsional_stiffness": 1e-3,
                "turning": {
                    "spring": 1e-3,
                    "rest_angle": 0.1,
                    "damping": 1e-7,
                    "friction": 1e-6,
                    "friction_speed": 1.0,
                },
                "sliding": {"spring": 1.0, "limits": [-1e-3, 1e-5], "limit_stiffness": 1.0, "friction": 1e-4},
            },
        ],
        masses=[{"name": "cargo", "rod": "arm", "position": 2.3 * spacing, "mass": 1e-5}],
        loads=loads,
    )


HALF_SIZES = {
    "plane": (0.0, 0.0, 0.0),
    "sphere": (0.0, 0.0, 0.0),
    "box": (0.3, 0.2, 0.15),
    "cylinder": (0.25, 0.25, 0.2),
}
"""Of shapes along their axes [m], for tests of shapes by themselves."""
