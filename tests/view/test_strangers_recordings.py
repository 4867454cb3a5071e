"""Recordings and logs from elsewhere: a viewer that shows them must not fetch anything."""

import shlex
import subprocess
from dataclasses import replace
from types import SimpleNamespace

import pyarrow as pa
import pytest
import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import RrdReader
from support import synthetic_run

from bilayer_core.cli import main
from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_core.log.run.log_reader import read_log
from bilayer_core.view import viewer_process
from bilayer_core.view.rerun_view import write_branches, write_rrd

PICTURE = "![a picture](http://stranger.invalid/a.png)"
ODD_NAME = "-a #1%41? ü.rrd"
"""Looks like an option, and has what is special in a URL."""


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    path = tmp_path_factory.mktemp("strange") / "run.mcap"
    recorder = McapRecorder(path)
    recorder.start(replace(synthetic_run.description(), title=PICTURE))
    for moment in (0.0, 2.0, 4.0):
        recorder.observe(synthetic_run.frame(moment))
    recorder.close(True)
    return read_log(path)


def texts(path):
    """Entity -> text and media type of each text document of a recording."""
    found = {}
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        if "TextDocument:text" in batch.schema.names:
            kinds = batch.column("TextDocument:media_type") if "TextDocument:media_type" in batch.schema.names else None
            kind = kinds.flatten().to_pylist() if isinstance(kinds, pa.ListArray) else [None]
            found[chunk.entity_path] = (batch.column("TextDocument:text").flatten().to_pylist(), kind)
    return found


@pytest.mark.parametrize("kind", ["recording", "branches"])
def test_a_title_from_a_stranger_is_plain_text_in_the_recording(run, tmp_path, kind):
    path = tmp_path / "run.rrd"
    if kind == "recording":
        write_rrd(run, path)
    else:
        write_branches([SimpleNamespace(value=0.5, run=run, stopped=PICTURE)], PICTURE, path, force=False)
    ((text,), kinds) = texts(path)["/summary"]
    assert kinds == ["text/plain"] and PICTURE in text


def recording(path, media_type, shown_as=None):
    """A recording with a text, whose layout may show it as another media type."""
    stream = rr.RecordingStream("stranger")
    stream.save(path)
    overrides = {"text": rr.TextDocument.from_fields(media_type=shown_as)} if shown_as else None
    stream.send_blueprint(rrb.Blueprint(rrb.TextDocumentView(origin="text", overrides=overrides)))
    stream.log("text", rr.TextDocument(PICTURE, media_type=media_type), static=True)
    stream.flush()
    stream.disconnect()


@pytest.mark.parametrize(("media_type", "shown_as"), [("text/markdown", None), ("text/plain", "text/markdown")])
def test_a_recording_with_markdown_is_not_shown(tmp_path, monkeypatch, capsys, media_type, shown_as):
    monkeypatch.chdir(tmp_path)
    recording(tmp_path / ODD_NAME, media_type, shown_as)
    assert main(["view", "--web", "--", ODD_NAME]) == 2
    assert main(["view", "--screenshot", "a.png", "--", ODD_NAME]) == 2
    assert capsys.readouterr().err.count("is Markdown, with which a recording can make the viewer fetch addresses") == 2


def test_the_viewer_gets_the_absolute_path_of_a_recording_with_an_odd_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    recording(tmp_path / ODD_NAME, "text/plain")
    commands = []
    monkeypatch.setattr(viewer_process.subprocess, "call", lambda command, **_: commands.append(command) or 0)
    assert main(["view", "--", ODD_NAME]) == 0
    assert commands[0][1] == str(tmp_path / ODD_NAME)


@pytest.mark.parametrize("name", ["http://stranger.invalid/run.rrd", "rerun+http://127.0.0.1:9/proxy.rrd"])
def test_an_address_in_the_place_of_a_file_is_refused(name, capsys):
    assert main(["view", name]) == 2
    assert f"{name.replace('//', '/')}: there is no such file" in capsys.readouterr().err


def test_a_damaged_recording_is_refused_with_a_reason(tmp_path, capsys):
    whole = tmp_path / "whole.rrd"
    recording(whole, "text/plain")
    (tmp_path / "cut.rrd").write_bytes(whole.read_bytes()[:-900])
    (tmp_path / "text.rrd").write_text("no recording")
    for name in ("cut.rrd", "text.rrd"):
        assert main(["view", str(tmp_path / name)]) == 2
        assert f"{name}: cannot be read as a rerun recording" in capsys.readouterr().err


@pytest.mark.verify
def test_a_recording_with_an_odd_name_is_drawn(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_rrd(run, tmp_path / ODD_NAME)
    assert main(["view", "--screenshot", "a.png", "--", ODD_NAME]) == 0
    assert (tmp_path / "a.png").stat().st_size > 50_000


def test_reruns_importer_draws_surfaces_and_forces_as_the_page_says(run, tmp_path, root):
    synthetic_run.run(McapRecorder(tmp_path / "run.mcap"), [0.0, 2.0, 4.0])
    line = next(text for text in (root / "docs/logs.md").read_text().splitlines() if "rerun mcap convert" in text)
    words = shlex.split(line.strip("`"))
    subprocess.run([viewer_process.viewer_executable(), *words[1:]], cwd=tmp_path, check=True, capture_output=True)
    drawn, timelines = set(), set()
    for chunk in RrdReader(tmp_path / "run.rrd").stream():
        schema = chunk.to_record_batch().schema
        if "Points3D:positions" in schema.names:
            drawn.add(chunk.entity_path.rpartition("/")[2])
        assert not (chunk.entity_path.endswith("/state") and "Scalars:scalars" in schema.names)
        timelines |= {str(schema.field(name).type) for name in chunk.timeline_names}
    assert drawn == {"points", "obstacle_points", "body_points", "contact_force_points"}
    assert timelines == {"duration[ns]"}
