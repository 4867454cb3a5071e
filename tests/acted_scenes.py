"""A scene on which much may act from outside: a channel, a load, and a body that goes to poses."""

from sample_scenes import GEL, GROUND, contact, layer, rod, scene


def pushed(dimension=2, **solver):
    """A bilayer that falls on the ground, with a channel, a load and a body that can be moved from outside."""
    strip = rod(
        [layer("low"), layer("high", eigenstrain={"stimulus": "heat", "gain": 0.05})],
        length=0.04,
        stations=9,
        start=(0, 0, 3e-3),
        clamp_end="hand",
    )
    still = {"type": "prescribed", "top_speed": 0.5, "top_angular_speed": 20.0}
    return {
        **scene([strip], obstacles=[GROUND], contact=contact(5e-4, 0.3), gravity=[0, 0, -9.81]),
        "materials": {"gel": GEL | {"retardation_time": 5e-3}},
        "bodies": [{"name": "hand", "position": [0.04, 0, 3e-3], "motion": still}],
        "stimuli": {"heat": {"schedule": {"type": "hold", "value": 0.0}}},
        "loads": [{"name": "push", "rod": "rod", "position": 0.01, "force": [0, 0, 1e-3]}],
        "solver": {"dimension": dimension, **solver},
        "duration": 0.2,
    }
