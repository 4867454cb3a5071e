"""The writer of logs against the library's own, and its blocks of small messages against messages made one by one."""

import io

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer
from support import synthetic_run

from bilayer_core.log.file.frame_block import FrameBlock
from bilayer_core.log.file.mcap_file import McapFile, message_head, time_and_sequence
from bilayer_core.log.messages.encoders import FrameEncoder

TOPICS = ("/a", "/b", "/never", "/d")


def messages(count, seed=3):
    """Channel, time [ns], sequence and data of random messages, times in and out of order."""
    random = np.random.default_rng(seed)
    for sequence in range(count):
        size = int(random.integers(0, 3000)) * int(random.random() < 0.8)
        yield int(random.choice([1, 2, 4])), int(random.integers(0, 2**40)), sequence, random.bytes(size)


def written(make, count, flush_after):
    """The file that a writer makes of the same calls."""
    file = io.BytesIO()
    log = make(file)
    for number, (channel, time, sequence, data) in enumerate(messages(count)):
        log.message(channel, time, sequence, data)
        if number in flush_after:
            log.flush()
    log.end()
    return file.getvalue()


class Library:
    def __init__(self, file):
        self.log = Writer(file, chunk_size=20_000, compression=CompressionType.LZ4)
        self.log.start(profile="ros2", library="test")
        self.log.add_attachment(0, 0, "scene.yaml", "application/yaml", b"schema: 1\n")
        self.log.add_metadata("versions", {"one": "1", "über": "2"})
        schemas = [self.log.register_schema(name, "ros2msg", b"float64 data\n") for name in ("p/msg/A", "p/msg/B")]
        for number, topic in enumerate(TOPICS):
            self.log.register_channel(topic, "cdr", schemas[number % 2], {"qos": "- depth: 1"})
        self.flush = self.log.flush

    def message(self, channel, time, sequence, data):
        self.log.add_message(channel, time, data, time, sequence)

    def end(self):
        self.log.flush()
        self.log.add_metadata("run", {"complete": "true"})
        self.log.finish()


class Own:
    def __init__(self, file):
        self.log = McapFile(file, 20_000, "ros2", "test")
        self.log.add_attachment("scene.yaml", "application/yaml", b"schema: 1\n")
        self.log.add_metadata("versions", {"one": "1", "über": "2"})
        schemas = [self.log.add_schema(name, "float64 data\n") for name in ("p/msg/A", "p/msg/B")]
        for number, topic in enumerate(TOPICS):
            self.log.add_channel(topic, schemas[number % 2], {"qos": "- depth: 1"})
        self.flush, self.message = self.log.flush, self.log.add_message

    def end(self):
        self.log.flush()
        self.log.add_metadata("run", {"complete": "true"})
        self.log.finish()


@pytest.mark.parametrize("count", [0, 1, 200])
def test_a_file_has_the_bytes_that_the_library_writes(count):
    flush_after = {0, 17, 18, 150}
    assert written(Own, count, flush_after) == written(Library, count, flush_after)


def test_a_block_holds_the_messages_that_the_encoder_makes_one_by_one():
    encoder = FrameEncoder(synthetic_run.description())
    random = np.random.default_rng(5)
    small = encoder.small_messages(synthetic_run.random_frame(random))
    channels = {name: 7 + number for number, name in enumerate(small)}
    block = FrameBlock(small, channels)
    ends = [begin for _, begin in block.places[1:]] + [len(block.records)]
    for sequence in (0, 70_000):
        frame = synthetic_run.random_frame(random)
        block.fill(frame, sequence)
        for name, (channel, begin), end in zip(small, block.places, ends, strict=True):
            data = encoder.encode(name, frame)
            head, moment = message_head(channels[name], len(data))
            expected = head[:moment] + time_and_sequence(round(frame.time * 1e9), sequence) + data
            assert (channel, bytes(block.records[begin:end])) == (channels[name], expected), name
