"""Compiled code follows the sources, wherever they are edited."""

import os
import queue
import shutil
import subprocess
import sys
import time
from collections import Counter, deque

import pytest

from bilayer_core.errors import OutputError
from bilayer_core.jit import cache, compile_all, digest, piece

PROGRAM = """
import numpy as np

from bilayer_core.jit import piece, record
from bilayer_core.jit.record import Stack
from bilayer_core.kinematics.rotating import rotate_by, rotation_vector_between

@record
class Pair:
    rotations: Stack

@piece(float, Pair)
def turned(pair):
    return rotation_vector_between(pair.rotations, 0, pair.rotations, 1)[2]

@piece(float, Pair)
def turn(pair):
    rotate_by(0.0, 0.0, 0.1, pair.rotations, 0, pair.rotations, 1)
    return 0.0

pair = Pair(rotations=np.array([np.eye(3), np.eye(3)]))
turn(pair)
print(repr(turned(pair)))
"""
CALLED, TURN = "bilayer_core/kinematics/rotating.py", "return factor * x, factor * y, factor * z"
TRIPLED = "return 3.0 * factor * x, 3.0 * factor * y, 3.0 * factor * z"
"""A file of functions that kernels call, and what one of them says of the turn of a body."""


def _turn(tree, folder):
    environment = os.environ | {"PYTHONPATH": str(tree), "NUMBA_CACHE_DIR": str(folder), "BILAYER_JIT_AHEAD": "0"}
    (tree / "program.py").write_text(PROGRAM)
    run = subprocess.run([sys.executable, "program.py"], env=environment, capture_output=True, text=True, cwd=tree)
    assert run.returncode == 0, run.stderr
    return float(run.stdout)


def test_an_edit_of_a_function_that_kernels_call_changes_the_result_at_once(root, tmp_path):
    tree, folder = tmp_path / "tree", tmp_path / "cache"
    shutil.copytree(root / "bilayer_core", tree / "bilayer_core", ignore=shutil.ignore_patterns("__pycache__"))
    path = tree / CALLED
    source = path.read_text(encoding="utf-8")
    assert source.count(TURN) == 1
    first = _turn(tree, folder)
    assert _turn(tree, folder) == first == pytest.approx(0.1)
    path.write_text(source.replace(TURN, TRIPLED), encoding="utf-8")
    assert _turn(tree, folder) == pytest.approx(3.0 * first, rel=1e-12)
    compiled = Counter(path.name.rpartition("-")[0] for path in (folder / "kernels").iterdir())
    assert compiled == {"turned": 2, "turn": 1}  # the edit changes one of the pieces


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The folder of this process, in an empty place."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    cache.cache_folder.cache_clear()
    yield cache.cache_folder
    cache.cache_folder.cache_clear()


def test_files_that_nobody_has_used_for_long_are_deleted(tmp_path, folder):
    (tmp_path / cache.KERNELS).mkdir(mode=0o700)
    old, young, foreign = tmp_path / "kernels" / "old.o", tmp_path / "kernels" / "young.o", tmp_path / "other"
    long_ago = time.time() - (cache.DAYS_KEPT + 1) * cache.DAY
    for file in (old, young, foreign):
        file.touch()
        if file != young:
            os.utime(file, (long_ago, long_ago))
    assert folder().is_dir() and young.exists() and foreign.exists() and not old.exists()


def test_a_file_that_is_used_stays(folder):
    cache.keep("used.o", b"code")
    long_ago = time.time() - (cache.DAYS_KEPT - 1) * cache.DAY
    os.utime(folder() / "used.o", (long_ago, long_ago))
    assert cache.kept("used.o") == b"code" and cache.kept("unknown.o") is None
    assert time.time() - (folder() / "used.o").stat().st_mtime < cache.DAY


def test_a_file_is_there_as_a_whole_or_not_at_all(folder, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(OutputError, match="cannot be kept: No space left on device; set NUMBA_CACHE_DIR to"):
        cache.keep("new.o", b"code")
    assert list(folder().iterdir()) == []


@piece(int, int)
def add_one_for_the_cache(n):
    return n + 1


def test_a_damaged_file_is_compiled_again(folder):
    cache.keep(add_one_for_the_cache.file, b"no code")
    assert add_one_for_the_cache(1) == 2
    assert cache.kept(add_one_for_the_cache.file).startswith(b"\x7fELF")


def test_the_fingerprint_is_another_for_other_settings_of_numba(monkeypatch):
    before = digest.settings.__wrapped__()
    assert digest.settings.__wrapped__() == before
    monkeypatch.setenv("NUMBA_BOUNDSCHECK", "1")
    assert digest.settings.__wrapped__() != before


def test_a_folder_that_cannot_be_made_is_said_and_nothing_is_kept(tmp_path, folder, monkeypatch, caplog):
    blocked = tmp_path / "file"
    blocked.touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(blocked))
    assert folder() is None
    assert "cannot be kept" in caplog.text and "NUMBA_CACHE_DIR" in caplog.text


def test_only_pieces_that_the_cache_lacks_are_compiled_ahead(folder, monkeypatch):
    import bilayer_core.engine  # noqa: F401 (declares pieces)

    compiled = []
    monkeypatch.setenv("BILAYER_JIT_AHEAD", "1")
    monkeypatch.setattr(compile_all, "_compile", lambda names, report: compiled.append(sorted(names)))
    for own in compile_all.own_pieces():
        if own.name not in ("add_drag", "integrate", "observe"):
            cache.keep(own.file, b"")
    compile_all.ensure_compiled(needed=lambda: {"add_drag", "add_bending"})
    assert compiled == [["add_drag"]] and not compile_all.is_complete()
    assert compile_all.compile_all() == 3 and compile_all.is_complete()
    compile_all.ensure_compiled()
    assert compiled[1:] == [["add_drag", "integrate", "observe"]]


def test_numba_itself_keeps_nothing(folder):
    _ = add_one_for_the_cache.make_object()
    assert [path.name for path in folder().iterdir()] == [add_one_for_the_cache.file]


def test_workers_compile_this_package_and_not_one_of_its_name_where_they_start(tmp_path, monkeypatch):
    decoy = tmp_path / "bilayer_core" / "__init__.py"
    decoy.parent.mkdir()
    decoy.write_text("raise ImportError('not this one')")
    monkeypatch.chdir(tmp_path)
    done = queue.SimpleQueue()
    compile_all._Worker(deque(["update_attached"]).pop, done).run()
    assert done.get(timeout=1.0) == "update_attached"
