"""Which rates of frames a simulation can keep."""

from __future__ import annotations

from bilayer_core.errors import InputError
from bilayer_core.simulation.simulator import Simulator
from bilayer_sim_ros.control.control_ticks import SHORTEST_PERIOD
from bilayer_sim_ros.control.periods import ROUNDING


def refuse_rate(simulator: Simulator, rate: float) -> None:
    """Raise InputError for more frames than steps can give.

    Parameters
    ----------
    simulator : Simulator
    rate : float
        Frames per simulated second [Hz].
    """
    fixed = simulator.tolerance is None
    most = 1.0 / (simulator.dt if fixed else SHORTEST_PERIOD)
    if rate > most * (1.0 + ROUNDING):
        why = f"fixed steps of {simulator.dt:g} s end no more often" if fixed else "steps are not made shorter for it"
        raise InputError(f"parameter 'rate' is {rate:g}; allowed is at most {most:g} Hz: {why}")


def refuse_marker_rate(marker_rate: float, rate: float) -> None:
    """Raise InputError for nodes, points and markers more often than frames; both rates in Hz."""
    if marker_rate > rate * (1.0 + ROUNDING):
        raise InputError(
            f"parameter 'marker_rate' is {marker_rate:g}; allowed is at most the rate of frames, {rate:g} Hz: "
            "set 'rate' to that too"
        )
