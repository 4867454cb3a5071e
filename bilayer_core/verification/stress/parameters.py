"""Parameters of the stress matrix: one setting of everything, and the values that each axis goes through."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

ROBOTS = ("beam", "coil", "drop", "crawler", "ball", "bat", "pile", "swimmer", "hub", "box")
"""What a scene is about; see `verification.stress.robots`."""
INTEGRATORS = ("sdirk2", "implicit_euler", "tr_bdf2", "generalised_alpha", "implicit_midpoint")
ADAPTIVE = INTEGRATORS[:-1]
"""Those with an estimate of their error."""
STIMULI = ("ramp", "step", "square", "noise")


@dataclass(frozen=True)
class Parameters:
    """Settings of one case of the matrix; the defaults are easy ones."""

    robot: str = "beam"  # One of `ROBOTS`
    model: str = "laminate"
    dimension: int = 3
    integrator: str = "sdirk2"
    dt: float | None = None  # Length of fixed steps [s]; None for adaptive ones
    tolerance: float = 1e-4  # Of adaptive steps
    stations: int = 21  # Along each strip
    covered: float = 1.0  # Part of the length that the upper layer covers
    modulus_ratio: float = 1.0
    thickness_ratio: float = 1.0
    """`modulus_ratio`, `thickness_ratio`: upper layer over lower layer."""
    youngs_modulus: float = 1e7  # Of the lower layer [Pa]
    slenderness: float = 50.0
    """Length over thickness of a strip; a strip that is shorter than ten thicknesses is as wide as thick."""
    length: float = 0.1
    """Of a strip [m]: the unit of the scene. Gravity and speeds are those of a strip of 0.1 m, scaled with it."""
    eigenstrain: float = 0.02  # Of the lower layer, at the largest stimulus
    stimulus: str = "ramp"  # How the stimulus gets there: one of `STIMULI`
    turns: float = 0.0  # Natural curvature times length, over 2π
    speed: float = 1.0
    """Of what flies, at a length of 0.1 m [m/s]; what falls does so from the height that gives it, 10 m at most."""
    friction: float = 0.4
    threshold: float = 1e-3
    """`friction`, `threshold`: coefficient, and the speed from which it acts [m/s]."""
    contact_stiffness: float = 1e6  # [Pa]
    barrier: float = 2e-4  # Distance at a length of 0.1 m [m]
    restitution: float | None = None
    mass_ratio: float = 1.0  # Mass of the body over that of the strips
    fluid_ratio: float = 0.0  # Density of the fluid over that of the strip; 0 without a fluid
    added_mass: bool = False
    gravity: float = 9.81  # At a length of 0.1 m [m/s²]
    damped: bool = True  # Whether the material has a retardation time

    def text(self) -> str:
        """Return the settings that differ from the defaults, in one line."""
        changed = (f for f in fields(self) if getattr(self, f.name) != f.default)
        return ", ".join(f"{f.name} {_short(getattr(self, f.name))}" for f in changed) or "all as by default"


def _short(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


@dataclass(frozen=True)
class Range:
    """An axis: the interval from which the sample draws, and the values it takes alone."""

    low: float
    high: float
    values: tuple[float, ...]  # Alone, from easy or extreme to extreme
    robots: tuple[str, ...]  # For which the axis is gone through alone
    logarithmic: bool = True  # Whether the sample is even in the logarithm

    def at(self, part: float) -> float:
        """Return the value at a part of the interval, 0 … 1.

        It is rounded to three digits, so that files show what was run.
        """
        if self.logarithmic:
            value = math.exp((1.0 - part) * math.log(self.low) + part * math.log(self.high))
        else:
            value = (1.0 - part) * self.low + part * self.high
        return float(f"{value:.3g}")


def _decades(first: int, last: int, step: int = 1) -> tuple[float, ...]:
    return tuple(float(f"1e{power}") for power in range(first, last + 1, step))


TOUCHING = ("drop", "crawler", "ball", "bat", "pile", "box")
RANGES: dict[str, Range] = {
    "dt": Range(1e-7, 1e-1, _decades(-7, -1), ("beam", "coil", "drop", "ball", "pile", "swimmer")),
    "tolerance": Range(1e-7, 1e-2, _decades(-7, -2), ("beam", "coil", "drop", "crawler", "ball", "pile", "hub")),
    "stations": Range(3, 300, (3, 4, 5, 10, 100, 300, 1000, 3000), ("beam", "drop", "pile")),
    "covered": Range(0.1, 1.0, (0.1, 0.35, 0.5, 0.9), ("beam", "drop", "crawler"), False),
    "modulus_ratio": Range(1e-4, 1e4, _decades(-4, 4), ("beam", "drop")),
    "thickness_ratio": Range(1e-2, 1e2, (1e-2, 3e-2, 0.1, 0.3, 3.0, 10.0, 30.0, 100.0), ("beam", "drop")),
    "youngs_modulus": Range(1e3, 1e12, _decades(3, 12), ("beam", "drop", "pile")),
    "slenderness": Range(5, 1e4, (5, 10, 100, 1e3, 3e3, 1e4), ("beam", "drop")),
    "eigenstrain": Range(-0.5, 0.5, (-0.5, -0.3, -0.1, -0.01, 1e-4, 0.1, 0.3, 0.5), ("beam", "crawler"), False),
    "turns": Range(-10, 10, (-10, -3, -0.3, 1e-3, 0.3, 1, 3, 10), ("coil",), False),
    "speed": Range(1e-3, 200, (1e-3, 0.1, 1, 3, 10, 14, 50, 200), ("drop", "ball", "bat", "pile")),
    "friction": Range(1e-3, 10, (0, 1e-3, 0.1, 1, 3, 10), ("drop", "crawler", "pile", "bat")),
    "threshold": Range(1e-8, 1e-1, _decades(-8, -1), ("drop", "crawler")),
    "contact_stiffness": Range(1e2, 1e12, _decades(2, 12), ("drop", "ball", "pile")),
    "barrier": Range(1e-6, 1e-2, _decades(-6, -2), ("drop", "ball", "pile")),
    "restitution": Range(0, 1, (0, 0.1, 0.5, 0.9, 1), ("ball", "box"), False),
    "mass_ratio": Range(1e-6, 1e6, _decades(-6, 6), ("hub", "ball")),
    "fluid_ratio": Range(1e-3, 1e3, _decades(-3, 3), ("swimmer",)),
    "gravity": Range(1e-3, 1e5, (0.0, 1e-3, 1.0, 1e2, 1e3, 1e4, 1e5), ("beam", "drop", "crawler", "pile")),
    "length": Range(1e-6, 1e3, _decades(-6, 3), ("beam", "drop", "crawler", "ball", "pile", "swimmer", "hub")),
}
CHOICES: dict[str, tuple[object, ...]] = {
    "model": ("laminate", "two_rod"),
    "dimension": (2, 3),
    "integrator": INTEGRATORS,
    "stimulus": STIMULI,
    "added_mass": (False, True),
    "damped": (True, False),
}
