"""A run drawn by VTK without a screen or a graphics card. VTK is imported when a stage is made, not before.

Every picture is drawn with more pixels than it has, and made smaller, which smooths edges in a third of the time that
the driver's own way takes.
"""

from __future__ import annotations

import ctypes.util
import importlib.util
import math
import sys
from typing import TYPE_CHECKING, Any

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.observed.frame import ShapeInfo
from bilayer_core.record.run_data import RunData
from bilayer_core.view import geometry
from bilayer_core.view.arrows import REACTIONS, Arrows
from bilayer_core.view.camera import HALF_SLOPE, Shot
from bilayer_core.view.colouring import Colouring
from bilayer_core.view.moments import Moment, Moments
from bilayer_core.view.theme import (
    ARROW_COLOUR,
    BALL_COLOURS,
    JOINT_COLOURS,
    OBSTACLE_COLOURS,
    REACTION_COLOURS,
    SIDE_SHADE,
    Theme,
)

if TYPE_CHECKING:
    from PIL import Image

FINER, FINER_OF_FILMS = 2.0, 1.5  # times as many pixels along each side are drawn as a picture has
ARROW_RADIUS = 0.006  # of the shaft of an arrow, in sizes of the robot
MISSING = "pictures and films need VTK; install it with: pip install 'bilayer_sim_ros[film]'"
MISSING_DRIVER = (
    "there is no OpenGL driver to draw with; on Debian and Ubuntu install Mesa's software driver with: "
    "sudo apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri"
)


def require_vtk() -> None:
    """Raise InputError, with what to install, where nothing can be drawn."""
    for module in ("vtkmodules", "PIL"):
        if importlib.util.find_spec(module) is None:
            raise InputError(MISSING)
    if sys.platform == "linux" and not any(map(ctypes.util.find_library, ("EGL", "OSMesa"))):
        raise InputError(MISSING_DRIVER)


def _window() -> Any:
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


class Stage:
    """Everything that is seen of a run, and a camera.

    Parameters
    ----------
    run : RunData
    moments : Moments
        Of the run, with what colours it.
    colouring : Colouring
    theme : Theme
    size : tuple of int
        Width and height of pictures.
    ground : tuple of (ndarray, float, float)
        Middle, radius and edge of squares of planes [m].
    arrow_size : float
        Size of the robot, for the thickness of arrows [m].
    arrows : dict of str to Arrows
        Scales of the arrows that are drawn: ``contact_forces``, ``clamp_forces``, ``clamp_moments``.
    finer : float
        How many times as many pixels are drawn along each side.

    Raises
    ------
    InputError
        If VTK or a driver is missing.
    """

    def __init__(
        self,
        run: RunData,
        moments: Moments,
        colouring: Colouring,
        theme: Theme,
        size: tuple[int, int],
        ground: tuple[np.ndarray, float, float],
        arrow_size: float,
        arrows: dict[str, Arrows],
        finer: float = FINER,
    ):
        require_vtk()
        import vtkmodules.vtkRenderingOpenGL2  # noqa: F401, the classes below are then its own
        from vtkmodules.vtkRenderingCore import vtkRenderer

        self._run, self._moments, self._colouring, self._theme = run, moments, colouring, theme
        self._size, self._arrows = size, arrows
        self._arrow_radius = ARROW_RADIUS * arrow_size
        self._renderer = vtkRenderer()
        self._renderer.SetBackground(*(c / 255 for c in theme.background))
        self._renderer.SetBackgroundAlpha(0.0 if theme.transparent else 1.0)
        if theme.transparent:
            self._renderer.SetBackground(0.0, 0.0, 0.0)
        self._window = _window()
        self._window.SetMultiSamples(0)
        self._window.SetAlphaBitPlanes(1)
        self._window.SetSize(*(round(finer * side) for side in size))
        self._window.AddRenderer(self._renderer)
        self._add_lights()
        self._add_fixed(ground)
        self._ribbons = self._add_ribbons()
        self._moving = self._add_moving(ground)
        self._arrow_data = {name: self._add_arrows(name) for name in arrows}

    def close(self) -> None:
        """Give the window back."""
        self._window.Finalize()

    def draw(self, moment: Moment, shot: Shot) -> Image.Image:
        """The run at a time, from an eye: RGB, or RGBA with a transparent background."""
        self._place_ribbons(moment)
        for actor, body in self._moving:
            actor.SetUserMatrix(_matrix(moment.body_positions[body], moment.body_quaternions[body]))
        for name, data in self._arrow_data.items():
            self._place_arrows(name, data, moment)
        self._look(shot)
        self._window.Render()
        return self._pixels()

    # what is there

    def _add_lights(self) -> None:
        """One from the eye, and one from over its left shoulder."""
        from vtkmodules.vtkRenderingCore import vtkLight

        self._renderer.SetAutomaticLightCreation(False)
        for place, strength in (((0.0, 0.0, 1.0), 0.55), ((-0.6, 0.9, 0.7), 0.6)):
            light = vtkLight()
            light.SetLightTypeToCameraLight()
            light.SetPosition(*place)
            light.SetFocalPoint(0.0, 0.0, 0.0)
            light.SetIntensity(strength)
            self._renderer.AddLight(light)

    def _add(self, data: Any, ambient: float, diffuse: float, specular: float = 0.0) -> Any:
        """An actor that draws points with colours."""
        from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

        mapper = vtkPolyDataMapper()
        mapper.SetInputData(data)
        mapper.SetColorModeToDirectScalars()
        actor = vtkActor()
        actor.SetMapper(mapper)
        of = actor.GetProperty()
        of.SetInterpolationToPhong()
        of.SetAmbient(ambient)
        of.SetDiffuse(diffuse)
        of.SetSpecular(specular)
        of.SetSpecularPower(30.0)
        self._renderer.AddActor(actor)
        return actor

    def _add_shape(self, shape: ShapeInfo, colours: geometry.Colours, ground: tuple) -> Any:
        if shape.kind == "plane":
            middle, radius, cell = ground
            clear = self._theme.transparent
            rim = () if clear else (self._theme.background,)  # opaque is drawn in a third of the time
            colours = (*self._theme.ground, *rim)
            vertices, shades, triangles = geometry.plane_mesh(shape, middle, radius, cell, colours)
            actor = self._add(_poly_data(vertices, None, shades, triangles), 1.0, 0.0)
            actor.GetProperty().LightingOff()
            if clear:
                actor.ForceTranslucentOn()
            return actor
        vertices, normals, shades, triangles = geometry.shape_mesh(shape, colours)
        return self._add(_poly_data(vertices, normals, shades, triangles), 0.35, 0.65, 0.15)

    def _add_fixed(self, ground: tuple) -> None:
        for obstacle in self._run.description.obstacles:
            self._add_shape(obstacle.shape, OBSTACLE_COLOURS, ground)
        for joint in self._run.description.joints:
            if joint.body < 0:
                self._add_shape(joint.shape, JOINT_COLOURS, ground)

    def _add_moving(self, ground: tuple) -> list[tuple[Any, int]]:
        """Bodies as they are, and joints on them; a body without a surface has nothing to draw."""
        of = self._run.description
        bodies = [
            (self._add_shape(body.shape, BALL_COLOURS, ground), index)
            for index, body in enumerate(of.bodies)
            if body.shape is not None
        ]
        joints = [(self._add_shape(j.shape, JOINT_COLOURS, ground), j.body) for j in of.joints if j.body >= 0]
        return bodies + joints

    def _add_ribbons(self) -> Any:
        triangles, first = [], 0
        for layer in self._run.description.layers:
            nodes = layer.nodes.stop - layer.nodes.start
            triangles.append(first + geometry.ribbon_triangles(nodes))
            first += nodes * geometry.CORNERS
        blank = np.zeros((first, 3), np.float32)
        shades = np.zeros((first, 3), np.uint8)
        data = _poly_data(blank, blank.copy(), shades, np.concatenate(triangles))
        self._add(data, 0.62, 0.42, 0.06)
        return data

    def _place_ribbons(self, moment: Moment) -> None:
        shade = np.where(np.arange(geometry.CORNERS) < geometry.WIDE_CORNERS, 1.0, SIDE_SHADE)[:, None]
        vertices, normals, colours = [], [], []
        for layer, rows, values in zip(self._run.description.layers, self._moments.rows, moment.values, strict=True):
            frames = moment.material_frames[None, rows]
            vertices.append(geometry.ribbon_vertices(layer, moment.positions[None, layer.nodes], frames)[0])
            normals.append(geometry.ribbon_normals(frames)[0])
            own = self._colouring.colours(values)[:, None, :3] * shade
            colours.append(np.rint(255.0 * own).astype(np.uint8))
        _replace(self._ribbons, *(np.concatenate(part).reshape(-1, 3) for part in (vertices, normals, colours)))

    def _add_arrows(self, name: str) -> Any:
        blank = np.zeros((1, 3), np.float32)
        data = _poly_data(blank, blank.copy(), np.zeros((1, 3), np.uint8), np.zeros((0, 3), np.uint32))
        self._add(data, 0.5, 0.5)
        return data

    def _place_arrows(self, name: str, data: Any, moment: Moment) -> None:
        scale = self._arrows[name]
        if name in REACTIONS:
            origins, forces = moment.body_positions, moment.clamp_wrenches[:, REACTIONS[name]]
        else:
            origins, forces = moment.positions, moment.contact_forces
        colour = REACTION_COLOURS.get(name, ARROW_COLOUR)
        shown = np.linalg.norm(forces, axis=1) > scale.shown
        vertices, normals, triangles = geometry.arrow_mesh(
            origins[shown], forces[shown] * scale.metres_per_unit, self._arrow_radius
        )
        if not len(vertices):
            vertices = normals = np.zeros((1, 3), np.float32)
        shades = np.tile(np.array(colour, np.uint8), (len(vertices), 1))
        data.ShallowCopy(_poly_data(vertices, normals, shades, triangles))

    # how it is seen

    def _look(self, shot: Shot) -> None:
        camera = self._renderer.GetActiveCamera()
        camera.SetPosition(*shot.eye)
        camera.SetFocalPoint(*shot.target)
        camera.SetViewUp(*shot.up)
        camera.SetParallelProjection(shot.half_height is not None)
        if shot.half_height is not None:
            camera.SetParallelScale(shot.half_height)
        else:
            camera.SetViewAngle(2.0 * math.degrees(math.atan(HALF_SLOPE)))
        self._renderer.ResetCameraClippingRange()

    def _pixels(self) -> Image.Image:
        from PIL import Image
        from vtkmodules.util.numpy_support import vtk_to_numpy
        from vtkmodules.vtkCommonCore import vtkUnsignedCharArray

        width, height = self._window.GetSize()
        found = vtkUnsignedCharArray()
        self._window.GetRGBACharPixelData(0, 0, width - 1, height - 1, 0, found)
        whole = Image.frombuffer("RGBX", (width, height), vtk_to_numpy(found), "raw", "RGBX", 0, 1)
        halved = (width, height) == (2 * self._size[0], 2 * self._size[1])
        small = whole.reduce(2) if halved else whole.resize(self._size, Image.Resampling.BOX)
        small = small.transpose(Image.Transpose.FLIP_TOP_BOTTOM)
        if not self._theme.transparent:
            return small.convert("RGB")
        # Colours are multiplied by the opacity: nothing was behind them.
        return Image.frombytes("RGBa", small.size, small.tobytes()).convert("RGBA")


def _poly_data(vertices: np.ndarray, normals: np.ndarray | None, colours: np.ndarray, triangles: np.ndarray) -> Any:
    """Triangles for VTK."""
    from vtkmodules.util.numpy_support import numpy_to_vtkIdTypeArray
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData

    data = vtkPolyData()
    data.SetPoints(vtkPoints())
    cells = vtkCellArray()
    corners = np.ascontiguousarray(triangles, dtype=np.int64).ravel()
    offsets = np.arange(0, len(corners) + 1, 3, dtype=np.int64)
    cells.SetData(numpy_to_vtkIdTypeArray(offsets, deep=1), numpy_to_vtkIdTypeArray(corners, deep=1))
    data.SetPolys(cells)
    _replace(data, vertices, normals, colours)
    return data


def _replace(data: Any, vertices: np.ndarray, normals: np.ndarray | None, colours: np.ndarray) -> None:
    """Move and colour the corners of triangles."""
    from vtkmodules.util.numpy_support import numpy_to_vtk

    data.GetPoints().SetData(numpy_to_vtk(vertices, deep=1))
    if normals is not None:
        data.GetPointData().SetNormals(numpy_to_vtk(normals, deep=1))
    data.GetPointData().SetScalars(numpy_to_vtk(colours, deep=1))
    data.GetPoints().Modified()
    data.Modified()


def _matrix(position: np.ndarray, quaternion: np.ndarray) -> Any:
    from vtkmodules.vtkCommonMath import vtkMatrix4x4

    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([geometry.rotated(quaternion, axis) for axis in range(3)], axis=1)
    matrix[:3, 3] = position
    found = vtkMatrix4x4()
    found.DeepCopy(matrix.ravel().tolist())
    return found
