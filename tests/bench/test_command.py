"""`bilayer bench`: what it writes, what it refuses, what it goes on with."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from bilayer_core.cli import main
from bilayer_core.model.plan import MODELS
from bilayer_core.observed.inputs import SHAPES
from bilayer_core.verification.bench import (
    cantilever,
    commands,
    converged_answers,
    machine,
    measuring,
    plots,
    problems,
    run_benchmark,
    tables,
    work_precision,
)
from bilayer_core.verification.bench.configurations import Configuration, Family, families

FAMILY = Family("two_rod", 3, "sdirk2")


@pytest.fixture
def small(monkeypatch):
    """Two problems of a few steps each, their references made up, and no peer installed."""
    by_name = {problem.name: problem for problem in problems.PROBLEMS}
    tip = by_name["cantilever"]
    chosen = tuple(
        type(tip)(
            **{
                **vars(tip),
                "name": name,
                "duration": 0.02,
                "levels": ((6, (4e-3, 2e-3)),),
                "euler_levels": ((6, (1e-3,)),),
                "quick_levels": ((6, (4e-3,)),),
                "tolerances": (1e-3,),
                "measure": type(tip.measure)("tip", until=0.02, spacing=2e-3, length=0.1),
            }
        )
        for name in ("cantilever", "snap")
    )
    times = np.linspace(0.0, 0.02, 11)
    way = np.column_stack([times, 0.1 + 0 * times, 0 * times, -0.5 * 9.81 * times**2])
    made = converged_answers.Reference(way, 1e-4, "free fall", 1e-3)
    for module in (problems, run_benchmark):
        monkeypatch.setattr(module, "PROBLEMS", chosen)
    entry = {"bar": 1e-4, "checks": {"free fall": 1e-3}, "values": way.tolist()}
    entries = {problem.name: {model: entry for model in MODELS} for problem in chosen}
    for module in (plots, tables):
        monkeypatch.setattr(module, "PROBLEMS", chosen)
        monkeypatch.setattr(module, "read_file", lambda: entries)
    monkeypatch.setattr(converged_answers, "read_file", lambda: entries)
    monkeypatch.setattr(converged_answers, "stored", lambda problem, model: made)
    monkeypatch.setattr(measuring, "REPEATS", 1)
    monkeypatch.setattr(cantilever, "find_spec", lambda name: None)


def test_two_problems_are_measured_into_json_tables_and_plots(small, tmp_path, capsys, monkeypatch):
    chosen = [family for family in families(problems.PROBLEMS[0].config()) if family.dimension == 2]
    monkeypatch.setattr(work_precision, "families", lambda *_: chosen)
    out = tmp_path / "out"
    parts = ["--only", "cantilever", "--only", "snap", "--only", "peers"]
    assert main(["bench", "--out", str(out), *parts]) == 0
    printed = capsys.readouterr().out
    assert "pyelastica: skipped, it is not installed; pip install 'bilayer_sim_ros[bench]'" in printed
    content = json.loads((out / "bench.json").read_text())
    runs = content["work_precision"]
    further = sum(family.integrator == "implicit_euler" and not family.adaptive for family in chosen)
    expected = 2 * (sum(1 if family.adaptive else 2 for family in chosen) + further)
    assert len(runs) == expected and {run["outcome"] for run in runs} == {"done"}
    assert all(0.0 < run["error"] < 1.0 and run["cpu_time"] > 0.0 for run in runs)
    assert content["machine"]["cores"] >= 1 and len(content["began"]["load"]) == 3
    assert content["recommended"]["model"] in {run["model"] for run in runs}
    with (out / "work_precision.csv").open() as file:
        assert len(list(csv.DictReader(file))) == expected
    page = (out / "bench.md").read_text()
    assert content["machine"]["cpu"] in page and "## CPU time to an error of 1 %" in page
    beside = [line for line in page.split("## Adaptive steps beside")[1].splitlines() if line.startswith("| ")][2:4]
    assert [line.split(" | ")[0] for line in beside] == ["| cantilever", "| snap"]
    for name in ("cantilever", "snap"):
        pixels = np.asarray(Image.open(out / f"work_precision_{name}.png").convert("RGB")).reshape(-1, 3)
        assert len(np.unique(pixels[(pixels < 250).any(axis=1)] // 64, axis=0)) >= 5


def test_results_that_are_there_are_refused_kept_or_replaced_as_asked(small, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(work_precision, "families", lambda *_: [FAMILY])
    arguments = ["bench", "--out", str(tmp_path), "--only", "snap"]
    assert main(arguments) == 0
    before = json.loads((tmp_path / "bench.json").read_text())["work_precision"]
    assert main(arguments) == 2
    assert "exists already; go on with it with --resume, replace it with --force" in capsys.readouterr().err
    with monkeypatch.context() as patch:
        patch.setattr(measuring, "run", None)  # nothing is left to run
        assert main([*arguments, "--resume"]) == 0
    assert json.loads((tmp_path / "bench.json").read_text())["work_precision"] == before
    assert main([*arguments, "--resume", "--quick"]) == 2
    assert "quick is False there and True now" in capsys.readouterr().err
    assert main([*arguments, "--force", "--quick"]) == 0
    assert json.loads((tmp_path / "bench.json").read_text())["quick"] is True


def test_what_is_not_there_to_be_measured_is_refused(capsys, tmp_path):
    assert main(["bench", "--only", "swiming", "--out", str(tmp_path)]) == 2
    assert "--only swiming: no such part, did you mean swimming?" in capsys.readouterr().err


def test_the_list_says_what_there_is(capsys):
    assert main(["bench", "--list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == run_benchmark.names()
    assert len(problems.PROBLEMS) >= 7


@pytest.mark.parametrize("problem", problems.PROBLEMS, ids=lambda problem: problem.name)
def test_every_problem_has_a_reference_that_fits_it(problem):
    models = converged_answers.read_file()[problem.name]
    assert converged_answers.JUDGE in models
    for model in models:
        reference = converged_answers.stored(problem, model)
        assert reference.values.shape[1] in (1, 4) and np.isfinite(reference.values).all()
        # two methods that have neither mesh nor step, or not the integrator, in common
        assert reference.difference <= reference.bar + 1e-3
        assert reference.bar <= converged_answers.BLURRED


@pytest.mark.parametrize("problem", problems.PROBLEMS, ids=lambda problem: problem.name)
def test_levels_are_meshes_and_steps_that_end_with_the_run(problem):
    for stations, steps in [*problem.levels, *problem.euler_levels]:
        problem.config(stations)
        for dt in steps:
            assert problem.duration / dt == pytest.approx(round(problem.duration / dt), abs=1e-6)


def test_a_problem_that_changed_asks_for_a_new_reference():
    """Without a section the strip of `snap` is computed as a strip, and its reference is of a beam."""
    problem = problems.problem("snap")
    of_strip = replace(problem, changes=[change for change in problem.changes if ".section=" not in change])
    with pytest.raises(Exception, match="bilayer bench --references --only snap"):
        converged_answers.stored(of_strip, "laminate")


@pytest.mark.parametrize("name", ["cantilever", "snap"])
def test_a_run_in_small_steps_meets_the_reference(name):
    problem = problems.problem(name)
    found = measuring.run(problem, Configuration(Family("laminate", 2, "sdirk2"), 41, 1e-3))
    assert problem.measure.error(found.values, converged_answers.stored(problem, "laminate").values) < 5e-3


def test_a_way_has_a_point_for_every_step():
    problem = problems.problem("cantilever")
    found = measuring.run(problem, Configuration(FAMILY, 6, 4e-3))
    assert found.values[:, 0] == pytest.approx(4e-3 * np.arange(126))
    assert found.cost["cpu_time"] > 0.0


def test_a_run_that_takes_too_long_is_ended_and_says_so():
    problem = problems.problem("cantilever")
    found = measuring.run(problem, Configuration(FAMILY, 6, 4e-3), longest=0.0)
    assert found.values is None and "ended after 0 s of CPU" in found.outcome


def test_the_machine_is_recorded_with_versions():
    record = machine.record()
    assert record["cpu"] and record["versions"]["numpy"]
    assert machine.installed_version("no-such-distribution") is None


def test_actions_of_a_controller_are_counted_beside_their_errors(tmp_path, monkeypatch):
    monkeypatch.setattr(commands, "QUICK_SCENE", "bending")
    monkeypatch.setattr(commands, "ACTIONS", 4)
    assert main(["bench", "--quick", "--quiet", "--out", str(tmp_path), "--only", "commands"]) == 0
    records = json.loads((tmp_path / "bench.json").read_text())["commands"]
    found = {(r["shape"], r["integrator"], r["tolerance_factor"]): r for r in records}
    assert list(found) == [(shape, *choice) for shape in SHAPES for choice in commands.CHOICES]
    for shape in SHAPES:
        small, large = (found[shape, "sdirk2", factor]["error"] for factor in (1.0, 5.0))
        assert 0.0 < small < large < 0.01
    assert all(record["actions_per_second"] > 0.0 for record in records)
    page = (tmp_path / "bench.md").read_text().split("## Actions of a controller")[1]
    assert sum(line.startswith("| bending | ") for line in page.splitlines()) == len(records)
