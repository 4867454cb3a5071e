"""What a run costs before its first step: reading a scene, building its simulator, and taking it back to the start.

    python tests/benchmarks/build.py [REPEATS]

Least CPU time of so many repeats (default 30) with all kernels loaded, in ms: `load` from a file to a validated scene;
`build` of that fresh scene to a simulator; `both` in one repeat; `first` to have it ready to step; `reset`;
`reset(scene)` to another scene of the same model, read before. Then a row of 10, 100 and 1,000 copies of a strip, each
with its ratio to the one before: 10 is linear.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

from bilayer_core import Simulator, load_scene

ROBOTS = ("gripping", "crawling_inchworm", "crawling_dual_leg", "jumping", "swimming")
COPIES = (10, 100, 1000)


def timed(work: Callable[[], object]) -> tuple[float, object]:
    """CPU time [ms], and the result."""
    begin = time.thread_time()
    result = work()
    return 1e3 * (time.thread_time() - begin), result


def row_of_strips(count: int) -> dict:
    """Strips of two layers, side by side and far above nothing."""
    layer = {"material": "gel", "thickness": "1 mm"}
    return {
        "schema": 1,
        "name": "row",
        "title": "Strips in a row",
        "duration": 1.0,
        "materials": {"gel": {"youngs_modulus": "1 MPa", "poisson_ratio": 0.5, "density": "1000 kg/m^3"}},
        "rods": [
            {
                "name": "strip",
                "width": "5 mm",
                "path": {"shape": "straight", "start": [0, 0, 0], "direction": [1, 0, 0], "length": "50 mm"},
                "normal": [0, 0, 1],
                "stations": 11,
                "layers": [{"name": "bottom", **layer}, {"name": "top", **layer}],
                "pattern": {"type": "translation", "step": [0, "10 mm", 0], "count": count},
            }
        ],
    }


def figures(source: str | dict, repeats: int) -> list[float]:
    """load, build, both, first, reset, reset(scene) [ms]."""
    best = [float("inf")] * 6
    other = load_scene(source, {"duration": 0.5, "solver.tolerance": 2e-4})
    for _ in range(repeats):
        load, scene = timed(lambda: load_scene(source))
        build, simulator = timed(lambda: Simulator(scene))  # noqa: B023 (called at once)
        first, _ = timed(simulator.compile)
        again, _ = timed(simulator.reset)
        to_other, _ = timed(lambda: simulator.reset(other))  # noqa: B023
        best = [min(pair) for pair in zip(best, (load, build, load + build, first, again, to_other), strict=True)]
    return best


def main() -> None:
    """Print both tables."""
    repeats = int(sys.argv[1]) if len(sys.argv) > 1 else 30
    Simulator(load_scene("gripping")).compile()
    print("| scene | load | build | both | first | reset | reset(scene) |\n| --- | --- | --- | --- | --- | --- | --- |")
    for name in ROBOTS:
        print(f"| {name} | " + " | ".join(f"{value:.2f}" for value in figures(name, repeats)) + " |", flush=True)
    before = None
    print("\n| copies | load | build | ratio | reset |\n| --- | --- | --- | --- | --- |")
    for count in COPIES:
        load, build, _, _, again, _ = figures(row_of_strips(count), max(1, min(repeats, 2000 // count)))
        ratio = "" if before is None else f"{build / before:.1f}"
        print(f"| {count} | {load:.2f} | {build:.2f} | {ratio} | {again:.2f} |", flush=True)
        before = build


if __name__ == "__main__":
    main()
