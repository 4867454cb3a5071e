"""Planes as endless chequered ground that fades away, smooth by itself: VTK's shader says the colour of each pixel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from bilayer_core.observed.frame import ShapeInfo
from bilayer_core.view.camera import Shot
from bilayer_core.view.geometry import plane_axes
from bilayer_core.view.theme import Theme

FADE_BEGINS = 0.35  # of the radius
_VERTEX = ("//VTK::PositionVC::Dec", "out vec2 place;"), ("//VTK::PositionVC::Impl", "place = vertexMC.xy;")
_SIGNS = (-1, -1), (1, -1), (1, 1), (-1, 1)
_DECLARED = "in vec2 place;\n"
# The mean of the squares over a box as wide as its two ways through a pixel are together: the root of the sum of their
# squares, within 4 %. No root is taken, which halves the time.
_COLOUR = """
vec2 across = abs(dFdx(place)), upwards = abs(dFdy(place));
vec2 width = max(0.96 * max(across, upwards) + 0.4 * min(across, upwards), 1e-6);
vec2 less = fract(0.5 * (place - 0.5 * width)) - 0.5, more = fract(0.5 * (place + 0.5 * width)) - 0.5;
vec2 mean = 2.0 * (abs(less) - abs(more)) / width;
vec2 way = (place - vec2({x:.9g}, {y:.9g})) * {share:.9g};
float fade = clamp((dot(way, way) - {begins}) * {slope:.9g}, 0.0, 1.0);
vec3 square = mix(vec3({dark}), vec3({light}), 0.5 + 0.5 * mean.x * mean.y);
diffuseColor = vec3(0.0);
ambientColor = {colour};
opacity = {opacity};
"""


@dataclass(frozen=True)
class Ground:
    """Where planes are seen."""

    middle: np.ndarray  # The point below which they are in the middle [m], shape (3,)
    radius: float  # Where they have faded away [m]
    cell: float  # Edge of a square [m]. The squares keep their places when the middle changes.

    def corners(self, plane: ShapeInfo) -> np.ndarray:
        """Return the corners of a square that holds the visible part of a plane [m], shape (4, 3)."""
        axes, point = plane_axes(plane), np.array(plane.position)
        middle = (self.middle - point) @ axes[:2].T
        return point + (middle + self.radius * np.array(_SIGNS)) @ axes[:2]


def is_edge_on(plane: ShapeInfo, shot: Shot) -> bool:
    """Return whether a picture without perspective shows no more of a plane than a line."""
    back = shot.eye - shot.target
    return shot.half_height is not None and abs(plane_axes(plane)[2] @ back) < 1e-9 * np.linalg.norm(back)


def below_edge(plane: ShapeInfo, shot: Shot, size: tuple[int, int]) -> list[tuple[float, float]]:
    """Return the corners of what is below a plane that is seen as a line [pixels], beyond the edges of the picture."""
    width, height = size
    back = shot.eye - shot.target
    right = np.cross(shot.up, back / np.linalg.norm(back))
    normal, down = plane_axes(plane)[2], np.array([1.0, -1.0])
    inwards = down * [normal @ right, normal @ shot.up]  # in the picture, whose rows go downwards
    offset = (np.array(plane.position) - shot.target) @ normal * height / (2.0 * shot.half_height)
    point = 0.5 * np.array(size) + offset * inwards
    along, far = np.array([-inwards[1], inwards[0]]), 2.0 * (width + height) + abs(offset)
    first, last = point - far * along, point + far * along
    return [tuple(at) for at in (first, last, last - 2.0 * far * inwards, first - 2.0 * far * inwards)]


def add_plane(renderer: Any, plane: ShapeInfo, ground: Ground, theme: Theme) -> Any:
    """Draw a plane that fades into the background, or into nothing if that is transparent.

    Its user matrix may move it.
    """
    from vtkmodules.vtkRenderingCore import vtkActor, vtkAssembly, vtkPolyDataMapper

    cell, axes = ground.cell, plane_axes(plane)
    middle = axes[:2] @ (ground.middle - np.array(plane.position)) / cell
    radius = ground.radius / cell
    # Two squares are a period: seen from an origin beside the middle, places there have all digits.
    first = 2.0 * np.round(0.5 * middle)
    x, y = middle - first
    placed = np.eye(4)
    placed[:3, :3] = cell * axes.T
    placed[:3, 3] = np.array(plane.position) + cell * first @ axes[:2]
    mapper = vtkPolyDataMapper()
    mapper.SetInputData(_square(x, y, radius))
    mapper.SetVBOShiftScaleMethod(0)  # places of vertices stay what they are
    actor = vtkActor()
    actor.SetMapper(mapper)
    actor.SetUserMatrix(_matrix(placed))
    actor.GetProperty().LightingOff()
    if theme.transparent:
        actor.ForceTranslucentOn()
    light, dark, rim = (", ".join(f"{c / 255:.6f}" for c in colour) for colour in (*theme.ground, theme.background))
    colour = _COLOUR.format(
        x=x,
        y=y,
        share=1.0 / radius,
        begins=FADE_BEGINS**2,
        slope=1.0 / (1.0 - FADE_BEGINS**2),
        light=light,
        dark=dark,
        colour="square" if theme.transparent else f"mix(square, vec3({rim}), fade)",
        opacity="1.0 - fade" if theme.transparent else "1.0",
    )
    shaders = actor.GetShaderProperty()
    for mark, text in _VERTEX:
        shaders.AddVertexShaderReplacement(mark, True, f"{mark}\n{text}\n", False)
    for mark, text in (("//VTK::PositionVC::Dec", _DECLARED), ("//VTK::Color::Impl", colour)):
        shaders.AddFragmentShaderReplacement(mark, True, f"{mark}\n{text}\n", False)
    whole = vtkAssembly()
    whole.AddPart(actor)
    renderer.AddActor(whole)
    return whole


def _square(x: float, y: float, radius: float) -> Any:
    """Return two triangles that hold the disc [squares]."""
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData

    points, cells, data = vtkPoints(), vtkCellArray(), vtkPolyData()
    for i, j in _SIGNS:
        points.InsertNextPoint(x + i * radius, y + j * radius, 0.0)
    for corners in ((0, 1, 2), (0, 2, 3)):
        cells.InsertNextCell(3, corners)
    data.SetPoints(points)
    data.SetPolys(cells)
    return data


def _matrix(values: np.ndarray) -> Any:
    from vtkmodules.vtkCommonMath import vtkMatrix4x4

    matrix = vtkMatrix4x4()
    matrix.DeepCopy(values.ravel().tolist())
    return matrix
