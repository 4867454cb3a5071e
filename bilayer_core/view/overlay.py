"""Annotations of pictures: the time, the colour bar with its unit, a scale bar, the meaning of arrows and squares."""

from __future__ import annotations

from functools import cache

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from bilayer_core.view.colouring import Colouring
from bilayer_core.view.theme import Theme

TEXT_SHARE, LEAST_TEXT = 1 / 38, 11  # size of text: in heights of the picture, and at least [pixels]
BAR_SHARE, BAR_TEXT = 0.26, 11.0  # width of the colour bar: of the picture's, and at least so many sizes of text
SCALE_SHARE = 0.16  # width that the scale bar is aimed at, of the picture's
_STEPS = (1.0, 2.0, 5.0)
_PREFIXES = ((1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "u"), (1e-9, "n"))
_LENGTHS = ((1e3, "km"), (1.0, "m"), (1e-3, "mm"), (1e-6, "um"), (1e-9, "nm"))


class Overlay:
    """Writes on pictures of one size.

    Parameters
    ----------
    size : tuple of int
        Width and height.
    theme : Theme
    colouring : Colouring
    metres_per_pixel : float
        Across the line of sight, where the camera looks.
    notes : list of str
        What arrows and squares mean: written between the bars, or at the upper left where there is no room.
    text_size : int, optional
        In pixels; by default a share of the height.
    """

    def __init__(
        self,
        size: tuple[int, int],
        theme: Theme,
        colouring: Colouring,
        metres_per_pixel: float,
        notes: list[str],
        text_size: int | None = None,
    ):
        self.size, self._theme = size, theme
        self._text = text_size or text_size_of(size[1])
        self._margin = self._text
        self._legend = Image.new("RGBA", size, (*theme.halo, 0))
        drawing = ImageDraw.Draw(self._legend)
        left = self._draw_colour_bar(drawing, colouring)
        right = self._draw_scale_bar(drawing, metres_per_pixel)
        self.aside = self._draw_notes(drawing, notes, left, right)  # Notes at the upper left
        self._box = self._legend.getbbox()
        self._legend = self._legend.crop(self._box)

    def write(self, picture: Image.Image, time: str = "") -> Image.Image:
        """Draw bars and time onto the picture, and return it."""
        if picture.mode == "RGBA":
            picture.alpha_composite(self._legend, self._box[:2])
        else:
            picture.paste(self._legend, self._box[:2], self._legend)
        drawing = ImageDraw.Draw(picture)
        for row, line in enumerate([time] * bool(time) + self.aside):
            self._put(drawing, (self._margin, self._margin + round(1.4 * row * self._text)), line, "lt")
        return picture

    def _put(self, drawing: ImageDraw.ImageDraw, at: tuple[float, float], text: str, anchor: str) -> None:
        halo = max(1, round(self._text / 9))
        font, theme = font_of(self._text), self._theme
        drawing.text(at, text, theme.text, font, anchor, stroke_width=halo, stroke_fill=theme.halo)

    def _draw_colour_bar(self, drawing: ImageDraw.ImageDraw, colouring: Colouring) -> int:
        """Draw the colour bar at the lower left, and return its right end [pixels]."""
        width, height = self._legend.size
        text, left = self._text, 2 * self._margin
        length = round(min(max(BAR_SHARE * width, BAR_TEXT * text), 0.5 * width))
        thick = max(6, round(0.6 * text))
        top = height - self._margin - round(1.25 * text) - thick
        colours = np.rint(255 * colouring.colour_map[:, :3]).astype(np.uint8)
        bar = Image.fromarray(colours[None]).resize((length, thick), Image.Resampling.BILINEAR)
        drawing.rectangle((left - 1, top - 1, left + length, top + thick), outline=(*self._theme.text, 255))
        self._legend.paste(bar, (left, top))
        self._put(drawing, (left, top - round(0.35 * text)), colouring.title, "ls")
        for place, label in colouring.ticks:
            at = left + place * (length - 1)
            self._put(drawing, (at, top + thick + round(0.2 * text)), label, "mt")
        return left + length + 2 * text

    def _draw_scale_bar(self, drawing: ImageDraw.ImageDraw, metres_per_pixel: float) -> int:
        """Draw the scale bar at the lower right, and return its left end [pixels]."""
        width, height = self._legend.size
        metres, label = round_length(SCALE_SHARE * width * metres_per_pixel)
        length, text = metres / metres_per_pixel, self._text
        right, thick = width - 2 * self._margin, max(3, round(0.22 * text))
        bottom = height - self._margin - round(1.25 * text)
        left = right - length
        drawing.rectangle((left - 1, bottom - thick - 1, right + 1, bottom + 1), fill=(*self._theme.halo, 255))
        drawing.rectangle((left, bottom - thick, right, bottom), fill=(*self._theme.text, 255))
        self._put(drawing, (0.5 * (left + right), bottom + round(0.2 * text)), label, "mt")
        return round(left - 2 * text)

    def _draw_notes(self, drawing: ImageDraw.ImageDraw, notes: list[str], left: int, right: int) -> list[str]:
        """Write what has room between the bars, and return what has none."""
        font = font_of(self._text)
        if any(font.getlength(note) >= right - left for note in notes):
            return notes
        for row, note in enumerate(reversed(notes)):
            at = 0.5 * (left + right), self._legend.size[1] - self._margin - round(1.4 * row * self._text)
            self._put(drawing, at, note, "ms")
        return []


def text_size_of(height: int) -> int:
    """Return the size of text in a picture of a height [pixels]."""
    return int(max(TEXT_SHARE * height, LEAST_TEXT))


def round_length(metres: float) -> tuple[float, str]:
    """Return the greatest of 1, 2, 5, 10, … that is no longer, with its unit: ``(0.02, "20 mm")``."""
    power = 10.0 ** np.floor(np.log10(metres))
    length = power * max(step for step in _STEPS if step * power <= metres * (1 + 1e-9))
    scale, unit = next((of for of in _LENGTHS if length >= of[0] * (1 - 1e-9)), _LENGTHS[-1])
    return float(length), f"{length / scale:.6g} {unit}"


def with_prefix(value: float, unit: str) -> str:
    """Return a value with its unit, from 1 to 1000 of it where there is a prefix: ``60 mN``."""
    scale, prefix = next((of for of in _PREFIXES if value >= of[0] * (1 - 1e-9)), _PREFIXES[-1])
    return f"{value / scale:.3g} {prefix}{unit}"


@cache
def font_of(size: int) -> ImageFont.FreeTypeFont:
    """Return Pillow's own font, which has the characters of ASCII and few more."""
    return ImageFont.load_default(size)
