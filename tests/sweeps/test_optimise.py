"""Searches: they find what is known, go on after a kill, and confirm what they found."""

import json
from dataclasses import replace

import pytest
import yaml
from support.sweep_programs import STRIP

from bilayer_core import load_scene, optimise
from bilayer_core.cli import main
from bilayer_core.cli.optimise import lines
from bilayer_core.errors import InputError
from bilayer_core.studies.sweeps.execute_runs import execute
from bilayer_core.studies.sweeps.journal import Journal
from bilayer_core.studies.sweeps.optimise import Search, finer_job
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


def search_in_process(content, metric, trials, functions=None):
    """A search without processes, as `optimise` makes it with one worker."""

    read = read_sweep(content, functions=functions, is_search=True)
    search, rows = Search(read, metric, True, 3), []
    for _ in range(trials):
        point = search.ask()
        rows += execute(read.job, [point])
        search.tell(point.number, rows[-1])
    return search, rows


def test_a_known_optimum_is_found(ranges):
    search, rows = search_in_process(ranges, "near", 40, NEAR)
    best = search.ranked(rows)[0]
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
