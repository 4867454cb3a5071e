"""Eigenstrain laws as scenes state them."""

import numpy as np
import pytest
from support.sample_scenes import layer, rod, scene

from bilayer_core import load_scene
from bilayer_core.errors import SceneError
from bilayer_core.model.build_model import build_model
from bilayer_core.model.validity import validity_warnings
from bilayer_core.scene.eigenstrain import LAWS
from bilayer_core.scene.loader import parse_scene, scene_text
from bilayer_core.scene.transduction import free_strain

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


def limited(*laws, **more):
    """Lines of the error that refuses a layer with these laws; none if it is accepted."""
    content = driven(list(laws), **more)
    content["rods"][0]["section"] = "strip" if more else "auto"
    try:
        load_scene(content)
    except SceneError as error:
        return str(error).splitlines()
    return []


def of(stimulus, gain, **more):
    return {"stimulus": stimulus, "gain": gain, **more}


def test_an_eigenstrain_that_would_leave_a_layer_no_length_is_refused():
    (told,) = limited(of("humidity", -1.5))
    assert told.startswith(
        f"{PLACE}[0].gain: found -1.5; must leave the layer a length: `humidity` from 0 to 1 [1] can"
    )
    assert "take its eigenstrain to -150 %; allowed is above -100 %, by a smaller gain, a `saturation` below 1" in told


@pytest.mark.parametrize(
    ("laws", "reached"),
    [
        ([of("humidity", -0.999)], None),
        ([of("humidity", -1)], "-100 %"),
        ([of("heat", 1)], "-100 %"),  # heat goes down to -1
        ([of("humidity", 3)], None),  # grows, however much
        ([of("humidity", 0.6, reference=1.7)], "-102 %"),
        ([of("humidity", -5, saturation=0.99)], None),
        ([of("humidity", -5, saturation=1.2)], "-119.9 %"),
        ([of("humidity", -0.6), of("heat", 0.5)], "-110 %"),
        ([of("humidity", -0.6), of("heat", 0.39)], None),
        ([of("humidity", -0.6, interval=[0, 0.05]), of("heat", 0.5, interval=[0.05, 0.1])], None),
        ([of("humidity", -0.6, interval=[0, 0.06]), of("heat", 0.5, interval=[0.05, 0.1])], "-110 %"),
        ([of("humidity", -2), of("humidity", 1.1)], None),  # in step: -90 % at most
        ([of("humidity", -2), of("humidity", 1.1, time_constant=1)], "-200 %"),  # the second lags behind
        ([of("heat", 3, saturation=0.9), of("heat", -0.8)], None),
        ([of("humidity", -12, saturation=3), of("humidity", 2.5)], "-178.1 %"),  # in between: -50 % at the end
    ],
)
def test_the_least_rest_length_counts_laws_where_and_when_they_meet(laws, reached):
    told = limited(*laws)
    assert len(told) == (reached is not None)
    assert reached is None or f"can take its eigenstrain to {reached};" in told[0]
    assert len(laws) == 1 or reached is None or "with the laws that act there too" in told[0]


@pytest.mark.parametrize(
    ("along", "across", "gain", "reached"),
    [
        (1.0, 0.5, -0.999, None),
        (0.0, 2.0, -0.6, "-120 %"),
        (0.2, 0.5, -1.5, None),
        (1.0, -2.0, 0.7, "-140 %"),
    ],
)
def test_the_least_rest_length_counts_what_fibres_multiply(along, across, gain, reached):
    fibres = {"angle": 0.4, "along": {"swelling": along}, "across": {"swelling": across}}
    told = limited(of("humidity", gain), fibres=fibres)
    assert len(told) == (reached is not None)
    assert reached is None or f"can take its eigenstrain to {reached};" in told[0]


@pytest.mark.parametrize("model", ["laminate", "two_rod"])
def test_every_edge_of_a_model_keeps_a_rest_length_at_the_ends_of_what_is_accepted(model):
    built = build_model(load_scene(driven([of("humidity", -0.6), of("heat", 0.39)])), model)
    least = np.minimum(built.drives.law_gain * [0.0, -1.0], built.drives.law_gain * [1.0, 1.0])
    strain = built.drives.rest_strain.copy()
    np.add.at(strain, built.drives.driven_edge, built.drives.driven_weight * least[built.drives.driven_law])
    assert strain.min() > -1.0
    assert strain.min() == pytest.approx({"laminate": -0.495, "two_rod": -0.99}[model])


def test_strains_of_scenes_are_those_of_kernels():
    values = np.linspace(-1, 1, 21)
    for saturation in (None, 0.05):
        law = laws_of(of("heat", 0.3, reference=0.2, saturation=saturation))[0]
        np.testing.assert_array_max_ulp(law.strain_at(values), free_strain(values, 0.3, 0.2, law.limit), 2)


def test_adjoining_intervals_cover_each_edge_of_the_layer_once():
    strip = load_scene(
        driven(
            [
                {"stimulus": "heat", "gain": 0.1, "interval": ends}
                for ends in ([0, 0.0125], [0.0125, 0.061], [0.061, 0.1])
            ],
            interval=[0.005, 0.09],
        )
    ).rods[0]
    edges, grown = np.arange(strip.stations - 1), strip.layers[1]
    parts = [strip.covered_parts(edges, grown, law) for law in grown.eigenstrain]
    assert sum(parts) == pytest.approx(strip.covered_parts(edges, grown))
    assert [part.sum() for part in parts] == pytest.approx(np.array([7.5, 48.5, 29.0]) / (1e3 * strip.edge_length))
    assert [list(np.flatnonzero(part)) for part in parts] == [
        list(strip.driven_edges(grown, law)) for law in grown.eigenstrain
    ]


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
            ".gian: unknown key, did you mean gain?; allowed are stimulus, gain, reference",
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
            {"stimulus": "humidity", "gain": 1, "interval": [0.05, 0.05]},
            ".interval: found [0.05, 0.05]; must be two increasing lengths [m] along the path, from 0 to 0.1",
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
        load_scene(driven({"stimulus": "heat", "gain": 0.1}), ["rods.rod.layers.active.eigenstrain.law=current_sma"])


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
    assert any(
        f"eigenstrain up to {percent} %" in str(figure) for figure in validity_warnings(load_scene(driven(laws)))
    )


def test_a_law_that_misses_its_layer_is_refused_however_near_it_is():
    for interval in ([0.0491, 0.0493], [0.06, 0.07]):
        content = driven({"stimulus": "heat", "gain": 0.1, "interval": interval}, interval=[0.005, 0.049])
        with pytest.raises(SceneError, match="interval: found .* must hold a part of the layer"):
            load_scene(content)
