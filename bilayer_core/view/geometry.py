"""Surfaces to draw: ribbons of a run, shapes whose rotation is seen, the ground. Plain numpy."""

from __future__ import annotations

import math

import numpy as np

from bilayer_core.observed.frame import ShapeInfo, Strand

# Corners of a cross-section along (m1, m2), in half thicknesses and half widths. Every corner is there twice, once
# for the wide face and once for the narrow one, so that narrow faces can be darker and edges stay sharp.
_CORNERS = np.array([[1, -1], [1, 1], [-1, -1], [-1, 1], [1, -1], [-1, -1], [1, 1], [-1, 1]], float)
# A round section is drawn as an octagon, of which the narrow faces of corners that are there twice are a ribbon's.
_OCTAGON = _CORNERS * np.repeat([[math.cos(math.pi / 8), math.sin(math.pi / 8)]], 8, axis=0)
_OCTAGON[4:] = _CORNERS[4:] * [math.sin(math.pi / 8), math.cos(math.pi / 8)]
_ROUND = (0, 1, 6, 7, 3, 2, 5, 4)  # corners one after the other, round the tangent
WIDE_CORNERS = 4  # the first corners belong to the wide faces
CORNERS = len(_CORNERS)


def rotated(quaternions: np.ndarray, axis: int) -> np.ndarray:
    """Return the column `axis` of the rotation matrices of unit quaternions x y z w, shape (..., 3)."""
    x, y, z, w = np.moveaxis(quaternions, -1, 0)
    columns = (
        (1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)),
        (2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)),
        (2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)),
    )
    return np.stack(columns[axis], axis=-1)


def ribbon_vertices(strand: Strand, positions: np.ndarray, material_frames: np.ndarray) -> np.ndarray:
    """Return the corners of the cross-sections of a ribbon over time.

    Parameters
    ----------
    positions : ndarray
        Of the strand's nodes [m], shape (times, nodes, 3).
    material_frames : ndarray
        Quaternions x y z w of m1 m2 m3 at the nodes, shape (times, nodes, 4).

    Returns
    -------
    ndarray
        [m], shape (times, nodes, CORNERS, 3), float32.
    """
    normal, section = rotated(material_frames, 0), np.where(_is_round(strand), _OCTAGON, _CORNERS)
    thickness = 0.5 * strand.thickness[:, None] * normal
    width = 0.5 * strand.width[:, None] * rotated(material_frames, 1)
    high, wide = (np.einsum("nc,tni->tnci", section[..., axis], half) for axis, half in enumerate((thickness, width)))
    corners = high + wide
    middles = positions + strand.offset[:, None] * normal
    return (middles[:, :, None] + corners).astype(np.float32)


def ribbon_normals(strand: Strand, material_frames: np.ndarray) -> np.ndarray:
    """Return the normals of those corners, of faces or radial, shape (times, nodes, CORNERS, 3), float32."""
    across, along = rotated(material_frames, 0), rotated(material_frames, 1)
    faces = (across, across, -across, -across, -along, -along, along, along)
    radial = _OCTAGON[:, :1] * across[..., None, :] + _OCTAGON[:, 1:] * along[..., None, :]
    return np.where(_is_round(strand), radial, np.stack(faces, axis=-2)).astype(np.float32)


def _is_round(strand: Strand) -> np.ndarray:
    """Return whether sections of a strand are round, for one or for each node, shape (n or 1, 1, 1)."""
    return np.reshape(strand.round, (-1, 1, 1))


def ribbon_triangles(nodes: int) -> np.ndarray:
    """Return the vertex indices of the surface of a ribbon with its ends closed, for vertices as above, shape
    (triangles, 3).
    """
    last = CORNERS * (nodes - 1)
    ends = np.concatenate([FIRST_END, last + LAST_END])
    return np.concatenate([ribbon_faces(nodes), two_triangles(ends)])


LAST_END = np.array([[0, 1, 6, 7], [0, 7, 3, 2], [0, 2, 5, 4]])  # corners of the last section, seen from outside
FIRST_END = LAST_END[:, ::-1]


def ribbon_faces(nodes: int) -> np.ndarray:
    """Return the vertex indices of the surface of a ribbon without its ends, shape (triangles, 3)."""
    first = CORNERS * np.arange(nodes - 1)[:, None, None]
    quads = np.array([[a, b, b + CORNERS, a + CORNERS] for a, b in zip(_ROUND, (*_ROUND[1:], _ROUND[0]), strict=True)])
    return two_triangles((first + quads).reshape(-1, 4))


def two_triangles(corners: np.ndarray) -> np.ndarray:
    """Return the two triangles of each of some quadrilaterals, shape (quadrilaterals, 4): shape (triangles, 3)."""
    return np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]]).astype(np.uint32)


_ARROW_SIDES = 10
SLIMMEST_ARROW = 0.06  # radius of the shaft of a short arrow, in lengths of it


def arrow_mesh(origins: np.ndarray, vectors: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the arrows with heads three times as wide as their shafts, which have one radius unless they are short.

    Parameters
    ----------
    origins, vectors : ndarray
        [m], shape (n, 3).
    radius : float
        [m].

    Returns
    -------
    vertices, normals, triangles : ndarray
        Shapes (v, 3), (v, 3), (t, 3).
    """
    count, sides = len(origins), _ARROW_SIDES
    length = np.linalg.norm(vectors, axis=1)[:, None]
    axis = vectors / np.maximum(length, np.finfo(float).tiny)
    radius = np.minimum(radius, SLIMMEST_ARROW * length)
    other = np.where(np.abs(axis[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    first = np.cross(axis, other)
    first /= np.linalg.norm(first, axis=1)[:, None]
    second = np.cross(axis, first)
    turn = 2 * np.pi * np.arange(sides) / sides
    circle = np.cos(turn)[:, None] * first[:, None] + np.sin(turn)[:, None] * second[:, None]
    neck = np.maximum(length - 7.0 * radius, 0.6 * length)[:, :, None] * axis[:, None]
    radius = radius[:, :, None]
    tip = length[:, :, None] * axis[:, None]
    none = np.zeros_like(neck)
    along = (none, neck, neck, neck, neck, tip)
    wide, outwards = (1.0, 1.0, 1.0, 3.0, 3.0, 0.0), (1, 1, 0, 0, 1, 1)  # shaft, underside of the head, head
    rings = [origins[:, None] + at + width * radius * circle for at, width in zip(along, wide, strict=True)]
    normals = [circle if out else -np.broadcast_to(axis[:, None], circle.shape) for out in outwards]
    vertices = np.stack(rings, axis=1).reshape(-1, 3)
    place = np.arange(sides)
    beside = (place + 1) % sides
    quads = np.concatenate(
        [np.stack([place, beside, beside + sides, place + sides], axis=1) + sides * row for row in (0, 2, 4)]
    )
    quads = (6 * sides * np.arange(count)[:, None, None] + quads).reshape(-1, 4)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return (
        vertices.astype(np.float32),
        np.stack(normals, axis=1).reshape(-1, 3).astype(np.float32),
        triangles.astype(np.uint32),
    )


Colours = tuple[tuple[int, int, int], tuple[int, int, int]]
Mesh = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
ARC_STEPS = 12  # rows of vertices along a quarter of a circle


def shape_mesh(shape: ShapeInfo, colours: Colours) -> Mesh:
    """Return a sphere, box or cylinder in the frame of its owner, in patches of two colours that show how it turns.

    Returns
    -------
    vertices, normals, colours, triangles : ndarray
        Shapes (v, 3), (v, 3), (v, 3) uint8, (t, 3).
    """
    half = 0.5 * np.array(shape.size)
    rounding = half[0] if shape.kind == "sphere" else shape.rounding
    core = np.maximum(half - rounding, 0.0)
    patches = _box_patches(core, rounding) if shape.kind == "box" else _round_patches(core[0], core[2], rounding)
    first, vertices, normals, shades, triangles = 0, [], [], [], []
    for number, (points, directions) in enumerate(patches):
        rows, columns = points.shape[:2]
        corner = first + np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)
        quads = np.stack([corner, corner + columns, corner + columns + 1, corner + 1], axis=-1).reshape(-1, 4)
        triangles += [quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]
        vertices.append(points.reshape(-1, 3))
        normals.append(directions.reshape(-1, 3))
        shades.append(np.tile(np.array(colours[number % 2], np.uint8), (rows * columns, 1)))
        first += rows * columns
    rotation = np.stack([rotated(np.array(shape.quaternion), axis) for axis in range(3)])
    placed = np.concatenate(vertices) @ rotation + np.array(shape.position)
    directions = np.concatenate(normals) @ rotation
    return (
        placed.astype(np.float32),
        directions.astype(np.float32),
        np.concatenate(shades),
        np.concatenate(triangles).astype(np.uint32),
    )


def _round_patches(radius: float, half_length: float, rounding: float, segments: int = 8, steps: int = 6):
    """Yield segments round the axis z, like those of a beach ball: points and normals, shapes (rows, steps + 1, 3)."""
    polar = np.linspace(0.0, np.pi, 2 * ARC_STEPS + 1)
    polar = np.concatenate([[0.0], polar[: ARC_STEPS + 1], polar[ARC_STEPS:], [np.pi]])
    flat = np.concatenate([[0.0], np.full(2 * ARC_STEPS + 2, radius), [0.0]])  # ends begin at the axis
    side = np.repeat([half_length, -half_length], ARC_STEPS + 2)
    across, up = flat + rounding * np.sin(polar), side + rounding * np.cos(polar)
    for segment in range(segments):
        turn = 2 * np.pi * (segment + np.linspace(0.0, 1.0, steps + 1)) / segments
        circle = np.stack([np.cos(turn), np.sin(turn), np.zeros_like(turn)], axis=-1)
        axis = np.array([0.0, 0.0, 1.0])
        points = across[:, None, None] * circle + up[:, None, None] * axis
        yield points, np.sin(polar)[:, None, None] * circle + np.cos(polar)[:, None, None] * axis


def _box_patches(core: np.ndarray, rounding: float):
    """Yield the faces of a box with their share of its rounded edges: points and normals, shapes (rows, columns, 3)."""
    quarter = np.linspace(0.0, 0.25 * np.pi, ARC_STEPS // 2 + 1)
    slopes = np.tan(np.concatenate([-quarter[::-1], quarter]))
    signs = np.repeat([-1.0, 1.0], len(quarter))
    for axis in range(3):
        for side in (1.0, -1.0):
            first, second = ((axis + 1) % 3, (axis + 2) % 3)[:: int(side)]
            direction, corner = np.zeros((len(slopes), len(slopes), 3)), np.zeros((len(slopes), len(slopes), 3))
            direction[..., axis], corner[..., axis] = side, side
            direction[..., first], corner[..., first] = slopes[:, None], signs[:, None]
            direction[..., second], corner[..., second] = slopes, signs
            direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
            yield core * corner + rounding * direction, direction


def shape_extent(shape: ShapeInfo) -> np.ndarray:
    """Return the corners of a box that holds a shape, in the frame of its owner [m], shape (8, 3); its position for a
    plane.
    """
    rotation = np.stack([rotated(np.array(shape.quaternion), axis) for axis in range(3)])
    signs = np.array(np.meshgrid([-0.5, 0.5], [-0.5, 0.5], [-0.5, 0.5])).reshape(3, -1).T
    return np.array(shape.position) + (signs * np.array(shape.size)) @ rotation


def plane_axes(plane: ShapeInfo) -> np.ndarray:
    """Return the unit vectors along the sides of the squares of a plane, and its normal, as rows."""
    normal = rotated(np.array(plane.quaternion), 2)
    across = np.cross([0.0, 1.0, 0.0] if abs(normal[1]) < 0.9 else [1.0, 0.0, 0.0], normal)
    across /= np.linalg.norm(across)
    return np.stack([across, np.cross(normal, across), normal])


def plane_mesh(
    plane: ShapeInfo, center: np.ndarray, half_size: float, cell: float, colours: tuple[tuple[int, ...], ...]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a chequered disc on a plane round the point below `center`, fading out at its rim.

    Parameters
    ----------
    center : ndarray
        [m], shape (3,).
    half_size, cell : float
        Radius of the disc and edge of a square [m]. The squares keep their places when the centre changes.
    colours : three of (red, green, blue)
        Of the two squares, and of the rim into which they fade.

    Returns
    -------
    vertices, colours, triangles : ndarray
        Shapes (v, 3), (v, 3) uint8, (t, 3).
    """
    across, along, _ = plane_axes(plane)
    point = np.array(plane.position)
    relative = center - point
    middle = np.array([relative @ across, relative @ along])
    first = np.floor((middle - half_size) / cell).astype(int)
    count = int(np.ceil(2 * half_size / cell)) + 1
    i, j = np.meshgrid(first[0] + np.arange(count), first[1] + np.arange(count), indexing="ij")
    inside = np.hypot((i + 0.5) * cell - middle[0], (j + 0.5) * cell - middle[1]) < half_size
    i, j = i[inside], j[inside]
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    at = (np.stack([i, j], axis=-1)[:, None] + corners) * cell
    vertices = point + at[..., :1] * across + at[..., 1:] * along
    distance = np.linalg.norm(at - middle, axis=-1, keepdims=True) / half_size
    fade = np.clip((distance - 0.35) / 0.65, 0.0, 1.0) ** 1.5
    light, dark, rim = (np.array(colour, float) for colour in colours)
    shades = (1 - fade) * np.where(((i + j) % 2 == 0)[:, None, None], light, dark) + fade * rim
    quads = 4 * np.arange(len(i))[:, None] + np.arange(4)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return (
        vertices.reshape(-1, 3).astype(np.float32),
        np.rint(shades).astype(np.uint8).reshape(-1, 3),
        triangles.astype(np.uint32),
    )
