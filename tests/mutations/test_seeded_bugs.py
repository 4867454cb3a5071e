"""Seeded bugs: each is put into a copy of the tree, where a test of its module or a quick stress case must notice it.

One bug by default. Others by a pattern of their names, such as ``newton*``; all take hours, as kernels are compiled
anew for most of them:

    SEEDED_BUGS='*' pytest -m "" -v tests/mutations

What notices a bug must be content without it.
"""

from __future__ import annotations

import fnmatch
import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CONTENT = tomllib.loads(Path(__file__).with_name("mutants.toml").read_text(encoding="utf-8"))
BUGS = {bug["name"]: bug for bug in CONTENT["mutant"]}
CHOSEN = fnmatch.filter(BUGS, os.environ.get("SEEDED_BUGS", "encoders: strain in the place of curvature"))
COPIED = ("bilayer_core", "config", "docs", "tests", "pyproject.toml")
PYTEST = ("pytest", "-q", "--tb=line", "-p", "no:cacheprovider", "--timeout=0")
STRESS = ("bilayer_core", "stress", "--quick", "--no-shrink", "--quiet", "--out", "runs")
LONGEST = 1800.0
"""Wall time after which a process counts as one that does not end; kernels take minutes of it [s]."""
_FAILED = re.compile(r"^(?:FAILED|ERROR) (\S+?(?:\[.*?\])?)(?: - .*)?$", re.MULTILINE)


def files_of(bug: dict[str, str]) -> list[str]:
    return [f"tests/{name}" for name in CONTENT["tests"][bug["file"]]]


def source_of(bug: dict[str, str], tree: Path) -> Path:
    return tree / "bilayer_core" / bug["file"]


def test_every_bug_fits_its_source_once_and_has_tests_that_are_there():
    assert CHOSEN and len(BUGS) == len(CONTENT["mutant"]) >= 30
    for name, bug in BUGS.items():
        source = source_of(bug, ROOT).read_text(encoding="utf-8")
        assert source.count(bug["old"]) == 1, name
        compile(source.replace(bug["old"], bug["new"]), bug["file"], "exec")
        assert files_of(bug) and all((ROOT / test).is_file() for test in files_of(bug)), name


@pytest.fixture(scope="module")
def tree(tmp_path_factory):
    """A copy of the tree."""
    copy = tmp_path_factory.mktemp("copy")
    for name in COPIED:
        copied = shutil.copytree if (ROOT / name).is_dir() else shutil.copy2
        copied(ROOT / name, copy / name)
    yield copy
    shutil.rmtree(copy)


@contextmanager
def seeded(bug: dict[str, str], tree: Path) -> Iterator[None]:
    """Put a bug into a tree, and take it and the kernels that were compiled with it out again."""
    path, kernels = source_of(bug, tree), set(tree.glob("kernels/*"))
    whole = path.rename(path.with_suffix(".whole"))  # with its time, which numba looks at
    path.write_text(whole.read_text(encoding="utf-8").replace(bug["old"], bug["new"]), encoding="utf-8")
    try:
        yield
    finally:
        whole.rename(path)
        for folder in set(tree.glob("kernels/*")) - kernels:
            shutil.rmtree(folder)


def run(tree: Path, arguments: tuple[str, ...]) -> tuple[int | None, str]:
    """Run a module in a tree; its exit code, None if it does not end, and what it printed."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("NUMBA_", "PYTEST_"))}
    environment |= {
        "PYTHONPATH": str(tree),
        "PYTHONDONTWRITEBYTECODE": "1",  # which goes by seconds and size: two bugs may have both alike
        "NUMBA_CACHE_DIR": str(tree / "kernels"),
        "BILAYER_JIT_AHEAD": "0",
    }
    words = [sys.executable, "-P", "-m", *arguments]
    try:
        ended = subprocess.run(words, cwd=tree, env=environment, capture_output=True, text=True, timeout=LONGEST)
    except subprocess.TimeoutExpired:
        return None, ""
    return ended.returncode, ended.stdout


def what_notices(bug: dict[str, str], tree: Path) -> tuple[str, ...]:
    """What fails with a bug, as arguments of `run`: a test, files that die or do not end, stress cases, or nothing."""
    with seeded(bug, tree):
        code, said = run(tree, (*PYTEST, "-x", *files_of(bug)))
        if code != 0:
            found = _FAILED.search(said)
            return *PYTEST, *([found[1]] if found else files_of(bug))
        return () if run(tree, STRESS)[0] == 0 else STRESS


@pytest.mark.parametrize(
    ("tests", "cases", "noticed_by"),
    [
        ((1, "FAILED tests/a.py::test_b[x 1] - assert 0\n"), None, (*PYTEST, "tests/a.py::test_b[x 1]")),
        ((-11, ""), None, (*PYTEST, *files_of(BUGS[CHOSEN[0]]))),
        ((None, ""), None, (*PYTEST, *files_of(BUGS[CHOSEN[0]]))),
        ((0, ""), (1, ""), STRESS),
        ((0, ""), (0, ""), ()),
    ],
)
def test_stress_cases_judge_what_tests_let_live_and_the_source_is_restored(
    tests, cases, noticed_by, monkeypatch, tmp_path
):
    bug = BUGS[CHOSEN[0]]
    path = source_of(bug, tmp_path)
    path.parent.mkdir(parents=True)
    shutil.copy2(source_of(bug, ROOT), path)
    before, seen = (path.read_bytes(), path.stat().st_mtime_ns), []

    def ended(tree, arguments):
        seen.append(bug["new"] in path.read_text(encoding="utf-8"))
        (tree / "kernels" / "seeded").mkdir(parents=True, exist_ok=True)
        return cases if arguments == STRESS else tests

    monkeypatch.setitem(globals(), "run", ended)
    assert what_notices(bug, tmp_path) == noticed_by
    assert all(seen) and len(seen) == 1 + (cases is not None)
    assert (path.read_bytes(), path.stat().st_mtime_ns) == before and not any((tmp_path / "kernels").iterdir())


@pytest.mark.verify
@pytest.mark.timeout(4 * LONGEST)
@pytest.mark.parametrize("name", CHOSEN)
def test_a_bug_is_noticed(name, tree):
    by = what_notices(BUGS[name], tree)
    assert by, f"nothing notices this bug: {BUGS[name]['bug']}"
    print(f"\n{name}: noticed by {' '.join(by)}")
    code, said = run(tree, by)
    assert code == 0, f"fails without the bug as well: {said[-2000:]}"
