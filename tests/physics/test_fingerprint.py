"""A state goes on in the scene that it is of, under other conditions too, and in no other."""

import copy

import numpy as np
import pytest
from support.sample_scenes import everything

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import InputError
from bilayer_core.model.fingerprint import FIXED, fingerprint_of


def changed(change):
    content = copy.deepcopy(everything())
    change(content)
    return Simulator(load_scene(content), model="two_rod")


@pytest.fixture(scope="module")
def saved():
    return Simulator(load_scene(everything()), model="two_rod").save_state()


OTHERS = {
    "rods": lambda s: s["rods"][0].update(width=0.0041),
    "materials": lambda s: s["materials"]["gel"].update(density=1001.0),
    "channels of stimuli": lambda s: s["stimuli"]["humidity"].update(maximum=0.9),
    "bodies": lambda s: s["bodies"][1]["motion"].update(mass=0.5),
    "masses": lambda s: s["masses"][0].update(mass=2e-5),
    "obstacles": lambda s: s["obstacles"][0].update(point=[0, 0, -1e-4]),
    "coupling of two rods": lambda s: s.update(coupling={"twist": 11.0}),
    "added mass of the fluid": lambda s: s["fluid"].update(density=999.0),
}


@pytest.mark.parametrize("part", OTHERS)
def test_a_state_of_the_same_size_of_another_scene_is_refused_and_told_by_what_differs(saved, part):
    other = changed(OTHERS[part])
    before = other.save_state()
    assert before.size == saved.size
    with pytest.raises(InputError) as refused:
        other.load_state(saved)
    told = str(refused.value)
    assert told.startswith(f"saved state: is of another scene, with other {part}; allowed to differ are schedules of")
    assert np.array_equal(other.save_state(), before, equal_nan=True)


def without_friction(scene):
    scene["contact"].pop("friction")


CONDITIONS = {
    "schedule": lambda s: s["stimuli"]["humidity"].update(schedule={"type": "hold", "value": 0.7}),
    "loads": lambda s: s["loads"].pop(),
    "gravity": lambda s: s.update(gravity=[0, 0, -1]),
    "friction": without_friction,
    "barrier": lambda s: s["contact"].update(stiffness=2e7),
    "damping": lambda s: s.update(damping={"mass": 0.5}),
    "drag": lambda s: s["fluid"].update(drag_across=0.1),
    "steps": lambda s: s.update(solver={"tolerance": 1e-3, "integrator": "sdirk2"}),
    "text": lambda s: s.update(name="other", title="Other", duration=7.0, output={"rate": 20}),
    "unused material": lambda s: s["materials"].update(spare=dict(s["materials"]["gel"])),
}


@pytest.mark.parametrize("condition", CONDITIONS)
def test_a_state_of_other_conditions_is_of_the_same_scene(saved, condition):
    marks = slice(-len(FIXED), None)
    np.testing.assert_array_equal(changed(CONDITIONS[condition]).save_state()[marks], saved[marks])


def test_a_state_is_taken_as_it_is_where_gravity_friction_and_schedule_are_others():
    def conditions(scene):
        CONDITIONS["schedule"](scene)
        scene["gravity"] = [0, 0, -1]
        scene["contact"]["friction"]["coefficient"] = 0.1

    whole = changed(lambda scene: None)
    whole.run(0.004)
    other = changed(conditions)
    other.load_state(whole.save_state())
    taken, left, begin = other.save_state(), whole.save_state(), 0
    others = {"account", "law_force", "conditions", "seal"}  # the account of energy is another with another gravity
    for name, shape in whole.description.state_layout:
        end = begin + int(np.prod(shape))
        assert name in others or np.array_equal(taken[begin:end], left[begin:end], equal_nan=True), name
        begin = end
    other.run(0.002)
    assert other.time == pytest.approx(0.006) and other.stimulus == {"humidity": 0.7}


def test_a_state_with_the_history_of_one_integrator_is_none_of_another():
    config = load_scene(everything())
    states = {name: Simulator(config, integrator=name) for name in ("tr_bdf2", "generalised_alpha")}
    assert len({simulator.save_state().size for simulator in states.values()}) == 1
    with pytest.raises(InputError, match="with other integrator, which keeps what the last step left; allowed"):
        states["tr_bdf2"].load_state(states["generalised_alpha"].save_state())


def test_integrators_without_history_have_the_same_states(saved):
    euler = Simulator(load_scene(everything()), model="two_rod", integrator="implicit_euler").save_state()
    assert np.array_equal(euler, saved, equal_nan=True)


def test_a_state_of_another_size_tells_what_differs(saved):
    with pytest.raises(
        InputError, match=r"values, this scene's state has \d+; it is of another scene, with other rods$"
    ):
        Simulator(load_scene(everything(stations=7)), model="two_rod").load_state(saved)


def test_numbers_without_a_fingerprint_are_refused(saved):
    bare = saved.copy()
    bare[-len(FIXED) :] = 0.0
    with pytest.raises(InputError, match="saved state: is of another scene, with other model, "):
        changed(lambda scene: None).load_state(bare)


def test_a_fingerprint_does_not_depend_on_how_a_scene_is_written():
    written, reordered = everything(), dict(reversed(everything().items()))
    for scene in (written, reordered):
        scene["materials"] = dict(sorted(scene["materials"].items(), reverse=scene is reordered))
    reordered["rods"][0]["width"] = f"{1e3 * written['rods'][0]['width']:.9g} mm"
    one, other = (fingerprint_of(load_scene(scene), "two_rod", "") for scene in (written, reordered))
    np.testing.assert_array_equal(one, other)
    assert one.shape == (len(FIXED),) and len(set(one.tolist())) == len(FIXED)
    assert np.all(one == np.floor(one)) and one.max() < 2.0**53
