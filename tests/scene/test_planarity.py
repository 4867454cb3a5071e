"""Which scenes stay in a plane, and what is said of those that do not."""

import pytest
from support.planar_scenes import FREE
from support.sample_scenes import contact, layer, rod, scene

from bilayer_core.errors import SceneError
from bilayer_core.model.plan import best_dimension, make_plan
from bilayer_core.scene.bundled import bundled_scenes
from bilayer_core.scene.loader import load_scene

BUNDLED = {
    "arch": (2, "all stays in the plane y = 0"),
    "awn": (3, "rods.awn leaves the plane with normal (0, 0.390683, -0.920525) through (0.003, 0, 0) m"),
    "bending": (2, "all stays in the plane y = 0"),
    "cantilever": (2, "all stays in the plane y = 0"),
    "chiral_pod": (3, "rods.valve.layers.inner.fibres turn the rod out of the plane y = 0"),
    "crawling_dual_leg": (3, "rods.hind_foot leaves the plane y = 0"),
    "crawling_film": (2, "all stays in the plane y = 0"),
    "crawling_inchworm": (2, "all stays in the plane y = 0"),
    "films": (3, "rods.all_around leaves the plane y = -0.025 m"),
    "flagellum": (2, "all stays in the plane y = 0"),
    "gripping": (3, "rods.arm_1 leaves the plane y = 0"),
    "gripping_friction": (3, "rods.arm_1 leaves the plane y = 0"),
    "helical_ribbon": (3, "rods.ribbon.layers.lower.fibres turn the rod out of the plane y = 0"),
    "heated_finger": (2, "all stays in the plane y = 0"),
    "helix": (3, "rods.strip.layers.helical.natural_twist turns the rod out of the plane y = 0"),
    "jumping": (2, "all stays in the plane y = 0"),
    "knot": (3, "rods.thread leaves the plane with normal (0.0703485, -0.997522, 0) through (-0.15, 0, -0.012) m"),
    "lattice": (2, "all stays in the plane y = 0"),
    "ring": (2, "all stays in the plane y = 0"),
    "six_finger_gripper": (3, "rods.finger_1 leaves the plane y = 0"),
    "steered_walker": (
        3,
        "rods.fore_1 leaves the plane with normal (0.342, -0.9397, 0) through (0.005, 0.025, 0.0182) m",
    ),
    "swimming": (3, "rods.arm_1 leaves the plane y = 0"),
}


def test_of_every_bundled_scene_is_said_whether_it_stays_in_a_plane():
    assert {name: best_dimension(load_scene(name)) for name in bundled_scenes()} == BUNDLED


def with_body(**body):
    return {"bodies": [{"name": "thing", "position": [0, 0, -0.05], "motion": {"type": "prescribed"}, **body}]}


def with_load(**load):
    return {"loads": [{"name": "tug", "rod": "rod", "position": 0.05, **load}]}


CUBE = {"shape": "box", "size": [0.01, 0.01, 0.01]}
FAR = {"name": "ground", "type": "plane", "point": [0, 0, -1], "normal": [0, 0, 1]}
LEAVES = {
    "gravity leaves": {"gravity": [0, 1, -10]},
    "fluid.velocity leaves": {"fluid": {"drag_along": 1, "drag_across": 1, "velocity": [0, 1, 0]}},
    "loads.tug.force leaves": with_load(force=[1, 1e-3, 0]),
    "loads.tug.force leaves the": with_load(force=[1, 0, 1e-3], frame="material"),
    "bodies.thing.motion.displacements leaves": with_body(
        motion={"type": "prescribed", "times": [0, 1], "displacements": [[0, 0, 0], [0, 1, 0]]}
    ),
    "bodies.thing.motion.rotations leaves": with_body(
        motion={"type": "prescribed", "times": [0, 1], "rotations": [[0, 0, 0], [1, 0, 0]]}
    ),
    "bodies.thing.motion.axis leaves": with_body(motion={"type": "guided", "axis": [0, 1, 1], "mass": 1}),
    "bodies.thing.position leaves": with_body(motion=FREE, position=[0, 0.01, -0.05]),
    "bodies.thing.motion.velocity leaves": with_body(motion=FREE | {"velocity": [0, 1, 0]}),
    "bodies.thing.motion.angular_velocity leaves": with_body(motion=FREE | {"angular_velocity": [0, 1, 1]}),
    "bodies.thing.motion.inertia, of which no": with_body(motion=FREE, rotation=[0.3, 0, 0]),
    "points by which bodies.thing touches are not": with_body(
        motion=FREE, contact_points=[{"position": [0, 1e-3, 0], "length": 0.01, "offset": 1e-3}]
    ),
    "bodies.thing.surface is not": with_body(surface=CUBE, rotation=[0.3, 0, 0]),
    "stimuli.sun.light.from leaves": {
        "stimuli": {"sun": {"schedule": {"type": "hold", "value": 1}, "light": {"from": [0, 0.1, 1]}}}
    },
    "contact.friction.axis leaves": {
        "contact": {**contact(), "friction": {"coefficient": 1, "speed_threshold": 1e-4, "axis": [1, 0.1, 0]}}
    },
    "obstacles.ground.grain leaves": {"obstacles": [FAR | {"grain": [1, 1, 0]}]},
    "bodies.thing.surface.grain leaves": with_body(surface=CUBE | {"grain": [1, 0, 0]}, rotation=[0, 0, 0.1]),
    "obstacles.hill is not": {
        "obstacles": [{"name": "hill", "type": "plane", "point": [0, 0, -1], "normal": [0, 1, 3]}]
    },
    "obstacles.rock is not": {
        "obstacles": [{"name": "rock", "type": "sphere", "position": [0, 1e-3, -0.1], "radius": 0.05}]
    },
    "obstacles.log is not": {
        "obstacles": [{"name": "log", "type": "cylinder", "position": [0, 0.04, -1], "axis": [0, 1, 0]} | {
            "radius": 0.05, "length": 0.05}]
    },
}  # fmt: skip


@pytest.mark.parametrize("message", LEAVES)
def test_what_leaves_the_plane_is_named(message):
    content = scene([rod([layer()])], contact=contact(coefficient=0.3)) | LEAVES[message]
    with pytest.raises(
        SceneError, match=f"sample: solver.dimension: found 2, but .*{message}.* plane y = 0; for this scene"
    ):
        make_plan(load_scene(content), dimension=2)
    assert make_plan(load_scene(content)).dimension == 3


STAYS = {
    "a rail": with_body(motion={"type": "guided", "axis": [1, 0, 1], "mass": 1}),
    "a turned cube": with_body(motion=FREE, surface=CUBE, rotation=[0, 0.3, 0]),
    "a point beside the plane on a body that does not turn": with_body(
        contact_points=[{"position": [0, 1e-3, 0], "length": 0.01, "offset": 1e-3}]
    ),
    "two feet, left and right": with_body(
        motion=FREE,
        contact_points=[{"position": [0, y, 0], "length": 0.01, "offset": 1e-3} for y in (-1e-3, 1e-3)],
    ),
    "grain along the slope, and across": {
        "obstacles": [FAR | {"grain": [1, 0, 0]}],
        "contact": {**contact(), "friction": {"coefficient": 1, "speed_threshold": 1e-4, "axis": [0, 1, 0]}},
    },
    "a slope": {"obstacles": [{"name": "hill", "type": "plane", "point": [0, 5, -1], "normal": [1, 0, 3]}]},
    "a log that runs on": {
        "obstacles": [{"name": "log", "type": "cylinder", "position": [0, 0.04, -1], "axis": [0, 1, 0]} | {
            "radius": 0.05, "length": 0.1}]
    },
    "a pole": {
        "obstacles": [
            {"name": "pole", "type": "cylinder", "position": [0, 0, -1], "axis": [1, 0, 1], "radius": 0.05, "length": 1}
        ]
    },
}  # fmt: skip


@pytest.mark.parametrize("what", STAYS)
def test_what_stays_in_the_plane_is_allowed(what):
    content = scene([rod([layer()])], contact=contact(coefficient=0.3)) | STAYS[what]
    plan = make_plan(load_scene(content), dimension=2)
    assert plan.dimension == 2
    assert plan.reasons["dimension"] == "asked for: all stays in the plane y = 0"
    assert plan.terms["twisting"] == "skipped: nothing twists in a plane"
