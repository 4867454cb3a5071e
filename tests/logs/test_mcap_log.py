"""Logs: written whole, cut off by a kill, refused, and on a disk that fails."""

import re
import time
from dataclasses import fields

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from support import synthetic_run
from support.kills import kill
from support.slow_disks import Full

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import InputError, OutputError, SimulationError
from bilayer_core.log.file import mcap_log
from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_core.log.messages.description_text import to_text
from bilayer_core.log.messages.markers import DELETE_ALL
from bilayer_core.log.run.log_reader import read_description, read_info, read_log, read_state, scene_from_log
from bilayer_core.log.run.memory import MemoryRecorder

TIMES = np.arange(0, 51) * 0.02


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "run.mcap"
    recorder = McapRecorder(path, rate=50.0, marker_rate=50.0)
    synthetic_run.run(recorder, TIMES, inputs=synthetic_run.stimulus_before(25, TIMES))
    return path


def assert_equal_descriptions(found, expected):
    for item in fields(expected):
        one, other = getattr(found, item.name), getattr(expected, item.name)
        if item.name == "strands":
            for strand, own in zip(one, other, strict=True):
                for part in fields(own):
                    np.testing.assert_array_equal(getattr(strand, part.name), getattr(own, part.name))
        else:
            assert one == other


def test_a_log_of_another_version_is_refused_with_the_version_that_wrote_it(tmp_path, monkeypatch):
    def older(description):
        return {name: text for name, text in to_text(description).items() if name != "obstacles"}

    monkeypatch.setattr(mcap_log, "to_text", older)
    synthetic_run.run(McapRecorder(tmp_path / "run.mcap", rate=25.0, marker_rate=25.0), TIMES[:2])
    with pytest.raises(InputError, match=r"run\.mcap: describes its run in another way .* bilayer_sim_ros [\d.]+"):
        read_description(tmp_path / "run.mcap")


def test_info_says_what_the_log_holds(log):
    info = read_info(log)
    assert (info.scene, info.title) == ("synthetic", "Four ribbons and a ball")
    assert (info.start_time, info.last_time, info.duration) == (0.0, 1.0, 1.0)
    assert (info.complete, info.termination, info.channels) == (True, "completed", ("humidity",))
    assert info.topics["/bilayer_sim/markers"] == {"type": "visualization_msgs/msg/MarkerArray", "count": 51}
    assert info.topics["/bilayer_sim/stimulus/humidity"]["count"] == 1
    assert info.settings == {"model": "two_rod", "integrator": "implicit_euler", "dt": "0.001"}
    assert info.versions["numpy"] == np.__version__
    assert info.size == log.stat().st_size


def test_the_scene_and_the_description_come_back(log):
    assert scene_from_log(log) == synthetic_run.SCENE_TEXT
    assert_equal_descriptions(read_description(log), synthetic_run.description())


def test_only_the_first_markers_of_a_log_delete_those_of_another_one(log):
    with log.open("rb") as file:
        messages = make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages("/bilayer_sim/markers")
        actions = [[marker.action for marker in decoded.markers] for *_, decoded in messages]
    assert [action.count(DELETE_ALL) for action in actions] == [1] + 50 * [0]
    assert actions[0][0] == DELETE_ALL


def test_arrays_read_from_the_log_are_those_that_were_observed(log):
    memory = MemoryRecorder()
    synthetic_run.run(memory, TIMES)
    expected, found = memory.run_data(), read_log(log)
    for item in fields(expected):
        one, other = getattr(found, item.name), getattr(expected, item.name)
        if isinstance(other, np.ndarray):
            np.testing.assert_allclose(one, other, rtol=0, atol=1e-9, err_msg=item.name)
        elif isinstance(other, dict):
            assert list(one) == list(other)
            for name in other:
                np.testing.assert_array_equal(one[name], other[name])


def test_a_state_is_read_back_exactly(log):
    last, last_time = read_state(log)
    assert last_time == 1.0
    np.testing.assert_array_equal(last, synthetic_run.frame(1.0, 1.0).state)
    earlier, earlier_time = read_state(log, 0.515)
    assert earlier_time == 0.5
    np.testing.assert_array_equal(earlier, synthetic_run.frame(0.5, 1.0).state)
    with pytest.raises(InputError, match="holds no state at or before t = -1 s"):
        read_state(log, -1.0)
    period = last_time - read_state(log, 0.999)[1]
    assert read_state(log, 1.0 + 0.9 * period)[1] == 1.0
    with pytest.raises(InputError, match="its last state is of t = 1 s, and t = 1.5 s is after its end"):
        read_state(log, 1.5)


def test_a_run_goes_on_from_its_log_bit_for_bit(tmp_path):
    path = tmp_path / "run.mcap"
    Simulator(load_scene("gripping")).run(0.04, observers=[McapRecorder(path)])
    again = Simulator(load_scene(yaml.safe_load(scene_from_log(path))))
    middle, moment = read_state(path, 0.02)
    assert 0.01 < moment <= 0.02
    again.load_state(middle)
    again.run(until=0.04)
    np.testing.assert_array_equal(again.save_state(), read_state(path)[0])


def test_rosbags_reads_every_message(log):
    with AnyReader([log]) as reader:
        counts = {connection.topic: connection.msgcount for connection in reader.connections}
        decoded = [reader.deserialize(raw, connection.msgtype) for connection, _, raw in reader.messages()]
        offered = {connection.topic: connection.ext.offered_qos_profiles for connection in reader.connections}
    assert len(decoded) == sum(counts.values()) == 15 * 51 + 26 + 1 + 2 + 3  # contact, ground, inputs, events
    assert {len(profiles) for profiles in offered.values()} == {1}
    profile = offered["/bilayer_sim/state"][0]
    assert (profile.history.name, profile.depth) == ("KEEP_LAST", 10)
    assert (profile.reliability.name, profile.durability.name) == ("RELIABLE", "VOLATILE")
    assert offered["/clock"][0].depth == 1


def test_mcap_ros2_reads_every_message_in_order_of_time(log):
    with log.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        assert [item.name for item in reader.iter_attachments()] == ["scene.yaml"]
        last = {}
        for _, channel, message, decoded in reader.iter_decoded_messages():
            last[channel.topic] = (message.log_time, decoded)
    assert len(last) == 20
    stamp, pose = last["/bilayer_sim/body_pose/ball"]
    assert stamp == 10**9
    assert (pose.header.stamp.sec, pose.header.frame_id) == (1, "world")
    assert pose.pose.position.z == pytest.approx(synthetic_run.RADIUS + 1e-3 + synthetic_run.LIFT)
    assert last["/bilayer_sim/stimulus/humidity"][0] == 500_000_000
    stamp, told = last["/bilayer_sim/inputs"]
    assert stamp == 500_000_000
    assert [(part.label, part.size) for part in told.layout.dim] == [("step,time,stimulus:humidity", 3)]
    assert list(told.data) == [25.0, 0.5, 0.25]


def test_an_interrupted_run_is_not_complete(tmp_path):
    recorder = McapRecorder(tmp_path / "run.mcap")
    recorder.start(synthetic_run.description())
    recorder.observe(synthetic_run.frame(0.0))
    recorder.close(False, "interrupted")
    info = read_info(tmp_path / "run.mcap")
    assert (info.complete, info.termination, info.last_time) == (False, "interrupted", 0.0)


RECORDING = """
import time
from support import synthetic_run
from bilayer_core.log.file.mcap_log import McapRecorder

recorder = McapRecorder({log!r})
recorder.start(synthetic_run.description())
step = 0
while True:
    recorder.observe(synthetic_run.frame(0.02 * step))
    step += 1
    time.sleep(0.02)
"""


def test_a_log_of_a_killed_process_is_readable_up_to_its_last_second(tmp_path):
    path = tmp_path / "run.mcap"
    loss = kill(RECORDING.format(log=str(path)), path, tmp_path / "diary", 1.5)
    assert loss.frames > 0 and loss.missing - loss.stalled < 1.0
    info = read_info(path)
    assert info.scene == "synthetic"
    survivors = info.topics["/clock"]["count"]
    begun = round(info.last_time / 0.02) - (survivors - 1)
    assert begun in (0, 1)  # the state comes before all else
    lost = survivors - len(read_log(path).times)
    assert lost in (0, 1)  # a chunk may end within a frame
    assert read_state(path)[1] == pytest.approx(info.last_time)


@pytest.mark.parametrize("missing", [1, 7, 500, 30_000, 100_000])
def test_a_log_cut_at_any_byte_loses_only_what_was_cut(log, tmp_path, missing):
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(log.read_bytes()[:-missing])
    info = read_info(cut)
    assert info.scene == "synthetic"
    assert len(read_log(cut).times) == info.topics["/bilayer_sim/com"]["count"] > 20


@pytest.mark.parametrize("content", [b"", b"no log at all, but long enough for some records", None])
def test_a_file_that_is_no_log_is_refused(content, tmp_path):
    path = tmp_path / "file.mcap"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=r"file\.mcap"):
        read_info(path)


def test_a_damaged_chunk_is_noticed(log, tmp_path):
    data = bytearray(log.read_bytes())
    data[len(data) // 2] ^= 0xFF
    damaged = tmp_path / "damaged.mcap"
    damaged.write_bytes(data)
    with pytest.raises(InputError, match=r"is damaged: the chunk at byte \d+.*`bilayer repair`"):
        read_log(damaged).com  # noqa: B018


@pytest.mark.parametrize("part", [b"versions", b"settings", b"description"])
def test_a_log_whose_head_is_damaged_is_refused_with_what_is_missing(log, tmp_path, part):
    damaged = tmp_path / "damaged.mcap"
    damaged.write_bytes(log.read_bytes().replace(part, part[::-1], 1))
    with pytest.raises(InputError, match=f"or is damaged: {part.decode()} is missing"):
        read_log(damaged)


def test_every_message_about_a_damaged_log_says_what_is_wrong(log, tmp_path):
    data, random, told = log.read_bytes(), np.random.default_rng(1), set()
    damaged = tmp_path / "damaged.mcap"
    for place in random.integers(8, 400, 300):
        damaged.write_bytes(data[:place] + b"\xff" + data[place + 1 :])
        try:
            read_info(damaged)
        except InputError as error:
            told.add(str(error).removeprefix(f"{damaged}: ").partition("damaged: ")[2] or str(error))
    assert len(told) > 2 and all(len(message) > 10 for message in told)


def test_bad_paths_are_refused_before_anything_is_computed(tmp_path):
    existing = tmp_path / "old.mcap"
    existing.write_bytes(b"precious")
    with pytest.raises(InputError, match=r"old\.mcap: exists already"):
        McapRecorder(existing)
    with pytest.raises(InputError, match=r"there is no directory .*missing"):
        McapRecorder(tmp_path / "missing" / "run.mcap")
    (tmp_path / "folder.mcap").mkdir()
    with pytest.raises(InputError, match="is a directory"):
        McapRecorder(tmp_path / "folder.mcap", force=True)
    with pytest.raises(InputError, match=r"run\.log: must end in \.mcap"):
        McapRecorder(tmp_path / "run.log")
    assert existing.read_bytes() == b"precious"


def test_force_replaces_a_file_when_the_run_starts_and_not_before(tmp_path):
    path = tmp_path / "old.mcap"
    path.write_bytes(b"precious")
    recorder = McapRecorder(path, force=True)
    assert path.read_bytes() == b"precious"
    synthetic_run.run(recorder, TIMES[:2])
    assert read_info(path).complete


def test_a_full_disk_surfaces_as_an_error_of_the_run(tmp_path):
    path = tmp_path / "full.mcap"
    path.symlink_to("/dev/full")
    recorder = McapRecorder(path, force=True)
    with pytest.raises((OutputError, SimulationError), match="full.mcap.*No space left on device"):
        recorder.start(synthetic_run.description())
        for moment in TIMES:
            recorder.observe(synthetic_run.frame(float(moment)))
        recorder.close(True)


def test_a_disk_that_fills_up_stops_the_run_and_is_told_again_at_the_end(tmp_path, monkeypatch):
    monkeypatch.setattr(mcap_log, "open_alone", lambda path, force: Full(path.open("xb"), 300_000))
    recorder = McapRecorder(tmp_path / "run.mcap")
    recorder.start(synthetic_run.description())
    with pytest.raises(SimulationError, match=r"run\.mcap could not be written: No space left") as raised:
        for step in range(10_000):
            recorder.observe(synthetic_run.frame(0.01 * step))
    assert raised.value.exit_code == 3
    with pytest.raises(SimulationError, match="No space left"):
        recorder.close(False)
    kept = float(re.search(r"it can be read up to t = (\S+) s", str(raised.value))[1])
    assert kept == pytest.approx(read_info(tmp_path / "run.mcap").last_time) and kept > 0.0
    assert len(read_log(tmp_path / "run.mcap").times) > 0


def test_a_log_whose_directory_disappears_is_reported(tmp_path):
    directory = tmp_path / "runs"
    directory.mkdir()
    recorder = McapRecorder(directory / "run.mcap")
    recorder.start(synthetic_run.description())
    recorder.observe(synthetic_run.frame(0.0))
    (directory / "run.mcap").unlink()
    directory.rmdir()
    with pytest.raises(SimulationError, match="was deleted while it was written"):
        recorder.close(True)


def test_a_slow_disk_holds_the_run_back_and_loses_nothing(tmp_path, monkeypatch):
    write = mcap_log._LogFile.write

    def slow(self, item):
        time.sleep(0.005)
        write(self, item)

    monkeypatch.setattr(mcap_log._LogFile, "write", slow)
    monkeypatch.setattr(mcap_log, "QUEUE_LENGTH", 4)
    recorder = McapRecorder(tmp_path / "run.mcap")
    start = time.monotonic()
    synthetic_run.run(recorder, np.arange(60) * 0.02)
    assert time.monotonic() - start > 0.3
    assert read_info(tmp_path / "run.mcap").topics["/clock"]["count"] == 60
