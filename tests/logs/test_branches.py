"""Many runs from one instant of a log."""

import io
import re

import numpy as np
import pytest
from PIL import Image

from bilayer_core import Simulator, load_scene
from bilayer_core.cli import main
from bilayer_core.errors import InputError, SimulationError
from bilayer_core.log.run.log_reader import read_state
from bilayer_core.runs.branches import Varied, run_branches
from bilayer_core.runs.replay import branch


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("branches") / "run.mcap"
    simulator = Simulator(load_scene("bending"))
    simulator.set_stimulus("swelling", 0.5)
    simulator.run(0.2, log=path)
    return path


def test_each_branch_is_the_run_that_goes_on_with_its_value(log):
    varied = Varied.read("stimulus.swelling=0:1:3")
    found = list(run_branches(log, 0.1, varied, 0.2))
    assert [of.value for of in found] == [0.0, 0.5, 1.0] and not any(of.stopped for of in found)
    for of in found:
        simulator, inputs = branch(log, 0.1, stimuli={"swelling": of.value})
        simulator.run(until=0.2, inputs=inputs)
        np.testing.assert_array_equal(of.run.com[-1], simulator.com)
        assert of.run.times[0] == read_state(log, 0.1)[0][0] <= 0.1 and of.run.times[-1] == 0.2
    ends = [of.run.com[-1, 2] for of in found]
    assert len(set(ends)) == 3


def test_values_of_the_scene_may_differ_as_well(log):
    weak, strong = run_branches(log, 0.1, Varied.read("gravity.2=-1:-20:2"), 0.2)
    simulator, inputs = branch(log, 0.1, ["gravity.2=-20"])
    simulator.run(until=0.2, inputs=inputs)
    np.testing.assert_array_equal(strong.run.com[-1], simulator.com)
    assert strong.run.com[-1, 2] < weak.run.com[-1, 2]


def test_a_branch_that_cannot_go_on_says_why_and_the_others_go_on(log, monkeypatch):
    def run(self, *, until, **others):
        heavy = self.scene.gravity[2] < -15.0
        result = run_of(self, until=0.14 if heavy else until, **others)
        if heavy:
            raise SimulationError("it is too heavy", self.time)
        return result

    run_of = Simulator.run
    monkeypatch.setattr(Simulator, "run", run)
    hopeless, fine = run_branches(log, 0.1, Varied.read("gravity.2=-20:-1:2"), 0.2)
    assert hopeless.stopped == "it is too heavy" and hopeless.run.times[-1] == 0.14
    assert not fine.stopped and fine.run.times[-1] == 0.2


@pytest.mark.parametrize(
    "text", ["swelling", "a=1:2", "a=1:2:0", "a=1:2:1001", "a=1:x:3", "=1:2:3", "a=1:nan:3", "a=1:2:3:4", "a=1:2:2.5"]
)
def test_what_is_no_range_of_values_is_refused(text):
    with pytest.raises(InputError, match="--vary: .* must be NAME=FROM:TO:COUNT"):
        Varied.read(text)


@pytest.mark.parametrize(
    ("arguments", "fault"),
    [
        (["--vary", "stimulus.swelling=0:1:3"], "name that by --rrd"),
        (["--vary", "stimulus.swell=0:1:3", "--rrd", "OUT"], "no such channel"),
        (["--vary", "stimulus.swelling=0:2:3", "--rrd", "OUT"], "2.0 is not allowed|1.0"),
        (["--vary", "gravity.7=0:2:3", "--rrd", "OUT"], "there is no 7 of gravity"),
        (["--vary", "load.push=0:2:3", "--rrd", "OUT"], "no such load"),
    ],
)
def test_branches_that_cannot_be_are_refused_and_leave_no_file(log, tmp_path, capsys, arguments, fault):
    out = tmp_path / "out.rrd"
    arguments = [str(out) if word == "OUT" else word for word in arguments]
    code = main(["replay", str(log), "--from", "0.1", "--quiet", *arguments])
    told = capsys.readouterr().err
    assert code == 2 and re.search(fault, told), told
    assert not out.exists()


@pytest.mark.slow
def test_branches_are_overlaid_in_one_recording(log, tmp_path, capsys):
    from bilayer_core.view.viewer_process import HeadlessViewer

    out = tmp_path / "branches.rrd"
    command = ["replay", str(log), "--from", "0.1", "--vary", "stimulus.swelling=0:1:12", "--rrd", str(out)]
    assert main(command) == 0
    begin, told = read_state(log, 0.1)[0][0], capsys.readouterr()
    assert begin < 0.1 and f"12 branches from t = {begin:g} s to 0.2 s by stimulus.swelling" in told.out
    assert f"begins at t = {begin:.9g} s, where the last logged step before t = 0.1 s ended" in told.err
    with HeadlessViewer() as viewer:
        viewer.open(out)
        found = {item.entity_path for item in viewer.client.get_recording_schema(paths_only=True).entities}
        viewer.set_time(None)
        picture = np.asarray(Image.open(io.BytesIO(viewer.picture())).convert("RGB")).astype(int)
        assert viewer.complaints() == []
    assert {f"/world/branches/{k:02}/rods" for k in range(12)} <= found
    assert {f"/plots/height/{k:02}" for k in range(12)} <= found
    robot = picture[60:860, :1195]
    red, blue = robot[..., 0], robot[..., 2]
    assert np.count_nonzero((blue > 200) & (red < 110)) > 100  # the smallest value
    assert np.count_nonzero((red > 220) & (blue < 90)) > 100  # the largest
    assert main([*command, "--quiet"]) == 2
    assert "exists already" in capsys.readouterr().err
