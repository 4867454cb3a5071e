"""Light with a direction: what faces it, what is hidden from it, and that it is one more stimulus otherwise."""

import math

import numpy as np
import pytest
from support.sample_scenes import layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.kinematics.rotation import rotation_matrix
from bilayer_core.model.build_model import build_model
from bilayer_core.model.lit_elements import light_of, part_seen
from bilayer_core.model.shape_numbers import obstacle_pose, shape_of, signed_distance
from bilayer_core.verification.validate.light import CURVATURE, GAIN, LENGTH, SMALL, lit_strip


def seen_at_start(content, model="laminate"):
    """The record of the light of a scene, and the part that each law sees at the start."""
    built = build_model(load_scene(content), model)
    light, bodies, frames = light_of(built), built.bodies, built.start_director1
    return light, part_seen(light, built.start_position, frames, bodies.start_position, bodies.start_rotation)


def settled(content, **choices):
    simulator = Simulator(load_scene(content), **choices)
    simulator.solve_static()
    return simulator


def bent(angle, **more):
    """Curvatures along a strip that has settled in the light [1/m]."""
    return settled(lit_strip(angle, stations=21, **more), model="laminate").curvatures


def test_robot_and_light_turned_together_bend_the_same():
    content = lit_strip(0.5, stations=21)
    turn = rotation_matrix(np.array([0.4, -0.9, 1.3]))
    turned = lit_strip(0.5, stations=21)
    for key in ("path.direction", "normal"):
        vector = {"path.direction": turn[:, 0], "normal": turn[:, 2]}[key].tolist()
        (turned["rods"][0]["path"] if "." in key else turned["rods"][0])[key.split(".")[-1]] = vector
    shines = turned["stimuli"]["sun"]["light"]
    shines["from"] = (turn @ np.array(shines["from"])).tolist()
    plain, rotated = (settled(c, model="laminate", dimension=3) for c in (content, turned))
    assert rotated.positions == pytest.approx(plain.positions @ turn.T, abs=1e-9)


def test_light_from_the_side_of_the_width_is_weaker_by_its_cosine():
    content = lit_strip(0.0, SMALL, 11)
    content["stimuli"]["sun"]["light"]["from"] = [0, math.sin(1.0), math.cos(1.0)]
    straight, oblique = settled(lit_strip(0.0, SMALL, 11)), settled(content)
    assert not oblique.model.plane.exists  # that light leaves the plane
    assert oblique.curvatures == pytest.approx(math.cos(1.0) * straight.curvatures, rel=1e-3)


@pytest.mark.parametrize("model", ["laminate", "two_rod"])
def test_a_plane_and_space_give_the_same_shape(model):
    flat, space = (settled(lit_strip(0.7, stations=21), model=model, dimension=d).positions for d in (2, 3))
    assert flat == pytest.approx(space, abs=1e-9 * LENGTH)


def test_the_bottom_layer_lit_from_below_is_the_mirror_image_of_the_top_lit_from_above():
    content = lit_strip(0.5, stations=21)
    content["rods"][0]["layers"][0]["eigenstrain"] = content["rods"][0]["layers"][1].pop("eigenstrain")
    content["stimuli"]["sun"]["light"]["from"][2] *= -1.0
    below, above = settled(content).positions, settled(lit_strip(0.5, stations=21)).positions
    assert below == pytest.approx(above * [1, 1, -1], abs=1e-12)


def test_a_layer_by_itself_is_lit_on_either_face():
    lengths = []
    for angle in (0.0, math.pi, 0.5 * math.pi):
        content = lit_strip(angle, stations=6)
        content["rods"][0]["layers"] = content["rods"][0]["layers"][1:]
        lengths.append(float(settled(content).positions[-1, 0]))
    assert lengths[:2] == pytest.approx([LENGTH * (1.0 + GAIN)] * 2, rel=1e-9)
    assert lengths[2] == pytest.approx(LENGTH, rel=1e-9)


def test_where_the_other_layer_ends_both_faces_of_a_layer_are_lit():
    content = lit_strip(math.pi, stations=21)
    content["rods"][0]["layers"][0]["interval"] = [0, 0.05]
    simulator = settled(content, model="laminate")
    model = simulator.model
    assert np.count_nonzero(model.light.side == 0.0) == 10 and np.count_nonzero(model.light.side == 1.0) == 10
    seen = simulator._state.transduction
    assert seen == pytest.approx([0.0] * 10 + [1.0] * 10, abs=1e-12)


def test_a_run_reaches_the_equilibrium_of_statics():
    content = lit_strip(0.8, stations=21, lag=0.05)
    content["materials"]["gel"] = content["materials"]["gel"] | {"retardation_time": 0.02}
    content["solver"] = {"model": "laminate"}
    simulator = Simulator(load_scene(content))
    simulator.run(1.0)
    assert simulator.positions == pytest.approx(settled(content).positions, abs=1e-5 * LENGTH)


def test_a_channel_of_light_is_set_as_any_other():
    simulator = Simulator(load_scene(lit_strip(0.0, SMALL, 11)), model="laminate")
    simulator.set_stimulus("sun", 0.25)
    simulator.solve_static()
    assert simulator.curvatures[5] == pytest.approx(-0.25 * CURVATURE * SMALL / GAIN, rel=1e-3)


SWINGING = {"type": "sine", "mean": 0.5, "amplitude": 0.5, "period": 0.2}


def swinging(**solver):
    content = lit_strip(0.6, 0.05, 11, 0.03, light={"shadow": True})
    content["materials"]["gel"] = content["materials"]["gel"] | {"retardation_time": 2e-3}
    content["stimuli"]["sun"]["schedule"] = SWINGING
    content["output"] = {"rate": 20}
    content["solver"] = {"model": "laminate", **solver}
    return Simulator(load_scene(content))


@pytest.mark.parametrize("solver", [{}, {"integrator": "generalised_alpha", "dt": 2e-3}], ids=["adaptive", "fixed"])
def test_a_saved_state_goes_on_bit_for_bit(solver):
    whole, part = swinging(**solver), swinging(**solver)
    whole.run(0.2)
    part.run(0.1)
    again = swinging(**solver)
    again.load_state(part.save_state())
    again.run(0.1)
    assert np.array_equal(again.save_state(), whole.save_state(), equal_nan=True)


def test_smaller_tolerances_come_nearer_to_the_limit():
    def tip(tolerance):
        simulator = swinging(tolerance=tolerance)
        simulator.run(0.2)
        return simulator.positions[-1]

    exact = tip(1e-7)
    errors = [np.linalg.norm(tip(tolerance) - exact) / LENGTH for tolerance in (1e-3, 1e-4, 1e-5)]
    assert errors[0] > errors[1] > errors[2] and errors[1] < 5e-3 and errors[2] < 1e-3


def test_the_work_of_light_goes_where_the_budget_says():
    content = swinging(tolerance=1e-5).scene
    simulator = Simulator(content, budget=True)
    simulator.run(0.3)
    budget = simulator.budget()
    assert budget["supplied"]["stimulus"] > 0.0
    assert abs(budget["relative_residual"]) < 1e-3
    assert abs(budget["lost"]["numerical"]) < 0.01 * budget["supplied"]["stimulus"]


def test_a_scene_without_light_has_nothing_of_it():
    content = lit_strip(0.0, stations=6)
    del content["stimuli"]["sun"]["light"]
    model = build_model(load_scene(content), "laminate")
    assert not light_of(model).exists and len(model.drives.law_gain) == 1
    assert len(build_model(load_scene(lit_strip(0.0, stations=6)), "laminate").drives.law_gain) == 5


def test_copies_that_are_mirror_images_bend_as_mirror_images():
    content = lit_strip(0.0, stations=11)
    del content["rods"][0]["clamp_start"], content["bodies"]
    content["rods"][0]["path"]["start"] = [0.01, 0, 0]
    content["rods"][0]["pattern"] = {"type": "mirror", "axis": [1, 0, 0], "center": [0, 0, 0]}
    _, seen = seen_at_start(content)
    assert seen == pytest.approx(np.ones(20), abs=1e-12)


def visible(obstacle, direction):
    """V of every element of a strip behind an obstacle."""
    content = lit_strip(0.0, stations=101, light={"from": direction, "shadow": True})
    content |= {"obstacles": [obstacle], "contact": {"barrier_distance": 1e-5, "stiffness": 1e7}}
    light, _ = seen_at_start(content)
    return light.visible[:, 0].copy(), light.softness[0]


OBSTACLES = {
    "ball": {"type": "sphere", "position": [0.05, 0.002, 0.03], "radius": 0.012},
    "box": {"type": "box", "position": [0.05, 0, 0.03], "size": [0.03, 0.02, 0.01], "rotation": [0.3, 0.5, 0.2]},
    "pipe": {"type": "cylinder", "position": [0.04, 0.01, 0.03], "axis": [0.2, 1, 0.4], "radius": 4e-3, "length": 0.05},
}


@pytest.mark.parametrize("direction", [[0, 0, 1], [0.5, 0.1, 1], [-0.8, -0.2, 1]])
@pytest.mark.parametrize("shape", OBSTACLES)
def test_shadows_of_shapes_are_those_of_rays_followed_point_by_point(shape, direction):
    obstacle = OBSTACLES[shape] | {"name": "roof"}
    found, soft = visible(obstacle, direction)
    law = {"barrier_distance": 1e-5, "stiffness": 1}
    (roof,) = load_scene(scene([rod([layer()])], obstacles=[obstacle], contact=law)).obstacles
    shape, (position, turn) = shape_of(roof), obstacle_pose(roof)
    toward = np.array(direction) / np.linalg.norm(direction)
    faces = np.stack([(np.arange(100) + 0.5) * 1e-3, np.zeros(100), np.full(100, 1e-3)], axis=1)
    ray = np.linspace(0.0, 0.15, 4000)[:, None] * toward
    nearest = np.array([signed_distance(shape, (face + ray - position) @ turn).min() for face in faces])
    clear = np.abs(nearest) > 0.55 * soft
    assert np.array_equal(found[clear], (nearest[clear] > 0.0).astype(float))
    assert np.count_nonzero(clear) > 85 and 5 < np.count_nonzero(found == 0.0) < 60
    between = ~clear
    assert np.all(np.abs(found[between] - (0.5 + nearest[between] / soft)) < 0.15)


def test_light_from_below_the_ground_reaches_nothing():
    ground = {"name": "ground", "type": "plane", "point": [0, 0, -0.1], "normal": [0, 0, 1]}
    assert np.all(visible(ground, [1, 0, -0.1])[0] == 0.0)
    assert np.all(visible(ground, [1, 0, 0.1])[0] == 1.0)


def test_the_edge_of_a_shadow_that_moves_over_a_strip_leaves_no_step():
    def lit(start):
        content = lit_strip(0.0, SMALL, 21, light={"shadow": True})
        content["rods"].append(rod([layer()], 0.05, 11, (start, 0, 0.02), "roof"))
        return seen_at_start(content, "two_rod")[1]

    starts = np.linspace(0.02, 0.03, 101)
    seen = np.array([lit(start) for start in starts])
    assert np.abs(np.diff(seen, axis=0)).max() < 0.04  # 3/2 of a step over the width of an edge, 1/50
    assert seen.sum(axis=1) == pytest.approx(np.full(101, 10.0), abs=0.05)  # of 20 elements half are covered


def test_a_strip_that_curls_over_itself_is_in_its_own_shadow():
    def curl(shadow):
        path = {"shape": "arc", "start": [0, 0, 0], "direction": [1, 0, 0], "radius": 0.01, "angle": "300 deg"}
        top = layer("top", 1e-4, eigenstrain={"stimulus": "sun", "gain": SMALL, "time_constant": 0.1})
        hook = rod([layer("bottom", 1e-4), top], stations=61) | {"path": path, "normal": [0, 0, 1]}
        shines = {"from": [0, 0, 1], "shadow": shadow}
        stimuli = {"sun": {"schedule": {"type": "hold", "value": 1}, "light": shines}}
        return seen_at_start(scene([hook], stimuli=stimuli))[1]

    free, hidden = curl(False), curl(True)
    assert free.max() > 0.99  # the inner face at the bottom looks up
    assert np.all(hidden <= free) and hidden[free > 0.5].max() < 0.9


def lit_ring(start, **light):
    """A closed ring in the plane y = 0 about the origin whose path begins at an angle [rad] from its lowest point."""
    c, s = math.cos(start), math.sin(start)
    path = {"shape": "arc", "start": [0.01 * s, 0, -0.01 * c], "direction": [c, 0, s], "radius": 0.01, "closed": True}
    outer = layer("outer", 2e-4, eigenstrain={"stimulus": "sun", "gain": 0.02, "time_constant": 0.1})
    ring = rod([outer, layer("inner", 2e-4)], stations=41) | {"path": path | {"angle": "360 deg"}, "normal": [-s, 0, c]}
    shines = {"sun": {"schedule": {"type": "hold", "value": 1}, "light": {"from": [0.5, 0, 1], **light}}}
    content = scene([ring], stimuli=shines, damping={"mass": 5.0})
    content["solver"] = {"tolerance": 1e-5}
    return content


@pytest.mark.parametrize("model", ["laminate", "two_rod"])
def test_where_a_ring_closes_makes_no_difference_to_light(model):
    angle = 2.0 * math.pi * 10 / 40
    shapes = []
    for start in (0.0, angle):
        simulator = Simulator(load_scene(lit_ring(start, shadow=True)), model=model)
        simulator.run(0.2)
        shapes.append(simulator.positions[:40])
    assert np.abs(np.roll(shapes[1], 10, axis=0) - shapes[0]).max() < 1e-7
    assert np.ptp(np.linalg.norm(shapes[0][:, [0, 2]], axis=1)) > 5e-4  # it is no circle any more


def test_a_convex_ring_throws_no_shadow_on_its_outer_face_but_for_soft_edges():
    _, free = seen_at_start(lit_ring(0.0))
    _, hidden = seen_at_start(lit_ring(0.0, shadow=True))
    assert len(free) == 40 and np.count_nonzero(free) in (20, 21)
    assert hidden == pytest.approx(free, abs=0.03)  # light that grazes the next elements, within half of one's length
    assert hidden[free > 0.5] == pytest.approx(free[free > 0.5], abs=1e-12)
