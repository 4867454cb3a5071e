"""Logs with a patience: a disk that is slow, silent or full holds nobody up, and what is lost is told."""

import threading
import time

import numpy as np
import pytest
from support import synthetic_run
from support.slow_disks import Full, Valve

from bilayer_core.errors import OutputError
from bilayer_core.log.file import mcap_log
from bilayer_core.log.file.mcap_log import QUEUE_LENGTH, McapRecorder
from bilayer_core.log.messages.encoders import decode_input
from bilayer_core.log.messages.topics import INPUTS
from bilayer_core.log.run.log_reader import read_info, read_log, read_messages
from bilayer_core.observed.inputs import STIMULUS, Input

FRAMES = 300
PERIOD = 0.02


@pytest.fixture
def valve(monkeypatch):
    valve = Valve()
    monkeypatch.setattr(mcap_log, "open_alone", valve.file)
    yield valve
    valve.open()


def stall(recorder, valve):
    """Have the writer hang in a write."""
    valve.shut()
    recorder.observe(synthetic_run.frame(0.0))
    assert valve.stalled.wait(20.0)


def observe_all(recorder, frames=FRAMES):
    """Hand over frames with an input before each; the longest time that one took [s]."""
    longest = 0.0
    for step in range(1, frames + 1):
        moment, begin = step * PERIOD, time.monotonic()
        recorder.note(Input(step, moment, STIMULUS, "humidity", (step / frames,)))
        recorder.observe(synthetic_run.frame(moment))
        longest = max(longest, time.monotonic() - begin)
    return longest


def inputs_in(path):
    found = (data for _, _, _, data in read_messages(path, {INPUTS.full_name()}))
    return [decode_input(data) for data in found if data is not None]


def test_a_disk_that_hangs_costs_counted_frames_but_no_input_and_not_the_last(tmp_path, valve):
    path = tmp_path / "run.mcap"
    recorder = McapRecorder(path, patience=0.0)
    recorder.start(synthetic_run.description())
    stall(recorder, valve)
    observe_all(recorder)
    assert FRAMES - QUEUE_LENGTH <= recorder.dropped < FRAMES and recorder.failure == ""
    valve.open()
    recorder.close(True)
    assert [told.step for told in inputs_in(path)] == list(range(1, FRAMES + 1))
    info, run = read_info(path), read_log(path)
    assert info.complete and info.last_time == run.times[-1] == pytest.approx(FRAMES * PERIOD)
    assert len(run.times) == 1 + FRAMES - recorder.dropped
    assert np.diff(run.times).max() > 100 * PERIOD
    assert str(recorder.dropped).encode() in path.read_bytes()


def test_a_hanging_disk_is_waited_for_once_and_no_longer_than_the_patience(tmp_path, valve, monkeypatch):
    waits = []
    put = mcap_log.Backlog.put
    monkeypatch.setattr(
        mcap_log.Backlog, "put", lambda self, item, patience: waits.append(patience) or put(self, item, patience)
    )
    recorder = McapRecorder(tmp_path / "run.mcap", patience=0.2)
    recorder.start(synthetic_run.description())
    stall(recorder, valve)
    begin = time.monotonic()
    longest = observe_all(recorder)
    assert 0.2 <= longest and time.monotonic() - begin < 10.0
    assert waits.count(0.0) == recorder.dropped - 1 > 100
    valve.open()
    recorder.close(True)


def test_a_disk_that_keeps_up_loses_nothing_whatever_the_patience(tmp_path):
    recorder = McapRecorder(tmp_path / "run.mcap", patience=60.0)
    recorder.start(synthetic_run.description())
    observe_all(recorder)
    recorder.close(True)
    assert recorder.dropped == 0 and len(read_log(tmp_path / "run.mcap").times) == FRAMES


def test_a_disk_that_is_silent_at_the_end_is_given_up_and_told(tmp_path, valve, monkeypatch):
    monkeypatch.setattr(mcap_log, "LONGEST_SILENCE", 0.2)
    recorder = McapRecorder(tmp_path / "run.mcap", patience=0.0)
    recorder.start(synthetic_run.description())
    stall(recorder, valve)
    with pytest.raises(OutputError, match=r"run\.mcap could not be finished: nothing of it was taken in 0\.2 s"):
        recorder.close(True)
    valve.open()
    for thread in threading.enumerate():
        if thread.name == "mcap log":
            thread.join(20.0)


def test_with_a_patience_a_full_disk_ends_nothing_before_the_log_is_closed(tmp_path):
    path = tmp_path / "full.mcap"
    path.symlink_to("/dev/full")
    recorder = McapRecorder(path, force=True, patience=0.0)
    with pytest.raises(OutputError, match="No space left on device"):  # its head finds no room
        recorder.start(synthetic_run.description())


def test_with_a_patience_a_disk_that_fills_up_is_told_and_the_run_goes_on(tmp_path, monkeypatch):
    path = tmp_path / "run.mcap"
    monkeypatch.setattr(mcap_log, "open_alone", lambda path, force: Full(path.open("xb"), 300_000))
    recorder = McapRecorder(path, patience=60.0)
    recorder.start(synthetic_run.description())
    deadline = time.monotonic() + 60.0
    while not recorder.failure:
        observe_all(recorder, 10)
        assert time.monotonic() < deadline
    assert recorder.failure == f"the log {path} could not be written: No space left on device"
    dropped = recorder.dropped
    observe_all(recorder, 10)
    assert recorder.dropped == dropped + 10
    with pytest.raises(OutputError, match="No space left on device; it can be read up to t = ") as raised:
        recorder.close(True)
    assert raised.value.exit_code == 3 and "stopped at" not in str(raised.value)
    assert len(read_log(path).times) > 0


@pytest.mark.parametrize("patience", [None, 0.0])
def test_an_error_of_the_writer_itself_is_raised_as_it_is(tmp_path, monkeypatch, patience):
    monkeypatch.setattr(mcap_log._LogFile, "write", lambda self, item: [][0])
    recorder = McapRecorder(tmp_path / "run.mcap", patience=patience)
    recorder.start(synthetic_run.description())
    recorder.observe(synthetic_run.frame(0.0))
    with pytest.raises(IndexError) as raised:
        recorder.close(True)
    assert raised.value.__cause__ is None
