"""The paper's robots as laminates do what they do as pairs of bonded rods."""

import pytest
from support.paper import PAPERS, TWO_RODS
from support.strides import strides

from bilayer_core import Simulator, load_scene

pytestmark = pytest.mark.slow
LAMINATE = "solver.model=laminate"
SECOND_ORDER = "solver.integrator=sdirk2"


def both(scene, duration, figure, *changes):
    """A figure of a run of the scene by the paper's method: of two rods, and of the laminate."""
    found = []
    for model in (TWO_RODS, LAMINATE):
        simulator = Simulator(load_scene(scene, [*PAPERS, model, *changes]))
        simulator.run(duration)
        found.append(figure(simulator))
    return found


@pytest.mark.verify
def test_the_walker_with_two_legs_takes_the_same_strides():
    bonded, whole = (strides("crawling_dual_leg", 2, *PAPERS, model)[0] for model in (TWO_RODS, LAMINATE))
    assert whole == pytest.approx(bonded, rel=2e-3)


def test_the_jumper_rises_as_high():
    """By the integrator that damps impacts: with others the rise changes by up to 0.6 % with Newton's tolerance."""
    bonded, whole = both("jumping", 1.4, lambda s: s.summary()["com_max_height"] - s.start_com[2], "solver.dt=0.5 ms")
    assert whole == pytest.approx(bonded, rel=5e-3)


@pytest.mark.verify
def test_the_swimmer_rises_as_far_with_each_beat():
    bonded, whole = both("swimming", 0.6, lambda s: s.bodies["hub"].position[2], "rods.arm.stations=79", SECOND_ORDER)
    assert whole == pytest.approx(bonded, rel=0.01)


@pytest.mark.verify
def test_the_gripper_touches_the_ball_at_the_same_time_and_lifts_it_as_high():
    bonded, whole = both("gripping", 17.5, lambda s: s.summary()["bodies"]["ball"])
    assert whole["first_contact"] == pytest.approx(bonded["first_contact"], abs=0.05)
    assert whole["lift"] == pytest.approx(bonded["lift"], abs=1e-5)


def test_the_inchworms_stride_does_not_depend_on_where_a_model_keeps_its_nodes():
    one_curve = strides("crawling_inchworm", 1, *PAPERS, LAMINATE)[0][0]
    for stations in (80, 159):
        bonded = strides("crawling_inchworm", 1, *PAPERS, TWO_RODS, f"rods.body.stations={stations}")[0][0]
        assert bonded == pytest.approx(one_curve, rel=2e-3)
