"""Executable `ramp_controller`: takes one stimulus channel from one value to another."""

from __future__ import annotations

import sys

from bilayer_sim_ros.signals import Signals


def main(argv: list[str] | None = None) -> int:
    """Run the node; the exit code, 0 also after SIGINT and SIGTERM."""
    signals = Signals("ramp_controller")  # before what takes long to import
    try:
        from bilayer_sim_ros.executable import run_task
        from bilayer_sim_ros.parameters import RAMP_CONTROLLER
        from bilayer_sim_ros.ramp import control
    except ModuleNotFoundError as error:
        from bilayer_sim_ros.missing import explain_missing_ros

        return explain_missing_ros("ramp_controller", error)
    return run_task(signals, "ramp_controller", "ramp_controller", RAMP_CONTROLLER, control, argv)


if __name__ == "__main__":
    sys.exit(main())
