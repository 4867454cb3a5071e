"""Layers that follow their stimulus by diffusion: the whole way from a stimulus to a state, a log and an account."""

import numpy as np
import pytest
import yaml
from support.budgets import SOFT
from support.evaluations import Problem, check
from support.faulty_scenes import faults_of
from support.sample_scenes import everything, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.cli import main
from bilayer_core.engine.energy_account import NUMERICAL
from bilayer_core.integrators.integrator_register import INTEGRATORS
from bilayer_core.model.build_model import build_model
from bilayer_core.model.validity import validity_figures
from bilayer_core.scene.diffusion_modes import DEGREE, DEGREE_OF_VARIED, FieldModes

GAIN, THICKNESS = 0.01, 1e-3
WAVE = {"type": "sine", "mean": 0.5, "amplitude": 0.5, "period": 0.2, "phase": -1.5}


def film(field=None, schedule=None, **more):
    """A clamped bilayer, both layers of which water enters from above."""
    layers = [
        layer("passive", THICKNESS),
        layer("active", 0.5 * THICKNESS, eigenstrain={"stimulus": "water", "gain": GAIN}),
    ]
    whole = {"stimulus": "water", "diffusivity": {"passive": 2e-6, "active": 1e-6}, "partition": 0.5, "top": {}}
    strip = rod(layers, length=0.03, stations=7, clamp_start="wall", diffusion={**whole, **(field or {})})
    water = {"water": {"schedule": schedule or {"type": "hold", "value": 0}}}
    return scene([strip], bodies=[fixed()], stimuli=water, **more)


VARIED = {"diffusivity": {"passive": 2e-6, "active": {"at": [0, 1], "value": [3e-7, 3e-6]}}}


def reached(simulator):
    """Mean and gradient that the laws of the active layer follow."""
    drives, modes = simulator.model.drives, simulator._state.transduction
    first = drives.law_first
    parts = zip(first[:-1], first[1:], drives.field_first[drives.law_field], strict=True)
    return np.array([drives.law_weight[a:b] @ modes[m : m + b - a] for a, b, m in parts])


def test_all_that_follows_one_field_has_the_same_modes_and_a_lag_has_one():
    content = film()
    content["rods"][0]["layers"][0]["eigenstrain"] = {"stimulus": "water", "gain": 0.5 * GAIN}
    drives = build_model(load_scene(content), "two_rod").drives
    assert drives.law_field.tolist() == [0, 0, 0, 0]
    assert len(drives.mode_rising) == 2 * DEGREE  # 2 · 12 points, one shared, one given
    lag = build_model(load_scene(everything())).drives
    assert (lag.law_weight.tolist(), lag.field_first.tolist()) == ([1.0, 1.0], [0, 1])  # one for each layer


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_the_field_at_a_time_depends_on_neither_steps_nor_integrator(integrator):
    ramp = {"type": "ramp", "start": 0, "end": 0.04, "from": 0, "to": 1}
    expected = None
    adaptive = [] if integrator == "implicit_midpoint" else [{"tolerance": 1e-3}]  # it estimates no error
    for solver in ({"dt": 1e-2}, {"dt": 2e-3}, *adaptive):
        content = film(schedule=ramp) | {"solver": {**solver, "integrator": integrator}}
        simulator = Simulator(load_scene(content))
        simulator.run(until=0.08)
        expected = reached(simulator) if expected is None else expected
        assert reached(simulator) == pytest.approx(expected, abs=1e-12)


def test_a_field_that_moves_the_faster_the_more_of_it_there_is_depends_on_no_step_either():
    ramp = {"type": "ramp", "start": 0, "end": 0.04, "from": 0, "to": 1}
    found = []
    for solver in ({"dt": 1e-2}, {"dt": 1e-3}, {"tolerance": 1e-4}):
        simulator = Simulator(load_scene(film(VARIED, schedule=ramp) | {"solver": solver}))
        simulator.run(until=0.08)
        found.append(reached(simulator))
    assert len(simulator.model.drives.mode_rising) == 2 * DEGREE_OF_VARIED
    assert found[0] == pytest.approx(found[1], abs=1e-5)
    assert found[2] == pytest.approx(found[1], abs=1e-5)
    assert found[0][0] < 0.97  # it is still on its way


@pytest.mark.parametrize("exchange", [None, 2e-3])
def test_a_curve_that_is_constant_is_a_number(exchange):
    found = []
    for value in (1e-6, {"at": [0.3], "value": [1e-6]}):
        field = {"diffusivity": {"passive": 2e-6, "active": value}, "top": {"exchange": exchange}}
        simulator = Simulator(load_scene(film(field, schedule=WAVE)))
        simulator.run(0.05)
        found.append(reached(simulator))
    assert np.array_equal(found[0], found[1])


def test_a_settled_layer_has_its_stimulus_everywhere_and_so_has_a_scene_at_its_start():
    content = film(schedule={"type": "hold", "value": 0.7})
    assert reached(Simulator(load_scene(content))) == pytest.approx([0.7, 0.0], abs=1e-12)


def test_statics_have_the_settled_field():
    simulator = Simulator(load_scene(film()))
    simulator.set_stimulus("water", 0.6)
    simulator.solve_static()
    assert reached(simulator) == pytest.approx([0.6, 0.0], abs=1e-12)


@pytest.mark.parametrize(("model", "dimension"), [("laminate", 2), ("laminate", 3), ("two_rod", 2), ("two_rod", 3)])
def test_derivatives_are_those_of_the_energy_where_a_gradient_acts(model, dimension):
    content = film()
    if dimension == 3:
        content = everything()
        content["rods"][0]["diffusion"] = {"stimulus": "humidity", "diffusivity": {"active": 1e-6}, "top": {}}
    check(Problem(content, np.random.default_rng(3), model, dimension, noise=5e-5))


def test_what_the_stimulus_supplies_by_mean_and_gradient_is_in_budget_and_account():
    lost = []
    for dt in (5e-4, 1.25e-4):
        content = film(schedule=WAVE, solver={"newton_tolerance": 1e-10}, materials=SOFT)
        simulator = Simulator(load_scene(content), dt=dt, integrator="tr_bdf2", budget=True)
        simulator.run(0.05)
        budget, account = simulator.budget(), simulator.energy_account
        supplied = abs(budget["supplied"]["stimulus"])
        lost.append(abs(budget["lost"]["numerical"]) / supplied)
        assert abs(budget["relative_residual"]) < 1e-4
        assert -account[NUMERICAL] == pytest.approx(budget["lost"]["numerical"], abs=0.01 * supplied)
    assert lost[1] < 0.3 * lost[0] < 1e-5


@pytest.mark.parametrize("field", [{}, VARIED])
def test_a_state_within_a_wave_goes_on_bit_for_bit(field):
    content = film(field, schedule=WAVE)
    simulator = Simulator(load_scene(content))
    simulator.run(0.05)
    saved = simulator.save_state()
    simulator.run(0.1)
    other = Simulator(load_scene(content))
    other.load_state(saved)
    other.run(0.1)
    assert np.array_equal(other.save_state(), simulator.save_state(), equal_nan=True)


@pytest.mark.parametrize("field", [{}, VARIED])
def test_a_log_is_made_again_bit_for_bit(tmp_path, field):
    path, log = tmp_path / "film.yaml", tmp_path / "film.mcap"
    path.write_text(yaml.safe_dump(film(field, schedule=WAVE, duration=0.1)))
    assert main(["run", str(path), "--log", str(log), "--quiet"]) == 0
    assert main(["replay", str(log), "--verify"]) == 0


def test_a_ring_and_a_copy_with_a_channel_of_its_own_follow_by_diffusion():
    content = film({"stimulus": "water"})
    content["stimuli"]["oil"] = {"schedule": {"type": "hold", "value": 1}}
    content["rods"][0]["pattern"] = {"count": 2, "stimuli": {"water": ["water", "oil"]}}
    assert reached(Simulator(load_scene(content))) == pytest.approx([0, 0, 1, 0], abs=1e-12)


def test_each_element_of_a_layer_in_the_light_warms_and_cools_by_itself():
    sun = {"schedule": {"type": "hold", "value": 1}, "light": {"from": [0, 0, 1]}}
    source = {"layer": "active", "rate": 20.0, "depth": 1e-4}
    cooled = {"sees": "ambient", "exchange": 1e-3}
    content = film({"diffusivity": {"active": 1e-6}, "partition": 1.0, "top": cooled, "source": source})
    content["stimuli"]["water"] = sun
    content["rods"][0]["layers"][1]["eigenstrain"]["gain"] = 1e-5  # it stays flat
    simulator = Simulator(load_scene(content))
    assert len(simulator.model.drives.field_channel) == 6
    simulator.run(0.02)
    field = FieldModes(load_scene(content).rods[0], load_scene(content).rods[0].diffusion[0])
    steady = float(field.functionals[0][0] @ field.steady)
    assert reached(simulator)[::2] == pytest.approx(np.full(6, steady), rel=1e-4)
    assert steady == pytest.approx(20.0 * 0.5e-3 / 1e-3, rel=0.1)


ALONE = {"diffusivity": {"active": 1e-6}, "partition": 1.0}


@pytest.mark.parametrize(
    ("field", "where", "demand"),
    [
        ({"diffusivity": {"active": 0}}, "diffusivity.active: found 0;", "a diffusivity [m^2/s] above 0"),
        ({"diffusivity": {"active": -1e-9}}, "diffusivity.active: found -1e-09;", "a diffusivity [m^2/s] above 0"),
        (
            {"diffusivity": {"active": {"at": [0, 0.5, 0.5], "value": [1e-9, 1e-9, 1e-9]}}},
            "diffusivity.active.at",
            "must be above the value before it (0.5)",
        ),
        (
            {"diffusivity": {"active": {"at": [0, 1], "value": [1e-9]}}},
            "diffusivity.active.value",
            "must be as many as `at`, 2",
        ),
        (
            {"diffusivity": {"active": {"at": [0], "value": [0]}}},
            "diffusivity.active.value",
            "must be a diffusivity [m^2/s] above 0",
        ),
        ({**VARIED, "along": True}, "along", "must be false where a diffusivity depends on the field"),
        (
            {**VARIED, "source": {"layer": "active", "rate": 1}},
            "source",
            "must be left out where a diffusivity depends",
        ),
        ({"diffusivity": {"activ": 1e-9}, "partition": 1.0}, "diffusivity.activ: ", "did you mean active"),
        ({"diffusivity": {}}, "diffusivity: found {}", "must name a layer or two"),
        ({"topp": {}}, "topp", "unknown key, did you mean top?"),
        ({**ALONE, "bottom": {}}, "bottom", "must be left out: its layer, passive, has no diffusivity"),
        ({"top": None}, "top", "must be given, or `bottom`"),
        ({"top": {"exchange": 0}}, "top.exchange: found 0;", "an exchange coefficient [m/s] above 0"),
        ({"top": {"sees": "sky"}}, 'top.sees: found "sky"', "'stimulus' or 'ambient'"),
        ({"top": {"sees": "ambient"}}, "top.sees", "must be stimulus on a face, or `source` be given"),
        ({"partition": 0}, "partition: found 0;", "a number above 0"),
        ({"diffusivity": {"active": 1e-9}}, "partition", "must be left out: the field is in one layer only"),
        ({"interval": [0, 0.01]}, "interval", "must be left out where `along` is false"),
        ({"along": True, "interval": [0.01, 0.05]}, "interval", "must be two increasing lengths"),
        ({"source": {"layer": "base", "rate": 1}}, "source.layer", "must be one of passive, active"),
        ({"stimulus": "oil"}, "stimulus", "must be that of a law of a layer in `diffusivity` (passive, active)"),
    ],
)
def test_bad_fields_are_refused_with_key_value_and_what_is_allowed(field, where, demand):
    (fault,) = [line for line in faults_of(film(field)) if f"diffusion.{where}" in line.replace("[0]", "")]
    assert demand in fault


@pytest.mark.parametrize("key", ["time_constant", "time_constant_rising", "saturation"])
def test_a_law_that_follows_a_field_has_no_lag(key):
    content = film()
    content["rods"][0]["layers"][1]["eigenstrain"][key] = 0.1
    (fault,) = faults_of(content)
    assert f"eigenstrain[0].{key}" in fault or f"eigenstrain.{key}" in fault
    assert "must be left out: the layer follows the rod's `diffusion`" in fault


def test_check_names_the_time_constants_and_warns_of_waves_too_fast_for_the_layer():
    slow = film({"diffusivity": {"passive": 2e-9, "active": 1e-9}}, schedule=WAVE, duration=10.0)
    figures = {figure.what: figure for figure in validity_figures(load_scene(slow)) if "diffusion" in figure.where}
    slowest = next(figure for what, figure in figures.items() if what.startswith("slowest"))
    assert "the run ends before" in slowest.outside
    wave = next(figure for what, figure in figures.items() if what.startswith("part of the wave"))
    assert "little more than the mean" in wave.outside
    fast = film({"diffusivity": {"passive": 2e-3, "active": 1e-3}})
    assert any("in equilibrium from one output" in str(figure) for figure in validity_figures(load_scene(fast)))
