"""What must be there for a run to be drawn."""

from __future__ import annotations

from bilayer_core.errors import InputError
from bilayer_core.record.run_data import RunData

DRAWN = ("body_pose", "com", "nodes", "points")
"""Topics without which there is nothing to draw."""


def refuse_undrawable(run: RunData, name: str) -> None:
    """Raise InputError, which begins with a name, if a run holds no frame, or its log lacks what is drawn."""
    if not len(run.times) or not len(run.shape_times):
        raise InputError(f"{name}: the run holds no frame, there is nothing to show")
    if missing := [topic for topic in run.lacks if topic.split("/")[2] in DRAWN]:
        raise InputError(f"{name}: the log does not hold {', '.join(missing)}, which is drawn")
