"""Logs are read quantity by quantity, and as much of them is in memory as was asked for."""

import tracemalloc

import numpy as np
import pytest
from benchmarks.large_log import write_log
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer
from support import synthetic_run

from bilayer_core import compare, read_log
from bilayer_core.cli import main
from bilayer_core.errors import InputError
from bilayer_core.log.file import log_records
from bilayer_core.log.file.log_chunks import LogFile
from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_core.log.run.bag import Bag
from bilayer_core.log.run.log_reader import read_info, read_state
from bilayer_core.log.run.log_source import LogSource

LARGE = 60.0
"""Of the log [MB]."""
MOST_MEMORY = 40e6
"""Above the result that is asked for [bytes]."""
ROD = "rod/arm_1/active"


@pytest.fixture(scope="module")
def large(tmp_path_factory):
    directory = tmp_path_factory.mktemp("large")
    write_log(directory / "run.mcap", LARGE)
    data = (directory / "run.mcap").read_bytes()
    (directory / "cut.mcap").write_bytes(data[: -len(data) // 50])
    return directory


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "run.mcap"
    synthetic_run.run(McapRecorder(path, rate=50.0, marker_rate=25.0), np.arange(0, 26) * 0.02)
    return path


@pytest.fixture
def unpacked(monkeypatch):
    """How many chunks have been unpacked."""
    counted, unpack = [], log_records.unpacked
    monkeypatch.setattr(log_records, "unpacked", lambda data: counted.append(1) or unpack(data))
    return counted


def mass_centre_of_bag(path):
    """The mass centre in a file that is read as a bag is, which has no times of its own."""
    bag = Bag(path)
    source = LogSource(path, *bag.opened(bag.runs[0]))
    return source.read(source.entries["com"])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("what", "use"),
    [
        ("info", lambda at: read_info(at / "run.mcap")),
        ("one quantity", lambda at: read_log(at / "run.mcap")["com"]),
        pytest.param(
            "a quantity of nodes", lambda at: read_log(at / "run.mcap")[f"{ROD}/strain"], marks=pytest.mark.verify
        ),
        ("a state", lambda at: read_state(at / "run.mcap", 3.0)),
        pytest.param("a quantity of a bag", lambda at: mass_centre_of_bag(at / "run.mcap"), marks=pytest.mark.verify),
        ("compare", lambda at: compare(at / "run.mcap", at / "cut.mcap")),
        ("repair", lambda at: main(["repair", str(at / "cut.mcap"), str(at / "new.mcap"), "--force"])),
        pytest.param(
            "csv",
            lambda at: main(["export", str(at / "run.mcap"), "--csv", str(at / "csv"), "--force"]),
            marks=pytest.mark.verify,
        ),
        pytest.param(
            "npz",
            lambda at: main(["export", str(at / "run.mcap"), "--npz", str(at / "run.npz"), "--force"]),
            marks=pytest.mark.verify,
        ),
        pytest.param(
            "plot",
            lambda at: main(["plot", str(at / "run.mcap"), "com", "--out", str(at / "com.png"), "--force"]),
            marks=pytest.mark.verify,
        ),
    ],
)
def test_a_large_log_is_used_in_little_memory(what, use, large):
    read_info(large / "cut.mcap")  # what is imported at the first use
    tracemalloc.start()
    try:
        use(large)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    print(f"{what}: {peak / 1e6:.1f} MB")
    assert peak < MOST_MEMORY


def test_what_a_log_holds_is_known_without_unpacking_it(log, unpacked):
    file = LogFile(log)
    assert len(file.times("/bilayer_sim/com")) == 26 and len(file.times("/bilayer_sim/nodes")) == 13
    assert unpacked == []


def test_one_state_is_read_from_its_chunk_alone(log, unpacked):
    assert read_state(log, 0.31)[1] == 0.3
    assert len(unpacked) <= 2


def test_a_quantity_is_read_once_and_kept(log, unpacked):
    run = read_log(log)
    assert run["com"] is run["com"]
    before = len(unpacked)
    assert run["com"].values is not None and len(unpacked) == before


def test_quantities_are_the_same_one_by_one_and_all_together(log):
    apart, together = read_log(log), read_log(log)
    assert len(together.positions) and len(together.com)  # all at once
    for name in together.quantities:
        np.testing.assert_array_equal(apart[name].values, together[name].values, err_msg=name)
        assert apart[name].values.dtype == together[name].values.dtype, name


def test_blocks_of_any_size_have_the_same_rows(log):
    source = LogSource(log)
    wanted = [source.entries[name] for name in ("com", "body/ball/position")]
    whole = {entry.name: source.read(entry).values for entry in wanted}
    for most in (1, 1000, 1 << 20):
        blocks = list(source.blocks(wanted, most))
        assert [rows.start for rows, _ in blocks[1:]] == [rows.stop for rows, _ in blocks[:-1]]
        for name, values in whole.items():
            np.testing.assert_array_equal(np.concatenate([block[name] for _, block in blocks]), values)


def test_a_file_of_another_writer_without_chunks_or_index_is_read(log, tmp_path):
    for name, options in {
        "bare": {"use_chunking": False},
        "zstd": {"compression": CompressionType.ZSTD, "index_types": IndexType.NONE, "use_statistics": False},
    }.items():
        path = tmp_path / f"{name}.mcap"
        with log.open("rb") as source, path.open("wb") as target:
            reader, writer = make_reader(source), Writer(target, **options)
            writer.start("ros2")
            for item in reader.iter_attachments():
                writer.add_attachment(item.create_time, item.log_time, item.name, item.media_type, item.data)
            for item in reader.iter_metadata():
                writer.add_metadata(item.name, item.metadata)
            numbers = {}
            for schema, channel, message in reader.iter_messages(log_time_order=False):
                if channel.topic not in numbers:
                    schema_number = writer.register_schema(schema.name, schema.encoding, schema.data)
                    numbers[channel.topic] = writer.register_channel(channel.topic, "cdr", schema_number)
                writer.add_message(numbers[channel.topic], message.log_time, message.data, message.publish_time)
            writer.finish()
        assert compare(log, path).equal, name
        assert len(read_log(path).times) == 26


def test_an_index_that_says_other_times_is_noticed(log, tmp_path):
    number = next(number for number, of in LogFile(log).channels.items() if of.topic == "/bilayer_sim/com")
    with log.open("rb") as file:
        indexes = [place for place in log_records.walk(file) if place.opcode == log_records.MESSAGE_INDEX]
        place = next(p for p in indexes if log_records.read_index(log_records.content(file, p))[0] == number)
    data = bytearray(log.read_bytes())
    data[place.offset + 6 + 3] ^= 0x01  # the first time
    (tmp_path / "run.mcap").write_bytes(data)
    with pytest.raises(InputError, match="its index says another time for /bilayer_sim/com"):
        read_log(tmp_path / "run.mcap").com  # noqa: B018


def test_opcodes_are_those_of_the_format():
    names = ("HEADER", "FOOTER", "SCHEMA", "CHANNEL", "MESSAGE", "CHUNK", "MESSAGE_INDEX", "ATTACHMENT", "METADATA")
    assert all(getattr(log_records, name) == Opcode[name] for name in (*names, "DATA_END"))
