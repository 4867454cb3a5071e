"""Logs whose runs are made again: bit for bit, with what acted on them, and with changes from an instant on."""

import json
import math

import numpy as np
import pytest
from support.acted_scenes import pushed
from support.sample_scenes import everything

from bilayer_core import Simulator, load_scene
from bilayer_core.cli import main
from bilayer_core.errors import InputError
from bilayer_core.log.file import mcap_log
from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_core.log.messages.topics import EVENTS, stimulus_topics
from bilayer_core.log.run.log_reader import read_info, read_log, read_state
from bilayer_core.observed.inputs import LOAD, POSE, STIMULUS, UNTIL, Input
from bilayer_core.runs import replay
from bilayer_core.runs.replay import branch, inputs_after, verify
from bilayer_core.scene.bundled import bundled_scenes

INTEGRATORS = ("implicit_euler", "sdirk2", "tr_bdf2", "generalised_alpha")
ADAPTIVE, FIXED = {"tolerance": 1e-3}, {"tolerance": None, "dt": 1e-3}


def someone(simulator, seed):
    """Sets things at random times, as controllers do."""
    chance = np.random.default_rng(seed)
    times = sorted(chance.uniform(0.0, 0.2, 30).tolist())

    def act(time):
        while times and time >= times[0]:
            times.pop(0)
            what, value = chance.integers(4), float(chance.random())
            if what < 2:
                simulator.set_stimulus("heat", None if value < 0.1 else value)
            elif what == 2:
                simulator.set_load("push", None if value < 0.1 else 4.0 * value - 2.0)
            else:
                simulator.set_pose("hand", [0.04, 0.0, 3e-3 + 2e-3 * value], over=0.01 + 0.05 * chance.random())

    return act


def recorded(path, content, seed=0, duration=0.2, rate=50.0, **more):
    simulator = Simulator(load_scene(content), **more)
    recorder = McapRecorder(path, rate=rate)
    simulator.run(duration, observers=[recorder], each_step=someone(simulator, seed) if seed else None)
    return simulator


@pytest.mark.parametrize("name", bundled_scenes())
def test_the_run_of_every_bundled_scene_comes_out_bit_for_bit(tmp_path, name):
    recorded(tmp_path / "run.mcap", name, duration=0.1)
    found = verify(tmp_path / "run.mcap")
    assert found.passed and found.states >= 2 and not found.changed


def test_another_target_compiler_and_mathematical_library_are_named(tmp_path, monkeypatch):
    recorded(tmp_path / "run.mcap", "bending", duration=0.02)
    now = replay.origin()
    other = {"target": "znver9", "compiler": "numba 0.1", "libm": "musl 1.2"}
    monkeypatch.setattr(replay, "origin", lambda: other)
    assert verify(tmp_path / "run.mcap").changed == {name: (now[name], other[name]) for name in other}


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize(
    ("model", "dimension", "steps"),
    [("laminate", 2, ADAPTIVE), ("laminate", 3, FIXED), ("two_rod", 2, FIXED), ("two_rod", 3, ADAPTIVE)],
)
def test_so_does_one_on_which_much_acts(tmp_path, model, dimension, integrator, steps):
    content = pushed(dimension, integrator=integrator, model=model, **steps)
    recorded(tmp_path / "run.mcap", content, seed=3)
    found = verify(tmp_path / "run.mcap")
    assert found.first is None and not found.stopped
    assert found.states == 11 and found.inputs > 5


@pytest.mark.parametrize("rate", [7.0, 333.0])
def test_frames_at_other_times_than_those_of_the_scene_are_found(tmp_path, rate):
    recorded(tmp_path / "run.mcap", pushed(), seed=5, rate=rate)
    found = verify(tmp_path / "run.mcap")
    assert found.passed and found.states > 0.9 * 0.2 * rate


def test_steps_that_someone_has_made_end_are_made_so_again(tmp_path):
    simulator, recorder = Simulator(load_scene(pushed())), McapRecorder(tmp_path / "run.mcap")
    recorder.start(simulator.description)
    stop = simulator.listen(recorder.note)
    recorder.observe(simulator.frame())
    for k in range(1, 40):
        simulator.step(until=simulator.time + 1e-3 if k % 3 else math.inf)
        simulator.set_stimulus("heat", 0.02 * (k % 7))
        recorder.observe(simulator.frame())
    stop()
    recorder.close(False)
    found = verify(tmp_path / "run.mcap")
    assert found.passed and found.states == 40


def test_what_was_set_before_the_log_began_acts_again(tmp_path):
    simulator = Simulator(load_scene(pushed()))
    simulator.set_stimulus("heat", 0.6)
    simulator.set_load("push", -1.0)
    simulator.set_pose("hand", [0.04, 0.0, 4e-3])
    simulator.run(0.1, observers=[McapRecorder(tmp_path / "run.mcap")])
    found = verify(tmp_path / "run.mcap")
    assert found.passed and found.inputs == 0


def test_a_run_that_goes_on_from_a_state_does_too(tmp_path):
    recorded(tmp_path / "run.mcap", pushed(), seed=7)
    new, log = str(tmp_path / "next.mcap"), str(tmp_path / "run.mcap")
    assert main(["replay", log, "--from", "0.1", "--log", new, "--quiet"]) == 0
    found = verify(new)
    assert found.passed and found.states == 6
    one, other = read_log(new), read_log(log)
    np.testing.assert_allclose(one.body_positions[-1], other.body_positions[-1], atol=1e-12)
    np.testing.assert_allclose(one.com[-1], other.com[-1], atol=1e-4)  # steps end where inputs act


def test_a_run_that_was_interrupted_is_made_again_as_far_as_it_went(tmp_path):
    simulator, asked = Simulator(load_scene(pushed())), []
    recorder = McapRecorder(tmp_path / "run.mcap")
    simulator.run(0.2, observers=[recorder], interrupted=lambda: asked.append(0) or len(asked) > 3)
    assert simulator.time < 0.2
    assert verify(tmp_path / "run.mcap").passed


# what differs is told


def test_an_input_that_the_log_lacks_is_the_first_difference(tmp_path, monkeypatch):
    lost = []

    def keep(self, told):
        lost.append(told) if told.kind == STIMULUS and told.time > 0.1 else self._put(told)

    monkeypatch.setattr(mcap_log.McapRecorder, "note", keep)
    recorded(tmp_path / "run.mcap", pushed(), seed=3)
    found = verify(tmp_path / "run.mcap")
    assert not found.passed
    assert found.first.time == pytest.approx(next(t.time for t in lost), abs=0.02)
    assert found.first.time >= lost[0].time
    assert found.largest.size > 1e-9 and " of rod/" in found.largest.where


def test_the_command_tells_time_quantity_rod_and_size_and_ends_with_1(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(replay, "versions", lambda: {"numba": "0.1"})
    log = tmp_path / "run.mcap"
    recorded(log, pushed(), seed=3)
    assert main(["replay", str(log), "--verify"]) == 0
    assert " states" in capsys.readouterr().out
    monkeypatch.setattr(replay, "_apply", lambda simulator, waiting, until: waiting.clear() or until)  # nothing acts
    assert main(["replay", str(log), "--verify"]) == 1
    told = capsys.readouterr().out
    assert "not equal bit for bit; the first difference is at t = " in told
    assert "largest difference of a position: t = " in told and "position of node" in told
    assert "numba" in told and "0.1 here" in told
    assert main(["replay", str(log), "--verify", "--json", "-"]) == 1
    report = json.loads(capsys.readouterr().out)
    assert report["pass"] is False and report["first"]["quantity"] and report["changed"]["numba"][1] == "0.1"


def test_within_a_tolerance_a_run_of_another_tolerance_is_the_same(tmp_path, monkeypatch):
    recorded(tmp_path / "run.mcap", pushed(tolerance=1e-5), seed=0)
    monkeypatch.setattr(replay, "simulator_of", lambda path: Simulator(load_scene(pushed(tolerance=2e-5))))
    assert not verify(tmp_path / "run.mcap").passed
    found = verify(tmp_path / "run.mcap", tolerance=1e-2)
    assert found.passed and found.largest.size > 0.0
    assert not verify(tmp_path / "run.mcap", tolerance=1e-9).passed


def test_a_log_of_before_says_what_it_lacks(tmp_path, monkeypatch):
    monkeypatch.setattr(mcap_log, "input_topics", mcap_log_stimuli)
    monkeypatch.setattr(mcap_log.McapRecorder, "note", lambda self, told: None)
    recorded(tmp_path / "old.mcap", pushed())
    with pytest.raises(InputError, match=r"old\.mcap: does not hold what acted on the run \(/bilayer_sim/inputs\)"):
        verify(tmp_path / "old.mcap")


def mcap_log_stimuli(description):
    return (EVENTS, *stimulus_topics(description))


# other runs from an instant on


def test_other_values_act_from_an_instant_on_and_all_else_as_in_the_log(tmp_path):
    log = tmp_path / "run.mcap"
    recorded(log, pushed(), seed=3)
    simulator, inputs = branch(log, 0.1, ("contact.friction.coefficient=0.1",), {"heat": 1.0}, {"push": 0.0})
    begin = simulator.time
    assert 0.09 < begin <= 0.1 and simulator.scene.contact.friction.coefficient == 0.1
    assert {told.kind for told in inputs} == {POSE}
    assert all(told.time >= begin for told in inputs)
    simulator.run(until=0.2, inputs=inputs)
    assert simulator.stimulus["heat"] == 1.0
    same, all_inputs = branch(log, 0.1)
    assert {STIMULUS, LOAD, POSE} >= {told.kind for told in all_inputs} > {POSE}
    same.run(until=0.2, inputs=all_inputs)
    end = read_log(log)
    np.testing.assert_allclose(same.bodies["hand"].position, end.body_positions[-1, 0], atol=1e-12)
    assert np.abs(same.positions - simulator.positions).max() > 1e-5


def test_branches_do_not_touch_the_log(tmp_path, capsys):
    log = tmp_path / "run.mcap"
    recorded(log, pushed(), seed=3)
    before = log.read_bytes()
    assert main(["replay", str(log), "--from", "0.1", "--stimulus", "heat=0.5", "--log", str(log), "--force"]) == 2
    assert "is the log that is gone on from" in capsys.readouterr().err
    assert log.read_bytes() == before


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ([], "say either --verify"),
        (["--verify", "--from", "0.1"], "say either --verify"),
        (["--verify", "--stimulus", "heat=1"], "--stimulus: is for --from"),
        (["--from", "0.1", "--tolerance", "1e-3"], "--tolerance: is for --verify"),
        (["--from", "0.1", "--stimulus", "heat"], "'heat' is not allowed; it must be NAME=NUMBER"),
        (["--from", "0.1", "--stimulus", "heat=7"], "stimulus 'heat': 7.0 is not allowed"),
        (["--from", "0.1", "--stimulus", "light=1"], "stimulus 'light': no such channel"),
        (["--from", "0.1", "--load", "pull=1"], "load 'pull': no such load"),
        (["--from", "0.1", "--set", "rods.rod.stations=5"], "saved state: "),
        (["--from", "9"], "its last state is of t = 0.12 s, and t = 9 s is after its end"),
        (["--from", "0.12"], "say with --duration how long to go on"),
        (["--verify", "--tolerance", "-1"], "--tolerance: -1.0 is not allowed"),
    ],
)
def test_bad_wishes_are_refused(tmp_path, capsys, options, told):
    log = tmp_path / "run.mcap"
    recorded(log, pushed(), duration=0.12)
    assert main(["replay", str(log), *options]) == 2
    assert told in capsys.readouterr().err


def test_a_run_goes_on_from_any_instant_of_a_log(tmp_path, capsys):
    log = str(tmp_path / "run.mcap")
    recorded(log, "bending", duration=0.2)
    arguments = ["run", "bending", "--from-state", log, "--duration", "0.06", "--quiet"]
    assert main([*arguments, "--at", "0.1", "--log", str(tmp_path / "next.mcap")]) == 0
    state, begin = read_state(log, 0.1)
    assert begin < 0.1 and read_info(tmp_path / "next.mcap").start_time == begin
    assert main([*arguments[:-1], "--at", "0.1"]) == 0
    assert f"begins at t = {state[0]:.9g} s, where the last logged step before t = 0.1 s" in capsys.readouterr().err
    assert main(["run", "bending", "--at", "0.1"]) == 2
    assert "--at: is a time of the log of --from-state" in capsys.readouterr().err
    np.testing.assert_array_equal(read_state(tmp_path / "next.mcap", 0.12)[0], read_state(log, 0.12)[0])


# what is told


def test_inputs_are_told_before_the_step_from_which_on_they_act():
    simulator, told = Simulator(load_scene(pushed())), []
    stop = simulator.listen(told.append)
    simulator.run(0.04)
    simulator.set_stimulus("heat", 0.5)
    simulator.set_load("push", None)
    simulator.run(0.04)
    stop()
    simulator.set_stimulus("heat", 0.1)
    steps = told[1].step
    at = told[1].time
    assert at == pytest.approx(0.04)
    assert told[0] == Input(0, 0.0, UNTIL, "", (told[0].values[0],)) and told[0].values[0] == pytest.approx(0.04)
    assert told[1] == Input(steps, at, STIMULUS, "heat", (0.5, 0.0))
    assert (told[2].kind, told[2].name) == (LOAD, "push") and math.isnan(told[2].values[0])
    assert told[3].kind == UNTIL and len(told) == 4


def test_inputs_of_a_run_act_at_their_times(tmp_path):
    log = tmp_path / "run.mcap"
    times = 0.0123, 0.05, 0.0777
    inputs = [Input(0, t, STIMULUS, "heat", (v,)) for t, v in zip(times, (0.3, 0.9, math.nan), strict=True)]
    simulator = Simulator(load_scene(pushed()))
    simulator.run(0.1, observers=[McapRecorder(log)], inputs=inputs)
    found = [told for told in inputs_after(log, read_state(log, 0.0)[0]) if told.kind == STIMULUS]
    assert [told.time for told in found] == list(times)
    assert verify(log).passed


def test_everything_that_can_be_simulated_comes_out_bit_for_bit(tmp_path):
    recorded(tmp_path / "run.mcap", everything(), duration=0.05)
    assert verify(tmp_path / "run.mcap").passed
