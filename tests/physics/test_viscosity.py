"""Kelvin–Voigt viscosity of materials; decay, creep, spin and orders are cases of `bilayer validate`."""

import numpy as np
import pytest
from support.sample_scenes import GEL, everything, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import SceneError
from bilayer_core.model.plan import make_plan
from bilayer_core.verification.validate.motion import let_go
from bilayer_core.verification.validate.viscosity import gel

MODELS = [("laminate", 2), ("laminate", 3), ("two_rod", 2), ("two_rod", 3)]
METHODS = ["implicit_euler", "sdirk2", "tr_bdf2", "generalised_alpha"]
JUMP = {"h": {"schedule": {"type": "hold", "value": 0.0}}}


def bilayer(time=5e-3, integrator="tr_bdf2", model="laminate", dimension=2, times=None, **more):
    """A soft clamped strip whose top layer swells."""
    top = layer("top", material="top", eigenstrain=[{"stimulus": "h", "gain": 0.04}])
    strip = rod([layer("bottom"), top], length=0.06, stations=21, clamp_start="wall")
    below, above = times or (time, time)
    solver = {"integrator": integrator, "model": model, "dimension": dimension, "newton_tolerance": 1e-10}
    materials = {"gel": gel(below), "top": gel(above)}
    return scene([strip], solver=solver, bodies=[fixed()], materials=materials, stimuli=JUMP, **more)


def swollen(content, dt, seconds=0.5):
    """A run with its energy budget, whose stimulus jumps after 10 ms."""
    simulator = Simulator(load_scene(content), dt=dt, budget=True)
    simulator.run(0.01)
    simulator.set_stimulus("h", 1.0)
    simulator.run(seconds)
    return simulator


@pytest.mark.parametrize(
    ("model", "dimension", "integrator"), [(*MODELS[k], integrator) for k, integrator in enumerate(METHODS)]
)
def test_a_jump_of_the_eigenstrain_meets_no_viscosity_and_its_energy_is_accounted_for(model, dimension, integrator):
    budget = swollen(bilayer(integrator=integrator, model=model, dimension=dimension), 5e-4, 0.15).budget()
    jump = 0.5 * 1e6 * 0.01 * 1e-3 * 0.06 * 0.04**2  # ½ EA η² L: the energy of a layer that could not follow at all
    if model == "laminate":
        jump *= 0.875  # what shape can release of it: ½ N²/A + ½ M²/D
    assert 0.94 * jump < budget["supplied"]["stimulus"] < jump
    left = budget["supplied"]["stimulus"] - sum(budget["stored"].values()) - budget["lost"]["numerical"]
    assert budget["lost"]["viscosity"] == pytest.approx(left, rel=1e-6)
    assert abs(budget["lost"]["numerical"]) < 0.05 * budget["lost"]["viscosity"]


def test_what_integrators_say_that_viscosity_took_agrees():
    lost = [swollen(bilayer(integrator=name), 2.5e-4, 0.1).budget()["lost"]["viscosity"] for name in METHODS[1:]]
    assert np.ptp(lost) < 3e-3 * np.mean(lost)


@pytest.mark.parametrize("integrator", METHODS)
def test_momentum_of_a_viscous_strip_in_violent_vibration_stays(integrator):
    layers = [layer("passive"), layer("active", thickness=1.5e-3)]
    solver = {"dt": 1e-4, "integrator": integrator}
    content = scene([rod(layers, length=0.02, stations=9)], solver=solver, materials={"gel": gel(1e-3)})
    simulator = Simulator(load_scene(content))
    rng = np.random.default_rng(3)
    let_go(simulator, 0.2 * rng.standard_normal((simulator.model.node_count, 3)))
    before, energy = simulator.model.rods.node_mass @ simulator.velocities, simulator.energy()
    simulator.run(0.02)
    after = simulator.model.rods.node_mass @ simulator.velocities
    assert np.abs(after - before).max() < 1e-9 * np.linalg.norm(before)
    assert sum(simulator.energy().values()) < sum(energy.values())


@pytest.mark.parametrize("integrator", METHODS)
def test_at_rest_viscosity_changes_nothing(integrator):
    tips = []
    for time in (0.0, 0.02):
        simulator = Simulator(load_scene(bilayer(time=time, integrator=integrator, gravity=[0, 0, -1.0])), dt=1e-3)
        simulator.set_stimulus("h", 1.0)
        simulator.solve_static()
        tips.append(simulator.positions[-1])
        simulator.run(0.05)
        assert np.abs(simulator.positions[-1] - tips[-1]).max() < 1e-8
    assert np.abs(tips[0] - tips[1]).max() < 1e-9


def test_a_saved_state_goes_on_with_the_same_rates_of_strain():
    content = bilayer(integrator="generalised_alpha")
    first = swollen(content, 1e-3, 0.02)
    second = Simulator(load_scene(content), dt=1e-3)
    second.load_state(first.save_state())
    for simulator in (first, second):
        simulator.run(0.1)
    assert np.array_equal(first.positions, second.positions)


def test_without_a_retardation_time_nothing_is_computed_or_stored():
    simulator = Simulator(load_scene(bilayer(time=0.0)))
    assert "viscosity" not in simulator.model.forces
    assert simulator.plan.terms["viscosity"] == "skipped: no retardation_time of a material is above zero"
    assert simulator._state.strain_rate.size == 0


def test_layers_of_different_retardation_times_are_two_rods():
    config = load_scene(bilayer(times=(0.0, 0.01)) | {"solver": {}})
    plan = make_plan(config)
    assert plan.model == "two_rod" and "different retardation times" in plan.reasons["model"]
    with pytest.raises(SceneError, match=r"model: laminate .*rods\.rod have 0 s and 0\.01 s; allowed: two_rod"):
        make_plan(config, model="laminate")


def test_viscosity_takes_tr_bdf2_by_default_and_refuses_the_midpoint_rule():
    config = load_scene(bilayer() | {"solver": {}})
    assert make_plan(config).integrator == "tr_bdf2"
    with pytest.raises(SceneError, match="implicit_midpoint does not follow viscosity"):
        make_plan(config, integrator="implicit_midpoint")


def test_the_scene_with_every_force_has_viscosity():
    assert "viscosity" in Simulator(load_scene(everything())).model.forces


@pytest.mark.parametrize("value", [-1e-3, "fast", "3 m"])
def test_a_retardation_time_that_is_none_is_refused(value):
    content = scene([rod([layer()])], materials={"gel": GEL | {"retardation_time": value}})
    with pytest.raises(SceneError, match=r"materials\.gel\.retardation_time"):
        load_scene(content)
