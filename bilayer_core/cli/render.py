"""The verb ``render``."""

from __future__ import annotations

import click

from bilayer_core.cli.options import Duration, Verb

SHEET_PICTURES = 6
GIF_PICTURES = 40
MOST_PICTURES = 400
"""In an animation or a sheet: an animation of 8 s has no more at 50 pictures a second, as fast as players show them."""


@click.command(cls=Verb)
@click.argument("file", metavar="FILE.mcap")
@click.option("--png", metavar="OUT.png", help="One picture, of the end or of --at.")
@click.option("--sheet", metavar="OUT.png", help=f"{SHEET_PICTURES} pictures in one, with their times.")
@click.option("--gif", metavar="OUT.gif", help=f"A moving picture; {GIF_PICTURES} pictures take about a minute.")
@click.option("--at", "times", type=Duration(from_zero=True), multiple=True, help="Simulated time; may be repeated.")
@click.option("--frames", type=click.IntRange(1, MOST_PICTURES), metavar="N", help="How many, evenly over the run.")
@click.option("--reactions", is_flag=True, help="Draw the forces and moments that rods exert on bodies.")
@click.option("--force", is_flag=True, help="Replace existing files.")
def render(
    file: str,
    png: str | None,
    sheet: str | None,
    gif: str | None,
    times: tuple[float, ...],
    frames: int | None,
    reactions: bool,
    force: bool,
) -> None:
    """Draw a run without a screen: the robot alone, as large as its motion allows."""
    from bilayer_core.errors import InputError
    from bilayer_core.record.paths import check_output_path
    from bilayer_core.view.render import Studio

    wanted = {"--png": png, "--sheet": sheet, "--gif": gif}
    if not any(wanted.values()):
        raise InputError("say what to draw: --png OUT.png, --sheet OUT.png or --gif OUT.gif")
    for option, path in wanted.items():
        if path:
            check_output_path(path, force, ".gif" if option == "--gif" else ".png")
    if png and sheet and png == sheet:
        raise InputError(f"{png}: is named for two outputs; give each a file of its own")
    if times and frames is not None:
        raise InputError("--frames: says how many pictures, --at of which times; give one of the two")
    if png and (len(times) > 1 or frames is not None):
        raise InputError("--png: is one picture; give one --at, or a sheet")
    if len(times) > MOST_PICTURES:
        raise InputError(f"--at: is given {len(times)} times; at most {MOST_PICTURES} are allowed")
    with Studio(file, reactions) as studio:
        if png:
            studio.picture(png, times[0] if times else None)
            click.echo(f"picture    {png}")
        if sheet:
            studio.sheet(sheet, times or studio.spread(frames or SHEET_PICTURES))
            click.echo(f"sheet      {sheet}")
        if gif:
            studio.gif(gif, times or studio.spread(frames or GIF_PICTURES))
            click.echo(f"animation  {gif}")
