"""Starts inside the barrier are told, and `start: settle` begins at the static equilibrium."""

import json

import numpy as np
import pytest

from bilayer_core import Simulator, load_scene
from bilayer_core.cli import main
from bilayer_core.errors import SimulationError
from bilayer_core.verification.validate.friction import box_on_ground, stride

DISTANCE, STIFFNESS = 0.5e-3, 1e7


def worm(height, **more):
    layers = [{"name": name, "material": "gel", "thickness": "0.6 mm"} for name in ("passive", "active")]
    layers[1]["eigenstrain"] = {"stimulus": "heat", "gain": "2 %"}
    path = {"shape": "straight", "start": [0, 0, height], "direction": [1, 0, 0], "length": "60 mm"}
    lying = {"name": "worm", "width": "8 mm", "path": path, "normal": [0, 0, 1], "stations": 21, "layers": layers}
    content = {
        "schema": 1,
        "name": "worm",
        "title": "A strip on the ground",
        "duration": 0.1,
        "materials": {"gel": {"youngs_modulus": "1 MPa", "poisson_ratio": 0.5, "density": 1100}},
        "stimuli": {"heat": {"schedule": {"type": "hold", "value": 0.0}}},
        "rods": [lying],
        "obstacles": [{"name": "ground", "type": "plane", "point": [0, 0, 0], "normal": [0, 0, 1]}],
        "contact": {"barrier_distance": DISTANCE, "stiffness": STIFFNESS},
    }
    return {**content, **more}


def start_of(height, **more):
    return Simulator(load_scene(worm(height, **more))).start_warnings


def test_a_start_inside_the_barrier_is_told_with_gap_energy_as_height_and_remedy():
    gap = 5e-5
    (warning,) = start_of(0.6e-3 + gap)
    stored = STIFFNESS * 0.06 * (gap - DISTANCE) ** 2 * -np.log(gap / DISTANCE)
    height = stored / (1100 * 0.06 * 8e-3 * 1.2e-3 * 9.81)
    assert "rod 'worm' starts inside the barrier" in warning and "ground, 0.05 mm from it" in warning
    assert "begins at 0.5 mm" in warning and f"lifts it by {height:.3g} m" in warning
    assert "let it start 0.45 mm farther away" in warning and "`start: settle`" in warning


def test_without_gravity_the_speed_is_told():
    (warning,) = start_of(0.65e-3, gravity=[0, 0, 0])
    assert "throws it at 29.7 m/s" in warning


@pytest.mark.parametrize("gap", [DISTANCE, 0.4987e-3])
def test_a_start_at_the_barrier_or_at_rest_on_it_is_not_told(gap):
    assert start_of(0.6e-3 + gap) == ()


def test_a_body_near_a_held_rod_is_told_by_its_own_mass():
    ball = {"name": "ball", "position": [0.03, 0, 0.1 + 0.6e-3 + 5e-3 + 1e-4], "motion": {"type": "free", "mass": 1e-3}}
    ball["surface"] = {"shape": "sphere", "radius": 5e-3}
    content = worm(0.1, bodies=[ball, {"name": "wall", "position": [0, 0, 0.1], "motion": {"type": "prescribed"}}])
    content["rods"][0]["clamp_start"] = "wall"
    warnings = Simulator(load_scene(content)).start_warnings
    assert any("body 'ball'" in text or "2, with" in text for text in warnings)


def test_rods_that_start_near_each_other_are_told():
    content = worm(0.1)
    above = json.loads(json.dumps(content["rods"][0])) | {"name": "above"}
    above["path"]["start"][2] = 0.1 + 1.2e-3 + 1e-4
    content |= {"rods": [content["rods"][0], above]}
    (warning,) = Simulator(load_scene(content)).start_warnings
    assert "starts inside the barrier" in warning and "is near node" in warning


def test_check_and_run_print_the_warning(tmp_path, capsys):
    path = tmp_path / "worm.yaml"
    path.write_text(json.dumps(worm(0.65e-3)))
    for arguments in (["check", str(path)], ["run", str(path), "--duration", "1ms"]):
        assert main(arguments) == 0
        assert "starts inside the barrier" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize("model", ["laminate", "two_rod"])
def test_a_robot_that_settles_rests_on_the_ground_from_the_first_moment(model):
    simulator = Simulator(load_scene(worm(0.65e-3, start="settle")), model=model)
    start = simulator.com
    assert simulator.settled.stable and simulator.start_warnings == () and simulator.time == 0.0
    force = 1100 * 0.06 * 8e-3 * 1.2e-3 * 9.81
    assert simulator.contact_forces[:, 2].sum() == pytest.approx(force, rel=1e-6)
    simulator.run(0.1)
    assert simulator.com == pytest.approx(start, abs=1e-9)


def test_a_settled_start_comes_again_with_reset_and_is_not_for_loaded_states():
    scene = load_scene(worm(0.65e-3, start="settle"))
    simulator = Simulator(scene)
    first = simulator.save_state()
    simulator.run(0.01)
    later = simulator.save_state()
    simulator.reset()
    assert np.array_equal(simulator.save_state(), first, equal_nan=True)
    other = Simulator(scene)
    other.load_state(later)
    assert np.array_equal(other.save_state(), later, equal_nan=True) and other.settled is None


def test_settling_takes_stimuli_and_loads_from_before_time_zero():
    push = {"name": "push", "rod": "worm", "position": 0.06, "force": [0, 0, -1e-5]}
    push["schedule"] = {"type": "square", "low": 1.0, "high": 0.0, "period": 10.0}
    held = worm(0.1, start="settle", loads=[push], gravity=[0, 0, 0])
    held |= {"bodies": [{"name": "wall", "position": [0, 0, 0.1], "motion": {"type": "prescribed"}}]}
    held["rods"][0]["clamp_start"] = "wall"
    simulator = Simulator(load_scene(held))
    bending = 1e6 * 8e-3 * 1.2e-3**3 / 12
    assert simulator.positions[-1, 2] - 0.1 == pytest.approx(-1e-5 * 0.06**3 / (3 * bending), rel=0.03)
    simulator.run(0.01)
    assert simulator.velocities[-1, 2] > 1e-4


def test_a_robot_that_nothing_holds_cannot_settle():
    content = worm(0.1, start="settle")
    del content["obstacles"], content["contact"]
    simulator = Simulator(load_scene(content))
    with pytest.raises(SimulationError, match="start: settle: no static equilibrium.*remedy: hold the robot"):
        simulator.run(0.01)


def test_a_settled_robot_can_start_in_motion():
    simulator = Simulator(load_scene(worm(0.65e-3, start="settle", velocity=[0, 0, 1])))
    assert simulator.velocities[:, 2] == pytest.approx(1.0)


def test_a_strip_pushed_by_the_border_of_a_box_settles_where_friction_holds_it():
    """Friction's law has no force at rest, so it creeps by 1e-11 m/s. The stride is that of a beam on both barriers,
    solved by finite differences.
    """
    assert stride(0.4, 0.5, 41, box_on_ground(0.0447))[0] == pytest.approx(0.5638, rel=0.01)
