"""The description of a run in a log has types, sizes, ranges and names that a scene can have, or is refused."""

import json

import pytest
from support import hostile_logs, synthetic_run

from bilayer_core import read_log
from bilayer_core.cli import main
from bilayer_core.errors import InputError
from bilayer_core.log.file.log_head import read_head

DESCRIPTION = synthetic_run.description()
ESCAPE = "\x1b]0;owned\x07"
WRONG = {
    "scene_name": "../../etc",
    "node_count": "many",
    "edge_count": 1,
    "channels": ["a b"],
    "channel_ranges": [[float("nan"), 1.0]],
    "channel_units": [],
    "state_layout": [["position", [-1]]],
    "bodies": [{"name": ESCAPE, "shape": None, "prescribed": True}],
    "obstacles": [{"name": "x", "shape": {"kind": "cone"}}],
    "joints": [{"name": "joints/x/../y", "body": 0, "shape": None}],
    "settings": {"dt": 1},
    "strands": [],
}


def written(folder, **changes):
    path = folder / "run.mcap"
    texts = {key: json.dumps(value) for key, value in changes.items()}
    path.write_bytes(hostile_logs.finished(hostile_logs.head(DESCRIPTION, **texts)))
    return path


@pytest.mark.parametrize("key", WRONG)
def test_a_description_that_no_scene_has_is_refused_with_file_and_key(key, tmp_path):
    with pytest.raises(InputError, match=rf"run\.mcap: .*{key}") as refused:
        read_head(written(tmp_path, **{key: WRONG[key]}))
    assert str(refused.value).isprintable() and len(str(refused.value)) < 600


@pytest.mark.parametrize("text", ["NaN", "1e999", "[" * 100_000, "1" * 5000, '"\\ud800"', ""])
@pytest.mark.parametrize("key", ["node_count", "strands", "state_layout"])
def test_json_that_python_reads_into_something_else_is_refused(key, text, tmp_path):
    path = tmp_path / "run.mcap"
    path.write_bytes(hostile_logs.finished(hostile_logs.head(DESCRIPTION, **{key: text})))
    with pytest.raises(InputError, match=rf"run\.mcap: .*description.*{key}"):
        read_log(path)


def test_info_shows_a_hostile_title_as_escapes(tmp_path, capsys):
    path = written(tmp_path, title=f"{ESCAPE}\u202eexe.txt" + "x" * 100_000)
    assert main(["info", str(path)]) == 0
    shown = capsys.readouterr().out
    assert "\\x1b]0;owned\\x07\\u202eexe.txt" in shown
    assert all(line.isprintable() and len(line) < 2100 for line in shown.splitlines())


def test_a_file_whose_name_has_escapes_is_named_without_them(tmp_path, capsys):
    assert main(["info", str(tmp_path / f"{ESCAPE}.mcap")]) == 2
    assert capsys.readouterr().err.strip().isprintable()
