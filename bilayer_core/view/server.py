"""The server of rerun as a process of its own: viewers connect to it, also late ones, and it never holds anybody up."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time as clock
import webbrowser
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

from bilayer_core.errors import InputError, OutputError
from bilayer_core.view.bound_process import BoundProcess
from bilayer_core.view.viewer_process import viewer_environment, viewer_executable

LOCAL = "127.0.0.1"
PORT, WEB_PORT = 9876, 9090
"""Where viewers and browsers look first."""
PORTS_TRIED = 50
MEMORY_LIMIT = "1GB"
"""Of what is kept for viewers that come late; beyond it the oldest is dropped."""
START_LIMIT = 30.0  # longest wait for the server to answer [s]
CHECK_PERIOD = 0.5  # between two looks at whether the server still runs [s]


class ViewServer:
    """Takes what is sent to it, and hands it to all viewers that connect, from its beginning on.

    It ends with the ``with`` block, and with this process, however that ends.

    Parameters
    ----------
    bind : str
        Address of this machine at which it listens; ``0.0.0.0`` for all, where whoever reaches the machine can look.
    port : int, optional
        For viewers; by default the first free one from `PORT` on.
    recording : Path, optional
        An ``.rrd`` file that it shows from the start; an absolute path, which rerun cannot take for an option or a URL.

    Attributes
    ----------
    port, web_port : int
        For viewers and for browsers.
    url : str
        For recordings of this machine.

    Raises
    ------
    InputError
        If the address or the port cannot be had.
    """

    def __init__(self, bind: str = LOCAL, port: int | None = None, recording: Path | None = None):
        self.bind, self._recording = bind, recording
        self.port = _free_port(bind, PORT, "") if port is None else _free_port(bind, port, "--port")
        self.web_port = _free_port(bind, WEB_PORT, "", but=self.port)
        self._host = socket.gethostname() if bind in ("0.0.0.0", "::") else bind
        local = LOCAL if bind in ("0.0.0.0", "::") else bind
        self.url = f"rerun+http://{_bracketed(local)}:{self.port}/proxy"

    @property
    def viewer_address(self) -> str:
        """For ``rerun ADDRESS``."""
        return f"rerun+http://{_bracketed(self._host)}:{self.port}/proxy"

    @property
    def web_address(self) -> str:
        """For a browser."""
        quoted = self.viewer_address.replace("+", "%2B")
        return f"http://{_bracketed(self._host)}:{self.web_port}/?url={quoted}"

    @property
    def address(self) -> str:
        """Both, in words for a screen."""
        return f"rerun {self.viewer_address}  or in a browser  {self.web_address}"

    def __enter__(self) -> ViewServer:
        command = [str(viewer_executable()), "--serve-web", "--bind", self.bind, "--port", str(self.port)]
        command += ["--web-viewer-port", str(self.web_port), "--server-memory-limit", MEMORY_LIMIT]
        command += ["--cors-allow-origin", f"http://{_bracketed(self._host)}:{self.web_port}"]
        command += [str(self._recording)] if self._recording else []
        self._process = BoundProcess(command, viewer_environment())
        try:
            self._wait()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._process.end()

    def check(self) -> None:
        """Raise OutputError if it has ended."""
        if (code := self._process.exit_code) is not None:
            last = "\n".join(self._process.said().splitlines()[-5:])
            raise OutputError(f"the viewer's server ended with exit code {code}; it said:\n{last}")

    def _wait(self) -> None:
        deadline = clock.monotonic() + START_LIMIT
        address = self.url.partition("//")[2].rpartition(":")[0].strip("[]")
        while True:
            self.check()
            try:
                socket.create_connection((address, self.port), timeout=1.0).close()
                return
            except OSError:
                if clock.monotonic() > deadline:
                    raise OutputError(f"the viewer's server has not answered for {START_LIMIT:g} s") from None
                clock.sleep(0.05)


def serve(recording: Path, name: str, say: Callable[[str], None]) -> NoReturn:
    """Show a recording in a browser, until a signal comes.

    `recording`: an absolute path. `name`: what the user calls it. `say`: takes the line for the screen, with the
    address. Raises OutputError if the server ends.
    """
    with ViewServer(recording=recording) as server:
        say(f"{name}: {server.web_address} (served to this machine only, until Ctrl-C)")
        if has_screen():
            webbrowser.open(server.web_address)
        while True:
            server.check()
            clock.sleep(CHECK_PERIOD)


def has_screen() -> bool:
    """Return whether a window can be opened."""
    return sys.platform != "linux" or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def open_window(server: ViewServer) -> subprocess.Popen:
    """Open a viewer with a window that shows what a server has."""
    command = [str(viewer_executable()), "--connect", server.url, "--bind", LOCAL, "--port", "auto"]
    return subprocess.Popen(command, env=viewer_environment(), stdin=subprocess.DEVNULL)


def _bracketed(host: str) -> str:
    """Return a host as a URL needs it: an IPv6 address in brackets."""
    return f"[{host}]" if ":" in host else host


def _free_port(bind: str, first: int, option: str, but: int | None = None) -> int:
    """Return `first` itself if an option asks for it, else the first free port from there on."""
    for port in range(first, first + 1 if option else first + PORTS_TRIED):
        if port == but:
            continue
        with socket.socket(socket.AF_INET6 if ":" in bind else socket.AF_INET) as probe:
            if os.name == "posix":  # on Windows this option takes ports from other programs
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind((bind, port))
                probe.listen(1)
            except (OSError, OverflowError) as error:
                if not isinstance(error, OSError) or error.errno not in _TAKEN:
                    raise InputError(
                        f"--bind: cannot listen at {bind}, port {port}: {getattr(error, 'strerror', None) or error}"
                    ) from error
                continue
        return port
    if option:
        raise InputError(f"{option}: {first} is taken by another program; leave it out for the first free one")
    raise InputError(f"--port: no port from {first} to {first + PORTS_TRIED - 1} is free")


_TAKEN = (98, 48, 10048)
"""EADDRINUSE of Linux, macOS and Windows."""


def suffixed(path: Path, number: int) -> Path:
    """Return the name of a run's file; files after a reset are numbered, as logs are."""
    return path.with_stem(f"{path.stem}_{number}") if number else path
