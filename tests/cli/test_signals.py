"""Signals at any moment: one line, an exit code, nothing left over."""

import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest
from support.processes import TIMEOUT, bilayer, command, environment

from bilayer_core.cli import main, program
from bilayer_core.cli.signals import Interruption, Signals, interruption_behind
from bilayer_core.log.run.log_reader import read_info

LINES = {signal.SIGINT: "bilayer: interrupted\n", signal.SIGTERM: "bilayer: ended by SIGTERM\n"}
INTERRUPT_OR_ALL = signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.verify)
LONG_RUN = ("run", "cantilever", "--dt", "0.1 ms", "--duration", "1000", "--quiet")
READ_AGAIN = """
import sys
import bilayer_core.engine
from bilayer_core.jit.piece import PIECES

kept = sorted(PIECES.keys() & set(sys.argv[1:]))
print(sum(PIECES[name].address > 0 for name in kept))
"""
ENDS_WITHIN = 60.0
"""Of a process that was told to end, on a busy machine [s]."""
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")


@contextmanager
def started(*arguments, cwd, **variables):
    """A command whose handlers of signals are installed: before that a signal is Python's, and not the program's."""
    process = subprocess.Popen(
        command(*arguments),
        env=environment() | variables,
        cwd=cwd,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        wait_for(lambda: catches(process.pid, signal.SIGTERM), process)
        yield process
    finally:
        process.kill()
        process.communicate()


def wait_for(condition, process=None):
    deadline = time.monotonic() + TIMEOUT
    while not condition():
        assert process is None or process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.01)


def catches(pid: int, number: int) -> bool:
    status = Path(f"/proc/{pid}/status").read_text()
    return bool(int(status.partition("SigCgt:")[2].split()[0], 16) >> (number - 1) & 1)


def below(pid: int) -> set[int]:
    """Processes that a process started, and those that they started."""
    found = set()
    for thread in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in map(int, thread.read_text().split()):
            found |= {child, *below(child)}
    return found


def lives(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def assert_ended_by(number, process):
    out, err = process.communicate(timeout=ENDS_WITHIN)
    assert (process.returncode, out, err) == (128 + number, "", LINES[number])


@pytest.mark.slow
@pytest.mark.parametrize("times", [1, pytest.param(2, marks=pytest.mark.verify), 3])
@pytest.mark.parametrize("number", INTERRUPT_OR_ALL)
def test_a_signal_at_any_moment_of_the_start_is_one_line(tmp_path, number, times):
    for delay in (0.0, 0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0):
        with started(*LONG_RUN, cwd=tmp_path) as process:
            time.sleep(delay)
            for _ in range(times):
                process.send_signal(number)
            assert_ended_by(number, process)


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    [
        ("check", "gripping"),
        ("validate", "--only", "motion/*"),
        ("converge", "cantilever", "--set", "solver.dt=0.1 ms", "--duration", "1000", "--quiet"),
        ("bench", "--only", "cantilever", "--quiet"),
        ("schema",),
    ],
    ids=lambda arguments: arguments[0],
)
def test_every_verb_that_computes_or_imports_ends_with_one_line(tmp_path, arguments):
    with started(*arguments, cwd=tmp_path) as process:
        process.send_signal(signal.SIGINT)
        assert_ended_by(signal.SIGINT, process)


@pytest.mark.slow
@pytest.mark.parametrize("number", [*INTERRUPT_OR_ALL, signal.SIGKILL])
def test_processes_that_compile_end_with_the_program_and_leave_a_cache_that_works(tmp_path, number):
    variables = {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "BILAYER_JIT_AHEAD": "1"}
    with started(*LONG_RUN, cwd=tmp_path, **variables) as process:
        wait_for(lambda: list(tmp_path.glob("cache/kernels/*.o")), process)
        workers = below(process.pid)
        assert workers
        process.send_signal(number)
        if number in LINES:
            assert_ended_by(number, process)
        wait_for(lambda: not any(map(lives, workers)))
    assert not list(tmp_path.glob("cache/kernels/complete*"))
    kept = {path.name.rpartition("-")[0] for path in tmp_path.glob("cache/kernels/*.o")}
    again = subprocess.run(
        [sys.executable, "-c", READ_AGAIN, *kept],
        env=environment() | variables,
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
    )
    assert (again.returncode, again.stderr) == (0, "") and int(again.stdout) > 0


@pytest.mark.slow
def test_a_signal_while_a_run_itself_compiles_is_one_line(tmp_path):
    variables = {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "BILAYER_JIT_AHEAD": "0"}
    with started(*LONG_RUN, cwd=tmp_path, **variables) as process:
        wait_for(lambda: list(tmp_path.glob("cache/kernels/*.o")), process)
        process.send_signal(signal.SIGINT)
        assert_ended_by(signal.SIGINT, process)


@pytest.mark.slow
@pytest.mark.parametrize("number", [*INTERRUPT_OR_ALL, signal.SIGKILL])
def test_runs_side_by_side_end_with_the_program(tmp_path, number):
    study = ("converge", "cantilever", "--set", "solver.dt=0.1 ms", "--duration", "1000", "--workers", "2", "--quiet")
    with started(*study, cwd=tmp_path) as process:
        wait_for(lambda: len(below(process.pid)) >= 3, process)  # one more looks after what they share
        time.sleep(2.0)
        others = below(process.pid)
        process.send_signal(number)
        if number in LINES:
            assert_ended_by(number, process)
        wait_for(lambda: not any(map(lives, others)))


@pytest.mark.parametrize("number", LINES)
def test_a_second_signal_ends_a_run_that_writes_a_log_with_one_line(tmp_path, number):
    with started(*LONG_RUN, "--log", "run.mcap", cwd=tmp_path) as process:
        log = tmp_path / "run.mcap"
        wait_for(lambda: log.exists() and log.stat().st_size > 50_000, process)
        for _ in range(2):
            process.send_signal(number)
        assert_ended_by(number, process)
    assert read_info(log).termination == "interrupted"


def test_the_exception_of_a_signal_that_other_code_catches_is_raised_again(tmp_path):
    program = (
        "import os, signal, sys, time\n"
        "import bilayer_core.cli.program as program\n"
        "def busy(*arguments):\n"
        "    try:\n"
        "        os.kill(os.getpid(), signal.SIGTERM)\n"
        "    except BaseException:\n"
        "        pass\n"
        "    time.sleep(60)\n"
        "program.run_program = busy\n"
        "from bilayer_core.cli import main\n"
        "sys.exit(main())\n"
    )
    run = subprocess.run([sys.executable, "-c", program], env=environment(), capture_output=True, text=True, timeout=50)
    assert (run.returncode, run.stderr) == (143, LINES[signal.SIGTERM])


def test_the_command_line_called_from_python_leaves_the_handlers_as_they_were():
    before = [signal.getsignal(number) for number in LINES], sys.unraisablehook
    signals = Signals(of_process=False)
    signals.heed()
    assert signal.getsignal(signal.SIGTERM) not in before[0]
    signals.close()
    assert ([signal.getsignal(number) for number in LINES], sys.unraisablehook) == before


def test_an_interruption_is_found_behind_exceptions_that_go_in_circles():
    first, second, interruption = ValueError("1"), ValueError("2"), Interruption(signal.SIGINT)
    first.__cause__ = first
    assert interruption_behind(first) is None
    first.__cause__, second.__context__ = second, first
    assert interruption_behind(first) is None and interruption_behind(None) is None
    first.__context__ = interruption  # beside the cause, which leads nowhere
    assert interruption_behind(second) is interruption


def test_a_signal_at_the_end_of_the_process_changes_nothing():
    program = (
        "import atexit, os, signal, sys\n"
        "from bilayer_core.cli import main\n"
        "sys.argv[1:] = ['scenes']\n"
        "code = main()\n"
        "os.kill(os.getpid(), signal.SIGINT)\n"
        "print('not reached')\n"
    )
    run = subprocess.run([sys.executable, "-c", program], env=environment(), capture_output=True, text=True, timeout=50)
    assert (run.returncode, run.stderr) == (0, "") and run.stdout == bilayer("scenes").stdout


def test_an_error_that_a_library_makes_of_an_interruption_is_taken_for_one(capfd, monkeypatch):
    """Compiled ones do not say of what they made it, as pydantic's does while it builds the models of scenes."""

    def catch(*arguments, **settings):
        try:
            signal.raise_signal(signal.SIGTERM)
        except BaseException as error:
            text = str(error)
        raise ValueError(text)

    monkeypatch.setattr(program.program, "main", catch)
    assert main(["scenes"]) == 128 + signal.SIGTERM
    assert capfd.readouterr().err == LINES[signal.SIGTERM]
