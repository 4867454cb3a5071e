"""`bilayer converge`: five runs, orders, error bars."""

import json
import signal
from concurrent.futures import Future
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from bilayer_core import Simulator, estimate_error, load_scene
from bilayer_core.cli import main
from bilayer_core.cli.error_table import print_errors
from bilayer_core.cli.signals import Interruption
from bilayer_core.errors import SimulationError
from bilayer_core.model.undamped_friction import unseen_vibrations
from bilayer_core.studies.converge import study
from bilayer_core.studies.converge.order import estimate
from bilayer_core.studies.converge.quantities import measure
from bilayer_core.studies.converge.study import BASE, COARSER_MESH, COARSER_STEP, FINER_STEP, FINEST_STEP, planned_runs

SMALL = ["--set", "rods.strip.stations=11", "--set", "solver.dt=4 ms", "--set", "solver.integrator=implicit_euler"]


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """A short fall of a cantilever, as the command tells of it."""
    file = tmp_path_factory.mktemp("converge") / "study.json"
    asked = ["--quantity", "tip.strip.z", "--quantity", "com.z"]
    assert main(["converge", "cantilever", "--duration", "80 ms", *SMALL, *asked, "--json", str(file)]) == 0
    return json.loads(file.read_text())


@pytest.fixture(autouse=True)
def in_this_process(monkeypatch):
    """Runs one after the other in this process, which starts no other; those of `found` have their own."""

    @contextmanager
    def one_by_one(*_):
        def schedule(function, *arguments):
            future = Future()
            try:
                future.set_result(function(*arguments))
            except Exception as error:
                future.set_exception(error)
            return future

        yield schedule

    monkeypatch.setattr(study, "side_by_side", one_by_one)


def test_the_paper_s_integrator_shows_order_one(found):
    assert found["integrator"] == "implicit_euler"
    tip = found["quantities"][0]
    assert tip["name"] == "tip.strip.z"
    assert 0.8 < tip["time"]["order"] < 1.2


def test_the_error_bar_holds_a_much_finer_run(found):
    tip = found["quantities"][0]
    scene = load_scene("cantilever", ["rods.strip.stations=81", "solver.dt=0.25 ms"])
    fine = measure(Simulator(scene), 0.08)["tip.strip.z"]
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
    assert (coarser.dt, coarser.tolerance, coarser.max_step) == pytest.approx((2e-3, 8e-5, 0.02))
    asked = ["--quantity", "tip.strip.z", "--duration", "0.1", "--json", "study.json", "--quiet"]
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


# the global error of one run


def test_the_global_error_holds_a_much_finer_run():
    changes = ["rods.strip.stations=11", "solver.dt=4 ms", "solver.integrator=implicit_euler"]
    row = estimate_error(load_scene("cantilever", changes), 0.08, ["tip.strip.z"]).rows[0]
    fine = measure(Simulator(load_scene("cantilever", [*changes, "solver.dt=0.1 ms"])), 0.08)["tip.strip.z"]
    assert 0.8 < row.time.order < 1.2 and row.mesh is None
    assert 0.5 < abs(fine - row.values[BASE]) / row.bar < 1.0


def test_a_quarter_of_the_step_is_a_third_level_whose_bar_holds_a_much_finer_run():
    changes = ["rods.strip.stations=11", "solver.dt=4 ms", "solver.integrator=implicit_euler"]
    scene, name = load_scene("cantilever", changes), "tip.strip.z"
    row = estimate_error(scene, 0.08, [name], quarter=True).rows[0]
    fine = measure(Simulator(load_scene("cantilever", [*changes, "solver.dt=0.1 ms"])), 0.08)[name]
    assert set(row.values) == {COARSER_STEP, BASE, FINER_STEP, FINEST_STEP}
    assert 0.8 < row.time.order < 1.2
    assert 0.5 < abs(fine - row.values[BASE]) / row.bar < 1.0
    assert abs(fine - row.values[FINEST_STEP]) < 0.4 * abs(fine - row.values[BASE])


def test_an_estimate_names_what_it_cannot_see_where_friction_acts_on_an_undamped_material(capsys):
    (unseen,) = unseen_vibrations(load_scene("crawling_inchworm"))
    assert "materials.film.retardation_time" in unseen and "--quarter-step" in unseen
    damped = "materials.film.retardation_time=1 ms"
    for unheard in (["crawling_inchworm", [damped]], ["cantilever"], ["gripping", ["contact.friction.coefficient=0"]]):
        assert unseen_vibrations(load_scene(*unheard)) == ()
    print_errors(study.Study("sdirk2", "adaptive", [], {}, (unseen,)))
    assert f"Not seen: {unseen[:20]}" in capsys.readouterr().out


def test_a_third_level_without_an_estimate_is_refused(capsys):
    assert main(["run", "cantilever", "--quarter-step", "--quiet"]) == 2
    assert "--quarter-step: adds a run to those of --error-estimate" in capsys.readouterr().err


def test_a_run_with_an_estimate_is_the_run_without_and_tells_its_error(tmp_path, capsys):
    base = ["run", "cantilever", "--duration", "0.1"]
    assert main([*base, "--save-state", str(tmp_path / "a.npz"), "--quiet"]) == 0
    files = ["--save-state", str(tmp_path / "b.npz"), "--summary", str(tmp_path / "b.json")]
    assert main([*base, *files, "--error-estimate"]) == 0
    first, second = (np.load(tmp_path / name) for name in ("a.npz", "b.npz"))
    for key in first:
        np.testing.assert_array_equal(first[key], second[key])
    summary = json.loads((tmp_path / "b.json").read_text())
    moved = summary["com_end"][2] - summary["com_start"][2]
    told = summary["global_error"]["figures"]["com.z"]
    assert told["value"] == pytest.approx(moved, rel=1e-12)
    assert abs(told["finer"] - told["value"]) < told["error"] < 0.1 * abs(moved)
    shown = capsys.readouterr().out
    assert "global error" in shown and "Of the time steps alone" in shown


def test_runs_of_an_estimate_start_from_the_state_that_the_run_starts_from(tmp_path):
    start, summary = str(tmp_path / "start.npz"), tmp_path / "s.json"
    assert main(["run", "cantilever", "--duration", "0.04", "--save-state", start, "--quiet"]) == 0
    again = ["run", "cantilever", "--from-state", start, "--duration", "0.04", "--summary", str(summary), "--quiet"]
    assert main([*again, "--error-estimate"]) == 0
    told = json.loads(summary.read_text())["global_error"]["figures"]["com.z"]
    assert told["finer"] == pytest.approx(told["value"], rel=0.02)
    from_rest = measure(Simulator(load_scene("cantilever")), 0.04)["com.z"]
    assert abs(from_rest - told["value"]) > 0.3 * abs(told["value"])


def test_an_estimate_that_cannot_be_made_leaves_the_run_and_its_outputs(tmp_path, monkeypatch, capsys):
    def stop(*_, **__):
        raise SimulationError("half the step: too hard", 0.01)

    monkeypatch.setattr(study, "estimate_error", stop)
    summary = tmp_path / "s.json"
    asked = ["run", "cantilever", "--duration", "8 ms", "--summary", str(summary), "--error-estimate"]
    assert main(asked) == 3
    written = json.loads(summary.read_text())
    assert written["termination"] == "completed" and "global_error" not in written
    assert "half the step: too hard" in capsys.readouterr().err


def test_runs_that_close_in_on_no_limit_are_told(capsys):
    values = {COARSER_STEP: 1.0, BASE: 1.1, FINER_STEP: 0.8}
    row = study.Row("com.x", values, estimate((2.0, 1.0, 0.5), tuple(values.values())), None)
    print_errors(study.Study("sdirk2", "adaptive", [row], {}))
    shown = capsys.readouterr().out
    assert "none seen" in shown and "± 1.8e+03 mm" in shown and "no bound where motion is chaotic" in shown


def test_the_time_of_a_contact_is_known_to_a_step():
    scene = load_scene("gripping", ["rods.arm.stations=10", "stimuli.humidity.schedule={type: hold, value: 1}"])
    row = estimate_error(scene, 0.03, ["body.ball.first_contact"]).rows[0]
    runs = {run.name: run.step for run in study.runs_over_steps(scene, False)}
    names = COARSER_STEP, BASE, FINER_STEP
    of_values = estimate(tuple(runs[name] for name in names), tuple(row.values[name] for name in names))
    assert row.bar == pytest.approx(of_values.bar + Simulator(scene).steps.longest, rel=1e-12)


def test_an_estimate_that_is_interrupted_leaves_the_run_and_its_outputs(tmp_path, monkeypatch):
    def interrupt(*_, **__):
        raise Interruption(signal.SIGINT)

    monkeypatch.setattr(study, "estimate_error", interrupt)
    summary = tmp_path / "s.json"
    assert main(["run", "cantilever", "--duration", "8 ms", "--summary", str(summary), "--error-estimate"]) == 130
    assert json.loads(summary.read_text())["termination"] == "completed"
