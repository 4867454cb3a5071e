"""A copy of the checkout that mutants are put into, with compiled kernels of its own."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from ..errors import InputError
from ..jit.cache import CACHE_DIR, FOLDERS
from .mutants import PACKAGE, Mutant
from .reached import reached

try:
    import resource
except ImportError:  # Windows
    resource = None

COPIED = (PACKAGE, "config", "docs", "tests", "pyproject.toml")
"""Of the checkout: what tests of the package need."""
WALL_OVER_CPU = 5.0
"""Wall time after which a process is ended, over the CPU time that it may take: the machine may be busy."""
_FOLDER = "from bilayer_core.jit.cache import cache_folder; print(cache_folder())"


@dataclass(frozen=True)
class Ended:
    """How a process ended: its exit code, what it printed, its CPU time [s], and whether that was all it may take."""

    code: int
    text: str
    cpu_time: float
    stopped: bool


def checkout() -> Path:
    """The checkout that the package is run from.

    Raises
    ------
    InputError
        If it is run from none, so that there are no tests, or not on Linux.
    """
    if not hasattr(resource, "prlimit"):
        raise InputError("mutations: only Linux limits the CPU time of another process; run them there")
    root = Path(__file__).resolve().parents[2]
    missing = [name for name in COPIED if not (root / name).exists()]
    if missing:
        raise InputError(
            f"mutations: {root} has no {', '.join(missing)}; they need a checkout of the repository with its tests, "
            "and the package run from it"
        )
    return root


class CheckoutCopy:
    """A copy in a directory, whose kernels are compiled there once for the sources as they are.

    A mutant has a cache of kernels of its own. All that it cannot change is linked to that of the copy: most of them
    change one or two of some hundred and twenty pieces.

    Parameters
    ----------
    directory : Path
        Made if it is not there; kernels that are in it already are used again.

    Attributes
    ----------
    tree : Path
        The copy.
    """

    def __init__(self, directory: Path):
        self._root, self.tree = checkout(), directory.absolute() / "tree"
        self._kernels, self._own = directory.absolute() / "kernels", directory.absolute() / "kernels-of-mutant"
        self._home = directory.absolute() / "home"
        self._process: int | None = None
        self._stopped = False
        shutil.rmtree(self.tree, ignore_errors=True)
        shutil.rmtree(self._own, ignore_errors=True)  # of a run that was killed
        self._home.mkdir(parents=True, exist_ok=True)
        for name in COPIED:
            source = self._root / name
            if source.is_dir():
                shutil.copytree(source, self.tree / name, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                shutil.copy2(source, self.tree / name)

    def compile(self) -> None:
        """Compile all kernels of the sources as they are.

        Raises
        ------
        InputError
            If that fails.
        """
        ended = self.run(["-m", "bilayer_core.jit.compile_all"], 3600.0)
        if ended.code != 0:
            raise InputError(f"mutations: the kernels of {self.tree} cannot be compiled:\n{ended.text}")

    def stop(self) -> None:
        """End what runs, and let nothing run any more."""
        self._stopped = True
        if self._process is not None:
            _end(self._process)

    def _go_on(self) -> None:
        if self._stopped:
            raise InputError("mutations: were stopped")

    @contextmanager
    def changed(self, mutant: Mutant) -> Iterator[None]:
        """Put a mutant into the copy, and take it out again."""
        path = self.tree / mutant.path
        before, times = path.read_text(encoding="utf-8"), path.stat()
        try:
            base = self._folder(self._kernels)  # before the edit, which has another one
            path.write_text(mutant.applied_to(before), encoding="utf-8")
            self._link_kernels(base, mutant, before)
            yield
        finally:
            path.write_text(before, encoding="utf-8")
            os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))  # which numba looks at
            shutil.rmtree(self._own, ignore_errors=True)

    def _link_kernels(self, base: Path, mutant: Mutant, before: str) -> None:
        """Fill the cache of the mutant with what it cannot change of that of the copy."""
        shutil.rmtree(self._own, ignore_errors=True)
        own = self._folder(self._own)
        names = reached(self.tree / PACKAGE, FOLDERS, mutant.file, before)
        stale = {f"{Path(path).stem}.{name}" for path, name in names}
        for folder in filter(Path.is_dir, base.iterdir()):
            (own / folder.name).mkdir(exist_ok=True)
            for file in folder.iterdir():
                # numba calls files <module>.<name>-<line>…, functions within others <module>.<name>.locals.…
                if ".".join(file.name.split("-")[0].split(".")[:2]) not in stale:
                    os.link(file, own / folder.name / file.name)

    def _folder(self, kernels: Path) -> Path:
        """The folder of the cache `kernels` that the sources of the copy use now."""
        found = subprocess.run(
            [sys.executable, "-P", "-c", _FOLDER],
            env=self._environment(kernels),
            cwd=self.tree,
            capture_output=True,
            text=True,
            check=True,
        )
        return Path(found.stdout.strip())

    def _environment(self, kernels: Path) -> dict[str, str]:
        own = {name: value for name, value in os.environ.items() if not name.startswith(("NUMBA_", "PYTEST_"))}
        return own | {
            "PYTHONPATH": str(self.tree),
            "PYTHONDONTWRITEBYTECODE": "1",  # which goes by seconds and size: two mutants may have both alike
            "HYPOTHESIS_STORAGE_DIRECTORY": str(self._home / "hypothesis"),
            "BILAYER_JIT_AHEAD": "0",
            CACHE_DIR: str(kernels),
        }

    def run(self, arguments: Sequence[str], cpu_limit: float) -> Ended:
        """Run python in the copy, with the kernels of the mutant if there is one in it.

        Parameters
        ----------
        arguments : sequence of str
            Of the interpreter.
        cpu_limit : float
            CPU time [s] after which the process is ended.

        Raises
        ------
        InputError
            After `stop`.
        """
        self._go_on()
        shutil.rmtree(self._home, ignore_errors=True)  # what hypothesis remembers of other mutants
        self._home.mkdir(parents=True)
        kernels = self._own if self._own.exists() else self._kernels
        output = self._home / "output"
        with open(output, "wb") as file:
            process = subprocess.Popen(
                [sys.executable, "-P", *arguments],
                env=self._environment(kernels),
                cwd=self.tree,
                stdout=file,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
            resource.prlimit(process.pid, resource.RLIMIT_CPU, (int(cpu_limit), int(cpu_limit) + 5))
            self._process = process.pid
            late = threading.Timer(WALL_OVER_CPU * cpu_limit, _end, (process.pid,))
            late.start()
            _, status, usage = os.wait4(process.pid, 0)
            late.cancel()
            self._process = None
            process.returncode = os.waitstatus_to_exitcode(status)
        self._go_on()
        stopped = process.returncode in (-signal.SIGXCPU, -signal.SIGKILL)
        text = output.read_text(encoding="utf-8", errors="replace")
        return Ended(process.returncode, text, usage.ru_utime + usage.ru_stime, stopped)


def _end(process: int) -> None:
    """End a process and all that it started."""
    try:
        os.killpg(process, signal.SIGKILL)
    except ProcessLookupError:  # it has ended by itself just now
        pass
