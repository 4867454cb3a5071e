"""Pictures and films of a run without a screen: the robot alone, as large as the camera allows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.extras import require
from bilayer_core.log.run.log_reader import read_log
from bilayer_core.log.run.run_data import RunData
from bilayer_core.view.arrows import contact_arrows, reaction_arrows
from bilayer_core.view.camera import AUTO, HALF_SLOPE, Camera, Insets, Shot, parse_camera, shots
from bilayer_core.view.colouring import STRAIN, choose_colouring
from bilayer_core.view.drawable import has_sections, refuse_undrawable
from bilayer_core.view.ground import Ground, is_edge_on
from bilayer_core.view.run_at_times import Moment, Moments
from bilayer_core.view.scales import ARROW_SHARE, choose_scales
from bilayer_core.view.stage import Stage
from bilayer_core.view.theme import Theme, theme_of
from bilayer_core.view.window import require_vtk

if TYPE_CHECKING:
    from PIL import Image

    from bilayer_core.view.overlay import Overlay

AREA = 1280 * 720  # of a picture whose size is not given [pixels]
ASPECTS = (0.7, 2.6)  # least and largest width over height of one
FILM_SIZE = (1280, 720)
MISSED = 0.1  # part of a run without shapes at its end that is warned of
SHEET_INSETS = Insets(top=0.10, bottom=0.06, side=0.05)
NARROW, NOTES_TOP = 1.2, 0.07  # width over height of pictures whose notes stand at the top, and their part of it
DEEPEST = 40.0  # radius of the ground, in sizes of the robot: squares of a run that goes far are still seen


@dataclass(frozen=True)
class Look:
    """How pictures look, as `bilayer render` is asked for it."""

    camera: Camera
    theme: Theme
    colour: str = STRAIN  # One of `colouring.QUANTITIES`
    size: tuple[int, int] | None = None  # Width and height; None suits what is to be seen
    reactions: bool = False  # Whether to draw the forces and moments of rods on the bodies that hold them

    @classmethod
    def of(cls, camera: str = AUTO, background: str = "dark", **others: object) -> Look:
        """Read a look from the words of the command line; InputError if one is not known."""
        return cls(parse_camera(camera), theme_of(background), **others)


class Studio:
    """A run, for as many pictures as are wanted.

    Parameters
    ----------
    run : RunData, str or Path
        A run, or the MCAP log of one.
    look : Look

    Raises
    ------
    InputError
        The log cannot be read or holds no frame, or VTK or an OpenGL driver is missing.
    """

    def __init__(self, run: RunData | str | Path, look: Look):
        require_vtk()
        path, run = (run.description.scene_name, run) if isinstance(run, RunData) else (str(run), read_log(run))
        self._path, self._look, self._run = path, look, run
        refuse_undrawable(run, path)
        if not all(map(has_sections, run.description.layers)):
            raise InputError(
                f"{path}: does not hold the node's description, so the widths of its rods are not known; "
                "`bilayer view` shows their nodes as points"
            )
        self._scales = choose_scales(run)
        self._colouring = choose_colouring(run, look.colour)
        self._moments = Moments(run, [self._colouring.values(run, layer) for layer in run.description.layers])
        self._arrows = {"contact_forces": contact_arrows(run, self._scales)}
        if look.reactions:
            self._arrows |= reaction_arrows(run, self._scales)

    @property
    def first(self) -> float:
        """Time of the first shape [s]."""
        return float(max(self._run.times[0], self._run.shape_times[0]))

    @property
    def last(self) -> float:
        """Time of the last one [s]."""
        return float(min(self._run.times[-1], self._run.shape_times[-1]))

    @property
    def _flat_camera(self) -> Camera:
        """The camera without perspective, by which a robot is as large wherever it went."""
        camera = self._look.camera
        return camera if camera.distance is not None else replace(camera, parallel=True)

    @property
    def warning(self) -> str | None:
        """Warning that shapes end long before the run, where they were logged too seldom; None if they do not."""
        end = float(self._run.times[-1])
        if end - self.last <= MISSED * (end - float(self._run.times[0])):
            return None
        return (
            f"{self._path}: the run ends at t = {end:.9g} s, but its last shape is of t = {self.last:.9g} s, and "
            "nothing later can be drawn; run it with a larger output.marker_rate"
        )

    def spread(self, count: int) -> list[float]:
        """Return times evenly over the run, from its start to its end [s]."""
        return np.linspace(self.first, self.last, count).tolist() if count > 1 else [self.last]

    def picture(self, path: str | Path, *times: float) -> None:
        """Write one picture of the run at `times` [s] (default: the end), with all but the last pale."""
        from bilayer_core.view import sheet

        moments = sorted(times) or [self.last]
        camera = self._look.camera if len(moments) == 1 else replace(self._flat_camera, kind="fixed")
        setting = self._set(moments, Insets(), 0.0, camera)
        overlay = self._overlay(setting.size, setting.metres_per_pixel, self._notes(setting))
        written = ", ".join(text.removesuffix(" s") for text in time_text(moments)) + " s"
        sheet.save_png(overlay.write(next(self._draw(setting, together=True)), written), path)

    def sheet(self, path: str | Path, times: Sequence[float]) -> None:
        """Write pictures at `times` [s] as one, over one colour bar and one scale bar."""
        from bilayer_core.view import sheet

        setting = self._set(times, SHEET_INSETS, 0.0, self._flat_camera)
        pictures = list(self._draw(setting))
        columns, scale = sheet.layout_of(len(pictures), *setting.size)
        small = setting.metres_per_pixel / scale
        width, notes = sheet.width_of(columns, scale, setting.size), self._notes(setting)
        footer = self._overlay(sheet.footer_size(width, 0), small, notes, sheet.TEXT)
        if footer.aside:
            footer = self._overlay(sheet.footer_size(width, len(notes)), small, notes, sheet.TEXT)
        sheet.save_png(sheet.put_together(pictures, time_text(times), footer, self._look.theme), path)

    def gif(self, path: str | Path, times: Sequence[float], rate: float, note: str = "") -> None:
        """Write pictures at `times` [s] as an animation of so many pictures a second."""
        from bilayer_core.view import sheet

        pictures = self.pictures(times, Insets(), rate, time_text(times, note), sheet.GIF_SIZE)
        sheet.save_gif(list(pictures), rate, path)

    def film(self, path: str | Path, times: Sequence[float], rate: float, note: str = "") -> None:
        """Write pictures at `times` [s] as a film of so many pictures a second."""
        from bilayer_core.view.film import save_mp4

        require("films", "imageio_ffmpeg")
        setting = self._set(times, Insets(), rate, size=FILM_SIZE)
        save_mp4(self._written(setting, time_text(times, note)), setting.size, rate, path)

    def pictures(
        self, times: Sequence[float], insets: Insets, rate: float, texts: list[str], longest: int | None = None
    ) -> Iterator[Image.Image]:
        """Return the pictures at `times` [s], with all that is written on them.

        `rate`: pictures a second of film; 0 if it is none. `texts`: what is written on each beside the bars. `longest`:
        the longer side of pictures whose size is not given [pixels].
        """
        return self._written(self._set(times, insets, rate, longest=longest), texts)

    def _written(self, setting: _Setting, texts: list[str]) -> Iterator[Image.Image]:
        overlay = self._overlay(setting.size, setting.metres_per_pixel, self._notes(setting))
        for picture, text in zip(self._draw(setting), texts, strict=True):
            yield overlay.write(picture, text)

    def _set(
        self,
        times: Sequence[float],
        insets: Insets,
        rate: float,
        camera: Camera | None = None,
        size: tuple[int, int] | None = None,
        longest: int | None = None,
    ) -> _Setting:
        """Return the moments at `times` [s], the view of each, the size of pictures and how many metres a pixel is."""
        for time in times:
            if not self.first <= time <= self.last:
                raise InputError(f"{self._path}: holds {self.first:g} s to {self.last:g} s, and not {time:g} s")
        moments = [self._moments.at(time) for time in times]
        every = [self._moments.all_points(moment, self._scales.metres_per_newton) for moment in moments]
        robot = [self._moments.robot_points(moment, self._scales.metres_per_newton) for moment in moments]
        camera = camera or self._look.camera
        size = self._look.size or size
        if size is None:
            aspect = _aspect_of(camera, shots(camera, every, robot, 1.5, insets, rate), every, robot)
            height = (AREA / aspect) ** 0.5
            shrunk = 1.0 if longest is None else longest / max(height, aspect * height)
            size = (2 * round(0.5 * shrunk * aspect * height), 2 * round(0.5 * shrunk * height))
        if size[0] < NARROW * size[1]:
            insets = replace(insets, top=insets.top + NOTES_TOP)
        found = shots(camera, every, robot, size[0] / size[1], insets, rate)
        return _Setting(moments, found, size, found[0].metres_per_height / size[1])

    def _draw(self, setting: _Setting, together: bool = False) -> Iterator[Image.Image]:
        """Draw each moment, or all in one picture."""
        scales, targets = self._scales, np.array([shot.target for shot in setting.shots])
        middle = 0.5 * (targets.min(axis=0) + targets.max(axis=0))
        way = 0.5 * float(np.linalg.norm(np.ptp(targets, axis=0)))
        seen = max(shot.metres_per_height for shot in setting.shots)
        radius = min(scales.size + 2.0 * scales.extent, DEEPEST * scales.size) + way + seen
        stage = Stage(
            self._run,
            self._moments,
            self._colouring,
            self._look.theme,
            setting.size,
            Ground(middle, radius, scales.cell),
            scales.size,
            self._arrows,
            setting.has_trail,
        )
        try:
            if together:
                yield stage.draw(setting.moments, setting.shots[0])
                return
            for moment, shot in zip(setting.moments, setting.shots, strict=True):
                yield stage.draw([moment], shot)
        finally:
            stage.close()

    def _overlay(
        self, size: tuple[int, int], metres_per_pixel: float, notes: list[str], text_size: int | None = None
    ) -> Overlay:
        from bilayer_core.view.overlay import Overlay

        return Overlay(size, self._look.theme, self._colouring, metres_per_pixel, notes, text_size)

    def _notes(self, setting: _Setting) -> list[str]:
        """Return notes that explain the arrows and squares that are seen."""
        from bilayer_core.view.overlay import round_length, with_prefix

        run, notes = self._run, []
        if run.contact_forces.any():
            metres, length = round_length(0.5 * ARROW_SHARE * self._scales.size)
            notes.append(
                f"green: contact force, {with_prefix(metres / self._scales.metres_per_newton, 'N')} for {length}"
            )
        if len(self._arrows) > 1:
            notes.append("blue, purple: force and moment of rods on bodies")
        if setting.has_trail:
            notes.append("line: way of the robot's middle")
        planes = [obstacle.shape for obstacle in run.description.obstacles if obstacle.shape.kind == "plane"]
        if all(is_edge_on(plane, setting.shots[0]) for plane in planes):
            return notes
        return [*notes, f"squares of {round_length(self._scales.cell)[1]}"]


@dataclass(frozen=True)
class _Setting:
    """Moments with the eye of each, size of pictures and how many metres a pixel is."""

    moments: list[Moment]
    shots: list[Shot]
    size: tuple[int, int]
    metres_per_pixel: float

    @property
    def has_trail(self) -> bool:
        """True where the eye moves, which hides how far the robot went."""
        return len({tuple(shot.eye) for shot in self.shots}) > 1


def _aspect_of(camera: Camera, found: list[Shot], every: list[np.ndarray], robot: list[np.ndarray]) -> float:
    """Return width over height of what is seen of the points that the camera holds, as far as pictures are so wide."""
    axes, follows = camera.axes, len({tuple(shot.eye) for shot in found}) > 1
    spans = []
    for shot, points in zip(found, robot if follows else every, strict=True):
        x, y, z = ((points - shot.eye) @ axes.T).T
        depth = -z if shot.half_height is None else np.full(len(z), shot.half_height / HALF_SLOPE)
        spans.append([(x / depth).min(), (x / depth).max(), (y / depth).min(), (y / depth).max()])
    left, right, low, high = np.array(spans).T
    wide, tall = right.max() - left.min(), 1.25 * (high.max() - low.min())
    return float(np.clip(wide / max(tall, 1e-12), *ASPECTS))


def time_text(times: Sequence[float], note: str = "") -> list[str]:
    """Return times with as many decimals as tell them apart, as texts."""
    from bilayer_core.view.sheet import decimals_for

    decimals = decimals_for(list(times))
    return [f"{time:.{decimals}f} s{note}" for time in times]
