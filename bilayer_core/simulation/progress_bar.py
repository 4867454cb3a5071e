"""A bar that shows how far a run is."""

from __future__ import annotations

import sys
import time as clock
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from html import escape

REFRESH = 0.1
"""Wall time between two updates of the bar [s]."""


@contextmanager
def progress_bar(name: str, begin: float, end: float, quiet: bool = False) -> Iterator[Callable[[float], None]]:
    """Show a bar with simulated time and real-time factor, in a notebook or on stderr, with the time left.

    Yield a function to set the time.

    Parameters
    ----------
    name : str
        Of the scene.
    begin, end : float
        Simulated time at the ends of the bar [s].
    quiet : bool
        Show nothing.
    """
    if not quiet and in_notebook():
        yield _notebook_bar(name, begin, end)
        return
    if quiet or not sys.stderr.isatty():
        yield lambda time: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    bar = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[time]:.2f}/{task.fields[end]:g} s"),
        TextColumn("real time x {task.fields[factor]:.2f}"),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=Console(stderr=True),
    )
    started = shown = clock.perf_counter()
    with bar:
        task = bar.add_task(name, total=end - begin, time=begin, end=end, factor=0.0)

        def show(time: float) -> None:
            nonlocal shown
            now = clock.perf_counter()
            if now - shown >= REFRESH or time >= end:
                shown = now
                bar.update(task, completed=time - begin, time=time, factor=(time - begin) / (now - started))

        yield show


def in_notebook() -> bool:
    """Return whether a notebook runs the program."""
    if "IPython" not in sys.modules:
        return False
    from IPython import get_ipython

    return getattr(get_ipython(), "kernel", None) is not None


def _notebook_bar(name: str, begin: float, end: float) -> Callable[[float], None]:
    """Show a bar under the cell, and return a function to set the time."""
    from IPython.display import HTML, display

    def bar(time: float, factor: float) -> HTML:
        part = f"<progress value='{time - begin:.9g}' max='{end - begin:.9g}'></progress>"
        return HTML(f"{escape(name)} {part} {time:.2f}/{end:g} s, real time x {factor:.2f}")

    shown_at = started = clock.perf_counter()
    handle = display(bar(begin, 0.0), display_id=True)

    def show(time: float) -> None:
        nonlocal shown_at
        now = clock.perf_counter()
        if now - shown_at >= REFRESH or time >= end:
            shown_at = now
            handle.update(bar(time, (time - begin) / (now - started)))

    return show
