"""What the gripper does, from its scene file alone."""

import numpy as np
import pytest
from support.paper import TWO_RODS

from bilayer_core import Simulator, load_scene
from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_core.log.run.memory import MemoryRecorder

pytestmark = pytest.mark.slow


class Gaps:
    """Watches the smallest gap and the ball, a hundred times a second."""

    rate = 100.0

    def start(self, description):
        self.ball = [body.name for body in description.bodies].index("ball")
        self.times, self.heights, self.smallest = [], [], np.inf

    def observe(self, frame):
        self.times.append(frame.time)
        self.heights.append(frame.body_positions[self.ball, 2])
        self.smallest = min(self.smallest, frame.min_gap)

    def close(self, complete, termination):
        assert complete


@pytest.fixture(scope="module", params=[0.5, 0.0], ids=["friction", "no friction"])
def gripped(request):
    """A whole run, with the scene's friction and without any."""
    gaps = Gaps()
    simulator = Simulator(load_scene("gripping", [f"contact.friction.coefficient={request.param}"]))
    simulator.run(observers=[gaps])
    return simulator, gaps


def test_the_gripper_has_the_papers_parameters():
    simulator = Simulator(load_scene("gripping", [TWO_RODS]))
    strands = simulator.model.strands
    passive = sum(s.node_count for s in strands if s.layer == "passive") + simulator.model.point_count  # with the hub
    active = sum(s.node_count for s in strands if s.layer == "active")
    assert (passive, active) == (201, 192)
    assert all((s.width == 0.01).all() and (s.thickness == 1e-3).all() for s in strands)
    scene = simulator.scene
    assert scene.gravity == (0.0, 0.0, -10.0)
    assert {(m.youngs_modulus, m.density) for m in scene.materials.values()} == {(1e8, 1000.0)}
    assert (scene.contact.barrier_distance, scene.contact.stiffness) == (1e-3, 1e7)


@pytest.mark.parametrize("steps", [{}, pytest.param({"dt": 2e-3}, marks=pytest.mark.verify)], ids=["adaptive", "fixed"])
def test_arms_touch_the_ball_in_the_same_bits_whatever_watches_them(steps, tmp_path):
    simulator = Simulator(load_scene("gripping"), **steps)
    simulator.run(12.6)
    start, ends = simulator.save_state(), []
    observers = [
        [],
        [McapRecorder(tmp_path / "7.mcap", 7.0)],
        [McapRecorder(tmp_path / "1000.mcap", 1000.0)],
        [McapRecorder(tmp_path / "50.mcap", 50.0), MemoryRecorder(30.0)],
    ]
    for watching in observers:
        simulator.load_state(start)
        simulator.run(0.5, observers=watching)
        ends.append((simulator.save_state(), simulator.statistics.bodies["ball"].first_contact))
    for state, contact in ends[1:]:
        np.testing.assert_array_equal(state, ends[0][0])
        assert contact == ends[0][1] == pytest.approx(12.77, abs=0.03)


def test_the_arms_close_on_the_ball_before_the_stimulus_is_complete(gripped):
    simulator, _ = gripped
    contact = simulator.statistics.bodies["ball"]
    assert contact.first_contact == pytest.approx(12.77, abs=0.03)
    assert contact.nodes >= 4


def test_the_ball_lies_still_until_the_arms_touch_it(gripped):
    simulator, gaps = gripped
    before = np.array(gaps.heights)[np.array(gaps.times) < simulator.statistics.bodies["ball"].first_contact]
    assert len(before) > 1000
    assert np.ptp(before) < 1e-7


def test_the_ball_is_held_by_form_and_lifted_by_100_mm(gripped):
    simulator, gaps = gripped
    lift = gaps.heights[-1] - gaps.heights[0]
    assert lift == pytest.approx(0.1, abs=1e-3)
    settled = np.array(gaps.heights)[np.array(gaps.times) > simulator.time - 0.5]
    assert np.ptp(settled) < 1e-4


def test_no_surface_is_ever_crossed_and_every_step_converges(gripped):
    simulator, gaps = gripped
    assert 0.0 < simulator.statistics.min_gap <= gaps.smallest < 1e-3
    assert simulator.summary()["converged"] is True


@pytest.mark.parametrize(("coefficient", "held"), [(0.5, True), (0.0, False)])
def test_short_arms_hold_the_ball_by_friction_alone(coefficient, held):
    simulator = Simulator(load_scene("gripping_friction", [f"contact.friction.coefficient={coefficient}"]))
    simulator.run(13.5)
    assert simulator.statistics.bodies["ball"].first_contact < 13.30
    ball, hub = simulator.bodies["ball"].position[2], simulator.bodies["hub"].position[2]
    simulator.run(4.0)
    lift = simulator.bodies["ball"].position[2] - ball
    raised = simulator.bodies["hub"].position[2] - hub
    assert raised == pytest.approx(0.1, abs=1e-12)
    if held:
        assert raised - lift < 1e-3  # slip
    else:
        assert abs(lift) < 1e-4
