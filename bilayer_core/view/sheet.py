"""Pictures put together: the part that shows the robot, times written on it, sheets, animations. Plain pillow."""

from __future__ import annotations

import math
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

from bilayer_core.record.paths import draft_of
from bilayer_core.view.layout import BACKGROUND

SHEET_WIDTH = 1120  # of a sheet, at most [pixels]
GIF_SIZE = 480  # longer side of an animation, at most [pixels]
SHEET_ASPECT = 2.0  # width over height of a sheet that is aimed at
GAP = 6  # between the pictures of a sheet [pixels]
MARGIN = 10  # of text [pixels]
TEXT_COLOUR = (225, 228, 232)
FOOTER_COLOUR = (150, 155, 163)
FOOTER_HEIGHT = 34
TEXT_SIZE, FOOTER_SIZE = 20, 16
GIF_LIMIT = 8.0  # longest time that an animation takes [s]; a longer run is played faster


def write_time(picture: Image.Image, time: float, decimals: int) -> Image.Image:
    """The picture with its time in a corner."""
    drawing = ImageDraw.Draw(picture)
    font = ImageFont.load_default(TEXT_SIZE)
    text = f"{time:.{decimals}f} s"
    drawing.text((MARGIN, MARGIN), text, TEXT_COLOUR, font, stroke_width=2, stroke_fill=BACKGROUND)
    return picture


def decimals_for(times: list[float]) -> int:
    """Decimals with which all times differ from one another, 1 to 4."""
    return next((n for n in range(1, 4) if len({f"{time:.{n}f}" for time in times}) == len(set(times))), 4)


def columns_for(count: int, width: int, height: int) -> int:
    """Columns of a sheet without an empty place whose shape is nearest to `SHEET_ASPECT`."""
    divisors = [columns for columns in range(1, count + 1) if count % columns == 0]
    return min(divisors, key=lambda c: abs(math.log(c * width / (count / c * height) / SHEET_ASPECT)))


def put_together(pictures: list[Image.Image], times: list[float], footer: str) -> Image.Image:
    """A sheet of equal pictures with their times, row by row, over a line of text."""
    width, height = pictures[0].size
    columns = columns_for(len(pictures), width, height)
    scale = min(1.0, (SHEET_WIDTH - GAP * (columns - 1)) / (columns * width))
    width, height = int(scale * width), int(scale * height)
    rows = len(pictures) // columns
    size = (columns * (width + GAP) - GAP, rows * (height + GAP) + FOOTER_HEIGHT)
    decimals = decimals_for(times)
    sheet = Image.new("RGB", size, BACKGROUND)
    for index, picture in enumerate(pictures):
        row, column = divmod(index, columns)
        small = picture.resize((width, height), Image.Resampling.LANCZOS)
        sheet.paste(write_time(small, times[index], decimals), (column * (width + GAP), row * (height + GAP)))
    font = ImageFont.load_default(FOOTER_SIZE)
    ImageDraw.Draw(sheet).text((MARGIN, size[1] - FOOTER_HEIGHT + 6), footer, FOOTER_COLOUR, font)
    return sheet


def save_png(picture: Image.Image, path: str | Path) -> None:
    """Write a picture; OutputError if it cannot be written."""
    _save(picture, path, optimize=True)


def save_gif(pictures: list[Image.Image], times: list[float], path: str | Path) -> None:
    """Write an animation at the speed of the run, or faster if that takes long."""
    scale = min(1.0, GIF_SIZE / max(pictures[0].size))
    size = tuple(round(scale * side) for side in pictures[0].size)
    decimals = decimals_for(times)
    small = [
        write_time(picture.resize(size, Image.Resampling.LANCZOS), time, decimals)
        for picture, time in zip(pictures, times, strict=True)
    ]
    lasting = min(times[-1] - times[0], GIF_LIMIT) / max(len(times) - 1, 1)
    _save(small[0], path, save_all=True, append_images=small[1:], duration=max(20, round(1e3 * lasting)), loop=0)


def _save(picture: Image.Image, path: str | Path, **options: object) -> None:
    with draft_of(path, force=True) as draft:
        picture.save(draft, **options)
