"""Force and moment that clamps bear in motion; those at rest are cases of `bilayer validate`."""

import numpy as np
import pytest
from support.sample_scenes import GEL, everything, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.verification.validate.reactions import cantilever, load_of_nodes

MODELS = ["laminate", "two_rod"]


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("model", MODELS)
def test_the_clamp_of_a_moving_cantilever_bears_its_weight_less_its_inertia(model, dimension):
    simulator, h = cantilever(model, dimension, integrator="implicit_euler", dt=1e-4), 1e-4
    simulator.run(0.02)
    before = simulator.velocities
    simulator.step()
    found, expected = (
        simulator.clamps["arm.start"].wrench,
        load_of_nodes(simulator, (simulator.velocities - before) / h),
    )
    assert found[:3] == pytest.approx(expected[:3], abs=1e-9 * np.linalg.norm(expected[:3]))
    assert found[3:] == pytest.approx(expected[3:], abs=1e-9 * np.linalg.norm(expected[3:]))
    body, clamp = simulator.bodies["wall"], simulator.clamps["arm.start"]
    expected[3:] += np.cross(clamp.position - body.position, expected[:3])
    assert body.clamp_wrench == pytest.approx(expected, abs=1e-9 * np.linalg.norm(expected))


@pytest.mark.parametrize("dt", [2e-4, 1e-4])
@pytest.mark.parametrize("integrator", ["sdirk2", "tr_bdf2", "generalised_alpha"])
def test_a_clamp_bears_the_same_by_every_integrator_to_second_order(integrator, dt):
    def wrench(integrator, dt):
        simulator = cantilever("laminate", 2, retardation_time=2e-3, integrator=integrator, dt=dt)
        simulator.run(0.03)
        return simulator.clamps["arm.start"].wrench

    exact = wrench("sdirk2", 1e-5)
    allowed = 4e-3 * (dt / 2e-4) ** 2
    assert wrench(integrator, dt) == pytest.approx(exact, abs=allowed * np.linalg.norm(exact))


@pytest.mark.parametrize("model", MODELS)
def test_a_free_body_is_accelerated_by_the_wrench_of_its_rods(model):
    layers = [layer("bottom"), layer("top", eigenstrain={"stimulus": "humidity", "gain": 0.05})]
    strip = rod(layers, length=0.05, stations=11, start=(0.01, 0, 0.1), clamp_start="hub", name="arm")
    strip["path"]["direction"] = [1, 0.2, 0]
    inertia = np.array([1e-7, 2e-7, 2.5e-7])
    hub = {
        "name": "hub",
        "position": [0, 0, 0.1],
        "motion": {"type": "free", "mass": 1e-3, "inertia": inertia.tolist()},
    }
    humidity = {"humidity": {"schedule": {"type": "hold", "value": 1.0}}}
    content = scene([strip], bodies=[hub], stimuli=humidity)
    simulator, h = Simulator(load_scene(content), model=model, integrator="implicit_euler", dt=1e-4), 1e-4
    simulator.run(0.005)
    before = simulator.frame()
    simulator.step()
    after = simulator.frame()
    gain = 1e-3 * (after.body_velocities[0] - before.body_velocities[0]) / h
    assert np.linalg.norm(gain) > 1e-4
    assert simulator.bodies["hub"].clamp_wrench[:3] == pytest.approx(gain, abs=1e-9 * np.linalg.norm(gain))


def test_clamps_bear_all_that_acts_and_say_so_in_frames():
    simulator = Simulator(load_scene(everything()), dt=1e-3, integrator="sdirk2", model="two_rod")
    simulator.run(0.01)
    frame, hub = simulator.frame(), simulator.bodies["hub"]
    np.testing.assert_array_equal(frame.clamp_wrenches[0], hub.clamp_wrench)
    np.testing.assert_array_equal(frame.contact_wrenches[0], hub.contact_wrench)
    assert set(simulator.clamps) == {"arm_0.start", "arm_1.start"}
    assert simulator.clamps["arm_1.start"].body == "hub"
    total = sum(clamp.wrench[:3] for clamp in simulator.clamps.values())
    assert hub.clamp_wrench[:3] == pytest.approx(total, rel=1e-12)
    assert not frame.clamp_wrenches[1].any()  # the ball holds nothing


def test_looking_at_reactions_changes_no_step():
    watched, alone = (Simulator(load_scene(everything()), model="two_rod") for _ in range(2))
    for _ in range(20):
        watched.step()
        alone.step()
        assert np.isfinite(watched.bodies["hub"].clamp_wrench).all()
    np.testing.assert_array_equal(watched.save_state(), alone.save_state())


@pytest.mark.parametrize("thicknesses", [(1e-3, 1e-3), (2e-3, 0.5e-3)])
@pytest.mark.parametrize("model", ["laminate", "two_rod"])
def test_a_clamp_tells_its_moment_about_the_path_in_either_model(model, thicknesses):
    """Between two walls the upper layer alone is strained: E w h₂ η pushes at h₂/2 over the path, the interface."""
    swelling = {"stimulus": "heat", "gain": 1e-4}
    layers = [layer("lower", thicknesses[0]), layer("upper", thicknesses[1], eigenstrain=swelling)]
    arm = rod(layers, length=0.05, name="arm", clamp_start="left", clamp_end="right", stations=21)
    walls = [fixed("left"), fixed("right", (0.05, 0, 0))]
    heat = {"heat": {"schedule": {"type": "hold", "value": 1.0}}}
    simulator = Simulator(load_scene(scene([arm], bodies=walls, stimuli=heat)), model=model)
    simulator.solve_static()
    clamp, force = simulator.clamps["arm.start"], GEL["youngs_modulus"] * arm["width"] * thicknesses[1] * 1e-4
    assert clamp.position == pytest.approx([0, 0, 0], abs=1e-12)
    assert np.abs(clamp.wrench[[0, 4]]) == pytest.approx([force, 0.5 * thicknesses[1] * force], rel=1e-6)
