"""The diverging colour map of strain, the same in markers and in the viewer.

Blue is shortened, light grey unstrained, red stretched. The map is linear in Oklab between five colours whose
lightness falls equally on both sides, so that equal differences of strain look equally large.
"""

from __future__ import annotations

import numpy as np

ANCHORS = ("#1b3a8c", "#4f8fe0", "#eceae6", "#ee7b51", "#9c1030")
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


def _build_map() -> np.ndarray:
    """The colours as sRGBA from 0 to 1, shape (STEPS, 4), float32."""
    encoded = np.array([[int(text[i : i + 2], 16) / 255 for i in (1, 3, 5)] for text in ANCHORS])
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    lab = np.cbrt(linear @ _TO_CONE.T) @ _TO_LAB.T
    at = np.linspace(0, len(ANCHORS) - 1, STEPS)
    blend = np.stack([np.interp(at, np.arange(len(ANCHORS)), channel) for channel in lab.T], axis=1)
    linear = ((blend @ np.linalg.inv(_TO_LAB).T) ** 3 @ np.linalg.inv(_TO_CONE).T).clip(0, 1)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.concatenate([encoded, np.ones((STEPS, 1))], axis=1).astype(np.float32)


STRAIN_MAP = _build_map()


def strain_colours(strain: np.ndarray, limit: float) -> np.ndarray:
    """Colours of `strain`, full blue at -`limit` and full red at +`limit`: sRGBA from 0 to 1, float32, shape + (4,)."""
    index = np.rint((strain / limit + 1) * ((STEPS - 1) / 2))
    return STRAIN_MAP[np.clip(index, 0, STEPS - 1).astype(np.intp)]
