"""Springs, damping, friction and limits of hinges, rails and joints, and joints that slide or have crossed axes."""

import math

import numpy as np
import pytest
from support.evaluations import Problem, check
from support.sample_scenes import fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import SceneError
from bilayer_core.forces.mechanisms import limit_energy
from bilayer_core.verification.validate.mechanisms import ARM, GRAVITY, MASS, pendulum, rigid

AXES = {"axis": [0.6, 0.0, 0.8], "second_axis": [0.0, 1.0, 0.0]}
KEYS = {
    "pin": {},
    "hinge": {"axis": AXES["axis"]},
    "universal": AXES,
    "slide": {"axis": AXES["axis"]},
    "cylinder": {"axis": AXES["axis"]},
    "weld": {},
}
TURNING = {"spring": 3e-3, "rest_angle": 0.4, "damping": 2e-6, "friction": 1e-4, "friction_speed": 0.5}
SLIDING = {"spring": 4.0, "rest_position": 0.01, "damping": 3e-2, "friction": 2e-2, "friction_speed": 5e-3}
SOFT = {"stiffness": 30.0, "torsional_stiffness": 4e-3}


def block(name, position, **motion):
    """A free box."""
    inertia = [2e-8, 3e-8, 4e-8]
    return {"name": name, "position": position, "motion": {"type": "free", "mass": 1e-3, "inertia": inertia, **motion}}


def strip():
    """A rod, which scenes need."""
    return rod([layer()], length=5e-3, stations=5, start=(0, 0, 0.02), name="strip", clamp_start="left")


def joined(kind, other="free", guides=(), **keys):
    """Two bodies, the first with a rod, in a joint."""
    joint = {"name": "joint", "type": kind, "bodies": ["left", "right"], "point": [4e-3, 3e-3, 1e-2]}
    joint |= {**KEYS[kind], **keys}
    right = block("right", [9e-3, 2e-3, 4e-3])
    if other != "free":
        right["motion"] = {"type": "prescribed"}
    return scene([strip()], bodies=[block("left", [0, 0, 0.02]), right], joints=[joint])


@pytest.mark.parametrize("other", ["free", "prescribed"])
@pytest.mark.parametrize("kind", KEYS)
def test_derivatives_of_every_joint_that_gives_way_agree_with_differences(kind, other):
    for seed in (0, 1):
        soft = {"stiffness": SOFT["stiffness"]} if kind == "pin" else SOFT
        problem = Problem(joined(kind, other, **soft), np.random.default_rng(seed))
        loosen(problem)
        check(problem, ("joints",))


def loosen(problem, turn=0.15, shift=1e-3):
    """Put bodies far from where joints want them."""
    rng = np.random.default_rng(11)
    vector = np.zeros(len(problem.scale))
    moved = rng.standard_normal(len(problem.free))
    vector[problem.free] = np.where(problem.free < problem.model.solved_layout.size, 0.0, moved)
    vector[problem.model.solved_layout.size :] *= np.where(
        problem.scale[problem.model.solved_layout.size :] == 1.0, shift, turn * 2e-2
    )
    problem.move(problem.at, vector, problem.trial)
    problem.at, problem.trial = problem.trial, problem.at
    problem.evaluator.update_lagged(problem.at)


@pytest.mark.parametrize("force", ["joints", "joint friction"])
@pytest.mark.parametrize("limits", [False, True])
@pytest.mark.parametrize("other", ["free", "prescribed"])
def test_derivatives_of_springs_friction_and_limits_agree_with_differences(force, limits, other):
    stops = {"limits": [-0.03, 0.02], "limit_stiffness": 2e-2}
    ways = {"limits": [-1e-4, 2e-4], "limit_stiffness": 20.0}
    for seed in (0, 1):
        content = joined(
            "cylinder",
            other,
            turning=TURNING | (stops if limits else {}),
            sliding=SLIDING | (ways if limits else {}),
            **SOFT,
        )
        problem = Problem(content, np.random.default_rng(seed))
        loosen(problem)
        check(problem, (force,))
        assert problem.terms[force] > 0.0


def test_derivatives_of_a_guided_body_agree_with_differences():
    content = scene([strip()], bodies=[block("left", [0, 0, 0.02])])
    content["bodies"][0]["motion"] = {
        "type": "guided",
        "mass": 1e-3,
        "inertia": [2e-8, 3e-8, 4e-8],
        "axis": [0.6, 0.0, 0.8],
        "hinge": [0.0, 0.6, 0.8],
        "turning": TURNING,
        "sliding": SLIDING,
    }
    for seed in (0, 2):  # with 1 it slides at 8e-6 m/s, next to where f₀ has no third derivative
        problem = Problem(content, np.random.default_rng(seed))
        for force in ("joints", "joint friction"):
            check(problem, (force,))
            assert problem.terms[force] > 0.0


def test_a_limit_is_twice_continuously_differentiable_and_gives_way_as_it_says():
    stiffness, margin = 5.0, 0.01
    for x in (1e-4, 0.005, margin, 0.02):
        step = 1e-7
        below, here, above = (limit_energy(x + d, stiffness, margin) for d in (-step, 0.0, step))
        assert (above[0] - below[0]) / (2 * step) == pytest.approx(here[1], rel=1e-6)
        assert (above[1] - below[1]) / (2 * step) == pytest.approx(here[2], rel=1e-5)
    assert limit_energy(-1.0, stiffness, margin) == (0.0, 0.0, 0.0)
    before, after = limit_energy(margin * (1 - 1e-12), stiffness, margin), limit_energy(margin, stiffness, margin)
    assert before == pytest.approx(after, rel=1e-10)
    moment = 0.1
    assert limit_energy(moment / stiffness + 0.5 * margin, stiffness, margin)[1] == pytest.approx(moment)


def wheel(gravity=0.0, **law):
    """A wheel on a hinge."""
    turns = {"type": "guided", "hinge": [0, 1, 0], "mass": 1e-3, "inertia": [1e-6] * 3, "turning": law}
    return rigid([{"name": "wheel", "position": [0, 0, 0], "motion": turns}], gravity=gravity)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_spring_winds_its_hinge_by_three_whole_turns_and_a_saved_state_knows_them(dimension):
    content = wheel(spring=1e-4, rest_angle="3 turns", damping=2e-5)
    simulator = Simulator(load_scene(content), dimension=dimension, integrator="tr_bdf2", dt=1e-3)
    simulator.run(1.0)
    middle, angle = simulator.save_state(), simulator.bodies["wheel"].turning.value
    assert angle > 2.0 * math.tau
    other = Simulator(load_scene(content), dimension=dimension, integrator="tr_bdf2", dt=1e-3)
    other.load_state(middle)
    assert other.bodies["wheel"].turning.value == angle
    for each in (simulator, other):
        each.run(3.0)
    assert simulator.bodies["wheel"].turning.value == pytest.approx(3.0 * math.tau, abs=1e-3)
    assert simulator.save_state().tolist() == other.save_state().tolist()


def test_statics_find_the_turns_of_a_wound_spring():
    content = wheel(spring=1e-4, rest_angle="3 turns")
    simulator = Simulator(load_scene(content), dimension=3)
    simulator.solve_static()
    assert simulator.bodies["wheel"].turning.value == pytest.approx(3.0 * math.tau, rel=1e-9)


@pytest.mark.parametrize("integrator", ["implicit_euler", "sdirk2", "tr_bdf2", "generalised_alpha"])
@pytest.mark.parametrize("law", [{"damping": 3e-6}, {"friction": 2e-5}], ids=["damping", "friction"])
def test_what_friction_of_a_hinge_takes_is_in_the_account_and_in_the_budget(law, integrator):
    content = wheel(**law)
    content["bodies"][1]["motion"]["angular_speed"] = 20.0
    simulator = Simulator(load_scene(content), dimension=2, integrator=integrator, dt=1e-4, budget=True)
    simulator.run(0.02)
    if "damping" in law:
        speed = 20.0 * math.exp(-3.0 * 0.02)
        angle = 20.0 / 3.0 * (1.0 - math.exp(-3.0 * 0.02))
    else:
        speed, angle = 19.6, 0.396
    lost = 0.5e-6 * (20.0**2 - speed**2)
    order = 1e-3 if integrator == "implicit_euler" else 1e-6
    assert simulator.bodies["wheel"].turning.value == pytest.approx(angle, rel=order)
    budget = simulator.budget()
    assert budget["lost"]["joint friction"] == pytest.approx(lost, rel=10 * order)
    assert abs(budget["relative_residual"]) < 1e-6
    assert abs(simulator.summary()["numerical_energy"]) < 10 * order * lost


def test_damping_of_a_hinge_keeps_the_order_of_integrators():
    def angle(dt):
        content = wheel(spring=4e-4, rest_angle=1.0, damping=1e-5)
        simulator = Simulator(load_scene(content), dimension=2, integrator="sdirk2", dt=dt)
        simulator.run(0.2)
        return simulator.bodies["wheel"].turning.value

    rate, own = 5.0, math.sqrt(400.0 - 25.0)
    exact = 1.0 - math.exp(-rate * 0.2) * (math.cos(own * 0.2) + rate / own * math.sin(own * 0.2))
    errors = [abs(angle(dt) - exact) for dt in (4e-3, 2e-3, 1e-3)]
    assert errors[0] > 3.5 * errors[1] > 3.5**2 * errors[2]


def test_dry_friction_holds_a_hinge_that_a_smaller_moment_pulls():
    content = wheel(spring=1e-4, rest_angle=0.5, friction=1e-4, friction_speed=1e-3)
    simulator = Simulator(load_scene(content), dimension=2, integrator="tr_bdf2", dt=1e-3)
    simulator.run(1.0)
    turning = simulator.bodies["wheel"].turning
    assert 0.0 < turning.value < 1e-3  # it creeps at less than the threshold, 1 mrad/s
    assert turning.exerted == pytest.approx(0.0, abs=1e-10)


@pytest.mark.parametrize("steps", [{"dt": 1e-3}, {"tolerance": 1e-5}])
@pytest.mark.parametrize("integrator", ["implicit_euler", "sdirk2", "tr_bdf2", "generalised_alpha"])
def test_a_pendulum_comes_to_rest_on_its_limit_under_any_integrator(integrator, steps):
    angle, stiffness = math.radians(30.0), 1.0
    content = pendulum(angle, axis=(0, 1, 0), limits=[-1.0, 0.2], limit_stiffness=stiffness, damping=2e-5)
    simulator = Simulator(load_scene(content), dimension=2, integrator=integrator, **steps)
    simulator.run(2.0)
    turning = simulator.joints["hinge"].turning
    moment = MASS * GRAVITY * ARM * math.sin(angle - turning.value)
    assert turning.value - 0.2 == pytest.approx(math.sqrt(2.0 * 1.2e-3 * moment / stiffness), rel=2e-2)
    assert turning.value - 0.2 <= turning.beyond < 0.1
    summary = simulator.summary()
    assert summary["joints"]["hinge"]["turning"] == turning.value
    assert summary["joints"]["hinge"]["turning_beyond_limit"] == turning.beyond


def test_a_wrench_of_a_joint_has_what_its_spring_exerts():
    content = pendulum(0.3, axis=(0, 1, 0), spring=1e-2, rest_angle=0.1)
    simulator = Simulator(load_scene(content), dimension=3)
    simulator.solve_static()
    hinge = simulator.joints["hinge"]
    weight = MASS * GRAVITY
    assert hinge.wrench[:3] == pytest.approx([0, 0, -weight], abs=1e-6 * weight)
    assert hinge.wrench[4] == pytest.approx(-hinge.turning.exerted, rel=1e-9)
    assert hinge.turning.exerted == pytest.approx(1e-2 * (0.1 - hinge.turning.value), rel=1e-9)
    assert hinge.turning.exerted == pytest.approx(-weight * ARM * math.sin(0.3 - hinge.turning.value), rel=1e-6)


def test_damping_and_friction_of_a_hinge_are_refused_with_the_implicit_midpoint_rule():
    with pytest.raises(SceneError, match="implicit_midpoint does not follow damping and friction of wheel"):
        Simulator(load_scene(wheel(friction=1.0)), integrator="implicit_midpoint")


def test_a_joint_costs_a_scene_without_mechanisms_nothing():
    simulator = Simulator(load_scene(scene([rod([layer()], clamp_start="wall")], bodies=[fixed()])))
    assert not simulator._stepper.engine.mechanisms.exists
    assert simulator.plan.terms["joint friction"].startswith("skipped")


@pytest.mark.parametrize("speed", [1.0, 10.0, 100.0])
def test_adaptive_steps_resolve_rebounds_from_a_limit(speed):
    def lost(tolerance):
        content = wheel(limits=[-1.0, 1.0])
        content["bodies"][1]["motion"]["angular_speed"] = speed
        simulator = Simulator(load_scene(content), dimension=2, integrator="tr_bdf2", tolerance=tolerance)
        simulator.run(10.0 / speed)  # five rebounds
        assert simulator.bodies["wheel"].turning.beyond > 0.0
        return -simulator.summary()["numerical_energy"] / (0.5e-6 * speed**2)

    assert 0.0 < lost(1e-4) < 0.03
    assert abs(lost(1e-5)) < 0.003
