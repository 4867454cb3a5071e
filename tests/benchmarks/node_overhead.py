"""CPU time that the node takes beyond the physics, with no subscriber, in per cent of a core (Linux).

    python tests/benchmarks/node_overhead.py [--scene NAME] [--rate HZ] [--real-time-factor X] [--duration S]

Counted while it simulates, between the lines in which the node says that it is ready and that it has ended.
"""

import argparse
import os
import re
import subprocess
import sys
import time
from pathlib import Path


def cpu_time(pid: int) -> float:
    """CPU time of a running process [s]."""
    user, system = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[11:13]
    return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")


def measure(scene: str, rate: float, factor: float, duration: float) -> tuple[float, float, float]:
    """Of a run: CPU time of the steps, of everything else, and the time that it took [s]."""
    parameters = {"scene": scene, "rate": rate, "real_time_factor": factor, "duration": duration}
    command = [sys.executable, "-m", "bilayer_sim_ros.sim_node", "--ros-args"]
    for name, value in parameters.items():
        command += ["-p", f"{name}:={value}"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        output = ""
        for line in process.stderr:
            output += line
            if "is ready" in line:
                begin, cpu_at_begin = time.monotonic(), cpu_time(process.pid)
            elif "ended at" in line:
                elapsed, cpu = time.monotonic() - begin, cpu_time(process.pid) - cpu_at_begin
    steps = re.search(r"CPU time of the steps: ([\d.]+) s", output)
    if steps is None:
        raise SystemExit(f"the node did not reach its end:\n{output}")
    physics = float(steps[1])
    return physics, cpu - physics, elapsed


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", default="gripping")
    parser.add_argument("--rate", type=float, default=50.0, help="frames per simulated second [Hz]")
    parser.add_argument("--real-time-factor", type=float, default=0.5)
    parser.add_argument("--duration", type=float, default=10.0, help="simulated time [s]")
    options = parser.parse_args()
    physics, beyond, elapsed = measure(options.scene, options.rate, options.real_time_factor, options.duration)
    print(f"physics {100 * physics / elapsed:.1f} %, beyond it {100 * beyond / elapsed:.2f} % of a core")


if __name__ == "__main__":
    main()
