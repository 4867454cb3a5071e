"""The life of a simulation beside a node: kernels are compiled, it runs, it ends, each in threads of its own."""

from __future__ import annotations

import atexit
import sys
import threading
from collections.abc import Callable, Mapping
from functools import partial

from rclpy.node import Node

from bilayer_core.engine.needed_pieces import FOR_FRAMES, needed_pieces
from bilayer_core.errors import BilayerError
from bilayer_core.jit.compile_all import ensure_compiled
from bilayer_sim_ros.node.parameters import Value
from bilayer_sim_ros.node.simulation_topics import wire
from bilayer_sim_ros.publishing.live_view import Nobody, Viewers, live_view

COMPILING = threading.Lock()
"""Held while kernels are compiled or loaded: simulations of one process share them."""
PERIOD = 0.1
"""Real time between two looks whether it is another simulation's turn to compile [s]."""
PATIENCE = 3.0
"""Longest wait for a compilation that is to end: a compiler ends with the piece of the engine that it is at [s]."""
AT_EXIT = "ended with the program"


class SimulationRun:
    """A simulation that is started once and stopped from any thread.

    Parameters
    ----------
    node : Node
        On whose topics and services it is.
    parameters : mapping
        Values of `SIM_NODE`.
    ended : callable
        Called at the very end, in a thread of the run.

    Raises
    ------
    InputError
        For parameters that cannot be.
    """

    def __init__(self, node: Node, parameters: Mapping[str, Value], ended: Callable[[], None]):
        self.error: Exception | None = None  # Why it ended, unless it was stopped or reached its duration
        self._logger = node.get_logger()
        self._ended = ended
        self._stop, self._over = threading.Event(), threading.Event()
        self._turn = threading.Event()  # compiled, or to be stopped
        self._reason = ""
        self._lock = threading.Lock()
        self._show: Callable[[], Viewers] = partial(live_view, node, parameters)
        self._simulation = wire(node, parameters, self._stop.set, self.stop)
        self._compilation = threading.Thread(target=self._compile, name="compilation", daemon=True)
        self._thread = threading.Thread(target=self._live, name="simulation run", daemon=True)

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._simulation.simulator.time

    @property
    def compiling(self) -> bool:
        """True while kernels are being compiled; a compiler cannot be ended in the middle of a piece of the engine."""
        return self._compilation.is_alive()

    @property
    def started(self) -> bool:
        """True if the run was started."""
        return self._thread.ident is not None

    @property
    def over(self) -> bool:
        """True if the run has ended, and its files are finished."""
        return self._over.is_set()

    def start(self) -> None:
        """Compile and simulate, in other threads. They do not keep a program alive; files are finished at its exit."""
        atexit.register(self._end_with_program)
        self._thread.start()

    def stop(self, reason: str) -> None:
        """End the run soon, for a reason that log and console tell; the first one counts."""
        with self._lock:
            if not self._stop.is_set():
                self._reason = reason
            self._stop.set()
        self._turn.set()

    def wait(self, timeout: float | None = None) -> bool:
        """Return when it has ended, and its files are finished, or after `timeout` [s]; whether it has."""
        return self._over.wait(timeout)

    def close(self) -> None:
        """Refuse what is still asked, of a run that was never started."""
        self._simulation.worker.stop()

    # The rest runs in threads of the run.

    def _live(self) -> None:
        worker, simulator = self._simulation.worker, self._simulation.simulator
        viewers = self._begin_view()
        try:
            if self.error is None:
                self._compilation.start()
                self._turn.wait()
            in_time = not self._stop.is_set()
            if in_time:
                self._await_viewers(viewers)
            if not in_time:
                worker.stop()
                reason = f"{self._reason} while kernels were compiled"
                worker.tell_failure(reason)
                self._compilation.join(PATIENCE)
                self._logger.info(reason)
            elif self.error is None:
                worker.start()
                self._stop.wait()
                worker.stop(self._reason)
                self._say_end(worker, simulator)
            else:
                worker.stop()
                worker.tell_failure(str(self.error))
            self._simulation.services.finish()
            self.error = self.error or worker.error
        except Exception as error:
            self.error = self.error or error
        finally:
            self._simulation.frames.finish()
            viewers.end()
            atexit.unregister(self._end_with_program)
            self._over.set()
            self._ended()

    def _begin_view(self) -> Viewers:
        try:
            return self._show()
        except BilayerError as error:
            self.error = error
            return Nobody()

    def _await_viewers(self, viewers: Viewers) -> None:
        if self.error is None:
            try:
                viewers.wait(self._stop, self._simulation.frames.is_shown)
            except BilayerError as error:
                self.error = error

    def _compile(self) -> None:
        try:
            while not COMPILING.acquire(timeout=PERIOD):
                self._report(0, 0)
            try:
                model = self._simulation.simulator.model
                ensure_compiled(self._report, lambda: needed_pieces(model) | FOR_FRAMES)
                self._report(0, 0)
                seconds = self._simulation.simulator.compile()
            finally:
                COMPILING.release()
            name, state = self._simulation.simulator.description.scene_name, self._simulation.state
            self._logger.info(f"'{name}' is ready ({seconds:.1f} s to compile or load kernels), {state}")
        except _NotNeededError:
            return
        except Exception as error:
            self.error = error
        finally:
            self._turn.set()

    def _report(self, done: int, total: int) -> None:
        if self._stop.is_set():
            raise _NotNeededError
        if total:
            self._simulation.announcer.say_compiling(done, total)

    def _say_end(self, worker, simulator) -> None:
        if worker.log_status.dropped and not worker.log_status.failure:
            self._logger.warning(f"the log lacks {worker.log_status.dropped} frames: the disk was too slow")
        if worker.error is None:
            self._logger.info(
                f"{self._reason or 'ended'} at t = {simulator.time:.6g} s; "
                f"CPU time of the steps: {simulator.cpu_time:.3f} s"
            )

    def _end_with_program(self) -> None:
        self.stop(AT_EXIT)
        self.wait()
        # Python clears modules from the last to the first, and rclpy's global executor needs `weakref` to end, which
        # rclpy imports: with rclpy last, a program that does not shut it down ends without a traceback.
        sys.modules["rclpy"] = sys.modules.pop("rclpy")


class _NotNeededError(Exception):
    """A compilation whose simulation has been stopped."""
