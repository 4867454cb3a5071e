"""What must be there for a run to be drawn."""

from __future__ import annotations

from bilayer_core.errors import InputError
from bilayer_core.observed.frame import Strand
from bilayer_core.record.run_data import RunData

DRAWN = ("body_pose", "nodes", "points")
"""Topics without which there is nothing to draw."""


def refuse_undrawable(run: RunData, name: str) -> None:
    """Raise InputError, which begins with a name, if a run holds no frame, or its log lacks what is drawn."""
    if missing := [topic for topic in run.lacks if any(f"/{drawn}/" in f"{topic}/" for drawn in DRAWN)]:
        raise InputError(f"{name}: the log does not hold {', '.join(missing)}, which is drawn")
    if not len(run.times) or not len(run.shape_times):
        raise InputError(f"{name}: the run holds no frame, there is nothing to show")


def has_sections(layer: Strand) -> bool:
    """Return whether the cross-section of a layer is known, which it is not in a bag without the node's description."""
    return bool(layer.width.any())
