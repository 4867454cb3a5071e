"""The demonstration as a newcomer runs it."""

import os
import re
import subprocess
import sys

import numpy as np
import pytest

from bilayer_core import Simulator, load_scene
from bilayer_core.log.run.log_reader import read_info, read_log
from bilayer_sim_ros.demo import BALL, CHANNEL, RAMP_DURATION, SCENE

ROUNDING = 1e-7
"""What steps make of last digits, which may differ between what two processes compile: 3e-9, with a margin [m]."""
PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"


def driven_directly():
    """The same run without ROS: at each frame its time [s], the ball's position [m] and how many nodes touch it."""
    scene = load_scene(SCENE)
    simulator = Simulator(scene)
    arms = slice(0, max(strand.nodes.stop for strand in simulator.description.strands))
    frames = []
    for count in range(1, round(scene.duration * scene.output.rate) + 1):
        due = count / scene.output.rate
        simulator.set_stimulus(CHANNEL, min(simulator.time / RAMP_DURATION, 1.0), over=due - simulator.time)
        while simulator.time < due:
            simulator.step(until=due)
        touching = np.any(simulator.contact_forces[arms] != 0.0, axis=1).sum()
        frames.append((simulator.time, simulator.bodies[BALL].position, touching))
    times, positions, touching = zip(*frames, strict=True)
    return np.array(times), np.array(positions), np.array(touching)


@pytest.mark.slow
def test_the_demonstration_lifts_the_ball_and_leaves_log_recording_and_picture(domain, tmp_path):
    runs = tmp_path / "runs"
    runs.mkdir()
    for left_over in ("gripping.mcap", "gripping.rrd", "gripping.png"):
        (runs / left_over).write_bytes(b"of an earlier run")
    demo = subprocess.run(
        [sys.executable, "-m", "bilayer_sim_ros.demo"],
        cwd=tmp_path,
        env=os.environ | {"ROS_DOMAIN_ID": str(domain)},
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert demo.returncode == 0, demo.stdout + demo.stderr
    run = read_log(runs / "gripping.mcap")
    times, positions, touching = driven_directly()
    ball = [body.name for body in run.description.bodies].index(BALL)
    assert run.times[1:] == pytest.approx(times, abs=1e-9)  # logs count nanoseconds
    np.testing.assert_allclose(run.body_positions[1:, ball], positions, rtol=0.0, atol=ROUNDING)
    first_touch = times[np.argmax(touching > 0)]
    first_contact = run.shape_times[run.shape_times >= first_touch - 1e-9][0]
    figures = {name: float(value) for name, value in re.findall(r"^([a-z ]+?)  +([-\d.]+)", demo.stdout, re.M)}
    assert figures["first contact"] == pytest.approx(first_contact, abs=0.05 + 1e-9)  # one decimal is printed
    assert figures["contact nodes"] == touching[-1] == 4  # one an arm
    assert figures["ball lifted by"] == pytest.approx(100.0, abs=1.0)  # mm, as the hub's path says
    assert read_info(runs / "gripping.mcap").complete
    assert (runs / "gripping.png").read_bytes().startswith(PNG_SIGNATURE)
    assert (runs / "gripping.rrd").stat().st_size > 1e6
