"""How a peer is told what to compute, and how it answers: cases as json on standard input, a line of json for each."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass


@dataclass(frozen=True)
class Cantilever:
    """The common cantilever, clamped at the origin, along x, released from straight; z is up.

    Lengths [m], modulus [Pa], density [kg/m³], gravity [m/s²], simulated time and interval of samples [s].
    """

    length: float = 0.1
    width: float = 0.01
    thickness: float = 2e-3
    youngs_modulus: float = 1e6
    density: float = 1000.0
    gravity: float = 9.81
    duration: float = 1.0
    sampled_until: float = 0.5
    sampling: float = 2e-3

    @property
    def area(self) -> float:
        """Area of the section [m²]."""
        return self.width * self.thickness

    @property
    def bending_stiffness(self) -> float:
        """EI [N m²]."""
        return self.youngs_modulus * self.width * self.thickness**3 / 12.0


@dataclass(frozen=True)
class Case:
    """One run: elements, step [s], and whether the rod begins half an element inside the wall.

    Programs that clamp a rod by fixing its first element put the wall where that element ends in its middle; `shifted`
    makes up for it.
    """

    elements: int
    dt: float
    shifted: bool

    def element_length(self, beam: Cantilever) -> float:
        """Return the length of an element [m]."""
        return beam.length / (self.elements - 0.5 if self.shifted else self.elements)

    def start(self, beam: Cantilever) -> float:
        """Return x of the first node [m]."""
        return -0.5 * self.element_length(beam) if self.shifted else 0.0

    def stride(self, beam: Cantilever) -> int:
        """Return the number of steps from one sample to the next."""
        return max(1, round(beam.sampling / self.dt))


@dataclass(frozen=True)
class Answer:
    """CPU seconds of the whole run, and the way of the tip: times [s], x and z [m]."""

    cpu_time: float
    times: list[float]
    x: list[float]
    z: list[float]


def serve(simulate: Callable[[Cantilever, Case], Answer]) -> None:
    """Answer every case on standard input; the first is done twice, so that nothing is compiled while time counts."""
    cases = [Case(**case) for case in json.load(sys.stdin)]
    beam = Cantilever()
    simulate(beam, cases[0])
    for case in cases:
        print(json.dumps({"case": asdict(case), "answer": asdict(simulate(beam, case))}), flush=True)
