"""Write a large log, and measure the memory and the time that each command takes with it.

    python tests/benchmarks/large_log.py --size 2000 --directory /tmp/large

Beside the log, a second one is written for `compare`, of which every other frame is missing. Memory is the largest
resident set of a process of its own, less that of one that imports the same and reads an empty log.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

TESTS = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TESTS), str(TESTS.parent)]

MEASURED = """
import json, re, time
{program}
peak = int(re.search(r"VmHWM:\\s+(\\d+) kB", open("/proc/self/status").read())[1]) / 1024
print("MEASURED", json.dumps([peak, time.process_time()]))
"""
MAIN = "from bilayer_core.cli import main\ncode = main({arguments})\nassert code == 0, code"
"""The command line, in the process that is measured."""


def write_log(path: Path, megabytes: float, rate: float = 50.0, every: int = 1) -> None:
    """A log of the synthetic run, with noise in all numbers, so that it is as large as one of a robot that moves."""
    from support import synthetic_run

    from bilayer_core.log.file.mcap_log import McapRecorder

    generator = np.random.default_rng(1)
    recorder = McapRecorder(path, rate=rate, marker_rate=rate, force=True)
    recorder.start(synthetic_run.description())
    frames = [synthetic_run.random_frame(generator) for _ in range(50)]
    step = 0
    while step % 50 or path.stat().st_size < megabytes * 1e6:
        frame = frames[step % len(frames)]
        object.__setattr__(frame, "time", step / rate)
        object.__setattr__(frame, "step", step)
        recorder.observe(copy_of(frame))
        step += every
    recorder.close(True)


def copy_of(frame):
    """A frame that waits for the writer may not change."""

    return replace(frame)


def measured(program: str) -> tuple[float, float, str]:
    """Largest resident set [MB], CPU time [s] and output of a program."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(TESTS.parent), str(TESTS)])}
    run = [sys.executable, "-c", MEASURED.format(program=program)]
    done = subprocess.run(run, env=environment, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(done.stderr)
    text, _, figures = done.stdout.rpartition("MEASURED ")
    peak, seconds = json.loads(figures)
    return peak, seconds, text


def command(*arguments) -> str:
    """A program that runs the command line."""
    return MAIN.format(arguments=[str(argument) for argument in arguments])


def programs(log: Path, other: Path, cut: Path, out: Path) -> dict[str, str]:
    """What is measured, by name."""
    read = "from bilayer_core import read_log\nrun = read_log({path!r})\n"
    node = "rod/arm_0/active/strain"
    return {
        "`bilayer info`": command("info", log),
        '`read_log(…)["com"]`': read.format(path=str(log)) + "print(run['com'])",
        "`read_log(…)` of a rod": read.format(path=str(log)) + f"print(run['{node}'])",
        "`bilayer repair`": command("repair", cut, out / "repaired.mcap", "--force"),
        "`bilayer export --csv`": command("export", log, "--csv", out / "csv", "--force"),
        "`bilayer export --parquet`": command("export", log, "--parquet", out / "parquet", "--force"),
        "`bilayer export --npz`": command("export", log, "--npz", out / "run.npz", "--force"),
        "`bilayer compare`": command("compare", log, other),
        "`bilayer plot`": command("plot", log, "com.z", node, "--out", out / "figure.pdf", "--force"),
    }


def baseline(directory: Path, megabytes: float = 0.1) -> dict[str, float]:
    """Memory of the same with a log of hardly any frames [MB]."""
    paths = [directory / f"small_{name}.mcap" for name in ("log", "other", "cut")]
    for path in paths:
        write_log(path, megabytes)
    out = directory / "small"
    out.mkdir(exist_ok=True)
    return {name: measured(program)[0] for name, program in programs(*paths, out).items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--size", type=float, default=2000.0, help="Of the log [MB].")
    parser.add_argument("--directory", type=Path, required=True)
    parser.add_argument("--only", nargs="*", help="Words of the names of what is measured.")
    options = parser.parse_args()
    directory = options.directory
    directory.mkdir(parents=True, exist_ok=True)
    log, other, cut = (directory / f"{name}.mcap" for name in ("log", "other", "cut"))
    if not (log.exists() and log.stat().st_size >= options.size * 1e6):
        start = time.monotonic()
        write_log(log, options.size)
        write_log(other, 0.5 * options.size, every=2)
        print(f"wrote {log.stat().st_size / 1e6:.0f} MB in {time.monotonic() - start:.0f} s", flush=True)
    if not cut.exists():
        with log.open("rb") as source, cut.open("wb") as target:
            left = log.stat().st_size - 1_000_000
            while left > 0:
                left -= target.write(source.read(min(left, 1 << 24)))
    before = baseline(directory)
    print("| with a log of | peak above a log of 0.1 MB | CPU time |\n| --- | --- | --- |")
    for name, program in programs(log, other, cut, directory).items():
        if not options.only or any(word in name for word in options.only):
            peak, seconds, _ = measured(program)
            print(f"| {name} | {peak - before[name]:.0f} MB | {seconds:.1f} s |", flush=True)


if __name__ == "__main__":
    main()
