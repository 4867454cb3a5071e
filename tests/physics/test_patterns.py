"""Copies of a pattern move as the same rods written out one by one, and a mirror image as the image of the motion."""

import copy

import numpy as np
import pytest
from support.sample_scenes import GROUND, contact, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.log.run.memory import MemoryRecorder
from bilayer_core.view.geometry import ribbon_vertices

BOTH = [("laminate", 2), ("laminate", 3), ("two_rod", 2), ("two_rod", 3)]
RAMP = {"type": "ramp", "start": 0, "end": 0.02, "from": 0, "to": 1}
LATER = RAMP | {"start": 0.01, "end": 0.03}
CHANNELS = {"heat": {"schedule": RAMP}, "late": {"schedule": LATER}}
SOLVER = {"integrator": "sdirk2", "dt": 2e-3}
FREE = {"type": "free", "mass": 1e-3, "inertia": [2e-8, 3e-8, 4e-8]}
"""Of the body that each copy holds."""


def arm(start=(0.005, 0, 0), direction=(1, 0, 0), normal=(0, 0, 1), gain=0.02, stimulus="heat", **more):
    growing = layer("active", interval=[0.0, 0.02], eigenstrain={"stimulus": stimulus, "gain": gain})
    bent = rod([layer("passive"), growing], length=0.03, stations=7, width=2e-3, **({"name": "arm"} | more))
    bent["path"] |= {"start": list(start), "direction": list(direction)}
    return bent | {"normal": list(normal)}


def simulated(rods, model, dimension, duration=0.03, **more):
    bodies = [
        fixed("hub"),
        {"name": "cart", "position": [0, 0, 0.05], "motion": FREE},
        {"name": "other", "position": [0, 0, -0.05], "motion": FREE},
    ]
    content = scene(copy.deepcopy(rods), solver=SOLVER, bodies=bodies, stimuli=CHANNELS, gravity=[0.5, 0, -9.81])
    simulator = Simulator(load_scene(content | more), model=model, dimension=dimension)
    simulator.run(duration)
    return simulator


OWN = {"stimuli": {"heat": ["heat", "late"]}, "gains": [1, -1.5], "clamp_start": ["cart", None]}
HALF = np.sqrt(0.5)
# By each type: the pattern, and start, direction, normal of the second copy.
PLACES = {
    "rotation": ({"count": 2}, ([-0.005, 0, 0], [-1, 0, 0], [0, 0, 1])),
    "rotation by an angle": (
        {"count": 2, "axis": [0, 1, 0], "angle": "-45 deg"},
        ([0.005 * HALF, 0, 0.005 * HALF], [HALF, 0, HALF], [-HALF, 0, HALF]),
    ),
    "translation": (
        {"type": "translation", "step": [0.01, 0, 0.02], "count": 2},
        ([0.015, 0, 0.02], [1, 0, 0], [0, 0, 1]),
    ),
    "grid": (
        {"type": "grid", "steps": [[0.1, 0, 0], [0.01, 0, 0.02]], "counts": [1, 2]},
        ([0.015, 0, 0.02], [1, 0, 0], [0, 0, 1]),
    ),
    "mirror": (
        {"type": "mirror", "axis": [0, 0, 1], "center": [0, 0, 0.01]},
        ([0.005, 0, 0.02], [1, 0, 0], [0, 0, -1]),
    ),
    "list": (
        {"type": "list", "placements": [{}, {"rotation": [0, "-90 deg", 0], "position": [0, 0, 0.01]}]},
        ([0, 0, 0.015], [0, 0, 1], [-1, 0, 0]),
    ),
}


@pytest.mark.parametrize(("model", "dimension"), BOTH)
@pytest.mark.parametrize("kind", PLACES)
def test_copies_move_as_the_same_rods_written_out(kind, model, dimension):
    pattern, (start, direction, normal) = PLACES[kind]
    by_pattern = simulated([arm(pattern=pattern | OWN)], model, dimension)
    written = simulated(
        [
            arm(name="arm_0", clamp_start="cart"),
            arm(start, direction, normal, gain=-0.03, stimulus="late", name="arm_1"),
        ],
        model,
        dimension,
    )
    apart = np.abs(by_pattern.positions - written.positions).max()
    assert apart < 1e-12 and np.abs(by_pattern.positions - by_pattern.model.start_position).max() > 1e-4
    assert [strand.name for strand in by_pattern.model.strands] == [strand.name for strand in written.model.strands]


@pytest.mark.parametrize("model", ["laminate", "two_rod"])
def test_copies_touch_each_other_as_rods_written_out_do(model):
    pattern = {"type": "translation", "step": [0, 0, 2.5e-3], "count": 2, "gains": [-1, 1]}
    law = {"contact": contact(1e-3) | {"rods": True}}
    by_pattern = simulated([arm(pattern=pattern, clamp_start="hub")], model, 2, **law)
    both = [arm(gain=-0.02, name="arm_0", clamp_start="hub"), arm((0.005, 0, 2.5e-3), name="arm_1", clamp_start="hub")]
    written = simulated(both, model, 2, **law)
    assert by_pattern.plan.contact_pairs[0].startswith("arm – itself")
    assert np.abs(by_pattern.contact_forces).max() > 1e-3
    assert np.abs(by_pattern.positions - written.positions).max() < 1e-12


MIRROR = {"type": "mirror", "axis": [0.6, 0.8, 0], "center": [-0.06, 0.01, 0.0]}


def reflected(points):
    normal, center = np.array(MIRROR["axis"]), np.array(MIRROR["center"])
    return points - 2.0 * np.outer((points - center) @ normal, normal)


def walker(pattern, **more):
    """A curved strip with everything that has a handedness: natural twist, an imperfection, forward to one side."""
    layers = [
        layer("passive", natural_twist=4.0, natural_curvature=24.0),
        layer("active", interval=[0.0, 0.025], eigenstrain={"stimulus": "heat", "gain": 0.02}, natural_twist=9.0),
    ]
    strip = arm(start=(0.005, 0.002, 1.4e-3), pattern=pattern, friction_axis="across") | {"layers": layers}
    strip["path"] |= {"shape": "arc", "radius": 0.04, "angle": 0.75}
    del strip["path"]["length"]
    return strip | {"imperfection": {"shape": "random", "size": 2e-4, "direction": "both", "seed": 3}} | more


UNEVEN = {"forward": 0.2, "backward": 0.8, "sideways": 0.4}


def moved(model, pattern, friction, **more):
    law = contact(1e-3, coefficient=0.3, speed_threshold=1e-3) | {"rods": False}
    law["friction"] |= friction
    surroundings = {"obstacles": [GROUND], "contact": law, "gravity": [0, 0, -40.0], "bodies": []}
    fluid = {"drag_along": 0.3, "drag_across": 1.2, "added_mass": True}
    solver = {"solver": SOLVER | {"dt": 1e-3, "newton_tolerance": 1e-12}, "damping": {"mass": 20.0}}
    return simulated([walker(pattern, **more)], model, 3, duration=0.04, fluid=fluid, **surroundings, **solver)


# Uneven friction of two bonded rods repeats to 1e-7 m only, that of a shifted copy as well: its coefficients jump where
# nodes of one layer begin to slide the other way.
@pytest.mark.parametrize(("model", "friction"), [("laminate", UNEVEN), ("two_rod", {})])
def test_the_mirror_image_of_a_robot_moves_as_the_image_of_its_motion(model, friction):
    simulator = moved(model, MIRROR, friction)
    first, second = np.split(simulator.positions, 2)
    moved_by = np.abs(first - np.split(simulator.model.start_position, 2)[0]).max()
    assert moved_by > 2e-3 and simulator.summary()["max_contact_force"] > 1e-3
    assert np.abs(second - reflected(first)).max() < 1e-9


@pytest.mark.parametrize("what", ["natural_twist", "friction_axis"])
def test_a_handedness_that_were_not_mirrored_would_show(what):
    """Guards the test above: with the sign of one of them as it is, the image would be elsewhere."""
    pattern = {"type": "list", "placements": [{}, {"rotation": [0, 0, 1.0], "position": [0.2, 0, 0]}]}
    simulator = moved("laminate", pattern, UNEVEN)
    plain = np.split(simulator.positions, 2)[0]
    if what == "friction_axis":
        changed = moved("laminate", pattern, UNEVEN, friction_axis="path")
    else:
        layers = [part | {"natural_twist": -part["natural_twist"]} for part in walker(None)["layers"]]
        changed = moved("laminate", pattern, UNEVEN, layers=layers)
    assert np.abs(np.split(changed.positions, 2)[0] - plain).max() > 1e-7


@pytest.mark.parametrize("model", ["laminate", "two_rod"])
def test_a_mirror_image_is_drawn_as_the_image_of_what_is_drawn(model):
    simulator = simulated([arm(pattern=MIRROR)], model, 3, duration=2e-3, gravity=[0, 0, -9.81])
    memory = MemoryRecorder()
    simulator.run(2e-3, observers=[memory])
    run = memory.run_data()
    corners = {}
    for part in run.description.layers:
        drawn = ribbon_vertices(part, run.positions[:, part.nodes], run.material_frames[:, part.nodes])
        corners[part.name] = drawn[-1].reshape(-1, 3)
    assert list(corners) == ["arm_0/passive", "arm_0/active", "arm_1/passive", "arm_1/active"]
    for name in ("passive", "active"):
        image = reflected(corners[f"arm_0/{name}"])
        apart = np.linalg.norm(image[:, None] - corners[f"arm_1/{name}"], axis=2)
        assert apart.min(axis=1).max() < 1e-7 and apart.min(axis=0).max() < 1e-7
