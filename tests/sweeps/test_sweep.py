"""Sweeps on processes: those of a cluster, those of this machine, and what happens when they die."""

import os
import random
import signal
import socket
import sqlite3
import subprocess
import sys
import time

import pytest
import yaml
from support.processes import TIMEOUT, environment
from support.sweep_programs import address_in, await_workers, end, start_scheduler, start_worker, wait_until

from bilayer_core import read_log, read_results
from bilayer_core.errors import EngineError, InputError
from bilayer_core.scene.loader import load_scene, scene_content
from bilayer_core.studies.sweeps.job import Outcome
from bilayer_core.studies.sweeps.open_processes import Processes, open_engine
from bilayer_core.studies.sweeps.run_sweep import read_sweep, sweep

COMMAND = [sys.executable, "-m", "bilayer_core"]


def kept_keys(file):
    """Keys of the rows in a journal, also one that is being written."""
    try:
        with sqlite3.connect(file) as base:
            return {key for (key,) in base.execute("SELECT key FROM rows")}
    except sqlite3.OperationalError:
        return set()


def results(found):
    """What of rows does not depend on the clock."""
    return [(row.number, row.key, row.parameters, row.outcome, row.metrics, row.reason) for row in found.rows]


def test_a_cluster_makes_all_runs_and_this_machine_makes_the_same(strip, cluster):
    strip_rows = results(sweep(strip, scheduler=cluster))
    assert [row[0] for row in strip_rows] == list(range(8))
    assert {row[3] for row in strip_rows} == {Outcome.DONE}
    assert results(sweep(strip, workers=1)) == strip_rows


def test_scenes_and_tables_travel_with_the_runs(cluster, tmp_path, monkeypatch):
    (tmp_path / "table.csv").write_text("time,value\n0,0\n0.3,1\n")
    schedule = {"type": "csv", "file": "table.csv", "value_column": "value"}

    content = scene_content(load_scene("bending"))
    content["stimuli"]["swelling"]["schedule"] = schedule
    (tmp_path / "own.yaml").write_text(yaml.safe_dump(content))
    (tmp_path / "own.py").write_text("def steps(run):\n    return run.summary['steps']\n")
    spec = {
        "schema": 1,
        "scene": "own.yaml",
        "set": {"duration": 0.3},
        "parameters": {"length": {"path": "rods.strip.path.length", "values": [0.08, 0.1]}},
        "metrics": {"steps": {"function": "own.py:steps"}, "same": "steps", "end": "max_curvature"},
    }
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sweep.yaml").write_text(yaml.safe_dump(spec))
    found = sweep(tmp_path / "sweep.yaml", scheduler=cluster)
    assert [row.metrics["steps"] for row in found.rows] == [row.metrics["same"] for row in found.rows] != [None] * 2
    assert all(row.metrics["end"] == pytest.approx(7.5, rel=0.02) for row in found.rows)


def die_hog_or_hang(run):
    """Never comes back, for the first run; dies the first time that it is called, or takes memory without end."""
    mark = run.simulator.scene.title
    if run.parameters["damping"] == 0.0:
        time.sleep(1000.0)
    if run.parameters["damping"] == 8.0 and not os.path.exists(mark):
        open(mark, "w").close()
        os.kill(os.getpid(), signal.SIGKILL)
    held = []
    while run.parameters["damping"] == 9.0:
        held.append(bytearray(os.urandom(1) * 20_000_000))
        time.sleep(0.005)
    return run.parameters["damping"]


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=pytest.mark.verify)])
def test_with_a_process_that_dies_no_run_is_lost_but_those_that_kill_it(strip, tmp_path, monkeypatch, workers):
    monkeypatch.setattr("bilayer_core.studies.sweeps.dask_processes.LARGEST_PIECE", 4)  # so some wait for the process
    values = {"path": "damping.mass", "from": 0.0, "to": 20.0, "count": 21}
    many = strip | {"parameters": {"damping": values}, "set": {"duration": "0.05 s", "title": str(tmp_path / "died")}}
    limits = {"limits": {"memory": "700 MB", "wall_time": "3 s"}}
    found = sweep(many | limits, workers=workers, functions={"there": die_hog_or_hang})
    assert (tmp_path / "died").exists()
    killed = {row.parameters["damping"]: row.reason for row in found.rows if row.outcome is Outcome.KILLED}
    assert killed.pop(0.0) == "it did not stop within 16 s, and was killed"
    assert killed == {9.0: "its process died 2 times; processes are killed beyond 0.7 GB"}
    assert found.outcomes == {"done": 19, "killed": 2}
    done = [row for row in found.rows if row.outcome is Outcome.DONE]
    assert all(row.metrics["there"] == row.parameters["damping"] for row in done)


TWICE = """
from support.sweep_programs import STRIP
from bilayer_core import sweep
if __name__ == "__main__":
    for duration in ("0.01 s", "0.02 s"):
        print(sweep(STRIP | {"set": {"duration": duration}}, workers=1).outcomes)
"""


@pytest.mark.verify
def test_one_program_makes_two_sweeps(tmp_path):
    (tmp_path / "twice.py").write_text(TWICE)
    run = [sys.executable, tmp_path / "twice.py"]
    done = subprocess.run(run, cwd=tmp_path, env=environment(), capture_output=True, text=True, timeout=TIMEOUT)
    assert done.stdout == 2 * "{'done': 8}\n", done.stderr


def test_a_scheduler_that_is_not_there_is_told_within_ten_seconds(strip):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    begin = time.monotonic()
    with pytest.raises(InputError, match=f"--scheduler: {address}: no Dask scheduler can be reached there"):
        sweep(strip, scheduler=address)
    assert time.monotonic() - begin < 10.0


@pytest.mark.parametrize("address", ["nonsense", "tcp://", "http://127.0.0.1:1", ""])
def test_what_is_no_address_is_an_input_error(strip, address):
    with pytest.raises(InputError, match="no Dask scheduler can be reached"):
        sweep(strip, scheduler=address)


def test_logs_need_a_directory_that_workers_see(strip, cluster, tmp_path, monkeypatch):
    found = sweep(strip | {"logs": "all"}, scheduler=cluster, out=tmp_path / "here")
    assert sorted(row.log for row in found.rows) == [f"logs/{k:06d}.mcap" for k in range(8)]
    assert results(read_results(tmp_path / "here")) == results(found)  # the table is there as well
    read = read_sweep(strip | {"logs": "all"}, tmp_path / "here")
    monkeypatch.setattr(
        "bilayer_core.studies.sweeps.open_processes.LOGS", "only_here"
    )  # which workers look for elsewhere
    with pytest.raises(InputError, match="does not see it; logs need a directory that all workers share"):
        with open_engine(read.job, Processes(scheduler=cluster)):
            pass


def test_a_scheduler_that_goes_is_told_and_what_is_done_is_kept(strip, tmp_path):
    file = tmp_path / "scheduler.json"
    strip["set"]["duration"] = "20 s"
    strip["parameters"]["gain"]["count"] = 100
    processes = [start_scheduler(file)]
    try:
        address = address_in(file)
        processes.append(start_worker(address, tmp_path))
        await_workers(address)
        seen = []

        def look(row):
            seen.append(row.key)
            if len(seen) == 3:
                processes[0].kill()

        with pytest.raises(EngineError, match="the scheduler has gone"):
            sweep(strip, scheduler=address, out=tmp_path / "out", progress=look)
        assert kept_keys(tmp_path / "out/results.sqlite") >= set(seen[:3])
    finally:
        end(processes[::-1])


MOMENTS = int(os.environ.get("SWEEP_KILLS", "5"))


@pytest.mark.verify
@pytest.mark.timeout(1800)
def test_a_sweep_killed_at_random_moments_is_completed_and_nothing_is_made_twice(strip, tmp_path):
    rng = random.Random(int(os.environ.get("SWEEP_KILLS_SEED", "7")))
    strip["parameters"]["gain"]["count"] = 10 + MOMENTS
    strip["set"]["duration"] = "40 s"
    strip["logs"] = "all"
    (tmp_path / "sweep.yaml").write_text(yaml.safe_dump(strip))
    out, counts = tmp_path / "out", []
    command = [*COMMAND, "sweep", "sweep.yaml", "--out", str(out), "--quiet", "--workers", "2"]
    made: dict[str, str] = {}

    def rows():
        try:
            with sqlite3.connect(f"file:{out / 'results.sqlite'}?mode=rw", uri=True) as base:
                return dict(base.execute("SELECT key, row FROM rows").fetchall())
        except sqlite3.OperationalError:  # not there yet
            return {}

    def start():
        resume = ["--resume"] if (out / "results.sqlite").exists() else []
        return subprocess.Popen([*command, *resume], cwd=tmp_path, start_new_session=True)

    for moment in range(MOMENTS):
        program = start()
        deadline = time.monotonic() + 60.0
        while moment % 2 and program.poll() is None and len(rows()) == len(made) and time.monotonic() < deadline:
            time.sleep(0.02)  # every second kill comes while rows do, the others at any time from the start
        try:
            program.wait(rng.uniform(0.0, 2.0) if moment % 2 else rng.uniform(0.3, 8.0))
        except subprocess.TimeoutExpired:
            program.kill()
            program.wait()
        now = rows()
        assert made.items() <= now.items()  # what was there is the same text, with its times: it was not made again
        made = now
        counts.append(len(made))
    assert start().wait() == 0
    assert made.items() <= rows().items() and len(rows()) == 2 * (10 + MOMENTS)

    found = read_results(out)
    assert found.outcomes == {"done": len(rows())}
    assert all(read_log(out / row.log).times[-1] == pytest.approx(40.0) for row in found.rows[::7])
    print(f"{MOMENTS} kills; rows after each: {counts}")


@pytest.mark.slow
def test_ctrl_c_ends_a_sweep_with_one_line_and_its_processes_with_it(strip, tmp_path):
    strip["set"]["duration"] = "40 s"
    strip["parameters"]["gain"]["count"] = 200
    (tmp_path / "sweep.yaml").write_text(yaml.safe_dump(strip))
    command = [*COMMAND, "sweep", "sweep.yaml", "--out", "out", "--quiet", "--workers", "1"]
    program = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True, start_new_session=True)
    file = tmp_path / "out/results.sqlite"

    def some():
        return file.exists() and len(kept_keys(file)) > 2

    wait_until(some)
    os.killpg(program.pid, signal.SIGINT)  # as a terminal does: to all of its processes
    assert program.wait(30) == 130
    assert program.stderr.read() == "bilayer: interrupted\n"
    wait_until(lambda: not processes_of_group(program.pid), 10)
    assert kept_keys(file)


def processes_of_group(group):
    """Processes of a group that are no zombies."""
    listed = subprocess.run(["ps", "-eo", "pgid,stat"], capture_output=True, text=True, check=True).stdout
    rows = [line.split() for line in listed.splitlines()[1:]]
    return [row for row in rows if row[0] == str(group) and not row[1].startswith("Z")]


def test_rows_of_another_version_are_made_again_and_not_mixed(strip, cluster, tmp_path, monkeypatch):
    sweep(strip, scheduler=cluster, out=tmp_path)
    with sqlite3.connect(tmp_path / "results.sqlite") as base:
        base.execute("UPDATE rows SET key = 'of another version ' || number")
    seen = []
    found = sweep(strip, scheduler=cluster, out=tmp_path, resume=True, progress=seen.append)
    assert len(seen) == len(found) == 8
