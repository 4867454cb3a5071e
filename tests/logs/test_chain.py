"""What `replay --verify` says of logs that are not whole, or whose messages are no longer those that were written."""

import pytest
from mcap.records import Attachment, Channel, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer
from support.acted_scenes import pushed

from bilayer_core import Simulator, load_scene
from bilayer_core.cli import main
from bilayer_core.log.file.chain import CHAIN, END, check_chain
from bilayer_core.log.file.log_chunks import LogFile
from bilayer_core.log.file.log_records import CHUNK, walk
from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_core.log.file.repair import repair
from bilayer_core.log.run.log_reader import read_description, read_info
from bilayer_core.runs.replay import verify

STATE, INPUTS = "/bilayer_sim/state", "/bilayer_sim/inputs"


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """A run of 0.2 s with 21 states, on which a stimulus acts four times."""
    path = tmp_path_factory.mktemp("log") / "run.mcap"
    simulator = Simulator(load_scene(pushed()))
    times = [0.03, 0.07, 0.12, 0.18]

    def act(time):
        if times and time >= times[0]:
            simulator.set_stimulus("heat", 3.0 * times.pop(0))

    simulator.run(0.2, observers=[McapRecorder(path, rate=100.0, tf="bilayer_sim")], each_step=act)
    return path


def rewritten(log, new, change=lambda messages: messages, records=lambda record: record, chunk_size=4000):
    """Write a log anew with the library `mcap`, in other chunks: its messages, as (topic, record), and other records
    as functions return them (None: without it).
    """
    with log.open("rb") as source, new.open("wb") as target:
        writer, schemas, topics, messages = Writer(target, chunk_size, CompressionType.LZ4), {}, {}, []
        writer.start("ros2")
        for record in StreamReader(source).records:
            if isinstance(record, Schema):
                schemas[record.id] = schemas.get(record.id) or writer.register_schema(
                    record.name, record.encoding, record.data
                )
            elif isinstance(record, Channel) and record.topic not in topics:
                topics[record.id] = record.topic
                topics[record.topic] = writer.register_channel(
                    record.topic, "cdr", schemas[record.schema_id], record.metadata
                )
            elif isinstance(record, Message):
                messages.append((topics[record.channel_id], record))
            elif isinstance(record, Attachment | Metadata) and (record := records(record)) is not None:
                if isinstance(record, Metadata):
                    writer.add_metadata(record.name, record.metadata)
                else:
                    writer.add_attachment(0, 0, record.name, record.media_type, record.data)
        for topic, of in change(messages):
            writer.add_message(topics[topic], of.log_time, of.data, of.publish_time, of.sequence)
        writer.finish()
    return new


def changed(data: bytes) -> bytes:
    """The same message with the last bit of a number in its middle flipped."""
    place = 4 + (len(data) - 4) // 16 * 8
    return data[:place] + bytes([data[place] ^ 1]) + data[place + 1 :]


def with_data(record, data):
    return Message(record.channel_id, record.log_time, data, record.publish_time, record.sequence)


def nth(messages, wanted, number):
    """Index of a message of a topic; negative numbers count from the end."""
    return [index for index, (topic, _) in enumerate(messages) if topic == wanted][number]


def without(topic, number, last=False):
    """A change: a message of a topic is gone, or all from it on."""

    def change(messages):
        index = nth(messages, topic, number)
        return [m for k, m in enumerate(messages) if m[0] != topic or (k < index if last else k != index)]

    return change


def with_other(topic, number):
    """A change: another value in a message of a topic."""

    def change(messages):
        index = nth(messages, topic, number)
        of = messages[index][1]
        return [*messages[:index], (topic, with_data(of, changed(of.data))), *messages[index + 1 :]]

    return change


def with_swapped_parts(messages):
    length = len(messages) // 10
    one, other = slice(3 * length, 4 * length), slice(6 * length, 7 * length)
    return [
        *messages[: one.start],
        *messages[other],
        *messages[one.stop : other.start],
        *messages[one],
        *messages[other.stop :],
    ]


def with_one_more(messages):
    index = nth(messages, STATE, -1)
    return [*messages, messages[index]]


def wholeness(path):
    return check_chain(path, read_description(path))


def test_a_log_is_whole_also_when_another_tool_packs_it_anew(log, tmp_path):
    assert wholeness(log).whole
    for size in (1000, 10_000_000):
        assert wholeness(rewritten(log, tmp_path / f"{size}.mcap", chunk_size=size)).whole
    assert wholeness(rewritten(log, tmp_path / "few.mcap", without("/bilayer_sim/points", 0, last=True))).whole


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (without(STATE, -3, last=True), "some states or inputs at the end were changed, removed or added"),
        (without(INPUTS, 3, last=True), "changed, removed or added"),
        (without(INPUTS, -1), "changed, removed or added"),
        (without(STATE, 10), "changed, removed or added"),
        (without(INPUTS, 3), "changed, removed or added"),
        (with_other(STATE, 10), "changed, removed or added"),
        (with_other(STATE, -1), "changed, removed or added"),
        (with_other(INPUTS, 3), "changed, removed or added"),
        (with_swapped_parts, "changed, removed or added"),
        (with_one_more, "some states or inputs at the end were changed, removed or added"),
        (lambda messages: [], "(0 of 21 states and 0 of "),
    ],
)
def test_states_and_inputs_that_are_missing_changed_added_or_moved_are_noticed(log, tmp_path, change, said):
    found = wholeness(rewritten(log, tmp_path / "new.mcap", change))
    assert not found.whole and said in found.reason


def test_the_last_time_up_to_which_all_is_as_written_is_told(log, tmp_path, monkeypatch):
    monkeypatch.setattr("bilayer_core.log.file.mcap_log.CHUNK_SIZE", 4000)
    long = tmp_path / "long.mcap"
    Simulator(load_scene(pushed())).run(0.2, observers=[McapRecorder(long, rate=100.0)])
    changed_at = LogFile(long).times(STATE)[6] / 1e9
    found = wholeness(rewritten(long, tmp_path / "new.mcap", with_other(STATE, 6)))
    end, begin = (float(text.split(" s")[0]) for text in found.reason.split("t = ")[1:])
    assert begin < changed_at <= end and end - begin < 0.08


@pytest.mark.parametrize("name", ["versions", "machine", "settings", "description", "scene.yaml"])
def test_a_changed_scene_or_description_is_noticed(log, tmp_path, name):
    def other(record):
        if record.name != name:
            return record
        if isinstance(record, Attachment):
            return Attachment(0, 0, name, record.media_type, record.data + b"\n")
        return Metadata(name, {**record.metadata, "added": "1"})

    found = wholeness(rewritten(log, tmp_path / "new.mcap", records=other))
    assert not found.whole and "scene, versions, machine, settings or description were changed" in found.reason


def test_missing_last_states_end_verify_with_1_though_all_others_are_equal(log, tmp_path, capsys):
    new = rewritten(log, tmp_path / "new.mcap", without(STATE, -3, last=True))
    assert main(["replay", str(new), "--verify"]) == 1
    told = capsys.readouterr().out
    assert "not whole: 18 states, " in told and " s were compared, and are equal" in told
    assert "(18 of 21 states and " in told
    assert read_info(new).lacks == ("3 states, which were taken out of it or lost",)


def chunks(path):
    """Places of the chunks of a log."""
    with path.open("rb") as file:
        return [place for place in walk(file) if place.opcode == CHUNK]


def test_a_log_that_was_cut_off_is_compared_as_far_as_it_goes_and_said_to_have_no_end(log, tmp_path, capsys):
    cut, new = tmp_path / "cut.mcap", tmp_path / "new.mcap"
    cut.write_bytes(log.read_bytes()[: chunks(log)[-1].end + 10])
    repair(cut, new)
    for path in (cut, new):
        assert main(["replay", str(path), "--verify", "--derived"]) == 1
        told = capsys.readouterr().out
        assert "not whole: 21 states" in told and "it has no end, as it was cut off or is still being written" in told
        assert "difference" not in told


def test_a_repaired_log_without_a_chunk_in_the_middle_says_so(tmp_path, monkeypatch):
    monkeypatch.setattr("bilayer_core.log.file.mcap_log.CHUNK_SIZE", 4000)
    log, damaged, new = (tmp_path / name for name in ("run.mcap", "damaged.mcap", "new.mcap"))
    Simulator(load_scene(pushed())).run(0.1, observers=[McapRecorder(log, rate=100.0)])
    places, data = chunks(log), bytearray(log.read_bytes())
    for place in places:  # the first chunk from the middle on that holds a state
        damaged.write_bytes(data[: place.end - 100] + bytes([data[place.end - 100] ^ 1]) + data[place.end - 99 :])
        new.unlink(missing_ok=True)
        (lost,) = repair(damaged, new).lost
        if place.begin > len(data) // 2 and len(LogFile(new).times(STATE)) < len(LogFile(log).times(STATE)):
            break
    assert "chunk" in lost
    found = verify(new)
    assert not found.passed and "changed, removed or added" in found.wholeness.reason


def test_a_repaired_log_of_which_only_the_index_was_lost_is_whole(log, tmp_path):
    cut, new = tmp_path / "cut.mcap", tmp_path / "new.mcap"
    cut.write_bytes(log.read_bytes()[:-20])
    repair(cut, new)
    assert wholeness(cut).whole and wholeness(new).whole


def test_a_log_that_left_frames_out_is_whole(tmp_path, monkeypatch):
    monkeypatch.setattr(
        McapRecorder, "_put_in_time", lambda self, frame: round(1e3 * frame.time) % 3 and self._put(frame) is None
    )
    path = tmp_path / "run.mcap"
    recorder = McapRecorder(path, rate=100.0, patience=0.0)
    Simulator(load_scene(pushed())).run(0.1, observers=[recorder])
    assert recorder.dropped > 1
    found = verify(path, derived=True)
    assert found.passed and 0 < found.states < recorder.dropped + found.states <= 11


def test_a_log_that_goes_on_after_a_reset_comes_out_and_is_whole(tmp_path):
    simulator, path = Simulator(load_scene(pushed())), tmp_path / "run.mcap"
    detach = simulator.attach(McapRecorder(path, rate=100.0))
    for stimulus in (0.5, 0.2):
        simulator.set_stimulus("heat", stimulus)
        simulator.run(0.05)
        simulator.step()  # no frame is of this one
        simulator.reset()
    simulator.run(0.03)
    detach()
    found = verify(path, derived=True)
    assert found.passed and found.inputs == 4 and found.states > 10


def test_a_log_without_a_hash_is_verified_and_said_to_be_of_an_older_version(log, tmp_path, capsys):
    def older(record):
        if record.name == END:
            kept = {"complete", "termination", "last_time"}
            return Metadata(END, {key: text for key, text in record.metadata.items() if key in kept})
        return None if record.name == CHAIN else record

    new = rewritten(log, tmp_path / "new.mcap", without(STATE, -1), older)
    assert main(["replay", str(new), "--verify"]) == 0
    told = capsys.readouterr().out
    assert "all equal bit for bit" in told and "whether some are missing cannot be seen" in told


# derived messages


DERIVED = "markers nodes points body_points energy com contact_wrench/hand body_pose/hand stimulus/heat".split()


def test_all_derived_messages_of_a_run_come_out_byte_for_byte(log):
    found = verify(log, derived=True)
    assert found.passed and found.derived > 21 * 6
    assert found.not_compared == ("/bilayer_sim/events", "/bilayer_sim/solver")


@pytest.mark.parametrize("topic", [*(f"/bilayer_sim/{name}" for name in DERIVED), "/clock", "/tf"])
def test_a_changed_derived_message_is_found_only_when_asked_for(log, tmp_path, capsys, topic):
    new = str(rewritten(log, tmp_path / "new.mcap", with_other(topic, 2)))
    assert main(["replay", new, "--verify"]) == 0
    assert "not compared: " in capsys.readouterr().out
    assert main(["replay", new, "--verify", "--derived"]) == 1
    told = capsys.readouterr().out
    assert "first difference of a derived message is at t = 0." in told
    assert f"the message of {topic} is not what the run made again gives" in told


@pytest.mark.parametrize("number", [4, -1])
def test_a_missing_derived_message_is_found_with_its_time(log, tmp_path, number):
    time = LogFile(log).times("/bilayer_sim/energy")[number] / 1e9
    found = verify(rewritten(log, tmp_path / "new.mcap", without("/bilayer_sim/energy", number)), derived=True)
    assert found.first_derived == f"t = {time:.9g} s: the message of /bilayer_sim/energy is missing"


def test_derived_messages_are_not_compared_within_a_tolerance(log, capsys):
    assert main(["replay", str(log), "--verify", "--derived", "--tolerance", "1e-3"]) == 2
    assert "--derived: compares messages byte by byte" in capsys.readouterr().err
    assert main(["replay", str(log), "--from", "0.1", "--derived"]) == 2
    assert "--derived: is for --verify" in capsys.readouterr().err
