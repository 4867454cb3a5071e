"""Figures, films and views in space for notebooks; runs have these functions as methods."""

from __future__ import annotations

import os
import tempfile
from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from bilayer_core.errors import InputError
from bilayer_core.extras import require
from bilayer_core.log.run.recorded import Recorded
from bilayer_core.log.run.run_data import RunData

RATE = 15.0
"""Pictures a second of a film."""
SHORTEST, LONGEST = 2.0, 8.0
"""Of a film whose length is not given [s]."""
HEIGHT = 480
"""Of a view in rerun [pixels]."""


@dataclass(frozen=True)
class Shown:
    """A picture or an animation, which notebooks show."""

    content: bytes = field(repr=False)
    kind: str
    """``png`` or ``webp``."""

    def _repr_html_(self) -> str:
        """Return it for notebooks."""
        return f"<img style='max-width:100%' src='data:image/{self.kind};base64,{b64encode(self.content).decode()}'>"

    def save(self, path: str | Path) -> None:
        """Write it to a file."""
        if Path(path).suffix.lower() != f".{self.kind}":
            raise InputError(f"{path}: must end in .{self.kind}")
        Path(path).write_bytes(self.content)


def plot(run: Recorded, quantities: Sequence[str], node: int | None, width: str | float) -> Any:
    """Return a figure of quantities over time; see `Recorded.plot`."""
    require("plot", "matplotlib")
    import matplotlib
    from matplotlib import pyplot

    from bilayer_core.view.plot import STYLE, draw, lines_of

    if not quantities:
        raise InputError("plot: name at least one quantity, such as com.z; `run.quantities` has the names")
    with matplotlib.rc_context(STYLE):
        figure = draw(lines_of(run, 0, quantities, node), [run.description.scene_name], width)
        pyplot.close(figure)  # the notebook shows what is returned, and shows it once
    return figure


def film(run: RunData, seconds: float | None, look: Mapping[str, Any]) -> Shown:
    """Return an animation of a run; see `RunData.film`."""
    from bilayer_core.view.render import Studio

    studio = Studio(run, _look(look))
    span = studio.last - studio.first
    lasting = min(max(span, SHORTEST), LONGEST) if seconds is None else seconds
    if not 0.0 < lasting <= 60.0:
        raise InputError(f"film: found {lasting:g} s; it may last above 0 and at most 60 s")
    times = studio.spread(max(2, round(RATE * lasting)) if span > 0.0 else 1)
    return _drawn("webp", lambda path: studio.gif(path, times, RATE))


def show(run: RunData, look: Mapping[str, Any]) -> Any:
    """Return a view of a run in space; see `RunData.show`."""
    chosen = _look(look)
    if find_spec("rerun_notebook") is not None and find_spec("rerun") is not None:
        os.environ.setdefault("RERUN_NOTEBOOK_ASSET", "inline")  # its page comes from here, not from the network
        import rerun
        from rerun.notebook import Viewer

        from bilayer_core.view.rrd_writer import send_run

        recording = rerun.RecordingStream("bilayer_sim")
        viewer = Viewer(width="auto", height=HEIGHT, recording=recording)
        send_run(recording, run, chosen.colour)
        return viewer
    from bilayer_core.view.render import Studio

    studio = Studio(run, chosen)
    return _drawn("png", studio.picture)


def _look(words: Mapping[str, Any]) -> Any:
    from bilayer_core.view.render import Look

    known = ("camera", "background", "colour", "size", "reactions")
    if unknown := [word for word in words if word not in known]:
        raise InputError(f"{unknown[0]}: is no word about a picture; allowed are {', '.join(known)}")
    return Look.of(**{"background": "white", **words})


def _drawn(kind: str, draw: Any) -> Shown:
    """Return what a function writes to a file."""
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / f"drawn.{kind}"
        draw(path)
        return Shown(path.read_bytes(), kind)
