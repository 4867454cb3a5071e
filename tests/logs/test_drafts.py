"""Drafts of output files: where they are, who can reach them, and what becomes of those of killed programs."""

import os
import signal
import stat
import subprocess
import sys

import pytest
from support.processes import TIMEOUT, environment

from bilayer_core.log.file import private_directory as module
from bilayer_core.log.file.output_paths import draft_of, write_text
from bilayer_core.log.file.private_directory import LOCK, OLD, PREFIX, private_directory

HOLDER = """
import signal, sys, time
from bilayer_core.log.file.output_paths import draft_of
signal.signal(signal.SIGINT, signal.default_int_handler)  # which who runs in the background does not have
with draft_of(sys.argv[1], force=False) as draft:
    draft.write_text("half")
    print(draft, flush=True)
    time.sleep(600)
"""


@pytest.fixture
def holder(tmp_path):
    """Another program that is writing run.csv, and the directory of its draft."""
    command = [sys.executable, "-c", HOLDER, str(tmp_path / "run.csv")]
    process = subprocess.Popen(command, env=environment(), stdout=subprocess.PIPE, text=True)
    draft = process.stdout.readline().strip()
    yield process, next(path for path in tmp_path.iterdir() if draft.startswith(str(path)))
    process.kill()
    process.communicate()


def test_a_link_with_a_name_that_could_be_guessed_is_not_written_through(tmp_path):
    precious = tmp_path / "precious"
    precious.write_text("precious")
    (tmp_path / f".bilayer-{os.getpid()}-run.csv").symlink_to(precious)
    write_text(tmp_path / "run.csv", "new", force=False)
    assert (tmp_path / "run.csv").read_text() == "new" and precious.read_text() == "precious"


def test_a_draft_is_for_its_user_alone_and_the_file_has_the_usual_mode(tmp_path):
    before = os.umask(0o027)
    try:
        with draft_of(tmp_path / "run.csv", force=False) as draft:
            (directory,) = tmp_path.iterdir()
            assert stat.S_IMODE(directory.stat().st_mode) == 0o700 and directory in draft.parents
            draft.write_text("whole")
    finally:
        os.umask(before)
    assert [path.name for path in tmp_path.iterdir()] == ["run.csv"]
    assert stat.S_IMODE((tmp_path / "run.csv").stat().st_mode) == 0o640


def test_the_draft_of_a_killed_program_is_removed_by_the_next_one_and_a_live_one_stays(holder, tmp_path):
    process, left = holder
    write_text(tmp_path / "other.csv", "whole", force=False)
    assert left.is_dir()
    process.send_signal(signal.SIGKILL)
    process.wait(TIMEOUT)
    write_text(tmp_path / "third.csv", "whole", force=False)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["other.csv", "third.csv"]


def test_a_program_that_is_ended_removes_its_draft(holder, tmp_path):
    process, _ = holder
    process.send_signal(signal.SIGINT)
    process.wait(TIMEOUT)
    assert list(tmp_path.iterdir()) == []


def age(directory, seconds):
    """Let a directory and its files be as old as that."""
    for path in (*directory.rglob("*"), directory):
        os.utime(path, (path.stat().st_mtime - seconds,) * 2)


def test_a_draft_of_another_machine_is_removed_once_it_is_old(tmp_path, monkeypatch):
    monkeypatch.setattr(module.shutil, "rmtree", lambda *_, **__: None)
    monkeypatch.setattr(module.socket, "gethostname", lambda: "elsewhere")
    with private_directory(tmp_path) as elsewhere:
        (elsewhere / "run.csv").write_text("half")
    monkeypatch.undo()
    left = elsewhere.parent
    write_text(tmp_path / "run.csv", "whole", force=False)
    assert left.is_dir()
    age(left, OLD + 60.0)
    write_text(tmp_path / "run.csv", "whole", force=True)
    assert not left.exists()


def test_only_directories_with_the_lock_file_of_a_draft_are_removed(tmp_path):
    named, precious = tmp_path / f"{PREFIX}{module._machine()}-aaaaaaaa", tmp_path / "precious"
    for directory in (named, precious):
        directory.mkdir()
        (directory / "mine.txt").write_text("precious")
    (precious / LOCK).touch()
    (precious / "content").mkdir()
    (tmp_path / f"{PREFIX}{module._machine()}-bbbbbbbb").symlink_to(precious)
    write_text(tmp_path / "run.csv", "whole", force=False)
    for directory in (named, precious):
        assert (directory / "mine.txt").read_text() == "precious"
