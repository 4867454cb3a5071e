"""Pictures of a run without a screen: the robot alone, cut to the part of the view in which it moves."""

from __future__ import annotations

import io
import shutil
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.record.log_reader import read_log
from bilayer_core.record.paths import draft_of
from bilayer_core.view.rerun_view import require_rerun
from bilayer_core.view.scales import SHOWN_SLOPE, choose_scales, seen_from, visible_points

if TYPE_CHECKING:
    from PIL import Image

WINDOW_SIZE = "2040x1180"  # four fifths of the width for the robot
MARGIN = 0.16  # round what is to be seen, in its longer side
HEADROOM = 0.1  # for the time, in heights
ASPECTS = (0.7, 2.6)  # least and largest width over height of a picture
SHORT_PERIOD = 0.02  # between two looks once all meshes are loaded [s]


class Studio:
    """A log in a viewer without a window, for as many pictures as are wanted; use it in a ``with`` block.

    Parameters
    ----------
    path : str or Path
        MCAP log.
    reactions : bool
        Whether to draw the forces and moments of rods on the bodies that hold them.

    Raises
    ------
    InputError
        The log cannot be read or holds no frame, or the viewer or a Vulkan driver is missing.
    """

    def __init__(self, path: str | Path, reactions: bool = False):
        require_rerun()
        self._reactions = reactions
        self._path = Path(path)
        self._run = read_log(path)
        self._stack = ExitStack()
        self._loaded = False

    def __enter__(self) -> Studio:
        from bilayer_core.view.layout import robot_alone
        from bilayer_core.view.rrd_writer import write_recording
        from bilayer_core.view.viewer_process import HeadlessViewer

        with self._stack as stack:
            directory = tempfile.mkdtemp(prefix="bilayer_render_")
            stack.callback(shutil.rmtree, directory, ignore_errors=True)
            recording = Path(directory) / "run.rrd"
            with draft_of(recording, force=True) as draft:
                write_recording(self._run, draft, partial(robot_alone, reactions=self._reactions))
            self._scales = choose_scales(self._run)
            self._viewer = stack.enter_context(HeadlessViewer(WINDOW_SIZE))
            self._viewer.open(recording)
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *exception: object) -> None:
        self._stack.close()

    def spread(self, count: int) -> list[float]:
        """Times evenly over the run, from its start to its end [s]."""
        times = self._run.times
        return [float(time) for time in np.linspace(times[0], times[-1], count)] if count > 1 else [float(times[-1])]

    def picture(self, path: str | Path, time: float | None = None) -> None:
        """Write the picture at `time` [s] (default: the end)."""
        from bilayer_core.view import sheet

        moment = self.spread(1)[0] if time is None else time
        sheet.save_png(sheet.write_time(self._pictures([moment])[0], moment, sheet.decimals_for([moment])), path)

    def sheet(self, path: str | Path, times: Sequence[float]) -> None:
        """Write pictures at `times` [s] as one."""
        from bilayer_core.view import sheet

        sheet.save_png(sheet.put_together(self._pictures(times), list(times), self._legend()), path)

    def gif(self, path: str | Path, times: Sequence[float]) -> None:
        """Write pictures at `times` [s] as an animation."""
        from bilayer_core.view import sheet

        sheet.save_gif(self._pictures(times), list(times), path)

    def _pictures(self, times: Sequence[float]) -> list[Image.Image]:
        """Pictures at `times`, all cut alike."""
        from PIL import Image

        first, last = self._run.times[0], self._run.times[-1]
        for time in times:
            if not first <= time <= last:
                raise InputError(f"{self._path}: holds {first:g} s to {last:g} s, and not {time:g} s")
        box, pictures = None, []
        for time in times:
            self._viewer.set_time(time)
            whole = Image.open(io.BytesIO(self._look())).convert("RGB")
            box = box or self._part_with_robot(times, whole.size)
            pictures.append(whole.crop(box))
        return pictures

    def _look(self) -> bytes:
        """The view; the first one waits for all that is still being loaded."""
        if self._loaded:
            return self._viewer.picture("Robot", SHORT_PERIOD)
        self._loaded = True
        return self._viewer.picture("Robot")

    def _part_with_robot(self, times: Sequence[float], size: tuple[int, int]) -> tuple[int, int, int, int]:
        """Left, upper, right and lower edge of what holds the robot at all `times`, in pixels of a picture."""

        def nearest(of: np.ndarray) -> np.ndarray:
            return np.unique(np.clip(np.searchsorted(of, times, side="right") - 1, 0, len(of) - 1))

        run, scales = self._run, self._scales
        points = visible_points(run, nearest(run.shape_times), nearest(run.times), scales.metres_per_newton)
        slopes = seen_from(scales.eye, scales.target, points) * (1, -1)
        width, height = size
        pixels = 0.5 * np.array(size) + slopes * (0.5 * height / SHOWN_SLOPE)
        low, high = pixels.min(axis=0), pixels.max(axis=0)
        half = 0.5 * (high - low) + MARGIN * (high - low).max()
        least, most = ASPECTS
        half = np.array([max(half[0], least * half[1]), max(half[1], half[0] / most)])
        middle = 0.5 * (low + high)
        left, upper = np.clip(middle - half - (0, HEADROOM * 2 * half[1]), 0, size)
        right, lower = np.clip(middle + half, 0, size)
        return int(left), int(upper), int(np.ceil(right)), int(np.ceil(lower))

    def _legend(self) -> str:
        """What colours, arrows and squares mean."""
        run, percent = self._run, 100 * self._scales.strain_limit
        parts = [f"{run.description.scene_name}: axial strain from -{percent:g} % (blue) to +{percent:g} % (red)"]
        if run.contact_forces.any():
            parts.append("contact forces (green)")
        if self._reactions and run.clamp_wrenches.any():
            parts.append("force (blue) and moment (purple) of rods on bodies")
        if any(obstacle.shape.kind == "plane" for obstacle in run.description.obstacles):
            parts.append(f"squares of {1e3 * self._scales.cell:g} mm")
        return ", ".join(parts)
