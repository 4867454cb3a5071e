"""The page about logs: its programs run one after the other, then its commands, and print what it says."""

import os
import shutil
import subprocess

import pytest
from support.documents import blocks, is_told, pasted

from bilayer_core import Simulator, load_scene
from bilayer_core.log.file.mcap_log import McapRecorder

MCAP_INCLUDE = os.environ.get("MCAP_INCLUDE", "")
"""The folder `cpp/mcap/include` of a checkout of MCAP."""
PAGE = "docs/logs.md"


def outputs_of(page, kind):
    """What the programs or commands of a page print, one after the other."""
    known, outputs = {}, ""
    for block in blocks(page):
        if block.info == kind:
            code, output = pasted(block, known)
            assert code == 0, f"line {block.line}:\n{output}"
            outputs += output
    return outputs


@pytest.mark.slow
def test_the_programs_and_commands_of_the_page_about_logs_do_what_it_says(root, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    printed, told = (outputs_of(root / PAGE, kind) for kind in ("python", "sh"))
    assert "RunData(bending: t = 0 to 0.4 s, 21 frames" in printed and "(9, " in printed
    assert (tmp_path / "height.pdf").stat().st_size > 1000
    for block in blocks(root / PAGE):
        if block.info == "text":
            assert is_told(block.text, told) is None


@pytest.mark.slow
def test_the_programs_of_the_page_about_python_run(root, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    printed = outputs_of(root / "docs/python.md", "python")
    assert "Simulator(gripping at t = 0 s" in printed and "Termination.STOPPED" in printed
    assert "Recorder(gripping: t = " in printed and printed.rstrip().endswith("True")


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
