"""How often the 95 % intervals of `bilayer fit` cover the truth.

    python tests/benchmarks/fit_coverage.py [--fits 500] [--seed 20261124]

The protocol was fixed before any of these fits was made:

- A clamped strip (50 mm, 11 stations, two layers of 1 mm) sinks under its weight for 0.1 s, then one layer swells for
  0.2 s. Truth: modulus 1 MPa, eigenstrain gain 4 %.
- Data: x and z of the tip at 8 times, 40 ms apart, of the run with the true values and adaptive steps, plus independent
  normal noise of 0.5 mm, of which the fits are not told. The noise of fit k is that of `default_rng([seed, k])`.
- Fitted: the modulus from 0.1 to 10 MPa (by its logarithm), starting at 0.6 MPa; the gain from 1 to 10 %, starting at
  2.5 %. A fit that fails counts as two intervals that do not cover.
- Accepted if 93 to 97 % of all intervals cover the truth. Found of 1,000: 95.4 %.

Prints the share of intervals that cover the truth, by parameter and of all, and what a fit takes.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass

import numpy as np

from bilayer_core import Simulator, fit, load_scene
from bilayer_core.errors import BilayerError

SEED, FITS = 20261124, 500
NOISE = 0.5e-3
"""Standard deviation of each coordinate [m]."""
ACCEPTED = (0.93, 0.97)
"""Share of intervals that cover the truth."""
TIMES = np.round(0.04 * np.arange(1, 9), 10)
"""[s]"""
TIP = "rod/strip/position[-1]"
TRUTH = {"materials.gel.youngs_modulus": 1e6, "rods.strip.layers.active.eigenstrain.gain": 0.04}
PARAMETERS = {
    "materials.gel.youngs_modulus": ("0.1 MPa", "10 MPa", "0.6 MPa"),
    "rods.strip.layers.active.eigenstrain.gain": ("1 %", "10 %", "2.5 %"),
}
"""Bounds and starts; the modulus is varied by its logarithm, the gain in proportion."""
SCENE = {
    "schema": 1,
    "name": "strip",
    "title": "A clamped strip sinks under its weight, then one of its layers swells",
    "duration": "0.32 s",
    "gravity": [0, 0, "-9.81 m/s^2"],
    "materials": {"gel": {"youngs_modulus": "1 MPa", "poisson_ratio": 0.5, "density": "1000 kg/m^3"}},
    "stimuli": {"swelling": {"schedule": {"type": "ramp", "start": "0.1 s", "end": "0.3 s", "from": 0, "to": 1}}},
    "rods": [
        {
            "name": "strip",
            "width": "10 mm",
            "path": {"shape": "straight", "start": [0, 0, 0], "direction": [1, 0, 0], "length": "50 mm"},
            "normal": [0, 0, 1],
            "stations": 11,
            "section": "beam",
            "clamp_start": "wall",
            "layers": [
                {"name": "passive", "material": "gel", "thickness": "1 mm"},
                {
                    "name": "active",
                    "material": "gel",
                    "thickness": "1 mm",
                    "eigenstrain": {"stimulus": "swelling", "gain": "4 %"},
                },
            ],
        }
    ],
    "bodies": [{"name": "wall", "position": [0, 0, 0], "motion": {"type": "prescribed"}}],
    "damping": {"mass": "30 1/s"},
    "output": {"rate": "25 Hz"},
}


@dataclass(frozen=True)
class Study:
    """Many fits.

    Attributes
    ----------
    values : ndarray
        Fitted, in parts of the truth, NaN where a fit failed, shape (fits, parameters).
    intervals : ndarray
        Likewise, shape (fits, parameters, 2).
    runs, seconds : float
        Of a fit, on average.
    """

    values: np.ndarray
    intervals: np.ndarray
    runs: float
    seconds: float

    @property
    def covered(self) -> np.ndarray:
        """Whether each interval covers the truth; that of a fit that failed does not."""
        return (self.intervals[..., 0] <= 1.0) & (self.intervals[..., 1] >= 1.0)


def exact_data() -> dict[str, np.ndarray]:
    """Where the tip is at the times of the data, at the true values."""
    simulator = Simulator(load_scene(SCENE, TRUTH))
    tips = []
    for moment in TIMES:
        simulator.run(until=float(moment))
        tips.append(simulator.rods["strip"].positions[-1])
    return {"time": TIMES, f"{TIP}.x": np.array(tips)[:, 0], f"{TIP}.z": np.array(tips)[:, 2]}


def study(fits: int, seed: int, told=lambda done: None) -> Study:
    """Make so many fits; the noise of each follows from the seed and its number alone."""
    exact, truth = exact_data(), np.array(list(TRUTH.values()))
    values = np.full((fits, truth.size), np.nan)
    intervals = np.full((fits, truth.size, 2), np.nan)
    runs, begin = 0, time.perf_counter()
    for k in range(fits):
        noise = np.random.default_rng([seed, k])
        data = {name: at if name == "time" else at + noise.normal(0.0, NOISE, at.size) for name, at in exact.items()}
        try:
            found = fit(SCENE, data, PARAMETERS)
        except BilayerError as error:
            print(f"fit {k}: {error}", file=sys.stderr)
            continue
        runs += found.runs
        values[k] = [found[path].value for path in TRUTH] / truth
        intervals[k] = [found[path].interval or (np.nan, np.nan) for path in TRUTH] / truth[:, None]
        told(k + 1)
    return Study(values, intervals, runs / fits, (time.perf_counter() - begin) / fits)


def main() -> int:
    """Print the study; 1 if the share is not what is promised."""
    options = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    options.add_argument("--fits", type=int, default=FITS)
    options.add_argument("--seed", type=int, default=SEED)
    asked = options.parse_args()

    def told(done: int) -> None:
        if done % 50 == 0:
            print(f"{done} fits done", file=sys.stderr, flush=True)

    found = study(asked.fits, asked.seed, told)
    for k, path in enumerate(TRUTH):
        share, scatter = found.covered[:, k].mean(), np.nanstd(found.values[:, k])
        half = np.nanmean(found.intervals[:, k, 1] - found.intervals[:, k, 0]) / 2.0
        mean = np.nanmean(found.values[:, k])
        spread = f"scatter {scatter:.5f}, half an interval {half:.5f}"
        print(f"{path}: covered {100 * share:.1f} %; mean {mean:.5f} of the truth, {spread}")
    share = found.covered.mean()
    passes = ACCEPTED[0] <= share <= ACCEPTED[1]
    verdict = "accepted" if passes else "NOT accepted"
    print(f"all {found.covered.size} intervals: covered {100 * share:.1f} %, {verdict}")
    print(f"seed {asked.seed}; {found.runs:.1f} runs and {found.seconds:.2f} s a fit")
    return 0 if passes else 1


if __name__ == "__main__":
    raise SystemExit(main())
