"""A part of the world as VTK sees it, without a screen or a graphics card. VTK is imported when a window is made."""

from __future__ import annotations

import ctypes.util
import importlib.util
import math
import sys
from typing import TYPE_CHECKING, Any

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.view.camera import HALF_SLOPE, Shot
from bilayer_core.view.theme import Theme

if TYPE_CHECKING:
    from PIL import Image

MISSING = "pictures and films need VTK; install it with: pip install 'bilayer_sim_ros[film]'"
MISSING_DRIVER = (
    "there is no OpenGL driver to draw with; on Debian and Ubuntu install Mesa's software driver with: "
    "sudo apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri"
)
Part = tuple[int, int, int, int]
"""Of a picture: its left, upper, right and lower edge, in pixels from the upper left corner."""

ROOM = 2  # pixels round what is seen


def require_vtk() -> None:
    """Raise InputError, with what to install, where nothing can be drawn."""
    for module in ("vtkmodules", "PIL"):
        if importlib.util.find_spec(module) is None:
            raise InputError(MISSING)
    if sys.platform == "linux" and not any(map(ctypes.util.find_library, ("EGL", "OSMesa"))):
        raise InputError(MISSING_DRIVER)


def _offscreen() -> Any:
    """A window without a screen; InputError where none can be."""
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

    Parameters
    ----------
    theme : Theme
        Of the background.
    size : tuple of int
        Width and height of whole pictures.

    Attributes
    ----------
    renderer : vtkRenderer

    Raises
    ------
    InputError
        If VTK or a driver is missing.
    """

    def __init__(self, theme: Theme, size: tuple[int, int]):
        require_vtk()
        import vtkmodules.vtkRenderingOpenGL2  # noqa: F401, the classes below are then its own
        from vtkmodules.vtkRenderingCore import vtkRenderer

        self._size, self._clear = size, theme.transparent
        self._mode = "RGBa" if theme.transparent else "RGB"
        self._empty = (0, 0, 0, 0) if theme.transparent else theme.background
        self.renderer = vtkRenderer()
        self.renderer.SetBackground(*(c / 255 for c in self._empty[:3]))
        self.renderer.SetBackgroundAlpha(0.0 if theme.transparent else 1.0)
        self._window = _offscreen()
        self._window.SetMultiSamples(0)
        self._window.SetAlphaBitPlanes(1)
        self._window.AddRenderer(self.renderer)
        self._add_light()

    def close(self) -> None:
        """Give the window back."""
        self._window.Finalize()

    def nothing(self) -> Image.Image:
        """A whole picture of the background."""
        from PIL import Image

        return Image.new(self._mode, self._size, self._empty)

    def draw(self, shot: Shot, part: Part, finer: int) -> Image.Image:
        """A part of the picture: RGB, or with a transparent background RGBa, colours times opacity.

        Parameters
        ----------
        shot : Shot
            Of the whole picture.
        part : tuple of int
        finer : int
            How many times as many pixels are drawn along each side.
        """
        left, upper, right, lower = part
        self._window.SetSize(finer * (right - left), finer * (lower - upper))
        self._look(shot, part)
        self._window.Render()
        return self._pixels(finer)

    def _add_light(self) -> None:
        """One from the eye: materials say by themselves what it lights (`stage.py`)."""
        from vtkmodules.vtkRenderingCore import vtkLight

        self.renderer.SetAutomaticLightCreation(False)
        light = vtkLight()
        light.SetLightTypeToHeadlight()
        self.renderer.AddLight(light)

    def _look(self, shot: Shot, part: Part) -> None:
        """The camera of the whole picture, of which it sees a part: the same lines of sight."""
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

    def _pixels(self, finer: int) -> Image.Image:
        from PIL import Image
        from vtkmodules.util.numpy_support import vtk_to_numpy
        from vtkmodules.vtkCommonCore import vtkUnsignedCharArray

        width, height = self._window.GetSize()
        found = vtkUnsignedCharArray()
        self._window.GetRGBACharPixelData(0, 0, width - 1, height - 1, 0, found)
        data = vtk_to_numpy(found)
        if finer == 1 and not self._clear:
            return Image.frombytes("RGB", (width, height), data, "raw", "RGBX", 0, -1)
        drawn = Image.frombuffer("RGBX", (width, height), data, "raw", "RGBX", 0, 1)
        drawn = drawn.reduce(finer).transpose(Image.Transpose.FLIP_TOP_BOTTOM)
        if self._clear:
            return Image.frombytes("RGBa", drawn.size, drawn.tobytes())
        return drawn.convert("RGB")


def part_around(
    shot: Shot, points: np.ndarray, size: tuple[int, int], least: tuple[int, int] = (1, 1)
) -> Part | None:
    """The part of a picture that shows points, with some room; all of it if one is beside the eye or behind it.

    Parameters
    ----------
    shot : Shot
    points : ndarray
        [m], shape (points, 3).
    size, least : tuple of int
        Width and height of the picture, and least ones of the part.

    Returns
    -------
    tuple of int or None
        None if none of the points is seen.
    """
    back = shot.eye - shot.target
    back = back / np.linalg.norm(back)
    x, y, z = ((points - shot.eye) @ np.stack([np.cross(shot.up, back), shot.up, back]).T).T
    if shot.half_height is None:
        if z.max() >= -1e-3 * np.linalg.norm(shot.eye - shot.target):
            return (0, 0, *size)
        half = -HALF_SLOPE * z
    else:
        half = np.full(len(z), shot.half_height)
    width, height = size
    columns, rows = 0.5 * (width + height * x / half), 0.5 * height * (1.0 - y / half)
    edges = []
    for seen, most, smallest in ((columns, width, least[0]), (rows, height, least[1])):
        first, last = math.floor(seen.min()) - ROOM, math.ceil(seen.max()) + ROOM
        first, last = max(first, 0), min(last, most)
        if first >= last:
            return None
        length = max(last - first, min(smallest, most))
        first = min(max((first + last - length) // 2, 0), most - length)
        edges.append((first, first + length))
    (left, right), (upper, lower) = edges
    return left, upper, right, lower
