"""Do tests and cases notice a bug? Each seeded bug is put into a copy of the checkout and judged there.

First by the quick tests of its module, up to the first that fails; if none does, by cases of the quick matrix, those
that are cheapest first, up to the first that fails or is no longer accurate where it was. A process that takes several
times as long as it should is ended: that is noticed, too. At last the tests that have failed run in a copy without any
bug, where they must pass.
"""

from __future__ import annotations

import json
import re
import threading
import time as clock
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from queue import Empty, SimpleQueue

from ..bench import machine
from ..errors import InputError
from ..jit.cache import FOLDERS
from .case import Outcome, Record
from .cases import quick_names
from .checkout_copy import CheckoutCopy, checkout
from .journal import commit
from .mutants import FILE as MUTANTS_FILE
from .mutants import Mutant, chosen_mutants, mutants

FILE, CASES = "mutations.jsonl", "cases.jsonl"
TEST, CASE, HANG, CRASH = "test", "case", "hang", "crash"
LIVES, VOID = "lives", "fails without it"
TEST_TIME = 240.0
"""CPU time [s] for the quick tests of a module, several times what the slowest take with kernels to compile."""
CASE_TIME = 120.0
"""CPU time [s] of the cases that judge a bug which the tests let live, without it."""
SLOWER = 4.0
"""Times that, after which they are ended."""
PYTEST = ("-m", "pytest", "-q", "-n", "0", "-m", "not slow", "--tb=line", "-rfE", "-p", "no:cacheprovider")
"""Of the interpreter."""
_FAILED = re.compile(r"^(?:FAILED|ERROR) (\S+?(?:\[.*?\])?)(?: - (.*))?$", re.MULTILINE)


@dataclass(frozen=True)
class Judged:
    """What came of a mutant: a line of results.

    Attributes
    ----------
    name, digest : str
    verdict : str
        What noticed it: `TEST`, `CASE`, `HANG` or `CRASH`; `LIVES`; `VOID` if the test fails without the bug as well.
    by : str
        Which test, or which case; the test files of which the process did not end, or died.
    message : str
        What it said.
    cpu_time, wall_time : float
        Until then [s], with what had to be compiled.
    cases : int
        How many cases were to judge it, after the tests.
    checked : bool
        Whether it was seen that all is well without the bug.
    """

    name: str
    digest: str
    verdict: str
    by: str = ""
    message: str = ""
    cpu_time: float = 0.0
    wall_time: float = 0.0
    cases: int = 0
    checked: bool = False

    @property
    def caught(self) -> bool:
        """Whether anything noticed it."""
        return self.verdict in (TEST, CASE, HANG, CRASH)


def run_mutations(
    only: Sequence[str],
    out: Path,
    tell: Callable[[Judged], None],
    *,
    resume: bool = False,
    workers: int = 2,
    with_cases: bool = True,
) -> dict[str, Judged]:
    """Judge mutants, and write what comes of each into ``mutations.jsonl`` as it does.

    Parameters
    ----------
    only : sequence of str
        Patterns of names; none for all.
    out : Path
        Where the results go, and the copies with their kernels, which a later run uses again.
    tell : callable
        Called with each result.
    resume : bool
        Keep the results that are there, of mutants that have not changed since.
    workers : int
        Copies, in each of which one process runs at a time.
    with_cases : bool
        Whether those that the tests let live are judged by cases, too.

    Returns
    -------
    dict
        Results by name, those kept as well.

    Raises
    ------
    InputError
        If the package is not run from a checkout, a pattern fits no mutant, or a mutant does not fit the sources.
    """
    chosen = chosen_mutants(only)
    checkout()  # a package without its tests is refused before anything is written
    journal = _Journal(out / FILE, mutants(), resume)
    left: SimpleQueue[Mutant] = SimpleQueue()
    for name, mutant in chosen.items():
        found = journal.results.get(name)
        if found is None or found.verdict == VOID or with_cases and found.verdict == LIVES and not found.cases:
            left.put(mutant)
    own = (result for name, result in journal.results.items() if name in chosen)
    if left.empty() and all(result.checked for result in own if result.caught):
        return journal.results
    copies = [CheckoutCopy(out / "copies" / str(number)) for number in range(max(1, min(workers, left.qsize())))]
    if with_cases or any(mutant.file.split("/")[0] in FOLDERS for mutant in chosen.values()):
        for copy in copies:
            copy.compile()
    expected = _expected(copies[0], out / CASES) if with_cases and not left.empty() else []

    def work(copy: CheckoutCopy) -> None:
        while True:
            try:
                mutant = left.get_nowait()
            except Empty:
                return
            result = _judge(copy, mutant, expected)
            journal.add(result)
            tell(result)

    with ThreadPoolExecutor(len(copies)) as pool:
        try:
            for future in [pool.submit(work, copy) for copy in copies]:
                future.result()
        except BaseException:  # such as that of Ctrl-C
            for copy in copies:
                copy.stop()
            raise
    unchecked = [result for name, result in journal.results.items() if name in chosen and not result.checked]
    for result in _checked(copies[0], unchecked):
        journal.add(result)
        if not result.caught:
            tell(result)
    return journal.results


class _Journal:
    """The file of results: a line that says what they are of, and one for each mutant, of which the last counts."""

    def __init__(self, path: Path, known: dict[str, Mutant], resume: bool):
        self._path, self._lock, self.results = path, threading.Lock(), {}
        if resume and path.exists():
            found = read_results(path)[1]
            self.results = {n: r for n, r in found.items() if n in known and r.digest == known[n].digest}
            return
        path.parent.mkdir(parents=True, exist_ok=True)
        head = {"commit": commit(), "machine": machine.record(), **machine.now()}
        path.write_text(json.dumps(head) + "\n", encoding="utf-8")

    def add(self, result: Judged) -> None:
        with self._lock, open(self._path, "a", encoding="utf-8") as file:
            self.results[result.name] = result
            file.write(json.dumps(asdict(result)) + "\n")


def read_results(path: Path) -> tuple[dict, dict[str, Judged]]:
    """What results are of, and the last one of each mutant by name."""
    first, *lines = path.read_text(encoding="utf-8").splitlines()
    results = {}
    for line in lines:
        try:
            result = Judged(**json.loads(line))
        except ValueError:  # the last line of a run that was killed
            continue
        results[result.name] = result
    return json.loads(first), results


def _judge(copy: CheckoutCopy, mutant: Mutant, expected: list[Record]) -> Judged:
    begin, result = clock.monotonic(), Judged(mutant.name, mutant.digest, LIVES)
    with copy.changed(mutant):
        ended = copy.run([*PYTEST, "-x", *mutant.tests], TEST_TIME)
        cpu_time = ended.cpu_time
        if ended.stopped:
            result = replace(result, verdict=HANG, by=", ".join(mutant.tests), message=f"over {TEST_TIME:g} s")
        elif ended.code != 0 and (found := _FAILED.search(ended.text)):
            by, message = found.groups()
            result = replace(result, verdict=TEST, by=by, message=(message or "").strip()[:200])
        elif ended.code != 0:
            result = replace(result, verdict=CRASH, by=", ".join(mutant.tests), message=f"exit code {ended.code}")
        elif expected:
            by, message, more = _first_unlike(copy, expected)
            result = replace(result, verdict=CASE if by else LIVES, by=by, message=message, cases=len(expected))
            cpu_time += more
    return replace(result, cpu_time=round(cpu_time, 1), wall_time=round(clock.monotonic() - begin, 1))


def _first_unlike(copy: CheckoutCopy, expected: list[Record]) -> tuple[str, str, float]:
    """The first case that does not end as expected, how it ends, and the CPU time that this took [s]."""
    given, results = copy.tree.parent / "expected", copy.tree.parent / "results"
    given.write_text("".join(record.line() + "\n" for record in expected), encoding="utf-8")
    limit = SLOWER * sum(record.cpu_time for record in expected) + TEST_TIME
    ended = copy.run(["-m", "bilayer_core.stress.alike", str(given), str(results)], limit)
    if ended.code == 0 and not ended.text.strip():
        return "", "", ended.cpu_time
    done = results.read_text(encoding="utf-8").splitlines() if results.exists() else []
    if ended.code == 0:
        found = json.loads(ended.text.splitlines()[-1])
        return found["case"], f"{found['before']} → {found['now']}: {found['why']}"[:200], ended.cpu_time
    why = "was ended: it took too long" if ended.stopped else f"its process died with exit code {ended.code}"
    return expected[min(len(done), len(expected) - 1)].name, why, ended.cpu_time


def _expected(copy: CheckoutCopy, path: Path) -> list[Record]:
    """Records of cases of the quick matrix without any bug: of those that are cheapest, together `CASE_TIME`.

    They are kept with the commit that they are of.
    """
    mark = json.dumps({"commit": commit()})
    if not path.exists() or path.read_text(encoding="utf-8").split("\n", 1)[0] != mark:
        names, results = copy.tree.parent / "names", copy.tree.parent / "results"
        names.write_text("\n".join(sorted(quick_names())), encoding="utf-8")
        ended = copy.run(["-m", "bilayer_core.stress.alike", str(names), str(results)], 3600.0)
        if ended.code != 0:
            raise InputError(f"mutations: the quick matrix cannot be run without any bug:\n{ended.text[-2000:]}")
        path.write_text(mark + "\n" + results.read_text(encoding="utf-8"), encoding="utf-8")
    records = [Record.from_line(line) for line in path.read_text(encoding="utf-8").splitlines()[1:]]
    chosen, total = [], 0.0
    for record in sorted(records, key=lambda record: record.cpu_time):
        total += record.cpu_time
        if total <= CASE_TIME and record.outcome is not Outcome.FAILED:
            chosen.append(record)
    return chosen


def _checked(copy: CheckoutCopy, results: list[Judged]) -> list[Judged]:
    """Results of what noticed something, `VOID` where the test fails, or the tests take long, without any bug as well.

    Cases were compared with those of the same copy.
    """
    by = {verdict: sorted({r.by for r in results if r.verdict == verdict}) for verdict in (TEST, HANG, CRASH)}
    wrong = {files for files in by[HANG] if _fails(copy, files, TEST_TIME / SLOWER)}
    wrong |= {files for files in by[CRASH] if _fails(copy, files, TEST_TIME)}
    if by[TEST]:
        ended = copy.run([*PYTEST, *by[TEST]], SLOWER * TEST_TIME)
        failed = {name for name, _ in _FAILED.findall(ended.text)}
        wrong |= failed if ended.code in (0, 1) else set(by[TEST])
    caught = [replace(result, checked=True) for result in results if result.caught]
    return [replace(result, verdict=VOID) if result.by in wrong else result for result in caught]


def _fails(copy: CheckoutCopy, files: str, cpu_limit: float) -> bool:
    """Whether tests fail, or take longer than they may, without any bug."""
    return copy.run([*PYTEST, *files.split(", ")], cpu_limit).code != 0


def markdown(path: Path) -> list[str]:
    """Results as lines of a page: how many bugs were noticed, which live, and what noticed each.

    Parameters
    ----------
    path : Path
        Of the file of results.
    """
    head, results = read_results(path)
    known = mutants()
    judged = [results[name] for name in known if name in results]
    alive = [result for result in judged if not result.caught]
    counted = {verdict: sum(result.verdict == verdict for result in judged) for verdict in (TEST, CASE, HANG, CRASH)}
    cpu_time = sum(result.cpu_time for result in judged)
    lines = [
        f"{len(judged)} bugs were put into the sources, one at a time (`bilayer stress --mutations`; they are in",
        f"`bilayer_core/stress/{MUTANTS_FILE.name}`). {len(judged) - len(alive)} were noticed:",
        f"{counted[TEST]} by the quick tests of their module, {counted[CASE]} by a case of the quick matrix,",
        f"{counted[HANG] + counted[CRASH]} because a process did not end, or died.",
        f"Commit {head['commit'] or 'unknown'}, {str(head['date'])[:10]}, {cpu_time / 60.0:.0f} minutes of CPU.",
        "",
    ]
    if alive:
        lines += ["These live:", "", *(f"- {result.name}: {known[result.name].bug}." for result in alive), ""]
    lines += ["| bug | what is wrong | noticed by | after CPU time |", "| --- | --- | --- | --- |"]
    for result in judged:
        bug = known[result.name].bug
        lines.append(f"| {result.name} | {bug} | {_noticed_by(result)} | {result.cpu_time:.0f} s |")
    return [*lines, ""]


def _noticed_by(result: Judged) -> str:
    if not result.caught:
        return "nothing"
    if result.verdict == CASE:
        return f"case `{result.by}`"
    if result.verdict in (HANG, CRASH):
        return f"{'no end' if result.verdict == HANG else 'death'} of {result.by}"
    file, _, name = result.by.partition("::")
    return f"`{name.split('[')[0] or file}`"
