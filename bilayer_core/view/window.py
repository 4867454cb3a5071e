"""A part of the world as VTK sees it, without a screen or a graphics card. VTK is imported when a window is made."""

from __future__ import annotations

import ctypes.util
import math
import sys
from typing import Any

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.extras import require
from bilayer_core.view.camera import HALF_SLOPE, Shot
from bilayer_core.view.theme import Theme

MISSING_DRIVER = (
    "there is no OpenGL driver to draw with; on Debian and Ubuntu install Mesa's software driver with: "
    "sudo apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri"
)
Part = tuple[int, int, int, int]
"""Of a picture: its left, upper, right and lower edge, in pixels from the upper left corner."""

FINER = 2  # times as many pixels along each side are drawn of what has edges
_LANES = np.uint64(0x00FF00FF00FF00FF)
ROOM = 2  # pixels round what is seen
EDGE = 0.6  # brightness of the edge of what is drawn


def require_vtk() -> None:
    """Raise InputError, with what to install, where nothing can be drawn."""
    require("pictures and films", "vtkmodules", "PIL")
    if sys.platform == "linux" and not any(map(ctypes.util.find_library, ("EGL", "OSMesa"))):
        raise InputError(MISSING_DRIVER)


def _offscreen() -> Any:
    """Return a window without a screen; raise InputError where there can be none."""
    from vtkmodules import vtkRenderingOpenGL2 as rendering
    from vtkmodules.vtkCommonCore import vtkObject
    from vtkmodules.vtkRenderingCore import vtkRenderWindow

    if sys.platform != "linux":
        window = vtkRenderWindow()
    elif ctypes.util.find_library("EGL"):
        window = rendering.vtkEGLRenderWindow()
    else:
        window = rendering.vtkOSOpenGLRenderWindow()
    window.SetOffScreenRendering(1)
    told = vtkObject.GetGlobalWarningDisplay()
    vtkObject.SetGlobalWarningDisplay(0)  # what it would print is said below
    try:
        works = window.SupportsOpenGL()
    finally:
        vtkObject.SetGlobalWarningDisplay(told)
    if not works:
        raise InputError(MISSING_DRIVER)
    return window


class Window:
    """Draws what is added to its renderer.

    `theme`: of the background. `size`: width and height of whole pictures. `clear`: whether pictures have no
    background, to be laid over others. Raises InputError if VTK or a driver is missing.
    """

    def __init__(self, theme: Theme, size: tuple[int, int], clear: bool):
        require_vtk()
        import vtkmodules.vtkRenderingOpenGL2  # noqa: F401, the classes below are then its own
        from vtkmodules.vtkRenderingCore import vtkRenderer

        self._size = size
        self.renderer = vtkRenderer()
        self.renderer.SetBackground(*((0.0, 0.0, 0.0) if clear else (c / 255 for c in theme.background)))
        self.renderer.SetBackgroundAlpha(0.0 if clear else 1.0)
        self._window = _offscreen()
        self._window.SetMultiSamples(0)
        self._window.SetAlphaBitPlanes(1)
        self._window.AddRenderer(self.renderer)
        self._add_light()

    def close(self) -> None:
        """Give the window back."""
        self._window.Finalize()

    def draw(self, shot: Shot, part: Part, finer: int) -> np.ndarray:
        """Draw a part of the picture.

        `shot`: of the whole picture. `finer`: how many times as many pixels are drawn along each side. Returns RGBA,
        colours times opacity, as bytes from the upper row on; shape (finer x rows, finer x columns, 4).
        """
        left, upper, right, lower = part
        self._window.SetSize(finer * (right - left), finer * (lower - upper))
        self._look(shot, part)
        self._window.Render()
        return self._pixels()

    def _add_light(self) -> None:
        """Add one light from the eye: materials say by themselves what it lights (`stage.py`)."""
        from vtkmodules.vtkRenderingCore import vtkLight

        self.renderer.SetAutomaticLightCreation(False)
        light = vtkLight()
        light.SetLightTypeToHeadlight()
        self.renderer.AddLight(light)

    def _look(self, shot: Shot, part: Part) -> None:
        """Turn the camera of the whole picture so that it sees a part along the same lines of sight."""
        width, height = self._size
        left, upper, right, lower = part
        share = (lower - upper) / height
        camera = self.renderer.GetActiveCamera()
        camera.SetPosition(*shot.eye)
        camera.SetFocalPoint(*shot.target)
        camera.SetViewUp(*shot.up)
        camera.SetWindowCenter((left + right - width) / (right - left), (height - upper - lower) / (lower - upper))
        camera.SetParallelProjection(shot.half_height is not None)
        if shot.half_height is not None:
            camera.SetParallelScale(share * shot.half_height)
        else:
            camera.SetViewAngle(2.0 * math.degrees(math.atan(share * HALF_SLOPE)))
        self.renderer.ResetCameraClippingRange()

    def _pixels(self) -> np.ndarray:
        from vtkmodules.util.numpy_support import vtk_to_numpy
        from vtkmodules.vtkCommonCore import vtkUnsignedCharArray

        width, height = self._window.GetSize()
        found = vtkUnsignedCharArray()
        self._window.GetRGBACharPixelData(0, 0, width - 1, height - 1, 0, found)
        return vtk_to_numpy(found).reshape(height, width, 4)[::-1]


def outlined(drawn: np.ndarray) -> np.ndarray:
    """Return what is drawn with a darker edge, so that pale strips are seen on pale ground.

    `drawn`: RGBA, colours times opacity, with `FINER` times as many pixels along each side.
    """
    seen = drawn[..., 3] > 0
    within = seen[: -2 * FINER, FINER:-FINER] & seen[2 * FINER :, FINER:-FINER]
    within &= seen[FINER:-FINER, : -2 * FINER] & seen[FINER:-FINER, 2 * FINER :]
    rows, columns = np.nonzero(seen[FINER:-FINER, FINER:-FINER] & ~within)
    rows, columns = rows + FINER, columns + FINER
    found = drawn.copy()
    found[rows, columns, :3] = (EDGE * found[rows, columns, :3]).astype(np.uint8)
    return found


def lay_over(picture: np.ndarray, drawn: np.ndarray, part: Part) -> None:
    """Draw what has twice as many pixels along each side over a part of a picture, smaller by as much.

    `picture`: RGBA, colours times opacity, as bytes, shape (rows, columns, 4); changed. `drawn`: the same, shape (2 x
    rows of the part, 2 x its columns, 4).
    """
    left, upper, _, _ = part
    pairs = drawn.reshape(len(drawn), -1).view(np.uint64)  # of pixels beside each other
    rows, columns = np.nonzero(pairs[0::2] | pairs[1::2])  # most is empty
    above, below = pairs[2 * rows, columns], pairs[2 * rows + 1, columns]
    # Bytes are added in lanes of 16 bits: red and blue, green and opacity.
    red_blue = _both((above & _LANES) + (below & _LANES))
    green_opacity = _both(((above >> 8) & _LANES) + ((below >> 8) & _LANES))
    blended = (red_blue >> 2) & 0xFF00FF | ((green_opacity >> 2) & 0xFF00FF) << 8
    whole = picture.reshape(picture.shape[0], -1).view(np.uint32)
    rows, columns = rows + upper, columns + left
    seen_through = 4 * 255 + 2 - (green_opacity >> 16)
    edge = np.flatnonzero(seen_through)
    behind = whole[rows[edge], columns[edge]].view(np.uint8).reshape(-1, 4)
    own = blended[edge].astype(np.uint32).view(np.uint8).reshape(-1, 4)
    mixed = own + seen_through[edge, None].astype(np.uint32) * behind // (4 * 255)
    whole[rows, columns] = blended
    whole[rows[edge], columns[edge]] = mixed.astype(np.uint8).view(np.uint32)[:, 0]


def _both(lanes: np.ndarray) -> np.ndarray:
    """Return sums over two pixels beside each other, with an offset that rounds a quarter of them."""
    return ((lanes + (lanes >> 32)) & 0xFFFFFFFF) + 0x20002


def pixels_of(shot: Shot, points: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Return columns and rows of points in a picture of a size, shape (points, 2); NaN beside the eye and behind it."""
    back = shot.eye - shot.target
    distance = np.linalg.norm(back)
    back = back / distance
    x, y, z = ((points - shot.eye) @ np.stack([np.cross(shot.up, back), shot.up, back]).T).T
    if shot.half_height is None:
        half = np.where(z < -1e-3 * distance, -HALF_SLOPE * z, np.nan)
    else:
        half = np.full(len(z), shot.half_height)
    width, height = size
    return np.stack([0.5 * (width + height * x / half), 0.5 * height * (1.0 - y / half)], axis=1)


def part_around(shot: Shot, points: np.ndarray, size: tuple[int, int], least: tuple[int, int] = (1, 1)) -> Part | None:
    """Return the part of a picture that shows points, with some room.

    It is the whole picture if a point is beside the eye or behind it.

    `points`: [m], shape (points, 3). `size`, `least`: width and height of the picture, and least ones of the part.
    Returns None if none of the points is seen.
    """
    places = pixels_of(shot, points, size)
    if not len(places) or np.isnan(places).any():
        return (0, 0, *size) if len(places) else None
    edges = []
    for seen, most, smallest in zip(places.T, size, least, strict=True):
        first, last = math.floor(seen.min()) - ROOM, math.ceil(seen.max()) + ROOM
        first, last = max(first, 0), min(last, most)
        if first >= last:
            return None
        length = max(last - first, min(smallest, most))
        first = min(max((first + last - length) // 2, 0), most - length)
        edges.append((first, first + length))
    (left, right), (upper, lower) = edges
    return left, upper, right, lower
