"""Logs that were cut off or are damaged become ones that strict readers open, with all that is whole."""

import io

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from support import synthetic_run

from bilayer_core import read_log
from bilayer_core.cli import main
from bilayer_core.errors import InputError
from bilayer_core.log.file.log_records import CHANNEL, CHUNK, SCHEMA, walk
from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_core.log.file.repair import repair
from bilayer_core.log.run.log_reader import read_info, read_messages

TIMES = np.arange(0, 76) * 0.02


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "run.mcap"
    recorder = McapRecorder(path, rate=50.0, marker_rate=25.0)
    synthetic_run.run(recorder, TIMES, inputs=synthetic_run.stimulus_before(25, TIMES))
    return path


@pytest.fixture
def damaged(log, tmp_path):
    """A function that writes a changed copy of the log and repairs that; returns what was found, and the new log."""

    def make(data: bytes):
        (tmp_path / "damaged.mcap").write_bytes(data)
        return repair(tmp_path / "damaged.mcap", tmp_path / "new.mcap"), tmp_path / "new.mcap"

    return make


def chunks_of(log):
    with log.open("rb") as file:
        return [place for place in walk(file) if place.opcode == CHUNK]


def messages_of(path):
    return [(topic, time, data) for topic, _, time, data in read_messages(path) if data is not None]


def assert_strict_readers_open(path, count):
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_summary().statistics.message_count == count
        assert sum(1 for _ in reader.iter_decoded_messages()) == count
        assert "scene.yaml" in [item.name for item in reader.iter_attachments()]
    with AnyReader([path]) as reader:
        read = [reader.deserialize(data, link.msgtype) for link, _, data in reader.messages()]
        assert len(read) == count


def test_what_is_kept_of_a_cut_log_is_what_was_written(log, damaged):
    places = chunks_of(log)
    for kept in (1, len(places) // 2):
        found, new = damaged(log.read_bytes()[: places[kept].offset + 100])
        assert (found.whole, found.chunks) == (False, kept)
        written = messages_of(log)[: found.messages]
        assert messages_of(new) == written and found.last_time == written[-1][1] / 1e9
        assert_strict_readers_open(new, found.messages)
        assert read_info(new).termination == "cut off"
        new.unlink()


def test_channels_keep_their_metadata_and_attachments_and_records_their_content(log, damaged):
    found, new = damaged(log.read_bytes()[:-3])
    contents = []
    for path in (log, new):
        with path.open("rb") as file:
            reader = make_reader(file)
            summary = reader.get_summary()
            channels = {c.topic: (c.message_encoding, c.metadata) for c in summary.channels.values()}
            schemas = {s.name: (s.encoding, s.data) for s in summary.schemas.values()}
            attachments = [(a.name, a.media_type, a.data) for a in reader.iter_attachments()]
            records = {m.name: m.metadata for m in reader.iter_metadata()}
            contents.append((reader.get_header().profile, channels, schemas, attachments, records))
    own = contents[1][4].pop("repair")
    assert contents[0] == contents[1] and own["lost"] == ""
    assert all("offered_qos_profiles" in metadata for _, metadata in contents[1][1].values())
    assert found.lost == [] and read_info(new).complete


def test_a_whole_log_is_copied_as_it_is(log, tmp_path, capsys):
    assert main(["repair", str(log), str(tmp_path / "new.mcap")]) == 0
    assert "the log is whole: copied as it is" in capsys.readouterr().out
    assert (tmp_path / "new.mcap").read_bytes() == log.read_bytes()


def test_a_flipped_byte_costs_its_chunk_alone_which_is_named(log, damaged):
    data, place = bytearray(log.read_bytes()), chunks_of(log)[2]
    data[place.offset + place.length // 2] ^= 0x10
    found, new = damaged(bytes(data))
    (lost,) = found.lost
    assert f"the chunk at byte {place.begin} (t = " in lost and "messages): its checksum is another one" in lost
    assert found.messages + int(lost.split("s, ")[1].split()[0]) == len(messages_of(log))
    assert_strict_readers_open(new, found.messages)
    assert any("lost before it was repaired: the chunk" in lack for lack in read_info(new).lacks)


def test_a_log_with_a_hole_has_only_whole_frames(log, damaged):
    data, places = log.read_bytes(), chunks_of(log)
    _, new = damaged(data[: places[2].begin] + data[places[2].begin + 1000 :])
    whole, run = read_log(log), read_log(new)
    assert 0 < len(run.times) < len(whole.times)
    kept = np.isin(whole.times, run.times)
    for name in ("com", "energy/bend", "body/ball/position", "stimulus/humidity"):
        np.testing.assert_array_equal(run[name].values, whole[name].values[kept])
    kept = np.isin(whole.shape_times, run.shape_times)
    np.testing.assert_array_equal(run.positions, whole.positions[kept])
    np.testing.assert_array_equal(run.material_frames, whole.material_frames[kept])


@pytest.mark.parametrize(
    "what",
    ["length of a chunk", "longer chunk", "length of an index", "length in an index", "zeros", "its first chunk"],
)
def test_what_comes_after_damage_is_found_again(what, log, damaged):
    data, places = bytearray(log.read_bytes()), chunks_of(log)
    if what == "length of a chunk":
        data[places[1].begin + 4] ^= 0xFF
    elif what == "longer chunk":
        length = (places[1].length + 1000).to_bytes(8, "little")
        data[places[1].begin + 1 : places[1].offset] = length
    elif what == "length of an index":
        data[places[1].end + 2] ^= 0x10
    elif what == "length in an index":
        data[places[1].end + 9 + 2] ^= 0x10
    elif what == "zeros":
        data[places[1].begin : places[1].begin + 5000] = bytes(5000)
    else:
        data[places[0].offset + 300] ^= 0xFF
    found, new = damaged(bytes(data))
    lost_chunks = 0 if what.startswith("longer") or what.endswith("index") else 1
    assert len(found.lost) == 1 and found.chunks == len(places) - lost_chunks
    assert_strict_readers_open(new, found.messages)


def test_random_damage_is_never_kept_silently_and_never_breaks_the_repair(log, tmp_path):
    data, random = log.read_bytes(), np.random.default_rng(3)
    written = set(messages_of(log))
    for _ in range(25):
        changed = bytearray(data)
        for place in random.integers(8, len(data), random.integers(1, 4)):
            changed[place] ^= 1 << random.integers(8)
        (tmp_path / "damaged.mcap").write_bytes(changed[: random.integers(len(data) // 2, len(data) + 1)])
        found = repair(tmp_path / "damaged.mcap", tmp_path / "new.mcap", force=True)
        kept = messages_of(tmp_path / "new.mcap")
        assert len(kept) == found.messages and set(kept) <= written


def test_what_follows_a_first_chunk_that_is_lost_is_kept_without_an_index(log, damaged):
    data, places = bytearray(log.read_bytes()), chunks_of(log)
    data[places[0].offset + 300] ^= 0xFF
    found, new = damaged(bytes(data[: places[3].begin]))  # neither the first chunk nor the index describes channels
    assert (found.whole, found.chunks, len(found.lost)) == (False, 2, 1)
    kept = messages_of(new)
    assert kept == [of for of in messages_of(log) if of in set(kept)] and found.messages == len(kept) > 100
    assert_strict_readers_open(new, found.messages)
    assert len(read_log(new).times) > 10


def test_a_description_outside_of_chunks_that_is_damaged_yields_to_that_inside(log, damaged):
    data = bytearray(log.read_bytes())
    at = data.index(b"/bilayer_sim/com")
    assert at < chunks_of(log)[0].begin
    data[at + 1] ^= 0x01
    found, new = damaged(bytes(data[:-3000]))
    assert messages_of(new) == messages_of(log)[: found.messages] and found.messages > 100


def test_messages_without_a_description_of_their_channel_are_told(log, damaged):
    data, places = bytearray(log.read_bytes()), chunks_of(log)
    data[places[0].offset + 300] ^= 0xFF
    outside = [place for place in walk(io.BytesIO(data[: places[0].begin])) if place.opcode in (SCHEMA, CHANNEL)]
    assert len(outside) > 10 and outside[-1].end == places[0].begin
    data[outside[0].begin : outside[-1].end] = b""
    found, new = damaged(bytes(data[:-3000]))  # nothing describes channels
    assert found.messages == 0 and "messages of channels that nothing describes" in found.lost[-1]
    assert len(read_log(new).times) == 0


def test_bad_names_are_refused_and_nothing_is_overwritten_or_left(log, tmp_path, capsys):
    other = tmp_path / "other.mcap"
    other.write_bytes(b"precious")
    for new, message in (
        (log, "is the log that is to be repaired"),
        (other, "exists already"),
        (tmp_path / "a", "must end"),
    ):
        assert main(["repair", str(log), str(new)]) == 2
        assert message in capsys.readouterr().err
    assert other.read_bytes() == b"precious"
    for content in (b"", b"no log at all", log.read_bytes()[:8]):
        (tmp_path / "file.mcap").write_bytes(content)
        with pytest.raises(InputError, match=r"file\.mcap: (is not an MCAP log|nothing in it can be kept)"):
            repair(tmp_path / "file.mcap", tmp_path / "new.mcap")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file.mcap", "other.mcap"]
