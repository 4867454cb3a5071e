"""The demonstration as a newcomer runs it."""

import os
import re
import subprocess
import sys

import pytest

from bilayer_core.record.log_reader import read_info

PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"


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
    figures = {name: float(value) for name, value in re.findall(r"^([a-z ]+?)  +([-\d.]+)", demo.stdout, re.M)}
    assert figures["ball lifted by"] == pytest.approx(100.0, abs=1.0)  # mm, as the hub's path says
    assert figures["first contact"] == pytest.approx(12.9, abs=0.3)  # s, shortly before the ramp's end
    assert figures["contact nodes"] >= 4  # one an arm
    assert read_info(runs / "gripping.mcap").complete
    assert (runs / "gripping.png").read_bytes().startswith(PNG_SIGNATURE)
    assert (runs / "gripping.rrd").stat().st_size > 1e6
