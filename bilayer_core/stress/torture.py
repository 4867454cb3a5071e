"""The torture cases of the field, each with what decides it."""

from __future__ import annotations

from .case import StressCase


def torture_cases() -> list[StressCase]:
    """All of them, on their ladders."""
    return []
