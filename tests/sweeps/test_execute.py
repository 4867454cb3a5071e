"""What comes of one run: its row, whatever happens."""

import json

import pytest

from bilayer_core import Simulator, load_scene, read_log
from bilayer_core.studies.sweeps.execute_runs import execute, simulator_of
from bilayer_core.studies.sweeps.job import Outcome, Row
from bilayer_core.studies.sweeps.run_sweep import read_sweep

GAIN = "rods.strip.layers.active.eigenstrain.gain"


def rows(content, out=None, functions=None):
    """Rows of all runs, made in this process by what the others call."""
    read = read_sweep(content, out, functions)
    return execute(read.job, list(read.points()))


def test_a_row_is_what_a_run_with_these_values_gives_bit_for_bit(strip):
    for row in rows(strip):
        changes = [f"{GAIN}={row.parameters['gain']} %", f"rods.strip.path.length={row.parameters['length']} mm"]
        sim = Simulator(load_scene("bending", [*changes, "duration=0.3 s"]))
        sim.run()
        summary = json.loads(json.dumps(sim.summary()))
        assert row.outcome is Outcome.DONE
        assert row.metrics["curvature"] == summary["max_curvature"]
        assert row.summary["com_end"] == summary["com_end"]
        assert row.summary["steps"] == summary["steps"]


def test_runs_with_the_same_model_are_made_by_one_simulator_and_are_the_same(strip):
    strip["parameters"] = {"end": {"path": "stimuli.swelling.schedule.end", "values": [0.4, 0.8, 0.4]}}
    first, second, third = rows(strip)
    assert first.metrics == third.metrics != second.metrics
    sims = [simulator_of(load_scene("bending", {"stimuli.swelling.schedule.end": end})) for end in (0.5, 0.7)]
    assert sims[0] is sims[1]
    assert simulator_of(load_scene("bending", {GAIN: 0.03})) is not sims[0]


def test_a_row_is_the_same_whatever_ran_before_it(strip):
    read = read_sweep(strip)
    points = list(read.points())
    there = {row.key: (row.metrics, row.summary["com_end"]) for row in execute(read.job, points)}
    back = {row.key: (row.metrics, row.summary["com_end"]) for row in execute(read.job, points[::-1])}
    assert there == back


def test_what_a_scene_refuses_is_a_row_with_the_reason(strip):
    strip["parameters"]["length"]["values"] = ["80 mm", "-80 mm"]
    found = [row for row in rows(strip) if row.parameters["length"] < 0]
    assert len(found) == 4
    for row in found:
        assert row.outcome is Outcome.REFUSED
        assert "rods.strip.path.length: found" in row.reason and "must be a length [m] above 0" in row.reason
        assert row.metrics == {"curvature": None, "height": None}


def test_a_run_that_cannot_go_on_is_a_row_with_reason_remedy_and_how_far_it_came(strip):
    strip["parameters"] = {"shortest": {"path": "solver.max_newton_iterations", "values": [1]}}
    strip["set"] |= {"solver.tolerance": None, "solver.dt": "0.1 s", "solver.max_halvings": 0}
    (row,) = rows(strip)
    assert row.outcome is Outcome.STOPPED
    assert "converge" in row.reason and row.remedy
    assert row.summary["simulated"] < 0.3


def test_a_run_over_its_time_is_stopped_between_steps_and_says_so(strip):
    shaken = {"type": "sine", "mean": 0.5, "amplitude": 0.5, "period": "0.1 s"}
    strip["set"] = {"duration": "1e6 s", "stimuli.swelling.schedule": shaken}
    strip["limits"] = {"wall_time": "0.2 s"}
    row = rows(strip)[0]
    assert row.outcome is Outcome.OVER_TIME
    assert "took longer than 0.2 s; it was at t = " in row.reason
    assert row.wall_time < 2.0


def test_a_function_that_fails_is_a_row_with_its_error(strip):
    def wrong(run):
        return 1 / (len(run.parameters) - 2)

    row = rows(strip, functions={"wrong": wrong})[0]
    assert row.outcome is Outcome.ERROR
    assert row.reason == "metric wrong (python:wrong): ZeroDivisionError: division by zero"


@pytest.mark.parametrize("value", [[1.0], {}, object()])
def test_what_is_no_number_or_text_is_no_metric(strip, value):
    row = rows(strip, functions={"wrong": lambda run: value})[0]
    assert row.outcome is Outcome.ERROR and "must return a number, a text or None" in row.reason


def test_functions_see_simulator_summary_parameters_and_what_was_recorded(strip):
    strip["record"] = {"quantities": ["com", "stimulus/*"], "rate": 20}

    def seen(run):
        assert run.simulator.time == pytest.approx(0.3)
        assert set(run.parameters) == {"gain", "length"}
        assert run.recording["com"].values.shape == (7, 3)
        assert run.recording["stimulus/swelling"].values[-1] == pytest.approx(0.3)
        return run.summary["steps"]

    found = rows(strip, functions={"seen": seen})
    assert [row.metrics["seen"] for row in found] == [row.summary["steps"] for row in found]


def test_metrics_of_quantities_take_what_they_say(strip):
    of = "rod/strip/position.z"
    for take in ("first", "last", "change", "min", "max", "mean", "range", "largest_magnitude"):
        strip["metrics"][take] = {"quantity": of, "node": -1, "take": take}
    strip["metrics"]["late"] = {"quantity": of, "node": -1, "take": "range", "after": "0.3 s"}
    strip["record"] = {"quantities": ["rod/strip/position"], "rate": 100}
    kept = []
    row = rows(strip, functions={"keep": lambda run: kept.append(run.recording[of[:-2]].values[:, -1, 2])})[0]
    z, found = kept[0], row.metrics
    assert (found["first"], found["last"], found["change"]) == (z[0], z[-1], z[-1] - z[0]) and found["late"] == 0.0
    assert found["min"] == z.min() and found["max"] == z.max() and found["range"] == pytest.approx(z.max() - z.min())
    assert found["mean"] == pytest.approx(z.mean()) and found["largest_magnitude"] == abs(z).max() > 0.0


def test_a_function_may_change_the_scene_in_ways_that_no_key_path_says(strip, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.py").write_text(
        "def double(content, parameters):\n"
        "    content['rods'][0]['path']['length'] = 2.0 * parameters['half']\n"
        "    return content\n"
    )
    strip["parameters"] = {"half": {"values": ["40 mm", "50 mm"]}}
    strip["change"] = "own.py:double"
    found = rows(strip)
    assert [row.metrics["height"] for row in found] == [row.metrics["height"] for row in rows_of_lengths(strip)]


@pytest.mark.parametrize("half", [[0.04, 0.05], ["40 mm", "5 cm"]])
def test_functions_get_parameters_in_si_units_whatever_the_sweep_writes(strip, half):
    strip["parameters"] = {"half": {"path": "rods.strip.path.length", "values": half}}
    found = rows(strip, functions={"seen": lambda run: run.parameters["half"]})
    assert [row.metrics["seen"] for row in found] == [0.04, 0.05]
    assert [row.parameters["half"] for row in found] == ([0.04, 0.05] if half[0] == 0.04 else [40.0, 50.0])


def rows_of_lengths(strip):
    plain = {key: value for key, value in strip.items() if key != "change"}
    return rows(plain | {"parameters": {"length": {"path": "rods.strip.path.length", "values": [0.08, 0.1]}}})


@pytest.mark.parametrize(("body", "told"), [("return None", "must return the content"), ("1 / 0", "ZeroDivisionError")])
def test_a_change_that_fails_is_told(strip, tmp_path, monkeypatch, body, told):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.py").write_text(f"def change(content, parameters):\n    {body}\n")
    strip["change"] = "own.py:change"
    with pytest.raises(Exception, match=told):
        read_sweep(strip)


def test_logs_are_kept_for_all_or_for_runs_that_meet_conditions(strip, tmp_path):
    every = rows(strip | {"logs": "all"}, tmp_path / "all")
    assert [row.log for row in every] == [f"logs/{k:06d}.mcap" for k in range(8)]
    run = read_log(tmp_path / "all" / every[3].log)
    assert run.times[-1] == pytest.approx(0.3)
    some = rows(strip | {"logs": {"curvature": {"above": 2.0}, "outcome": {"equals": "done"}}}, tmp_path / "some")
    kept = [row for row in some if row.log]
    assert 0 < len(kept) < 8
    assert all((row.metrics["curvature"] > 2.0) == bool(row.log) for row in some)
    assert sorted(path.name for path in (tmp_path / "some/logs").iterdir()) == sorted(row.log[5:] for row in kept)
    assert [row.metrics for row in every] == [row.metrics for row in some]  # who looks changes nothing


def test_rows_come_back_from_their_text_as_they_were(strip):
    for row in rows(strip):
        assert Row.from_text(row.text()) == row
