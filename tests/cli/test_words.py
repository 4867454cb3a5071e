"""Options that mean the same wherever they are, and old spellings that work on with a note."""

import json

import click
import pytest
import yaml
from support import synthetic_run

from bilayer_core.cli import main
from bilayer_core.cli.program import program
from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_core.scene.bundled import bundled_scenes

TO_STANDARD_OUTPUT = {"check", "info"}
"""Whose --json is a flag."""


@pytest.fixture
def logs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, end in (("a.mcap", 0.4), ("b.mcap", 0.5)):
        synthetic_run.run(McapRecorder(name, rate=25.0), [0.04 * k for k in range(round(end / 0.04) + 1)])


def options(name):
    """The option of this name of each verb that has it."""
    return {
        verb: option
        for verb, command in program.commands.items()
        for option in command.params
        if isinstance(option, click.Option) and name in option.opts and not option.hidden
    }


def test_json_is_standard_output_in_check_and_info_and_a_file_or_a_dash_elsewhere():
    found = options("--json")
    assert found.keys() == TO_STANDARD_OUTPUT | {"compare", "converge", "fit", "replay", "stress", "validate"}
    for verb, option in found.items():
        assert option.is_flag == (verb in TO_STANDARD_OUTPUT), verb
        assert verb in TO_STANDARD_OUTPUT or option.metavar == "FILE.json|-", verb


def test_log_is_a_log_that_is_written_and_at_a_time_of_the_run():
    assert {option.metavar.rpartition(".")[2] for option in options("--log").values()} == {"mcap"}
    assert options("--log").keys() == {"run", "replay"}
    assert {option.type.name for option in options("--at").values()} == {"time"}
    assert options("--at").keys() == {"run", "render", "view"} and not options("--time")


RUNS = {
    "validate": ["validate", "--only", "locking"],
    "compare": ["compare", "a.mcap", "b.mcap"],
    "run": ["run", "cantilever", "--duration", "2 ms"],
    "converge": ["converge", "cantilever", "--duration", "10 ms", "--workers", "1", "--set", "rods.strip.stations=6"],
}
OPTION = {"run": "--summary"}


@pytest.mark.parametrize("verb", RUNS)
def test_a_dash_leaves_standard_output_to_json_and_tells_the_rest_beside(logs, verb, capsys):
    arguments, option = RUNS[verb], OPTION.get(verb, "--json")
    code = 1 if verb == "compare" else 0  # the runs differ
    assert main([*arguments, option, "-"]) == code
    out, told = capsys.readouterr()
    content = json.loads(out)
    assert main([*arguments, option, "there.json"]) == code
    said = capsys.readouterr().out
    with open("there.json") as file:
        assert json.load(file).keys() == content.keys()
    assert said.split()[0] in told  # the first word of the text: a title, the time, or the scene


def test_old_spellings_work_on_with_a_note(logs, capsys, monkeypatch):
    assert main(["compare", "a.mcap", "b.mcap", "--json", "-"]) == 1
    new = capsys.readouterr().out
    for arguments in (["a.mcap", "b.mcap", "--json"], ["--json", "a.mcap", "b.mcap"], ["a.mcap", "--json", "b.mcap"]):
        assert main(["compare", *arguments]) == 1
        out, told = capsys.readouterr()
        assert out == new and "--json without a value is --json - now" in told
    asked = []
    monkeypatch.setattr("bilayer_core.view.rerun_view.screenshot", lambda *given: asked.append(given))
    for option, note in (("--at", ""), ("--time", "bilayer: --time is --at now; the old spelling goes with the next")):
        assert main(["view", "a.mcap", "--screenshot", f"{option}.png", option, "0.2 s"]) == 0
        assert capsys.readouterr().err.startswith(note) if note else not capsys.readouterr().err
    assert asked == [("a.mcap", f"{option}.png", 0.2, "strain") for option in ("--at", "--time")]
    assert main(["view", "a.mcap", "--screenshot", "c.png", "--time=300 ms"]) == 0
    assert asked[-1] == ("a.mcap", "c.png", 0.3, "strain")


def test_an_old_spelling_is_not_in_the_help(capsys):
    assert main(["view", "--help"]) == 0
    assert "--at" in (said := capsys.readouterr().out) and "--time" not in said


@pytest.mark.parametrize("verb", ["check", "sweep"])
def test_text_of_a_strangers_file_is_printed_as_escapes(tmp_path, capsys, verb):
    hostile = "\x1b]0;title\x07 \u202etxt.exe"
    scene = yaml.safe_load(bundled_scenes()["bending"].read_text()) | {"title": hostile}
    sweep = {"schema": 1, "scene": "bending", "parameters": {"title": {"path": "title", "values": [hostile]}}}
    file = tmp_path / f"{verb}.yaml"
    file.write_text(yaml.safe_dump({"check": scene, "sweep": sweep}[verb]))
    assert main({"check": ["check", str(file)], "sweep": ["sweep", str(file), "--list"]}[verb]) == 0
    told = capsys.readouterr().out
    assert "\\x1b]0;title\\x07 \\u202etxt.exe" in told
    assert told.replace("\n", "").replace("\t", "").isprintable()
