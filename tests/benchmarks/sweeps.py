"""What runs of a sweep cost beyond their steps, what a second process brings, and the memory of many runs.

    python tests/benchmarks/sweeps.py [RUNS]

`overhead` is the wall time of a run on one process beyond that of the same run in a loop of a program, which loads,
builds and steps; `speed-up` is the time of one process over that of two, without their start. Each is the least of
three, made in turns. RUNS, 10,000 by default, short runs follow, with the largest memory of the program and of its
processes.
"""

import os
import sys
import threading
import time
from itertools import islice

import psutil

from bilayer_core.studies.sweeps.execute_runs import execute
from bilayer_core.studies.sweeps.open_processes import Processes, open_engine
from bilayer_core.studies.sweeps.run_sweep import read_sweep, sweep
from bilayer_core.verification.bench.machine import record

GAIN = {
    "bending": "rods.strip.layers.active.eigenstrain.gain",
    "gripping": "rods.arm.layers.active.eigenstrain.gain",
    "crawling_inchworm": "stimuli.humidity.schedule.period",
}
REPEATS = 3
CASES = (("bending", 0.05, 400), ("bending", 2.0, 400), ("crawling_inchworm", 1.0, 600), ("gripping", 1.0, 60))


def spec(scene: str, duration: float, count: int) -> dict:
    """A sweep of runs of about the same length."""
    path = GAIN[scene]
    ends = {"from": "2.3 s", "to": "2.5 s"} if "period" in path else {"from": "1 %", "to": "1.1 %"}
    return {
        "schema": 1,
        "scene": scene,
        "set": {"duration": duration},
        "parameters": {"value": {"path": path, **ends, "count": count}},
        "metrics": {"steps": "steps"},
    }


def seconds(content: dict, workers: int) -> float:
    """Wall time of all runs of a sweep, from the first to the last, processes being ready."""
    read = read_sweep(content)
    with open_engine(read.job, Processes(workers)) as engine:
        points = list(read.points())
        for _ in engine.run(iter(points[: 4 * workers])):  # kernels are loaded
            pass
        begin = time.perf_counter()
        for _ in engine.run(iter(points)):
            pass
        return time.perf_counter() - begin


def alone(content: dict) -> float:
    """Wall time of the same runs, one after the other in this process."""
    read = read_sweep(content)
    points = list(read.points())
    execute(read.job, points[:4])
    begin = time.perf_counter()
    execute(read.job, points)
    return time.perf_counter() - begin


def many(runs: int) -> None:
    """Many short runs, with the largest memory seen."""
    largest = [0, 0]
    done = threading.Event()

    def watch() -> None:
        me = psutil.Process()
        while not done.wait(0.2):
            largest[0] = max(largest[0], me.memory_info().rss)
            for child in me.children(recursive=True):
                try:
                    largest[1] = max(largest[1], child.memory_info().rss)
                except psutil.NoSuchProcess:
                    pass

    watcher = threading.Thread(target=watch)
    watcher.start()
    begin, first = time.perf_counter(), []
    found = sweep(
        spec("bending", 0.05, runs),
        out=sys.argv[2] if len(sys.argv) > 2 else None,
        progress=lambda row: first.append(time.perf_counter()) if not first else None,
    )
    end = time.perf_counter()
    done.set()
    watcher.join()
    rate = (runs - 1) / (end - first[0])
    print(
        f"{found.outcomes}: {end - begin:.1f} s, {rate:.0f} a second; largest memory {largest[0] / 1e6:.0f} MB, "
        f"of a process {largest[1] / 1e6:.0f} MB"
    )


def main() -> None:
    """Print the tables."""
    print(f"{record()}; load {os.getloadavg()[0]:.1f}")
    print("| scene | simulated [s] | runs | alone [ms] | one process | overhead | two processes | speed-up |")
    for scene, duration, count in CASES:
        content = spec(scene, duration, count)
        turns = [(alone(content), seconds(content, 1), seconds(content, 2)) for _ in range(REPEATS)]
        a, one, two = (1e3 * min(of) / count for of in zip(*turns, strict=True))
        print(
            f"| {scene} | {duration:g} | {count} | {a:.2f} | {one:.2f} | {one - a:.2f} | {two:.2f} | {one / two:.2f} |"
        )
    many(int(next(islice(sys.argv, 1, None), 10_000)))


if __name__ == "__main__":
    main()
