"""Strips with fibres at an angle and layers of unlike Poisson's ratios, through the engine."""

import math

import numpy as np
import pytest
from support.evaluations import Problem, check
from support.sample_scenes import GEL, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import SceneError, SimulationError

HUMID = {"stimulus": "humidity", "gain": 0.02}
STIFF = {"along": {"stiffness": 6.0, "swelling": 0.1}, "shear": 1.3}


def crossed(degrees=30.0, width=4e-3, stations=7, ratios=(0.4, 0.4), fibres=STIFF, **more):
    """A clamped strip 0.5 mm thick, of two layers whose fibres cross at right angles."""
    layers = [
        layer(name, h, name, eigenstrain=HUMID, fibres={"angle": math.radians(degrees + turn), **fibres})
        for name, h, turn in (("bottom", 0.2e-3, 0.0), ("top", 0.3e-3, 90.0))
    ]
    gel = {**GEL, "retardation_time": 1e-3}
    return scene(
        [rod(layers, 1.1e-3 * (stations - 1), stations, width=width, section="strip", clamp_start="wall") | more],
        bodies=[fixed()],
        stimuli={"humidity": {"schedule": {"type": "hold", "value": 0.5}}},
        materials={
            name: {**gel, "poisson_ratio": ratio} for name, ratio in zip(("bottom", "top"), ratios, strict=True)
        },
    )


def plain(**how):
    """The same strip without its fibres."""
    content = crossed(**how)
    for own in content["rods"][0]["layers"]:
        del own["fibres"]
    return content


@pytest.mark.parametrize(
    ("content", "dimension"),
    [(crossed(), 3), (crossed(90.0), 2), (plain(ratios=(0.1, 0.45)), 2), (plain(ratios=(0.1, 0.45)), 3)],
)
def test_derivatives_agree_with_differences(content, dimension):
    problem = Problem(content, np.random.default_rng(1), "laminate", dimension=dimension)
    check(problem)
    check(problem, ("viscosity",))


def test_fibres_that_run_across_are_a_layer_that_swells_along_only():
    ends = []
    for how in ({"fibres": {"angle": 0.5 * math.pi, "along": {"swelling": 0.0}}}, {"swelling": "along"}):
        content = plain()
        content["rods"][0]["layers"][1] |= how
        content["rods"][0]["layers"][0]["eigenstrain"] = None
        simulator = Simulator(load_scene(content), model="laminate")
        simulator.solve_static()
        ends.append(simulator.positions)
    assert ends[0] == pytest.approx(ends[1], abs=1e-12)


def test_opposite_angles_and_mirror_images_have_the_same_curvature_and_opposite_twist():
    pattern = {"pattern": {"type": "mirror", "axis": [0, 1, 0], "center": [0, 0.01, 0]}}
    ends = []
    for degrees, more in ((30.0, pattern), (-30.0, {})):
        simulator = Simulator(load_scene(crossed(degrees, stations=15, **more)), model="laminate")
        simulator.solve_static()
        ends += [view.positions for view in simulator.rods.values()]
    rod_itself, image, opposite = ends
    assert abs(rod_itself[-1, 1]) > 1e-4
    assert image == pytest.approx(rod_itself * [1, -1, 1] + [0, 0.02, 0], abs=1e-11)
    assert opposite == pytest.approx(rod_itself * [1, -1, 1], abs=1e-11)


def test_the_work_of_a_stimulus_that_twists_a_strip_is_what_it_gains():
    content = crossed(stations=15) | {"gravity": [0.0, 0.0, -9.81]}
    ramp = {"type": "ramp", "start": 0.005, "end": 0.015, "from": 0.4, "to": 1.0}
    content["stimuli"]["humidity"]["schedule"] = ramp
    content["solver"] = {"integrator": "sdirk2", "dt": 2e-5, "newton_tolerance": 1e-10}
    simulator = Simulator(load_scene(content), model="laminate", budget=True)
    simulator.run(0.02)
    simulator.set_stimulus("humidity", 0.2)  # a jump
    simulator.run(0.01)
    assert abs(simulator.summary()["numerical_energy"]) < 1e-3 * simulator.summary()["largest_energy"]


def test_a_wide_strip_cut_at_45_degrees_folds_since_each_joint_may_bend_either_way():
    content = crossed(45.0, width=20e-3, stations=9, fibres={"along": {"swelling": 0.0}})
    content["rods"][0]["path"]["length"] = 0.1
    content["stimuli"]["humidity"]["schedule"]["value"] = 1.0
    simulator = Simulator(load_scene(content), model="laminate")
    with pytest.raises(SimulationError, match=r"rods\.rod folds: its parts are in two shapes of rest"):
        simulator.solve_static()


def test_fibres_at_an_angle_leave_the_plane():
    with pytest.raises(SceneError, match=r"rods\.rod\.layers\.bottom\.fibres turn the rod out of the plane"):
        Simulator(load_scene(crossed()), model="laminate", dimension=2)


def test_two_rods_cannot_have_fibres():
    with pytest.raises(SceneError, match="no part across the width"):
        Simulator(load_scene(crossed()), model="two_rod")


def test_a_natural_curvature_of_a_layer_beside_fibres_is_refused():
    content = crossed()
    content["rods"][0]["layers"][0]["natural_curvature"] = 3.0
    with pytest.raises(SceneError, match="takes no `natural_curvature`, and bottom has one"):
        Simulator(load_scene(content), model="laminate")
