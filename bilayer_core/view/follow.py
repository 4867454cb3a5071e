"""Following a log that is being written. rerun is imported when it is called, not before."""

from __future__ import annotations

import time as clock
import webbrowser
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from bilayer_core.log.file.growing_log import GrowingLog
from bilayer_core.view.colouring import STRAIN
from bilayer_core.view.rerun_view import require_rerun

if TYPE_CHECKING:
    import subprocess

    from bilayer_core.view.server import ViewServer

PERIOD = 0.2
"""Between two looks at the log [s]; its writer adds to it about as often."""


@dataclass(frozen=True)
class Serving:
    """How what is followed is shown."""

    bind: str = "127.0.0.1"  # Address at which viewers are served
    port: int | None = None  # For viewers; None for the first that is free
    window: bool = True  # Open the viewer, where there is a screen
    web: bool = False  # Open a browser instead
    save: Path | None = None  # Recording that is written as well
    colour: str = STRAIN  # What the colours of rods say


def follow_log(path: str | Path, serving: Serving, say: Callable[[str], None]) -> None:
    """Show a log from its beginning on, and what is added to it, until the window is closed or a signal comes.

    Parameters
    ----------
    path : str or Path
        A log that is being written, or is finished; one that replaces it is shown as another recording.
    serving : Serving
    say : callable
        Takes lines for the screen.

    Raises
    ------
    InputError
        If it is no log, or the address cannot be had.
    OutputError
        If the server of the viewers ends.
    """
    require_rerun()
    from bilayer_core.view.live import LiveView
    from bilayer_core.view.server import ViewServer

    log = GrowingLog(path)
    with ExitStack() as ending:
        server = ending.enter_context(ViewServer(serving.bind, serving.port))
        view = LiveView(server, serving.colour, serving.save)
        ending.callback(view.close)
        view.begin(log.head.description)
        say(f"following {path}: {server.address}")
        window = open_for(server, serving, say, ending)
        told = False
        while window is None or window.poll() is None:
            messages = log.read()
            for message in messages:
                view.add(*message)
            view.show()
            if messages:
                continue
            if log.finished and not told:
                told = True
                say(f"{path} is finished; it is served until Ctrl-C" if window is None else f"{path} is finished")
            if log.replaced and log.restart():
                told = False
                view.begin(log.head.description)
                say(f"{path} was replaced by another log: it is shown as another recording")
            clock.sleep(PERIOD)


def open_for(
    server: ViewServer, serving: Serving, say: Callable[[str], None], ending: ExitStack
) -> subprocess.Popen | None:
    """Open what the user wants to look with; the window, which `ending` closes."""
    if not serving.window:
        return None
    from bilayer_core.view.server import has_screen, open_window

    if not has_screen():
        say("there is no screen here: no window is opened, viewers may connect from elsewhere")
        return None
    if serving.web:
        webbrowser.open(server.web_address)
        return None
    window = open_window(server)
    ending.callback(window.terminate)
    return window
