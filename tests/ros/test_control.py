"""What acts of what controllers send: real runs, without ROS topics."""

import math
import random

import numpy as np
import pytest
from support.acted_scenes import pushed

from bilayer_core import Simulator, load_scene
from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_core.observed.inputs import STIMULUS
from bilayer_core.runs.replay import verify
from bilayer_sim_ros.control.control_ticks import Control
from bilayer_sim_ros.control.pending_changes import Commands
from bilayer_sim_ros.control.stimulus import Channel, StimulusInputs

PERIOD = 0.02
CHANNEL = "swelling"


class Driven:
    """A simulator with messages that come between its steps, as the node has it."""

    def __init__(
        self, scene="bending", interpolation="linear", period=PERIOD, fallback="hold", timeout=0.0, log=None, **settings
    ):
        self.simulator = Simulator(load_scene(scene), **settings)
        self.simulator.compile()
        stimuli = self.simulator.scene.stimuli.items()
        channels = [Channel(name, of.minimum, of.maximum, of.schedule) for name, of in stimuli]
        self.inputs = StimulusInputs(channels, timeout, fallback)
        self.commands = Commands(pytest.fail)
        self.control = Control(self.inputs, self.commands, 1.0 / period, interpolation)
        self.told = []
        self.simulator.listen(self.told.append)
        self.log = McapRecorder(log) if log else None
        if self.log:
            self.log.start(self.simulator.description)
            self.simulator.listen(self.log.note)
            self.log.observe(self.simulator.frame())
        self.control.start(self.simulator.time)

    def step(self, until=math.inf):
        self.control.act(self.simulator)
        self.simulator.step(until=min(until, self.control.next_stop(self.simulator.time)))
        self.control.advance_to(self.simulator.time)
        if self.log:
            self.log.observe(self.simulator.frame())

    def run(self, until, send=lambda time: None):
        """Step; `send` is called before each step."""
        while self.simulator.time < until - 1e-9:
            send(self.simulator.time)
            self.step(until)
        return self

    @property
    def stimuli(self):
        """When [s] which value was set, and within which time [s]."""
        return [(told.time, *told.values) for told in self.told if told.kind == STIMULUS]


def test_linear_reaches_a_command_one_period_after_its_tick():
    driven = Driven()
    driven.run(0.1)
    driven.inputs.receive(CHANNEL, 0.6)
    driven.run(0.11)
    assert driven.simulator.stimulus[CHANNEL] == pytest.approx(0.6 * (driven.simulator.time - 0.1) / PERIOD)
    driven.run(0.12)
    assert driven.simulator.stimulus[CHANNEL] == pytest.approx(0.6, abs=1e-12)
    assert driven.stimuli == [(0.0, 0.0, 0.0), (0.1, 0.6, pytest.approx(PERIOD))]


def test_smooth_reaches_a_command_by_half_a_wave():
    driven = Driven(interpolation="smooth").run(0.1)
    driven.inputs.receive(CHANNEL, 0.6)
    driven.run(0.11)
    part = (driven.simulator.time - 0.1) / PERIOD
    assert driven.simulator.stimulus[CHANNEL] == pytest.approx(0.3 - 0.3 * math.cos(math.pi * part))
    assert driven.stimuli[-1] == (0.1, 0.6, pytest.approx(PERIOD), 1.0)


def test_hold_jumps_at_the_tick():
    driven = Driven(interpolation="hold").run(0.1)
    driven.inputs.receive(CHANNEL, 0.6)
    driven.step()
    assert driven.simulator.stimulus[CHANNEL] == 0.6
    assert driven.stimuli[-1] == (pytest.approx(0.1), 0.6, 0.0)


@pytest.mark.parametrize("interpolation", ["linear", "hold"])
def test_of_several_messages_within_a_period_the_last_acts_at_the_next_tick(interpolation):
    driven, sent = Driven(interpolation=interpolation), []

    def send(time):
        for _ in range(3):
            sent.append((time, random.Random(len(sent)).random()))
            driven.inputs.receive(CHANNEL, sent[-1][1])

    driven.run(0.2, send)
    expected = {}
    for time, value in sent:
        expected[math.ceil(time / PERIOD - 1e-6)] = value  # what comes at a tick is in time for it
    set_at = {round(time / PERIOD): value for time, value, _ in driven.stimuli}
    assert set_at == {tick: value for tick, value in expected.items() if tick < 10}
    assert len(driven.stimuli) == 10


def test_steps_go_on_through_ramps_and_begin_again_after_jumps():
    counts = {}
    for interpolation in ("linear", "hold"):
        driven = Driven(interpolation=interpolation)
        driven.run(0.4, lambda time, driven=driven: driven.inputs.receive(CHANNEL, 0.5 - 0.5 * math.cos(6.0 * time)))
        counts[interpolation] = driven.simulator.statistics.substeps
    assert counts["linear"] < 0.5 * counts["hold"]


def test_what_nobody_commands_is_the_run_of_the_scene_itself():
    driven = Driven(fallback="schedule", period=0.013).run(0.3)
    alone = Simulator(load_scene("bending"))
    alone.run(0.3)
    np.testing.assert_array_equal(driven.simulator.save_state(), alone.save_state())


@pytest.mark.parametrize("settings", [{"dt": 3e-3}, {"dt": 0.05}, {"period": 0.0137}, {"period": 1e-3}], ids=str)
def test_ticks_off_the_grid_of_steps_lose_no_command(settings):
    driven = Driven(**settings)
    driven.run(0.3)
    driven.inputs.receive(CHANNEL, 0.6)
    end = driven.simulator.time + 3.5 * max(settings.get("dt", 0.0), settings.get("period", PERIOD))
    driven.run(end)
    assert driven.simulator.stimulus[CHANNEL] == pytest.approx(0.6, abs=1e-12)


@pytest.mark.parametrize(
    "settings",
    [{}, {"interpolation": "hold"}, {"dt": 1e-3}, {"model": "two_rod"}, {"integrator": "generalised_alpha"}],
    ids=str,
)
def test_a_log_of_commands_of_every_kind_is_made_again_bit_for_bit(tmp_path, settings):
    log, chance = tmp_path / "run.mcap", random.Random(7)
    driven = Driven(pushed(), log=log, period=0.0071, **settings)

    def send(time):
        for _ in range(chance.randrange(3)):
            driven.inputs.receive("heat", chance.random())
            driven.commands.ask_load("push", chance.random())

    driven.run(0.1, send)
    driven.log.close(True)
    found = verify(log)
    assert found.passed and found.inputs > 20, found


def test_a_fallback_after_commands_is_reached_by_a_ramp_and_before_them_acts_at_once():
    driven = Driven(fallback="zero", timeout=0.1).run(0.04)
    driven.inputs.receive(CHANNEL, 0.6)
    driven.run(0.3)
    assert [(round(time, 6), value, round(over, 6)) for time, value, over in driven.stimuli] == [
        (0.0, 0.0, 0.0),
        (0.04, 0.6, 0.02),
        (0.14, 0.0, 0.02),
    ]
