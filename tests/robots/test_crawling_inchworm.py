"""What the inchworm does, from its scene file alone."""

import numpy as np
import pytest
from support.paper import TWO_RODS
from support.strides import DAMPED, strides

from bilayer_core import Simulator, load_scene

pytestmark = pytest.mark.slow
SCENE = "crawling_inchworm"


@pytest.fixture(scope="module")
def forward():
    return strides(SCENE, 4)


def test_the_inchworm_has_the_papers_parameters():
    simulator = Simulator(load_scene(SCENE, [TWO_RODS]))
    passive, active = simulator.model.strands
    assert (passive.node_count, active.node_count) == (80, 50)
    assert simulator.scene.contact.friction.each_way[:2] == (0.3, 0.6)


def test_every_cycle_moves_it_forward_and_by_the_same_from_the_second_on(forward):
    moved, simulator = forward
    assert moved[1] == pytest.approx(6.991e-3, rel=0.002)
    assert moved[1:] == pytest.approx(np.full(3, moved[1]), rel=0.02)
    assert abs(simulator.com[1]) < 1e-9
    assert simulator.summary()["converged"] is True


def test_it_goes_the_other_way_when_its_friction_is_turned_round(forward):
    moved, _ = strides(SCENE, 2, "contact.friction.forward=0.6", "contact.friction.backward=0.3")
    assert moved == pytest.approx(-forward[0][:2], rel=1e-3)


def test_it_stays_where_it_is_when_friction_is_the_same_both_ways(forward):
    moved, _ = strides(SCENE, 2, "contact.friction.forward=0.6")
    assert abs(moved[1]) < 0.02 * forward[0][1]


def test_it_does_not_drift_at_rest():
    simulator = Simulator(
        load_scene(
            "crawling_inchworm",
            ["stimuli.humidity.schedule.amplitude=0", "stimuli.humidity.schedule.mean=0.6", DAMPED],
        )
    )
    simulator.run(1.0)
    start = simulator.com[0]
    simulator.run(1.0)
    assert abs(simulator.com[0] - start) < 1e-5  # 0.01 mm/s
