"""The verb ``render``."""

from __future__ import annotations

import re
from typing import Any

import click

from bilayer_core.cli.options import Duration, Verb
from bilayer_core.cli.terminal import say
from bilayer_core.errors import InputError

SHEET_PICTURES = 6
MOST_PICTURES = 400
"""In a sheet or an animation; films may have `MOST_OF_FILM`."""
MOST_OF_FILM = 20_000
FILM_RATE, GIF_RATE = 25.0, 20.0
"""Pictures a second."""
SHORTEST_FILM, LONGEST_FILM, LONGEST_GIF = 5.0, 20.0, 8.0
"""A run that takes less or more time is shown slower or faster, so that its film lasts so long [s]."""
LEAST_SIDE, MOST_SIDE = 160, 4096
SUFFIXES = {"--png": ".png", "--sheet": ".png", "--gif": ".gif", "--mp4": ".mp4"}


class Size(click.ParamType):
    """Width and height of a picture, such as 1280x720."""

    name = "size"

    def convert(self, value: Any, param: click.Parameter | None, context: click.Context | None) -> tuple[int, int]:
        """Return both in pixels."""
        if isinstance(value, tuple):
            return value
        found = re.fullmatch(r"\s*(\d{1,6})\s*[x×]\s*(\d{1,6})\s*", value)
        size = (int(found[1]), int(found[2])) if found else (0, 0)
        if not all(LEAST_SIDE <= side <= MOST_SIDE for side in size):
            allowed = f"width and height in pixels, each from {LEAST_SIDE} to {MOST_SIDE}, such as 1280x720"
            self.fail(f"found {value!r}; allowed are {allowed}", param, context)
        return size


@click.command(cls=Verb)
@click.argument("file", metavar="FILE.mcap|BAG")
@click.option("--png", metavar="OUT.png", help="One picture, of the end or of all --at.")
@click.option("--sheet", metavar="OUT.png", help=f"{SHEET_PICTURES} pictures in one, with their times.")
@click.option("--gif", metavar="OUT.gif|OUT.webp", help=f"An animation, {GIF_RATE:g} pictures a second.")
@click.option("--mp4", metavar="OUT.mp4", help="A film.")
@click.option("--at", "times", type=Duration(from_zero=True), multiple=True, help="Simulated time; may be repeated.")
@click.option(
    "--frames", type=click.IntRange(1, MOST_OF_FILM), metavar="N", help="How many pictures, evenly over the run."
)
@click.option(
    "--camera",
    metavar="CAMERA",
    default="auto",
    help="front, side, top (these without perspective), iso, follow, or 'azimuth,elevation[,distance]' of the eye in "
    "degrees and m; default: iso, and follow where the robot would else be small.",
)
@click.option("--size", type=Size(), metavar="WxH", help="In pixels; default: 1280x720 for films, else what suits.")
@click.option(
    "--background", metavar="COLOUR", default="dark", help="dark, white, transparent, or a colour such as '#f4f1e8'."
)
@click.option(
    "--colour",
    type=click.Choice(["strain", "curvature", "section", "contact"]),
    default="strain",
    help="Quantity that colours rods; section is the curvature across strips, contact the contact pressure.",
)
@click.option(
    "--fps", type=click.FloatRange(1.0, 100.0), metavar="N", help=f"Pictures a second of film; default {FILM_RATE:g}."
)
@click.option(
    "--speed",
    type=click.FloatRange(0.0, 1e6, min_open=True),
    metavar="X",
    help=f"Simulated seconds in a second of film; default: 1, and what lasts {SHORTEST_FILM:g} to {LONGEST_FILM:g} s.",
)
@click.option("--reactions", is_flag=True, help="Draw the forces and moments that rods exert on bodies.")
@click.option("--force", is_flag=True, help="Replace existing files.")
def render(
    file: str,
    png: str | None,
    sheet: str | None,
    gif: str | None,
    mp4: str | None,
    times: tuple[float, ...],
    frames: int | None,
    camera: str,
    size: tuple[int, int] | None,
    background: str,
    colour: str,
    fps: float | None,
    speed: float | None,
    reactions: bool,
    force: bool,
) -> None:
    """Draw a run without a screen: the robot alone, with a colour bar and a scale bar."""
    from bilayer_core.log.file.output_paths import check_output_path

    wanted = {"--png": png, "--sheet": sheet, "--gif": gif, "--mp4": mp4}
    outputs = [path for path in wanted.values() if path]
    if not outputs:
        raise InputError("say what to draw: --png OUT.png, --sheet OUT.png, --gif OUT.gif or --mp4 OUT.mp4")
    for option, path in wanted.items():
        if path:
            webp = option == "--gif" and path.lower().endswith(".webp")
            check_output_path(path, force, ".webp" if webp else SUFFIXES[option])
    if len(set(outputs)) < len(outputs):
        twice = next(path for path in outputs if outputs.count(path) > 1)
        raise InputError(f"{twice}: is named for two outputs; give each a file of its own")
    if times and frames is not None:
        raise InputError("--frames: says how many pictures, --at of which times; give one of the two")
    if png and frames is not None:
        raise InputError("--png: is one picture; give --at, or a sheet")
    if len(times) > MOST_PICTURES:
        raise InputError(f"--at: is given {len(times)} times; at most {MOST_PICTURES} are allowed")
    if (sheet or gif) and frames is not None and frames > MOST_PICTURES:
        raise InputError(f"--frames: {frames} is not in the range 1<=x<={MOST_PICTURES}; a film may have more")
    moving = gif or mp4
    if (fps or speed) and not moving:
        raise InputError(f"{'--fps' if fps else '--speed'}: is that of a film; give --mp4 or --gif as well")
    if speed and (times or frames):
        raise InputError("--speed: says how many pictures a run takes, as --frames and --at do; give one of them")
    if mp4 and size and any(side % 2 for side in size):
        raise InputError(f"--size: a film's width and height are even, found {size[0]}x{size[1]}")
    if mp4 and background == "transparent":
        raise InputError("--background: a film cannot be transparent; a picture, a sheet or an animation can")

    from bilayer_core.extras import require
    from bilayer_core.view.render import Look, Studio

    require("render", "vtkmodules", "PIL", *(["imageio_ffmpeg"] if mp4 else []))
    look = Look.of(camera, background, colour=colour, size=size, reactions=reactions)
    studio = Studio(file, look)
    if studio.warning is not None:
        say(f"warning: {studio.warning}", err=True)
    if png:
        studio.picture(png, *times)
        say(f"picture    {png}")
    if sheet:
        studio.sheet(sheet, times or studio.spread(frames or SHEET_PICTURES))
        say(f"sheet      {sheet}")
    kinds = (gif, "animation", GIF_RATE, LONGEST_GIF), (mp4, "film", FILM_RATE, LONGEST_FILM)
    for path, kind, rate, longest in kinds:
        if path:
            rate = fps or rate
            moments, note = _moments(studio, times, frames, rate, speed, longest)
            draw = studio.gif if kind == "animation" else studio.film
            draw(path, moments, rate, note)
            say(f"{kind:11}{path}: {len(moments)} pictures, {len(moments) / rate:.3g} s{note}")


def _moments(
    studio: Any, times: tuple[float, ...], frames: int | None, rate: float, speed: float | None, longest: float
) -> tuple[list[float], str]:
    """Return the times of a film's pictures [s] and a note about its speed."""
    span = studio.last - studio.first
    if times:
        return list(times), ""
    if frames is None:
        lasting = span / speed if speed else min(max(span, min(SHORTEST_FILM, longest)), longest)
        frames = max(2, round(lasting * rate)) if span > 0.0 else 1
        if frames > MOST_OF_FILM:
            raise InputError(f"--speed: {speed:g} takes {frames} pictures; at most {MOST_OF_FILM} are allowed")
    shown = span * rate / frames
    note = ""
    if span > 0.0 and abs(shown - 1.0) > 0.05:
        note = f", {shown:.3g}x faster" if shown > 1.0 else f", {1.0 / shown:.3g}x slower"
    return studio.spread(frames), note
