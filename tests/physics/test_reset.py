"""A simulator that is reset to another scene of the same model is a new one of that scene, bit for bit."""

import copy

import numpy as np
import pytest
from support.repeats import differences, figures
from support.sample_scenes import everything

from bilayer_core import Recorder, Simulator, load_scene
from bilayer_core.errors import InputError

OTHERS = {
    "gripping": {
        "stimuli.humidity.schedule": {"type": "hold", "value": 0.7},
        "contact.friction.coefficient": 0.33,
        "duration": 0.3,
    },
    "crawling_inchworm": {"solver.tolerance": 1e-3, "output.rate": 40.0, "contact.friction.coefficient": 0.35},
    "jumping": {"solver.tolerance": 3e-4, "name": "other"},
    "steered_walker": {"output.rate": 30.0, "solver.max_newton_iterations": 40},
}
SPANS = {"gripping": 0.02}
"""Of simulated time that is compared [s], of scenes with short steps."""


def other_of(name):
    """A scene and one of the same model that differs in what may differ."""
    return load_scene(name), load_scene(name, OTHERS[name])


FIXED = {"model": "two_rod", "dt": 2e-3, "integrator": "generalised_alpha"}


@pytest.mark.parametrize(
    ("name", "chosen"), [("gripping", {}), ("crawling_inchworm", FIXED), ("jumping", FIXED), ("steered_walker", {})]
)
def test_a_simulator_that_takes_another_scene_is_a_new_one_of_it_bit_for_bit(name, chosen):
    scene, other = other_of(name)
    span = SPANS.get(name, 0.06)
    simulator, new = Simulator(scene, **chosen), Simulator(other, **chosen)
    first = Simulator(scene, **chosen)
    for each in (simulator, first):
        each.run(until=span)
    simulator.reset(other)
    assert simulator.scene is other and simulator.time == 0.0
    for each in (simulator, new):
        each.run(until=span)
    assert differences(simulator, new.save_state(), figures(new)) == []
    simulator.reset(scene)
    simulator.run(until=span)
    assert differences(simulator, first.save_state(), figures(first)) == []
    assert np.any(first.save_state() != new.save_state())


def everything_but(change):
    content = copy.deepcopy(everything())
    change(content)
    return load_scene(content)


ALLOWED = {
    "stimulus": lambda s: s["stimuli"]["humidity"].update(schedule={"type": "hold", "value": 0.7}),
    "factor of a load": lambda s: s["loads"][0].update(schedule={"type": "hold", "value": 0.5}),
    "steps": lambda s: s["solver"].update(dt=5e-4),
    "friction": lambda s: s["contact"]["friction"].update(coefficient=0.21),
    "threshold of friction": lambda s: s["contact"]["friction"].update(speed_threshold=2e-3),
    "texts": lambda s: s.update(name="other", duration=7.0, output={"rate": 20}),
}


@pytest.mark.parametrize("change", ALLOWED)
@pytest.mark.parametrize("model", ["two_rod", "laminate"])
def test_each_change_that_is_allowed_is_taken_bit_for_bit(change, model):
    other = everything_but(ALLOWED[change])
    settings = {"model": model, "integrator": "sdirk2", "budget": True}
    simulator = Simulator(load_scene(everything()), **settings)
    simulator.run(0.003)
    simulator.reset(other)
    new = Simulator(other, **settings)
    for each in (simulator, new):
        each.run(until=0.004)
    assert differences(simulator, new.save_state(), figures(new)) == []
    assert simulator.budget() == new.budget()


REFUSED = {
    "rods": lambda s: s["rods"][0].update(width=0.0041),
    "materials": lambda s: s["materials"]["gel"].update(density=1001.0),
    "stimuli.humidity.maximum": lambda s: s["stimuli"]["humidity"].update(maximum=0.95),
    "gravity": lambda s: s.update(gravity=[0, 0, -1]),
    "contact.stiffness": lambda s: s["contact"].update(stiffness=2e7),
    "contact.friction": lambda s: s["contact"].pop("friction"),
    "loads": lambda s: s["loads"].pop(),
    "solver.integrator": lambda s: s["solver"].update(integrator="tr_bdf2"),
    "fluid": lambda s: s["fluid"].update(density=999.0),
}


@pytest.fixture(scope="module")
def simulator():
    return Simulator(load_scene(everything()))


@pytest.mark.parametrize("key", REFUSED)
def test_a_scene_of_another_model_is_refused_by_what_differs(simulator, key):
    before, scene = simulator.save_state(), simulator.scene
    other = everything_but(REFUSED[key])
    assert not simulator.same_model(other)
    with pytest.raises(InputError, match=rf"by its {key}; allowed to differ"):
        simulator.reset(other)
    assert simulator.scene is scene and np.array_equal(simulator.save_state(), before, equal_nan=True)


def test_no_other_scene_is_taken_while_somebody_observes():
    simulator = Simulator(load_scene(everything()))
    Recorder(simulator, ["com"])
    with pytest.raises(InputError, match="while a log or an observer is attached"):
        simulator.reset(everything_but(ALLOWED["stimulus"]))


def test_a_tolerance_that_the_integrator_cannot_keep_is_refused_and_changes_nothing():
    scene = load_scene("cantilever", {"solver.dt": 1e-3, "solver.tolerance": None})
    other = load_scene("cantilever", {"solver.dt": None, "solver.tolerance": 1e-3})
    simulator = Simulator(scene, integrator="implicit_midpoint")
    simulator.run(0.005)
    before = simulator.save_state()
    assert simulator.same_model(other)
    with pytest.raises(InputError, match="no estimate of its error"):
        simulator.reset(other)
    assert simulator.scene is scene and np.array_equal(simulator.save_state(), before, equal_nan=True)
    simulator.run(0.005)
