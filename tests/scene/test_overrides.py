import pytest
from support.sample_scenes import everything

from bilayer_core import load_scene
from bilayer_core.errors import SceneError


def test_an_override_changes_its_value_and_no_other():
    plain, changed = load_scene(everything()), load_scene(everything(), ["rods.arm.stations=7"])
    assert changed.rods[0].stations == 7
    assert changed.model_copy(update={"rods": plain.rods}) == plain


@pytest.mark.parametrize(
    ("override", "read", "value"),
    [
        ("rods.arm.layers.active.eigenstrain.gain=5 %", lambda s: s.rods[0].layers[1].eigenstrain[0].gain, 0.05),
        ("rods.0.layers.1.thickness=2 mm", lambda s: s.rods[0].layers[1].thickness, 2e-3),
        ("gravity.2=-1 m/s^2", lambda s: s.gravity[2], -1.0),
        ("bodies.ball.position=[0, 0, 30 mm]", lambda s: s.bodies[1].position, (0.0, 0.0, 0.03)),
        ("contact.friction=null", lambda s: s.contact.friction, None),
        ("output.rate=1e2", lambda s: s.output.rate, 100.0),
        ("stimuli.humidity.schedule={type: hold, value: 1}", lambda s: s.stimuli["humidity"].schedule.value(0), 1.0),
        ("fluid.added_mass=false", lambda s: s.fluid.added_mass, None),
        ("fluid.added_mass={through: 2}", lambda s: s.fluid.added_mass.through, 2.0),
        ("fluid.added_mass=true", lambda s: s.fluid.added_mass.sideways, 1.0),
        ("title=a = b", lambda s: s.title, "a = b"),
    ],
)
def test_items_are_addressed_by_name_or_index_and_defaults_as_well(override, read, value):
    assert read(load_scene(everything(), [override])) == value


def test_overrides_that_need_each_other_are_validated_together():
    config = load_scene(everything(), ["stimuli.humidity.maximum=3", "stimuli.humidity.schedule.value=2"])
    assert config.stimuli["humidity"].schedule.value(0.0) == 2.0


def test_of_two_overrides_of_one_value_the_later_counts():
    assert load_scene(everything(), ["duration=3", "duration=4"]).duration == 4.0


@pytest.mark.parametrize(
    ("override", "fault"),
    [
        ("rods.arm.station=7", "there is no station of rods.arm, did you mean stations?; there are name, width"),
        ("rods.leg.stations=7", "there is no leg of rods; there are arm"),
        ("gravity.3=1", "there is no 3 of gravity; there are 0, 1, 2"),
        ("durration=1", "there is no durration, did you mean duration?"),
        ("duration.s=1", "duration is a single value and has no s"),
        ("rods.arm.layers.passive.eigenstrain.gain=1", "eigenstrain is not given in this scene; set it as a whole"),
        ("duration", "must be PATH=VALUE"),
        ("=1", "must be PATH=VALUE"),
        ("rods..stations=1", "must be PATH=VALUE"),
        ("duration=[1", "is not readable YAML"),
        ("duration=1 kg", 'scene with duration=1 kg: duration: found "1 kg", a quantity in kg'),
        ("rods.arm.layers.active.thickness=-1", "rods.arm.layers.active.thickness: found -1; must be a length"),
    ],
)
def test_an_override_that_cannot_be_is_refused_with_the_reason(override, fault):
    with pytest.raises(SceneError) as refused:
        load_scene(everything(), [override])
    assert fault in str(refused.value)


def test_a_change_of_part_of_another_change_leaves_the_callers_list_as_it_is():
    gravity = [0.0, 0.0, -1.0]
    assert load_scene("bending", {"gravity": gravity, "gravity.2": -2.0}).gravity == (0.0, 0.0, -2.0)
    assert gravity == [0.0, 0.0, -1.0]
