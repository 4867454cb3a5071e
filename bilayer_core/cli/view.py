"""The verb ``view``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from bilayer_core.cli.options import Duration, Verb
from bilayer_core.cli.terminal import say
from bilayer_core.errors import InputError

NODE = "/bilayer_sim"
FOLLOWING = ("node", "bind", "port", "serve")
"""Options of a run that goes on."""


@click.command(cls=Verb, old_spellings={"--time": "--at"})
@click.argument("file", metavar="[FILE.mcap|BAG|FILE.rrd]", required=False)
@click.option("--follow", is_flag=True, help="Show a run as it goes on: of a node, or of a log that is being written.")
@click.option("--node", metavar="NAME", help=f"Node to follow; default: {NODE}.")
@click.option("--serve", is_flag=True, help="With --follow: open no window, say only where viewers may connect.")
@click.option("--bind", metavar="ADDRESS", help="With --follow: listen there; default: 127.0.0.1, this machine alone.")
@click.option(
    "--port", type=click.IntRange(1, 65535), help="With --follow: for viewers; default: the first free one from 9876."
)
@click.option("--web", is_flag=True, help="In a browser.")
@click.option("--save", metavar="FILE.rrd", help="Write a rerun recording; with --follow, as well.")
@click.option("--screenshot", "picture", metavar="FILE.png", help="Write a picture, without a screen.")
@click.option("--at", "moment", type=Duration(from_zero=True), help="Time of the picture; default: the end.")
@click.option(
    "--colour",
    type=click.Choice(["strain", "curvature", "section", "contact"]),
    help="What the colours of rods say: axial strain (default), curvature, that across strips (section), or the "
    "pressure of contact.",
)
@click.option("--force", is_flag=True, help="Replace existing files.")
def view(file: str | None, follow: bool, **options: Any) -> None:
    """Show a run in rerun; with --follow one that goes on."""
    from bilayer_core.log.file.output_paths import check_output_path
    from bilayer_core.view.colouring import STRAIN

    picture, save, colour = options["picture"], options["save"], options["colour"]
    if options["moment"] is not None and picture is None:
        raise InputError("--at: is the time of a picture; give --screenshot FILE.png as well")
    if not follow:
        for name in FOLLOWING:
            if options[name]:
                raise InputError(f"--{name}: is for a run that goes on; give --follow as well")
        if file is None:
            raise InputError("say what to show: FILE.mcap, FILE.rrd, or --follow for a node that runs")
    if file and file.endswith(".rrd"):
        if follow:
            raise InputError(f"--follow: {file} is a rerun recording; what can be followed is a log, or a node")
        if colour:
            raise InputError(
                f"--colour: {file} is a rerun recording, whose colours are made already; give the log instead"
            )
        if save:
            raise InputError(f"--save: {file} is a rerun recording already")
    for path, suffix in ((save, ".rrd"), (picture, ".png")):
        if path:
            check_output_path(path, options["force"], suffix)
    if follow:
        if picture:
            raise InputError("--screenshot: is of a run that is over; leave out --follow")
        if file and options["node"]:
            raise InputError(f"--node: is followed without a log; leave out {file}")
        _follow(file, options)
        return
    colour = colour or STRAIN
    from bilayer_core.view.rerun_view import convert_log, open_browser, open_viewer, screenshot

    if save:
        convert_log(file, save, colour)
        say(f"recording  {save}")
    if picture:
        screenshot(save or file, picture, options["moment"], colour)
        say(f"picture    {picture}")
    if save or picture:
        return
    if options["web"]:
        open_browser(file, say, colour)
    else:
        open_viewer(file, colour)


def _follow(file: str | None, options: dict[str, Any]) -> None:
    """Follow a log here, or a node as a node that takes this process over."""
    if file is None:
        from bilayer_core.cli.nodes import become_follower

        given = {f"--{name}": options[name] for name in ("bind", "port", "save", "colour")}
        become_follower(options["node"] or NODE, given, {f"--{name}": options[name] for name in ("serve", "web")})
    from bilayer_core.view.follow import Serving, follow_log

    serving = Serving(
        bind=options["bind"] or Serving.bind,
        port=options["port"],
        window=not options["serve"],
        web=options["web"],
        save=Path(options["save"]) if options["save"] else None,
        colour=options["colour"] or Serving.colour,
    )
    follow_log(file, serving, say)
