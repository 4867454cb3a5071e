"""The cache of kernels holds machine code: only a folder that other users cannot write to is read."""

import os
import subprocess
import sys

import pytest

from bilayer_core.jit import cache
from bilayer_core.jit.private_folder import exposure, make_private

NOBODY = 65534
IS_ROOT = os.geteuid() == 0
"""Only root can give files to somebody else."""
PROGRAM = """
from bilayer_core.jit import piece


@piece(float, float)
def change(x):
    return 2.0 * x


print(change(3.0))
"""


@pytest.fixture
def folder(tmp_path):
    """A folder of a cache as it is made, with a file of kernels in it."""
    made = make_private(tmp_path / "above" / "root" / "kernels-1")
    (made / "engine").mkdir()
    (made / "engine" / "kernel.o").touch()
    return made


def found(folder):
    return exposure(folder, cache.PACKAGE)


@pytest.mark.parametrize("umask", [0o000, 0o002, 0o022, 0o077])
def test_folders_of_the_cache_are_made_for_the_user_alone_whatever_the_umask(tmp_path, umask):
    before = os.umask(umask)
    try:
        made = make_private(tmp_path / "above" / "root" / "kernels-1")
        (made / "kernel.o").touch()
    finally:
        os.umask(before)
    assert [path.stat().st_mode & 0o7777 for path in (made, made.parent, made.parents[1])] == [0o700] * 3
    assert found(made) == ""


@pytest.mark.parametrize(
    ("place", "mode"),
    [(".", 0o770), (".", 0o702), (".", 0o1777), ("..", 0o770), ("..", 0o702), ("../..", 0o702)],
)
def test_a_folder_that_others_can_write_to_is_named(folder, place, mode):
    path = (folder / place).resolve()
    path.chmod(mode)
    assert found(folder) == f"other users can write to {path}"


@pytest.mark.parametrize("mode", [0o620, 0o602])
def test_files_that_others_can_reach_and_write_to_are_named(folder, mode):
    file = folder / "engine" / "kernel.o"
    file.chmod(mode)
    assert found(folder) == ""  # nobody else comes as far
    folder.chmod(0o755)
    assert found(folder) == f"other users can write to {file}"


@pytest.mark.parametrize("place", [".", "engine", "engine/kernel.o", "..", "../.."] if IS_ROOT else [])
def test_what_belongs_to_another_user_is_named_with_that_user(folder, place):
    path = (folder / place).resolve()
    os.chown(path, NOBODY, NOBODY)
    assert found(folder) == f"{path} belongs to the user nobody"


def test_a_root_like_tmp_is_safe_since_nobody_can_rename_folders_of_others(folder):
    folder.parent.chmod(0o1777)
    assert found(folder) == ""


def test_folders_above_the_package_itself_are_not_looked_at(folder):
    folder.parents[1].chmod(0o777)
    assert exposure(folder, folder.parents[1] / "package") == ""
    assert exposure(folder, folder.parent / "package") == ""
    assert exposure(folder, folder.parents[1] / "package" / "below") == ""


def test_a_link_is_followed_to_a_folder_that_is_looked_at_itself(tmp_path):
    (tmp_path / "open").mkdir()
    (tmp_path / "open").chmod(0o777)
    (tmp_path / "link").symlink_to(tmp_path / "open")
    made = make_private(tmp_path / "link" / "kernels-1")
    assert made == tmp_path / "open" / "kernels-1"
    assert found(made) == f"other users can write to {tmp_path / 'open'}"


def test_code_that_another_user_planted_is_not_run(tmp_path):
    program, root = tmp_path / "program.py", tmp_path / "cache"

    def run(cache_folder, factor):
        program.write_text(PROGRAM.replace("2.0", factor))
        environment = os.environ | {"NUMBA_CACHE_DIR": str(cache_folder), "PYTHONPATH": str(cache.PACKAGE.parent)}
        command = [sys.executable, "program.py"]
        return subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)

    assert run(root, "2.0").stdout == "6.0\n"
    assert run(tmp_path / "other", "5.0").stdout == "15.0\n"
    (own,), (planted,) = root.rglob("*.o"), (tmp_path / "other").rglob("*.o")
    own.write_bytes(planted.read_bytes())
    own.parent.chmod(0o777)
    again = run(root, "2.0")
    assert again.stdout == "6.0\n"
    (line,) = again.stderr.splitlines()
    assert str(own.parent) in line
    assert "can run programs as you; set NUMBA_CACHE_DIR to a folder that only you can write to" in line
    own.parent.chmod(0o700)
    assert run(root, "2.0").stdout == "15.0\n"  # such a file is run as it is
