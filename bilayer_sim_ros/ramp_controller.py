"""Executable `ramp_controller`: takes one stimulus channel from one value to another."""

from __future__ import annotations

import sys

from bilayer_sim_ros.missing import explain_missing_ros
from bilayer_sim_ros.parameters import RAMP_CONTROLLER


def main(argv: list[str] | None = None) -> int:
    """Run the node; the exit code."""
    try:
        from bilayer_sim_ros.executable import run
        from bilayer_sim_ros.ramp import control
    except ModuleNotFoundError as error:
        return explain_missing_ros("ramp_controller", error)
    return run("ramp_controller", "ramp_controller", RAMP_CONTROLLER, control, argv)


if __name__ == "__main__":
    sys.exit(main())
