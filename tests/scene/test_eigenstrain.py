"""Eigenstrain laws as scenes state them."""

import pytest
from sample_scenes import layer, rod, scene

from bilayer_core import load_scene
from bilayer_core.errors import SceneError
from bilayer_core.model.validity import validity_warnings
from bilayer_core.scene.eigenstrain import LAWS
from bilayer_core.scene.loader import parse_scene, scene_text

CHANNELS = {
    "humidity": {"schedule": {"type": "hold", "value": 0}},
    "heat": {"minimum": -1, "schedule": {"type": "hold", "value": 0}},
}
PLACE = "scene: rods.rod.layers.active.eigenstrain"


def driven(laws, **more):
    strip = rod([layer("passive"), layer("active", eigenstrain=laws, **more)], length=0.1, stations=21)
    return scene([strip], stimuli=CHANNELS)


def laws_of(laws):
    return load_scene(driven(laws)).rods[0].layers[1].eigenstrain


@pytest.mark.parametrize("name", LAWS)
def test_a_law_stands_for_its_numbers_and_the_text_of_the_scene_states_them(name):
    by_name = load_scene(driven({"stimulus": "humidity", "law": name}))
    by_number = load_scene(driven({"stimulus": "humidity", **LAWS[name]}))
    assert by_name == by_number
    assert parse_scene(scene_text(by_name), "text") == by_name


def test_every_number_of_a_law_can_be_stated_otherwise():
    changes = {"gain": 0.07, "saturation": None, "time_constant_falling": 9.0, "reference": 0.3}
    (law,) = laws_of({"stimulus": "humidity", "law": "humidity_hydrogel", **changes})
    rising = LAWS["humidity_hydrogel"]["time_constant_rising"]
    assert (law.gain, law.saturation, law.lags, law.reference) == (0.07, None, (rising, 9.0), 0.3)


def test_one_time_constant_replaces_both_of_a_law():
    (law,) = laws_of({"stimulus": "heat", "law": "light_photothermal", "time_constant": "20 ms"})
    assert law.lags == (0.02, 0.02)


def test_one_law_is_written_without_a_list_and_several_are_read_back_the_same():
    one, two = {"stimulus": "humidity", "gain": 0.01}, {"stimulus": "heat", "gain": 0.02, "interval": [0, 0.05]}
    assert laws_of(one) == laws_of([one])
    config = load_scene(driven([one, two]), ["rods.rod.layers.active.eigenstrain.1.gain=0.03"])
    assert [law.gain for law in config.rods[0].layers[1].eigenstrain] == [0.01, 0.03]
    assert parse_scene(scene_text(config), "text") == config


def test_adjoining_intervals_share_no_edge_and_leave_none_out():
    strip = load_scene(
        driven(
            [
                {"stimulus": "heat", "gain": 1, "interval": ends}
                for ends in ([0, 0.0125], [0.0125, 0.061], [0.061, 0.1])
            ],
            interval=[0.005, 0.09],
        )
    ).rods[0]
    edges = [list(strip.driven_edges(strip.layers[1], law)) for law in strip.layers[1].eigenstrain]
    # The middle of edge 2 lies at 12.5 mm: rounding may give it to either interval, but to one of them.
    assert edges[0][0] == 1
    assert sum(edges, []) == list(range(1, 18))


@pytest.mark.parametrize(
    ("laws", "fault"),
    [
        (
            {"stimulus": "humidity", "law": "humidity_hydrogle"},
            '.law: found "humidity_hydrogle"; must be one of the laws (humidity_hydrogel, temperature_elastomer, '
            "light_photothermal, current_sma), did you mean humidity_hydrogel?",
        ),
        ({"stimulus": "humidity"}, ".gain: is missing; must be a number, such as 0.5"),
        (
            {"stimulus": "humidity", "gain": 1, "gian": 1},
            ".gian: unknown key, did you mean gain?; allowed are stimulus, law, gain",
        ),
        ({"stimulus": "humidity", "gain": "1 mm"}, '.gain: found "1 mm", a quantity in m; must be a number'),
        ({"stimulus": "humidity", "gain": 1, "saturation": 0}, ".saturation: found 0; must be a number above 0"),
        (
            {"stimulus": "humidity", "gain": 1, "time_constant_rising": -1},
            ".time_constant_rising: found -1; must be a time [s] at least 0",
        ),
        (
            {"stimulus": "humidity", "gain": 1, "time_constant": 1, "time_constant_falling": 2},
            ".time_constant: found 1.0; must be left out where `time_constant_falling` is given",
        ),
        (
            {"stimulus": "humidity", "gain": 1, "interval": [0.05, 0.02]},
            ".interval: found [0.05, 0.02]; must be two increasing lengths [m] along the path, from 0 to 0.1",
        ),
        (
            {"stimulus": "humidity", "gain": 1, "interval": [0.05, 0.2]},
            ".interval: found [0.05, 0.2]; must be two increasing lengths [m] along the path, from 0 to 0.1",
        ),
        (
            {"stimulus": "humidity", "gain": 1, "interval": [0.0501, 0.052]},
            ".interval: found [0.0501, 0.052]; must hold the middle of an edge of the layer; an edge is 0.005 m long",
        ),
        (
            [{"stimulus": "heat", "gain": 1}, {"stimulus": "humid", "gain": 1}],
            '[1].stimulus: found "humid"; must be one of the stimuli (humidity, heat), did you mean humidity?',
        ),
        ([{"stimulus": "heat", "gain": 1}, {"stimulus": "heat"}], "[1].gain: is missing; must be a number"),
        (3, ": found 3; must be a list"),
    ],
)
def test_a_fault_of_a_law_is_told_with_its_place(laws, fault):
    with pytest.raises(SceneError) as refused:
        load_scene(driven(laws))
    assert str(refused.value).startswith(PLACE + fault)


def test_a_law_is_no_key_to_override_once_its_numbers_are_stated():
    with pytest.raises(SceneError, match="there is no law of rods.rod.layers.active.eigenstrain"):
        load_scene(driven({"stimulus": "heat", "gain": 1}), ["rods.rod.layers.active.eigenstrain.law=current_sma"])


@pytest.mark.parametrize(
    ("laws", "percent"),
    [
        ([{"stimulus": "heat", "gain": 0.2, "reference": 0.5}], "30"),
        ([{"stimulus": "humidity", "gain": 5, "saturation": 0.15}], "15"),
        ([{"stimulus": "heat", "gain": 0.12, "interval": [0, 0.06]}, {"stimulus": "humidity", "gain": 0.1}], "22"),
        (
            [
                {"stimulus": "heat", "gain": 0.12, "interval": [0, 0.05]},
                {"stimulus": "heat", "gain": 0.1, "interval": [0.05, 0.1]},
            ],
            "12",
        ),
    ],
)
def test_the_largest_eigenstrain_of_a_layer_counts_laws_where_they_meet(laws, percent):
    assert any(f"eigenstrain up to {percent} %" in text for text in validity_warnings(load_scene(driven(laws))))
