"""The simulator as a user meets it: stimuli, states, observers, failures."""

import math

import numpy as np
import pytest
import yaml
from support.sample_scenes import GROUND, PAPER, contact, everything, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.engine.evaluator import Evaluator
from bilayer_core.engine.newton import SETTLED_WITHIN
from bilayer_core.errors import InputError, PenetrationError, SceneError, SimulationError
from bilayer_core.simulation.run_result import Termination


class Recorder:
    """An observer that keeps what it is told."""

    def __init__(self, rate):
        self.rate = rate
        self.frames, self.closed, self.description = [], None, None

    def start(self, description):
        self.description = description

    def observe(self, frame):
        self.frames.append(frame)

    def close(self, complete, termination):
        self.closed, self.termination = complete, termination


@pytest.fixture
def simulator():
    return Simulator(load_scene(everything()))


def test_a_saved_state_continues_bit_for_bit(simulator):
    simulator.run(0.02)
    simulator.set_stimulus("humidity", 0.9)
    simulator.run(0.01)
    saved = simulator.save_state()
    simulator.run(0.03)
    expected = simulator.save_state()
    other = Simulator(load_scene(everything()))
    other.load_state(saved)
    assert other.time == pytest.approx(0.03)
    other.run(0.03)
    assert np.array_equal(other.save_state(), expected, equal_nan=True)
    assert np.array_equal(other.contact_forces, simulator.contact_forces)


def test_a_state_in_a_frame_is_enough_to_continue(simulator):
    recorder = Recorder(rate=100.0)
    simulator.run(0.05, observers=[recorder])
    middle = recorder.frames[2]
    other = Simulator(load_scene(yaml.safe_load(recorder.description.scene_text)))
    other.load_state(middle.state)
    other.run(0.05 - middle.time)
    assert np.array_equal(other.save_state(), recorder.frames[-1].state, equal_nan=True)


def test_a_state_of_another_scene_is_refused_and_nothing_changes(simulator):
    simulator.run(0.01)
    before = simulator.save_state()
    other = Simulator(load_scene(everything(stations=7)))
    with pytest.raises(InputError, match="values, this scene's state has"):
        simulator.load_state(other.save_state())
    broken = before.copy()
    broken[20] = math.nan
    with pytest.raises(InputError, match="must be finite"):
        simulator.load_state(broken)
    assert np.array_equal(simulator.save_state(), before, equal_nan=True)


def test_reset_goes_back_to_the_start_and_forgets_stimuli(simulator):
    fresh = simulator.save_state()
    simulator.set_stimulus("humidity", 1.0)
    simulator.run(0.01)
    simulator.reset()
    assert simulator.time == 0.0
    assert np.array_equal(simulator.save_state(), fresh, equal_nan=True)


def test_a_stimulus_acts_from_the_next_step_and_overrides_the_schedule(simulator):
    simulator.step()
    assert simulator.stimulus == {"humidity": 0.5}
    simulator.set_stimulus("humidity", 0.8)
    assert simulator.stimulus == {"humidity": 0.5}
    simulator.step()
    assert simulator.stimulus == {"humidity": 0.8}
    simulator.set_stimulus("humidity", None)
    simulator.step()
    assert simulator.stimulus == {"humidity": 0.5}


@pytest.mark.parametrize(
    ("channel", "value", "message"),
    [
        ("humidty", 0.5, "no such channel; the scene 'sample' has: humidity"),
        ("humidity", math.nan, "must be from 0 to 1"),
        ("humidity", 1.01, "must be from 0 to 1"),
    ],
)
def test_a_bad_stimulus_is_refused_and_the_last_one_stays(simulator, channel, value, message):
    simulator.set_stimulus("humidity", 0.7)
    with pytest.raises(InputError, match=message):
        simulator.set_stimulus(channel, value)
    simulator.step()
    assert simulator.stimulus == {"humidity": 0.7}


def test_observers_see_the_first_frame_the_last_and_their_rate_between(simulator):
    fast, slow = Recorder(500.0), Recorder(70.0)
    result = simulator.run(0.05, observers=[fast, slow])
    assert result.termination is Termination.COMPLETED and result.steps == 50
    assert [f.step for f in fast.frames] == list(range(0, 51, 2))
    assert [f.step for f in slow.frames] == [0, 14, 28, 42, 50]  # done at 0, 1/70, 2/70, 3/70 and 0.05 s
    assert fast.closed is True and slow.closed is True
    assert fast.frames[-1].substeps == slow.frames[-1].substeps == simulator.statistics.substeps


def test_whoever_asks_for_each_step_sees_every_one_and_changes_none(simulator):
    times = []
    simulator.run(0.05, each_step=times.append)
    assert times == pytest.approx(simulator.dt * np.arange(1, round(0.05 / simulator.dt) + 1), abs=1e-12)
    watched = simulator.save_state()
    simulator.reset()
    simulator.run(0.05)
    np.testing.assert_array_equal(simulator.save_state(), watched)


def test_an_interrupted_run_tells_its_observers(simulator):
    recorder = Recorder(100.0)
    result = simulator.run(0.05, observers=[recorder], interrupted=lambda: simulator.time > 0.0225)
    assert result.termination is Termination.INTERRUPTED
    assert (recorder.closed, recorder.termination) == (False, "interrupted")
    assert 0.0225 < recorder.frames[-1].time == simulator.time < 0.031  # asked whenever someone has looked
    assert simulator.summary()["termination"] == "interrupted"


def test_a_solver_that_cannot_go_on_says_what_and_when_and_keeps_the_last_state():
    hopeless = everything()
    hopeless["solver"] = {**PAPER, "max_newton_iterations": 1, "max_halvings": 1, "newton_tolerance": 1e-15}
    simulator = Simulator(load_scene(hopeless))
    before = simulator.save_state()
    recorder = Recorder(100.0)
    with pytest.raises(
        SimulationError, match=r"stopped at t = 0 s: .*tried down to 0\.0005 s \(correction left .* m/s"
    ):
        simulator.run(0.05, observers=[recorder])
    assert np.array_equal(simulator.save_state(), before, equal_nan=True)
    assert (recorder.closed, recorder.termination) == (False, "failed") and recorder.frames[-1].time == 0.0
    assert simulator.summary()["termination"] == "failed"


def test_prescribed_motion_through_a_surface_stops_the_run_and_nothing_has_crossed():
    pushed = everything()
    pushed["bodies"], pushed["loads"], pushed["joints"] = pushed["bodies"][:1], [], []
    pushed["bodies"][0]["motion"] |= {"times": [0.0, 0.05], "displacements": [[0, 0, 0], [0, 0, -0.06]]}
    simulator = Simulator(load_scene(pushed))
    with pytest.raises(SimulationError, match=r"(node|contact point) .* would reach the surface of ground"):
        simulator.run(0.05)
    assert simulator.time > 0.02
    assert simulator.statistics.min_gap > 0.0


def test_a_duration_in_which_nothing_would_happen_is_refused(simulator):
    with pytest.raises(InputError, match="less than half a step"):
        simulator.run(1e-4)
    assert simulator.run(0.0).steps == 0


def test_a_correction_that_is_not_finite_is_never_small(simulator):
    evaluator = Evaluator(simulator.model)
    evaluator.stage.length = evaluator.stage.momentum_length = 1.0
    for rods, body in ((np.nan, 0.0), (0.0, np.nan), (0.0, np.inf)):
        assert not evaluator.speed(rods, body) <= 1.0
    assert evaluator.speed(0.0, 0.0) <= 1.0


def test_a_step_that_does_not_converge_is_halved_and_the_steps_grow_again():
    rough = everything()
    rough["solver"] = {**PAPER, "dt": 0.01, "max_newton_iterations": 6}
    rough["damping"] = {"mass": 0.0}
    simulator = Simulator(load_scene(rough))
    simulator.run(0.2)
    statistics = simulator.statistics
    assert statistics.rejected > 0 and statistics.substeps > 20
    # the last correction, which friction that was frozen anew had asked for
    assert statistics.largest_residual <= SETTLED_WITHIN * simulator.steps.newton_tolerance
    assert simulator.summary()["converged"] is True


def test_a_scene_that_starts_in_penetration_names_the_node_and_the_depth():
    sunk = scene([rod([layer()], start=(0, 0, 0.4e-3), stations=11)], obstacles=[GROUND], contact=contact())
    with pytest.raises(PenetrationError, match=r"node \d+ of rod/only at .* is 0\.1 mm behind the surface of ground"):
        Simulator(load_scene(sunk))


def test_a_start_in_penetration_because_of_a_missing_unit_asks_for_the_unit():
    sunk = scene([rod([layer()], length=40, start=(0, 0, 0.4e-3))], obstacles=[GROUND], contact=contact())
    with pytest.raises(PenetrationError, match=r"behind the surface of ground.*rods\.rod is 40 m long: is the unit"):
        Simulator(load_scene(sunk))


def test_a_simulator_is_made_of_what_names_a_scene_as_well():
    assert Simulator("bending").scene == load_scene("bending")
    with pytest.raises(SceneError, match="bendin"):
        Simulator("bendin")


@pytest.mark.parametrize(("key", "value"), [("model", "three_rod"), ("dimension", "7"), ("integrator", "leapfrog")])
def test_an_unknown_choice_is_refused_with_those_that_exist(key, value):
    with pytest.raises(SceneError, match=f"{key}: {value} does not exist; allowed: auto, "):
        Simulator(load_scene(everything()), **{key: value})


def test_the_plan_skips_what_a_scene_does_not_need():
    bare = Simulator(load_scene(scene([rod([layer()])])))
    assert bare.plan.terms["bond"] == "skipped: no rod has two layers"
    assert bare.plan.terms["barrier"] == "skipped: no surfaces that can meet"
    bare.step()
    assert set(bare.energy()) == {"kinetic", "stretching", "bending", "twisting"}
    full = Simulator(load_scene(everything()))
    assert {name for name, said in full.plan.terms.items() if said != "active"} == {"flattening"}
