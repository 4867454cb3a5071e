"""Looks at pixels of pictures: what is drawn in which colours."""

import numpy as np
from PIL import Image

from bilayer_core.view.theme import BALL_COLOURS


def pixels(path):
    return np.asarray(Image.open(path).convert("RGB")).astype(int)


def is_red(image):
    r, g, b = np.moveaxis(image[..., :3], -1, 0)
    return (r > 110) & (r > 2 * g) & (r > 2 * b)


def is_ball(image):
    """The stronger of the ball's colours, in any light."""
    r, g, b = np.moveaxis(image[..., :3], -1, 0)
    red, green, blue = BALL_COLOURS[0]
    return (r > 80) & (np.abs(g - r * green / red) < 25) & (np.abs(b - r * blue / red) < 40)


def is_blue(image):
    r, g, b = np.moveaxis(image[..., :3], -1, 0)
    return (b > r + 40) & (b > g + 20)
