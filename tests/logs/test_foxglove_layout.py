"""The layout for Foxglove names what the gripper's node and log have."""

import json
import re

import pytest
from rosbags.typesys import Stores, get_typestore

from bilayer_core import Simulator, load_scene
from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_core.log.messages.cdr import read_float64_multi_array
from bilayer_core.log.run.log_reader import read_messages

LIVE = {"/diagnostics"}
"""Topics of the node alone."""


@pytest.fixture(scope="module")
def layout(root):
    return json.loads((root / "config/foxglove.json").read_text())


@pytest.fixture(scope="module")
def messages(tmp_path_factory):
    """Type of each topic of a log of the gripper, and its last message if there is one."""
    path = tmp_path_factory.mktemp("foxglove") / "run.mcap"
    Simulator(load_scene("gripping")).run(0.02, observers=[McapRecorder(path)])
    return {topic: (ros_type, data) for topic, ros_type, _, data in read_messages(path)}


def panels_of(node):
    """Panels in the order of the layout, whose inner nodes have two children each."""
    if isinstance(node, str):
        return [node]
    assert set(node) == {"direction", "first", "second", "splitPercentage"} and node["direction"] in ("row", "column")
    return panels_of(node["first"]) + panels_of(node["second"])


def test_every_panel_of_the_layout_has_its_place_and_its_settings(layout):
    assert set(layout) == {"configById", "globalVariables", "userNodes", "playbackConfig", "layout"}
    assert sorted(panels_of(layout["layout"])) == sorted(layout["configById"])
    kinds = {name.partition("!")[0] for name in layout["configById"]}
    assert kinds == {"3D", "Plot", "RosOut", "DiagnosticSummary"}  # Foxglove's names of them


def test_every_topic_of_the_layout_is_in_a_log(layout, messages):
    named = {topic for panel in layout["configById"].values() for topic in panel.get("topics", ())}
    named |= {panel["topicToRender"] for panel in layout["configById"].values() if "topicToRender" in panel}
    assert named - LIVE and named - LIVE <= messages.keys()


def test_every_curve_of_the_layout_is_a_number_with_its_name_in_a_log(layout, messages):
    typestore, seen = get_typestore(Stores.ROS2_KILTED), []
    for name, panel in layout["configById"].items():
        for path in panel.get("paths", ()):
            topic, fields = re.fullmatch(r"([\w/]+)\.(.+)", path["value"]).groups()
            ros_type, data = messages[topic]
            value = typestore.deserialize_cdr(data, ros_type)
            for field, index in re.findall(r"(\w+)(?:\[(\d+)\])?", fields):
                value = getattr(value, field)
                value = value[int(index)] if index else value
            assert isinstance(float(value), float)
            if "[" in fields and "solver" not in name:
                assert read_float64_multi_array(data)[0][int(index)] == path["label"]
            seen.append(path["value"])
    assert len(seen) == len(set(seen)) > 12
