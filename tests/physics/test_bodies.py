"""Bodies that hold rods: junctions, hubs, rails."""

import numpy as np
import pytest
from support.sample_scenes import GROUND, ball, contact, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene

SOFT = {"gel": {"youngs_modulus": 1e6, "poisson_ratio": 0.5, "density": 1000.0}}


def free(name, position, mass=1e-3, inertia=1e-8, **more):
    """A free body without a surface."""
    motion = {"type": "free", "mass": mass, "inertia": [inertia, inertia, inertia]}
    return {"name": name, "position": list(position), "motion": motion, **more}


@pytest.mark.parametrize("layers", [[layer(thickness=2e-3)], [layer("bottom"), layer("top")]])
def test_a_junction_in_the_middle_of_a_cantilever_changes_nothing(layers):
    settings = {"gravity": [0, 2.0, -9.81], "materials": SOFT, "solver": {"dt": 1.0, "newton_tolerance": 1e-11}}
    whole = Simulator(
        load_scene(scene([rod(layers, length=0.08, stations=81, clamp_start="wall")], bodies=[fixed()], **settings))
    )
    inner = rod(layers, length=0.04, stations=41, name="inner", clamp_start="wall", clamp_end="junction")
    outer = rod(layers, length=0.04, stations=41, start=(0.04, 0, 0), name="outer", clamp_start="junction")
    light = free("junction", (0.04, 0, 0), mass=1e-9, inertia=1e-14)
    joined = Simulator(load_scene(scene([inner, outer], bodies=[fixed(), light], **settings)))
    whole.run(60.0)
    joined.run(60.0)
    tip = whole.model.strands[0].node_count - 1
    outer_tip = joined.model.strands[len(layers)].first_node + 40
    deflection = np.linalg.norm(whole.positions[tip] - [0.08, 0, 0 if len(layers) == 1 else -0.5e-3])
    assert deflection > 0.02
    assert np.abs(whole.positions[tip] - joined.positions[outer_tip]).max() < 2e-4 * deflection


def test_a_flying_hub_and_its_arms_keep_their_momentum_while_they_bend():
    active = layer("active", eigenstrain={"stimulus": "heat", "gain": 0.03})
    arm = rod([layer("passive"), active], length=0.03, stations=11, start=(0.004, 0, 0), name="arm", clamp_start="hub")
    arm["pattern"] = {"count": 3}
    flyer = scene(
        [arm, rod([layer()], length=0.02, stations=6, start=(0.004, 0, 0.01), name="wing", clamp_start="hub")],
        bodies=[free("hub", (0, 0, 0))],
        stimuli={"heat": {"schedule": {"type": "ramp", "start": 0, "end": 0.02, "from": 0, "to": 1}}},
    )
    simulator = Simulator(load_scene(flyer))
    simulator.run(0.015)  # while the arms are driven
    frame = simulator.frame()
    rods = simulator.model.rods.node_mass @ simulator.velocities
    momentum = rods + 1e-3 * frame.body_velocities[0]
    exchanged = np.abs(simulator.model.rods.node_mass[:, None] * simulator.velocities).sum()
    assert frame.body_positions[0, 2] > 1e-5  # arms bend down, the hub rises
    assert np.linalg.norm(frame.body_angular_velocities[0]) > 1e-3  # the wing makes it turn
    assert np.abs(momentum).max() < 1e-9 * exchanged


def test_a_guided_body_slides_along_its_rail_only():
    axis = np.array([0.6, 0.0, -0.8])
    hub = {"name": "hub", "position": [0, 0, 0], "motion": {"type": "guided", "axis": list(axis), "mass": 1e-3}}
    arm = rod([layer()], length=0.02, stations=6, start=(0.003, 0, 0), clamp_start="hub")
    simulator = Simulator(load_scene(scene([arm], bodies=[hub], gravity=[0, 0, -10.0])))
    simulator.run(0.2)
    position = simulator.bodies["hub"].position
    along = position @ axis
    assert np.linalg.norm(position - along * axis) < 1e-12
    assert simulator.bodies["hub"].quaternion == pytest.approx([0, 0, 0, 1], abs=1e-14)
    assert along == pytest.approx(0.5 * 8.0 * 0.2**2, rel=0.01)


def test_two_balls_collide_without_crossing_and_keep_their_momentum():
    first = ball((-0.05, 0, 0), velocity=[1.0, 0.1, 0])
    second = ball((0.05, 0.01, 0), velocity=[-0.5, 0, 0], angular_velocity=[0, 0, 30.0])
    second["name"] = "other"
    away = rod([layer()], length=0.02, stations=3, start=(0, 0, 5), clamp_start="wall")
    simulator = Simulator(
        load_scene(
            scene(
                [away],
                bodies=[fixed(position=(0, 0, 5)), first, second],
                contact=contact(barrier_distance=1e-4, coefficient=0.3, speed_threshold=1e-3),
            )
        )
    )
    simulator.run(0.1)
    frame = simulator.frame()
    total = 2.7e-3 * frame.body_velocities[1:].sum(axis=0)
    assert total == pytest.approx(2.7e-3 * np.array([0.5, 0.1, 0]), rel=1e-9, abs=1e-12)
    between = frame.body_positions[2] - frame.body_positions[1]
    approach = (frame.body_velocities[1] - frame.body_velocities[2]) @ between / np.linalg.norm(between)
    assert approach < 0.01  # of 1.5 m/s before
    assert abs(frame.body_angular_velocities[1, 2]) > 0.1  # friction made the first one turn
    assert 0.0 < simulator.statistics.min_gap < 1e-4


def test_a_free_body_with_feet_stands_on_the_ground():
    feet = [{"position": [x, y, -0.01], "length": 5e-3, "offset": 0} for x in (-0.02, 0.02) for y in (-0.02, 0.02)]
    table = free("table", (0, 0, 0.0108), mass=0.01, inertia=1e-5, contact_points=feet)
    mast = rod([layer()], length=0.02, stations=6, start=(0, 0, 0.02), clamp_start="table")
    mast["path"]["direction"], mast["normal"] = [0, 0, 1], [1, 0, 0]
    simulator = Simulator(
        load_scene(
            scene(
                [mast],
                bodies=[table],
                gravity=[0, 0, -9.81],
                obstacles=[GROUND],
                contact=contact(coefficient=0.5),
                damping={"mass": 5.0},
            )
        )
    )
    simulator.run(0.5)
    weight = 9.81 * (0.01 + simulator.model.rods.node_mass.sum())
    assert simulator.contact_forces[-4:, 2] == pytest.approx(np.full(4, weight / 4), rel=1e-3)
    assert simulator.frame().contact_wrenches[0] == pytest.approx([0, 0, weight, 0, 0, 0], abs=1e-3 * weight)


def test_a_tumbling_body_does_not_cross_the_ground_with_its_feet_or_its_mast():
    feet = [{"position": [x, 0, -0.01], "length": 5e-3, "offset": 0} for x in (-0.03, 0.03)]
    table = free("table", (0, 0, 0.06), mass=0.01, inertia=1e-5, contact_points=feet)
    table["motion"] |= {"angular_velocity": [0, 300.0, 0], "velocity": [0, 0, -2.0]}
    mast = rod([layer()], length=0.02, stations=6, start=(0, 0, 0.07), clamp_start="table")
    mast["path"]["direction"], mast["normal"] = [0, 0, 1], [1, 0, 0]
    simulator = Simulator(
        load_scene(scene([mast], bodies=[table], gravity=[0, 0, -9.81], obstacles=[GROUND], contact=contact()))
    )
    simulator.run(0.2)
    assert 0.0 < simulator.statistics.min_gap < 1e-3
    assert simulator.summary()["converged"] is True
