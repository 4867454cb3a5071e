"""What `auto` chooses for model, dimension, integrator and steps, and what a scene or a caller asks for instead."""

import pytest
from support.sample_scenes import layer, rod, scene

from bilayer_core import Simulator, load_scene

CHOSEN = {
    "awn": ("two_rod", 3),
    "bending": ("laminate", 2),
    "cantilever": ("laminate", 2),
    "crawling_dual_leg": ("laminate", 3),
    "crawling_inchworm": ("laminate", 2),
    "gripping": ("laminate", 3),
    "gripping_friction": ("laminate", 3),
    "helix": ("two_rod", 3),
    "jumping": ("laminate", 2),
    "lattice": ("laminate", 2),
    "swimming": ("laminate", 3),
}
MISSED = {"awn": "2.2 %", "helix": "5.8 %"}
"""Error of one curve in radius or pitch, for which there are two rods."""


@pytest.mark.parametrize(("name", "chosen"), CHOSEN.items(), ids=CHOSEN)
def test_bundled_scenes_run_by_the_simplest_model_in_the_plane_where_they_stay_in_one(name, chosen):
    simulator = Simulator(load_scene(name))
    assert (simulator.plan.model, simulator.plan.dimension) == chosen
    assert simulator.plan.integrator == "sdirk2"
    assert (simulator.tolerance, simulator.dt) == (1e-4, 1e-3)
    reasons = simulator.reasons
    assert "two_rod" not in chosen or f"which one curve would miss by {MISSED[name]}" in reasons["model"]
    assert ("plane" in reasons["dimension"]) and ("all stays" in reasons["dimension"]) == (chosen[1] == 2)
    assert "order" in reasons["integrator"] and "neither `dt` nor `tolerance`" in reasons["stepping"]


def test_what_is_asked_for_comes_before_what_the_scene_says():
    config = load_scene("cantilever", ["solver.model=laminate", "solver.dimension=3", "solver.integrator=tr_bdf2"])
    by_scene = Simulator(config)
    assert by_scene.plan.reasons == {key: f"set by `solver.{key}`" for key in ("model", "dimension", "integrator")}
    asked = Simulator(config, model="two_rod", dimension=2, integrator="sdirk2")
    assert (asked.plan.model, asked.plan.dimension, asked.plan.integrator) == ("two_rod", 2, "sdirk2")
    assert asked.reasons["model"] == "asked for" and asked.reasons["dimension"].startswith("asked for: all stays in")


STEPS = {
    # what the scene and the caller ask for; first or only step [s], tolerance, and the reason
    "nothing": ({}, {}, 1e-3, 1e-4, "neither"),
    "dt of the scene": ({"dt": 2e-3}, {}, 2e-3, None, "set by `solver.dt`"),
    "tolerance of the scene": ({"tolerance": 1e-3}, {}, 1e-3, 1e-3, "set by `solver.tolerance`"),
    "both of the scene": ({"dt": 2e-3, "tolerance": 1e-3}, {}, 2e-3, 1e-3, "set by `solver.tolerance`"),
    "dt against a tolerance": ({"tolerance": 1e-3}, {"dt": 5e-3}, 5e-3, None, "asked for"),
    "dt against both": ({"dt": 2e-3, "tolerance": 1e-3}, {"dt": 5e-3}, 5e-3, None, "asked for"),
    "tolerance against dt": ({"dt": 2e-3}, {"tolerance": 1e-5}, 2e-3, 1e-5, "asked for"),
    "tolerance alone": ({}, {"tolerance": 1e-5}, 1e-3, 1e-5, "asked for"),
    "both asked for": ({"dt": 2e-3}, {"dt": 5e-3, "tolerance": 1e-5}, 5e-3, 1e-5, "asked for"),
}


@pytest.mark.parametrize(("of_scene", "asked", "dt", "tolerance", "reason"), STEPS.values(), ids=STEPS)
def test_a_tolerance_asks_for_adaptive_steps_and_dt_alone_for_fixed_ones(of_scene, asked, dt, tolerance, reason):
    content = {**scene([rod([layer()])]), "solver": of_scene}
    simulator = Simulator(load_scene(content), **asked)
    assert (simulator.dt, simulator.tolerance) == (dt, tolerance)
    assert simulator.reasons["stepping"].startswith(reason)
    simulator.run(0.1)
    assert simulator.time == pytest.approx(0.1, rel=1e-12)
    assert str(simulator.steps).startswith("fixed" if tolerance is None else "adaptive")
    assert (simulator.statistics.longest - simulator.statistics.shortest > 1e-4) == (tolerance is not None)


def test_an_integrator_without_an_estimate_of_its_error_has_fixed_steps_by_default():
    content = {**scene([rod([layer()])]), "solver": {"integrator": "implicit_midpoint"}}
    simulator = Simulator(load_scene(content))
    assert (simulator.dt, simulator.tolerance) == (1e-3, None)
    assert simulator.reasons["stepping"] == "implicit_midpoint has no estimate of its error, and no `dt` is given"
