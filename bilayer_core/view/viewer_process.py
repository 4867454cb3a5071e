"""The viewer as a process of its own: with a window, in a browser, or without a screen for pictures."""

from __future__ import annotations

import ctypes.util
import importlib.util
import logging
import os
import socket
import subprocess
import sys
import time as clock
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import TypeVar

from bilayer_core.errors import InputError
from bilayer_core.extras import missing_library
from bilayer_core.view.bound_process import BoundProcess
from bilayer_core.view.recording_layout import TIMELINE

WINDOW_SIZE = "1920x1080"
START_LIMIT = 60.0  # longest wait for the viewer to answer [s]; a software driver on a busy machine is slow
DRAW_LIMIT = 120.0  # longest wait for a finished picture [s]
DRAW_PERIOD = 1.0  # between two looks at whether the picture still changes [s]
DRIVER_DIRECTORIES = (Path("/usr/share/vulkan/icd.d"), Path("/etc/vulkan/icd.d"))
DRIVER_VARIABLES = ("VK_DRIVER_FILES", "VK_ICD_FILENAMES")
MISSING_DRIVER = (
    "there is no Vulkan driver to draw with; on Debian and Ubuntu install Mesa's software driver with: "
    "sudo apt-get install mesa-vulkan-drivers libvulkan1"
)
DRIVER_FAILURES = ("No graphics adapter", "Failed to get render context")  # what the viewer says without a driver
SHOWN_LINES = 5  # of what the viewer said before it failed
_log = logging.getLogger(__name__)
Answer = TypeVar("Answer")


def show(recording: Path) -> None:
    """Open a recording in a window; return when it is closed."""
    command = [str(viewer_executable()), str(recording), "--bind", "127.0.0.1", "--port", "auto"]
    code = subprocess.call(command, env=viewer_environment())
    if code:
        raise InputError(f"the viewer ended with exit code {code}; without a screen use --web or --screenshot")


def take_picture(recording: Path, time: float | None = None) -> bytes:
    """Return PNG of a recording at `time` [s] (default: its end)."""
    with HeadlessViewer() as viewer:
        viewer.open(recording)
        viewer.set_time(time)
        picture = viewer.picture()
        for complaint in viewer.complaints():
            _log.warning("the picture is not complete: %s", complaint)
        return picture


def viewer_executable() -> Path:
    """Return the viewer's own program: killing the script of that name on PATH would leave the viewer running."""
    spec = importlib.util.find_spec("rerun_cli")
    if spec is None or spec.origin is None:
        raise missing_library("the viewer", "rerun_cli")
    directory = Path(spec.origin).parent
    bundled = directory / "Rerun.app" / "Contents" / "MacOS" / "Rerun"
    return bundled if sys.platform == "darwin" and bundled.exists() else directory / "rerun"


def viewer_environment() -> dict[str, str]:
    """Return the environment of the viewer: it sends no usage statistics where CI is set, and asks no questions."""
    return {**os.environ, "CI": "true", "RERUN_APP_ONLY": "true", "NO_COLOR": "1"}


def drawing_environment() -> dict[str, str]:
    """Return the viewer's environment for drawing without a screen.

    It selects Mesa's software driver unless the user has chosen a driver.
    """
    environment = viewer_environment()
    if sys.platform != "linux" or any(environment.get(name) for name in DRIVER_VARIABLES):
        return environment
    drivers = [path for directory in DRIVER_DIRECTORIES for path in sorted(directory.glob("*.json"))]
    if not drivers or ctypes.util.find_library("vulkan") is None:
        raise InputError(MISSING_DRIVER)
    software = [path for path in drivers if path.name.startswith("lvp_icd")]
    if software:
        environment[DRIVER_VARIABLES[1]] = str(software[0])
    return environment


class HeadlessViewer:
    """A viewer without a window, which ends with the ``with`` block, and with this process, however that ends.

    Attributes
    ----------
    client : rerun.experimental.ViewerClient
        For anything else that can be asked of it.
    """

    def __init__(self, window_size: str = WINDOW_SIZE):
        self._window_size = window_size

    def __enter__(self) -> HeadlessViewer:
        from rerun.experimental import ViewerClient

        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        command = [str(viewer_executable()), "--headless", "--hide-welcome-screen", "--window-size", self._window_size]
        command += ["--bind", "127.0.0.1", "--port", str(port)]
        self._process = BoundProcess(command, drawing_environment())
        with ExitStack() as undo:
            undo.callback(self.__exit__, None, None, None)
            self._wait_for(port)
            self.client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
            undo.pop_all()
        return self

    def __exit__(self, exception_type, exception, traceback) -> None:
        self._process.end()

    def open(self, recording: Path) -> None:
        """Load a recording and wait until all of it has arrived."""
        deadline = clock.monotonic() + DRAW_LIMIT
        self._ask("load the recording", deadline, lambda: self.client.open(str(recording)))
        while True:
            state = self._ask("load the recording", deadline, self.client.get_state)
            if not state.loading and any(self._timeline(item) for item in state.recordings):
                return
            self._check(deadline, "load the recording")

    def set_time(self, time: float | None) -> None:
        """Stop at `time` [s], or at the end."""
        state = self.client.get_state()
        shown = next(item for item in state.recordings if item.store_id == state.active_recording)
        if time is None:
            time = self._timeline(shown).end / 1e9
        self.client.set_time(TIMELINE, duration=float(time), play_state="paused")

    def picture(self, view: str | None = None, period: float = DRAW_PERIOD) -> bytes:
        """Return PNG of the whole viewer or of the view with this name, taken once two looks, a `period` [s] apart,
        show the same. The viewer draws anew for each look; once it has loaded all meshes, a short period will do.
        """
        deadline = clock.monotonic() + DRAW_LIMIT
        shown = None
        if view is not None:
            shown = next(item.view_id for item in self.client.get_state().views if item.name == view)
        before = None
        while True:
            now = self._ask("finish the picture", deadline, lambda: self.client.take_screenshot(shown))
            if now == before:
                return now
            before = now
            self._check(deadline, "finish the picture", period)

    def complaints(self) -> list[str]:
        """Return the viewer's reports of parts that it could not show, and the errors in its log."""
        reports = [
            f"{view.name}: {report.severity}: {report.summary}: {report.details}"
            for view in self.client.get_state().views
            for report in view.reports
        ]
        return reports + [
            f"{entry.level}: {entry.message}" for entry in self.client.get_logs() if entry.level == "ERROR"
        ]

    def _ask(self, what: str, deadline: float, question: Callable[[], Answer]) -> Answer:
        """Return the viewer's answer. It may need several attempts, because the viewer gives up on each after 15 s."""
        while True:
            try:
                return question()
            except (OSError, RuntimeError) as error:
                _log.debug("the viewer did not answer: %s", error)
                self._check(deadline, what)

    @staticmethod
    def _timeline(recording):
        """Return the timeline of simulated time, None while nothing is on it."""
        return next((item for item in recording.timelines if item.name == TIMELINE and item.end is not None), None)

    def _wait_for(self, port: int) -> None:
        deadline = clock.monotonic() + START_LIMIT
        while True:
            try:
                socket.create_connection(("127.0.0.1", port), timeout=DRAW_PERIOD).close()
                return
            except OSError:
                self._check(deadline, "start", 0.1)

    def _check(self, deadline: float, what: str, wait: float = DRAW_PERIOD) -> None:
        """Wait a little; raise if the viewer has ended or the time is over."""
        clock.sleep(wait)
        if self._process.exit_code is None and clock.monotonic() < deadline:
            return
        said = self._process.said().partition("stack backtrace:")[0].strip()
        last = "\n".join(said.splitlines()[-SHOWN_LINES:])
        if any(sign in said for sign in DRIVER_FAILURES):
            raise InputError(f"{MISSING_DRIVER}\nThe viewer said:\n{last}")
        raise InputError(f"the viewer did not {what}; it said:\n{last}")
