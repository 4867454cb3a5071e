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
from support.sweep_programs import address_in, await_workers, dask, end, start_scheduler, wait_until

from bilayer_core import read_results
from bilayer_core.errors import EngineError, InputError
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


@pytest.fixture(scope="session")
def strip_rows(cluster):
    from support.sweep_programs import STRIP

    return results(sweep(STRIP, scheduler=cluster))


def test_a_cluster_makes_all_runs_and_this_machine_makes_the_same(strip, strip_rows):
    assert [row[0] for row in strip_rows] == list(range(8))
    assert {row[3] for row in strip_rows} == {Outcome.DONE}
    assert results(sweep(strip, workers=1)) == strip_rows


def test_scenes_and_tables_travel_with_the_runs(cluster, tmp_path, monkeypatch):
    (tmp_path / "table.csv").write_text("time,value\n0,0\n0.3,1\n")
    schedule = {"type": "csv", "file": "table.csv", "value_column": "value"}
    from bilayer_core.scene.loader import load_scene, scene_content

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


def mark_and_die(run):
    """Kills the process the first time that it is called with the second gain."""
    mark = os.environ["SWEEP_TEST_MARK"] if "SWEEP_TEST_MARK" in os.environ else run.simulator.scene.title
    if run.parameters["gain"] == 1.0 and not os.path.exists(mark):
        open(mark, "w").close()
        os.kill(os.getpid(), signal.SIGKILL)
    return 1.0


def test_a_worker_that_is_killed_during_a_run_costs_nothing_but_time(strip, strip_rows, tmp_path):
    strip["set"]["title"] = str(tmp_path / "died")
    found = sweep(strip, workers=2, functions={"there": mark_and_die})
    assert (tmp_path / "died").exists()
    assert [row.metrics["there"] for row in found.rows] == [1.0] * 8
    assert [row.metrics["curvature"] for row in found.rows] == [row[4]["curvature"] for row in strip_rows]


def hog(run):
    """Takes memory until somebody ends the process, for one gain."""
    if run.parameters["gain"] == 1.0 and run.parameters["length"] == 80.0:
        held = []
        while True:
            held.append(bytearray(os.urandom(1) * 20_000_000))
            time.sleep(0.005)
    return 1.0


def hang(run):
    """Never comes back, for one gain."""
    if run.parameters["gain"] == 1.0 and run.parameters["length"] == 80.0:
        time.sleep(1000.0)
    return 1.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("function", "limits", "told"),
    [
        (hog, {"memory": "700 MB"}, "its process died 2 times; processes are killed beyond 0.7 GB"),
        (hang, {"wall_time": "4 s"}, "it did not stop within 9 s, and was killed"),
    ],
    ids=["memory", "time"],
)
def test_a_run_over_its_limits_is_killed_alone_and_is_a_row(strip, monkeypatch, function, limits, told):
    monkeypatch.setattr("bilayer_core.studies.sweeps.dask_processes.KILL_EXTRA", 1.0)
    found = sweep(strip | {"limits": limits}, workers=2, functions={"there": function})
    lost = [row for row in found.rows if row.outcome is not Outcome.DONE]
    assert [(row.outcome, row.parameters) for row in lost] == [(Outcome.KILLED, {"gain": 1.0, "length": 80.0})]
    assert told in lost[0].reason or function is hang and "it did not stop within" in lost[0].reason
    assert found.outcomes == {"done": 7, "killed": 1}


def die(run):
    """Kills the process, always, for one gain in the middle of many."""
    if run.parameters["gain"] == 1.0:
        os.kill(os.getpid(), signal.SIGKILL)
    return 1.0


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
def test_of_pieces_given_ahead_nothing_is_lost_with_the_process_they_wait_for(strip, workers):
    gains = {"path": "rods.strip.layers.active.eigenstrain.gain", "from": "0 %", "to": "2 %", "count": 201}
    many = strip | {"parameters": {"gain": gains}, "set": {"duration": "0.05 s"}}
    found = sweep(many, workers=workers, functions={"there": die})
    assert found.outcomes == {"done": 200, "killed": 1}
    assert [row.parameters for row in found.rows if row.outcome is not Outcome.DONE] == [{"gain": 1.0}]


TWICE = """
from support.sweep_programs import STRIP
from bilayer_core import sweep
if __name__ == "__main__":
    for duration in ("0.01 s", "0.02 s"):
        print(sweep(STRIP | {"set": {"duration": duration}}, workers=1).outcomes)
"""


@pytest.mark.slow
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


@pytest.mark.slow
def test_workers_with_another_version_are_refused_before_the_first_run(strip, tmp_path):
    file = tmp_path / "scheduler.json"
    processes = [start_scheduler(file)]
    try:
        address = address_in(file)
        options = address, "--nthreads", "1", "--no-dashboard", "--local-directory", str(tmp_path)
        with pytest.raises(InputError, match="has no workers; start some with `dask worker ADDRESS`"):
            sweep(strip, scheduler=address)
        processes.append(dask("worker", *options, BILAYER_JIT_PUBLIC="1"))  # other compiled code
        await_workers(address)
        with pytest.raises(InputError, match=r"has other versions: sources \w+ \(here \w+\)"):
            sweep(strip, scheduler=address)
    finally:
        end(processes[::-1])


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
        options = address, "--nthreads", "1", "--no-dashboard", "--local-directory", str(tmp_path)
        processes.append(dask("worker", *options))
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


@pytest.mark.slow
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
    from bilayer_core import read_log, read_results

    found = read_results(out)
    assert found.outcomes == {"done": len(rows())}
    assert all(read_log(out / row.log).times[-1] == pytest.approx(40.0) for row in found.rows[::7])
    print(f"{MOMENTS} kills; rows after each: {counts}")


@pytest.mark.slow
def test_ctrl_c_ends_a_sweep_with_one_line_and_its_processes_with_it(strip, tmp_path):
    strip["set"]["duration"] = "40 s"
    strip["parameters"]["gain"]["count"] = 200
    (tmp_path / "sweep.yaml").write_text(yaml.safe_dump(strip))
    command = [*COMMAND, "sweep", "sweep.yaml", "--out", "out", "--quiet"]
    program = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True, start_new_session=True)
    file = tmp_path / "out/results.sqlite"

    def some():
        return file.exists() and len(kept_keys(file)) > 2

    wait_until(some)
    os.killpg(program.pid, signal.SIGINT)  # as a terminal does: to all of its processes
    assert program.wait(30) == 130
    assert program.stderr.read() == "bilayer: interrupted\n"
    wait_until(lambda: not processes_of_group(program.pid), 10)
    found = subprocess.run([*command, "--resume", "--list"], cwd=tmp_path, capture_output=True, text=True)
    assert found.returncode == 0 and len(found.stdout.splitlines()) == 401


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
