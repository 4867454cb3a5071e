"""Logs that are shown while they are written."""

import io
import itertools
import os
import re
import shutil
import signal
import socket
import subprocess
import time
from contextlib import contextmanager

import numpy as np
import psutil
import pytest
from PIL import Image
from support import processes, recordings, synthetic_run

from bilayer_core.cli import main
from bilayer_core.errors import InputError
from bilayer_core.log.file.growing_log import GrowingLog
from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_core.log.messages.packing import pack, unpack
from bilayer_core.log.messages.topics import Rate, output_topics
from bilayer_core.log.run.log_reader import read_log
from bilayer_core.log.run.unfinished_run import ArrivingRun
from bilayer_core.view import viewer_process
from bilayer_core.view.live import LiveView
from bilayer_core.view.server import ViewServer

TIMES = np.arange(0, 101) * 0.04
LIMIT = 60.0
"""Longest wait for a process [s]."""


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("live") / "run.mcap"
    synthetic_run.run(McapRecorder(path, rate=25.0, marker_rate=12.5), TIMES)
    return path


def wait_until(condition, what):
    deadline = time.monotonic() + LIMIT
    while not condition():
        assert time.monotonic() < deadline, f"waited for {what}"
        time.sleep(0.05)


class Follower:
    """``bilayer view --follow`` as a process."""

    def __init__(self, directory, *arguments):
        self._path = directory / "said.txt"
        self._file = self._path.open("w")
        self.process = psutil.Popen(
            processes.command("view", "--follow", "--serve", *arguments),
            cwd=directory,
            env=processes.environment(),
            stdout=self._file,
            stderr=subprocess.STDOUT,
        )

    @property
    def said(self):
        return self._path.read_text()

    def wait_for(self, text):
        wait_until(lambda: text in self.said or self.process.poll() is not None, text)
        assert text in self.said, self.said

    def interrupt(self):
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(LIMIT)


@contextmanager
def following(directory, *arguments):
    follower = Follower(directory, *arguments)
    try:
        yield follower
    finally:
        if follower.process.poll() is None:
            follower.process.kill()
            follower.process.wait()


def test_a_log_is_shown_while_it_grows_from_zero_and_at_this_machine_alone(tmp_path):
    recorder = McapRecorder(tmp_path / "run.mcap", rate=25.0, marker_rate=12.5)
    recorder.start(synthetic_run.description())
    with following(tmp_path, "run.mcap", "--save", "seen.rrd") as follower:
        for number, moment in enumerate(TIMES):
            recorder.observe(synthetic_run.frame(float(moment), 4.0))
            if number == 30:
                follower.wait_for("following run.mcap: rerun rerun+http://127.0.0.1:")
                wait_until((tmp_path / "seen.rrd").exists, "what is shown before the end")
                addresses = recordings.listening(follower.process)
        recorder.close(True)
        follower.wait_for("run.mcap is finished")
        assert follower.interrupt() == 130
        said = follower.said
    assert {address for address, _ in addresses} == {"127.0.0.1"} and len(addresses) == 2
    assert {port for _, port in addresses} == set(map(int, re.findall(r":(\d+)/(?:proxy|\?url)", said)))
    seen, run = recordings.times_of(tmp_path / "seen.rrd"), read_log(tmp_path / "run.mcap")
    for strand in run.description.strands:
        np.testing.assert_allclose(seen[f"/world/strands/{strand.name}"], run.shape_times)
    for entity in ("/world/bodies/ball", "/plots/stimulus/humidity", "/plots/energy/bend"):
        np.testing.assert_allclose(seen[entity][-100:], run.times[-100:])
    assert seen["/events"].tolist() == [event.time for event in run.events]
    assert seen["/legend"][0] == seen["/summary"][0] == 0.0


def test_a_log_that_replaces_another_is_shown_as_another_recording(log, tmp_path):
    shutil.copy(log, tmp_path / "run.mcap")
    with following(tmp_path, "run.mcap", "--save", "seen.rrd") as follower:
        follower.wait_for("is finished")
        synthetic_run.run(McapRecorder(tmp_path / "other.mcap", rate=25.0, marker_rate=25.0), TIMES[:20])
        os.replace(tmp_path / "other.mcap", tmp_path / "run.mcap")
        follower.wait_for("was replaced by another log")
        wait_until(lambda: follower.said.count("is finished") == 2, "the end of the other log")
        follower.interrupt()
    first, second = (recordings.times_of(tmp_path / name)["/world/middle"] for name in ("seen.rrd", "seen_1.rrd"))
    assert (first[0], first[-1], second[0]) == (0.0, 4.0, 0.0)
    np.testing.assert_allclose(second, TIMES[:20])


def test_a_growing_log_gives_what_reading_it_whole_does(log, tmp_path):
    data = log.read_bytes()
    part = tmp_path / "part.mcap"
    part.write_bytes(data[: len(data) // 3])
    growing, arriving, taken = GrowingLog(part), ArrivingRun(synthetic_run.description()), []
    for size in [*range(len(data) // 3, len(data), 12_345), len(data)]:
        part.write_bytes(data[:size])
        for message in growing.read():
            arriving.add(*message)
        if (run := arriving.take()) is not None:
            taken.append(run)
    whole = read_log(log)
    assert growing.finished and len(taken) > 2
    for name in ("times", "com", "body_quaternions", "stimulus", "shape_times", "positions", "strain"):
        np.testing.assert_array_equal(np.concatenate([getattr(of, name) for of in taken]), getattr(whole, name))
    assert tuple(event for of in taken for event in of.events) == whole.events


def test_of_what_a_transport_loses_only_whole_frames_are_shown(log):
    arriving, generator = ArrivingRun(synthetic_run.description()), np.random.default_rng(3)
    come, names = [], set()
    for message in GrowingLog(log).read():
        if generator.random() > 0.1:
            come.append(message)
            names.add(message[0])
    for message in [*come, *come[:50]]:  # some come twice
        arriving.add(*message)
    run = arriving.take()
    stamps = {name: {stamp for of, stamp, _ in come if of == name} for name in names}
    needed = [spec for spec in output_topics(run.description) if spec.name not in ("/clock", "state", "markers")]
    for times, display in ((run.times, False), (run.shape_times, True)):
        whole = [stamps[spec.full_name()] for spec in needed if (spec.rate is Rate.DISPLAY) == display]
        assert np.rint(times * 1e9).astype(int).tolist() == sorted(set.intersection(*whole))
        assert 0.2 * len(TIMES) < len(times) < 0.9 * len(TIMES)
    assert np.isfinite(run.com).all() and np.isfinite(run.positions).all()
    assert arriving.take() is None


def test_a_taken_port_is_said_and_without_a_wish_the_next_one_is_taken():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(InputError, match=f"--port: {port} is taken by another program"):
            ViewServer(port=port)
    with ViewServer() as first, ViewServer() as second:
        assert len({first.port, first.web_port, second.port, second.web_port}) == 4
        assert first.viewer_address == f"rerun+http://127.0.0.1:{first.port}/proxy"
        assert first.web_address.startswith(f"http://127.0.0.1:{first.web_port}/?url=rerun%2Bhttp://127.0.0.1:")


def test_an_address_that_is_not_of_this_machine_is_refused():
    with pytest.raises(InputError, match=r"--bind: cannot listen at 192\.0\.2\.7"):
        ViewServer(bind="192.0.2.7")
    with pytest.raises(InputError, match="--bind: cannot listen at nowhere"):
        ViewServer(bind="nowhere.invalid")


def test_what_cannot_be_followed_is_refused_in_one_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty.mcap").write_bytes(b"")
    for arguments, said in [
        (["none.mcap"], "none.mcap: cannot be read: No such file"),
        (["empty.mcap"], "empty.mcap: is not an MCAP log"),
        (["run.rrd"], "--follow: run.rrd is a rerun recording"),
        (["run.mcap", "--node", "/other"], "--node: is followed without a log"),
        (["run.mcap", "--screenshot", "a.png"], "--screenshot: is of a run that is over"),
    ]:
        assert main(["view", "--follow", "--serve", *arguments]) == 2
        told = capsys.readouterr().err
        assert said in told and told.count("\n") == 1


def test_parts_of_a_frame_come_back_and_a_frame_that_lacks_some_is_refused():
    parts = [("/bilayer_sim/com", b"1234"), ("/a:b", b""), ("/clock", b"5")]
    label, data = pack(parts)
    assert unpack(label, data) == parts
    for bad in [(label, data + b"6"), ("com", b""), ("com:x", b"1"), ("com:-1", b"")]:
        with pytest.raises(InputError, match="parts of a frame"):
            unpack(*bad)


@pytest.mark.parametrize("lost", ["com", "points"])
def test_a_look_may_find_shapes_without_figures_or_figures_without_shapes(log, tmp_path, lost):
    with ViewServer() as server:
        view, kept = LiveView(server, save=tmp_path / "seen.rrd"), []
        view.begin(synthetic_run.description())
        for number, (stamp, frame) in enumerate(itertools.groupby(GrowingLog(log).read(), lambda message: message[1])):
            kept.append(number < 2 or number % 3 == 0)
            for topic, _, data in frame:
                if kept[-1] or not topic.endswith(lost):
                    view.add(topic, stamp, data)
            view.show()
        view.close()
    seen, run = recordings.times_of(tmp_path / "seen.rrd"), read_log(log)
    times = {"com": ("/world/bodies/ball", run.times), "points": ("/world/middle", run.shape_times)}
    whole = run.times[np.array(kept)]
    for topic, (entity, all_times) in times.items():
        expected = np.intersect1d(all_times, whole) if topic == lost else all_times
        np.testing.assert_allclose(seen[entity], expected)


def test_many_runs_leave_no_threads_behind_in_who_shows_them(log):
    messages, process = GrowingLog(log).read()[:300], psutil.Process()
    with ViewServer() as server:
        view, used = LiveView(server), []
        for _ in range(12):
            view.begin(synthetic_run.description())
            for message in messages:
                view.add(*message)
            view.show()
            used.append(process.num_threads())
        view.close()
    assert used[-1] <= used[3]


@pytest.mark.slow
def test_a_viewer_that_connects_late_sees_the_robot_with_its_layout_at_any_time(log, tmp_path):
    with following(tmp_path, log) as follower, viewer_process.HeadlessViewer() as viewer:
        follower.wait_for("is finished")
        viewer.open(re.search(r"rerun\+http://\S+", follower.said)[0])
        shown = []
        for moment in (0.0, 4.0):
            viewer.set_time(moment)
            picture = Image.open(io.BytesIO(viewer.picture())).convert("RGB")
            shown.append(np.asarray(picture).astype(int)[70:860, :1195])
        assert viewer.complaints() == []
        views = {view.name for view in viewer.client.get_state().views}
        (recording,) = viewer.client.get_state().recordings
    assert {"Robot", "axial strain [%]", "Run", "Stimulus", "Contact force [N]", "Solver", "Events"} <= views
    assert [(item.name, item.start, item.end) for item in recording.timelines] == [("sim_time", 0, 4 * 10**9)]
    red, green = (
        [np.count_nonzero((part[..., a] > 110) & (part[..., a] > 1.7 * part[..., b])) for part in shown]
        for a, b in ((0, 2), (1, 0))
    )
    assert red[1] > red[0] + 3000  # arms that are strained, beside the ball
    assert green[0] == 0 and green[1] > 500  # arrows of contact
