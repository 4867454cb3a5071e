"""Signals that ask a run to end, its progress, and a notice about compilation."""

from __future__ import annotations

import signal
import sys
import time as clock
from collections.abc import Callable, Collection, Iterator
from contextlib import ExitStack, contextmanager
from types import FrameType

from bilayer_core.cli.signals import WORDS
from bilayer_core.cli.terminal import say

COMPILING_NOTICE = "compiling kernels, once for this version on this machine (one to three minutes) ..."
TELL_EVERY = 10.0
"""Wall time between two lines about many runs, without a screen [s]."""


class Interrupt:
    """Turns the first signal that asks the program to end into a wish that is granted after the step.

    The next one is not put off: it goes to the handler that was there before.
    """

    def __init__(self):
        self.wished: int | None = None  # The number of the signal
        self.granted = False

    def __enter__(self) -> Interrupt:
        self._before = {number: signal.signal(number, self._note) for number in WORDS}
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def grant(self) -> bool:
        """Return whether to end now, and note it in `granted`; called between steps."""
        self.granted = self.wished is not None
        return self.granted

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self.wished is None:
            self.wished = number
            return
        self._before[number](number, frame)


def compile_kernels(quiet: bool, needed: Callable[[], Collection[str]] | None = None) -> None:
    """Compile all kernels or the `needed` ones if they are missing, and tell the user why nothing else happens."""
    from bilayer_core.jit.compile_all import ensure_compiled

    if quiet:
        ensure_compiled(lambda done, total: None, needed)
        return
    shown: list[Callable[[int, int], None]] = []

    def report(done: int, total: int) -> None:
        if not shown:
            say(COMPILING_NOTICE, err=True)
            shown.append(stack.enter_context(pieces_bar(total)))
        shown[0](done, total)

    with ExitStack() as stack:
        ensure_compiled(report, needed)


@contextmanager
def pieces_bar(total: int) -> Iterator[Callable[[int, int], None]]:
    """Show a bar on stderr for pieces that are compiled. Yield a function that takes the number done and the total."""
    if not sys.stderr.isatty():
        yield lambda done, total: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeElapsedColumn

    with Progress(BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), console=Console(stderr=True)) as bar:
        task = bar.add_task("", total=total)
        yield lambda done, total: bar.update(task, completed=done)


@contextmanager
def count_bar(total: int, quiet: bool) -> Iterator[Callable[[str], None]]:
    """Show a bar on stderr for many measurements. Yield a function that takes the name of the next one.

    `total`: number of calls.
    """
    if quiet or not sys.stderr.isatty():
        yield lambda text: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TextColumn("{task.description}")
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task, begun = bar.add_task("", total=total), 0

        def show(text: str) -> None:
            nonlocal begun
            bar.update(task, completed=begun, description=text)
            begun += 1

        yield show
        bar.update(task, completed=total, description="done")


@contextmanager
def runs_bar(total: int, there: int, quiet: bool) -> Iterator[Callable[[str], None]]:
    """Show a bar on stderr for many runs: how many are done, how many a second, the time left, how many failed.

    Without a terminal, print a line now and then. Yield a function that takes the outcome of each run. `total`,
    `there`: number of runs, and of those that are there before it begins.
    """
    if quiet:
        yield lambda outcome: None
        return
    begun, count, failed = clock.perf_counter(), 0, 0

    def state() -> tuple[float, float, int]:
        rate = count / max(clock.perf_counter() - begun, 1e-9)
        return rate, (total - there - count) / rate if rate else 0.0, failed

    if not sys.stderr.isatty():
        told = begun

        def tell(outcome: str) -> None:
            nonlocal count, failed, told
            count, failed = count + 1, failed + (outcome != "done")
            if clock.perf_counter() - told >= TELL_EVERY:
                told = clock.perf_counter()
                rate, left, _ = state()
                text = f"{there + count} of {total} runs, {rate:.3g} a second, {left:.0f} s left, {failed} not done"
                say(text, err=True)

        yield tell
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = BarColumn(), MofNCompleteColumn(), TextColumn("{task.description}"), TimeRemainingColumn()
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task("starting processes", total=total, completed=there)

        def show(outcome: str) -> None:
            nonlocal count, failed
            count, failed = count + 1, failed + (outcome != "done")
            bar.update(task, completed=there + count, description=f"{state()[0]:.3g}/s, {failed} not done, left")

        yield show
