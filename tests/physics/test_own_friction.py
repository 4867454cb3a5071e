"""Coefficients of friction of single rods, bodies and obstacles, and the rule that combines those of two."""

import numpy as np
import pytest
from support.evaluations import Problem, check
from support.meeting_rods import Rods, parallel_rods
from support.sample_scenes import GROUND, contact, everything, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import InputError, SceneError
from bilayer_core.verification.validate.friction import FAR, GRAVITY, SIZE, at_rest, block

ON_BARRIER = 1.1988475e-3
"""Height at which the strip below rests [m]."""
BOTH = {"minimum": 0.1, "geometric": 0.03**0.5, "mean": 0.2, "maximum": 0.3}


def slid(of_strip, of_ground, pull=4.0, solver=None, **law):
    """The coefficient that a strip meets: it slides on the ground for 0.2 s, drawn by `pull` [m/s²]."""
    rule = contact(barrier_distance=2e-4, coefficient=0.25, speed_threshold=1e-4)
    rule["friction"] |= law
    strip = rod([layer("a"), layer("b")], length=0.02, stations=6, start=(0, 0, ON_BARRIER)) | of_strip
    content = scene([strip], gravity=[pull, 0, -10.0], obstacles=[GROUND | of_ground], contact=rule)
    content["solver"] = solver or {}
    simulator = Simulator(load_scene(content))
    simulator.run(0.1)
    before = simulator.com[0]
    simulator.run(0.2)
    return 0.1 * (abs(pull) - abs(simulator.com[0] - before) / 0.04)


def own(coefficient, **ways):
    return {"friction": {"coefficient": coefficient, **ways}}


@pytest.mark.parametrize(
    ("of_strip", "of_ground", "expected"),
    [({}, {}, 0.25), ({}, own(0.1), 0.1), (own(0.3), {}, 0.3), (own(0.0), own(0.3), 0.0)],
)
def test_what_one_has_of_its_own_holds_where_the_other_has_none(of_strip, of_ground, expected):
    assert slid(of_strip, of_ground) == pytest.approx(expected, abs=0.004)


@pytest.mark.parametrize("solver", [{}, {"model": "two_rod", "dimension": 3}], ids=["default", "two_rod"])
@pytest.mark.parametrize("rule", BOTH)
def test_the_rule_holds_where_both_have_coefficients_of_their_own(rule, solver):
    assert slid(own(0.3), own(0.1), solver=solver, combine=rule) == pytest.approx(BOTH[rule], abs=0.004)


def test_directions_of_the_scene_count_as_own_ones_of_rods():
    for rule, forward in (("minimum", 0.15), ("maximum", 0.3)):
        met = slid({}, own(0.3), combine=rule, forward=0.15, backward=0.35)
        assert met == pytest.approx(forward, abs=0.004)
        back = slid({}, own(0.3), pull=-4.0, combine=rule, forward=0.15, backward=0.35)
        assert back == pytest.approx({"minimum": 0.3, "maximum": 0.35}[rule], abs=0.004)


def test_a_rod_may_have_directions_of_its_own():
    assert slid(own(0.2, forward=0.1, backward=0.3), {}) == pytest.approx(0.1, abs=0.004)
    assert slid(own(0.2, forward=0.1, backward=0.3), {}, pull=-4.0) == pytest.approx(0.3, abs=0.004)


def blocks(**own_ones):
    """A scene with blocks on the ground, of which some have coefficients of their own, and all are pulled by m g/2."""
    bodies = [block((0, 0.2 * k, SIZE[2])) | {"name": name} for k, name in enumerate(own_ones)]
    return scene(
        [rod([layer()], length=0.02, stations=3, start=FAR, clamp_start="wall")],
        gravity=[0.5 * GRAVITY, 0, -GRAVITY],
        obstacles=[GROUND],
        contact=contact(coefficient=0.4, speed_threshold=1e-5),
        bodies=[fixed(position=FAR)]
        + [body | ({} if mu is None else own(mu)) for body, mu in zip(bodies, own_ones.values(), strict=True)],
    ) | {"solver": {}}


def speeds(simulator, time):
    """Changes of the blocks' speeds over some time [m/s]."""
    before = simulator.frame().body_velocities[1:, 0].copy()
    simulator.run(time)
    return simulator.frame().body_velocities[1:, 0] - before


def on_ground(content):
    """A simulator whose blocks rest at first."""
    for name in ("plain", "slippery"):
        at_rest(content, name)
    return at_rest(content, "rough")


def test_each_body_slides_by_its_own_and_what_is_set_later_is_that_of_the_others():
    simulator = on_ground(blocks(plain=None, slippery=0.1, rough=0.6))
    assert speeds(simulator, 0.4) == pytest.approx(0.4 * GRAVITY * np.array([0.1, 0.4, 0.0]), abs=4e-3)
    simulator.set_friction(0.2)
    assert speeds(simulator, 0.4) == pytest.approx(0.4 * GRAVITY * np.array([0.3, 0.4, 0.0]), abs=4e-3)


def test_a_coefficient_that_holds_nowhere_cannot_be_set():
    content = blocks(slippery=0.1, rough=0.6)
    content["rods"][0] |= own(0.2)  # far away; it could touch the ground
    simulator = on_ground(content)
    for key in ("coefficient", "forward"):
        with pytest.raises(InputError, match="friction of their own"):
            simulator.set_friction(0.2, key)


@pytest.mark.parametrize(("model", "dimension"), [("two_rod", 3), ("laminate", 3)])
def test_derivatives_agree_with_differences_where_all_have_their_own(model, dimension):
    content = everything()
    content["bodies"][0]["motion"] = {"type": "free", "mass": 1e-3, "inertia": [2e-8, 3e-8, 4e-8]}
    content["contact"]["rods"] = False  # noise moves borders of arms into each other
    content["contact"]["friction"]["combine"] = "mean"
    content["rods"][0] |= own(0.2, forward=0.1)
    content["bodies"][1] |= own(0.8)
    content["obstacles"][0] |= own(0.6, forward=0.4) | {"grain": [1, -1, 0.2]}
    problem = Problem(content, np.random.default_rng(4), model, dimension)
    check(problem, ("friction",))
    sliding, surfaces = problem.evaluator.problem.sliding, problem.evaluator.problem.surfaces
    count = sliding.count[0]
    ground = surfaces.body[sliding.surface[:count]] == len(content["bodies"])
    rods = surfaces.contact_point_body[sliding.first[:count]] < 0
    expected = {
        (True, True): [0.3, 0.4, 0.4],  # the ground's directions with the arms' 0.2
        (False, True): [0.45, 0.5, 0.5],  # the arms' directions with the ball's 0.8
    }
    met = {(bool(g), bool(r)): sliding.mu[k] for k, (g, r) in enumerate(zip(ground, rods, strict=True))}
    assert {pair for pair in met if pair[1]}
    for pair, mu in met.items():
        if pair in expected:
            assert mu == pytest.approx(expected[pair])


@pytest.mark.parametrize(
    ("mine", "other", "expected"), [(None, None, 0.4), (0.1, None, 0.1), (0.3, 0.2, 0.2), (0, 0.5, 0)]
)
def test_rods_slide_on_each_other_by_their_own(mine, other, expected):
    keys = [own(mu) if mu is not None else {} for mu in (mine, other)]
    model, position = parallel_rods(np.random.default_rng(5), keys)
    rods = Rods(model)
    rods.start(position, position)
    load = np.linalg.norm(rods.evaluate(position)[1][6:].sum(axis=0))
    slipped = position.copy()
    slipped[:6, 0] += 1e-4  # far above the threshold in 10 ms
    _, gradient = rods.evaluate(slipped, "rod friction")
    assert gradient[:6].sum(axis=0)[0] == pytest.approx(expected * load, rel=0.05, abs=1e-12)
    assert np.isfinite(rods.bound(position, slipped - position).fraction)


def refused(change):
    """What the scene of the blocks is refused with after a change."""
    content = blocks(plain=None, slippery=0.1)
    change(content)
    with pytest.raises(SceneError) as caught:
        load_scene(content)
    return str(caught.value)


def test_bad_coefficients_are_refused_with_the_key():
    told = refused(lambda content: content["contact"].pop("friction"))
    assert "bodies.slippery.friction" in told and "contact.friction" in told
    told = refused(lambda content: content["obstacles"][0].update(own(0.3, sideways=0.1)))
    assert "obstacles.ground.friction.sideways" in told and "grain" in told
    told = refused(lambda content: content["rods"][0].update(own(-0.3)))
    assert "rods.rod.friction.coefficient" in told
    told = refused(lambda content: content["contact"]["friction"].update(combine="product"))
    assert "contact.friction.combine" in told and "geometric" in told
