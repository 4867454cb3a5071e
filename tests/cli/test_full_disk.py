"""Disks that are full, two writers on one file, and output that nobody takes."""

import contextlib
import io
import json
import os
import resource
import subprocess
import sys
import time

import numpy as np
import pytest
from support import synthetic_run
from support.processes import TIMEOUT, bilayer, command, environment

from bilayer_core.cli import main
from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_core.log.run.log_reader import read_info, read_log

FULL = "File too large"
"""What the system says where a file would be longer than the limit of its process: to the program, a full disk."""


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty directory to run in."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="module", autouse=True)
def compiled():
    """Kernels are kept before files may not be large."""
    assert main(["run", "cantilever", "--duration", "2 ms", "--quiet"]) == 0


@pytest.fixture
def with_room(monkeypatch):
    """Runs ``bilayer`` in this process, where no file may meanwhile be longer; exit code and both outputs."""
    monkeypatch.setattr(sys, "dont_write_bytecode", True)

    def run(size, *arguments):
        out, err = io.StringIO(), io.StringIO()
        before = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
        try:
            with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
                code = main(list(arguments))
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)
        return code, out.getvalue(), err.getvalue()

    return run


def test_a_log_that_cannot_be_begun_ends_with_3_and_leaves_no_file(here, with_room):
    code, _, err = with_room(100, "run", "cantilever", "--duration", "0.1", "--log", "run.mcap", "--quiet")
    assert (code, err) == (3, f"bilayer: run.mcap: cannot be written: {FULL}\n")
    assert list(here.iterdir()) == []


def test_a_log_that_finds_no_room_is_named_with_what_is_kept_and_the_summary_is_written(here, with_room):
    outputs = ["--log", "run.mcap", "--summary", "run.json"]
    code, out, err = with_room(300_000, "run", "cantilever", "--duration", "100", *outputs)
    assert code == 3 and out.startswith("cantilever: failed")
    line, _, kept = err.partition(f"the log run.mcap could not be written: {FULL}; it can be read up to t = ")
    assert line.startswith("bilayer: stopped at t = ") and kept.endswith(" s (0.3 MB)\n")
    assert float(kept.split()[0]) == pytest.approx(read_info("run.mcap").last_time)
    assert len(read_log("run.mcap").times) > 1
    summary = json.loads((here / "run.json").read_text())
    assert summary["termination"] == "failed" and FULL in summary["reason"]


def test_the_first_loss_is_told_first_and_later_ones_below_it(here, with_room):
    outputs = ["--log", "run.mcap", "--save-state", "run.npz", "--summary", "run.json"]
    code, _, err = with_room(1000, "run", "cantilever", "--duration", "0.1", *outputs, "--quiet")
    assert code == 3
    assert err.splitlines() == [
        f"bilayer: run.mcap: cannot be written: {FULL}",
        f"  then run.npz: cannot be written: {FULL}",
        f"  then run.json: cannot be written: {FULL}",
    ]
    assert list(here.iterdir()) == []


def test_a_summary_without_room_leaves_the_old_one(here, with_room):
    (here / "run.json").write_text("old")
    words = ["run", "cantilever", "--duration", "2 ms", "--summary", "run.json", "--force", "--quiet"]
    code, _, err = with_room(1000, *words)
    assert (code, err) == (3, f"bilayer: run.json: cannot be written: {FULL}\n")
    assert [path.read_text() for path in here.iterdir()] == ["old"]


def test_a_recording_whose_end_finds_no_room_is_not_left_as_if_it_were_whole(here, with_room):
    assert main(["run", "cantilever", "--duration", "0.1", "--log", "run.mcap", "--quiet"]) == 0
    assert main(["view", "run.mcap", "--save", "whole.rrd"]) == 0
    room = (here / "whole.rrd").stat().st_size - 1000
    code, _, err = with_room(room, "view", "run.mcap", "--save", "part.rrd")
    assert (code, err) == (3, f"bilayer: part.rrd: cannot be written: {FULL}\n")
    assert sorted(path.name for path in here.iterdir()) == ["run.mcap", "whole.rrd"]


def test_a_new_scene_without_room_leaves_no_file_and_says_why(here, with_room):
    code, _, err = with_room(100, "new", "robot.yaml")
    assert (code, err) == (3, f"bilayer: robot.yaml: cannot be written: {FULL}\n")
    assert list(here.iterdir()) == []


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """A log made by hand, of half a megabyte; and matplotlib has kept its list of fonts."""
    import matplotlib.font_manager  # noqa: F401

    path = tmp_path_factory.mktemp("log") / "run.mcap"
    synthetic_run.run(McapRecorder(path), np.arange(40) * 0.02)
    return path


WRITERS = {
    "repair LOG out.mcap": "out.mcap",
    "export LOG --csv out.csv": "out.csv",
    "export LOG energy/bend energy/twist --csv tables": "tables/energy/bend.csv",
    "export LOG --parquet out.parquet": "out.parquet",
    "export LOG com --parquet tables": "tables/com.parquet",
    "export LOG --npz out.npz": "out.npz",
    "compare LOG LOG --json out.json": "out.json",
    "plot LOG com.z --out out.pdf": "out.pdf",
    "plot LOG com.z --out out.svg": "out.svg",
    "render LOG --png out.png": "out.png",
    "render LOG --gif out.gif --frames 2": "out.gif",
    "render LOG --mp4 out.mp4 --frames 10": "out.mp4",
}


@pytest.mark.parametrize("arguments", WRITERS)
def test_a_command_names_the_file_that_found_no_room_and_nothing_else(here, with_room, log, arguments):
    words = [str(log) if word == "LOG" else word for word in arguments.split()]
    code, _, err = with_room(400, *words)
    assert (code, err) == (3, f"bilayer: {WRITERS[arguments]}: cannot be written: {FULL}\n")
    assert list(here.iterdir()) == []


def test_kernels_that_find_no_room_are_an_error_that_says_what_to_do(here):
    variables = {"NUMBA_CACHE_DIR": str(here), "BILAYER_JIT_AHEAD": "0", "PYTHONDONTWRITEBYTECODE": "1"}

    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))

    run = subprocess.run(
        command("run", "cantilever", "--duration", "2 ms", "--quiet"),
        env=environment() | variables,
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
        preexec_fn=limit,
    )
    assert run.returncode == 3 and run.stderr.count("\n") == 1
    assert f"compiled kernels cannot be kept: {FULL}; set NUMBA_CACHE_DIR to a directory with room" in run.stderr


REFUSED = "bilayer: standard output: cannot be written: No space left on device\n"
RUN = ("run", "cantilever", "--duration", "2 ms")


@pytest.mark.parametrize(
    ("arguments", "redirection", "code", "told"),
    [
        (("scenes",), ">&-", 0, ""),
        (("scenes",), ">&- 2>&-", 0, ""),
        (("scenes",), ">/dev/full", 3, REFUSED),
        (("scenes",), ">/dev/full 2>/dev/full", 3, ""),
        (("schema",), ">&- 2>&-", 0, ""),
        (("check", "gripping", "--json"), ">&-", 0, ""),
        (("validate", "--list"), ">/dev/full", 3, REFUSED),
        (RUN, ">&- 2>&-", 0, ""),
        (RUN, ">/dev/full", 3, REFUSED),
        (RUN, ">/dev/full 2>/dev/full", 3, ""),
    ],
)
def test_output_that_is_closed_or_full_ends_in_at_most_a_line(here, arguments, redirection, code, told):
    shell = ["bash", "-c", f'"$@" {redirection}', "bash", *command(*arguments)]
    run = subprocess.run(shell, env=environment(), capture_output=True, text=True, timeout=TIMEOUT)
    assert (run.returncode, run.stdout, run.stderr) == (code, "", told)


def test_a_run_whose_reader_is_gone_tells_its_failure_all_the_same(here):
    read, write = os.pipe()
    os.close(read)
    hopeless = ["--set", "solver={max_newton_iterations: 1, max_halvings: 0, newton_tolerance: 1e-15}"]
    run = subprocess.run(
        command("run", "cantilever", *hopeless), env=environment(), stdout=write, stderr=subprocess.PIPE, text=True
    )
    os.close(write)
    assert run.returncode == 3 and run.stderr.startswith("bilayer: stopped at t = ")


WRITER = """
import sys, time
from support import synthetic_run
from bilayer_core.log.file.mcap_log import McapRecorder

recorder = McapRecorder(sys.argv[1])
recorder.start(synthetic_run.description())
recorder.observe(synthetic_run.frame(0.0))
print("begun", flush=True)
time.sleep(600)
"""


@pytest.fixture
def writer(here):
    """Another program that writes the log run.mcap."""
    process = subprocess.Popen([sys.executable, "-c", WRITER, "run.mcap"], env=environment(), stdout=subprocess.PIPE)
    assert process.stdout.readline() == b"begun\n"
    yield process
    process.kill()
    process.communicate()


def test_a_second_writer_of_a_log_is_refused_also_with_force_until_the_first_has_ended(writer, here):
    again = ["run", "cantilever", "--duration", "2 ms", "--quiet", "--log", "run.mcap"]
    deadline = time.monotonic() + TIMEOUT
    while len(before := (here / "run.mcap").read_bytes()) < 1000 or read_info("run.mcap").last_time != 0.0:
        assert time.monotonic() < deadline
    refused = bilayer(*again, "--force")
    assert refused.returncode == 2
    assert refused.stderr.startswith("bilayer: run.mcap: another program is writing it; wait for its end")
    assert (here / "run.mcap").read_bytes().startswith(before)
    assert bilayer(*again).returncode == 2
    writer.kill()
    writer.wait()
    taken = bilayer(*again, "--force")
    assert (taken.returncode, taken.stderr) == (0, "")
    assert read_info("run.mcap").complete
