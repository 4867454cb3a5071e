"""The torture cases of the field, each with what decides it."""

from __future__ import annotations

from .case import StressCase
from .ladder import Torture
from .torture_beams import BEAMS
from .torture_contact import CONTACT
from .torture_friction import FRICTION
from .torture_motion import MOTION
from .torture_twist import TWIST

TORTURES: tuple[Torture, ...] = tuple(sorted((*BEAMS, *MOTION, *TWIST, *FRICTION, *CONTACT), key=lambda torture: torture.number))
"""Those that the scene format can express, by their number."""


def torture_cases() -> list[StressCase]:
    """All of them, on their ladders."""
    return [case for torture in TORTURES for case in torture.cases()]
