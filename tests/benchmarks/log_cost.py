"""CPU time that a log costs, in ms per simulated second: of all threads, and on the thread that steps.

    python tests/benchmarks/log_cost.py [SCENE ...] [--repeats N] [--node]

Each scene is run with a log and without one in turn, as `bilayer run --log` does, or with --node as the node does, at
real time and with no subscriber; the least of all runs counts. All but the steps themselves is told as the difference
of the two. By how much the steps become dearer is told beside it: caches are shared, which a busy machine makes worse.
"Start" is what is paid once a run: describing the scene, opening and closing the file.
"""

import argparse
import os
import tempfile
import threading
import time
from dataclasses import dataclass
from pathlib import Path

from bilayer_core import Simulator, load_scene
from bilayer_core.log.file.mcap_log import McapRecorder

ROBOTS = ("gripping", "crawling_inchworm", "crawling_dual_leg", "jumping", "swimming")
LONGEST = 6.0
"""Simulated time of a run at most [s]."""
SETTLED = 0.3
"""Simulated time from which on a run is measured without its start [s]."""
CLOSING = 0.02
"""Before the end of a run: up to there it is measured, without closing the file [s]."""


@dataclass
class Reading:
    """CPU time so far [ms]: of all threads and of the stepping one, each without the steps, and of the steps."""

    time: float
    beyond: float
    stepping: float
    steps: float

    @classmethod
    def of(cls, simulator: Simulator, thread: int) -> "Reading":
        """Of this process, whose thread of an identifier steps."""
        own = time.clock_gettime(time.pthread_getcpuclockid(thread))
        steps = simulator.cpu_time
        return cls(simulator.time, *(1e3 * of for of in (time.process_time() - steps, own - steps, steps)))

    def since(self, other: "Reading") -> list[float]:
        """Per simulated second: what is beyond the steps, what of it on their thread, and the steps [ms/s]."""
        length = self.time - other.time
        return [(getattr(self, of) - getattr(other, of)) / length for of in ("beyond", "stepping", "steps")]


def run(scene: str, log: Path | None) -> tuple[list[float], float]:
    """CPU time per simulated second once a run has settled, and what its start and its end cost beside that [ms]."""
    config = load_scene(scene)
    simulator, thread = Simulator(config), threading.get_ident()
    simulator.compile()
    length = min(config.duration, LONGEST)
    looks: list[Reading] = []

    def look(now: float) -> None:
        if now >= (SETTLED, length - CLOSING)[len(looks)] - 1e-9:
            looks.append(Reading.of(simulator, thread))

    begin = Reading.of(simulator, thread)
    observers = [McapRecorder(log, config.output.rate, config.output.marker_rate, force=True)] if log else []
    simulator.run(length, observers=observers, progress=lambda now: look(now) if len(looks) < 2 else None)
    end = Reading.of(simulator, thread)
    rates = looks[1].since(looks[0])
    return rates, end.beyond - begin.beyond - rates[0] * (end.time - begin.time)


def node(scene: str, log: Path | None) -> tuple[list[float], float]:
    """The same of the thread of the node, from `SETTLED` on; what start and end cost is not measured."""
    from bilayer_sim_ros.control.control_ticks import Control
    from bilayer_sim_ros.control.pacing import Pacer
    from bilayer_sim_ros.control.pending_changes import Commands
    from bilayer_sim_ros.control.stimulus import Channel, StimulusInputs
    from bilayer_sim_ros.node.worker import SimulationWorker
    from bilayer_sim_ros.publishing.run_files import Recording

    class Nobody:
        """Subscribes to nothing."""

        wanted = False

    config = load_scene(scene)
    simulator, rate = Simulator(config), config.output.rate
    simulator.compile()
    channels = [Channel(name, of.minimum, of.maximum, of.schedule) for name, of in config.stimuli.items()]
    if log:
        log.unlink(missing_ok=True)
    finished = threading.Event()
    worker = SimulationWorker(
        simulator,
        control=Control(StimulusInputs(channels, 0.0, "schedule"), Commands(print), 50.0),
        publisher=Nobody(),
        recording=Recording(str(log or ""), "", rate, config.output.marker_rate, patience=0.0),
        rate=rate,
        pacer=Pacer(1.0),
        duration=min(config.duration, LONGEST),
        report=lambda status: None,
        finished=finished.set,
    )
    worker.start()
    (thread,) = (of.ident for of in threading.enumerate() if of.name == "simulation")
    time.sleep(SETTLED)
    settled = Reading.of(simulator, thread)
    time.sleep(max(0.0, min(config.duration, LONGEST) - simulator.time - SETTLED))
    end = Reading.of(simulator, thread)
    finished.wait()
    worker.stop()
    if worker.log_status.dropped:
        raise SystemExit(f"{scene}: {worker.log_status.dropped} frames were left out of the log")
    return end.since(settled), 0.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=ROBOTS, metavar="SCENE")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--node", action="store_true", help="as the node runs it, in real time")
    options = parser.parse_args()
    measure = node if options.node else run
    print("| scene | in all [ms/s] | on the stepping thread | steps dearer by | start [ms] | log [kB/s] |")
    print("| --- | --- | --- | --- | --- | --- |")
    for scene in options.scenes:
        least: dict[bool, list[float]] = {}
        with tempfile.TemporaryDirectory() as folder:
            log = Path(folder) / "run.mcap"
            for logged in options.repeats * (False, True):
                rates, start = measure(scene, log if logged else None)
                least[logged] = list(map(min, least.get(logged, [float("inf")] * 4), [*rates, start]))
            size = os.path.getsize(log) / min(load_scene(scene).duration, LONGEST) / 1e3
        with_log, without = least[True], least[False]
        beyond, stepping, steps, start = (one - other for one, other in zip(with_log, without, strict=True))
        began = "" if options.node else f"{start:.0f}"
        row = f"{scene} | {beyond:.1f} | {stepping:.1f} | {steps:.1f} of {without[2]:.0f} | {began} | {size:.0f}"
        print(f"| {row} |", flush=True)


if __name__ == "__main__":
    main()
