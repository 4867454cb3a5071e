"""Colour maps, the same in markers, in the viewer and in pictures.

Of strain and curvature: blue is shortened, light grey unstrained, red stretched; the map is linear in Oklab between
five colours whose lightness falls equally on both sides, so that equal differences look equally large. Of pressure:
from light grey over yellow and orange to dark red, ever darker.
"""

from __future__ import annotations

import numpy as np

ANCHORS = ("#1b3a8c", "#4f8fe0", "#eceae6", "#ee7b51", "#9c1030")
PRESSURE_ANCHORS = ("#dcdad6", "#f6c945", "#ee7b31", "#c2252c", "#5c0a2e")
STEPS = 257

# Ottosson, "A perceptual color space for image processing" (2020)
_TO_CONE = np.array(
    [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
)
_TO_LAB = np.array(
    [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
)


def _build_map(anchors: tuple[str, ...]) -> np.ndarray:
    """Return the colours as sRGBA from 0 to 1, shape (STEPS, 4), float32."""
    encoded = np.array([[int(text[i : i + 2], 16) / 255 for i in (1, 3, 5)] for text in anchors])
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    lab = np.cbrt(linear @ _TO_CONE.T) @ _TO_LAB.T
    at = np.linspace(0, len(anchors) - 1, STEPS)
    blend = np.stack([np.interp(at, np.arange(len(anchors)), channel) for channel in lab.T], axis=1)
    linear = ((blend @ np.linalg.inv(_TO_LAB).T) ** 3 @ np.linalg.inv(_TO_CONE).T).clip(0, 1)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.concatenate([encoded, np.ones((STEPS, 1))], axis=1).astype(np.float32)


STRAIN_MAP = _build_map(ANCHORS)
PRESSURE_MAP = _build_map(PRESSURE_ANCHORS)


def map_colours(values: np.ndarray, low: float, high: float, colours: np.ndarray) -> np.ndarray:
    """Return the colours of `values` from a map whose ends are those of `low` and `high`: sRGBA from 0 to 1, shape +
    (4,).
    """
    index = np.rint((values - low) * ((STEPS - 1) / (high - low)))
    return colours.take(np.minimum(np.maximum(index, 0.0), STEPS - 1.0).astype(np.intp), axis=0)


def strain_colours(strain: np.ndarray, limit: float) -> np.ndarray:
    """Return the colours of `strain`, full blue at -`limit` and full red at +`limit`: sRGBA from 0 to 1, float32, shape
    + (4,).
    """
    return map_colours(strain, -limit, limit, STRAIN_MAP)
