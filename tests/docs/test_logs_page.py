"""The page about logs: its programs run one after the other, then its commands, and print what it says."""

import subprocess
import sys

import pytest
from documents import blocks, is_told
from processes import TIMEOUT, environment

PAGE = "docs/logs.md"


@pytest.mark.slow
def test_the_programs_and_commands_of_the_page_about_logs_do_what_it_says(root, tmp_path):
    told = blocks(root / PAGE)
    program = "\n".join(block.text for block in told if block.info == "python")
    script = f'bilayer() {{ "{sys.executable}" -m bilayer_core "$@"; }}\n'
    script += "\n".join(block.text for block in told if block.info == "sh")
    outputs = []
    for command in ([sys.executable, "-c", program], ["bash", "-e", "-c", script]):
        done = subprocess.run(
            command, cwd=tmp_path, env=environment(), capture_output=True, text=True, timeout=TIMEOUT
        )
        assert done.returncode == 0, done.stdout + done.stderr
        outputs.append(done.stdout)
    assert "RunData(bending: t = 0 to 0.4 s, 21 frames" in outputs[0] and "(9, " in outputs[0]
    assert (tmp_path / "height.pdf").stat().st_size > 1000
    for block in told:
        if block.info == "text":
            assert is_told(block.text, outputs[1]) is None
