"""The account that every step keeps of energy; impacts are cases of `bilayer validate`."""

import numpy as np
import pytest
from support.budgets import driven
from support.moving_scenes import part, with_parts
from support.sample_scenes import GEL, GROUND, contact, everything, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.engine.energy_account import (
    ENERGY,
    FREE,
    LARGEST,
    LARGEST_DRIVEN_GAIN,
    LARGEST_GAIN,
    LARGEST_STEP_GAIN,
    LOWEST,
    NUMERICAL,
    POWER_SUPPLIED,
)
from bilayer_core.errors import SimulationError
from bilayer_core.verification.stress.parameters import Parameters
from bilayer_core.verification.stress.robots import scene_of
from bilayer_core.verification.validate.impacts import thrown
from bilayer_core.verification.validate.motion import let_go

METHODS = ["implicit_euler", "sdirk2", "tr_bdf2", "generalised_alpha", "implicit_midpoint"]


def falling_strip(speed=12.0, **solver):
    """A strip that falls flat onto the ground."""
    strip = rod([layer()], length=0.05, stations=11, start=(0, 0, 2e-3))
    solver = {"model": "laminate", "dimension": 2, **solver}
    simulator = Simulator(load_scene(scene([strip], solver=solver, obstacles=[GROUND], contact=contact(2e-4))))
    let_go(simulator, np.tile([0.0, 0.0, -speed], (simulator.model.node_count, 1)))
    return simulator


@pytest.mark.parametrize("dt", [1e-4, 1e-5])
@pytest.mark.parametrize("integrator", METHODS[:4])
def test_a_strip_that_falls_never_rebounds_with_more_than_it_had(integrator, dt):
    simulator = falling_strip(integrator=integrator, dt=dt)
    start = largest = sum(simulator.energy().values())
    while simulator.time < 1e-3:
        simulator.step()
        largest = max(largest, sum(simulator.energy().values()))
    assert largest < 1.001 * start


@pytest.mark.parametrize("integrator", ["sdirk2", "generalised_alpha"])
def test_numerical_energy_is_that_of_the_energy_budget(integrator):
    arm = rod([layer("bottom"), layer("top")], length=0.06, stations=11, clamp_start="wall")
    solver = {"integrator": integrator, "dt": 5e-4, "newton_tolerance": 1e-10}
    hanging = scene([arm], solver=solver, bodies=[fixed()], gravity=[0, 0, -9.81])
    simulator = Simulator(load_scene(hanging), budget=True)
    simulator.run(0.2)
    budget, summary = simulator.budget(), simulator.summary()
    assert summary["numerical_energy"] == pytest.approx(-budget["lost"]["numerical"], rel=2e-3)
    assert summary["largest_energy"] >= budget["stored"]["kinetic"] + budget["stored"]["bending"]


@pytest.mark.parametrize(("model", "integrator"), [("two_rod", "sdirk2"), ("laminate", "tr_bdf2")])
def test_works_of_all_that_drives_and_damps_are_in_the_account(model, integrator):
    """Everything at once, of a ball that is pushed where it rests: account and budget take works in two ways."""
    content = everything()
    content["contact"].pop("restitution")  # whose power the budget takes at the ends of steps alone
    content["stimuli"]["humidity"]["schedule"] = {"type": "ramp", "start": 0, "end": 0.02, "from": 0, "to": 0.1}
    content["start"] = "settle"  # or barriers throw the ball within a step: then neither way of taking works is right
    simulator = Simulator(load_scene(content), dt=5e-5, integrator=integrator, model=model, budget=True)
    speeds = {name: part(simulator, name).copy() for name in ("body_velocity", "body_angular_velocity")}
    speeds["body_velocity"][1], speeds["body_angular_velocity"][1] = (0.3, -0.2, 0.0), (5.0, 3.0, 8.0)
    with_parts(simulator, **speeds)
    before = simulator.energy_account[NUMERICAL]
    simulator.run(0.02)
    budget, found = simulator.budget(), simulator.energy_account[NUMERICAL] - before
    works = sum(abs(work) for rows in ("supplied", "lost") for work in budget[rows].values())
    assert min(budget["lost"][name] for name in ("friction", "viscosity")) > 0.03 * works
    assert abs(found + budget["lost"]["numerical"]) < 1e-3 * works


@pytest.mark.parametrize(
    ("model", "dimension", "gravity", "joined"),
    [
        ("laminate", 2, -9.81, True),
        ("laminate", 3, 0.0, True),
        ("laminate", 3, -9.81, False),
        ("two_rod", 3, 0.0, False),
    ],
)
def test_a_prescribed_body_that_shifts_and_turns_supplies_its_work(model, dimension, gravity, joined):
    motion = {"times": [0, 0.02, 0.04], "displacements": [[0, 0, 0], [0, 0, 0.01], [0.01, 0, 0.01]]}
    hub = fixed("hub", (-0.02, 0, 0)) | {
        "motion": {"type": "prescribed", **motion, "rotations": [[0, 0, 0], [0, 0.5, 0], [0, 1.0, 0]]}
    }
    layers = [layer("bottom", 0.5e-3), layer("top", 0.5e-3)]
    arm = rod(layers, length=0.05, stations=11, name="arm", clamp_start="end" if joined else "hub")
    soft = {"gel": {"youngs_modulus": 1e6, "poisson_ratio": 0.5, "density": 1000.0}}
    end = {"name": "end", "position": [0, 0, 0], "motion": {"type": "free"}}
    weld = {"name": "weld", "type": "weld", "bodies": ["end", "hub"], "point": [0, 0, 0]}
    content = scene([arm], bodies=[hub, end] if joined else [hub], materials=soft, gravity=[0, 0, gravity])
    content["joints"] = [weld] if joined else []
    steps = {"integrator": "tr_bdf2", "dt": 1e-4}
    simulator = Simulator(load_scene(content), model=model, dimension=dimension, budget=True, **steps)
    simulator.run(0.05)
    budget, account = simulator.budget(), simulator.energy_account
    supplied = budget["supplied"]["prescribed motion"]
    assert abs(supplied) > 1e-5
    assert abs(account[NUMERICAL]) < 0.02 * account[LARGEST]
    if not joined:  # a weld's force at the ends of steps alone is not that of their stages
        assert -account[NUMERICAL] == pytest.approx(budget["lost"]["numerical"], abs=0.005 * abs(supplied))


def test_what_a_stimulus_supplies_is_in_the_account():
    simulator = Simulator(load_scene(driven(gain=0.1)), dt=2.5e-4, integrator="tr_bdf2", budget=True)
    simulator.run(0.05)
    budget, account = simulator.budget(), simulator.energy_account
    assert abs(budget["supplied"]["stimulus"]) > 1e-6
    assert -account[NUMERICAL] == pytest.approx(
        budget["lost"]["numerical"], abs=0.01 * abs(budget["supplied"]["stimulus"])
    )


@pytest.mark.parametrize("dimension", [2, 3])
def test_what_viscosity_takes_is_in_the_account(dimension):
    arm = rod([layer("bottom"), layer("top")], length=0.06, stations=11, clamp_start="wall")
    soft = {"gel": {**GEL, "youngs_modulus": 5e5, "retardation_time": 0.02}}
    hanging = scene([arm], bodies=[fixed()], gravity=[0, 0, -9.81], materials=soft)
    simulator = Simulator(load_scene(hanging), dimension=dimension, dt=2.5e-4, integrator="tr_bdf2", budget=True)
    simulator.run(0.1)
    budget, account = simulator.budget(), simulator.energy_account
    taken = budget["lost"]["viscosity"]
    assert taken > 0.05 * account[LARGEST]
    assert -account[NUMERICAL] == pytest.approx(budget["lost"]["numerical"], abs=0.02 * taken)


@pytest.mark.parametrize("frame", ["world", "material"])
def test_what_a_load_supplies_is_in_the_account(frame):
    arm = rod([layer("bottom"), layer("top")], length=0.06, stations=11, name="arm", clamp_start="wall")
    pull = {"name": "pull", "rod": "arm", "position": 0.06, "force": [0, 0, 5e-3], "frame": frame}
    soft = {"gel": {**GEL, "youngs_modulus": 5e5}}
    content = scene([arm], bodies=[fixed()], materials=soft, loads=[pull])
    simulator = Simulator(load_scene(content), dt=2.5e-4, integrator="tr_bdf2", budget=True)
    simulator.run(0.05)
    budget, account = simulator.budget(), simulator.energy_account
    supplied = sum(budget["supplied"].values())
    assert supplied > 0.1 * account[LARGEST] > 0.0
    assert -account[NUMERICAL] == pytest.approx(budget["lost"]["numerical"], abs=0.02 * supplied)


def rises(simulator, end):
    """The most that T + V less supplied work rises over its lowest value, of the largest energy of the run."""
    lowest, most = float(simulator.energy_account[FREE]), 0.0
    while simulator.time < end:
        simulator.step(until=end)
        lowest = min(lowest, float(simulator.energy_account[FREE]))
        most = max(most, float(simulator.energy_account[FREE]) - lowest)
    return most / float(simulator.energy_account[LARGEST])


@pytest.mark.parametrize("integrator", ["generalised_alpha", "tr_bdf2"])
def test_a_slow_stimulus_does_not_excuse_steps_that_make_energy(integrator):
    """A slender strip that uncurls by three turns, much too fast for its steps, while a stimulus creeps."""
    high = {"material": "stiff", "interval": [0, 0.011]}
    layers = [layer("low", 5e-6, eigenstrain={"stimulus": "heat", "gain": -0.07}), layer("high", 7.5e-6, **high)]
    for one in layers:
        one["natural_curvature"] = -350.0
    strip = rod(layers, length=0.05, stations=42, width=0.005, clamp_start="wall")
    materials = {"gel": {**GEL, "youngs_modulus": 1e7}, "stiff": {**GEL, "youngs_modulus": 7e10}}
    ramp = {"type": "ramp", "start": 0, "end": 0.7, "from": 0, "to": 1}
    content = scene([strip], bodies=[fixed()], materials=materials, stimuli={"heat": {"schedule": ramp}})
    simulator = Simulator(load_scene(content), dt=8.4e-4, integrator=integrator)
    assert rises(simulator, 0.2) < 0.1
    assert simulator.statistics.gaining > 0


@pytest.mark.parametrize("seed", [1, 2])
def test_noise_on_a_stimulus_does_not_excuse_steps_that_make_energy(seed):
    """A strip of two rods rings, too fast for its steps, while the quadrature of its stimulus errs to and fro."""
    layers = [layer("low", 1.6e-3, eigenstrain={"stimulus": "heat", "gain": -0.04}), layer("high", 1.05e-3)]
    for one in layers:
        one["natural_curvature"] = -32.0
    strip = rod(layers, length=0.112, stations=21, width=0.0112, clamp_start="wall")
    values = np.random.default_rng(seed).normal(0.5, 0.05, 400).tolist()
    noise = {"type": "table", "times": np.linspace(0.0, 0.712, 400).tolist(), "values": values}
    soft = {"gel": {**GEL, "youngs_modulus": 2.8e7}}
    content = scene([strip], bodies=[fixed()], materials=soft, stimuli={"heat": {"schedule": noise}})
    solver = {"integrator": "implicit_midpoint", "dt": 2.18e-4, "model": "two_rod", "dimension": 2}
    simulator = Simulator(load_scene(content), **solver)
    assert rises(simulator, 0.285) < 3 * LARGEST_DRIVEN_GAIN  # twice what is allowed, and what was forgotten
    assert simulator.statistics.gaining > 0


BAT = {"robot": "bat", "length": 1.54e-3, "slenderness": 9e3, "stations": 6, "youngs_modulus": 2.5e6, "barrier": 3.5e-5}
BAT |= {"contact_stiffness": 5e11, "threshold": 1.2e-5, "eigenstrain": 0.0, "damped": False, "dimension": 2}


@pytest.mark.parametrize("gravity", [0.0, 0.3])
@pytest.mark.parametrize("model", ["two_rod", "laminate"])
@pytest.mark.parametrize(("speed", "dt"), [(12.3, 1e-5), (12.3, 3e-5), (12.3, 9e-5), (3.0, 3e-5)])
def test_no_step_that_a_body_drives_makes_energy_however_short(speed, dt, model, gravity):
    """A ball hits a film whose barrier is much too stiff for the steps of the midpoint rule, which ends within it."""
    parameters = Parameters(**BAT, speed=speed, dt=dt, model=model, gravity=gravity, integrator="implicit_midpoint")
    simulator = Simulator(load_scene(scene_of(parameters)))
    seen = []

    def look(time):
        account = simulator.energy_account
        seen.append([time, *account[[FREE, ENERGY, POWER_SUPPLIED, LARGEST]]])

    look(0.0)
    try:
        simulator.run(40 * dt, each_step=look)
    except SimulationError as stop:
        assert stop.remedy.changes
    assert len(seen) > 3
    time, free, energy, power, largest = np.array(seen).T
    gain = np.diff(free)
    supplied = np.diff(energy) - gain
    by_trapezoids = 0.5 * np.diff(time) * (power[1:] + power[:-1])
    assert (gain - np.abs(supplied - by_trapezoids) <= LARGEST_STEP_GAIN * largest[1:]).all()


@pytest.mark.parametrize("start", [1.0e-2, 1.0001e-2, 1.02e-2, 1.05e-2, 1.0999e-2])
def test_a_fixed_step_ends_where_a_stimulus_jumps(start):
    """Work is that of the jump, wherever it lies between ends of steps, so that nothing is made of nothing."""
    content = driven()
    square = {"type": "square", "low": 0, "high": 1, "period": 1.37e-2, "start": start}
    content["stimuli"]["heat"]["schedule"] = square
    simulator = Simulator(load_scene(content), dt=1e-3, integrator="implicit_midpoint")
    assert rises(simulator, 0.05) < 6 * LARGEST_GAIN  # as much from each of six jumps to the next
    assert simulator.statistics.steps == 50


def test_a_run_that_is_continued_from_a_saved_state_has_the_same_account():
    content = thrown(1e9, 2)
    whole = Simulator(load_scene(content), tolerance=1e-4)
    whole.run(1.05e-3)
    saved = whole.save_state()
    rest = Simulator(load_scene(content), tolerance=1e-4)
    rest.load_state(saved)
    for simulator in (whole, rest):
        simulator.run(5e-4)
    assert np.array_equal(whole.save_state(), rest.save_state(), equal_nan=True)


def test_velocities_that_are_changed_begin_a_new_account():
    simulator = falling_strip(speed=0.0, integrator="sdirk2", dt=1e-4)
    simulator.run(1e-3)
    let_go(simulator, np.tile([0.0, 0.0, 1.0], (simulator.model.node_count, 1)))
    account = simulator.energy_account
    assert account[ENERGY] == pytest.approx(0.5 * simulator.model.rods.node_mass.sum(), rel=1e-9)
    assert account[FREE] == account[LOWEST] == 0.0 < account[LARGEST]
    simulator.run(1e-3)
    assert simulator.statistics.gaining == 0


def test_the_summary_says_what_steps_lost_and_warns_where_that_is_much():
    arm = rod([layer("bottom"), layer("top")], length=0.06, stations=11, clamp_start="wall")
    soft = {"gel": {**GEL, "youngs_modulus": 5e5}}
    hanging = scene([arm], bodies=[fixed()], gravity=[0, 0, -9.81], materials=soft)
    fine, coarse = (Simulator(load_scene(hanging), dt=5e-3, integrator=name) for name in ("sdirk2", "implicit_euler"))
    for simulator in (fine, coarse):
        simulator.run(0.3)
    assert not fine.summary()["warnings"]
    (warning,) = coarse.summary()["warnings"]
    assert warning.startswith("numerical energy -") and "(at most 10 %)" in warning
    assert coarse.summary()["numerical_energy"] < -0.1 * coarse.summary()["largest_energy"]


def test_contact_at_rest_has_no_error_of_its_own():
    """Steps of a strip that lies on the ground, where it has bounced for half a second, grow to their longest."""
    strip = rod([layer()], length=0.05, stations=11, start=(0, 0, 1.49e-3))
    content = scene([strip], obstacles=[GROUND], contact=contact(), gravity=[0, 0, -9.81], solver={"dimension": 2})
    simulator = Simulator(load_scene(content), tolerance=1e-4, integrator="sdirk2")
    simulator.run(1.0)
    before = simulator.statistics.steps
    simulator.run(1.0)
    assert simulator.statistics.steps - before <= 1.0 / simulator.steps.longest + 21
