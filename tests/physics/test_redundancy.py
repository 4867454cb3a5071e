"""Joints that hold what is held already are named, and those that cannot follow a prescribed motion are refused."""

import math

import pytest
from support.sample_scenes import fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import SceneError
from bilayer_core.model.plan import make_plan


def block(name, position=(0, 0, 0), **motion):
    """A free box."""
    free = {"type": "free", "mass": 1e-3, "inertia": [1e-7] * 3}
    return {"name": name, "position": list(position), "motion": free | motion}


def joint(name, first, second, kind="hinge", point=(0, 0, 0), **keys):
    """A joint, by default a hinge about y."""
    axis = {"axis": [0, 1, 0]} if kind in ("hinge", "slide", "cylinder") else {}
    return {"name": name, "type": kind, "bodies": [first, second], "point": list(point), **axis, **keys}


def robot(bodies, joints):
    """Bodies in joints, a wall, and a rod that has nothing to do with them."""
    strip = rod([layer()], 0.1, 5, start=(0, 0, 1), name="strip", clamp_start="shelf")
    return load_scene(scene([strip], bodies=[fixed(), fixed("shelf", (0, 0, 1)), *bodies], joints=joints))


def told(content, dimension=3):
    """Warnings about joints."""
    return [line for line in make_plan(content, dimension=dimension).warnings if "prevented already" in line]


def four_bars():
    """Three rigid bars and a wall, in four parallel hinges."""
    corners = {"a": (0, 0, 0), "b": (0, 0, 0.1), "c": (0.1, 0, 0.1), "d": (0.1, 0, 0)}
    bars = [block("left", (0, 0, 0.05)), block("top", (0.05, 0, 0.1)), block("right", (0.1, 0, 0.05))]
    pairs = {"a": ("wall", "left"), "b": ("left", "top"), "c": ("top", "right"), "d": ("right", "wall")}
    return robot(bars, [joint(name, *pair, point=corners[name]) for name, pair in pairs.items()])


def test_a_closed_chain_of_rigid_bodies_is_named_in_space_and_right_in_its_plane():
    (line,) = told(four_bars())
    assert "joints.d: 3 of the 5 motions" in line
    assert all(f"joints.{name}" in line for name in "abc")
    assert told(four_bars(), 2) == []


def test_two_hinges_with_different_axes_between_two_bodies_are_named():
    first, second = joint("first", "wall", "box"), joint("second", "wall", "box", axis=[1, 0, 0])
    (line,) = told(robot([block("box")], [first, second]))
    assert "joints.second: 4 of the 5 motions that it prevents are prevented already, by joints.first" in line


@pytest.mark.parametrize("kind", ["pin", "hinge", "slide", "cylinder", "weld"])
def test_an_open_chain_is_not_named(kind):
    joints = [joint("first", "wall", "box", kind), joint("second", "box", "end", kind, point=(0.1, 0, 0))]
    content = robot([block("box", (0.05, 0, 0)), block("end", (0.2, 0, 0.1))], joints)
    for dimension in (2, 3) if kind in ("hinge", "weld") else (3,):
        assert told(content, dimension) == []


def test_a_joint_that_repeats_a_guide_is_named():
    guided = block("box") | {"motion": {"type": "guided", "hinge": [0, 1, 0], "mass": 1e-3, "inertia": [1e-7] * 3}}
    (line,) = told(robot([guided], [joint("again", "wall", "box")]))
    assert "joints.again: 5 of the 5 motions that it prevents are prevented already, by guides of its bodies" in line


def test_joints_through_bodies_that_hold_rods_are_not_redundant():
    light = [{"name": name, "position": [0.1, 0, 0], "motion": {"type": "free"}} for name in ("inner", "outer")]
    strips = [
        rod([layer()], 0.1, 5, name="first", clamp_start="wall", clamp_end="inner"),
        rod([layer()], 0.1, 5, start=(0.1, 0, 0), name="second", clamp_start="outer", clamp_end="end"),
    ]
    bodies = [fixed(), fixed("end", (0.2, 0, 0)), *light]
    content = scene(strips, bodies=bodies, joints=[joint("knee", "inner", "outer", point=(0.1, 0, 0))])
    assert told(load_scene(content)) == []


def moved(name, rotations=None, **keys):
    """A body on a schedule."""
    motion = {"type": "prescribed", "times": [0.0, 0.5, 1.0], **keys}
    return {"name": name, "position": [0, 0, 0], "motion": motion | ({"rotations": rotations} if rotations else {})}


def test_joints_that_cannot_follow_a_prescribed_motion_are_refused():
    turning = moved("crank", [[0, 0, 0], [0, 0, 0], [1, 0, 0]])
    joints = [joint("first", "wall", "box"), joint("second", "box", "crank", "weld")]
    with pytest.raises(SceneError, match=r"joints.first.*joints.second: cannot follow .* motion of crank from 0.5 s"):
        make_plan(robot([block("box"), turning], joints), dimension=3)


@pytest.mark.parametrize("rotations", [[[0, 0, 0], [0, 0, 0], [0, 1, 0]], [[0, 0, 0], [0, 0, 0], [0, -2, 0]]])
def test_joints_that_can_follow_a_prescribed_motion_are_not_refused(rotations):
    joints = [joint("first", "wall", "box"), joint("second", "box", "crank", "weld")]
    content = robot([block("box"), moved("crank", rotations)], joints)
    assert len(told(content)) == 1  # the weld holds the turn alone


def test_bodies_that_move_together_may_hold_one_between_them():
    ways = {"displacements": [[0, 0, 0], [0.01, 0, 0], [0, 0, 0]]}
    joints = [joint("first", "left", "box", "weld"), joint("second", "box", "right", "weld")]
    make_plan(robot([moved("left", **ways), block("box"), moved("right", **ways)], joints), dimension=3)
    other = {"displacements": [[0, 0, 0], [0.02, 0, 0], [0, 0, 0]]}
    with pytest.raises(SceneError, match="cannot follow the prescribed motion of left and right from 0 s"):
        make_plan(robot([moved("left", **ways), block("box"), moved("right", **other)], joints), dimension=3)


def test_a_closed_chain_that_is_named_still_swings_as_it_should():
    simulator = Simulator(four_bars(), dimension=3, dt=1e-3)
    simulator.run(0.05)
    assert math.isfinite(simulator.energy()["kinetic"])
    assert max(each.distance for each in simulator.joints.values()) < 1e-6


def test_a_body_without_mass_that_only_a_copy_holds_is_a_junction():
    ends = {"tip": 0.1, "tip_1": -0.1}
    pattern = {"count": 2, "angle": "180 deg", "clamp_end": list(ends)}
    legs = rod([layer()], 0.1, 5, clamp_start="wall", pattern=pattern)
    bodies = [{"name": name, "position": [x, 0, 0], "motion": {"type": "free"}} for name, x in ends.items()]
    bodies.append(fixed())
    load_scene(scene([legs], bodies=bodies))
    bodies.append({"name": "none", "position": [0, 0, 0.3], "motion": {"type": "free"}})
    with pytest.raises(SceneError, match="bodies.none.motion.mass: .*nothing has stiffness or inertia there"):
        load_scene(scene([legs], bodies=bodies))
