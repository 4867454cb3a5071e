"""Surfaces to draw: ribbons of a run, a ball whose rotation is seen, the ground. Plain numpy."""

from __future__ import annotations

import numpy as np

from bilayer_core.integrate.frame import PlaneInfo, Strand

# Corners of a cross-section along (m1, m2), in half thicknesses and half widths. Every corner is there twice, once
# for the wide face and once for the narrow one, so that narrow faces can be darker and edges stay sharp.
_CORNERS = np.array([[1, -1], [1, 1], [-1, -1], [-1, 1], [1, -1], [-1, -1], [1, 1], [-1, 1]], float)
_FACES = ((0, 1), (3, 2), (5, 4), (6, 7))  # pairs of corners joined along the ribbon
WIDE_CORNERS = 4  # the first corners belong to the wide faces
CORNERS = len(_CORNERS)


def rotated(quaternions: np.ndarray, axis: int) -> np.ndarray:
    """Column `axis` of the rotation matrices of unit quaternions x y z w, shape (..., 3)."""
    x, y, z, w = np.moveaxis(quaternions, -1, 0)
    columns = (
        (1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)),
        (2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)),
        (2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)),
    )
    return np.stack(columns[axis], axis=-1)


def ribbon_vertices(strand: Strand, positions: np.ndarray, material_frames: np.ndarray) -> np.ndarray:
    """Corners of the cross-sections of a ribbon over time.

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
    thickness = 0.5 * strand.thickness[:, None] * rotated(material_frames, 0)
    width = 0.5 * strand.width[:, None] * rotated(material_frames, 1)
    corners = np.einsum("c,tni->tnci", _CORNERS[:, 0], thickness) + np.einsum("c,tni->tnci", _CORNERS[:, 1], width)
    return (positions[:, :, None] + corners).astype(np.float32)


def ribbon_triangles(nodes: int) -> np.ndarray:
    """Vertex indices of the surface of a ribbon with its ends closed, for vertices as above, shape (triangles, 3)."""
    first = CORNERS * np.arange(nodes - 1)[:, None, None]
    quads = np.array([[a, b, b + CORNERS, a + CORNERS] for a, b in _FACES])
    last = CORNERS * (nodes - 1)
    ends = np.array([[4, 5, 7, 6], [last + 4, last + 6, last + 7, last + 5]])
    corners = np.concatenate([(first + quads).reshape(-1, 4), ends])
    return np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]]).astype(np.uint32)


def ball_mesh(
    radius: float, colours: tuple[tuple[int, int, int], tuple[int, int, int]], segments: int = 8, steps: int = 6
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A sphere about the origin whose segments, like a beach ball's, alternate between two colours.

    Parameters
    ----------
    segments, steps : int
        Segments round the axis z, and vertices across each of them.

    Returns
    -------
    vertices, normals, colours, triangles : ndarray
        Shapes (v, 3), (v, 3), (v, 3) uint8, (t, 3).
    """
    rows = 4 * steps
    polar = np.linspace(0.0, np.pi, rows + 1)[:, None]
    vertices, shades, triangles = [], [], []
    corner = np.arange(rows)[:, None] * (steps + 1) + np.arange(steps)
    quad = np.stack([corner, corner + steps + 1, corner + steps + 2, corner + 1], axis=-1).reshape(-1, 4)
    for segment in range(segments):
        turn = 2 * np.pi * (segment + np.linspace(0.0, 1.0, steps + 1)) / segments
        unit = np.stack(
            np.broadcast_arrays(np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)), axis=-1
        ).reshape(-1, 3)
        quads = quad + len(unit) * segment
        triangles += [quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]
        vertices.append(unit)
        shades.append(np.tile(np.array(colours[segment % 2], np.uint8), (len(unit), 1)))
    normals = np.concatenate(vertices).astype(np.float32)
    return normals * np.float32(radius), normals, np.concatenate(shades), np.concatenate(triangles).astype(np.uint32)


def plane_mesh(
    plane: PlaneInfo, center: np.ndarray, half_size: float, cell: float, colours: tuple[tuple[int, ...], ...]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A chequered disc on a plane round the point below `center`, fading out at its rim.

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
    normal = plane.normal / np.linalg.norm(plane.normal)
    across = np.cross([0.0, 1.0, 0.0] if abs(normal[1]) < 0.9 else [1.0, 0.0, 0.0], normal)
    across /= np.linalg.norm(across)
    along = np.cross(normal, across)
    relative = center - plane.point
    middle = np.array([relative @ across, relative @ along])
    first = np.floor((middle - half_size) / cell).astype(int)
    count = int(np.ceil(2 * half_size / cell)) + 1
    i, j = np.meshgrid(first[0] + np.arange(count), first[1] + np.arange(count), indexing="ij")
    inside = np.hypot((i + 0.5) * cell - middle[0], (j + 0.5) * cell - middle[1]) < half_size
    i, j = i[inside], j[inside]
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    at = (np.stack([i, j], axis=-1)[:, None] + corners) * cell
    vertices = plane.point + at[..., :1] * across + at[..., 1:] * along
    distance = np.linalg.norm(at - middle, axis=-1, keepdims=True) / half_size
    fade = np.clip((distance - 0.35) / 0.65, 0.0, 1.0) ** 1.5
    light, dark, rim = (np.array(colour, float) for colour in colours)
    own = np.where(((i + j) % 2 == 0)[:, None, None], light, dark)
    shades = (1 - fade) * own + fade * rim
    quads = 4 * np.arange(len(i))[:, None] + np.arange(4)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return (
        vertices.reshape(-1, 3).astype(np.float32),
        np.rint(shades).astype(np.uint8).reshape(-1, 3),
        triangles.astype(np.uint32),
    )
