"""Which rates of frames a node can keep."""

from __future__ import annotations

from bilayer_core.errors import InputError
from bilayer_sim_ros.control.control_ticks import SHORTEST_PERIOD
from bilayer_sim_ros.control.periods import ROUNDING


def refuse_rate(rate: float) -> None:
    """Raise InputError for more frames per simulated second than `/clock` tells apart [Hz]."""
    most = 1.0 / SHORTEST_PERIOD
    if rate > most * (1.0 + ROUNDING):
        raise InputError(f"parameter 'rate' is {rate:g}; allowed is at most {most:g} Hz")


def refuse_marker_rate(marker_rate: float, rate: float) -> None:
    """Raise InputError for nodes, points and markers more often than frames; both rates in Hz."""
    if marker_rate > rate * (1.0 + ROUNDING):
        raise InputError(
            f"parameter 'marker_rate' is {marker_rate:g}; allowed is at most the rate of frames, {rate:g} Hz: "
            "set 'rate' to that too"
        )
