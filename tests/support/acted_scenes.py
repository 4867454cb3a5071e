"""Scenes on which much may act from outside."""

from support.sample_scenes import GEL, GROUND, contact, layer, rod, scene


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


TWO_CHANNELS = """
schema: 1
name: two_channels
title: A strip whose layers are driven by two channels
duration: 10
materials:
  soft: {youngs_modulus: 1e6, density: 1000, poisson_ratio: 0.5, retardation_time: 10 ms}
stimuli:
  heat: {minimum: 0, maximum: 1, schedule: {type: hold, value: 0}}
  light: {minimum: 0, maximum: 1, schedule: {type: hold, value: 0.5}}
rods:
  - name: strip
    width: 10 mm
    stations: 11
    path: {shape: straight, start: [0, 0, 0], direction: [1, 0, 0], length: 60 mm}
    normal: [0, 0, 1]
    clamp_start: wall
    layers:
      - {name: lower, material: soft, thickness: 1 mm, eigenstrain: {stimulus: heat, gain: 3 %}}
      - {name: upper, material: soft, thickness: 1 mm, eigenstrain: {stimulus: light, gain: 3 %}}
bodies:
  - {name: wall, position: [0, 0, 0], motion: {type: prescribed}}
"""
