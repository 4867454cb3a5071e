"""What comes of a case: every way in which it can end."""

import math
from functools import partial

import pytest

from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.testing import judge as judging
from bilayer_core.testing.judge import Judge, Verdict
from bilayer_core.verification.stress.execute_case import execute
from bilayer_core.verification.stress.parameters import Parameters
from bilayer_core.verification.stress.robots import scene_of
from bilayer_core.verification.stress.stress_case import Decision, Outcome, Record, StressCase
from bilayer_core.verification.validate.parts import layer, rod, scene


def case_of(most_steps=2000, outside=(), decide=None, compared=True, **changes):
    content = partial(scene_of, Parameters(**changes))
    return StressCase("a case", content, outside, most_steps, decide=decide, compared=compared)


def test_an_easy_case_is_accurate_and_its_figures_are_told():
    record = execute(case_of(robot="drop", stations=11, tolerance=1e-5))
    assert record.outcome is Outcome.ACCURATE
    assert 0.0 < record.error < 0.01
    figures = record.figures
    assert figures["steps"] > 10 and figures["iterations"] > figures["steps"]
    assert 0.0 < figures["gap_over_barrier"] < 1.0
    assert Record.from_line(record.line()) == record


def test_a_case_that_nobody_compares_is_stable():
    record = execute(case_of(compared=False))
    assert record.outcome is Outcome.STABLE
    assert record.error is None and record.reason == "not compared with a finer run"


def test_a_case_with_coarse_steps_is_stable_and_its_error_is_told():
    record = execute(case_of(dt=0.05, integrator="implicit_euler", stimulus="step"))
    assert record.outcome is Outcome.STABLE
    assert record.error > 0.01


def test_a_scene_that_cannot_be_is_refused_with_its_reason():
    record = execute(case_of(stations=2))
    assert record.outcome is Outcome.REFUSED
    assert "stations: found 2" in record.reason


def test_a_run_that_cannot_go_on_is_refused_and_its_remedy_tried():
    one_length = {"dt": 2e-2, "max_step": 2e-2, "max_halvings": 0}
    content = scene([rod([layer()])], solver={**one_length, "tolerance": 1e-4, "integrator": "sdirk2"})
    content["loads"] = [{"name": "kick", "rod": "rod", "position": 0.03, "force": [0, 0, 1e-2]}]
    record = execute(StressCase("a stop", lambda: content | {"duration": 0.05}))
    assert record.outcome is Outcome.REFUSED
    assert record.remedy == "leave `solver.max_halvings` out, or set it above 0"
    assert record.remedy_works is True


@pytest.mark.parametrize(("low", "outcome"), [(0.0, Outcome.ACCURATE), (1.0, Outcome.FAILED)])
def test_what_decides_a_case_decides_it(low, outcome):
    def decide(trial):
        trial.run(0.01)
        return Decision("the time", trial.simulator.time, low, 2.0, "s")

    record = execute(case_of(decide=decide))
    assert record.outcome is outcome
    assert "the time: 0.01 s" in record.decision


def test_an_error_that_no_user_may_see_fails_a_case():
    def decide(trial):
        raise ZeroDivisionError("nobody caught this")

    record = execute(case_of(decide=decide))
    assert record.outcome is Outcome.FAILED
    assert record.reason.startswith("ZeroDivisionError: nobody caught this")


@pytest.mark.parametrize(
    ("limit", "value", "words"),
    [
        ("MOST_GAIN", -1.0, "energy rose"),
        ("MOST_MADE", -1.0, "steps made"),
        ("MOST_ITERATIONS", 0, "Newton iterations an attempt"),
        ("LARGEST_RESIDUAL", 0.0, "residual"),
    ],
)
def test_each_limit_of_the_judge_fails_a_case_that_is_beyond_it(limit, value, words, monkeypatch):
    monkeypatch.setattr(judging, limit, value)
    case = case_of(robot="drop", stations=11)
    record = execute(StressCase(case.name, case.content, most_steps=20, budget=True))
    assert record.outcome is Outcome.FAILED
    assert words in record.reason


def test_positions_that_are_no_numbers_fail_a_case():
    simulator = Simulator(load_scene(scene_of(Parameters())))
    simulator.compile()
    judge = Judge(simulator)
    judge.look(0.0)
    simulator._state.position[3, 1] = math.nan
    with pytest.raises(Verdict, match="not finite"):
        judge.look(0.0)


def test_momentum_that_comes_from_nothing_fails_a_case():
    simulator = Simulator(load_scene(scene_of(Parameters(robot="hub"))))
    simulator.compile()
    judge = Judge(simulator)
    simulator.run(0.05, each_step=judge.look)
    assert judge.momentum < 1.0
    simulator._state.velocity += 1e-4
    with pytest.raises(Verdict, match="momentum is wrong"):
        judge.look(simulator.time)
