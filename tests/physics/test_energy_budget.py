"""Where the energy of a run goes: the work of every force by itself, and the budget of whole scenes."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sample_scenes import GROUND, ball, contact, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import InputError, SimulationError
from bilayer_core.integrate.motion import PARTS
from bilayer_core.solve.newton import NewtonStatus
from bilayer_core.solve.terms import contact as contact_terms
from bilayer_core.solve.terms import elastic

SOFT = {"gel": {"youngs_modulus": 1e6, "poisson_ratio": 0.5, "density": 1000.0}}
EXACT = {"tolerance": 1e-10}


def run(description, duration, dt, velocity=None):
    """A simulator with its budget kept, after `duration` [s]; `velocity` of nodes at the start [m/s]."""
    simulator = Simulator(load_scene(description), dt=dt, budget=True)
    if velocity is not None:
        throw(simulator, np.broadcast_to(velocity, (simulator.model.node_count, 3)))
    simulator.run(duration)
    return simulator


def throw(simulator, velocity):
    """Give all nodes velocities [m/s], shape (n_node, 3); the budget starts anew."""
    state = simulator.save_state()
    parts = simulator.description.state_layout
    sizes = [int(np.prod(shape)) for _, shape in parts]
    start = sum(sizes[: [name for name, _ in parts].index("velocity")])
    state[start : start + velocity.size] = np.asarray(velocity).ravel()
    simulator.load_state(state)


def driven(stations=9, gain=0.02, **more):
    """A clamped bilayer whose upper layer grows smoothly."""
    layers = [layer("lower"), layer("upper", eigenstrain={"stimulus": "heat", "gain": gain})]
    wave = {"type": "sine", "mean": 0.5, "amplitude": 0.5, "period": 0.4, "phase": -math.pi / 2}
    more = {"bodies": [fixed()], "materials": SOFT, "solver": EXACT, **more}
    strip = rod(layers, length=0.04, stations=stations, clamp_start="wall")
    return scene([strip], stimuli={"heat": {"schedule": wave}}, **more)


def clamped(gravity, **path):
    """A soft strip, clamped at one end."""
    strip = rod([layer(thickness=2e-3)], length=0.05, stations=9, clamp_start="wall")
    if path:
        strip["path"] = {"start": [0, 0, 0], "direction": [1, 0, 0], **path}
    return scene([strip], gravity=list(gravity), bodies=[fixed()], materials=SOFT, solver=EXACT)


def bouncing():
    """A ball that falls onto a soft barrier."""
    away = rod([layer()], length=0.02, stations=3, start=(0, 5, 5), clamp_start="wall")
    return scene(
        [away],
        gravity=[0, 0, -9.81],
        obstacles=[GROUND],
        bodies=[fixed(position=(0, 5, 5)), ball((0, 0, 0.0212))],
        contact={**contact(), "stiffness": 1e4},
        solver=EXACT,
    )


ARC = {"shape": "arc", "radius": 0.03, "angle": 1.5, "toward": "normal"}
CONSERVATIVE = {  # scene, duration, time step
    "stretching": (clamped((3.0, 0, -9.81)), 0.1, 1e-3),
    "bending": (clamped((0, 0, -9.81)), 0.05, 1e-3),
    "twisting": (clamped((0, -9.81, -3.0), **ARC), 0.06, 1e-3),
    "bond": (driven(), 0.15, 1e-3),
    "barrier": (bouncing(), 0.016, 2e-4),
}
TERMS = {
    "stretching": [elastic.Stretching],
    "bending": [elastic.BendingAndTwisting, elastic._OneStrain],
    "twisting": [elastic.BendingAndTwisting, elastic._OneStrain],
    "bond": [elastic.Bond],
    "barrier": [contact_terms.Barrier],
}


def quadrature_error(simulator, force):
    """Work of a conservative force plus the change of its energy, and the latter [J]."""
    budget = simulator.budget()
    error = budget["work"][force] + budget["stored"][force]
    if force == "stretching":
        error -= budget["supplied"]["stimulus"]
    return error, budget["stored"][force]


@pytest.mark.parametrize("force", CONSERVATIVE)
def test_the_work_of_a_conservative_force_is_the_loss_of_its_energy_to_second_order(force):
    description, duration, dt = CONSERVATIVE[force]
    errors = []
    for step in (dt / 2, dt / 4):
        error, energy = quadrature_error(run(description, duration, step), force)
        errors.append(abs(error))
    assert errors[1] < 0.01 * abs(energy)
    assert math.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.2)


@pytest.mark.parametrize("force", CONSERVATIVE)
def test_a_gradient_wrong_by_a_percent_shows_as_a_percent_of_the_energy(force, monkeypatch):
    description, duration, dt = CONSERVATIVE[force]
    right, energy = quadrature_error(run(description, duration, dt / 4), force)
    for term in TERMS[force]:
        monkeypatch.setattr(term, "add", one_percent_more(term.add))
    wrong, energy = quadrature_error(run(description, duration, dt / 4), force)
    assert abs(wrong - right) == pytest.approx(0.01 * abs(energy), rel=0.1)


def one_percent_more(add):
    """The method of a term, with wrong first derivatives."""

    def wrong(term, at, with_hessian):
        before = [getattr(term.out, part).copy() for part in PARTS]
        add(term, at, with_hessian)
        for part, values in zip(PARTS, before, strict=True):
            array = getattr(term.out, part)
            array += 0.01 * (array - values)

    return wrong


def test_the_work_of_gravity_is_the_loss_of_its_energy_exactly():
    for description in (clamped((1.0, 0, -9.81)), bouncing()):
        error, energy = quadrature_error(run(description, 0.01, 1e-3), "gravity")
        assert abs(energy) > 1e-8
        assert abs(error) < 1e-10 * abs(energy)


# what is lost


def extrapolated(measure, dt):
    """Limit for small steps of a figure that has an error of first order."""
    return 2.0 * measure(dt / 2) - measure(dt)


def test_damping_takes_the_energy_that_decays_exponentially():
    strip = scene([rod([layer()], length=0.05, stations=5)], damping={"mass": 3.0}, solver=EXACT)
    taken = extrapolated(lambda dt: run(strip, 0.2, dt, (0, 0, 1.0)).budget()["lost"]["damping"], 1e-3)
    mass = 1000.0 * 0.01 * 1e-3 * 0.05
    assert taken == pytest.approx(0.5 * mass * (1.0 - math.exp(-2.0 * 3.0 * 0.2)), rel=1e-4)


def test_drag_takes_the_energy_of_a_plate_as_the_quadratic_law_says():
    drifting = scene([rod([layer()], length=0.05, stations=5)], fluid={"drag_along": 0.5, "drag_across": 1.0})
    taken = extrapolated(lambda dt: run(drifting, 2e-3, dt, (0, 0, 2.0)).budget()["lost"]["drag"], 2e-5)
    rate = 0.5 * 1000.0 * 0.01 * 1.0 / (1000.0 * 0.01 * 1e-3)  # ½ ρ_f w C/(ρ w h)
    mass, speed = 1000.0 * 0.01 * 1e-3 * 0.05, 2.0 / (1.0 + 2.0 * rate * 2e-3)
    assert taken == pytest.approx(0.5 * mass * (2.0**2 - speed**2), rel=1e-3)


def sliding(coefficient=0.3):
    """A strip on level ground, at the height where the barrier carries it."""
    strip = rod([layer(thickness=2e-3)], length=0.02, stations=5, start=(0, 0, 1.9974448e-3))
    return scene([strip], gravity=[0, 0, -9.81], obstacles=[GROUND], contact=contact(coefficient=coefficient))


def test_friction_takes_weight_times_coefficient_times_distance_and_all_of_a_sliding_strips_energy():
    simulator = run(sliding(), 0.15, 2e-4, (0.3, 0, 0))
    taken, mass = simulator.budget()["lost"]["friction"], simulator.model.node_mass.sum()
    distance = simulator.positions[0, 0]
    assert np.abs(simulator.velocities).max() < 1e-6
    assert taken == pytest.approx(0.3 * mass * 9.81 * distance, rel=2e-3)
    assert taken == pytest.approx(0.5 * mass * 0.3**2, rel=5e-3)


def test_a_spinning_ball_put_on_the_ground_loses_five_sevenths_of_its_energy_before_it_rolls():
    away = rod([layer()], length=0.02, stations=3, start=(0, 5, 5), clamp_start="wall")
    skidding = scene(
        [away],
        gravity=[0, 0, -10.0],
        obstacles=[GROUND],
        bodies=[fixed(position=(0, 5, 5)), ball((0, 0, 0.0209933), angular_velocity=[0, 50.0, 0])],
        contact=contact(coefficient=0.5),
    )
    taken = extrapolated(lambda dt: run(skidding, 0.1, dt).budget()["lost"]["friction"], 1e-3)
    assert taken == pytest.approx(5 / 7 * 0.5 * 0.4 * 2.7e-3 * 0.02**2 * 50.0**2, rel=2e-3)


@pytest.mark.parametrize("row", ["damping", "drag", "friction"])
def test_what_a_dissipative_force_takes_never_comes_back(row):
    description = driven(
        damping={"mass": 5.0},
        fluid={"density": 10.0, "drag_along": 0.3, "drag_across": 1.2},
        obstacles=[{**GROUND, "point": [0, 0, -2.4e-3]}],
        contact=contact(coefficient=0.5, speed_threshold=1e-3),
    )
    simulator = Simulator(load_scene(description), budget=True)
    taken = [0.0]
    for _ in range(300):
        simulator.step()
        taken.append(simulator.budget()["lost"][row])
    assert taken[-1] > 0.0
    assert np.diff(taken).min() >= 0.0


# what is supplied


def test_a_layer_that_cannot_grow_takes_up_the_work_of_its_stimulus():
    swelling = [layer(eigenstrain={"stimulus": "heat", "gain": 1e-4})]
    held = scene(
        [rod(swelling, stations=5, clamp_start="left", clamp_end="right")],
        bodies=[fixed("left"), fixed("right", (0.1, 0, 0))],
        stimuli={"heat": {"schedule": {"type": "ramp", "start": 0, "end": 0.05, "from": 0, "to": 1}}},
    )
    budget = run(held, 0.06, 1e-2).budget()
    assert budget["supplied"]["stimulus"] == pytest.approx(0.5 * 1e8 * 0.01 * 1e-3 * 1e-4**2 * 0.1, rel=1e-9)
    assert abs(budget["relative_residual"]) < 1e-9


def moving(name, position, displacement, duration):
    """A body on a prescribed path."""
    path = {"times": [0.0, duration], "displacements": [[0, 0, 0], list(displacement)]}
    return {"name": name, "position": list(position), "motion": {"type": "prescribed", **path}}


def test_pulling_a_strip_takes_the_work_that_it_stores():
    pulled = scene(
        [rod([layer()], stations=9, clamp_start="left", clamp_end="right")],
        bodies=[fixed("left"), moving("right", (0.1, 0, 0), (1e-4, 0, 0), 0.2)],
    )
    budget = run(pulled, 0.2, 1e-3).budget()
    assert budget["supplied"]["prescribed motion"] == pytest.approx(0.5 * 1e3 * 0.1 * 1e-3**2, rel=1e-4)
    assert abs(budget["relative_residual"]) < 1e-4


def test_lifting_a_strip_takes_its_weight_times_the_height():
    hanging = rod([layer()], length=0.05, stations=9, clamp_start="hub")
    hanging["path"]["direction"], hanging["normal"] = [0, 0, -1], [1, 0, 0]
    lifted = scene([hanging], gravity=[0, 0, -9.81], bodies=[moving("hub", (0, 0, 0), (0, 0, 0.02), 0.2)])
    work = extrapolated(lambda dt: run(lifted, 0.2, dt).budget()["supplied"]["prescribed motion"], 2e-3)
    assert work == pytest.approx(9.81 * 1000.0 * 0.01 * 1e-3 * 0.05 * 0.02, rel=1e-3)


def test_a_prescribed_ball_that_pushes_a_free_one_gives_it_its_energy():
    away = rod([layer()], length=0.02, stations=3, start=(0, 5, 5), clamp_start="wall")
    pusher = {**moving("pusher", (-0.0411, 0, 0), (0.05, 0, 0), 0.1), "surface": {"shape": "sphere", "radius": 0.02}}
    soft = {**contact(), "stiffness": 1e4}
    pushed = scene([away], bodies=[fixed(position=(0, 5, 5)), pusher, ball((0, 0, 0))], contact=soft)
    missing = []
    for dt in (1e-4, 5e-5):
        budget = run(pushed, 0.06, dt).budget()
        missing.append(budget["supplied"]["prescribed motion"] - budget["stored"]["kinetic"])
    assert budget["stored"]["kinetic"] > 1e-4
    assert abs(missing[1]) < 0.01 * budget["stored"]["kinetic"]
    assert math.log2(missing[0] / missing[1]) == pytest.approx(1.0, abs=0.2)


def test_loads_give_their_force_times_the_way_of_what_they_push():
    push = {"name": "push", "rod": "rod", "position": 0.05, "force": [0.0, 0.02, 0.0]}
    pushed = scene([rod([layer()], stations=5)], loads=[push])
    simulator = run(pushed, 0.05, 1e-3)
    way = simulator.positions[2, 1]
    assert simulator.budget()["supplied"]["loads"] == pytest.approx(0.02 * way, rel=1e-9)


# what the integrator loses


def test_what_implicit_euler_loses_is_what_its_velocities_say():
    """With a = Δv/h the accelerations of its steps: Σ ½ (aₙ + aₙ₊₁)·M Δx − ΔT, from velocities and masses alone."""
    simulator = Simulator(load_scene(clamped((0, 0, -9.81))), dt=1e-3, budget=True)
    mass = simulator.model.node_mass[1:, None]
    v, a = np.zeros((8, 3)), np.array([0, 0, -9.81])
    work = 0.0
    for _ in range(50):
        simulator.step()
        new = simulator.velocities[1:]
        work += 0.5 * np.sum(mass * (a + (new - v) / 1e-3) * new) * 1e-3
        a, v = (new - v) / 1e-3, new
    lost = simulator.budget()["lost"]["numerical"]
    assert lost == pytest.approx(work - 0.5 * np.sum(mass * v**2), rel=1e-5)
    assert lost > 0.01 * simulator.budget()["stored"]["kinetic"]


def test_the_spin_of_a_tumbling_body_costs_only_what_the_integrator_loses():
    away = rod([layer()], length=0.02, stations=3, start=(0, 5, 5), clamp_start="wall")
    motion = {"type": "free", "mass": 0.01, "inertia": [1e-6, 2e-6, 2.5e-6], "angular_velocity": [3.0, 20.0, 1.0]}
    tumbling = scene(
        [away], bodies=[fixed(position=(0, 5, 5)), {"name": "brick", "position": [0, 0, 0], "motion": motion}]
    )
    changes = []
    for dt in (1e-3, 5e-4):
        budget = run(tumbling, 0.3, dt).budget()
        assert budget["lost"]["numerical"] == pytest.approx(-budget["stored"]["kinetic"], rel=1e-9)
        changes.append(budget["stored"]["kinetic"])
    assert abs(changes[1]) < 0.05 * 0.5 * 2e-6 * 20.0**2
    assert math.log2(changes[0] / changes[1]) == pytest.approx(1.0, abs=0.1)


def test_a_strip_that_spins_freely_loses_angular_momentum_at_first_order():
    strip = scene([rod([layer()], length=0.1, stations=11, start=(-0.05, 0, 0))], solver=EXACT)
    lost = []
    for dt in (5e-4, 2.5e-4):
        simulator = Simulator(load_scene(strip), dt=dt)
        masses, radius = simulator.model.node_mass, simulator.positions[:, 0]
        throw(simulator, np.stack([0 * radius, 10.0 * radius, 0 * radius], axis=1))
        simulator.run(0.1)
        momentum = masses @ np.cross(simulator.positions, simulator.velocities)
        lost.append(1.0 - momentum[2] / (10.0 * masses @ radius**2))
    assert 0.0 < lost[1] < 0.01
    assert math.log2(lost[0] / lost[1]) == pytest.approx(1.0, abs=0.03)


# the whole


def flyer():
    """A free hub with two unlike arms: it turns while they bend."""
    active = layer("active", eigenstrain={"stimulus": "heat", "gain": 0.03})
    arm = rod([layer("passive"), active], length=0.03, stations=9, start=(0.004, 0, 0), name="arm", clamp_start="hub")
    wing = rod([layer()], length=0.02, stations=6, start=(0.004, 0, 0.01), name="wing", clamp_start="hub")
    motion = {"type": "free", "mass": 1e-3, "inertia": [1e-8, 2e-8, 3e-8]}
    wave = {"type": "sine", "mean": 0.5, "amplitude": 0.5, "period": 0.2, "phase": -math.pi / 2}
    return scene(
        [arm, wing],
        bodies=[{"name": "hub", "position": [0, 0, 0], "motion": motion}],
        materials=SOFT,
        stimuli={"heat": {"schedule": wave}},
        solver=EXACT,
    )


@pytest.mark.parametrize("description", [driven(gravity=[0, 0, -9.81]), flyer()], ids=["clamped", "flying"])
def test_the_budget_of_a_driven_bilayer_closes_at_second_order_and_its_numerical_loss_falls_at_first(description):
    budgets = [run(description, 0.15, dt).budget() for dt in (1e-3, 5e-4)]
    residual = [abs(budget["residual"]) for budget in budgets]
    numerical = [budget["lost"]["numerical"] for budget in budgets]
    assert abs(budgets[1]["relative_residual"]) < 1e-3
    assert residual[0] / residual[1] == pytest.approx(4.0, rel=0.15)
    assert min(numerical) > 0.0
    assert numerical[0] / numerical[1] == pytest.approx(2.0, rel=0.15)


@pytest.mark.slow
def test_the_first_cycle_of_the_inchworm_closes():
    lost = []
    for dt in (2e-3, 1e-3):
        simulator = Simulator(load_scene("crawling_inchworm"), dt=dt, budget=True)
        simulator.run(0.4)
        assert abs(simulator.budget()["relative_residual"]) < 1e-4
        simulator.load_state(simulator.save_state())  # it has come to lie on the barrier: a shock, whatever the step
        numerical = [0.0]
        for _ in range(5):
            simulator.run(0.4)
            numerical.append(simulator.budget()["lost"]["numerical"])
        budget = simulator.budget()
        assert abs(budget["relative_residual"]) < 1e-5
        paid = budget["supplied"]["stimulus"] - sum(budget["stored"].values())
        assert budget["lost"]["friction"] == pytest.approx(paid, rel=1e-3)
        # friction with the loads of a step's start takes too much while they fall and too little while they rise
        lost.append(np.abs(np.diff(numerical)).sum())
    assert lost[0] / lost[1] == pytest.approx(2.0, rel=0.1)


def test_the_inertia_of_a_flowing_fluid_takes_part_in_the_budget_of_a_strip_on_a_moving_clamp():
    fluid = {"drag_along": 0.3, "drag_across": 1.2, "added_mass": True, "velocity": [0.1, 0, 0.2]}
    towed = driven(fluid=fluid, bodies=[moving("wall", (0, 0, 0), (0, 3e-3, 0.01), 0.1)])
    budgets = [run(towed, 0.1, dt).budget() for dt in (5e-4, 2.5e-4)]
    lost = [budget["lost"]["numerical"] for budget in budgets]
    assert budgets[1]["stored"]["fluid"] > 10.0 * lost[1]
    assert abs(budgets[1]["relative_residual"]) < 1e-5
    assert math.log2(lost[0] / lost[1]) == pytest.approx(1.0, abs=0.1)


# the keeping of it


def test_keeping_the_budget_changes_nothing_and_a_loaded_state_starts_it_from_zero():
    kept, plain = Simulator(load_scene(driven()), budget=True), Simulator(load_scene(driven()))
    kept.run(0.02)
    plain.run(0.02)
    assert np.array_equal(kept.save_state(), plain.save_state(), equal_nan=True)
    assert kept.energy() == plain.energy()
    assert "budget" not in plain.summary()
    with pytest.raises(InputError, match="budget=True"):
        plain.budget()
    assert kept.summary()["budget"]["supplied"]["stimulus"] > 0.0
    kept.load_state(kept.save_state())
    assert kept.budget()["supplied"]["stimulus"] == kept.budget()["residual"] == 0.0


def test_parts_of_halved_steps_enter_the_budget():
    hasty = driven(gain=0.1, solver={"max_newton_iterations": 4, "max_halvings": 6})
    simulator = run(hasty, 0.1, 1e-2)
    assert simulator.statistics.rejected > 0
    assert abs(simulator.budget()["relative_residual"]) < 0.02


def test_accepted_parts_of_a_step_that_fails_leave_the_budget(monkeypatch):
    simulator = run(driven(solver={"max_halvings": 1}), 0.05, 1e-3)
    before, solver, attempts = simulator.budget(), simulator._stepper.solver, []
    minimise = solver.minimise

    def accepts_the_second(at, trial):
        attempts.append(None)
        report, end = minimise(at, trial)
        return report if len(attempts) == 2 else replace(report, status=NewtonStatus.MAX_ITERATIONS), end

    monkeypatch.setattr(solver, "minimise", accepts_the_second)
    with pytest.raises(SimulationError):
        simulator.step()
    assert len(attempts) == 3
    assert simulator.budget() == before
    monkeypatch.undo()
    simulator.step()
    assert simulator.budget()["supplied"]["stimulus"] > before["supplied"]["stimulus"]
    assert abs(simulator.budget()["relative_residual"]) < 1e-4
