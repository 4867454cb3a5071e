"""Searches: they find what is known, go on after a kill, and confirm what they found."""

import json
import warnings
from dataclasses import replace

import pytest
import yaml
from support.sweep_programs import STRIP

from bilayer_core import load_scene, optimise
from bilayer_core.cli import main
from bilayer_core.cli.optimise import lines
from bilayer_core.errors import InputError
from bilayer_core.simulation.gradients.run_response import RunResponse
from bilayer_core.studies.sweeps.ascent import Ascent, refuse_unclimbable
from bilayer_core.studies.sweeps.execute_runs import execute
from bilayer_core.studies.sweeps.journal import Journal
from bilayer_core.studies.sweeps.optimise import Search, finer_job, ranked, start_of
from bilayer_core.studies.sweeps.run_sweep import read_sweep

RANGES = {
    "gain": {"path": "rods.strip.layers.active.eigenstrain.gain", "from": "0.5 %", "to": "2 %", "start": "1 %"},
    "length": {"path": "rods.strip.path.length", "values": ["80 mm", "100 mm", "120 mm"]},
}
NEAR = {"near": lambda run: -((100.0 * run.parameters["gain"] - 1.7) ** 2) - (run.parameters["length"] != 0.1)}


@pytest.fixture
def ranges():
    """A sweep with ranges and a choice, for searches."""
    return {**STRIP, "parameters": RANGES}


def told(search, read, trials):
    """A search, with the rows of the runs that it asked for and was told of."""
    rows = []
    for _ in range(trials):
        point = search.ask()
        rows += execute(read.job, [point])
        search.tell(point.number, rows[-1])
    return search, rows


def search_in_process(content, metric, trials, functions=None):
    """A search without processes, as `optimise` makes it with one worker."""

    read = read_sweep(content, functions=functions, is_search=True)
    return told(Search(read, metric, True, 3), read, trials)


def test_a_known_optimum_is_found(ranges):
    search, rows = search_in_process(ranges, "near", 40, NEAR)
    best = ranked(rows, search.metric, search.largest)[0]
    assert best.parameters["length"] == 100.0
    assert best.parameters["gain"] == pytest.approx(1.7, abs=0.05)


def test_the_first_run_has_the_values_that_are_known_to_work(ranges):
    search, rows = search_in_process(ranges, "curvature", 1)
    assert rows[0].parameters == search.start == {"gain": 1.0, "length": 80.0}


def test_the_same_search_is_made_again(ranges):
    first, second = (search_in_process(ranges, "curvature", 15)[1] for _ in range(2))
    assert [row.parameters for row in first] == [row.parameters for row in second]


def test_a_search_that_is_continued_knows_what_was_tried(ranges):
    _, rows = search_in_process(ranges, "near", 25, NEAR)
    later = Search(read_sweep(ranges, functions=NEAR, is_search=True), "near", True, 3, rows)
    assert later.asked == 25

    def distance(search):
        return sum(abs(search.ask().parameters["gain"] - 1.7) for _ in range(12))

    assert distance(later) < distance(Search(read_sweep(ranges, functions=NEAR, is_search=True), "near", True, 3))


def test_a_finer_run_has_a_tenth_of_the_tolerance_or_a_quarter_of_the_step(ranges):
    read = read_sweep(ranges, is_search=True)
    values = {"gain": 1.0, "length": 80.0}
    finer = json.loads(finer_job(read.job, values).scene)["solver"]
    assert (finer["tolerance"], finer["max_step"]) == pytest.approx((1e-5, 1.5e-3))
    ranges["set"] = {"solver.tolerance": None, "solver.dt": "1 ms", "duration": 0.3}
    fixed = read_sweep(ranges, is_search=True)
    assert json.loads(finer_job(fixed.job, values).scene)["solver"]["dt"] == pytest.approx(2.5e-4)


def test_a_search_on_processes_is_confirmed_resumed_and_written(ranges, cluster, tmp_path):
    seen = []
    options = {"scheduler": cluster, "out": tmp_path, "progress": seen.append}
    first = optimise(ranges, "curvature", trials=12, **options)
    assert len(seen) == first.trials == 12
    assert first.is_confirmed and first.value > first.start > 0.0
    assert abs(first.difference) < 0.02
    second = optimise(ranges, "curvature", trials=20, resume=True, **options)
    assert len(seen) == second.trials == 20 and second.value >= first.value
    assert (second.at_end == ("gain",)) == (second.best.parameters["gain"] > 1.985)
    told = lines(replace(second, at_end=("gain",)))
    assert [line.endswith("at an end of its range: a wider one may have better") for line in told[1:3]] == [True, False]
    scene = load_scene(tmp_path / "best.yaml")
    layer = scene.rods[0].layers[1]
    assert layer.eigenstrain[0].gain == pytest.approx(second.best.parameters["gain"] / 100.0)
    with Journal(tmp_path, {}, force=True):
        pass


def test_a_value_that_finer_steps_do_not_confirm_is_told_and_ends_with_1(ranges, tmp_path, capsys):
    (tmp_path / "own.py").write_text("def steps(run):\n    return float(run.summary['steps'])\n")
    ranges["metrics"] = {"steps": {"function": "own.py:steps"}}  # which finer steps change
    (tmp_path / "sweep.yaml").write_text(yaml.safe_dump(ranges))
    out = str(tmp_path / "out")
    arguments = ["optimise", str(tmp_path / "sweep.yaml"), "--maximise", "steps", "--trials", "4", "--out", out]
    assert main([*arguments, "--workers", "1", "--quiet"]) == 1
    printed = capsys.readouterr().out
    assert "best of 4 runs: steps" in printed and "NOT confirmed with finer steps" in printed


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ([], "give --maximise METRIC or --minimise METRIC"),
        (["--maximise", "a", "--minimise", "b"], "give --maximise METRIC or --minimise METRIC"),
        (["--maximise", "curvatur"], "has no such metric; there are curvature, height"),
        (["--maximise", "curvature", "--workers", "2", "--scheduler", "tcp://127.0.0.1:1"], "a cluster"),
        (["--maximise", "curvature", "--trials", "0"], "trials"),
    ],
)
def test_what_cannot_be_searched_for_is_told(ranges, tmp_path, capsys, arguments, told):
    (tmp_path / "sweep.yaml").write_text(yaml.safe_dump(ranges))
    code = main(["optimise", str(tmp_path / "sweep.yaml"), "--out", str(tmp_path / "out"), "--quiet", *arguments])
    assert code == 2
    assert told in capsys.readouterr().err


def test_a_metric_that_no_run_has_is_told_with_how_runs_ended(ranges, cluster):
    ranges["metrics"] = {"contact": "min_gap"}
    with pytest.raises(InputError, match="metric 'contact': no run has a value of it; 2 runs were made"):
        optimise(ranges, "contact", trials=2, scheduler=cluster)


STRAIGHT = {
    "gain": {"path": "rods.strip.layers.active.eigenstrain.gain", "from": "-2 %", "to": "2 %", "start": "1.5 %"},
    "level": {"path": "stimuli.swelling.schedule.to", "from": 0.4, "to": 0.9, "start": 0.8},
}
STRAIGHTEST = 100.0 * 6.0 / (2.0 * 75.0**2)
"""Growth ε at which x = ½ L (1 + ½ ε)(1 − (κ L)²/12), κ L = 1.5 ε L/h = 75 ε, is largest [%]."""
REACH = {"reach": {"quantity": "com.x", "take": "last"}}


@pytest.fixture
def straight():
    """A strip that grows and bends, so that there is a growth with which its mass centre is farthest out."""
    return {**STRIP, "parameters": STRAIGHT, "metrics": REACH}


def climb_in_process(content, trials, seed=3, largest=True):
    """A search by derivatives without processes, as `optimise` makes it with one worker."""
    read = read_sweep(content, is_search=True)
    refuse_unclimbable(read, "reach")
    read = replace(read, job=replace(read.job, slope_of="reach"))
    return told(Ascent(read, "reach", largest, seed, start_of(read)), read, trials)


def test_climbs_along_derivatives_find_a_known_optimum(straight):
    climbs, rows = climb_in_process(straight, 16)
    best = ranked(rows, "reach", True)[0]
    assert rows[0].parameters == pytest.approx({"gain": 1.5, "level": 0.8})
    grown = 0.3 * best.parameters["gain"] * best.parameters["level"]  # at the end, 0.3 s into the ramp [%]
    assert grown == pytest.approx(STRAIGHTEST, rel=0.05)  # it still moves
    assert climb_in_process(straight, 16)[1][-1].parameters == rows[-1].parameters


def test_climbs_stay_within_ranges_and_go_along_their_ends(straight):
    straight["parameters"] = {**STRAIGHT, "gain": {**STRAIGHT["gain"], "from": "0.5 %"}}
    _, rows = climb_in_process(straight, 12)
    best = ranked(rows, "reach", True)[0].parameters
    assert (best["gain"], best["level"]) == pytest.approx((0.503, 0.401), abs=1e-9)
    assert all(0.5 <= row.parameters["gain"] <= 2.0 for row in rows)


def test_the_least_value_is_found_by_going_down(straight):
    _, rows = climb_in_process(straight, 12, largest=False)
    best = ranked(rows, "reach", False)[0].parameters
    assert abs(best["gain"]) > 1.9 and best["level"] > 0.89


ON_A_FLOATING_HUB = {
    "scene": "swimming",
    "parameters": {"gain": {"path": "rods.arm.layers.active.eigenstrain.gain", "from": "0.5 %", "to": "2.5 %"}},
    "metrics": {"reach": {"quantity": "com.z", "take": "change"}},
}


@pytest.mark.parametrize("changes", [{}, ON_A_FLOATING_HUB], ids=["strip", "robot with a free body"])
def test_derivatives_of_a_run_are_those_by_parameters_in_their_units(straight, changes):
    straight["set"] = {"duration": 0.3, "solver.tolerance": None, "solver.dt": "2 ms", "solver.newton_tolerance": 1e-9}
    read = read_sweep(straight | changes, is_search=True)
    job, h = replace(read.job, slope_of="reach"), 1e-3
    values = {name: {"gain": 1.0, "level": 0.7}[name] for name in read.spec.parameters}
    (row,) = execute(job, [read.point(0, values)])
    for name in values:
        points = [read.point(0, values | {name: values[name] + side * h}) for side in (1.0, -1.0)]
        above, below = (found.metrics["reach"] for found in execute(read.job, points))
        assert row.slopes[name] == pytest.approx((above - below) / (2.0 * h), rel=1e-4), name


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"metrics": {"reach": {"quantity": "com.x", "take": "max"}}}, "must be the last value or the change of com.x"),
        ({"metrics": {"reach": "mean_curvature"}}, "metric 'reach' must be the last value"),
        (
            {"metrics": {"reach": {"quantity": "com.x", "take": "change"}}, "set": {"start": "settle"}},
            "must be the last value where the start settles",
        ),
        (
            {"parameters": {"gain": {**STRAIGHT["gain"], "whole": True}}},
            "parameter 'gain' must have a range of numbers",
        ),
        ({"parameters": {"length": RANGES["length"]}}, "parameter 'length' must have a range of numbers"),
        (
            {
                "parameters": {"length": {"path": "rods.strip.path.length", "from": "90 mm", "to": "110 mm"}},
                "metrics": {"reach": {"quantity": "com.x", "take": "change"}},
            },
            "parameter 'length' is neither a gain nor of a stimulus",
        ),
    ],
)
def test_what_has_no_derivatives_is_refused_by_name(straight, changes, told):
    with pytest.raises(InputError, match=told):
        optimise(straight | changes, "reach", method="gradients", trials=1)


def test_a_search_by_derivatives_that_tell_nothing_says_so(straight, monkeypatch):
    def look(*_):
        warnings.warn("gradient: the motion forgets its start: …", RuntimeWarning, stacklevel=2)

    monkeypatch.setattr(RunResponse, "_look_at", look)
    climbs, rows = climb_in_process(straight, 3)
    assert climbs.is_lost and "forgets its start" in climbs.found_none
    assert rows[0].outcome == "done" and rows[0].slopes == {}


def test_a_search_by_derivatives_on_processes_is_confirmed_and_resumed(straight, cluster, tmp_path):
    options = {"scheduler": cluster, "out": tmp_path, "method": "gradients"}
    first = optimise(straight, "reach", trials=6, **options)
    seen = []
    second = optimise(straight, "reach", trials=10, resume=True, progress=seen.append, **options)
    assert second.is_confirmed and second.value >= first.value > first.start
    assert len(seen) <= 10
