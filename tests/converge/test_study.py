"""`bilayer converge`: five runs, orders, error bars."""

import json
from pathlib import Path

import numpy as np
import pytest

from bilayer_core import Simulator, load_scene
from bilayer_core.cli import main
from bilayer_core.converge.quantities import measure
from bilayer_core.converge.study import BASE, COARSER_MESH, COARSER_STEP, FINER_STEP, planned_runs

SMALL = ["--set", "rods.strip.stations=11", "--set", "solver.dt=4 ms", "--set", "solver.integrator=implicit_euler"]


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """A short fall of a cantilever, as the command tells of it."""
    file = tmp_path_factory.mktemp("converge") / "study.json"
    asked = ["--quantity", "tip.strip/gel.z", "--quantity", "com.z"]
    assert main(["converge", "cantilever", "--duration", "80 ms", *SMALL, *asked, "--json", str(file)]) == 0
    return json.loads(file.read_text())


def test_the_paper_s_integrator_shows_order_one(found):
    assert found["integrator"] == "implicit_euler"
    tip = found["quantities"][0]
    assert tip["name"] == "tip.strip/gel.z"
    assert 0.8 < tip["time"]["order"] < 1.2


def test_the_error_bar_holds_a_much_finer_run(found):
    tip = found["quantities"][0]
    scene = load_scene("cantilever", ["rods.strip.stations=81", "solver.dt=0.25 ms"])
    fine = measure(Simulator(scene), 0.08)["tip.strip/gel.z"]
    assert abs(fine - tip["values"][BASE]) < tip["error_bar"]


def test_measured_figures_are_those_of_the_simulator():
    scene = load_scene("cantilever", ["rods.strip.stations=11"])
    figures = measure(Simulator(scene), 0.02)
    simulator = Simulator(scene)
    start = simulator.com
    simulator.run(0.02)
    np.testing.assert_allclose([figures[f"com.{axis}"] for axis in "xyz"], simulator.com - start, rtol=1e-12)
    assert "com.rise" not in figures and "take_off" not in figures


def test_edges_are_halved_and_doubled():
    scene = load_scene("cantilever", ["rods.strip.stations=50"])
    runs = {run.name: run for run in planned_runs(scene)}
    assert runs[COARSER_MESH].overrides == ("rods.strip.stations=25",)
    assert runs[COARSER_MESH].edges == pytest.approx(24 / 49)


def test_adaptive_steps_are_halved_and_doubled_by_their_tolerance(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    changes = ["solver.integrator=sdirk2", "solver.tolerance=1e-5", "rods.strip.stations=11"]
    adaptive = [word for change in changes for word in ("--set", change)]
    scene = load_scene("cantilever", changes)
    runs = {run.name: run for run in planned_runs(scene)}
    coarser = load_scene("cantilever", [*changes, *runs[COARSER_STEP].overrides]).solver
    assert (coarser.dt, coarser.tolerance, coarser.max_step) == pytest.approx((2e-3, 8e-5, 0.04))
    asked = ["--quantity", "tip.strip/gel.z", "--duration", "0.1", "--json", "study.json", "--quiet"]
    assert main(["converge", "cantilever", *adaptive, *asked]) == 0
    stepping = "adaptive, error per step at most 1e-05 of the longest rod"
    assert f"cantilever: sdirk2, steps {stepping}\n" in capsys.readouterr().out
    tip = json.loads(Path("study.json").read_text())["quantities"][0]["values"]
    assert abs(tip[FINER_STEP] - tip[BASE]) < 0.5 * abs(tip[BASE] - tip[COARSER_STEP])


def test_an_unknown_figure_is_refused_before_any_run(capsys):
    assert main(["converge", "cantilever", "--quantity", "com.rize", "--quiet"]) == 2
    error = capsys.readouterr().err
    assert "--quantity com.rize: no such figure" in error and "com.rise" in error


def test_what_did_not_happen_has_no_order(capsys):
    asked = ["converge", "cantilever", "--duration", "8 ms", *SMALL, "--quantity", "take_off", "--quiet"]
    assert main(asked) == 2
    assert "take_off: did not happen in one of the runs" in capsys.readouterr().err


def test_a_scene_that_cannot_go_on_ends_with_exit_code_3(capsys):
    hopeless = [
        "--set",
        "solver.max_newton_iterations=1",
        "--set",
        "solver.max_halvings=0",
        "--set",
        "solver.newton_tolerance=1e-15",
    ]
    assert main(["converge", "cantilever", "--duration", "8 ms", *hopeless, "--quiet"]) == 3
    assert "stopped at t = 0 s" in capsys.readouterr().err
