"""Cameras of pictures: from where they look, and how near, so that the robot fills them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.scene.units import parse_quantity
from bilayer_core.view.scales import VIEW_DIRECTION

AUTO, FOLLOW = "auto", "follow"
NAMED = {"front": (0.0, 0.0), "side": (90.0, 0.0), "top": (0.0, 90.0)}
"""Azimuth and elevation of the eye [deg]: in front it looks along y with x to the right, from the side along −x with y
to the right, from the top along −z with x to the right. These three have no perspective."""
HALF_SLOPE = math.tan(math.radians(15.0))
"""Of what is seen over and under the line of sight; a longer lens than a viewer's distorts less."""
WORTH_FOLLOWING = 1.5
"""A camera by itself follows a robot that would else be drawn so many times smaller."""
SMOOTHING = 0.5
"""Time of the film over which a camera that follows smooths its way, as a standard deviation [s]."""
ALLOWED = (
    "front, side, top, iso, follow, or azimuth and elevation of the eye in degrees, with the distance if it is "
    "given: '40,20' or '40,20,0.3 m'"
)


@dataclass(frozen=True)
class Camera:
    """From where a picture is taken."""

    azimuth: float
    elevation: float
    """`azimuth`, `elevation`: of the eye as seen from the robot [rad]; an azimuth of 0 is in front of it, at −y, of
    90° at +x.
    """
    kind: str = "fixed"
    """``"auto"``, ``"follow"`` or ``"fixed"``."""
    parallel: bool = False  # Whether it has no perspective
    distance: float | None = None  # Of the eye [m]; None as near as all is seen

    @property
    def axes(self) -> np.ndarray:
        """Unit vectors to the right, upwards and towards the eye, as rows."""
        sa, ca = math.sin(self.azimuth), math.cos(self.azimuth)
        se, ce = math.sin(self.elevation), math.cos(self.elevation)
        right, back = np.array([ca, sa, 0.0]), np.array([sa * ce, -ca * ce, se])
        return np.stack([right, np.cross(back, right), back])


@dataclass(frozen=True)
class Shot:
    """Where the eye is in one picture."""

    eye: np.ndarray
    target: np.ndarray
    up: np.ndarray
    """`eye`, `target`, `up`: [m], [m], unit, shape (3,)."""
    half_height: float | None  # Of what is seen without perspective [m]
    metres_per_height: float  # Height of the picture, in the plane across the line of sight through the target [m]


@dataclass(frozen=True)
class Insets:
    """Parts of a picture's height and width that are kept free of the robot, for what is written there."""

    top: float = 0.08
    bottom: float = 0.15
    side: float = 0.05


def parse_camera(text: str) -> Camera:
    """Return the camera that an option names.

    Raises InputError if the option names none; the message says what is allowed.
    """
    name = text.strip().lower()
    if name in (AUTO, FOLLOW, "iso"):
        return _iso("fixed" if name == "iso" else name)
    if name in NAMED:
        azimuth, elevation = map(math.radians, NAMED[name])
        return Camera(azimuth, elevation, parallel=True)
    parts = [part.strip() for part in text.split(",")]
    if len(parts) not in (2, 3):
        raise InputError(f"--camera: found {text!r}; allowed are {ALLOWED}")
    azimuth, elevation = (math.radians(_number(part, "deg", text)) for part in parts[:2])
    if abs(elevation) > math.pi / 2 + 1e-9:
        raise InputError(f"--camera: found {text!r}; an elevation is from -90 to 90 degrees")
    distance = _number(parts[2], "m", text) if len(parts) == 3 else None
    if distance is not None and distance <= 0.0:
        raise InputError(f"--camera: found {text!r}; a distance is above 0 m")
    return Camera(azimuth, elevation, distance=distance)


def _iso(kind: str) -> Camera:
    x, y, z = VIEW_DIRECTION
    return Camera(math.atan2(x, -y), math.atan2(z, math.hypot(x, y)), kind)


def _number(text: str, unit: str, whole: str) -> float:
    try:
        found = parse_quantity(text, unit)
    except ValueError:
        found = math.nan
    if not math.isfinite(found):
        raise InputError(f"--camera: found {whole!r}; allowed are {ALLOWED}")
    return found


def shots(
    camera: Camera, groups: list[np.ndarray], followed: list[np.ndarray], aspect: float, insets: Insets, rate: float
) -> list[Shot]:
    """Return where the eye is in each picture of a film, so that all is seen, as near as that allows.

    Parameters
    ----------
    camera : Camera
    groups : list of ndarray
        Points that each picture must hold [m], each of shape (points, 3).
    followed : list of ndarray
        The same of the robot alone: what a camera that follows holds.
    aspect : float
        Width over height.
    insets : Insets
    rate : float
        Pictures a second of film.
    """
    still = np.zeros((len(groups), 3))
    if camera.kind == "fixed":
        return _along(camera, still, groups, aspect, insets)
    moving = _smooth_way(followed, rate)
    near = _along(camera, moving, followed, aspect, insets)
    if camera.kind == FOLLOW:
        return near
    far = _along(camera, still, groups, aspect, insets)
    return near if is_worth_following(far[0].metres_per_height, near[0].metres_per_height) else far


def is_worth_following(far: float, near: float) -> bool:
    """Return whether a still camera is more than `WORTH_FOLLOWING` times as far away as one that follows the robot."""
    return far > WORTH_FOLLOWING * near


def _smooth_way(groups: list[np.ndarray], rate: float) -> np.ndarray:
    """Return the middle of the robot over time, smoothed [m], shape (pictures, 3)."""
    from scipy.ndimage import gaussian_filter1d

    middles = np.array([0.5 * (points.min(axis=0) + points.max(axis=0)) for points in groups])
    return gaussian_filter1d(middles, SMOOTHING * rate, axis=0, mode="nearest") if rate > 0.0 else middles


def _along(camera: Camera, way: np.ndarray, groups: list[np.ndarray], aspect: float, insets: Insets) -> list[Shot]:
    """Return the shots of an eye that goes along a way and sees all points from wherever it is."""
    axes = camera.axes
    points = np.concatenate([points - at for points, at in zip(groups, way, strict=True)]) @ axes.T
    x, y, z = points.T
    extent = max(float(np.ptp(points, axis=0).max()), 1e-9)
    wide, low, high = aspect * (1.0 - 2.0 * insets.side), -1.0 + 2.0 * insets.bottom, 1.0 - 2.0 * insets.top
    depth = 0.5 * (z.min() + z.max())
    if camera.parallel:
        half = max(np.ptp(x) / (2.0 * wide), np.ptp(y) / (high - low), 0.02 * extent)
        place = np.array([0.5 * (x.min() + x.max()), 0.5 * (y.min() + y.max()) - 0.5 * (low + high) * half, depth])
        distance = z.max() - depth + 2.0 * extent
        half_height = float(half)
    else:
        place, distance = _perspective(camera, points, wide, low, high, extent)
        half_height = None
    height = 2.0 * (half_height if half_height is not None else distance * HALF_SLOPE)
    eye = place + np.array([0.0, 0.0, distance])
    return [Shot(at + eye @ axes, at + place @ axes, axes[1], half_height, float(height)) for at in way]


def _perspective(
    camera: Camera, points: np.ndarray, wide: float, low: float, high: float, extent: float
) -> tuple[np.ndarray, float]:
    """Return the point that the eye looks at, in the axes of the picture, and its distance from the eye [m].

    A point (x, y, z) is seen at slopes (x − e_x)/(e_z − z) and (y − e_y)/(e_z − z) from an eye e. That the upper one is
    at most h asks for e_y + h e_z ≥ max(y + h z), and so on: the least e_z and the middle of what it leaves for e_x and
    e_y follow without iteration.
    """
    x, y, z = points.T
    wide, low, high = wide * HALF_SLOPE, low * HALF_SLOPE, high * HALF_SLOPE
    right, left = (x + wide * z).max(), (-x + wide * z).max()
    upper, lower = (y + high * z).max(), (-y - low * z).max()
    depth = 0.5 * (z.min() + z.max())
    height = max((right + left) / (2.0 * wide), (upper + lower) / (high - low), z.max() + 0.05 * extent)
    if camera.distance is not None:
        height = depth + camera.distance
    place = [0.5 * (right - left), 0.5 * (upper - high * height - low * height - lower)]
    return np.array([*place, depth]), float(height - depth)
