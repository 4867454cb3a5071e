"""Logs of older versions, or of which something was taken out, say what they lack in words that help."""

import math

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from support import synthetic_run

from bilayer_core import Simulator, compare, load_scene, read_log
from bilayer_core.cli import main
from bilayer_core.errors import InputError
from bilayer_core.log.file.chain import CHAIN, Link
from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_core.log.messages.cdr import Template, read_float64_multi_array
from bilayer_core.log.messages.topics import MULTI_ARRAY
from bilayer_core.log.run.log_reader import read_info, read_state
from bilayer_core.runs.replay import verify

NO_LINK = Link(0, 0, "")


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "run.mcap"
    simulator = Simulator(load_scene("bending"))
    simulator.set_stimulus("swelling", 0.5)
    simulator.run(0.1, observers=[McapRecorder(path)])
    return path


def as_before(data):
    """A vector with names as logs once had it: a dimension for each name, with the number of its values."""
    names, values = read_float64_multi_array(data)
    sizes = [math.prod(map(int, name.split(":")[1].split("x"))) if ":" in name else 1 for name in names[:-1]]
    sizes += [len(values) - sum(sizes)] if names else []
    template = Template()
    template.put("<u4", len(names))
    for name, size in zip(names, sizes, strict=True):
        template.text(name)
        template.put("<u4", size, size)
    template.put("<u4", 0, len(values))
    template.array("data", "<f8", (len(values),))
    template.views()["data"][:] = values
    return template.to_bytes()


def stripped(log, path, topics=(), metadata=(), qos=True, vector=lambda data: data):
    """A copy without a hash, some topics and metadata records, and the quality of service, or with vectors changed."""
    with log.open("rb") as source, path.open("wb") as target:
        reader, writer = make_reader(source), Writer(target, compression=CompressionType.LZ4)
        writer.start("ros2")
        for item in reader.iter_attachments():
            writer.add_attachment(item.create_time, item.log_time, item.name, item.media_type, item.data)
        for item in reader.iter_metadata():
            if item.name not in {CHAIN, *metadata}:
                kept = {key: text for key, text in item.metadata.items() if key not in NO_LINK.as_metadata()}
                writer.add_metadata(item.name, kept)
        summary, numbers, types = reader.get_summary(), {}, {}
        for number, channel in summary.channels.items():
            if channel.topic not in topics:
                schema = summary.schemas[channel.schema_id]
                schema_number = writer.register_schema(schema.name, schema.encoding, schema.data)
                of, types[number] = channel.metadata if qos else {}, schema.name
                numbers[number] = writer.register_channel(channel.topic, "cdr", schema_number, of)
        for _, channel, message in reader.iter_messages(log_time_order=False):
            if channel.id in numbers:
                data = vector(message.data) if types[channel.id] == MULTI_ARRAY else message.data
                writer.add_message(numbers[channel.id], message.log_time, data, message.publish_time)
        writer.finish()
    return path


def test_a_log_of_this_version_lacks_nothing(log):
    assert read_info(log).lacks == ()


def test_a_log_with_a_dimension_for_each_name_is_read_and_replayed_as_ever(log, tmp_path, capsys):
    old = stripped(log, tmp_path / "old.mcap", vector=as_before)
    with old.open("rb") as file:
        (_, _, energy), *_ = make_reader(file).iter_messages(topics=["/bilayer_sim/energy"])
    assert int.from_bytes(energy.data[4:8], "little") == 3  # dimensions
    assert read_info(old).lacks == () and compare(log, old).equal
    whole, run = read_log(log), read_log(old)
    assert list(run.quantities) == list(whole.quantities) and "energy/bending" in run.quantities
    for name in run.quantities:
        np.testing.assert_array_equal(run[name].values, whole[name].values, err_msg=name)
    assert run.to_dataframe().equals(whole.to_dataframe())
    found = verify(old)
    assert found.passed and not found.wholeness.whole and "an older version wrote it" in found.wholeness.reason
    np.testing.assert_array_equal(read_state(old)[0], read_state(log)[0])
    for command in (
        ["plot", old, "energy/*", "--out", tmp_path / "plot.png"],
        ["view", old, "--save", tmp_path / "old.rrd"],
        ["export", old, "--npz", tmp_path / "old.npz"],
        ["repair", old, tmp_path / "whole.mcap"],
    ):
        assert main([str(part) for part in command]) == 0
    assert "energy/bending" in np.load(tmp_path / "old.npz")
    assert compare(log, tmp_path / "whole.mcap").equal


def test_a_log_without_what_acted_says_that_it_cannot_be_replayed(log, tmp_path, capsys):
    old = stripped(log, tmp_path / "old.mcap", topics=["/bilayer_sim/inputs"])
    assert main(["info", str(old)]) == 0
    assert "lacks     /bilayer_sim/inputs, what acted on the run: it cannot be replayed" in capsys.readouterr().out
    assert main(["replay", str(old), "--verify"]) == 2
    assert "does not hold what acted on the run" in capsys.readouterr().err
    assert compare(log, old).equal


@pytest.mark.parametrize(
    "topic", ["clamp_wrench/wall", "solver", "com", "energy", "points", "nodes", "stimulus_applied"]
)
def test_a_log_without_a_topic_has_all_else(topic, log, tmp_path, capsys):
    old = stripped(log, tmp_path / "old.mcap", topics=[f"/bilayer_sim/{topic}"])
    assert any(f"/bilayer_sim/{topic}: its quantities" in lack for lack in read_info(old).lacks)
    whole, run = read_log(log), read_log(old)
    missing = [name for name in whole.quantities if name not in run.quantities]
    assert missing and len(run.times) == len(whole.times)
    for name in run.quantities:
        np.testing.assert_array_equal(run[name].values, whole[name].values, err_msg=name)
    if topic not in ("energy", "solver"):  # whose parts only the topic itself names
        with pytest.raises(InputError, match=rf"{missing[0]}.*does not hold it: it has no /bilayer_sim/{topic}"):
            run[missing[0]]
    table = run.to_dataframe()
    assert len(table) == len(run.times) and not set(missing) & set(table)
    assert main(["export", str(old), "--npz", str(tmp_path / "old.npz")]) == 0
    found = compare(log, old)
    assert set(found.only[0]) == set(missing) and found.only[1] == ()


def test_what_a_log_does_not_hold_is_no_number(log, tmp_path):
    old = read_log(stripped(log, tmp_path / "old.mcap", topics=["/bilayer_sim/com", "/bilayer_sim/nodes"]))
    assert np.isnan(old.com).all() and np.isnan(old.material_frames).all()
    assert np.isfinite(old.positions).all() and np.isfinite(old.stimulus).all()


def test_older_metadata_is_told(log, tmp_path):
    old = read_info(stripped(log, tmp_path / "old.mcap", metadata=["machine", "run"], qos=False))
    assert (old.complete, old.termination) == (False, "cut off")
    assert any(lack.startswith("the machine it was made on") for lack in old.lacks)
    assert any(lack.startswith("the quality of service") for lack in old.lacks)


def test_a_log_without_states_says_so(log, tmp_path, capsys):
    old = stripped(log, tmp_path / "old.mcap", topics=["/bilayer_sim/state"])
    assert any("/bilayer_sim/state: no run can go on" in lack for lack in read_info(old).lacks)
    for words in (["replay", old, "--verify"], ["run", "bending", "--from-state", old]):
        assert main([*map(str, words), "--quiet"]) == 2
        assert "holds no state" in capsys.readouterr().err


def test_a_log_without_any_frame_is_read_as_empty(tmp_path):
    recorder = McapRecorder(tmp_path / "run.mcap")
    recorder.start(synthetic_run.description())
    recorder.close(False)
    run = read_log(tmp_path / "run.mcap")
    assert len(run.times) == len(run.com) == len(run.positions) == 0 and run["com"].values.shape == (0, 3)
    assert "empty" in repr(run)


@pytest.mark.parametrize("topic", ["body_pose/wall", "nodes"])
def test_a_log_without_shapes_or_poses_is_not_drawn(topic, log, tmp_path, capsys):
    old = stripped(log, tmp_path / "old.mcap", topics=[f"/bilayer_sim/{topic}"])
    assert main(["view", str(old), "--save", str(tmp_path / "old.rrd")]) == 2
    assert f"the log does not hold /bilayer_sim/{topic}, which is drawn" in capsys.readouterr().err
