"""A simulation as a ROS 2 node that lives in any process, beside others and on any executor."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from typing import Any

from bilayer_core.errors import InputError
from bilayer_sim_ros.node.configured_node import ConfiguredNode
from bilayer_sim_ros.node.parameters import SIM_NODE
from bilayer_sim_ros.node.signals import Stop
from bilayer_sim_ros.node.simulation_run import SimulationRun

STOPPED = "stopped"
DESTROYED = "ended with its node"
SHUT_DOWN = "ended with the ROS context"


class SimulationNode(ConfiguredNode):
    """The simulator as a node: what the executable `sim_node` runs.

    Its topics, services and parameters are there when it is made. `start` compiles what has to be and simulates, in
    threads of its own; so any executor will do, and a busy one delays messages but no step. Several such nodes may be
    in one process, each with its own name: what happens to one does not touch another. They share ``/clock``, which one
    node alone may publish: set `publish_clock` to false for all others, or remap ``/clock`` of nodes in lockstep.

    Parameters
    ----------
    node_name : str
    ended : callable, optional
        Called with this node when the simulation has ended and its files are finished, in a thread of the node's own;
        not for one that was never started.
    **of_node
        As for `rclpy.node.Node`: ``namespace``, ``context``, ``parameter_overrides``, ``cli_args`` and others. Where
        `rclpy.init` gets other arguments than the command line, give them as ``arguments`` too.

    Raises
    ------
    BilayerError
        For a parameter with a mistyped name or a value that is not allowed, and for a scene or a log that cannot be.

    Examples
    --------
    >>> node = SimulationNode(parameter_overrides=[Parameter("scene", value="bending")])  # doctest: +SKIP
    >>> executor.add_node(node)  # doctest: +SKIP
    >>> node.start()  # doctest: +SKIP
    """

    def __init__(
        self,
        node_name: str = "bilayer_sim",
        *,
        ended: Callable[[SimulationNode], None] | None = None,
        **of_node: Any,
    ):
        self._run: SimulationRun | None = None
        self._when_ended = ended
        super().__init__(node_name, SIM_NODE, **of_node)
        try:
            self._run = SimulationRun(self, self.values, self._tell_end)
        except BaseException:
            super().destroy_node()
            raise
        # A weak method, which `on_shutdown` makes of a bound one, complains when a program just ends.
        node = weakref.ref(self)

        def stop_with_context() -> None:
            if (left := node()) is not None:
                left.stop(SHUT_DOWN)

        self.context.on_shutdown(stop_with_context)

    @property
    def simulated_time(self) -> float:
        """Simulated time [s]."""
        return self._run.time

    @property
    def ended(self) -> bool:
        """True if the simulation has ended and its files are finished."""
        return self._run.over

    @property
    def error(self) -> Exception | None:
        """Why the simulation ended, or what of its files is lost; None if it was stopped or reached its duration."""
        return self._run.error

    @property
    def compiling(self) -> bool:
        """True if kernels are being compiled or loaded."""
        return self._run.compiling

    def start(self) -> None:
        """Compile and simulate until `duration` is reached, `stop` is called or the node is destroyed; returns at once.

        Raises
        ------
        InputError
            If it was started before: a simulation goes back to its start with the service ``~/reset``.
        """
        if self._run.started:
            name = self.get_fully_qualified_name()
            raise InputError(f"the simulation of {name} was started before; its service ~/reset begins it anew")
        self._run.start()

    def stop(self, reason: str = STOPPED) -> None:
        """End the simulation after its present step; returns at once.

        Parameters
        ----------
        reason : str
            Follows the word "run" in log and events.
        """
        self._run.stop(reason)

    def wait(self, timeout: float | None = None) -> bool:
        """Return when the simulation has ended, and its files are finished.

        Parameters
        ----------
        timeout : float, optional
            Longest real time to wait [s].

        Returns
        -------
        bool
            Whether it has ended.
        """
        return self._run.wait(timeout)

    def simulate(self, stop: Stop) -> None:
        """Simulate until it ends or `stop` is set; raises what it ended with. What an executable does.

        Raises
        ------
        BilayerError
            If the simulation could not go on, or its files are not whole.
        """
        ended = self._when_ended
        self._when_ended = lambda node: (stop.set(), ended and ended(node))
        self.start()
        stop.wait()
        self.stop(stop.reason or STOPPED)
        self.wait()
        if self.error is not None:
            raise self.error

    def destroy_node(self) -> None:
        """End the simulation, finish its files, and then the node."""
        if self._run is not None:
            self._run.stop(DESTROYED)
            if self._run.started:
                self._run.wait()
            else:
                self._run.close()
        super().destroy_node()

    def _tell_end(self) -> None:
        if self._when_ended is not None:
            self._when_ended(self)
