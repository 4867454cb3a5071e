"""Bags that recorders make of a node's messages are read as far as their topics allow."""

import shutil

import numpy as np
import pytest
from mcap.writer import CompressionType, IndexType
from rosbags.rosbag2 import StoragePlugin
from support import synthetic_run
from support.bags import EPOCH, live_messages, text_message, write_bag, write_mcap

from bilayer_core import compare, read_log
from bilayer_core.cli import main
from bilayer_core.errors import InputError
from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_core.log.messages.cdr import HEADER
from bilayer_core.log.messages.encoders import multi_array_template
from bilayer_core.log.run.log_reader import read_info
from bilayer_core.view.rerun_view import convert_log

ROBOT = "/lab/robot1"
DOUBLE = "std_msgs/msg/Float64"


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "run.mcap"
    synthetic_run.run(McapRecorder(path, rate=50.0, marker_rate=25.0), np.arange(0, 26) * 0.02)
    return path


@pytest.fixture(scope="module")
def messages(log):
    return list(live_messages(log, ROBOT))


def without(messages, *names):
    return [of for of in messages if not any(f"/{name}/" in f"{of[0]}/" for name in names)]


def refused(words, capsys):
    """What a command says that refuses something."""
    assert main([str(word) for word in words]) == 2
    return capsys.readouterr().err


FORMS = {
    "chunks": {},
    "zstd": {"compression": CompressionType.ZSTD},
    "no chunks": {"use_chunking": False},
    "no index": {"index_types": IndexType.NONE, "use_statistics": False},
    "bare": {"use_chunking": False, "index_types": IndexType.NONE, "use_statistics": False},
    "no channels in the summary": {"repeat_channels": False, "repeat_schemas": False},
    "no types in the summary": {"repeat_schemas": False, "use_statistics": False},
}


@pytest.mark.parametrize("form", FORMS)
def test_a_file_of_any_form_is_read_as_the_log_of_the_run(form, log, messages, tmp_path):
    bag = write_mcap(tmp_path / "bag.mcap", messages, chunk_size=50_000, **FORMS[form])
    assert compare(log, bag).equal
    assert read_info(bag).topics[f"{ROBOT}/com"]["count"] == 26


def test_a_file_that_was_cut_off_is_read_up_to_its_end(log, messages, tmp_path):
    data = write_mcap(tmp_path / "bag.mcap", messages, chunk_size=50_000).read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(data[: len(data) * 3 // 5])
    whole, run = read_log(log), read_log(cut)
    assert 8 < len(run.times) < 20
    np.testing.assert_array_equal(run.com, whole.com[: len(run.times)])
    np.testing.assert_array_equal(run["energy/bend"].values, whole["energy/bend"].values[: len(run.times)])
    assert any("an index" in lack for lack in read_info(cut).lacks)


def test_a_directory_of_several_files_is_one_bag_whatever_their_names(log, messages, tmp_path):
    bag = tmp_path / "bag"
    bag.mkdir()
    parts = [messages[: len(messages) // 3], messages[len(messages) // 3 :]]
    for name, part in zip(("bag_10", "bag_9"), parts, strict=True):
        write_mcap(bag / f"{name}.mcap", part)
    assert compare(log, bag).equal
    assert read_info(bag).size == sum(file.stat().st_size for file in bag.iterdir())


def test_times_are_simulated_and_the_recording_has_a_date(messages, tmp_path, capsys):
    bag = write_bag(tmp_path / "bag", messages)
    assert main(["info", str(bag)]) == 0
    told = capsys.readouterr().out
    assert "recorded  2026-11-25 15:30:12 UTC\n" in told
    assert f"run       {ROBOT}, simulated 0 s to 0.5 s\n" in told
    assert "read by   view, render, plot, export, compare" in told


def test_messages_that_a_recorder_began_late_and_lost_leave_only_whole_frames(log, messages, tmp_path):
    begin = {"energy": 5, "com": 3, "solver": 7, "stimulus_applied": 4}
    seen, kept = dict.fromkeys(begin, 0), []
    for message in messages:
        name = message[0].rpartition("/")[2]
        seen[name] = seen.get(name, 0) + 1
        if seen[name] > begin.get(name, 0) and (name, seen[name]) not in {("com", 15), ("energy", 18)}:
            kept.append(message)
    whole, run = read_log(log), read_log(write_bag(tmp_path / "bag", kept))
    rows = [k for k in range(7, 26) if k not in (14, 17)]
    np.testing.assert_array_equal(run.times, whole.times[rows])
    for name in ("com", "energy/bend", "solver/cpu_time", "stimulus/humidity", "body/ball/position"):
        np.testing.assert_array_equal(run[name].values, whole[name].values[rows], err_msg=name)


def test_messages_of_another_middleware_with_padding_at_their_end_are_read(log, messages, tmp_path):
    padded = [(*message, data + bytes(-len(data) % 4)) for *message, data in messages]
    assert any(len(one[3]) != len(other[3]) for one, other in zip(messages, padded, strict=True))
    assert compare(log, write_bag(tmp_path / "bag", padded)).equal


def test_times_of_sending_tell_what_belongs_together_where_those_of_recording_do_not(log, messages, tmp_path):
    # A run as fast as possible: the recorder takes all that waits of one topic after the other.
    order = {topic: number for number, topic in enumerate(dict.fromkeys(of[0] for of in messages))}
    late = {of: EPOCH + 10**9 * order[of[0]] for of in messages}
    kept = [of for of in messages if not (of[0].endswith("/energy") and of[2] < EPOCH + 10**8)]
    sent = iter([of[2] for of in kept])
    recorded = [(of[0], of[1], late[of] + of[2] - EPOCH, of[3]) for of in kept]
    bag = write_mcap(tmp_path / "bag.mcap", recorded, sent=lambda _: next(sent))
    whole, run = read_log(log), read_log(bag)
    assert len(run.times) == 21
    np.testing.assert_array_equal(run["energy/bend"].values, whole["energy/bend"].values[5:])


def test_without_a_description_all_that_topics_say_is_there(log, messages, tmp_path, capsys):
    bag = write_bag(tmp_path / "bag", without(messages, "description"))
    whole, run = read_log(log), read_log(bag)
    for name in ("com", "energy/bend", "stimulus/humidity", "body/hub/clamp_wrench", "body/ball/position"):
        np.testing.assert_array_equal(run[name].values, whole[name].values, err_msg=name)
    nodes = run["rod/all/nodes/position"].values
    assert nodes.shape == (13, 328, 3)
    np.testing.assert_array_equal(nodes, whole.positions[:, :328])
    assert "without a description" in read_info(bag).title
    recording = tmp_path / "run.rrd"
    assert main(["view", str(bag), "--save", str(recording)]) == 0
    assert b"world/strands/all/nodes" in recording.read_bytes()
    assert "does not hold the node's description" in refused(["render", bag, "--png", tmp_path / "a.png"], capsys)


@pytest.mark.parametrize(
    "names", [["solver"], ["energy", "com"], ["contact_wrench", "clamp_wrench", "stimulus_applied"]]
)
def test_a_bag_of_some_topics_is_shown_and_says_what_it_lacks(names, messages, tmp_path, capsys):
    bag = write_bag(tmp_path / "bag", without(messages, *names))
    assert main(["view", str(bag), "--save", str(tmp_path / "run.rrd")]) == 0
    lacks = read_info(bag).lacks
    assert all(any(f"{ROBOT}/{name}" in lack for lack in lacks) for name in names)
    with pytest.raises(InputError, match=f"nodes, {ROBOT}/points, which is drawn"):
        convert_log(write_bag(tmp_path / "few", without(messages, *names, "nodes", "points")), tmp_path / "few.rrd")


def test_values_without_any_stamp_have_the_time_since_the_first_message(log, messages, tmp_path):
    bag = write_bag(tmp_path / "bag", [of for of in messages if of[0].endswith(("/energy", "/stimulus_applied"))])
    run = read_log(bag)
    np.testing.assert_array_equal(run["energy/bend"].values, read_log(log)["energy/bend"].values)
    np.testing.assert_allclose(run["stimulus/humidity"].times, np.arange(26) * 0.02, atol=1e-3)
    assert any("stamps; times are those since" in lack for lack in read_info(bag).lacks)


def test_of_several_nodes_one_is_named(log, messages, tmp_path, capsys):
    other = [(f"/camera{of[0]}", *of[1:]) for of in messages if of[0].endswith("/points")]
    both = [*messages, *live_messages(log, "/b"), *other, ("/speed", DOUBLE, EPOCH, bytes([0, 1, *bytes(10)]))]
    bag = write_bag(tmp_path / "bag", sorted(both, key=lambda of: of[2]))
    assert compare(log, f"{bag}:/b").equal and compare(log, f"{bag}:{ROBOT}").equal
    said = refused(["plot", bag, "com", "--out", tmp_path / "a.png"], capsys)
    assert f"holds 2 runs; name one: {bag}:/b (0 to 0.5 s), {bag}:{ROBOT} (0 to 0.5 s)" in said
    assert f"{bag}: holds no messages of /c;" in refused(["info", f"{bag}:/c"], capsys)
    names = [f"{bag}:/b", f"{bag}:{ROBOT}"]
    assert main(["plot", *names, "com.z", "--out", str(tmp_path / "both.png")]) == 0
    info = read_info(bag)
    assert [run.node for run in info.runs] == ["/b", ROBOT]
    assert info.topics["/speed"]["count"] == 1 and info.topics[f"/camera{ROBOT}/points"]["count"] == 13


def test_a_reset_begins_another_run(log, messages, tmp_path, capsys):
    second = [of for of in live_messages(log, ROBOT, EPOCH + 10**9, described=False) if of[2] < EPOCH + 1.3e9]
    bag = write_bag(tmp_path / "bag", [*messages, *second])
    whole, run = read_log(log), read_log(f"{bag}:@2")
    assert compare(log, f"{bag}:{ROBOT}@1").equal
    np.testing.assert_array_equal(run.com, whole.com[: len(run.times)])
    np.testing.assert_array_equal(run["energy/bend"].values, whole["energy/bend"].values[: len(run.times)])
    said = refused(["export", bag, "--npz", tmp_path / "a.npz"], capsys)
    assert "its time goes back" in said and f"{bag}:{ROBOT}@2 (0 to 0.2" in said
    assert "holds no run 3" in refused(["info", f"{bag}:@3"], capsys)


def test_two_nodes_of_one_name_are_told_of_and_not_listed_one_by_one(log, messages, tmp_path, capsys):
    late = live_messages(log, ROBOT, EPOCH + 65 * 10**6)
    bag = write_bag(tmp_path / "bag", sorted([*messages, *late], key=lambda of: of[2]))
    said = refused(["export", bag, "--npz", tmp_path / "a.npz"], capsys)
    assert "or two nodes of one name" in said and " more" in said and len(said) < 1500


def test_any_other_file_is_described_and_not_more(messages, tmp_path, capsys):
    foreign = [("/map", "nav_msgs/msg/OccupancyGrid", 5 * 10**9, b"x"), ("/json", "", 6 * 10**9, b"{}")]
    path = write_mcap(tmp_path / "other.mcap", foreign, encoding="json")
    assert main(["info", str(path)]) == 0
    told = capsys.readouterr().out
    assert "an MCAP file, not a log" in told and "no command but info" in told and "recorded" not in told
    assert read_info(path).topics["/map"] == {"type": "nav_msgs/msg/OccupancyGrid", "count": 1}
    for words in (["plot", path, "com", "--out", tmp_path / "a.png"], ["compare", path, path]):
        assert "holds no messages of a node sim_node" in refused(words, capsys)
    ours = write_mcap(tmp_path / "json.mcap", messages, encoding="json")
    assert read_info(ours).kind == "mcap"


@pytest.mark.parametrize(
    "words", [["replay", "--verify"], ["replay", "--from", "0.1"], ["run", "bending", "--from-state"]]
)
def test_what_needs_a_log_says_so_of_a_bag(words, messages, tmp_path, capsys):
    bag = write_mcap(tmp_path / "bag.mcap", messages)
    said = refused([*words, bag], capsys)
    assert f"{bag}: is no log of a run" in said and "the node's parameter `log`" in said


def test_storage_that_is_not_read_is_refused_with_the_remedy(messages, tmp_path, capsys):
    bag = write_bag(tmp_path / "bag", messages, StoragePlugin.SQLITE3)
    for path in (bag, next(bag.glob("*.db3"))):
        said = refused(["info", path], capsys)
        assert "stored with sqlite3" in said and "ros2 bag convert" in said
    packed = [(*of, b"\x28\xb5\x2f\xfd" + data) for *of, data in messages]
    bag = write_bag(tmp_path / "packed", packed)
    assert "--compression-mode message" in refused(["export", bag, "--npz", tmp_path / "a.npz"], capsys)
    assert main(["info", str(bag)]) == 0


def test_a_directory_that_is_no_bag_is_refused(log, tmp_path, capsys):
    assert "without .mcap files" in refused(["info", tmp_path], capsys)
    shutil.copy(log, tmp_path / "a.mcap")
    said = refused(["info", tmp_path], capsys)
    assert f"is a directory of logs, and no bag of `ros2 bag record`; name one: {tmp_path / 'a.mcap'}" in said


def test_a_description_that_is_not_understood_is_told(messages, tmp_path, capsys):
    others = without(messages, "description")
    for text in ("{}", "[1]", '{"strands": 3, "scene_text": 1}', "\udcff"):
        data = text_message("x" * 4).replace(b"xxxx", b"\xff" * 4) if text == "\udcff" else text_message(text)
        bag = write_mcap(tmp_path / "bag.mcap", [(f"{ROBOT}/description", "std_msgs/msg/String", EPOCH, data), *others])
        assert f"{bag}: {ROBOT}/description: " in refused(["export", bag, "--npz", tmp_path / "a.npz"], capsys)
        assert main(["info", str(bag)]) == 0


def test_the_description_of_a_run_is_the_last_one_before_it(log, messages, tmp_path):
    other = (f"{ROBOT}/description", "std_msgs/msg/String", EPOCH - 10, text_message("{}"))
    later = (f"{ROBOT}/description", "std_msgs/msg/String", EPOCH + 10**9, text_message("{}"))
    assert compare(log, write_bag(tmp_path / "bag", [other, *messages, later])).equal


def test_a_log_is_named_by_its_node_as_a_bag_is(log):
    assert compare(log, f"{log}:/bilayer_sim").equal
    with pytest.raises(InputError, match="holds no messages of /other"):
        read_log(f"{log}:/other")


def test_names_of_strangers_lead_to_no_file_outside_of_an_export(messages, tmp_path, capsys):
    topic, kind = f"{ROBOT}/stimulus_applied", "std_msgs/msg/Float64MultiArray"
    bodies = [
        (f"{ROBOT}/body_pose/{name}", *of[1:]) for of in messages if "pose/hub" in of[0] for name in ("..", "a b")
    ]
    bag = write_mcap(tmp_path / "bodies.mcap", [*without(messages, "description"), *bodies])
    assert not [name for name in read_log(bag).quantities if ".." in name or " " in name]
    for number, data in enumerate((multi_array_template(["../../x"]).to_bytes(), HEADER + bytes([9] * 8))):
        few = [of for of in messages if not of[0].endswith(("/description", "/stimulus_applied"))]
        bag = write_mcap(tmp_path / f"{number}.mcap", [(topic, kind, EPOCH, data), *few])
        assert f"{bag}: {topic}: " in refused(["export", bag, "--csv", tmp_path / "out"], capsys)
        assert not (tmp_path / "out").exists() and main(["info", str(bag)]) == 0
