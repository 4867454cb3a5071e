"""The page about logs: its programs run one after the other, then its commands, and print what it says."""

import os
import shutil
import subprocess
import sys

import pytest
from support.documents import blocks, is_told
from support.processes import TIMEOUT, environment

from bilayer_core import Simulator, load_scene
from bilayer_core.log.file.mcap_log import McapRecorder

MCAP_INCLUDE = os.environ.get("MCAP_INCLUDE", "")
"""The folder `cpp/mcap/include` of a checkout of MCAP."""
PAGE = "docs/logs.md"


@pytest.mark.slow
def test_the_programs_and_commands_of_the_page_about_logs_do_what_it_says(root, tmp_path):
    told = blocks(root / PAGE)
    program = "\n".join(block.text for block in told if block.info == "python")
    script = f'bilayer() {{ "{sys.executable}" -m bilayer_core "$@"; }}\n'
    script += "\n".join(block.text for block in told if block.info == "sh")
    outputs = []
    for command in ([sys.executable, "-c", program], ["bash", "-e", "-c", script]):
        done = subprocess.run(command, cwd=tmp_path, env=environment(), capture_output=True, text=True, timeout=TIMEOUT)
        assert done.returncode == 0, done.stdout + done.stderr
        outputs.append(done.stdout)
    assert "RunData(bending: t = 0 to 0.4 s, 21 frames" in outputs[0] and "(9, " in outputs[0]
    assert (tmp_path / "height.pdf").stat().st_size > 1000
    for block in told:
        if block.info == "text":
            assert is_told(block.text, outputs[1]) is None


@pytest.mark.slow
def test_the_programs_of_the_page_about_python_run(root, tmp_path):
    program = "\n".join(block.text for block in blocks(root / "docs/python.md") if block.info == "python")
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, cwd=tmp_path, env=environment(), capture_output=True, text=True, timeout=TIMEOUT)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Simulator(gripping at t = 0 s" in done.stdout and "Termination.STOPPED" in done.stdout
    assert "Recorder(gripping: t = " in done.stdout and done.stdout.rstrip().endswith("True")


@pytest.mark.slow
@pytest.mark.skipif(not (MCAP_INCLUDE and shutil.which("g++")), reason="MCAP_INCLUDE names no headers of MCAP")
def test_the_program_in_c_plus_plus_prints_the_mass_centre(root, tmp_path):
    program = next(block.text for block in blocks(root / PAGE) if block.info == "cpp")
    (tmp_path / "com.cpp").write_text(program)
    build = ["g++", "-std=c++17", "-Wall", "-Werror", "-I", MCAP_INCLUDE, "com.cpp", "-llz4", "-lzstd", "-o", "com"]
    subprocess.run(build, cwd=tmp_path, check=True)
    simulator = Simulator(load_scene("bending"))
    simulator.run(0.1, observers=[McapRecorder(tmp_path / "run.mcap")])
    done = subprocess.run([tmp_path / "com", "run.mcap"], cwd=tmp_path, capture_output=True, text=True, check=True)
    last = [float(word) for word in done.stdout.splitlines()[-1].split()]
    assert last == pytest.approx([simulator.time, *simulator.com], rel=1e-8)
