"""Pictures put together: sheets with their times, animations. Plain pillow."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from PIL import Image, ImageDraw

from bilayer_core.log.file.output_paths import draft_of
from bilayer_core.view.theme import Theme

if TYPE_CHECKING:
    from bilayer_core.view.overlay import Overlay

SHEET_WIDTH = 1120  # of a sheet, at most [pixels]
GIF_SIZE = 480  # longer side of an animation, at most [pixels]
SHEET_ASPECT = 2.0  # width over height of a sheet that is aimed at
GAP = 6  # between the pictures of a sheet [pixels]
FOOTER_HEIGHT = 72
WEBP_QUALITY = 76
TEXT = 16  # size of text in the footer and of times [pixels]


def decimals_for(times: list[float]) -> int:
    """Return the decimals with which all times differ from one another, 1 to 4."""
    return next((n for n in range(1, 4) if len({f"{time:.{n}f}" for time in times}) == len(set(times))), 4)


def columns_for(count: int, width: int, height: int) -> int:
    """Return the columns of a sheet without an empty place whose shape is nearest to `SHEET_ASPECT`."""
    divisors = [columns for columns in range(1, count + 1) if count % columns == 0]
    return min(divisors, key=lambda c: abs(math.log(c * width / (count / c * height) / SHEET_ASPECT)))


def layout_of(count: int, width: int, height: int) -> tuple[int, float]:
    """Return the columns of a sheet of so many pictures, and how much smaller they are on it."""
    columns = columns_for(count, width, height)
    return columns, min(1.0, (SHEET_WIDTH - GAP * (columns - 1)) / (columns * width))


def width_of(columns: int, scale: float, size: tuple[int, int]) -> int:
    """Return the width of a whole sheet [pixels]."""
    return columns * (int(scale * size[0]) + GAP) - GAP


def footer_size(width: int, notes: int) -> tuple[int, int]:
    """Return the size of what is below the pictures, with so many notes above its bars [pixels]."""
    return width, FOOTER_HEIGHT + round(1.4 * TEXT * notes)


def put_together(pictures: list[Image.Image], texts: list[str], footer: Overlay, theme: Theme) -> Image.Image:
    """Return a sheet of equal pictures with their times, row by row, over one line of bars."""
    from bilayer_core.view.overlay import font_of

    (width, height), mode = pictures[0].size, pictures[0].mode
    columns, scale = layout_of(len(pictures), width, height)
    whole, small = width_of(columns, scale, (width, height)), (int(scale * width), int(scale * height))
    rows = len(pictures) // columns
    blank = (*theme.background, 0) if theme.transparent else theme.background
    sheet = Image.new(mode, (whole, rows * (small[1] + GAP) + footer.size[1]), blank)
    drawing = ImageDraw.Draw(sheet)
    for index, picture in enumerate(pictures):
        row, column = divmod(index, columns)
        corner = (column * (small[0] + GAP), row * (small[1] + GAP))
        sheet.paste(picture.resize(small, Image.Resampling.LANCZOS), corner)
        at = corner[0] + TEXT // 2, corner[1] + TEXT // 2
        drawing.text(at, texts[index], theme.text, font_of(TEXT), stroke_width=2, stroke_fill=theme.halo)
    below = footer.write(Image.new(mode, footer.size, blank))
    sheet.paste(below, (0, sheet.height - footer.size[1]))
    return sheet


def save_png(picture: Image.Image, path: str | Path) -> None:
    """Write a picture; OutputError if it cannot be written."""
    _save(picture, path, optimize=True)


def save_gif(pictures: list[Image.Image], rate: float, path: str | Path) -> None:
    """Write an animation that begins anew when it ends, of so many pictures a second: at most 50, as fast as players
    show them. The name says whether as GIF or, a third of the size and with all colours, as WebP.
    """
    lasting = max(20, 10 * round(100 / rate))
    options = {"save_all": True, "append_images": pictures[1:], "duration": lasting, "loop": 0}
    if Path(path).suffix.lower() == ".webp":
        _save(pictures[0], path, **options, quality=WEBP_QUALITY, method=6)
        return
    if pictures[0].mode == "RGB":
        colours = pictures[len(pictures) // 2].quantize(255, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
        pictures = [picture.quantize(palette=colours, dither=Image.Dither.NONE) for picture in pictures]
    options["append_images"] = pictures[1:]
    _save(pictures[0], path, **options, optimize=False, disposal=2 if pictures[0].mode == "RGBA" else 1)


def _save(picture: Image.Image, path: str | Path, **options: object) -> None:
    with draft_of(path, force=True) as draft:
        picture.save(draft, **options)
