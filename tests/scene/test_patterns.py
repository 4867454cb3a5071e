"""Patterns of rods: where copies are, what each has of its own, and what is refused."""

import numpy as np
import pytest
from support.sample_scenes import contact, fixed, layer, rod, scene

from bilayer_core import load_scene
from bilayer_core.cli import main
from bilayer_core.errors import SceneError
from bilayer_core.model.edge_figures import EdgeFigures
from bilayer_core.model.plan import best_dimension, make_plan
from bilayer_core.scene.loader import scene_text
from bilayer_core.scene.pattern import pair_at_one_place
from bilayer_core.scene.text import read_yaml

CHANNELS = {name: {"schedule": {"type": "hold", "value": 0.5}} for name in ("heat", "left", "right")}
GROWING = {"stimulus": "heat", "gain": 0.01}
SHIFT, ROW = [0, 0.02, 0], [0, 0, 0.03]
TWO = {
    "rotation": {"type": "rotation", "count": 2},
    "translation": {"type": "translation", "step": SHIFT, "count": 2},
    "grid": {"type": "grid", "steps": [SHIFT, ROW], "counts": [2, 1]},
    "mirror": {"type": "mirror", "axis": [1, 0, 0], "center": [-0.01, 0, 0]},
    "list": {"type": "list", "placements": [{}, {"rotation": [0, 0, 3], "position": [0, 0, 0.02]}]},
}
"""Two copies by each type."""


def content(pattern, **more):
    arm = rod([layer("passive"), layer("active", eigenstrain=GROWING)], name="arm", pattern=pattern, **more)
    return scene([arm], stimuli=CHANNELS, bodies=[fixed("hub"), fixed("wall", (0, 0, 1))])


def arm_of(pattern, **more):
    return load_scene(content(pattern, **more)).rods[0]


def starts(pattern):
    arm = arm_of(pattern)
    return np.array([copy.place.points(np.array([0.01, 0.0, 0.0])) for copy in arm.copies])


def test_a_pattern_without_a_type_turns_copies_evenly_about_an_axis():
    assert arm_of({"count": 4}).pattern == arm_of({"type": "rotation", "count": 4}).pattern
    np.testing.assert_array_equal(starts({"count": 4}), [[0.01, 0, 0], [0, 0.01, 0], [-0.01, 0, 0], [0, -0.01, 0]])


def test_copies_may_be_turned_by_a_given_angle():
    third = starts({"count": 3, "angle": "30 deg"})[2]
    np.testing.assert_allclose(third, [0.005, 0.01 * np.sqrt(0.75), 0], atol=1e-17)


def test_a_grid_counts_along_its_first_step_first():
    grid = starts({"type": "grid", "steps": [SHIFT, ROW], "counts": [3, 2]})
    np.testing.assert_allclose(grid, [[0.01, 0.02 * (k % 3), 0.03 * (k // 3)] for k in range(6)], atol=1e-17)
    cube = starts({"type": "grid", "steps": [SHIFT, ROW, [0.5, 0, 0]], "counts": [2, 2, 2]})
    assert len(cube) == 8 and np.allclose(cube[7], [0.51, 0.02, 0.03])


def test_a_mirror_image_lies_as_far_behind_the_mirror():
    np.testing.assert_allclose(starts(TWO["mirror"])[1], [-0.03, 0, 0], atol=1e-17)
    assert [copy.place.handedness for copy in arm_of(TWO["mirror"]).copies] == [1.0, -1.0]


@pytest.mark.parametrize("kind", TWO)
def test_a_scene_with_a_pattern_is_written_out_and_read_back(kind):
    pattern = {**TWO[kind], "stimuli": {"heat": ["left", "right"]}, "gains": [1, -2], "clamp_start": ["hub", None]}
    config = load_scene(content(pattern))
    assert load_scene(read_yaml(scene_text(config), "written")) == config


def test_copies_take_channels_gains_and_clamps_of_their_own():
    pattern = {
        **TWO["translation"],
        "stimuli": {"heat": ["left", "right"]},
        "gains": [1, -2],
        "clamp_start": ["hub", None],
    }
    first, second = arm_of(pattern).copies
    laws = [copy.rod.layers[1].eigenstrain[0] for copy in (first, second)]
    assert [(law.stimulus, law.gain) for law in laws] == [("left", 0.01), ("right", -0.02)]
    assert [copy.rod.clamp_start for copy in (first, second)] == ["hub", None]
    assert [copy.name for copy in (first, second)] == ["arm_0", "arm_1"]


def test_figures_of_a_pattern_are_those_of_its_strongest_copy():
    config = load_scene(content({**TWO["translation"], "gains": [1, -3]}))
    assert EdgeFigures(config, config.rods[0]).eigenstrain.max() == pytest.approx(0.03)
    np.testing.assert_allclose(EdgeFigures(config, config.rods[0]).eigenstrain_range[:, 1, 0], [-0.03, 0.01])


def test_a_count_can_be_overridden():
    assert len(load_scene("gripping", ["rods.arm.pattern.count=3"]).rods[0].copies) == 3
    row = load_scene(content(TWO["translation"]), ["rods.arm.pattern.count=5"])
    assert row.rods[0].copy_names == [f"arm_{k}" for k in range(5)]


@pytest.mark.parametrize(
    ("pattern", "fault"),
    [
        ({"count": 0}, ".count: found 0; must be a whole number of at least 1"),
        ({"count": 2, "angle": 0}, ".angle: found 0.0; must not be zero: all copies would lie on each other"),
        ({"cuont": 2, "count": 2}, ".cuont: unknown key, did you mean count?; allowed are "),
        ({"type": "lst"}, ": found {\"type\": \"lst\"}; `type` must be one of 'rotation', 'translation', 'grid', "),
        ({"type": "translation", "count": 2}, ".step: is missing; must be a list"),
        ({"type": "translation", "step": SHIFT, "count": 0}, ".count: found 0; must be a whole number of at least 1"),
        ({"type": "translation", "step": [0, 0, 0], "count": 2}, ".step: found [0, 0, 0]; must not be zero: all"),
        ({"type": "grid", "steps": [SHIFT], "counts": [2, 2]}, ".steps: found [[0, 0.02, 0]]; must have at least 2"),
        ({**TWO["grid"], "counts": [1, 1, 2]}, '.counts: found "3 entries"; must be as many as `steps`, 2'),
        ({"type": "mirror"}, ".axis: is missing; must be a list"),
        ({"type": "mirror", "axis": [0, 0, 0]}, ".axis: found [0, 0, 0]; must be a direction, with a length above 0"),
        ({"type": "mirror", "axis": [1, 0, 0], "count": 2}, ".count: unknown key"),
        ({"type": "list", "placements": []}, ".placements: found []; must have at least 1 entries, has 0"),
        ({**TWO["list"], "placements": [{"positoin": SHIFT}]}, ".placements[0].positoin: unknown key, did you mean"),
        # what each copy has
        ({"count": 2, "gains": [1]}, '.gains: found "1 entries"; must have an entry for each of the 2 copies'),
        ({"count": 2, "gains": [1, "x"]}, '.gains[1]: found "x", not a number with a unit; must be a number, such as'),
        ({"count": 2, "clamp_end": ["hub"] * 3}, '.clamp_end: found "3 entries"; must have an entry for each of the 2'),
        ({**TWO["mirror"], "clamp_end": ["hub"]}, '.clamp_end: found "1 entries"; must have an entry for each of'),
        ({"count": 2, "clamp_end": ["hub", "hubb"]}, '.clamp_end[1]: found "hubb"; must be one of the bodies (hub'),
        ({"count": 2, "stimuli": {"heat": ["left"]}}, '.stimuli.heat: found "1 entries"; must have an entry for each'),
        ({"count": 2, "stimuli": {"heat": ["left", "lift"]}}, '.stimuli.heat[1]: found "lift"; must be one of the sti'),
        ({"count": 2, "stimuli": {"hat": ["left"] * 2}}, '.stimuli.hat: found "hat"; must be one of the channels in'),
        ({"count": 2, "gains": [1, -101]}, ".gains: found [1.0, -101.0]; must leave the layer a length: `heat` from 0"),
        # copies that lie on each other
        ({"count": 3, "angle": "360 deg"}, ': found "rotation"; must leave no copy where another is: arm_1 lies'),
        ({"count": 2, "axis": [1, 0, 0]}, ': found "rotation"; must leave no copy where another is: arm_1 lies'),
        ({"type": "mirror", "axis": [0, 1, 0]}, ': found "mirror"; must leave no copy where another is: arm_1 lies on'),
        ({"type": "mirror", "axis": [1, 0, 0], "center": [0.05, 0, 0]}, ': found "mirror"; must leave no copy where'),
        ({"type": "list", "placements": [{}, {"position": SHIFT}, {}]}, ': found "list"; must leave no copy where ano'),
    ],
)
def test_a_fault_of_a_pattern_is_told_with_its_place_the_value_found_and_what_is_allowed(pattern, fault):
    with pytest.raises(SceneError) as refused:
        load_scene(content(pattern))
    assert f"scene: rods.arm.pattern{fault}" in str(refused.value), refused.value


@pytest.mark.parametrize("seed", range(40))
def test_copies_that_lie_on_each_other_are_found_as_by_comparing_all(seed):
    rng = np.random.default_rng(seed)
    copies = rng.normal(size=(rng.integers(1, 12), 5, 3)) + 1e6 * rng.integers(-1, 2)
    copies -= copies[:, 2:3] * rng.integers(0, 2)  # of half the cases the middles are all at one place
    for _ in range(rng.integers(0, 3)):
        one, other = rng.integers(len(copies), size=2)
        copies[other] = copies[one][:: rng.choice([-1, 1])] + rng.uniform(-0.9e-3, 0.9e-3, 3)

    def on_each_other(one, other):
        return min(np.abs(one - other).max(), np.abs(one - other[::-1]).max()) <= 1e-3

    pairs = {
        (first, second)
        for second in range(len(copies))
        for first in range(second)
        if on_each_other(copies[first], copies[second])
    }
    found = pair_at_one_place(copies, 1e-3)
    assert found in pairs if pairs else found is None


def test_a_clamp_of_all_copies_and_one_of_each_contradict():
    with pytest.raises(SceneError, match=r'rods.arm.clamp_start: found "hub"; must be left out where `pattern.clamp_s'):
        load_scene(content({"count": 2, "clamp_start": ["hub", "wall"]}, clamp_start="hub"))


def test_gains_of_a_rod_that_does_not_grow_are_refused():
    stiff = rod([layer()], name="arm", pattern={"count": 2, "gains": [1, 2]})
    with pytest.raises(SceneError, match=r"pattern.gains: found \[1.0, 2.0\]; must be left out: no layer has an eigen"):
        load_scene(scene([stiff]))


def test_several_faults_of_patterns_are_told_at_once():
    pattern = {**TWO["translation"], "stimuli": {"heat": ["lift", "left"]}, "clamp_start": ["hubs", "hub"]}
    with pytest.raises(SceneError) as refused:
        load_scene(content(pattern))
    assert len(str(refused.value).splitlines()) == 2


PLANAR = {
    "rotation": ({"count": 2}, 2),
    "rotation about y": ({"count": 3, "axis": [0, 1, 0]}, 2),
    "rotation out of it": ({"count": 4}, "rods.arm_1 leaves the plane y = 0"),
    "translation": ({"type": "translation", "step": [0, 0, 0.02], "count": 3}, 2),
    "translation out of it": ({"type": "translation", "step": SHIFT, "count": 3}, "rods.arm_1 leaves the plane y = 0"),
    "grid": ({"type": "grid", "steps": [[0, 0, 0.02], [0.2, 0, 0]], "counts": [2, 2]}, 2),
    "grid out of it": ({"type": "grid", "steps": [[0.2, 0, 0], SHIFT], "counts": [2, 2]}, "rods.arm_2 leaves"),
    "mirror": ({"type": "mirror", "axis": [1, 0, 1], "center": [-0.01, 0, 0]}, 2),
    "mirror out of it": ({"type": "mirror", "axis": [1, 1, 0]}, "rods.arm_1 leaves the plane y = 0"),
    "list": ({"type": "list", "placements": [{"position": SHIFT}, {"position": [0.2, 0.02, 0]}]}, 2),
    "list out of it": (TWO["list"], "rods.arm_1 leaves the plane y = 0"),
}


@pytest.mark.parametrize("case", PLANAR)
def test_the_plane_of_a_scene_is_that_of_all_copies(case):
    pattern, expected = PLANAR[case]
    dimension, reason = best_dimension(load_scene(content(pattern)))
    assert dimension == 2 if expected == 2 else (dimension == 3 and expected in reason), reason


def test_clamps_of_copies_keep_rods_apart_or_not():
    def pairs(step, **clamps):
        held = content({"type": "translation", "step": step, "count": 2, **clamps}) | {"contact": contact()}
        return make_plan(load_scene(held))

    near, far = [0, 0, 0.02], [0, 0, 1.0]
    assert len(pairs(near, clamp_start=["hub", "hub"]).contact_pairs) == 1
    apart = pairs(far, clamp_start=["hub", "wall"])
    assert apart.contact_pairs == () and "arm – its copies: held 79" in apart.terms["rod barrier"]
    assert len(pairs(far, clamp_start=["hub", None]).contact_pairs) == 1


def test_check_says_how_many_copies_there_are_what_holds_and_what_drives_them(tmp_path, capsys):
    own = {"stimuli": {"heat": ["left", "right"]}, "gains": [1, -2], "clamp_start": ["hub", "wall"]}
    path = tmp_path / "row.yaml"
    path.write_text(scene_text(load_scene(content({**TWO["translation"], **own}))))
    assert main(["check", str(path)]) == 0
    text = capsys.readouterr().out
    assert "2 of them, each 100 mm long" in text and "start held by hub and wall" in text
    assert "copy by copy: heat is left and right; gain times 1 and -2" in text
