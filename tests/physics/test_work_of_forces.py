"""The work of every force by itself: against its energy, or against a closed form of what it takes or gives."""

import math
from functools import cache

import numpy as np
import pytest
from support.budgets import EXACT, clamped, driven, extrapolated, moving, run
from support.sample_scenes import GROUND, ball, contact, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.simulation.edge_space import PARTS
from bilayer_core.simulation.energy_budget import BARRIERS


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


def landing():
    """A strip that falls onto a held one."""
    lower = rod([layer()], length=0.03, stations=7, name="lower", clamp_start="left", clamp_end="right")
    upper = rod([layer()], length=0.02, stations=6, start=(0.004, 0, 2.1e-3), name="upper")
    return scene(
        [lower, upper],
        gravity=[0, 0, -9.81],
        bodies=[fixed("left"), fixed("right", (0.03, 0, 0))],
        contact={**contact(), "stiffness": 1e3},
        solver=EXACT,
    )


ARC = {"shape": "arc", "radius": 0.03, "angle": 1.5, "toward": "normal"}
CONSERVATIVE = {  # scene, duration, time step
    "stretching": (clamped((3.0, 0, -9.81)), 0.1, 1e-3),
    "bending": (clamped((0, 0, -9.81)), 0.05, 1e-3),
    "twisting": (clamped((0, -9.81, -3.0), **ARC), 0.06, 1e-3),
    "bond": (driven(), 0.15, 1e-3),
    "barrier": (bouncing(), 0.016, 2e-4),
    "rod barrier": (landing(), 0.014, 4e-4),
}


def quadrature_error(budget, force):
    """Work of a conservative force plus the change of its energy [J]."""
    error = budget["work"][force] + budget["stored"][force]
    return error - budget["supplied"]["stimulus"] if force == "stretching" else error


@cache
def budget_of(force, parts):
    """Of its scene, with a part of its time step."""
    description, duration, dt = CONSERVATIVE[force]
    return run(description, duration, dt / parts).budget()


@pytest.mark.parametrize("force", [force for force in CONSERVATIVE if force not in BARRIERS])
def test_the_work_of_a_conservative_force_is_the_loss_of_its_energy_to_fourth_order(force):
    errors = [abs(quadrature_error(budget_of(force, parts), force)) for parts in (2, 4)]
    assert errors[1] < 1e-4 * abs(budget_of(force, 4)["stored"][force])
    assert math.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.3)


@pytest.mark.parametrize("force", BARRIERS)
def test_the_work_of_a_barrier_is_the_loss_of_its_energy_however_long_the_steps(force):
    for parts in (1, 2):
        budget = budget_of(force, parts)
        assert abs(quadrature_error(budget, force)) < 1e-3 * abs(budget["stored"][force])


@pytest.mark.parametrize("force", CONSERVATIVE)
def test_a_gradient_wrong_by_a_percent_leaves_a_percent_of_the_energy(force, monkeypatch):
    description, duration, dt = CONSERVATIVE[force]
    simulator = Simulator(load_scene(description), dt=dt / 2, budget=True)
    evaluator = simulator._stepper.ledger._evaluator
    monkeypatch.setattr(evaluator, "forces", one_percent_more(evaluator, force))
    simulator.run(duration)
    right, wrong = budget_of(force, 2), simulator.budget()
    change = quadrature_error(wrong, force) - quadrature_error(right, force)
    assert change == pytest.approx(0.01 * right["work"][force], rel=1e-6)
    assert abs(change) > 1e-3 * abs(right["stored"][force])


def one_percent_more(evaluator, force):
    """`Evaluator.forces` with wrong first derivatives of one force."""
    right = evaluator.forces

    def wrong(at, forces):
        energies = right(at, forces)
        for part in PARTS if forces == (force,) else ():
            array = getattr(evaluator.sums, part)
            array *= 1.01
        return energies

    return wrong


def test_the_work_of_gravity_is_the_loss_of_its_energy_exactly():
    for description in (clamped((1.0, 0, -9.81)), bouncing()):
        budget = run(description, 0.01, 1e-3).budget()
        energy = abs(budget["stored"]["gravity"])
        assert energy > 1e-8
        assert abs(quadrature_error(budget, "gravity")) < 1e-10 * energy


# what is lost


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


def test_friction_takes_coulombs_work_and_all_of_a_sliding_strips_energy():
    simulator = run(sliding(), 0.12, 2e-4, (0.3, 0, 0))
    taken, mass = simulator.budget()["lost"]["friction"], simulator.model.rods.node_mass.sum()
    distance = simulator.positions[0, 0]
    assert np.abs(simulator.velocities).max() < 1e-6
    assert taken == pytest.approx(0.3 * mass * 9.81 * distance, rel=2e-3)
    assert taken == pytest.approx(0.5 * mass * 0.3**2, rel=5e-3)


def test_friction_between_rods_takes_weight_times_coefficient_times_distance():
    lower = rod([layer()], length=0.08, stations=17, name="lower", clamp_start="left", clamp_end="right")
    upper = rod([layer()], length=0.02, stations=6, start=(0.01, 0, 1.99845e-3), name="upper")
    pile = scene(
        [lower, upper],
        gravity=[0, 0, -9.81],
        bodies=[fixed("left"), fixed("right", (0.08, 0, 0))],
        contact=contact(coefficient=0.3),
    )
    simulator = run(pile, 0.3, 5e-4, np.repeat([[0, 0, 0], [0.2, 0, 0]], [17, 6], axis=0))
    # friction below its mass centre makes it rock as it stops, until 0.3 s
    distance = simulator.positions[17:, 0].mean() - 0.02
    weight = 9.81 * 1000.0 * 0.01 * 1e-3 * 0.02
    assert np.abs(simulator.velocities[17:, 0]).max() < 1e-5
    assert simulator.budget()["lost"]["rod friction"] == pytest.approx(0.3 * weight * distance, rel=3e-3)


def test_a_spinning_ball_loses_five_sevenths_of_its_energy_before_it_rolls():
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


@pytest.mark.verify
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


def test_a_curved_strip_feels_the_same_drag_from_whichever_end_its_path_begins():
    def momentum(start, direction, normal):
        path = {"shape": "arc", "start": start, "direction": direction, "radius": 0.05, "angle": "90 deg"}
        strip = rod([layer()], stations=7) | {"path": path, "normal": normal}
        fluid = {"drag_along": 0.3, "drag_across": 1.2, "velocity": [0.1, -0.2, 0.05]}
        simulator = Simulator(load_scene(scene([strip], fluid=fluid)), dt=1e-4)
        simulator.run(1e-3)
        return simulator.model.rods.node_mass @ simulator.velocities

    one = momentum([0, 0, 0], [1, 0, 0], [0, 0, 1])
    other = momentum([0.05, 0, 0.05], [0, 0, -1], [-1, 0, 0])
    assert np.abs(one).min() > 0.0
    assert other == pytest.approx(one, rel=1e-6)
