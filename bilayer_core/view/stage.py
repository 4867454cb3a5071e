"""A run drawn by VTK. The ground is smooth by itself and drawn as it is. Over it comes the part of the picture where
anything else is seen, drawn with twice as many pixels along each side and made smaller, which smooths its edges.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from bilayer_core.log.run.run_data import RunData
from bilayer_core.observed.frame import ShapeInfo, Strand
from bilayer_core.view import geometry
from bilayer_core.view.arrows import REACTIONS, Arrows
from bilayer_core.view.camera import Shot
from bilayer_core.view.colouring import Colouring
from bilayer_core.view.ground import Ground, add_plane, below_edge, is_edge_on
from bilayer_core.view.run_at_times import Moment, Moments
from bilayer_core.view.scales import middles_of
from bilayer_core.view.theme import (
    ARROW_COLOUR,
    BALL_COLOURS,
    JOINT_COLOURS,
    OBSTACLE_COLOURS,
    REACTION_COLOURS,
    SIDE_SHADE,
    Theme,
)
from bilayer_core.view.window import FINER, Part, Window, lay_over, outlined, part_around, pixels_of

if TYPE_CHECKING:
    from PIL import Image

_MARK, _LIGHT = (
    "//VTK::Light::Impl",
    """
float near = max(normalVCVSOutput.z, 0.0), over = max(dot(normalVCVSOutput, vec3(-0.4657, 0.6985, 0.5433)), 0.0);
float first = near * near, second = max(dot(normalVCVSOutput, vec3(-0.2651, 0.3976, 0.8784)), 0.0);
second *= second;
first *= first; first *= first; first *= first; first *= first;
second *= second; second *= second; second *= second; second *= second;
vec3 shine = (0.55 * first + 0.6 * second) * specularIntensity * specularColorUniform;
fragOutput0 = vec4(ambientColor + (0.55 * near + 0.6 * over) * diffuseColor + shine, opacity);
""",
)
"""Light from the eye and from over its left shoulder: diffuse, and the 32nd power of the cosine between the normal and
what halves the angle to the eye. VTK's own loop over lights takes one and a half times as long."""
WORTH_KEEPING = 0.7  # of the size of the part that was drawn last: other sizes cost new buffers
ARROW_RADIUS = 0.006  # of the shaft of an arrow, in sizes of the robot
HUB_SIDE = 0.5  # of the block that stands for a body without a surface, in widths of the widest rod
TRAIL_WIDTH = 0.003  # in heights of the picture
PALE = 0.5  # opacity of the earlier ones of several moments


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
    ground : Ground
        Where planes are seen.
    arrow_size : float
        Size of the robot, for the thickness of arrows [m].
    arrows : dict of str to Arrows
        Scales of the arrows that are drawn: ``contact_forces``, ``clamp_forces``, ``clamp_moments``.
    trail : bool
        Whether to draw the way of the robot's middle up to each moment.

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
        ground: Ground,
        arrow_size: float,
        arrows: dict[str, Arrows],
        trail: bool,
    ):
        self._run, self._moments, self._colouring, self._theme = run, moments, colouring, theme
        self._size, self._ground, self._arrows = size, ground, arrows
        self._arrow_radius = ARROW_RADIUS * arrow_size
        self._trail = middles_of(run) if trail else None
        self._window = Window(theme, size, clear=True)
        self._renderer = self._window.renderer
        self._all_layers, self._rows, self._nodes = self._chain_layers()
        self._ribbons = self._add_ribbons()
        self._moving = self._add_moving()
        self._arrow_data = {name: self._add_arrows() for name in arrows}
        self._fixed = self._add_fixed()
        planes = [o.shape for o in run.description.obstacles if o.shape.kind == "plane"]
        self._planes = [(plane, add_plane(self._renderer, plane, ground, theme)) for plane in planes]
        self._background: Window | None = None
        self._behind: tuple[Shot, Image.Image] | None = None
        if planes:
            self._background = Window(theme, size, clear=theme.transparent)
            for plane in planes:
                add_plane(self._background.renderer, plane, ground, theme)
        self._background_finer = 1 if len(planes) < 2 else FINER  # where two planes meet is an edge
        self._drawn = (1, 1)  # size of the part that was drawn last

    def close(self) -> None:
        """Give the windows back."""
        self._window.close()
        if self._background is not None:
            self._background.close()

    def draw(self, moments: Sequence[Moment], shot: Shot) -> Image.Image:
        """Draw the run from an eye, with all but the last moment pale: RGB, or RGBA with a transparent background."""
        from PIL import Image

        picture = self._picture_behind(shot)
        if self._trail is not None:
            self._draw_trail(picture, moments[-1].time, shot)
        for moment in moments:
            self._draw_over(picture, moment, shot, moment is not moments[-1])
        if self._theme.transparent:
            return Image.frombytes("RGBa", self._size, picture.tobytes()).convert("RGBA")
        return Image.frombytes("RGB", self._size, picture, "raw", "RGBX")

    def _draw_trail(self, picture: np.ndarray, time: float, shot: Shot) -> None:
        """Draw the way of the robot's middle until a time."""
        from PIL import Image, ImageDraw

        way = pixels_of(shot, self._trail[self._run.shape_times <= time], self._size)
        fine = Image.new("L", (FINER * self._size[0], FINER * self._size[1]))
        corners = [tuple(at) for at in FINER * way[np.isfinite(way).all(axis=1)]]
        ImageDraw.Draw(fine).line(corners, 255, max(2, round(TRAIL_WIDTH * fine.size[1])), joint="curve")
        covered = np.asarray(fine.resize(self._size, Image.Resampling.BOX), np.uint16)[..., None]
        colour = np.array((*self._theme.text, 255), np.uint16)
        picture[:] = (covered * colour + (255 - covered) * picture) // 255

    def _draw_over(self, picture: np.ndarray, moment: Moment, shot: Shot, pale: bool) -> None:
        """Draw all that stands before the ground at one time."""
        points = [self._fixed, self._place_ribbons(moment)]
        points += [self._place_moving(moment, *moving) for moving in self._moving]
        points += [self._place_arrows(name, data, moment) for name, data in self._arrow_data.items()]
        places = np.concatenate(points)
        hiding = [_hides(plane, shot, places) for plane, _ in self._planes]
        for (_, actor), hides in zip(self._planes, hiding, strict=True):
            actor.SetVisibility(hides)
        part = self._part(shot, places)
        if part is None:
            return
        left, upper, right, lower = part
        if self._theme.transparent and any(hiding):
            picture[upper:lower, left:right] = 0  # the ground is drawn with all else
        drawn = outlined(self._window.draw(shot, part, FINER))
        lay_over(picture, (drawn * PALE).astype(np.uint8) if pale else drawn, part)

    def _part(self, shot: Shot, points: np.ndarray) -> Part | None:
        """Return the part of the picture that shows points, as large as the last one unless that is much too large."""
        part = part_around(shot, points, self._size)
        if part is not None:
            width, height = part[2] - part[0], part[3] - part[1]
            larger = max(width, self._drawn[0]), max(height, self._drawn[1])
            if width * height > WORTH_KEEPING * larger[0] * larger[1]:
                part = part_around(shot, points, self._size, larger)
            self._drawn = (part[2] - part[0], part[3] - part[1])
        return part

    def _picture_behind(self, shot: Shot) -> np.ndarray:
        """Return the ground alone, RGBA, colours times opacity: the last one as long as the eye stays where it is."""
        if self._behind is None or not (self._background is None or _equal(shot, self._behind[0])):
            self._behind = shot, self._ground_alone(shot)
        return self._behind[1].copy()

    def _ground_alone(self, shot: Shot) -> np.ndarray:
        from PIL import Image, ImageDraw

        picture = Image.fromarray(self._planes_alone(shot), "RGBA")
        for plane, _ in self._planes:
            if is_edge_on(plane, shot):
                fill = (*self._theme.ground[0], 255)
                ImageDraw.Draw(picture).polygon(below_edge(plane, shot, self._size), fill)
        return np.array(picture)

    def _planes_alone(self, shot: Shot) -> np.ndarray:
        width, height = self._size
        if self._background is None:
            empty = (0, 0, 0, 0) if self._theme.transparent else (*self._theme.background, 255)
            return np.tile(np.array(empty, np.uint8), (height, width, 1))
        drawn = self._background.draw(shot, (0, 0, width, height), self._background_finer)
        if self._background_finer == 1:
            return drawn
        four = drawn.reshape(height, FINER, width, FINER, 4)
        return np.rint(four.mean(axis=(1, 3), dtype=np.float32)).astype(np.uint8)

    # what is there

    def _add(self, data: Any, ambient: float, diffuse: float, specular: float = 0.0) -> Any:
        """Add an actor that draws points with colours, and return it."""
        from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

        mapper = vtkPolyDataMapper()
        mapper.SetInputData(data)
        mapper.SetColorModeToDirectScalars()
        actor = vtkActor()
        actor.SetMapper(mapper)
        of = actor.GetProperty()
        of.BackfaceCullingOn()  # all surfaces are closed
        of.SetInterpolationToPhong()
        of.SetAmbient(ambient)
        of.SetDiffuse(diffuse)
        of.SetSpecular(specular)
        actor.GetShaderProperty().AddFragmentShaderReplacement(_MARK, True, f"{_MARK}\n{_LIGHT}", False)
        self._renderer.AddActor(actor)
        return actor

    def _add_shape(self, shape: ShapeInfo, colours: geometry.Colours) -> tuple[Any, np.ndarray]:
        """Add an actor. Return it and the corners of a box that holds it, in the frame of its owner [m]."""
        if shape.kind == "plane":
            return add_plane(self._renderer, shape, self._ground, self._theme), self._ground.corners(shape)
        vertices, normals, shades, triangles = geometry.shape_mesh(shape, colours)
        actor = self._add(_poly_data(vertices, normals, shades, triangles), 0.35, 0.65, 0.15)
        return actor, geometry.shape_extent(shape)

    def _add_fixed(self) -> np.ndarray:
        """Return the corners of boxes round all that has edges and does not move [m], shape (points, 3)."""
        found = [np.zeros((0, 3))]
        for obstacle in self._run.description.obstacles:
            if obstacle.shape.kind != "plane":
                found.append(self._add_shape(obstacle.shape, OBSTACLE_COLOURS)[1])
        for joint in self._run.description.joints:
            if joint.body < 0:
                found.append(self._add_shape(joint.shape, JOINT_COLOURS)[1])
        return np.concatenate(found)

    def _add_moving(self) -> list[tuple[Any, np.ndarray, int]]:
        """Return the bodies as they are, blocks for those without a surface that hold rods, and joints on bodies."""
        of = self._run.description
        bodies = [
            (*self._add_shape(body.shape, BALL_COLOURS), index)
            for index, body in enumerate(of.bodies)
            if body.shape is not None
        ]
        side = HUB_SIDE * max(float(strand.width.max()) for strand in of.strands)
        block = ShapeInfo("box", (side, side, side), 0.1 * side, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
        bodies += [
            (*self._add_shape(block, JOINT_COLOURS), index)
            for index, body in enumerate(of.bodies)
            if body.shape is None and body.holds_rods
        ]
        joints = [(*self._add_shape(j.shape, JOINT_COLOURS), j.body) for j in of.joints if j.body >= 0]
        return bodies + joints

    def _place_moving(self, moment: Moment, actor: Any, corners: np.ndarray, body: int) -> np.ndarray:
        """Move a body; its corners."""
        position, quaternion = moment.body_positions[body], moment.body_quaternions[body]
        axes = np.stack([geometry.rotated(quaternion, axis) for axis in range(3)])
        actor.SetUserMatrix(_matrix(position, axes))
        return position + corners @ axes

    def _chain_layers(self) -> tuple[Strand, np.ndarray, np.ndarray]:
        """Return all layers as if they were one, and the rows and nodes that their cross-sections have in a moment."""
        layers = self._run.description.layers
        parts = {name: [getattr(of, name) for of in layers] for name in ("width", "thickness", "offset")}
        rows = np.concatenate([np.arange(part.start, part.stop) for part in self._moments.rows])
        nodes = np.concatenate([np.arange(of.nodes.start, of.nodes.stop) for of in layers])
        each = np.concatenate([np.full(len(of.width), of.round) for of in layers])
        return (
            replace(layers[0], round=each, **{name: np.concatenate(part) for name, part in parts.items()}),
            rows,
            nodes,
        )

    def _add_ribbons(self) -> Any:
        triangles, first, ends = [], 0, []
        for layer in self._run.description.layers:
            nodes = layer.nodes.stop - layer.nodes.start
            triangles.append(first + geometry.ribbon_faces(nodes))
            ends.append(first + geometry.FIRST_END.ravel())
            first += nodes * geometry.CORNERS
            ends.append(first - geometry.CORNERS + geometry.LAST_END.ravel())
        self._ends = np.concatenate(ends)
        triangles.append(first + geometry.two_triangles(np.arange(len(self._ends)).reshape(-1, 4)))
        self._outwards = np.tile(np.repeat([[-1.0], [1.0]], geometry.LAST_END.size, axis=0), (len(ends) // 2, 1))
        count = first + len(self._ends)  # corners of ends are there once more, with normals of their own
        blank = np.zeros((count, 3), np.float32)
        shades = np.zeros((count, 3), np.uint8)
        data = _poly_data(blank, blank.copy(), shades, np.concatenate(triangles))
        self._add(data, 0.8, 0.22)  # nearly the colours of the bar, with enough shade to see how it bends
        return data

    def _place_ribbons(self, moment: Moment) -> np.ndarray:
        """Move the ribbons; their corners [m], shape (corners, 3)."""
        shade = np.where(np.arange(geometry.CORNERS) < geometry.WIDE_CORNERS, 255.0, 255.0 * SIDE_SHADE)[:, None]
        frames = moment.material_frames[None, self._rows]
        vertices = geometry.ribbon_vertices(self._all_layers, moment.positions[None, self._nodes], frames)[0]
        own = self._colouring.colours(np.concatenate(moment.values))[:, None, :3] * shade
        colours = np.rint(own).astype(np.uint8)
        vertices, colours = vertices.reshape(-1, 3), colours.reshape(-1, 3)
        along = self._outwards * geometry.rotated(frames[0], 2)[self._ends // geometry.CORNERS]
        normals = [geometry.ribbon_normals(self._all_layers, frames).reshape(-1, 3), along.astype(np.float32)]
        joined = [vertices, vertices[self._ends]], normals, [colours, colours[self._ends]]
        _replace(self._ribbons, *map(np.concatenate, joined))
        return vertices

    def _add_arrows(self) -> Any:
        blank = np.zeros((1, 3), np.float32)
        data = _poly_data(blank, blank.copy(), np.zeros((1, 3), np.uint8), np.zeros((0, 3), np.uint32))
        self._add(data, 0.5, 0.5)
        return data

    def _place_arrows(self, name: str, data: Any, moment: Moment) -> np.ndarray:
        """Move arrows of one kind; their corners [m], shape (corners, 3)."""
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
        blank = vertices if len(vertices) else np.zeros((1, 3), np.float32)
        shades = np.tile(np.array(colour, np.uint8), (len(blank), 1))
        data.ShallowCopy(_poly_data(blank, normals if len(vertices) else blank, shades, triangles))
        return vertices


def _hides(plane: ShapeInfo, shot: Shot, points: np.ndarray) -> bool:
    """Return whether a plane is between the eye and one of the points, or may be because the eye is on neither side."""
    normal = geometry.plane_axes(plane)[2]
    heights = (points - np.array(plane.position)) @ normal
    back = shot.eye - shot.target if shot.half_height is not None else shot.eye - np.array(plane.position)
    side = float(back @ normal)
    return bool((np.sign(side) * heights < 0.0).any()) or side == 0.0


def _equal(first: Shot, second: Shot) -> bool:
    """Return whether two shots show the same."""
    return first.half_height == second.half_height and all(
        np.array_equal(getattr(first, name), getattr(second, name)) for name in ("eye", "target", "up")
    )


def _poly_data(vertices: np.ndarray, normals: np.ndarray | None, colours: np.ndarray, triangles: np.ndarray) -> Any:
    """Return the triangles for VTK."""
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


def _matrix(position: np.ndarray, axes: np.ndarray) -> Any:
    from vtkmodules.vtkCommonMath import vtkMatrix4x4

    matrix = np.eye(4)
    matrix[:3, :3] = axes.T
    matrix[:3, 3] = position
    found = vtkMatrix4x4()
    found.DeepCopy(matrix.ravel().tolist())
    return found
