"""Ribbons that touch surfaces have a width and a sole."""

import numpy as np
import pytest
from support.sample_scenes import GROUND, ball, contact, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.verification.validate.contacts import upright


def test_a_strip_falls_beyond_the_slope_on_which_its_border_holds_it():
    assert upright(1.05) < 0.0  # it lies on its face's other side after half a second


@pytest.mark.parametrize("model", ["laminate", "two_rod"])
@pytest.mark.parametrize("tilt", [1e-6, 1e-2])
def test_a_crawler_in_space_stays_on_its_sole_under_gravity_that_is_tilted(model, tilt):
    changes = [f"solver.model={model}", "solver.dimension=3"]
    level = Simulator(load_scene("crawling_inchworm", changes))
    tilted = Simulator(load_scene("crawling_inchworm", [*changes, f"gravity=[0, {10 * tilt}, -10]"]))
    for simulator in (level, tilted):
        simulator.run(2.4)
    assert np.abs(tilted.frame().directors[:, 1]).max() < 0.01 * tilt  # it does not roll
    assert tilted.com[0] - tilted.start_com[0] == pytest.approx(level.com[0] - level.start_com[0], rel=1e-4)


def test_a_flat_ribbon_rests_as_high_with_its_borders_as_without():
    found = []
    for dimension in (2, 3):
        strip = rod([layer("bottom"), layer("top", thickness=2e-3)], start=(0, 0, 2.5e-3))
        content = scene([strip], gravity=[0, 0, -10.0], obstacles=[GROUND], contact=contact())
        simulator = Simulator(load_scene(content), model="laminate", dimension=dimension)
        assert simulator.solve_static().stable
        found.append(simulator.positions)
    assert found[0] == pytest.approx(found[1], abs=1e-10)


def test_a_ball_sinks_no_deeper_into_a_flat_ribbon_than_onto_its_middle():
    # its borders are w²/8R lower under the ball than its middle: felt there alone, it would sink by as much
    radius, width = 0.02, 10e-3
    heights = []
    for wide in (1e-3, width):
        strip = rod(
            [layer()], length=0.04, stations=41, width=wide, start=(-0.02, 0, 0), clamp_start="a", clamp_end="b"
        )
        stands = [
            {"name": n, "position": [x, 0, 0], "motion": {"type": "prescribed"}} for n, x in (("a", -0.02), ("b", 0.02))
        ]
        content = scene(
            [strip],
            gravity=[0, 0, -1.0],
            bodies=[*stands, ball((0, 0, radius + 0.5e-3 + 0.9e-3), radius)],
            contact=contact(),
            materials={"gel": {"youngs_modulus": 1e11, "poisson_ratio": 0.5, "density": 1.0}},
        )
        simulator = Simulator(load_scene(content))
        simulator.solve_static()
        heights.append(simulator.bodies["ball"].position[2])
    assert abs(heights[1] - heights[0]) < 0.2 * width**2 / (8.0 * radius)
