"""The program in docs/ros2.md, as a user would run it."""

import os
import re
import subprocess
import sys

from bilayer_core.log.run.log_reader import read_info


def test_the_program_of_the_page_composes_two_simulations_that_end_well(root, domain, tmp_path):
    page = (root / "docs" / "ros2.md").read_text(encoding="utf-8")
    (tmp_path / "two.py").write_text(re.search(r"```python\n(.*?)```", page, re.S)[1], encoding="utf-8")
    ended = subprocess.run(
        [sys.executable, "two.py"],
        cwd=tmp_path,
        env=os.environ | {"ROS_DOMAIN_ID": str(domain)},
        capture_output=True,
        text=True,
        timeout=200,
    )
    assert ended.returncode == 0, ended.stderr
    said = r"(left|right) ended at t = 0.5 s: all well"  # two threads print: a newline may come late
    assert sorted(re.findall(said, ended.stdout)) == ["left", "right"]
    assert not re.sub(said, "", ended.stdout).strip()
    assert read_info(tmp_path / "left.mcap").complete and "Traceback" not in ended.stderr
