"""Pure functions between the simulator's quantities and those ROS messages that are not made from frames."""

from __future__ import annotations

import math
from collections.abc import Mapping

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from std_msgs.msg import Header

from bilayer_sim_ros.node.run_status import Status

NANOSECONDS = 1_000_000_000
# A run that reaches less than this part of the requested real-time factor is reported as late.
ON_TIME = 0.95
PATIENCE = 5.0
"""Real time after which a controller that does not answer is missed [s]."""


def to_time(seconds: float) -> Time:
    """Return a simulated time [s] as a message, to the nearest nanosecond."""
    whole, part = divmod(to_nanoseconds(seconds), NANOSECONDS)
    return Time(sec=whole, nanosec=part)


def to_nanoseconds(seconds: float) -> int:
    """Return a simulated time [s] as ROS counts it [ns]."""
    return round(seconds * NANOSECONDS)


def nanoseconds_of(stamp: Time) -> int:
    """Return the time of a message [ns]."""
    return stamp.sec * NANOSECONDS + stamp.nanosec


def to_seconds(stamp: Time) -> float:
    """Return the time of a message [s]."""
    return nanoseconds_of(stamp) / NANOSECONDS


def status_without_run(message: str, name: str) -> DiagnosticArray:
    """Return diagnostics of the node's activity before there is a run; `name` is the node's full name."""
    return DiagnosticArray(status=[_report(DiagnosticStatus.OK, message, name, {})])


def to_diagnostics(status: Status, name: str, ignored: Mapping[str, int]) -> DiagnosticArray:
    """Return how the run is doing.

    `name`: full name of the node. `ignored`: how many answers to ticks are ignored so far, by the reason.
    """
    waiting = status.waited > 0.0
    late = not (status.paused or waiting) and status.real_time_factor < ON_TIME * status.asked_factor
    if waiting:
        message = f"waiting for a stimulus at t = {status.time:.6g} s"
    elif status.paused:
        message = "paused"
    elif late:
        message = f"slower than asked for: {status.real_time_factor:.3g} not {status.asked_factor:g}"
    else:
        message = "running"
    if status.log.failure:
        message += ", without its log"
    elif status.dropped:
        message += f", and {status.dropped} frames were left out of the log: the disk is too slow"
    per_step = status.iterations / status.steps if status.steps else math.nan
    part = status.numerical_energy / status.energy_through if status.energy_through > 0.0 else 0.0
    values = {
        "simulated time [s]": f"{status.time:.6g}",
        "real-time factor": f"{status.real_time_factor:.4g}",
        "steps": str(status.steps),
        "steps taken": str(status.substeps),
        "rejected steps": str(status.rejected),
        "rejected steps since the start": str(status.rejected_in_all),
        "Newton iterations per step": f"{per_step:.3g}",
        "largest residual [m/s]": f"{status.residual:.3g}",
        "numerical energy [J]": f"{status.numerical_energy:.3g}",
        "numerical energy, of what went through": f"{part:.3g}",
        "waited for a stimulus [s]": f"{status.waited:.3g}",
        **{f"answers ignored that were {why}": str(count) for why, count in ignored.items()},
        "frames left out of the log": str(status.log.dropped),
        "in the queue of the log": str(status.log.waiting),
        "log": status.log.failure or "OK",
    }
    level = DiagnosticStatus.WARN if late or status.dropped or status.waited >= PATIENCE else DiagnosticStatus.OK
    report = _report(DiagnosticStatus.ERROR if status.log.failure else level, message, name, values)
    return DiagnosticArray(header=Header(stamp=to_time(status.time)), status=[report])


def _report(level: bytes, message: str, name: str, values: Mapping[str, str]) -> DiagnosticStatus:
    pairs = [KeyValue(key=key, value=value) for key, value in values.items()]
    return DiagnosticStatus(level=level, name=f"{name}: simulation", message=message, hardware_id=name, values=pairs)
