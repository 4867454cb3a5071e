"""Input that means no scene: each ends with one clear message, soon, and never with a crash or a traceback."""

from __future__ import annotations

import os
import re
import resource
import subprocess
import sys
import time

import numpy as np
import pytest
import yaml

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import SceneError
from bilayer_core.scene.faults import MOST_FAULTS
from bilayer_core.scene.limits import DEEPEST, LARGEST_FILE, MOST_COPIES, MOST_NODES, MOST_VALUES
from bilayer_core.scene.text import read_yaml
from bilayer_core.verification.validate.parts import layer, rod, scene

BOMB = "a: &a [1, 1, 1, 1, 1, 1, 1, 1, 1]\n" + "".join(
    f"{name}: &{name} [{', '.join(['*' + last] * 9)}]\n" for last, name in zip("abcdefghi", "bcdefghij", strict=True)
)
LONGEST = 10.0
"""CPU time until an answer [s]."""
LONGEST_LINE = 1000
"""Of a message [characters]."""


def refusal(data, overrides=()):
    begin = time.process_time()
    with pytest.raises(SceneError) as refused:
        load_scene(data, overrides)
    assert time.process_time() - begin < LONGEST
    return str(refused.value)


def written(directory, text):
    path = directory / "scene.yaml"
    if isinstance(text, bytes):
        path.write_bytes(text)
    else:
        path.write_text(text)
    return path


TEXTS = {
    "brackets": ("[" * 100_000, f"more than {DEEPEST} deep"),
    "balanced brackets": ("a: " + "[" * 900 + "]" * 900, f"more than {DEEPEST} deep"),
    "braces": ("{a: " * 100_000, f"more than {DEEPEST} deep"),
    "dashes": ("- " * 100_000, f"more than {DEEPEST} deep"),
    "questions": ("? " * 100_000, f"more than {DEEPEST} deep"),
    "bomb": (BOMB, f"more than {MOST_VALUES} values"),
    "bomb under a key": ("rods:\n" + re.sub("^", "  ", BOMB, flags=re.M), f"more than {MOST_VALUES} values"),
    "alias in itself": ("rods: &a [*a]", "deep inside each other"),
    "mapping in itself": ("rods: &a {rods: *a}", "deep inside each other"),
    "set": ("rods: !!set {a, b}", "the tag 'tag:yaml.org,2002:set' means nothing in a scene"),
    "binary": ("title: !!binary aGk=", "means nothing in a scene"),
    "python": ("title: !!python/object/apply:os.getcwd []", "means nothing in a scene"),
    "no integer": ("duration: !!int foo", ":1:11: is not readable YAML: 'foo' is not a whole number"),
    "no number": ("duration: !!float foo", "'foo' is not a number"),
    "no truth": ("duration: !!bool foo", "'foo' is not true or false"),
    "long integer": ("duration: " + "1" * 5000, "is not a whole number that can be read"),
    "empty": ("", "is empty; `bilayer new FILE` writes a scene"),
    "comment": ("# nothing\n", "is empty"),
    "two documents": ("a: 1\n---\na: 2\n", "begins another document"),
    "list key": ("[a, b]: 1", "a key must be plain text"),
    "twice": ("a: 1\na: 2", "the key 'a' occurs twice"),
    "a number": ("7", "found int; must be a mapping"),
    "control characters": ("schema: 1\ntitle: é\x07", ":2:9: is not readable YAML: the character U+0007 is not"),
    "not utf-8": (b"title: \xff\xfe", "is not UTF-8 text"),
    "a log": (b"\x89MCAP0\r\n\xff\xfe", "is an MCAP log, not a scene"),
    "too large": ("# " + "x" * LARGEST_FILE, "is larger than 2 MB"),
    "many values": ("gravity: [" + "0," * (MOST_VALUES + 1) + "]", f"more than {MOST_VALUES} values"),
}


@pytest.mark.parametrize("name", TEXTS)
def test_text_that_is_no_scene_is_refused_with_the_reason(name, tmp_path):
    text, reason = TEXTS[name]
    assert reason in refusal(written(tmp_path, text))


@pytest.mark.parametrize(
    ("override", "reason"),
    [
        ("title=" + "[" * 100_000, "deep"),
        ("rods=&a [*a]", "deep inside each other"),
        ("duration=1e-80", "below 1e-60, as good as 0"),
        ("duration=" + "9" * 5000, "is not a whole number that can be read"),
        ("rods.strip.stations=100000000", f"at most {MOST_NODES}"),
        ("rods.strip.stations=1" + "0" * 400, f"at most {MOST_NODES}"),
        ("rods.strip.path.length=1e-320", "as good as 0"),
        ("rods.strip.path.length=1e200", "must be a length [m]"),
        ("materials={on: 1}", "materials.on"),
        ("rods.strip.name=" + "x" * 1000, "at most 100 characters"),
        ("rods.strip.path.length=3 dB", "whose unit 'dB' is not known"),
        ("rods.strip.width=1e40", "must be a length [m]"),
        ("rods.strip.path.start=[0, 1e20, 0]", "rods.strip.path.start: found"),
        ("rods.strip.pattern={type: translation, step: [0, 1e20, 0], count: 2}", "must leave all coordinates"),
        ("title=a\udcff", r"override title=a\udcff: is not UTF-8 text: surrogates not allowed at character 2"),
        ("duration=!!int ", "'' is not a whole number that can be read"),
        ("rods." + "9" * 5000 + ".width=1", "there is no 999"),
        ("duration={" + "x" * 900 + ": 1}", "must be a time"),
        ("x" * 5000 + "=1", "there is no xxx"),
        ("y" * 5000, "must be PATH=VALUE"),
    ],
)
def test_an_override_that_cannot_be_is_refused(override, reason):
    text = refusal("cantilever", [override])
    assert reason in text and max(map(len, text.splitlines())) < LONGEST_LINE


@pytest.mark.parametrize("given", [None, 7, 1.5, ["cantilever"], b"cantilever", np.zeros(3)])
def test_what_is_no_path_name_or_mapping_is_refused(given):
    assert f"found {type(given).__name__}; must be the path of a scene file" in refusal(given)


NO_FILES = ["nothing\0here", "nothing\0here.yaml", "x" * 5000 + ".yaml", "/dev/zero", "/proc/self/mem"]


@pytest.mark.parametrize("given", NO_FILES)
def test_a_path_that_is_no_file_is_refused(given):
    assert refusal(given)


def test_directories_and_pipes_are_not_read(tmp_path):
    assert "is a directory, not a file" in refusal(tmp_path)
    pipe = tmp_path / "pipe.yaml"
    os.mkfifo(pipe)
    assert "is a device or a pipe, not a file" in refusal(pipe)


def test_a_mapping_that_contains_itself_is_refused():
    content = scene([rod([layer()])])
    content["rods"][0]["layers"] = content["rods"]
    assert "deep inside each other" in refusal(content)


def test_dates_and_words_for_true_are_text_where_text_is_meant(tmp_path):
    assert read_yaml("title: 2020-13-45", "x") == {"title": "2020-13-45"}
    assert read_yaml("{on: 1, yes: 2, 3: 4, =: 5}", "x") == {"on": 1, "yes": 2, "3": 4, "=": 5}
    assert read_yaml("a: &a {x: 1, y: 2}\nb: {<<: *a, y: 3}", "x") == {"a": {"x": 1, "y": 2}, "b": {"x": 1, "y": 3}}


@pytest.mark.parametrize(
    ("pattern", "reason"),
    [
        ({"type": "rotation", "count": 100_000}, f"at most {MOST_COPIES}"),
        ({"type": "grid", "counts": [1000, 1000], "steps": [[0, 1, 0], [0, 0, 1]]}, "must make at most 1000 copies"),
    ],
)
def test_too_many_copies_are_refused(pattern, reason):
    assert reason in refusal(scene([rod([layer()]) | {"pattern": pattern}]))


def test_text_that_no_file_can_hold_is_refused():
    text = refusal(scene([rod([layer()])], description="a\udcff"))
    assert text == r"scene: the text 'a\\udcff' is not UTF-8: surrogates not allowed"


def test_names_that_became_numbers_are_listed_as_they_are():
    text = refusal(scene([rod([layer()])]), ["rods.rod.name=3", "rods.arm.width=1"])
    assert text.endswith("there is no arm of rods; there are 3")


def test_as_many_copies_as_there_may_be_are_compared_in_time():
    placements = [{"position": [0, 1.0 * k, 0]} for k in range(MOST_COPIES - 1)]
    pattern = {"type": "list", "placements": [*placements, placements[0]]}
    assert f"rod_{MOST_COPIES - 1} lies on rod_0" in refusal(scene([rod([layer()]) | {"pattern": pattern}]))


@pytest.mark.parametrize(
    ("turns", "reason"),
    [(100, 'found "0 m between'), (1e6, "must be at most 200000 times the thickness of the rod, 0.001 m")],
)
def test_a_path_of_many_turns_on_each_other_is_refused_in_time_and_memory(turns, reason):
    arc = {"shape": "arc", "start": [0, 0, 0], "direction": [1, 0, 0], "radius": 0.05, "angle": f"{turns} turns"}
    assert reason in refusal(scene([rod([layer()]) | {"path": arc}]))


def test_as_many_elements_as_a_light_may_have_are_built_in_time():
    light = {"sun": {"light": {"from": [0, 0, 1], "shadow": True}, "schedule": {"type": "hold", "value": 1.0}}}
    sheet = layer(eigenstrain={"stimulus": "sun", "gain": 0.01, "time_constant": 1.0})
    few, many = (scene([rod([sheet], stations=n)], stimuli=light, solver={"model": "auto"}) for n in (7_000, 20_000))
    assert "20000 elements follow lights, and each has 20000 nodes to look at" in refusal(many)
    begin = time.process_time()
    Simulator(load_scene(few))
    assert time.process_time() - begin < LONGEST


def test_points_too_unevenly_spaced_for_a_curve_are_refused():
    path = {"shape": "spline", "points": [[0, 0, 0], [1e-3, 0, 0], [1e20, 1e-3, 0]]}
    text = refusal(scene([rod([layer()]) | {"path": path}]))
    assert "points[1]: found [0.001, 0.0, 0.0]; must be 1e+11 m or more" in text


def test_as_many_rods_that_may_meet_as_there_may_be_are_built_in_time():
    pattern = {"type": "translation", "step": [0, 0.02, 0], "count": MOST_COPIES}
    arms = rod([layer("a"), layer("b")], stations=5, clamp_start="hub") | {"pattern": pattern}
    content = scene([arms], bodies=[{"name": "hub", "position": [0, 0, 0], "motion": {"type": "prescribed"}}])
    content |= {"contact": {"barrier_distance": 1e-3, "stiffness": 1e7, "rods": True}}
    begin = time.process_time()
    Simulator(load_scene(content), model="laminate")
    assert time.process_time() - begin < LONGEST


def test_of_very_many_faults_the_first_are_told():
    lines = refusal(scene([rod([layer()])], masses=[{}] * 5000)).splitlines()
    assert len(lines) == MOST_FAULTS + 1 and lines[-1] == f"scene: and {4 * 5000 - MOST_FAULTS} more faults"


def test_too_many_nodes_are_refused_with_the_memory_that_they_would_take():
    rods = [rod([layer("a"), layer("b")], stations=60_000, name=name) for name in ("left", "right")]
    text = refusal(scene(rods))
    assert "rods.left.stations: found 60000; must be fewer" in text and "240000 nodes, and take about 1.2 GB" in text
    rods = [rod([layer()], stations=3) | {"name": f"r_{k}", "pattern": {"count": 750}} for k in range(2)]
    assert 'found "1500 rods"; must be at most 1000' in refusal(scene(rods))


def test_as_many_nodes_as_are_allowed_are_built_in_time_and_memory():
    code = (
        "import resource, sys\n"
        "from bilayer_core import Simulator, load_scene\n"
        "from bilayer_core.verification.validate.parts import layer, rod, scene\n"
        "strip = rod([layer('a'), layer('b')], length=1e4, stations=100_000)\n"
        "Simulator(load_scene(scene([strip])), model='two_rod')\n"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)\n"
    )
    begin = time.process_time()
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    done = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True, check=True)
    assert resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before < 3 * LONGEST
    assert time.process_time() - begin < LONGEST
    assert int(done.stdout) * 1024 < 2e9


def with_table(directory, file):
    content = scene([rod([layer(eigenstrain={"stimulus": "lamp", "gain": 0.01})])])
    content["stimuli"] = {"lamp": {"schedule": {"type": "csv", "file": file, "value_column": "value"}}}

    return written(directory, yaml.safe_dump(content))


@pytest.mark.parametrize("file", ["/etc/passwd", "../other.csv", "a/../../other.csv", "", "a\0b"])
def test_a_table_outside_of_the_scenes_folder_is_neither_read_nor_quoted(tmp_path, file):
    (tmp_path / "other.csv").write_text("unheard_of,time\n1,2\n")
    inside = tmp_path / "inside"
    inside.mkdir()
    text = refusal(with_table(inside, file))
    assert "unheard_of" not in text and "root:" not in text
    assert "stimuli.lamp.schedule.file" in text


def test_a_table_below_the_scenes_folder_is_read(tmp_path):
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "lamp.csv").write_text("time,value\n0,0\n1,1\n")
    assert load_scene(with_table(tmp_path, "data/../data/lamp.csv")).stimuli["lamp"].schedule.values == [0.0, 1.0]


def test_a_table_that_is_a_directory_or_too_large_is_refused(tmp_path):
    (tmp_path / "data").mkdir()
    assert "it is a directory, not a file" in refusal(with_table(tmp_path, "data"))
    (tmp_path / "large.csv").write_text("time,value\n" + "0,0\n" * 800_000)
    assert "it is larger than 3 MB" in refusal(with_table(tmp_path, "large.csv"))


def test_the_largest_table_is_read_in_time(tmp_path):
    lines = "".join(f"{k},0.5\n" for k in range(250_000))
    (tmp_path / "lamp.csv").write_text("time,value\n" + lines)
    begin = time.process_time()
    assert len(load_scene(with_table(tmp_path, "lamp.csv")).stimuli["lamp"].schedule.values) == 250_000
    assert time.process_time() - begin < LONGEST


@pytest.mark.parametrize("value", ["name\nname", "a\r\nb", "x\u2028y", "tab\there", "\x1b[31mred"])
def test_what_an_override_holds_breaks_no_line_of_a_message(value):
    told = refusal(scene([rod([layer()])]), [f"schema={value}"])
    assert len(told.splitlines()) == 1 and told.isprintable()
