"""The verb `stress`, as it is called."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pytest

from bilayer_core.cli import main
from bilayer_core.errors import InputError
from bilayer_core.verification.stress import outcome_pictures, pool
from bilayer_core.verification.stress.journal import Journal
from bilayer_core.verification.stress.parameters import Parameters
from bilayer_core.verification.stress.pool import run_cases
from bilayer_core.verification.stress.robots import scene_of
from bilayer_core.verification.stress.shrink import shrink
from bilayer_core.verification.stress.stress_case import Decision, Outcome, Record, StressCase

ONE = "restitution/0.5/ball/laminate"


def test_results_report_and_scenes_are_written_and_gone_on_with(tmp_path, capfd, monkeypatch):
    out = tmp_path / "stress"
    table = tmp_path / "all.json"
    assert main(["stress", "--only", ONE, "--out", str(out), "--json", str(table), "--workers", "1"]) == 0
    told = capfd.readouterr().out
    assert "inside the region of validity: 1 cases, 1 accurate" in told
    written = {path.relative_to(out).as_posix() for path in out.rglob("*.*")}
    assert written >= {"results.jsonl", "stability.md", "stability_axes.png", "stability_effort.png"}
    assert json.loads(table.read_text())["results"][0]["name"] == ONE
    page = (out / "stability.md").read_text()
    assert "| inside | 1 | 1 | 0 | 0 | 0 |" in page and "capstan" in page
    pictures = re.findall(r"!\[.*?\]\((.*?)\)", page)
    assert len(pictures) == 2 and all((out / picture).is_file() for picture in pictures)
    before = (out / "results.jsonl").read_text()
    monkeypatch.setattr(outcome_pictures, "draw", lambda records, directory: [])
    assert main(["stress", "--only", ONE, "--out", str(out), "--resume", "--workers", "1"]) == 0
    assert (out / "results.jsonl").read_text() == before  # nothing was left to do
    (scene,) = (out / "worst").iterdir()
    assert main(["stress", "--scene", str(scene), "--out", str(tmp_path / "own"), "--workers", "1"]) == 0


def test_cases_are_listed_with_why_they_are_outside(capfd):
    assert main(["stress", "--list", "--only", "eigenstrain/*/beam/laminate"]) == 0
    lines = capfd.readouterr().out.splitlines()
    assert "eigenstrain/0.1/beam/laminate" in lines
    assert any(line.startswith("eigenstrain/0.5/beam/laminate  [outside: eigenstrain 0.5") for line in lines)


def test_a_pattern_that_fits_no_case_is_told_with_the_groups(capfd):
    assert main(["stress", "--only", "restitutoin/*"]) == 2
    assert "--only restitutoin/*: fits no case; there are groups dt, tolerance, stations" in capfd.readouterr().err


def test_results_of_other_cases_are_not_gone_on_with(tmp_path):
    head = {"cases": "one"}
    Journal(tmp_path, head, resume=False).add(Record("a", "", True, [], Outcome.STABLE))
    assert Journal(tmp_path, head, resume=True).records.keys() == {"a"}
    with pytest.raises(InputError, match="holds results of other cases"):
        Journal(tmp_path, {"cases": "another"}, resume=True)
    with pytest.raises(InputError, match="no results are there"):
        Journal(tmp_path / "nothing", head, resume=True)


def test_a_last_line_that_was_cut_off_is_done_again(tmp_path):
    head = {"cases": "one"}
    journal = Journal(tmp_path, head, resume=False)
    journal.add(Record("a", "", True, [], Outcome.STABLE))
    with open(journal.path, "a", encoding="utf-8") as file:
        file.write('{"name": "b", "outc')
    assert Journal(tmp_path, head, resume=True).records.keys() == {"a"}


def hangs(trial):
    time.sleep(1e4)


def takes_all_memory(trial):
    return [bytes(2**28) for _ in range(100)]


def dies(trial):
    os._exit(7)


def fine(trial):
    return Decision("nothing", 1.0, 0.0, 2.0)


def test_cases_that_hang_die_or_take_all_memory_fail_and_the_rest_goes_on(monkeypatch):
    monkeypatch.setattr(pool, "LEAST_TIME", 8.0)
    content = partial(scene_of, Parameters(stations=5))
    ways = {"hangs": hangs, "memory": takes_all_memory, "dies": dies, "fine": fine}
    cases = [StressCase(name, content, decide=way, cpu_limit=0.1) for name, way in ways.items()]
    records: dict[str, Record] = {}
    run_cases(cases, 1, lambda record: records.update({record.name: record}))
    reasons = {name: record.reason for name, record in records.items()}
    assert reasons["hangs"] == "took longer than 8 s, and was killed"
    assert reasons["memory"] == "out of memory"
    assert reasons["dies"] == "its process died with exit code 7"
    outcomes = {name: record.outcome for name, record in records.items()}
    assert outcomes == dict.fromkeys(("hangs", "memory", "dies"), Outcome.FAILED) | {"fine": Outcome.ACCURATE}


def test_a_failure_is_made_smaller_and_runs_again(tmp_path):
    hard = Parameters(robot="drop", stations=15, friction=1.0, youngs_modulus=2e7)
    case = StressCase("hard", partial(scene_of, hard), decide=partial(is_stiff, 1.5e7))
    path = shrink(case, Record("hard", "", True, [], Outcome.FAILED, "stiff: too much: of it"), tmp_path)
    text = path.read_text()
    assert "youngs_modulus: 20000000.0" in text  # without it nothing fails
    assert "stations: 5" in text and "coefficient: 0.4" in text  # all else is at its default, or less


def is_stiff(limit, trial):
    stiffness = trial.simulator.scene.materials["lower"].youngs_modulus
    return Decision("stiff: too much", stiffness, 0.0, limit)


@pytest.mark.verify
def test_an_interrupted_run_ends_at_once_and_keeps_what_it_has(tmp_path):
    command = [sys.executable, "-m", "bilayer_core", "stress", "--only", "integrator/sdirk2/*", "--out", str(tmp_path)]
    command += ["--workers", "1"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    results = Path(tmp_path) / "results.jsonl"
    while not results.exists() or len(results.read_text().splitlines()) < 2:  # its head, and a case
        assert process.poll() is None
        time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    error = process.communicate(timeout=60)[1]
    assert process.returncode == 130
    assert error.splitlines()[-1] == "bilayer: interrupted"
