"""Motions with a known answer: sliding, rolling, free fall, impact, damping, and the order of the integrator."""

import math

import numpy as np
import pytest
from sample_scenes import ball, contact, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene


def slope(angle):
    """A plane through the origin, tilted about y so that +x is downhill."""
    normal = [math.sin(angle), 0.0, math.cos(angle)]
    return {"name": "slope", "type": "plane", "point": [0, 0, 0], "normal": normal}


def tilted_gravity(angle, g=9.81):
    """Gravity on level ground that acts like a slope: rods lie along x on z = 0."""
    return [g * math.sin(angle), 0.0, -g * math.cos(angle)]


def block(angle, coefficient, dt=1e-3, speed_threshold=1e-4):
    strip = rod([layer(thickness=2e-3)], length=0.02, stations=5, start=(0, 0, 1.99e-3))
    return scene(
        [strip],
        gravity=tilted_gravity(angle),
        obstacles=[slope(0.0)],
        contact=contact(coefficient=coefficient, speed_threshold=speed_threshold),
        solver={"dt": dt},
    )


def test_a_block_slides_down_a_steep_slope_as_coulomb_says():
    angle, mu = 0.5, 0.3
    simulator = Simulator(load_scene(block(angle, mu)))
    simulator.run(0.1)
    start = simulator.velocities[:, 0].mean()
    simulator.run(0.2)
    acceleration = (simulator.velocities[:, 0].mean() - start) / 0.2
    assert acceleration == pytest.approx(9.81 * (math.sin(angle) - mu * math.cos(angle)), rel=0.005)


def test_a_block_on_a_gentle_slope_creeps_at_the_smoothed_laws_speed():
    angle, mu, threshold = 0.2, 0.5, 1e-3
    simulator = Simulator(load_scene(block(angle, mu, speed_threshold=threshold)))
    simulator.run(0.5)
    expected = threshold * (1.0 - math.sqrt(1.0 - math.tan(angle) / mu))
    assert simulator.velocities[:, 0] == pytest.approx(np.full(5, expected), rel=0.01)


@pytest.mark.parametrize(("shell", "factor"), [(False, 5 / 7), (True, 3 / 5)])
def test_a_ball_rolls_down_a_slope_without_slipping(shell, factor):
    angle = 0.3
    far_away = rod([layer()], length=0.02, stations=3, start=(0, 5, 5), clamp_start="wall")
    simulator = Simulator(
        load_scene(
            scene(
                [far_away],
                gravity=tilted_gravity(angle),
                obstacles=[slope(0.0)],
                bodies=[fixed(position=(0, 5, 5)), ball((0, 0, 0.0208), shell=shell)],
                contact=contact(coefficient=0.6, speed_threshold=1e-4),
            )
        )
    )
    simulator.run(0.1)
    before = simulator.frame()
    simulator.run(0.2)
    after = simulator.frame()
    acceleration = (after.body_velocities[1, 0] - before.body_velocities[1, 0]) / 0.2
    assert acceleration == pytest.approx(factor * 9.81 * math.sin(angle), rel=0.01)
    assert after.body_angular_velocities[1, 1] * 0.02 == pytest.approx(after.body_velocities[1, 0], rel=0.01)


def test_no_node_crosses_the_ground_however_fast_it_falls():
    strip = rod([layer()], length=0.05, stations=11, start=(0, 0, 0.3))
    simulator = Simulator(load_scene(scene([strip], gravity=[0, 0, -2e4], obstacles=[slope(0.0)], contact=contact())))
    lowest = math.inf
    for _ in range(60):
        simulator.step()  # at impact a node would travel 100 mm in a step
        lowest = min(lowest, simulator.positions[:, 2].min() - 0.5e-3)
    assert 0.0 < lowest < 1e-3
    assert simulator.statistics.min_gap > 0.0


def test_mass_damping_slows_a_free_strip_exponentially():
    strip = rod([layer()], length=0.05, stations=5)
    errors = []
    for dt in (2e-3, 1e-3):
        simulator = Simulator(load_scene(scene([strip], damping={"mass": 3.0}, gravity=[0, 0, -10.0])), dt=dt)
        simulator.run(0.4)
        expected = -10.0 / 3.0 * (1.0 - math.exp(-3.0 * 0.4))
        errors.append(abs(simulator.velocities[:, 2].mean() - expected))
    assert errors[1] < 2e-3 * abs(expected)
    assert math.log2(errors[0] / errors[1]) == pytest.approx(1.0, abs=0.1)


def test_implicit_euler_is_of_first_order_in_time_for_a_swinging_bilayer():
    layers = [
        layer("bottom"),
        layer("top", eigenstrain={"stimulus": "heat", "gain": 0.02, "time_constant": 0.02}),
    ]
    swinging = scene(
        [rod(layers, length=0.06, stations=11, clamp_start="wall")],
        bodies=[fixed()],
        materials={"gel": {"youngs_modulus": 1e6, "poisson_ratio": 0.5, "density": 1000.0}},
        stimuli={"heat": {"schedule": {"type": "ramp", "start": 0, "end": 0.05, "from": 0, "to": 1}}},
        solver={"tolerance": 1e-9},
    )
    tips = []
    for dt in (1e-3, 5e-4, 2.5e-4, 1.25e-4):
        simulator = Simulator(load_scene(swinging), dt=dt)
        simulator.run(0.1)
        tips.append(simulator.positions[10])
    differences = np.linalg.norm(np.diff(tips, axis=0), axis=1)
    order = math.log2(differences[1] / differences[2])
    assert order == pytest.approx(1.0, abs=0.15)


def test_a_lagging_layer_follows_its_stimulus_with_its_time_constant_whatever_the_step():
    lagging = [layer(eigenstrain={"stimulus": "heat", "gain": 0.01, "time_constant": 0.05})]
    for dt in (1e-3, 1e-2):
        simulator = Simulator(
            load_scene(
                scene(
                    [rod(lagging, length=0.02, stations=5)],
                    stimuli={"heat": {"schedule": {"type": "hold", "value": 0}}},
                    damping={"mass": 1e5},
                )
            ),
            dt=dt,
        )
        simulator.set_stimulus("heat", 1.0)
        simulator.run(0.05)
        strain = simulator.frame().strain
        assert strain == pytest.approx(np.full(5, 0.01 * (1 - math.exp(-1.0))), rel=2e-3)


WHOLE, HALVES = [layer(thickness=2e-3)], [layer("bottom"), layer("top")]


@pytest.mark.parametrize(
    ("layers", "gravity", "area", "coefficient"),
    [
        (WHOLE, [5.0, 0, 0], 0.01, 0.4),
        (WHOLE, [0, 5.0, 0], 2e-3, 1.2),
        (WHOLE, [0, 0, 5.0], 0.01, 1.2),
        (HALVES, [0, 0, 5.0], 0.01, 1.2),
    ],
    ids=["along", "sideways", "across the face", "across the face, two layers"],
)
def test_a_strip_sinks_at_its_terminal_velocity(layers, gravity, area, coefficient):
    sinking = scene(
        [rod(layers, length=0.05, stations=11)],
        gravity=gravity,
        fluid={"density": 800.0, "drag_along": 0.4, "drag_across": 1.2, "velocity": [0.2, 0.1, -0.3]},
    )
    simulator = Simulator(load_scene(sinking), dt=5e-3)
    simulator.run(10.0)
    speed = math.sqrt(5.0 * 1000.0 * 0.01 * 2e-3 / (0.5 * 800.0 * area * coefficient))
    expected = np.array([0.2, 0.1, -0.3]) + speed * np.array(gravity) / 5.0
    moving = np.array(gravity) > 0  # the flow takes the rest of the strip along, ever more slowly
    assert simulator.velocities[:, moving] == pytest.approx(expected[moving][0], rel=1e-3)


def test_a_fluid_at_rest_slows_a_strip_as_the_quadratic_law_says():
    strip = rod([layer()], length=0.05, stations=5)
    drifting = scene([strip], gravity=[0, 0, 0], fluid={"drag_along": 0.5, "drag_across": 1.0})
    simulator = Simulator(load_scene(drifting), dt=1e-5)
    state = simulator.save_state()
    sizes = [(name, int(np.prod(shape))) for name, shape in simulator.description.state_layout]
    start = sum(size for _, size in sizes[: [name for name, _ in sizes].index("velocity")])
    state[start : start + 15] = np.tile([0.0, 0.0, 2.0], 5)
    simulator.load_state(state)
    simulator.run(0.02)
    rate = 0.5 * 1000.0 * 0.01 * 1.0 / (1000.0 * 0.01 * 1e-3)  # ½ ρ_f w C/(ρ w h)
    assert simulator.velocities[:, 2] == pytest.approx(np.full(5, 2.0 / (1.0 + 2.0 * rate * 0.02)), rel=5e-3)


@pytest.mark.parametrize(
    ("gravity", "coefficient"),
    [([4.0, 0, -9.81], 0.1), ([-4.0, 0, -9.81], 0.3), ([0, 4.0, -9.81], 0.2), ([0, -4.0, -9.81], 0.2)],
    ids=["forward", "backward", "left", "right"],
)
def test_a_strip_slides_against_the_coefficient_of_its_direction(gravity, coefficient):
    friction = {**contact(coefficient=0.5)["friction"], "forward": 0.1, "backward": 0.3, "sideways": 0.2}
    strip = rod([layer(thickness=2e-3)], length=0.02, stations=5, start=(0, 0, 1.99e-3))
    sliding = scene([strip], gravity=gravity, obstacles=[slope(0.0)], contact={**contact(), "friction": friction})
    simulator = Simulator(load_scene(sliding))
    simulator.run(0.05)
    start = simulator.velocities.mean(axis=0)
    simulator.run(0.2)
    acceleration = (simulator.velocities.mean(axis=0) - start) / 0.2
    direction = np.sign(np.array(gravity)) * [1, 1, 0]
    assert acceleration == pytest.approx((4.0 - coefficient * 9.81) * direction, abs=0.02)


def test_a_strip_slides_obliquely_along_the_direction_of_greatest_dissipation():
    friction = {**contact(coefficient=0.5)["friction"], "forward": 0.1, "sideways": 0.4}
    strip = rod([layer(thickness=2e-3)], length=0.02, stations=5, start=(0, 0, 1.99e-3))
    pushed = scene(
        [strip], gravity=[1.5, 6.0, -9.81], obstacles=[slope(0.0)], contact={**contact(), "friction": friction}
    )
    simulator = Simulator(load_scene(pushed))
    simulator.run(0.3)
    v = simulator.velocities.mean(axis=0)
    # along x and y the law slows by μ_i² v_i/√(Σ μ² v²) g: integrate it by itself
    reference, dt = np.zeros(2), 1e-5
    for _ in range(30000):
        weighted = np.array([0.1, 0.4]) ** 2 * reference
        size = math.sqrt((np.array([0.1, 0.4]) ** 2) @ reference**2)
        reference += dt * (np.array([1.5, 6.0]) - 9.81 * weighted / max(size, 1e-6))
    assert v[:2] == pytest.approx(reference, rel=0.01)
