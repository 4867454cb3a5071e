import pytest
from mcap.writer import CompressionType, Writer
from support.written_logs import WITHOUT_INDEX, damage, number, value_of, write_log

from bilayer_core.errors import InputError
from bilayer_core.log.file.indexed_log import IndexedLog


def counted(topic="/a", count=100, period=0.1):
    """Messages 0, 1, 2, ... at even times."""
    return [(topic, index * period, number(index)) for index in range(count)]


def values(messages):
    return [value_of(message.data) for message in messages]


def numbers(log):
    return {channel.topic: channel.number for channel in log.channels}


@pytest.mark.parametrize("compression", list(CompressionType))
def test_messages_come_from_any_time_on_whatever_the_compression(tmp_path, compression):
    path = write_log(tmp_path / "run.mcap", counted(), compression=compression)
    with IndexedLog(path) as log:
        assert (log.start, log.end) == (0, 9_900_000_000)
        for start in (0, 1, 4_200_000_000, 9_900_000_000, 9_900_000_001):
            expected = [index for index in range(100) if index * 100_000_000 >= start]
            assert values(log.messages(numbers(log).values(), start)) == expected


def test_messages_come_by_time_and_those_of_one_time_as_in_the_file(tmp_path):
    late = [("/a", time, number(index)) for index, time in enumerate((5, 1, 4, 4, 2, 3, 4, 0))]
    with IndexedLog(write_log(tmp_path / "run.mcap", late, chunk_size=1)) as log:
        found = list(log.messages(numbers(log).values(), 0))
    assert values(found) == [7, 1, 4, 5, 2, 3, 6, 0]


def test_a_log_of_many_chunks_is_read_without_gap_or_repetition_from_any_time_on(tmp_path):
    out_of_order = sorted(counted(count=1000), key=lambda message: round(message[1] * 10) % 7 + message[1] // 2)
    with IndexedLog(write_log(tmp_path / "run.mcap", out_of_order, chunk_size=60)) as log:
        for start in range(0, 1001, 53):
            found = values(log.messages(numbers(log).values(), start * 100_000_000))
            assert found == list(range(start, 1000))


def test_only_messages_of_the_wished_channels_come(tmp_path):
    with IndexedLog(write_log(tmp_path / "run.mcap", counted("/a") + counted("/b", 3))) as log:
        assert len(list(log.messages([numbers(log)["/b"]], 0))) == 3
        assert {channel.topic: channel.count for channel in log.channels} == {"/a": 100, "/b": 3}


def test_two_channels_of_one_topic_are_told_apart(tmp_path):
    path = tmp_path / "run.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schemas = [writer.register_schema(f"std_msgs/msg/{name}", "ros2msg", b"") for name in ("Float64", "String")]
        for index, schema in enumerate(schemas):
            writer.add_message(writer.register_channel("/a", "cdr", schema), index, number(index), index)
        writer.finish()
    with IndexedLog(path) as log:
        first, second = (channel.number for channel in log.channels)
        assert values(log.messages([second], 0)) == [1]
        assert values(log.latest(first, 9, 9)) == [0]


def test_the_last_messages_before_a_time_leave_out_that_time(tmp_path):
    with IndexedLog(write_log(tmp_path / "run.mcap", counted())) as log:
        (channel,) = numbers(log).values()
        assert values(log.latest(channel, 5_000_000_000, 3)) == [47, 48, 49]
        assert values(log.latest(channel, 5_000_000_001, 1)) == [50]
        assert values(log.latest(channel, 100_000_001, 9)) == [0, 1]
        assert log.latest(channel, 0, 1) == []


def test_a_log_that_was_cut_off_anywhere_is_refused_and_repair_is_named(tmp_path):
    content = write_log(tmp_path / "run.mcap", counted()).read_bytes()
    path = tmp_path / "cut off.mcap"
    for length in (8, 20, len(content) // 2, len(content) - 30, len(content) - 1):
        path.write_bytes(content[:length])
        with pytest.raises(InputError, match=r"off\.mcap: has no index.*bilayer repair '.*off\.mcap' NEW\.mcap"):
            IndexedLog(path)


@pytest.mark.parametrize("options", [{"finish": False}, WITHOUT_INDEX])
def test_a_log_without_an_index_is_refused_and_repair_is_named(tmp_path, options):
    path = write_log(tmp_path / "run.mcap", counted(), **options)
    with pytest.raises(InputError, match="has no index.*bilayer repair"):
        IndexedLog(path)


def test_a_log_without_messages_is_refused(tmp_path):
    with pytest.raises(InputError, match="holds no message"):
        IndexedLog(write_log(tmp_path / "run.mcap", []))


@pytest.mark.parametrize("content", [b"", b"scene: gripping\n", bytes(1000)])
def test_what_is_no_log_is_refused(tmp_path, content):
    path = tmp_path / "run.mcap"
    path.write_bytes(content)
    with pytest.raises(InputError, match="is not an MCAP log"):
        IndexedLog(path)


def test_a_missing_file_and_a_directory_are_refused(tmp_path):
    for path in (tmp_path / "none.mcap", tmp_path):
        with pytest.raises(InputError, match="cannot be read"):
            IndexedLog(path)


@pytest.mark.parametrize("compression", list(CompressionType))
def test_a_damaged_chunk_is_told_when_it_is_read(tmp_path, compression):
    path = write_log(tmp_path / "run.mcap", counted(), compression=compression)
    damage(path)
    with IndexedLog(path) as log:
        with pytest.raises(InputError, match=r"run\.mcap: .*damaged"):
            list(log.messages(numbers(log).values(), 0))
        assert values(log.messages(numbers(log).values(), 9_000_000_000)) == list(range(90, 100))
