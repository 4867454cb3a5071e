"""What the robot with two legs does, from its scene file alone."""

import numpy as np
import pytest
from support.paper import TWO_RODS
from support.strides import DAMPED, strides

from bilayer_core import Simulator, load_scene

pytestmark = pytest.mark.slow
SCENE = "crawling_dual_leg"


@pytest.fixture(scope="module")
def forward():
    return strides(SCENE, 3)


def test_the_robot_has_the_papers_parameters():
    simulator = Simulator(load_scene(SCENE, [TWO_RODS]))
    nodes = {
        layer: sum(s.node_count for s in simulator.model.strands if s.layer == layer) for layer in ("passive", "active")
    }
    assert nodes == {"passive": 100, "active": 55}
    assert simulator.scene.contact.friction.each_way[:2] == (0.3, 0.6)


def test_every_cycle_moves_it_forward_and_by_the_same_from_the_second_on(forward):
    moved, simulator = forward
    assert 28.7e-3 < moved[1] < 29.7e-3  # where the strides of all integrators and steps lie
    assert moved[2] == pytest.approx(moved[1], rel=0.02)
    assert abs(simulator.com[1]) < 1e-3 * simulator.steps.newton_tolerance * simulator.time
    assert simulator.summary()["converged"] is True


def test_only_its_feet_touch_the_ground(forward):
    _, simulator = forward
    feet = [s for s in simulator.model.strands if s.rod.endswith("_foot")]
    nodes = np.concatenate([s.first_node + np.arange(s.node_count) for s in feet])
    pressed = np.flatnonzero(simulator.contact_forces[:, 2])
    assert sorted(nodes) == pressed.tolist()


def test_it_walks_faster_than_the_inchworm_crawls(forward):
    inchworm, _ = strides("crawling_inchworm", 2)
    assert forward[0][1] > 2.0 * inchworm[1]  # of the same period, materials and friction


def test_it_goes_the_other_way_when_its_friction_is_turned_round():
    moved, _ = strides(SCENE, 2, "contact.friction.forward=0.6", "contact.friction.backward=0.3")
    assert moved[1] < -10e-3


def test_it_does_not_drift_at_rest():
    # Its legs push outwards: smoothed friction lets feet creep at a speed in proportion to its threshold. With that of
    # Table 1, 0.1 mm/s, the drift is ten times the one here.
    changes = [
        "stimuli.humidity.schedule={type: ramp, start: 0 s, end: 1.2 s, from: 0, to: 0.6}",
        "contact.friction.speed_threshold=0.01 mm/s",
        DAMPED,
    ]
    simulator = Simulator(load_scene("crawling_dual_leg", changes))

    def place():
        return np.mean([simulator.bodies[f"{leg}_ankle"].position[0] for leg in ("hind", "fore")])

    simulator.run(1.6)
    start = place()
    simulator.run(0.5)
    assert abs(place() - start) < 0.5 * 1e-5  # 0.01 mm/s


@pytest.mark.parametrize("change", [(), ("solver.tolerance=1e-5",), (DAMPED, "solver.dt=1 ms")])
def test_with_a_film_that_damps_the_stride_is_the_same_over_integrators_and_tolerances(change):
    moved, _ = strides(SCENE, 2, "materials.film.retardation_time=1 ms", *change)
    assert moved[1] == pytest.approx(28.77e-3, abs=0.15e-3)
