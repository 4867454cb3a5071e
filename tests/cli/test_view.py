"""`bilayer view`: what it hands to the viewer's functions."""

import pytest

from bilayer_core.cli import main
from bilayer_core.cli.terminal import say


@pytest.fixture
def viewer(monkeypatch, tmp_path):
    """Notes what the viewer's functions are asked to do instead of doing it; the directory is empty."""
    asked = []
    for name in ("convert_log", "open_browser", "open_viewer", "screenshot"):
        monkeypatch.setattr(
            f"bilayer_core.view.rerun_view.{name}", lambda *arguments, name=name: asked.append((name, *arguments))
        )
    monkeypatch.chdir(tmp_path)
    return asked


@pytest.mark.parametrize(
    ("arguments", "asked"),
    [
        (["run.mcap"], [("open_viewer", "run.mcap", "strain")]),
        (["run.rrd", "--web"], [("open_browser", "run.rrd", say, "strain")]),
        (["run.mcap", "--colour", "contact"], [("open_viewer", "run.mcap", "contact")]),
        (["run.mcap", "--save", "run.rrd"], [("convert_log", "run.mcap", "run.rrd", "strain")]),
        (["run.mcap", "--screenshot", "run.png"], [("screenshot", "run.mcap", "run.png", None, "strain")]),
        (
            ["run.rrd", "--screenshot", "run.png", "--at", "500 ms"],
            [("screenshot", "run.rrd", "run.png", 0.5, "strain")],
        ),
        (
            ["run.mcap", "--save", "run.rrd", "--screenshot", "run.png"],
            [("convert_log", "run.mcap", "run.rrd", "strain"), ("screenshot", "run.rrd", "run.png", None, "strain")],
        ),
    ],
)
def test_the_viewer_is_asked_for_what_the_options_say(viewer, arguments, asked):
    assert main(["view", *arguments]) == 0
    assert viewer == asked


def test_a_recording_keeps_its_colours(viewer, capsys):
    assert main(["view", "run.rrd", "--colour", "contact"]) == 2
    assert "--colour: run.rrd is a rerun recording, whose colours are made already" in capsys.readouterr().err


@pytest.mark.parametrize(("option", "name"), [("--save", "there.rrd"), ("--screenshot", "there.png")])
def test_an_existing_file_is_replaced_with_force_only(viewer, tmp_path, option, name, capsys):
    (tmp_path / name).write_text("precious")
    assert main(["view", "run.mcap", option, name]) == 2
    assert f"{name}: exists already" in capsys.readouterr().err and viewer == []
    assert main(["view", "run.mcap", option, name, "--force"]) == 0
    assert len(viewer) == 1


def test_a_run_is_shown_as_a_recording(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["run", "bending", "--duration", "0.04", "--quiet", "--log", "run.mcap", "--rrd", "direct.rrd"]) == 0
    assert main(["view", "run.mcap", "--save", "converted.rrd"]) == 0
    assert capsys.readouterr().out == "recording  converted.rrd\n"
    for name in ("direct.rrd", "converted.rrd"):
        assert (tmp_path / name).read_bytes()[:4] == b"RRF2"
