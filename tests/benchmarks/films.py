"""What films of ten seconds cost: 250 pictures of 1280x720, on one core without a graphics card (Linux).

    python tests/benchmarks/films.py [--runs DIR] [--limit 15] [SCENE ...]

Simulates the scenes (by default the paper's five robots) and makes a film of each by `bilayer render`; counted is the
CPU time of that command with all of its processes, start and reading of the log included. Logs and films stay in DIR.
Exit code 1 if one takes longer than the limit.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROBOTS = ("gripping", "crawling_inchworm", "crawling_dual_leg", "jumping", "swimming")
FRAMES = 250
BILAYER = (sys.executable, "-m", "bilayer_core")


def cost(command):
    """CPU and wall time of a process and its children [s]."""
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, time.monotonic() - begin


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=ROBOTS, metavar="SCENE")
    parser.add_argument("--runs", type=Path, metavar="DIR")
    parser.add_argument("--limit", type=float, default=15.0, metavar="S")
    given = parser.parse_args()
    runs = given.runs or Path(tempfile.mkdtemp())
    runs.mkdir(parents=True, exist_ok=True)
    core = min(os.sched_getaffinity(0))
    print("| film of | CPU time | wall time | size |\n| --- | --- | --- | --- |", flush=True)
    slowest = 0.0
    for scene in given.scenes:
        log, film = runs / f"{scene}.mcap", runs / f"{scene}.mp4"
        if not log.exists():
            subprocess.run([*BILAYER, "run", scene, "--log", log, "--quiet"], check=True)
        os.sched_setaffinity(0, {core})
        used, waited = cost([*BILAYER, "render", log, "--mp4", film, "--frames", str(FRAMES), "--force"])
        slowest = max(slowest, used)
        print(f"| `{scene}` | {used:.1f} s | {waited:.1f} s | {film.stat().st_size / 1e6:.2f} MB |", flush=True)
    return slowest > given.limit


if __name__ == "__main__":
    sys.exit(main())
