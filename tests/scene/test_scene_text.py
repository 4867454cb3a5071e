import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.sample_scenes import everything, layer, rod, scene

from bilayer_core import load_scene
from bilayer_core.errors import SceneError
from bilayer_core.scene.bundled import bundled_scenes
from bilayer_core.scene.loader import parse_scene, scene_text


@pytest.mark.parametrize("name", bundled_scenes())
def test_a_bundled_scene_is_read_back_the_same_from_its_text(name):
    config = load_scene(name)
    assert parse_scene(scene_text(config), "text") == config


@pytest.mark.parametrize("name", bundled_scenes())
def test_a_bundled_scene_has_the_name_of_its_file(name):
    assert load_scene(name).name == name


def test_a_scene_with_every_part_is_read_back_the_same_from_its_text():
    config = load_scene(everything())
    assert parse_scene(scene_text(config), "text") == config


@pytest.mark.parametrize("title", ["next\x85line", "\u2028 \ufeff: #", "😀 - 中\xa0", "yes", "~", "1e5"])
def test_any_title_is_read_back_the_same_from_its_text(title):
    config = load_scene(scene([rod([layer()])], title=title))
    assert parse_scene(scene_text(config), "text").title == title


@given(
    st.tuples(*[st.floats(-1e3, 1e3)] * 3).filter(lambda v: math.hypot(*v) > 1e-6),
    st.floats(1e-9, 1e9, exclude_min=True),
)
def test_directions_and_numbers_are_read_back_bit_for_bit(direction, number):
    content = scene([rod([layer()])], gravity=[number, -number, 0.0])
    content["obstacles"] = [{"name": "slope", "type": "plane", "point": [0, 0, -1], "normal": list(direction)}]
    content["contact"] = {"barrier_distance": 1e-3, "stiffness": number}
    config = load_scene(content)
    assert parse_scene(scene_text(config), "text") == config
    assert math.hypot(*config.obstacles[0].normal) == pytest.approx(1.0, abs=1e-15)


def test_the_text_states_the_values_that_the_scene_left_out():
    text = scene_text(load_scene(scene([rod([layer()])])))
    assert "max_halvings: null" in text and "marker_rate: 20.0" in text


@pytest.mark.parametrize(
    ("text", "remedy"),
    [("a: 1\n\tb: 2\n", "indented with spaces"), ("title: a: b\n", "text with a colon needs quotes")],
)
def test_common_slips_are_told_with_their_remedy(text, remedy):
    with pytest.raises(SceneError, match=remedy):
        parse_scene(text, "scene.yaml")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("schema: 1\nname: a\nname: b\n", "scene.yaml:3:1: is not readable YAML: the key 'name' occurs twice"),
        ("solver:\n  {dt: 1, dt: 2}\n", "scene.yaml:2:11: is not readable YAML: the key 'dt' occurs twice"),
        ("rods: [1, 2\nname: x\n", "scene.yaml:2:5: is not readable YAML"),
        ("a: !!python/object:os.system {}\n", "scene.yaml:1:4: is not readable YAML"),
        ("", "scene.yaml: is empty; `bilayer new FILE`"),
        ("- 1\n", "scene.yaml: found list; must be a mapping"),
    ],
)
def test_text_that_is_no_mapping_of_yaml_is_refused_with_its_place(text, message):
    with pytest.raises(SceneError) as refused:
        parse_scene(text, "scene.yaml")
    assert str(refused.value).startswith(message)


def test_keys_merged_from_an_anchor_do_not_occur_twice():
    text = scene_text(load_scene(everything())).replace(
        "damping: {mass: 2.0}", "damping: &base {mass: 2.0}\ncoupling: {<<: {twist: 10.0}, twist: 4.0}"
    )
    text = "\n".join(line for line in text.splitlines() if not line.startswith("coupling: {translation"))
    assert parse_scene(text, "text").coupling.twist == 4.0


@pytest.mark.parametrize(
    ("content", "message"),
    [(None, "No such file"), (b"\xff\xfe", "is not UTF-8 text"), ("directory", "is a directory, not a file")],
)
def test_a_file_that_cannot_be_read_is_named_with_the_reason(tmp_path, content, message):
    path = tmp_path / "robot.yaml"
    if content == "directory":
        path.mkdir()
    elif content is not None:
        path.write_bytes(content)
    with pytest.raises(SceneError, match=f"robot.yaml: .*{message}"):
        load_scene(path)
