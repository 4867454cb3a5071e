"""`bilayer new`: what it writes loads, is explained key by key, and does what its title says."""

import json
import re

import pytest
import yaml

from bilayer_core import load_scene
from bilayer_core.cli import main
from bilayer_core.scene.bundled import bundled_scenes, bundled_templates
from bilayer_core.scene.new import name_from


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty directory to write in."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("template", bundled_templates())
def test_what_is_written_passes_check_without_a_warning(here, capsys, template):
    assert main(["new", "my-robot.yaml", "--template", template]) == 0
    told = capsys.readouterr().out
    assert told == f"my-robot.yaml: a scene to start from, like {template}\nnext: bilayer check my-robot.yaml\n"
    assert load_scene("my-robot.yaml").name == "my_robot"
    assert main(["check", "my-robot.yaml"]) == 0
    assert capsys.readouterr().out.endswith("no faults, no warnings\n")


def test_a_strip_is_written_without_a_template_and_runs(here, capsys):
    assert main(["new", "robot.yaml"]) == 0
    assert main(["run", "robot.yaml", "--duration", "20 ms", "--summary", "run.json"]) == 0
    summary = json.loads((here / "run.json").read_text())
    assert summary["scene"] == "robot" and summary["simulated"] == 0.02 and summary["converged"]


@pytest.mark.parametrize("template", bundled_templates())
def test_every_part_of_a_template_has_comments(template):
    text = bundled_templates()[template].read_text(encoding="utf-8")
    for key in yaml.safe_load(text).keys() - {"title"}:
        block = re.search(rf"^{key}:.*(?:\n .*)*", text, re.M)[0]
        assert "# " in block or block.startswith("materials"), f"{key} is not explained"
    assert all(len(line) <= 120 for line in text.splitlines())


@pytest.mark.parametrize("scene", bundled_scenes())
def test_a_copy_of_a_scene_differs_from_it_in_its_name_only(here, scene):
    assert main(["new", "copy.yaml", "--from", scene]) == 0
    copy, origin = load_scene("copy.yaml"), load_scene(scene)
    assert copy.name == "copy" and copy.model_copy(update={"name": origin.name}) == origin
    before, after = (path.read_text("utf-8").splitlines() for path in (bundled_scenes()[scene], here / "copy.yaml"))
    assert [line for line, old in zip(after, before, strict=True) if line != old] == ["name: copy"]


@pytest.mark.parametrize(
    ("path", "name"),
    [("arm.yaml", "arm"), ("my-robot v2.yaml", "my_robot_v2"), ("2legs.yaml", "robot_2legs"), ("__.yaml", "robot")],
)
def test_the_scene_is_called_after_its_file(tmp_path, path, name):
    assert name_from(tmp_path / path) == name


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["there.yaml"], "there.yaml: exists already"),
        (["robot"], "robot: must end in .yaml or .yml"),
        (["absent/robot.yaml"], "absent/robot.yaml: cannot be written: there is no"),
        (["robot.yaml", "--template", "gripr"], "--template: gripr does not exist, did you mean gripper?; there are"),
        (["robot.yaml", "--from", "griping"], "griping: neither a scene file nor a bundled scene, did you mean"),
        (["robot.yaml", "--from", "absent.yaml"], "absent.yaml: cannot be read: No such file or directory"),
        (["robot.yaml", "--from", "there.yaml"], "there.yaml: has no line that begins with `name:`"),
        (["robot.yaml", "--from", "gripping", "--template", "strip"], "--template, --from: name one of the two"),
        ([], "Missing argument 'FILE.yaml'"),
    ],
)
def test_what_cannot_be_written_is_refused_and_nothing_is(here, arguments, message, capsys):
    (here / "there.yaml").write_text("precious: true\n")
    assert main(["new", *arguments]) == 2
    assert message in capsys.readouterr().err
    assert [path.name for path in here.iterdir()] == ["there.yaml"]
    assert (here / "there.yaml").read_text() == "precious: true\n"


def test_an_existing_file_is_replaced_with_force(here):
    (here / "there.yaml").write_text("old\n")
    assert main(["new", "there.yaml", "--force"]) == 0
    assert load_scene("there.yaml").name == "there"


def test_help_lists_the_templates(capsys):
    assert main(["new", "--help"]) == 0
    text = capsys.readouterr().out
    assert all(f"  {template} " in text for template in bundled_templates())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("template", "moved", "least"), [("gripper", "ball", 0.039), ("crawler", None, 0.007), ("swimmer", "hub", 0.015)]
)
def test_a_template_does_what_its_title_says(here, template, moved, least):
    """Way [m]: of the gripper's ball with the hub, of the crawler forward in a cycle, of the swimmer upwards."""
    assert main(["new", "robot.yaml", "--template", template]) == 0
    duration = [] if template == "gripper" else ["--duration", "2 s"]
    assert main(["run", "robot.yaml", *duration, "--summary", "run.json", "--quiet"]) == 0
    summary = json.loads((here / "run.json").read_text())
    way = summary["bodies"][moved]["lift"] if moved else summary["com_end"][0] - summary["com_start"][0]
    assert way > least
