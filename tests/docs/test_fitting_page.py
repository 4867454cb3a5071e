"""The page about fits: its programs and commands run one after the other, and print what it says."""

import subprocess
import sys

import pytest
from support.documents import blocks, is_told
from support.processes import TIMEOUT, environment

PAGE = "docs/fitting.md"


@pytest.mark.slow
def test_the_programs_and_commands_of_the_page_about_fits_do_what_it_says(root, tmp_path):
    told = blocks(root / PAGE)
    assert [block.info for block in told] == ["python", "sh", "text", "python", "sh", "text"]
    bilayer = f'bilayer() {{ "{sys.executable}" -m bilayer_core "$@"; }}\n'
    outputs = []
    for block, after in zip(told, [*told[1:], None], strict=True):
        if block.info == "text":
            continue
        run = [sys.executable, "-c", block.text] if block.info == "python" else ["bash", "-c", bilayer + block.text]
        done = subprocess.run(run, cwd=tmp_path, env=environment(), capture_output=True, text=True, timeout=TIMEOUT)
        expected = after.text if after is not None and after.info == "text" else ""
        assert done.returncode == expected.startswith("bilayer: nothing was fitted"), done.stderr
        assert is_told(expected, done.stdout + done.stderr) is None, f"line {block.line}:\n{done.stdout}{done.stderr}"
        outputs.append(done.stdout)
    assert "FitResult(cantilever: materials.gel.youngs_modulus = 1.197 MPa" in outputs[2]
    assert {path.name for path in (tmp_path / "fitted").iterdir()} == {
        "report.json", "residuals.csv", "fitted.yaml", "fit.png",
    }  # fmt: skip
