"""The torture cases of the field, each with what decides it."""

from __future__ import annotations

from .case import StressCase
from .ladder import Torture
from .torture_beams import BEAMS

TORTURES: tuple[Torture, ...] = tuple(sorted((*BEAMS,), key=lambda torture: torture.number))
"""Those that the scene format can express, by their number."""


def torture_cases() -> list[StressCase]:
    """All of them, on their ladders."""
    return [case for torture in TORTURES for case in torture.cases()]
